"""The pictures, as methods of a loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavesweep.picture.diagram import diagram
from wavesweep.picture.timing import timing
from wavesweep.program import api
from wavesweep.program.plots.style import drawn_into

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class LoopPicture(api.Loop):
    """Methods that `wavesweep.Loop` has in addition."""

    def plot_diagram(self, *, ax: Axes | None = None) -> Figure:
        """The picture of the loop, as `wavesweep check --plot` draws it.

        Parameters
        ----------
        ax : Axes, optional
            As for `plot_zwidth`.

        Returns
        -------
        matplotlib.figure.Figure
        """
        return drawn_into(ax, lambda: diagram(self.spec))

    def plot_timing(self, *, ax: Axes | None = None) -> Figure:
        """When the loop samples, computes and acts, as `wavesweep check --plot` draws it.

        Parameters
        ----------
        ax : Axes, optional
            As for `plot_zwidth`.

        Returns
        -------
        matplotlib.figure.Figure
        """
        return drawn_into(ax, lambda: timing(self.spec))
