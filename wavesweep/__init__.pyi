from wavesweep import results as results
from wavesweep.check.library import verdict as verdict
from wavesweep.designs.library import design as design
from wavesweep.engine.errors import IllPosedLoopError as IllPosedLoopError
from wavesweep.engine.errors import SpecError as SpecError
from wavesweep.engine.errors import UsageError as UsageError
from wavesweep.engine.errors import WavesweepError as WavesweepError
from wavesweep.identification.library import identify as identify
from wavesweep.margins.library import LoopMargins
from wavesweep.passive.library import LoopPassive
from wavesweep.passive.library import passivity as passivity
from wavesweep.picture.library import LoopPicture
from wavesweep.poles.library import LoopPoles
from wavesweep.program import api
from wavesweep.program.api import bode as bode
from wavesweep.program.api import stability_region as stability_region
from wavesweep.program.api import zwidth as zwidth
from wavesweep.program.spec import Spec as Spec
from wavesweep.program.spec import load as load
from wavesweep.program.store.checkpoint import CheckpointError as CheckpointError
from wavesweep.reports.library import report as report
from wavesweep.sensitivity.library import LoopSensitivity
from wavesweep.sensitivity.library import why as why
from wavesweep.simulation.library import LoopSimulation
from wavesweep.simulation.library import simulate as simulate

__version__: str

class Loop(LoopMargins, LoopPassive, LoopPicture, LoopPoles, LoopSensitivity, LoopSimulation): ...

def compile(source: api.Source) -> Loop: ...
