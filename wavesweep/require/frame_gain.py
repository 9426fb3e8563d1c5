"""The gain from an input to an output at all frequencies, and whether it stays below a level on
panels of a number.

The gain is the H-infinity norm of the map of a frame from the inputs of its ticks to its outputs,
`H(z) = T + O (z - A)^-1 G`: the root of the largest ratio of the energy of an output to that of its
input. It is below the level if `level^2 - H* H` is positive on the unit circle. With P = -O'O, S =
-O'T and R = level^2 - T'T this is Popov's form

    [x; u]* [P S; S' R] [x; u],   x = (z - A)^-1 G u,

and it is singular on the circle only where the pencil `N - z L` is (see `hinf`),

    N = [A 0 G; P -1 S; S' 0 R],   L = [1 0 0; 0 -A' 0; 0 -G' 0].

So in a connected set of numbers in which no eigenvalue of the pencil is on the circle, the form is
positive everywhere if it is at one angle of one number. The same holds on an arc of the circle, a
band of frequencies. See `pencil` for how it is shown, and `maps` for the map that shows the gain at
the frequency itself.

Where the gain at rest is the level itself, as in a string of vehicles, the form is 0 at z = 1 for a
constant input, whose unit vector is w: H(1) w = h, h' H(1) = level^2 w'. With u + f w w'u/(z - 1)
in place of u, which multiplies the determinant by
|z - 1 + f|^2/|z - 1|^2, it is such a form too, and not 0 there: with r = (1 - A)^-1 G w and c = h' O (1 - A)^-1

    x = (z - A)^-1 (G - f r w') u,   P = -O'O,   S' = -T'O - f w c A,   R = level^2 - T'T + f^2 c r w w' - f (w c G + G'c'w').
"""

from dataclasses import dataclass

import numpy as np

from wavesweep.engine.doubles import EPS
from wavesweep.engine.frames import Bounded, inverse, on_circle, solve
from wavesweep.engine.norms import NEAR_CIRCLE, START, with_middles
from wavesweep.require.between import Between, by_panel, determinants, of_panels, poles_inside
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, SAFE
from wavesweep.require.pencil import angles_of, clear, off_circle
from wavesweep.require.sines import Panel

