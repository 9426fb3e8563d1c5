"""The table [measured]: files of points that were measured of the device."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavesweep.engine.keys import Key
from wavesweep.program.reading.tables import KeyValues, SpecTable

if TYPE_CHECKING:
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


PORTS = {"measured.z_width": "wall", "measured.response": "hand"}  # where each was measured


class Measured(KeyValues):
    """The files `z_width` and `response`, relative to the spec's folder."""

    @property
    def files(self) -> tuple[str, ...]:
        """All of them."""
        return tuple(self.values())


def build(request: Request) -> Measured:
    """Return the files and add the mistakes of the table."""
    drawing = request.drawing
    for path, port in PORTS.items():
        leaf = request.belongs.keys.get(path)
        if leaf and drawing and getattr(drawing, port) is None:
            expected = f"a {port} in [ports], where it was measured"
            request.mistakes.refuse(leaf, path, expected, "none")
    return Measured(TABLE.read(request.belongs.below("measured"), request.mistakes))


TABLE = SpecTable(path="measured", build=build, keys=KEYS, always=True)
