"""Values of expressions in ball arithmetic, where doubles lose digits: terms may be thirty powers of ten apart."""

import math
from collections.abc import Mapping
from functools import lru_cache

from wavesweep.engine.drawing.expressions import Tree, evaluate, is_constant

PRECISIONS = (256, 1024, 4096)  # bits, each tried if the one before leaves the value in doubt
ENOUGH = 110  # bits of the value, so that its rounding to a double is the only one but once in 2^57 times
LEAST = 1e-320  # below it a part is 0


def exactly(tree: Tree, numbers: Mapping[str, float | complex]) -> float | complex:
    """Return the value of a tree without signals, rounded once, for numbers that are exact; NaN or infinite if it has no value.

    It is complex if it is not real. A part that is below 1e-320, or cannot be told from 0 with 4096 bits, is 0.
    """
    from flint import acb, ctx

    balls = {name: acb(number) for name, number in ({each: each for each in constants_of(tree)} | dict(numbers)).items()}
    before, tree = ctx.prec, named(tree)
    try:
        for ctx.prec in PRECISIONS:
            value = evaluate(tree, balls, acb)
            parts = value.real, value.imag
            if all(part == 0 or part.rel_accuracy_bits() > ENOUGH for part in parts):
                break
    except ZeroDivisionError:
        return math.nan
    finally:
        ctx.prec = before
    real, imag = map(_rounded, parts)
    return complex(real, imag) if imag else real


def _rounded(ball):
    if ball.rel_accuracy_bits() > ENOUGH:
        return float(ball.mid())
    return 0.0 if ball.abs_upper() < LEAST else math.nan


@lru_cache(maxsize=1024)
def named(tree: Tree) -> Tree:
    """Return the tree with a name in place of each constant, the constant itself, except for exponents that are constants."""
    if tree[0] == "number":
        return ("name", tree[1], tree[2])
    parts = [named(part) if isinstance(part, tuple) else part for part in tree[1:-1]]
    return (tree[0], parts[0], *tree[2:]) if tree[0] == "**" and is_constant(tree[2]) else (tree[0], *parts, tree[-1])


@lru_cache(maxsize=1024)
def constants_of(tree: Tree) -> frozenset[float]:
    """Return the constants of a tree."""
    own = [tree[1]] if tree[0] == "number" else []
    return frozenset(own).union(*(constants_of(part) for part in tree[1:-1] if isinstance(part, tuple)))
