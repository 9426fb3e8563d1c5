"""The gain of a sine at its own frequency: that of loops of several ticks a frame, shown to be below a level.

With H, M times M, the map of a frame from the inputs of its ticks to its outputs, and a(z) = (1, z, ..., z^(M - 1)), a sine of
z = e^{j theta} per tick comes out with `h(z) = a(1/z)' H(z^M) a(z)/M` at its frequency. What is asked is the sign of

    f = level^2 - h(z) h(1/z),

which is real for real theta and p, the number, and analytic in both where z^M and z^-M are no eigenvalues of a frame. With the
characteristic polynomials of both, F = f q(z^M) q(z^-M) is analytic everywhere. Where h(1) is the level at all p, f has a
double zero at theta = 0, and f/(4 sin^2(theta/2)) takes its place.

At one angle, F on a circle of p about a panel, of twice its size, bounds how much it differs on the panel from its value in
the middle (Schwarz's lemma): half of what it does on the circle. If this leaves the sign open, the panel has to be halved. An
arc of half width r about an angle is proved for a panel by the same lemma along all lines through the middle: f differs there
by at most half of what it does where theta is on a circle of 2 r and p on that circle. For this no eigenvalue may be among the
z^M of the circle of theta. None is at its middle for any p if q does not vanish there; then the inverse of the least distance
from there to an eigenvalue, a spectral radius of an analytic matrix, is largest on the circle of p (Vesentini). Other arcs are
halved.
"""

import numpy as np

from wavesweep.engine.frames import ROUNDING, on_circle, solve
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, SAFE

POINTS = 16  # of a circle of theta
AROUND = np.exp(2j * np.pi * (np.arange(POINTS) + 0.5) / POINTS)
WIDE = 0.2  # half width of the first arcs, of an angle of 1 in a frame
MANY = 1000  # arcs that are looked at, beyond which the panel is halved
AT_ONCE = 200_000  # values
NARROWER = 9  # values of theta about the lowest one, between the neighbours of which the next ones are
SMALLEST = 1e-3  # angle that is looked at, of that of the slowest mode
TURNS = 14  # of narrowing
LOWEST = 6  # of the angles, about which it is narrowed


