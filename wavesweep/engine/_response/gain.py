"""Worst-case gain: the largest singular value of the lifted map from the hand's forces of a
frame to its positions."""

from collections.abc import Callable
from typing import Any

import numpy as np

from wavesweep.engine._monodromy.bounded import Bounded, sum_rounding
from wavesweep.engine._response.lifted import Lifted, Stretch
from wavesweep.engine._response.static import LOST_DIGITS
from wavesweep.engine._response.steady import respond
from wavesweep.engine.doubles import EPS

DENSE_TICKS = 64  # ticks up to which singular values of the full matrix are quicker


def gain_of(loop: Lifted) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Return the worst-case gain (m/N) of loops as a function of frequencies `(points,)` (Hz),
    prepared once.

    The function returns the gain and a bound on its relative error, `(..., points)` each. The value
    is NaN, with an error of 0, if it is unbounded; both are NaN if the value is not known. A loop
    that is the same in every tick mixes no images: its gain is the size of its admittance.
    """
    if loop.frame.ticks > 1:
        return Gain(loop)

    def size_of_admittance(frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        response = respond(loop, frequency_hz)
        return np.abs(response.admittance), response.admittance_error

    return size_of_admittance


class Gain:
    """The worst-case gain of loops, see `gain_of`.

    The map is `T + O (w - E)^-1 G`: T gives the positions at the beginning of the ticks for forces
    of the same frame, G the state that the forces leave, and O the positions for that state; only
    the closed loop has poles in it. The part through the state is a matrix no larger than the state
    between two with orthonormal columns, `O = left corner` and `G = entry right'`.
    """

    def __init__(self, loop: Lifted) -> None:
        self.loop = loop
        self.frame, self.lost = loop.of_positions
        self.n = self.frame.E[0].shape[-1]
        self.O = self.frame.observability.part(..., -1, slice(None), slice(None))
        O = self.O.value
        G, dG = self.frame.controllability
        with np.errstate(all="ignore"):
            self.left, self.corner = np.linalg.qr(O)
            self.right, entry = np.linalg.qr(G.mT)
            self.entry = entry.mT[..., None, :, :]
            # lengths of what factors miss of columns
            missed_O = Bounded.exact(self.left) @ self.corner - Bounded.exact(O)
            missed_G = Bounded.exact(self.right) @ entry - Bounded.exact(G.mT)
            self.of_O = np.sqrt((missed_O.size**2).sum(-2))[..., None, :, None]
            of_entry = np.sqrt((missed_G.size**2).sum(-2)) + np.sqrt((dG**2).sum(-1))
            self.of_entry = of_entry[..., None, :, None]
            self.of_map = norm_of_errors(self.frame)

    def __call__(self, frequency_hz: np.ndarray | list[float]) -> tuple[np.ndarray, np.ndarray]:
        """Return the gain, unbounded at multiples of the frame's rate if the position drifts, and a
        bound on its error.

        Accuracy: as bounded, except beyond 64 ticks, where Lanczos' process ends at changes of
        1e-13.
        """
        frequency = np.atleast_1d(np.asarray(frequency_hz, float))
        ticks = self.frame.ticks
        unbounded = (self.loop.circle(frequency).frame == 0) & (self.loop.port.position is None)
        gain = np.full((*self.lost.shape, frequency.size), np.nan)
        relative = np.zeros((*self.lost.shape, frequency.size))
        bounded = np.flatnonzero(~unbounded)
        size_of_point = ticks * (ticks if ticks <= DENSE_TICKS else self.n)
        # Entries of one batch of matrices.
        width = max(1, 2_000_000 // (max(1, self.lost.size) * size_of_point))
        with np.errstate(all="ignore"):
            for start in range(0, bounded.size, width):
                index = bounded[start : start + width]
                value, error = self._at(self.loop.circle(frequency[index]).frame)
                # of singular values, whose error LAPACK bounds by a modest multiple of the size
                off = error / value + ticks * EPS
                good = (off < LOST_DIGITS) & ~self.lost[..., None]
                gain[..., index] = np.where(good, value, np.nan)
                relative[..., index] = np.where(good, off, np.nan)
        return gain, np.where(self.lost[..., None], np.nan, relative)

    def _at(self, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest singular value at each point of the frame's circle, and a bound on
        its error (m/N)."""
        n = self.n
        w = w[:, None, None]
        A = Bounded.exact(w * np.eye(n)) - self.frame.E.part(..., None, slice(None), slice(None))
        entry = Bounded(*np.broadcast_arrays(self.entry + 0 * w, self.of_entry))
        X, dX = A.solved(entry)
        size_X = np.abs(X)
        O = self.O.part(..., None, slice(None), slice(None))
        of_O = O.with_rounding(2 * n, of_complex=True)
        error = norm_of_product(np.abs(O.value), dX) + norm_of_product(of_O, size_X)
        error = error + (self.of_O * size_X).sum((-1, -2)) + self.of_map[..., None]
        core = self.corner[..., None, :, :] @ X
        finite = np.isfinite(core).all((-1, -2))
        core = np.where(finite[..., None, None], core, 0)
        rows = self.left[..., None, :, :]
        right = self.right.mT[..., None, :, :]
        size = norm_of_product(np.abs(rows), np.abs(core) @ np.abs(right))
        error = error + sum_rounding(2 * n + 1, of_complex=True) * size
        if self.frame.ticks <= DENSE_TICKS:
            H = rows @ core @ right
            H += self.frame.impulse_map()[..., None, :, :]
            value = _largest_singular_value(H)
        else:
            value = self._lanczos(core)
        return np.where(finite, value, np.nan), error

    def _lanczos(self, core: np.ndarray) -> np.ndarray:
        """Return the largest singular value, see `by_lanczos`."""
        shape = core.shape[:-2]
        ticks = self.frame.ticks
        loop = np.repeat(np.arange(int(np.prod(shape[:-1], dtype=int))), shape[-1])
        rows = self.left.reshape(-1, *self.left.shape[-2:])[loop]
        right = self.right.reshape(-1, *self.right.shape[-2:])[loop]
        core = core.reshape(-1, *core.shape[-2:])
        turned = core.conj().mT

        def apply(v: np.ndarray, back: bool) -> np.ndarray:
            direct = applied(self.frame, v[..., None].view(float), loop, adjoint=back).view(
                complex
            )[..., 0]
            into, out, middle = (rows, right, turned) if back else (right, rows, core)
            through_state = out @ (middle @ (into.mT @ v[..., None]))
            return direct + through_state[..., 0]

        return by_lanczos(apply, len(core), ticks).reshape(shape)


