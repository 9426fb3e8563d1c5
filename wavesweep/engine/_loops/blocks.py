"""The blocks that a spec can draw, as doubles: each from its numbers and its own period, in delta
form.

What they do is written in `definitions`; here it becomes arrays, exact over a tick for what is
continuous, with the sizes of terms that cancel. Numbers are scalars or arrays over a batch, real or
complex. Matrices of `ss` are lists of rows of these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawn_block import DELTA
from wavesweep.engine._drawing.mass_matrix import MATRICES, adjugate, at_axes, determinant
from wavesweep.engine._loops import definitions
from wavesweep.engine._loops.block import SPARSE_ROWS, SPARSE_SHARE, Block, matrix, numbers
from wavesweep.engine._loops.definitions import Equations, controllable, tf_at_rest, with_delays
from wavesweep.engine._loops.device import LOST_PHASE, SERIES_REACH, impulse_and_step, motion
from wavesweep.engine._loops.filters import butterworth as sections
from wavesweep.engine.doubles import EPS, LARGEST_DOUBLE

if TYPE_CHECKING:
    from wavesweep.engine._state_space import StateSpace

WITHOUT_PERIOD = ("mean", "impulse")  # whose equations are the same at every period
LABELS = {  # of the states of a block, for messages
    "difference": "input of the last run",
    "integrator": "integral",
    "avatar": "position",
    "local_model": "model position",
}


def mass(
    name: str,
    period: np.ndarray | float,
    mass: np.ndarray | float,
    damping: np.ndarray | float = 0.0,
    stiffness: np.ndarray | float = 0.0,
) -> Block:
    """`m x'' + d x' + k x = f` with f held over the period: exact. `f` (N) -> `x` (m), `v`
    (m/s)."""
    m = numbers(mass)
    keys = {"damping": numbers(damping), "stiffness": numbers(stiffness)}
    d = keys["damping"] / m
    k = keys["stiffness"] / m
    s, g, of_s, of_g = impulse_and_step(d, k, period)
    E, B = motion(s, g, -d, -k, m)
    parts: tuple[Any, ...] = E, B, [[0, 1], [1, 0]], [[0], [0]]
    at_rest = definitions.at_rest("mass", keys, np.sqrt)
    block = _block(name, ("f",), ("x", "v"), Equations(("v", "x"), *parts), at_rest)
    sizes: tuple[np.ndarray, ...] = ()
    if of_s is not None:
        of_E, of_B = motion(of_s, of_g, np.abs(d), np.abs(k), np.abs(m))
        sizes = of_E, of_B, block.C, block.D
    return replace(block, terms=sizes, labels=(f"{name} velocity", f"{name} position"))


def inertia(
    name: str,
    period: np.ndarray | float,
    inertia: np.ndarray | float,
    damping: float = 0.0,
    stiffness: float = 0.0,
) -> Block:
    """A `mass` that turns: `f` (N*m) -> `x` (rad), `v` (rad/s)."""
    return mass(name, period, inertia, damping, stiffness)


def mass_matrix(name: str, period: np.ndarray | float, **keys: Any) -> Block:
    """`M a + D v + K x = f` with the forces held over the period: exact."""
    states, (A, B, C, D) = continuous("mass_matrix", keys)
    E, G, *of_E_and_G = held(A, B, period, sizes_of("mass_matrix", keys, A, B))
    terms = (*of_E_and_G, np.abs(C), np.abs(D))
    inputs, outputs = TYPES["mass_matrix"].ports_of(keys)
    n = len(inputs)
    at_rest = _arrays(definitions.at_rest("mass_matrix", keys, np.sqrt), 2 * n, n, 2 * n)
    labels = tuple(
        f"{name} {kind} {axis}" for kind in ("velocity", "position") for axis in keys["axes"]
    )
    pivot = pivot_of("mass_matrix", keys)
    block = Block(name, inputs, outputs, states, E, G, C, D, terms=terms, pivot=pivot)
    return replace(block, at_rest=at_rest, labels=labels)


def pivot_of(kind: str, keys: dict[str, Any]) -> np.ndarray | float:
    """What the entries of a continuous block are divided by, which makes poles of them where it
    is zero."""
    return numbers(determinant(at_axes(keys, "mass"))) if kind == "mass_matrix" else 1.0


def sizes_of(
    kind: str, keys: dict[str, Any], A: np.ndarray, B: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The sizes of the terms of the sums that the entries of A and B of a continuous block are."""
    if kind != "mass_matrix":
        return np.abs(A), np.abs(B)
    M, D, K = (matrix(at_axes(keys, key)) for key in MATRICES)
    sizes = {}
    for name in (*MATRICES, "through"):
        sizes[name] = [[np.abs(numbers(key)) for key in row] for row in keys[name]]
    of_M, of_D, of_K = (at_axes({**keys, **sizes}, key) for key in MATRICES)
    n = M.shape[-1]
    inverse = B[..., :n, :]
    of_determinant = matrix([[determinant(of_M, 1)]])
    of_adjugate = matrix(adjugate(of_M, 1))
    of_inverse = of_adjugate + np.abs(inverse) * of_determinant
    of_inverse = of_inverse / np.abs(np.linalg.det(M))[..., None, None]
    of_damping = of_inverse @ np.abs(D) + np.abs(inverse) @ matrix(of_D)
    of_stiffness = of_inverse @ np.abs(K) + np.abs(inverse) @ matrix(of_K)
    parts = A, of_damping, of_stiffness, of_inverse
    batch = np.broadcast_shapes(*(part.shape[:-2] for part in parts))
    of_A = np.array(np.broadcast_to(np.abs(A), (*batch, *A.shape[-2:])))
    of_B = np.array(np.broadcast_to(np.abs(B), (*batch, *B.shape[-2:])))
    of_A[..., :n, :n] = of_damping
    of_A[..., :n, n:] = of_stiffness
    of_B[..., :n, :] = of_inverse
    return of_A, of_B


