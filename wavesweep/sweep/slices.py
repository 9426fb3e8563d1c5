"""Stable intervals of a run of loops, each closed with every wall: the piece of work that a worker does.

A worker gets values and arrays and loads numpy alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from wavesweep.analysis.intervals import Intervals, stable_along_any, stable_intervals
from wavesweep.diagram import WALL, draw
from wavesweep.lifted import Cut, close, cut_at_wall
from wavesweep.sweep.records import records_of

TINY = 1e-300  # stands in for a zero that would take a state out of the loop
SYMBOL = dict(zip(WALL, ("K_VE", "B_VE"), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class Work:
    """What is to be solved: intervals along the path `along` within span = (low, high).

    groups: (members, values) pairs, see `groups`; the members of all of them number the loops from 0.
    walls: path -> value of every wall that each loop is closed with. bounds: beyond them the parameter makes no loop.
    cut: the compiled loop, where there is a single one and it is at hand.
    """

    along: str
    span: tuple[float, float]
    bounds: tuple[float, float]
    groups: tuple[tuple[np.ndarray, Mapping[str, object]], ...]
    walls: Mapping[str, np.ndarray]
    cut: Cut | None = None

    def records(self) -> np.ndarray:
        """Solve it; the intervals as records."""
        return records_of(solve(self))


def solve(work: Work) -> Intervals:
    """Solve it; columns of the result are numbered `loop * walls + wall`."""
    walls = len(work.walls[WALL[0]])
    along = _along_wall if work.along in WALL else _along_number
    parts = []
    for members, values in work.groups:
        found = along(work, values, members.size, walls)
        parts.append((found, members[found.column // walls] * walls + found.column % walls))
    return joined(parts)


def _along_wall(work, values, size, walls):
    """Exactly, the wall being one scalar of the cut loop."""
    loops = with_batch(work.cut or cut_at_wall(draw(values)), size)
    other = next(path for path in WALL if path != work.along)
    return stable_intervals(loops, SYMBOL[work.along], work.span, np.broadcast_to(work.walls[other], (size, walls)))


def _along_number(work, values, size, walls):
    """Through eigenvalues: the loop is compiled anew at every point that is asked for, once for all walls."""
    K, B = (work.walls[path] for path in WALL)

    def evaluate(column, p):
        loop, wall = np.divmod(column, walls)
        first, back = _different(loop, p)
        at, p = loop[first], np.where(p[first] == 0, TINY, p[first])
        varied = {path: v[at] if np.ndim(v) else v for path, v in values.items()} | {work.along: p}
        with np.errstate(all="ignore"):  # beside the real axis a loop may explode: what is not finite is seen by the panels
            cuts = with_batch(cut_at_wall(draw(varied)), p.size).at(back)
            return close(cuts, K[wall], B[wall])

    rate = np.broadcast_to(np.asarray(values["rates.fast_hz"], float), (size,))
    ticks = draw(values).ratio
    return stable_along_any(evaluate, work.span, size * walls, np.repeat(ticks / rate, walls), _bounds(work, rate))


def _different(loop, p):
    """Where each different pair of loop and value stands first, and for all of them which of these they equal."""
    order = np.lexsort((p.imag, p.real, loop))
    new = np.append(True, (np.diff(loop[order]) != 0) | (np.diff(p[order]) != 0))[: p.size]
    back = np.empty(p.size, int)
    back[order] = np.cumsum(new) - 1
    return order[new], back


def _bounds(work, rate):
    """Beyond which values there is no loop; for a cutoff, half way from the span to half the fast rate (Hz)."""
    low, high = work.bounds
    if work.along.endswith("cutoff_hz"):
        high = min(high, (work.span[1] + rate.min() / 2) / 2)
    return low, high


def with_batch(cut: Cut, size: int) -> Cut:
    """The cut as a batch of `size` loops; one that nothing varied is repeated."""
    return cut if cut.batch else cut.at(np.newaxis).at(np.zeros(size, int))


def joined(parts) -> Intervals:
    """Intervals of several groups as one, sorted by column; parts: (intervals, their columns' new numbers) pairs."""
    column = np.concatenate([columns for _, columns in parts])
    order = np.argsort(column, kind="stable")
    whole = {f.name: np.concatenate([getattr(part, f.name) for part, _ in parts])[order] for f in fields(Intervals)}
    return Intervals(**(whole | {"column": column[order]}))
