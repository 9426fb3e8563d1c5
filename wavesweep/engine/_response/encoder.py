"""Velocities that an encoder gives, from a mass's displacement in a tick, where a difference of
positions would cancel."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine._loops.block import Block
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.drift import MarginalModes

if TYPE_CHECKING:
    from wavesweep.engine._loops.multirate import ScheduledBlock

DISPLACEMENT = "displacement"  # the output that a mass gets


def with_displacements(
    drawn: MultirateLoop, drift: MarginalModes
) -> tuple[MultirateLoop, MarginalModes]:
    """Return the drawing, and its drift, with the differences of positions of masses as delays of
    their displacements.

    A block whose state only keeps the position x of a mass, and whose output is `c (x[k] -
    x[k-1])`, is one with the state `c (x[k] - x[k-1])`, which no drift moves. All runs in every
    tick. The states keep their names.
    """
    placed = {scheduled.block.name: scheduled for scheduled in drawn.placed}
    sums = dict(drawn.sums)
    leads = {drift.states[lead] for lead in drift.leads}
    gone = set()
    for name, scheduled in list(placed.items()):
        read = sums.get(f"{name}.u", {})
        state = f"{name}.u1"
        if not _is_difference(scheduled) or len(read) != 1 or state in leads:
            continue
        ((signal, gain),) = read.items()
        mass, _, port = signal.rpartition(".")
        if port != "x" or mass not in placed or not _is_mass(placed[mass]):
            continue
        placed[mass] = replace(placed[mass], block=_with_displacement(placed[mass].block))
        block = scheduled.block
        delay = Block(name, block.inputs, block.outputs, block.states, *_delay(block.D))
        placed[name] = replace(scheduled, block=delay)
        sums[f"{name}.u"] = {f"{mass}.{DISPLACEMENT}": gain}
        gone.add(drift.states.index(state))
    constant = []
    for lead, followers in drift.constant:
        constant.append((lead, tuple(pair for pair in followers if pair[0] not in gone)))
    drawn = replace(drawn, placed=tuple(placed.values()), sums=sums)
    return drawn, replace(drift, constant=tuple(constant))


def _delay(gain: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """E, B, C, D of a delay of a tick whose state is the input times a gain."""
    return np.array([[-1.0]]), gain, np.ones((1, 1)), np.zeros((1, 1))


def _is_mass(scheduled: ScheduledBlock) -> bool:
    return scheduled.every == 1 and scheduled.block.states == ("v", "x")


def _is_difference(scheduled: ScheduledBlock) -> bool:
    block = scheduled.block
    if (
        block.states != ("u1",)
        or scheduled.every != 1
        or not block.E.shape[-2:] == block.B.shape[-2:] == (1, 1)
    ):
        return False
    return bool(np.all(block.E == -1) and np.all(block.B == 1) and np.all(block.C == -block.D))


def _with_displacement(block: Block) -> Block:
    if DISPLACEMENT in block.outputs:
        return block
    C, D = _rows(block.E, block.B, block.C, block.D)
    terms = block.terms and (*block.terms[:2], *_rows(*block.terms))
    return replace(
        block, outputs=(*block.outputs, DISPLACEMENT), C=C, D=D, terms=terms, at_rest=None
    )


def _rows(
    E: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """C and D with the change of the position as a further output."""
    return _with_row(C, E[..., 1:2, :]), _with_row(D, B[..., 1:2, :])


def _with_row(matrix: np.ndarray, row: np.ndarray) -> np.ndarray:
    matrix = np.broadcast_to(matrix, (*row.shape[:-2], *matrix.shape[-2:]))
    return np.concatenate([matrix, row], -2)
