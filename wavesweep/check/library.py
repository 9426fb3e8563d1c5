"""The verdict as a call."""

from __future__ import annotations

from typing import Any

from wavesweep.check import verdict as of_check
from wavesweep.program.api import Source, spec_of


def verdict(source: Source) -> dict[str, Any]:
    """The verdict of `wavesweep check` on a spec's own design.

    Parameters
    ----------
    source : Spec, str, Path or dict
        A spec, its path, or its nested tables.

    Returns
    -------
    dict
        See `wavesweep.check.verdict`; a missing number is None.
    """
    return of_check.verdict(spec_of(source))
