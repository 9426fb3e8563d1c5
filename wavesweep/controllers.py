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


def drawing_of(kind: str):
    """Return the function from flat values to the `Diagram` of that kind; KeyError if there is none."""
    drawn = CONTROLLERS[kind]
    if callable(drawn):
        return drawn
    module, name = drawn.split(":")
    return getattr(import_module(module), name)
