"""Passivity at the hand's port: whether the whole loop can give the hand more energy than it took."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.hinf import Element, angles, climb, passage, repeated, then, tick
from wavesweep.analysis.passivity.port_loop import PortLoop, PortResponse, port_loop
from wavesweep.analysis.spectrum import is_stable
from wavesweep.diagram import draw
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.drift import hand_drifts
from wavesweep.lifted import close, cut_at_wall

TOLERANCE = 1e-9  # of the mean eigenvalue: by how much the margin may be negative for rounding's sake
SLACK = 1e-10  # of the margin and of the mean eigenvalue: what the margin is good to
HUGE = 1e10  # an unstable loop that grows by this much in a frame keeps no digit worth reporting


@dataclass(frozen=True, slots=True, eq=False)
class PortMargin:
    """The hand's port, arrays over the batch of the values.

    margin: smallest eigenvalue, over all frequencies, of the Hermitian part of the lifted map from the held force to
    the displacement in the tick, m/N; NaN for a loop so unstable that a frame of it overflows, or nearly.
    omega: where, rad/s, in [0, pi/T_s].
    mean: of all eigenvalues over all frequencies (T^2/2m and a little less), which is the natural scale, m/N.
    stable: every eigenvalue but drift inside the unit circle.
    certified: no frequency has an eigenvalue below the margin by more than SLACK of it and of the mean.
    """

    margin: np.ndarray
    omega: np.ndarray
    mean: np.ndarray
    stable: np.ndarray
    certified: np.ndarray

    @property
    def passive(self) -> np.ndarray:
        """Stable, and no eigenvalue below zero by more than TOLERANCE of the mean.

        The margin is zero, not positive, where a spring holds the scene: a constant force then moves nothing, at zero
        frequency the map has a zero row and column. So zero has to pass, and rounding about it.
        """
        return self.stable & (self.margin >= -TOLERANCE * self.mean)


def port_margin(values) -> PortMargin:
    """Margin of positive realness at the hand's port for every loop of the batch.

    values: flat keys, numbers or arrays. A held force does the work `f_h[k] (x[k+1] - x[k])` in a tick, so the loop is
    passive exactly when the lifted map between the two is positive real. Not a grid: the level just below the margin is
    shown to be met at no frequency (`climb`, on the frame's `scattering` element).
    Accuracy: 1e-10 of the margin and of the mean eigenvalue.
    """
    diagram = draw(values)
    K, B = values["environment.K_VE"], values["environment.B_VE"]
    loop = port_loop(diagram, K, B)
    batch = loop.batch
    margin, theta, certified = lowest_eigenvalue(loop)
    is_stable = np.broadcast_to(stable(diagram, K, B), batch)
    lost = ~is_stable.reshape(-1) & (np.abs(loop.slow.E).max((-1, -2), initial=0) > HUGE)
    margin, certified = np.where(lost, np.nan, margin), certified & ~lost
    held = np.broadcast_to(np.asarray(K) != 0, batch).reshape(-1) | (not hand_drifts(diagram))
    theta = np.where(held & (margin > 0), 0.0, theta)
    margin = np.where(held, np.minimum(margin, 0.0), margin)
    period = np.broadcast_to(diagram.period * diagram.ratio, batch)
    return PortMargin(
        margin.reshape(batch),
        theta.reshape(batch) / period,
        loop.mean.reshape(batch),
        is_stable,
        certified.reshape(batch),
    )


def stable(diagram: Diagram, K_VE, B_VE) -> np.ndarray:
    """Whether every eigenvalue of the frame-to-frame matrix, drift aside, is inside the unit circle."""
    return is_stable(close(cut_at_wall(diagram), K_VE, B_VE))


def lowest_eigenvalue(loop: PortLoop):
    """(margin, angle in rad per frame, certified) of each loop."""
    response = PortResponse(loop)
    summit = climb(
        lambda owner, theta: -response.smallest(owner, theta),
        lambda owner, level: angles(level_frame(loop, owner, -level)),
        loop.loops,
        lambda owner, level: SLACK * (np.abs(level) + loop.mean[owner]),
    )
    return np.where(loop.finite, -summit.value, np.nan), summit.theta, summit.certified & loop.finite


def level_frame(loop: PortLoop, owner, level) -> Element:
    """One frame with the balance `2 f (x+ - x) - 2 level f^2`.

    Its state: that of the fast side, held signals, that of the slow side, pending signals. Phase 0 makes new values of
    the held signals, which are pending until phase `delay`.
    """
    fast, event = loop.fast, loop.event
    n, h, s = len(fast.states), len(fast.inputs) - 1, len(event.states) - len(fast.states)
    pending = h if loop.delay else 0
    size, k = n + h + s + pending, owner.size
    own, held, slow, late = (slice(a, b) for a, b in ((0, n), (n, n + h), (n + h, n + h + s), (n + h + s, size)))
    A, B, C = np.zeros((k, size, size)), np.zeros((k, size, 1)), np.zeros((k, 1, size))
    A[:] = np.eye(size)
    A[:, own, own] += fast.E[owner]
    A[:, own, held], B[:, own] = fast.B[owner][..., 1:], fast.B[owner][..., :1]
    C[..., own], C[..., held] = fast.C[owner][:, :1], fast.D[owner][:, :1, 1:]
    every = tick(A, B, 0 * A, np.swapaxes(C, -1, -2), 2 * (fast.D[owner][:, :1, :1] - level[:, None, None]))
    moved = np.zeros((k, size, size))
    moved[:] = np.eye(size)
    both = np.r_[own, slow]
    moved[:, both[:, None], both] += event.E[owner]
    target = late if pending else held
    moved[:, target] = 0
    moved[:, target, both] = event.C[owner]
    if not pending:
        return then(passage(moved), repeated(every, loop.ratio))
    moved[:, both, held] = event.B[owner]
    moved[:, target, held] = event.D[owner]
    shown = np.zeros((k, size, size))
    shown[:] = np.eye(size)
    shown[:, held] = 0
    shown[:, held, late] = np.eye(h)
    first, second = repeated(every, loop.delay), repeated(every, loop.ratio - loop.delay)
    return then(then(passage(moved), first), then(passage(shown), second))
