"""Gain and phase margins at a cut on stretches of a number by forms that decrease, where panels would
be many: where a factor hardly moves a slow mode.

A form of the states, a polynomial in the number and in the factor of the signal at the cut, is shown
to decrease in each cell of both, as [for_all] shows it of its numbers. So all loops of a stretch are
stable with every factor of the margin. A stretch has it nowhere if all of its loops are unstable with
one factor, by their exact intervals.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from wavesweep.engine.intervals import Search
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Sides
from wavesweep.engine.switched import Growth, cover_constant
from wavesweep.program.analyses.factors_at_cut import with_factors
from wavesweep.program.reading.axes import Axis
from wavesweep.require.disc_panels import BAD, GOOD

VALUES, LOOKED_AT = 17, 33  # of the number, and of each side of the factor, that are looked at
ZOOMS, PEAKS = 4, 3  # in which the worst factor is looked for about the largest radii
NEAR = 1e-7  # of an end, how far from it proofs go


@dataclass(frozen=True)
class ByForms:
    """Proofs of a margin along a number.

    loops: a batch, whose columns are its loops. margin, size: what is asked, by the names of [sweep]
    require. span: of the number.
    """

    loops: Loops
    along: str
    cut: str
    margin: str
    size: float
    span: tuple[float, float]

    @cached_property
    def _with_factor(self) -> tuple[Loops, Axis]:
        """The loops with the factor, and its range."""
        margin_at_cut = {"cut": self.cut, self.margin: self.size}
        loops, (factor,) = next(with_factors(self.loops, margin_at_cut, {self.along: self.span}))
        return loops, factor

    def told(
        self, column: int, low: np.ndarray, high: np.ndarray
    ) -> list[tuple[float, float, int]]:
        """Stretches of the panels of a column, with GOOD or BAD of each."""
        told = []
        loops, factor = self._with_factor
        loops = loops.one(column) if loops.batch else loops
        order = np.argsort(low)
        sampled = order[np.unique(np.linspace(0, low.size - 1, VALUES).astype(int))]
        p = (low[sampled] + high[sampled]) / 2
        growth = np.array([self._worst(loops, factor, value, zooms=1)[0] for value in p])
        edges = [low.min()]
        for first in np.flatnonzero((growth[1:] < 0) != (growth[:-1] < 0)).tolist():
            edges.append(self._end(loops, factor, *p[first : first + 2]))
        edges.append(high.max())
        good = bool(growth[0] < 0)
        for start, stop in pairwise(edges):
            if good:
                begun = (start + stop) / 2
                low_end = start + NEAR * abs(start) * (start > edges[0])
                high_end = stop - NEAR * abs(stop) * (stop < edges[-1])
                down = self._reached(loops, factor, begun, low_end, up=False)
                up = self._reached(loops, factor, begun, high_end, up=True)
                told.append((down, up, GOOD))
            else:
                for seen_at in (start, (start + stop) / 2, stop):
                    unstable = self._unstable(loops, factor, seen_at, (start, stop))
                    told += [(*ends, BAD) for ends in unstable]
            good = not good
        return told

    def _worst(self, loops, factor, p, zooms=ZOOMS):
        """The logarithm of the largest spectral radius of the loop at p, over the factors of the
        range, and the factor that has it: as far as a search finds it, which zooms in about the
        largest peaks."""
        step = (factor.stop - factor.start) / (LOOKED_AT - 1)
        places = np.linspace(factor.start, factor.stop, LOOKED_AT)
        growth = Growth.of_loops(loops, [self.along, factor.path])

        def radii(places):
            return growth.of(np.column_stack([np.full(places.size, p), places]))

        radii_found = radii(places)
        for _ in range(zooms):
            beside = np.pad(radii_found, 1, constant_values=-1.0)
            peaks = np.flatnonzero((radii_found >= beside[:-2]) & (radii_found >= beside[2:]))
            peaks = peaks[np.argsort(-radii_found[peaks])][:PEAKS]
            around = places[peaks, None] + np.linspace(-step, step, LOOKED_AT // 2)
            places = np.unique(np.clip(np.append(around, places[peaks]), factor.start, factor.stop))
            step *= 2 / (LOOKED_AT // 2 - 1)
            radii_found = radii(places)
        return float(np.log(radii_found.max())), places[radii_found.argmax()]

    def _end(self, loops, factor, first, second):
        """Where between two values the loops begin to be unstable with some factor."""
        from scipy.optimize import brentq

        def growth(p: float) -> float:
            return self._worst(loops, factor, p)[0]

        if growth(first) * growth(second) >= 0:  # the worst factor lies between those of the grid
            return first
        return brentq(growth, first, second, rtol=NEAR / 16)

    def _unstable(self, loops, factor, seen_at, span):
        """Stretches of a span in which no loop is stable with the factor that is worst at a value."""
        _, worst = self._worst(loops, factor, seen_at)
        group = ((np.zeros(1, int), loops.changed({factor.path: worst})),)
        records = Search(self.along, span, group, lines=False, checked=True).records()
        if not records["certified"].all():
            return []
        stable = [span[0], *np.column_stack([records["low"], records["high"]]).ravel(), span[1]]
        if not records["intervals"].all():
            stable = [*span]
        return zip(stable[::2], stable[1::2], strict=True)

    def _reached(self, loops, factor, begun, end, *, up):
        """Up to which value of the number all loops are shown, from one on towards an end."""
        paths = [self.along, factor.path]
        box = np.array([sorted((begun, end)), (factor.start, factor.stop)]).T
        sides = Sides.of(loops, paths, box, swept=True)
        whole = sides.places(box)
        return float(sides[0].number(cover_constant(loops, sides, whole, up).end))
