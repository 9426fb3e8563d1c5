"""What each type of block does, written once for numbers of every kind: doubles and arrays of them,
balls, fractions.

A block is `x[k+1] - x[k] = E x[k] + B u[k]`, `y[k] = C x[k] + D u[k]`, a continuous one `x' = A x +
B u`. Matrices are lists of rows. The frames of a loop, in doubles and in balls, and its equations
at rest follow from these definitions; the simulation alone has others, since it is the witness
against them. Filters (`filters`) are not here: their entries are not rational.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.mass_matrix import MATRICES, adjugate, at_axes, determinant

Rows = list[list[Any]]
Root = Callable[[Any], Any]  # the square root of numbers of a kind


class Equations(NamedTuple):
    """The equations of a block: names of its states, and its matrices; `E` is A of a continuous
    one."""

    states: tuple[str, ...]
    E: Rows
    B: Rows
    C: Rows
    D: Rows


def running(kind: str, T: Any, keys: Mapping[str, Any], root: Root) -> Equations:
    """Return what a block does in a run. T: its own period (s).

    Errors: KeyError for a type that is not defined here.
    """
    match kind:
        case "gain":
            return _static([[keys["k"]]])
        case "hold" | "channel":
            return _static([[1]])
        case "wave":
            b = keys["b"]
            r = root(2 * b)
            if keys["gives"] == "force":
                return _static([[b, -r], [r, -1]])
            return _static([[-1 / b, r / b], [-r / b, 1]])
        case "delay":
            steps = keys["steps"]
            if not steps:
                return _static([[1]])
            return with_delays(_static([[0]]), [0] * (steps - 1) + [1])
        case "mean":
            share = 1 / (0 * T + keys["n"])
            return with_delays(_static([[share]]), [share] * (keys["n"] - 1))
        case "difference":
            return Equations(("u1",), [[-1]], [[1]], [[-1 / T]], [[1 / T]])
        case "integrator":
            return Equations(("s",), [[0]], [[T]], [[1]], [[_ahead(T, keys["method"])]])
        case "impulse":
            return Equations(("s",), [[0]], [[1]], [[1]], [[1]])
        case "avatar":
            # The state is the start of the step, so that s+ = s + T v in all integrations; a
            # trapezium has half of the last step in it.
            b = keys["b"]
            r = root(2 * b)
            speed = [r / b, -1 / b]
            read = _ahead(T, keys["integration"])
            sent = T / 2 if keys["integration"] == "trapezoidal" else T
            step = [T * gain for gain in speed]
            position_sent = [sent * gain for gain in speed]
            position_read = [read * gain for gain in speed]
            D = [speed, position_sent, position_read, [1, -r / b]]
            return Equations(("s",), [[0]], [step], [[0], [1], [1], [0]], D)
        case "local_model":
            # v = (r in - K s)/(b + B + K read) solves the step, and out = (r/b) b v - in.
            K = keys["K"]
            r = root(2 * keys["b"])
            total = keys["b"] + keys["B"] + K * _ahead(T, keys["integration"])
            by_input = r / total
            by_position = -K / total
            E = [[T * by_position]]
            B = [[T * by_input]]
            return Equations(("s",), E, B, [[r * by_position]], [[r * by_input - 1]])
    raise KeyError(kind)


def continuous(kind: str, keys: Mapping[str, Any]) -> Equations:
    """Return the rates of a continuous block; of a discrete `ss` the matrices as they are."""
    if TYPES[kind].body:
        m = keys[TYPES[kind].body]
        d = keys["damping"]
        k = keys["stiffness"]
        A = [[-d / m, -k / m], [1, 0]]
        return Equations(("v", "x"), A, [[1 / m], [0]], [[0, 1], [1, 0]], [[0], [0]])
    if kind == "mass_matrix":
        return _mass_matrix(keys)
    if kind == "spring":
        k = keys["k"]
        d = keys["d"]
        return _static([[-k, -d, k, d], [k, d, -k, -d]])
    if kind == "tf":
        return controllable(keys["num"], keys["den"])
    states = tuple(f"x{i}" for i in range(len(keys["A"])))
    D = keys["D"] or [[0] * len(keys["inputs"]) for _ in keys["outputs"]]
    C = keys["C"] or [[] for _ in D]
    return Equations(states, keys["A"], keys["B"], C, D)


def _mass_matrix(keys: Mapping[str, Any]) -> Equations:
    """`v' = M^-1 (f - D v - K x)`, `x' = v` in the states v and x; the outputs are x and v."""
    names = keys["axes"]
    n = len(names)
    M, D, K = (at_axes(keys, name) for name in MATRICES)
    total = determinant(M)
    inverse = [[entry / total for entry in row] for row in adjugate(M)]
    pulled = []
    for row in inverse:
        by_state = []
        for matrix in (D, K):
            for column in zip(*matrix, strict=True):
                by_state.append(-sum(a * b for a, b in zip(row, column, strict=True)))
        pulled.append(by_state)
    unit = _unit(2 * n)
    none = [[0] * n for _ in names]
    states = (*(f"v{name}" for name in names), *names)
    return Equations(states, pulled + unit[:n], inverse + none, unit[n:] + unit[:n], none + none)


def at_rest(kind: str, keys: Mapping[str, Any], root: Root) -> tuple[Rows, ...] | None:
    """Return what a block does while nothing changes, `0 = E x + B u`, `y = C x + D u`, without
    rounding.

    D alone if y follows u whatever the states are. None: what it does in a run is all that is
    known. For example, a wave comes back from an avatar at rest with the other sign, which its
    entries in a run show only up to rounding.
    """
    if TYPES[kind].body:
        E = [[-keys["damping"], -keys["stiffness"]], [1, 0]]
        return E, [[1], [0]], [[0, 1], [1, 0]], [[0], [0]]
    match kind:
        case "mass_matrix":
            return _mass_matrix_at_rest(keys)
        case "spring":
            return (continuous(kind, keys).D,)
        case "gain" | "hold" | "channel":
            return (running(kind, 1, keys, root).D,)
        case "wave":
            # with an impedance whose root is exact, since waves that meet cancel whatever it is
            b = root(2 * keys["b"]) ** 2 / 2
            return (running(kind, 1, {**keys, "b": b}, root).D,)
        case "delay" | "mean":
            return ([[1]],)
        case "difference":
            return ([[0]],)
        case "integrator":
            return [[0]], [[1]], [[1]], [[0]]
        case "impulse":
            return [[0]], [[1]], [[1]], [[1]]
        case "avatar":
            B = [[root(2 * keys["b"]), -1]]
            D = [[0, 0], [0, 0], [0, 0], [-1, 0]]
            return [[0]], B, [[0], [1], [1], [0]], D
        case "local_model":
            return [[-keys["K"]]], [[root(2 * keys["b"])]], [[0]], [[-1]]
        case "ss":
            _, A, B, C, D = continuous(kind, keys)
            E = []
            for i, row in enumerate(A):
                E.append([entry - (i == j) * keys["discrete"] for j, entry in enumerate(row)])
            return E, B, C, D
        case "tf" if not keys["discrete"]:
            return tf_at_rest(keys["num"], keys["den"])
    return None


def _mass_matrix_at_rest(keys: Mapping[str, Any]) -> tuple[Rows, ...]:
    """`0 = f - D v - K x`, `0 = v`."""
    _, A, _, C, none = continuous("mass_matrix", keys)
    n = len(keys["axes"])
    _, damping, stiffness = (at_axes(keys, name) for name in MATRICES)
    pulled = []
    for by_velocity, by_position in zip(damping, stiffness, strict=True):
        pulled.append([-entry for entry in (*by_velocity, *by_position)])
    forces = [row[:n] for row in _unit(2 * n)]
    return pulled + A[n:], forces, C, none


def tf_at_rest(
    num: Sequence[Any], den: Sequence[Any], later: Sequence[Any] = ()
) -> tuple[Rows, ...]:
    """Return `at_rest` of a transfer function from coefficients of descending powers of s or z - 1;
    later: see `with_delays`.

    The first state does not change, so y is the sum of the states times the numerator's
    coefficients but the first. The state of an integrator that is alone may count for ever, if its
    coefficient is 0; y follows u then.
    """
    equations = controllable(num, den)
    if not equations.states:
        return with_delays(equations, later)[1:]
    b = over(num, den)
    direct = b[0] * (den[-1] == 0) if len(equations.states) == 1 else 0  # of each loop of several
    return with_delays(equations._replace(C=[b[1:]], D=[[direct]]), later)[1:]


def over(num: Sequence[Any], den: Sequence[Any]) -> list[Any]:
    """Return coefficients of the numerator, as many as those of the denominator, over the first
    one of that."""
    return [0] * (len(den) - len(num)) + [coefficient / den[0] for coefficient in num]


def controllable(num: Sequence[Any], den: Sequence[Any]) -> Equations:
    """Return a transfer function from coefficients of descending powers; each state but the
    first integrates the one before."""
    n = len(den) - 1
    states = tuple(f"x{i}" for i in range(n))
    a = [coefficient / den[0] for coefficient in den[1:]]
    b = over(num, den)
    A = [[-coefficient for coefficient in a], *_unit(n)[:-1]]
    B = [[int(i == 0)] for i in range(n)]
    C = [coefficient - factor * b[0] for coefficient, factor in zip(b[1:], a, strict=True)]
    return Equations(states, A[:n], B, [C], [[b[0]]])


def with_delays(equations: Equations, later: Sequence[Any]) -> Equations:
    """Return a block of one output with delays behind its last state, or behind its input; y
    adds each times one of `later`.

    The first delay of a block without states reads the input, each other one the state before it.
    """
    n = len(equations.states)
    k = len(later)
    states = (*equations.states, *(f"u{j + 1}" for j in range(k)))
    E = [[*row, *[0] * k] for row in equations.E]
    B = list(equations.B)
    for j in range(n, n + k):
        row = [0] * (n + k)
        row[j] = -1
        if j:
            row[j - 1] = 1
        E.append(row)
        B.append([int(j == 0)])
    return Equations(states, E, B, [[*equations.C[0], *later]], equations.D)


def _static(D: list[list[Any]]) -> Equations:
    """A block without states."""
    return Equations((), [], [], [[] for _ in D], D)


def _unit(size: int) -> list[list[int]]:
    """The rows of a unit matrix."""
    return [[int(i == j) for j in range(size)] for i in range(size)]


def _ahead(T: Any, method: str) -> Any:
    """The share of a step's velocity that is read in the step itself, in seconds (`AHEAD` in
    `spec.keys`)."""
    return {"explicit": 0, "implicit": T, "trapezoidal": T / 2}[method]