def spring(
    name: str, period: np.ndarray | float, k: np.ndarray | float, d: np.ndarray | float = 0.0
) -> Block:
    """`f1 = k (x2 - x1) + d (v2 - v1)` on one end, `f2 = -f1` on the other."""
    del period
    keys = {"k": numbers(k), "d": numbers(d)}
    inputs, outputs = TYPES["spring"].ports
    return _block(name, inputs, outputs, definitions.continuous("spring", keys))


def ss(
    name: str,
    period: np.ndarray | float,
    A: list[list[Any]] | np.ndarray,
    B: list[list[Any]] | np.ndarray,
    C: list[list[Any]] | np.ndarray,
    D: list[list[Any]] | np.ndarray,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    discrete: bool = False,
    rests: list[list[float]] | None = None,
) -> Block:
    """State-space model with the ports `inputs` and `outputs`; continuous ones have their inputs
    held: exact.

    rests: of a discrete one, the parts of the entries of A that rounding has taken.
    """
    n = len(A)
    m = len(inputs)
    p = len(outputs)
    A = _matrix(A, (n, n))
    B = _matrix(B, (n, m))
    C = _matrix(C, (p, n))
    D = _matrix(D, (p, m))
    states = tuple(f"x{i}" for i in range(n))
    if discrete:
        rest = 0.0 if rests is None else _matrix(rests, (n, n))
        return Block(name, tuple(inputs), tuple(outputs), states, A - np.eye(n) + rest, B, C, D)
    E, G, *sizes = held(A, B, period)
    block = Block(name, tuple(inputs), tuple(outputs), states, E, G, C, D, at_rest=(A, B, C, D))
    if not sizes:
        return block
    return replace(block, terms=(*sizes, np.abs(block.C), np.abs(block.D)))


def tf(
    name: str,
    period: np.ndarray | float,
    num: Sequence[Any],
    den: Sequence[Any],
    discrete: bool | str = False,
    rests: tuple[list[float], list[float]] | None = None,
) -> Block:
    """Transfer function from coefficients of descending powers, in controllable form; `u` -> `y`.

    A discrete one is realised in powers of z - 1, or of z + 1 if its poles are plain numbers and
    nearer to -1, to which its coefficients are taken without rounding: in powers of z, the ticks of
    a long frame would grow and cancel. Poles that are written as 0 are delays. rests: the parts of
    the coefficients that rounding has taken. Accuracy: that of the coefficients, whose roots lose
    digits at high orders; `butterworth` and `ss` do not.
    """
    if discrete and discrete != DELTA:
        of_num, of_den = rests or ([0.0] * len(num), [0.0] * len(den))
        return _discrete_tf(name, num, den, of_num, of_den)
    num = [numbers(coefficient) for coefficient in num]
    den = [numbers(coefficient) for coefficient in den]
    n = len(den) - 1
    equations = controllable(num, den)
    if discrete:
        block = _block(name, ("u",), ("y",), equations, tf_at_rest(num, den))
        direct, *further = definitions.over(num, den)
        of_C = []
        for a, b in zip(den[1:], further, strict=True):
            of_C.append(abs(b) + abs(a / den[0] * direct))
        sizes = np.abs(block.E), np.abs(block.B), _matrix([of_C], (1, n)), np.abs(block.D)
        return replace(block, terms=sizes)
    block = ss(name, period, *equations[1:], ("u",), ("y",))
    return replace(block, at_rest=_arrays(tf_at_rest(num, den), n, 1, 1)) if n else block


