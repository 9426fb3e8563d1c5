"""Proofs that analytic functions of one or two numbers are positive all over a box of these.

On a box with the middle c and half widths h let f be analytic for x = c + h t, |t_i| <= RADIUS, and P the
part of its power series of degree DEGREE or less in each t_i. f - P vanishes to that degree along each
line through the middle, so by Schwarz's lemma

    |f(t) - P(t)| <= RADIUS^-(DEGREE + 1) max |f - P| on the circles |t_i| = RADIUS,   |t_i| <= 1,

and P is a convex combination of its Bernstein coefficients. So f is positive where these are beyond that
remainder; else the box is halved. f is computed in CIRCLE points of each circle: bounds are sampled.
"""

from collections.abc import Callable
from functools import lru_cache
from itertools import product
from math import comb
from typing import NamedTuple, Protocol

import numpy as np

from wavesweep.engine.doubles import EPS

RADIUS = 2.0  # of the circles, in half widths: so far expressions are resolved, see `Resolution`
DEGREE = 7
CIRCLE = 16  # points of a circle
SAFE = 1.5  # on the largest value at points of the circles, for those between
LOGARITHMIC_FROM = (
    3.0  # ratio of the ends of a number, from which on it is halved at their geometric mean
)
AT_ONCE = 4000  # points that are computed together

Box = np.ndarray
"""Low and high ends of some numbers, `(2, numbers)`."""


class FunctionValues(NamedTuple):
    """Values of functions, `(functions, n)`: phase, logarithm of the size, and relative error in
    units of EPS.

    pivots: `(n, k)`, see `Frames`.
    """

    phase: np.ndarray
    log: np.ndarray
    error: np.ndarray
    pivots: np.ndarray


class Functions(Protocol):
    """Functions of the numbers of a box, real at real points and analytic within the bounds."""

    def units(self, middle: np.ndarray) -> np.ndarray:
        """What makes values near a point well known; `values` is given it."""

    def values(self, x: np.ndarray, units: np.ndarray) -> FunctionValues:
        """Values at points `(n, numbers)`, real or complex."""


class Cover(NamedTuple):
    """What is known of a box: the parts that are not proved, `(parts, 2, numbers)`, and points at which a
    function is surely negative, `(points, numbers)`."""

    open: np.ndarray
    negative: np.ndarray


class _Series(NamedTuple):
    """Power series in so many numbers from values on circles.

    t: the points, `(points, numbers)`, of which the conjugates are left out. terms: from values there to
    coefficients, of which the real part is taken, `(terms, points)`. at_points: back to values there,
    `(points, terms)`. bernstein: from coefficients to those of Bernstein's polynomials on [-1, 1],
    `(controls, terms)`.
    """

    t: np.ndarray
    terms: np.ndarray
    at_points: np.ndarray
    bernstein: np.ndarray


