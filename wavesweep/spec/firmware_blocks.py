"""Blocks of firmware: transfer functions of their own keys, by the formulas of their types, one for each coefficient.

Next to z = 1, where the poles of slow filters are, coefficients in powers of z cancel; those in powers of z - 1 do not. The
simulation has laws of its own for the same blocks.
"""

from functools import lru_cache
from types import MappingProxyType

from wavesweep.spec.block_types import TYPES
from wavesweep.spec.expressions import Tree, with_trees
from wavesweep.spec.keys import AHEAD
from wavesweep.spec.parsing import parse

DELTA = "delta"  # in place of true as `discrete` of a transfer function: its powers are those of z - 1
# What names in the formulas of `BlockType` stand for, unless they are keys that are given.
DEFINED = MappingProxyType(
    {"K": "tan(pi*frequency_hz*T)", "a": "2*pi*cutoff_hz*T/(1 + 2*pi*cutoff_hz*T)", "r": "sqrt(2*b)", "g": "1/(b + B + K*T/2)"}
)
_ABSENT = {name: ("number", value, 0) for name, value in (("kp", 0.0), ("ki", 1.0), ("kd", 0.0), ("tau", 0.0))}
TRAPEZIA = "trapezoidal"


@lru_cache(maxsize=1024)
def transfer_function(kind: str, keys: tuple[tuple[str, object], ...], period: Tree) -> tuple[tuple[str, object], ...]:
    """Return the keys of the block of type `tf` that a block of firmware is; keys: its own; period: of the block, s."""
    known = _meanings(keys, period)
    num, den = (tuple(with_trees(parse(text), known) for text in texts) for texts in TYPES[kind].formula)
    return ("num", num), ("den", den), ("discrete", True if kind == "biquad" else DELTA)


@lru_cache(maxsize=1024)
def stepwise(
    kind: str, keys: tuple[tuple[str, object], ...], ports: tuple[tuple[str, ...], tuple[str, ...]], period: Tree
) -> tuple[tuple[str, object], ...]:
    """Return the keys of a block as one of type `ss` whose states mean the same at every period; none if its own states do.

    A trapezium over a step of its own needs the last velocity, which the one state of steps that are all alike has in it.
    """
    words, (inputs, outputs) = dict(keys), ports
    if not TYPES[kind].stepwise or not (TYPES[kind].formula or TRAPEZIA in words.values()):
        return ()
    known = _ABSENT | _meanings(keys, period) | {"late": ("number", 0.5 * (TRAPEZIA in words.values()), 0)}
    rows = [tuple(with_trees(parse(text), known) for text in row.split(";")) for row in TYPES[kind].stepwise]
    n = len(rows) - len(outputs)
    A, B, C, D = (tuple(row[part] for row in some) for some in (rows[:n], rows[n:]) for part in (slice(n), slice(n, None)))
    return ("A", A), ("B", B), ("C", C), ("D", D), ("inputs", inputs), ("outputs", outputs), ("discrete", True)


def _meanings(keys, period):
    """What names in a formula stand for."""
    known = {name: tree for name, tree in keys if isinstance(tree, tuple)} | {"T": period}
    known["ahead"] = ("number", AHEAD.get(dict(keys).get("method"), 0.0), 0)
    return {name: with_trees(parse(text), known) for name, text in DEFINED.items()} | known