def _trailing_zeros(coefficients: Sequence[Any]) -> int:
    """The number of coefficients at the end that are zero and no arrays; 0 if all are."""
    for at, coefficient in enumerate(reversed(coefficients)):
        if type(coefficient) not in (int, float) or coefficient:
            return at
    return 0


def _discrete_tf(
    name: str, num: Sequence[Any], den: Sequence[Any], of_num: list[float], of_den: list[float]
) -> Block:
    """`num(z)/(z^k rest(z))`: the input goes through `1/rest` and then k delays, which the last
    k coefficients read.

    In powers of z - c the states have the matrix E + c of these, so the delta form has E + c - 1.
    """
    k, centre = realisation(den)
    n = len(den) - 1 - k
    padding = [0.0] * (len(den) - len(num))
    num = [*padding, *num]
    of_num = [*padding, *of_num]
    numerator = [numbers(coefficient) for coefficient in num[: n + 1]]
    denominator = [numbers(coefficient) for coefficient in den[: n + 1]]
    later = [numbers(coefficient) / den[0] for coefficient in num[n + 1 :]]

    def about(centre: int) -> tuple[list[float], list[float]]:
        above = recentred(centre, numerator, of_num[: n + 1])
        return above, recentred(centre, denominator, of_den[: n + 1])

    equations = controllable(*about(centre))
    E = []
    for i, row in enumerate(equations.E):
        E.append([entry + (centre - 1) * (i == j) for j, entry in enumerate(row)])
    equations = with_delays(equations._replace(E=E), later)
    rest: tuple[list[list[Any]], ...] | None = None
    if centre == -1:
        # At rest a pole near -1 leaves its states out: y is a multiple of the last one, or of the
        # input.
        above, below = about(1)
        C = [[*[0.0] * n, *later]]
        rest = equations.E, equations.B, C, [[above[-1] / below[-1]]]
    elif n:
        rest = tf_at_rest(*about(1), later)
    return _block(name, ("u",), ("y",), equations, rest)


def realisation(den: Sequence[Any]) -> tuple[int, int]:
    """Return how many delays a transfer function in z has at its end, and the centre, 1 or -1,
    of the powers of the rest."""
    delays = _trailing_zeros(den)
    return delays, -1 if _near_minus_one(den[: len(den) - delays]) else 1


def _near_minus_one(den: Sequence[Any]) -> bool:
    """Whether the roots are nearer to -1 than to 1 by a bound on them (Fujiwara 1916), and none is
    1.

    Only plain numbers decide, since the states of a loop must not change along a sweep.
    """
    if not all(type(value) in (int, float) for value in den):
        return False
    ones = np.abs(recentred(1, den))
    minus = np.abs(recentred(-1, den))
    return _bound_on_roots(minus) < _bound_on_roots(ones) and ones[-1] > 0


def _bound_on_roots(sizes: np.ndarray) -> float:
    """A bound on the sizes of roots, but for a factor, from those of coefficients of descending
    powers (Fujiwara 1916)."""
    return np.max((sizes[1:] / sizes[0]) ** (1 / np.arange(1, len(sizes))), initial=0.0)


