"""Responses of drawn loops at the hand's port: admittance, and the impedance of what answers the hand."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.analysis.response.bordered import solved
from wavesweep.analysis.response.steady import Response
from wavesweep.analysis.response.ticks import ENTRIES, both, long_sum
from wavesweep.diagram.drawn import Drawn
from wavesweep.errors import UsageError
from wavesweep.lifted.circle import on_circle
from wavesweep.lifted.periodic import Drift, in_a_row, then, ticks_of

POINTS = 256  # frequencies at a time
STILL = 1e-9  # of the terms of a shift, what is rounding
LOST = 0.1  # relative error from which on a number has no digit


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

    From the force to the displacement in the tick and the force against it. E `(..., n, n)` less identity, B `(..., n, 1)`, C
    `(..., 2, n)`, D `(..., 2, 1)`. position: its row `(..., 1, n)`, None if it drifts: a constant force moves it without end.
    condition: by how much closing algebraic loops may have multiplied the rounding of the entries (see `Block`).
    """

    maps: tuple[tuple[np.ndarray, ...], ...]
    kind: np.ndarray
    period: float
    position: np.ndarray | None = None
    condition: float = 1.0

    @property
    def rough(self) -> float:
        """Relative error of sums over a frame, of entries that algebraic loops may have made rough."""
        return long_sum(self.kind.size) * self.condition

    def turned(self, first: int) -> "Port":
        """The same with a frame that begins with another tick."""
        return replace(self, kind=np.roll(self.kind, -first))

    def at_rest(self) -> "Port":
        """The same with the position in place of the displacement in the tick."""
        still = [
            (
                E,
                B,
                np.concatenate([self.position, C[..., 1:, :]], axis=-2),
                np.concatenate([0 * D[..., :1, :], D[..., 1:, :]], axis=-2),
            )
            for E, B, C, D in self.maps
        ]
        return replace(self, maps=tuple(still))


def port_of(drawn: Drawn, ports: Ports, drift: Drift) -> Port:
    """See the loop from its port.

    The displacement of a tick is the difference of two positions, so the position has to be a state alone: that of a plant.
    Errors: UsageError if it is not.
    """
    signals = (ports.position, *((ports.reaction,) if ports.reaction else ()))
    ticks = ticks_of(drawn, signals)
    reads = ticks.maps[0].C[..., :1, :]
    if any(np.any(each.D[..., 0, :]) or np.any(each.C[..., :1, :] != reads) for each in ticks.maps):
        raise UsageError(
            f"[ports] hand: expected a position that a plant has in every tick, such as a mass's x, found {ports.position}"
        )
    force = drawn.inputs.index(ports.force)
    maps = tuple(_seen(each, reads, force, drift, bool(ports.reaction)) for each in ticks.maps)
    kept = _kept(drift)
    still = not any(_moves(reads, lead, others) for lead, others in drift.moved)
    condition = max(float(np.max(each.condition)) for each in ticks.maps)
    return Port(maps, ticks.kind, float(np.ravel(drawn.period)[0]), reads[..., kept] if still else None, condition)


def _moves(reads, lead, others):
    """Whether a shift moves what is read: the lead by 1, others by their factors."""
    terms = np.stack([reads[..., lead], *(factor * reads[..., state] for state, factor in others)], -1)
    return bool((np.abs(terms.sum(-1)) > STILL * np.abs(terms).sum(-1)).any())


def _seen(block, reads, force, drift, reacts):
    E, B = block.E.copy(), block.B[..., force : force + 1].copy()
    C, D = (reads @ E, reads @ B)
    rows = [(C, D)] + ([(block.C[..., 1:2, :], block.D[..., 1:2, force : force + 1])] if reacts else [])
    for lead, others in drift.moved:
        for index, factor in others:
            E[..., index, :] -= factor * E[..., lead, :]
            B[..., index, :] -= factor * B[..., lead, :]
    kept = _kept(drift)
    C, D = (
        np.concatenate(np.broadcast_arrays(*part) if part[0].ndim > 2 else part, axis=-2) for part in zip(*rows, strict=True)
    )
    return E[..., kept, :][..., kept], B[..., kept, :], C[..., kept], D


def _kept(drift):
    leads = {lead for lead, _ in drift.moved}
    return [index for index in range(len(drift.states)) if index not in leads]


