"""The table [measured]: files of points that were measured of the device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from wavesweep.engine.keys import Key
from wavesweep.program.reading.tables import SpecTable, TableValue

if TYPE_CHECKING:
    from wavesweep.program.spec.schema import Shapes
    from wavesweep.program.spec.studies import Request

KEYS = Key.by_path(
    [
        Key.word(
            "measured.z_width",
            None,
            "CSV file of limits that were measured: columns B_VE and K_VE; or of walls that were tried, with a column stable "
            "(1 or 0); path from the spec's folder",
        ),
        Key.word(
            "measured.response",
            None,
            "CSV file of a response that was measured at the hand: frequency_hz, admittance_abs (m/N) and admittance_deg, or "
            "admittance_re and admittance_im, and perhaps coherence; path from the spec's folder",
        ),
    ]
)


class Measured(dict, TableValue):
    """The files `z_width` and `response`, relative to the spec's folder; empty without the
    table."""

    @property
    def files(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(self.values())

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        return dict(self)


def build(request: Request) -> Measured:
    """Return the files and add the mistakes of the table."""
    leaves = {f"measured.{name}": leaf for name, leaf in request.belongs.below("measured").items()}
    files = request.mistakes.read(KEYS, leaves)
    for path, port, needed in (
        ("measured.z_width", "wall", "a wall"),
        ("measured.response", "hand", "a hand"),
    ):
        if request.drawing and getattr(request.drawing, port) is None and path in leaves:
            request.mistakes.refuse(
                leaves[path], path, f"{needed} in [ports], where it was measured", "none"
            )
    return Measured({path.removeprefix("measured."): name for path, name in files.items()})


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table."""
    return shapes.table({path.rpartition(".")[2]: shapes.value(key) for path, key in KEYS.items()})


TABLE = SpecTable(path="measured", build=build, keys=KEYS, always=True, schema=schema)
