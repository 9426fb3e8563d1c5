"""The columns of all tables: name, kind, unit and meaning of each, as columns.csv has them. It loads no numpy."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from wavesweep.core import doubts

if TYPE_CHECKING:
    import numpy as np

    from wavesweep.core.columns import Columns

FieldKind = Literal["number", "integer", "boolean", "string"]
OF_ALONG, OF_WALL = "that of along", "that of the wall"  # units that the run decides


@dataclass(frozen=True)
class Field:
    """One column.

    unit: "1" if dimensionless, "" if none applies, `OF_ALONG` or `OF_WALL`. optional: only some tables of the kind have it.
    derived: computes the column from the others, `(rows,)`, if it does not come with them. values: the meaning of each of its
    words, if it holds words of this program. advice: what a reader of the column can do, as a sentence or two.
    """

    name: str
    kind: FieldKind
    unit: str
    description: str
    optional: bool = False
    derived: Callable[[Columns], np.ndarray] | None = None
    values: Mapping[str, str] = field(default_factory=dict, hash=False)
    advice: str = ""


_VALUES = {
    "hand": {
        "free": "the device alone, without a hand",
        "operator": "the spec's own operator",
        "passive": "every passive hand, of any mass and stiffness, also if it moves within a tick",
        "box": "every hand between a fingertip and an arm, or in the ranges that --for-hands box:... gives",
        "port": "the hand's port is passive, if forces are held over a tick",
        "ports": "every pair of linear passive terminations at both ports, if forces are held over a tick",
        "channel": "the wave channel adds at most the tolerance of the run to its waves",
    },
    "guarantee": {
        "spec": "the spec's own numbers",
        "for_all": "all numbers of [for_all]",
        "mean_square": "messages lost at random",
    },
    "margin": {
        "gain_up": "the loop stays stable if the signal is multiplied by up to this factor; 1e6 means: by any",
        "gain_down": "the loop stays stable if the signal is multiplied by down to this factor; 0 means: by any",
        "phase": "phase (deg) that the signal may lose or gain; 180 means: any",
        "delay": "further delay (s) of the signal up to which the loop stays stable; 1e6 frames mean: any",
        "disk": "the largest a for which every factor (1 + a d/2)/(1 - a d/2), |d| < 1, leaves the loop stable",
        "disk_gain": "how far the gain alone may move within the disk, up or down by this factor; 1e6 means: by any",
        "disk_phase": "how far the phase (deg) alone may move within the disk",
        "sensitivity": "Ms, the largest factor by which a disturbance is amplified; usual designs have less than 2",
        "complementary": "Mt, the largest factor by which a command is amplified; usual designs have less than 1.5",
    },
}
_DERIVED: dict[str, Callable[[Columns], np.ndarray]] = {
    "excess": lambda columns: columns["channel_norm"] - 1,
    "energy_gain": lambda columns: columns["channel_norm"] ** 2 - 1,
}


def _read_groups() -> dict[str, tuple[Field, ...]]:
    """The columns by the groups of the file; a description may name the words of doubt that a column can have."""
    words = {name: ", ".join(each) for name, each in vars(doubts).items() if name.startswith("OF_")}
    groups: dict[str, tuple[Field, ...]] = {}
    with Path(__file__).with_name("columns.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            name, group = row["name"], row.pop("group")
            own: dict[str, Any] = {**row, "derived": _DERIVED.get(name), "values": _VALUES.get(name, {})}
            own |= {"description": row["description"].format(**words), "optional": bool(row["optional"])}
            groups[group] = (*groups.get(group, ()), Field(**own))
    return groups


_GROUPS = _read_groups()
ABOUT_ENDS, FOR_ALL, LEFT_OPEN, TICKS = (_GROUPS[name] for name in ("about-ends", "for-all", "left-open", "ticks"))
_ALONG, _FOUND, _FELT, _LINES, _BODE = (_GROUPS[name] for name in ("along", "found", "felt", "lines", "bode"))
_INTERVALS = (*_ALONG, *_FOUND, *_FELT, *FOR_ALL, *_LINES, *LEFT_OPEN, *_GROUPS["open"])
_FOR_HANDS = (*_ALONG, *_GROUPS["hand"], *_FOUND, *ABOUT_ENDS, *_FELT, *_LINES)
_FOR_HANDS = (*_FOR_HANDS, *(each for each in (*FOR_ALL, *LEFT_OPEN) if each.name not in ("guarantee", "settled")))
_FOR_HANDS = (*_FOR_HANDS, *_GROUPS["open"])
_LINEAR = [
    replace(each, name=f"linear_{each.name}", description=f"{each.description}, of the linear loop")
    for each in (*_BODE[4:12], *_BODE[14:16])
]
_ALONE = ("bode-ports", "passivity", "passivity-filters", "passivity-ports", "why", "margins", "identify", "identify-response")
COLUMNS: Mapping[str, tuple[Field, ...]] = MappingProxyType(
    {
        **dict.fromkeys(("zwidth", "stability-region"), _INTERVALS),
        "compare": (_BODE[0], *_INTERVALS),
        **dict.fromkeys(("zwidth-hands", "stability-region-hands", "passivity-along"), _FOR_HANDS),
        **dict.fromkeys(("bode", "compare-bode"), _BODE),
        # A drawn loop has those of its hand, if any, and its inputs, outputs and named signals behind the time.
        "simulate": (*TICKS, *_GROUPS["signals"]),
        # As seen in the simulation, beside what the linear analysis says of the same loop.
        "simulate-response": (*_BODE[:12], *_LINEAR, *_GROUPS["simulate-response"]),
        **{name: _GROUPS[name] for name in _ALONE},
    }
)
"""The columns of each table behind those of its axes; those of a design follow from its spec, its own are in `DESIGN`."""
DESIGN = _GROUPS["design"]
