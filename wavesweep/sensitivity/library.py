"""Elasticities of limits, as calls."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavesweep.program import api
from wavesweep.program.analyses.asked import Numbers
from wavesweep.program.analyses.claims import own_figures
from wavesweep.program.api import Source, Span, spec_of
from wavesweep.program.tables.frame import framed
from wavesweep.sensitivity import table

if TYPE_CHECKING:
    from pandas import DataFrame


class LoopSensitivity(api.Loop):
    """Methods that `wavesweep.Loop` has in addition."""

    def sensitivity(
        self, along: str | None = None, span: Span | None = None, **axes: Numbers
    ) -> DataFrame:
        """How each end of the stable intervals, and the stiffness felt there, moves with each number.

        Parameters
        ----------
        along, span, **axes
            As for `stable_intervals`.

        Returns
        -------
        DataFrame
            A row per end that stability sets, crossing, quantity ("end" or "felt") and number, with
            the columns of `wavesweep why`: each axis given, along, interval, side, crossing,
            corner, quantity, limit_value in unit, omega (rad/s), hz and second_hz (Hz) and
            damping_ratio of the mode, states, number and its value in number_unit, elasticity,
            slope, certified, doubt, elasticity_down, slope_down. elasticity is d ln limit/d ln
            number, slope d limit/d number, as the number grows; those for one that falls differ
            where a dead time is a whole number of ticks.

        Raises
        ------
        UsageError
            If a spec would not accept a name or a value.

        Notes
        -----
        By the implicit function theorem. Accuracy: elasticities to 1e-8 of themselves or of 1; if
        rounding could exceed that, a reason of doubt and no number.
        """
        grid, axis = self._asked(along, span, axes)
        rows = table.sensitivities(grid, axis)
        return self._frame("why", rows, own_figures([grid.spec], "limits"))


def why(source: Source, along: str | None = None) -> DataFrame:
    """Elasticities and slopes of each limit of a spec's own design, as `wavesweep why` computes them.

    Parameters
    ----------
    source : Spec, str, Path or dict
        A spec, its path, or its nested tables.
    along : str, optional
        The axis of the intervals, the spec's own by default.

    Returns
    -------
    DataFrame
        As of `Loop.sensitivity`.
    """
    return framed(table.why(spec_of(source), along))
