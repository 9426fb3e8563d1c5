"""Loops of flat values as their hand feels them, over a frame."""

import numpy as np

from wavesweep.engine._response.at_hand import ports_of_batch
from wavesweep.engine._response.lifted import Lifted
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import loop_drawing


def loop_of(values) -> Lifted:
    """The loop of a controller, or a batch of them if numbers are arrays."""
    drawing = loop_drawing(values)
    size = max((np.size(value) for value in values.values() if isinstance(value, np.ndarray)), default=1)
    read = {path: value for path, value in values.items() if path in drawing.reads}
    ((_, port),) = ports_of_batch(Loops(drawing, read), size)
    return Lifted.of(port)
