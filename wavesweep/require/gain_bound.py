"""The bounds on gains as values, and the words of requirements. Specs have it, so that it does
not load numpy."""

from __future__ import annotations

from typing import NamedTuple

LIFTED, BASE_BAND = "lifted", "base-band"


class GainBound(NamedTuple):
    """What a gain has to be below: the names of an input and an output, the level, a band, and
    what the gain is."""

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


class CutBound(NamedTuple):
    """What the distance of 1/(1 + L) to a number has to be below, of the loop L that is cut at a
    signal.

    centre: 0 for the peak sensitivity Ms; 1/2 for the disk margin, which is 1 over the largest
    distance.
    """

    cut: str
    at_most: float
    centre: float

    band_hz = None  # it is of all frequencies


class Margins(NamedTuple):
    """The margins of a loop that is cut at a signal: the largest Ms, and the least disk margin;
    None if it may be any."""

    cut: str
    Ms: float | None = None
    disk: float | None = None

    def bounds(self) -> tuple[CutBound, ...]:
        """The same as bounds on the sensitivity."""
        bounds = []
        if self.Ms:
            bounds.append(CutBound(self.cut, self.Ms, 0.0))
        if self.disk:
            bounds.append(CutBound(self.cut, 1 / self.disk, 0.5))
        return tuple(bounds)

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        return {name: value for name, value in self._asdict().items() if value is not None}
