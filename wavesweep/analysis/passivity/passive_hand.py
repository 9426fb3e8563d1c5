"""Stability with every passive hand: the damping that it needs, and the walls for which there is enough."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.analysis.passivity.hinf import angles, peak_by_levels
from wavesweep.analysis.passivity.port import PortResponse, level_frame, port_loop, port_margin
from wavesweep.analysis.spectrum import is_stable
from wavesweep.diagram import WALL, draw
from wavesweep.diagram.block import Block, matrix

SLACK = 1e-10  # of the damping and of 1 N*s/m, within which no frequency needs more
SURE = 1e-7  # of the same, for rounding at the lowest frequency, where the position's pole cancels, with room
LOWEST = 1e-4  # rad per frame, in place of zero frequency, where the position has its pole


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
    a wave that moves the avatar, and the force that this builds up stays.
    Accuracy: 1e-10 of d* and of 1 N*s/m; 1e-8 if zero frequency needs d*, since the position's pole is near.
    """
    if values["device.velocity"] != "difference":
        return None
    diagram = _without_device(draw(values))
    loop = port_loop(diagram, values["environment.K_VE"], values["environment.B_VE"], diagram.hand.reaction)
    period = np.broadcast_to(diagram.period, loop.batch).reshape(-1)
    response = PortResponse(loop, LOWEST, to_rest=False)
    peak = peak_by_levels(
        lambda owner, theta: -period[owner] * response.smallest(owner, theta),
        lambda owner, level: angles(level_frame(loop, owner, -level / period[owner])),
        loop.loops,
        lambda _, level: SLACK * (1 + np.abs(level)),
    )
    needed = np.where(_builds_up(response, loop.loops), np.inf, peak.value)
    batch = loop.batch
    frame = period * diagram.ratio
    return DampingNeeded(
        needed.reshape(batch),
        (peak.theta / frame).reshape(batch),
        (_responsive(loop) & loop.finite).reshape(batch),
        (peak.certified & loop.finite).reshape(batch),
    )


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


def _builds_up(response, loops):
    """Whether motion at multiples of the slow rate leaves a force behind: a pole z = 1 between different aliases."""
    if response.ratio == 1:
        return np.zeros(loops, bool)
    sizes = []
    for theta in (LOWEST, 1e-2 * LOWEST):
        _, left, right = response.parts(np.arange(loops), np.full(loops, theta))
        steady = (response.ratio - 1) // 2  # the alias at theta itself
        row = np.abs(left[:, steady : steady + 1] @ right)[:, 0]
        sizes.append(np.delete(row, steady, axis=-1).max(-1))
    return sizes[1] > 50 * sizes[0]


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
        return damping_needed(at).suffices(at["device.damping"] + hand_damping)

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
