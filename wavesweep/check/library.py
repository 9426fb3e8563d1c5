"""The verdict as a call."""

from __future__ import annotations

from typing import Any

from wavesweep.check import verdict as of_check
from wavesweep.core.api import Source, spec_of


def verdict(source: Source) -> dict[str, Any]:
    """The verdict of `wavesweep check` on the own design of `source`, as a dict; see `wavesweep.check.verdict`."""
    return of_check.verdict(spec_of(source))
