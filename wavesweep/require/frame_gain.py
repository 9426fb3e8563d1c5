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
band of frequencies. If the form is negative in the middle of a panel at some z, and the pencil is
not singular at that one z for any number of it, the gain is too large in all of it, or infinite;
where inputs stand in the pencil, `_exceeds` shows it with the singular vectors of one input.
See `pencil` for how it is shown, and `sines` for the gain of a sine at its own frequency.

Where the gain at rest is the level itself, as in a string of vehicles, the form is 0 at z = 1 for a
constant input, whose unit vector is w: H(1) w = h, h' H(1) = level^2 w'. With u + f w w'u/(z - 1)
in place of u, which multiplies the determinant by
|z - 1 + f|^2/|z - 1|^2, it is such a form too, and not 0 there: with r = (1 - A)^-1 G w and c = h' O (1 - A)^-1

    x = (z - A)^-1 (G - f r w') u,   P = -O'O,   S' = -T'O - f w c A,   R = level^2 - T'T + f^2 c r w w' - f (w c G + G'c'w').

The inputs of a frame of many ticks are gone before its pencil is looked at. In each tick the
balance `level^2 u^2 - y^2` is stationary in its input, and ticks are joined by Redheffer's star
product, as in `hinf.then`, for a disc of complex numbers. What is left of a frame has A, G and Q of
as many rows as it has states,

    x+ = A x - G l+,   l = Q x + A' l+,   N = [A 0; -Q 1],   L = [1 G; 0 A'].

The join of two parts eliminates the state between them with the matrix `[-G_1 -1; -1 Q_2]`, and a
tick its input with `r = level^2 - d^2`. Where none of these is singular in a disc, A, G and Q are
analytic there. By Sylvester's law of inertia the form has

    the negative eigenvalues of [-G A - z; (A - z)* Q], less n, and those of all r, and of all joins, less n each,

as negative eigenvalues, n the number of states. What is eliminated has as many on all of a panel as
in its middle, since it is not singular in between. Where it may be singular, a gain beyond a higher
level, or below a lower one, decides as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from wavesweep.engine.doubles import EPS, NEXT_TO_ZERO
from wavesweep.engine.frames import Bounded, in_a_row, inverse, on_circle, solve
from wavesweep.engine.norms import NEAR_CIRCLE, START, with_middles
from wavesweep.require.between import Between, by_panel, determinants, of_panels, poles_inside
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, SAFE
from wavesweep.require.maps import of_ticks
from wavesweep.require.pencil import angles_of, clear, off_arc
from wavesweep.require.sines import Panel

SURE_SIGN = 1e-12  # of the size of a matrix, from which on the signs of its eigenvalues are known
FEW_INPUTS = 16  # of a frame, up to which they stand in the pencil, which is sharper
# times the level, or less by it: there something else is singular where its parts are eliminated
BESIDE_LEVEL = 1.02


class Form(NamedTuple):
    """The form of all inputs of frames at points, of which some in a row are of each panel, the
    first its middle: A less identity, G, P, S and R, each with a bound on its error."""

    E: Bounded
    G: Bounded
    P: Bounded
    S: Bounded
    R: Bounded
    points: int
    at_rest: bool

    sure = 1e-9  # of its terms, from which on its sign at an angle is known

    @property
    def inputs(self) -> int:
        """Of the pencil."""
        return self.R.value.shape[-1]

    def pencil(self) -> tuple[Bounded, Bounded]:
        """N - L, and L."""
        E, G, P, S, R, *_ = self
        identity = Bounded.exact(np.eye(E.value.shape[-1]))
        K = Bounded.block([[E, 0, G], [P, E.mT, S], [S.mT, G.mT, R]])
        return K, Bounded.block([[identity, 0, 0], [0, -(identity + E.mT), 0], [0, -G.mT, R * 0.0]])

    def singular(self, shape: tuple[int, int]) -> np.ndarray:
        """Whether a pole may be 1 in panels, if that matters."""
        if not self.at_rest:
            return np.zeros(shape[0], bool)
        E = self.E.value
        return poles_inside(determinants(E.reshape(*shape, *E.shape[1:]))[..., None])

    def least(self, panels: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """The least eigenvalue of the form at angles, of the size of its terms, `(n, angles)`, 0
        where it is not known; panels: which, in whose middles."""
        middles = (matrix[panels * self.points].real for matrix, _ in self[:5])
        E, G, P, S, R = (matrix[:, None] for matrix in middles)
        with np.errstate(all="ignore"):
            x = solve(on_circle(theta)[..., None, None] * np.eye(E.shape[-1]) - E, G + 0j)
            back = x.mT.conj()
            across = S.mT @ x
            form = back @ P @ x + across + across.mT.conj() + R
            size = np.abs(back) @ np.abs(P) @ np.abs(x) + 2 * np.abs(S.mT) @ np.abs(x) + np.abs(R)
            finite = np.isfinite(form).all((-1, -2))
            values = np.linalg.eigvalsh(np.where(finite[..., None, None], form, 0.0))
            least = values[..., 0] / size.sum((-1, -2))
        return np.where(finite, least, 0.0)


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

    inputs = 0  # that are left
    sure = SURE_SIGN

    def pencil(self) -> tuple[Bounded, Bounded]:
        """N - L, and L."""
        identity = Bounded.exact(np.eye(self.E.value.shape[-1]))
        K = Bounded.block([[self.E, -self.G], [-self.Q, -self.E.mT]])
        return K, Bounded.block([[identity, self.G], [0, identity + self.E.mT]])

    def singular(self, shape: tuple[int, int]) -> np.ndarray:
        """Whether something that is eliminated may be singular in panels."""
        eliminated = np.stack(self.pivots, -1).reshape(*shape, -1)
        return ~np.isfinite(self.below) | poles_inside(eliminated)

    def least(self, panels: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """What is positive at angles if the form is, as a share of its largest eigenvalue, `(n,
        angles)`.

        panels: which, in whose middles. It is the least eigenvalue above the negative ones that
        come of states and of what is eliminated.
        """
        E, G, Q = (matrix[panels * self.points].real for matrix, _ in (self.E, self.G, self.Q))
        n = E.shape[-1]
        units = _units(G, Q)
        u = units[:, None, :]
        v = units[:, :, None]
        moved = (E * u / v)[:, None] - on_circle(theta)[..., None, None] * np.eye(n)
        form = np.zeros((*theta.shape, 2 * n, 2 * n), complex)
        form[..., :n, :n] = -(G / (u * v))[:, None]
        form[..., :n, n:] = moved
        form[..., n:, :n] = moved.mT.conj()
        form[..., n:, n:] = (Q * u * v)[:, None]
        values = np.linalg.eigvalsh(np.where(np.isfinite(form), form, 0.0))
        negative = n - np.nan_to_num(self.below[panels])
        least = np.clip(negative, 0, 2 * n - 1).astype(int)
        least = values[np.arange(len(values)), :, least]
        return least / np.maximum(np.abs(values).max(-1), NEXT_TO_ZERO)


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
    identity = Bounded.exact(np.eye(first.E.value.shape[-1]))
    star = identity + first.G @ second.Q
    X = star.inverse()
    A_1 = identity + first.E
    A_2 = identity + second.E
    spread = X @ first.G
    carried = first.E - spread @ second.Q @ A_1  # X A_1, less identity
    E = carried + second.E + second.E @ carried
    G = second.G + A_2 @ spread @ A_2.mT
    Q = first.Q + A_1.mT @ second.Q @ (identity + carried)
    pivots = (*first.pivots, *second.pivots, np.linalg.det(star.value))
    below = (
        first.below
        + second.below
        + _negative(first.G[0][:: first.points].real, second.Q[0][:: first.points].real)
    )
    return Joined(E, _symmetric(G), _symmetric(Q), first.points, pivots, below)


def _negative(G: np.ndarray, Q: np.ndarray) -> np.ndarray:
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


@dataclass(frozen=True, slots=True, eq=False)
class BoundedGain(Between):
    """The gain of loops between an input and a signal along a number; level: which it has to stay
    below.

    arc: its ends (rad), on which it has to be so, `(columns, 2)`. at_rest: whether the gain at rest
    is the level at all values, and its neighbourhood decides.
    """

    arc: np.ndarray
    at_rest: bool
    forms: ClassVar[None] = None

    @property
    def long(self) -> bool:
        """Whether the inputs are eliminated."""
        return self.read.size > FEW_INPUTS and not self.at_rest

    @property
    def order(self) -> int:
        """Of the pencil."""
        return 2 * self.kept.size + (0 if self.long else self.read.size)

    def at_rest_through(self, column: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What comes of inputs that are constant, as a map of a frame, and the constant input, of
        length 1."""
        E, G, O, T = (matrix for matrix, _ in self.maps(column, p))
        w = np.full((self.read.size, 1), self.read.size**-0.5)
        return T - O @ solve(E, G), w

    def off_at_rest(self, column: np.ndarray, p: np.ndarray) -> np.ndarray:
        """By how much what comes of a constant input, and what goes to a constant output, differ
        from the level at rest."""
        H, w = self.at_rest_through(column, p)
        signed = np.copysign(self.level, w.mT @ H @ w) * w
        of_output = np.abs(H @ w - signed).max((-1, -2))
        of_input = np.abs(H.mT @ w - signed).max((-1, -2))
        return np.maximum(of_output, of_input)

    def labelled(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> np.ndarray:
        port, shape, judged = self._about(column, low, high, bounds)
        label, singular = self._at_level(1.0, column, port, shape, judged)
        for beside, verdict in ((BESIDE_LEVEL, BAD), (1 / BESIDE_LEVEL, GOOD)):
            again = singular & (label == OPEN)
            if self.long and again.any():
                labels, _ = self._at_level(beside, column, port, shape, again)
                label[again & (labels == verdict)] = verdict
        return label

    def _at_level(
        self,
        beside: float,
        column: np.ndarray,
        port: Any,
        shape: tuple[int, int],
        judged: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The labels of panels that are judged at the level times `beside`, and whether something
        may be singular in them."""
        frame = self._frame(beside, port, shape)
        singular = judged & frame.singular(shape)
        K, L = by_panel(frame.pencil(), shape)
        fine = judged & ~singular
        for array in (*K, *L):
            fine &= np.isfinite(array).all((-1, -2, -3))
        label = np.full(column.size, OPEN)
        panels = np.flatnonzero(fine)
        if not panels.size:
            return label, singular

        middle = [matrix.part(panels, 0).real for matrix in (K, L)]
        rims = K.value[panels, 1:], L.value[panels, 1:]
        arc = self.arc[self.columns[column[panels]]]
        inside, d = clear(*middle, rims, frame.inputs, arc)
        theta = _angles(d, arc)
        value = frame.least(panels, theta)
        label[panels[inside & (value.max(-1) > frame.sure)]] = GOOD
        by_signs = self.long or self.at_rest
        sure = frame.sure if by_signs else 0.0  # `_exceeds` needs no sign to begin with
        at_one = np.flatnonzero(value.min(-1) < -sure)
        if at_one.size:
            z = theta[at_one, value[at_one].argmin(-1)]
            if by_signs:
                rims = [rim[at_one] for rim in rims]
                arc = np.stack([z, z], -1)
                alone, _ = clear(*of_panels(middle, at_one), rims, frame.inputs, arc)
            else:
                maps = by_panel(self.over_frame(port, np.prod(shape)), shape)
                with np.errstate(all="ignore"):
                    alone = _exceeds(of_panels(maps, panels[at_one]), self.level, z)
            label[panels[at_one[alone]]] = BAD
        return label, singular

    def worst_at(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The point of the circle, less 1, at which the form is least, and by how much it is
        negative, of its terms."""
        port, _ = self.between(np.full(p.size, np.searchsorted(self.columns, column)), p)
        frame = self._frame(1.0, port, (p.size, 1))
        K, L = frame.pencil()
        arc = self.arc[np.full(p.size, column)]
        _, d = clear(K, L, (K.value[:, None], L.value[:, None]), frame.inputs, arc)
        theta = _angles(d, arc)
        value = self._form(port, (p.size, 1)).least(np.arange(p.size), theta)
        loop = np.arange(p.size)
        lowest = value.argmin(-1)
        return on_circle(theta[loop, lowest]), -value[loop, lowest]

    def _frame(self, beside: float, port: Any, shape: tuple[int, int]) -> Form:
        """Frames at points of panels, at the level times `beside`, without their inputs if they
        are long."""
        if not self.long:
            return self._form(port, shape)
        ticks = of_ticks(port, self.kept, (np.prod(shape),))
        square = (self.level * beside) ** 2
        with np.errstate(all="ignore"):
            eliminated = [of_tick(*terms, square, shape[1]) for terms in ticks]
            return in_a_row(port.kind.tolist(), eliminated, then)

    def _form(self, port: Any, shape: tuple[int, int]) -> Form:
        """The form of all inputs of frames at points of panels: P, S and R of this file's first lines, at
        rest those in which the constant input w does not count."""
        points = shape[1]
        E, G, O, T = self.over_frame(port, np.prod(shape))
        P = -(O.mT @ O)
        S = -(O.mT @ T)
        R = Bounded.exact(self.level * np.eye(self.read.size)) * self.level - T.mT @ T
        if not self.at_rest:
            return Form(E, G, P, S, R, points, at_rest=False)
        X = (-E).inverse()
        w = np.full((self.read.size, 1), self.read.size**-0.5)
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
        late = w @ (c @ r) @ w.mT
        late = late * f * f - (w_cG + w_cG.mT) * f
        G = G - (r @ w.mT) * f
        return Form(E, G, P, S - (w_cA * f).mT, R + late, points, at_rest=True)


class Sine(BoundedGain):
    """The same at the frequency of a sine itself, which `read` has all ticks of: see `sines`."""

    __slots__ = ()

    def off_at_rest(self, column: np.ndarray, p: np.ndarray) -> np.ndarray:
        """By how much the gain of a constant differs from the level."""
        H, w = self.at_rest_through(column, p)
        through = w.mT @ H @ w
        return np.abs(through - np.copysign(self.level, through)).max((-1, -2))

    def labelled(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> np.ndarray:
        port, shape, judged = self._about(column, low, high, bounds)
        maps = by_panel(self.over_frame(port, np.prod(shape)), shape)
        for matrix, size in maps:
            judged &= np.isfinite(matrix).all((1, 2, 3)) & np.isfinite(size).all((1, 2, 3))
        label = np.full(column.size, OPEN)
        for panel in np.flatnonzero(judged):
            label[panel] = self._panel(column[panel], of_panels(maps, panel)).label()
        return label

    def _panel(self, column: int, maps: list[Bounded]) -> Panel:
        return Panel(maps, self.level, self.arc[self.columns[column]], self.at_rest)

    def worst_at(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As that of `BoundedGain`."""
        index = np.searchsorted(self.columns, column)
        maps = self.maps(np.full(p.size, index), p)
        worst = [
            self._panel(index, of_panels(maps, slice(at, at + 1))).worst() for at in range(p.size)
        ]
        delta, beyond = np.array(worst).T
        return delta, beyond.real


def _angles(d: np.ndarray, arc: np.ndarray) -> np.ndarray:
    """Angles (rad) of arcs at which the form is looked at, `(n, any)`: some, those of
    eigenvalues d of the pencil next to the arc, and between these."""
    off = off_arc(d, arc)
    nearest = np.argsort(off, -1)[:, :8]  # eigenvalues
    d = np.take_along_axis(d, nearest, -1)
    off = np.take_along_axis(off, nearest, -1)
    low = arc[:, :1]
    high = arc[:, 1:]
    beside = np.where(off <= NEAR_CIRCLE, angles_of(d), np.nan)
    angles = with_middles(np.clip(beside, low, high))
    angles = np.where(np.isnan(angles), low, np.clip(angles, low, high))
    return np.concatenate([angles, low + (high - low) * START / np.pi], -1)


def _units(G: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Units of the states in which G and Q are alike on their diagonals."""
    of_G, of_Q = (np.abs(np.diagonal(form, axis1=-2, axis2=-1)) for form in (G, Q))
    both = np.isfinite(of_G) & np.isfinite(of_Q) & (of_G > 0) & (of_Q > 0)
    return np.where(both, np.where(both, of_G, 1.0) / np.where(both, of_Q, 1.0), 1.0) ** 0.25


def _symmetric(matrix: Bounded) -> Bounded:
    """The symmetric part of a matrix, of one that is symmetric but for rounding."""
    return (matrix + matrix.mT) * 0.5


def _exceeds(
    maps: tuple[Bounded, Bounded, Bounded, Bounded], level: float, theta: np.ndarray
) -> np.ndarray:
    """Whether the gain is beyond the level, or infinite, at an angle of each panel for all numbers
    of it.

    With h and v the singular vectors of H(z) in the middle, the gain is at least |f|, f = h* H(z) v,
    and 1/f is the last entry of the inverse of

        M = [z - A, -G v; h* O, h* T v],

    analytic in the disc where this is regular, also if z is an eigenvalue of A. By Schwarz's lemma
    it moves in the panel by at most half of what it moves to the rim, whose lower half is the upper
    one for the conjugates of z, h and v.
    """
    E, G, O, T = (matrix[:, 0].real for matrix, _ in maps)
    z = on_circle(theta)[:, None, None] * np.eye(E.shape[-1])  # less 1
    H = T + O @ solve(z - E, G + 0j)
    finite_panels = np.isfinite(H).all((-1, -2))
    h, _, v = np.linalg.svd(np.where(finite_panels[:, None, None], H, 0.0))
    E, G, O, T = maps
    determinant = 1.0
    moved = 0.0
    left_vectors = h[:, None, :, :1]
    right = v[:, None, :1].mT
    for w, h, v in ((z, left_vectors.conj(), right.conj()), (z.conj(), left_vectors, right)):
        of_states = Bounded(w, 2 * EPS * np.abs(w)).each(lambda entries: entries[:, None]) - E
        M = Bounded.block([[of_states, -(G @ v)], [(O.mT @ h).mT, (T.mT @ h).mT @ v]])
        least = inverse(M.value)[..., -1, -1]  # 1/f
        moved = np.maximum(moved, np.abs(least[:, 1:] - least[:, :1]).max(-1))
        determinant = determinant * determinants(M.value)
    # Of the conjugates in the middle, whose size is the same.
    largest_inverse = M.part(slice(None), 0).inverse().size[:, -1, -1] + SAFE / 2 * moved
    # The vectors are of length 1 up to rounding.
    return (
        finite_panels
        & (largest_inverse * level < 1 - SURE_SIGN)
        & ~poles_inside(determinant[..., None])
    )
