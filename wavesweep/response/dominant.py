"""The largest singular value of the lifted response: through modes, in a few steps, proved from the trace."""

from dataclasses import dataclass, fields

import numpy as np

from wavesweep.monodromy.circle import solve
from wavesweep.monodromy.rounding import ROUNDING
from wavesweep.response.lifted import LEAF, Stretch
from wavesweep.response.ticks import long_sum

STEPS = 9  # of the bidiagonalisation; beyond, singular values of the whole matrix are the quicker way
SETTLED = 1e-13  # relative width of the bounds on a singular value, at which it ends
TILE = 16  # points of one product of matrices
FLOOR = 1e-3  # of what modes take from the forces, where one takes nothing
LOOKED = 3, 5, 7, STEPS  # steps after which values are checked; few are settled earlier, and a check costs as much as a step
NEWTON = 20  # steps of Newton's method; some 6 are enough
NEARLY = 1e-9  # relative size of such a step, after which x is right to rounding
NEAR = 0.1  # by how much the modes' inverse may be off for its error to be bounded with it


class Dominant:
    """The lifted map as `T + sum_i p_i q_i/(w - z_i)` over the modes of E, with bounds on its errors.

    p_i are the positions of a frame for a unit of a mode, q_i the parts of that mode that the frame's forces leave.
    """

    def __init__(self, frame: Stretch):
        (E, dE), (G, dG), (O, dO) = frame.E, frame.left, (part[..., -1, :, :] for part in frame.seen)
        self.poles, V = np.linalg.eig(E)
        V, eye = V.astype(complex), np.broadcast_to(np.eye(V.shape[-1]), V.shape)
        into = solve(V, eye)
        wide, back, rough = np.abs(V), np.abs(into), long_sum(V.shape[-1])
        defect = E @ V - V * self.poles[..., None, :]
        of_defect = dE @ wide + rough * (np.abs(E) @ wide + wide * np.abs(self.poles[..., None, :]))
        self.slope = np.abs(into @ defect) + back @ of_defect
        self.offset = np.abs(into @ V - eye) + rough * (back @ wide)
        shows, takes = _norms(np.abs(O) @ wide, -2), _norms(back @ np.abs(G), -1)
        vague = _norms(dO @ wide, -2) * takes + shows * _norms(back @ dG, -1)
        self.shows, self.takes, self.vague = (part[..., None] for part in (shows, takes, vague))
        self.frame, self.P, self.Q = frame, O @ V, into @ G
        self.size, self.unsure = (part[..., None] for part in norms_of(frame))
        self.square = self.size**2
        flat = self.P.reshape(-1, *self.P.shape[-2:])
        shown = applied(frame, flat.view(float), np.arange(len(flat)), adjoint=True).view(complex).reshape(self.P.shape)
        self.mixed = (shown * np.swapaxes(self.Q, -1, -2)).sum(-2)[..., None]
        self.pairs = (np.swapaxes(self.P.conj(), -1, -2) @ self.P) * (self.Q.conj() @ np.swapaxes(self.Q, -1, -2))

    def gain(self, points):
        """Return the largest singular value at each point, `(..., points)`, and a bound on its error (m/N).

        The bound is not a finite number if the value is not proved.

        Golub and Kahan's bidiagonalisation (SIAM J. Numer. Anal. 2, 1965) gives an approximate square s of the largest singular
        value and the residual r of its eigenvector of A'A. The trace of A'A leaves at most `trace - s` for the other squares;
        if that is less than s, the largest is between s and `s + r^2/(2 s - trace)` (T. Kato, J. Phys. Soc. Japan 4, 1949).
        """
        factor = 1 / (points.frame - self.poles[..., None])
        size, error = self._errors(points.frame, np.abs(factor))
        rough = long_sum(sum(self.P.shape[-2:]))
        trace = (factor.conj() * (self.pairs @ factor)).sum(-2).real + 2 * (self.mixed * factor).sum(-2).real
        trace = trace + self.square + rough * (size + self.size) ** 2
        value, width = self._settled(points.ladder(self.frame.ticks), factor, trace)
        return value, width + error + rough * (size + self.size)

    def _settled(self, start, factor, trace):
        """Return the largest singular value, and a bound on the error of the iteration; start: vectors `(ticks, points)`.

        Points are taken in tiles, which are left when they are settled. A product of matrices is of one tile, so that its bits
        do not depend on the others.
        """
        shape, (factor, trace) = trace.shape, (_tiles(factor), _tiles(trace[..., None, :])[:, 0])
        v = _tiles(start).view(float)
        v *= len(start) ** -0.5
        v = v if len(v) == len(trace) else np.tile(v, (len(trace) // len(v), 1, 1))
        best, width, above = np.full((3, *trace.shape), np.nan)
        maps, at, ticks = self._maps(factor), np.arange(len(trace)), v.shape[1]
        u, across, diagonal, beside = np.zeros(v.shape), np.zeros((len(trace), TILE)), [], []
        scratch = np.empty(v.shape), np.empty(factor.shape, complex)  # fresh memory costs as much as a product
        for step in range(1, STEPS + 1):
            along = maps.next(v, u, across, False, scratch)
            across = maps.next(u, v, along, True, scratch)
            diagonal, beside = [*diagonal, along], [*beside, across]
            if step not in LOOKED and step < ticks:
                continue
            open_ = np.nonzero(~(width[at] <= SETTLED * best[at]))  # one that is settled keeps its value
            place = at[open_[0]], open_[1]
            square, missed = _largest(*([part[open_] for part in parts] for parts in (diagonal, beside)), above[place])
            gap, value = 2 * square - trace[place], np.sqrt(square)
            beyond = np.where(gap > 0, missed / gap, np.inf)
            best[place], width[place], above[place] = value, beyond / (2 * value), square + beyond
            left = np.flatnonzero((~(width[at] <= SETTLED * best[at])).any(-1))
            if not left.size:
                break
            if left.size < at.size:
                maps, at, u, v, across = maps.take(left), at[left], u[left], v[left], across[left]
                scratch = tuple(part[: left.size] for part in scratch)
                diagonal, beside = [part[left] for part in diagonal], [part[left] for part in beside]
        width = np.where(width <= SETTLED * best, width, np.inf)
        return tuple(part.reshape(*shape[:-1], -1)[..., : shape[-1]] for part in (best, width))

    def _maps(self, factor):
        """Return the map of each tile; factor: `(tiles, modes, TILE)`."""
        parts = [part.reshape(-1, *part.shape[-2:]) for part in (self.P, self.Q)]
        which = np.repeat(np.arange(len(parts[0])), len(factor) // len(parts[0]))
        parts = [part[which] if len(part) > 1 else part for part in parts]
        own = self.frame.whole() if self.frame.ticks <= LEAF else None
        if own is not None:
            own = own.reshape(-1, *own.shape[-2:])
            own = own[which] if len(own) > 1 else own
        return _Maps(self.frame, own, which, *parts, *(np.swapaxes(part.conj(), -1, -2) for part in parts), factor)

    def _errors(self, w, size):
        """Return the sum of the sizes of the modes' parts, and a bound on the error of the map, as Frobenius norms.

        The inverse through modes is `V f V^-1`, f the factors; with S = offset + slope |f| from the defects of the modes and
        the errors of E, the true one is at most `V f (1 + S + S^2 + ...) V^-1`. If `S t <= near t` for some t that is at least
        `takes`, this series can be summed. The bound is infinite if `near` is too large for that.
        """
        shown, most = size * self.shows, self.takes + FLOOR * self.takes.max(-2, keepdims=True, initial=0)
        changed = self.offset @ most + self.slope @ (size * most) + ROUNDING * np.abs(w) * size * most
        near = (changed / most).max(-2, initial=0)
        error = (shown * changed).sum(-2) / (1 - near) + (size * self.vague).sum(-2) + self.unsure
        return (shown * self.takes).sum(-2), np.where(near <= NEAR, error, np.inf)


@dataclass(frozen=True, slots=True)
class _Maps:
    """The maps of tiles of points: `own + P diag(factor) Q`.

    own: None for long frames, which are applied part by part. which: the loop of each tile. Pt, Qt: adjoints. own, P, Q and
    these have one entry for all tiles, or one each.
    """

    frame: Stretch
    own: np.ndarray | None
    which: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    Pt: np.ndarray
    Qt: np.ndarray
    factor: np.ndarray

    def take(self, index):
        """Return the maps of some tiles."""
        parts = (getattr(self, field.name) for field in fields(self))
        several = len(self.factor)
        return _Maps(*(part[index] if isinstance(part, np.ndarray) and len(part) == several else part for part in parts))

    def next(self, v, u, weight, adjoint, scratch):
        """Put each map times its vectors v, less `weight u`, in place of u, at length 1, and return the lengths.

        v, u: `(tiles, ticks, 2 TILE)`, real and imaginary parts in turn. weight: `(tiles, TILE)`. adjoint: whether the adjoint
        of the map is applied. scratch: arrays as large as u and factor.
        """
        more, inner = scratch
        np.matmul(self.Pt if adjoint else self.Q, v.view(complex), out=inner)
        inner *= self.factor.conj() if adjoint else self.factor
        np.matmul(self.Qt if adjoint else self.P, inner, out=more.view(complex))
        u *= _both_parts(-weight)
        u += more
        u += self._own_times(v, adjoint, more)
        square = np.einsum("tij,tij->tj", u, u)
        length = np.sqrt(square[:, ::2] + square[:, 1::2])
        u *= _both_parts(1 / length)
        return length

    def _own_times(self, v, adjoint, out):
        if self.own is None:
            return applied(self.frame, v, self.which, adjoint=adjoint)
        return np.matmul(np.swapaxes(self.own, -1, -2) if adjoint else self.own, v, out=out)


def applied(frame: Stretch, v, which, *, adjoint: bool):
    """Return the positions of a frame for its forces v, `(vectors, ticks, columns)`, real; adjoint: the transposed map.

    which: the loop of each vector. What the forces of one part of a long frame do in the other goes through the state.
    """
    if frame.inner:
        own = _of_loops(frame.inner[0], which)
        return (np.swapaxes(own, -1, -2) if adjoint else own) @ v
    first, second, ticks = frame.first, frame.second, frame.first.ticks
    parts = v[:, :ticks], v[:, ticks:]
    found = [applied(part, some, which, adjoint=adjoint) for part, some in zip((first, second), parts, strict=True)]
    seen, left = _of_loops(second.seen[0][..., -1, :, :], which), _of_loops(first.left[0], which)
    if adjoint:
        found[0] += np.swapaxes(left, -1, -2) @ (np.swapaxes(seen, -1, -2) @ parts[1])
    else:
        found[1] += seen @ (left @ parts[0])
    return np.concatenate(found, axis=-2)


def _of_loops(part, which):
    part = part.reshape(-1, *part.shape[-2:])
    return part[which] if len(part) > 1 else part


def norms_of(frame: Stretch) -> tuple[np.ndarray, np.ndarray]:
    """Return Frobenius norms of the map from a frame's forces to its positions, and of its errors, `(...)` each."""
    if frame.inner:
        return tuple(_norms(part, (-2, -1)) for part in frame.inner)
    seen, dseen = (part[..., -1, :, :] for part in frame.second.seen)
    left, dleft = frame.first.left
    size = np.abs(left)
    across = norm_of_product(seen, left), norm_of_product(dseen, size) + norm_of_product(np.abs(seen), dleft + ROUNDING * size)
    return tuple(
        np.sqrt(sum(part**2 for part in parts))
        for parts in zip(*map(norms_of, (frame.first, frame.second)), across, strict=True)
    )


def norm_of_product(A, B):
    """Return the Frobenius norm of `A B` without forming it."""
    return np.sqrt(np.maximum(((np.swapaxes(A, -1, -2) @ A) * (B @ np.swapaxes(B, -1, -2))).sum((-1, -2)), 0))


def _tiles(part):
    """Return `(..., n, points)` as `(tiles, n, TILE)`; the last point is repeated if it does not fill its tile."""
    *batch, n, points = part.shape
    whole, left = divmod(points, TILE)
    tiles = np.empty((*batch, whole + (left > 0), n, TILE), part.dtype)
    tiles[..., :whole, :, :] = np.moveaxis(part[..., : whole * TILE].reshape(*batch, n, whole, TILE), -2, -3)
    if left:
        tiles[..., whole, :, :left], tiles[..., whole, :, left:] = part[..., whole * TILE :], part[..., -1:]
    return tiles.reshape(-1, n, TILE)


def _both_parts(numbers):
    """Repeat a number per vector, `(tiles, TILE)`, for real and imaginary parts of the vectors' entries."""
    return np.repeat(numbers, 2, axis=-1)[:, None, :]


def _norms(A, axis):
    return np.sqrt((np.abs(A) ** 2).sum(axis))


def _largest(diagonal, beside, above):
    """Return a Rayleigh quotient of `B'B` next to its largest eigenvalue, and the square of its vector's residual.

    B is bidiagonal with these entries, a list of arrays each. Newton's method for the characteristic polynomial falls from the
    Frobenius norm, or from `above`, towards the eigenvalue. The vector has the entries `prod_(i < j) d_i/b_i`, with the pivots
    d of `x - B'B` and its entries b beside the diagonal, up to some j. In `x - B'B` times it only `d_j` and `-b_j` times its
    last entry are left, so that quotient and residual are known wherever x stands. Of all j the best is taken; the last b is
    of the next step of the bidiagonalisation.
    Accuracy: rounding adds up to 1e-15 of the square of the value to that of the residual.
    """
    on = [diagonal[0] ** 2, *(a * a + b * b for a, b in zip(diagonal[1:], beside, strict=False))]
    off = [(a * b) ** 2 for a, b in zip(diagonal, beside, strict=True)]
    x = np.fmin(np.sqrt(sum(part * part for part in on) + 2 * sum(off[:-1])), above)
    for _ in range(NEWTON):
        fall = sum(square / d for d, square in _pivots(x, on, off))
        step = np.where(fall > 0, 1 / fall, 0)
        x = x - step
        if not (step > NEARLY * x).any():
            break
    value, least = x, np.inf
    for (d, square), b in zip(_pivots(x, on, off), off, strict=True):
        left = (d * d + b) / square
        better = left < least
        value, least = np.where(better, x - d / square, value), np.where(better, left, least)
    return value, least


def _pivots(x, on, off):
    """Yield the pivots of `x` less a tridiagonal matrix, each with its derivative, the vector's square over its last entry's.

    on: its diagonal. off: the squares of its entries beside it.
    """
    d, square = x - on[0], 1.0
    yield d, square
    for a, b in zip(on[1:], off, strict=False):
        part = b / d
        d, square = x - a - part, 1 + part / d * square
        yield d, square
