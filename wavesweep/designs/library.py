"""The search for designs, as a call."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

from wavesweep.designs import study
from wavesweep.program.api import Source, spec_of
from wavesweep.program.sweep.running import WorkOptions
from wavesweep.program.tables.frame import framed

if TYPE_CHECKING:
    from pandas import DataFrame


def design(source: Source, **work: Unpack[WorkOptions]) -> DataFrame:
    """Designs that meet the wishes of the spec's [design], the best first, as `wavesweep design` has them.

    Parameters
    ----------
    source, **work
        As for `zwidth`.

    Returns
    -------
    DataFrame
        A row per design, with the columns of `wavesweep design`.

    Raises
    ------
    UsageError, SpecError
        For arguments and for the spec.
    WavesweepError
        If no design meets all bounds.
    """
    return framed(study.design(spec_of(source).asking("design"), **work))