def by_lanczos(apply: Callable[..., Any], points: int, outputs: int) -> np.ndarray:
    """Return the largest singular value of a map at points, `(points,)`, or a little less, by
    Golub-Kahan-Lanczos with full reorthogonalisation, all points at once.

    apply: takes vectors `(points, inputs)`, or with `back` those `(points, outputs)` of the adjoint
    map.
    """
    v = apply(np.ones((points, outputs), complex), back=True)
    mixed = np.random.default_rng(0).normal(
        size=v.shape[-1]
    )  # the same always, and a part of every singular vector
    v = v / _norm(v) + mixed / _norm(mixed)
    best = np.zeros(points)
    basis = []
    band = []
    settled = np.zeros(points, bool)  # a point that has settled keeps its value
    for step in range(
        min(40, outputs, v.shape[-1])
    ):  # it stops earlier when nothing moves any more
        v = v / _norm(v)
        basis.append(v)
        band.append(apply(v, back=False))
        value = _largest_singular_value(np.stack(band, axis=-1))
        still = (np.abs(value - best) <= 1e-13 * value) & (
            step >= 8  # before, the process may rest at another singular value
        )
        best = np.where(settled, best, value)
        settled = settled | still
        if settled.all():
            break
        v = apply(band[-1], back=True)
        for vector in basis * 2:
            v = v - vector * (vector.conj() * v).sum(-1, keepdims=True)
    return best


def _largest_singular_value(H: np.ndarray) -> np.ndarray:
    square = H.conj().mT @ H
    return np.sqrt(np.maximum(np.linalg.eigvalsh(square)[..., -1], 0))


def _norm(v: np.ndarray) -> np.ndarray:
    size = np.sqrt((np.abs(v) ** 2).sum(-1, keepdims=True))
    return np.where(size > 0, size, 1)


def applied(frame: Stretch, v: np.ndarray, loop: np.ndarray, *, adjoint: bool) -> np.ndarray:
    """Return the positions of a frame for its forces v, `(vectors, ticks, columns)`, real; adjoint:
    the transposed map.

    loop: that of each vector. What the forces of one half of a long frame do in the other goes
    through the state.
    """
    if frame.impulse:
        H = _of_loops(frame.impulse[0], loop)
        return (H.mT if adjoint else H) @ v
    first, second = frame.halves
    early = v[:, : first.ticks]
    late = v[:, first.ticks :]
    results = [
        applied(first, early, loop, adjoint=adjoint),
        applied(second, late, loop, adjoint=adjoint),
    ]
    O = _of_loops(second.observability.value[..., -1, :, :], loop)
    G = _of_loops(first.controllability.value, loop)
    if adjoint:
        results[0] += G.mT @ (O.mT @ late)
    else:
        results[1] += O @ (G @ early)
    return np.concatenate(results, axis=-2)


def _of_loops(matrices: np.ndarray, loop: np.ndarray) -> np.ndarray:
    matrices = matrices.reshape(-1, *matrices.shape[-2:])
    return matrices[loop] if len(matrices) > 1 else matrices


def norm_of_errors(frame: Stretch) -> np.ndarray:
    """Return the Frobenius norm of the errors of the map from a frame's forces to its positions,
    `(...)`."""
    if frame.impulse:
        return np.sqrt((frame.impulse[1] ** 2).sum((-2, -1)))
    first, second = frame.halves
    O, dO = second.observability.part(..., -1, slice(None), slice(None))
    G = first.controllability
    dG = G.with_rounding(O.shape[-1])
    across = norm_of_product(dO, np.abs(G.value)) + norm_of_product(np.abs(O), dG)
    return np.sqrt(norm_of_errors(first) ** 2 + norm_of_errors(second) ** 2 + across**2)


def norm_of_product(A: np.ndarray, B: np.ndarray) -> np.ndarray | float:
    """Return the Frobenius norm of `A B` without forming it."""
    of_A = A.mT @ A
    of_B = B @ B.mT
    return np.sqrt(np.maximum((of_A * of_B).sum((-1, -2)), 0))
