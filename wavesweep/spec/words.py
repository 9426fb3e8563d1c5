"""The words of firmware: blocks that are transfer functions of their own keys, one formula for each coefficient.

Next to z = 1, where the poles of slow filters are, coefficients in powers of z cancel; those in powers of z - 1 do not. The
simulation has laws of its own for the same words.
"""

from functools import lru_cache
from types import MappingProxyType

from wavesweep.spec.expressions import Tree, parse, with_trees
from wavesweep.spec.keys import AHEAD

DELTA = "delta"  # in place of true as `discrete` of a transfer function: its powers are those of z - 1

# Numerator and denominator, descending powers of z - 1, of a biquad of z. T is the block's own period (s), ahead the share of a
# period by which an integral reads ahead, K(f) = tan(pi f T) the prewarped frequency of the bilinear transform.
_K = "tan(pi*{}*T)"
_W = "(2*pi*cutoff_hz*T)"
_P = "(kp + ki*ahead*T)"
FORMULAS = MappingProxyType(
    {
        "lowpass": (("a", "a"), ("1", "a")),
        "pi": ((_P, "ki*T"), ("1", "0")),
        "pid": ((f"{_P}*(T + tau) + kd", f"{_P}*T + ki*T*(T + tau)", "ki*T**2"), ("T + tau", "T", "0")),
        "lead": ((f"1 + 1/{_K.format('zero_hz')}", "2"), (f"1 + 1/{_K.format('pole_hz')}", "2")),
        "notch": (
            ("(1 + 1/K**2)/4 + depth/(4*q*K)", "1 + depth/(2*q*K)", "1"),
            ("(1 + 1/K**2)/4 + 1/(4*q*K)", "1 + 1/(2*q*K)", "1"),
        ),
        "biquad": (("b0", "b1", "b2"), ("1", "a1", "a2")),
    }
)
DEFINED = MappingProxyType({"K": _K.format("frequency_hz"), "a": f"{_W}/(1 + {_W})"})  # unless they are keys that are given


@lru_cache(maxsize=1024)
def transfer_function(kind: str, keys: tuple[tuple[str, object], ...], period: Tree) -> tuple[tuple[str, object], ...]:
    """Return the keys of the block of type `tf` that a word is; keys: its own, trees and words; period: of the block, s."""
    known = {name: tree for name, tree in keys if isinstance(tree, tuple)} | {"T": period}
    known["ahead"] = ("number", AHEAD.get(dict(keys).get("method"), 0.0), 0)
    known = {name: with_trees(parse(text), known) for name, text in DEFINED.items()} | known
    num, den = (tuple(with_trees(parse(text), known) for text in texts) for texts in FORMULAS[kind])
    return ("num", num), ("den", den), ("discrete", True if kind == "biquad" else DELTA)
