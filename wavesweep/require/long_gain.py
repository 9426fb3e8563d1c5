"""The gain of loops with many ticks in a frame: the inputs are gone before the pencil of a level is
looked at.

In each tick the balance `level^2 u^2 - y^2` is stationary in its input, and ticks are joined by
Redheffer's star product, as in `hinf.then`, for a disc of complex numbers. What is left of a frame
has A, G and Q of as many rows as it has states,

    x+ = A x - G l+,   l = Q x + A' l+,   N = [A 0; -Q 1],   L = [1 G; 0 A'],

and the form of `frame_gain` is singular on the circle only where the pencil `N - z L` is. The join
of two parts eliminates the state between them with the matrix `[-G_1 -1; -1 Q_2]`, and a tick its
input with `r = level^2 - d^2`. Where none of these is singular in a disc, A, G and Q are analytic
there. By Sylvester's law of inertia the form has

    the negative eigenvalues of [-G A - z; (A - z)* Q], less n, and those of all r, and of all joins, less n each,

as negative eigenvalues, n the number of states. What is eliminated has as many on all of a panel as
in its middle, since it is not singular in between. If the form is negative in the middle at some z,
and the pencil is not singular at that one z for any number of the panel, the gain is too large in
all of it, or infinite. Where something that is eliminated may be singular, a gain beyond a higher
level, or below a lower one, decides as well.
"""

from typing import NamedTuple

import numpy as np

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.frames import Bounded, Change, balance, in_a_row, on_circle, solve
from wavesweep.engine.norms import NEAR_CIRCLE, with_middles
from wavesweep.require.between import by_panel, loops_between, of_panels, poles_inside
from wavesweep.require.disc_panels import BAD, GOOD, HALF_RIM, OPEN
from wavesweep.require.frame_gain import BoundedGain
from wavesweep.require.maps import of_ticks
from wavesweep.require.pencil import angles_of, clear, off_arc

SURE_SIGN = 1e-12  # of the size of a matrix, from which on the signs of its eigenvalues are known
# times the level, or less by it: there something else is singular where its parts are eliminated
BESIDE_LEVEL = 1.02


class Joined(NamedTuple):
    """A, less identity, G and Q of some ticks at points, of which some in a row are of each panel,
    the first its middle.

    A, G, Q: each with a bound on its error. points: of a panel. pivots: of what is eliminated.
    below: how many negative directions that has beside those of states, in the middle of each
    panel; NaN if rounding does not tell.
    """

    E: Bounded
    G: Bounded
    Q: Bounded
    points: int
    pivots: tuple[np.ndarray, ...]
    below: np.ndarray


def of_tick(e: Bounded, b: Bounded, c: Bounded, d: Bounded, square: float, points: int) -> Joined:
    """Return a tick with one input and one output; square: of the level; points: of a panel.

    r = square - d^2,   A = e + b d r^-1 c,   G = b r^-1 b',   Q = -c' square r^-1 c
    """
    r = Bounded.exact(np.full_like(d.value, square)) - d @ d
    over = Bounded.exact(np.ones((1, 1))).over(r)
    E = e + b @ (d @ over) @ c
    G = b @ over @ b.mT
    Q = -(c.mT @ over * square @ c)
    pivot = r.value[:, 0, 0]
    return Joined(E, G, Q, points, (pivot,), np.where(pivot[::points].real < 0, 1.0, 0.0))


def then(first: Joined, second: Joined) -> Joined:
    """Return some ticks and those that follow."""
    one = Bounded.exact(np.eye(first.E.value.shape[-1]))
    star = one + first.G @ second.Q
    X = star.inverse()
    A_1 = one + first.E
    A_2 = one + second.E
    spread = X @ first.G
    carried = first.E - spread @ second.Q @ A_1  # X A_1, less identity
    E = carried + second.E + second.E @ carried
    G = second.G + A_2 @ spread @ A_2.mT
    Q = first.Q + A_1.mT @ second.Q @ (one + carried)
    pivots = (*first.pivots, *second.pivots, np.linalg.det(star.value))
    below = (
        first.below
        + second.below
        + _negative(first.G[0][:: first.points].real, second.Q[0][:: first.points].real)
    )
    return Joined(E, _symmetric(G), _symmetric(Q), first.points, pivots, below)


def _negative(G, Q):
    """How many negative eigenvalues `[-G -1; -1 Q]` has beside one for each state; NaN if
    rounding does not tell."""
    n = G.shape[-1]
    units = _units(G, Q)
    block = np.zeros((len(G), 2 * n, 2 * n))
    block[:, :n, :n] = -G / (units[:, None, :] * units[:, :, None])
    block[:, n:, n:] = Q * units[:, None, :] * units[:, :, None]
    block[:, np.arange(n), n + np.arange(n)] = block[:, n + np.arange(n), np.arange(n)] = -1.0
    values = np.linalg.eigvalsh(np.where(np.isfinite(block), block, 0.0))
    size = np.abs(values)
    told = size.min(-1) > SURE_SIGN * size.max(-1)
    return np.where(told, (values < 0).sum(-1) - n, np.nan)


