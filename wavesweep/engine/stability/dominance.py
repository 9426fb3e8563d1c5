"""No eigenvalue of a frame is on a circle for all values of a number in a range: by dominance of the diagonal in eigenvectors.

About a place p0 of a panel (see `entries`), with `p = p0 + half h`, the frame less identity is
`E(h) = D0 + h D1 + h^2 D2 + h^3 D3 + h^4 R`, each entry to a bound. X has the eigenvectors of D0, Z is nearly its inverse, and
K is what turns them with the number, `K_ij = (Z D1 X)_ij / (w_j - w_i)`. So in

    T(z, h) = (1 - hK) Z (z - 1 - E(h)) X (1 + hK)

nothing is left off the diagonal that is linear in h, but for rounding. If T is nonsingular, so is `z - 1 - E(h)`.

T is nonsingular if a vector u > 0 exists with `|T_ii| u_i > sum_j |T_ij| u_j` for each row (dominance of the diagonal). It is
shown for all z of a circle and all h of a range on one side of 0: `|z - 1 - mu_i|` of a diagonal entry mu_i is bounded from
below by a concave function of |h|, all that is subtracted is bounded from above by convex ones, so both ends of the range
prove it all. Then as many eigenvalues are outside the circle as entries mu_i: while the rest of T is taken away by and by, this
stays so, and none crosses.
"""

from dataclasses import dataclass

import numpy as np

from wavesweep.engine.monodromy.unit_circle import inverse, solve
from wavesweep.engine.stability.entries import DEGREES, EPS, ORDER, Panels, taylor

CLUSTER = 0.5  # of their distance from the circle: eigenvalues so near to each other are not told apart
STEEP = 0.25  # most of `h^2 |K_ij K_ji|` at half of the range that is wanted, beyond which two vectors are not turned
WANTED = 0.3  # the most of h that is wanted
REAL = 0.3  # size of an eigenvalue that may be on its way to the circle
OUTSIDE = 1e-6  # of the logarithm of an eigenvalue, from which on it is outside and not on its way there
SURELY = 1e-9  # relative, by which dominance has to hold beyond the rounding of its own terms
DEPENDENT = 1e8  # condition of eigenvectors from which on those of a matrix next to it are taken
DEFECTIVE = 1e-14, 1e-10  # of the largest entry, how far that is from it
MANY = 64  # states, beyond which a block makes tests shorter
SMALLEST, LARGEST = 0.2, 0.98  # sizes of eigenvalues, below which all are alike for a block, and beyond which none is in it
SLACK, DOUBLED = 0.5, 12  # of what is left to 1, how much a block leaves; terms of its unit's series, as a power of two
TINY = 1e-150  # added to norms, whose squares may underflow


