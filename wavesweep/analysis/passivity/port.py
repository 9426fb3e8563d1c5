"""Passivity at the hand's port: the loop as the port sees it, its map frequency by frequency, and the margin."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wavesweep.analysis.passivity.at_rest import AtRest
from wavesweep.analysis.passivity.hinf import (
    Element,
    angles,
    passage,
    peak_by_levels,
    repeated,
    smallest_hermitian,
    then,
    tick,
)
from wavesweep.analysis.response.felt import held_at_rest
from wavesweep.analysis.spectrum import is_stable
from wavesweep.diagram import draw
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted.at_wall import cut_at_wall
from wavesweep.lifted.circle import on_circle
from wavesweep.lifted.connect import connect
from wavesweep.lifted.cut import close
from wavesweep.lifted.lift import fast_side, slow_side, wall_sum
from wavesweep.lifted.resolvent import alias_angles, flattened, response_of


@dataclass(frozen=True, slots=True, eq=False)
class PortLoop:
    """Both rates with the wall in place, one loop per element of the flattened `batch`.

    fast: from `f_h` and the held signals to the displacement in the tick and the samples, a block of the tick.
    slow: from the hand's part of the samples to the sources of the held signals, a block of the frame.
    event: the change at phase 0: its states are those of `fast` and of the slow blocks, its inputs the held signals
    as shown (none without delay), its outputs their sources.
    finite: `(loops,)`, false if the frame overflowed; the slow block is then zero.
    source: the drawing and its wall (K_VE, B_VE).
    """

    fast: Block
    slow: Block
    event: Block
    ratio: int
    delay: int
    batch: tuple[int, ...]
    finite: np.ndarray
    source: tuple

    @property
    def loops(self) -> int:
        """Number of loops."""
        return math.prod(self.batch)

    @property
    def mean(self) -> np.ndarray:
        """Mean eigenvalue of the port's Hermitian part over all frequencies (m/N), `(loops,)`: its direct term."""
        return self.fast.D[:, 0, 0]


def port_loop(diagram: Diagram, K_VE, B_VE, seen: str | None = None) -> PortLoop:
    """Connect both rates; `K_VE` (N/m), `B_VE` (N*s/m): numbers or arrays over the diagram's batch.

    seen: the fast signal that the port shows, by default the displacement of the hand's device.
    """
    samples = tuple(diagram.samples.values())
    fast = _without_idle(fast_side(diagram, (seen or diagram.hand.displacement, *samples)))
    held = fast.inputs[1:]
    sources = tuple(diagram.holds[name] for name in held)
    wall = wall_sum(diagram, K_VE, B_VE)
    with np.errstate(over="ignore", invalid="ignore"):
        slow, _ = slow_side(diagram, sources, injected=True, wall=wall)
    event = _event(diagram, fast, held, sources, wall)
    batch = np.broadcast_shapes(fast.batch, slow.batch, event.batch, np.shape(diagram.period))
    fast, slow, event = (flattened(block, batch) for block in (fast, slow, event))
    finite = np.logical_and.reduce([np.isfinite(getattr(slow, name)).all((-1, -2)) for name in "EBCD"])
    slow = replace(slow, **{name: np.where(finite[:, None, None], getattr(slow, name), 0) for name in "EBCD"})
    return PortLoop(fast, slow, event, diagram.ratio, diagram.delay, batch, finite, (diagram, K_VE, B_VE))


def _without_idle(fast: Block) -> Block:
    """Leave out the held signals that nothing reads."""
    keep = [i for i in range(len(fast.inputs)) if i == 0 or np.any(fast.B[..., i]) or np.any(fast.D[..., i])]
    return replace(fast, inputs=tuple(fast.inputs[i] for i in keep), B=fast.B[..., keep], D=fast.D[..., keep])


