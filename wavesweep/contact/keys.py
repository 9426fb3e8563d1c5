"""The key `contact` of [for_all]: whether answers have to hold through contact as well."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from wavesweep.engine.keys import Key
from wavesweep.program.reading.tables import SpecTable, TableValue

if TYPE_CHECKING:
    from wavesweep.program.spec.studies import Request

PATH = "for_all.contact"
LOSS = "for_all.loss"
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


def _beside(request: Request) -> Iterator[tuple[str, str]]:
    """Yield what contact cannot be proved beside, and what to write instead."""
    loss = request.belongs.keys.get(LOSS)
    if loss and loss.value:
        yield "for_all.loss", "lost = 1 for losses in any order"
    for_all = request.asked.get("for_all")
    if for_all:
        for axis in for_all.unknown:
            if not (axis.values or axis.structural):
                yield f"a range of {axis.name}", f"values = [...] of {axis.name}"
        if for_all.shares or for_all.delays:
            yield "shares or next", "the lengths without how often they occur"
    drawing = request.drawing
    if drawing and drawing.channels:
        names = ", ".join(block.name for block in drawing.channels)
        yield f"channel {names}", "delays that every message has"


def build(request: Request) -> Contact | None:
    """Return the value and add its mistakes; None if contact is not asked for."""
    leaf = request.belongs.keys.get(PATH)
    asked = request.mistakes.check(KEY, leaf) if leaf else False
    if not asked:
        return None
    beside = dict(_beside(request))
    if beside:
        instead = ", ".join(beside.values())
        expected = f"beside contact {instead}, or no contact"
        request.mistakes.refuse(leaf, PATH, expected, f"{', '.join(beside)} beside it")
    return Contact()


TABLE = SpecTable(
    path=PATH, build=build, keys={PATH: KEY}, always=True, schema=lambda shapes: shapes.value(KEY)
)