@lru_cache
def _series(numbers: int) -> _Series:
    circle = RADIUS * np.exp(2j * np.pi * (np.arange(CIRCLE) + 0.5) / CIRCLE)
    t = np.array([*product(circle[: CIRCLE // 2], *[circle] * (numbers - 1))])
    degrees = range(DEGREE + 1)
    at_points = (t[:, None, :] ** np.array([*product(degrees, repeat=numbers)])).prod(-1)
    # t^i = (2 s - 1)^i = sum_j comb(i, j) (2 s)^j (-1)^(i - j), s^j = sum_k comb(k, j)/comb(n, j) B_k(s)
    of_s = np.array([[comb(i, j) * 2.0**j * (-1.0) ** (i - j) for i in degrees] for j in degrees])
    alone = np.array([[comb(k, j) / comb(DEGREE, j) for j in degrees] for k in degrees]) @ of_s
    bernstein = np.ones((1, 1))
    for _ in range(numbers):
        bernstein = np.kron(bernstein, alone)
    return _Series(t, 1 / at_points.T / len(t), at_points, bernstein)


def _is_inside(ends: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Whether the disc of RADIUS half lengths about the middle of each range is within limits, or it is a
    point; ends: `(boxes, 2)`."""
    low, high = ends.T
    reach = RADIUS * (high - low) / 2
    middle = (low + high) / 2
    return (low == high) | (middle - reach >= limits[0]) & (middle + reach <= limits[1])


def positive(
    functions: Functions,
    box: Box,
    limits: tuple[float, float],
    resolved: Callable[[float, float], bool],
    most_points: int,
) -> Cover:
    """Prove that functions are positive on a box; a number whose two ends are equal does not vary.

    limits: of the first number, beyond which they are not analytic. resolved: whether they have no narrow
    features between two values of it. most_points: points to compute at most.
    """
    box = np.asarray(box, float)
    wide = np.flatnonzero(box[0] < box[1])
    per_box = 1 + len(_series(wide.size).t)
    units = functions.units(box.mean(0))
    queue = [box]
    used = 0
    while queue and used < most_points:
        together = max(1, AT_ONCE // per_box)
        boxes = np.array(queue[:together])
        queue = queue[together:]
        inside = _is_inside(boxes[..., 0], limits)
        inside[inside] = [resolved(*ends) for ends in boxes[inside][..., 0].tolist()]
        for ends in boxes[~inside]:
            queue += _halves(ends, 0)
        boxes = boxes[inside]
        if not len(boxes):
            continue
        used += per_box * len(boxes)
        with np.errstate(all="ignore"):
            judged = _judged(functions, units, boxes, wide)
        if judged.negative.any():
            return Cover(np.array([*queue, *boxes]), boxes.mean(1)[judged.negative])
        for index in np.flatnonzero(~judged.positive):
            queue += _halves(boxes[index], wide[judged.number[index]])
    return Cover(np.array(queue).reshape(-1, *box.shape), np.zeros((0, box.shape[1])))


class _Judged(NamedTuple):
    """Whether functions are positive all over each box, whether one is surely not in its middle, and which
    of the wide numbers to halve."""

    positive: np.ndarray
    negative: np.ndarray
    number: np.ndarray


def _judged(
    functions: Functions, units: np.ndarray, boxes: np.ndarray, wide: np.ndarray
) -> _Judged:
    """What polynomials on boxes prove, by their Bernstein coefficients; wide: numbers that vary."""
    series = _series(wide.size)
    t = series.t
    half = (boxes[:, 1] - boxes[:, 0]) / 2
    points = np.repeat(boxes.mean(1)[:, None], 1 + len(t), 1).astype(complex)
    points[:, 1:, wide] += half[:, None, wide] * t
    sampled = functions.values(points.reshape(-1, points.shape[-1]), units)
    phase, log, error = (entries.reshape(-1, *points.shape[:2]) for entries in sampled[:3])
    pivots = sampled.pivots.reshape(*points.shape[:2], -1)

    negative = (phase[..., 0].real < 0) & (EPS * error[..., 0] < 1)
    finite = np.isfinite(log).all((0, 2)) & np.isfinite(pivots).all((1, 2))
    # Divided by an exponential of t, so that a polynomial follows them more easily.
    log = np.where(finite[:, None], log - log[..., :1], 0.0)
    trend = 2 * (log[..., 1:] @ t.conj()).real / len(t) / RADIUS**2
    value = phase[..., 1:] * np.exp(log[..., 1:] - trend @ t.T)
    terms = (value @ series.terms.T).real
    beyond = np.abs(value - terms @ series.at_points.T)
    rest = RADIUS ** -(DEGREE + 1.0) * beyond.max(-1) + np.abs(1 - terms[..., 0])
    noise = EPS * (error[..., 1:] * np.abs(value)).max(-1)
    controls = terms @ series.bernstein.T
    proved = (controls.min(-1) > SAFE * rest + noise).all(0)

    # Of a pivot without zeros the logarithm is analytic too.
    ratio = pivots[:, 1:] / pivots[:, :1]
    slopes = np.einsum("npk,pi->nik", np.log(ratio), t.conj()).real / len(t) / RADIUS**2
    turned = np.abs(ratio * np.exp(-t @ slopes) - 1).max((1, 2), initial=0.0)
    regular = SAFE * turned < 1
    in_numbers = controls.reshape(*controls.shape[:2], *[DEGREE + 1] * wide.size)
    changes = []
    for number in range(wide.size):
        steps = np.abs(np.diff(in_numbers, axis=2 + number))
        of_terms = steps.reshape(*controls.shape[:2], -1).max((0, 2))
        of_pivots = np.nan_to_num(np.abs(slopes[:, number]).max(-1, initial=0.0), nan=1.0)
        changes.append(np.where(regular, of_terms, of_pivots))
    return _Judged(finite & regular & proved, np.any(negative, 0), np.argmax(changes, axis=0))


def _halves(box: np.ndarray, number: int) -> list[np.ndarray]:
    """The halves of a box along a number, in the logarithm if its ends differ by much."""
    low, high = box[:, number]
    middle = (low + high) / 2
    if high > LOGARITHMIC_FROM * low > 0:
        middle = np.sqrt(low * high)
    lower = box.copy()
    lower[1, number] = middle
    upper = box.copy()
    upper[0, number] = middle
    return [lower, upper]
