"""Blocks that act on each other continuously, as one block: the rates of change of their states,
exact over a held tick."""

from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np

from wavesweep.engine._drawing.drawn_block import Plant
from wavesweep.engine._loops.algebraic import loop_inverse
from wavesweep.engine._loops.block import Block, block_diagonal, numbers
from wavesweep.engine._loops.blocks import Rates, continuous, pivot_of, sizes_of
from wavesweep.engine._loops.dead_time import with_ports
from wavesweep.engine.errors import IllPosedLoopError


def plant_of(
    plant: Plant,
    keys: Mapping[str, dict[str, Any]],
    gains: Mapping[str, Mapping[str, np.ndarray | float]],
    period: np.ndarray | float,
    constants: dict[str, np.ndarray | int],
    shares: dict[str, np.ndarray],
) -> Block:
    """Return the block of a plant whose members act on each other by `u = K y + e`; the inputs e
    are held over the period.

    plant: of blocks `x' = A x + B u`, `y = C x + D u`. keys: those of each with their values.
    gains: K, input port -> output -> number or array over the batch. period: s. constants, shares: of
    dead times, see `with_ports`.

        x' = (A + B K M C) x + B (1 + K M D) e,   y = M (C x + D e),   M = (1 - D K)^-1

    Accuracy: that of `held`. `terms` has what a rounding of each term of the sums above does to the
    entries, since springs and dampers of different signs may cancel. Errors: IllPosedLoopError if
    the direct terms make a loop without a solution.
    """
    (A, B, C, D), (of_A, of_B), pivots, names = _side_by_side(plant, keys)
    inputs, outputs = plant.drawn_ports
    K = _gains(gains, inputs, outputs)
    L = D @ K
    M = np.eye(len(outputs))
    of_M = np.eye(len(outputs))
    condition: np.ndarray | float = 1.0
    determinant: np.ndarray | float = 1.0
    if L.any():
        M, of_M, condition, determinant = _closed(L, np.abs(D) @ np.abs(K), outputs, plant.name)
    shown = M @ C
    through = M @ D
    back = B @ K
    of_C = of_M @ np.abs(C)
    of_D = of_M @ np.abs(D)
    of_back = of_B @ np.abs(K)
    of_A = of_A + of_back @ of_C
    of_B = of_B + of_back @ of_D
    A = A + back @ shown
    B = B + back @ through
    rates = Rates(A, B, of_A, of_B, period)
    E, G, of_E, of_G = rates.over()
    shown_inputs, shown_outputs = plant.ports
    made = Block(
        plant.name,
        tuple(shown_inputs),
        tuple(shown_outputs),
        tuple(plant.own(f"{member}.{state}") for member, state in names),
        *(E, G, shown, through),
        condition=condition,
        pivot=prod(pivots, start=determinant),
        terms=(of_E, of_G, of_C, of_D),
        labels=tuple(f"{member} {LABELS.get(state, state)}" for member, state in names),
        ring=plant.acts_on_itself,
    )
    if not (plant.arriving or plant.sensed):
        return made
    return with_ports(made, plant, rates, constants, shares)


def _side_by_side(
    plant: Plant, keys: Mapping[str, dict[str, Any]]
) -> tuple[list[np.ndarray], list[np.ndarray], list[Any], list[tuple[str, str]]]:
    """A, B, C, D of all members side by side, the sizes of the terms of A and B, a pivot of each
    member, and member and name of each state."""
    matrices = []
    sizes = []
    pivots = []
    names = []
    for block in plant.members:
        numbers_of_block = keys[block.name]
        states, of_member = continuous(block.type, numbers_of_block)
        matrices.append(of_member)
        sizes.append(sizes_of(block.type, numbers_of_block, *of_member[:2]))
        pivots.append(pivot_of(block.type, numbers_of_block))
        names += [(block.name, state) for state in states]
    of_plant = [block_diagonal(parts) for parts in zip(*matrices, strict=True)]
    of_sums = [block_diagonal(parts) for parts in zip(*sizes, strict=True)]
    return of_plant, of_sums, pivots, names


LABELS = {"v": "velocity", "x": "position"}  # of states of masses, for messages


def _gains(
    gains: Mapping[str, Mapping[str, np.ndarray | float]], inputs: list[str], outputs: list[str]
) -> np.ndarray:
    """The matrix of the gains, `(..., inputs, outputs)`."""
    entries = {}
    for port, terms in gains.items():
        for signal, gain in terms.items():
            entries[port, signal] = numbers(gain)
    batch = np.broadcast_shapes(*(entry.shape for entry in entries.values()))
    K = np.zeros((*batch, len(inputs), len(outputs)), np.result_type(float, *entries.values()))
    for (port, signal), entry in entries.items():
        K[..., inputs.index(port), outputs.index(signal)] = entry
    return K


def _closed(
    L: np.ndarray, sizes: np.ndarray, outputs: list[str], name: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The inverse of `1 - L`, the sizes of what rounding does to it, its condition, and the
    determinant."""
    reached = np.eye(len(outputs), dtype=bool) | np.any(L != 0, axis=tuple(range(L.ndim - 2)))
    for _ in outputs:
        reached = (reached.astype(int) @ reached) > 0
    try:
        inverse, condition, pivot = loop_inverse(L, sizes, reached, name, outputs)
    except IllPosedLoopError as error:
        raise IllPosedLoopError(
            f"the direct terms through {', '.join(outputs)} of the plant {name} make a loop that has no solution that "
            "double precision can find; change a gain of the wires between its blocks, or put a hold into one"
        ) from error
    size = np.abs(inverse)
    of_inverse = size @ (np.eye(len(outputs)) + sizes) @ size
    return inverse, of_inverse, condition, pivot
