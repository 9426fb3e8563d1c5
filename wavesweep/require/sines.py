"""The gain of a sine at its own frequency, as `bode` has it, of loops of several ticks a frame,
shown to be below a level.

With H, M times M, the map of a frame from the inputs of its ticks to its outputs, and a(z) = (1, z,
..., z^(M - 1)), a sine of z = e^{j theta} per tick comes out with `h(z) = a(1/z)' H(z^M) a(z)/M` at
its frequency. An input that is not read in a tick has a column of zeros in H. What is asked is the sign of

    f = level^2 - h(z) h(1/z),

which is real for real theta and p, the number, and analytic in both where z^M and z^-M are no
eigenvalues of a frame. With the characteristic polynomials of both, F = f q(z^M) q(z^-M) is
analytic everywhere. Where h(1) is the level at all p, f has a double zero at theta = 0, and f/(4
sin^2(theta/2)) takes its place.

At one angle, F on a circle of p about a panel, of twice its size, bounds how much it differs on the
panel from its value in the middle (Schwarz's lemma): half of what it does on the circle. If this
leaves the sign open, the panel has to be halved. An arc of half width r about an angle is proved
for a panel by the same lemma along all lines through the middle: f differs there by at most half of
what it does where theta is on a circle of 2 r and p on that circle. For this no eigenvalue may be
among the z^M of the circle of theta. None is at its middle for any p if q does not vanish there;
then the inverse of the least distance from there to an eigenvalue, a spectral radius of an analytic
matrix, is largest on the circle of p (Vesentini). Other arcs are halved.
"""

from collections.abc import Sequence

import numpy as np

from wavesweep.engine.frames import Bounded, on_circle, solve, sum_rounding
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, SAFE

CIRCLE_POINTS = 16  # of a circle of theta
AROUND = np.exp(2j * np.pi * (np.arange(CIRCLE_POINTS) + 0.5) / CIRCLE_POINTS)
# values of theta about the lowest one, between the neighbours of which the next ones are
NARROWER = 9


