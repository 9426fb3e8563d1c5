"""No eigenvalue of a frame is on a circle for all values of a number in a range: by dominance of
the diagonal in eigenvectors.

docs/proof.md, "Dominance along any number", has the proof, with equations (1) to (4). About a place
p0 of a panel (see `entries`), with `p = p0 + half h`, the frame less identity is `E(h) = D0 + h D1
+ h^2 D2 + h^3 D3 + h^4 R`, each entry to a bound. X has the eigenvectors of D0, Z is nearly its
inverse, and K is what turns them with the number. So in

    T(z, h) = (1 - hK) Z (z - 1 - E(h)) X (1 + hK)                                                              (1)

nothing is left off the diagonal that is linear in h, but for rounding. If T is nonsingular, so is
`z - 1 - E(h)`.

T is nonsingular if a vector u > 0 exists with `|T_ii| u_i > sum_j |T_ij| u_j` for each row (4). It
is shown for all z of a circle and all h of a range on one side of 0: `|z - 1 - mu_i|` of a diagonal
entry mu_i is bounded from below by a concave function of |h| (3), all that is subtracted is bounded
from above by convex ones, so both ends of the range prove it all. Then as many eigenvalues are
outside the circle as entries mu_i: while the rest of T is taken away by and by, this stays so, and
none crosses.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from wavesweep.engine._monodromy.unit_circle import inverse, solve
from wavesweep.engine._stability.entries import DEGREES, TAYLOR_ORDER, Panels, taylor
from wavesweep.engine.doubles import EPS
from wavesweep.engine.rows import Rows, of_each

# of their distance from the circle: eigenvalues so near to each other are not told apart
CLUSTER = 0.5
# most of `h^2 |K_ij K_ji|` at half of the range that is wanted, beyond which two vectors are not
# turned
TURNED_COUPLING = 0.25
WANTED = 0.3  # the most of h that is wanted
ON_WAY_TO_CIRCLE = 0.3  # size of an eigenvalue that may be on its way to the circle
# of the logarithm of an eigenvalue, from which on it is outside and not on its way there
OUTSIDE_BY = 1e-6
DOMINANT_BY = 1e-9  # relative, by which dominance has to hold beyond the rounding of its own terms
# size of an entry, below which it is 0 for the choice of vectors: eigenvalues are computed in units
# in which rows and columns are alike, and those that it asks for leave no digits to the vectors
FLUSHED = 1e-150  # also added to norms, whose squares may underflow
DEPENDENT = 1e8  # condition of eigenvectors from which on those of a matrix next to it are taken
SMALLEST_EIGENVALUE = 0.2  # sizes of eigenvalues below it are alike for a block
LARGEST_OF_BLOCK = 0.98  # and those beyond it are in none
SLACK = 0.5  # share of what is left to 1 that a block leaves


class Eigenbasis(NamedTuple):
    """Vectors of matrices as columns, `(matrices, n, n)`, and what is nearly their inverse.

    block: which of them are together a basis of one subspace, `(matrices, n)`; all others are
    eigenvectors.
    """

    X: np.ndarray
    Z: np.ndarray
    block: np.ndarray


def eigenbasis(E: np.ndarray) -> Eigenbasis:
    """Return vectors of matrices less identity; the inverses are huge or NaN if there are too few.

    They are orthonormal within clusters of eigenvalues that are nearer to each other than to the
    circle, as nothing has to tell these apart. Where they are nearly dependent, those of small
    eigenvalues become a block, as for delay lines, which have one eigenvector each; where they
    still are, those of a matrix next to it are taken.
    """
    n = E.shape[-1]
    E = np.where(np.abs(E) < FLUSHED, 0.0, E)
    block = np.zeros(E.shape[:2], bool)
    if n <= 64:  # of more states a block makes tests shorter
        X, Z = _vectors(E)
    else:
        X, Z = np.full((2, *E.shape), np.inf, complex)
    for group in _dependent(X, Z):
        X[group], Z[group], block[group] = _with_block(E[group])
    for size in (1e-14, 1e-10):  # of the largest entry, how far the matrix next to it is from it
        dependent = _dependent(X, Z)
        if not dependent.size:
            break
        pattern = np.cos(np.arange(n * n) ** 2.0).reshape(n, n)
        change = pattern * np.abs(E[dependent]).max((1, 2), keepdims=True)
        X[dependent], Z[dependent] = _vectors(E[dependent] + size * change)
        block[dependent] = False
    return Eigenbasis(X, Z, block)


def _dependent(X: np.ndarray, Z: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        condition = (np.abs(Z) @ np.abs(X)).max((1, 2))
        return np.flatnonzero(~(condition < DEPENDENT))


def _with_block(E: np.ndarray) -> Eigenbasis:
    """Eigenvectors of the eigenvalues beyond the widest gap, and a basis of what the left ones do
    not see; gaps are ratios of what eigenvalues lose in a frame, the logarithms of their sizes.

    In that basis the block N shortens every vector: its unit is P with `P = 1 + N'PN/r^2`, r being
    between its spectral radius and 1.
    """
    n = len(E)
    w, X = np.linalg.eig(E)
    left_w, Y = np.linalg.eig(E.T)
    order = np.argsort(np.abs(1 + w))
    left_order = np.argsort(np.abs(1 + left_w))
    size = np.maximum(np.abs(1 + w[order]), SMALLEST_EIGENVALUE)
    decay = -np.log(np.minimum(size, LARGEST_OF_BLOCK))
    gaps = np.where(size[:-1] < LARGEST_OF_BLOCK, decay[:-1] / decay[1:], 0)
    k = 1 + int(np.argmax(gaps)) if gaps.any() else 0  # states of the block
    seen = Y[:, left_order[k:]].conj()
    basis = np.linalg.qr(seen, mode="complete")[0][:, n - k :]
    N = basis.conj().T @ (basis + E @ basis)
    # The series P = sum over i of (N'/r)^i (N/r)^i, a power of two of its terms.
    power = N / (1 - (1 - size[k - 1]) * SLACK)
    P = np.eye(k, dtype=complex)
    for _ in range(12):  # doublings of the terms of the series of its unit, 2^12 of them
        P = P + power.conj().T @ P @ power
        power = power @ power
    (alone,) = _orthonormal(w[None, order[k:]], X[None, :, order[k:]])
    X = np.concatenate([basis @ inverse(_cholesky(P)).conj().T, alone], 1)
    return Eigenbasis(X, inverse(X), np.arange(n) < k)


def _vectors(E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    X = _orthonormal(*np.linalg.eig(E))
    return X, inverse(X)


def _orthonormal(w: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Eigenvectors that are orthonormal within clusters."""
    w = w.astype(complex)
    X = X.astype(complex)
    n = w.shape[1]
    alike = _alike(w)
    clustered = np.flatnonzero(alike.sum((1, 2)) > n)
    if clustered.size:
        link = alike[clustered].astype(float)
        for _ in range(3):  # what is alike by way of others is of one cluster
            link = np.minimum(link @ link, 1)
        vectors = X[clustered]
        gram = link * (vectors.conj().swapaxes(1, 2) @ vectors) + EPS * np.eye(n)
        X[clustered] = vectors @ inverse(_cholesky(gram)).conj().swapaxes(1, 2)
    return X


