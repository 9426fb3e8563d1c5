"""Classes of blocks that a capability has: a spec may use them without drawing them."""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path as File

from wavesweep.capabilities import offered
from wavesweep.engine.drawing import TYPES
from wavesweep.engine.keys import Leaf, Path, Place, leaves_of


def with_classes(leaves: Mapping[Path, Leaf]) -> Mapping[Path, Leaf]:
    """Return the leaves with the classes that a capability has, of those that blocks name and
    the spec does not draw, in the order in which blocks name them."""
    kinds = {
        path: leaf for path, leaf in leaves.items() if path[0] == "block" and path[2:] == ("type",)
    }
    drawn_types = {*TYPES, *(path[1] for path in leaves if path[0] == "type" and len(path) > 1)}
    missing = {
        leaf.value: leaf
        for leaf in kinds.values()
        if isinstance(leaf.value, str) and leaf.value not in drawn_types
    }
    shipped = shipped_classes() if missing else {}
    completed = dict(leaves)
    for name, user in missing.items():
        if name not in shipped:
            continue
        tables = tomllib.loads(shipped[name].read_text(encoding="utf-8"))
        completed |= {
            path: replace(leaf, place=user.place)
            for path, leaf in leaves_of(tables, Place(), ("type", name))
        }
    return completed


def shipped_classes() -> dict[str, File]:
    """Return the files of the classes that a capability has, by their names."""
    module = offered("classes")
    return dict(module.CLASSES) if module else {}
