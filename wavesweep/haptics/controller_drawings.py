"""The paper's controllers as loops: which page draws a spec's controller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine.drawing.drawing import Drawing
from wavesweep.engine.errors import UsageError
from wavesweep.haptics.controller_page import drawing_of_page
from wavesweep.haptics.controllers import CONTROLLERS, WALL

if TYPE_CHECKING:
    from wavesweep.engine.monodromy.cut import LinearFractional

_DECIDING = (
    *("rates.ratio", "environment.delay", "environment.integration", "device.velocity"),
    *("local_model.delay", "local_model.integration"),
)
_AMPLIFIER, _DEAD_TIME = "device.delay", "device.dead_time"
_GAIN = "controller.Kp"  # without it, nothing holds the avatar's position


def loop_drawing(values: Mapping[str, Any], varied: Iterable[str] = ()) -> Drawing:
    """Return the loop that a spec's controller is, as a drawing whose numbers are the keys of a spec.

    values: flat keys; arrays over a batch may stand for floats. varied: paths of gains that count as other than 0.
    Errors: UsageError for a kind that no page draws.
    """
    return _drawing(*_page_of(values, varied))


def keys_of_page(values: Mapping[str, Any]) -> frozenset[str]:
    """Return the keys that the loop of a spec's controller depends on, with those of the wall."""
    return _read(*_page_of(values))


def assumption_of_page(values: Mapping[str, Any]) -> str:
    """Return what the page of a spec's controller declares of its wall."""
    kind, items = _page_of(values)
    return CONTROLLERS[kind].page(dict(items)).assumes


def wall_cut(values: Mapping[str, object]) -> LinearFractional | None:
    """Return the loops of a controller cut at both numbers of its wall; None if its frame reads these more than once.

    values: flat keys, with numbers or arrays over the loops.
    """
    from wavesweep.engine.loop import Loops
    from wavesweep.engine.search.open_loops import open_loops

    loops = Loops(loop_drawing(values), values).read
    opened = open_loops(loops, *WALL, per_loop=True)
    return opened and opened.cut


def _page_of(values, varied=()):
    """The kind of a controller, and the values that decide how its page draws it."""
    kind = values["controller.kind"]
    if kind not in CONTROLLERS:
        raise UsageError(f"controller.kind: expected one of {', '.join(CONTROLLERS)}, found {kind}, which has no page")
    late = int(values.get(_AMPLIFIER, 0))
    nonzero = ((path, path in varied or bool(np.any(values.get(path, 0.0)))) for path in (_GAIN, _DEAD_TIME))
    return kind, (*((path, values[path]) for path in _DECIDING), (_AMPLIFIER, late), *nonzero)


@lru_cache(maxsize=256)
def _drawing(kind, items):
    return drawing_of_page(_late(kind, dict(items)))


@lru_cache(maxsize=256)
def _read(kind, items):
    watched = _Watched(items)
    page = _late(kind, watched)
    return frozenset({"controller.kind", *WALL}) | watched.seen | drawing_of_page(page).reads


def _late(kind, values):
    """The page of a controller, its force as late as the amplifier is."""
    return CONTROLLERS[kind].page(values).behind_amplifier(values[_AMPLIFIER], _DEAD_TIME if values[_DEAD_TIME] else "")


class _Watched(dict):
    """Values that remember which of them were asked for."""

    def __init__(self, items):
        super().__init__(items)
        self.seen = set()

    def __getitem__(self, path):
        self.seen.add(path)
        return super().__getitem__(path)
