"""Arithmetic in numbers and signals as trees: values, texts, gains of signals, and other trees in
place of names.

A tree is nested tuples (operation, operands, offset in the text), so that it can be compared,
hashed and sent to workers.
"""

import math
import operator
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any

Tree = tuple[Any, ...]
Terms = tuple[tuple[str, Tree], ...]  # signal -> its gain

# Parts of a tree, and parts within each other, with the trees that its names stand for: a spec is
# refused before these take long or reach the recursion limit of Python.
MOST_PARTS_OF_TREE = 2000
DEEPEST_TREE = 200
FUNCTIONS = ("sqrt", "sin", "cos", "tan", "exp", "log")  # angles in rad, the natural logarithm
PREVIOUS = "prev"  # of signals: what they were before the tick
RESERVED = ("pi", *FUNCTIONS)
EXPANDED = 32  # the largest exponent that is written out as products
ONE: Tree = ("number", 1.0, 0)
# Rank of an operation, the ranks that its parts need, and its sign in a text.
RANKS = {
    "+": (1, (1, 2), " + "),
    "-": (1, (1, 2), " - "),
    "negative": (1, (2,), ""),
    "*": (2, (2, 3), "*"),
    "/": (2, (2, 3), "/"),
    "**": (3, (4, 3), "**"),
}


class Fault(ValueError):
    """One mistake in a text: its offset there, the expected text and the text found."""

    def __init__(self, offset: int, expected: str, found: str, suggestion: str = "") -> None:
        super().__init__(f"expected {expected}, found {found}")
        self.offset, self.expected, self.found, self.suggestion = (
            offset,
            expected,
            found,
            suggestion,
        )


def text_of(tree: Tree, least: int = 0) -> str:
    """Return a text whose tree has the same value. least: rank of operations from which no
    parentheses are needed."""
    operation, operands = tree[0], tree[1:-1]
    if operation == "name":
        return str(operands[0])
    if operation == "number":
        return _text_of_number(operands[0])
    if operation in FUNCTIONS:
        return f"{operation}({text_of(operands[0])})"
    if operation in ("*", "/") and (unsigned := _unsigned(tree)) is not None:
        return text_of(("negative", unsigned, tree[-1]), least)
    if operation == "negative" and (unsigned := _unsigned(operands[0])) is not None:
        return text_of(unsigned, least)
    rank, sides, sign = RANKS[operation]
    text = sign.join(text_of(operand, side) for operand, side in zip(operands, sides, strict=True))
    text = f"-{text}" if operation == "negative" else text
    return text if rank >= least else f"({text})"


def _text_of_number(number: float) -> str:
    short = f"{number:g}"
    return "pi" if number == math.pi else short if float(short) == number else repr(number)


def sum_of(terms: Terms) -> str:
    """Return a sum of signals times gains as a text."""
    texts = (
        text_of(("*", gain, ("name", signal, 0), 0)).removeprefix("1*") for signal, gain in terms
    )
    return " + ".join(texts).replace("+ -", "- ")


def _unsigned(tree: Tree) -> Tree | None:
    """Return a product or quotient without the sign of its first factor, which is left out if it
    is -1; None without one."""
    operation: str = tree[0]
    first: Tree = tree[1]
    if operation == "negative":
        return first
    if operation not in ("*", "/") or (inner := _unsigned(first)) is None:
        return None
    second: Tree = tree[2]
    return (
        second
        if operation == "*" and inner[:2] == ("number", 1.0)
        else (operation, inner, *tree[2:])
    )


def names_in(tree: Tree) -> Iterator[tuple[str, int]]:
    """Yield each name in the tree with its offset."""
    if tree[0] == "name":
        yield tree[1], tree[2]
    for operand in tree[1:-1]:
        if isinstance(operand, tuple):
            yield from names_in(operand)


