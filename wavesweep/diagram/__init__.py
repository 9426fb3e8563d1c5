"""Blocks, their connections at two rates, and the paper's controllers drawn with them."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache, lru_cache

import numpy as np

from wavesweep.controllers import CONTROLLERS, drawing_of
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.drift import drift_of, latch
from wavesweep.diagram.tame import scattered
from wavesweep.loops.controllers import PAGES, keys_of_page

__all__ = ["CONTROLLERS", "WALL", "Diagram", "draw", "drift_of", "identity", "items_of", "keys_read", "state_labels"]

WALL = ("environment.K_VE", "environment.B_VE")


def draw(values) -> Diagram:
    """Return the drawing of the loop of `values`, without the wall's law.

    values: flat keys -> numbers, arrays over a batch, or words. If a number is exactly zero, it may take a branch or a
    state out of the loop, so in a batch it has to be zero in all loops or in none.
    """
    function = drawing_of(values["controller.kind"])
    return replace(function(values), structure=_structure(function, tuple(sorted(_tame(values)))))


def identity(values) -> tuple:
    """What a single loop of these values is remembered by: its drawing, and `items_of`."""
    return drawing_of(values["controller.kind"]), items_of(values)


def items_of(values) -> tuple:
    """The pairs of flat `values`; arrays of one as tuples."""
    return tuple((path, tuple(value.tolist()) if isinstance(value, np.ndarray) else value) for path, value in values.items())


@lru_cache(maxsize=1024)
def _structure(function, items) -> Diagram:
    """The drawing of the same structure with moderate numbers."""
    return function(dict(items))


def _tame(values):
    """Each key with a number of moderate size, the same for all loops of one structure; zero if the key is zero."""
    for path, value in values.items():
        if path in FEW_TICKS:
            yield path, min(value, FEW_TICKS[path])
        elif isinstance(value, (str, int, type(None))):
            yield path, value
        else:
            yield path, _moderate(path) * bool(value != 0 if isinstance(value, float) else np.any(value))


@cache
def _moderate(path):
    """A number for a key, other keys having others."""
    return TAME_RATE if path == "rates.fast_hz" else 7 + 4 * scattered(path)


FEW_TICKS = {"rates.ratio": 3, "environment.delay": 1}
TAME_RATE = 100.0  # Hz, far above twice any moderate cutoff


def keys_read(values) -> frozenset[str]:
    """The keys that the loop of `values` depends on, with those of the wall; without a page, recorded while it is drawn."""
    if values["controller.kind"] in PAGES:
        return keys_of_page(values)
    return _read(drawing_of(values["controller.kind"]), tuple(sorted(_tame(values))))


@lru_cache(maxsize=1024)
def _read(function, items) -> frozenset[str]:
    """The same; two loops of one structure read the same keys."""
    watched = _Watched(dict(items))
    function(watched)
    return frozenset({*watched.seen, "controller.kind", *WALL})


def state_labels(diagram: Diagram) -> dict[str, str]:
    """Readable name of each state of the lifted `diagram`: name as in `Cut.states` -> label of its block."""
    labels = {}
    for prefix, blocks in (("frame.", diagram.fast), ("", diagram.slow)):
        for block in blocks:
            readable = block.labels or [f"{block.name} {state}" for state in block.states]
            labels |= {f"{prefix}{block.name}.{state}": label for state, label in zip(block.states, readable, strict=True)}
    return labels | {latch(held): f"{held} of the last frame" for held in diagram.holds}


class _Watched(Mapping):
    """A mapping that records the keys that are read."""

    def __init__(self, values):
        self.values, self.seen = values, set()

    def __getitem__(self, key):
        self.seen.add(key)
        return self.values[key]

    def __iter__(self):
        return iter(self.values)

    def __len__(self):
        return len(self.values)
