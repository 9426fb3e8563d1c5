"""Stability with every passive hand: the damping that it needs; and a finder of intervals in which something holds."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.energy.lifted_map import LiftedMap, TickMaps, damping_peak, read
from wavesweep.engine.loops.block import Block
from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.monodromy.periodic import Ticks
from wavesweep.engine.monodromy.unit_circle import solve
from wavesweep.engine.response.linear_systems import solved
from wavesweep.engine.stability.spectrum import is_stable
from wavesweep.haptics.held_loop import HeldLoop

LOWEST = 1e-3  # rad per frame; loops that do not settle are examined from here on


@dataclass(frozen=True, slots=True, eq=False)
class DampingNeeded:
    """Arrays over the batch of the loops.

    damping: d* (N*s/m), of device and hand together; infinite if none is enough (see `damping_needed`). omega: the
    frequency that needs it, rad/s, in [0, pi/T_s]. responsive: whether the controller, its position prescribed, is
    stable; else no damping is enough. certified: whether no frequency needs more, see `damping_peak`.
    """

    damping: np.ndarray
    omega: np.ndarray
    responsive: np.ndarray
    certified: np.ndarray


def damping_needed(loop: HeldLoop) -> DampingNeeded | None:
    """Least damping d* of device and hand with which the loop is stable whatever else, passive, the hand is.

    None if the hand holds no single mass, or if something reads the velocity of that mass: a point sample of the velocity can
    be anything at no cost in energy, so no damping bounds the work of its feedback.

    In a tick a damper takes at least `d dx^2/T` for the displacement dx, whatever way it goes, and masses and springs
    take nothing in the end. The held force takes `f_m dx`. So all of it is passive for a continuous hand exactly when
    `d/T + C` is positive real, C the lifted map from the frame's displacements to its forces:
    `d* = -T min lambda(He C)`, the smallest eigenvalue of the Hermitian part over all frequencies. A dead time divides each
    tick in two parts, with a force f_i and a displacement dx_i in each; the damper takes at least `d dx_i^2/(l_i T)` in a part
    of l_i ticks, so C is the map from all `dx_i/sqrt(l_i)` to all `sqrt(l_i) f_i`. At one rate without one this is
    `b > K T/2 + |B|` (J. E. Colgate, G. G. Schenkel, Passivity of a class of sampled-data systems: application to haptic
    interfaces, Journal of Robotic Systems 14(1), 37-47, 1997). The condition at the port for held forces (`port_margin`) is
    weaker: it asks nothing of hands whose force moves within the tick, and lets the device's mass help.
    Waves without position feedback need infinite damping at any LP1: a motion at a multiple of the slow rate aliases to
    a wave that moves the avatar, and the force that this builds up stays. So they are not responsive. At one rate there are
    no such motions.
    Accuracy: 1e-10 of d* and of 1 N*s/m, at zero frequency as well.
    """
    if loop.device is None or loop.reads_velocity:
        return None
    drawn, batch = loop.drawn(), loop.batch
    ticks, x = reaction(loop, drawn, batch)
    lifted = ticks.lifted()
    responsive, apart = _responsive(lifted, x), settled(lifted, x)
    pairs = [(getattr(apart, name), getattr(lifted, name)) for name in LiftedMap.__slots__]
    lifted = LiftedMap(*(np.where(responsive[:, None, None], *pair) for pair in pairs))
    M = ticks.kind.size
    period = np.broadcast_to(np.real(drawn.period), batch).reshape(-1)
    peak = damping_peak(ticks, lifted, period, np.where(responsive, 0.0, LOWEST))
    finite = np.isfinite(peak.value)
    needed = np.where((responsive | (M == 1)) & finite, peak.value, np.inf)
    return DampingNeeded(
        needed.reshape(batch),
        (peak.theta / (period * M)).reshape(batch),
        (responsive & finite).reshape(batch),
        (peak.certified & finite).reshape(batch),
    )


REACTION = "ports.push"  # the junction of the force that pushes the device, but for the hand's


def reaction(loop: HeldLoop, drawn: MultirateLoop, batch) -> tuple[TickMaps, list[int]]:
    """The ticks from the displacement of the device (m) to the force against it (N), and its position among the states.

    The device is a ruler: the hand's input is the displacement in the tick. Both have an entry for each part of the tick, a
    displacement over and a force times the root of its share; see `damping_needed`. drawn: the blocks of the loops. States that
    the force does not depend on are left out.
    """
    device, force, steps = loop.device, loop.drawing.hand[0], loop.parts
    n, moves, sums, pushed = len(steps), [], dict(drawn.sums), {}
    ports = tuple(port.removeprefix(f"{device}.") for port in steps)
    ruler = Block(device, ports, ("x", "v"), ("x",), np.zeros((1, 1)), np.ones((1, n)), np.eye(2, 1), np.zeros((2, n)))
    placed = tuple(
        replace(placed_block, block=ruler) if placed_block.block.name == device else placed_block
        for placed_block in drawn.placed
    )
    for port, share in steps.items():
        root, gains = np.sqrt(share), {signal: -gain for signal, gain in drawn.sums[port].items() if signal != force}
        pushed = pushed | gains
        sums[f"{REACTION}.{port}"] = {signal: root * gain for signal, gain in pushed.items()}
        sums[port] = {(move := f"move.{port}"): root}
        moves.append(move)
    outputs = tuple(f"{REACTION}.{port}" for port in steps)
    ticks = Ticks.of(replace(drawn, placed=placed, sums=sums, inputs=(*drawn.inputs, *moves), exact=None), outputs)
    at = [ticks.maps[0].inputs.index(move) for move in moves]
    maps = [(tick_map.E, tick_map.B[..., at], tick_map.C, tick_map.D[..., at]) for tick_map in ticks.maps]
    reached = np.flatnonzero(read(maps))
    maps = [(E[..., reached, :][..., reached], B[..., reached, :], C[..., reached], D) for E, B, C, D in maps]
    at = [i for i, state in enumerate(reached) if ticks.states[state] == f"{device}.x"]
    return TickMaps.of(maps, ticks.kind, batch), at


def settled(lifted: LiftedMap, x) -> LiftedMap:
    """The map from displacements to forces of loops that settle, with its pole at z = 1 set apart.

    Nothing moves the position x but the displacements, and every other state of a responsive loop settles at R times x, so
    the states less R x follow `w s = E s + (G - R G_x) u`, without x. The force for a constant position is the stiffness k,
    the same in every part of a tick, so that x adds `k/w g^T g`, whose Hermitian part is `-k/2 g^T g` at every frequency, g
    being its row of G, the roots of the shares of these parts.
    """
    if not x:
        return lifted
    rest = np.setdiff1d(np.arange(lifted.E.shape[-1]), x)
    with np.errstate(all="ignore"):
        place = -_exact(lifted.E[:, rest][..., rest], lifted.E[:, rest][..., x])
        g = lifted.G[:, x]
        stiffness = g @ (lifted.O[..., x] + lifted.O[..., rest] @ place) / (g**2).sum(-1, keepdims=True)
        E, G, O = (matrix.copy() for matrix in (lifted.E, lifted.G, lifted.O))
        E[:, x, :], E[:, :, x], O[..., x] = 0.0, 0.0, 0.0
        E[:, x, x] = -1.0
        G[:, rest] -= place * lifted.G[:, x]
        return LiftedMap(E, lifted.T - stiffness * np.swapaxes(g, -1, -2) * g / 2, O, G)


def _exact(A, b):
    """The solution of A X = b, with refined inverses where it is real."""
    return solve(A, b) if np.iscomplexobj(A) else solved(A, 0 * A, b, 0 * b)[0]


def _responsive(lifted: LiftedMap, x) -> np.ndarray:
    """Whether the states other than the position x settle, `(loops,)`."""
    rest = np.setdiff1d(np.arange(lifted.E.shape[-1]), x)
    return is_stable(lifted.E[:, rest][..., rest]) if rest.size else np.isfinite(lifted.E).all((-1, -2))


POINTS = 33  # values tried first
CUTS = 15  # points of one round of refinement
TINY = 1e-300  # in place of a zero, which would take a state out of the loop
FINEST = 1e-10  # of the range, to which an end is refined


def runs_of(passive, span, more=()) -> tuple[np.ndarray, np.ndarray]:
    """Low and high ends of runs of values that pass, refined all together by multisection. A 0 is looked at by itself.

    more: values that are tried first, in addition to POINTS of them.
    """
    low, high = map(float, span)

    def passed(points):
        is_passive = np.zeros(points.size, bool)
        for zero_or_not in (np.flatnonzero(points == 0), np.flatnonzero(points != 0)):  # a zero takes a branch out of the loop
            if zero_or_not.size:
                is_passive[zero_or_not] = passive(points[zero_or_not])
        return is_passive

    # evenly in the square root: the soft end matters most, and 0 belongs to the range
    points = np.union1d(low + (high - low) * np.linspace(0, 1, POINTS) ** 2, more)
    good = passed(points)
    change = np.flatnonzero(good[1:] != good[:-1])
    inside, outside = (np.where(good[change] == kind, points[change], points[change + 1]) for kind in (True, False))
    while change.size and np.abs(inside - outside).max() > FINEST * (high - low):
        between = inside[:, None] + (outside - inside)[:, None] * np.arange(1, CUTS + 1) / (CUTS + 1)
        passed_between = passed(between.reshape(-1)).reshape(between.shape)
        count = np.where(passed_between.all(-1), CUTS, passed_between.argmin(-1))
        marks = np.concatenate([inside[:, None], between, outside[:, None]], axis=-1)
        inside, outside = (np.take_along_axis(marks, count[:, None] + step, -1)[:, 0] for step in (0, 1))
    rising = good[change + 1]
    lows = np.concatenate([points[:1][good[:1]], inside[rising]])
    highs = np.concatenate([inside[~rising], points[-1:][good[-1:]]])
    return lows, highs