def linear(tree: Tree, signals: set[str]) -> Terms:
    """Return the tree as signals times gains; a gain is a tree without signals.

    Errors: Fault if the text is not linear in the signals, or has a term without a signal other
    than 0.
    """
    terms = _linear(tree, signals)
    rest = terms.pop("", None)
    if rest is not None and not _is_nothing(rest):
        offset = rest[-1]
        raise Fault(offset, "a sum of signals times numbers", "a term without a signal")
    return tuple(terms.items())


def _is_nothing(tree: Tree) -> bool:
    """Whether a tree is 0 as it is written, products with 0 included."""
    operation, *operands, _ = tree
    if operation in ("+", "-"):
        return all(map(_is_nothing, operands))
    if operation == "*":
        return any(map(_is_nothing, operands))
    return (
        _is_nothing(operands[0]) if operation in ("negative", "/") else tree[:2] == ("number", 0.0)
    )


def _linear(tree: Tree, signals: set[str]) -> dict[str, Tree]:
    """The gain of each signal; that of "" is the term without a signal."""
    operation, at = tree[0], tree[-1]
    if operation == "number" or (operation == "name" and tree[1] not in signals):
        return {"": tree}
    if operation == "name":
        return {tree[1]: ONE}
    sums = [_linear(operand, signals) for operand in tree[1:-1]]
    if operation == "negative":
        return {name: ("negative", gain, at) for name, gain in sums[0].items()}
    if operation in ("+", "-"):
        total = dict(sums[0])
        for name, gain in sums[1].items():
            alone = gain if operation == "+" else ("negative", gain, at)
            total[name] = (operation, total[name], gain, at) if name in total else alone
        return total
    return _product(tree, sums)


def _refuse_nonlinear(operation: str, at: int, left: list[str], right: list[str]) -> None:
    """Raise Fault if an operation is not linear in the signals that its operands, left and
    right, read."""
    fault = {
        **dict.fromkeys(
            FUNCTIONS, left and f"{'a root' if operation == 'sqrt' else operation} of a signal"
        ),
        "**": (left or right) and "a power of a signal, or with a signal",
        "/": right and f"a division by the signal {right[0]}",
        "*": left and right and f"the product of the signals {left[0]} and {right[0]}",
    }[operation]
    if fault:
        raise Fault(at, "arithmetic that is linear in the signals", fault)


def _product(tree: Tree, sums: list[dict[str, Tree]]) -> dict[str, Tree]:
    """`_linear` of an operation other than a sum. sums: of its operands."""
    operation, at = tree[0], tree[-1]
    left, right = ([name for name in gains if name] for gains in (sums[0], sums[-1]))
    _refuse_nonlinear(operation, at, left, right)
    if not left and not right:
        return {"": tree}
    factor, of_signals = (sums[0][""], sums[1]) if right else (sums[1][""], sums[0])
    return {name: _without_ones((operation, gain, factor, at)) for name, gain in of_signals.items()}


def _without_ones(tree: Tree) -> Tree:
    """A product without factors of 1, or a quotient as it stands."""
    gain: Tree = tree[1]
    factor: Tree = tree[2]
    if tree[0] == "*" and ONE in (gain, factor):
        return factor if gain == ONE else gain
    return tree


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
        visited, queue, lost = {id(tree)}, [tree], []
        while queue:
            node = queue.pop()
            if id(node) in self.lost:
                lost.append(self.lost[id(node)])
            inner = [
                operand
                for operand in node[1:-1]
                if isinstance(operand, tuple) and id(operand) not in visited
            ]
            visited.update(map(id, inner))
            queue += inner
        return lost


def evaluate(
    tree: Tree,
    numbers: Mapping[str, Any],
    library: Any = math,
    watch: Callable[[Tree, Any, Any, Any], None] | None = None,
    shared: SharedParts | None = None,
) -> Any:
    """Return the value of a tree without signals.

    numbers: name -> number, or array of numbers, real or complex. library: has the functions of
    such values, as `math` has them. watch: is called with every operation on two terms and every
    function, their values and its own. shared: of trees evaluated before, at the same numbers with
    the same library and watch. Errors: those of Python's arithmetic for single numbers, such as
    ZeroDivisionError.
    """
    return _evaluate(tree, numbers, library, watch, {} if shared is None else shared.values)


