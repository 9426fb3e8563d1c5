"""Blocks, who feeds whom at which rate, and the paper's controllers drawn with them."""

from wavesweep.diagram.direct import dc, dc_lm, dc_slow
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.pmw import pmw
from wavesweep.diagram.pmw_lm import pmw_lm

CONTROLLERS = {"dc": dc, "dc-slow": dc_slow, "dc-lm": dc_lm, "pmw": pmw, "pmw-lm": pmw_lm}


def draw(values) -> Diagram:
    """Draw the loop of `values` (flat keys -> numbers, arrays over a batch, or words).

    A number that decides the drawing (Kp, K_LM, the operator's stiffness: zero or not) must be zero everywhere in the
    batch or nowhere.
    """
    return CONTROLLERS[values["controller.kind"]](values)