def _event(diagram, fast, held, sources, wall) -> Block:
    """Sampler, slow blocks and wall at one instant; the fast states stand still."""
    samples = tuple(diagram.samples.values())
    n, shape = len(fast.states), fast.B.shape[:-2]
    reader = Block(
        "tick",
        held,
        samples,
        fast.states,
        np.zeros((*shape, n, n)),
        np.zeros((*shape, n, len(held))),
        fast.C[..., 1:, :],
        fast.D[..., 1:, 1:],
    )
    shown = () if diagram.delay == 0 else tuple(f"shown.{name}" for name in held)
    sums = dict(diagram.sums) | wall
    for name, source in zip(held, shown or sources, strict=True):
        sums[f"tick.{name}"] = {source: 1}
    for name, source in diagram.samples.items():
        sums[name] = {f"tick.{source}": 1}
    return connect("event", (reader, *diagram.slow), sums, shown, sources)


LOWEST = 1e-7  # rad per frame below which shares are 0/0 and a drift has its pole


class PortResponse:
    """The lifted map as a diagonal (the fast side, for each alias) and a mixture of low rank (through the slow side).

    If the fast side samples a position that nothing holds, its response has the pole z = 1, which only the slow loop
    removes: a difference of large numbers. In that case the mixture is put together from displacements: to shift the sample
    by p is to shift the state x by p, and that is an input (z - 1) p of the closed loop.
    """

    def __init__(self, loop: PortLoop, lowest: float = LOWEST, near_rest: type[AtRest] = AtRest):
        self.near_rest = near_rest  # the map below `lowest`
        self.loop, self.ratio, self.delay, self.lowest = loop, loop.ratio, loop.delay, lowest
        fast, slow = loop.fast, loop.slow
        hand = loop.source[0].hand
        self.shifted = _drifts(fast, hand)
        if self.shifted:
            fast, slow = _from_displacements(fast, slow, hand.position)
        self.fast, self.slow = response_of(fast, loop.loops), response_of(slow, loop.loops)

    def parts(self, owner, theta):
        """d `(points, M)`, left `(points, M, r)`, right `(points, r, M)` of `diag(d) + left right`; theta not 0."""
        phi = alias_angles(theta, self.ratio)
        fast = self.fast.at(owner, phi)
        slow = self.slow.at(owner, theta[:, None])[:, 0]
        share = np.exp(-1j * phi * self.delay) * on_circle(-theta)[:, None] / (self.ratio * on_circle(-phi))
        left = (fast[..., 0, 1:] * share[..., None]) @ slow
        right = np.swapaxes(fast[..., 1:, 0], -1, -2)
        if self.shifted:
            shift = fast[..., 0, 0] * on_circle(theta)[:, None] / on_circle(phi)
            right = np.concatenate([right, shift[:, None, :]], axis=1)
        return fast[..., 0, 0], left, right

    def smallest(self, owner, theta, ceiling=None):
        """Smallest eigenvalue of the Hermitian part (m/N) of the loops `owner` at `theta` (rad per frame).

        ceiling: `(points,)`; next to rest infinity may stand for a value that is not below it.
        """
        found, low = np.full(theta.size, np.nan), np.flatnonzero(theta < self.lowest)
        if low.size:
            found[low] = self.at_rest.smallest(owner[low], theta[low], None if ceiling is None else ceiling[low])
        rest = np.flatnonzero(np.isnan(found))
        if rest.size:
            found[rest] = smallest_hermitian(*self.parts(owner[rest], np.maximum(theta[rest], self.lowest)))
        return found

    @cached_property
    def at_rest(self) -> AtRest:
        """The map for angles below `lowest`."""
        return self.near_rest(self.loop)


def _drifts(fast, hand):
    """Whether a sampled position is held by nothing on the fast side, and its displacement comes out of it."""
    if fast.outputs[0] != hand.displacement:
        return False
    return hand.position in fast.states and not np.any(fast.E[..., fast.states.index(hand.position)])


