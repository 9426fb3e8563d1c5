"""Stability with every passive hand: the damping that it needs, and the walls for which there is enough."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.analysis.passivity.at_rest import AtRest
from wavesweep.analysis.passivity.hinf import SOFT, angles, peak_by_levels
from wavesweep.analysis.passivity.port import PortLoop, PortResponse, level_frame, parts_of_frame, port_loop, port_margin
from wavesweep.analysis.response.bordered import solved
from wavesweep.analysis.spectrum import is_stable
from wavesweep.diagram import WALL, draw
from wavesweep.diagram.block import Block, matrix

SLACK = 1e-10  # of the damping and of 1 N*s/m, within which no frequency needs more
SURE = 1e-7  # of the same, for rounding, with room
LOWEST = 1e-3  # rad per frame, below which the position's pole is set apart


@dataclass(frozen=True, slots=True, eq=False)
class DampingNeeded:
    """Arrays over the batch of the values.

    damping: d* (N*s/m), of device and hand together; infinite if none is enough (see `damping_needed`). omega: the
    frequency that needs it, rad/s, in [0, pi/T_s]. responsive: whether the controller, its position prescribed, is
    stable; else no damping is enough. certified: whether no frequency needs more than SLACK more.
    """

    damping: np.ndarray
    omega: np.ndarray
    responsive: np.ndarray
    certified: np.ndarray

    def suffices(self, damping) -> np.ndarray:
        """Whether `damping` (N*s/m) of device and hand together makes the loop stable with every passive hand."""
        return self.responsive & self.certified & (damping > self.damping + SURE * (1 + np.abs(self.damping)))


def damping_needed(values) -> DampingNeeded | None:
    """Least damping d* of device and hand with which the loop is stable whatever else, passive, the hand is.

    values: flat keys, numbers or arrays; `device.velocity` must be `difference`, else None: a point sample of the
    velocity can be anything at no cost in energy, so no damping bounds the work of its feedback.

    In a tick a damper takes at least `d dx^2/T` for the displacement dx, whatever way it goes, and masses and springs
    take nothing in the end. The held force takes `f_m dx`. So all of it is passive for a continuous hand exactly when
    `d/T + C` is positive real, C the lifted map from the frame's displacements to its forces:
    `d* = -T min lambda(He C)`, the smallest eigenvalue of the Hermitian part over all frequencies. At one rate this is
    `b > K T/2 + |B|` (J. E. Colgate, G. G. Schenkel, Passivity of a class of sampled-data systems: application to haptic
    interfaces, Journal of Robotic Systems 14(1), 37-47, 1997). The condition at the port for held forces (`port_margin`) is
    weaker: it asks nothing of hands whose force moves within the tick, and lets the device's mass help.
    Waves without position feedback need infinite damping at any LP1: a motion at a multiple of the slow rate aliases to
    a wave that moves the avatar, and the force that this builds up stays. So they are not responsive. At one rate there are
    no such motions.
    Accuracy: 1e-10 of d* and of 1 N*s/m, at zero frequency as well.
    """
    if values["device.velocity"] != "difference":
        return None
    diagram = _without_device(draw(values))
    loop = port_loop(diagram, values["environment.K_VE"], values["environment.B_VE"], diagram.hand.reaction)
    period = np.broadcast_to(diagram.period, loop.batch).reshape(-1)
    response = PortResponse(loop, LOWEST, NearRest)
    peak = peak_by_levels(
        lambda owner, theta, floor: -period[owner] * response.smallest(owner, theta, -floor / period[owner]),
        lambda owner, level: angles(level_frame(loop, owner, -level / period[owner])),
        loop.loops,
        lambda _, level: SLACK * (1 + np.abs(level)),
        SOFT,
    )
    responsive, batch = _responsive(loop) & loop.finite, loop.batch
    needed = np.where(responsive | (loop.ratio == 1), peak.value, np.inf)
    frame = period * diagram.ratio
    return DampingNeeded(
        needed.reshape(batch),
        (peak.theta / frame).reshape(batch),
        responsive.reshape(batch),
        (peak.certified & loop.finite).reshape(batch),
    )


class NearRest(AtRest):
    """The map from displacements to forces at low frequencies, its pole at z = 1 set apart.

    Nothing moves the position x but the displacements, and every other state of a responsive loop settles at R times x, so
    the states less R x follow `w s = E s + (G - R G_x) u`, without x. The force for a constant position is the stiffness k,
    the same in every tick, so that x adds `k/w 11^T`, whose Hermitian part is `-k/2 11^T` at every frequency.
    """

    def __init__(self, loop: PortLoop):
        fast, every = loop.fast, np.arange(loop.loops)
        tick, moved, shown = parts_of_frame(loop, every)
        frame, seen, into, impulse = _unrolled(tick, moved, shown, loop.ratio, loop.delay)
        position = loop.source[0].hand.position
        x = [i for i, name in enumerate(fast.states) if name == position]
        rest = [i for i in range(frame.shape[-1]) if i not in x]
        E = (frame - np.eye(frame.shape[-1]))[:, rest]
        of_rest, stiffness = E[..., rest], np.zeros(loop.loops)
        states = seen[..., rest], into[:, rest]
        if x:
            with np.errstate(all="ignore"):
                settled = -solved(of_rest, 0 * of_rest, E[..., x], np.zeros((len(rest), 1)))[0]
                stiffness = (seen[..., x] + seen[..., rest] @ settled).mean((-1, -2))
            states = seen[..., rest], into[:, rest] - settled * into[:, x]
        impulse = np.concatenate([fast.D[:, :1, 0], impulse], axis=-1)
        impulse[~_responsive(loop)] = np.nan  # a loop that does not settle is looked at from LOWEST on
        self._put(impulse, of_rest, 0 * of_rest, *states, -stiffness / 2)


def _unrolled(tick, moved, shown, ratio, delay):
    """The frame, the outputs of its ticks for its first state, its last state for their inputs, and their later outputs.

    tick, moved, shown: see `parts_of_frame`. Arrays `(loops, n, n)`, `(loops, ratio, n)`, `(loops, n, ratio)` and `(loops,
    ratio - 1)`.
    """
    A, B, C = tick
    last = np.eye(A.shape[-1]) if shown is None or delay < ratio else shown
    seen, into, later, frame, rest, moving = [], [], [], moved, last, B
    with np.errstate(over="ignore", invalid="ignore"):
        for number in range(ratio):
            frame = shown @ frame if shown is not None and number == delay else frame
            seen.append(C @ frame)
            frame = A @ frame
            into.insert(0, rest @ B)
            rest = rest @ A
            rest = rest @ shown if shown is not None and number == ratio - 1 - delay else rest
            later.append(C @ moving)
            moving = A @ moving
    return last @ frame, np.concatenate(seen, -2), np.concatenate(into, -1), np.concatenate(later, -1)[:, 0, : ratio - 1]


def _without_device(diagram):
    """The drawing with a ruler for a device: the hand's force is the displacement in the tick (m), and is not pushed back."""
    period, hand = diagram.period, diagram.hand
    ruler = Block(
        hand.device,
        ("f",),
        ("x", "v_hat", "dx"),
        ("w", "x"),
        E=matrix([[-1, 0], [0, 0]]),
        B=matrix([[1 / period], [1]]),
        C=matrix([[0, 1], [1, 0], [0, 0]]),
        D=matrix([[0], [0], [1]]),
    )
    fast = tuple(ruler if block.name == hand.device else block for block in diagram.fast)
    structure = diagram.structure and _without_device(diagram.structure)
    return replace(diagram, fast=fast, sums=dict(diagram.sums) | {hand.push: {hand.force: 1}}, structure=structure)


