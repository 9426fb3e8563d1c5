"""The characteristic polynomials of a drawn loop as polynomials in one of its numbers too, with
proved errors.

The frame falls apart into components that do not feed back to each other, each with a polynomial of
its own. Multiplied by the determinants of the algebraic loops, their coefficients are polynomials
in a number that only gains read; then some values of it give them exactly. Otherwise they are
interpolated on parts of the range, and the error follows from a bound on an ellipse around the part
(L. N. Trefethen, Approximation Theory and Approximation Practice, theorem 8.2).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, comb, inf, log2
from typing import Any

import numpy as np
from flint import acb, arb, arb_mat, arb_poly, ctx

from wavesweep.engine.drawing import Plant
from wavesweep.engine.expressions import Tree
from wavesweep.engine.frames import blocks_of
from wavesweep.prove.ticks import BallLoop, UndecidedError, reads

ELLIPSE = 4  # sum of the semi-axes of the ellipse, in half widths of the part
# share of the bits that are kept: a term that is smaller counts as part of the error
BITS_KEPT = 0.6
STRUCTURE = 0.5  # share of the bits that have to vanish of a factor z - 1


@dataclass(frozen=True, slots=True)
class FamilyPart:
    """A part of the range, from its low to its high end, with a polynomial per component.

    Row j of a matrix has the Bernstein coefficients of that of z^j on the part. A polynomial of
    degree 0 stands for the determinants of the algebraic loops: where it is 0 there is no loop.
    """

    low: arb
    high: arb
    polynomials: tuple[arb_mat, ...]


class BallFamily:
    """The characteristic polynomials of a loop on a range of the number.

    loop: along its number. span: (low, high). budget: a counter of operations, see `Budget`.
    """

    def __init__(self, loop: BallLoop, span: tuple[float, float], budget: Budget) -> None:
        self.loop = loop
        self.span = span
        self.budget = budget
        low, high = map(arb, span)
        places = loop.pattern(low.union(high))
        self.parts = []
        for indices in blocks_of(places):
            feeds_back = places[np.ix_(indices, indices)].any()
            if feeds_back:
                self.parts.append(indices.tolist())
        self.size = len(places)
        self.degree = _degree(loop)
        self.bent = any(_branches(tree, loop) for _, tree in loop.drawing.trees())
        self.ones = [0] * (len(self.parts) + self.exact)

    @property
    def exact(self) -> bool:
        """Whether the coefficients are polynomials in the number of a degree that is known and
        small."""
        # Degrees in the number, up to which the polynomials are taken as such.
        return self.degree <= 64

    def at(self, number: Any, *, times: bool = False) -> list[list[Any]]:
        """The coefficients of each component's polynomial at a value; times: multiplied by the
        determinants of the loops."""
        self.budget.use(self.loop.ticks.bit_length() * self.size**3 + 500 * self.size)
        frame, pivot = self.loop.frame(number)
        matrix = type(frame)
        polynomials = []
        for indices in self.parts:
            component = matrix([[frame[i, j] for j in indices] for i in indices])
            characteristic = component.charpoly()
            coefficients = [characteristic[j] for j in range(len(indices) + 1)]
            if times:
                coefficients = [c * pivot for c in coefficients]
            polynomials.append(coefficients)
        if self.exact:
            polynomials.append([pivot])
        return polynomials

    def find_ones(self) -> int:
        """Count the eigenvalues that are 1 for every value of the number, by digits that vanish
        at two precisions."""
        low, high = map(arb, self.span)
        bits = ctx.prec
        counts = []
        for share, times in ((0.381966, 1), (0.618034, 2)):
            ctx.prec = times * bits
            try:
                counts.append([_ones(p) for p in self.at((low + (high - low) * share).mid())])
            finally:
                ctx.prec = bits
        if counts[0] != counts[1]:
            raise UndecidedError
        self.ones = counts[0]
        return sum(self.ones)

    def plain(self, number: arb) -> list[list[arb]]:
        """The coefficients at a value, without the eigenvalues that are always 1."""
        return [
            _without_ones(p, times) for p, times in zip(self.at(number), self.ones, strict=True)
        ]

    def over_range(self) -> Iterator[FamilyPart]:
        """Yield the parts of the range in order."""
        open_ = [tuple(map(arb, self.span))]
        count = 0
        while open_:
            low, high = open_.pop()
            count += 1
            if count > 400 or (not self.exact and self.bent):  # parts of the range
                raise UndecidedError
            errors = [0] * len(self.ones) if self.exact else self._errors(low, high)
            if errors is None:
                middle = ((low + high) / 2).mid()
                open_ += [(middle, high), (low, middle)]
                continue
            yield FamilyPart(low, high, tuple(self._interpolated(low, high, errors)))

    def _errors(self, low, high):
        """Bounds on errors of each component's coefficients, and the nodes; None if the part is
        too long for few of them."""
        middle = (low + high) / 2
        half = (high - low) / 2
        across = half * (ELLIPSE + arb(1) / ELLIPSE) / 2  # semi-axes of the ellipse
        up = half * (ELLIPSE - arb(1) / ELLIPSE) / 2
        around = acb(middle + arb(0, across.upper()), arb(0, up.upper()))
        bounds = self.at(around)
        sizes = self.at(middle.mid())
        for polynomial in (*bounds, *sizes):
            if not all(c.is_finite() for c in polynomial):
                return None
        most_bits = 0.0
        for bound, size in zip(bounds, sizes, strict=True):
            largest = max(abs(c).upper() for c in size)
            ratio = max((abs(c).upper() / largest).upper() for c in bound)
            if not ratio < arb(2) ** (ctx.prec // 2):
                return None
            most_bits = max(most_bits, log2(float(ratio)) if ratio > 1 else 0.0)
        nodes = ceil((most_bits + ctx.prec * BITS_KEPT) / log2(ELLIPSE)) + 3
        # theorem 8.2: 4 M rho^-n/(rho - 1)
        share = arb(4) / (ELLIPSE - 1) / arb(ELLIPSE) ** (nodes - 1)
        errors = []
        for bound in bounds:
            errors.append(([abs(c).upper() * share for c in bound], nodes))
        return errors

    def _interpolated(self, low, high, errors):
        nodes = self.degree + 1 if self.exact else errors[0][1]
        # the second for `_to_bernstein`, kept or not
        # 30 operations for each pair of an interpolant's nodes.
        self.budget.use(30 * nodes**2 + nodes**3 / 4)
        points, weights = _nodes(nodes, ctx.prec)
        values = [
            self.at((low + high) / 2 + (high - low) / 2 * point, times=self.exact)
            for point in points
        ]
        for number, (times, error) in enumerate(zip(self.ones, errors, strict=True)):
            at_nodes = [value[number] for value in values]
            of_coefficients = [[c.real for c in column] for column in zip(*at_nodes, strict=True)]
            in_chebyshev = arb_mat(of_coefficients) * weights
            rows = _trimmed(in_chebyshev.tolist(), error[0] if error else None)
            yield arb_mat(_without_ones_rows(rows, times)) * _to_bernstein(len(rows[0]), ctx.prec)


class Budget:
    """A number of operations that may still be used, which does not depend on the speed of the
    machine."""

    def __init__(self, left: float) -> None:
        self.left = left

    def use(self, operations: float) -> None:
        """Use some of them. Errors: UndecidedError if none are left."""
        self.left -= operations
        if self.left < 0:
            raise UndecidedError


def _degree(loop: BallLoop) -> float:
    """A bound on the degree in the number of the frame's polynomial times the determinants;
    infinite if it is not one.

    Each equation of a tick, of a port, an output or a state, adds the degree of its factors.
    """
    number = loop.number
    if reads(loop.drawing.tick_hz, number):
        return inf

    def largest(trees):
        return max((tree.degree(number) for tree in trees), default=0)

    of_wires = {port: largest(gain for _, gain in terms) for port, terms in loop.wires.items()}
    of_blocks = []
    for block in loop.blocks:
        of_ports = sum(of_wires.get(f"{block.name}.{port}", 0) for port in block.ports[0])
        of_blocks.append(of_ports + _degree_of_block(block, number, largest))
    total = 0
    for running in loop.kinds:
        total += sum(of_blocks[at] for at in running)
    return total if total == inf else int(total)


def _degree_of_block(block, number, largest) -> float:
    """That of what a block does in a tick; largest: gives the largest degree of several trees."""
    kind = "" if isinstance(block, Plant) else block.type
    keys = dict(block.keys) if kind else {}
    if kind == "gain":
        return keys["k"].degree(number)
    if kind == "ss" and keys["discrete"]:  # rows side by side have the larger degree of both
        return sum(largest(row) for name in "ABCD" for row in keys[name])
    if kind == "tf" and keys["discrete"] and not any(reads(tree, number) for tree in keys["den"]):
        return largest(keys["num"])
    if any(reads(tree, number) for _, tree in block.trees()):
        return inf
    return 0


def _branches(tree: Tree, loop: BallLoop) -> bool:
    """Whether a tree that reads the number of a loop has a power with another than a whole
    exponent, which is not analytic everywhere."""
    exponent = tree.whole_exponent(loop.values, loop.number)
    if tree.operation == "**" and reads(tree, loop.number) and np.isnan(exponent):
        return True
    return any(_branches(branch, loop) for branch in tree.operands)


def _ones(p):
    """How many times z - 1 divides a polynomial, if it does for all that the bits tell."""
    size = sum((abs(c) for c in p), arb(0))
    least = size * arb(2) ** (-ctx.prec * STRUCTURE)
    count = 0
    shifted = arb_poly(p)(arb_poly([1, 1])).coeffs()
    while count < len(shifted) - 1 and shifted[count].contains(0):
        if not abs(shifted[count]).upper() < least:
            raise UndecidedError
        count += 1
    return count


def _without_ones(p, times):
    return [row[0] for row in _without_ones_rows([[c] for c in p], times)]


def _without_ones_rows(rows, times):
    """Rows of coefficients of a polynomial divided by (z - 1)^times; the remainder is known to
    be 0."""
    for _ in range(times):
        lowest, *higher = rows
        carried = [arb(0)] * len(lowest)
        quotient = []
        for row in reversed(higher):
            carried = [a + b for a, b in zip(carried, row, strict=True)]
            quotient.append(carried)
        remainder = [a + b for a, b in zip(carried, lowest, strict=True)]
        if not all(c.contains(0) for c in remainder):
            raise UndecidedError
        rows = quotient[::-1]
    return rows


def _trimmed(rows, errors):
    """Rows of Chebyshev coefficients, of which the last ones that are nothing beside the largest
    are taken for errors.

    errors: bounds on those of the rows on (-1, 1), None without any. As `|T_k| <= 1` there, a bound
    on what a row lacks is a radius of its first coefficient.
    """
    largest = max(abs(c).mid() for row in rows for c in row)
    least = arb(2) ** (-ctx.prec * BITS_KEPT) * largest
    kept_count = 1
    for row in rows:
        for i, c in enumerate(row):
            if not abs(c).upper() <= least:  # one that is not a number is kept
                kept_count = max(kept_count, 1 + i)
    trimmed = []
    for j, row in enumerate(rows):
        error = sum((abs(c).upper() for c in row[kept_count:]), errors[j] if errors else arb(0))
        trimmed.append([row[0] + arb(0, error.upper()), *row[1:kept_count]])
    return trimmed


@lru_cache(maxsize=64)
def _nodes(count, bits):
    """Chebyshev points on (-1, 1), and the matrix from values at them to Chebyshev coefficients;
    bits: the precision."""
    del bits
    angles = [arb.pi() * (2 * i + 1) / (2 * count) for i in range(count)]
    points = [angle.cos() for angle in angles]
    weights = []
    for angle in angles:
        means = [(angle * k).cos() * 2 / count for k in range(1, count)]
        weights.append([arb(1) / count, *means])
    return points, arb_mat(weights)


@lru_cache(maxsize=256)
def _to_bernstein(count, bits):
    """The matrix from Chebyshev coefficients on (-1, 1) to as many Bernstein coefficients; bits:
    the precision."""
    del bits
    return bernstein(chebyshev(count, 1), count - 1)


def chebyshev(count: int, slope: int, constant: int = 0) -> list[list[int]]:
    """Coefficients in t of polynomials p_k(2t - 1): p_0 = 1, p_1 = slope x + constant, p_k = 2x
    p_(k-1) - p_(k-2)."""
    basis = [[1], [constant - slope, 2 * slope]]
    while len(basis) < count:
        last, before_last = basis[-1], basis[-2]
        basis.append(
            [
                4 * a - 2 * b - c
                for a, b, c in zip([0, *last], [*last, 0], [*before_last, 0, 0], strict=True)
            ]
        )
    return basis[:count]


def bernstein(polynomials: list[list[int]], n: int) -> arb_mat:
    """Bernstein coefficients of degree n on (0, 1), a row for each polynomial, from its
    coefficients in t."""
    bits = ctx.prec
    ctx.prec = bits + 6 * n  # integers up to 6^n cancel
    try:
        powers = [[arb(comb(i, j)) / comb(n, j) for i in range(n + 1)] for j in range(n + 1)]
        return arb_mat([p + [0] * (n + 1 - len(p)) for p in polynomials]) * arb_mat(powers)
    finally:
        ctx.prec = bits
