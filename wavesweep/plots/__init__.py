"""A table becomes a figure; nothing is computed here. Each kind of figure is `draw(columns, facts, path)`."""

from wavesweep.plots.filter_choices import filter_choices
from wavesweep.plots.intervals import zwidth
from wavesweep.plots.passivity import passivity
from wavesweep.plots.picture import Picture
from wavesweep.plots.responses import bode
from wavesweep.plots.simulated_response import simulate_response
from wavesweep.plots.simulation import simulate

__all__ = ["Picture", "bode", "filter_choices", "passivity", "simulate", "simulate_response", "zwidth"]
