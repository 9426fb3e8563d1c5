"""The gain from an input to an output at all frequencies, and whether it stays below a level on panels of a number.

The gain is the H-infinity norm of the map of a frame from the inputs of its ticks to its outputs, `H(z) = T + O (z - A)^-1 G`:
the root of the largest ratio of the energy of an output to that of its input. It is below the level if `level^2 - H* H` is
positive on the unit circle. With P = -O'O, S = -O'T and R = level^2 - T'T this is Popov's form

    [x; u]* [P S; S' R] [x; u],   x = (z - A)^-1 G u,

and it is singular on the circle only where the pencil `N - z L` is (see `hinf`),

    N = [A 0 G; P -1 S; S' 0 R],   L = [1 0 0; 0 -A' 0; 0 -G' 0].

So in a connected set of numbers in which no eigenvalue of the pencil is on the circle, the form is positive everywhere if it is
at one angle of one number. The same holds on an arc of the circle, a band of frequencies. See `pencil` for how it is shown, and
`maps` for the map that shows the gain at the frequency itself.

Where the gain at rest is the level itself, as in a string of vehicles, the form is 0 at z = 1 for a constant input, whose unit
vector is w: H(1) w = h, h' H(1) = level^2 w'. With u + f w w'u/(z - 1) in place of u, which multiplies the determinant by
|z - 1 + f|^2/|z - 1|^2, it is such a form too, and not 0 there: with r = (1 - A)^-1 G w and c = h' O (1 - A)^-1

    x = (z - A)^-1 (G - f r w') u,   P = -O'O,   S' = -T'O - f w c A,   R = level^2 - T'T + f^2 c r w w' - f (w c G + G'c'w').
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.frames import ROUNDING, MarginalModes, Ticks, inverse, on_circle, pole_inside, solve
from wavesweep.engine.frames import level as level_of
from wavesweep.engine.intervals import Intervals
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import NEAR, START, with_middles
from wavesweep.engine.response import plus, port_between, times
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, RIM, SAFE
from wavesweep.require.maps import minus, over_frame, scaled, transposed
from wavesweep.require.pencil import angles_of, clear, off_circle
from wavesweep.require.sines import Panel

POSITIVE = 1e-9  # of the terms of the form, from which on it is positive at an angle whatever rounding does
ANGLES = 8  # eigenvalues next to the circle, at whose angles and between which the form is looked at


def loops_between(loops, along, drift, route, number, p):
    """The loops `number` at values p as they are seen between an input and a signal, and their pivots."""
    at = loops.some(number).changed({along: p})
    with np.errstate(all="ignore"):
        drawn = at.drawn()
        port, (pivot, _) = port_between(drawn, *route, drift), Ticks.of(drawn, alone=True).facts
    pivot = np.broadcast_to(np.asarray(pivot)[..., None], (p.size, 1))
    return port, np.concatenate([pivot, at.guards_at(along, p.shape).reshape(p.size, -1)], -1)


@dataclass(frozen=True, slots=True, eq=False)
class BoundedGain:
    """The gain of loops between an input and a signal (route) along a number; level: which it has to stay below.

    A judge of `panels`, of these columns. kept: states that the input reaches and the signal depends on. inputs: of the
    map, one for each tick. stable: where loops may be stable, and nothing is looked for elsewhere. arc: its ends (rad), on
    which it has to be so, `(columns, 2)`. at_rest: whether the gain at rest is the level
    at all values, and its neighbourhood decides.
    """

    loops: Loops
    along: str
    route: tuple[str, str]
    level: float
    drift: MarginalModes
    kept: np.ndarray
    inputs: int
    columns: np.ndarray
    stable: Intervals
    arc: np.ndarray
    at_rest: bool
    many: ClassVar[int] = 1000
    smooth: ClassVar[bool] = False

    @property
    def order(self) -> int:
        """Of the pencil."""
        return 2 * self.kept.size + self.inputs

    def maps(self, column, p):
        """E less identity, G, O and T of a frame, each with a bound on its error, and pivots; NaN without a solution."""
        try:
            port, pivots = loops_between(self.loops, self.along, self.drift, self.route, self.columns[column], p)
        except IllPosedLoopError:
            if p.size == 1:
                n, m = self.kept.size, self.inputs
                shapes = ((1, n, n), (1, n, m), (1, m, n), (1, m, m))
                return [(np.full(shape, np.nan),) * 2 for shape in shapes], np.zeros((1, 1))
            halves = [self.maps(column[half], p[half]) for half in np.array_split(np.arange(p.size), 2)]
            maps = [
                tuple(map(np.concatenate, zip(*pair, strict=True)))
                for pair in zip(*(half_maps for half_maps, _ in halves), strict=True)
            ]
            return maps, np.zeros((p.size, 1))  # which may be poles
        return over_frame(port, self.kept, p.shape), pivots

    def changes(self, column, p):
        """E less identity of frames, `(points, n, n)`."""
        return self.maps(column, p)[0][0][0]

    def at_rest_through(self, column, p):
        """What comes of inputs that are constant, as a map of a frame, and the constant input, of length 1."""
        E, G, O, T = (array for array, _ in self.maps(column, p)[0])
        return T - O @ solve(E, G), np.full((self.inputs, 1), self.inputs**-0.5)

    def off_at_rest(self, column, p):
        """By how much what comes of a constant input, and what goes to a constant output, differ from the level at rest."""
        H, w = self.at_rest_through(column, p)
        signed = np.copysign(self.level, _t(w) @ H @ w) * w
        return np.max([np.abs(each @ w - signed).max((-1, -2)) for each in (H, _t(H))], 0)

    def label(self, column, low, high, bounds):
        """GOOD, BAD or OPEN of panels; BAD outside of where loops may be stable."""
        own_rows = self.stable.column == self.columns[column][:, None]
        within = own_rows & (self.stable.low < high[:, None]) & (self.stable.high > low[:, None])
        label, inside = np.full(column.size, BAD), within.any(-1)
        if inside.any():
            label[inside] = self._label(column[inside], low[inside], high[inside], bounds)
        return label

    def _about(self, column, low, high, bounds):
        """The maps in the middles of panels and on rims about them, `(panels * points, ...)`, their number, and where they
        are known."""
        middle, half = (low + high) / 2, (high - low) / 2
        p = middle[:, None] + 2 * half[:, None] * np.append(0.0, RIM)
        maps, pivots = self.maps(np.repeat(column, p.shape[1]), p.ravel())
        inside_range = (middle - 2 * half >= bounds[0][column]) & (middle + 2 * half <= bounds[1][column])
        return maps, p.shape, inside_range & ~poles_inside(pivots.reshape(*p.shape, -1))

    def _label(self, column, low, high, bounds):
        maps, shape, judged = self._about(column, low, high, bounds)
        form = self.form(shape[1], *maps)
        both = [tuple(array.reshape(*shape, *array.shape[1:]) for array in pair) for pair in self.pencil(maps[0], *form)]
        (K, dK), (L, dL) = both
        if self.at_rest:
            judged &= ~poles_inside(_determinants(maps[0][0].reshape(*shape, *maps[0][0].shape[1:]))[..., None])
        judged &= np.logical_and.reduce([np.isfinite(array).all((-1, -2, -3)) for array in (K, dK, L, dL)])
        label, open_columns = np.full(column.size, OPEN), np.flatnonzero(judged)
        if not open_columns.size:
            return label
        middles = K[open_columns, 0].real, dK[open_columns, 0], L[open_columns, 0].real, dL[open_columns, 0]
        arc = self.arc[self.columns[column[open_columns]]]
        inside, d = clear(*middles, (K[open_columns, 1:], L[open_columns, 1:]), self.inputs, arc)
        arrays = [tuple(array.reshape(*shape, *array.shape[1:])[open_columns] for array in pair) for pair in (maps[0], *form)]
        theta = _angles(d, arc)
        value, size, v = _least([array[:, 0].real for array, _ in arrays], theta)
        good = inside & (value > POSITIVE * size).any(-1)
        label[open_columns[good]] = GOOD
        rest = np.flatnonzero(~good & (value.min(-1) < 0))
        if rest.size:
            at = value[rest].argmin(-1)
            with np.errstate(all="ignore"):
                bad = _negative([tuple(array[rest] for array in pair) for pair in arrays], theta[rest, at], v[rest, at])
            label[open_columns[rest[bad]]] = BAD
        return label

    def worst(self, column, p):
        """The point of the circle, less 1, at which the form is least, and by how much it is negative, of its terms."""
        maps, _ = self.maps(np.full(p.size, np.searchsorted(self.columns, column)), p)
        form = self.form(1, *maps)
        (K, dK), (L, dL) = self.pencil(maps[0], *form)
        arc = self.arc[np.full(p.size, column)]
        _, d = clear(K, dK, L, dL, (K[:, None], L[:, None]), self.inputs, arc)
        theta = _angles(d, arc)
        value, size, _ = _least([array for array, _ in (maps[0], *form)], theta)
        most = (value / size).argmin(-1)[:, None]
        value, size, theta = (np.take_along_axis(array, most, 1)[:, 0] for array in (value, size, theta))
        return on_circle(theta), -value / size

    def form(self, points, E, G, O, T):
        """The matrices G, P, S, R of the form, each with a bound on its error; points: of a disc, with one b."""
        if self.at_rest:
            return self._form_at_rest(points, E, G, O, T)
        back = transposed(O)
        return G, minus(times(back, O)), minus(times(back, T)), self._level_less(T)

    def _form_at_rest(self, points, E, G, O, T):
        X, w = inverse(-E[0]), np.full((self.inputs, 1), self.inputs**-0.5)
        aX, h = np.abs(X), self.level * np.sign((_t(w) @ (T[0] + O[0] @ X @ G[0]) @ w).real) * w
        h, w, G_w = (h, 0 * h), (w, 0 * w), times(G, (w, 0 * w))
        h_O, r = times(transposed(h), O), X @ G_w[0]
        r, c = (r, aX @ (E[1] @ np.abs(r) + G_w[1] + ROUNDING * (np.abs(E[0]) @ np.abs(r) + np.abs(G_w[0])))), h_O[0] @ X
        c = c, (np.abs(c) @ (E[1] + ROUNDING * np.abs(E[0])) + h_O[1] + ROUNDING * np.abs(h_O[0])) @ aX
        frames = (c[0] @ r[0]).real.reshape(-1, points)[:, :1] / self.level**2  # by which a slow input is late
        f = np.repeat(1 / np.maximum(2.0, frames), points, axis=0).reshape(-1, 1, 1)
        w_c, w_cG = times(w, plus(c, minus(h_O))), times(w, times(c, G))
        S = minus(transposed(plus(times(transposed(T), O), scaled(f, w_c))))
        late = times(times(w, times(c, r)), transposed(w))
        late = plus(scaled(f**2, late), minus(scaled(f, plus(w_cG, transposed(w_cG)))))
        R = plus(self._level_less(T), late)
        return plus(G, minus(scaled(f, times(r, transposed(w))))), minus(times(transposed(O), O)), S, R

    def _level_less(self, T):
        """level^2 - T'T."""
        TT = times(transposed(T), T)
        return plus((self.level**2 * np.eye(TT[0].shape[-1]), 0.0), minus(TT))

    def pencil(self, E, G, P, S, R):
        """N - L and L, each with a bound on its error."""
        n, m = G[0].shape[-2:]
        x, l, u, blocks = slice(n), slice(n, 2 * n), slice(2 * n, None), []
        for e, g, p, s, r in zip(E, G, P, S, R, strict=True):
            K, L = np.zeros((2, *g.shape[:-2], 2 * n + m, 2 * n + m), np.result_type(e, g, p, s, r))
            K[..., x, x], K[..., x, u] = e, g
            K[..., l, x], K[..., l, l], K[..., l, u] = p, _t(e), s
            K[..., u, x], K[..., u, l], K[..., u, u] = _t(s), _t(g), r
            L[..., l, l], L[..., u, l] = -_t(e), -_t(g)
            blocks.append((K, L))
        (K, L), errors = blocks
        L[..., x, x], L[..., l, l] = np.eye(n), L[..., l, l] - np.eye(n)
        return (K, np.abs(errors[0])), (L, np.abs(errors[1]) + ROUNDING * np.abs(L))


