"""The lifted loop cut at the wall: its only input is the wall's force, and its outputs are the signals that the wall reads."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from wavesweep.diagram.block import Block, frozen, numbers
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.drift import drift_of
from wavesweep.diagram.elimination import reduced_echelon
from wavesweep.lifted.circle import solve
from wavesweep.lifted.lift import slow_side

V, ADVANCE, OFFSET = 0, 1, 2  # rows of C and D
MODERATE = 7.3, 5.9  # N/m and N*s/m, a wall where moderate numbers are wanted


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """Everything but the wall, once a frame, in delta form (`w = z - 1`).

    E `(..., n, n)`, B `(..., n, 1)`, C `(..., 3, n)`, D `(..., 3, 1)`; the rows of C and D are V: velocity that the wall reads,
    G_v (m/(N*s)); ADVANCE and OFFSET: its displacement is G_x = ADVANCE/w + OFFSET. integrates: whether there is an ADVANCE. It
    is the exact eigenvalue 1 of the cut loop: the position of the whole scene if no spring holds the hand, or the avatar's if
    only the wall reads it. It is kept out of E, so it is never rounded. period: of the frame, s (a number or an array over the
    batch). states, unread: names of the states that are kept and left out. condition: factor by which closing its algebraic
    loops may have multiplied the rounding of its entries; pivot: see `Block`. growth: of stretches of ticks over the frame (see
    `growth_of`). conserved: the drift that was eliminated ("" if
    none): a combination of states that no wall force changes. poles_at_one: how many eigenvalues of E are exactly 0, as that of
    a mass is that nothing brakes.
    """

    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    integrates: bool
    period: np.ndarray
    states: tuple[str, ...]
    unread: tuple[str, ...]
    conserved: str = ""
    condition: np.ndarray = 1.0
    pivot: np.ndarray = 1.0
    growth: np.ndarray = 1.0
    poles_at_one: int = 0

    def __post_init__(self):
        for name in ("E", "B", "C", "D", "period", "condition", "pivot", "growth"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def order(self) -> int:
        """Number of states of the loop with the wall closed."""
        return self.E.shape[-1] + self.integrates

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        shapes = {part.shape[:-2] for part in (self.E, self.B, self.C, self.D)}
        return shapes.pop() if len(shapes) == 1 else np.broadcast_shapes(*shapes)

    def at(self, index) -> "Cut":
        """Return the loops `index` (anything that indexes the leading axes) of the batch."""
        batch = self.batch

        def pick(array, tail):
            full = batch + array.shape[array.ndim - tail :]
            return (array if array.shape == full else np.broadcast_to(array, full))[index]

        parts = {name: pick(getattr(self, name), 2) for name in "EBCD"}
        return Cut(
            **parts,
            integrates=self.integrates,
            period=pick(self.period, 0),
            states=self.states,
            unread=self.unread,
            conserved=self.conserved,
            condition=pick(self.condition, 0),
            pivot=pick(self.pivot, 0),
            growth=pick(self.growth, 0),
            poles_at_one=self.poles_at_one,
        )


def cut_at_wall(diagram: Diagram, whole: Block | None = None) -> Cut:
    """Lift the drawing and cut it at the wall.

    diagram: the drawing. whole: see `slow_side`.
    """
    block, unread = slow_side(diagram, diagram.wall, whole=whole)
    facts = {"period": diagram.period * diagram.ratio, "unread": unread, "condition": block.condition, "pivot": block.pivot}
    facts["poles_at_one"] = _poles_at_one(diagram.structure) if diagram.structure else 0
    drift = drift_of(diagram)
    if drift.lead not in block.states:
        x, v = block.C[..., 0, :], block.C[..., 1, :]
        C = np.stack([v, np.zeros_like(x), x], axis=-2)
        D = np.stack([block.D[..., 1, :], 0 * block.D[..., 0, :], block.D[..., 0, :]], axis=-2)
        return Cut(block.E, block.B, C, D, False, states=block.states, **facts)
    lead = block.states.index(drift.lead)
    moved, others = _about_lead(block, drift, lead), np.flatnonzero(np.arange(len(block.states)) != lead)
    x, v = moved.C[..., 0, others], moved.C[..., 1, others]
    E, B = moved.E[..., others[:, None], others], moved.B[..., others, :]
    advance, step = moved.E[..., lead, others], moved.B[..., lead, :]
    names = tuple(block.states[i] for i in others)
    if not drift.driven:
        C = np.stack([v, np.zeros_like(x), x + _integrated(E, advance)], axis=-2)
        D = np.stack([moved.D[..., 1, :], 0 * step, moved.D[..., 0, :]], axis=-2)
        return Cut(E, B, C, D, False, states=names, conserved=f"{drift.lead} less what the hand has moved", **facts)
    C = np.stack(np.broadcast_arrays(v, advance, x), axis=-2)
    D = np.stack(np.broadcast_arrays(moved.D[..., 1, :], step, moved.D[..., 0, :]), axis=-2)
    return Cut(E, B, C, D, True, states=names, **facts)


@lru_cache(maxsize=256)
def _poles_at_one(structure):
    """How many eigenvalues 1 the loop without the wall and its drift has in a drawing with moderate numbers."""
    return _lacking(cut_at_wall(structure).E)


@lru_cache(maxsize=256)
def moves_on(structure: Diagram, wall: tuple[bool, bool]) -> bool:
    """Return whether the loop has an eigenvalue 1 whatever its numbers are, as a device that nothing holds and nothing brakes.

    It is none of a drift, nor of another combination of states that no force of the wall changes. structure: the drawing with
    moderate numbers. wall: whether there is a stiffness, and whether there is a damping.
    """
    cut = cut_at_wall(structure)
    closed = close(cut, *(size * each for size, each in zip(MODERATE, wall, strict=True)))
    pushed = np.concatenate([cut.E, cut.B], -1)
    if cut.integrates:
        pushed = np.concatenate([pushed, np.append(cut.C[ADVANCE], cut.D[ADVANCE])[None]])
    return _lacking(closed) > _lacking(pushed)


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


def with_batch(cut: Cut, size: int) -> Cut:
    """The cut as a batch of `size` loops, all its parts over all of them; a single loop is repeated."""
    if cut.batch:
        return cut.at(slice(None))
    return cut.at(np.newaxis) if size == 1 else cut.at(np.newaxis).at(np.zeros(size, int))


def open_in(cut: Cut, along: str, fixed) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the loop with one wall parameter closed and the other open: (E, B, C, D) from the open part's force to its input.

    along: the open parameter, "K_VE" or "B_VE"; fixed: value of the other one, an array that broadcasts with the batch.
    """
    at_rest = along == "B_VE"
    B = np.concatenate([cut.B, cut.D[..., ADVANCE : ADVANCE + 1, :]], axis=-2) if cut.integrates else cut.B
    A = np.concatenate([cut.E, cut.C[..., ADVANCE : ADVANCE + 1, :]], axis=-2) if cut.integrates else cut.E
    x, v = (
        np.concatenate([cut.C[..., row : row + 1, :], np.full((*cut.batch, 1, 1), unit)], axis=-1)
        if cut.integrates
        else cut.C[..., row : row + 1, :]
        for row, unit in ((OFFSET, 1.0), (V, 0.0))
    )
    if cut.integrates:
        A = np.concatenate([A, np.zeros((*A.shape[:-1], 1))], axis=-1)
    (closed, through), open_ = ((x, cut.D[..., OFFSET, 0]), v) if at_rest else ((v, cut.D[..., V, 0]), x)
    direct = cut.D[..., V, 0] if at_rest else cut.D[..., OFFSET, 0]
    direct, left = direct[..., None, None], (1 - fixed * through)[..., None, None]
    gain = fixed[..., None, None] / left
    return A + B * gain * closed, B / left, open_ + direct * gain * closed, direct / left


