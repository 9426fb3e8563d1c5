"""What the figure of stable intervals shows: its rows, the roles of their axes, its limits, and
single points in it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.program.analyses.plane_columns import spec_of
from wavesweep.program.columns import Columns, whose_column
from wavesweep.program.plots.figure_layout import Layout
from wavesweep.program.plots.member_panels import Member, members_of, specs_of
from wavesweep.program.plots.region_figures import felt_differs, range_end
from wavesweep.program.tables.columns import swept_range

_ROOM_OF_FACTORS = 1.15  # a factor beyond the ends of a scale of factors


class Shown:
    """The rows of a table that its figure shows, with the roles of its axes and the best design.

    along: the number of the intervals. whose: the column that says for whom a row is. swept: the
    range in which they were searched. by_factors, view: the scale of the axis along them, and its
    ends. span: the part of `swept` in these. walls: points that capabilities mark. felt: whether
    the hand feels other stiffnesses at the limits, and some are shown.
    """

    def __init__(
        self, columns: Columns, facts: Mapping[str, Any], layout: Layout, best: Mapping[str, Any]
    ) -> None:
        self.columns = columns
        self.facts = facts
        self.layout = layout
        self.along = str(columns["along"][0])
        self.whose = whose_column(columns)
        of_specs = self.whose == "spec"
        self.best = {} if of_specs else best  # each spec has its own
        self.spec = spec_of(facts)
        ranges = [swept_range({"spec": tables}, self.along) for tables in specs_of(facts).values()]
        lowest, highest = np.transpose(ranges)
        self.swept = (float(lowest.min()), float(highest.max()))
        self.by_factors, (bottom, top) = self._limits()
        marks = offered("marks")
        if marks:
            self.walls = [marks.walls(facts, layout.x, self.along, of_specs)]
        else:
            self.walls = []
        for walls in self.walls:
            top = max(top, _ROOM_OF_FACTORS * walls.highest(self.swept[1]))
        self.view = (bottom, top)
        self.span = (max(bottom, self.swept[0]), min(top, self.swept[1]))
        of_walls = layout.x == "B_VE" and self.along == "K_VE" and self.whose in ("", "spec")
        self.felt = False
        if of_walls and felt_differs(columns):
            in_view = (columns["felt_high"] >= bottom) & (columns["felt_high"] <= top)
            self.felt = bool(in_view.any())

    def members(self, columns: Columns) -> list[Member]:
        """The members of a panel, whose rows these are."""
        specs: dict[tuple[str, str], None] = {}
        if self.whose == "spec":
            names = self.columns["spec"]
            words = self.columns.get("guarantee", np.full(names.size, "spec", object))
            specs = dict.fromkeys(zip(names.tolist(), words.tolist(), strict=True))
        return members_of(columns, self.facts, self.layout.bars, specs)

    def place(self, row: Mapping[str, Any], members: Sequence[Member]) -> tuple[float, float]:
        """The coordinates of the best end of a row, see `best_row`."""
        if self.layout.x is not None:
            return row[self.layout.x], row["value"]
        if self.whose:
            guarantees = [member.guarantee for member in members]
            return row["value"], guarantees.index(row[self.whose])
        bars = self.layout.bars
        bar = {name: row[name] for name in bars[0]}
        return row["value"], bars.index(bar) if bar in bars else np.nan

    def own_design(self, panels: Sequence[float]) -> list[tuple[float, float]]:
        """The spec's own design in the plane of the figure, or on its bar, if one of these
        panels shows it."""
        layout = self.layout
        spec = self.spec
        if spec is None or self.whose == "spec":
            return []
        if layout.x is None and self.whose:  # bars of hands are not designs
            return []
        axes_of_bars = list(layout.bars[0]) if layout.x is None else []
        names = (self.along, layout.x, layout.panels, layout.family, *axes_of_bars, *layout.fixed)
        design = {name: spec.own(spec.names.find(name).path) for name in names if name}
        if (
            None in design.values()
        ):  # an edge of a filter's band, from which its order and cutoff follow
            return []
        if not self._shows(design, panels):
            return []
        if layout.x is None:
            bar = {name: design[name] for name in axes_of_bars}
            return [(design[self.along], layout.bars.index(bar))]
        return [(design[layout.x], design[self.along])]

    def _shows(self, design: Mapping[str, float], panels: Sequence[float]) -> bool:
        """Whether these panels show all numbers of a design."""
        layout = self.layout
        shown: dict[str | None, Sequence[float]] = {
            name: (value,) for name, value in layout.fixed.items()
        }
        shown[layout.panels] = panels
        shown[layout.family] = layout.members
        if layout.x is None:
            shown |= layout.beside
        elif not layout.points[0] <= design[layout.x] <= layout.points[-1]:
            return False
        if any(name and design[name] not in values for name, values in shown.items()):
            return False
        low, high = self.span
        return bool(low <= design[self.along] <= high)

    def _limits(self) -> tuple[bool, tuple[float, float]]:
        """Whether a scale of factors shows the limits, and the ends of the axis, which all panels
        share.

        An even scale would squeeze most of the limits into its lowest part. The ends show every
        interval of the table, or the swept range if there is none. There is room beyond the largest
        value, and below the least one as far as it is swept, or if the swept range ends there.
        Space that is not swept is not shown otherwise: it would pass for unstable.
        """
        columns = self.columns
        start, _ = self.swept
        ends = np.concatenate([columns["low"], columns["high"]])
        omegas = np.concatenate([columns["low_omega"], columns["high_omega"]])
        limits = ends[~np.isnan(omegas)]
        reached = np.concatenate([columns["high"], columns.get("fails_from", [])])
        top = float(np.nanmax(reached, initial=0.0))
        # Of an axis of bars from 0 on, in whose lowest part all limits would be.
        in_lowest_part = limits.size > 0 and 0 < limits.max() < 0.1 * top
        if self.layout.x is None and start == 0 and in_lowest_part:
            # The axis then begins at a third of the lowest of these limits.
            return True, (limits[limits > 0].min() / 3, top * _ROOM_OF_FACTORS)
        starts_in_view = 0 < start < top
        bottom = float(np.nanmin(columns["low"], initial=start if starts_in_view else 0.0))
        # Half of the limits below a quarter of the largest.
        squeezed = limits.size > 0 and np.median(limits) < 0.25 * limits.max()
        factors = bool(np.isfinite(start) and start > 0 and squeezed)
        if top <= bottom:
            return factors, self.swept if np.isfinite(self.swept).all() else (bottom, 1.0)
        if factors:
            least = max(start, float(np.nanmin(columns["low"])))
            return factors, (least / _ROOM_OF_FACTORS, top * _ROOM_OF_FACTORS)
        room = 0.06 * (top - bottom)
        return factors, (self._bottom(bottom, room, starts_in_view), top + room)

    def _bottom(self, least: float, room: float, starts_in_view: bool) -> float:
        """The low end of the axis, with room below the least value as far as it is swept, or if the swept
        range ends there."""
        start, _ = self.swept
        lowest = range_end(self.columns, "low")
        if lowest is not None:
            below = lowest - room
            return min(least, below if lowest <= 0 else max(below, 0.0))
        if starts_in_view:
            return start
        # If stability ends at the least value, what is below is unstable.
        return max(start, least - room) if start < least else least

    def limits_of_walls(self) -> dict[str, float]:
        """Stiffnesses in the figure beyond which walls that are felt as they are may buzz, see
        `limits_of_walls`."""
        felt_as_it_is = self.layout.x == "B_VE" and not felt_differs(self.columns)
        limits = self.facts.get("limits_of_walls", {}) if felt_as_it_is else {}
        return {
            name: limit for name, limit in limits.items() if self.view[0] < limit < self.view[1]
        }
