"""Passivity for all values of a number in an interval: the Hermitian part of a frame's map as a
function of number and angle.

On the circle the determinant of the Hermitian part of `T + O (w - E)^-1 G`, times `|det(w - E)|^2`,
is

    det(S) det(diag(w - E, w' - E') + [G; O'] S^-1 [O, G']),   S = T + T',   w = z - 1,   w' = 1/z - 1,

up to a factor (the determinant lemma). This is a polynomial in z and 1/z and analytic in the
number. If it is positive on a connected set of numbers and on the whole circle, then no eigenvalue
of the Hermitian part changes its sign there and no pole reaches the circle: so all loops are
passive if one of them is.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from wavesweep.engine.blocks import Block, MultirateLoop, Ports
from wavesweep.engine.frames import Bounded, Ticks, balance, inverse, on_circle, solve
from wavesweep.engine.intervals import FunctionValues
from wavesweep.engine.norms import SOFT, Element, LiftedMap, Peak, TickMaps, hinf_norm, read
from wavesweep.engine.response import Port
from wavesweep.haptics.held_loop import HeldLoop, device_keys
from wavesweep.passive.channel import channel_of

NEXT_TO_0 = 1e-7  # of the range, in place of a number of 0, which takes a branch out of the loop
EIGENVALUE_SLACK = 1e-11  # of the mean eigenvalue: accuracy of the smallest one
SURE_EIGENVALUE = 1e-9  # of the mean eigenvalue: what is surely not rounding
# of the largest eigenvalue, in which the smallest one may drown if a mode is slow
EIGENVALUE_NOISE = 2e-12
SKEW = 1e-9  # relative, of a compliance that counts as symmetric
DRIFT = 1e-14  # of the largest entry of a frame: an eigenvalue that is a drift
REACTION = "ports.push"  # the junction of the force that pushes the device, but for the hand's
# errors of the entries of a map of a frame, in roundings of the sizes of their terms
ENTRY_ROUNDINGS = 16.0

Covering = Callable[[object, list, int], Any]
"""From functions, a box of numbers and a count of points to its `Cover` (see
`engine.intervals`), None without a solution."""

Maps = Callable[[np.ndarray], tuple[LiftedMap, np.ndarray]]
"""From values of a number `(n,)`, real or complex, to the maps of a frame, and their pivots `(n,
k)` (see `Frames`)."""


def port_maps(loop: HeldLoop, path: str, span: tuple[float, float]) -> Maps:
    """The maps from the held force to the displacement at the hand along a number, apart at rest
    where a spring holds it."""
    hand = Ports.of_axes(loop.drawing)
    drift = loop.changed({path: inner_numbers(span)}).drift(watched=hand.signals)

    def maps(p):
        at = loop.changed({path: away_from_0(p, span)})
        with np.errstate(all="ignore"):
            port = Port.of(at.drawn(), hand, drift)
            of_displacement = slice(port.axes)
            maps_of_ticks = [
                (E, B, C[..., of_displacement, :], D[..., of_displacement, :])
                for E, B, C, D in port.maps
            ]
            ticks = TickMaps.of(maps_of_ticks, port.kind, p.shape)
            lifted = ticks.lifted(measured=False)
            if port.drifts < port.axes:
                lifted = apart_at_rest(lifted, port.position, port.held)
        return lifted, pivots_of(at, path, port.pivot, p.shape)

    return remembered(maps)


def reaction_maps(loop: HeldLoop, path: str, span: tuple[float, float]) -> Maps:
    """Maps whose Hermitian parts are positive where the loop is stable with every passive hand of
    at least this damping.

    In a tick a damper takes at least `d dx^2/T` for the displacement dx, whatever way it goes, and
    masses and springs take nothing in the end. The held force takes `f_m dx`. So all of it is
    passive for a continuous hand exactly when `d/T + C` is positive real, d (N*s/m) that of device
    and hand, C the lifted map from the frame's displacements to its forces. A dead time divides
    each tick in two parts, with a force f_i and a displacement dx_i in each; the damper takes at
    least `d dx_i^2/(l_i T)` in a part of l_i ticks, so C is the map from all `dx_i/sqrt(l_i)` to
    all `sqrt(l_i) f_i`. At one rate without one this is `b > K T/2 + |B|` (J. E. Colgate, G. G.
    Schenkel, Passivity of a class of sampled-data systems: application to haptic interfaces,
    Journal of Robotic Systems 14(1), 37-47, 1997). The condition at the port for held forces
    (`port_maps`) is weaker: it asks nothing of hands whose force moves within the tick, and lets
    the device's mass help. If the hand holds no single mass, or something reads the velocity of
    that mass, nothing bounds it: a point sample of the velocity can be anything at no cost in
    energy, so no damping bounds the work of its feedback.

    Of a controller with a drift at z = 1, the position prescribed, as waves without position
    feedback have one, the pole there is not set apart: no value is passive. A motion at a multiple
    of the slow rate aliases to a wave that moves the avatar, and the force that this builds up
    stays. At one rate there are no such motions.
    """

    def reactions(p):
        at = loop.changed({path: away_from_0(p, span)})
        drawn = at.drawn()
        with np.errstate(all="ignore"):
            ticks, x = reaction(at, drawn, p.shape)
            return (at, drawn), ticks.lifted(measured=False), x

    _, lifted, x = reactions(np.linspace(*inner_numbers(span), 3))
    rest = np.setdiff1d(np.arange(lifted.E.shape[-1]), x)
    of_rest = np.nan_to_num(lifted.E[:, rest][..., rest])
    slowest = np.abs(np.linalg.eigvals(of_rest)).min(-1, initial=np.inf)
    largest = np.abs(lifted.E).max((-1, -2), initial=0.0)
    drifts = (slowest <= DRIFT * largest).all()

    def maps(p):
        (at, drawn), lifted, x = reactions(p)
        if not drifts:
            with np.errstate(all="ignore"):
                lifted = settled(lifted, x)
        _, damping, _ = device_keys(at)
        paid = np.broadcast_to(damping / drawn.period, p.shape)
        T = lifted.T + paid[:, None, None] * np.eye(lifted.T.shape[-1])
        return replace(lifted, T=T), pivots_of(
            at, path, Ticks.of(drawn, alone=True).facts[0], p.shape
        )

    return remembered(maps)


def _ruler(device: str, parts: Collection[str]) -> Block:
    """A block in the place of the device, whose position is the sum of all displacements that enter."""
    n = len(parts)
    return Block(
        device,
        inputs=tuple(port.removeprefix(f"{device}.") for port in parts),
        outputs=("x", "v"),
        states=("x",),
        E=np.zeros((1, 1)),
        B=np.ones((1, n)),
        C=np.eye(2, 1),
        D=np.zeros((2, n)),
    )


def reaction(loop: HeldLoop, drawn: MultirateLoop, batch) -> tuple[TickMaps, list[int]]:
    """The ticks from the displacement of the device (m) to the force against it (N), and its
    position among the states.

    The device is a ruler: the hand's input is the displacement in the tick. Both have an entry for
    each part of the tick, a displacement over and a force times the root of its share; see
    `reaction_maps`. drawn: the blocks of the loops. States that the force does not depend on are
    left out.
    """
    device = loop.device
    force, *_ = loop.drawing.hand
    parts = loop.parts  # input of the device -> share of the tick
    ruler = _ruler(device, parts)
    placed = tuple(replace(p, block=ruler) if p.block.name == device else p for p in drawn.placed)
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
    with_ruler = replace(drawn, placed=placed, sums=sums, inputs=inputs, exact=None)
    ticks = Ticks.of(with_ruler, outputs)
    moved = [ticks.maps[0].inputs.index(move) for move in moves]
    maps = [(each.E, each.B[..., moved], each.C, each.D[..., moved]) for each in ticks.maps]
    kept = np.flatnonzero(read(maps))
    maps = [(E[..., kept, :][..., kept], B[..., kept, :], C[..., kept], D) for E, B, C, D in maps]
    x = [place for place, state in enumerate(kept) if ticks.states[state] == f"{device}.x"]
    return TickMaps.of(maps, ticks.kind, batch), x


def settled(lifted: LiftedMap, x) -> LiftedMap:
    """The map from displacements to forces of loops that settle, with its pole at z = 1 set apart.

    Nothing moves the position x but the displacements, and every other state of a responsive loop
    settles at R times x, so the states less R x follow `w s = E s + (G - R G_x) u`, without x. The
    force for a constant position is the stiffness k, the same in every part of a tick, so that x
    adds `k/w g^T g`, whose Hermitian part is `-k/2 g^T g` at every frequency, g being its row of G,
    the roots of the shares of these parts.
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
        T = lifted.T - k * g.mT * g / 2
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
    return Bounded.exact(A).solved(Bounded.exact(b)).value


