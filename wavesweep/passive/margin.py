"""The margin of passivity at the hand's port, and the damping that a device would have to have more for it."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.energy.hinf import SOFT, angles, hinf_norm
from wavesweep.engine.energy.lifted_map import TickMaps
from wavesweep.engine.errors import UsageError
from wavesweep.engine.monodromy.unit_circle import solve
from wavesweep.engine.stability.spectrum import count_outside, eigenvalues, is_stable
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.held_loop import HeldLoop

SLACK = 1e-10  # of the margin and of the mean eigenvalue: accuracy of the margin
TOLERANCE = 1e-9  # of the mean eigenvalue: a margin that is negative by more than this is so beyond rounding
FAINT = 256 * np.finfo(float).eps  # of the mean eigenvalue: smaller margins are 0 up to rounding
ALIKE = 0.5  # values are alike if each is at least this share of the others
SURE = 1e-8  # of the margin and of the mean: rounding of the ticks moves a known margin by no more
SHARE = 1 / 16  # of a coupling at rest: rounding of the ticks moves a known coupling by no more
SHAKES = 4  # other roundings of the ticks that are tried
SLOW = 5e-3  # distance of an eigenvalue from 1 below which its mode may have a peak next to rest
HUGE = 1e10  # an unstable loop that grows by this much in a frame keeps no digit worth reporting
LONGEST = 1000  # ticks; the map of a frame is a matrix of that size


@dataclass(frozen=True, slots=True, eq=False)
class PortMargin:
    """The hand's port, arrays over the batch of the loops.

    margin: smallest eigenvalue, over all frequencies, of the Hermitian part of the lifted map from the held force to
    the displacement in the tick, m/N; NaN for a loop so unstable that a frame of it overflows, or nearly, and for one in which
    rounding leaves no digits of it. omega: its frequency, rad/s, in [0, pi/T_s]. mean: of all eigenvalues over all frequencies
    (T^2/2m and a little less), which is the natural scale, m/N. stable: every eigenvalue but drift inside the unit circle.
    certified: no frequency has an eigenvalue below the margin by more than SLACK of it and of the mean. negative: the margin
    is below zero, and not for rounding's sake.
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


def port_margin(loop: HeldLoop, *, decide: bool = False) -> PortMargin:
    """Margin of positive realness at the hand's port for every loop of the batch.

    decide: only whether ports are passive matters, so the search ends where a margin is surely negative.
    A held force does the work `f_h[k] (x[k+1] - x[k])` in a tick, so the loop is passive exactly when the lifted map between
    the two is positive real. Not a grid: the level just below the margin is shown to be met at no frequency (`hinf_norm`,
    on the frame's `Element`, see `hinf`).
    Errors: UsageError for a frame of more than LONGEST ticks. Accuracy: 1e-10 of the margin and of the mean eigenvalue.
    """
    drawn, batch = loop.drawn(), loop.batch
    port = loop.port(drawn)
    M = port.kind.size
    if M * port.axes > LONGEST:
        problem = f"{M}" if port.axes == 1 else f"{M} of {port.axes} axes"
        raise UsageError(f"expected a frame of at most {LONGEST // port.axes} ticks for passivity, found {problem}")
    problem = _margins(port, batch, decide)
    unsure = np.isnan(port.maps[0][0]).all((-1, -2)).reshape(-1)
    for at in np.flatnonzero(unsure).tolist() if batch else ():
        alone = _margins(loop.at(at).port(), (), decide)  # with the drift of its own numbers
        for name in PortMargin.__slots__:
            getattr(problem, name)[at] = getattr(alone, name)[0]
    period = np.broadcast_to(np.real(drawn.period) * M, batch)
    arrays = {name: getattr(problem, name).reshape(batch) for name in PortMargin.__slots__}
    return PortMargin(**arrays | {"omega": arrays["omega"] / period})