def _cholesky(gram: np.ndarray) -> np.ndarray:
    try:
        return np.linalg.cholesky(gram)
    except np.linalg.LinAlgError:
        return np.broadcast_to(np.eye(gram.shape[-1]), gram.shape)


def _alike(w: np.ndarray) -> np.ndarray:
    """Which eigenvalues less 1 are so near to each other."""
    far = np.abs(np.abs(1 + w) - 1)
    apart = np.abs(w[:, None] - w[:, :, None])
    return apart < CLUSTER * np.minimum(far[:, :, None], far[:, None, :])


def _turning(B1: np.ndarray, w: np.ndarray, wanted: np.ndarray, block: np.ndarray) -> np.ndarray:
    """K; 0 for two vectors that turn too fast, or need not be told apart, and for a block."""
    with np.errstate(all="ignore"):
        K = B1 / (w[:, None, :] - w[:, :, None])
        steep = np.abs(K * K.swapaxes(1, 2)) * np.minimum(wanted, WANTED)[:, None, None] ** 2
        alike = _alike(w) | block[:, None] | block[:, :, None]
        K = np.where((steep < TURNED_COUPLING) & ~alike & np.isfinite(K), K, 0)
    K[:, range(w.shape[1]), range(w.shape[1])] = 0
    return K