def channel_maps(loop: HeldLoop, path: str, way: str, square: float) -> Maps:
    """Maps whose Hermitian parts are positive where a direction of the wave channel has a norm
    below the root of `square`."""

    def maps(p):
        at = loop.changed({path: p})
        channel = channel_of(at.drawing, at.values)
        ticks = getattr(channel, way)
        if ticks.loops != p.size:
            ticks = TickMaps.of(ticks.maps, ticks.kind, p.shape)
        lifted = bounded_by(ticks.lifted(measured=False), square)
        return lifted, pivots_of(at, path, Ticks.of(at.drawn(), alone=True).facts[0], p.shape)

    return remembered(maps)


def inner_numbers(span) -> np.ndarray:
    """The ends of a range, without 0."""
    return np.array([span[0] or NEXT_TO_0 * span[1], span[1]])


def away_from_0(p, span):
    """The number, but for values so near to 0 that rounding hides what they do."""
    return np.where(np.abs(p) < NEXT_TO_0 * span[1], NEXT_TO_0 * span[1], p)


def remembered(maps: Maps) -> Maps:
    """The same maps, which keep the last results: a proof asks for the same numbers at several
    angles."""
    cached = lru_cache(maxsize=64)(lambda numbers, kind: maps(np.frombuffer(numbers, kind)))
    return lambda p: cached(p.tobytes(), p.dtype.str)


