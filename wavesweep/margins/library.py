"""Margins, as methods of a loop."""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import product
from typing import TYPE_CHECKING

from wavesweep.margins import table
from wavesweep.program import api
from wavesweep.program.analyses.asked import Numbers, axes_asked
from wavesweep.program.api import MOST_ANSWERS
from wavesweep.program.plots.style import drawn_into
from wavesweep.program.tables.frame import framed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from wavesweep.program.spec import Spec
    from wavesweep.program.tables.table import Table


@lru_cache(MOST_ANSWERS)
def _margins(spec: Spec, cut: str) -> Table:
    return table.margins(spec, cut)


class LoopMargins(api.Loop):
    """Methods that `wavesweep.Loop` has in addition."""

    def margins(self, cut: str = "") -> DataFrame:
        """Margins of the loop broken at a signal, as `wavesweep margins` computes them.

        Parameters
        ----------
        cut : str, optional
            An output of a block that a wire reads, "block.port"; by default the cut of
            the spec's `require.margins`, or of a wish, else of several channels, else the one that acts on the plant.

        Returns
        -------
        DataFrame
            A row per margin: cut, margin (its name), value in its unit (a ratio, deg or s), omega
            (rad/s from frame to frame) and hz (Hz, the line that a spectrum shows), bound
            (relative), certified, doubt, limited (whether there is a limit at all).

        Raises
        ------
        UsageError
            For another signal, or if the loop is not stable.

        Notes
        -----
        Accuracy: every row has a bound on its relative error, or a reason of doubt.
        """
        return framed(_margins(self.spec, cut))

    def plot_margins(
        self,
        cut: str = "",
        *,
        ax: Axes | None = None,
        legend: bool = True,
        caption: bool = True,
        **axes: Numbers,
    ) -> Figure:
        """Nyquist curve, open-loop Bode plot and step response with the margins, as `wavesweep margins` draws them.

        Parameters
        ----------
        cut : str, optional
            As for `margins`.
        ax, legend, caption
            As for `plot_zwidth`.
        **axes : float or array of shape (n,)
            Numbers with several values each (see `Loop`); each combination has a curve in each
            panel. By default these are the ends of the ranges of [for_all].

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        UsageError
            As for `margins`.
        """
        from wavesweep.margins.figure import margins, named_specs

        places = []
        for values in product(*(axis.values for axis in axes_asked(self.spec, axes))):
            if values:
                places.append(dict(zip(axes, values, strict=True)))
        of_loop = _margins(self.spec, cut)
        family = named_specs(self.spec, places)
        draw = partial(margins, of_loop.columns, of_loop.facts, family)
        return drawn_into(ax, draw, legend=legend, caption=caption)