def respond_port(port: Port, frequency_hz) -> Response:
    """Admittance (m/N) and impedance (N/m) of the port, `(points,)`, with estimates of their relative errors.

    With the force z^k in tick k, the state at the start of a frame solves `(z^M - Phi) X = g`; Phi is the frame and g the trace
    of the force in it. The answer is the displacement's component at the force's own frequency, over z - 1. The frame is begun
    at two different ticks, and the error is the difference of the two answers and the bound of the solution.
    Accuracy: as each number says; near multiples of the frame's rate, drifts other than a shift of positions cost digits.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    found = [np.empty(frequency.size, kind) for kind in (complex, complex, float, float)]
    for still in (False, True):
        chosen = np.flatnonzero((frequency == 0) == still)
        for at in (chosen[start : start + POINTS] for start in range(0, chosen.size, POINTS)):
            for part, values in zip(found, _both(port, frequency[at], still), strict=True):
                part[at] = values
    return Response(*found)


def _both(port, frequency, still):
    """still: at 0 Hz, where the displacement in a tick says nothing of the position."""
    if still and port.position is None:
        nothing = np.full(frequency.size, np.nan)
        return nothing, nothing, nothing, nothing
    port = port.at_rest() if still else port
    with np.errstate(all="ignore"):
        (one, error), (two, _) = (_once(each, frequency) for each in (port, port.turned(max(1, port.kind.size // 2))))
        error = error + np.abs(one - two)
        w = 1.0 if still else on_circle(2 * np.pi * frequency * port.period)
        relative = np.where(error == 0, 0.0, error / np.abs(one)) + 4 * np.finfo(float).eps
        relative = np.where(relative < LOST, relative, np.nan)
        admittance = np.where(np.isnan(relative[0]), np.nan, one[0] / w)
        if len(one) == 1:
            return admittance, 1 / admittance, relative[0], relative[0]
        return admittance, np.where(np.isnan(relative[1]), np.nan, one[1] / admittance), relative[0], relative.sum(0)


def _once(port, frequency):
    """Components `(outputs, points)` at the force's frequency and bounds on their errors."""
    z, M = np.exp(2j * np.pi * frequency * port.period), port.kind.size
    frame = _frame(port, z)
    wM = on_circle(2 * np.pi * frequency * port.period * M)
    rough = port.rough
    at = wM[:, None, None] * np.eye(frame.E.shape[-1])
    unsure = frame.dE * port.condition + rough * np.abs(at)
    X, dX = (each[..., 0] for each in solved(at - frame.E, unsure, frame.g[..., None], (rough * frame.g_size)[..., None]))
    total = (frame.G @ X[..., None])[..., 0] + frame.h
    terms = (frame.G_size @ np.abs(X)[..., None])[..., 0] + frame.h_size
    error = (np.abs(frame.G) @ dX[..., None])[..., 0] + rough * terms
    return total.T / M, error.T / M


@dataclass(frozen=True, slots=True)
class _Frame:
    """Ticks in a row under the force z^k, of all frequencies: `X -> (I + E) X + g`; the outputs times z^-k sum up to `G X + h`.

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


def _frame(port, z):
    """The whole frame from its ticks, repeated stretches once."""
    one = np.ones((z.size, 1))
    ticks = []
    for E, B, C, D in port.maps:
        g, h = one * B[..., 0], one * D[..., 0]
        G = one[..., None] * C
        ticks.append(_Frame(E, ENTRIES * np.abs(E), g, np.abs(g), G, np.abs(G), h, np.abs(h), z))
    return in_a_row(port.kind.tolist(), ticks, _joined)


def _joined(first, second):
    """The second stretch begins when the force and the weights have turned by the first one's ticks."""
    turn = first.turn[:, None]
    moved, seen = first.g @ second.E.T, second.G @ first.g[..., None]
    later = (second.G + second.G @ first.E) / turn[..., None]
    g, h = first.g + moved + turn * second.g, first.h + seen[..., 0] / turn + second.h
    return _Frame(
        then(first.E, second.E),
        both((first.E, first.dE), (second.E, second.dE))[1],
        g,
        np.abs(first.g) + np.abs(first.g) @ np.abs(second.E.T) + second.g_size,
        first.G + later,
        first.G_size + np.abs(second.G) + np.abs(second.G) @ np.abs(first.E),
        h,
        first.h_size + (np.abs(second.G) @ np.abs(first.g)[..., None])[..., 0] + second.h_size,
        first.turn * second.turn,
    )


def frame_of_port(port: Port) -> np.ndarray:
    """The frame-to-frame matrix less identity of a port's loop."""
    with np.errstate(over="ignore", invalid="ignore"):
        return in_a_row(port.kind.tolist(), [each[0] for each in port.maps], then)
