"""Expressions are read by a parser of their own, and never evaluated as code.

sum    = product { ("+" | "-") product }        product = signed { ("*" | "/") signed }
signed = "-" signed | "+" signed | power        power   = atom [ "**" signed ]
atom   = number | name | name "." port | "pi" | function "(" sum ")" | "(" sum ")" | "prev" "(" sum ")"
"""

import math
import re
from collections import deque
from collections.abc import Iterator

from wavesweep.engine._drawing.expressions import FUNCTIONS, PREVIOUS, RANKS, Fault, Tree
from wavesweep.engine._keys.checking import nearest, show

MOST_TOKENS = 400  # tokens
# parentheses, signs and exponents within each other, so that recursion has room wherever it is
# called from
DEEPEST_EXPRESSION = 50
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)|(?P<sign>\*\*|[-+*/()]))",
    re.ASCII,
)


# What is meant by signs of other languages and of typeset text.
MEANT = {
    "^": "**",
    "\u2212": "-",
    "\u2013": "-",
    "\u00d7": "*",
    "\u00b7": "*",
    "\u22c5": "*",
    "\u00f7": "/",
    "\u2215": "/",
}


def parse(text: str) -> Tree:
    """Return the tree of a text. Errors: Fault at the first token that does not fit."""
    tokens = deque(_tokens(text))
    if len(tokens) > MOST_TOKENS:
        raise Fault(0, f"at most {MOST_TOKENS} numbers, names and signs", f"{len(tokens) - 1}")
    tree = _operand(tokens, 1, 0)
    kind, rest, offset = tokens.popleft()
    if kind != "end":
        without_unit = " (a number has no unit behind it)" if kind == "name" else ""
        raise Fault(offset, f"an operator or the end{without_unit}", show(rest))
    return tree


def _operand(tokens: deque[tuple[str, str, int]], least: int, depth: int) -> Tree:
    """Read an operand, up to an operation of a lower rank than `least`. depth: of parentheses,
    signs and exponents."""
    kind, text, offset = tokens.popleft()
    if depth > DEEPEST_EXPRESSION:
        raise Fault(
            offset,
            f"at most {DEEPEST_EXPRESSION} parentheses, signs and exponents within each other",
            "more",
        )
    tree: Tree
    if kind == "number":
        if not math.isfinite(float(text)):
            raise Fault(offset, "a finite number", text)
        tree = Tree.number(float(text), offset)
    elif text in ("+", "-"):
        tree = _operand(tokens, RANKS["**"][0], depth + 1)
        tree = Tree("negative", (tree,), offset) if text == "-" else tree
    elif text == "(":
        tree = _operand(tokens, 1, depth + 1)
        _expect(tokens, ")", ") to close a parenthesis")
    elif kind == "name":
        tree = _named(tokens, text, offset, depth)
    else:
        raise Fault(offset, "a number, a name or a parenthesis", show(text) if text else "the end")
    while tokens[0][0] == "sign" and RANKS.get(tokens[0][1], (0,))[0] >= least:
        _, sign, offset = tokens.popleft()
        second = _operand(tokens, RANKS[sign][1][1], depth + (sign == "**"))
        tree = Tree(sign, (tree, second), offset)
    return tree


def _named(tokens: deque[tuple[str, str, int]], name: str, offset: int, depth: int) -> Tree:
    """Return the tree of a name, which may be a function, whose argument is read, or pi."""
    if name not in FUNCTIONS and tokens[0][1] != "(":
        return Tree.number(math.pi, offset) if name == "pi" else Tree.name(name, offset)
    if name not in (PREVIOUS, *FUNCTIONS):
        raise Fault(
            offset,
            f"one of the functions {', '.join(FUNCTIONS)}",
            show(name),
            nearest(name, FUNCTIONS),
        )
    _expect(tokens, "(", f"( after {name}")
    argument = _operand(tokens, 1, depth + 1)
    _expect(tokens, ")", ") to close a parenthesis")
    return Tree(name, (argument,), offset)


def _expect(tokens: deque[tuple[str, str, int]], sign: str, expected: str) -> None:
    _, text, offset = tokens.popleft()
    if text != sign:
        raise Fault(offset, expected, show(text) if text else "the end")


def _tokens(text: str) -> Iterator[tuple[str, str, int]]:
    offset = 0
    while text[offset:].strip():
        match = _TOKEN.match(text, offset)
        if match is None:
            offset += len(text[offset:]) - len(text[offset:].lstrip())
            hint = MEANT.get(text[offset], "")
            raise Fault(
                offset, "a number, a name, or one of + - * / ** ( )", show(text[offset]), hint
            )
        kind = match.lastgroup or ""
        yield kind, match[kind], match.start(kind)
        offset = match.end()
    yield "end", "", len(text)