def _units(G, Q):
    """Units of the states in which G and Q are alike on their diagonals."""
    of_G, of_Q = (np.abs(np.diagonal(each, axis1=-2, axis2=-1)) for each in (G, Q))
    both = np.isfinite(of_G) & np.isfinite(of_Q) & (of_G > 0) & (of_Q > 0)
    return np.where(both, np.where(both, of_G, 1.0) / np.where(both, of_Q, 1.0), 1.0) ** 0.25


class LongGain(BoundedGain):
    """The gain of loops with many ticks in a frame."""

    __slots__ = ()

    @property
    def order(self) -> int:
        """Of the pencil."""
        return 2 * self.kept.size

    def changes(self, column, p):
        """E less identity of frames, `(points, n, n)`."""
        ticks, kinds, _ = self._ticks(column, p)
        return in_a_row(kinds, [Change.of(e) for (e, _), *_ in ticks], Change.then).E

    def off_at_rest(self, column, p):
        """By how much what comes of a constant input, and what goes to a constant output, differ
        from the level at rest."""
        ticks, kinds, _ = self._ticks(column, p)
        ticks = [tuple(matrix for matrix, _ in each) for each in ticks]
        still = -self.changes(column, p)
        w = len(kinds) ** -0.5
        driven = np.zeros_like(ticks[0][1])
        for kind in kinds:
            e, b, _, _ = ticks[kind]
            driven = driven + e @ driven + b * w
        x = solve(still, driven)
        outputs = []
        for kind in kinds:
            e, b, c, d = ticks[kind]
            outputs.append((c @ x + d * w)[:, 0, 0])
            x = x + e @ x + b * w
        seen = np.zeros_like(ticks[0][2])
        for kind in reversed(kinds):
            e, _, c, _ = ticks[kind]
            seen = seen + seen @ e + c * w
        l = solve(still.mT, seen.mT).mT
        inputs = []
        for kind in reversed(kinds):
            e, b, c, d = ticks[kind]
            inputs.append((l @ b + d * w)[:, 0, 0])
            l = l + l @ e + c * w
        outputs = np.array(outputs)
        inputs = np.array(inputs)
        signed = np.copysign(self.level, outputs.sum(0)) * w
        return np.maximum(np.abs(outputs - signed).max(0), np.abs(inputs - signed).max(0))

    def worst(self, column, p):
        """As that of `BoundedGain`."""
        index = np.full(p.size, np.searchsorted(self.columns, column))
        frame, _ = self._frame(self.level, index, p, 1)
        K, L = _pencil(frame)
        arc = self.arc[np.full(p.size, column)]
        _, d = clear(K, L, (K.value[:, None], L.value[:, None]), 0, arc)
        value, theta = _least(frame, np.arange(p.size), d, arc)
        loop = np.arange(p.size)
        lowest = value.argmin(-1)
        return on_circle(theta[loop, lowest]), -value[loop, lowest]

    def _ticks(self, column, p):
        """E less identity, B, C and D of each kind of tick, in even units, the kinds, and
        pivots, `(points, k)`."""
        port, pivots = loops_between(
            self.loops, self.along, self.drift, self.route, self.columns[column], p
        )
        return _in_even_units(of_ticks(port, self.kept, p.shape)), port.kind.tolist(), pivots

    def _frame(self, level, column, p, points):
        """The frames of columns at values p, and pivots, `(points, k)`; points: of each panel."""
        ticks, kinds, pivots = self._ticks(column, p)
        with np.errstate(all="ignore"):
            return in_a_row(
                kinds, [of_tick(*each, level**2, points) for each in ticks], then
            ), pivots

    def labelled(self, column, low, high, bounds):
        label, singular = self._at_level(self.level, column, low, high, bounds)
        for level, kept in ((self.level * BESIDE_LEVEL, BAD), (self.level / BESIDE_LEVEL, GOOD)):
            again = np.flatnonzero(singular & (label == OPEN))
            if again.size:
                found, _ = self._at_level(level, column[again], low[again], high[again], bounds)
                label[again[found == kept]] = kept
        return label

    def _at_level(self, level, column, low, high, bounds):
        """The labels of panels at a level, and whether something that is eliminated may be
        singular in them."""
        try:
            return self._labelled(level, column, low, high, bounds)
        except IllPosedLoopError:  # of one panel at least
            if column.size == 1:
                return np.full(1, OPEN), np.zeros(1, bool)
            halves = np.array_split(np.arange(column.size), 2)
            parts = [
                self._at_level(level, column[half], low[half], high[half], bounds)
                for half in halves
            ]
            return tuple(map(np.concatenate, zip(*parts, strict=True)))

    def _labelled(self, level, column, low, high, bounds):
        middle = (low + high) / 2
        radius = high - low  # twice that of the panel
        p = middle[:, None] + radius[:, None] * np.append(0.0, HALF_RIM)
        points = p.shape[1]
        frame, pivots = self._frame(level, np.repeat(column, points), p.ravel(), points)
        judged = (middle - radius >= bounds[0][column]) & (middle + radius <= bounds[1][column])
        judged &= ~poles_inside(pivots.reshape(*p.shape, -1))
        eliminated = np.stack(frame.pivots, -1).reshape(*p.shape, -1)
        singular = ~np.isfinite(frame.below) | poles_inside(eliminated)
        judged &= ~singular
        K, L = by_panel(_pencil(frame), p.shape)
        for array in (*K, *L):
            judged &= np.isfinite(array).all((1, 2, 3))
        label = np.full(column.size, OPEN)
        at = np.flatnonzero(judged)
        if not at.size:
            return label, singular

        middle = [each.part(at, 0).real for each in (K, L)]
        rims = K.value[at, 1:], L.value[at, 1:]
        arc = self.arc[self.columns[column[at]]]
        inside, d = clear(*middle, rims, 0, arc)
        value, theta = _least(frame, at, d, arc)
        label[at[inside & (value.max(-1) > SURE_SIGN)]] = GOOD
        lowest = value.argmin(-1)
        at_one = np.flatnonzero(value.min(-1) < -SURE_SIGN)
        if at_one.size:
            z = theta[at_one, lowest[at_one]]
            rims = [rim[at_one] for rim in rims]
            alone, _ = clear(*of_panels(middle, at_one), rims, 0, np.stack([z, z], -1))
            label[at[at_one[alone]]] = BAD
        return label, singular


