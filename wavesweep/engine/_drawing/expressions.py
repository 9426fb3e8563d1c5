"""Arithmetic in numbers and signals as trees: values, texts, gains of signals, and other trees in
place of names."""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

# Parts of a tree, and parts within each other, with the trees that its names stand for: a spec is
# refused before these take long or reach the recursion limit of Python.
MOST_PARTS_OF_TREE = 2000
DEEPEST_TREE = 200
FUNCTIONS = ("sqrt", "sin", "cos", "tan", "exp", "log")  # angles in rad, the natural logarithm
PREVIOUS = "prev"  # of signals: what they were before the tick
PERIOD = "dt"  # a block's own period, in its keys and in wires to it
RESERVED = ("pi", *FUNCTIONS)
NOT_RESERVED = f"and neither pi nor a function nor {PERIOD}, a block's own period"
# Rank of an operation, the ranks that its parts need, and its sign in a text.
RANKS = {
    "+": (1, (1, 2), " + "),
    "-": (1, (1, 2), " - "),
    "negative": (1, (2,), ""),
    "*": (2, (2, 3), "*"),
    "/": (2, (2, 3), "/"),
    "**": (3, (4, 3), "**"),
}
# an operation that multiplies the rounding of its first term by more than this loses digits
RAISED = 16
SUBNORMAL = sys.float_info.min  # below which doubles have fewer digits
# bits of the value, so that its rounding to a double is the only one but once in 2^57 times
BITS_OF_VALUE = 110
ROUNDED = "(rounded)"  # no number of a spec can have this name
_OPERATIONS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


class Fault(ValueError):
    """One mistake in a text: its offset there, the expected text and the text found."""

    def __init__(self, offset: int, expected: str, found: str, suggestion: str = "") -> None:
        super().__init__(f"expected {expected}, found {found}")
        self.offset = offset
        self.expected = expected
        self.found = found
        self.suggestion = suggestion


class SharedParts:
    """Values of the parts of trees at the same numbers, so that what trees have in common is
    computed once.

    Parts are known by their `id`, so the trees must outlive this. lost: where digits are lost, of
    the parts that lose any.
    """

    def __init__(self) -> None:
        self.values: dict[int, Any] = {}
        self.lost: dict[int, Any] = {}

    def lost_in(self, tree: Tree) -> list[Any]:
        """Return where digits are lost, for each part of a tree that loses any."""
        if not self.lost:
            return []
        visited = {id(tree)}
        queue = [tree]
        lost = []
        while queue:
            part = queue.pop()
            if id(part) in self.lost:
                lost.append(self.lost[id(part)])
            for operand in part.operands:
                if id(operand) not in visited:
                    visited.add(id(operand))
                    queue.append(operand)
        return lost


