"""Poles and root loci, as methods of a loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wavesweep.poles import table
from wavesweep.poles.figure import poles as drawn
from wavesweep.program import api
from wavesweep.program.analyses.asked import Numbers, axes_asked, axis_along
from wavesweep.program.plots.style import drawn_into
from wavesweep.program.spec.loading import naming
from wavesweep.program.tables.frame import framed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame


class LoopPoles(api.Loop):
    """Methods that `wavesweep.Loop` has in addition."""

    def poles(self) -> DataFrame:
        """The closed-loop poles of the loop's own numbers, without what drifts.

        Returns
        -------
        DataFrame
            A row per pole, the slowest first, with the columns of `wavesweep poles`, among them
            `z_re` and `z_im` per frame and their `radius`; `s_re` (1/s) and `s_im` (rad/s) of `s =
            log(z)/T`, T the period of the frame; `frequency_hz` (Hz), `damping_ratio` and
            `time_constant_s` (s) of s; `states`, the states that take part most, by participation
            factors; `shown_hz` (Hz), the line that a spectrum shows, since a frame has only an
            image of a frequency above half its rate.

        Notes
        -----
        Accuracy: that of eigenvalues in double precision; `doubt` says where rounding hides whether
        a pole is stable.
        """
        return framed(table.poles(self.spec))

    def plot_root_locus(
        self,
        number: str,
        values: Numbers | None = None,
        *,
        ax: Axes | None = None,
        legend: bool = True,
        caption: bool = True,
    ) -> Figure:
        """The poles per frame over a number, with the unit circle and the ends of stable intervals.

        Parameters
        ----------
        number : str
            Named as an axis, see `Loop`.
        values : array of shape (n,), optional
            By default 300 over the span that the spec's [sweep] has for it. Ends, which are
            certified or marked as not certified, are those between the least and the largest value;
            a number that decides how the loop is built has none.
        ax, legend, caption
            As for `plot_zwidth`.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        UsageError
            If a spec would not accept a name or a value.
        """
        spec = naming(self.spec, [number])
        if values is None:
            span = axis_along(spec, number, None)
            values = np.linspace(span.start, span.stop, table.LOCUS)
        (axis,) = axes_asked(spec, {number: values})
        locus = table.over(spec, axis)
        figure: Figure = drawn_into(
            ax, lambda: drawn(locus.columns, locus.facts), legend=legend, caption=caption
        )
        return figure
