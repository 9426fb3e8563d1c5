"""The key `contact` of [for_all]: whether answers have to hold through contact as well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from wavesweep.engine.keys import Key
from wavesweep.program.reading.tables import SpecTable, TableValue

if TYPE_CHECKING:
    from wavesweep.program.spec.studies import Request

PATH = "for_all.contact"
LOSSES = "for_all.lost", "for_all.loss"
KEY = Key(
    PATH,
    "boolean",
    False,
    "",
    "intervals for every wall that pushes and never pulls as well: rows with guarantee = contact",
)


@dataclass(frozen=True, slots=True)
class Contact(TableValue):
    """That intervals are asked for through contact too."""

    def written(self) -> bool:
        """Return the key as a spec could give it."""
        return True


def build(request: Request) -> Contact | None:
    """Return the value and add its mistakes; None if contact is not asked for."""
    leaf = request.belongs.keys.get(PATH)
    asked = request.mistakes.check(KEY, leaf) if leaf else False
    if not asked:
        return None
    beside = [*request.belongs.axes.get("for_all", {})]
    given = request.belongs.keys
    beside += [name for name in LOSSES if name in given and given[name].value]
    if request.drawing:
        beside += [f"channel {block.name}" for block in request.drawing.channels]
    if beside:
        expected = "contact alone in [for_all]: its proof is of the spec's own numbers and frames"
        request.mistakes.refuse(leaf, PATH, expected, f"{', '.join(beside)} beside it")
    return Contact()


TABLE = SpecTable(
    path=PATH, build=build, keys={PATH: KEY}, always=True, schema=lambda shapes: shapes.value(KEY)
)