@dataclass(frozen=True, eq=False)
class Tree:
    """An expression in numbers and signals.

    operation: "number" or "name", whose value or name is `leaf`; or a sign of RANKS, a function, or
    "prev", of the operands. offset: in the text that it was read from.

    `+ - * /` make trees of trees and numbers; two trees are equal if they were read at the same
    offsets too, so that the texts are what tells whether they say the same.
    """

    operation: str
    operands: tuple[Tree, ...] = ()
    offset: int = 0
    leaf: Any = None

    @staticmethod
    def number(value: float, offset: int = 0) -> Tree:
        """Return the tree of a number."""
        return Tree("number", (), offset, value)

    @staticmethod
    def name(name: str, offset: int = 0) -> Tree:
        """Return the tree of the name of a number or a signal."""
        return Tree("name", (), offset, name)

    @cached_property
    def parts(self) -> tuple[Any, ...]:
        """The tree as nested tuples, which are compared and hashed without recursion of Python."""
        inner = tuple([operand.parts for operand in self.operands])
        return self.operation, inner, self.offset, self.leaf

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tree) and (self is other or self.parts == other.parts)

    def __hash__(self) -> int:
        return hash(self.parts)

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process computes anew what is remembered of a tree."""
        return Tree, (self.operation, self.operands, self.offset, self.leaf)

    def __add__(self, other: Tree) -> Tree:
        return Tree("+", (self, other))

    def __sub__(self, other: Tree) -> Tree:
        return Tree("-", (self, other))

    def __mul__(self, other: Tree) -> Tree:
        return Tree("*", (self, other))

    def __rmul__(self, factor: float) -> Tree:
        return Tree("*", (Tree.number(factor), self))

    def __truediv__(self, other: Tree | float) -> Tree:
        divisor = other if isinstance(other, Tree) else Tree.number(other)
        return Tree("/", (self, divisor))

    def __neg__(self) -> Tree:
        return Tree("negative", (self,))

    def is_number(self, value: float) -> bool:
        """Whether this is the number itself, as it is written."""
        return bool(self.operation == "number" and self.leaf == value)

    @property
    def is_leaf(self) -> bool:
        """Whether this is a number or a name."""
        return self.operation in ("number", "name")

    @property
    def is_constant(self) -> bool:
        """Whether this is a number as it is written, or the negative of one."""
        tree = self.operands[0] if self.operation == "negative" else self
        return tree.operation == "number"

    @property
    def is_given(self) -> bool:
        """Whether this is a number or a name, or the negative of one, which no rounding changes."""
        if self.operation == "negative":
            return self.operands[0].is_given
        return self.is_leaf

    @property
    def is_nothing(self) -> bool:
        """Whether this is 0 as it is written, products with 0 included."""
        if self.operation in ("+", "-"):
            return all(operand.is_nothing for operand in self.operands)
        if self.operation == "*":
            return any(operand.is_nothing for operand in self.operands)
        if self.operation in ("negative", "/"):
            return self.operands[0].is_nothing
        return self.is_number(0.0)

    @property
    def is_whole_power(self) -> bool:
        """Whether this is a power with a whole number as its exponent."""
        if self.operation != "**":
            return False
        exponent = self.operands[1]
        return bool(exponent.operation == "number" and exponent.leaf.is_integer())

    def whole_exponent(self, numbers: Mapping[str, Any], varied: str) -> Any:
        """Return the exponent of a power where it is a whole number, else NaN: of what is no power,
        and of one whose exponent reads the number that varies."""
        import numpy as np

        if self.operation != "**" or self.operands[1].reads(varied):
            return np.nan
        exponent = np.asarray(self.operands[1].values(numbers))
        return np.where(exponent == np.round(exponent), exponent, np.nan)

    @property
    def text(self) -> str:
        """A text whose tree has the same value."""
        return self.text_within(0)

    def text_within(self, least: int) -> str:
        """The text. least: rank of operations from which no parentheses are needed."""
        if self.operation == "name":
            return str(self.leaf)
        if self.operation == "number":
            return _text_of_number(self.leaf)
        if self.operation in FUNCTIONS:
            return f"{self.operation}({self.operands[0].text})"
        if self.operation in ("*", "/"):
            unsigned = self.unsigned()
            if unsigned is not None:
                return (-unsigned).text_within(least)
        if self.operation == "negative":
            unsigned = self.operands[0].unsigned()
            if unsigned is not None:
                return unsigned.text_within(least)
        rank, ranks_of_parts, sign = RANKS[self.operation]
        parts = [
            operand.text_within(rank_of_part)
            for operand, rank_of_part in zip(self.operands, ranks_of_parts, strict=True)
        ]
        text = f"-{parts[0]}" if self.operation == "negative" else sign.join(parts)
        return text if rank >= least else f"({text})"

    def unsigned(self) -> Tree | None:
        """A product or quotient without the sign of its first factor, which is left out if it is
        -1; None without one."""
        if self.operation == "negative":
            return self.operands[0]
        if self.operation not in ("*", "/"):
            return None
        first, second = self.operands
        unsigned = first.unsigned()
        if unsigned is None:
            return None
        if self.operation == "*" and unsigned.is_number(1.0):
            return second
        return Tree(self.operation, (unsigned, second), self.offset)

    def places_of_names(self) -> Iterator[tuple[str, int]]:
        """Yield each name with its offset, as often as it stands there."""
        if self.operation == "name":
            yield self.leaf, self.offset
        for operand in self.operands:
            yield from operand.places_of_names()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names, each once, in the order of the text."""
        return tuple(dict(self.places_of_names()))

    def reads(self, name: str) -> bool:
        """Return whether a name is one of these."""
        return name in self.names

    @cached_property
    def constants(self) -> frozenset[float]:
        """The constants."""
        if self.operation == "number":
            return frozenset([self.leaf])
        return frozenset().union(*(operand.constants for operand in self.operands))

    @cached_property
    def in_names(self) -> Tree:
        """The tree with a name in place of each constant, the constant itself, except for
        exponents that are constants."""
        if self.operation == "number":
            return Tree.name(self.leaf, self.offset)
        if self.operation == "**" and self.operands[1].is_constant:
            base, exponent = self.operands
            return Tree("**", (base.in_names, exponent), self.offset)
        operands = tuple(operand.in_names for operand in self.operands)
        return Tree(self.operation, operands, self.offset, self.leaf)

    def with_operands(self, operands: tuple[Tree, ...]) -> Tree:
        """Return the operation on other operands: the tree itself if none is another one, so that
        parts stay the same ones, see `SharedParts`."""
        if all(before is after for before, after in zip(self.operands, operands, strict=True)):
            return self
        return Tree(self.operation, operands, self.offset, self.leaf)

    def with_number(self, name: str, number: float) -> Tree:
        """Return the tree with a number in place of a name."""
        return self.with_trees({name: Tree.number(number)})

    def with_trees(self, meanings: Mapping[str, Tree]) -> Tree:
        """Return the tree with other trees in place of names, each at the offset of its name."""
        if self.operation == "name" and self.leaf in meanings:
            meant = meanings[self.leaf]
            return Tree(meant.operation, meant.operands, self.offset, meant.leaf)
        return self.with_operands(tuple(operand.with_trees(meanings) for operand in self.operands))

    def remembered(self, signals: set[str]) -> tuple[Tree, dict[str, str]]:
        """Return the tree with the outputs of registers in place of the signals within `prev(...)`,
        and the signal of each output.

        Errors: Fault if there is neither a signal nor 0 within the parentheses.
        """
        operands = []
        registers: dict[str, str] = {}
        for operand in self.operands:
            inner, of_operand = operand.remembered(signals)
            operands.append(inner)
            registers |= of_operand
        tree = self.with_operands(tuple(operands))
        if tree.operation != PREVIOUS:
            return tree, registers
        inner = tree.operands[0]
        read = {
            f"{PREVIOUS}({name}).y": name
            for name in inner.names
            if name in signals or name in registers
        }
        if not (read or inner.is_nothing):  # as an input of a class that is at rest
            raise Fault(tree.offset, f"a signal of a wire within {PREVIOUS}( )", "none")
        outputs = {name: Tree.name(register) for register, name in read.items()}
        return inner.with_trees(outputs), registers | read

    def extent(self, of_names: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
        """Return how many parts a tree has and how deep it is, if names stand for trees of such
        extents."""
        if self.operation == "name":
            return of_names.get(self.leaf, (1, 1))
        size = 1
        deepest = 0
        for operand in self.operands:
            size_of_operand, depth = operand.extent(of_names)
            size += size_of_operand
            deepest = max(deepest, depth)
        return size, 1 + deepest

    def check_extent(self, of_names: Mapping[str, tuple[int, int]]) -> None:
        """Raise Fault for a tree that is too large or too deep with what its names stand for."""
        size, depth = self.extent(of_names)
        if size > MOST_PARTS_OF_TREE or depth > DEEPEST_TREE:
            expected = (
                f"at most {MOST_PARTS_OF_TREE} parts, {DEEPEST_TREE} within each other, "
                "with those of its names"
            )
            raise Fault(0, expected, "more")

    def linear(self, signals: set[str]) -> Terms:
        """Return the tree as signals times gains; a gain is a tree without signals.

        Errors: Fault if the text is not linear in the signals, or has a term without a signal other
        than 0.
        """
        gains = self.gains(signals)
        rest = gains.pop("", None)
        if rest is not None and not rest.is_nothing:
            raise Fault(rest.offset, "a sum of signals times numbers", "a term without a signal")
        return tuple(gains.items())

    def gains(self, signals: set[str]) -> dict[str, Tree]:
        """The gain of each signal; that of "" is the term without a signal."""
        if self.operation == "number" or (self.operation == "name" and self.leaf not in signals):
            return {"": self}
        if self.operation == "name":
            return {self.leaf: ONE}
        of_operands = [operand.gains(signals) for operand in self.operands]
        if self.operation == "negative":
            negatives = {}
            for name, gain in of_operands[0].items():
                negatives[name] = Tree("negative", (gain,), self.offset)
            return negatives
        if self.operation in ("+", "-"):
            total = dict(of_operands[0])
            for name, gain in of_operands[1].items():
                if name in total:
                    total[name] = Tree(self.operation, (total[name], gain), self.offset)
                elif self.operation == "+":
                    total[name] = gain
                else:
                    total[name] = Tree("negative", (gain,), self.offset)
            return total
        return self._gains_of_product(of_operands)

    def _gains_of_product(self, of_operands: list[dict[str, Tree]]) -> dict[str, Tree]:
        """`gains` of an operation other than a sum."""
        first_signals = [name for name in of_operands[0] if name]
        right = [name for name in of_operands[-1] if name]
        _refuse_nonlinear(self.operation, self.offset, first_signals, right)
        if not first_signals and not right:
            return {"": self}
        if right:
            factor = of_operands[0][""]
            of_signals = of_operands[1]
        else:
            factor = of_operands[1][""]
            of_signals = of_operands[0]
        products = {}
        for name, gain in of_signals.items():
            if self.operation == "*" and gain == ONE:
                products[name] = factor
            elif self.operation == "*" and factor == ONE:
                products[name] = gain
            else:
                products[name] = Tree(self.operation, (gain, factor), self.offset)
        return products

    def singular(self) -> Iterator[tuple[Tree, Tree | None]]:
        """Yield the trees at whose zeros this one is not analytic, and the root or power that may
        still have a value there.

        These are divisors, arguments of logarithms and cosines of those of tangents, which leave
        none, arguments of roots, and bases of powers that are not whole numbers.
        """
        for operand in self.operands:
            yield from operand.singular()
        if self.operation == "/":
            yield self.operands[1], None
        elif self.operation == "log":
            yield self.operands[0], None
        elif self.operation == "tan":
            yield Tree("cos", self.operands, self.offset), None
        elif self.operation == "sqrt" or (self.operation == "**" and not self.is_whole_power):
            yield self.operands[0], self

    def degree(self, number: str) -> float:
        """Return the degree of the tree as a polynomial in a number; infinite if it is not a
        polynomial."""
        if self.is_leaf:
            return int(self.operation == "name" and self.leaf == number)
        degrees = [operand.degree(number) for operand in self.operands]
        if self.operation in ("+", "-", "negative"):
            return max(degrees)
        if self.operation == "*":
            return sum(degrees)
        if self.operation == "/" and degrees[1] == 0:
            return degrees[0]
        if self.is_whole_power:
            return float(degrees[0] * self.operands[1].leaf)
        return math.inf if any(degrees) else 0

    def cancelled(self) -> Tree:
        """Return the tree without the factors that a quotient has above and below, such as `b` of
        `(a*b)/b`."""
        tree = self.with_operands(tuple(operand.cancelled() for operand in self.operands))
        if tree.operation != "/":
            return tree
        above, below = tree.operands
        quotient = above.over(below.text)
        return tree if quotient is None else quotient

    def over(self, factor: str) -> Tree | None:
        """The tree divided by a factor, given as a text; None if it is not one of the tree."""
        if self.text == factor:
            return ONE
        if self.operation in ("negative", "+", "-"):
            quotients = []
            for operand in self.operands:
                quotient = operand.over(factor)
                if quotient is None:
                    return None
                quotients.append(quotient)
            return Tree(self.operation, tuple(quotients), self.offset)
        factors = {"*": 2, "/": 1}.get(self.operation, 0)  # operands that the factor may be one of
        for i in range(factors):
            quotient = self.operands[i].over(factor)
            if quotient is not None:
                operands = (*self.operands[:i], quotient, *self.operands[i + 1 :])
                return Tree(self.operation, operands, self.offset)
        return None

    def evaluate(
        self,
        numbers: Mapping[str, Any],
        library: Any = math,
        watch: Callable[[Tree, Any, Any, Any], None] | None = None,
        shared: SharedParts | None = None,
    ) -> Any:
        """Return the value of a tree without signals.

        numbers: name -> number, or array of numbers, real or complex. library: has the functions of
        such values, as `math` has them. watch: is called with every operation on two terms and
        every function, their values and its own. shared: of trees evaluated before, at the same
        numbers with the same library and watch. Errors: those of Python's arithmetic.
        """
        operation = self.operation
        if operation == "number":
            return self.leaf
        if operation == "name":
            return numbers[self.leaf]
        if shared is None:
            shared = SharedParts()
        key = id(self)  # what a name stands for is one part wherever it is read
        if key in shared.values:
            return shared.values[key]
        operands = self.operands
        first = operands[0].evaluate(numbers, library, watch, shared)
        second = operands[1].evaluate(numbers, library, watch, shared) if operands[1:] else None
        if operation == "negative":
            value = -first
        elif operation == "**":
            value = _power(first, second, operands[1].is_constant)
        elif operation in FUNCTIONS:
            value = getattr(library, operation)(first)
        else:
            value = _OPERATIONS[operation](first, second)
        if watch and operation != "negative":
            watch(self, first, second, value)
        shared.values[key] = value
        return value

    def lost_digits(self, first: Any, second: Any, result: Any) -> Any:
        """Return whether the operation is wrong by more than a few roundings, for each of its
        values. first, second: of its operands. result: its own."""
        operation = self.operation
        computed = [not operand.is_given for operand in self.operands]
        if operation in FUNCTIONS:  # the size of f'(x) x against that of f(x)
            change = {
                "sqrt": 0.0,
                "tan": abs(first) * (1 + abs(result * result)),
                "exp": abs(first * result),
                "log": 1.0,
            }
            return (change.get(operation, abs(first)) > RAISED * abs(result)) & computed[0]
        if operation in ("+", "-"):  # a sum of two numbers is rounded once
            # A sum below a sixteenth of its first term has lost digits.
            return (abs(result) < 1 / 16 * abs(first)) & any(computed)
        if operation == "**":
            return (abs(second) > RAISED) & computed[0]
        return (abs(result) < SUBNORMAL) & (abs(first) >= SUBNORMAL) & (abs(second) >= SUBNORMAL)

    def value(self, numbers: Mapping[str, float], shared: SharedParts | None = None) -> Any:
        """Return the value of a tree without signals, correct to a few roundings of itself, for
        numbers that are exact.

        Where digits are lost, as in sums that cancel, the value is computed again in ball
        arithmetic. shared: what is known of the parts of trees at the same numbers, to which those
        of this tree are added. Errors: those of `evaluate`.
        """
        shared = SharedParts() if shared is None else shared

        def note_lost_digits(part: Tree, *terms_and_value: Any) -> None:
            if part.lost_digits(*terms_and_value):
                shared.lost[id(part)] = True

        in_doubles = self.evaluate(numbers, watch=note_lost_digits, shared=shared)
        if not shared.lost_in(self):
            return in_doubles
        return self.exactly({name: numbers[name] for name in self.names})

    def finite_value(
        self, numbers: Mapping[str, float], shared: SharedParts | None = None
    ) -> float | None:
        """Return the value, None if there is no finite one or one of its numbers has none, as
        after a mistake."""
        # A KeyError is that of a number without a value, a TypeError that of the root of a complex
        # number.
        try:
            value = self.value(numbers, shared)
            return value if not isinstance(value, complex) and math.isfinite(value) else None
        except (ArithmeticError, KeyError, ValueError, TypeError):
            return None

    def values(self, numbers: Mapping[str, Any], shared: SharedParts | None = None) -> Any:
        """Return what `value` does, for numbers or arrays of these: each element from its own
        numbers alone. A missing value is NaN or infinite."""
        import numpy as np

        if self.is_leaf:
            return self.evaluate(numbers)
        shared = SharedParts() if shared is None else shared

        def watch(part: Tree, *values: Any) -> None:
            lost = np.asarray(part.lost_digits(*values))
            if lost.any():
                shared.lost[id(part)] = lost

        with np.errstate(all="ignore"):
            rough = self.evaluate(numbers, np, watch, shared)
        without = shared.lost_in(self)
        if not without:
            return rough
        lost = np.logical_or.reduce(np.broadcast_arrays(*without)) & np.isfinite(rough)
        return self._again(numbers, np.array(rough, order="C"), lost)

    def _again(self, numbers: Mapping[str, Any], values: Any, lost: Any) -> Any:
        """The values, those that have lost digits from ball arithmetic."""
        import numpy as np

        lost_places = np.flatnonzero(np.broadcast_to(lost, values.shape))
        columns = {}
        for name in self.names:
            columns[name] = (
                np.broadcast_to(numbers[name], values.shape).reshape(-1)[lost_places].tolist()
            )
        exact_values = []
        for row in range(lost_places.size):
            exact_values.append(
                self.exactly({name: column[row] for name, column in columns.items()})
            )
        exact = np.array(exact_values)
        if values.dtype.kind != "c" and exact.dtype.kind == "c":
            exact = np.where(exact.imag == 0, exact.real, np.nan)
        values.reshape(-1)[lost_places] = exact
        return values if values.shape else values.item()

    def rest(self, value: Any, numbers: Mapping[str, Any]) -> Any:
        """Return the part of a value of the tree that rounding has taken; 0 for a number itself,
        and for complex values."""
        import numpy as np

        if self.is_given or np.iscomplexobj(value):
            return 0.0
        return (self - Tree.name(ROUNDED)).values({**numbers, ROUNDED: value})

    def exactly(self, numbers: Mapping[str, float | complex]) -> float | complex:
        """Return the value of a tree without signals, rounded once, for numbers that are exact; NaN
        or infinite if it has no value.

        It is complex if it is not real. A part that is below 1e-320, or cannot be told from 0 with
        4096 bits, is 0.
        """
        from flint import acb, ctx

        balls: dict[Any, Any] = {constant: acb(constant) for constant in self.constants}
        balls |= {name: acb(number) for name, number in numbers.items()}
        before = ctx.prec
        try:
            # In ball arithmetic, where doubles lose digits: terms may be thirty powers of ten
            # apart. Bits, each tried if the one before leaves the value in doubt.
            for ctx.prec in (256, 1024, 4096):
                value = self.in_names.evaluate(balls, acb)
                if _is_good(value.real) and _is_good(value.imag):
                    break
        except ZeroDivisionError:
            return math.nan
        finally:
            ctx.prec = before
        real = _rounded(value.real)
        imag = _rounded(value.imag)
        return complex(real, imag) if imag else real


Terms = tuple[tuple[str, Tree], ...]  # signal -> its gain
ONE = Tree.number(1.0)


def sum_of(terms: Terms) -> str:
    """Return a sum of signals times gains as a text."""
    texts = ((gain * Tree.name(signal)).text.removeprefix("1*") for signal, gain in terms)
    return " + ".join(texts).replace("+ -", "- ")


def _text_of_number(number: float) -> str:
    if number == math.pi:
        return "pi"
    short = f"{number:g}"
    return short if float(short) == number else repr(number)


def _refuse_nonlinear(operation: str, offset: int, first: list[str], right: list[str]) -> None:
    """Raise Fault if an operation is not linear in the signals that its operands, left and
    right, read."""
    fault = {
        **dict.fromkeys(
            FUNCTIONS, first and f"{'a root' if operation == 'sqrt' else operation} of a signal"
        ),
        "**": (first or right) and "a power of a signal, or with a signal",
        "/": right and f"a division by the signal {right[0]}",
        "*": first and right and f"the product of the signals {first[0]} and {right[0]}",
    }[operation]
    if fault:
        raise Fault(offset, "arithmetic that is linear in the signals", fault)


def _power(base: Any, exponent: Any, is_constant: bool) -> Any:
    """A power. A small whole exponent that is a constant is written out, so that it is exact for
    negative and complex numbers."""
    # Larger exponents are not written out as products.
    if not (is_constant and exponent == int(exponent) and abs(exponent) <= 32):
        # Whole numbers have all their digits, which of a tower of powers nobody waits for.
        if isinstance(base, int) and isinstance(exponent, int):
            base = float(base) if exponent * base.bit_length() > 64 else base
        return base**exponent
    total = 1.0
    for bit in f"{abs(int(exponent)):b}":
        total = total * total * base if bit == "1" else total * total
    return total if exponent >= 0 else 1 / total


def _is_good(ball: Any) -> bool:
    """Whether the rounding of a ball to a double is known."""
    return bool(ball == 0 or ball.rel_accuracy_bits() > BITS_OF_VALUE)


def _rounded(ball: Any) -> float:
    if ball.rel_accuracy_bits() > BITS_OF_VALUE:
        return float(ball.mid())
    return 0.0 if ball.abs_upper() < 1e-320 else math.nan  # below it a part is 0