class Sine(BoundedGain):
    """The same at the frequency of a sine itself, of frames of several ticks: see `sines`."""

    __slots__ = ()

    def off_at_rest(self, column, p):
        """By how much the gain of a constant differs from the level."""
        H, w = self.at_rest_through(column, p)
        through = _t(w) @ H @ w
        return np.abs(through - np.copysign(self.level, through)).max((-1, -2))

    def _label(self, column, low, high, bounds):
        maps, shape, judged = self._about(column, low, high, bounds)
        maps = [tuple(array.reshape(*shape, *array.shape[1:]) for array in pair) for pair in maps]
        judged &= np.logical_and.reduce([np.isfinite(array).all((1, 2, 3)) for pair in maps for array in pair])
        label = np.full(column.size, OPEN)
        for at in np.flatnonzero(judged):
            label[at] = self._panel(column[at], [tuple(array[at] for array in pair) for pair in maps]).label()
        return label

    def _panel(self, column, maps):
        return Panel(maps, self.level, self.arc[self.columns[column]], self.at_rest)

    def worst(self, column, p):
        """As that of `BoundedGain`."""
        index = np.searchsorted(self.columns, column)
        maps, _ = self.maps(np.full(p.size, index), p)
        worst = [
            self._panel(index, [tuple(array[at : at + 1] for array in pair) for pair in maps]).worst() for at in range(p.size)
        ]
        return tuple(map(np.array, zip(*worst, strict=True)))


