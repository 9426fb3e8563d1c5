"""A sweep's columns in chunks: contiguous pieces of about a third of a second, the unit that is handed out and kept."""

from dataclasses import dataclass

import numpy as np

SECONDS = 0.3  # a chunk should take so long: longer, and a crash loses more; shorter, and handing it out costs more
FEWEST, MOST = 16, 4096  # columns of a chunk; more would leave the processor's cache
# Seconds per column and squared order, measured: one polynomial per column; arcs, which crowded poles of high order need;
# eigenvalues at many points, along anything but the wall.
BY_POLYNOMIAL, BY_ARCS, BY_EIGENVALUES = 0.4e-6, 30e-6, 40e-6
CROWDED = 24  # states


@dataclass(frozen=True, slots=True)
class Chunk:
    """The loops `loops` closed with the walls `walls` (index ranges); its columns are consecutive, from `first` on."""

    number: int
    loops: range
    walls: range
    first: int

    @property
    def columns(self) -> int:
        """How many columns it has."""
        return len(self.loops) * len(self.walls)


@dataclass(frozen=True, slots=True)
class Chunks:
    """All chunks of `loops x walls` columns, column = loop * walls + wall; each of `deep` loops and `wide` walls at most.

    One of the two is whole: several loops with all their walls, or a part of the walls of one loop. So a chunk is a run of
    consecutive columns. Where the borders are leaves no trace in the results.
    """

    loops: int
    walls: int
    deep: int
    wide: int

    def __len__(self) -> int:
        return -(-self.loops // self.deep) * self._across

    @property
    def _across(self):
        return -(-self.walls // self.wide)

    def __getitem__(self, number: int) -> Chunk:
        down, across = divmod(number, self._across)
        loops = range(down * self.deep, min((down + 1) * self.deep, self.loops))
        walls = range(across * self.wide, min((across + 1) * self.wide, self.walls))
        return Chunk(number, loops, walls, loops.start * self.walls + walls.start)

    def of(self, column) -> np.ndarray:
        """Number of the chunk that each column is in."""
        loop, wall = np.divmod(column, self.walls)
        return loop // self.deep * self._across + wall // self.wide


def cut_up(loops: int, walls: int, cost: float) -> Chunks:
    """Cut the columns into chunks of about `SECONDS`; cost: s per column, as expected (see `expected_cost`)."""
    columns = int(np.clip(SECONDS / cost, FEWEST, MOST))
    if walls > columns:
        return Chunks(loops, walls, 1, columns)
    return Chunks(loops, walls, columns // walls, walls)


def expected_cost(order: int, wall: bool) -> float:
    """Seconds that a column of a loop with `order` states takes, roughly; wall: along K_VE or B_VE.

    A fixed rule and no measurement, so that a run that goes on finds the chunks of the one that was stopped.
    """
    share = BY_EIGENVALUES if not wall else BY_POLYNOMIAL if order <= CROWDED else BY_ARCS
    return share * max(order, 2) ** 2
