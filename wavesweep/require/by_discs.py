"""Intervals in which the eigenvalues of a loop are where they have to be, along any number, by
discs about them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Protocol

import numpy as np

from wavesweep.engine.frames import Frames, blocks_of, level, pole_inside
from wavesweep.engine.intervals import END_ROUNDING, SHARE_OF_SPAN, Intervals
from wavesweep.require.disc_panels import (
    HALF_RIM,
    OPEN,
    SAFE,
    Accuracy,
    Domain,
    along_panels,
)
from wavesweep.require.discs import RequiredCircle, Spiral, verdicts

BEGUN = 1e-9  # see `Accuracy`; eigenvalues may move along the spiral


class Family(Protocol):
    """Loops of some columns along a number p, as `FramesAlong` has them; of one column or of each
    value its own."""

    def frames(self, number: np.ndarray, p: np.ndarray) -> Frames:
        """At values, real or complex, of which the pivots are read."""

    def errors(self, number: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frames less identity `(n, r, r)`, and bounds on the errors of their entries."""

    def turns(
        self,
        number: np.ndarray,
        p: np.ndarray,
        delta: np.ndarray,
        radius: np.ndarray,
        margin: float,
    ) -> np.ndarray:
        """What modes turn in a frame (rad), `(n, r, 3)`, see `FramesAlong.turns`."""


def along_by_discs(
    family: Family,
    domain: Domain,
    place: Spiral | RequiredCircle,
    *,
    lines: bool,
) -> Intervals:
    """All intervals of a number p within a domain in which all eigenvalues are in their place, per
    column.

    place: of the eigenvalues, see `discs`. lines: whether modes have other lines than their angles.

    All of a panel of p is in an interval, or none of it, if that follows from Gershgorin discs of
    the frames in the eigenvectors of that in the middle. The entries there are bounded by the
    frames on a circle about the panel, as they are analytic and vanish in the middle (Schwarz's
    lemma), and by the errors of the frames. Otherwise the panel is halved, see `panels`. Diagonal
    blocks go apart. Accuracy: EXACT, and BEGUN. Errors: UsageError if no loop can have its
    eigenvalues there.
    """
    columns = domain.period.size
    loops, finite_columns = _loops_of(family, lines, domain.span, columns, place)
    ends = Accuracy(END_ROUNDING, 256.0, END_ROUNDING * SHARE_OF_SPAN, np.full(columns, BEGUN))
    return along_panels(loops, finite_columns, domain, ends)


def _loops_of(
    family: Family,
    lines: bool,
    span: tuple[float, float],
    columns: int,
    place: RequiredCircle | Spiral,
) -> tuple[list[_LoopsInDiscs], np.ndarray]:
    """The loops by diagonal blocks, without states that are 0 at the end of every frame, and the
    columns with known frames."""
    # Of the span, where the structure of the frames is looked at.
    points = span[0] + (span[1] - span[0]) * np.array(
        (0.53, 0.37, 0.71, 0.13, 0.91, 1e-3, 0.0, 1.0)
    )
    column = np.repeat(np.arange(columns), points.size)
    E, _ = family.errors(column, np.tile(points, columns))
    states = E.shape[-1]
    E = E.reshape(columns, points.size, states, states)
    finite = np.isfinite(E).all((-1, -2))
    finite_columns = finite.any(-1)
    nonzero = (finite[..., None, None] & (E + np.eye(states) != 0)).any((0, 1))
    loops = []
    for block in blocks_of(nonzero):
        same_block = block[:, None], block
        if nonzero[same_block].any():
            some = np.flatnonzero(finite_columns)
            loops.append(_LoopsInDiscs(family, lines, some, states, block, place))
            place.refuse(E[finite][:, *same_block])
    return loops, finite_columns


