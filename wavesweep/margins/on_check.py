"""The step that `check` names beside others: `margins`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def is_next(spec: Spec, facts: Mapping[str, Any]) -> bool:
    """Whether `margins` goes on from a verdict: for a stable drawn loop without a hand that can
    be broken."""
    if not (facts["stable"] and spec.drawing) or spec.drawing.hand:
        return False
    from wavesweep.margins.broken_loops import default_cut, returns

    return returns(spec, default_cut(spec))
