"""Responses of drawn loops at the hand's port: admittance, and the impedance of what answers the hand."""

from dataclasses import dataclass, replace
from functools import reduce

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
NOTHING = 1e-9  # of the hand's force, up to which what rounding may leave of a force is none
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

    From the force to the displacement in the tick, the force against it, and if the latter moves with a drift, the change of
    that share of it in the tick. E `(..., n, n)` less identity, B `(..., n, 1)`, C `(..., outputs, n)`, D `(..., outputs, 1)`.
    position: its row `(..., 1, n)`, None if it drifts. condition: by how much closing algebraic loops may have multiplied the
    rounding of the entries (see `Block`). laws: how many combinations of the states nothing in the loop changes.
    """

    maps: tuple[tuple[np.ndarray, ...], ...]
    kind: np.ndarray
    period: float
    position: np.ndarray | None = None
    condition: float | np.ndarray = 1.0
    laws: int = 0

    @property
    def rough(self) -> float:
        """Relative error of sums over a frame, of entries that algebraic loops may have made rough."""
        return long_sum(self.kind.size) * self.condition

    def turned(self, first: int) -> "Port":
        """The same with a frame that begins with another tick."""
        return replace(self, kind=np.roll(self.kind, -first))


def port_of(drawn: Drawn, ports: Ports, drift: Drift) -> Port:
    """See the loop from its port.

    The displacement of a tick is the difference of two positions, so the position has to be a state alone: that of a plant.
    Errors: UsageError if it is not.
    """
    signals = (ports.position, *((ports.reaction,) if ports.reaction else ()))
    if not drift.folded:  # what nothing but a drift reads drifts itself
        drift = replace(drift, moved=(*drift.moved, *((state, ()) for state in drift.unread)))
    ticks = ticks_of(drawn, signals)
    reads = ticks.maps[0].C[..., :1, :]
    if any(np.any(each.D[..., 0, :]) or np.any(each.C[..., :1, :] != reads) for each in ticks.maps):
        raise UsageError(
            f"[ports] hand: expected a position that a plant has in every tick, such as a mass's x, found {ports.position}"
        )
    force = drawn.inputs.index(ports.force)
    answers = ticks.maps[0].C[..., 1:2, :]
    moved = [(lead, _along(answers, lead, others)[0]) for lead, others in drift.moved if _moves(answers, lead, others)]
    maps = tuple(_seen(each, reads, force, drift, bool(ports.reaction), moved) for each in ticks.maps)
    kept = _kept(drift)
    still = not any(_moves(reads, lead, others) for lead, others in drift.moved)
    condition = reduce(np.maximum, (each.condition for each in ticks.maps))
    period = float(np.ravel(drawn.period)[0])
    return Port(maps, ticks.kind, period, reads[..., kept] if still else None, condition, len(drift.folded))


def _along(reads, lead, others):
    """How much of what is read a shift moves, the lead by 1, others by their factors, and the sizes of its terms."""
    terms = np.stack([reads[..., lead], *(factor * reads[..., state] for state, factor in others)], -1)
    return terms.sum(-1), np.abs(terms).sum(-1)


def _moves(reads, lead, others):
    moved, size = _along(reads, lead, others)
    return bool((np.abs(moved) > STILL * size).any())


def _seen(block, reads, force, drift, reacts, moved):
    """The maps of a tick; moved: drifts that move the force against the hand, as pairs of a lead and that force for a 1 of it.

    A state that drifts is counted from the lead. The lead itself is the sum of its changes, which go by the other states.
    """
    E, B = block.E.copy(), block.B[..., force : force + 1].copy()
    rows = [(reads @ E, reads @ B)]
    if reacts:
        rows.append((block.C[..., 1:2, :], block.D[..., 1:2, force : force + 1]))
    if moved:
        change = [
            (share[..., None] * E[..., lead : lead + 1, :], share[..., None] * B[..., lead : lead + 1, :])
            for lead, share in moved
        ]
        rows.append(tuple(sum(part) for part in zip(*change, strict=True)))
    for lead, others in drift.moved:
        for index, factor in others:
            E[..., index, :] -= factor * E[..., lead, :]
            B[..., index, :] -= factor * B[..., lead, :]
    kept = _kept(drift)
    C, D = (
        np.concatenate(np.broadcast_arrays(*part) if part[0].ndim > 2 else part, axis=-2) for part in zip(*rows, strict=True)
    )
    # Contiguous, since the order of sums follows the memory, and with it the bits of a loop the batch that it is in.
    return tuple(map(np.ascontiguousarray, (E[..., kept, :][..., kept], B[..., kept, :], C[..., kept], D)))


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
    """still: at 0 Hz."""
    if still:
        return tuple(np.broadcast_to(part, frequency.size) for part in at_rest(port))
    with np.errstate(all="ignore"):
        (one, error), (two, _) = (_once(each, frequency) for each in (port, port.turned(max(1, port.kind.size // 2))))
        w = on_circle(2 * np.pi * frequency * port.period)
        return _response(*_of_drift(one, error + np.abs(one - two), w))


def _of_drift(found, error, w):
    """Position and force against the hand, `(2 or 1, ...)`, from what the port shows, and errors; w: `z - 1` of the tick."""
    shown = [found[0] / w, *found[1:2]]
    off = [error[0] / np.abs(w), *error[1:2]]
    if len(found) > 2:
        shown[1], off[1] = shown[1] + found[2] / w, off[1] + error[2] / np.abs(w)
    return np.stack(shown), np.stack(off)


def _response(found, error):
    """Admittance, impedance and their relative errors, from position and force and errors of these."""
    with np.errstate(all="ignore"):
        relative = np.where(error == 0, 0.0, error / np.abs(found)) + 4 * np.finfo(float).eps
        relative = np.where(relative < LOST, relative, np.nan)
        admittance = np.where(np.isnan(relative[0]), np.nan, found[0])
        if len(found) == 1:
            return admittance, 1 / admittance, relative[0], relative[0]
        return admittance, np.where(np.isnan(relative[1]), np.nan, found[1] / admittance), relative[0], relative.sum(0)


def at_rest(port: Port, *, twice: bool = True) -> tuple[np.ndarray, ...]:
    """Admittance (m/N) and impedance (N/m) of a port, or of each of a batch, towards 0 Hz, `(...)`, and bounds on their
    relative errors. A position that a constant force moves without end has no admittance; NaN: none, or not known.

    With w = z - 1 of the tick and M ticks in a frame, both sides of `(z^M - 1 - E) X = g` and of what a frame shows of X are
    expanded to first order: `E X_0 = -g_0`, `E X_1 = M X_0 - g_1`. What changes in a tick vanishes with w, and its slope is
    what has been changed. Slopes are those of a complex step (W. Squire, G. Trapp, SIAM Rev. 40, 1998). The error is that of
    both solutions, and the difference of two frames that begin with different ticks; twice: whether the second is computed.
    """
    with np.errstate(all="ignore"):
        value, slope, errors, size = _still(port)
        value_2, slope_2, *_ = _still(port.turned(port.kind.size // 2)) if twice else (value, slope)
        off, off_slope = (error + np.abs(a - b) for error, a, b in zip(errors, (value, slope), (value_2, slope_2), strict=True))
        going = np.abs(value) > off + STILL * size  # of what changes in a tick: it changes for ever
        found, error = [slope[:1], value[1:2]], [off_slope[:1], off[1:2]]
        forces = np.zeros(value[0].shape), np.zeros(value[0].shape)
        if len(value) > 2:
            found[1], error[1] = found[1] + slope[2:], np.where(going[2:], np.nan, error[1] + off_slope[2:])
            forces = value[2], off[2] / np.abs(value[2])
        error[0] = np.where(going[:1], np.nan, error[0])
        none = (np.abs(found[-1]) <= error[-1]) & (error[-1] <= NOTHING) & (len(value) > 1)  # of 1 N: nothing but rounding
        found[-1], error[-1] = np.where(none, 0.0, found[-1]), np.where(none, 0.0, error[-1])
        admittance, impedance, *relative = _response(np.concatenate(found), np.concatenate(error))
        stiffness = np.where(forces[0] == 0, 0.0, forces[0] / value[0])
        unsure = np.where(forces[0] == 0, 0.0, forces[1] + off[0] / np.abs(value[0]))
    impedance, unsure = (np.where(going[0], *pair) for pair in ((stiffness, impedance), (unsure, relative[1])))
    return admittance + 0j, impedance + 0j, relative[0], unsure


STEP = 1e-30  # of z, for slopes


def _still(port):
    """What a frame shows under a constant force, and its slope, `(outputs, ...)`; bounds on the errors of both; and the size of
    the first one's terms."""
    frame, M, rough = _frame(port, np.array([1 + 1j * STEP])), port.kind.size, np.asarray(port.rough)[..., None]
    parts = (part for each in (frame.g, frame.G, frame.h) for part in (each.real, each.imag / STEP))
    E, unsure, (g, g_1, G, G_1, h, h_1) = -frame.E, frame.dE * np.asarray(port.condition)[..., None, None], parts
    right, missed = (g, rough * frame.g_size), rough * M * frame.g_size
    if port.laws:
        E, unsure, right = _with_law(E, unsure, right, (g_1 / M, missed / M))
    X, dX = (each[..., 0] for each in solved(E, unsure, *(part[..., None] for part in right)))
    more = missed + M * dX
    X_1, dX_1 = (each[..., 0] for each in solved(E, unsure, (g_1 - M * X)[..., None], more[..., None]))
    size = _times(frame.G_size, np.abs(X)) + frame.h_size
    value, slope = _times(G, X) + h, _times(G_1, X) + _times(G, X_1) + h_1
    error = _times(np.abs(G), dX) + rough * size
    of_slope = rough * (M * size + _times(frame.G_size, np.abs(X_1)))
    of_slope = of_slope + _times(np.abs(G_1), dX) + _times(np.abs(G), dX_1)
    value, slope, error, of_slope, size = (np.moveaxis(part, -1, 0) / M for part in (value, slope, error, of_slope, size))
    return value, slope, (error, of_slope), size


