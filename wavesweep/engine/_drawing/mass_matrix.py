"""The block type `mass_matrix`: its matrices as they are at its axes, for numbers of every kind.

With `J = through` a mass m of further coordinates, such as joints and links, is `J' m J` at the
axes.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any

MATRICES = ("mass", "damping", "stiffness")
MASS = ("mass", "through")  # the keys that the mass at the axes depends on
MOST_AXES = 3  # a plant with more is one of type ss

Rows = list[list[Any]]


def at_axes(keys: Mapping[str, Any], name: str) -> Rows:
    """Return one of the matrices at the axes, `J' m J`; a single row of m is its diagonal."""
    J = keys["through"]
    m: Rows = keys[name]
    n = len(keys["axes"])
    if not m:
        return [[0] * n for _ in range(n)]
    if len(m) == 1 < len(m[0]):
        m = _diagonal(m[0])
    if not J:
        return m
    return _product([list(column) for column in zip(*J, strict=True)], _product(m, J))


def _diagonal(entries: Sequence[Any]) -> Rows:
    rows = []
    for i, entry in enumerate(entries):
        row = [0] * len(entries)
        row[i] = entry
        rows.append(row)
    return rows


def _product(left: Rows, right: Rows) -> Rows:
    columns = list(zip(*right, strict=True))
    product = []
    for row in left:
        product.append([sum(map(operator.mul, row, column)) for column in columns])
    return product


def determinant(rows: Rows, sign: int = -1) -> Any:
    """Return the determinant; with sign 1 the permanent, which is the size of its terms if the
    entries are sizes."""
    if not rows:
        return 1
    total = 0
    for i, row in enumerate(rows):
        total = total + sign**i * row[0] * determinant(_without(rows, i, 0), sign)
    return total


def adjugate(rows: Rows, sign: int = -1) -> Rows:
    """Return the inverse times the determinant; with sign 1 the sizes of its terms."""
    n = range(len(rows))
    adjugate_rows = []
    for p in n:
        adjugate_rows.append([sign ** (p + q) * determinant(_without(rows, q, p), sign) for q in n])
    return adjugate_rows


def _without(rows: Rows, i: int, j: int) -> Rows:
    """The matrix without a row and a column."""
    return [[*row[:j], *row[j + 1 :]] for row in (*rows[:i], *rows[i + 1 :])]


def is_mass(keys: Mapping[str, Any], *entries: Any) -> Any:
    """Return whether the mass matrix is symmetric, and positive definite at the axes; entries:
    of MASS, in order."""
    remaining = iter(entries)
    matrices = {name: [[next(remaining) for _ in row] for row in keys[name]] for name in MASS}
    m = matrices["mass"]
    good = []
    for i in range(len(m)):
        for j in range(i):
            a = m[i][j]
            b = m[j][i]
            # Relative: entries of a symmetric matrix.
            good.append(abs(a - b) <= 1e-12 * (abs(a) + abs(b)))
    M = at_axes({**keys, **matrices}, "mass")
    for n in range(1, len(M) + 1):
        leading = [row[:n] for row in M[:n]]
        good.append(determinant(leading) > 0)
    return reduce(operator.and_, good)


def _has_shape(rows: Sequence[Sequence[Any]], height: int, width: int) -> bool:
    """Whether a matrix has as many rows, and each of them as many numbers."""
    return len(rows) == height and all(len(row) == width for row in rows)


def shape_fault(keys: Mapping[str, Any]) -> tuple[str, str, str] | None:
    """Return key, expected and found text if the matrices do not fit together."""
    n = len(keys["axes"])
    if not 1 <= n <= MOST_AXES:
        return "axes", f"1 to {MOST_AXES} names; a plant with more is one of type ss", f"{n}"
    ports = keys["axes"], [f"v{name}" for name in keys["axes"]]
    if clash := set(ports[0]).intersection(ports[1]):
        name = min(clash)
        return "axes", "names of which none is v and another one, as outputs are called", repr(name)
    many = len(keys["through"]) or n
    for name in ("through", *MATRICES):
        rows = keys[name]
        shapes = [(many, n)] if name == "through" else [(many, many), (1, many)]
        if (rows or name == "mass") and not any(_has_shape(rows, *shape) for shape in shapes):
            expected = " or ".join(f"{h} row{'s' * (h > 1)} of {w} numbers" for h, w in shapes)
            widths = ", ".join(dict.fromkeys(str(len(row)) for row in rows)) or "0"
            return name, expected, f"{len(rows)} of {widths}"
    return None