def pivots_of(loop: HeldLoop, path: str, pivot: np.ndarray, shape) -> np.ndarray:
    """What has a zero where the maps are not analytic in the number, `(*shape, k)`; pivot: see
    `Ticks.facts`."""
    pivots = np.broadcast_to(np.asarray(pivot)[..., None], (*shape, 1))
    guards = loop.guards_at(path, shape)
    return np.concatenate([pivots, guards], axis=-1)


def apart_at_rest(lifted: LiftedMap, position: np.ndarray, held: np.ndarray) -> LiftedMap:
    """The map of a port whose position returns, without the zero that its Hermitian part has at
    rest.

    position: `(loops, axes, n)`, the rows of the position among the states; held: `(axes,
    directions)`, those in which it returns. Constant forces e, a column for each direction, move
    nothing in the end, and the displacements of a frame add up to the movement of the position, so
    e is in the null space of the Hermitian part at w = 0. In the directions of e the forces are
    multiplied by `1/(1/z - 1)` and the displacements by `1/(z - 1)`, which leaves the signs of the
    Hermitian part at all other angles. With the rest states r under e, and P the projection that
    takes e away,

        V = P T P + P O r e' + e c r e'/2 + (P O + e c) (w - E)^-1 (G P + (I + E) r e'),   c = held' position/sqrt(M).

    The compliance c r has to be symmetric, as that of springs and walls is; the map is NaN where it
    is not, since a port that a slow motion in circles takes energy from is not passive.
    """
    M = lifted.T.shape[-1] // len(held)
    e = np.kron(np.full((M, 1), M**-0.5), held)
    P = np.eye(len(e)) - e @ e.T
    c = held.T @ position * M**-0.5
    r = -solve(lifted.E, lifted.G @ e)
    compliance = c @ r
    difference = np.abs(compliance - compliance.mT).max((-1, -2))
    skew = difference > SKEW * np.abs(compliance).max((-1, -2))
    direct = P @ lifted.T @ P + (P @ lifted.O @ r) @ e.T + e @ compliance @ e.T / 2
    direct = np.where(skew[:, None, None], np.nan, direct)
    rows = P @ lifted.O + e @ c
    columns = lifted.G @ P + (r + lifted.E @ r) @ e.T
    return LiftedMap(lifted.E, direct, rows, columns)


def bounded_by(lifted: LiftedMap, square: float) -> LiftedMap:
    """A map whose Hermitian part is positive where the square of the norm of another one is below a
    value.

    The Hermitian part is half of `[[1, H], [H*, square]]`.
    """
    loops, p, m = lifted.T.shape
    T = np.zeros((loops, p + m, p + m), lifted.T.dtype)
    T[:, range(p + m), range(p + m)] = [0.5] * p + [square / 2] * m
    T[:, :p, p:] = lifted.T
    n = lifted.E.shape[-1]
    rows = np.concatenate([lifted.O, np.zeros((loops, m, n))], -2)
    columns = np.concatenate([np.zeros((loops, n, p)), lifted.G], -1)
    return LiftedMap(lifted.E, T, rows, columns)


