"""Crossings by adaptive arcs: slower than one polynomial, and good where the poles crowd at several scales."""

import numpy as np

from wavesweep.analysis.intervals.crossings import Crossings, at_both_ends
from wavesweep.analysis.intervals.isolate import isolate
from wavesweep.analysis.intervals.polish import polish
from wavesweep.lifted.circle import on_circle, solve
from wavesweep.lifted.cut import Cut, open_in

NODES, KEPT = 20, 14  # samples per arc; the Chebyshev coefficients from KEPT on must have decayed and bound the error
DECAYED = 1e-9
OVERLAP = 1.07  # arcs reach a little into their neighbours, so that no root stays on an edge for ever
SMALLEST = 1e-9  # rad; an arc this small that proves nothing is given up
MANY = 256  # so many open arcs of one column, and the column is given up
DEGREES = (1, 2, 4, 7, 10, KEPT)  # an interpolant is cut to each of these in turn, what is cut away added to its error


def arc_crossings(cut: Cut, along: str, fixed) -> Crossings:
    """Crossings of a few columns (loops `cut`, one per column), from Chebyshev interpolants on arcs of the circle.

    On each arc the boundary equation, freed of its poles and of its zeros at z = +-1, is interpolated at NODES points of
    state space; an arc is bisected until the interpolant has decayed and `isolate` proves its roots for every function
    within the error bound, or until it is too small: then the column is not complete.
    """
    opened = open_in(cut, along, fixed)
    poles = np.linalg.eigvals(opened[0]).astype(complex)
    column, low, high = _first_arcs(fixed.size)
    complete, found = np.isfinite(cut.E).all((-1, -2)), []
    while column.size:
        middle, half = (low + high) / 2, OVERLAP * (high - low) / 2
        coefficients, noise, decayed = _interpolant([part[column] for part in opened], poles[column], middle, half)
        good = np.zeros(column.size, bool)
        for rows, roots in _trimmed_roots(coefficients, noise):
            good[rows] = decayed[rows]
            at, which = np.nonzero(roots.inside & good[rows, None])
            arc = rows[at]
            found.append((column[arc], middle[arc] + half[arc] * roots.value[at, which], roots.slope_sign[at, which]))
        hopeless = ~good & ((high - low < SMALLEST) | (np.abs(coefficients).max(-1) <= noise))
        complete[column[hopeless]] = False
        column, low, high = _halves(column, low, high, ~good & complete[column])
        complete[np.bincount(column, minlength=fixed.size) > MANY] = False
    return _collect(cut, along, fixed, opened, complete, found)


def _first_arcs(columns):
    edges = np.linspace(0, np.pi, 5)
    return np.repeat(np.arange(columns), 4), np.tile(edges[:-1], columns), np.tile(edges[1:], columns)


def _trimmed_roots(coefficients, noise):
    """Proved roots of the interpolants, as (rows, Roots) pairs; each row is tried at the lowest degree first.

    High coefficients that have decayed to rounding would leave the discs without a leading coefficient to stand on.
    """
    weight = np.arange(1, KEPT + 1) * np.abs(coefficients)
    rows = np.arange(noise.size)
    for degree in DEGREES:
        bound = noise[rows] + weight[rows, degree:].sum(-1)
        roots = isolate(coefficients[rows, :degree], bound)
        yield rows[roots.proved], roots.rows(roots.proved)
        rows = rows[~roots.proved]


def _halves(column, low, high, split):
    column, low, high = column[split], low[split], high[split]
    cut_at = low + 0.48 * (high - low)  # not the middle, where symmetric loops put their roots
    return np.tile(column, 2), np.concatenate([low, cut_at]), np.concatenate([cut_at, high])


def _boundary(opened, theta):
    """`Im K / sin(theta)` times |H|^2, H = 1/K, and the size of what was added up for it.

    `Im H(z) = -sin(theta) C (conj(w) I - E)^-1 (w I - E)^-1 B`, by the resolvent identity: nothing cancels, not even
    where the circle meets the real axis.
    """
    E, B, C = opened
    A = on_circle(theta)[..., None, None] * np.eye(E.shape[-1]) - E
    right = solve(A, B + 0 * A[..., :1])[..., 0]
    left = solve(np.swapaxes(A.conj(), -1, -2), np.swapaxes(C, -1, -2) + 0 * A[..., :1])[..., 0]
    return (left * right).sum(-1).real, np.abs(left * right).sum(-1)


def _interpolant(opened, poles, middle, half):
    """Second-kind Chebyshev coefficients `(arcs, KEPT)` on each arc, their error bound, and whether they decayed."""
    node = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    theta = middle[:, None] + half[:, None] * node
    value, size = _boundary([part[:, None] for part in opened], theta)
    distance = np.abs(on_circle(theta)[..., None] - poles[:, None, :])
    nearest = np.abs(on_circle(middle)[:, None] - poles)[:, None, :] + half[:, None, None]
    weight = np.prod((distance / nearest) ** 2, axis=-1)
    value, size = value * weight, size * weight
    first_kind = value @ np.cos(np.outer(np.arange(NODES), np.arccos(node))).T * (2 / NODES)
    first_kind[:, 0] /= 2
    largest = np.abs(first_kind).max(-1)
    tail = np.abs(first_kind[:, KEPT:]).max(-1)
    floor = 4 * NODES * np.finfo(float).eps * size.max(-1)
    second = first_kind[:, :KEPT] / 2
    second[:, 0] *= 2
    second[:, :-2] -= first_kind[:, 2:KEPT] / 2
    return second, NODES * (8 * tail + floor), tail <= np.maximum(DECAYED * largest, floor)


def _collect(cut, along, fixed, opened, complete, found):
    """Polish, drop what overlapping arcs found twice, and add z = 1 and -1."""
    column = np.concatenate([c for c, _, _ in found])
    seed = np.concatenate([t for _, t, _ in found])
    jump = np.concatenate([2.0 * s for _, _, s in found])
    inside = (seed > 0) & (seed < np.pi)
    column, seed, jump = column[inside], seed[inside], jump[inside]
    theta, value, converged = polish(cut.at(column), along, fixed[column], seed)
    complete[column[~converged | (np.abs(theta - seed) > 1e-3 * np.minimum(seed, np.pi - seed))]] = False
    order = np.lexsort((theta, column))
    column, theta, value, jump = column[order], theta[order], value[order], jump[order]
    new = np.ones(column.size, bool)
    close_by = np.diff(theta) <= 1e-9 * np.minimum(theta[1:], np.pi - theta[1:])
    new[1:] = (np.diff(column) != 0) | ~close_by
    column, theta, value, jump = column[new], theta[new], value[new], jump[new]
    first, last = np.full(fixed.size, np.pi), np.zeros(fixed.size)
    np.minimum.at(first, column, theta)
    np.maximum.at(last, column, theta)
    at_one, at_minus_one = (np.sign(_boundary(opened, a)[0]) for a in (first / 2, (np.pi + last) / 2))
    ends = at_both_ends(cut, along, fixed, at_one, at_minus_one)
    return Crossings(*(np.concatenate(pair) for pair in zip((column, value, theta, jump), ends, strict=True)), complete)