def eigenbasis(E) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vectors of matrices less identity, as columns, the inverses, which are huge or NaN if there are too few, and which
    vectors are a block, `(matrices, n)`; the others are eigenvectors.

    They are orthonormal within clusters of eigenvalues that are nearer to each other than to the circle, as nothing has to tell
    these apart. Where they are nearly dependent, those of small eigenvalues become a block, as for delay lines, which have one
    eigenvector each; where they still are, those of a matrix next to it are taken.
    """
    n, block = E.shape[-1], np.zeros(E.shape[:2], bool)
    X, Z = _vectors(E) if n <= MANY else np.full((2, *E.shape), np.inf, complex)
    for at in _dependent(X, Z):
        X[at], Z[at], block[at] = _with_block(E[at])
    for size in DEFECTIVE:
        dependent = _dependent(X, Z)
        if not dependent.size:
            break
        change = np.cos(np.arange(n * n) ** 2.0).reshape(n, n) * np.abs(E[dependent]).max((1, 2), keepdims=True)
        (X[dependent], Z[dependent]), block[dependent] = _vectors(E[dependent] + size * change), False
    return X, Z, block


def _dependent(X, Z):
    with np.errstate(invalid="ignore"):
        return np.flatnonzero(~((np.abs(Z) @ np.abs(X)).max((1, 2)) < DEPENDENT))


def _with_block(E):
    """Eigenvectors of the eigenvalues beyond the widest gap in their sizes, and a basis of what the left ones do not see.

    In that basis the block N shortens every vector: its unit is P with `P = 1 + N'PN/r^2`, r being between its spectral radius
    and 1.
    """
    n, ((w, X), (v, Y)) = len(E), (np.linalg.eig(E), np.linalg.eig(E.T))
    order, left_order = np.argsort(np.abs(1 + w)), np.argsort(np.abs(1 + v))
    size = np.maximum(np.abs(1 + w[order]), SMALLEST)
    gaps = np.where(size[:-1] < LARGEST, size[1:] / size[:-1], 0)
    k = 1 + int(np.argmax(gaps)) if gaps.any() else 0
    basis = np.linalg.qr(Y[:, left_order[k:]].conj(), mode="complete")[0][:, n - k :]
    N = basis.conj().T @ (basis + E @ basis)
    power, P = N / (1 - (1 - size[k - 1]) * SLACK), np.eye(k, dtype=complex)
    for _ in range(DOUBLED):
        P, power = P + power.conj().T @ P @ power, power @ power
    (alone,) = _orthonormal(w[None, order[k:]], X[None, :, order[k:]])
    X = np.concatenate([basis @ inverse(_cholesky(P)).conj().T, alone], 1)
    return X, inverse(X), np.arange(n) < k


def _vectors(E):
    X = _orthonormal(*np.linalg.eig(E))
    return X, inverse(X)


def _orthonormal(w, X):
    """Eigenvectors that are orthonormal within clusters."""
    w, X = w.astype(complex), X.astype(complex)
    alike = _alike(w)
    clustered = np.flatnonzero(alike.sum((1, 2)) > w.shape[1])
    if clustered.size:
        link, vectors = alike[clustered].astype(float), X[clustered]
        for _ in range(3):
            link = np.minimum(link @ link, 1)
        gram = link * (vectors.conj().swapaxes(1, 2) @ vectors) + EPS * np.eye(w.shape[1])
        X[clustered] = vectors @ inverse(_cholesky(gram)).conj().swapaxes(1, 2)
    return X


def _cholesky(gram):
    try:
        return np.linalg.cholesky(gram)
    except np.linalg.LinAlgError:
        return np.broadcast_to(np.eye(gram.shape[-1]), gram.shape)


def _alike(w):
    """Which eigenvalues less 1 are so near to each other."""
    far = np.abs(np.abs(1 + w) - 1)
    return np.abs(w[:, None] - w[:, :, None]) < CLUSTER * np.minimum(far[:, :, None], far[:, None, :])


def _turning(B, w, wanted, block):
    """K; 0 for two vectors that turn too fast, or need not be told apart, and for a block."""
    with np.errstate(all="ignore"):
        K = B[:, 1] / (w[:, None, :] - w[:, :, None])
        steep = np.abs(K * K.swapaxes(1, 2)) * np.minimum(wanted, WANTED)[:, None, None] ** 2
        alike = _alike(w) | block[:, None] | block[:, :, None]
        K = np.where((steep < STEEP) & ~alike & np.isfinite(K), K, 0)
    K[:, range(w.shape[1]), range(w.shape[1])] = 0
    return K


@dataclass(frozen=True, slots=True)
class ExactFrames:
    """Frames less identity at the places of some tests themselves, and bounds on their errors."""

    tests: np.ndarray
    E: np.ndarray
    off: np.ndarray


def rounding_of(n) -> float:
    """Return the relative rounding of products of up to five matrices of n states."""
    return 16 * (n + 4) * EPS / 2


def expansions(panels: Panels, at, x, pad, exact: ExactFrames) -> tuple[np.ndarray, ...]:
    """Return the terms of the frames less identity about places of panels, `(tests, ORDER, n, n)`, the sizes of what each is a
    sum of, and bounds on the errors of the entries: at the places, and by how much more they are off for each h from there.

    The arguments are those of `DominanceTests`.
    """
    n, m = panels.error.shape[-1], at.size
    degree = DEGREES[1] if panels.coefficients[at, DEGREES[0] + 1 :].any() else DEGREES[0]
    T, c = taylor(x, degree), panels.coefficients[at, : degree + 1].reshape(m, degree + 1, n * n)
    D, aD = ((t @ series).reshape(m, ORDER, n, n) for t, series in ((T, c), (np.abs(T), np.abs(c))))
    error, drift = panels.error[at].copy(), np.zeros((m, n, n))
    exact_tests = exact.tests
    if exact_tests.size:
        # The model's error e, which is known at the place itself, changes by |e'| <= 4 degree max |e| times h at most: e is
        # a polynomial of that degree, of rounding, and q g as in `panels_of`, where |q'| < degree + 3 within the panel,
        # and |g'| < 2.2 max |g|, as the rim is 0.45 away (Cauchy).
        off = np.abs(exact.E - D[exact_tests, 0]) <= 2 * (error[exact_tests] + exact.off)
        drift[exact_tests], D[exact_tests, 0] = 4 * degree * error[exact_tests], exact.E
        error[exact_tests] = np.where(off.all((1, 2), keepdims=True), exact.off, np.inf)
    error += pad[:, None, None] * np.abs(D[:, 1])
    lost = ~np.isfinite(D[:, 0]).all((1, 2))
    D[lost], error[lost] = 0.0, np.inf
    return D, aD, error, drift


class DominanceTests:
    """Tests about places of panels, one element each; see this file's head.

    w: eigenvalues less 1 at the place, `(tests, n)`; unsure: bounds on their errors; excess, slope: of `|mu|^2 - 1` at h = 0.
    """

    def __init__(self, panels: Panels, at, x, pad, wanted, exact: ExactFrames):
        """at: panels of the tests; x: places on them, from -1 to 1, known to `pad`; wanted: half of what is to be proved."""
        D, aD, error, drift = expansions(panels, at, x, pad, exact)
        n = panels.error.shape[-1]
        X, Z, block = eigenbasis(D[:, 0])
        B = Z[:, None] @ D @ X[:, None]
        w, self.real = np.diagonal(B[:, 0], axis1=1, axis2=2), (X.imag == 0).all(1)
        aZ, aX, rounding = np.abs(Z), np.abs(X), rounding_of(n)
        self.e0, self.e1 = aZ @ (error + rounding * np.abs(D[:, 0])) @ aX, aZ @ (drift + rounding * aD[:, 1:].sum(1)) @ aX
        self.e2, self.G = aZ @ panels.rest[at] @ aX, np.abs(Z @ X - np.eye(n)) + rounding * aZ @ aX
        K = _turning(B, w, wanted, block)
        B0, B1, B2, B3 = B.swapaxes(0, 1)
        KB0, K2 = K @ B0, K @ K
        C = np.stack([B0, B1 + B0 @ K - KB0, B2 + B1 @ K - K @ B1 - KB0 @ K])  # of the powers of h; what follows is bounded
        diagonal, d1, d2 = (np.diagonal(M, axis1=1, axis2=2) for M in (K2, *C[1:]))
        self.mu = w, d1, d2 + w * diagonal
        self.c0, self.k2 = np.abs(d2), np.abs(diagonal)
        self.K, self.K2, self.C, self.B1, self.B2, self.B3 = (np.abs(M) for M in (K, K2, C, B1, B2, B3))
        for entries in (self.K2, *self.C):
            entries[:, range(n), range(n)] *= block
        if block.any():
            self._join(block, B0)
        self.w, d1, c2 = self.mu
        w, z = self.w, 1 + self.w
        self.KBK, self.unsure = self.K @ self.B1 @ self.K, np.diagonal(self.e0, axis1=1, axis2=2)
        self.b, self.c = np.abs(d1), np.abs(c2)
        self.size, self.excess = np.abs(z), 2 * w.real + np.abs(w) ** 2
        self.slope, self.curve = 2 * (z.conj() * d1).real, 2 * (z.conj() * c2).real + np.abs(d1) ** 2

    def _join(self, block, B0):
        """Put norms in place of the entries in rows or columns of a block, whose own norm is that of the frame there.

        So it is one more eigenvalue 0 with something off the diagonal, as far as dominance goes; others of them fill tests up.
        """
        most = (~block).sum(1).max() + 1
        place = np.where(block, most - 1, np.cumsum(~block, 1) - 1)
        to = (place[:, None] == np.arange(most)[:, None]).astype(float)
        alone = to * ~block[:, None]
        for name in ("e0", "e1", "e2", "G", "K", "K2", "C", "B1", "B2", "B3"):
            setattr(self, name, np.sqrt(to @ getattr(self, name) ** 2 @ to.swapaxes(1, 2)) + TINY)
        for at in np.flatnonzero(block.any(1)):
            N = B0[at][np.ix_(block[at], block[at])] + np.eye(block[at].sum())
            self.C[0, at, -1, -1] = np.linalg.norm(np.nan_to_num(N), 2) * (1 + SURELY)
        facts = *self.mu, self.c0, self.k2, self.real
        w, *rest, self.c0, self.k2, real = ((alone @ fact[..., None])[..., 0] for fact in facts)
        self.mu, self.real = (w + (alone.any(2) - 1.0), *rest), real > 0

    def crossings(self):
        """The h next to 0 at which each eigenvalue seems to be on the unit circle, inf if none, `(tests, n)`."""
        with np.errstate(all="ignore"):
            root = np.sqrt(self.slope**2 - 4 * self.curve * self.excess)
            h = -2 * self.excess / (self.slope + np.copysign(root, self.slope))
        return np.where(np.isfinite(h) & (self.size > REAL), h, np.inf)

    def angle(self, index, h):
        """Return the angle of eigenvalue `index` of each test at h; exactly 0 or pi if it is real."""
        w, d1, c2 = (np.take_along_axis(term, index[:, None], 1)[:, 0] for term in self.mu)
        z, real = 1 + w + h * d1 + h**2 * c2, np.take_along_axis(self.real, index[:, None], 1)[:, 0]
        return np.abs(np.angle(np.where(real, z.real, z)))

    def radius(self):
        """Return 1, or a larger radius that all are farther from, if some are outside it: it is enough if these stay there."""
        size = np.sort(np.log(np.maximum(self.size, 1e-9)), 1)[:, ::-1]
        below = np.concatenate([size[:, 1:], np.full((len(size), 1), -20.0)], 1)
        gap = np.where(size > 0, size - np.maximum(below, 0), 0)
        most = np.argmax(gap, 1)[:, None]
        outer, gap = np.take_along_axis(size, most, 1)[:, 0], np.take_along_axis(gap, most, 1)[:, 0]
        return np.where(gap > np.maximum(3 * np.abs(size).min(1), OUTSIDE), np.exp(outer - gap / 2), 1.0)

    def prove(self, tests, start, stop, radius):
        """Return whether none is on the circle from h = start to stop of each of `tests`, and how many are outside then.

        start, stop: of one sign, or 0.

        Row i of T over `1 - h^2 k2`, k2 = |(K^2)_ii|, has the diagonal `z - 1 - mu` with `mu = w + b h + c h^2 + ...` and
        `|z - 1 - mu| >= ||1 + mu|^2 - r^2| / (|1 + mu| + r)`, r being the radius. Entries times z - 1 are at most `|mu| +
        |z - 1 - mu|` times as large, which matters most where |z - 1 - mu| is least.
        """
        most, n = np.maximum(np.abs(start), np.abs(stop))[:, None], self.w.shape[1]
        names = ("w", "excess", "slope", "curve", "size", "b", "c", "c0", "k2")
        w, excess, slope, curve, size, b, c, c0, k2 = (getattr(self, name)[tests] for name in names)
        names = ("e0", "e1", "e2", "K", "K2", "B2", "B3", "KBK", "G")
        e0, e1, e2, K, K2, B2, B3, KBK, G = (getattr(self, name)[tests] for name in names)
        C, w = self.C[:, tests], np.abs(w)
        excess = excess + (1 - radius[:, None] ** 2)
        side = np.where(excess + (start + stop)[:, None] / 2 * slope > 0, 1.0, -1.0)
        bends, cubic = np.maximum(0, -side * curve), 2 * b * c + most * c**2
        largest = size + most * b + most**2 * c + radius[:, None]
        reach = (w + most * b + most**2 * c + (np.abs(excess) + most * np.abs(slope)) / largest)[:, :, None]

        def ratios(h):
            """What is off the diagonal over what is left of it, at h; infinite if nothing is left."""
            a, left = np.abs(h)[:, None], 1 - k2 * np.abs(h)[:, None] ** 2
            A, safe = a[:, :, None], np.maximum(left, 0.1)
            if h.any():
                k, second = A * K, A**2 * B2
                N = e0 + A * (e1 + A * A * (B3 + A * e2)) + second
                N, g = N + k @ N, G + k @ G
                N = N + N @ k - second + C[0] + A * (C[1] + A * (C[2] + A * KBK)) + reach * (g + g @ k + A * A * K2)
            else:
                N = e0 + C[0] + reach * G
            N /= safe[:, :, None]
            d = (side * (excess + h[:, None] * slope) - a**2 * (bends + a * cubic)) / largest - np.diagonal(N, axis1=1, axis2=2)
            d -= a**3 * k2 * (b + a * c0) + a**4 * k2**2 * (w + a * b + a**2 * c0) / safe
            d = np.where(left > 0.1, d, -1.0)[:, :, None]
            N[:, range(n), range(n)] = 0
            with np.errstate(all="ignore"):
                return np.where(d > 0, N / d, np.inf)

        H = np.maximum(ratios(stop), ratios(start))
        proved = np.isfinite(H).all((1, 2))
        H = np.where(proved[:, None, None], H, 0)
        u = solve(np.eye(n) * (1 + SURELY) - H, np.ones((len(H), n, 1)))
        proved &= (u > 0).all((1, 2)) & (H @ u < u * (1 - SURELY / 2)).all((1, 2))
        return proved, (side > 0).sum(1)
