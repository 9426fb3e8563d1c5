"""The controllers that a spec may name. Each is declared here once, with the page of `haptics`
that draws its loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

WALL = ("environment.K_VE", "environment.B_VE")
"""The keys of the wall's numbers."""
HAND = ("operator.mass", "operator.damping", "operator.stiffness")
"""The keys of the hand's numbers."""

# slow steps in a frame: doubles distinguish fractions with denominators up to this
MOST_SLOW_STEPS = 10_000


@dataclass(frozen=True, slots=True)
class Controller:
    """A controller.

    description: for a user. page: function from flat values to a `BlockDiagram`. filters: those of
    [filters] that the loop has; the rate sets no limit to the others.
    """

    description: str
    page: Callable[[Mapping[str, Any]], Any]
    filters: tuple[str, ...] = ("lp1", "hp", "lp2")


def _page(module: str, name: str) -> Callable[[Mapping[str, Any]], Any]:
    """Return a page of `wavesweep.haptics`, which is imported only when a loop is drawn."""

    def page(values: Mapping[str, Any]) -> Any:
        return getattr(import_module(f"wavesweep.haptics.{module}"), name)(values)

    return page


CONTROLLERS = {
    "dc": Controller(
        "direct coupling to a wall at the fast rate, the ideal", _page("direct", "dc"), filters=()
    ),
    "dc-slow": Controller(
        "direct coupling to the slow wall, whose force is held over a frame",
        _page("direct", "dc_slow"),
        filters=(),
    ),
    "dc-lm": Controller(
        "dc-slow with a local model of the wall at the fast rate, in the power domain",
        _page("direct", "dc_lm"),
        filters=(),
    ),
    "dc-vc": Controller(
        "a spring and a damper at the fast rate, a virtual coupling, to an avatar at the slow wall",
        _page("virtual_coupling", "dc_vc"),
        filters=(),
    ),
    "dc-vc-lm": Controller(
        "dc-vc with a local model of the wall at the fast rate, about the slow avatar's pose and force",
        _page("virtual_coupling", "dc_vc_lm"),
        filters=(),
    ),
    "pmw": Controller(
        "passive multirate wave control, wave variables with a low-pass before the downsampler (the paper's Figure 1)",
        _page("pmw", "pmw"),
        filters=("lp1",),
    ),
    "pmw-mean": Controller(
        "pmw with the mean of a frame for a low-pass: passive where rates divide, and none that is feels stiffer at rest",
        _page("pmw", "pmw_mean"),
        filters=(),
    ),
    "pmw-lm": Controller(
        "pmw with a filter bank, a local model of the wall and a position correction (the paper's Figure 3)",
        _page("pmw", "pmw_lm"),
    ),
}
"""Controllers by the name that `controller.kind` takes."""