@dataclass(frozen=True, slots=True, eq=False)
class _LoopsInDiscs:
    """A diagonal block of the frames, which have so many states, of some columns.

    A judge of `panels`; place: of the eigenvalues.
    """

    family: Family
    lines: bool
    columns: np.ndarray
    states: int
    block: np.ndarray
    place: Spiral | RequiredCircle
    forms: ClassVar[None] = None

    @property
    def order(self) -> int:
        """Of the block."""
        return self.block.size

    @property
    def many(self) -> int:
        """Panels of a column that may be open, fewer of large matrices."""
        # Panels of a column that may be open, and entries of their matrices.
        return min(1024, max(16, 50_000 // self.order**2))

    @property
    def smooth(self) -> bool:
        """Whether the number moves the worst eigenvalue smoothly across its bound."""
        return self.place.smooth

    def at(self, column: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The frames less identity, `(n, r, r)`, and bounds on the errors of their entries."""
        E, dE = self.family.errors(self.columns[column], p)
        order = self.order
        if E.shape[-1] != self.states:  # states that are there at some values alone
            unknown = np.full((p.size, order, order), np.nan)
            return unknown, unknown
        rows = self.block[:, None]
        return E[:, rows, self.block], np.abs(dE[:, rows, self.block])

    def about(
        self, column: np.ndarray, middle: np.ndarray, radius: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`at` the middles of discs, and the frames on their rims, `(n, points, r, r)`, NaN if
        there may be a pole inside."""
        middle = middle[:, None]
        rim = middle + radius[:, None] * HALF_RIM
        columns = self.columns[column][:, None]
        inside = self.family.frames(columns, middle).pivots
        pivots = self.family.frames(columns, rim).pivots.reshape(*rim.shape, -1)
        moving = (pivots != pivots[:, :1]).any((1, 2))
        poles = pole_inside(pivots, level(inside[:, None])) & moving

        # All in one call, so that they have the same states.
        p = np.concatenate([middle, rim], axis=1)
        E, dE = self.at(np.repeat(column, p.shape[1]), p.ravel())
        E = E.reshape(*p.shape, *E.shape[1:])
        dE = dE.reshape(*p.shape, *dE.shape[1:])
        rims = np.where(poles[:, None, None, None], np.nan, E[:, 1:])
        return E[:, 0].real, dE[:, 0], rims

    def label(
        self,
        column: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
        bounds: tuple[np.ndarray, np.ndarray],
    ) -> np.ndarray:
        """GOOD, BAD or OPEN of panels."""
        middle = (low + high) / 2
        radius = high - low  # twice that of the panel
        E, dE, rims = self.about(column, middle, radius)
        inside_range = middle - radius >= bounds[0][column]
        inside_range &= middle + radius <= bounds[1][column]
        inside_range &= np.isfinite(E).all((-1, -2))
        inside_range &= np.isfinite(dE).all((-1, -2))
        inside_range &= np.isfinite(rims).all((-1, -2, -3))
        label = np.full(column.size, OPEN)
        inside = np.flatnonzero(inside_range)
        if inside.size:
            place = self.place.at(self.columns[column[inside]])
            lines = None
            if self.lines:
                lines = partial(
                    self.lines_on_panels, column[inside], middle[inside], radius[inside]
                )
            label[inside] = verdicts(E[inside], dE[inside], rims[inside], place, lines)
        return label

    def lines_on_panels(
        self,
        column: np.ndarray,
        middle: np.ndarray,
        radius: np.ndarray,
        delta: np.ndarray,
        wanted: np.ndarray,
        of_discs: np.ndarray | None = None,
    ) -> np.ndarray:
        """What the modes of eigenvalues less 1 in discs about those in the middles of panels turn
        in a frame (rad) anywhere on the panels, `(n, r, 3)`; without discs in the middles alone.

        They are asked about of some modes, a mask `(n, r)`; the others have their angles. radius:
        twice that of the panels.
        """
        turns = np.stack([np.abs(np.angle(1 + delta))] * 3, -1)
        p = middle[:, None]
        if of_discs is None:
            of_discs = np.zeros(delta.shape)
        else:
            p = np.concatenate([p, p + radius[:, None] * HALF_RIM], axis=1)
        # Entries of the matrices of a tick, on circles about panels.
        at_once = max(1, 500_000 // (p.shape[1] * self.states**2))
        some = np.flatnonzero(wanted.any(-1))
        for first in range(0, some.size, at_once):
            batch = some[first : first + at_once]
            turns[batch] = self.told(
                self.columns[column[batch]], p[batch], delta[batch], wanted[batch], of_discs[batch]
            )
        return turns

    def told(
        self,
        columns: np.ndarray,
        p: np.ndarray,
        delta: np.ndarray,
        wanted: np.ndarray,
        radius: np.ndarray,
    ) -> np.ndarray:
        """What some modes at values turn, see `FramesAlong.turns`; wanted: which, a mask. The
        others may have their angles."""
        turns = np.stack([np.abs(np.angle(1 + delta))] * 3, -1)
        conjugate = np.abs(delta[:, :, None] - delta.conj()[:, None, :]).argmin(-1)
        wanted = wanted | np.take_along_axis(wanted, conjugate, 1)
        radius = np.maximum(radius, np.take_along_axis(radius, conjugate, 1))
        upper = wanted & (delta.imag >= 0)
        modes = upper.sum(-1).max(initial=0)
        if not modes:
            return turns
        order = np.argsort(~upper, axis=-1, kind="stable")[:, :modes]
        of_order = (np.take_along_axis(array, order, 1) for array in (delta, radius))
        lines = self.family.turns(columns, p, *of_order, SAFE)
        np.put_along_axis(turns, order[..., None], lines, 1)
        of_conjugate = np.take_along_axis(turns, conjugate[..., None], 1)
        return np.where((wanted & ~upper)[..., None], of_conjugate, turns)

    def worst(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of each loop the eigenvalue less 1 that is farthest outside of its place, and by how
        much."""
        E, _ = self.at(np.full(p.size, np.searchsorted(self.columns, column)), p)
        finite = np.isfinite(E).all((-1, -2))
        delta = np.linalg.eigvals(np.where(finite[:, None, None], E, 0.0)).astype(complex)
        place = self.place.at(np.full(p.size, column))
        if self.lines:
            wanted = place.turning(delta)
            columns = np.full(p.size, column)
            alone = np.zeros(delta.shape)
            place = place.told(self.told(columns, p[:, None], delta, wanted, alone))
        beyond = place.beyond(delta)
        loop = np.arange(p.size)
        farthest = beyond.argmax(-1)
        return delta[loop, farthest], beyond[loop, farthest]