def _evaluate(
    tree: Tree,
    numbers: Mapping[str, Any],
    library: Any,
    watch: Callable[[Tree, Any, Any, Any], None] | None,
    known_values: dict[int, Any],
) -> Any:
    """The value; known_values: those of parts by `id`, since what a name stands for is one part
    wherever it is read."""
    operation = tree[0]
    if operation == "number":
        return tree[1]
    if operation == "name":
        return numbers[tree[1]]
    key = id(tree)
    if key in known_values:
        return known_values[key]
    first, *rest = (
        _evaluate(operand, numbers, library, watch, known_values) for operand in tree[1:-1]
    )
    second = rest[0] if rest else None
    if operation == "negative":
        value = -first
    elif operation in FUNCTIONS:
        value = getattr(library, operation)(first)
    else:
        value = (
            _power(first, second, tree[2])
            if operation == "**"
            else _OPERATIONS[operation](first, second)
        )
    if watch and operation != "negative":
        watch(tree, first, second, value)
    known_values[key] = value
    return value


_OPERATIONS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


def _power(base: Any, exponent: Any, tree: Tree) -> Any:
    """A small whole exponent is written out, so that it is exact for negative and complex
    numbers."""
    if not (is_constant(tree) and exponent == int(exponent) and abs(exponent) <= EXPANDED):
        return base**exponent
    total, count = 1.0, abs(int(exponent))
    for bit in f"{count:b}":
        total = total * total * base if bit == "1" else total * total
    return total if exponent >= 0 else 1 / total


CANCELLED = 1 / 16  # a sum below this share of its first term has lost digits
# an operation that multiplies the rounding of its first term by more than this loses digits
RAISED = 16
SUBNORMAL = sys.float_info.min  # below which doubles have fewer digits


def lost_digits(tree: Tree, first: Any, second: Any, found: Any) -> Any:
    """Return whether an operation is wrong by more than a few roundings, for each of its values."""
    operation, computed = tree[0], [not is_given(operand) for operand in tree[1:-1]]
    if operation in FUNCTIONS:  # the size of f'(x) x against that of f(x)
        change = {
            "sqrt": 0.0,
            "tan": abs(first) * (1 + abs(found * found)),
            "exp": abs(first * found),
            "log": 1.0,
        }
        return (change.get(operation, abs(first)) > RAISED * abs(found)) & computed[0]
    if operation in ("+", "-"):  # a sum of two numbers is rounded once
        return (abs(found) < CANCELLED * abs(first)) & any(computed)
    if operation == "**":
        return (abs(second) > RAISED) & computed[0]
    return (abs(found) < SUBNORMAL) & (abs(first) >= SUBNORMAL) & (abs(second) >= SUBNORMAL)


def value_of(tree: Tree, numbers: Mapping[str, float], shared: SharedParts | None = None) -> Any:
    """Return the value of a tree without signals, correct to a few roundings of itself, for numbers
    that are exact.

    Where digits are lost, as in sums that cancel, the value is computed again in ball arithmetic.
    shared: of trees at the same numbers. Errors: those of `evaluate`.
    """
    shared = SharedParts() if shared is None else shared

    def watch(node: Tree, *values: Any) -> None:
        if lost_digits(node, *values):
            shared.lost[id(node)] = True

    rough = evaluate(tree, numbers, watch=watch, shared=shared)
    if not shared.lost_in(tree):
        return rough
    return exactly(tree, {name: numbers[name] for name, _ in names_in(tree)})


def is_given(tree: Tree) -> bool:
    """Whether a tree is a number or a name, or the negative of one, which no rounding changes."""
    return tree[0] in ("number", "name") or (tree[0] == "negative" and is_given(tree[1]))


def is_constant(tree: Tree) -> bool:
    """Whether a tree is a number as it is written, or the negative of one."""
    return bool(tree[0] == "number" or (tree[0] == "negative" and tree[1][0] == "number"))