def recentred(
    centre: int, coefficients: Sequence[Any], rests: list[float] | None = None
) -> list[Any]:
    """Return the coefficients d of a polynomial in powers of z - c, c = 1 or -1, from its
    coefficients a in powers of z, both in descending order:

        p(z) = sum_k a_k z^(n - k) = sum_k d_k (z - c)^(n - k).

    For c = 1, Horner's scheme divides p by z - 1, then the quotient, and so on: each division is a
    row of sums, a_i + a_(i - 1), and leaves one more d_k, the last one first. The roundings of all
    sums are computed (D. E. Knuth, TAOCP 2, 4.2.2, theorem B), and added in the end. rests: what
    rounding took from the coefficients a before, 0 if absent.
    """
    rests = rests or [0] * len(coefficients)
    if centre < 0:  # of q(w) = p(-w), w = -z, since z + 1 = -(w - 1)
        signs = [(-1.0) ** power for power in reversed(range(len(coefficients)))]
        mirrored = [sign * a for sign, a in zip(signs, coefficients, strict=True)]
        mirrored_rests = [sign * rest for sign, rest in zip(signs, rests, strict=True)]
        about_one = recentred(1, mirrored, mirrored_rests)
        return [sign * d for sign, d in zip(signs, about_one, strict=True)]
    sums = list(coefficients)
    lost = list(rests)
    for end in range(len(sums), 1, -1):
        for i in range(1, end):
            total = sums[i] + sums[i - 1]
            added = total - sums[i]
            rounding = (sums[i] - (total - added)) + (sums[i - 1] - added)
            lost[i] = lost[i] + lost[i - 1] + rounding
            sums[i] = total
    return [total + rest for total, rest in zip(sums, lost, strict=True)]


def butterworth(
    name: str,
    period: np.ndarray | float,
    order: int,
    cutoff_hz: np.ndarray | float,
    passes: str = "low",
) -> Block:
    """Butterworth filter by the bilinear transform with prewarping, in normal form; `u` -> `y`."""
    return sections(name, order, cutoff_hz, period, highpass=passes == "high")


def defined(kind: str, name: str, period: np.ndarray | float, **keys: Any) -> Block:
    """A block of a type that `definitions.running` defines, with its keys; see its description
    in `TYPES`."""
    period = 1.0 if kind in WITHOUT_PERIOD else numbers(period)
    keys = _with_numbers(kind, keys)
    equations = definitions.running(kind, period, keys, np.sqrt)
    rest = definitions.at_rest(kind, keys, np.sqrt)
    labels = (f"{name} {LABELS[kind]}",) if kind in LABELS else ()
    return replace(_block(name, *TYPES[kind].ports_of(keys), equations, rest), labels=labels)


def _with_numbers(kind: str, keys: dict[str, Any]) -> dict[str, Any]:
    """The keys of a block of this type, those that are numbers as arrays."""
    types = {name: key.type for name, key in TYPES[kind].keys.items()}
    return {
        name: numbers(value) if types[name] == "number" else value for name, value in keys.items()
    }


def continuous(kind: str, keys: dict[str, Any]) -> tuple[tuple[str, ...], tuple[np.ndarray, ...]]:
    """States and matrices `x' = A x + B u`, `y = C x + D u` of a continuous block of this type."""
    keys = _with_numbers(kind, keys)
    for name in ("num", "den") if kind == "tf" else ():
        keys[name] = [numbers(coefficient) for coefficient in keys[name]]
    states, *matrices = definitions.continuous(kind, keys)
    inputs, outputs = TYPES[kind].ports_of(keys)
    return states, _arrays(matrices, len(states), len(inputs), len(outputs))


class HeldMatrices(NamedTuple):
    """`held` with the changes of both by a rounding of each term of all sums."""

    E: np.ndarray
    G: np.ndarray
    of_E: np.ndarray
    of_G: np.ndarray


