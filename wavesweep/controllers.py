"""The controllers that a spec may name. The name selects a drawing; everything else follows from the drawing."""

from importlib import import_module

CONTROLLERS = {
    "dc": "wavesweep.diagram.direct:dc",
    "dc-slow": "wavesweep.diagram.direct:dc_slow",
    "dc-lm": "wavesweep.diagram.direct:dc_lm",
    "pmw": "wavesweep.diagram.pmw:pmw",
    "pmw-lm": "wavesweep.diagram.pmw_lm:pmw_lm",
}
"""Kind -> the function that draws it, or "module:function"; text, so that a spec is checked without loading numpy."""

MEANINGS = {
    "dc": "direct coupling to a wall at the fast rate, the ideal",
    "dc-slow": "direct coupling to the slow wall, whose force is held over a frame",
    "dc-lm": "dc-slow with a local model of the wall at the fast rate, in the power domain",
    "pmw": "passive multirate wave control, wave variables with a low-pass before the downsampler (the paper's Figure 1)",
    "pmw-lm": "pmw with a filter bank, a local model of the wall and a position correction (the paper's Figure 3)",
}
"""Kind -> its description for a user. A kind that is not listed has none."""


FILTERS_OF = {"dc": (), "dc-slow": (), "dc-lm": (), "pmw": ("lp1",)}
"""Kind -> the filters that it has, if it has not all of them: the rate sets no limit to the others."""


def drawing_of(kind: str):
    """Return the function from flat values to the `Diagram` of that kind; KeyError if there is none."""
    drawn = CONTROLLERS[kind]
    if callable(drawn):
        return drawn
    module, name = drawn.split(":")
    return getattr(import_module(module), name)