@dataclass(frozen=True, slots=True)
class ExactFrames:
    """Frames less identity at the places of some tests themselves, and bounds on their errors."""

    tests: np.ndarray
    E: np.ndarray
    off: np.ndarray


def rounding_of(n: int) -> float:
    """Return the relative rounding of products of up to five matrices of n states."""
    return 16 * (n + 4) * EPS / 2


class Expansions(NamedTuple):
    """Frames less identity about places, `E(h) = D0 + h D1 + h^2 D2 + h^3 D3` and a rest, of tests.

    D: the terms, `(tests, ORDER, n, n)`. sizes: those of what each term is a sum of. error: bounds
    on the errors of the entries at the places, `(tests, n, n)`; drift: by how much more they are
    off for each h from there.
    """

    D: np.ndarray
    sizes: np.ndarray
    error: np.ndarray
    drift: np.ndarray


def expansions(
    panels: Panels, panel: np.ndarray, x: np.ndarray, pad: np.ndarray, exact: ExactFrames
) -> Expansions:
    """Return the frames about places of panels; the arguments are those of `DominanceTests.of`."""
    n = panels.error.shape[-1]
    m = panel.size
    bent = panels.coefficients[panel, DEGREES[0] + 1 :].any()
    degree = DEGREES[1] if bent else DEGREES[0]
    T = taylor(x, degree)
    c = panels.coefficients[panel, : degree + 1].reshape(m, degree + 1, n * n)
    D = (T @ c).reshape(m, TAYLOR_ORDER, n, n)
    sizes = (np.abs(T) @ np.abs(c)).reshape(m, TAYLOR_ORDER, n, n)
    error = panels.error[panel].copy()
    drift = np.zeros((m, n, n))
    if exact.tests.size:
        # The model's error e, which is known at the place itself, changes by |e'| <= 4 degree max
        # |e| times h at most: e is a polynomial of that degree, of rounding, and q g as in
        # `panels_of`, where |q'| < degree + 3 within the panel, and |g'| < 2.2 max |g|, as the rim
        # is 0.45 away (Cauchy).
        of_panel = error[exact.tests]
        agrees = np.abs(exact.E - D[exact.tests, 0]) <= 2 * (of_panel + exact.off)
        drift[exact.tests] = 4 * degree * of_panel
        D[exact.tests, 0] = exact.E
        error[exact.tests] = np.where(agrees.all((1, 2), keepdims=True), exact.off, np.inf)
    error += pad[:, None, None] * np.abs(D[:, 1])
    lost = ~np.isfinite(D[:, 0]).all((1, 2))
    D[lost] = 0.0
    error[lost] = np.inf
    return Expansions(D, sizes, error, drift)


@dataclass(frozen=True, slots=True)
class _Diagonals(Rows):
    """The diagonal of `(1 - hK) Z E(h) X (1 + hK)` over `1 - h^2 k2`, `mu = w + b h + c h^2 + ...`,
    `(tests, n)`.

    d2: size of what h^2 comes with in it; k2: size of the diagonal of K^2. real: whether an
    eigenvalue is.
    """

    w: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d2: np.ndarray
    k2: np.ndarray
    real: np.ndarray

    def joined(self, alone: np.ndarray) -> _Diagonals:
        """Those that stand alone at their new places, and the eigenvalue 0 of the frame at all
        others."""

        def moved(facts: np.ndarray) -> np.ndarray:
            return (alone @ facts[..., None])[..., 0]

        w = moved(self.w) + (alone.any(2) - 1.0)
        real = moved(self.real) > 0
        return _Diagonals(w, moved(self.b), moved(self.c), moved(self.d2), moved(self.k2), real)


@dataclass(frozen=True, slots=True)
class _Sizes(Rows):
    """Sizes of the entries of what T consists of, `(tests, n, n)`.

    C0, C1, C2: of the powers of h in `(1 - hK) Z E(h) X (1 + hK)`, and K2 of K^2, without their
    diagonals. B1, B2, B3: of `Z D1 X` and so on. G: of `ZX - 1`. e0, e1, e2: bounds on what the
    errors of E add, at the place, for each h, and for h^4.
    """

    C0: np.ndarray
    C1: np.ndarray
    C2: np.ndarray
    K: np.ndarray
    K2: np.ndarray
    B1: np.ndarray
    B2: np.ndarray
    B3: np.ndarray
    G: np.ndarray
    e0: np.ndarray
    e1: np.ndarray
    e2: np.ndarray

    def joined(self, to: np.ndarray) -> _Sizes:
        """Norms of the rows and columns that `to` puts together, `(tests, fewer, n)`."""
        back = to.swapaxes(1, 2)
        norms = {}
        for part in fields(self):
            norms[part.name] = np.sqrt(to @ getattr(self, part.name) ** 2 @ back) + FLUSHED
        return _Sizes(**norms)


