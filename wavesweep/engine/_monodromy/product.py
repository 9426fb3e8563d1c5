"""The product of the ticks of a frame in delta form, with a bound on the error of every entry.

Ticks are maps `x -> (I + E) x + B u`, u being constant over the frame. Their product less identity
is computed without forming I + E, which keeps the distance of slow poles from 1 in all its digits,
and repeated stretches are multiplied once.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from itertools import groupby
from typing import Any

import numpy as np

from wavesweep.engine._monodromy.batches import in_parts
from wavesweep.engine._monodromy.bounded import sum_rounding
from wavesweep.engine._monodromy.periodic import in_a_row
from wavesweep.engine.components import strong_components
from wavesweep.engine.doubles import ENTRY_ROUNDING
from wavesweep.engine.rows import different

# ticks, or stretches of them, one after the other, over which errors are summed up
SUMMED_STRETCHES = 128

# a kind of tick, or a row of steps that are multiplied once
_Step = int | tuple["_Step", ...]


def product_with_errors(
    kind: np.ndarray,
    changes: Sequence[np.ndarray],
    sizes: Sequence[np.ndarray],
    *,
    ramp: bool = False,
    per_loop: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the product of ticks less identity, `(..., n, n)` or `(..., n, n + inputs)`, and
    bounds on its errors.

    kind: of each tick, `(M,)`. changes: per kind, E, or E and behind it the columns of inputs that
    are held over the frame. ramp: whether the last input becomes one that grows by the one before
    it with every tick, from 0. An entry that is zero by the ticks' patterns is exactly zero.
    Overflow gives infinities or NaN without a warning. sizes: per kind, the sizes of the terms of
    the entries of each tick (running error terms), in the form of the changes. per_loop: whether
    every loop of a batch has a bound of its own, at three times the cost; otherwise it is that of
    the largest entries of the loops that are multiplied together, which is tight for loops that are
    alike. Accuracy: to first order in a rounding.
    """
    over = np.asarray if per_loop else lambda size: size.max(tuple(range(size.ndim - 2)))
    kinds = kind.tolist()
    still = ~pattern_of(kind, changes, ramp=ramp)
    batch = _batch_of(changes, sizes)

    def of_loops(index: Any) -> np.ndarray:
        ticks = []
        for change, size_of_terms in zip(changes, sizes, strict=True):
            E = _of_loops(change, batch, index)
            error = ENTRY_ROUNDING * over(_of_loops(size_of_terms, batch, index))
            ticks.append(((E, 1), *_largest(over, E), error))
        (E, _), *_, dE = in_a_row(kinds, ticks, partial(_after_with_errors, ramp, over))
        return np.stack([E, np.broadcast_to(dE, E.shape)], axis=-3)

    with np.errstate(all="ignore"):
        pair = in_parts(of_loops, batch, changes[0].shape[-1], np.result_type(*changes))
    E = np.where(still, -np.eye(*still.shape), pair[..., 0, :, :])
    return E, np.where(still, 0.0, pair[..., 1, :, :])


def _batch_of(changes: Sequence[np.ndarray], sizes: Sequence[np.ndarray]) -> tuple[int, ...]:
    """The shape of the batch that matrices are of together."""
    return np.broadcast_shapes(*(matrix.shape[:-2] for matrix in (*changes, *sizes)))


def _of_loops(matrix: np.ndarray, batch: tuple[int, ...], index: Any) -> np.ndarray:
    """Some of the matrices of a batch; one matrix if it is that of all."""
    if matrix.ndim == 2:
        return matrix
    return np.broadcast_to(matrix, (*batch, *matrix.shape[-2:]))[index]


