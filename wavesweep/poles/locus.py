"""What `check --root-locus` asks of this capability: the values of a root locus over a number,
and its figure."""

from typing import Any

from wavesweep.poles import figure
from wavesweep.poles.table import axis_over, over
from wavesweep.program.spec import Axis, Spec

__all__ = ["axis_over", "root_locus"]


def root_locus(spec: Spec, axis: Axis) -> Any:
    """The figure of the poles over the values of an axis."""
    table = over(spec, axis)
    return figure.poles(table.columns, table.facts)