def close(cut: Cut, K_VE, B_VE) -> np.ndarray:
    """Return the frame-to-frame matrix, less identity, of the loop with the wall in place: `(..., order, order)`.

    cut: the loop without the wall. K_VE (N/m), B_VE (N*s/m): numbers or arrays that broadcast with the batch. If K_VE = 0,
    nothing reads the position of the scene; its eigenvalue 1 is a drift and is replaced by 0 (a delta of -1).
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # a frame that overflows is for the caller to see
        return _closed(cut, *(numbers(a)[..., None, None] for a in (K_VE, B_VE)))


def wall_pivot(cut: Cut, K_VE, B_VE) -> np.ndarray:
    """Return the factor of the pivot that comes from the wall's own algebraic loop; see `Block`."""
    return 1 - K_VE * cut.D[..., OFFSET, 0] - B_VE * cut.D[..., V, 0]


def _closed(cut, K, F):
    read = K * cut.C[..., OFFSET : OFFSET + 1, :] + F * cut.C[..., V : V + 1, :]
    through = 1 - K * cut.D[..., OFFSET : OFFSET + 1, :] - F * cut.D[..., V : V + 1, :]
    read = read / through
    if not cut.integrates:
        return cut.E + cut.B * read
    B = np.concatenate([cut.B, cut.D[..., ADVANCE : ADVANCE + 1, :]], axis=-2)
    A = np.concatenate([cut.E, cut.C[..., ADVANCE : ADVANCE + 1, :]], axis=-2) + B * read
    last = B * (K / through)
    last[..., -1, :] = np.where(K[..., 0, :] == 0, -1.0, last[..., -1, :])
    return np.concatenate([A, np.broadcast_to(last, (*A.shape[:-1], 1))], axis=-1)
