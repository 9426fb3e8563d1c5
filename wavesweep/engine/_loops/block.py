"""The discrete block in delta form, of which all loops consist, and its arrays over a batch."""

from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

# Rows from which on, and share of entries up to which, products by the entries that are not zero
# take less time than others: chains of masses and long delays have such matrices.
SPARSE_ROWS = 100
SPARSE_SHARE = 0.05

_Numbers = TypeVar("_Numbers", bound=np.ndarray | complex)


def numbers(array: Any) -> np.ndarray:
    """Return `array` as floats, or as complex numbers if a parameter is complex."""
    array = np.asarray(array)
    return array if array.dtype.kind == "c" else array.astype(float, copy=False)


def frozen(array: np.ndarray | list[list[float]]) -> np.ndarray:
    """Return `array` as a read-only view of `numbers`; the caller's own array stays writable."""
    if isinstance(array, np.ndarray) and array.dtype == np.float64 and not array.flags.writeable:
        return array
    view = numbers(array).view()
    view.flags.writeable = False
    return view


def matrix(rows: list[list[np.ndarray | float]]) -> np.ndarray:
    """Stack rows of scalars and arrays to `(..., len(rows), len(rows[0]))`, entries broadcast
    together."""
    kinds = set().union(*(map(type, row) for row in rows))
    if all(issubclass(kind, int | float) for kind in kinds):
        return np.array(rows, float)
    height = len(rows)
    width = len(rows[0])
    entries = [numbers(entry) for row in rows for entry in row]
    batch = np.broadcast_shapes(*(entry.shape for entry in entries))
    stacked = np.empty((*batch, height, width), np.result_type(*entries))
    for index, entry in enumerate(entries):
        stacked[..., index // width, index % width] = entry
    return stacked


def block_diagonal(parts: list[np.ndarray] | tuple[np.ndarray, ...]) -> np.ndarray:
    """Return matrices along a diagonal, `(..., rows, columns)`."""
    batch = np.broadcast_shapes(*(block.shape[:-2] for block in parts))
    height = sum(block.shape[-2] for block in parts)
    width = sum(block.shape[-1] for block in parts)
    diagonal = np.zeros((*batch, height, width), np.result_type(float, *parts))
    row = 0
    column = 0
    for block in parts:
        below = row + block.shape[-2]
        right = column + block.shape[-1]
        diagonal[..., row:below, column:right] = block
        row = below
        column = right
    return diagonal


def concatenated(parts: list[np.ndarray] | tuple[np.ndarray, ...], axis: int) -> np.ndarray:
    """Return matrices side by side (axis -1) or below each other (-2), broadcast over their
    batches."""
    batch = np.broadcast_shapes(*(matrix.shape[:-2] for matrix in parts))
    return np.concatenate(
        [np.broadcast_to(matrix, (*batch, *matrix.shape[-2:])) for matrix in parts], axis
    )


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """A linear block `x[k+1] - x[k] = E x[k] + B u[k]`, `y[k] = C x[k] + D u[k]`.

    The delta operator (Middleton and Goodwin, 1990) keeps the distance of slow poles from 1 in all
    its digits: the poles are `1 + eig(E)`. Arrays are `(..., n, n)`, `(..., n, m)`, `(..., p, n)`,
    `(..., p, m)`, leading axes being a batch.

    inputs, outputs: port names; elsewhere the port `p` of the block `name` is the signal
    `"name.p"`. states: one name per state. condition: factor by which closing its algebraic loops,
    or modes that turn by whole circles, may have multiplied the rounding of its entries, a number
    or an array over the batch. pivot: the product of the determinants of these loops' return
    differences; it is zero where one of them has no solution, and the entries have a pole. terms:
    for E, B, C and D, the sizes of the terms of each entry's sum, in which a closed loop counts for
    all that rounding of its entries does to it; empty if they are not known. at_rest: what the block
    does while signals do not change, without rounding, as arrays in place of E, B, C and D, or D
    alone (see `definitions.at_rest`); None if E, B, C and D are all that is known. labels: a
    readable name per state for messages; by default the block's name and the state's. ring: whether
    it is a loop of several blocks in itself, and not only a part of one. Errors: ValueError if an
    array or the labels do not fit the names.
    """

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]
    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    condition: np.ndarray | float = 1.0
    pivot: np.ndarray | complex = 1.0
    terms: tuple[np.ndarray, ...] = ()
    at_rest: tuple[Any, ...] | None = None
    labels: tuple[str, ...] = ()
    ring: bool = False

    def __post_init__(self) -> None:
        """Check the shapes once and make the arrays read-only."""
        n = len(self.states)
        m = len(self.inputs)
        p = len(self.outputs)
        for name, shape in (("E", (n, n)), ("B", (n, m)), ("C", (p, n)), ("D", (p, m))):
            array = frozen(getattr(self, name))
            if array.shape[-2:] != shape:
                raise ValueError(
                    f"block {self.name}: {name} expected (..., {shape[0]}, {shape[1]}), found {array.shape}"
                )
            object.__setattr__(self, name, array)
        if self.labels and len(self.labels) != n:
            raise ValueError(
                f"block {self.name}: labels expected {n}, one per state, found {len(self.labels)}"
            )

    def of_loop(self, index: int) -> "Block":
        """Return the block of one loop of a batch; what all loops have alike has no axis for them."""

        def own(array: _Numbers, axes: int) -> _Numbers:
            return np.asarray(array)[index] if np.ndim(array) > axes else array

        return replace(
            self,
            E=own(self.E, 2),
            B=own(self.B, 2),
            C=own(self.C, 2),
            D=own(self.D, 2),
            condition=own(self.condition, 0),
            pivot=own(self.pivot, 0),
            terms=tuple(own(term, 2) for term in self.terms),
            at_rest=None,
        )

    @property
    def batch(self) -> tuple[int, ...]:
        """The shape of the leading axes, all four arrays broadcast together."""
        return np.broadcast_shapes(*(a.shape[:-2] for a in (self.E, self.B, self.C, self.D)))
