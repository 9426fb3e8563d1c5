"""Arithmetic of a spec as sums: a form over names of signals, its number under the name ""."""

import ast
import math
from collections.abc import Callable

FUNCTIONS = {"sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan, "exp": math.exp, "log": math.log}


def dotted(node) -> str:
    """The name `a.b.c` of a node of names and attributes."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id


def terms_of(node, meanings=None) -> list[tuple[float, ast.expr]]:
    """The terms of a sum as (sign, part); a name in `meanings` is its text in brackets."""
    return list(_terms(node, 1.0, meanings or {}))


def _terms(node, sign, meanings):
    if isinstance(node, str):
        node = ast.parse(node.strip(), mode="eval").body
    if isinstance(node, (ast.Name, ast.Attribute)) and dotted(node) in meanings:
        yield from _terms(meanings[dotted(node)], sign, meanings)
    elif isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
        yield from _terms(node.left, sign, meanings)
        yield from _terms(node.right, sign if isinstance(node.op, ast.Add) else -sign, meanings)
    elif isinstance(node, ast.UnaryOp):
        yield from _terms(node.operand, -sign if isinstance(node.op, ast.USub) else sign, meanings)
    else:
        yield sign, node


def multiplied_out(node, meanings, numbers) -> list[tuple[float, tuple[str, ...], str]]:
    """The products that a term is the sum of, as (sign, factors, signal); "prev NAME" is a signal, "" none."""
    products = []
    for sign, part in terms_of(node, meanings):
        if isinstance(part, ast.BinOp) and isinstance(part.op, ast.Mult):
            for one, factors, signal in multiplied_out(part.left, meanings, numbers):
                for other, further, behind in multiplied_out(part.right, meanings, numbers):
                    products.append((sign * one * other, tuple(sorted((*factors, *further))), signal + behind))
        elif isinstance(part, ast.BinOp) and isinstance(part.op, ast.Div):
            for one, factors, signal in multiplied_out(part.left, meanings, numbers):
                products.append((sign * one, tuple(sorted((*factors, f"1/({ast.unparse(part.right)})"))), signal))
        elif isinstance(part, ast.Call) and part.func.id == "prev":
            for one, factors, signal in multiplied_out(part.args[0], meanings, numbers):
                products.append((sign * one, factors, f"prev {signal}"))
        elif isinstance(part, (ast.Name, ast.Attribute)) and dotted(part) not in numbers:
            products.append((sign, (), dotted(part)))
        else:
            products.append((sign, (ast.unparse(part),), ""))
    return products


def linear(node, value_of: Callable[[str], dict]) -> dict[str, float]:
    """The form of a node; `value_of` gives that of a name, and of `prev(...)` by the name "prev NAME"."""
    if isinstance(node, str):
        node = ast.parse(node.strip(), mode="eval").body
    if isinstance(node, ast.Constant):
        return {"": float(node.value)}
    if isinstance(node, (ast.Name, ast.Attribute)):
        return value_of(dotted(node))
    if isinstance(node, ast.UnaryOp):
        inside = linear(node.operand, value_of)
        return _times(-1.0 if isinstance(node.op, ast.USub) else 1.0, inside)
    if isinstance(node, ast.Call):
        if node.func.id == "prev":
            return linear(node.args[0], lambda name: value_of(f"prev {name}"))
        return {"": FUNCTIONS[node.func.id](number(node.args[0], value_of))}
    left = linear(node.left, value_of)
    right = linear(node.right, value_of)
    if isinstance(node.op, ast.Add):
        return _sum(left, right)
    if isinstance(node.op, ast.Sub):
        return _sum(left, _times(-1.0, right))
    if isinstance(node.op, ast.Mult) and set(left) <= {""}:
        return _times(left.get("", 0.0), right)
    divisor = right.get("", 0.0)
    if not set(right) <= {""}:
        raise ValueError("not linear")
    if isinstance(node.op, ast.Mult):
        return _times(divisor, left)
    if isinstance(node.op, ast.Div):
        return {name: coefficient / divisor for name, coefficient in left.items()}
    return {"": left.get("", 0.0) ** divisor}


def number(node, value_of) -> float:
    """The value of what has no signals."""
    terms = linear(node, value_of)
    if not set(terms) <= {""}:
        raise ValueError("a number is wanted")
    return terms.get("", 0.0)


def names_in(node) -> set[str]:
    """All dotted names that a part of an expression mentions, as they stand there."""
    if isinstance(node, (ast.Name, ast.Attribute)):
        return {dotted(node)}
    found: set[str] = set()
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr) and not (isinstance(node, ast.Call) and child is node.func):
            found |= names_in(child)
    return found


def _sum(left, right):
    total = dict(left)
    for name, coefficient in right.items():
        total[name] = total.get(name, 0.0) + coefficient
    return total


def _times(factor, terms):
    return {name: factor * coefficient for name, coefficient in terms.items()}