def _in_even_units(ticks):
    """Ticks with states in units, powers of two, in which their entries have similar sizes."""
    n = ticks[0][0][0].shape[-1]
    sizes = np.zeros((1, n + 1, n + 1))
    for (e, _), (b, _), (c, _), _ in ticks:
        sizes[0, :n, :n] += np.nan_to_num(np.abs(e)).max(0)
        sizes[0, :n, n:] += np.nan_to_num(np.abs(b)).max(0)
        sizes[0, n:, :n] += np.nan_to_num(np.abs(c)).max(0)
    units = balance(sizes, thorough=True)[1][0]
    u = units[:n] / units[n]
    v = u[:, None]
    in_units = []
    for (e, de), (b, db), (c, dc), d in ticks:
        among_states = Bounded(e * u / v, de * u / v)
        in_units.append((among_states, Bounded(b / v, db / v), Bounded(c * u, dc * u), d))
    return in_units


def _pencil(frame):
    """N - L, and L, of frames."""
    E = frame.E
    one = Bounded.exact(np.eye(E.value.shape[-1]))
    K = Bounded.block([[E, -frame.G], [-frame.Q, -E.mT]])
    return K, Bounded.block([[one, frame.G], [0, one + E.mT]])


def _least(frame, panels, d, arc):
    """What is positive at angles if the form is, as a share of its largest eigenvalue, and these
    angles, `(n, angles)`.

    panels: which, in whose middles. d: eigenvalues of the pencil. It is the least eigenvalue above
    the negative ones that come of states and of what is eliminated.
    """
    off = off_arc(d, arc)
    # The form is looked at at eight eigenvalues next to the arc, and between these.
    nearest = np.argsort(off, -1)[:, :8]
    d = np.take_along_axis(d, nearest, -1)
    off = np.take_along_axis(off, nearest, -1)
    first = arc[:, :1]
    last = arc[:, 1:]
    near = with_middles(np.clip(np.where(off <= NEAR_CIRCLE, angles_of(d), np.nan), first, last))
    near = np.where(np.isnan(near), first, np.clip(near, first, last))
    # Of an arc, where it is looked at as well.
    theta = np.concatenate([near, first + (last - first) * (0.0, 0.37, 0.71, 1.0)], -1)

    E, G, Q = (matrix[panels * frame.points].real for matrix, _ in (frame.E, frame.G, frame.Q))
    n = E.shape[-1]
    units = _units(G, Q)
    u = units[:, None, :]
    v = units[:, :, None]
    E = E * u / v
    G = G / (u * v)
    Q = Q * u * v
    moved = E[:, None] - on_circle(theta)[..., None, None] * np.eye(n)
    form = np.zeros((*theta.shape, 2 * n, 2 * n), complex)
    form[..., :n, :n] = -G[:, None]
    form[..., :n, n:] = moved
    form[..., n:, :n] = moved.mT.conj()
    form[..., n:, n:] = Q[:, None]
    values = np.linalg.eigvalsh(np.where(np.isfinite(form), form, 0.0))
    negative = n - np.nan_to_num(frame.below[panels])
    least = np.clip(negative, 0, 2 * n - 1).astype(int)
    least = values[np.arange(len(values)), :, least]
    return least / np.maximum(np.abs(values).max(-1), NEXT_TO_ZERO), theta


def _symmetric(matrix):
    """The symmetric part of a matrix, of one that is symmetric but for rounding."""
    return (matrix + matrix.mT) * 0.5
