"""Velocities that an encoder gives, from a mass's displacement in a tick, where a difference of
positions would cancel."""

from dataclasses import replace

import numpy as np

from wavesweep.engine._loops.block import Block
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.drift import MarginalModes

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
    placed, sums = {scheduled.block.name: scheduled for scheduled in drawn.placed}, dict(drawn.sums)
    leads, gone = {drift.states[lead] for lead in drift.leads}, set()
    for name, scheduled in list(placed.items()):
        source = sums.get(f"{name}.u", {})
        mass, _, port = next(iter(source), "").rpartition(".")
        state = f"{name}.u1"
        of_mass = (
            mass in placed
            and placed[mass].every == 1
            and placed[mass].block.states == ("v", "x")
            and port == "x"
        )
        if not (of_mass and _is_difference(scheduled) and len(source) == 1 and state not in leads):
            continue
        placed[mass] = replace(placed[mass], block=_with_displacement(placed[mass].block))
        block = scheduled.block
        E, B, C, D = np.array([[-1.0]]), block.D, np.ones((1, 1)), np.zeros((1, 1))
        placed[name] = replace(
            scheduled, block=Block(name, block.inputs, block.outputs, block.states, E, B, C, D)
        )
        sums[f"{name}.u"] = {f"{mass}.{DISPLACEMENT}": next(iter(source.values()))}
        gone.add(drift.states.index(state))
    constant = tuple(
        (lead, tuple(pair for pair in followers if pair[0] not in gone))
        for lead, followers in drift.constant
    )
    return replace(drawn, placed=tuple(placed.values()), sums=sums), replace(
        drift, constant=constant
    )


def _is_difference(scheduled):
    block = scheduled.block
    if (
        block.states != ("u1",)
        or scheduled.every != 1
        or not block.E.shape[-2:] == block.B.shape[-2:] == (1, 1)
    ):
        return False
    return bool(np.all(block.E == -1) and np.all(block.B == 1) and np.all(block.C == -block.D))


def _with_displacement(block):
    if DISPLACEMENT in block.outputs:
        return block
    C, D = _rows(block.E, block.B, block.C, block.D)
    terms = block.terms and (*block.terms[:2], *_rows(*block.terms))
    return replace(
        block, outputs=(*block.outputs, DISPLACEMENT), C=C, D=D, terms=terms, at_rest=None
    )


def _rows(E, B, C, D):
    """C and D with the change of the position as a further output."""
    steps = (C, E[..., 1:2, :]), (D, B[..., 1:2, :])
    return [
        np.concatenate([np.broadcast_to(rows, (*step.shape[:-2], *rows.shape[-2:])), step], -2)
        for rows, step in steps
    ]