def with_number(tree: Tree, name: str, number: float) -> Tree:
    """Return the tree with a number in place of a name."""
    return with_trees(tree, {name: ("number", number, 0)})


def with_trees(tree: Tree, meanings: Mapping[str, Tree]) -> Tree:
    """Return the tree with other trees in place of names, each at the offset of its name."""
    if tree[0] == "name" and tree[1] in meanings:
        return (*meanings[tree[1]][:-1], tree[2])
    return _same_or(
        tree,
        tuple(
            with_trees(operand, meanings) if isinstance(operand, tuple) else operand
            for operand in tree
        ),
    )


def _same_or(tree: Tree, made: Tree) -> Tree:
    """The tree itself if none of its parts is another one: see `_evaluate`."""
    return tree if all(before is after for before, after in zip(tree, made, strict=True)) else made


def remembered(tree: Tree, signals: set[str]) -> tuple[Tree, dict[str, str]]:
    """Return the tree with the outputs of registers in place of the signals within `prev(...)`, and
    the signal of each output.

    Errors: Fault if there is neither a signal nor 0 within the parentheses.
    """
    operands = [
        remembered(operand, signals) if isinstance(operand, tuple) else (operand, {})
        for operand in tree[1:-1]
    ]
    registers = {register: signal for _, read in operands for register, signal in read.items()}
    tree = _same_or(tree, (tree[0], *(operand for operand, _ in operands), tree[-1]))
    if tree[0] != PREVIOUS:
        return tree, registers
    read = {
        f"{PREVIOUS}({name}).y": name
        for name, _ in names_in(tree)
        if name in signals or name in registers
    }
    if not (read or _is_nothing(tree[1])):  # as an input of a class that is at rest
        raise Fault(tree[-1], f"a signal of a wire within {PREVIOUS}( )", "none")
    return with_trees(
        tree[1], {name: ("name", register, 0) for register, name in read.items()}
    ), registers | read


