"""Worst-case gain: the largest singular value of the lifted response."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from wavesweep.analysis.response.bordered import solved
from wavesweep.analysis.response.circle import circle
from wavesweep.analysis.response.dominant import Dominant, Lifted
from wavesweep.analysis.response.frame import Loop, prepare
from wavesweep.analysis.response.static import held_at_rest
from wavesweep.analysis.response.steady import GOOD, LOST, respond
from wavesweep.analysis.response.ticks import taken
from wavesweep.lifted.rounding import ROUNDING

DENSE = 32  # up to this ratio LAPACK's singular values of the whole matrix are the quicker way
STEPS = 40  # of the Lanczos process beyond; it stops earlier when nothing moves any more
SETTLED = 1e-13  # relative change of a singular value that counts as none
HUGE = 1e100  # entries whose squares are next to overflow
BLOCK = 2_000_000  # entries of one batch of matrices
POINTS = 200_000  # ticks times frequencies at a time


def worst_gain(loop: Loop, frequency_hz, ratio: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest singular value (m/N) of the lifted map from the frame's hand forces to its positions, and its error.

    Both are `(..., points)`; the error is a relative bound. frequency_hz: `(points,)`, Hz. ratio: ticks in a frame. The map is
    `T + O (w - E)^-1 G`: T gives the positions for forces of the same frame, a Toeplitz matrix, G the state that the forces
    leave, and O the positions for that state; only the closed loop has poles in it. The value is NaN, with an error of 0, if it
    is unbounded: at multiples of the slow rate if the position may drift. Both are NaN if the value is not known.
    Accuracy: as bounded (see `Dominant`), except if modes fail beyond 32 ticks: then Lanczos' process ends at changes of 1e-13.
    """
    return gain_of(loop, ratio)(frequency_hz)


def gain_of(loop: Loop, ratio: int) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Return `worst_gain` of one loop as a function of the frequencies, prepared once for any number of calls.

    ratio: ticks in a frame. The function also accepts the frequencies' `points`, see `respond`.
    """
    if loop.diagram.ratio == 1:
        return partial(_over_aliases, loop, ratio)
    with np.errstate(all="ignore"):
        whole, drifts = with_scene(prepare(loop.diagram, *loop.wall, outputs=(loop.diagram.hand.position,)))
        return partial(_through_modes, whole, drifts, Dominant(Lifted.of(whole)), ratio)


@np.errstate(all="ignore")
def _through_modes(whole, drifts, modes, ratio, frequency_hz, points=None):
    """Return the gain at these frequencies.

    `whole`, `drifts`: see `with_scene`. points: `circle(whole, frequency_hz)`, if known.
    """
    frequency, width = np.atleast_1d(np.asarray(frequency_hz, float)), max(1, POINTS // ratio)
    points = circle(whole, frequency) if points is None else points
    parts = [modes.gain(points.at(slice(at, at + width))) for at in range(0, frequency.size, width)]
    gain, error = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    _improve(whole, frequency, gain, error)
    gain = np.where((points.frame == 0) & drifts[..., None], np.inf, gain)
    relative = np.where(gain == np.inf, 0.0, error / gain + len(whole.states) * ROUNDING)
    unknown = ~(relative < LOST) | whole.lost[..., None]
    return np.where(unknown | (gain == np.inf), np.nan, gain), np.where(unknown, np.nan, relative)


def with_scene(loop):
    """Return the loop with the scene's position among the outputs of the ticks, and whether the position drifts."""
    seen, dseen = loop.shown.seen
    if loop.law is not None and not np.any(loop.still[0]):  # what is conserved does not move the position
        loop = replace(loop, law=None, shown=replace(loop.shown, law=None))
    O, E = seen.copy(), loop.E.copy()
    if loop.lead is not None:
        O[..., 0, :, loop.lead] += loop.still[0]
        if not loop.still[0]:  # a spring holds the hand: if nothing reads the scene's position, its pole has no effect
            E[..., loop.lead, loop.lead] = np.where(loop.free, -1.0, E[..., loop.lead, loop.lead])
    # A state that nothing reads but the output, and that does not decay, drifts.
    drifts = ((E == 0).all(-2) & (O[..., 0, :, :] != 0).any(-2)).any(-1) | (loop.law is not None)
    return replace(loop, E=E, shown=replace(loop.shown, seen=(O, dseen))), drifts