def _responsive(loop):
    """Whether all that follows from a prescribed position dies out: every state but the position itself."""
    rest = [i for i, name in enumerate(loop.slow.states) if name != f"frame.{loop.source[0].hand.position}"]
    return is_stable(loop.slow.E[:, rest][:, :, rest]) if rest else np.ones(loop.loops, bool)


POINTS = 33  # stiffnesses tried first
CUTS = 15  # points of one round of refinement
TINY = 1e-300  # in place of a zero, which would take a state out of the loop
FINEST = 1e-10  # of the range, to which an end is refined


@dataclass(frozen=True, slots=True, eq=False)
class PassiveWalls:
    """Intervals of K_VE (N/m), `(intervals,)` each.

    low, high: the passive side of each end. method: every stiffness tried is proved to be passive or not; the walls
    between two neighbours of the same kind are not proved.
    """

    low: np.ndarray
    high: np.ndarray
    method: str = "each stiffness looked at is proved; 33 of the range are looked at, and the ends refined"


def port_passive_walls(values, span, path: str = "environment.K_VE") -> PassiveWalls:
    """Stiffnesses within `span` (low, high) with which the hand's port is passive for held forces (`port_margin`).

    values: flat keys, numbers. path: another number to look along, in place of K_VE.
    """
    return _intervals(lambda p: port_margin(dict(values) | {path: _away_from_zero(path, p)}).passive, span)


def any_hand_walls(values, span, hand_damping: float = 0.0, path: str = "environment.K_VE") -> PassiveWalls | None:
    """Stiffnesses within `span` stable with every passive hand of at least `hand_damping` (N*s/m).

    values: flat keys, numbers. None if `damping_needed` is None. The guarantee is for continuous hands of any mass and
    stiffness, including nonlinear and time-varying ones. path: another number to look along, in place of K_VE.
    """
    if values["device.velocity"] != "difference":
        return None

    def passive(p):
        at = dict(values) | {path: _away_from_zero(path, p)}
        enough = damping_needed(at).suffices(at["device.damping"] + hand_damping)
        return np.broadcast_to(enough, np.shape(p))  # the damping needed does not depend on the device's mass

    return _intervals(passive, span)


def _away_from_zero(path, p):
    """A batch must not have a zero that takes a branch of the drawing out of some of its loops."""
    return p if path in WALL else np.where(p == 0, TINY, p)


def _intervals(passive, span) -> PassiveWalls:
    """Runs of stiffnesses that pass, their ends refined all together by multisection."""
    low, high = map(float, span)
    # evenly in the square root: the soft end matters most, and 0 belongs to the range
    points = low + (high - low) * np.linspace(0, 1, POINTS) ** 2
    good = passive(points)
    change = np.flatnonzero(good[1:] != good[:-1])
    inside, outside = (np.where(good[change] == kind, points[change], points[change + 1]) for kind in (True, False))
    while change.size and np.abs(inside - outside).max() > FINEST * (high - low):
        between = inside[:, None] + (outside - inside)[:, None] * np.arange(1, CUTS + 1) / (CUTS + 1)
        passed = passive(between.reshape(-1)).reshape(between.shape)
        count = np.where(passed.all(-1), CUTS, passed.argmin(-1))
        marks = np.concatenate([inside[:, None], between, outside[:, None]], axis=-1)
        inside, outside = (np.take_along_axis(marks, count[:, None] + step, -1)[:, 0] for step in (0, 1))
    rising = good[change + 1]
    lows = np.concatenate([points[:1][good[:1]], inside[rising]])
    highs = np.concatenate([inside[~rising], points[-1:][good[-1:]]])
    return PassiveWalls(lows, highs)