def _with_law(E, unsure, right, later):
    """The equations `E X = g` with the combination of the states that nothing changes determined by what the start of the force
    leaves in it; right: g and its error. NaN if the force's mean moves it for ever.

    With `l E = 0`, the expansion of `(M w + E) X = g + g_1 w` gives `l g = 0` and `l X = l g_1/M` (later: `g_1/M`, and its
    error). That is added along l, where E has nothing, and a state that it keeps shows no displacement, whatever it is.
    """
    left, values, _ = np.linalg.svd(np.where(np.isfinite(E), E, 0.0))
    law, scale = left[..., -1], values[..., :1, None]
    whole = E + scale * law[..., :, None] * law[..., None, :]
    off = np.abs(np.linalg.pinv(np.where(np.isfinite(whole), whole, 0.0)))
    vague = _times(np.swapaxes(off, -1, -2), _times(np.swapaxes(unsure, -1, -2), np.abs(law)))  # of the law
    (g, dg), (g_1, dg_1) = right, later
    mean, size = (
        (law * g).sum(-1, keepdims=True),
        (np.abs(law) * (dg + STILL * np.abs(g)) + vague * np.abs(g)).sum(-1, keepdims=True),
    )
    left_in, error = (law * g_1).sum(-1, keepdims=True), (np.abs(law) * dg_1 + vague * np.abs(g_1)).sum(-1, keepdims=True)
    g = np.where(np.abs(mean) <= size, g + scale[..., 0] * law * left_in, np.nan)
    dg = dg + scale[..., 0] * (np.abs(law) * error + vague * np.abs(left_in))
    twist = vague[..., :, None] * np.abs(law)[..., None, :]
    return whole, unsure + scale * (twist + np.swapaxes(twist, -1, -2)), (g, dg)


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
    moved, seen = _times(second.E, first.g), second.G @ first.g[..., None]
    later = (second.G + second.G @ first.E) / turn[..., None]
    g, h = first.g + moved + turn * second.g, first.h + seen[..., 0] / turn + second.h
    return _Frame(
        then(first.E, second.E),
        both((first.E, first.dE), (second.E, second.dE))[1],
        g,
        np.abs(first.g) + _times(np.abs(second.E), np.abs(first.g)) + second.g_size,
        first.G + later,
        first.G_size + np.abs(second.G) + np.abs(second.G) @ np.abs(first.E),
        h,
        first.h_size + (np.abs(second.G) @ np.abs(first.g)[..., None])[..., 0] + second.h_size,
        first.turn * second.turn,
    )


def _times(E, g):
    """`E g` of every frequency, or of every loop of a batch; g: `(points, n)`. The bits of a product of matrices would depend
    on the batch."""
    return np.multiply(E, g[..., None, :], order="C").sum(-1)


def frame_of_port(port: Port) -> np.ndarray:
    """The frame-to-frame matrix less identity of a port's loop."""
    with np.errstate(over="ignore", invalid="ignore"):
        return in_a_row(port.kind.tolist(), [each[0] for each in port.maps], then)