def _t(part):
    return np.swapaxes(part, -1, -2)


def _angles(d, arc):
    """Angles (rad) of arcs at which the form is looked at, `(n, any)`: some, those of eigenvalues next to the circle, and
    between these."""
    off = off_circle(d)
    nearest = np.argsort(off, -1)[:, :ANGLES]
    d, off = (np.take_along_axis(array, nearest, -1) for array in (d, off))
    angles = with_middles(np.clip(np.where(off <= NEAR, angles_of(d), np.nan), arc[:, :1], arc[:, 1:]))
    angles = np.where(np.isnan(angles), arc[:, :1], np.clip(angles, arc[:, :1], arc[:, 1:]))
    return np.concatenate([angles, arc[:, :1] + (arc[:, 1:] - arc[:, :1]) * START / np.pi], -1)


def _least(parts, theta):
    """The least eigenvalue of the form at angles, `(n, angles)`, the size of its terms, and its vectors.

    parts: E, G, P, S, R of each, `(n, r, c)`.
    """
    E, G, P, S, R = (array[:, None] for array in parts)
    with np.errstate(all="ignore"):
        x = solve(on_circle(theta)[..., None, None] * np.eye(E.shape[-1]) - E, G + 0j * theta[..., None, None])
        back, St = _t(x).conj(), _t(S)
        hermitian = back @ P @ x + back @ S + St @ x + R
        size = np.abs(back) @ np.abs(P) @ np.abs(x) + np.abs(back) @ np.abs(S) + np.abs(St) @ np.abs(x) + np.abs(R)
        finite = np.isfinite(hermitian).all((-1, -2))
        value, vectors = np.linalg.eigh(np.where(finite[..., None, None], hermitian, 0.0))
    return np.where(finite, value[..., 0], 0.0), np.where(finite, size.sum((-1, -2)), 1.0), vectors[..., 0]


