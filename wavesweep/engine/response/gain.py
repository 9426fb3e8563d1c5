"""Worst-case gain: the largest singular value of the lifted map from the hand's forces of a frame to its positions."""

from collections.abc import Callable
from functools import partial

import numpy as np

from wavesweep.engine.monodromy.rounding import ROUNDING
from wavesweep.engine.response.lifted import Lifted, Stretch
from wavesweep.engine.response.linear_systems import solved
from wavesweep.engine.response.static import LOST
from wavesweep.engine.response.steady import respond

DENSE = 64  # ticks up to which singular values of the whole matrix are quicker
STEPS = 40  # of the Lanczos process beyond; it stops earlier when nothing moves any more
FEWEST = 8  # steps before it may stop, since the process may rest at another singular value first
SETTLED = 1e-13  # relative change below which a singular value has settled
BLOCK = 2_000_000  # entries of one batch of matrices


def gain_of(loop: Lifted) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Return the worst-case gain (m/N) of loops as a function of frequencies `(points,)` (Hz), prepared once.

    The function returns the gain and a bound on its relative error, `(..., points)` each. The value is NaN, with an error of 0,
    if it is unbounded; both are NaN if the value is not known. A loop that is the same in every tick mixes no images: its gain
    is the size of its admittance.
    """
    return partial(_of_one_tick, loop) if loop.frame.ticks == 1 else Gain(loop)


def _of_one_tick(loop, frequency_hz):
    found = respond(loop, frequency_hz)
    return np.abs(found.admittance), found.admittance_error


class Gain:
    """The worst-case gain of loops, see `gain_of`.

    The map is `T + O (w - E)^-1 G`: T gives the positions at the beginning of the ticks for forces of the same frame, G the
    state that the forces leave, and O the positions for that state; only the closed loop has poles in it. The part through the
    state is a matrix no larger than the state between two with orthonormal columns, `O = left corner` and `G = entry right'`.
    """

    def __init__(self, loop: Lifted):
        self.loop, (self.frame, self.lost) = loop, loop.of_positions
        with np.errstate(all="ignore"):
            self.n = self.frame.E[0].shape[-1]
            (O, self.dO), (G, dG) = (part[..., -1, :, :] for part in self.frame.seen), self.frame.left
            self.size, factoring = (
                np.abs(O),
                2 * self.n * ROUNDING,
            )  # of a column's length, what is lost by factors in its place
            self.of_O = factoring * np.sqrt((O**2).sum(-2))[..., None, :, None]
            self.vague = (factoring * np.sqrt((G**2).sum(-1)) + np.sqrt((dG**2).sum(-1)))[..., None, :, None]
            self.left, self.corner = np.linalg.qr(O)
            self.right, entry = np.linalg.qr(np.swapaxes(G, -1, -2))
            self.entry, self.unsure = np.swapaxes(entry, -1, -2)[..., None, :, :], norm_of_errors(self.frame)

    def __call__(self, frequency_hz) -> tuple[np.ndarray, np.ndarray]:
        """Return the gain, unbounded at multiples of the frame's rate if the position drifts, and a bound on its error.

        Accuracy: as bounded, except beyond 64 ticks, where Lanczos' process ends at changes of 1e-13.
        """
        frequency, ticks = np.atleast_1d(np.asarray(frequency_hz, float)), self.frame.ticks
        unbounded = (self.loop.circle(frequency).frame == 0) & (self.loop.port.position is None)
        gain, relative = np.full((*self.lost.shape, frequency.size), np.nan), np.zeros((*self.lost.shape, frequency.size))
        bounded = np.flatnonzero(~unbounded)
        width = max(1, BLOCK // (max(1, self.lost.size) * ticks * (ticks if ticks <= DENSE else self.n)))
        with np.errstate(all="ignore"):
            for start in range(0, bounded.size, width):
                which = bounded[start : start + width]
                value, error = self._at(self.loop.circle(frequency[which]).frame)
                off = error / value + self.n * ROUNDING
                known = (off < LOST) & ~self.lost[..., None]
                gain[..., which], relative[..., which] = (np.where(known, part, np.nan) for part in (value, off))
        return gain, np.where(self.lost[..., None], np.nan, relative)

    def _at(self, w):
        """Return the largest singular value at each point of the frame's circle, and a bound on its error (m/N)."""
        (E, dE), w, n = self.frame.E, w[:, None, None], self.n
        none = 0 * w.real
        A, dA = w * np.eye(n) - E[..., None, :, :], dE[..., None, :, :] + none
        X, dX = solved(A, dA, self.entry + 0 * w, self.vague + 0 * np.abs(self.entry) + none)
        size, O, dO = np.abs(X), self.size[..., None, :, :], self.dO[..., None, :, :]
        error = norm_of_product(O, dX) + norm_of_product(dO + n * ROUNDING * O, size)
        error = error + (self.of_O * size).sum((-1, -2)) + self.unsure[..., None]
        core = self.corner[..., None, :, :] @ X
        finite = np.isfinite(core).all((-1, -2))
        core = np.where(finite[..., None, None], core, 0)
        value = self._dense(core) if self.frame.ticks <= DENSE else self._lanczos(core)
        return np.where(finite, value, np.nan), error

    def _dense(self, core):
        """Return the largest singular value from the whole matrix A, the root of the largest eigenvalue of `A' A`."""
        whole = self.left[..., None, :, :] @ core @ np.swapaxes(self.right, -1, -2)[..., None, :, :]
        whole += self.frame.whole()[..., None, :, :]
        return np.sqrt(np.linalg.eigvalsh(np.swapaxes(whole.conj(), -1, -2) @ whole)[..., -1])

    def _lanczos(self, core):
        """Return the largest singular value by Golub-Kahan-Lanczos with full reorthogonalisation, all points at once."""
        shape, ticks, rank = core.shape[:-2], self.frame.ticks, core.shape[-2:]
        which = np.repeat(np.arange(int(np.prod(shape[:-1], dtype=int))), shape[-1])
        left, right = (part.reshape(-1, *part.shape[-2:])[which] for part in (self.left, self.right))
        core = core.reshape(-1, *rank)
        turned = np.swapaxes(core.conj(), -1, -2)

        def apply(v, back):
            own = applied(self.frame, v[..., None].view(float), which, adjoint=back).view(complex)[..., 0]
            into, out, middle = (left, right, turned) if back else (right, left, core)
            return own + (out @ (middle @ (np.swapaxes(into, -1, -2) @ v[..., None])))[..., 0]

        v = apply(np.ones((len(core), ticks), complex), back=True)
        mixed = np.random.default_rng(0).normal(size=ticks)  # the same always, and a part of every singular vector
        v, best = v / _norm(v) + mixed / _norm(mixed), 0.0
        basis, band, settled = [], [], np.zeros(len(core), bool)  # a point that has settled keeps its value
        for step in range(min(STEPS, ticks)):
            v = v / _norm(v)
            basis.append(v)
            band.append(apply(v, back=False))
            span = np.stack(band, axis=-1)
            value = np.sqrt(np.maximum(np.linalg.eigvalsh(np.swapaxes(span.conj(), -1, -2) @ span)[..., -1], 0))
            still = (np.abs(value - best) <= SETTLED * value) & (step >= FEWEST)
            best, settled = np.where(settled, best, value), settled | still
            if settled.all():
                break
            v = apply(band[-1], back=True)
            for known in basis * 2:
                v = v - known * (known.conj() * v).sum(-1, keepdims=True)
        return best.reshape(shape)


def _norm(v):
    size = np.sqrt((np.abs(v) ** 2).sum(-1, keepdims=True))
    return np.where(size > 0, size, 1)


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


def norm_of_errors(frame: Stretch) -> np.ndarray:
    """Return the Frobenius norm of the errors of the map from a frame's forces to its positions, `(...)`."""
    if frame.inner:
        return np.sqrt((frame.inner[1] ** 2).sum((-2, -1)))
    seen, dseen = (part[..., -1, :, :] for part in frame.second.seen)
    left, dleft = frame.first.left
    size = np.abs(left)
    across = norm_of_product(dseen, size) + norm_of_product(np.abs(seen), dleft + ROUNDING * size)
    return np.sqrt(norm_of_errors(frame.first) ** 2 + norm_of_errors(frame.second) ** 2 + across**2)


def norm_of_product(A, B):
    """Return the Frobenius norm of `A B` without forming it."""
    return np.sqrt(np.maximum(((np.swapaxes(A, -1, -2) @ A) * (B @ np.swapaxes(B, -1, -2))).sum((-1, -2)), 0))