def _from_displacements(fast, slow, position):
    """The fast side without its position; the slow side with an input that shifts the position of the scene."""
    x = fast.states.index(position)
    rest = [i for i in range(len(fast.states)) if i != x]
    fast = replace(
        fast,
        states=tuple(fast.states[i] for i in rest),
        E=fast.E[..., rest, :][..., rest],
        B=fast.B[..., rest, :],
        C=fast.C[..., rest],
    )
    push = np.zeros((*slow.B.shape[:-1], 1))
    push[..., [i for i, name in enumerate(slow.states) if name == f"frame.{position}"], 0] = 1
    return fast, replace(
        slow,
        inputs=(*slow.inputs, "shift"),
        B=np.concatenate([slow.B, push], axis=-1),
        D=np.concatenate([slow.D, np.zeros((*slow.D.shape[:-1], 1))], axis=-1),
    )


TOLERANCE = 1e-9  # of the mean eigenvalue: a margin that is negative by more than this is so beyond rounding
AT_REST = np.array([1e-12, 3e-12, 1e-11])  # rad per frame, at which a margin at zero frequency is computed again
FAINT = 64 * np.finfo(float).eps  # of the mean eigenvalue, what a margin of zero may be by the same rounding in two ways
ALIKE = 0.9  # least share of one another of values that are alike
SLACK = 1e-10  # of the margin and of the mean eigenvalue: accuracy of the margin
HUGE = 1e10  # an unstable loop that grows by this much in a frame keeps no digit worth reporting


@dataclass(frozen=True, slots=True, eq=False)
class PortMargin:
    """The hand's port, arrays over the batch of the values.

    margin: smallest eigenvalue, over all frequencies, of the Hermitian part of the lifted map from the held force to
    the displacement in the tick, m/N; NaN for a loop so unstable that a frame of it overflows, or nearly.
    omega: its frequency, rad/s, in [0, pi/T_s].
    mean: of all eigenvalues over all frequencies (T^2/2m and a little less), which is the natural scale, m/N.
    stable: every eigenvalue but drift inside the unit circle.
    certified: no frequency has an eigenvalue below the margin by more than SLACK of it and of the mean.
    negative: the margin is below zero, and not for rounding's sake.
    """

    margin: np.ndarray
    omega: np.ndarray
    mean: np.ndarray
    stable: np.ndarray
    certified: np.ndarray
    negative: np.ndarray

    @property
    def passive(self) -> np.ndarray:
        """Stable, and no eigenvalue below zero.

        The margin is zero, not positive, if a spring holds the scene: a constant force then moves nothing, and at zero
        frequency the map has a zero row and column. So zero has to pass, and so has rounding about it.
        """
        return self.stable & ~self.negative & ~np.isnan(self.margin)


def port_margin(values) -> PortMargin:
    """Margin of positive realness at the hand's port for every loop of the batch.

    values: flat keys, numbers or arrays. A held force does the work `f_h[k] (x[k+1] - x[k])` in a tick, so the loop is
    passive exactly when the lifted map between the two is positive real. Not a grid: the level just below the margin is
    shown to be met at no frequency (`peak_by_levels`, on the frame's `Element`, see `hinf`).
    Accuracy: 1e-10 of the margin and of the mean eigenvalue.
    """
    diagram = draw(values)
    K, B = values["environment.K_VE"], values["environment.B_VE"]
    loop = port_loop(diagram, K, B)
    batch = loop.batch
    margin, theta, certified, negative = lowest_eigenvalue(loop)
    is_stable = np.broadcast_to(stable(diagram, K, B), batch)
    lost = ~is_stable.reshape(-1) & (np.abs(loop.slow.E).max((-1, -2), initial=0) > HUGE)
    margin, certified = np.where(lost, np.nan, margin), certified & ~lost
    held = np.broadcast_to(held_at_rest(diagram, (K, B)), batch).reshape(-1)
    theta = np.where(held & (margin > 0), 0.0, theta)
    margin = np.where(held, np.minimum(margin, 0.0), margin)
    period = np.broadcast_to(diagram.period * diagram.ratio, batch)
    return PortMargin(
        margin.reshape(batch),
        theta.reshape(batch) / period,
        loop.mean.reshape(batch),
        is_stable,
        certified.reshape(batch),
        negative.reshape(batch),
    )


