"""A drawn loop seen from the hand's port: a map per kind of tick, and its frame under a force of one frequency."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from wavesweep.analysis.response.ticks import long_sum, ordered_product
from wavesweep.diagram.drawn import Drawn
from wavesweep.errors import UsageError
from wavesweep.lifted.periodic import in_a_row, known_frames, then, ticks_of
from wavesweep.lifted.rounding import ENTRIES, both, measured_frame
from wavesweep.lifted.tick_drift import TickDrift, counted_from_leads
from wavesweep.spec.drawing import OF_PLANT

STILL = 1e-9  # of the terms of a shift, what is rounding


class NoPositionError(UsageError):
    """The displacement at a port is none that could be counted from tick to tick."""


@dataclass(frozen=True, slots=True)
class Ports:
    """The hand's port of a drawn loop: the input `force` (N), and the signals of its position (m) and of the force against it.

    reaction: empty if none is known; then the impedance is that of the whole port, force over position.
    """

    force: str
    position: str
    reaction: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """A drawn loop seen from its port, a map per kind of tick, every position counted from those that drift.

    Each map goes from the force to the displacement in the tick and the force against it. If the latter moves with a drift, the
    change of that share of it in the tick is a third output. E `(..., n, n)` less identity, B `(..., n, 1)`, C
    `(..., outputs, n)`, D `(..., outputs, 1)`. sizes: for each map, those of the terms of its entries' sums. position: its row
    `(..., 1, n)`, None if it drifts. laws: number of combinations of the states that nothing in the loop changes. slowest:
    ticks between two runs of the slowest block. rate: ticks per second (Hz) as given; 1/period may differ in its last bit.
    """

    maps: tuple[tuple[np.ndarray, ...], ...]
    sizes: tuple[tuple[np.ndarray, ...], ...]
    kind: np.ndarray
    period: float
    position: np.ndarray | None = None
    laws: int = 0
    slowest: int = 1
    rate: float = 0.0

    @property
    def rough(self) -> float:
        """Relative error of sums over a frame."""
        return long_sum(self.kind.size)

    def turned(self, first: int) -> "Port":
        """Return the port with a frame that begins with the tick `first`."""
        return replace(self, kind=np.roll(self.kind, -first))


def port_of(drawn: Drawn, ports: Ports, drift: TickDrift) -> Port:
    """Return the loop as it is seen from its port.

    The displacement of a tick is the difference of two positions, so the position has to be a state alone: that of a plant.
    Errors: NoPositionError if it is not.
    """
    signals = (ports.position, *((ports.reaction,) if ports.reaction else ()))
    ticks = ticks_of(drawn, signals, terms=True)
    if not drift.folded:  # what nothing but a drift reads drifts itself
        drift = replace(drift, moved=(*drift.moved, *((state, ()) for state in drift.unread)))
    reads = ticks.maps[0].C[..., :1, :]
    if any(np.any(each.D[..., 0, :]) or np.any(each.C[..., :1, :] != reads) for each in ticks.maps):
        raise NoPositionError(f"[ports] hand: expected {OF_PLANT}, found {ports.position}")
    force = drawn.inputs.index(ports.force)
    answers = ticks.maps[0].C[..., 1:2, :]
    moved = [(lead, _along(answers, lead, others)[0]) for lead, others in drift.moved if _moves(answers, lead, others)]
    parts = [(each.E, each.B, each.C, each.D) for each in ticks.maps]
    maps = tuple(_seen(each, reads, force, drift, bool(ports.reaction), moved) for each in parts)
    moved = [(lead, np.abs(share)) for lead, share in moved]
    sizes = [_seen(each.terms, np.abs(reads), force, drift, bool(ports.reaction), moved, 1) for each in ticks.maps]
    kept = _kept(drift)
    still = not any(_moves(reads, lead, others) for lead, others in drift.moved)
    period = float(np.ravel(drawn.period)[0])
    rate = 1 / period if drawn.rate is None else float(np.ravel(drawn.rate)[0])
    slowest = max(each.every for each in drawn.placed)
    return Port(maps, tuple(sizes), ticks.kind, period, reads[..., kept] if still else None, len(drift.folded), slowest, rate)


def _along(reads, lead, others):
    """Return by how much a shift moves the signals that are read, and the sizes of the terms of that sum.

    The shift moves the lead by 1, and others by their factors.
    """
    terms = np.stack([reads[..., lead], *(factor * reads[..., state] for state, factor in others)], -1)
    return terms.sum(-1), np.abs(terms).sum(-1)


def _moves(reads, lead, others):
    moved, size = _along(reads, lead, others)
    return bool((np.abs(moved) > STILL * size).any())


def _seen(parts, reads, force, drift, reacts, moved, sign=-1):
    """Return the maps of a tick from its E, B, C and D, or their sizes from those of these.

    moved: drifts that move the force against the hand, as pairs of a lead and the force for a shift of 1. sign: 1 for sizes.

    A state that drifts is counted from the lead. The lead itself is the sum of its changes, which depend on the other states.
    """
    E, B, C, D = parts
    B = B[..., force : force + 1]
    rows = [(reads @ E, reads @ B)]
    if reacts:
        rows.append((C[..., 1:2, :], D[..., 1:2, force : force + 1]))
    if moved:
        change = [
            (share[..., None] * E[..., lead : lead + 1, :], share[..., None] * B[..., lead : lead + 1, :])
            for lead, share in moved
        ]
        rows.append(tuple(sum(part) for part in zip(*change, strict=True)))
    E, B = counted_from_leads((E, B), drift, sign)
    kept = _kept(drift)
    C, D = (
        np.concatenate(np.broadcast_arrays(*part) if part[0].ndim > 2 else part, axis=-2) for part in zip(*rows, strict=True)
    )
    # Contiguous, since the order of sums follows the memory, and with it the bits of a loop the batch that it is in.
    return tuple(map(np.ascontiguousarray, (E[..., kept, :][..., kept], B[..., kept, :], C[..., kept], D)))


def _kept(drift):
    leads = {lead for lead, _ in drift.moved}
    return [index for index in range(len(drift.states)) if index not in leads]


def frame_of_port(port: Port) -> np.ndarray:
    """Return the frame-to-frame matrix less identity of a port's loop; NaN if rounding leaves nothing of it."""
    E, growth, _ = measured_frame(port.kind, [each[0] for each in port.maps])
    return known_frames(E, growth)


