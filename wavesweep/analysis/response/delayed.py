"""Linear systems of frames with long delays, solved without the states that only pass values on."""

import numpy as np

from wavesweep.analysis.response.bordered import error_of, inverted
from wavesweep.lifted.rounding import ROUNDING
from wavesweep.lifted.shifts import DelayLines


def solved_frame(E, dE, w, g, dg) -> tuple[np.ndarray, np.ndarray]:
    """Return `X` of `(w - E) X = g`, `(points, n, k)`, and a bound on its error, entry by entry, as `bordered.solved` does.

    E, dE `(n, n)`: the frame less identity and a bound on its error. w: `(points, 1, 1)`, `z - 1` on the unit circle. g, dg:
    `(points, n, k)` or `(n, k)`.

    The system of the states that are kept is the Schur complement of that of the delayed ones, whose inverse has entries of
    size 1 and 0.
    """
    lines = DelayLines.of(E)
    k, d, z, one = lines.kept, lines.delayed, 1 + w, np.ones_like(w.real)
    g, dg = g + 0 * w, dg + 0 * one
    out, into = E[np.ix_(k, d)], E[np.ix_(d, k)]  # what the delayed states give to the others, and get from them
    of_out, of_into = np.abs(out), np.abs(into)
    own = w * np.eye(k.size) - E[np.ix_(k, k)]
    through = out @ lines.along(into + 0 * z, z)
    passed = of_out @ lines.along(of_into + 0 * one, one)
    inverse, off = inverted(own - through, ROUNDING * (1 + len(lines.levels)) * (np.abs(own) + passed))

    def residual(x, y):
        X = np.empty_like(g)
        X[:, k], X[:, d] = x, y
        left = g - w * X + E @ X
        return X, left[:, k], left[:, d]

    x, y = 0 * g[:, k], 0 * g[:, d]
    for _ in range(3):
        _, of_kept, of_delayed = residual(x, y)
        step = inverse @ (of_kept + out @ lines.along(of_delayed, z))
        x, y = x + step, y + lines.along(of_delayed + into @ step, z)
    X, *left = residual(x, y)
    size = np.abs(X)
    unsure = ROUNDING * (np.abs(w) * size + np.abs(E) @ size + np.abs(g)) + dE @ size + dg
    of_kept, of_delayed = (np.abs(part) + unsure[:, at] for part, at in zip(left, (k, d), strict=True))
    bound = np.empty_like(size)
    of_x = error_of(inverse, off, of_kept + of_out @ lines.along(of_delayed, one))
    bound[:, k], bound[:, d] = of_x, lines.along(of_delayed + of_into @ of_x, one)
    return X, bound
