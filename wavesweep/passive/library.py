"""Passivity, as calls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

from wavesweep.passive import table
from wavesweep.program import api
from wavesweep.program.analyses.asked import Numbers, axes_asked
from wavesweep.program.analyses.claims import own_figures
from wavesweep.program.api import Source, figure_of_table, spec_of
from wavesweep.program.plots.style import drawn_into
from wavesweep.program.spec.loading import naming
from wavesweep.program.sweep.running import WorkOptions
from wavesweep.program.tables.frame import framed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame


class LoopPassive(api.Loop):
    """Methods that `wavesweep.Loop` has in addition."""

    def passivity(self, **axes: Numbers) -> DataFrame:
        """Norm of the wave channel and margin at the hand's port.

        Parameters
        ----------
        **axes : float or array of shape (n,)
            See `Loop`.

        Returns
        -------
        DataFrame
            The columns of `wavesweep passivity`: each axis given, channel_norm (passive up to 1),
            channel_omega (rad/s, of that norm), port_margin (m/N, the smallest eigenvalue of the
            Hermitian part, force to displacement), port_omega (rad/s), channel_passive,
            port_passive, stable, damping_needed (N*s/m of further device damping for a passive
            port), channel_hz, port_hz (Hz).

        Notes
        -----
        Accuracy: see docs/accuracy.md.
        """
        spec = naming(self.spec, axes)
        rows = table.in_memory(spec, axes_asked(spec, axes))
        return self._frame("passivity", rows, own_figures([spec], "energies at the ports"))

    def plot_passivity(
        self,
        *,
        ax: Axes | None = None,
        legend: bool = True,
        caption: bool = True,
        **axes: Numbers,
    ) -> Figure:
        """The figure of channel norm and port margin, as `wavesweep passivity` draws it.

        Parameters
        ----------
        ax, legend, caption
            As for `plot_zwidth`.
        **axes
            As for `passivity`.

        Returns
        -------
        matplotlib.figure.Figure
        """
        draw = figure_of_table("passivity", self.passivity(**axes), self.spec)
        return drawn_into(ax, draw, legend=legend, caption=caption)


def passivity(source: Source, tolerance: float = 1e-3, **work: Unpack[WorkOptions]) -> DataFrame:
    """Wave channel and hand's port over the spec's [sweep], as `wavesweep passivity` has them.

    Parameters
    ----------
    source, **work
        As for `zwidth`.
    tolerance : float, default 0.001
        J per J sent that aliasing may add.

    Returns
    -------
    DataFrame
        The axes of [sweep] and the columns of `Loop.passivity`.
    """
    return framed(table.passivity(spec_of(source), tolerance, **work))