class Panel:
    """The map of a frame in the middle of a disc of a number, and on its rim.

    maps: E less identity, G, O and T, each with a bound on its error, of the points, `(points, r, c)`, the first the middle.
    level: of the gain. arc: of theta (rad). at_rest: whether the gain is the level at theta = 0 for all numbers.
    """

    def __init__(self, maps, level, arc, at_rest):
        from scipy.linalg import schur

        (E, *_), (G, *_), (O, *_), (T, *_) = maps
        self.middle = [(array[0], size[0]) for array, size in maps]
        self.level, self.arc, self.at_rest, self.ticks = level, arc, at_rest, T.shape[-1]
        upper, basis = zip(*(schur(matrix, output="complex") for matrix in E), strict=True)
        self.upper, basis = np.array(upper), np.array(basis)
        self.G, self.O = np.swapaxes(basis, -1, -2).conj() @ G, np.swapaxes(O @ basis, -1, -2)
        self.late = np.arange(1 - self.ticks, self.ticks)
        self.T = np.stack([np.trace(T, offset=-lag, axis1=-2, axis2=-1) for lag in self.late], -1)
        with np.errstate(divide="ignore"):
            self.poles = np.log1p(np.diagonal(self.upper[0]))
        self.slow = min(1.0, np.abs(self.poles).min()) / self.ticks

    def _sided(self, theta, points):
        """h and Q at angles, `(points, n)`, of the first points."""
        M, n = self.ticks, self.upper.shape[-1]
        z, upper = np.exp(1j * theta * np.arange(M)[:, None]), self.upper[:points]
        w = np.expm1(1j * M * theta)
        x, left = self.G[:points] @ z, self.O[:points] @ (1 / z)
        away = w - np.diagonal(upper, axis1=-2, axis2=-1)[..., None]
        for row in reversed(range(n)):
            x[:, row] = (x[:, row] + (upper[:, row : row + 1, row + 1 :] @ x[:, row + 1 :])[:, 0]) / away[:, row]
        direct = self.T[:points] @ np.exp(-1j * theta * self.late[:, None])
        return ((left * x).sum(1) + direct) / M, (away / (1 + w)).prod(1)

    def both(self, theta, points):
        """level^2 - h h, over the double zero, and Q Q, at angles, `(points, n)`."""
        with np.errstate(all="ignore"):
            (h, Q), (back, Q_back) = self._sided(theta, points), self._sided(-theta, points)
            f = self.level**2 - h * back
            return (f / (4 * np.sin(theta / 2) ** 2) if self.at_rest else f), Q * Q_back

    def error(self, theta):
        """A bound on the error of level^2 - h h in the middle at angles, over the double zero, `(n,)`."""
        (E, dE), (G, dG), (O, dO), (T, dT) = self.middle
        M, total, sizes = self.ticks, 0.0, []
        rough = 2 * (E.shape[-1] + M + 4) * ROUNDING
        dE, dG, dO, dT = (off + rough * np.abs(matrix) for matrix, off in ((E, dE), (G, dG), (O, dO), (T, dT)))
        for angle in (theta, -theta):
            z, w = np.exp(1j * angle[:, None] * np.arange(M)), np.expm1(1j * M * angle)
            A = w[:, None, None] * np.eye(E.shape[-1]) - E
            x, y = solve(A, (z @ G.T)[..., None])[..., 0], solve(np.swapaxes(A, -1, -2), ((1 / z) @ O)[..., None])[..., 0]
            (ax, ay), (az, ab) = (np.abs(array) for array in (x, y)), (np.abs(z), np.abs(1 / z))
            off = (ay * (ax @ dE.T + rough * np.abs(w)[:, None] * ax + az @ dG.T)).sum(-1)
            off = off + (ax * (ab @ dO)).sum(-1) + (ab * (az @ dT.T)).sum(-1)
            sizes.append((np.abs((1 / z * (x @ O.T + z @ T.T)).sum(-1)), 2 * off))
        (size, d_one), (size_back, d_other) = sizes
        total = (size * d_other + size_back * d_one + d_one * d_other) / M**2 + rough * (
            self.level**2 + size * size_back / M**2
        )
        return total / np.abs(4 * np.sin(theta / 2) ** 2) if self.at_rest else total

    def at(self, theta, points):
        """F over Q Q in the middle, at angles, `(points, n)`, and a bound on its error in the middle, `(n,)`.

        At the double zero it is the mean over a circle.
        """
        zero = (theta == 0) & self.at_rest
        f, Q = self.both(np.where(zero, self.slow, theta), points)
        value, error = f * Q / Q[:1].real, self.error(np.where(zero, self.slow, theta))
        if zero.any():
            rim = self.slow / 4 * AROUND
            (f, Q), (_, Q_zero) = self.both(rim, points), self.both(np.zeros(1), 1)
            value[:, zero] = ((f * Q).mean(-1) / Q_zero[0, 0].real)[:, None]
            error[zero] = (self.error(rim) * np.abs(Q[0] / Q_zero[0, 0])).max()
        return value, error

    def lowest(self):
        """An angle at which the form is about least."""
        M, (low, high) = self.ticks, self.arc
        modes = (self.poles.imag[:, None] + 2 * np.pi * np.arange(M)).ravel() / M
        theta = [np.linspace(low, high, 16 * M + 48), np.geomspace(SMALLEST * self.slow, np.pi, 100), modes]
        theta = np.concatenate(theta)
        first = max(low, SMALLEST * self.slow) if self.at_rest else low
        theta = np.unique(np.clip(theta[(theta >= first) & (theta <= high)], first, high))
        value = self.both(theta, 1)[0][0].real
        inner = np.append(np.inf, value[:-1]) >= value
        inner &= np.append(value[1:], np.inf) >= value
        at = np.flatnonzero(inner)
        at = at[np.argsort(value[at])[:LOWEST]]
        best, below, above = theta[at], theta[np.maximum(at - 1, 0)], theta[np.minimum(at + 1, theta.size - 1)]
        for _ in range(TURNS):
            points = below[:, None] + (above - below)[:, None] * np.linspace(0, 1, NARROWER)
            value = self.both(points.ravel(), 1)[0][0].real.reshape(points.shape)
            lowest = np.where(np.isfinite(value), value, np.inf).argmin(-1)
            row = np.arange(at.size)
            best = points[row, lowest]
            below, above = points[row, np.maximum(lowest - 1, 0)], points[row, np.minimum(lowest + 1, NARROWER - 1)]
        best = np.append(best, 0.0) if self.at_rest else best
        value, _ = self.at(best, 1)
        return best[np.argmin(np.where(np.isfinite(value[0]), value[0].real, np.inf))]

    def label(self):
        """GOOD, BAD or OPEN, for all numbers of the panel."""
        decided = self._decided(np.array([self.lowest()]))
        if decided is not None:
            return decided
        low, high = self.arc
        count = int(np.ceil((high - low) * self.ticks / (2 * WIDE)))
        edges = np.linspace(low, high, count + 1)
        low, high, tried = edges[:-1], edges[1:], 0
        while low.size:
            tried += low.size
            zero = (low == 0) & self.at_rest
            theta, half = np.where(zero, 0.0, (low + high) / 2), np.where(zero, high, (high - low) / 2)
            if tried > MANY or (decided := self._decided(theta)) is not None:
                return OPEN if tried > MANY else decided
            few = max(1, AT_ONCE // (POINTS * len(self.upper) * self.upper.shape[-1]))
            proved = np.concatenate(
                [self._proved(theta[at : at + few], half[at : at + few]) for at in range(0, theta.size, few)]
            )
            low, high = low[~proved], high[~proved]
            middle = (low + high) / 2
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        return GOOD

    def _decided(self, theta):
        """BAD if F is negative at an angle for all numbers, OPEN if it may be so for some; None else."""
        value, error = self.at(theta, None)
        middle, change = value[0].real, SAFE / 2 * np.abs(value[1:] - value[0].real).max(0)
        if (middle + error + change < 0).any():
            return BAD
        return None if (middle - error - change > 0).all() else OPEN

    def _proved(self, theta, half):
        """Whether the form is positive on arcs for all numbers."""
        proved = self._clear(theta, half)
        theta, half = theta[proved], half[proved]
        value, error = self.at(theta, 1)
        rim = theta[:, None] + 2 * half[:, None] * AROUND
        f = self.both(rim.ravel(), None)[0].reshape(len(self.upper), *rim.shape)
        with np.errstate(all="ignore"):
            change = np.abs(f - value[0].real[:, None]).max((0, 2))
            proved[proved] = value[0].real - error - SAFE / 2 * change > 0
        return proved

    def _clear(self, theta, half):
        """Whether no eigenvalue of a frame is on the circles about arcs, or within, for any number of the disc."""
        Q = self.both(theta, None)[1]
        diagonal = np.diagonal(self.upper, axis1=-2, axis2=-1)[..., None]
        off = np.min([np.abs(np.expm1(side * 1j * self.ticks * theta) - diagonal).min((0, 1)) for side in (-1, 1)], 0)
        return (SAFE * np.abs(Q / Q[:1] - 1).max(0) < 1) & (SAFE * np.expm1(2 * self.ticks * half) < off)

    def worst(self):
        """The point of the circle, less 1, at which the form is least, and by how much it is negative, of its terms."""
        theta = np.array([self.lowest()])
        value = self.at(theta, 1)[0][0].real
        size = 2 * self.level**2
        return on_circle(theta)[0], -value[0] * (self.slow**2 if self.at_rest else 1.0) / size