@dataclass(frozen=True, slots=True, eq=False)
class Determinant:
    """The determinant above, as a function of the number and the angle (rad per frame): see
    `positive.Functions`."""

    maps: Maps

    def units(self, middle) -> np.ndarray:
        """The units in which the states have similar sizes, `(n,)`."""
        lifted, _ = self.maps(middle[:1])
        _, units = balance(np.abs(lifted.E), thorough=True)
        return units[0]

    def values(self, x, units):
        """Phase, logarithm, error and pivots at points `(n, 2)`."""
        numbers, place = np.unique(x[:, 0], return_inverse=True)
        lifted, pivots = self.maps(numbers if numbers.imag.any() else numbers.real)
        n = len(units)
        E = lifted.E * (units / units[:, None])
        O = lifted.O * units
        G = lifted.G / units[:, None]
        S = lifted.T + lifted.T.mT
        rows = np.concatenate([G, O.mT], axis=-2)
        half = solve(S, np.concatenate([O, G.mT], axis=-1))
        # [G; O'] S^-1 [O, G'] - diag(E, E'), and the sizes of the terms of its entries
        inner = rows @ half
        size = ENTRY_ROUNDINGS * np.abs(rows) @ np.abs(half)
        for block, matrices in ((slice(n), E), (slice(n, None), E.mT)):
            inner[:, block, block] -= matrices
            size[:, block, block] += ENTRY_ROUNDINGS * np.abs(matrices)
        # diag(w, w') is added at each angle
        at = inner[place].astype(complex)
        w = on_circle(np.stack([x[:, 1], -x[:, 1]]))
        at[:, range(2 * n), range(2 * n)] += np.repeat(w, n, axis=0).T
        phase_of_S, log_of_S = np.linalg.slogdet(S)
        phase, log = np.linalg.slogdet(at)
        # To first order, the relative change of a determinant is the trace of the inverse times
        # the change of the matrix.
        error = (np.abs(inverse(at).mT) * size[place]).sum((-1, -2))
        return FunctionValues(
            (phase_of_S[place] * phase)[None],
            (log_of_S[place] + log)[None],
            error[None],
            pivots[place],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Witness:
    """What takes energy at one angle, as a function of the number: `-v* He v` for the worst
    direction v at `number`."""

    maps: Maps
    number: float
    theta: float

    def units(self, middle) -> np.ndarray:  # noqa: ARG002
        """The direction, `(m,)`."""
        (hermitian,), _, _ = self.hermitian(np.array([self.number]))
        _, vectors = np.linalg.eigh(hermitian)
        return vectors[:, 0]

    def values(self, x, units):
        """Phase, logarithm, error and pivots at points `(n, 1)`."""
        hermitian, size, pivots = self.hermitian(x[:, 0])
        value = -units.conj() @ hermitian @ units
        modulus = np.abs(value)
        error = ENTRY_ROUNDINGS * np.abs(units) @ size @ np.abs(units) / modulus
        return FunctionValues((value / modulus)[None], np.log(modulus)[None], error[None], pivots)

    def hermitian(self, numbers):
        """The Hermitian part at the angle, continued to complex numbers, the sizes of its terms,
        and the pivots."""
        lifted, pivots = self.maps(numbers)
        ahead, size_ahead = with_sizes(lifted, np.array([self.theta]))
        back, size_back = with_sizes(lifted, np.array([-self.theta]))
        hermitian = (ahead + back.mT) / 2
        size = (size_ahead + size_back.mT) / 2
        return hermitian, size, pivots


def with_sizes(lifted: LiftedMap, theta) -> tuple[np.ndarray, np.ndarray]:
    """The maps at angles, real or complex, `(loops, p, m)`, and the sizes of the terms of their
    entries."""
    A = on_circle(theta)[:, None, None] * np.eye(lifted.E.shape[-1]) - lifted.E
    back = inverse(A)
    moved = back @ lifted.G
    terms = np.abs(back) @ (np.abs(A) @ np.abs(moved) + np.abs(lifted.G))
    return lifted.T + lifted.O @ moved, np.abs(lifted.T) + np.abs(lifted.O) @ terms


def least(lifted: LiftedMap, sure: float = SURE_EIGENVALUE) -> Peak:
    """The smallest eigenvalue of the Hermitian part over all angles, with its sign changed, for
    each of some loops.

    sure: of its size, from which on it is surely negative, and a smaller one is not looked for. Accuracy: EIGENVALUE_NOISE of the
    largest eigenvalue at the same angle, by which it may be too large.
    """
    size = np.abs(np.diagonal(lifted.T, axis1=-2, axis2=-1)).mean(-1)

    def negative(owner, theta, _level):
        return np.nan_to_num(-lifted.smallest(owner, theta, EIGENVALUE_NOISE), nan=-np.inf)

    def crossed(owner, level):
        T = lifted.T[owner]
        direct = T + T.mT + 2 * level[:, None, None] * np.eye(T.shape[-1])
        E = lifted.E[owner]
        back = lifted.O[owner].mT
        return Element.of(np.eye(E.shape[-1]) + E, lifted.G[owner], 0.0, back, direct).angles()

    def slack(owner, _level):
        return EIGENVALUE_SLACK * size[owner]

    return hinf_norm(negative, crossed, len(size), slack, SOFT, sure * size)
