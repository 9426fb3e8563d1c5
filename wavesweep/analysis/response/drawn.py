"""Responses of drawn loops at the hand's port: admittance, and the impedance of what answers the hand."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.response.bordered import solved
from wavesweep.analysis.response.steady import Response
from wavesweep.analysis.response.ticks import ROUNDING
from wavesweep.diagram.drawn import Drawn
from wavesweep.errors import UsageError
from wavesweep.lifted.circle import on_circle
from wavesweep.lifted.periodic import Drift, in_a_row, then, ticks_of

POINTS = 256  # frequencies at a time
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
    `(..., 2, n)`, D `(..., 2, 1)`.
    """

    maps: tuple[tuple[np.ndarray, ...], ...]
    kind: np.ndarray
    period: float

    def turned(self, first: int) -> "Port":
        """The same with a frame that begins with another tick."""
        return Port(self.maps, np.roll(self.kind, -first), self.period)


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
    return Port(maps, ticks.kind, float(np.ravel(drawn.period)[0]))


def _seen(block, reads, force, drift, reacts):
    E, B = block.E.copy(), block.B[..., force : force + 1].copy()
    C, D = (reads @ E, reads @ B)
    rows = [(C, D)] + ([(block.C[..., 1:2, :], block.D[..., 1:2, force : force + 1])] if reacts else [])
    for lead, others in drift.moved:
        for index, factor in others:
            E[..., index, :] -= factor * E[..., lead, :]
            B[..., index, :] -= factor * B[..., lead, :]
    leads = {lead for lead, _ in drift.moved}
    kept = [i for i in range(len(block.states)) if i not in leads]
    C, D = (
        np.concatenate(np.broadcast_arrays(*part) if part[0].ndim > 2 else part, axis=-2) for part in zip(*rows, strict=True)
    )
    return E[..., kept, :][..., kept], B[..., kept, :], C[..., kept], D


def respond_port(port: Port, frequency_hz) -> Response:
    """Admittance (m/N) and impedance (N/m) of the port, `(points,)`, with estimates of their relative errors.

    With the force z^k in tick k, the state at the start of a frame solves `(z^M - Phi) X = g`; Phi is the frame and g the trace
    of the force in it. The answer is the displacement's component at the force's own frequency, over z - 1. The frame is begun
    at two different ticks, and the error is the difference of the two answers and the bound of the solution.
    Accuracy: as each number says; near multiples of the frame's rate, drifts other than a shift of positions cost digits.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    parts = [_both(port, frequency[at : at + POINTS]) for at in range(0, frequency.size, POINTS)]
    return Response(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _both(port, frequency):
    with np.errstate(all="ignore"):
        (one, error), (two, _) = (_once(each, frequency) for each in (port, port.turned(max(1, port.kind.size // 2))))
        error = error + np.abs(one - two)
        w = on_circle(2 * np.pi * frequency * port.period)
        relative = np.where(error == 0, 0.0, error / np.abs(one)) + 4 * np.finfo(float).eps
        relative = np.where(relative < LOST, relative, np.nan)
        admittance = np.where(np.isnan(relative[0]), np.nan, one[0] / w)
        if len(one) == 1:
            return admittance, 1 / admittance, relative[0], relative[0]
        return admittance, np.where(np.isnan(relative[1]), np.nan, one[1] / admittance), relative[0], relative.sum(0)


def _once(port, frequency):
    """Components `(outputs, points)` at the force's frequency and bounds on their errors."""
    E, M = frame_of_port(port), port.kind.size
    z, n = np.exp(2j * np.pi * frequency * port.period), E.shape[-1]
    wM = on_circle(2 * np.pi * frequency * port.period * M)
    g, size, _ = _run(port, np.zeros((frequency.size, n), complex), z)
    rough = ROUNDING * (4 + np.sqrt(M))
    A = wM[:, None, None] * np.eye(n) - E
    X, dX = solved(A, rough * np.abs(A), g[..., None], (rough * size)[..., None])
    _, _, (total, terms) = _run(port, X[..., 0], z)
    spread = (dX[..., 0] / np.maximum(np.abs(X[..., 0]), np.finfo(float).tiny)).max(-1, initial=0)
    return total / M, (np.abs(total) * np.minimum(spread, 1) + rough * terms) / M


def frame_of_port(port: Port) -> np.ndarray:
    """The frame-to-frame matrix less identity of a port's loop."""
    with np.errstate(over="ignore", invalid="ignore"):
        return in_a_row(port.kind.tolist(), [each[0] for each in port.maps], then)


def _run(port, X, z):
    """The state after a frame of the force z^k, its size on the way, and the sums of outputs times z^-k with their sizes."""
    turn, size = np.ones_like(z), np.abs(X)
    total = np.zeros((port.maps[0][2].shape[-2], z.size), complex)
    terms = np.zeros(total.shape)
    for kind in port.kind.tolist():
        E, B, C, D = port.maps[kind]
        seen = (X @ C.T + turn[:, None] * D[:, 0]).T * turn.conj()
        total += seen
        terms += np.abs(seen) + (np.abs(X) @ np.abs(C).T).T
        X = X + X @ E.T + turn[:, None] * B[:, 0]
        size = np.maximum(size, np.abs(X))
        turn = turn * z
    return X, size, (total, terms)
