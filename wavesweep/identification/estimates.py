"""Estimates of the numbers of a model from the residual of a fit: the likeliest numbers, and their
95 % intervals.

The positions are treated as linear in the numbers, with slopes J. The residual r may be one of
three things:

- Rounding alone: each reading is within half a step of the model. The numbers for which this holds
  form a polytope, whose ends are found by linear programs. The interval is valid if the encoder has
  no noise.
- Rounding and white noise of deviation s: a reading has the probability F((r + q/2)/s) - F((r -
  q/2)/s), where q is the step
and
  F the normal distribution. Newton's method finds the largest likelihood, and its curvature gives
  the interval.
- Coloured noise: an autoregression (Burg's method, order by BIC) gives the spectrum of the score u,
  the derivative of the logarithm of that probability; the sandwich H^-1 J'E[u u']J H^-1 gives the
  interval. In short logs the spectrum is known only roughly, so the quantile is that of logs drawn
  from the same autoregression, each with an estimated spectrum.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog, minimize_scalar
from scipy.signal import lfilter
from scipy.special import log_ndtr, stdtrit

from wavesweep.engine.doubles import NEXT_TO_ZERO

SMOOTH = 0.5  # white noise, in steps, above which rounding acts like more white noise
NOISE = np.log([0.02, SMOOTH])  # range, in steps, in which the white noise is searched
MOST_NEWTON_STEPS = 30  # steps of Newton's method at most
# steps by which a reading may miss its rounding, because of the digits of the file
READING_SLACK = 1e-3
SEARCHED = 20_000  # rows at most from which the noise is estimated
DRAWS = 159  # logs drawn
WARM = 1000  # rows before each
CONSTRAINTS_ADDED = 40  # constraints of a linear program that are added at a time


@dataclass(frozen=True, eq=False)
class Estimate:
    """Numbers and intervals, estimated near the numbers at which the slopes were taken.

    step: to the likeliest numbers, or the middle of the possible ones. half: half the widths of the
    intervals. noise: standard deviation of the white noise (m). score (1/m) and weight (1/m^2):
    minus the first and the second derivative of the logarithm of the likelihood with respect to the
    residual, `(rows,)`. slopes: of the positions, `(rows, numbers)`. rounded: rounding alone
    explains each reading.
    """

    step: np.ndarray
    half: np.ndarray
    noise: float
    score: np.ndarray
    weight: np.ndarray
    slopes: np.ndarray
    rounded: bool = False


def estimated(slopes: np.ndarray, residual: np.ndarray, resolution: float) -> Estimate:
    """Estimate the numbers from a residual (m) and slopes of the positions. resolution: step of
    the encoder (m), 0 for none."""
    size = np.linalg.norm(slopes, axis=0)
    basis, upper = np.linalg.qr(slopes / size)
    inverse = np.linalg.pinv(upper) / size[:, None]
    rows = len(residual)
    if resolution and (ends := _polytope(basis, residual, resolution, inverse)) is not None:
        weight = np.full(rows, 12 / resolution**2)
        step = np.mean(ends, axis=0)
        return Estimate(
            step,
            np.ptp(ends, axis=0) / 2,
            0.0,
            weight * (residual - slopes @ step),
            weight,
            slopes,
            rounded=True,
        )
    change, noise = _likeliest(basis, residual, resolution)
    score, weight = _readings(residual - basis @ change, resolution, noise)[1:]
    curved = basis.T @ (weight[:, None] * basis)
    curved = np.linalg.inv(curved + np.eye(len(change)) * (1e-12 * np.trace(curved) + NEXT_TO_ZERO))
    many = max(np.sum(weight) ** 2 / np.sum(weight**2) - len(change) - 1, 1.0)
    # The curvature and the scores themselves are two estimates of the same variance, of which the
    # larger is taken.
    squares = inverse @ curved @ (basis.T @ (score[:, None] ** 2 * basis)) @ curved @ inverse.T
    square = np.maximum(np.diag(inverse @ curved @ inverse.T), np.diag(squares))
    half = np.sqrt(square * (1 + (len(change) + 1) / many)) * stdtrit(many, 0.975)
    wider = _coloured(inverse, curved, basis, weight, score)
    half = half if wider is None else np.maximum(half, wider)
    return Estimate(inverse @ change, half, noise, score, weight, slopes)


def _polytope(basis, residual, resolution, aims):
    """The least and the largest of `aims @ change` with all readings within half a step, `(2,
    aims)`; None if none is so."""
    unit = np.sqrt(len(residual))
    A = basis * unit
    b = residual / resolution
    numbers = basis.shape[1]
    active = np.unique(np.linspace(0, len(b) - 1, min(len(b), 10 * CONSTRAINTS_ADDED)).astype(int))
    least = np.append(np.zeros(numbers), 1.0)
    change, active = _lowest(least, A, b, active, 0.0)  # from which the worst reading is least off
    if change[-1] > 0.5 + READING_SLACK:
        return None
    ends = np.empty((2, len(aims)))
    for place in np.ndindex(ends.shape):
        aim = aims[place[1]]
        cost = np.append((1, -1)[place[0]] * aim / np.linalg.norm(aim), 0.0)
        change, active = _lowest(cost, A, b, active, 0.5 + READING_SLACK)
        ends[place] = aim @ change[:-1] * unit * resolution
    return ends if np.isfinite(ends).all() else None


def _lowest(cost, A, b, active, bound):
    """The change, and a distance e, of the lowest cost with |b - A change| <= bound + e in each
    row; e is 0 if it is free.

    Constraints are added as they are broken. Returns their rows as well.
    """
    bounds = [(-1e4, 1e4)] * A.shape[1] + [(0.0, None if cost[-1] else 0.0)]
    while True:
        rows = A[active]
        wide = np.ones(len(active))
        upper = np.concatenate([np.c_[rows, -wide], np.c_[-rows, -wide]])
        done = linprog(
            cost, upper, np.concatenate([bound + b[active], bound - b[active]]), bounds=bounds
        ).x
        if done is None:  # HiGHS failed
            return np.full(len(cost), np.inf), active
        off = np.abs(b - A @ done[:-1]) - bound - done[-1]
        new = np.argpartition(off, -min(CONSTRAINTS_ADDED, len(off)))[-CONSTRAINTS_ADDED:]
        new = np.setdiff1d(new[off[new] > 1e-6], active)
        if not len(new):
            return done, active
        active = np.concatenate([active, new])


def _likeliest(basis, residual, resolution):
    """The likeliest change, and the deviation of the white noise (m)."""
    change = basis.T @ residual
    remaining = residual - basis @ change
    square = remaining @ remaining / (len(remaining) - len(change))
    if square >= (SMOOTH**2 + 1 / 12) * resolution**2:
        return change, float(np.sqrt(square - resolution**2 / 12))
    every = -(-len(remaining) // SEARCHED)
    few = basis[::every]
    residual_part = residual[::every]
    best = change

    def unlikely(logarithm):
        nonlocal best
        best, value = _climbed(few, residual_part, resolution, np.exp(logarithm) * resolution, best)
        return -value

    noise = (
        float(
            np.exp(
                minimize_scalar(unlikely, bounds=NOISE, method="bounded", options={"xatol": 0.05}).x
            )
        )
        * resolution
    )
    return _climbed(basis, residual, resolution, noise, best)[0], noise


def _climbed(basis, residual, resolution, noise, change):
    """The likeliest change for a noise, from another one, by Newton's method, and the logarithm
    of its likelihood."""
    value, score, weight = _readings(residual - basis @ change, resolution, noise)
    for _ in range(MOST_NEWTON_STEPS):
        curved = basis.T @ (weight[:, None] * basis)
        curved += np.eye(len(change)) * (1e-9 * np.trace(curved) + NEXT_TO_ZERO)
        step = np.linalg.solve(curved, basis.T @ score)
        for _ in range(MOST_NEWTON_STEPS):
            after = _readings(residual - basis @ (change + step), resolution, noise)
            if after[0].sum() >= value.sum():
                break
            step = step / 2
        change = change + step
        gain = after[0].sum() - value.sum()
        value, score, weight = after
        if gain < 1e-6:
            break
    return change, float(value.sum())


def _readings(residual, resolution, noise):
    """Logarithm of the likelihood of residuals, and minus its first and second derivatives,
    `(rows,)` each."""
    if noise > SMOOTH * resolution:
        square = noise**2 + resolution**2 / 12
        return -(residual**2) / (2 * square), residual / square, np.full(len(residual), 1 / square)
    near = (np.abs(residual) - resolution / 2) / noise
    far = (np.abs(residual) + resolution / 2) / noise
    above = log_ndtr(-near)
    beyond = log_ndtr(-far)
    value = above + np.log1p(-np.exp(beyond - above))
    near_share, two = (
        np.exp(-(place**2) / 2 - value) / np.sqrt(2 * np.pi) for place in (near, far)
    )
    score = (near_share - two) / noise
    return value, np.sign(residual) * score, score**2 + (far * two - near * near_share) / noise**2


def _autoregression(series):
    """Polynomials and powers of the innovations of autoregressions, `(series, order + 1)` and
    `(series,)`.

    Burg's method (Burg 1975) goes up to the largest order; of each series the order with the least
    BIC is taken.
    """
    count, rows = series.shape
    highest_order = min(30, rows // 15)  # order, at most, and 15 rows for each order, at least
    past = np.eye(1, highest_order + 1).repeat(count, axis=0)
    power = np.mean(series**2, axis=1)
    ahead = series[:, 1:]
    behind = series[:, :-1]
    best = rows * np.log(power)
    past_kept = past.copy()
    powers = power.copy()
    for order in range(1, highest_order + 1):
        mirror = -2 * np.sum(ahead * behind, axis=1) / np.sum(ahead**2 + behind**2, axis=1)
        past[:, : order + 1] += mirror[:, None] * past[:, order::-1]
        power = power * (1 - mirror**2)
        ahead, behind = (
            (ahead + mirror[:, None] * behind)[:, 1:],
            (behind + mirror[:, None] * ahead)[:, :-1],
        )
        bic = rows * np.log(power) + order * np.log(rows)
        better = bic < best
        best = np.where(better, bic, best)
        powers = np.where(better, power, powers)
        past_kept[better] = past[better]
    return past_kept[:, : np.flatnonzero(np.any(past_kept, axis=0))[-1] + 1], powers


def _coloured(inverse, curved, basis, weight, score):
    """Half the widths of the intervals if the score is an autoregression; None if it is white."""
    (rows, numbers), (past, power) = basis.shape, _autoregression(score[None])
    if past.shape[1] == 1:
        return None
    lean = inverse @ curved
    size = 1 << (2 * rows - 1).bit_length()
    spectra = (
        np.stack([np.abs(np.fft.rfft(basis @ direction, size)) ** 2 for direction in lean], axis=1)
        / size
    )
    spectra[1:-1] *= 2

    def deviations(past, power):
        spectrum = (power * rows / (rows - numbers))[:, None] / np.abs(np.fft.rfft(past, size)) ** 2
        return np.sqrt(spectrum @ spectra), spectrum[:, 0]

    deviation, slow = deviations(past, power)
    if rows > 5000:  # rows up to which logs are drawn
        many = max(rows * min(1.0, float(np.mean(score**2) / slow[0])) - numbers, 1.0)
        return deviation[0] * np.sqrt(1 + numbers / many) * stdtrit(many, 0.975)
    drawn = lfilter(
        np.sqrt(power), past[0], np.random.default_rng(0).standard_normal((DRAWS, WARM + rows))
    )[:, WARM:]
    scores = drawn @ basis
    other_deviations = deviations(*_autoregression(drawn - weight * (scores @ curved @ basis.T)))[0]
    odds = np.sort(np.abs(scores @ lean.T) / np.maximum(other_deviations, NEXT_TO_ZERO), axis=0)
    return deviation[0] * np.maximum(
        odds[int(np.ceil(0.95 * (DRAWS + 1))) - 1], stdtrit(np.inf, 0.975)
    )