def _margins(port, batch, decide) -> PortMargin:
    """The margins of a flat batch, with angles in rad per frame in place of frequencies."""
    maps = TickMaps.of([(E, B, C[..., : port.axes, :], D[..., : port.axes, :]) for E, B, C, D in port.maps], port.kind, batch)
    ticks = maps.in_even_units()
    lifted = ticks.lifted()
    E, mean = lifted.E, lifted.mean
    finite = np.isfinite(E).all((-1, -2))
    safe = np.where(finite[:, None, None], E, 0.0)
    stable = finite & is_stable(E)
    # an eigenvalue on the circle but for rounding is a pole of the map
    lost = ~finite | ~count_outside(safe)[1] | (~stable & (np.abs(safe).max((-1, -2), initial=0.0) > HUGE))
    rows = np.flatnonzero(~lost)
    margins = PortMargin(
        *(np.full(lost.size, np.nan) for _ in range(2)), mean, stable, *(np.zeros(lost.size, bool) for _ in "cn")
    )
    if not rows.size:
        return margins
    known_ticks, few = ticks.at(rows), replace(lifted, E=E[rows], T=lifted.T[rows], O=lifted.O[rows], G=lifted.G[rows])
    scale = mean[rows]
    peak = hinf_norm(
        lambda owner, theta, _: np.nan_to_num(-few.smallest(owner, theta), nan=-np.inf),
        lambda owner, level: angles(known_ticks.pencil(owner, -level)),
        rows.size,
        lambda owner, level: SLACK * (np.abs(level) + scale[owner]),
        _slow_angles(E[rows]),
        TOLERANCE * scale if decide else np.inf,
    )
    margin, theta = -peak.value, peak.theta
    at_rest = few.smallest(np.arange(rows.size), np.zeros(rows.size))
    # Beside a peak at rest the response is the same but for rounding, and less well known.
    theta = np.where(at_rest <= margin + SLACK * (np.abs(margin) + scale), 0.0, theta)
    if port.drifts < port.axes:  # something holds the scene, so a constant force, of some direction, moves nothing
        theta, margin = np.where(margin > 0, 0.0, theta), np.minimum(margin, 0.0)
    certain, below = np.ones(rows.size, bool), margin < -TOLERANCE * scale
    open_ = np.flatnonzero(~below) if decide else np.arange(rows.size)
    if open_.size:
        at = rows[open_]
        certain[open_], below[open_] = _beyond_rounding(maps.at(at), port, at, peak.theta[open_], margin[open_], scale[open_])
    margin = np.where(certain & np.isfinite(margin), np.where(below | (margin > FAINT * scale), margin, 0.0), np.nan)
    free = port.drifts == port.axes and ticks.kind.size > 1
    at = np.flatnonzero(free & (margin >= -TOLERANCE * scale) & (~below | (theta == 0)))
    if at.size:
        rest = _dragged(maps.at(rows[at]), port, rows[at], scale[at])
        at, rest = at[rest < 0], rest[rest < 0]
        margin[at], theta[at], below[at] = rest, 0.0, True
    margins.margin[rows], margins.omega[rows] = margin, np.where(np.isnan(margin), np.nan, theta)
    margins.certified[rows], margins.negative[rows] = peak.certified, below
    return margins


def _slow_angles(E):
    """Angles that are tried first for each loop, `(loops, any)`: those of SOFT if it has a mode that slow."""
    delta, _ = eigenvalues(E)
    slow = (np.abs(delta) < SLOW).any(-1)
    return np.where(slow[:, None], SOFT, np.nan) if slow.any() else ()


def _beyond_rounding(ticks, port, loops, theta, margin, mean):
    """Whether margins are known, and whether they are negative, whatever the rounding of the ticks, `(loops,)` both.

    The ticks are computed again with entries that differ by roundings of their terms. A small margin is negative if it stays
    so, and alike; up to FAINT of the mean it may be zero.
    """
    shaken = _shaken(ticks, port, loops).in_even_units().lifted(measured=False)
    again = shaken.smallest(np.arange(SHAKES * loops.size), np.tile(theta, SHAKES))
    values = np.concatenate([margin, again]).reshape(1 + SHAKES, -1)
    most, least = values.max(0), values.min(0)
    certain = most - least <= SURE * (mean + np.abs(margin))
    below = (margin < -TOLERANCE * mean) | ((most < -FAINT * mean) & (most <= ALIKE * least))
    return certain, certain & below