def _joined(
    mu: _Diagonals, parts: _Sizes, block: np.ndarray, B0: np.ndarray
) -> tuple[_Diagonals, _Sizes]:
    """Put norms in place of the entries in rows or columns of a block, whose own norm is that of
    the frame there.

    So it is one more eigenvalue 0 with something off the diagonal, as far as dominance goes; others
    of them fill tests up.
    """
    size = (~block).sum(1).max() + 1
    place = np.where(block, size - 1, np.cumsum(~block, 1) - 1)
    to = (place[:, None] == np.arange(size)[:, None]).astype(float)
    parts = parts.joined(to)
    for index in np.flatnonzero(block.any(1)):
        N = B0[index][np.ix_(block[index], block[index])] + np.eye(block[index].sum())
        parts.C0[index, -1, -1] = np.linalg.norm(np.nan_to_num(N), 2) * (1 + DOMINANT_BY)
    return mu.joined(to * ~block[:, None]), parts


def _diagonal(matrices: np.ndarray) -> np.ndarray:
    return np.diagonal(matrices, axis1=1, axis2=2)


def _off_diagonal(matrices: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Sizes of the entries off the diagonal, and on it those of a block."""
    n = matrices.shape[-1]
    size = np.abs(matrices)
    size[:, range(n), range(n)] *= block
    return size


@dataclass(frozen=True, slots=True)
class DominanceTests:
    """Tests about places of panels, one element each; see this file's head.

    mu: the diagonal, parts: sizes of what T consists of, KBK: of `K B1 K`. size: of the eigenvalues
    1 + w; unsure: bounds on their errors. excess, slope, curve: what `|1 + mu|^2 - 1` is at h = 0,
    and what h and h^2 come with in it, `(tests, n)`.
    """

    mu: _Diagonals
    parts: _Sizes
    KBK: np.ndarray
    size: np.ndarray
    unsure: np.ndarray
    excess: np.ndarray
    slope: np.ndarray
    curve: np.ndarray

    @classmethod
    def of(
        cls,
        panels: Panels,
        panel: np.ndarray,
        x: np.ndarray,
        pad: np.ndarray,
        wanted: np.ndarray,
        exact: ExactFrames,
    ) -> DominanceTests:
        """panel: panels of the tests; x: places on them, from -1 to 1, known to `pad`; wanted: half
        of what is to be proved."""
        D, sizes, error, drift = expansions(panels, panel, x, pad, exact)
        n = panels.error.shape[-1]
        X, Z, block = eigenbasis(D[:, 0])
        B = Z[:, None] @ D @ X[:, None]
        B0, B1, B2, B3 = B.swapaxes(0, 1)
        w = _diagonal(B0)
        K = _turning(B1, w, wanted, block)
        # (1 - hK) (B0 + h B1 + h^2 B2) (1 + hK) by powers of h (2); of what follows there are
        # bounds.
        KB0 = K @ B0
        C1 = B1 + B0 @ K - KB0
        C2 = B2 + B1 @ K - K @ B1 - KB0 @ K
        KK = K @ K
        b = _diagonal(C1)
        d2 = _diagonal(C2)
        k2 = _diagonal(KK)
        mu = _Diagonals(w, b, d2 + w * k2, np.abs(d2), np.abs(k2), (X.imag == 0).all(1))
        size_X = np.abs(X)
        size_Z = np.abs(Z)
        rounding = rounding_of(n)
        parts = _Sizes(
            C0=_off_diagonal(B0, block),
            C1=_off_diagonal(C1, block),
            C2=_off_diagonal(C2, block),
            K=np.abs(K),
            K2=_off_diagonal(KK, block),
            B1=np.abs(B1),
            B2=np.abs(B2),
            B3=np.abs(B3),
            G=np.abs(Z @ X - np.eye(n)) + rounding * size_Z @ size_X,
            e0=size_Z @ (error + rounding * np.abs(D[:, 0])) @ size_X,
            e1=size_Z @ (drift + rounding * sizes[:, 1:].sum(1)) @ size_X,
            e2=size_Z @ panels.rest[panel] @ size_X,
        )
        if block.any():
            mu, parts = _joined(mu, parts, block, B0)
        z = 1 + mu.w
        return cls(
            mu,
            parts,
            KBK=parts.K @ parts.B1 @ parts.K,
            size=np.abs(z),
            unsure=_diagonal(parts.e0),
            excess=2 * mu.w.real + np.abs(mu.w) ** 2,
            slope=2 * (z.conj() * mu.b).real,
            curve=2 * (z.conj() * mu.c).real + np.abs(mu.b) ** 2,
        )

    def crossings(self) -> np.ndarray:
        """The h next to 0 at which each eigenvalue seems to be on the unit circle, inf if none,
        `(tests, n)`."""
        with np.errstate(all="ignore"):
            root = np.sqrt(self.slope**2 - 4 * self.curve * self.excess)
            h = -2 * self.excess / (self.slope + np.copysign(root, self.slope))
        return np.where(np.isfinite(h) & (self.size > ON_WAY_TO_CIRCLE), h, np.inf)

    def angle(self, index: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Return the angle of eigenvalue `index` of each test at h; exactly 0 or pi if it is
        real."""

        mu = self.mu
        w, b, c = (of_each(facts, index) for facts in (mu.w, mu.b, mu.c))
        z = 1 + w + h * b + h**2 * c
        return np.abs(np.angle(np.where(of_each(mu.real, index), z.real, z)))

    def radius(self) -> np.ndarray:
        """Return the radius of the circle that a test is about: 1, or a larger one, r, in a wide
        gap between eigenvalues.

        If no eigenvalue is on the larger circle, as many as are outside of it stay there, so the
        loop is unstable, whatever the others do; these may cross the unit circle meanwhile. The
        numbers here only choose r.
        """
        sizes = np.log(np.maximum(self.size, 1e-9))
        size = np.sort(sizes, 1)[:, ::-1]
        below = np.concatenate([size[:, 1:], np.full((len(size), 1), -20.0)], 1)
        gaps = np.where(size > 0, size - np.maximum(below, 0), 0)
        widest = np.argmax(gaps, 1)
        outer = of_each(size, widest)
        gap = of_each(gaps, widest)
        wide = gap > np.maximum(3 * np.abs(size).min(1), OUTSIDE_BY)
        return np.where(wide, np.exp(outer - gap / 2), 1.0)

    def prove(
        self, tests: np.ndarray, start: np.ndarray, stop: np.ndarray, radius: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return whether none is on the circle from h = start to stop of each of `tests`, and how
        many are outside then.

        start, stop: of one sign, or 0. radius: of the circle, which may be larger than 1. What is
        concave and convex in h is so for one u. So the same u has to serve both ends of the range,
        and it is found for the larger of their two ratios, entry by entry.
        """
        rows = _Rows.of(self, tests, start, stop, radius)
        H = np.maximum(rows.ratios(stop), rows.ratios(start))
        proved = np.isfinite(H).all((1, 2))
        H = np.where(proved[:, None, None], H, 0)
        # (4): if u > 0 and H u < u, the diagonal dominates.
        n = H.shape[1]
        u = solve(np.eye(n) * (1 + DOMINANT_BY) - H, np.ones((len(H), n, 1)))
        proved &= (u > 0).all((1, 2)) & (H @ u < u * (1 - DOMINANT_BY / 2)).all((1, 2))
        return proved, (rows.side > 0).sum(1)


class _Rows(NamedTuple):
    """The rows of T of tests, over a range of h on one side of 0 and on the circle |z| = r.

    Row i of T over `1 - h^2 k2`, k2 = |(K^2)_ii|, has the diagonal `z - 1 - mu` with `mu = w + b h
    + c h^2 + ...` and `|z - 1 - mu| >= ||1 + mu|^2 - r^2| / (|1 + mu| + r)` for all |z| = r. What is
    off the diagonal, over the same, is at most `F + |z - 1| G`. With `d = |z - 1 - mu_i|` it is `|z
    - 1| <= |mu_i| + d`, so a row holds if `d u_i > (F u)_i + (|mu_i| + d) (G u)_i`. It is enough to
    show this for the least d. As F and G are not negative, `(G u)_i < u_i` follows, so for every
    larger d the left side has grown by more than the right one.

    excess, slope: `|1 + mu|^2 - r^2` at h = 0 and its slope; side: 1 where it is positive, else -1.
    By (3) `side (|1 + mu|^2 - r^2)` is at least `side (excess + h slope) - h^2 (bends + |h| cubic)`.
    largest: of |1 + mu| + r. reach: |z - 1| is at most this where |z - 1 - mu| is least.
    """

    mu: _Diagonals
    parts: _Sizes
    KBK: np.ndarray
    excess: np.ndarray
    slope: np.ndarray
    side: np.ndarray
    bends: np.ndarray
    cubic: np.ndarray
    largest: np.ndarray
    reach: np.ndarray

    @staticmethod
    def of(
        tests: DominanceTests,
        chosen: np.ndarray,
        start: np.ndarray,
        stop: np.ndarray,
        radius: np.ndarray,
    ) -> _Rows:
        """Those of the tests `chosen` from h = start to stop, on the circle of the radius, `(tests,)`
        each. With mu = w + b h + c h^2, all terms of its powers are bounded at the h farthest from 0."""
        mu = tests.mu.take(chosen)
        slope = tests.slope[chosen]
        b = np.abs(mu.b)
        c = np.abs(mu.c)
        farthest = np.maximum(np.abs(start), np.abs(stop))[:, None]
        r = radius[:, None]
        excess = tests.excess[chosen] + (1 - r**2)
        side = np.where(excess + (start + stop)[:, None] / 2 * slope > 0, 1.0, -1.0)
        bends = np.maximum(0, -side * tests.curve[chosen])
        cubic = 2 * b * c + farthest * c**2
        largest = tests.size[chosen] + farthest * b + farthest**2 * c + r
        size_of_mu = np.abs(mu.w) + farthest * b + farthest**2 * c
        reach = size_of_mu + (np.abs(excess) + farthest * np.abs(slope)) / largest
        return _Rows(
            mu,
            tests.parts.take(chosen),
            tests.KBK[chosen],
            *(excess, slope, side, bends, cubic, largest),
            reach[:, :, None],
        )

    def ratios(self, h: np.ndarray) -> np.ndarray:
        """What is off the diagonal over what is left of it, at h; infinite if nothing is left."""
        mu = self.mu
        parts = self.parts
        a = np.abs(h)[:, None]
        slack = 1 - mu.k2 * a**2
        safe = np.maximum(slack, 0.1)
        if h.any():
            off = _entries_at(a[:, :, None], parts, self.KBK, self.reach)
        else:
            off = parts.e0 + parts.C0 + self.reach * parts.G
        off /= safe[:, :, None]
        above = self.side * (self.excess + h[:, None] * self.slope)
        distance = (above - a**2 * (self.bends + a * self.cubic)) / self.largest
        d = distance - _diagonal(off)
        # What dividing by 1 - h^2 k2 leaves of the powers of h beyond the second.
        b = np.abs(mu.b)
        last = np.abs(mu.w) + a * b + a**2 * mu.d2
        d -= a**3 * mu.k2 * (b + a * mu.d2) + a**4 * mu.k2**2 * last / safe
        d = np.where(slack > 0.1, d, -1.0)[:, :, None]
        n = off.shape[1]
        off[:, range(n), range(n)] = 0
        with np.errstate(all="ignore"):
            return np.where(d > 0, off / d, np.inf)


def _entries_at(a: np.ndarray, parts: _Sizes, KBK: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Bounds on what T has beside its diagonals at |h| = a, which is not 0."""
    aK = a * parts.K
    second = a**2 * parts.B2
    errors = parts.e0 + a * (parts.e1 + a * a * (parts.B3 + a * parts.e2)) + second
    errors = errors + aK @ errors
    errors = errors + errors @ aK - second  # h^2 D2 itself is in C2
    terms = parts.C1 + a * (parts.C2 + a * KBK)
    G = parts.G + aK @ parts.G
    return errors + parts.C0 + a * terms + reach * (G + G @ aK + a * a * parts.K2)