class Panel:
    """The map of a frame in the middle of a disc of a number, and on its rim.

    maps: E less identity, G, O and T, each with a bound on its error, of the points, `(points, r,
    c)`, the first the middle. level: of the gain. arc: of theta (rad). at_rest: whether the gain is
    the level at theta = 0 for all numbers.
    """

    def __init__(
        self, maps: Sequence[Bounded], level: float, arc: np.ndarray, at_rest: bool
    ) -> None:
        from scipy.linalg import schur

        E, G, O, T = (matrix for matrix, _ in maps)
        self.middle = [each.part(0) for each in maps]
        self.level = level
        self.arc = arc
        self.at_rest = at_rest
        self.ticks = T.shape[-1]
        upper = []
        basis = []
        for matrix in E:
            of_matrix, vectors = schur(matrix, output="complex")
            upper.append(of_matrix)
            basis.append(vectors)
        self.upper = np.array(upper)
        basis = np.array(basis)
        self.G = basis.mT.conj() @ G
        self.O = (O @ basis).mT
        self.late = np.arange(1 - self.ticks, self.ticks)
        diagonals = [np.trace(T, offset=-lag, axis1=-2, axis2=-1) for lag in self.late]
        self.T = np.stack(diagonals, -1)
        with np.errstate(divide="ignore"):
            self.poles = np.log1p(np.diagonal(self.upper[0]))
        slow = np.abs(self.poles[self.poles != 0])  # a mode at rest has no angle to look at
        self.slow = slow.min(initial=1.0) / self.ticks

    def _sided(self, theta: np.ndarray, points: int | None) -> tuple[np.ndarray, np.ndarray]:
        """h and Q at angles, `(points, n)`, of the first points."""
        M = self.ticks
        upper = self.upper[:points]
        z = np.exp(1j * theta * np.arange(M)[:, None])
        w = np.expm1(1j * M * theta)
        x = self.G[:points] @ z
        left = self.O[:points] @ (1 / z)
        away = w - np.diagonal(upper, axis1=-2, axis2=-1)[..., None]
        for row in reversed(range(upper.shape[-1])):
            of_others = upper[:, row : row + 1, row + 1 :] @ x[:, row + 1 :]
            x[:, row] = (x[:, row] + of_others[:, 0]) / away[:, row]
        direct = self.T[:points] @ np.exp(-1j * theta * self.late[:, None])
        h = ((left * x).sum(1) + direct) / M
        Q = (away / (1 + w)).prod(1)
        return h, Q

    def both(self, theta: np.ndarray, points: int | None) -> tuple[np.ndarray, np.ndarray]:
        """level^2 - h h, over the double zero, and Q Q, at angles, `(points, n)`."""
        with np.errstate(all="ignore"):
            h, Q = self._sided(theta, points)
            h_back, Q_back = self._sided(-theta, points)
            f = self.level**2 - h * h_back
            if self.at_rest:
                f = f / (4 * np.sin(theta / 2) ** 2)
            return f, Q * Q_back

    def error(self, theta: np.ndarray) -> np.ndarray:
        """A bound on the error of level^2 - h h in the middle at angles, over the double zero,
        `(n,)`."""
        E, G, O, T = (matrix for matrix, _ in self.middle)
        M = self.ticks
        n = E.shape[-1]
        terms = 3 * (n + M + 4)  # of three sums, one after the other
        rough = sum_rounding(terms, of_complex=True)
        dE, dG, dO, dT = (each.with_rounding(terms, of_complex=True) for each in self.middle)

        def sided(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            """The size of M h, and a bound on its error."""
            z = np.exp(1j * theta[:, None] * np.arange(M))
            w = np.expm1(1j * M * theta)
            A = w[:, None, None] * np.eye(n) - E
            x = solve(A, (z @ G.T)[..., None])[..., 0]
            y = solve(A.mT, ((1 / z) @ O)[..., None])[..., 0]
            x_size = np.abs(x)
            y_size = np.abs(y)
            z_size = np.abs(z)
            back_size = np.abs(1 / z)
            missed = x_size @ dE.T + rough * np.abs(w)[:, None] * x_size + z_size @ dG.T
            off = (y_size * missed).sum(-1)
            off = off + (x_size * (back_size @ dO)).sum(-1)
            off = off + (back_size * (z_size @ dT.T)).sum(-1)
            return np.abs((1 / z * (x @ O.T + z @ T.T)).sum(-1)), 2 * off

        size, off = sided(theta)
        size_back, off_back = sided(-theta)
        of_product = (size * off_back + size_back * off + off * off_back) / M**2
        total = of_product + rough * (self.level**2 + size * size_back / M**2)
        if self.at_rest:
            return total / np.abs(4 * np.sin(theta / 2) ** 2)
        return total

    def at(self, theta: np.ndarray, points: int | None) -> tuple[np.ndarray, np.ndarray]:
        """F over Q Q in the middle, at angles, `(points, n)`, and a bound on its error in the
        middle, `(n,)`.

        At the double zero it is the mean over a circle.
        """
        zero = (theta == 0) & self.at_rest
        beside = np.where(zero, self.slow, theta)
        f, Q = self.both(beside, points)
        value = f * Q / Q[:1].real
        error = self.error(beside)
        if zero.any():
            rim = self.slow / 4 * AROUND
            f, Q = self.both(rim, points)
            _, Q_zero = self.both(np.zeros(1), 1)
            Q_zero = Q_zero[0, 0]
            with np.errstate(all="ignore"):  # not finite, and OPEN, with a mode at rest
                value[:, zero] = ((f * Q).mean(-1) / Q_zero.real)[:, None]
                error[zero] = (self.error(rim) * np.abs(Q[0] / Q_zero)).max()
        return value, error

    def _finite(self, theta: np.ndarray) -> np.ndarray:
        """The form in the middle at angles, `(n,)`; infinite where a mode is on the circle."""
        value = self.both(theta, 1)[0][0].real
        return np.where(np.isfinite(value), value, np.inf)

    def lowest(self) -> float:
        """An angle at which the form is about least."""
        M = self.ticks
        low, high = self.arc
        smallest = 1e-3 * self.slow  # angle that is looked at, of that of the slowest mode
        even = np.linspace(low, high, int(16 * M * (high - low) / np.pi) + 48)
        small = np.geomspace(smallest, np.pi, 100)
        modes = (self.poles.imag[:, None] + 2 * np.pi * np.arange(M)).ravel() / M
        theta = np.concatenate([even, small, modes])
        first = max(low, smallest) if self.at_rest else low
        theta = np.unique(np.clip(theta[(theta >= first) & (theta <= high)], first, high))
        value = self._finite(theta)
        inner = np.append(np.inf, value[:-1]) >= value
        inner &= np.append(value[1:], np.inf) >= value
        at = np.flatnonzero(inner)
        at = at[np.argsort(value[at])[:6]]  # the lowest angles, about which it is narrowed
        best = theta[at]
        below = theta[np.maximum(at - 1, 0)]
        above = theta[np.minimum(at + 1, theta.size - 1)]
        for _ in range(14):  # steps of narrowing
            points = below[:, None] + (above - below)[:, None] * np.linspace(0, 1, NARROWER)
            lowest = self._finite(points.ravel()).reshape(points.shape).argmin(-1)
            row = np.arange(at.size)
            best = points[row, lowest]
            below = points[row, np.maximum(lowest - 1, 0)]
            above = points[row, np.minimum(lowest + 1, NARROWER - 1)]
        if self.at_rest:
            best = np.append(best, 0.0)
        value, _ = self.at(best, 1)
        return float(best[np.argmin(np.where(np.isfinite(value[0]), value[0].real, np.inf))])

    def label(self) -> int:
        """GOOD, BAD or OPEN, for all numbers of the panel: by the lowest angle, or by arcs that are
        halved until each is proved."""
        decided = self._decided(np.array([self.lowest()]))
        if decided is not None:
            return decided
        low, high = self.arc
        # Half width of the first arcs, of an angle of 1 in a frame.
        count = int(np.ceil((high - low) * self.ticks / (2 * 0.2)))
        edges = np.linspace(low, high, count + 1)
        low = edges[:-1]
        high = edges[1:]
        # Values at a time.
        at_once = max(1, 200_000 // (CIRCLE_POINTS * len(self.upper) * self.upper.shape[-1]))
        tried = 0
        while low.size:
            tried += low.size
            if tried > 1000:  # after more arcs the panel is halved
                return OPEN
            # The arc that begins at the double zero, theta = 0, is half of one about it.
            about_zero = (low == 0) & self.at_rest
            theta = np.where(about_zero, 0.0, (low + high) / 2)
            half = np.where(about_zero, high, (high - low) / 2)
            decided = self._decided(theta)
            if decided is not None:
                return decided
            proved = np.zeros(theta.size, bool)
            for first in range(0, theta.size, at_once):
                batch = slice(first, first + at_once)
                proved[batch] = self._proved(theta[batch], half[batch])
            low = low[~proved]
            high = high[~proved]
            middle = (low + high) / 2
            low = np.concatenate([low, middle])
            high = np.concatenate([middle, high])
        return GOOD

    def _decided(self, theta: np.ndarray) -> int | None:
        """BAD if F is negative at an angle for all numbers, OPEN if it may be so for some; None
        else."""
        value, error = self.at(theta, None)
        middle = value[0].real
        change = SAFE / 2 * np.abs(value[1:] - middle).max(0, initial=0.0)
        if (middle + error + change < 0).any():
            return BAD
        if (middle - error - change > 0).all():
            return None
        return OPEN

    def _proved(self, theta: np.ndarray, half: np.ndarray) -> np.ndarray:
        """Whether the form is positive on arcs for all numbers."""
        proved = self._clear(theta, half)
        theta = theta[proved]
        half = half[proved]
        value, error = self.at(theta, 1)
        middle = value[0].real
        rim = theta[:, None] + 2 * half[:, None] * AROUND
        f, _ = self.both(rim.ravel(), None)
        f = f.reshape(len(self.upper), *rim.shape)
        with np.errstate(all="ignore"):
            change = np.abs(f - middle[:, None]).max((0, 2))
            proved[proved] = middle - error - SAFE / 2 * change > 0
        return proved

    def _clear(self, theta: np.ndarray, half: np.ndarray) -> np.ndarray:
        """Whether no eigenvalue of a frame is on the circles about arcs, or within, for any
        number of the disc."""
        _, Q = self.both(theta, None)
        diagonal = np.diagonal(self.upper, axis1=-2, axis2=-1)[..., None]
        distance = np.inf
        for side in (-1, 1):
            w = np.expm1(side * 1j * self.ticks * theta)
            distance = np.minimum(distance, np.abs(w - diagonal).min((0, 1)))
        none_at_middle = SAFE * np.abs(Q / Q[:1] - 1).max(0) < 1
        return none_at_middle & (SAFE * np.expm1(2 * self.ticks * half) < distance)

    def largest(self) -> float:
        """The largest gain of the first point, found and not proved, with a level of 0."""
        f, _ = self.both(np.array([self.lowest()]), 1)
        return float(np.sqrt(-f[0, 0].real))

    def worst(self) -> tuple[complex, float]:
        """The point of the circle, less 1, at which the form is least, and by how much it is
        negative, of its terms."""
        theta = np.array([self.lowest()])
        value, _ = self.at(theta, 1)
        beyond = -value[0, 0].real
        if self.at_rest:
            beyond = beyond * self.slow**2
        return on_circle(theta)[0], beyond / (2 * self.level**2)
