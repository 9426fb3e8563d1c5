"""The columns of tables: name, kind, unit and meaning of each, as files columns.csv have them; what helps with a doubt.

It loads no numpy.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

from wavesweep.capabilities import CAPABILITIES
from wavesweep.engine.doubts import MEANINGS
from wavesweep.program.row_kinds import ARGUMENTS, words_of


class Doubt(NamedTuple):
    """What a word of doubt means, and what helps."""

    meaning: str
    advice: str


_ADVICE = MappingProxyType(
    {
        "": "",
        "rounding": (
            "Look for rates that do not divide (their frames are of many ticks) and for numbers of "
            "very different size (stiff springs on light masses, poles that nearly coincide), and describe that part with fewer "
            "or slower states. The numbers of the row are good guesses."
        ),
        "counts": (
            "Search a shorter range of the axis, which leaves out where the loop is nearly singular."
        ),
        "crowded": (
            "Move a number a little (eigenvalues that meet or touch the circle rarely do so for "
            "two values), search a shorter range, or, if the loop conserves energy, require = { "
            "bounded = true } in [sweep]."
        ),
        "search": (
            "Search a shorter range; try another axis, since a number that acts at one place "
            "only is proved most easily. A damping ratio, long delays and dead times are the "
            "hardest."
        ),
        "overflow": (
            "A frame of many ticks with a very unstable part grows beyond doubles: leave out the "
            "values that are far from stable, or take a shorter frame."
        ),
        "unstable": (
            "wavesweep check says what would make it stable. The numbers are right, but no experiment shows them."
        ),
        "defective": (
            "Move another number a little, and ask again: the end of that interval has a derivative."
        ),
        "fast": (
            "Judge the delay by a dead time: add a block of type delay with seconds, and sweep these with stability-region."
        ),
        "contradiction": (
            "This is a fault of wavesweep: please report it, with the spec. Rely on neither row before it is mended."
        ),
    }
)

DOUBTS: Mapping[str, Doubt] = MappingProxyType(
    {word: Doubt(meaning, _ADVICE[word]) for word, meaning in MEANINGS.items()}
)
"""The words of the column `doubt`, the most severe last; tables show the most severe of a slice."""

_OF_INTERVALS = ("rounding", "counts", "crowded", "search", "overflow", "contradiction")
DOUBTS_OF: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "OF_INTERVALS": _OF_INTERVALS,
        "OF_RESPONSES": ("rounding", "overflow", "unstable"),
        "OF_DERIVATIVES": (*_OF_INTERVALS, "defective"),
        "OF_MARGINS": (*_OF_INTERVALS, "fast"),
    }
)
"""The words that columns can have, by the name that a columns.csv has for them."""


FieldKind = Literal["number", "integer", "boolean", "string"]
# The unit that the run decides.
OF_ALONG = "that of along"


@dataclass(frozen=True)
class Field:
    """One column.

    unit: "1" if dimensionless, "" if none applies, or `OF_ALONG`. optional: only some
    tables of the kind have it. values: the meaning of each of its words, if it holds words of this program.
    advice: what a reader of the column can do, as a sentence or two.
    """

    name: str
    kind: FieldKind
    unit: str
    description: str
    optional: bool = False
    values: Mapping[str, str] = field(default_factory=dict, hash=False)
    advice: str = ""


_VALUES = {column: words_of(column) for column in ("hand", "guarantee")} | {"argument": ARGUMENTS}


def columns_beside(
    module: str,
    values: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> dict[str, tuple[Field, ...]]:
    """The columns that stand in columns.csv beside a module, by their groups.

    values: of columns by name, see `Field`. A description may name the words of doubt that
    a column can have.
    """
    words = {name: ", ".join(doubts) for name, doubts in DOUBTS_OF.items()}
    groups: dict[str, tuple[Field, ...]] = {}
    with Path(module).with_name("columns.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            name = row["name"]
            group = row.pop("group")
            arguments: dict[str, Any] = dict(row)
            arguments["description"] = row["description"].format(**words)
            arguments["optional"] = bool(row["optional"])
            arguments["values"] = values.get(name, {})
            groups[group] = (*groups.get(group, ()), Field(**arguments))
    return groups


_GROUPS = columns_beside(__file__, _VALUES)
ABOUT_ENDS = _GROUPS["about-ends"]
FOR_ALL = _GROUPS["for-all"]
LEFT_OPEN = _GROUPS["left-open"]
_ALONG = _GROUPS["along"]
_FOUND = _GROUPS["found"]
_FELT = _GROUPS["felt"]
_LINES = _GROUPS["lines"]
_OPEN = _GROUPS["open"]
_BODE = _GROUPS["bode"]
_INTERVALS = (
    *_ALONG,
    *_FOUND,
    *_FELT,
    *FOR_ALL,
    *_LINES,
    *LEFT_OPEN,
    *_OPEN,
    *_GROUPS["set-by"],
    *_GROUPS["argument"],
)
_REFUTED = tuple(
    field for field in (*FOR_ALL, *LEFT_OPEN) if field.name not in ("guarantee", "settled")
)
_FOR_HANDS = (
    *_ALONG,
    *_GROUPS["hand"],
    *_FOUND,
    *ABOUT_ENDS,
    *_FELT,
    *_LINES,
    *_REFUTED,
    *_OPEN,
    *_GROUPS["argument"],
)
COLUMNS: Mapping[str, tuple[Field, ...]] = MappingProxyType(
    {
        **dict.fromkeys(("zwidth", "stability-region"), _INTERVALS),
        **dict.fromkeys(("zwidth-hands", "stability-region-hands"), _FOR_HANDS),
        "zwidth-specs": (_BODE[0], *_INTERVALS),
        "bode": _BODE,
        "bode-ports": _GROUPS["bode-ports"],
    }
)
"""The columns of the core's tables behind those of their axes."""


def columns_of(kind: str) -> tuple[Field, ...]:
    """The columns of a kind of table behind those of its axes; those of a capability stand in its `columns.py`."""
    home = next((capability for capability in CAPABILITIES if kind in capability.kinds), None)
    return (home.module("columns").COLUMNS if home else COLUMNS).get(kind, ())
