"""A table becomes a figure; nothing is computed here. Each kind of figure is `draw(columns, facts, path)`."""

from wavesweep.plots.intervals import zwidth
from wavesweep.plots.responses import bode

__all__ = ["bode", "zwidth"]
