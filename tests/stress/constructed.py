"""Columns that are hard on purpose: next to a double crossing, or to one that reaches the end of the circle.

The boundary polynomial is `P_0 - y P_1` in cos(theta), y the other wall parameter, so two crossings merge at the
critical points of `y = P_0/P_1`, and one reaches z = +-1 where y has that value there. Both are known to all digits.
"""

import numpy as np
from flint import acb, arb, ctx
from stress.specs import Question, feeble, long_filters, spread, usual
from support import balls, certified


def question(seed) -> Question:
    """Three columns about one such point, at relative distances from 1e-2 to 1e-16."""
    r = np.random.default_rng(seed)
    while True:
        values = (usual, usual, feeble, long_filters)[int(r.integers(4))](r)
        along = str(r.choice(["K_VE", "K_VE", "B_VE"]))
        limits = (1e9, 1e4) if along == "K_VE" else (1e4, 1e9)
        points = [(y, k) for y, k in _points(values, along) if 1e-6 < y < limits[1] and -1e-3 < k < limits[0]]
        if points:
            fixed, value = points[int(r.integers(len(points)))]
            signs = r.choice([-1, 1], 3)
            columns = tuple(float(fixed * (1 + s * spread(r, 1e-16, 1e-2))) for s in signs)
            return Question(values, along, _span(r, value, limits[0]), columns)


def _span(r, value, limit):
    """The usual one, the widest, or one that ends next to the crossing."""
    choice = int(r.integers(4))
    if choice == 0 or not 1e-6 < value < limit / 2:
        return (0.0, max(limit * 10.0 ** -float(r.integers(0, 5)), 1.01 * value))
    if choice == 1:
        return (0.0, limit)
    low, high = (float(value * (1 + s * spread(r, 1e-12, 0.1))) for s in (-1, 1))
    return (0.0, high) if choice == 2 else (low, high)


def _points(values, along):
    """(the other wall parameter, the wall parameter) where crossings merge or reach an end, as floats."""
    ctx.prec = 1024
    frame = balls.frame(values)
    if max(abs(x) for row in frame.A.tolist() for x in row) > 1e30:
        return []
    polynomials = frame.polynomials()
    shape = certified.structure(values, along, False)
    pairs = [[certified.divided(p, 1, shape.common) for p in certified.open_wall(polynomials, along, y)] for y in (0.0, 1.0)]
    (p, q), (p_one, _) = pairs
    p_slope = p_one - p
    P, slope = (
        certified.divided(
            certified.divided(certified.boundary(part, q), 1, shape.boundary_at_one), -1, shape.boundary_at_minus_one
        )
        for part in (p, p_slope)
    )
    try:
        places = certified.real_roots(P.derivative() * slope - P * slope.derivative())
    except certified.Undecided:
        places = []
    found = []
    for x in [*places, arb(1), arb(-1)]:
        y, z = -P(x) / slope(x), acb(x, (1 - x * x).nonnegative_part().sqrt())
        k = ((p(z) + p_slope(z) * y) / q(z)).real
        if y.is_finite() and k.is_finite():
            found.append((float(y.mid()), float(k.mid())))
    return found