def product_with_tight_errors(
    kind: np.ndarray, changes: Sequence[np.ndarray], sizes: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return what `product_with_errors` does per loop, with bounds hundreds of times as tight.

    It takes some ten times as long. In a row of ticks I + E_k, each with an error d_k, let S_k be
    what is before it, and T_k what is behind it, both less identity. To first order the product is
    off by the sum of `(I + T_k) (d_k (I + S_k) + r_k)`, r_k being the rounding of this step. So
    sizes are taken of products whose terms have cancelled, and not anew wherever two stretches are
    joined. A longer row than SUMMED_STRETCHES is one of stretches, of which those that repeat are
    multiplied once.
    """
    kinds = tuple(kind.tolist())
    still = ~pattern_of(kind, changes)
    batch = _batch_of(changes, sizes)
    n = changes[0].shape[-1]

    def of_loops(index: Any) -> np.ndarray:
        ticks = [_of_loops(change, batch, index) for change in changes]
        errors = [ENTRY_ROUNDING * _of_loops(size, batch, index) for size in sizes]
        # Joined two by two, as in `product_with_errors`; dE bounds the error of `again`, joined one
        # by one, so their distance is added to it.
        E = in_a_row(list(kinds), ticks, lambda P, Q: P + Q + Q @ P)
        once: dict[_Step, tuple[np.ndarray, np.ndarray]] = dict(
            enumerate(zip(ticks, errors, strict=True))
        )
        again, dE = _of_steps(_steps_of(kinds), once)
        return np.stack(np.broadcast_arrays(E, dE + np.abs(E - again)), axis=-3)

    with np.errstate(all="ignore"):
        pair = in_parts(of_loops, batch, n, np.result_type(*changes))
    E = np.where(still, -np.eye(n), pair[..., 0, :, :])
    return E, np.where(still, 0.0, pair[..., 1, :, :])


@lru_cache(maxsize=64)
def _steps_of(kinds: tuple[_Step, ...]) -> tuple[_Step, ...]:
    """Kinds of ticks as a row of at most SUMMED_STRETCHES steps, each of which is a kind or
    again such a row."""
    if len(kinds) <= SUMMED_STRETCHES:
        return kinds
    return _narrowed(tuple(_narrowed(tuple(alike)) for _, alike in groupby(kinds)))


def _narrowed(steps: tuple[_Step, ...]) -> tuple[_Step, ...]:
    while len(steps) > SUMMED_STRETCHES:
        first_of_each = range(0, len(steps), SUMMED_STRETCHES)
        steps = tuple(steps[first : first + SUMMED_STRETCHES] for first in first_of_each)
    return steps


def _of_steps(
    steps: _Step, products: dict[_Step, tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """The product of steps and the bound on its error; products: those of steps that were
    multiplied before."""
    if isinstance(steps, tuple) and steps not in products:
        products[steps] = _in_sequence([_of_steps(step, products) for step in steps])
    return products[steps]


def _in_sequence(factors: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """The product of the factors `I + E_k`, less identity, and a bound on its error: the sum of
    `|I + T_k| (d_k |I + S_k| + r_k)` of `product_with_tight_errors`."""
    nothing = np.zeros_like(factors[0][0])
    n = nothing.shape[-1]
    eye = np.eye(n)
    rounding = sum_rounding(n + 2)
    before = [nothing]
    for E, _ in factors:
        before.append(before[-1] + E + E @ before[-1])
    total = np.zeros(())
    behind = nothing
    for (E, error), ahead in zip(reversed(factors), reversed(before[:-1]), strict=True):
        size = np.abs(E)
        of_E = error + rounding * size
        of_factor = of_E @ np.abs(eye + ahead) + rounding * (2 * size + np.abs(ahead))
        total = total + np.abs(eye + behind) @ of_factor
        behind = behind + E + behind @ E
    return before[-1], total


def pattern_of(
    kind: np.ndarray, changes: Sequence[np.ndarray], *, ramp: bool = False
) -> np.ndarray:
    """Return which entries of the product of ticks, identity included, may be other than 0 in a
    loop, `(n, n + inputs)`."""
    patterns = []
    n, width = changes[0].shape[-2:]
    for change in changes:
        pattern = (change != -np.eye(n, width)).any(tuple(range(change.ndim - 2)))
        if ramp:
            pattern[:, -1] |= pattern[:, -2]
        patterns.append(pattern.tobytes())
    return _pattern(tuple(patterns), kind.astype(np.int64).tobytes(), n, width)


@lru_cache(maxsize=256)
def _pattern(patterns: tuple[bytes, ...], kinds: bytes, n: int, width: int) -> np.ndarray:
    of_inputs = np.eye(width, dtype=bool)[n:]
    maps = []
    for pattern in patterns:
        maps.append(np.vstack([np.frombuffer(pattern, bool).reshape(n, width), of_inputs]))
    kinds = np.frombuffer(kinds, np.int64).tolist()
    entries = in_a_row(kinds, maps, lambda first, second: (second.astype(float) @ first) > 0)
    entries = np.ascontiguousarray(entries[:n])
    entries.flags.writeable = False
    return entries


def blocks_of(pattern: np.ndarray) -> list[np.ndarray]:
    """Return the strongly connected components of a pattern `(n, n)`, each as indices in order;
    what acts comes before what is acted on. In this order a matrix with the pattern is
    block-triangular, and its eigenvalues are those of the blocks."""
    components = _components(np.ascontiguousarray(pattern, bool).tobytes(), len(pattern))
    return [np.array(block) for block in components]


@lru_cache(maxsize=256)
def _components(pattern: bytes, n: int) -> tuple[tuple[int, ...], ...]:
    """The components of a pattern `(n, n)`, given as its bytes, for `blocks_of`.

    They are sorted by the number of states that act on each, through others too and its own
    included, then by their first states. A component that acts on another has fewer, so it comes
    first, and the order depends on no walk through the pattern.
    """
    acts = np.frombuffer(pattern, bool).reshape(n, n)
    component_of = np.zeros(n, int)
    states_acting_on: list[int] = []  # per component, as a set of bits
    blocks: list[tuple[int, tuple[int, ...]]] = []
    for block in strong_components(acts):  # after all that act on it
        this = len(blocks)
        component_of[block] = this
        acting = sum(1 << state for state in block)
        for component in different(component_of[acts[block].any(0)]).tolist():
            if component != this:
                acting |= states_acting_on[component]
        states_acting_on.append(acting)
        blocks.append((acting.bit_count(), tuple(block)))
    return tuple(block for _, block in sorted(blocks))


def _after(
    ramp: bool, first: tuple[np.ndarray, int], second: tuple[np.ndarray, int]
) -> tuple[np.ndarray, int]:
    """One stretch of ticks after another, each as its change and its ticks: `P + Q + Q P`, as
    `(I + Q) (I + P)` is I and that. A ramp has grown by the ticks of the first when the second
    begins."""
    P, ticks = first
    Q, more_ticks = second
    E = P + Q
    E += Q[..., : P.shape[-2]] @ P
    if ramp:
        E[..., -1] += ticks * Q[..., -2]
    return E, ticks + more_ticks


def _after_with_errors(
    ramp: bool,
    over: Callable[..., Any],
    first: tuple[tuple[np.ndarray, int], np.ndarray, np.ndarray, np.ndarray],
    second: tuple[tuple[np.ndarray, int], np.ndarray, np.ndarray, np.ndarray],
) -> tuple[tuple[np.ndarray, int], np.ndarray, np.ndarray, np.ndarray]:
    """The same with the largest sizes of the entries of E and of I + E in all loops, and a bound
    on their errors, to first order `|I + Q| dP + dQ |I + P| + u (|P| + |Q| + |Q| |P|)`, u being the
    rounding of a sum of so many terms."""
    P, size_P, whole_P, dP = first
    Q, size_Q, whole_Q, dQ = second
    both = _after(ramp, P, Q)
    n = size_P.shape[-2]
    # Zeros add no rounding: those of delays make rows of few terms.
    terms = int(np.count_nonzero(size_Q[..., :n], -1).max(initial=0)) + 2 + ramp
    rounding = sum_rounding(terms, np.iscomplexobj(both[0]))
    rounding = rounding * (size_P + size_Q + size_Q[..., :n] @ size_P)
    dE = whole_Q[..., :n] @ dP + dQ[..., :n] @ whole_P + rounding
    dE[..., n:] += dQ[..., n:]
    if ramp:
        dE[..., -1] += P[1] * (dQ[..., -2] + sum_rounding(2) * size_Q[..., -2])
    return both, *_largest(over, both[0]), dE


def _largest(over: Callable[..., Any], E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The sizes of the entries of E and of I + E, of each loop or the largest of a batch."""
    size = over(np.abs(E))
    index = np.arange(E.shape[-2])
    diagonal = over(np.abs(1 + E[..., index, index])[..., None, :])
    with_identity = size.copy()
    with_identity[..., index, index] = diagonal[..., 0, :]
    return size, with_identity
