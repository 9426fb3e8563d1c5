"""What the figure of stable intervals shows: its rows, the roles of their axes, its limits, and single points in it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.capabilities import modules
from wavesweep.program.analyses.plane_columns import spec_of
from wavesweep.program.columns import Columns, whose_column
from wavesweep.program.plots.figure_layout import Layout
from wavesweep.program.plots.member_panels import Member, members_of, specs_of
from wavesweep.program.plots.region_figures import felt_differs, range_end
from wavesweep.program.tables.columns import swept_range

_SQUEEZED, _ROOM = 0.25, 1.15  # of the largest limit, and a factor beyond the ends of a scale of factors
_LOWEST, _BELOW = 0.1, 3  # of an axis of bars from 0 on, in whose lowest part all limits would be; where it then begins


class Shown:
    """The rows of a table that its figure shows, with the roles of its axes and the best design.

    along: the number of the intervals. whose: the column that says for whom a row is. swept: the range in which they were
    searched. by_factors, view: the scale of the axis along them, and its ends. span: the part of `swept` in these. walls:
    points that capabilities mark. felt: whether the hand feels other stiffnesses at the limits, and some are shown.
    """

    def __init__(self, columns: Columns, facts: Mapping[str, Any], layout: Layout, best: Mapping[str, Any]) -> None:
        self.columns, self.facts, self.layout = columns, facts, layout
        self.along, self.whose = str(columns["along"][0]), whose_column(columns)
        self.best = {} if self.whose == "spec" else best  # each spec has its own
        self.spec = spec_of(facts)
        swept = np.array([swept_range({"spec": tables}, self.along) for tables in specs_of(facts).values()])
        self.swept = float(swept[:, 0].min()), float(swept[:, 1].max())
        self.by_factors, self.view = self._limits()
        self.walls = [marks.walls(facts, layout.x, self.along, self.whose == "spec") for marks in modules("marks")]
        self.view = self.view[0], max([self.view[1], *(_ROOM * marks.highest(self.swept[1]) for marks in self.walls)])
        self.span = max(self.view[0], self.swept[0]), min(self.view[1], self.swept[1])
        of_walls = layout.x == "B_VE" and self.along == "K_VE" and self.whose in ("", "spec")
        self.felt = False
        if of_walls and felt_differs(columns):
            self.felt = bool(((columns["felt_high"] >= self.view[0]) & (columns["felt_high"] <= self.view[1])).any())

    def members(self, columns: Columns) -> list[Member]:
        """The members of a panel, whose rows these are."""
        specs = dict.fromkeys(self.columns["spec"].tolist()) if self.whose == "spec" else ()
        return members_of(columns, self.facts, self.layout.bars, list(specs))

    def place(self, row: Mapping[str, Any], members: Sequence[Member]) -> tuple[float, float]:
        """The coordinates of the best end of a row, see `layout.best_row`."""
        if self.layout.x is not None:
            return row[self.layout.x], row["value"]
        if self.whose:
            return row["value"], [member.guarantee for member in members].index(row[self.whose])
        bar = {name: row[name] for name in self.layout.bars[0]}
        return row["value"], self.layout.bars.index(bar) if bar in self.layout.bars else np.nan

    def own_design(self, panels: Sequence[float]) -> list[tuple[float, float]]:
        """The spec's own design in the plane of the figure, or on its bar, if one of these panels shows it."""
        layout, spec = self.layout, self.spec
        if spec is None or self.whose == "spec" or (layout.x is None and self.whose):  # bars of hands are not designs
            return []
        bars = layout.bars[0] if layout.x is None else ()
        names = (self.along, layout.x, layout.panels, layout.family, *bars, *layout.fixed)
        design = {name: spec.own(spec.names.find(name).path) for name in names if name}
        if None in design.values():  # an edge of a filter's band, from which its order and cutoff follow
            return []
        if not self._shows(design, panels):
            return []
        if layout.x is None:
            return [(design[self.along], layout.bars.index({name: design[name] for name in bars}))]
        return [(design[layout.x], design[self.along])]

    def _shows(self, design: Mapping[str, float], panels: Sequence[float]) -> bool:
        """Whether these panels show all numbers of a design."""
        layout = self.layout
        shown = {name: (value,) for name, value in layout.fixed.items()}
        shown |= {layout.panels: panels, layout.family: layout.members} | (layout.beside if layout.x is None else {})
        if any(name and design[name] not in values for name, values in shown.items()):
            return False
        spans = {self.along: (max(self.swept[0], self.view[0]), min(self.swept[1], self.view[1]))}
        spans |= {layout.x: (layout.points[0], layout.points[-1])} if layout.x else {}
        return all(low <= design[name] <= high for name, (low, high) in spans.items())

    def _limits(self) -> tuple[bool, tuple[float, float]]:
        """Whether a scale of factors shows the limits, most of which an even one would squeeze into its lowest part, and the
        ends of the axis, which show every interval of the table, or the swept range if there is none; all panels share them.

        There is room beyond the largest value, and below the least one as far as it is swept, or if the swept range ends there.
        Space that is not swept is not shown otherwise: it would pass for unstable.
        """
        columns, swept = self.columns, self.swept
        ends = np.concatenate([columns["low"], columns["high"]])
        real = ends[~np.isnan(np.concatenate([columns["low_omega"], columns["high_omega"]]))]
        factors = bool(np.isfinite(swept[0]) and swept[0] > 0 and real.size and np.median(real) < _SQUEEZED * real.max())
        top = float(np.nanmax(np.concatenate([columns["high"], columns.get("fails_from", [])]), initial=0.0))
        if self.layout.x is None and swept[0] == 0 and real.size and 0 < real.max() < _LOWEST * top:
            return True, (real[real > 0].min() / _BELOW, top * _ROOM)
        bottom = float(np.nanmin(columns["low"], initial=swept[0] if 0 < swept[0] < top else 0.0))
        if top <= bottom:
            return factors, swept if np.isfinite(swept).all() else (bottom, 1.0)
        if factors:
            return factors, (max(swept[0], float(np.nanmin(columns["low"]))) / _ROOM, top * _ROOM)
        room, lowest = 0.06 * (top - bottom), range_end(columns, "low")
        if lowest is not None:
            bottom = min(bottom, lowest - room if lowest <= 0 else max(lowest - room, 0.0))
        elif 0 < swept[0] < top:
            bottom = swept[0]
        elif swept[0] < bottom:  # stability ends there, and what is below is unstable
            bottom = max(swept[0], bottom - room)
        return factors, (bottom, top + room)

    def limits_of_walls(self) -> dict[str, float]:
        """Stiffnesses in the figure beyond which walls that are felt as they are may buzz, see `limits_of_walls`."""
        felt_as_it_is = self.layout.x == "B_VE" and not felt_differs(self.columns)
        limits = self.facts.get("limits_of_walls", {}) if felt_as_it_is else {}
        return {name: limit for name, limit in limits.items() if self.view[0] < limit < self.view[1]}
