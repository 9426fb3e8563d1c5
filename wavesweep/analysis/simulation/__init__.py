"""Both loops run tick by tick: the paper's experiment in simulation, and a witness against every other analysis.

It shares nothing with `lifted/`, and nothing with `diagram/` but the blocks of a drawn loop, which has no other description
(`drawn`). Filters, device, walls and control laws are written here a second time, as difference equations on plain numbers, so
that an error in a drawing or in lifting shows as a difference between two programs and not as the same mistake twice. A test
reads the imports and keeps it so. The price is that a new drawing has no law here; `simulate` refuses such a kind by name and
never takes another kind's law for it.

`both_loops` runs the ticks; `direct_coupling` and `wave_control` are the control laws, with `avatar` and `cascade` for
walls and filters behind waves; `body`, `hardware` and `inputs` are the rest of the experiment; `record` has the results.
"""

from wavesweep.analysis.simulation.both_loops import CONTROLLERS, compile_loop, simulate
from wavesweep.analysis.simulation.from_spec import hand_force, record_path, simulated
from wavesweep.analysis.simulation.hardware import Effects
from wavesweep.analysis.simulation.inputs import Tone
from wavesweep.analysis.simulation.record import Energy, Simulation, estimate, table

__all__ = [
    "CONTROLLERS",
    "Effects",
    "Energy",
    "Simulation",
    "Tone",
    "compile_loop",
    "estimate",
    "hand_force",
    "record_path",
    "simulate",
    "simulated",
    "table",
]
