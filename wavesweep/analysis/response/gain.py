"""Worst-case gain: the largest singular value of the lifted response."""

import numpy as np

from wavesweep.analysis.response.bordered import solved
from wavesweep.analysis.response.circle import circle
from wavesweep.analysis.response.frame import Loop, prepare
from wavesweep.analysis.response.steady import LOST, respond
from wavesweep.analysis.response.ticks import ROUNDING, taken
from wavesweep.diagram.drift import hand_drifts

DENSE = 32  # up to this ratio LAPACK's singular values of the whole matrix are the quicker way
STEPS = 40  # of the Lanczos process beyond; it stops earlier when nothing moves any more
SETTLED = 1e-13  # relative change of a singular value that counts as none
STILL = 1e-13  # cycles per tick that stand for a constant force
HUGE = 1e100  # entries whose squares are next to overflow
BLOCK = 2_000_000  # entries of one batch of matrices


def worst_gain(loop: Loop, frequency_hz, ratio: int) -> tuple[np.ndarray, np.ndarray]:
    """Largest singular value (m/N) of the lifted map from the frame's hand forces to its positions, and a bound on its error.

    Both `(..., points)`, the bound relative. ratio: ticks in a frame. The map is `T + O (w - E)^-1 G`: T what a force does
    within its own frame, a Toeplitz matrix, G what it leaves in the state, O what the state shows in a frame; only the closed
    loop has poles in it. NaN, with an error of 0, where it is unbounded, at multiples of the slow rate if the position may
    drift; both NaN where it is not known.
    Accuracy: as bounded, but for the Lanczos process beyond 32 ticks, which stops at changes of 1e-13.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    with np.errstate(all="ignore"):
        if loop.diagram.ratio == 1:
            return _over_aliases(loop, frequency, ratio)
        whole = prepare(loop.diagram, *loop.wall, outputs=(loop.diagram.hand.position,))
        frame, loops = Frame(whole), max(1, whole.lost.size)
        width = max(1, BLOCK // (loops * ratio * (ratio if ratio <= DENSE else len(whole.states))))
        parts = [frame.gain(frequency[start : start + width]) for start in range(0, frequency.size, width)]
        gain, error = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
        relative = np.where(gain == np.inf, 0.0, error / gain + len(whole.states) * ROUNDING)
        unknown = ~(relative < LOST) | whole.lost[..., None]
        return np.where(unknown | (gain == np.inf), np.nan, gain), np.where(unknown, np.nan, relative)


def _over_aliases(loop, frequency, ratio):
    """A loop that is the same in every tick keeps every alias to itself."""
    points = circle(loop, frequency)
    rate, near = points.rate, (points.angle(ratio) / (2 * np.pi))[:, None]  # from the nearest multiple of the slow rate
    aliases = np.abs(np.arange(ratio) - (ratio - 1) // 2 + near) * (rate / ratio)
    constant = aliases == 0
    found = respond(loop, np.where(constant, STILL * rate, aliases).reshape(-1))
    gain, error = (
        part.reshape(*part.shape[:-1], *aliases.shape) for part in (np.abs(found.admittance), found.admittance_error)
    )
    held = (not hand_drifts(loop.diagram)) | (np.asarray(loop.wall[0]) != 0)[..., None, None]
    unbounded = (constant & ~held).any(-1)
    return np.where(unbounded, np.nan, gain.max(-1)), np.where(unbounded, 0.0, error.max(-1))


class Frame:
    """The lifted map in parts that no frequency changes: see `Shown`."""

    def __init__(self, loop: Loop):
        self.loop, self.O = loop, taken(loop.shown.seen, (..., 0, slice(None), slice(None)))
        self.impulse = taken(loop.shown.impulse, (..., 0, slice(None)))
        if loop.lead is not None:
            self.O[0][..., loop.lead] += 1  # the scene's position is everybody's
        idle = (loop.E == 0).all(-2).any(-1)  # a state that nothing reads but the output, and that does not decay
        self.drifts = loop.free | idle | (loop.law is not None)

    def gain(self, frequency):
        """The largest singular value at each frequency (Hz), and a bound on its error (m/N)."""
        loop, points = self.loop, circle(self.loop, frequency)
        n, ratio = len(loop.states), loop.diagram.ratio
        w = points.frame[:, None, None]
        law, (G, dG) = loop.shown.law, (part[..., None, :, :] for part in loop.shown.left)
        eye = np.eye(n)
        X, dX = solved(w * eye - loop.E[..., None, :, :], loop.dE[..., None, :, :] + 0 * w.real, G + 0 * w, dG + 0 * w.real)
        size, O, dO = np.abs(X), np.abs(self.O[0])[..., None, :, :], self.O[1][..., None, :, :]
        error = _norm_of_product(O, dX) + _norm_of_product(dO + n * ROUNDING * O, size)
        error = error + np.sqrt(ratio * (self.impulse[1] ** 2).sum(-1))[..., None]
        still = None
        if law is not None:
            still = loop.still[..., None, :, None] * (law[0][..., None, :, :] / w)
            unsure = (law[1] + 8 * ROUNDING * np.abs(law[0]))[..., None, :, :] / np.abs(w)
            unsure = np.abs(loop.still)[..., None, :, None] * unsure
            error = error + np.sqrt(ratio * (unsure**2).sum((-1, -2)))
        value = self._dense(X, still) if ratio <= DENSE else self._lanczos(X, still)
        drifting = (points.frame == 0) & self.drifts[..., None]
        return np.where(drifting, np.inf, value), error

    def _dense(self, X, still):
        """By LAPACK, from the whole matrix."""
        lag = np.subtract.outer(*[np.arange(self.loop.diagram.ratio)] * 2)
        toeplitz = np.where(lag >= 0, self.impulse[0][..., lag], 0)
        matrix = self.O[0][..., None, :, :] @ X + toeplitz[..., None, :, :]
        matrix = matrix if still is None else matrix + still
        finite = (np.abs(matrix) < HUGE).all((-1, -2))
        value = np.linalg.svd(np.where(finite[..., None, None], matrix, 0), compute_uv=False)[..., 0]
        return np.where(finite, value, np.nan)

    def _lanczos(self, X, still):
        """Golub-Kahan-Lanczos with full reorthogonalisation, all points at once; T by way of its Fourier transform."""
        ratio = self.loop.diagram.ratio
        O = np.broadcast_to(self.O[0][..., None, :, :], (*X.shape[:-2], *self.O[0].shape[-2:]))
        if still is not None:
            X = np.concatenate([X, still], axis=-2)
            O = np.concatenate([O, np.ones((*O.shape[:-1], 1))], axis=-1)
        impulse = self.impulse[0][..., None, :]
        finite = (np.abs(impulse) < HUGE).all(-1) & np.logical_and(*((np.abs(part) < HUGE).all((-1, -2)) for part in (X, O)))
        X, O = (np.where(finite[..., None, None], part, 0) for part in (X, O))
        spectrum = np.fft.fft(np.where(finite[..., None], impulse, 0), 2 * ratio)

        def forward(v):
            own = np.fft.ifft(spectrum * np.fft.fft(v, 2 * ratio))[..., :ratio]
            return own + (O @ (X @ v[..., None]))[..., 0]

        def backward(u):
            own = np.fft.ifft(spectrum.conj() * np.fft.fft(u, 2 * ratio))[..., :ratio]
            return own + (np.swapaxes(X.conj(), -1, -2) @ (np.swapaxes(O, -1, -2) @ u[..., None]))[..., 0]

        v, best = np.abs(X).sum(-2) / _norm(np.abs(X).sum(-2)) + 0.1 * np.hanning(ratio) + 0j, 0.0
        basis, band, settled = [], [], ~finite  # a point that has settled keeps its value, whichever others have not
        for _ in range(min(STEPS, ratio)):
            v = v / _norm(v)
            basis.append(v)
            band.append(forward(v))
            span = np.stack(band, axis=-1)
            value = np.sqrt(np.maximum(np.linalg.eigvalsh(np.swapaxes(span.conj(), -1, -2) @ span)[..., -1], 0))
            best, settled = np.where(settled, best, value), settled | (np.abs(value - best) <= SETTLED * value)
            if settled.all():
                break
            v = backward(band[-1])
            for known in basis * 2:
                v = v - known * (known.conj() * v).sum(-1, keepdims=True)
        return np.where(finite, best, np.nan)


def _norm_of_product(A, B):
    """Frobenius norm of `A B`, entries not negative, without forming it."""
    inner = np.swapaxes(A, -1, -2) @ A
    return np.sqrt(((inner @ B) * B).sum((-1, -2)))


def _norm(v):
    size = np.sqrt((np.abs(v) ** 2).sum(-1, keepdims=True))
    return np.where(size > 0, size, 1)
