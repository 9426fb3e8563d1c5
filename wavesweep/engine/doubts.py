"""Reasons of doubt about a row of a table: the words of the column `doubt`, what each means, and what a user can do."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple


class Doubt(NamedTuple):
    """What a word of doubt means, and what helps."""

    meaning: str
    advice: str


DOUBTS: Mapping[str, Doubt] = MappingProxyType(
    {
        "": Doubt("the row is certified", ""),
        "rounding": Doubt(
            "rounding of the loop's own entries could move a number beyond its tolerance, or change stable to unstable",
            "Look for numbers of very different size (stiff springs on light masses, poles within 1e-3 of each other, frames "
            "of many ticks), and describe that part with fewer or slower states. The numbers of the row are good guesses.",
        ),
        "counts": Doubt(
            "the counts of unstable eigenvalues do not fit the crossings that were found, or are not known everywhere",
            "Search a shorter range of the axis, which leaves out where the loop is nearly singular.",
        ),
        "crowded": Doubt(
            "crossings or poles lie too close together to prove that none is missed",
            "Move a number a little (eigenvalues that meet or touch the circle rarely do so for two values), search a shorter "
            "range, or, if the loop conserves energy, require = { bounded = true } in [sweep].",
        ),
        "search": Doubt(
            "part of the range could not be searched with proof",
            "Search a shorter range; try another axis, since a number that acts at one place only is proved most easily. A "
            "damping ratio, long delays and dead times are the hardest.",
        ),
        "overflow": Doubt(
            "the frame's matrix overflows or is lost in rounding, so part of the range, or the response, is not known",
            "A frame of many ticks with a very unstable part grows beyond doubles: leave out the values that are far from "
            "stable, or take a shorter frame.",
        ),
        "unstable": Doubt(
            "the loop is unstable and has no steady response: the numbers are those of its equations",
            "wavesweep check says what would make it stable. The numbers are right, but no experiment shows them.",
        ),
        "defective": Doubt(
            "two eigenvalues meet where the interval ends, which has no derivative there that doubles can find",
            "Move another number a little, and ask again: the end of that interval has a derivative.",
        ),
        "fast": Doubt(
            "the open loop's gain is not below 1 at half the rate of its frame, so that no delay follows from its phase",
            "Judge the delay by a dead time: add a block of type delay with seconds, and sweep these with stability-region.",
        ),
        "contradiction": Doubt(
            "what is proved for a set contradicts the exact intervals of one of its members, so one of the two is wrong",
            "This is a fault of wavesweep: please report it, with the spec. Rely on neither row before it is mended.",
        ),
    }
)
"""The most severe last; tables show the most severe of a slice."""
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
INCOMPLETE = ("counts", "crowded", "search", "overflow", "contradiction")
"""If a row has one of these, part of its range may be neither known to be stable nor known to be unstable."""


def words(codes: Any) -> Any:
    """Return the words of numeric `codes` as an array of objects."""
    import numpy as np

    return np.array(list(DOUBTS), dtype=object)[np.asarray(codes, int)]