def _dragged(ticks, port, loops, mean):
    """The margin at rest of ports that it shows not to be passive, however little, otherwise 0, `(loops,)`.

    A motion at a multiple of the slow rate may drag along what a constant force e, in one of the directions of the axes that do
    not act on each other at rest, does not move. At rest the Hermitian part S
    has then a 0 for e, and a coupling p of it to other forces: its least eigenvalue is `-p' (S + e e')^-1 p`, to first order in
    that, and negative however small p is, where rounding would hide an eigenvalue.
    """
    constant = np.kron(np.full((ticks.kind.size, 1), ticks.kind.size**-0.5), np.eye(port.axes))

    def at_rest(some, e):
        lifted, back = some.in_even_units().lifted(measured=False), np.swapaxes(e, -1, -2)
        X = solve(-lifted.E, lifted.G)
        both = (lifted.T @ e + lifted.O @ (X @ e) + np.swapaxes(back @ lifted.T + (back @ lifted.O) @ X, -1, -2)) / 2
        return lifted.T + lifted.O @ X if some is ticks else None, back @ both, both - e @ (back @ both)

    def along(e):
        (H, still, p), (*_, again) = at_rest(ticks, e), at_rest(shaken, np.tile(e, (SHAKES, 1, 1)))
        size, moved = np.linalg.norm(p, axis=(-1, -2)), np.linalg.norm(again.reshape(SHAKES, *p.shape) - p, axis=(-1, -2))
        S = (H + np.swapaxes(H, -1, -2)) / 2 + mean[:, None, None] * e @ np.swapaxes(e, -1, -2)
        rest = -(np.swapaxes(p, -1, -2) @ solve(S, p))[:, 0, 0]
        dragged = (np.abs(still[:, 0, 0]) <= TOLERANCE * mean) & (moved.max(0) <= SHARE * size)
        return np.where(dragged, np.minimum(np.fmax(rest, -size), -np.finfo(float).tiny), 0.0)

    with np.errstate(all="ignore"):
        shaken, still = _shaken(ticks, port, loops), np.nan_to_num(at_rest(ticks, constant)[1])
        directions = constant @ np.linalg.eigh((still + np.swapaxes(still, -1, -2)) / 2)[1]
        return np.minimum.reduce([along(directions[..., k : k + 1]) for k in range(port.axes)])


def _shaken(ticks, port, loops):
    """The ticks of some loops SHAKES times, one after the other, each time with other roundings of their entries."""
    maps, batch = [], ticks.loops
    for number, (tick_matrices, sizes) in enumerate(zip(ticks.maps, port.sizes, strict=True)):
        rows, moved = (sizes[0], sizes[1], sizes[2][..., : port.axes, :], sizes[3][..., : port.axes, :]), []
        for place, (matrix, size) in enumerate(zip(tick_matrices, rows, strict=True)):
            sizes_of = size.reshape(-1, *size.shape[-2:])
            error = np.finfo(float).eps * (sizes_of[loops] if len(sizes_of) > 1 else sizes_of)
            at = np.arange(SHAKES * matrix[0].size).reshape(SHAKES, 1, *matrix.shape[1:])
            signs = np.sign(np.sin(1.0 + 7 * number + place + at**2 % 97))  # fixed, without a structure that entries may have
            moved.append((matrix + signs * error).reshape(SHAKES * batch, *matrix.shape[1:]))
        maps.append(tuple(moved))
    return TickMaps(tuple(maps), ticks.kind)


MOST_DAMPING, LEAST_DAMPING = 1e4, 1e-4  # N*s/m: no device has more, and less makes no difference
CLOSE = 1e-3  # relative width of the bracket that is left


def more_damping(loop: HeldLoop, margin: PortMargin | None = None) -> np.ndarray:
    """Additional device damping (N*s/m) with which the hand's port is passive; 0 if it is, NaN if MOST_DAMPING is not enough.

    NaN as well if the hand holds no single mass, so that no block is the device. margin: that of the loops, if it is known. The
    bracket is halved on a logarithmic scale, each time over all frequencies, and its upper end is given: the port is passive
    with it. That less damping is not enough holds for the lower end, and below it if passivity is not lost again with damping,
    which no random loop showed. A hand that also moves within the tick needs more: see `damping_needed`.
    Accuracy: CLOSE relative, from above.
    """
    margin = port_margin(loop) if margin is None else margin
    needed = np.where(margin.passive, 0.0, np.nan).reshape(-1)
    if loop.device is None:
        return needed.reshape(margin.margin.shape)
    loop, batch = loop.with_hand(), loop.batch
    arrays = {path: np.broadcast_to(v, batch).reshape(-1) for path, v in loop.values.items() if np.ndim(v)}
    damping = np.broadcast_to(loop.values[HAND[1]], batch).reshape(-1)

    def passive(index, more):
        return port_margin(
            loop.changed({path: v[index] for path, v in arrays.items()} | {HAND[1]: damping[index] + more}), decide=True
        ).passive

    index = np.flatnonzero(np.isnan(needed))
    if index.size:
        index = index[passive(index, np.full(index.size, MOST_DAMPING))]
    low, high = np.full(index.size, LEAST_DAMPING), np.full(index.size, MOST_DAMPING)
    while index.size and np.any(high > low * (1 + CLOSE)):
        middle = np.sqrt(low * high)
        enough = passive(index, middle)
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    needed[index] = high
    return needed.reshape(margin.margin.shape)