def extent(tree: Tree, of_names: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
    """Return how many parts a tree has and how deep it is, if names stand for trees of such
    extents."""
    if tree[0] == "name":
        return of_names.get(tree[1], (1, 1))
    extents = [extent(operand, of_names) for operand in tree[1:-1] if isinstance(operand, tuple)]
    return 1 + sum(size for size, _ in extents), 1 + max((depth for _, depth in extents), default=0)


def check_extent(tree: Tree, of_names: Mapping[str, tuple[int, int]]) -> None:
    """Raise Fault for a tree that is too large or too deep with what its names stand for."""
    size, depth = extent(tree, of_names)
    if size > MOST_PARTS_OF_TREE or depth > DEEPEST_TREE:
        raise Fault(
            0,
            f"at most {MOST_PARTS_OF_TREE} parts, {DEEPEST_TREE} within each other, with those of its names",
            "more",
        )


def singular(tree: Tree) -> Iterator[tuple[Tree, Tree | None]]:
    """Yield the trees at whose zeros this one is not analytic, and the root or power that may still
    have a value there.

    These are divisors, arguments of logarithms and cosines of those of tangents, which leave none,
    arguments of roots, and bases of powers that are not whole numbers.
    """
    for operand in tree[1:-1]:
        if isinstance(operand, tuple):
            yield from singular(operand)
    if tree[0] == "/":
        yield tree[2], None
    elif tree[0] in ("log", "tan"):
        yield (tree[1] if tree[0] == "log" else ("cos", *tree[1:])), None
    elif tree[0] == "sqrt" or (
        tree[0] == "**" and not (tree[2][0] == "number" and tree[2][1].is_integer())
    ):
        yield tree[1], tree


def degree(tree: Tree, number: str) -> float:
    """Return the degree of the tree as a polynomial in a number; infinite if it is not a
    polynomial."""
    if tree[0] in ("number", "name"):
        return int(tree[0] == "name" and tree[1] == number)
    degrees = [degree(operand, number) for operand in tree[1:-1]]
    if tree[0] in ("+", "-", "negative"):
        return max(degrees)
    if tree[0] == "*":
        return sum(degrees)
    if tree[0] == "/" and degrees[1] == 0:
        return degrees[0]
    is_power = tree[0] == "**" and tree[2][0] == "number" and tree[2][1].is_integer()
    return degrees[0] * tree[2][1] if is_power else math.inf if any(degrees) else 0


def cancelled(tree: Tree) -> Tree:
    """Return the tree without the factors that a quotient has above and below, such as `b` of
    `(a*b)/b`."""
    if tree[0] in ("number", "name"):
        return tree
    tree = _same_or(tree, (tree[0], *map(cancelled, tree[1:-1]), tree[-1]))
    over = _over(tree[1], text_of(tree[2])) if tree[0] == "/" else None
    return tree if over is None else over


def _over(tree: Tree, factor: str) -> Tree | None:
    """The tree divided by a factor, given as a text; None if it is not one of the tree."""
    if text_of(tree) == factor:
        return ONE
    if tree[0] in ("negative", "+", "-"):
        quotients = [_over(operand, factor) for operand in tree[1:-1]]
        return None if None in quotients else (tree[0], *quotients, tree[-1])
    for at in {"*": (1, 2), "/": (1,)}.get(tree[0], ()):
        if (over := _over(tree[at], factor)) is not None:
            return (*tree[:at], over, *tree[at + 1 :])
    return None


# In ball arithmetic, where doubles lose digits: terms may be thirty powers of ten apart.
BITS_TRIED = (256, 1024, 4096)  # bits, each tried if the one before leaves the value in doubt
# bits of the value, so that its rounding to a double is the only one but once in 2^57 times
BITS_OF_VALUE = 110
LEAST_PART = 1e-320  # below it a part is 0


def exactly(tree: Tree, numbers: Mapping[str, float | complex]) -> float | complex:
    """Return the value of a tree without signals, rounded once, for numbers that are exact; NaN or
    infinite if it has no value.

    It is complex if it is not real. A part that is below 1e-320, or cannot be told from 0 with 4096
    bits, is 0.
    """
    from flint import acb, ctx

    balls: dict[Any, Any] = {
        name: acb(number)
        for name, number in (
            {constant: constant for constant in constants_of(tree)} | dict(numbers)
        ).items()
    }
    before, tree = ctx.prec, named(tree)
    try:
        for ctx.prec in BITS_TRIED:
            value = evaluate(tree, balls, acb)
            components = value.real, value.imag
            if all(
                component == 0 or component.rel_accuracy_bits() > BITS_OF_VALUE
                for component in components
            ):
                break
    except ZeroDivisionError:
        return math.nan
    finally:
        ctx.prec = before
    real, imag = map(_rounded, components)
    return complex(real, imag) if imag else real


def _rounded(ball: Any) -> float:
    if ball.rel_accuracy_bits() > BITS_OF_VALUE:
        return float(ball.mid())
    return 0.0 if ball.abs_upper() < LEAST_PART else math.nan


@lru_cache(maxsize=1024)
def named(tree: Tree) -> Tree:
    """Return the tree with a name in place of each constant, the constant itself, except for
    exponents that are constants."""
    if tree[0] == "number":
        return ("name", tree[1], tree[2])
    operands = [named(operand) if isinstance(operand, tuple) else operand for operand in tree[1:-1]]
    return (
        (tree[0], operands[0], *tree[2:])
        if tree[0] == "**" and is_constant(tree[2])
        else (tree[0], *operands, tree[-1])
    )


@lru_cache(maxsize=1024)
def constants_of(tree: Tree) -> frozenset[float]:
    """Return the constants of a tree."""
    constants = [tree[1]] if tree[0] == "number" else []
    return frozenset(constants).union(
        *(constants_of(operand) for operand in tree[1:-1] if isinstance(operand, tuple))
    )