def _improve(loop, frequency, gain, error):
    """Replace the gains that the modes did not prove."""
    doubtful, ratio = ~(error <= GOOD * gain), loop.diagram.ratio
    some = np.flatnonzero(doubtful.any(axis=tuple(range(doubtful.ndim - 1))))
    if not some.size:
        return
    frame = Frame(loop)
    width = max(1, BLOCK // (max(1, loop.lost.size) * ratio * (ratio if ratio <= DENSE else len(loop.states))))
    for start in range(0, some.size, width):
        index = some[start : start + width]
        found, bound = frame.gain(frequency[index])
        gain[..., index] = np.where(doubtful[..., index], found, gain[..., index])
        error[..., index] = np.where(doubtful[..., index], bound, error[..., index])


@np.errstate(all="ignore")
def _over_aliases(loop, ratio, frequency_hz, points=None):
    """Return the gain of a loop that is the same in every tick, so that aliases do not mix: the largest over the aliases."""
    points = circle(loop, np.atleast_1d(np.asarray(frequency_hz, float))) if points is None else points
    rate, near = points.rate, (points.angle(ratio) / (2 * np.pi))[:, None]  # from the nearest multiple of the slow rate
    aliases = np.abs(np.arange(ratio) - (ratio - 1) // 2 + near) * (rate / ratio)
    constant = aliases == 0
    found = respond(loop, aliases.reshape(-1))
    gain, error = (
        part.reshape(*part.shape[:-1], *aliases.shape) for part in (np.abs(found.admittance), found.admittance_error)
    )
    held = held_at_rest(loop.diagram, loop.wall)[..., None, None]
    unbounded = (constant & ~held).any(-1)
    return np.where(unbounded, np.nan, gain.max(-1)), np.where(unbounded, 0.0, error.max(-1))


class Frame:
    """The lifted map in parts that do not depend on the frequency: see `Shown`.

    The part through the state, `O (w - E)^-1 G`, is a matrix no larger than the state between two matrices with orthonormal
    columns, `O = left corner` and `G = entry right'`; the conserved combination and its outputs are one more column of each.
    """

    def __init__(self, loop: Loop):
        self.loop, self.n = loop, len(loop.states)
        O, self.dO = taken(loop.shown.seen, (..., 0, slice(None), slice(None)))
        self.impulse = taken(loop.shown.impulse, (..., 0, slice(None)))
        (G, self.dG), law = loop.shown.left, loop.shown.law
        self.sizes = np.abs(O)
        if law is not None:
            G, O = np.concatenate([G, law[0]], axis=-2), np.concatenate([O, np.ones((*O.shape[:-1], 1))], axis=-1)
        self.finite = (np.abs(G) < HUGE).all((-1, -2)) & (np.abs(O) < HUGE).all((-1, -2))
        G, O = (np.where(self.finite[..., None, None], part, 0) for part in (G, O))
        self.lengths = np.sqrt((O**2).sum(-2)), np.sqrt((G**2).sum(-1))
        self.left, self.corner = np.linalg.qr(O)
        self.right, entry = np.linalg.qr(np.swapaxes(G, -1, -2))
        self.entry = np.swapaxes(entry, -1, -2)

    def gain(self, frequency):
        """Return the largest singular value at each frequency (Hz), and a bound on its error (m/N)."""
        loop, n, points = self.loop, self.n, circle(self.loop, frequency)
        ratio, w = loop.diagram.ratio, points.frame[:, None, None]
        factoring = 2 * n * ROUNDING  # of a column's length, what is lost by factors in place of it
        of_O, of_G = (factoring * length for length in self.lengths)
        vague = of_G[..., :n] + np.sqrt((self.dG**2).sum(-1))  # of a row, in whichever direction
        G, dG = self.entry[..., None, :n, :], vague[..., None, :, None]
        eye, none = np.eye(n), 0 * w.real
        X, dX = solved(w * eye - loop.E[..., None, :, :], loop.dE[..., None, :, :] + none, G + 0 * w, dG + 0 * np.abs(G) + none)
        size, O, dO = np.abs(X), self.sizes[..., None, :, :], self.dO[..., None, :, :]
        error = _norm_of_product(O, dX) + _norm_of_product(dO + n * ROUNDING * O, size)
        error = error + (of_O[..., None, :n, None] * size).sum((-1, -2))
        error = error + np.sqrt(ratio * (self.impulse[1] ** 2).sum(-1))[..., None]
        law = loop.shown.law
        if law is not None:
            still = loop.still[..., None, :, None] / w
            X = np.concatenate([X, still * self.entry[..., None, n:, :]], axis=-2)
            unsure = np.abs(still) * (law[1] + (8 * ROUNDING + 2 * factoring) * np.abs(law[0]))[..., None, :, :]
            error = error + np.sqrt(ratio * (unsure**2).sum((-1, -2)))
        core = self.corner[..., None, :, :] @ X
        value = self._dense(core) if ratio <= DENSE else self._lanczos(core)
        return value, error

    def _within(self, core):
        """Return whether all numbers of a point are far from overflow, and the core and the impulse, zero if they are not."""
        tame = (np.abs(self.impulse[0]) < HUGE).all(-1) & self.finite
        finite = tame[..., None] & (np.abs(core) < HUGE).all((-1, -2))
        return finite, np.where(finite[..., None, None], core, 0), np.where(tame[..., None], self.impulse[0], 0)[..., None, :]

    def _dense(self, core):
        """Return the largest singular value by LAPACK, from the whole matrix."""
        lag = np.subtract.outer(*[np.arange(self.loop.diagram.ratio)] * 2)
        finite, core, impulse = self._within(core)
        toeplitz = np.where(lag >= 0, impulse[..., lag], 0)
        over = np.swapaxes(_by_real(self.right[..., None, :, :], np.swapaxes(core, -1, -2)), -1, -2)
        matrix = _by_real(self.left[..., None, :, :], over) + toeplitz
        return np.where(finite, np.linalg.svd(matrix, compute_uv=False)[..., 0], np.nan)

    def _lanczos(self, core):
        """Return the largest singular value by Golub-Kahan-Lanczos with full reorthogonalisation, all points at once.

        T is applied by way of its Fourier transform.
        """
        ratio = self.loop.diagram.ratio
        finite, core, impulse = self._within(core)
        spectrum, left, right = np.fft.fft(impulse, 2 * ratio), self.left[..., None, :, :], self.right[..., None, :, :]
        spectra, cores = (spectrum, spectrum.conj()), (core, np.swapaxes(core.conj(), -1, -2))
        outward, inward = (left, right), tuple(np.swapaxes(part, -1, -2).copy() for part in (left, right))

        def apply(v, back):
            own = np.fft.ifft(spectra[back] * np.fft.fft(v, 2 * ratio))[..., :ratio]
            return own + _by_real(outward[back], cores[back] @ _by_real(inward[1 - back], v[..., None]))[..., 0]

        v = _by_real(right, cores[1] @ _by_real(inward[0], np.ones((*core.shape[:-2], ratio, 1), complex)))[..., 0]
        v, best = v / _norm(v) + 0.1 * np.hanning(ratio), 0.0
        basis, band, settled = [], [], ~finite  # a point that has settled keeps its value, whichever others have not
        for _ in range(min(STEPS, ratio)):
            v = v / _norm(v)
            basis.append(v)
            band.append(apply(v, 0))
            span = np.stack(band, axis=-1)
            value = np.sqrt(np.maximum(np.linalg.eigvalsh(np.swapaxes(span.conj(), -1, -2) @ span)[..., -1], 0))
            best, settled = np.where(settled, best, value), settled | (np.abs(value - best) <= SETTLED * value)
            if settled.all():
                break
            v = apply(band[-1], 1)
            for known in basis * 2:
                v = v - known * (known.conj() * v).sum(-1, keepdims=True)
        return np.where(finite, best, np.nan)


def _by_real(A, v):
    """Return `A v`, A real and v complex, without making A complex."""
    parts = np.ascontiguousarray(v).view(float)
    return (A @ parts).view(complex)


def _norm_of_product(A, B):
    """Return the Frobenius norm of `A B`, whose entries are not negative, without forming it."""
    inner = np.swapaxes(A, -1, -2) @ A
    return np.sqrt(((inner @ B) * B).sum((-1, -2)))


def _norm(v):
    size = np.sqrt((np.abs(v) ** 2).sum(-1, keepdims=True))
    return np.where(size > 0, size, 1)
