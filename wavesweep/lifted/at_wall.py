"""The lifted loop of a controller's diagram, cut at the wall."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.drift import drift_of
from wavesweep.diagram.elimination import reduced_echelon
from wavesweep.lifted.circle import solve
from wavesweep.lifted.cut import ERRORS, Cut
from wavesweep.lifted.lift import slow_side

ORDINARY = 16.0  # condition of algebraic loops up to which entries are good to a few roundings


def _cut(E, B, C, D, condition, integrates, **facts):
    rounding = 4 * np.finfo(float).eps * np.maximum(1, condition / ORDINARY)
    errors = {name: rounding * np.abs(part) for name, part in zip(ERRORS, (E, B, C, D), strict=True)}
    return Cut(E, B, C, D, **errors, integrates=integrates, **facts)


def cut_at_wall(diagram: Diagram, whole: Block | None = None) -> Cut:
    """Lift the drawing and cut it at the wall.

    diagram: the drawing. whole: see `slow_side`.
    """
    block, unread = slow_side(diagram, diagram.wall, whole=whole)
    condition = np.asarray(block.condition)[..., None, None]
    facts = {"period": diagram.period * diagram.ratio, "unread": unread}
    facts["poles_at_one"] = _poles_at_one(diagram.structure) if diagram.structure else 0
    drift = drift_of(diagram)
    if drift.lead not in block.states:
        x, v = block.C[..., 0, :], block.C[..., 1, :]
        C = np.stack([v, np.zeros_like(x), x], axis=-2)
        D = np.stack([block.D[..., 1, :], 0 * block.D[..., 0, :], block.D[..., 0, :]], axis=-2)
        return _cut(block.E, block.B, C, D, condition, False, states=block.states, **facts)
    lead = block.states.index(drift.lead)
    moved, others = _about_lead(block, drift, lead), np.flatnonzero(np.arange(len(block.states)) != lead)
    x, v = moved.C[..., 0, others], moved.C[..., 1, others]
    E, B = moved.E[..., others[:, None], others], moved.B[..., others, :]
    advance, step = moved.E[..., lead, others], moved.B[..., lead, :]
    names = tuple(block.states[i] for i in others)
    if not drift.driven:
        C = np.stack([v, np.zeros_like(x), x + _integrated(E, advance)], axis=-2)
        D = np.stack([moved.D[..., 1, :], 0 * step, moved.D[..., 0, :]], axis=-2)
        return _cut(E, B, C, D, condition, False, states=names, **facts)
    C = np.stack(np.broadcast_arrays(v, advance, x), axis=-2)
    D = np.stack(np.broadcast_arrays(moved.D[..., 1, :], step, moved.D[..., 0, :]), axis=-2)
    return _cut(E, B, C, D, condition, True, states=names, **facts)


@lru_cache(maxsize=256)
def _poles_at_one(structure):
    """How many eigenvalues 1 the loop without the wall and its drift has in a drawing with moderate numbers."""
    return _lacking(cut_at_wall(structure).E)


def _lacking(A):
    """By how much the rank of a matrix is less than the number of its rows."""
    return len(A) - len(reduced_echelon(A)[1])


def _about_lead(block, drift, lead):
    """Count every state that drifts from the lead, so that the drift moves the lead alone, exactly."""
    E, B, C = (a.copy() for a in (block.E, block.B, block.C))
    for name, distance in drift.shift.items():
        if name != drift.lead and name in block.states:
            row = block.states.index(name)
            E[..., row, :] -= distance / drift.shift[drift.lead] * E[..., lead, :]
            B[..., row, :] -= distance / drift.shift[drift.lead] * B[..., lead, :]
    E[..., :, lead] = 0  # the sum of the columns of all that drifts, which is zero by structure
    C[..., 0, lead] = 1 / drift.shift[drift.lead]
    C[..., 1, lead] = 0
    return replace(block, E=E, B=B, C=C)


def _integrated(E, advance):
    """Return the row l of the combination `s - l x` that stays constant: `l = advance E^-1`.

    The input of the combination, `step - l B`, is zero then.
    """
    return solve(np.swapaxes(E, -1, -2), advance[..., None])[..., 0]


def conserves(diagram: Diagram, cut: Cut) -> bool:
    """Whether a combination of states, which no wall changes, has taken the place of a drift."""
    drift = drift_of(diagram)
    return not cut.integrates and bool(drift.shift) and not drift.driven and drift.lead not in cut.unread
