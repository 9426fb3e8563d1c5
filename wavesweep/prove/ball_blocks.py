"""The blocks that a spec can draw, in ball arithmetic: `x+ = A x + B u`, `y = C x + D u`.

What they do is written in `_loops.definitions`; here it is put in z and not in delta form, and
plants are exact over a tick. An entry is 0 exactly if it is 0 for every number in the balls of its
keys.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flint import acb_mat, arb, arb_mat

from wavesweep.engine.blocks import Rows, running
from wavesweep.engine.blocks import continuous as definition
from wavesweep.engine.drawing import DELTA, TYPES


class BallMatrices(NamedTuple):
    """A, B, C and D of a block."""

    A: Rows
    B: Rows
    C: Rows
    D: Rows


def matrices(kind: str, T: Any, keys: dict[str, Any]) -> BallMatrices:
    """A, B, C and D of a block of a type; T: its period (s), an arb or an acb, as are the
    numbers among its keys."""
    if kind == "butterworth":
        return _butterworth(keys["order"], keys["cutoff_hz"], keys["pass"] != "low", T)  # noqa: S105 - the side that passes
    if TYPES[kind].plant:
        A, B, C, D = continuous(kind, keys)
        if keys.get("discrete"):
            return BallMatrices(_in_z(A) if keys["discrete"] == DELTA else A, B, C, D)
        return BallMatrices(*(held(A, B, T) if A else (A, B)), C, D)
    _, E, B, C, D = running(kind, T, keys, _root)
    return BallMatrices(_in_z(E), B, C, D)


def continuous(kind: str, keys: dict[str, Any]) -> BallMatrices:
    """A, B, C and D of a continuous block, `x' = A x + B u`; of a discrete one they are those of
    a run."""
    return BallMatrices(*definition(kind, keys)[1:])


def _in_z(E):
    return [[entry + int(i == j) for j, entry in enumerate(row)] for i, row in enumerate(E)]


def _root(value):
    if isinstance(value, arb):
        return value.sqrt()
    return value.sqrt(analytic=True)


def held(A, B, T):
    """A and B of a continuous block whose inputs are held over the period."""
    n, m = len(A), len(B[0])
    rows = [[type(T)(entry) * T for entry in (*a, *b)] for a, b in zip(A, B, strict=True)]
    kind = arb_mat if isinstance(T, arb) else acb_mat
    exponential = kind(rows + [[0] * (n + m) for _ in range(m)]).exp().tolist()[:n]
    return [row[:n] for row in exponential], [row[n:] for row in exponential]


def _butterworth(order, cutoff_hz, high, T):
    """Sections `(b0 + b1 z^-1 + b2 z^-2)/(1 + a1 z^-1 + a2 z^-2)` in series, from the bilinear
    transform with `w = tan(pi f T)`.

    Of a low-pass b1 = 2 b0, of a high-pass b1 = -2 b0; b2 = b0. With the section's damping
    `s = sin(pi (2 k + 1)/(2 n))` and `q = 1 + 2 s w + w^2`: b0 = w^2/q or 1/q,
    a1 = 2 (w^2 - 1)/q, a2 = (1 - 2 s w + w^2)/q. An odd order has one of the first order more.
    """
    series = BallMatrices([], [], [[]], [[1]])
    if not order:
        return series
    w = (type(T).pi() * cutoff_hz * T).tan()
    sign = -1 if high else 1
    for k in range(order // 2):
        sine = (arb.pi() * (2 * k + 1) / (2 * order)).sin()
        bottom = 1 + 2 * sine * w + w * w
        b0 = (1 if high else w * w) / bottom
        a1 = 2 * (w * w - 1) / bottom
        a2 = (1 - 2 * sine * w + w * w) / bottom
        A = [[-a1, 1], [-a2, 0]]
        B = [[2 * sign * b0 - a1 * b0], [b0 - a2 * b0]]
        series = _in_series(series, (A, B, [[1, 0]], [[b0]]))
    if order % 2:
        b0 = (1 if high else w) / (1 + w)
        a1 = (w - 1) / (1 + w)
        series = _in_series(series, ([[-a1]], [[sign * b0 - a1 * b0]], [[1]], [[b0]]))
    return series


def _in_series(first, second):
    """A block of one signal after another one."""
    A, B, C, D = first
    a, b, c, d = second
    below = [[b[i][0] * entry for entry in C[0]] + a[i] for i in range(len(a))]
    return BallMatrices(
        [row + [0] * len(a) for row in A] + below,
        B + [[row[0] * D[0][0]] for row in b],
        [[d[0][0] * entry for entry in C[0]] + c[0]],
        [[d[0][0] * D[0][0]]],
    )