# of the terms of the form, from which on it is positive at an angle whatever rounding does
POSITIVE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class BoundedGain(Between):
    """The gain of loops between an input and a signal along a number; level: which it has to stay
    below.

    arc: its ends (rad), on which it has to be so, `(columns, 2)`. at_rest: whether the gain at rest
    is the level at all values, and its neighbourhood decides.
    """

    arc: np.ndarray
    at_rest: bool

    @property
    def order(self) -> int:
        """Of the pencil."""
        return 2 * self.kept.size + self.inputs

    def at_rest_through(self, column, p):
        """What comes of inputs that are constant, as a map of a frame, and the constant input,
        of length 1."""
        maps, _ = self.maps(column, p)
        E, G, O, T = (matrix for matrix, _ in maps)
        w = np.full((self.inputs, 1), self.inputs**-0.5)
        return T - O @ solve(E, G), w

    def off_at_rest(self, column, p):
        """By how much what comes of a constant input, and what goes to a constant output, differ
        from the level at rest."""
        H, w = self.at_rest_through(column, p)
        signed = np.copysign(self.level, w.mT @ H @ w) * w
        of_output = np.abs(H @ w - signed).max((-1, -2))
        of_input = np.abs(H.mT @ w - signed).max((-1, -2))
        return np.maximum(of_output, of_input)

    def labelled(self, column, low, high, bounds):
        maps, shape, judged = self._about(column, low, high, bounds)
        form = self.form(shape[1], *maps)
        K, L = by_panel(self.pencil(maps[0], *form), shape)
        parts = by_panel((maps[0], *form), shape)
        if self.at_rest:
            E, _ = parts[0]
            judged &= ~poles_inside(determinants(E)[..., None])
        for array in (*K, *L):
            judged &= np.isfinite(array).all((-1, -2, -3))
        label = np.full(column.size, OPEN)
        at = np.flatnonzero(judged)
        if not at.size:
            return label

        middle = [each.part(at, 0).real for each in (K, L)]
        rims = K.value[at, 1:], L.value[at, 1:]
        arc = self.arc[self.columns[column[at]]]
        inside, d = clear(*middle, rims, self.inputs, arc)
        parts = of_panels(parts, at)
        theta = _angles(d, arc)
        value, size, v = _least([matrix[:, 0].real for matrix, _ in parts], theta)
        good = inside & (value > POSITIVE * size).any(-1)
        label[at[good]] = GOOD
        rest = np.flatnonzero(~good & (value.min(-1) < 0))
        if rest.size:
            lowest = value[rest].argmin(-1)
            with np.errstate(all="ignore"):
                bad = _negative(of_panels(parts, rest), theta[rest, lowest], v[rest, lowest])
            label[at[rest[bad]]] = BAD
        return label

    def worst(self, column, p):
        """The point of the circle, less 1, at which the form is least, and by how much it is
        negative, of its terms."""
        maps, _ = self.maps(np.full(p.size, np.searchsorted(self.columns, column)), p)
        form = self.form(1, *maps)
        K, L = self.pencil(maps[0], *form)
        arc = self.arc[np.full(p.size, column)]
        _, d = clear(K, L, (K.value[:, None], L.value[:, None]), self.inputs, arc)
        theta = _angles(d, arc)
        value, size, _ = _least([matrix for matrix, _ in (maps[0], *form)], theta)
        loop = np.arange(p.size)
        lowest = (value / size).argmin(-1)
        return on_circle(theta[loop, lowest]), -value[loop, lowest] / size[loop, lowest]

    def form(self, points, E, G, O, T):
        """The matrices G, P, S, R of the form, each with a bound on its error; points: of a
        disc, with one b."""
        if self.at_rest:
            return self._form_at_rest(points, E, G, O, T)
        return G, -(O.mT @ O), -(O.mT @ T), self._level_less(T)

    def _form_at_rest(self, points, E, G, O, T):
        X = (-E).inverse()
        w = np.full((self.inputs, 1), self.inputs**-0.5)
        H = T.value + O.value @ X.value @ G.value
        h = Bounded.exact(self.level * np.sign((w.mT @ H @ w).real) * w)
        w = Bounded.exact(w)
        r = X @ (G @ w)
        h_O = h.mT @ O
        c = h_O @ X

        # By so many frames a slow input is late.
        frames = (c[0] @ r[0]).real.reshape(-1, points)[:, :1] / self.level**2
        f = np.repeat(1 / np.maximum(2.0, frames), points, axis=0).reshape(-1, 1, 1)
        w_cA = w @ (c - h_O)
        w_cG = w @ (c @ G)
        S = -(T.mT @ O + w_cA * f).mT
        late = w @ (c @ r) @ w.mT
        late = late * f * f - (w_cG + w_cG.mT) * f
        R = self._level_less(T) + late
        P = -(O.mT @ O)
        return G - (r @ w.mT) * f, P, S, R

    def _level_less(self, T):
        """level^2 - T'T."""
        return Bounded.exact(self.level * np.eye(T.value.shape[-1])) * self.level - T.mT @ T

    def pencil(self, E, G, P, S, R):
        """N - L and L."""
        one = Bounded.exact(np.eye(E.value.shape[-1]))
        of_inputs = R * 0.0
        K = Bounded.block([[E, 0, G], [P, E.mT, S], [S.mT, G.mT, R]])
        L = Bounded.block([[one, 0, 0], [0, -(one + E.mT), 0], [0, -G.mT, of_inputs]])
        return K, L


class Sine(BoundedGain):
    """The same at the frequency of a sine itself, of frames of several ticks: see `sines`."""

    __slots__ = ()

    def off_at_rest(self, column, p):
        """By how much the gain of a constant differs from the level."""
        H, w = self.at_rest_through(column, p)
        through = w.mT @ H @ w
        return np.abs(through - np.copysign(self.level, through)).max((-1, -2))

    def labelled(self, column, low, high, bounds):
        maps, shape, judged = self._about(column, low, high, bounds)
        maps = by_panel(maps, shape)
        for matrix, size in maps:
            judged &= np.isfinite(matrix).all((1, 2, 3)) & np.isfinite(size).all((1, 2, 3))
        label = np.full(column.size, OPEN)
        for at in np.flatnonzero(judged):
            label[at] = self._panel(column[at], of_panels(maps, at)).label()
        return label

    def _panel(self, column, maps):
        return Panel(maps, self.level, self.arc[self.columns[column]], self.at_rest)

    def worst(self, column, p):
        """As that of `BoundedGain`."""
        index = np.searchsorted(self.columns, column)
        maps, _ = self.maps(np.full(p.size, index), p)
        delta = []
        beyond = []
        for at in range(p.size):
            found = self._panel(index, of_panels(maps, slice(at, at + 1))).worst()
            delta.append(found[0])
            beyond.append(found[1])
        return np.array(delta), np.array(beyond)


def _angles(d, arc):
    """Angles (rad) of arcs at which the form is looked at, `(n, any)`: some, those of
    eigenvalues next to the circle, and between these."""
    off = off_circle(d)
    # Eigenvalues next to the circle, at whose angles and between which the form is looked at.
    nearest = np.argsort(off, -1)[:, :8]
    d = np.take_along_axis(d, nearest, -1)
    off = np.take_along_axis(off, nearest, -1)
    low = arc[:, :1]
    high = arc[:, 1:]
    beside = np.where(off <= NEAR_CIRCLE, angles_of(d), np.nan)
    angles = with_middles(np.clip(beside, low, high))
    angles = np.where(np.isnan(angles), low, np.clip(angles, low, high))
    return np.concatenate([angles, low + (high - low) * START / np.pi], -1)


