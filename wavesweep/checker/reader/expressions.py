"""Arithmetic of a spec as sums: a form over names of signals, its number under the name ""."""

import ast
import keyword
import re
from collections.abc import Callable

from .loops import Unreadable, form, scaled

FUNCTIONS = ("sqrt", "sin", "cos", "tan", "exp", "log")
LONGEST = 10_000  # characters of an expression
MOST = 4000  # parts of an expression with all that its names stand for
CHARACTERS = re.compile(r"[\w.+*/()\s-]*", re.ASCII)
KEYWORDS = re.compile(
    rf"\b({'|'.join(keyword.kwlist)})\b"
)  # of Python, and names like all others in a spec
MARK = "\xb7"  # behind a keyword, which makes it a name
NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


class Written(str):
    """A number as it stands in a text, and not the double nearest to it."""

    __slots__ = ()
    __repr__ = str.__str__


def parsed(text) -> ast.expr:
    """The node of an expression, its numbers as they are written."""
    text = str(text).strip()
    if len(text) > LONGEST:
        raise Unreadable(f"an expression of {len(text)} characters; at most {LONGEST}")
    if not CHARACTERS.fullmatch(text):
        raise Unreadable(
            f"{text[:60]!r} is no expression of names, numbers, + - * / ** and brackets"
        )
    try:
        marked = KEYWORDS.sub(rf"\g<0>{MARK}", text)
        node = ast.parse(marked, mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise Unreadable(f"{text[:60]!r} is no expression") from None
    for part in ast.walk(node):
        if isinstance(part, ast.Name):
            part.id = part.id.removesuffix(MARK)
        elif isinstance(part, ast.Attribute):
            part.attr = part.attr.removesuffix(MARK)
        elif isinstance(part, ast.Constant):
            part.value = Written(ast.get_source_segment(marked, part))
            if not NUMBER.fullmatch(part.value):
                raise Unreadable(f"{part.value!r} is no number")
    return node


def bounded_parts(texts: dict) -> None:
    """Unreadable for names that stand for each other in a circle, or for more than so many parts; texts: of names."""
    parts: dict[str, int] = {}

    def count(name: str, within: tuple) -> int:
        if name in within:
            raise Unreadable(f"{name} reads itself")
        if name not in parts:
            total = 0
            for node in ast.walk(parsed(texts[name])):
                if not isinstance(node, ast.expr):
                    continue
                called = dotted(node) if isinstance(node, ast.Name | ast.Attribute) else ""
                total += count(called, (*within, name)) if called in texts else 1
            parts[name] = total
        if parts[name] > MOST:
            raise Unreadable(f"{name} stands for more than {MOST} parts, with those of its names")
        return parts[name]

    for name in texts:
        count(name, ())


def dotted(node) -> str:
    """The name `a.b.c` of a node of names and attributes."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    if not isinstance(node, ast.Name):
        raise Unreadable(f"{ast.unparse(node)[:60]!r} is no name")
    return node.id


def terms_of(node, meanings=None) -> list[tuple[int, ast.expr]]:
    """The terms of a sum as (sign, part); a name in `meanings` is its text in brackets."""
    return list(_terms(node, 1, meanings or {}))


def _terms(node, sign, meanings):
    if isinstance(node, str):
        node = parsed(node)
    if isinstance(node, (ast.Name, ast.Attribute)) and dotted(node) in meanings:
        yield from _terms(meanings[dotted(node)], sign, meanings)
    elif isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
        yield from _terms(node.left, sign, meanings)
        yield from _terms(node.right, sign if isinstance(node.op, ast.Add) else -sign, meanings)
    elif isinstance(node, ast.UnaryOp):
        yield from _terms(node.operand, -sign if isinstance(node.op, ast.USub) else sign, meanings)
    else:
        yield sign, node


def multiplied_out(node, meanings, numbers) -> list[tuple[int, tuple[str, ...], str]]:
    """The products that a term is the sum of, as (sign, factors, signal); "prev NAME" is a signal, "" none."""
    products = []
    for sign, part in terms_of(node, meanings):
        if isinstance(part, ast.BinOp) and isinstance(part.op, ast.Mult | ast.Div):
            products_of_left = multiplied_out(part.left, meanings, numbers)
            right = [(1, (f"1/({ast.unparse(part.right)})",), "")]
            if isinstance(part.op, ast.Mult):
                right = multiplied_out(part.right, meanings, numbers)
            if len(products_of_left) * len(right) + len(products) > MOST:
                raise Unreadable(f"a wire of more than {MOST} products")
            for first_sign, factors, signal in products_of_left:
                for second_sign, further, behind in right:
                    products.append(
                        (
                            sign * first_sign * second_sign,
                            tuple(sorted((*factors, *further))),
                            signal + behind,
                        )
                    )
        elif isinstance(part, ast.Call) and part.func.id == "prev":
            for first_sign, factors, signal in multiplied_out(part.args[0], meanings, numbers):
                products.append((sign * first_sign, factors, f"prev {signal}"))
        elif isinstance(part, (ast.Name, ast.Attribute)) and dotted(part) not in numbers:
            products.append((sign, (), dotted(part)))
        else:
            products.append((sign, (ast.unparse(part),), ""))
    return products


def linear(node, value_of: Callable[[str], dict], arithmetic) -> dict:
    """The form of a node; `value_of` gives that of a name, and of `prev(...)` by the name "prev NAME"."""
    if isinstance(node, str):
        node = parsed(node)
    if isinstance(node, ast.Constant):
        return {"": arithmetic.number(node.value)}
    if isinstance(node, (ast.Name, ast.Attribute)):
        return value_of(dotted(node))
    if isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.Not):
        inside = linear(node.operand, value_of, arithmetic)
        return scaled(-1, inside) if isinstance(node.op, ast.USub) else inside
    if isinstance(node, ast.Call):
        function = dotted(node.func)
        if len(node.args) != 1 or node.keywords or function not in (*FUNCTIONS, "prev"):
            raise Unreadable(f"{ast.unparse(node)[:60]!r} is no function of expressions")
        if function == "prev":
            return linear(node.args[0], lambda name: value_of(f"prev {name}"), arithmetic)
        return {"": getattr(arithmetic, function)(number(node.args[0], value_of, arithmetic))}
    if not isinstance(node, ast.BinOp):
        raise Unreadable(f"{ast.unparse(node)[:60]!r} is no arithmetic")
    first = linear(node.left, value_of, arithmetic)
    right = linear(node.right, value_of, arithmetic)
    if isinstance(node.op, ast.Add):
        return form(first, right)
    if isinstance(node.op, ast.Sub):
        return form(first, scaled(-1, right))
    if isinstance(node.op, ast.Mult) and set(first) <= {""}:
        return scaled(first.get("", 0), right)
    if not set(right) <= {""}:
        raise Unreadable(f"{ast.unparse(node)[:60]!r} is not linear in signals")
    factor = right.get("", 0)
    if isinstance(node.op, ast.Mult):
        return scaled(factor, first)
    if isinstance(node.op, ast.Div):
        return {name: coefficient / factor for name, coefficient in first.items()}
    if not isinstance(node.op, ast.Pow) or not set(first) <= {""}:
        raise Unreadable(f"{ast.unparse(node)[:60]!r} is no arithmetic")
    return {"": first.get("", 0) ** factor}


def equations_of(
    law: str, called: Callable[[str], str], value_of: Callable[[str], dict], arithmetic
) -> tuple[dict, dict]:
    """The equations of a law, `NAME = sum` behind semicolons, and what it writes to memory, whose names begin with "@".

    called: the variable or the memory that a name on the left stands for.
    """
    rows: dict[str, dict] = {}
    for line in law.split(";"):
        name, right = line.split(" = ")
        rows[called(name.strip())] = linear(right, value_of, arithmetic)
    writes = {name: rows.pop(name) for name in [*rows] if name.startswith("@")}
    return rows, writes


def number(node, value_of, arithmetic):
    """The value of what has no signals."""
    terms = linear(node, value_of, arithmetic)
    if not set(terms) <= {""}:
        raise Unreadable("a number is wanted and not a signal")
    return terms.get("", 0)


def names_in(node) -> set[str]:
    """All dotted names that a part of an expression mentions, as they stand there."""
    if isinstance(node, (ast.Name, ast.Attribute)):
        return {dotted(node)}
    names: set[str] = set()
    for child in ast.iter_child_nodes(node):
        names |= names_in(child)
    return names