@dataclass(frozen=True, slots=True)
class Driven:
    """Ticks in a row under the force z^k, at all frequencies: `X -> (I + E) X + g`; the outputs times z^-k sum up to `G X + h`.

    turn: z to the number of ticks. dE: bound on the error of E. g_size, G_size, h_size: sizes of the terms of g, G and h.
    """

    E: np.ndarray
    dE: np.ndarray
    g: np.ndarray
    g_size: np.ndarray
    G: np.ndarray
    G_size: np.ndarray
    h: np.ndarray
    h_size: np.ndarray
    turn: np.ndarray


def driven(port: Port, z) -> Driven:
    """Return the whole frame from its ticks; repeated stretches are computed once."""
    one = np.ones((z.size, 1))
    ticks = []
    for (E, *parts), (dE, *sizes) in zip(port.maps, port.sizes, strict=True):
        each = ((one * B[..., 0], one[..., None] * C, one * D[..., 0]) for B, C, D in (parts, sizes))
        ticks.append(Driven(E, ENTRIES * dE, *(part for pair in zip(*each, strict=True) for part in pair), z))
    return in_a_row(port.kind.tolist(), ticks, partial(_joined, port.rough))


def _joined(rough, first, second):
    """Join two stretches of ticks; force and weights at the start of the second are turned by the ticks of the first."""
    turn = first.turn[:, None]
    moved, seen = ordered_product(second.E, first.g), second.G @ first.g[..., None]
    later = (second.G + second.G @ first.E) / turn[..., None]
    g, h = first.g + moved + turn * second.g, first.h + seen[..., 0] / turn + second.h
    return Driven(
        then(first.E, second.E),
        both((first.E, first.dE), (second.E, second.dE))[1],
        g,
        _g_size(first, second, rough),
        first.G + later,
        _G_size(first, second, rough),
        h,
        _h_size(first, second),
        first.turn * second.turn,
    )


# Bounds on rounding over `Port.rough`, the smaller one of two: that of all terms of a sum, or what its parts have already,
# passed on, and that of the terms of this sum. Ticks that contract forget rounding, which the first way never does.


def _g_size(first, second, rough):
    E, g = np.abs(second.E), np.abs(first.g)
    terms = first.g_size + ordered_product(E, first.g_size) + second.g_size
    passed = ordered_product(np.abs(np.eye(E.shape[-1]) + second.E), first.g_size) + second.g_size
    return np.minimum(terms, passed + g + ordered_product(E + second.dE / rough, g) + np.abs(second.g))


def _G_size(first, second, rough):
    E, G = np.abs(first.E), np.abs(second.G)
    terms = first.G_size + second.G_size + second.G_size @ E
    passed = first.G_size + second.G_size @ np.abs(np.eye(E.shape[-1]) + first.E)
    return np.minimum(terms, passed + np.abs(first.G) + G + G @ (E + first.dE / rough))


def _h_size(first, second):
    g, G = np.abs(first.g)[..., None], np.abs(second.G)
    terms = first.h_size + (second.G_size @ first.g_size[..., None])[..., 0] + second.h_size
    passed = first.h_size + (G @ first.g_size[..., None] + second.G_size @ g)[..., 0] + second.h_size
    return np.minimum(terms, passed + np.abs(first.h) + (G @ g)[..., 0] + np.abs(second.h))