def _least(parts, theta):
    """The least eigenvalue of the form at angles, `(n, angles)`, the size of its terms, and its
    vectors.

    parts: E, G, P, S, R of each, `(n, r, c)`.
    """
    E, G, P, S, R = (array[:, None] for array in parts)
    w = on_circle(theta)[..., None, None]
    with np.errstate(all="ignore"):
        x = solve(w * np.eye(E.shape[-1]) - E, G + 0j * theta[..., None, None])
        x_size = np.abs(x)
        back = x.mT.conj()
        back_size = np.abs(back)
        St = S.mT
        form = back @ P @ x + back @ S + St @ x + R
        size = back_size @ np.abs(P) @ x_size + back_size @ np.abs(S)
        size = size + np.abs(St) @ x_size + np.abs(R)
        finite = np.isfinite(form).all((-1, -2))
        values, vectors = np.linalg.eigh(np.where(finite[..., None, None], form, 0.0))
    least = np.where(finite, values[..., 0], 0.0)
    return least, np.where(finite, size.sum((-1, -2)), 1.0), vectors[..., 0]


def _negative(parts, theta, v):
    """Whether the form is negative at an angle, in a direction v of the inputs, for all numbers of
    discs.

    parts: E, G, P, S, R, each with a bound on its error, in the middle of a disc and on a circle of
    twice its size. The state x and the size a of the input u = v a solve

        B [x; a] = [0; 1],   B = [w - E, -G v; l],   w = z - 1,

    where the row l keeps them finite also where the loop has an eigenvalue at z. The form is there

        f = x~' (P x + S u) + u~' (S' x + R u),

    in which x~ and u~ solve the same for the conjugates of w, v and l: those of x and u where the
    number is real, and continued from there. If B and B~ are regular, f is analytic in the number,
    and with Schwarz's lemma in the disc

        |f - f(middle)| <= 1/2 max |f - f(middle)|,   the largest on the circle.

    In the middle, x and u are off by dx and du, bounds that the inverse of B has, and the form, to
    first order, by what it is off with x and u as they are, and by

        2 |P x + S u|' dx + 2 |S' x + R u|' du.
    """
    w = on_circle(theta)[:, None, None]
    v = v[:, :, None]
    middle = [each.part(slice(None), 0) for each in parts]
    E, G, P, S, R = (each.value for each in parts)
    n = E.shape[-1]
    eye = np.eye(n)
    x = solve(w * eye - E[:, 0].real, G[:, 0].real @ v)
    q = np.concatenate([x, np.ones((len(x), 1, 1))], 1)
    l = (q.conj() / (np.abs(q) ** 2).sum(1, keepdims=True)).mT

    def solved(w, v, l):
        """B, x and u."""
        B = np.zeros((*E.shape[:2], n + 1, n + 1), complex)
        B[..., :n, :n] = w[:, None] * eye - E
        B[..., :n, n:] = -G @ v[:, None]
        B[..., n:, :] = l[:, None]
        back = inverse(B)
        return B, back[..., :n, n:], v[:, None] * back[..., n:, n:]

    B, x, u = solved(w, v, l)
    B_dual, x_dual, u_dual = solved(w.conj(), v.conj(), l.conj())
    value = (x_dual.mT @ (P @ x + S @ u) + u_dual.mT @ (S.mT @ x + R @ u))[..., 0, 0]
    change = np.abs(value[:, 1:] - value[:, :1].real).max(-1)

    # The error in the middle: of x and u, and of the form.
    E, G, P, S, R = middle
    w = Bounded(w * eye, 2 * EPS * np.abs(w * eye))  # as sines are known
    l = Bounded.exact(l)
    B_middle = Bounded.block(
        [[w - E, -(G @ v)], [l.part(..., slice(n)), l.part(..., slice(n, None))]]
    )
    back = B_middle.inverse()
    x = back.part(..., slice(n), slice(n, None))
    u = back.part(..., slice(n, None), slice(n, None)) * v
    by_x = P @ x.value + S @ u.value
    by_u = S.mT @ x.value + R @ u.value
    form = by_x.mT @ x.value.conj() + by_u.mT @ u.value.conj()
    error = form.error + 2 * (by_x.size.mT @ x.error + by_u.size.mT @ u.error)

    poles = poles_inside((determinants(B) * determinants(B_dual))[..., None])
    return ~poles & (form.value.real[:, 0, 0] + SAFE / 2 * change + error[:, 0, 0] < 0)
