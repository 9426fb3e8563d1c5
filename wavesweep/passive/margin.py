"""The margin of passivity at the hand's port, and the damping that a device would have to have
more for it."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.doubles import EPS, LEAST_NORMAL
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import solve
from wavesweep.engine.norms import NORM_TOLERANCE, SOFT, TickMaps, hinf_norm
from wavesweep.engine.poles import count_outside, eigenvalues, is_stable
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.held_loop import HeldLoop

# of the mean eigenvalue: a margin that is negative by more than this is so beyond rounding
ZERO_MARGIN = 1e-9
# of the mean eigenvalue: smaller margins are 0 up to rounding
FAINT_MARGIN = 256 * EPS
SIMILAR_VALUES = 0.5  # values are alike if each is at least this share of the others
# of the margin and of the mean: rounding of the ticks moves a known margin by no more
SURE_MARGIN = 1e-8
# of a coupling at rest: rounding of the ticks moves a known coupling by no more
COUPLING_SHARE = 1 / 16
SHAKES = 4  # other roundings of the ticks that are tried
LONGEST_MAP = 1000  # ticks; the map of a frame is a matrix of that size


@dataclass(frozen=True, slots=True, eq=False)
class PortMargin:
    """The hand's port, arrays over the batch of the loops.

    margin: smallest eigenvalue, over all frequencies, of the Hermitian part of the lifted map from
    the held force to the displacement in the tick, m/N; NaN for a loop so unstable that a frame of
    it overflows, or nearly, and for one in which rounding leaves no digits of it. omega: its
    frequency, rad/s, in [0, pi/T_s]. mean: of all eigenvalues over all frequencies (T^2/2m and a
    little less), which is the natural scale, m/N. stable: every eigenvalue but drift inside the
    unit circle. certified: no frequency has an eigenvalue below the margin by more than
    NORM_TOLERANCE of it and of the mean. negative: the margin is below zero, and not for rounding's
    sake.
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

        The margin is zero, not positive, if a spring holds the scene: a constant force then moves
        nothing, and at zero frequency the map has a zero row and column. So zero has to pass, and
        so has rounding about it.
        """
        return self.stable & ~self.negative & ~np.isnan(self.margin)


def port_margin(loop: HeldLoop, *, decide: bool = False) -> PortMargin:
    """Margin of positive realness at the hand's port for every loop of the batch.

    decide: only whether ports are passive matters, so the search ends where a margin is surely
    negative. A held force does the work `f_h[k] (x[k+1] - x[k])` in a tick, so the loop is passive
    exactly when the lifted map between the two is positive real. Not a grid: the level just below
    the margin is shown to be met at no frequency (`hinf_norm`, on the frame's `Element`, see
    `hinf`). Errors: UsageError for a frame of more than LONGEST_MAP ticks. Accuracy: 1e-10 of the
    margin and of the mean eigenvalue.
    """
    drawn = loop.drawn()
    batch = loop.batch
    port = loop.port(drawn)
    ticks = port.kind.size
    if ticks * port.axes > LONGEST_MAP:
        found = f"{ticks}" if port.axes == 1 else f"{ticks} of {port.axes} axes"
        raise UsageError(
            f"expected a frame of at most {LONGEST_MAP // port.axes} ticks for passivity, found {found}"
        )
    margins = _margins(port, batch, decide)
    if batch:
        # Loops whose drift is not that of the batch: each with the drift of its own numbers.
        unsure = np.isnan(port.maps[0][0]).all((-1, -2)).reshape(-1)
        for at in np.flatnonzero(unsure).tolist():
            alone = _margins(loop.at(at).port(), (), decide)
            for name in PortMargin.__slots__:
                getattr(margins, name)[at] = getattr(alone, name)[0]
    period = np.broadcast_to(np.real(drawn.period) * ticks, batch)
    arrays = {name: getattr(margins, name).reshape(batch) for name in PortMargin.__slots__}
    arrays["omega"] = arrays["omega"] / period
    return PortMargin(**arrays)


def _margins(port, batch, decide) -> PortMargin:
    """The margins of a flat batch, with angles in rad per frame in place of frequencies."""
    # rows of the outputs; the others are the force against the hand
    of_displacement = slice(port.axes)
    seen = []
    for E, B, C, D in port.maps:
        seen.append((E, B, C[..., of_displacement, :], D[..., of_displacement, :]))
    maps = TickMaps.of(seen, port.kind, batch)
    ticks = maps.in_even_units()
    lifted = ticks.lifted()
    E = lifted.E
    finite = np.isfinite(E).all((-1, -2))
    safe = np.where(finite[:, None, None], E, 0.0)
    stable = finite & is_stable(E)
    # An eigenvalue on the circle but for rounding is a pole of the map.
    _, clear = count_outside(safe)
    # An unstable loop that grows by this much in a frame keeps no digit worth reporting.
    grown = ~stable & (np.abs(safe).max((-1, -2), initial=0.0) > 1e10)
    lost = ~finite | ~clear | grown
    margins = PortMargin(
        margin=np.full(lost.size, np.nan),
        omega=np.full(lost.size, np.nan),
        mean=lifted.mean,
        stable=stable,
        certified=np.zeros(lost.size, bool),
        negative=np.zeros(lost.size, bool),
    )
    rows = np.flatnonzero(~lost)
    if not rows.size:
        return margins
    scale = lifted.mean[rows]
    few = replace(lifted, E=E[rows], T=lifted.T[rows], O=lifted.O[rows], G=lifted.G[rows])
    peak = _least_eigenvalues(ticks.at(rows), few, scale, decide)
    margin = -peak.value
    theta = peak.theta
    # Beside a peak at rest the response is the same but for rounding, and less well known.
    at_rest = few.smallest(np.arange(rows.size), np.zeros(rows.size))
    theta = np.where(at_rest <= margin + NORM_TOLERANCE * (np.abs(margin) + scale), 0.0, theta)
    if port.drifts < port.axes:
        # Something holds the scene, so a constant force, of some direction, moves nothing.
        theta = np.where(margin > 0, 0.0, theta)
        margin = np.minimum(margin, 0.0)
    # certain: its digits stand. below: it is negative beyond rounding. told: its sign is known.
    certain = np.ones(rows.size, bool)
    below = margin < -ZERO_MARGIN * scale
    asked = np.flatnonzero(~below) if decide else np.arange(rows.size)
    if asked.size:
        at = rows[asked]
        certain[asked], below[asked] = _beyond_rounding(
            maps.at(at), port, at, peak.theta[asked], margin[asked], scale[asked]
        )
    told = below | (margin > FAINT_MARGIN * scale)
    margin = np.where(certain & np.isfinite(margin), np.where(told, margin, 0.0), np.nan)
    # What is held is back after a frame at rest whatever the forces: its displacements add up to 0,
    # and nothing is dragged along. A free scene may be, if its frame has several ticks.
    free = port.drifts == port.axes and ticks.kind.size > 1
    not_negative = margin >= -ZERO_MARGIN * scale
    at = np.flatnonzero(free & not_negative & (~below | (theta == 0)))
    if at.size:
        rest = _dragged(maps.at(rows[at]), port, rows[at], scale[at])
        at = at[rest < 0]
        margin[at] = rest[rest < 0]
        theta[at] = 0.0
        below[at] = True
    margins.margin[rows] = margin
    margins.omega[rows] = np.where(np.isnan(margin), np.nan, theta)
    margins.certified[rows] = peak.certified
    margins.negative[rows] = below
    return margins


def _least_eigenvalues(ticks, lifted, scale, decide):
    """The least eigenvalues over all angles of the Hermitian parts, as peaks of their negatives.

    scale: the mean eigenvalue of each loop. decide: whether a search ends below a margin that is
    surely negative.
    """

    def negative(owner, theta, _level):
        return np.nan_to_num(-lifted.smallest(owner, theta), nan=-np.inf)

    def crossed(owner, level):
        return ticks.pencil(owner, -level).angles()

    def slack(owner, level):
        return NORM_TOLERANCE * (np.abs(level) + scale[owner])

    enough = ZERO_MARGIN * scale if decide else np.inf
    return hinf_norm(negative, crossed, scale.size, slack, _slow_angles(lifted.E), enough)


def _slow_angles(E):
    """Angles that are tried first for each loop, `(loops, any)`: those of SOFT if it has a mode
    that slow."""
    delta, _ = eigenvalues(E)
    # An eigenvalue this near to 1 may have a peak next to rest.
    slow = (np.abs(delta) < 5e-3).any(-1)
    if slow.any():
        return np.where(slow[:, None], SOFT, np.nan)
    return ()


def _beyond_rounding(ticks, port, loops, theta, margin, mean):
    """Whether margins are known, and whether they are negative, whatever the rounding of the ticks,
    `(loops,)` both.

    The ticks are computed again with entries that differ by roundings of their terms. A small
    margin is negative if it stays so, and alike; up to FAINT_MARGIN of the mean it may be zero.
    """
    shaken = _shaken(ticks, port, loops).in_even_units().lifted(measured=False)
    again = shaken.smallest(np.arange(SHAKES * loops.size), np.tile(theta, SHAKES))
    values = np.concatenate([margin, again]).reshape(1 + SHAKES, -1)
    most = values.max(0)
    least = values.min(0)
    certain = most - least <= SURE_MARGIN * (mean + np.abs(margin))
    stays_so = (most < -FAINT_MARGIN * mean) & (most <= SIMILAR_VALUES * least)
    below = (margin < -ZERO_MARGIN * mean) | stays_so
    return certain, certain & below


def _dragged(ticks, port, loops, mean):
    """The margin at rest of ports that it shows not to be passive, however little, otherwise 0,
    `(loops,)`.

    A motion at a multiple of the slow rate may drag along what a constant force e, in one of the
    directions of the axes that do not act on each other at rest, does not move. At rest the
    Hermitian part S has then a 0 for e, and a coupling p of it to other forces: its least
    eigenvalue is `-p' (S + e e')^-1 p`, to first order in that, and negative however small p is,
    where rounding would hide an eigenvalue.
    """
    ticks_of_frame = ticks.kind.size
    constant = np.kron(np.full((ticks_of_frame, 1), ticks_of_frame**-0.5), np.eye(port.axes))
    with np.errstate(all="ignore"):
        shaken = _shaken(ticks, port, loops)
        _, coupling, _ = _at_rest(ticks, constant)
        still = np.nan_to_num(coupling)
        _, vectors = np.linalg.eigh((still + still.mT) / 2)
        directions = constant @ vectors
        least = [
            _dragged_along(directions[..., k : k + 1], ticks, shaken, mean)
            for k in range(port.axes)
        ]
        return np.minimum.reduce(least)


def _dragged_along(e, ticks, shaken, mean):
    """`_dragged` for constant forces in one direction e, `(loops, forces, 1)`."""
    H, still, p = _at_rest(ticks, e)
    *_, again = _at_rest(shaken, np.tile(e, (SHAKES, 1, 1)))
    size = np.linalg.norm(p, axis=(-1, -2))
    moved = np.linalg.norm(again.reshape(SHAKES, *p.shape) - p, axis=(-1, -2))
    S = (H + H.mT) / 2 + mean[:, None, None] * e @ e.mT
    rest = -(p.mT @ solve(S, p))[:, 0, 0]
    moves_nothing = np.abs(still[:, 0, 0]) <= ZERO_MARGIN * mean
    dragged = moves_nothing & (moved.max(0) <= COUPLING_SHARE * size)
    negative = np.minimum(np.fmax(rest, -size), -LEAST_NORMAL)
    return np.where(dragged, negative, 0.0)


def _at_rest(ticks, e):
    """The map at rest, what of the Hermitian part constant forces e share, and its coupling of e
    to other forces."""
    lifted = ticks.in_even_units().lifted(measured=False)
    back = e.mT
    X = solve(-lifted.E, lifted.G)
    from_e = lifted.T @ e + lifted.O @ (X @ e)
    to_e = back @ lifted.T + (back @ lifted.O) @ X
    both = (from_e + to_e.mT) / 2
    still = back @ both
    return lifted.T + lifted.O @ X, still, both - e @ still


def _shaken(ticks, port, loops):
    """The ticks of some loops SHAKES times, one after the other, each time with other roundings
    of their entries."""
    batch = ticks.loops
    maps = []
    for number, (tick_matrices, sizes) in enumerate(zip(ticks.maps, port.sizes, strict=True)):
        of_E, of_B, of_C, of_D = sizes
        terms = of_E, of_B, of_C[..., : port.axes, :], of_D[..., : port.axes, :]
        moved = []
        for place, (matrix, size) in enumerate(zip(tick_matrices, terms, strict=True)):
            sizes_of = size.reshape(-1, *size.shape[-2:])
            if len(sizes_of) > 1:
                sizes_of = sizes_of[loops]
            error = EPS * sizes_of
            at = np.arange(SHAKES * matrix[0].size).reshape(SHAKES, 1, *matrix.shape[1:])
            # Fixed signs, without a structure that entries may have.
            signs = np.sign(np.sin(1.0 + 7 * number + place + at**2 % 97))
            moved.append((matrix + signs * error).reshape(SHAKES * batch, *matrix.shape[1:]))
        maps.append(tuple(moved))
    return TickMaps(tuple(maps), ticks.kind)


MOST_DAMPING = 1e4  # N*s/m: no device has more
BRACKET_WIDTH = 1e-3  # relative width of the bracket that is left


def more_damping(loop: HeldLoop, margin: PortMargin | None = None) -> np.ndarray:
    """Additional device damping (N*s/m) with which the hand's port is passive; 0 if it is, NaN if
    MOST_DAMPING is not enough.

    NaN as well if the hand holds no single mass, so that no block is the device. margin: that of
    the loops, if it is known. The bracket is halved on a logarithmic scale, each time over all
    frequencies, and its upper end is given: the port is passive with it. That less damping is not
    enough holds for the lower end, and below it if passivity is not lost again with damping, which
    no random loop showed. A hand that also moves within the tick needs more: see
    `over_ranges.reaction_maps`. Accuracy: BRACKET_WIDTH relative, from above.
    """
    margin = port_margin(loop) if margin is None else margin
    needed = np.where(margin.passive, 0.0, np.nan).reshape(-1)
    if loop.device is None:
        return needed.reshape(margin.margin.shape)
    batch = loop.batch
    loop = loop.with_hand()
    arrays = {
        path: np.broadcast_to(v, batch).reshape(-1) for path, v in loop.values.items() if np.ndim(v)
    }
    damping = np.broadcast_to(loop.values[HAND[1]], batch).reshape(-1)

    def passive(index, more):
        numbers = {path: v[index] for path, v in arrays.items()}
        numbers[HAND[1]] = damping[index] + more
        return port_margin(loop.changed(numbers), decide=True).passive

    index = np.flatnonzero(np.isnan(needed))
    if index.size:
        index = index[passive(index, np.full(index.size, MOST_DAMPING))]
    low = np.full(index.size, 1e-4)  # N*s/m: less makes no difference
    high = np.full(index.size, MOST_DAMPING)
    while index.size and np.any(high > low * (1 + BRACKET_WIDTH)):
        middle = np.sqrt(low * high)
        enough = passive(index, middle)
        low = np.where(enough, low, middle)
        high = np.where(enough, middle, high)
    needed[index] = high
    return needed.reshape(margin.margin.shape)