def stable(diagram: Diagram, K_VE, B_VE) -> np.ndarray:
    """Whether every eigenvalue of the frame-to-frame matrix, drift aside, is inside the unit circle."""
    return is_stable(close(cut_at_wall(diagram), K_VE, B_VE))


def lowest_eigenvalue(loop: PortLoop):
    """(margin, angle in rad per frame, certified, negative beyond rounding) of each loop."""
    response = PortResponse(loop)
    peak = peak_by_levels(
        lambda owner, theta, _: -response.smallest(owner, theta),
        lambda owner, level: angles(level_frame(loop, owner, -level)),
        loop.loops,
        lambda owner, level: SLACK * (np.abs(level) + loop.mean[owner]),
    )
    margin = np.where(loop.finite, -peak.value, np.nan)
    negative = _below_zero(response, margin, peak.theta)
    margin = np.where(np.abs(margin) <= FAINT * loop.mean, 0.0, margin)
    return margin, peak.theta, peak.certified & loop.finite, negative


def _below_zero(response, margin, theta):
    """Whether the margin is negative, and not for rounding's sake, `(loops,)`.

    A small one has to be negative with aliases and without, whose rounding errors are different, and to be alike; one at zero
    frequency at several angles next to it. Up to FAINT of the mean both may be the same roundings. Of 3,000 random loops 333
    have so small a margin, 19 of them a negative one.
    """
    mean = response.loop.mean
    with np.errstate(all="ignore"):
        found = margin < -TOLERANCE * mean
        small = np.flatnonzero((margin < 0) & ~found)
        angle = np.where(theta[small, None] > AT_REST[-1], theta[small, None], AT_REST).reshape(-1)
        if small.size:
            owner = np.repeat(small, AT_REST.size)
            ways = smallest_hermitian(*response.parts(owner, angle)), response.at_rest.smallest(owner, angle)
            value = np.stack(ways).reshape(2, small.size, AT_REST.size)
            most, least = value.max((0, 2)), value.min((0, 2))
            found[small] = (most < -FAINT * mean[small]) & (most <= ALIKE * least)
    return found


def level_frame(loop: PortLoop, owner, level) -> Element:
    """One frame with the balance `2 f (x+ - x) - 2 level f^2`."""
    (A, B, C), moved, shown = parts_of_frame(loop, owner)
    every = tick(A, B, 0 * A, np.swapaxes(C, -1, -2), 2 * (loop.fast.D[owner][:, :1, :1] - level[:, None, None]))
    if shown is None:
        return then(passage(moved), repeated(every, loop.ratio))
    first, second = repeated(every, loop.delay), repeated(every, loop.ratio - loop.delay)
    return then(then(passage(moved), first), then(passage(shown), second))


def parts_of_frame(loop: PortLoop, owner):
    """A tick (A, B, C) of the loops `owner`, and the change of the state at phase 0 and, if there is a delay, at phase `delay`.

    The state: that of the fast side, held signals, that of the slow side, pending signals. Phase 0 makes new values of
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
    moved = np.zeros((k, size, size))
    moved[:] = np.eye(size)
    both = np.r_[own, slow]
    moved[:, both[:, None], both] += event.E[owner]
    target = late if pending else held
    moved[:, target] = 0
    moved[:, target, both] = event.C[owner]
    if not pending:
        return (A, B, C), moved, None
    moved[:, both, held] = event.B[owner]
    moved[:, target, held] = event.D[owner]
    shown = np.zeros((k, size, size))
    shown[:] = np.eye(size)
    shown[:, held] = 0
    shown[:, held, late] = np.eye(h)
    return (A, B, C), moved, shown
