"""Steady response of the whole loop to a sinusoidal hand force, as the hand feels it, with bounds on its errors."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.response.bordered import CLOSE, bordered, conserved_output
from wavesweep.analysis.response.circle import Circle, circle
from wavesweep.analysis.response.frame import Loop
from wavesweep.analysis.response.static import held_at_rest, static_response, zero_at_rest
from wavesweep.lifted.circle import solve
from wavesweep.lifted.rounding import ROUNDING

GOOD = 1e-9  # bound on the relative error up to which the modes are believed; beyond, the larger system is solved
LOST = 0.1  # relative error from which on a number has no digit
EXTRAPOLATED = 85 / 45  # the sum of the sizes of the weights by which an extrapolation adds up three values
LOW = 2e-4  # of the slowest pole and of the slow rate, the frequency that the static limit is held against
NOISE = 1e-13  # of the sizes of the modes, what rounding may leave of an entry of their sum
TERMS = 2_000_000  # ticks times frequencies at a time
BLOCK = 200_000  # entries of one batch of matrices


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """Admittance (m/N) and impedance (N/m), complex, `(..., points)`, and bounds on their relative errors.

    NaN: not known; with an error of 0 the number is known to have no bound.
    """

    admittance: np.ndarray
    impedance: np.ndarray
    admittance_error: np.ndarray
    impedance_error: np.ndarray


def steady_state(loop: Loop, frequency_hz) -> tuple[np.ndarray, np.ndarray]:
    """Return transmitted admittance (m/N) and impedance (N/m), complex, `(..., points)`.

    loop, frequency_hz: see `respond`.
    """
    found = respond(loop, frequency_hz)
    return found.admittance, found.impedance


def respond(
    loop: Loop, frequency_hz, good: float = GOOD, modal: "Modal | None" = None, points: Circle | None = None
) -> Response:
    """Return transmitted admittance and impedance with bounds on their errors.

    loop: see `prepare`. frequency_hz: `(points,)`, Hz; 0 for the static limit. good: relative error up to which a number is not
    computed again in a slower way. modal: of this loop, if it is known. points: `circle(loop, frequency_hz)`, if it is known.

    The hand's force `exp(j w k T)` gives a sum over `w + 2 pi m/T_s`; both results are its components at w itself. The state at
    the start of a frame solves `(w - E) X = g` with the loop closed, so no pole of an open loop enters, and a drift is treated
    separately (see `Loop`). The solution is found through the modes of E first; if these cancel too far, see `bordered`.
    Accuracy: as bounded, from the residual of the solution, the errors of all entries and the size of the inverse. At 0 Hz the
    error is the distance to an extrapolation from low frequencies, which shares no formula with the limit.
    """
    frequency, width = np.atleast_1d(np.asarray(frequency_hz, float)), max(1, TERMS // loop.diagram.ratio)
    with np.errstate(all="ignore"):
        modal, still = modal or Modal(loop), frequency == 0
        moving = frequency[~still]
        cuts = (slice(at, at + width) for at in range(0, moving.size, width))
        whole = points if points is not None and moving.size == frequency.size else circle(loop, moving)
        parts = [_responses(loop, modal, whole.at(cut), good) for cut in cuts]
        found = [np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)]
        if not still.any():
            return Response(*found)
        limit = _at_rest(loop, modal)
    if not parts:
        return Response(*(part + np.zeros(frequency.size, part.dtype) for part in limit))
    whole = [np.empty((*part.shape[:-1], frequency.size), part.dtype) for part in found]
    for array, part, one in zip(whole, found, limit, strict=True):
        array[..., ~still], array[..., still] = part, one
    return Response(*whole)


def _at_rest(loop, modal):
    """Return the static limit and its errors, `(..., 1)` each.

    The limit is compared with low frequencies f, f/2 and f/4, whose real parts are even in f.
    """
    limit = [part[..., None] for part in static_response(loop)]
    slow = np.min(np.abs(modal.poles), axis=-1, where=np.abs(modal.poles) > 0, initial=1.0)
    rate = loop.diagram.rate if loop.diagram.rate is not None else 1 / np.asarray(loop.diagram.period)
    # Powers of four, and each loop its own, so that what is found of one does not depend on the others of a batch.
    level = np.floor(np.log2(LOW * slow * float(np.min(rate)) / loop.diagram.ratio) / 2)
    low = [np.full((*level.shape, 3), np.nan, kind) for kind in (complex, complex, float, float)]
    for each in np.unique(level):
        parts = _responses(loop, modal, circle(loop, 4.0**each * np.array([1, 0.5, 0.25])))
        low = [np.where((level == each)[..., None], part, whole) for part, whole in zip(parts, low, strict=True)]
    found = []
    for value, part, error, zero in zip(limit, low[:2], low[2:], (False, zero_at_rest(loop)[..., None]), strict=True):
        first, second = ((4 * part[..., [at + 1]] - part[..., [at]]).real / 3 for at in (0, 1))
        expected, missed = (16 * second - first) / 15, EXTRAPOLATED * (error * np.abs(part)).max(-1, keepdims=True)
        off = (np.abs(value - expected) + missed) / np.minimum(np.abs(value), np.abs(expected))
        off = np.where(zero & (value == 0), 0.0, off)
        known = off < LOST
        found.append((np.where(known, value, np.nan) + 0j, np.where(known, off, np.nan)))
    (admittance, of_admittance), (impedance, of_impedance) = found
    moves = ~held_at_rest(loop.diagram, loop.wall)[..., None] & ~loop.lost[..., None]
    of_admittance = np.where(moves, 0.0, of_admittance)
    return admittance, impedance, of_admittance, of_impedance


def _responses(loop, modal, points, good=GOOD):
    """`respond` for some frequencies that are not 0, as a tuple."""
    found, error, again = _by_modes(loop, points, modal)
    for improve in (again, lambda index: bordered(loop, points.at(index))):
        doubtful = ~(error <= good * np.abs(found)).all(-2)
        some = np.flatnonzero(doubtful.any(axis=tuple(range(doubtful.ndim - 1))))
        width = max(1, BLOCK // (loop.outputs + len(loop.fast.states) + len(loop.states)) ** 2 // max(1, loop.lost.size))
        for start in range(0, some.size, width):
            index = some[start : start + width]
            number, less = improve(index)
            better = doubtful[..., None, index] & ~(less >= error[..., index])
            found[..., index] = np.where(better, number, found[..., index])
            error[..., index] = np.where(better, less, error[..., index])
    return _read(loop, points, found, error)


def _read(loop, points, found, error):
    """Return admittance and impedance from displacement and force; a number without a correct digit is NaN."""
    lost = loop.lost[..., None]
    relative = np.where(error == 0, 0.0, error / np.abs(found)) + 4 * np.finfo(float).eps
    relative = np.where(lost[..., None, :] | ~(relative < LOST), np.nan, relative)
    admittance = np.where(np.isnan(relative[..., 0, :]), np.nan, found[..., 0, :] / points.tick)
    impedance = np.where(np.isnan(relative[..., 1, :]), np.nan, found[..., 1, :] / admittance)
    known = np.isfinite(impedance)  # an admittance may be so small that it has no inverse in double precision
    whole = np.where(known, relative[..., 0, :] + relative[..., 1, :], np.nan)
    return admittance, np.where(known, impedance, np.nan), relative[..., 0, :], whole


def _by_modes(loop, points, modal):
    """Return (displacement, force) at the hand's frequency, `(..., 2, points)`, bounds on their errors, and a function.

    The function returns some of the results again with a better bound.
    """
    (rows, drows), (own, down), (g, dg), law = loop.shown.sums(points.ladder)
    X, unsure, gain, off = modal.solve(points.frame, g, dg)
    size, seen = np.abs(rows), np.swapaxes(X, -1, -2)[..., None, :, :]
    total = (rows * seen).sum(-1) + own
    rest = (size * (ROUNDING * np.abs(seen))).sum(-1) + drows @ np.abs(X) + down + ROUNDING * np.abs(own)
    if law is not None:
        still, dstill = conserved_output(loop, points, law)
        total, rest = total + points.ratio * still, rest + points.ratio * dstill

    def error(bound, index):
        grown = np.swapaxes(bound, -1, -2)[..., None, :, :]
        return ((size[..., index, :] * grown).sum(-1) + rest[..., index]) / points.ratio

    def again(index):
        chosen = (part[..., index] for part in (unsure, gain, off))
        return total[..., index] / points.ratio, error(modal.careful_bound(points.frame[index], *chosen), index)

    return total / points.ratio, error(modal.bound(unsure, gain, off), slice(None)), again


class Modal:
    """The resolvent `(w - E)^-1` through the modes of E, as an approximate inverse whose error is known."""

    def __init__(self, loop: Loop):
        E, self.error = loop.E.copy(), loop.dE
        if loop.lead is not None:  # if nothing reads the scene's position, its pole at 0 has no effect
            E[..., loop.lead, loop.lead] = np.where(loop.free, -1.0, E[..., loop.lead, loop.lead])
        self.E = E
        self.poles, self.vectors = np.linalg.eig(E)
        self.vectors = self.vectors.astype(complex)
        eye = np.broadcast_to(np.eye(E.shape[-1]), E.shape)
        self.into = solve(self.vectors, eye)
        self.defect = np.abs(self.into @ E @ self.vectors - self.poles[..., None, :] * eye).sum(-1)

    def solve(self, w, b, db):
        """Return X `(..., n, points)` of `(w - E) X = b`, and three measures of its accuracy: unsure, gain and off.

        unsure: the uncertainty of its equations. gain: the sizes of the modes' factors. off: a bound on the relative error of
        the inverse. db: error of b.
        """
        factor, E = 1 / (w - self.poles[..., None]), self.E + 0j
        X = self.vectors @ (factor * (self.into @ b))
        for _ in range(2):
            left = b - w * X + E @ X
            X = X + self.vectors @ (factor * (self.into @ left))
        left, size, gain = b - w * X + E @ X, np.abs(X), np.abs(factor)
        unsure = np.abs(left) + ROUNDING * (np.abs(w) * size + np.abs(self.E) @ size + np.abs(b)) + self.error @ size + db
        return X, unsure, gain, (gain * self.defect[..., None]).max(-2, keepdims=True, initial=0)

    def bound(self, unsure, gain, off):
        """Return a bound on the error of X, from the sizes of the modes; unsure, gain, off: see `solve`."""
        bound = np.abs(self.vectors) @ (gain * (np.abs(self.into) @ unsure))
        return np.where(off <= CLOSE, bound * (1 + 2 * off), np.inf)

    def careful_bound(self, w, unsure, gain, off):
        """Return a bound on the error of X from the inverse itself, in which modes cancel.

        w, unsure, gain, off: of the points, see `solve`. Every product of matrices is of one point.
        """
        factor = np.swapaxes(1 / (w - self.poles[..., None]), -1, -2)[..., None, :]
        unsure, gain = (np.swapaxes(part, -1, -2)[..., None] for part in (unsure, gain))
        vectors, into = self.vectors[..., None, :, :], self.into[..., None, :, :]
        noise = NOISE * (np.abs(vectors) @ (gain * (np.abs(into) @ unsure)))
        bound = np.swapaxes((np.abs((vectors * factor) @ into) @ unsure + noise)[..., 0], -1, -2)
        return np.where(off <= CLOSE, bound * (1 + 2 * off), np.inf)
