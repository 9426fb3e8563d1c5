"""Both loops run tick by tick: the witness of every other analysis, and the paper's experiment in simulation."""

from wavesweep.analysis.march.coordinates import random_state
from wavesweep.analysis.march.energy import Energy
from wavesweep.analysis.march.experiment import Simulation, simulate
from wavesweep.analysis.march.from_spec import hand_force, simulated, simulated_columns
from wavesweep.analysis.march.growth import Growth, growth, growth_rate
from wavesweep.analysis.march.linear import March, State, at_rest, compile_loop, march
from wavesweep.analysis.march.options import Options
from wavesweep.analysis.march.table import table

__all__ = [
    "Energy",
    "Growth",
    "March",
    "Options",
    "Simulation",
    "State",
    "at_rest",
    "compile_loop",
    "growth",
    "growth_rate",
    "hand_force",
    "march",
    "random_state",
    "simulate",
    "simulated",
    "simulated_columns",
    "table",
]
