"""D-decomposition by hand: the stability boundary sampled over the unit circle, its crossings refined by a secant.

The textbook's way, and the nearest to this tool's. It proves nothing: two crossings between neighbouring angles are missed
together, and nothing in its answer tells.
"""

from __future__ import annotations

import numpy as np

from wavesweep.bench.points import is_stable
from wavesweep.bench.problems import Bundle, bundles
from wavesweep.bench.scoring import Answer
from wavesweep.lifted import Cut, close
from wavesweep.lifted.circle import on_circle
from wavesweep.lifted.cut import ADVANCE, OFFSET, V
from wavesweep.spec import Spec

STEPS = 30  # of the secant at the most; six or seven are usual
CLOSE = 1e-11  # relative: a step this short leaves nothing to do for another


def decomposed(spec: Spec, angles: int) -> Answer:
    """All stable intervals of every column; angles: how many, evenly over the upper half of the circle."""
    stop = next(axis.stop for axis in spec.sweep if axis.name == "K_VE")
    theta = np.pi * (np.arange(angles) + 0.5) / angles
    parts = [_labelled(part, stop, *_crossings(part, theta)) for part in bundles(spec)]
    return Answer(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _terms(cut: Cut, w) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(one, x, v) of `one = K_VE x + B_VE v` at `z = 1 + w`: 1, G_x and G_v, all times w in a loop that drifts."""
    state = np.linalg.solve(w[..., None, None] * np.eye(cut.E.shape[-1]) - cut.E, cut.B + 0 * w[..., None, None])
    G = (cut.C @ state + cut.D)[..., 0]
    if not cut.integrates:
        return np.ones(G.shape[:-1]), G[..., OFFSET], G[..., V]
    return w + 0 * G[..., V], G[..., ADVANCE] + w * G[..., OFFSET], w * G[..., V]


def _crossings(part: Bundle, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(row, K_VE) where `K = (one - B_VE v)/x` is real: changes of sign between angles, refined, and z = 1 and z = -1."""
    one, x, v = (term[part.owner] for term in _terms(part.loops.at((slice(None), None)), on_circle(theta)[None]))
    apart = _imaginary(one - part.B_VE[:, None] * v, x)
    row, at = np.nonzero(np.signbit(apart[:, 1:]) != np.signbit(apart[:, :-1]))
    own, B = part.loops.at(part.owner[row]), part.B_VE[row]

    def wall(angle):
        one, x, v = _terms(own, on_circle(angle))
        return one - B * v, x

    angle = _secant(lambda angle: _imaginary(*wall(angle)), (theta[at], theta[at + 1]), (apart[row, at], apart[row, at + 1]))
    over, under = wall(angle)
    rows, values = [row], [(over / under).real]
    for w in (0.0, -2.0):
        one, x, v = (term[part.owner] for term in _terms(part.loops, np.full(part.loops.batch, w)))
        with np.errstate(divide="ignore", invalid="ignore"):
            values.append((one - part.B_VE * v) / x)
        rows.append(np.arange(part.column.size))
    return np.concatenate(rows), np.concatenate(values)


def _imaginary(over, under):
    """Imaginary part of the quotient times `|under|^2`, which has no pole where `under` vanishes."""
    return over.imag * under.real - over.real * under.imag


def _secant(function, ends, values):
    """Zeros within the brackets `ends`, all at once, by a secant that keeps its bracket (Anderson and Bjorck's)."""
    (a, b), (f_a, f_b) = ends, values
    for _ in range(STEPS):
        c = np.where(f_b == 0, b, b - f_b * (b - a) / (f_b - f_a))
        moved, f_c = np.abs(c - b), function(c)
        past = np.signbit(f_c) != np.signbit(f_b)  # the zero lies between c and b
        left = 1 - f_c / np.where(f_b == 0, 1.0, f_b)
        a, f_a = np.where(past, b, a), np.where(past, f_b, f_a * np.where(left > 0, left, 0.5))
        b, f_b = c, f_c
        if not np.any(moved > CLOSE * b):
            break
    return b


def _labelled(part: Bundle, stop: float, row, value) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(column, low, high) of the stable runs between the crossings, by one call for the eigenvalues in their middles."""
    inside = (value > 0) & (value < stop)
    every = np.arange(part.column.size)
    rows = np.concatenate([row[inside], every, every])
    marks = np.concatenate([value[inside], np.zeros(every.size), np.full(every.size, stop)])
    order = np.lexsort((marks, rows))
    rows, marks = rows[order], marks[order]
    of = rows[1:][np.diff(rows) == 0]
    low, high = marks[:-1][np.diff(rows) == 0], marks[1:][np.diff(rows) == 0]
    stable = is_stable(close(part.loops.at(part.owner[of]), (low + high) / 2, part.B_VE[of]))
    joined = stable[1:] & stable[:-1] & (np.diff(of) == 0)
    first, last = stable & ~np.append(False, joined), stable & ~np.append(joined, False)
    return part.column[of[first]], low[first], high[last]
