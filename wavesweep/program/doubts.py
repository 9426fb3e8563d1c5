"""What a user can do about a doubt, and the words of doubt that columns of tables can have."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from wavesweep.engine.doubts import MEANINGS


class Doubt(NamedTuple):
    """What a word of doubt means, and what helps."""

    meaning: str
    advice: str


_ADVICE = MappingProxyType(
    {
        "": "",
        "rounding": (
            "Look for numbers of very different size (stiff springs on light masses, poles "
            "within 1e-3 of each other, frames of many ticks), and describe that part with fewer "
            "or slower states. The numbers of the row are good guesses."
        ),
        "counts": ("Search a shorter range of the axis, which leaves out where the loop is nearly singular."),
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
        "unstable": ("wavesweep check says what would make it stable. The numbers are right, but no experiment shows them."),
        "defective": ("Move another number a little, and ask again: the end of that interval has a derivative."),
        "fast": (
            "Judge the delay by a dead time: add a block of type delay with seconds, and sweep these with stability-region."
        ),
        "contradiction": (
            "This is a fault of wavesweep: please report it, with the spec. Rely on neither row before it is mended."
        ),
    }
)

DOUBTS: Mapping[str, Doubt] = MappingProxyType({word: Doubt(meaning, _ADVICE[word]) for word, meaning in MEANINGS.items()})
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
