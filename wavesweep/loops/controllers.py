"""The paper's controllers as loops: which page draws a spec's controller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from wavesweep.loops.direct import dc, dc_lm, dc_slow
from wavesweep.loops.page import drawing_of_page
from wavesweep.loops.pmw import pmw, pmw_lm
from wavesweep.spec.drawing import Drawing

PAGES = {"dc": dc, "dc-slow": dc_slow, "dc-lm": dc_lm, "pmw": pmw, "pmw-lm": pmw_lm}
_DECIDING = (
    *("rates.ratio", "environment.delay", "environment.integration", "device.velocity"),
    *("local_model.delay", "local_model.integration"),
)
_GAIN = "controller.Kp"  # without it, nothing holds the avatar's position


def loop_drawing(values: Mapping[str, Any], varied: Iterable[str] = ()) -> Drawing:
    """Return the loop that a spec's controller is, as a drawing whose numbers are the keys of a spec.

    values: flat keys; arrays over a batch may stand for floats. varied: paths of gains that count as other than 0.
    """
    gain = _GAIN in varied or bool(values[_GAIN] != 0 if isinstance(values[_GAIN], float) else values[_GAIN].any())
    return _drawing(values["controller.kind"], (*((path, values[path]) for path in _DECIDING), (_GAIN, gain)))


@lru_cache(maxsize=256)
def _drawing(kind, items):
    return drawing_of_page(PAGES[kind](dict(items)))
