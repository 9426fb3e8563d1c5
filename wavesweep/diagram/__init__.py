"""Blocks, who feeds whom at which rate, and the paper's controllers drawn with them."""

from collections.abc import Mapping

from wavesweep.diagram.direct import dc, dc_lm, dc_slow
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.pmw import pmw
from wavesweep.diagram.pmw_lm import pmw_lm

CONTROLLERS = {"dc": dc, "dc-slow": dc_slow, "dc-lm": dc_lm, "pmw": pmw, "pmw-lm": pmw_lm}
WALL = ("environment.K_VE", "environment.B_VE")


def draw(values) -> Diagram:
    """Draw the loop of `values` (flat keys -> numbers, arrays over a batch, or words), its wall left open.

    A number that decides the drawing (see ZERO_MATTERS) must be zero everywhere in the batch or nowhere.
    """
    return CONTROLLERS[values["controller.kind"]](values)


ZERO_MATTERS = ("controller.Kp", "local_model.K_LM", "operator.stiffness")
"""Keys whose being exactly zero takes a branch or a state out of the loop."""


def keys_read(values) -> frozenset[str]:
    """The keys that the loop of `values` depends on, the wall's included; found by drawing it and watching."""
    watched = _Watched(values)
    draw(watched)
    return frozenset(watched.seen) | frozenset(WALL)


class _Watched(Mapping):
    """Remembers which keys were asked for."""

    def __init__(self, values):
        self.values, self.seen = values, set()

    def __getitem__(self, key):
        self.seen.add(key)
        return self.values[key]

    def __iter__(self):
        return iter(self.values)

    def __len__(self):
        return len(self.values)
