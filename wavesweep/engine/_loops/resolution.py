"""Whether the numbers of a loop are resolved on a box: polynomials of a small degree, but for next
to nothing.

Proofs take a function of some numbers from its values at nodes and on the rims of ellipses. Such
samples say nothing about a peak, a pole or a kink that is narrower than they are apart. A loop is
built from expressions, and the rest of it (matrix exponentials, products of ticks) has no narrow
features of its own; so each expression f that reads one of the numbers p is enclosed in balls on a
larger ellipse about p, of which the sum of the semi-axes is R half widths, with the other numbers
anywhere in the box. If it is analytic there and within M of its value c in the middle, the terms of
its Chebyshev series beyond the degree N add up to at most

    2 M (rho/R)^(N + 1) / (1 - rho/R)

on an ellipse of rho half widths, and to rho^-(N + 1) of that at real values (L. N. Trefethen,
Approximation Theory and Approximation Practice, theorem 8.1). A box in which this is not a small
part of how much f changes has to be divided.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing, name_of, scalars
from wavesweep.engine._drawing.expressions import (
    FUNCTIONS,
    ONE,
    SharedParts,
    cancelled,
    constants_of,
    degree,
    evaluate,
    is_constant,
    named,
    names_in,
)
from wavesweep.engine._drawing.mass_matrix import MASS, at_axes, determinant
from wavesweep.engine._loops.domain import divisors

# sum of the semi-axes of the largest ellipse on which functions of the numbers are sampled, in half
# widths
RHO = 4.25
LARGER = 6.0, 9.0  # the same of the ellipses on which expressions are enclosed, one after the other
RIM_DEGREE = 16  # N, as many as there are samples on a rim
# part of the change of an expression that the rest of its series may be on the rim of RHO
REST_OF_SERIES = 0.3
NO_CHANGE = 1e-10  # of the expression itself, what counts as no change
PARTS = 400  # of a box, in which extremes of an expression are looked for
STEPS_TO_EXTREME = 60  # steps towards an extreme
DEEPEST_RECTANGLE = 3  # times that a rectangle is halved both ways before an ellipse is given up
COST = 1  # points of a loop that take as long as the balls of one rectangle
RIM_PLACES = np.exp(1j * np.pi * (np.arange(RIM_DEGREE // 2) + 0.5) / (RIM_DEGREE // 2))
RIM_PLACES = np.concatenate(
    [(RHO * RIM_PLACES + 1 / (RHO * RIM_PLACES)) / 2, [-1.0, -0.5, 0.0, 0.5, 1.0]]
)


@dataclass(frozen=True, slots=True)
class Side:
    """A side t of a box: the number with this path is `offset + scale exp(t)`, or t itself if scale
    is 0.

    No expression reads the number without a path.
    """

    path: str = ""
    offset: float = 0.0
    scale: float = 0.0


class Resolution:
    """The expressions of a loop as functions of the sides of boxes.

    drawing, values: of one loop, flat. sides: of the boxes. used: what was computed so far, in
    points of a loop.
    """

    def __init__(self, drawing: Drawing, values: Mapping[str, Any], sides: Sequence[Side]) -> None:
        self.sides, self.used = sides, 0
        names = tuple(side.path and name_of(side.path) for side in sides)
        numbers = {name: v for name, v in scalars(values).items() if v is not None}
        bent = expressions(drawing, names, any(side.scale for side in sides))
        self.parts = [_BoxedExpression(expression, names, sides, numbers) for expression in bent]

    def unresolved(self, box: np.ndarray) -> np.ndarray:
        """Return along which sides a box `(2, sides)` may have to be divided before it is
        resolved, a mask `(sides,)`."""
        along = np.zeros(len(self.sides), bool)
        for expression in self.parts:
            before = expression.used
            along |= expression.unresolved(box)
            self.used += COST * (expression.used - before)
        return along

    def extremes(self, box: np.ndarray) -> np.ndarray:
        """Return points of a box, `(points, sides)`, at which an expression is about least or
        largest: members to try first.

        The box is divided until it is resolved, in up to PARTS parts, and each part is looked at in
        a few points; expressions of more than three sides are not looked at.
        """
        extremes = [np.zeros((0, len(self.sides)))]
        for expression in self.parts:
            wide = [at for at in expression.bent if box[0, at] < box[1, at]]
            if not 0 < len(wide) <= 3:
                continue
            queue, points = [box], []
            while queue and len(points) < PARTS:
                piece = queue.pop(0)
                if (unresolved := expression.unresolved(piece)).any():
                    queue += halves(piece, to_divide(unresolved, piece, box))
                shares = np.array(
                    list(product(*[np.linspace(0, 1, 9 if len(wide) < 3 else 5)] * len(wide)))
                )
                places = np.repeat(piece.mean(0)[None], len(shares), 0)
                places[:, wide] = piece[0, wide] + shares * np.ptp(piece, 0)[wide]
                points.append(places)
            points = np.concatenate(points)
            value = expression.values(points)
            for sign in (-1, 1) if np.isfinite(value).any() else ():
                at = points[np.argmax(np.where(np.isfinite(value), sign * value, -np.inf))]
                extremes.append(expression.climbed(at, box, wide, sign)[None])
        return np.unique(np.concatenate(extremes), axis=0)


def halves(box: np.ndarray, side: int) -> list[np.ndarray]:
    """Return the halves of a box along a side."""
    lower, upper = box.copy(), box.copy()
    lower[1, side] = upper[0, side] = box[:, side].mean()
    return [lower, upper]


def to_divide(unresolved: np.ndarray, box: np.ndarray, whole: np.ndarray) -> int:
    """Return the side along which a box is divided: of those that are not resolved the widest,
    relative to the whole box."""
    share = np.ptp(box, 0) / np.where(np.ptp(whole, 0) > 0, np.ptp(whole, 0), 1.0)
    return int(np.argmax(np.where(unresolved, share, -1.0)))


class ResolvedAlong:
    """Where the expressions of the loops of a batch are resolved, along one of their numbers.

    drawing, values: flat numbers, or arrays over the loops. path: of the number.
    """

    def __init__(self, drawing: Drawing, values: Mapping[str, Any], path: str) -> None:
        self.loops, self.path, self.known = (drawing, values), path, {}
        read = {
            name
            for expression in expressions(drawing, (name_of(path),), logarithmic=True)
            for name in expression.reads
        }
        self.none = not read
        self.varied = [
            key for key, v in values.items() if np.ndim(v) and key != path and name_of(key) in read
        ]

    def __call__(
        self,
        column: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
        offset: float = 0.0,
        scale: float = 0.0,
    ) -> np.ndarray:
        """Whether they are, for loops `column` and sides (see `Side`) from low to high, `(n,)`
        all."""
        if self.none:
            return np.ones(column.size, bool)
        (drawing, values), resolved = self.loops, []
        for at, *ends in zip(column.tolist(), low.tolist(), high.tolist(), strict=True):
            loop_values = {key: float(values[key][at]) for key in self.varied}
            key = (offset, scale, *loop_values.values())
            if key not in self.known:
                single = {name: v for name, v in values.items() if not np.ndim(v)}
                self.known[key] = Resolution(
                    drawing, {**single, **loop_values}, [Side(self.path, offset, scale)]
                )
            resolved.append(not self.known[key].unresolved(np.array(ends)[:, None]).any())
        return np.array(resolved, bool)


@dataclass(frozen=True, slots=True)
class Expression:
    """An expression that is not a polynomial of a small degree in some numbers.

    value(numbers, library, watch): see `evaluate`. reads: the names of the numbers. bent: those
    among the names asked about in which it is no such polynomial.
    """

    value: Callable[..., Any]
    reads: frozenset[str]
    constants: frozenset[float]
    bent: tuple[str, ...]


@lru_cache(maxsize=256)
def expressions(
    drawing: Drawing, names: tuple[str, ...], logarithmic: bool = False
) -> tuple[Expression, ...]:
    """Return the expressions of a drawing that are no polynomials of a small degree in these
    numbers: its numbers and 1 over its divisors. logarithmic: whether sides are logarithms of
    numbers, of which powers change faster."""
    most, names_asked = 4 if logarithmic else RIM_DEGREE, {name for name in names if name}
    trees = {cancelled(tree): None for _, tree in drawing.trees()}
    plain = dict.fromkeys(
        guard
        for _, guard in divisors(drawing)
        if len({*dict(names_in(guard))}) > 1 or not _is_affine(guard, names_asked)
    )
    trees |= {("/", ONE, guard, 0): None for guard in plain}
    bent_expressions = []
    for tree in trees:
        reads = frozenset(name for name, _ in names_in(tree))
        if bent := tuple(sorted(name for name in reads & names_asked if degree(tree, name) > most)):
            bent_expressions.append(
                Expression(partial(evaluate, named(tree)), reads, constants_of(tree), bent)
            )
    return (*bent_expressions, *_masses(drawing, names_asked))


def _is_affine(guard, names_asked):
    return all(degree(guard, name) <= 1 for name in names_asked)


def _masses(drawing, names_asked) -> Iterator[Expression]:
    """Yield 1 over the determinant of each mass matrix at its axes."""
    for block in drawing.blocks:
        if block.type != "mass_matrix":
            continue
        keys = dict(block.keys)
        matrices = {name: [[named(tree) for tree in row] for row in keys[name]] for name in MASS}
        trees = [tree for name in MASS for row in keys[name] for tree in row]
        reads = frozenset(name for tree in trees for name, _ in names_in(tree))
        if reads & names_asked:
            constants = frozenset().union(*map(constants_of, trees))
            yield Expression(
                partial(_inverse_mass, keys, matrices),
                reads,
                constants,
                tuple(sorted(reads & names_asked)),
            )


def _inverse_mass(keys, matrices, numbers, library, watch=None):
    """1 over the determinant of a mass matrix at its axes. matrices: trees of the keys that it
    is made of."""
    shared = SharedParts()
    entries = {
        name: [[evaluate(tree, numbers, library, watch, shared) for tree in row] for row in rows]
        for name, rows in matrices.items()
    }
    return 1 / determinant(at_axes({**keys, **entries}, "mass"))


class _NotAnalyticError(Exception):
    """A ball meets a branch cut."""


class _BoxedExpression:
    """An expression of a loop on boxes of some sides."""

    def __init__(self, expression: Expression, names, sides, known) -> None:
        self.expression, self.used = expression, 0
        self.own = [at for at, name in enumerate(names) if name in expression.reads]
        self.bent = [at for at, name in enumerate(names) if name in expression.bent]
        self.names, self.sides, self.shown = names, sides, np.zeros((0, 2, len(self.own)))
        unswept = expression.reads - {names[at] for at in self.own}
        self.known = {name: float(known[name]) for name in unswept} | {
            constant: constant for constant in expression.constants
        }

    def unresolved(self, box):
        """See `Resolution`: all sides along which the expression is bent, since it may be too
        large for any of them."""
        along, own_box = np.zeros(len(self.sides), bool), box[:, self.own]
        wide = [at for at in self.bent if box[0, at] < box[1, at]]
        # The ellipse about a part is within that about the whole.
        if (
            not wide
            or ((self.shown[:, 0] <= own_box[0]) & (own_box[1] <= self.shown[:, 1])).all(-1).any()
        ):
            return along
        if self._resolved(box, wide):
            self.shown = np.concatenate([self.shown, own_box[None]])
        else:
            along[wide] = True
        return along

    def _resolved(self, box, wide):
        middle, half = box.mean(0), (box[1] - box[0]) / 2
        centre, change = self._samples(middle, half, wide)
        if not np.isfinite(change):
            return False
        return all(self._is_small(at, middle, half, centre, change) for at in wide)

    def values(self, points):
        """The values at points, real or complex, `(points,)`."""
        numbers = dict(self.known)
        with np.errstate(all="ignore"):
            for at in self.own:
                side = self.sides[at]
                numbers[self.names[at]] = (
                    side.offset + side.scale * np.exp(points[:, at])
                    if side.scale
                    else points[:, at]
                )
            return np.broadcast_to(np.asarray(self.expression.value(numbers, np)), (len(points),))

    def climbed(self, at, box, wide, sign):
        """A point near another one at which the value, times the sign, is larger, as far as
        steps along the sides lead."""
        step = np.ptp(box, 0)[wide] / 16
        for _ in range(STEPS_TO_EXTREME):
            near = np.repeat(at[None], 1 + 2 * len(wide), 0)
            near[1:, wide] += np.concatenate([np.diag(step), -np.diag(step)])
            near = np.clip(near, *box)
            best = np.argmax(np.nan_to_num(sign * self.values(near), nan=-np.inf))
            at, step = near[best], step if best else step / 2
        return at

    def _samples(self, middle, half, wide):
        """The value in the middle, and the largest difference from it at places about each side,
        with others at three each."""
        wide_sides = [at for at in self.own if half[at] > 0]
        points = []
        for at in wide:
            rest = [side for side in wide_sides if side != at]
            for shares in (
                product((-1.0, 0.0, 1.0), repeat=len(rest))
                if len(rest) < 4
                else [(0.0,) * len(rest)]
            ):
                places = np.repeat(middle[None].astype(complex), RIM_PLACES.size, 0)
                places[:, rest] += np.array(shares) * half[rest]
                places[:, at] += half[at] * RIM_PLACES
                points.append(places)
        value = self.values(np.concatenate([middle[None].astype(complex), *points]))
        with np.errstate(all="ignore"):
            return value[0], np.abs(value - value[0]).max()

    def _is_small(self, at, middle, half, centre, change):
        """Whether the rest of the series along a side is small for one of the larger ellipses."""
        from flint import acb, arb

        allowed = REST_OF_SERIES * change + NO_CHANGE * abs(centre)
        for larger in LARGER:
            ratio = RHO / larger
            most = arb(float(allowed)) * float((1 - ratio) / (2 * ratio ** (RIM_DEGREE + 1)))
            if self._within(at, larger, most, middle, half, acb(complex(centre))):
                return True
        return False

    def _within(self, at, larger, most, middle, half, centre):
        """Whether an expression is analytic on an ellipse about a side, and within so much of its
        centre.

        The upper half of the ellipse is covered with rectangles; the lower half is its mirror
        image.
        """
        from flint import acb

        across, up = (larger + 1 / larger) / 2, (larger - 1 / larger) / 2
        balls = {name: acb(v) for name, v in self.known.items()}
        for side in self.own:
            balls[self.names[side]] = self._number(
                side, acb(_span(middle[side], half[side], -1.0, 1.0))
            )
        queue = [(-across, across, 0.0, up, 0)]
        while queue:
            left, right, bottom, top, depth = queue.pop()
            if (max(left, -right, 0.0) / across) ** 2 + (bottom / up) ** 2 > 1:
                continue
            self.used += 1
            real, imag = _span(middle[at], half[at], left, right), _span(0.0, half[at], bottom, top)
            balls[self.names[at]] = self._number(at, acb(real, imag))
            try:
                ball = acb(self.expression.value(balls, _library(), _watch)) - centre
                good = ball.is_finite() and ball.abs_upper() <= most
            except (_NotAnalyticError, ZeroDivisionError, OverflowError):
                good = False
            if good:
                continue
            if depth == DEEPEST_RECTANGLE:
                return False
            x, y = (left + right) / 2, (bottom + top) / 2
            quarters = product(((left, x), (x, right)), ((bottom, y), (y, top)))
            queue += [(*across_x, *across_y, depth + 1) for across_x, across_y in quarters]
        return True

    def _number(self, at, ball):
        side = self.sides[at]
        return ball.exp() * side.scale + side.offset if side.scale else ball


def _span(middle, half, low, high):
    """A ball with all real numbers from `middle + low half` to `middle + high half`."""
    from flint import arb

    centre, half = arb(float(middle)), arb(float(half))
    return (centre + half * float(low)).union(centre + half * float(high))


@lru_cache(maxsize=1)
def _library():
    """Functions whose balls are not finite where they meet a cut."""
    from flint import acb

    def root(ball):  # that of 0 everywhere is 0
        return ball if ball.is_zero() else ball.sqrt(analytic=True)

    functions = {name: getattr(acb, name) for name in FUNCTIONS}
    return SimpleNamespace(**functions | {"sqrt": root, "log": partial(acb.log, analytic=True)})


def _watch(tree, base, exponent, value):
    """Refuse a power that is not whole and whose base meets the cut of its logarithm."""
    del value
    is_whole = tree[0] != "**" or (is_constant(tree[2]) and float(exponent).is_integer())
    if not (is_whole or base.is_zero() or base.real > 0 or not base.imag.contains(0)):
        raise _NotAnalyticError
