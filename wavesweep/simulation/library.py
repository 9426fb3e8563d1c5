"""Simulations, as calls."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavesweep.program import api
from wavesweep.program.analyses.asked import Numbers
from wavesweep.program.api import Source, figure_of_table, spec_of
from wavesweep.program.plots.style import drawn_into
from wavesweep.program.spec import load
from wavesweep.program.tables.frame import framed
from wavesweep.simulation import table
from wavesweep.simulation.experiment import simulation_of
from wavesweep.simulation.from_spec import claim_of
from wavesweep.simulation.record import recorded

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame


class LoopSimulation(api.Loop):
    """Methods that `wavesweep.Loop` has in addition."""

    def simulate(self, force: Numbers | None = None, **options: float | str | None) -> DataFrame:
        """The loop run tick by tick.

        Parameters
        ----------
        force : array of shape (ticks,), optional
            The hand's force (N), or the signal of the input that [simulate] has `from`, per tick;
            by default the input of [simulate].
        **options : float, str or None
            Effects of the device in place of those of [simulate] (`wall=0.01, friction=0.2`).

        Returns
        -------
        DataFrame
            A row per fast tick, with the columns of `wavesweep simulate`: tick, frame, phase (ticks
            into the frame) and time_s (s); signals follow in their units.

        Raises
        ------
        UsageError, SpecError
            As for a spec.
        """
        rows = recorded(simulation_of(self.spec, force, None, **options))
        return self._frame("simulate", rows, {"spec": claim_of(self.spec)})

    def plot_simulate(
        self,
        force: Numbers | None = None,
        *,
        ax: Axes | None = None,
        legend: bool = True,
        caption: bool = True,
        **options: float | str | None,
    ) -> Figure:
        """The figure of a simulation, as `wavesweep simulate` draws it.

        Parameters
        ----------
        force, **options
            As for `simulate`.
        ax, legend, caption
            As for `plot_zwidth`.

        Returns
        -------
        matplotlib.figure.Figure
        """
        tables = self.spec.asking("simulate").tables()
        off = [name for name, value in options.items() if value is None]
        keys = {
            name: value for name, value in (tables["simulate"] | options).items() if name not in off
        }
        used = load(tables | {"simulate": keys}).asking("simulate")
        draw = figure_of_table("simulate", self.simulate(force, **options), used)
        return drawn_into(ax, draw, legend=legend, caption=caption)


def simulate(source: Source) -> list[DataFrame]:
    """The run that the [simulate] of a spec describes, tick by tick, as `wavesweep simulate` has it.

    Parameters
    ----------
    source : Spec, str, Path or dict
        A spec, its path, or its nested tables.

    Returns
    -------
    list of DataFrame
        The run, with the columns of `Loop.simulate`, and, for settled sines, its response.

    Examples
    --------
    >>> import wavesweep
    >>> spec = {"controller": {"kind": "pmw"}, "simulate": {"input": "pulse", "at_s": 0.1, "width_s": 0.05, "duration_s": 1}}
    >>> (run,) = wavesweep.simulate(spec)
    >>> run[["time_s", "f_h", "x"]].iloc[[0, 149, 150, 999]].round(4)
         time_s  f_h       x
    0     0.000  0.0  0.0000
    149   0.149  1.0  0.0021
    150   0.150  0.0  0.0022
    999   0.999  0.0  0.0001
    """
    return [framed(run) for run in table.simulate(spec_of(source).asking("simulate"))]
