"""The paper's controllers as loops: which page draws a spec's controller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from wavesweep.controllers import WALL
from wavesweep.errors import UsageError
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
    Errors: UsageError for a kind that no page draws.
    """
    return _drawing(*_page_of(values, varied))


def keys_of_page(values: Mapping[str, Any]) -> frozenset[str]:
    """Return the keys that the loop of a spec's controller depends on, with those of the wall."""
    return _read(*_page_of(values))


def assumption_of_page(values: Mapping[str, Any]) -> str:
    """Return what the page of a spec's controller declares of its wall."""
    kind, items = _page_of(values)
    return PAGES[kind](dict(items)).assumes


def _page_of(values, varied=()):
    """The kind of a controller, and the values that decide how its page draws it."""
    kind = values["controller.kind"]
    if kind not in PAGES:
        raise UsageError(f"controller.kind: expected one of {', '.join(PAGES)}, found {kind}, which has no page")
    gain = _GAIN in varied or bool(values[_GAIN] != 0 if isinstance(values[_GAIN], float) else values[_GAIN].any())
    return kind, (*((path, values[path]) for path in _DECIDING), (_GAIN, gain))


@lru_cache(maxsize=256)
def _drawing(kind, items):
    return drawing_of_page(PAGES[kind](dict(items)))


@lru_cache(maxsize=256)
def _read(kind, items):
    watched = _Watched(items)
    page = PAGES[kind](watched)
    return frozenset({"controller.kind", *WALL}) | watched.seen | drawing_of_page(page).reads


class _Watched(dict):
    """Values that remember which of them were asked for."""

    def __init__(self, items):
        super().__init__(items)
        self.seen = set()

    def __getitem__(self, path):
        self.seen.add(path)
        return super().__getitem__(path)
