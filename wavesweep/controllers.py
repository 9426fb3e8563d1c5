"""The controllers that a spec may name. The name selects a page of `wavesweep.loops`, from which all else follows."""

WALL = ("environment.K_VE", "environment.B_VE")
"""The keys of the wall's numbers."""

CONTROLLERS = {
    "dc": "direct coupling to a wall at the fast rate, the ideal",
    "dc-slow": "direct coupling to the slow wall, whose force is held over a frame",
    "dc-lm": "dc-slow with a local model of the wall at the fast rate, in the power domain",
    "pmw": "passive multirate wave control, wave variables with a low-pass before the downsampler (the paper's Figure 1)",
    "pmw-lm": "pmw with a filter bank, a local model of the wall and a position correction (the paper's Figure 3)",
}
"""Kind -> its description for a user."""


FILTERS_OF = {"dc": (), "dc-slow": (), "dc-lm": (), "pmw": ("lp1",)}
"""Kind -> the filters that it has, if it has not all of them: the rate sets no limit to the others."""
