"""The blocks that a spec can draw, in ball arithmetic: `x+ = A x + B u`, `y = C x + D u`.

They are written down from their equations once more, in z and not in delta form; words of firmware have the formulas of
`wavesweep.spec.firmware_blocks`, as elsewhere. An entry is 0 exactly if it is 0 for every number in the balls of its keys.
"""

from __future__ import annotations

from typing import Any

from flint import acb_mat, arb, arb_mat

from wavesweep.spec.firmware_blocks import DELTA
from wavesweep.spec.keys import AHEAD

SENT = {"explicit": 1.0, "implicit": 1.0, "trapezoidal": 0.5}  # share of an avatar's step in the position that it sends back

Rows = list[list[Any]]
Matrices = tuple[Rows, Rows, Rows, Rows]


def matrices(kind: str, T: Any, keys: dict[str, Any]) -> Matrices:  # noqa: C901, PLR0911 - a table of the blocks
    """A, B, C and D of a block of a type; T: its period (s), an arb or an acb, as are the numbers among its keys."""
    match kind:
        case "mass" | "inertia" | "spring" | "ss" | "tf":
            A, B, C, D = continuous(kind, keys)
            return (A, B, C, D) if keys.get("discrete") or not A else (*held(A, B, T), C, D)
        case "gain":
            return _static([[keys["k"]]])
        case "hold":
            return _static([[1]])
        case "delay":
            n = keys["steps"]
            A = [[int(i == j + 1) for j in range(n)] for i in range(n)]
            return A, [[int(i == 0)] for i in range(n)], [[int(i == n - 1) for i in range(n)]], [[int(n == 0)]]
        case "mean":
            n = keys["n"]
            A, B, _, _ = matrices("delay", T, {"steps": n - 1})
            return A, B, [[1 / type(T)(n)] * (n - 1)], [[1 / type(T)(n)]]
        case "difference":
            return [[0]], [[1]], [[-1 / T]], [[1 / T]]
        case "integrator":
            return [[1]], [[T]], [[1]], [[AHEAD[keys["method"]] * T]]
        case "butterworth":
            return _butterworth(keys["order"], keys["cutoff_hz"], keys["pass"] != "low", T)  # noqa: S105 - the side that passes
        case "wave":
            b, root = keys["b"], _root(2 * keys["b"])
            return _static([[b, -root], [root, -1]] if keys["gives"] == "force" else [[-1 / b, root / b], [-root / b, 1]])
        case "avatar":
            along, against = _root(2 / keys["b"]), -1 / keys["b"]
            read, sent = AHEAD[keys["integration"]] * T, SENT[keys["integration"]] * T
            D = [[along, against], [sent * along, sent * against], [read * along, read * against], [1, -along]]
            return [[1]], [[T * along, T * against]], [[0], [1], [1], [0]], D
        case "local_model":
            along, K = _root(2 * keys["b"]), keys["K"]
            total = keys["b"] + keys["B"] + K * (AHEAD[keys["integration"]] * T)
            return [[1 - T * K / total]], [[T * along / total]], [[-along * K / total]], [[along * along / total - 1]]
    raise KeyError(kind)


def continuous(kind: str, keys: dict[str, Any]) -> Matrices:
    """A, B, C and D of a continuous block, `x' = A x + B u`; of a discrete one they are those of a run."""
    match kind:
        case "spring":
            k, d = keys["k"], keys["d"]
            return _static([[-k, -d, k, d], [k, d, -k, -d]])
        case "ss" | "tf":
            return _state_space(**keys) if kind == "ss" else _transfer_function(**keys)
    m, d, k = (keys[name] for name in (kind, "damping", "stiffness"))
    return [[-d / m, -k / m], [1, 0]], [[1 / m], [0]], [[0, 1], [1, 0]], [[0], [0]]


def _static(D):
    return [], [], [[] for _ in D], D


def _root(value):
    return value.sqrt() if isinstance(value, arb) else value.sqrt(analytic=True)


def held(A, B, T):
    """A and B of a continuous block whose inputs are held over the period."""
    n, m = len(A), len(B[0])
    rows = [[type(T)(entry) * T for entry in (*a, *b)] for a, b in zip(A, B, strict=True)]
    kind = arb_mat if isinstance(T, arb) else acb_mat
    whole = kind(rows + [[0] * (n + m) for _ in range(m)]).exp().tolist()[:n]
    return [row[:n] for row in whole], [row[n:] for row in whole]


def _state_space(A, B, C, D, inputs, outputs, discrete):
    del discrete
    return A, B, C, D or [[0] * len(inputs) for _ in outputs]


def _transfer_function(num, den, discrete):
    """The controllable form of coefficients of descending powers."""
    n, lead = len(den) - 1, den[0]
    a, b = [each / lead for each in den[1:]], [0] * (n + 1 - len(num)) + [each / lead for each in num]
    A = [[-each for each in a]] + [[int(i == j) for j in range(n)] for i in range(n - 1)]
    if discrete == DELTA:
        A = [[each + int(i == j) for j, each in enumerate(row)] for i, row in enumerate(A)]
    C = [[each - factor * b[0] for each, factor in zip(b[1:], a, strict=True)]]
    return A[:n], [[int(i == 0)] for i in range(n)], C, [[b[0]]]


def _butterworth(order, cutoff_hz, high, T):
    """Sections `(b0 + b1 z^-1 + b2 z^-2)/(1 + a1 z^-1 + a2 z^-2)` in series, from the bilinear transform."""
    found = [], [], [[]], [[1]]
    w, far = (type(T).pi() * cutoff_hz * T).tan() if order else T, -1 if high else 1
    for k in range(order // 2):
        sine = (arb.pi() * (2 * k + 1) / (2 * order)).sin()
        bottom = 1 + 2 * sine * w + w * w
        b0, a1, a2 = (1 if high else w * w) / bottom, 2 * (w * w - 1) / bottom, (1 - 2 * sine * w + w * w) / bottom
        found = _in_series(found, ([[-a1, 1], [-a2, 0]], [[2 * far * b0 - a1 * b0], [b0 - a2 * b0]], [[1, 0]], [[b0]]))
    if order % 2:
        b0, a1 = (1 if high else w) / (1 + w), (w - 1) / (1 + w)
        found = _in_series(found, ([[-a1]], [[far * b0 - a1 * b0]], [[1]], [[b0]]))
    return found


def _in_series(first, second):
    """A block of one signal after another one."""
    (A, B, C, D), (a, b, c, d) = first, second
    below = [[b[i][0] * entry for entry in C[0]] + a[i] for i in range(len(a))]
    return (
        [row + [0] * len(a) for row in A] + below,
        B + [[each[0] * D[0][0]] for each in b],
        [[d[0][0] * entry for entry in C[0]] + c[0]],
        [[d[0][0] * D[0][0]]],
    )
