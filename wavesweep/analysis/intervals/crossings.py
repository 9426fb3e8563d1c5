"""Every crossing of every column of a slice: where eigenvalues meet the unit circle as the wall changes."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.intervals.curve import K_VE, terms
from wavesweep.analysis.intervals.isolate import isolate
from wavesweep.analysis.intervals.polish import polish
from wavesweep.analysis.intervals.polynomial import Polynomial, angle
from wavesweep.lifted.cut import Cut


@dataclass(frozen=True, slots=True)
class Crossings:
    """A flat list of crossings.

    column: which column it belongs to. value: the wall parameter. theta: angle of the eigenvalue that crosses (rad per
    frame, 0 and pi included). jump: by how much the number of unstable eigenvalues grows as the value grows past it.
    complete: `(columns,)`, whether the list of that column is proved complete.
    """

    column: np.ndarray
    value: np.ndarray
    theta: np.ndarray
    jump: np.ndarray
    complete: np.ndarray


def crossings(cut: Cut, owner, along: str, fixed, span, polynomial: Polynomial) -> Crossings:
    """Crossings of the columns with the loops `cut.at(owner)` and the other wall parameter `fixed`.

    polynomial: of each loop, `(loops, ...)`.
    The eigenvalue moves outward with the sign of d Im K/d theta at an interior crossing (K analytic in z), which is the
    sign of the polynomial's derivative turned round; at z = 1 and -1 with the sign of the polynomial. Where a root may be
    at such an end itself (an undamped device crosses twice at z = 1, at K_VE = 0), the column is complete only if the wall
    parameter of that end is not inside the span.
    """
    coefficients = polynomial.base[owner] + fixed[:, None] * polynomial.slope[owner]
    n = coefficients.shape[-1]
    noise = polynomial.noise[owner, 0] + np.abs(fixed) * polynomial.noise[owner, 1]  # per coefficient; |U_k| <= k + 1
    roots = isolate(coefficients, noise * (n * (n + 1) / 2))
    column, which = np.nonzero(roots.inside)
    seed = angle(roots.value[column, which], polynomial.scale[owner[column]])
    theta, value, converged = polish(cut.at(owner[column]), along, fixed[column], seed, max(map(abs, span)))
    complete = roots.proved & np.isfinite(coefficients).all(-1)
    # A polished angle far from its seed has left the root that the proof is about.
    astray = ~(np.abs(theta - seed) <= 1e-4 * np.minimum(seed, np.pi - seed)) | ~converged
    complete[column[astray]] = False
    jump = -2.0 * roots.slope_sign[column, which]
    ends = at_both_ends(cut, owner, along, fixed, roots.at_one, roots.at_minus_one)
    complete &= ~open_inside(ends[1], span, roots.open_at_one, roots.open_at_minus_one)
    return Crossings(*(np.concatenate(pair) for pair in zip((column, value, theta, jump), ends, strict=True)), complete)


def open_inside(value, span, at_one, at_minus_one):
    """Where a crossing that may hide at an end of the circle would be inside the span; value: as from `at_both_ends`."""
    slack = 1e-9 * (span[1] - span[0])
    within = (value > span[0] + slack) & (value < span[1] - slack)
    return (np.concatenate([at_one, at_minus_one]) & within).reshape(2, -1).any(0)


def at_both_ends(cut: Cut, owner, along: str, fixed, sign_at_one, sign_at_minus_one):
    """Crossings at z = 1 and z = -1 of every column: (column, value, theta, jump); the value is infinite where there is none.

    sign_at_one, sign_at_minus_one: sign of the polynomial there, which says which way the eigenvalue goes.
    """
    values = []
    for w in (0.0, -2.0):
        if w == 0.0 and cut.integrates:
            values.append(np.full(fixed.shape, 0.0 if along == K_VE else np.inf))
            continue
        t = terms(cut, np.full(cut.batch, w))
        solved, other = t.along(along)
        with np.errstate(divide="ignore", invalid="ignore"):
            values.append((t.one[owner] - fixed * other[owner]) / solved[owner])
    return (
        np.tile(np.arange(fixed.size), 2), np.concatenate(values), np.repeat([0.0, np.pi], fixed.size),
        np.concatenate([sign_at_one, -sign_at_minus_one]),
    )
