"""Simulations, as calls."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.arguments import real_numbers
from wavesweep.engine.errors import UsageError
from wavesweep.program import api, drawn_loop
from wavesweep.program.analyses.asked import Numbers
from wavesweep.program.api import Source, figure_of_table, spec_of
from wavesweep.program.plots.style import drawn_into
from wavesweep.program.spec import load
from wavesweep.program.tables.frame import framed
from wavesweep.simulation import table
from wavesweep.simulation.experiment import simulation_of
from wavesweep.simulation.from_spec import claim_of
from wavesweep.simulation.march import run_drawn
from wavesweep.simulation.record import recorded

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike
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


class DrawnLoopSimulation(drawn_loop.DrawnLoop):
    """Methods that a loop drawn in Python has in addition."""

    def simulate(self, inputs: Mapping[str, ArrayLike], signals: Iterable[str]) -> DataFrame:
        """The blocks run tick by tick from rest.

        Parameters
        ----------
        inputs : dict of str to array of shape (ticks,)
            For each input of the drawing its value in every tick.
        signals : iterable of str
            Names of ports or junctions.

        Returns
        -------
        DataFrame
            A row per tick with `time_s` (s) and the signals. The rows end before a signal that is
            not finite.

        Raises
        ------
        UsageError
            For a batch of loops, or for other inputs or signals.
        """
        from pandas import DataFrame

        drawn, arrays = self.drawn, {name: real_numbers(values) for name, values in inputs.items()}
        rows = {
            name: row.astype(float)
            for name, row in arrays.items()
            if row is not None and row.ndim == 1
        }
        # the names of the ports, junctions and inputs of a drawn loop
        names = {*drawn.sums, *drawn.inputs}
        for placed_block in drawn.placed:
            block = placed_block.block
            names |= {f"{block.name}.{port}" for port in (*block.inputs, *block.outputs)}
        unknown = [name for name in signals if name not in names]
        if drawn_loop.is_batch(drawn):
            raise UsageError("simulate: expected a single loop, found a batch")
        if unknown or sorted(arrays) != sorted(drawn.inputs):
            problem = ", ".join(unknown or arrays) or "none"
            raise UsageError(
                f"simulate: expected the inputs {', '.join(drawn.inputs)}, and ports or junctions, found {problem}"
            )
        if len(rows) < len(arrays) or len(set(map(len, rows.values()))) > 1:
            raise UsageError(
                "simulate: expected as many numbers for each input, one per tick, found others"
            )
        with drawn.naming_blocks():
            self.drift.closed_frame(drawn)
        marched = run_drawn(drawn, rows, tuple(signals))
        count = len(next(iter(marched.values()), ()))
        return DataFrame({"time_s": np.arange(count) * float(np.asarray(drawn.period))} | marched)


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
