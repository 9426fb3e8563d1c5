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
DEFINED = MappingProxyType(  # unless they are keys that are given
    {"K": _K.format("frequency_hz"), "a": f"{_W}/(1 + {_W})", "r": "sqrt(2*b)", "g": "1/(b + B + K*T/2)"}
)

# Blocks whose states mean something else at another period T, in states that do not: rows of A and B, then those of C and D.
# late: the share of the last input in a step. A pid's states are the integral, the last input and the last slope, those of the
# ends of waves the last position and velocity.
_PID = (
    "1; late*T; 0; (1 - late)*T",
    "0; 0; 0; 1",
    "0; -1/(tau + T); tau/(tau + T); 1/(tau + T)",
    "ki; ki*late*T - kd/(tau + T); kd*tau/(tau + T); kp + ki*ahead*T + kd/(tau + T)",
)
_X, _V = "1; T/2; T/2*r/b; -T/2/b", "0; 0; r/b; -1/b"
STEPWISE = MappingProxyType(
    {
        "lowpass": ("1 - a; a", "1 - a; a"),
        **dict.fromkeys(("integrator", "pi", "pid"), _PID),
        "avatar": (_X, _V, _V, _X, _X, "0; 0; 1; -r/b"),
        "local_model": ("1 - T/2*K*g; T/2 - T/2*K*T/2*g; T/2*r*g", "-K*g; -K*T/2*g; r*g", "-r*K*g; -r*K*T/2*g; r*r*g - 1"),
    }
)
_ABSENT = {name: ("number", value, 0) for name, value in (("kp", 0.0), ("ki", 1.0), ("kd", 0.0), ("tau", 0.0))}
TRAPEZIA = "trapezoidal"


@lru_cache(maxsize=1024)
def transfer_function(kind: str, keys: tuple[tuple[str, object], ...], period: Tree) -> tuple[tuple[str, object], ...]:
    """Return the keys of the block of type `tf` that a word is; keys: its own, trees and words; period: of the block, s."""
    known = _meanings(keys, period)
    num, den = (tuple(with_trees(parse(text), known) for text in texts) for texts in FORMULAS[kind])
    return ("num", num), ("den", den), ("discrete", True if kind == "biquad" else DELTA)


@lru_cache(maxsize=1024)
def stepwise(
    kind: str, keys: tuple[tuple[str, object], ...], ports: tuple[tuple[str, ...], tuple[str, ...]], period: Tree
) -> tuple[tuple[str, object], ...]:
    """Return the keys of a block as one of type `ss` whose states mean the same at every period; none if its own states do.

    A trapezium over a step of its own needs the last velocity, which the one state of steps that are all alike has in it.
    """
    words, (inputs, outputs) = dict(keys), ports
    if kind not in STEPWISE or (kind not in FORMULAS and TRAPEZIA not in words.values()):
        return ()
    known = _ABSENT | _meanings(keys, period) | {"late": ("number", 0.5 * (TRAPEZIA in words.values()), 0)}
    rows = [tuple(with_trees(parse(text), known) for text in row.split(";")) for row in STEPWISE[kind]]
    n = len(rows) - len(outputs)
    A, B, C, D = (tuple(row[part] for row in some) for some in (rows[:n], rows[n:]) for part in (slice(n), slice(n, None)))
    return ("A", A), ("B", B), ("C", C), ("D", D), ("inputs", inputs), ("outputs", outputs), ("discrete", True)


def _meanings(keys, period):
    """What names in a formula stand for."""
    known = {name: tree for name, tree in keys if isinstance(tree, tuple)} | {"T": period}
    known["ahead"] = ("number", AHEAD.get(dict(keys).get("method"), 0.0), 0)
    return {name: with_trees(parse(text), known) for name, text in DEFINED.items()} | known
