"""Stability with every passive hand: the damping that it needs; and a finder of intervals in which something holds."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.blocks import Block, MultirateLoop
from wavesweep.engine.frames import Ticks, solve
from wavesweep.engine.norms import LiftedMap, TickMaps, damping_peak, read
from wavesweep.engine.poles import is_stable
from wavesweep.engine.response import solved
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
    drawn = loop.drawn()
    batch = loop.batch
    ticks, x = reaction(loop, drawn, batch)
    lifted = ticks.lifted()
    responsive = _responsive(lifted, x)
    apart = settled(lifted, x)
    chosen = {}
    for name in LiftedMap.__slots__:
        settles = responsive[:, None, None]
        chosen[name] = np.where(settles, getattr(apart, name), getattr(lifted, name))
    lifted = LiftedMap(**chosen)
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
    device = loop.device
    force, *_ = loop.drawing.hand
    parts = loop.parts  # input of the device -> share of the tick
    n = len(parts)
    ruler = Block(
        device,
        inputs=tuple(port.removeprefix(f"{device}.") for port in parts),
        outputs=("x", "v"),
        states=("x",),
        E=np.zeros((1, 1)),
        B=np.ones((1, n)),
        C=np.eye(2, 1),
        D=np.zeros((2, n)),
    )
    placed = []
    for placed_block in drawn.placed:
        if placed_block.block.name == device:
            placed.append(replace(placed_block, block=ruler))
        else:
            placed.append(placed_block)
    sums = dict(drawn.sums)
    moves = []
    pushed = {}  # what pushes the device from this part of the tick on
    for port, share in parts.items():
        root = np.sqrt(share)
        for signal, gain in drawn.sums[port].items():
            if signal != force:
                pushed[signal] = -gain
        sums[f"{REACTION}.{port}"] = {signal: root * gain for signal, gain in pushed.items()}
        move = f"move.{port}"
        sums[port] = {move: root}
        moves.append(move)
    inputs = (*drawn.inputs, *moves)
    outputs = tuple(f"{REACTION}.{port}" for port in parts)
    with_ruler = replace(drawn, placed=tuple(placed), sums=sums, inputs=inputs, exact=None)
    ticks = Ticks.of(with_ruler, outputs)
    moved = [ticks.maps[0].inputs.index(move) for move in moves]
    maps = [(each.E, each.B[..., moved], each.C, each.D[..., moved]) for each in ticks.maps]
    kept = np.flatnonzero(read(maps))
    maps = [(E[..., kept, :][..., kept], B[..., kept, :], C[..., kept], D) for E, B, C, D in maps]
    x = [place for place, state in enumerate(kept) if ticks.states[state] == f"{device}.x"]
    return TickMaps.of(maps, ticks.kind, batch), x


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
        of_rest = lifted.E[:, rest]
        R = -_exact(of_rest[..., rest], of_rest[..., x])
        g = lifted.G[:, x]
        force = lifted.O[..., x] + lifted.O[..., rest] @ R
        k = g @ force / (g**2).sum(-1, keepdims=True)
        T = lifted.T - k * np.swapaxes(g, -1, -2) * g / 2
        E = lifted.E.copy()
        E[:, x, :] = 0.0
        E[:, :, x] = 0.0
        E[:, x, x] = -1.0
        O = lifted.O.copy()
        O[..., x] = 0.0
        G = lifted.G.copy()
        G[:, rest] -= R * g
        return LiftedMap(E, T, O, G)


def _exact(A, b):
    """The solution of A X = b, with refined inverses where it is real."""
    if np.iscomplexobj(A):
        return solve(A, b)
    X, _ = solved(A, 0 * A, b, 0 * b)
    return X


def _responsive(lifted: LiftedMap, x) -> np.ndarray:
    """Whether the states other than the position x settle, `(loops,)`."""
    rest = np.setdiff1d(np.arange(lifted.E.shape[-1]), x)
    if not rest.size:
        return np.isfinite(lifted.E).all((-1, -2))
    return is_stable(lifted.E[:, rest][..., rest])


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
        # A zero takes a branch out of the loop, and is asked about by itself.
        for alike in (np.flatnonzero(points == 0), np.flatnonzero(points != 0)):
            if alike.size:
                is_passive[alike] = passive(points[alike])
        return is_passive

    # evenly in the square root: the soft end matters most, and 0 belongs to the range
    points = np.union1d(low + (high - low) * np.linspace(0, 1, POINTS) ** 2, more)
    good = passed(points)
    change = np.flatnonzero(good[1:] != good[:-1])
    before = points[change]
    after = points[change + 1]
    inside = np.where(good[change], before, after)
    outside = np.where(good[change], after, before)
    while change.size and np.abs(inside - outside).max() > FINEST * (high - low):
        away = (outside - inside)[:, None]
        between = inside[:, None] + away * np.arange(1, CUTS + 1) / (CUTS + 1)
        passed_between = passed(between.reshape(-1)).reshape(between.shape)
        count = np.where(passed_between.all(-1), CUTS, passed_between.argmin(-1))
        marks = np.concatenate([inside[:, None], between, outside[:, None]], axis=-1)
        inside = np.take_along_axis(marks, count[:, None], -1)[:, 0]
        outside = np.take_along_axis(marks, count[:, None] + 1, -1)[:, 0]
    rising = good[change + 1]
    lows = np.concatenate([points[:1][good[:1]], inside[rising]])
    highs = np.concatenate([inside[~rising], points[-1:][good[-1:]]])
    return lows, highs
