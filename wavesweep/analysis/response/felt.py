"""The stiffness that the hand feels at rest of a controller, as a function of its wall's stiffness."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from wavesweep.analysis.response.frame import Loop, prepare
from wavesweep.analysis.response.ticks import ordered_product
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.drift import scene_drift
from wavesweep.lifted.circle import solve
from wavesweep.lifted.lift import frame_at_rest, only, prune

MODERATE = 7.3, 5.9  # N/m and N*s/m, a wall where moderate numbers are wanted
STILL = 1e-9  # of its terms, up to which a number of a loop of moderate numbers is nothing but rounding


def held_at_rest(diagram: Diagram, wall) -> np.ndarray:
    """Return whether something holds the hand's device, so that a constant force does not move it without end.

    It follows from the drawing alone, for walls `(K_VE, B_VE)`, numbers or arrays, in their shape. A wall holds nothing if no
    way leads from it to the device at rest.
    """
    return ~_by_structure(diagram.structure or diagram, wall)[0]


def _by_structure(structure, wall):
    """Whether nothing holds the device, and whether no force reaches the hand, for walls `(K_VE, B_VE)`, numbers or arrays."""
    there = np.broadcast_arrays(*(np.asarray(part) != 0 for part in wall))
    found = np.zeros((2, *there[0].shape), bool)
    for pattern in {*zip(*(part.ravel().tolist() for part in there), strict=True)}:
        known = _of_structure(structure, pattern)
        found[:, (there[0] == pattern[0]) & (there[1] == pattern[1])] = np.array(known)[:, None]
    return found


@lru_cache(maxsize=256)
def _of_structure(structure, there):
    wall = (size * each for size, each in zip(MODERATE, there, strict=True))
    with np.errstate(all="ignore"):
        return [bool(flag) for flag in _limit(prepare(structure, *wall))[2:]]


def _limit(loop: Loop):
    """Return position (m) and control force (N) at rest, whether the position moves without end, and whether there is no force.

    The last two hold for moderate numbers.
    """
    M, i = loop.diagram.ratio, np.arange(loop.diagram.ratio)
    with np.errstate(all="ignore"):
        seen, impulse, left = (part[0] for part in (loop.shown.seen, loop.shown.impulse, loop.shown.left))
        own = impulse * (M - i)
        found = solve(loop.E, np.stack([-left.sum(-1), -(left * i).sum(-1)], -1))
        X, X_1 = found[..., 0], found[..., 1] + M * solve(loop.E, found[..., :1])[..., 0]
        rows, later = seen.sum(-2), -(seen * i[:, None]).sum(-2)
        value, slope = (
            ordered_product(rows, X) + own.sum(-1),
            ordered_product(rows, X_1) + ordered_product(later, X) - (own * i).sum(-1),
        )
        size = ordered_product(np.abs(rows), np.abs(X)) + np.abs(own).sum(-1)
        if loop.law is not None:
            law = loop.shown.law[0][..., 0, :]
            one, two = ((law * weight).sum(-1)[..., None] for weight in (i, i * (i - 1) / 2))
            value, slope = value + loop.still * one, slope + loop.still * (two + (1 - M) * one)
        moves, none = np.abs(value[..., 0]) > STILL * size[..., 0], np.abs(value[..., 1]) <= STILL * np.maximum(size[..., 1], M)
    return slope[..., 0] / M, value[..., 1] / M, moves, none


def felt_map(diagram: Diagram, batch: tuple[int, ...] = (), whole: Block | None = None) -> np.ndarray:
    """Return coefficients (a, b, c) of the stiffness felt at rest, `(a + b K)/(1 + c K)`, `(3, ...)`; see `felt`.

    diagram: the drawing. batch: shape of the drawing's batch. whole: the result of `frame_at_rest`, if it is known. NaN: not
    known. The wall is one scalar of the loop, so the felt stiffness is a Moebius map of the wall's stiffness K (N/m); the
    wall's damping is not felt at rest. With F the wall's force, `E X + B F + g = 0` and `C X + D F = F/K` hold at rest. The
    solution for a rigid wall, and its change with an offset of that wall, give all others (Sherman and Morrison 1950). A
    combination of states that nothing restores keeps the value that the start of the force has left in it: see `_laws`. What
    is zero follows from the same drawing with moderate numbers, in which rounding hides nothing.
    Accuracy: 1e-9 relative against `static_response` in the tests.
    """
    (x, f, x_1, f_1), zeros = _felt_parts(diagram, whole)
    if diagram.structure:
        zeros = _zeros_felt(diagram.structure)
    with np.errstate(all="ignore"):
        moves, alone, no_f, no_f_1 = zeros
        f, f_1 = np.where(no_f, 0.0, f), np.where(no_f_1, 0.0, f_1)
        found = np.where(alone, np.stack([f / x, 0 * f, 0 * f]), np.stack([f_1, f, x]) / x_1)
        found = np.where(moves, 0.0, found)
    found = np.where(np.isfinite(found).all(0), found, np.nan)
    alike = (1,) * (len(batch) - found.ndim + 1)  # nothing that the batch varies is read
    return np.broadcast_to(found.reshape(3, *alike, *found.shape[1:]), (3, *batch))


@lru_cache(maxsize=256)
def _zeros_felt(structure):
    return [bool(flag) for flag in _felt_parts(structure)[1]]


def _felt_parts(diagram, whole=None):
    """Position and control force for a rigid wall, their changes with its offset less those of its force, and four flags.

    These hold for moderate numbers: whether nothing holds the device, whether no force reaches the wall, and whether the
    control force and its change are zero.
    """
    with np.errstate(all="ignore"):
        rest = _at_rest(diagram, frame_at_rest(diagram) if whole is None else whole)
        y, d = rest.rigid[..., 0], rest.rigid[..., 1]
        force, turn = y[..., -1:], d[..., -1:]  # of the rigid wall, and what its offset changes of it
        rigid, offset = rest.seen(y, rest.direct), rest.seen(d, 0.0)
        (x, f), (x_1, f_1) = (np.moveaxis(part, -1, 0) for part in (rigid, force * offset - turn * rigid))
        size = np.abs(force[..., 0]) * rest.sizes(d)[..., 1] + np.abs(turn[..., 0]) * rest.sizes(y)[..., 1]
        zeros = rest.moves, np.abs(force[..., 0]) <= STILL, np.abs(f) <= STILL, np.abs(f_1) <= STILL * size
    return (x, f, x_1, f_1), zeros


@dataclass(frozen=True, slots=True)
class _Rest:
    """The loop at rest under a unit force of the hand; unknowns are the states that are restored, and the wall's force.

    rigid `(..., n, 2)`: solution for a rigid wall, and its change with an offset of that wall (m). rows `(..., 2, n)`, direct
    `(..., 2)`: position (m) and control force (N) of a solution. moves: whether nothing holds the device.
    """

    rigid: np.ndarray
    rows: np.ndarray
    direct: np.ndarray
    moves: np.ndarray

    def seen(self, y, direct):
        return ordered_product(self.rows, y) + direct

    def sizes(self, y):
        return ordered_product(np.abs(self.rows), np.abs(y))


def _at_rest(diagram, whole) -> _Rest:
    """Solve for the states at rest."""
    block = prune(only(whole, whole.inputs, (diagram.wall[0], *whole.outputs[2:])))[0]
    drift, n = scene_drift(diagram), len(block.states)
    P = np.concatenate([np.concatenate([block.E, block.B], -1), np.concatenate([block.C, block.D], -1)], -2)
    lead = block.states.index(drift.lead) if drift.lead in block.states else None
    if lead is not None:
        P = _about(P, block.states, drift, lead, diagram.hand.position)
    # Rows: states, wall, position, control force; columns: states, the wall's force, the hand's, and that times its tick.
    x = block.states.index(f"frame.{diagram.hand.position}")
    unread = not np.any(P[..., : n + 1, x]) and x != lead
    kept = np.array([i for i in range(n + 1) if not (unread and i == x)])
    moves = np.zeros((), bool)
    if lead is not None and not drift.driven:
        others = kept[(kept != lead) & (kept != n)]
        law, moves = _laws(P, others, [lead], n, diagram.ratio)
        P[..., lead, :] = law[..., 0, :]
    if unread:
        law, moves = _laws(P, kept, [x], n, diagram.ratio)
        P[..., n + 1 :, :] -= P[..., n + 1 :, x, None] * law
    right = np.zeros((*P.shape[:-2], kept.size, 2), P.dtype)
    right[..., 0], right[..., -1, 1] = -P[..., kept, n + 1], 1
    rows = P[..., n + 1 :, :]
    return _Rest(solve(np.ascontiguousarray(P[..., kept[:, None], kept]), right), rows[..., kept], rows[..., n + 1], moves)


def _about(P, states, drift, lead, position):
    """Count every state that drifts from the lead, so that the drift moves the lead alone, which only wall and hand read."""
    P = P.copy()
    for name, distance in drift.shift.items():
        if name != drift.lead and name in states:
            P[..., states.index(name), :] -= distance / drift.shift[drift.lead] * P[..., lead : lead + 1, :][..., 0, :]
    P[..., lead] = 0
    P[..., len(states), lead] = 1 / drift.shift[drift.lead]
    P[..., len(states) + 1, lead] = drift.shift.get(f"frame.{position}", 0.0) / drift.shift[drift.lead]
    return P


def _laws(P, kept, rows, n, ratio):
    """Return the equations `law X = given` of states that nothing restores, as rows of P in place of their own.

    Also returns whether the hand's force moves these states without end.

    With `l = -e W^-1`, e such a row and W the equations kept, `l X + s` is changed by the hand's force alone. If the mean of
    that change does not vanish, the state is not held. Under a force z^k, z -> 1, the combination keeps the first moment over
    the frame.
    """
    W, e = P[..., kept[:, None], kept], P[..., rows, :]
    left = -np.swapaxes(solve(*(np.ascontiguousarray(np.swapaxes(part, -1, -2)) for part in (W, e[..., kept]))), -1, -2)
    mean = ordered_product(left, P[..., kept, n + 1])[..., None] + e[..., n + 1, None]
    size = ordered_product(np.abs(left), np.abs(P[..., kept, n + 1]))[..., None]
    moves = np.abs(mean) > STILL * (size + np.abs(e[..., n + 1, None]))
    given = ordered_product(left, P[..., kept, n + 2])[..., None] + e[..., n + 2, None]
    law = np.zeros(e.shape, P.dtype)
    states = kept < n
    law[..., kept[states]] = left[..., states]
    law[..., range(len(rows)), rows] = 1
    law[..., n + 1] = -given[..., 0] / ratio
    return law, moves[..., 0, 0]


def felt(coefficients: np.ndarray, K_VE) -> np.ndarray:
    """Return the stiffness (N/m) that the hand feels at rest of walls `K_VE` (N/m).

    coefficients: `(3, ...)`, see `felt_map`.
    """
    a, b, c = coefficients
    with np.errstate(all="ignore"):
        found = (a + b * K_VE) / (1 + c * K_VE)
    return np.where(np.isfinite(found), found, np.nan)