def _negative(parts, theta, v):
    """Whether the form is negative at an angle, in a direction v of the inputs, for all numbers of discs.

    parts: E, G, P, S, R, each with a bound on its error, in the middle of a disc and on a circle of twice its size. The state x
    and the size u of the input solve `(z - A) x = G v u` and `l (x, u) = 1`, where l keeps them finite also where the loop
    has an eigenvalue at z. Where the number is complex, conjugates are continued: they solve the same for those of z, v and l.
    """
    (E, dE), (G, dG), (P, dP), (S, dS), (R, dR) = parts
    n, w, v = E.shape[-1], on_circle(theta), v[:, None, :, None]
    x = solve(w[:, None, None] * np.eye(n) - E[:, 0].real, G[:, 0].real @ v[:, 0])
    q = np.concatenate([x, np.ones((len(x), 1, 1))], 1)
    l = (q.conj() / (np.abs(q) ** 2).sum(1, keepdims=True))[:, None, :, 0]

    def solved(w, v, l):
        B = np.zeros((*E.shape[:2], n + 1, n + 1), complex)
        B[..., :n, :n], B[..., :n, n:], B[..., n, :] = w[:, None, None, None] * np.eye(n) - E, -G @ v, l
        back = inverse(B)
        return B, back, back[..., :n, n:], v * back[..., n:, n:]

    (B, back, x, i), (dual, _, y, k) = solved(w, v, l), solved(w.conj(), v.conj(), l.conj())
    value = (_t(y) @ (P @ x + S @ i) + _t(k) @ (_t(S) @ x + R @ i))[..., 0, 0]
    change = np.abs(value[:, 1:] - value[:, :1].real).max(-1)
    x, i, rough = x[:, 0], i[:, 0], 2 * (n + 4) * ROUNDING
    sizes = [np.abs(array) for array in (x, i, back[:, 0], B[:, 0], v[:, 0])]
    (ax, ai, far, aB, av), (P, S, R) = sizes, (P[:, 0], S[:, 0], R[:, 0])
    dE, dG, dP, dS, dR = dE[:, 0], dG[:, 0], *(off[:, 0] + rough * np.abs(array) for off, array in ((dP, P), (dS, S), (dR, R)))
    left = np.concatenate([dE @ ax + dG @ ai, 0 * ai[:, :1]], 1) + rough * aB @ far[..., n:]
    off = far @ left
    dx, di = off[:, :n], av * off[:, n:]
    error = _t(ax) @ dP @ ax + 2 * _t(ax) @ dS @ ai + _t(ai) @ dR @ ai
    error = error + 2 * (np.abs(_t(P @ x + S @ i)) @ dx + np.abs(_t(_t(S) @ x + R @ i)) @ di)
    poles = poles_inside((_determinants(B) * _determinants(dual))[..., None])
    return ~poles & (value[:, 0].real + SAFE / 2 * change + error[:, 0, 0] < 0)


def poles_inside(pivots):
    """Whether one of the pivots may be 0 within a circle; pivots: in its middle and on its upper half, `(n, points, k)`."""
    return pole_inside(pivots[:, 1:], level_of(pivots[:, :1])) & (pivots != pivots[:, :1]).any((1, 2))


def _determinants(A):
    """The determinants of matrices `(n, points, r, r)`, of a disc over the size of that in its middle."""
    sign, log = np.linalg.slogdet(A)
    return sign * np.exp(log - log[:, :1])
