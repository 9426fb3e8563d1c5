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
from itertools import chain, product
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing, name_of, scalars
from wavesweep.engine._drawing.expressions import (
    FUNCTIONS,
    ONE,
    SharedParts,
)
from wavesweep.engine._drawing.mass_matrix import MASS, at_axes, determinant
from wavesweep.engine._loops.domain import divisors

if TYPE_CHECKING:
    from wavesweep.engine._drawing.expressions import Tree

# sum of the semi-axes of the largest ellipse on which functions of the numbers are sampled, in half
# widths
RHO = 4.25
RIM_DEGREE = 16  # N, as many as there are samples on a rim
MOST_PARTS_OF_BOX = 400  # of a box, in which extremes of an expression are looked for
MOST_SIDES = 3  # of an expression whose extremes are looked for, as places grow as a power of them


def _places_about_side() -> np.ndarray:
    """Where an expression is looked at about a side from -1 to 1: on the upper half of the ellipse
    `(rho u + 1/(rho u))/2`, |u| = 1, and at real places."""
    angles = np.pi * (np.arange(RIM_DEGREE // 2) + 0.5) / (RIM_DEGREE // 2)
    rim = RHO * np.exp(1j * angles)
    return np.concatenate([(rim + 1 / rim) / 2, [-1.0, -0.5, 0.0, 0.5, 1.0]])


PLACES_ABOUT_SIDE = _places_about_side()


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
        self.sides = sides
        self.used = 0
        names = tuple(side.path and name_of(side.path) for side in sides)
        numbers = {name: v for name, v in scalars(values).items() if v is not None}
        bent = expressions(drawing, names, any(side.scale for side in sides))
        self.parts = [_BoxedExpression(expression, names, sides, numbers) for expression in bent]

    def unresolved(self, box: np.ndarray) -> np.ndarray:
        """Return along which sides a box `(2, sides)` may have to be divided before it is
        resolved, a mask `(sides,)`."""
        sides = np.zeros(len(self.sides), bool)
        for expression in self.parts:
            before = expression.used
            sides |= expression.unresolved(box)
            self.used += expression.used - before
        return sides

    def extremes(self, box: np.ndarray) -> np.ndarray:
        """Return points of a box, `(points, sides)`, at which an expression is about least or
        largest: members to try first.

        The box is divided until it is resolved, in up to MOST_PARTS_OF_BOX parts, and each part is
        looked at in a few points; expressions of more than MOST_SIDES sides are not looked at.
        """
        extremes = [np.zeros((0, len(self.sides)))]
        for expression in self.parts:
            wide = [at for at in expression.bent if box[0, at] < box[1, at]]
            if not 0 < len(wide) <= MOST_SIDES:
                continue
            points = expression.points_in_parts(box, wide)
            value = expression.values(points)
            finite = np.isfinite(value)
            if not finite.any():
                continue
            for sign in (-1, 1):
                at = points[np.argmax(np.where(finite, sign * value, -np.inf))]
                extremes.append(expression.climbed(at, box, wide, sign)[None])
        return np.unique(np.concatenate(extremes), axis=0)


def halves(box: np.ndarray, side: int) -> list[np.ndarray]:
    """Return the halves of a box along a side."""
    middle = box[:, side].mean()
    lower = box.copy()
    lower[1, side] = middle
    upper = box.copy()
    upper[0, side] = middle
    return [lower, upper]


def to_divide(unresolved: np.ndarray, box: np.ndarray, whole: np.ndarray) -> int:
    """Return the side along which a box is divided: of those that are not resolved the widest,
    relative to the whole box."""
    width = np.ptp(whole, 0)
    share = np.ptp(box, 0) / np.where(width > 0, width, 1.0)
    return int(np.argmax(np.where(unresolved, share, -1.0)))


class ResolvedAlong:
    """Where the expressions of the loops of a batch are resolved, along one of their numbers.

    drawing, values: flat numbers, or arrays over the loops. path: of the number.
    """

    def __init__(self, drawing: Drawing, values: Mapping[str, Any], path: str) -> None:
        self.drawing = drawing
        self.values = values
        self.path = path
        self.known: dict[tuple[float, ...], Resolution] = {}
        read: set[str] = set()
        for expression in expressions(drawing, (name_of(path),), logarithmic=True):
            read |= expression.reads
        self.none = not read
        varied = [key for key, value in values.items() if np.ndim(value) and key != path]
        self.varied = [key for key in varied if name_of(key) in read]

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
        side = Side(self.path, offset, scale)
        resolved = []
        for at, *ends in zip(column.tolist(), low.tolist(), high.tolist(), strict=True):
            resolution = self._of_loop(at, side)
            resolved.append(not resolution.unresolved(np.array(ends)[:, None]).any())
        return np.array(resolved, bool)

    def _of_loop(self, at: int, side: Side) -> Resolution:
        """The resolution of one of the loops, the same for loops with the same numbers."""
        varied = {key: float(self.values[key][at]) for key in self.varied}
        key = (side.offset, side.scale, *varied.values())
        if key not in self.known:
            single = {name: value for name, value in self.values.items() if not np.ndim(value)}
            self.known[key] = Resolution(self.drawing, {**single, **varied}, [side])
        return self.known[key]


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
    # Along a logarithm powers of the number are exponentials.
    highest_degree = 4 if logarithmic else RIM_DEGREE
    names_asked = {name for name in names if name}
    trees = [tree.cancelled() for _, tree in drawing.trees()]
    for _, divisor in divisors(drawing):
        of_several = len(divisor.names) > 1
        if of_several or any(divisor.degree(name) > 1 for name in names_asked):
            trees.append(ONE / divisor)
    bent_expressions = []
    for tree in dict.fromkeys(trees):
        reads = frozenset(tree.names)
        bent = [name for name in reads & names_asked if tree.degree(name) > highest_degree]
        if bent:
            value = tree.in_names.evaluate
            expression = Expression(value, reads, tree.constants, tuple(sorted(bent)))
            bent_expressions.append(expression)
    return (*bent_expressions, *_masses(drawing, names_asked))


def _masses(drawing: Drawing, names_asked: set[str]) -> Iterator[Expression]:
    """Yield 1 over the determinant of each mass matrix at its axes."""
    for block in drawing.blocks:
        if block.type != "mass_matrix":
            continue
        keys = dict(block.keys)
        matrices = {}
        reads: set[str] = set()
        constants: set[float] = set()
        for key in MASS:
            matrices[key] = [[tree.in_names for tree in row] for row in keys[key]]
            for tree in chain.from_iterable(keys[key]):
                reads.update(tree.names)
                constants |= tree.constants
        bent = tuple(sorted(reads & names_asked))
        if bent:
            value = partial(_inverse_mass, keys, matrices)
            yield Expression(value, frozenset(reads), frozenset(constants), bent)


def _inverse_mass(
    keys: Mapping[str, Any],
    matrices: Mapping[str, list[list[Tree]]],
    numbers: Mapping[str, Any],
    library: Any,
    watch: Callable[..., Any] | None = None,
) -> Any:
    """1 over the determinant of a mass matrix at its axes. matrices: trees of the keys that it
    is made of."""
    shared = SharedParts()
    entries = {
        name: [[tree.evaluate(numbers, library, watch, shared) for tree in row] for row in rows]
        for name, rows in matrices.items()
    }
    return 1 / determinant(at_axes({**keys, **entries}, "mass"))


class _NotAnalyticError(Exception):
    """A ball meets a branch cut."""


class _BoxedExpression:
    """An expression of a loop on boxes of some sides."""

    def __init__(
        self,
        expression: Expression,
        names: tuple[str, ...],
        sides: Sequence[Side],
        known: Mapping[str, float],
    ) -> None:
        self.expression = expression
        self.names = names
        self.sides = sides
        self.used = 0
        self.read = [at for at, name in enumerate(names) if name in expression.reads]
        self.bent = [at for at, name in enumerate(names) if name in expression.bent]
        self.resolved = np.zeros((0, 2, len(self.read)))  # boxes, of the sides that it reads alone
        self.known: dict[float | str, Any] = {
            constant: constant for constant in expression.constants
        }
        for name in expression.reads - {names[at] for at in self.read}:
            self.known[name] = float(known[name])

    def unresolved(self, box: np.ndarray) -> np.ndarray:
        """Return along which sides a box may have to be divided, `(sides,)`: none if the expression
        is resolved on it, and otherwise all that are wide and in which it is bent, since any of them
        may be why it is too large on an ellipse.

        box: low and high ends, `(2, sides)`.
        """
        along = np.zeros(len(self.sides), bool)
        low, high = box
        wide = [side for side in self.bent if low[side] < high[side]]
        if not wide:
            return along
        # A part of a resolved box is resolved: its ellipse is within that about the whole.
        is_part = (self.resolved[:, 0] <= low[self.read]) & (high[self.read] <= self.resolved[:, 1])
        if is_part.all(-1).any():
            return along
        if self._is_resolved(box, wide):
            self.resolved = np.concatenate([self.resolved, box[None, :, self.read]])
        else:
            along[wide] = True
        return along

    def points_in_parts(self, box: np.ndarray, wide: list[int]) -> np.ndarray:
        """Points of a box in the parts of it that are resolved, and in those of which they are
        halves, `(points, sides)`."""
        of_each_side = np.linspace(0, 1, 9 if len(wide) < 3 else 5)
        shares = np.array(list(product(of_each_side, repeat=len(wide))))
        queue = [box]
        points: list[np.ndarray] = []
        while queue and len(points) < MOST_PARTS_OF_BOX:
            piece = queue.pop(0)
            unresolved = self.unresolved(piece)
            if unresolved.any():
                queue += halves(piece, to_divide(unresolved, piece, box))
            places = np.repeat(piece.mean(0)[None], len(shares), 0)
            places[:, wide] = piece[0, wide] + shares * np.ptp(piece, 0)[wide]
            points.append(places)
        return np.concatenate(points)

    def _is_resolved(self, box: np.ndarray, wide: list[int]) -> bool:
        """Whether the rest of the series is small along all of these sides."""
        middle = box.mean(0)
        half = (box[1] - box[0]) / 2
        centre, change = self._samples(middle, half, wide)
        if not np.isfinite(change):
            return False
        return all(self._is_small(at, middle, half, centre, change) for at in wide)

    def values(self, points: np.ndarray) -> np.ndarray:
        """The values at points, real or complex, `(points,)`."""
        numbers = dict(self.known)
        with np.errstate(all="ignore"):
            for at in self.read:
                side = self.sides[at]
                number = points[:, at]
                if side.scale:
                    number = side.offset + side.scale * np.exp(number)
                numbers[self.names[at]] = number
            value = self.expression.value(numbers, np)
        return np.broadcast_to(np.asarray(value), (len(points),))

    def climbed(self, at: np.ndarray, box: np.ndarray, wide: list[int], sign: int) -> np.ndarray:
        """A point near another one at which the value, times the sign, is larger, as far as
        steps along the sides lead."""
        step = np.ptp(box, 0)[wide] / 16
        for _ in range(60):  # steps towards an extreme
            near = np.repeat(at[None], 1 + 2 * len(wide), 0)
            near[1:, wide] += np.concatenate([np.diag(step), -np.diag(step)])
            near = np.clip(near, *box)
            best = np.argmax(np.nan_to_num(sign * self.values(near), nan=-np.inf))
            at = near[best]
            if best == 0:  # no neighbour is larger
                step = step / 2
        return at

    def _samples(
        self, middle: np.ndarray, half: np.ndarray, wide: list[int]
    ) -> tuple[complex, float]:
        """The value in the middle, and the largest difference from it at places about each side,
        with others at three each; in their middles if there are many."""
        wide_sides = [at for at in self.read if half[at] > 0]
        middle = middle[None].astype(complex)
        points = [middle]
        for at in wide:
            others = [side for side in wide_sides if side != at]
            of_each_side = (-1.0, 0.0, 1.0) if len(others) <= MOST_SIDES else (0.0,)
            for shares in product(of_each_side, repeat=len(others)):
                places = np.repeat(middle, PLACES_ABOUT_SIDE.size, 0)
                places[:, others] += np.array(shares) * half[others]
                places[:, at] += half[at] * PLACES_ABOUT_SIDE
                points.append(places)
        value = self.values(np.concatenate(points))
        with np.errstate(all="ignore"):
            return value[0], np.abs(value - value[0]).max()

    def _is_small(
        self, at: int, middle: np.ndarray, half: np.ndarray, centre: complex, change: float
    ) -> bool:
        """Whether the rest of the series along a side is small for one of the larger ellipses:
        with `2 M q^(N + 1)/(1 - q) <= allowed`, q = rho/R, it is small if the expression is within
        M of its value in the middle."""
        from flint import acb, arb

        # Part of the change of an expression that the rest of its series may be on the rim of RHO;
        # of the expression itself, what counts as no change.
        allowed = 0.3 * change + 1e-10 * abs(centre)
        balls = {name: acb(v) for name, v in self.known.items()}
        for side in self.read:
            anywhere = acb(_span(middle[side], half[side], -1.0, 1.0))
            balls[self.names[side]] = self._number(side, anywhere)
        for larger in (6.0, 9.0):  # ellipses on which expressions are enclosed, one after the other
            ratio = RHO / larger
            most = arb(float(allowed)) * float((1 - ratio) / (2 * ratio ** (RIM_DEGREE + 1)))

            def holds(rectangle: _Rectangle, most: Any = most) -> bool:
                ball = rectangle.ball(middle[at], half[at])
                balls[self.names[at]] = self._number(at, ball)
                return self._is_within(balls, acb(complex(centre)), most)

            if _holds_on_ellipse(holds, larger):
                return True
        return False

    def _is_within(self, balls: dict[float | str, Any], centre: Any, most: Any) -> bool:
        """Whether the expression is analytic in balls of its numbers, and within so much of its
        centre."""
        from flint import acb

        self.used += 1
        try:
            ball = acb(self.expression.value(balls, _library(), _watch)) - centre
        except (_NotAnalyticError, ZeroDivisionError, OverflowError):
            return False
        return ball.is_finite() and ball.abs_upper() <= most

    def _number(self, at: int, ball: Any) -> Any:
        """The number of a side from a ball of the side."""
        side = self.sides[at]
        return ball.exp() * side.scale + side.offset if side.scale else ball


class _Rectangle(NamedTuple):
    """A rectangle of the upper half plane about a side from -1 to 1, in half widths of it.

    depth: how often that about the ellipse was divided. The lower half of the ellipse is the mirror
    image of the upper one.
    """

    left: float
    right: float
    bottom: float
    top: float
    depth: int = 0

    def ball(self, middle: float, half: float) -> Any:
        """A ball with all of it, about a side of this middle and half width."""
        from flint import acb

        real = _span(middle, half, self.left, self.right)
        return acb(real, _span(0.0, half, self.bottom, self.top))

    def quarters(self) -> list[_Rectangle]:
        """The four quarters of it."""
        x = (self.left + self.right) / 2
        y = (self.bottom + self.top) / 2
        sides = product(((self.left, x), (x, self.right)), ((self.bottom, y), (y, self.top)))
        return [_Rectangle(*across, *up, self.depth + 1) for across, up in sides]


def _holds_on_ellipse(holds: Callable[..., Any], larger: float) -> bool:
    """Whether a claim holds on rectangles that cover the upper half of the ellipse whose semi-axes
    add up to `larger`."""
    across = (larger + 1 / larger) / 2
    up = (larger - 1 / larger) / 2
    queue = [_Rectangle(-across, across, 0.0, up)]
    while queue:
        rectangle = queue.pop()
        nearest = max(rectangle.left, -rectangle.right, 0.0)
        is_beyond = (nearest / across) ** 2 + (rectangle.bottom / up) ** 2 > 1
        if is_beyond or holds(rectangle):
            continue
        if rectangle.depth == 3:  # times that it is halved both ways before an ellipse is given up
            return False
        queue += rectangle.quarters()
    return True


def _span(middle: float, half: float, low: float, high: float) -> Any:
    """A ball with all real numbers from `middle + low half` to `middle + high half`."""
    from flint import arb

    centre = arb(float(middle))
    half_width = arb(float(half))
    return (centre + half_width * float(low)).union(centre + half_width * float(high))


@lru_cache(maxsize=1)
def _library() -> SimpleNamespace:
    """Functions whose balls are not finite where they meet a cut."""
    from flint import acb

    def root(ball: Any) -> Any:  # that of 0 everywhere is 0
        return ball if ball.is_zero() else ball.sqrt(analytic=True)

    functions = {name: getattr(acb, name) for name in FUNCTIONS}
    return SimpleNamespace(**functions | {"sqrt": root, "log": partial(acb.log, analytic=True)})


def _watch(tree: Tree, base: Any, exponent: Any, value: Any) -> None:
    """Refuse a power that is not whole and whose base meets the cut of its logarithm."""
    from flint import acb

    del value
    is_whole = tree.operation != "**" or acb(exponent).real.is_integer()
    if not (is_whole or base.is_zero() or base.real > 0 or not base.imag.contains(0)):
        raise _NotAnalyticError
