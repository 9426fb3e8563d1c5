"""The bound on a gain as a value, and the words of requirements. Specs have it, so that it does not load numpy."""

from __future__ import annotations

from typing import NamedTuple

LIFTED, BASE_BAND = "lifted", "base-band"


class GainBound(NamedTuple):
    """What a gain has to be below: the names of an input and an output, the level, a band, and what the gain is."""

    source: str
    signal: str
    at_most: float
    band_hz: tuple[float, float] | None = None
    measure: str = LIFTED

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        table: dict[str, object] = {"from": self.source, "to": self.signal, "at_most": self.at_most}
        table |= {"band_hz": list(self.band_hz)} if self.band_hz else {}
        return table | ({"measure": self.measure} if self.measure != LIFTED else {})
