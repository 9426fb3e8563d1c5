"""The largest singular value of the lifted response: through modes, in a few steps, proved from the trace."""

from dataclasses import dataclass, fields

import numpy as np

from wavesweep.analysis.response.frame import Loop
from wavesweep.analysis.response.ticks import long_sum, taken
from wavesweep.lifted.circle import solve
from wavesweep.lifted.rounding import ROUNDING

STEPS = 9  # of the bidiagonalisation; beyond, singular values of the whole matrix are the quicker way
SETTLED = 1e-13  # relative width of the bounds on a singular value, at which it ends
TILE = 16  # points of one product of matrices
FLOOR = 1e-3  # of what modes take from the forces, where one takes nothing
LONG = 64  # ticks from which on what a force does in its own frame is quicker through its Fourier transform
LOOKED = 3, 5, 7, STEPS  # steps after which values are checked; few are settled earlier, and a check costs as much as a step
NEAR = 0.1  # by how much the modes' inverse may be off for its error to be bounded with it


@dataclass(frozen=True, slots=True, eq=False)
class Lifted:
    """The map `T + O (w - E)^-1 G` from the forces of a frame to its positions; pairs with bounds on the errors of the entries.

    E `(..., n, n)`; O `(..., ticks, n)`: the positions for each state at the frame's start; G `(..., n, ticks)`: the state that
    the forces leave after the frame. T: the positions for the forces of the same frame, `(..., ticks, ticks)`, or
    `(..., ticks)`, the first column of a Toeplitz matrix. law, still: of a combination of states that the loop conserves, which
    is a mode at z = 1 (see `Shown` and `Loop`).
    """

    E: tuple
    O: tuple
    G: tuple
    T: tuple
    law: tuple | None = None
    still: np.ndarray | None = None

    @staticmethod
    def of(loop: Loop) -> "Lifted":
        """Return the map of a loop whose first output is the position."""
        seen, impulse = (
            taken(part, (..., 0, *[slice(None)] * axes)) for part, axes in ((loop.shown.seen, 2), (loop.shown.impulse, 1))
        )
        return Lifted((loop.E, loop.dE), seen, loop.shown.left, impulse, loop.shown.law, loop.still)


class Dominant:
    """The lifted map as `T + sum_i p_i q_i/(w - z_i)` over the modes of E, with bounds on its errors.

    p_i are the positions of a frame for a unit of a mode, q_i the parts of that mode that the frame's forces leave.
    """

    def __init__(self, lifted: Lifted):
        (E, dE), (O, dO), (G, dG), law, (own, down) = lifted.E, lifted.O, lifted.G, lifted.law, lifted.T
        ratio, toeplitz = O.shape[-2], own.ndim < O.ndim
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
        self.P, self.Q = O @ V, into @ G
        if law is not None:
            self._append(law, lifted.still, ratio)
            length = ratio**0.5 * np.abs(lifted.still[..., 0])
            unsure = length * _norms(law[1] + 8 * ROUNDING * np.abs(law[0]), -1)[..., 0]
            shows, takes, vague = (
                np.concatenate([part, more[..., None]], -1)
                for part, more in ((shows, length), (takes, _norms(law[0], -1)[..., 0]), (vague, unsure))
            )
        self.shows, self.takes, self.vague = (part[..., None] for part in (shows, takes, vague))
        lag = np.subtract.outer(np.arange(ratio), np.arange(ratio))
        self.T = np.where(lag >= 0, own[..., lag], 0.0) if toeplitz else own
        self.spectrum = np.fft.fft(own, 2 * ratio) if toeplitz and ratio > LONG else None
        self.size = _norms(self.T, (-2, -1))[..., None]
        self.unsure = (np.sqrt(ratio * (down**2).sum(-1)) if toeplitz else _norms(down, (-2, -1)))[..., None]
        self.square = (self.T**2).sum((-2, -1))[..., None]
        self.mixed = (np.swapaxes(self.T, -1, -2) @ self.P * np.swapaxes(self.Q, -1, -2)).sum(-2)[..., None]
        P, Q = (np.swapaxes(self.P.conj(), -1, -2) @ self.P, self.Q.conj() @ np.swapaxes(self.Q, -1, -2))
        self.pairs = P * Q

    def _append(self, law, still, ratio):
        """Add the conserved combination as a mode."""
        self.poles = np.concatenate([self.poles, 0 * self.poles[..., :1]], -1)
        self.P = np.concatenate([self.P, np.broadcast_to(still[..., None, :1], (*self.P.shape[:-1], 1))], -1)
        self.Q = np.concatenate([self.Q, np.broadcast_to(law[0], (*self.Q.shape[:-2], 1, ratio))], -2)
        corner = [(0, 0)] * (self.slope.ndim - 2) + [(0, 1)] * 2
        self.slope, self.offset = np.pad(self.slope, corner), np.pad(self.offset, corner)

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
        value, width = self._settled(points.ladder, factor, trace)
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
        best, width = np.full((2, *trace.shape), np.nan)
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
            square, missed = _largest(*(np.stack([part[open_] for part in parts], -1) for parts in (diagonal, beside)))
            place = at[open_[0]], open_[1]
            gap = 2 * square - trace[place]
            best[place], width[place] = np.sqrt(square), np.where(gap > 0, missed / gap, np.inf) / (2 * np.sqrt(square))
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
        own = self.T if self.spectrum is None else self.spectrum[..., None]
        parts = [part.reshape(-1, *part.shape[-2:]) for part in (own, self.P, self.Q)]
        parts = [np.repeat(part, len(factor) // len(part), axis=0) if len(part) > 1 else part for part in parts]
        return _Maps(*parts, *(np.swapaxes(part.conj(), -1, -2) for part in parts[1:]), factor)

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
    """The maps of tiles of points: `own + P diag(factor) Q`, own a Toeplitz matrix, or the Fourier transform of its column.

    Pt, Qt: adjoints. All but factor have one entry for all tiles, or one each.
    """

    own: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    Pt: np.ndarray
    Qt: np.ndarray
    factor: np.ndarray

    def take(self, index):
        """Return the maps of some tiles."""
        parts = (getattr(self, field.name) for field in fields(self))
        return _Maps(*(part[index] if len(part) == len(self.factor) else part for part in parts))

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
        ticks = v.shape[-2]
        if self.own.shape[-1] == ticks:
            return np.matmul(np.swapaxes(self.own, -1, -2) if adjoint else self.own, v, out=out)
        spectrum = self.own.conj() if adjoint else self.own
        return np.fft.ifft(spectrum * np.fft.fft(v.view(complex), 2 * ticks, axis=-2), axis=-2)[:, :ticks].view(float)


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


def _largest(diagonal, beside):
    """Return the largest eigenvalue of `B'B`, and the square of the residual of its eigenvector.

    B is bidiagonal with these entries, `(points, steps)`; the residual comes from the next step of the bidiagonalisation.
    """
    steps, last = diagonal.shape[-1], (diagonal[:, -1] * beside[:, -1]) ** 2
    square, off = diagonal**2, diagonal[:, :-1] * beside[:, :-1]
    square[:, 1:] += beside[:, :-1] ** 2
    matrix, index = np.zeros((len(square), steps, steps)), np.arange(steps)
    matrix[:, index, index], matrix[:, index[1:], index[:-1]] = square, off
    value, vector = np.linalg.eigh(np.where(np.isfinite(matrix), matrix, 0.0))
    return value[:, -1], last * vector[:, -1, -1] ** 2
