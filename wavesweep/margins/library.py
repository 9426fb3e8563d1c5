"""Poles and margins, as methods of a loop."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.core import api
from wavesweep.core.analyses.asked import Numbers, axes_asked, axis_along
from wavesweep.core.plots.style import drawn_into
from wavesweep.core.spec.loading import naming
from wavesweep.core.tables.frame import frame, framed
from wavesweep.margins import poles, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame


class Loop(api.Loop):
    """Methods of a compiled loop."""

    def poles(self) -> DataFrame:
        """The closed-loop poles of the loop's own numbers: a DataFrame, a row per pole, the slowest first, without what drifts.

        Columns: `z_re` and `z_im` per frame and their `radius`; `s_re` (1/s) and `s_im` (rad/s) of `s = log(z)/T`, T the period
        of the frame; `frequency_hz`, `damping_ratio` and `time_constant_s` of s; `states`, the states that take part most,
        by participation factors. A frame shows only an image of a frequency above half its rate.
        Accuracy: that of eigenvalues in double precision; intervals and the spectral radius say when rounding hides them.
        """
        return frame(poles.poles(self.spec), poles.UNITS, self.spec.for_all)

    def margins(self, cut: str = "") -> DataFrame:
        """Margins of the loop broken at a signal, as `wavesweep margins` computes them: a DataFrame.

        cut: an output of a block that a wire reads, "block.port"; by default the only one that acts on the plant. Errors:
        UsageError for another signal, or if the loop is not stable. Accuracy: every row has a bound on its relative error, or
        a reason of doubt.
        """
        return framed(table.margins(self.spec, cut))

    def plot_root_locus(self, number: str, values: Numbers | None = None, *, ax: Axes | None = None) -> Figure:
        """The poles per frame over a number: a matplotlib `Figure`, with the unit circle and the ends of stable intervals.

        number: named as an axis, see `Loop`. values: by default 300 over the span that the spec's [sweep] has for it. Ends,
        which are certified or marked as not certified, are those between the least and the largest value; a number that
        decides how the loop is built has none. Errors: UsageError if a spec would not accept a name or a value.
        """
        from wavesweep.margins.locus import LOCUS, locus_of

        spec = naming(self.spec, [number])
        if values is None:
            span = axis_along(spec, number, None)
            values = np.linspace(span.start, span.stop, LOCUS)
        (axis,) = axes_asked(spec, {number: values})
        return drawn_into(ax, lambda: locus_of(spec, axis))

    def plot_margins(self, cut: str, *, ax: Axes | None = None, **axes: Numbers) -> Figure:
        """Nyquist curve, open-loop Bode plot and step response with the margins, as `wavesweep margins` draws them.

        cut: as for `margins`. axes: numbers with several values each (see `Loop`); each combination has a curve in each panel.
        By default these are the ends of the ranges of [for_all]. Errors: as for `margins`.
        """
        from wavesweep.margins.figure import margins, named_specs

        asked, found = axes_asked(self.spec, axes), table.margins(self.spec, cut)
        places = [dict(zip(axes, each, strict=True)) for each in product(*(axis.values for axis in asked)) if each]
        family = named_specs(self.spec, places)
        return drawn_into(ax, lambda: margins(found.columns, found.facts, family))