def held(
    A: np.ndarray,
    B: np.ndarray,
    period: np.ndarray | float,
    sizes: tuple[np.ndarray, np.ndarray] | None = None,
) -> HeldMatrices | tuple[np.ndarray, np.ndarray]:
    """`E = exp(A T) - 1` and `G = int_0^T exp(A s) ds B`: a Taylor series over T/2^k, then k
    doublings in delta form,

        G -> 2 G + E G,   E -> 2 E + E E

    A `(..., n, n)`, B `(..., n, m)`. sizes: of the terms of the sums that the entries of A and B
    are. If they are given, or if there is something to double, two more arrays are the changes of
    the results by a rounding of each term of all sums, in roundings; otherwise they are known to a
    few roundings of themselves. In a doubling they go through the derivative of the formula, and
    the sizes of its own terms are added. Accuracy: some roundings of each entry for matrices that
    are not far from normal, unless they turn by much in a period; NaN if they have lost their
    phase (LOST_PHASE).
    """
    T = numbers(period)[..., None, None]
    A = np.broadcast_arrays(A * T, np.zeros(1))[0]
    B = B * T
    size = np.abs(A) if sizes is None else sizes[0] * np.abs(T)
    size = size.sum(-1).max(-1, initial=0.0)
    with np.errstate(divide="ignore"):
        doublings = np.ceil(np.log2(np.minimum(size, LARGEST_DOUBLE) / SERIES_REACH))
        doublings = np.maximum(0, doublings).astype(int)
    step = 0.5 ** doublings[..., None, None]
    E, G = _series(A * step, B * step)
    if sizes is None and not doublings.any():
        return E, G
    if sizes is None:
        of_E = np.abs(E)
        of_G = np.abs(G)
    else:
        of_A, of_B = (size * np.abs(T) * step for size in sizes)
        of_E, of_G = _series(of_A, of_B)
    eye = np.eye(E.shape[-1])
    certain = np.ones(doublings.shape, bool)
    with np.errstate(over="ignore", invalid="ignore"):
        for turn in range(int(doublings.max(initial=0))):
            unfinished = (turn < doublings)[..., None, None]
            size = np.abs(E)
            size_after = np.abs(E + eye)
            terms_G = 2 * np.abs(G) + size @ np.abs(G)
            next_of_G = of_E @ np.abs(G) + np.abs(E + 2 * eye) @ of_G + terms_G
            next_of_E = of_E @ size_after + size_after @ of_E + 2 * size + size @ size
            of_G = np.where(unfinished, next_of_G, of_G)
            of_E = np.where(unfinished, next_of_E, of_E)
            G = np.where(unfinished, 2 * G + E @ G, G)
            E = np.where(unfinished, 2 * E + E @ E, E)
            lost = EPS * of_E > LOST_PHASE * np.maximum(1, np.abs(E + eye))
            certain &= ~np.diagonal(lost, axis1=-2, axis2=-1).any(-1)
    is_certain = certain[..., None, None]
    return HeldMatrices(
        np.where(is_certain, E, np.nan), np.where(is_certain, G, np.nan), of_E, of_G
    )


class Rates(NamedTuple):
    """The rates of the states of a plant, `x' = A x + B u` with u held over a period (s), and the
    sizes of the terms of the sums that the entries of A and B are."""

    A: np.ndarray
    B: np.ndarray
    of_A: np.ndarray
    of_B: np.ndarray
    period: np.ndarray | float

    def over(
        self, share: np.ndarray | float = 1, columns: list[int] | slice = slice(None)
    ) -> HeldMatrices:
        """E and G of `held` over a share of the period; columns: some of those of B."""
        sizes = self.of_A, self.of_B[..., columns]
        matrices = held(self.A, self.B[..., columns], share * self.period, sizes)
        return matrices  # type: ignore[return-value]  # sizes are given


def _series(A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`exp(A) - 1` and `int_0^1 exp(A s) ds B` for small A."""
    E = np.zeros(())
    G = np.zeros(())
    power = A
    force = B
    right_A = _by_entries(A)
    right_B = _by_entries(B)
    # Taylor series of exp; for a matrix of SERIES_REACH what follows is below rounding.
    for term in range(1, 20):
        E = E + power
        G = G + force
        force = power @ right_B / (term + 1)
        power = power @ right_A / (term + 1)
    return E, G


def _by_entries(A: np.ndarray) -> np.ndarray:
    """A matrix, as the entries that are not zero if it has many rows with few of these."""
    if A.ndim > 2 or len(A) < SPARSE_ROWS or np.count_nonzero(A) > SPARSE_SHARE * A.size:
        return A
    from scipy.sparse import csc_array

    return csc_array(A)


def _matrix(rows: Any, shape: tuple[int, int]) -> np.ndarray:
    return matrix(rows) if all(shape) else np.zeros(shape)


def _arrays(parts: Any, n: int, m: int, p: int) -> tuple[np.ndarray, ...]:
    """E, B, C and D as arrays; D alone if that is all that is given."""
    shapes = ((n, n), (n, m), (p, n), (p, m))[-len(parts) :]
    arrays = []
    for rows, shape in zip(parts, shapes, strict=True):
        arrays.append(rows if isinstance(rows, np.ndarray) else _matrix(rows, shape))
    return tuple(arrays)


def _block(
    name: str,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    equations: Equations,
    rest: StateSpace | tuple[list[list[Any]], ...] | None = None,
) -> Block:
    """A block of equations, and of those at rest."""
    sizes = len(equations.states), len(inputs), len(outputs)
    at_rest = rest and _arrays(rest, *sizes)
    E, B, C, D = _arrays(equations[1:], *sizes)
    states = equations.states
    return Block(name, tuple(inputs), tuple(outputs), states, E, B, C, D, at_rest=at_rest)
