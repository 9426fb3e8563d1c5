"""Reasons of doubt: a word and a number for each, and what it means."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

MEANINGS: Mapping[str, str] = MappingProxyType(
    {
        "": "the row is certified",
        "rounding": (
            "rounding of the loop's own entries could move a number beyond its tolerance, or change stable to unstable"
        ),
        "counts": (
            "the counts of unstable eigenvalues do not fit the crossings that were found, or are not known everywhere"
        ),
        "crowded": "crossings or poles lie too close together to prove that none is missed",
        "search": "of part of the range nothing could be proved",
        "overflow": (
            "the frame's matrix overflows or is lost in rounding, so part of the range, or the response, is not known"
        ),
        "unstable": (
            "the loop is unstable and has no steady response: the numbers are those of its equations"
        ),
        "defective": (
            "two eigenvalues meet where the interval ends, which has no derivative there that doubles can find"
        ),
        "fast": (
            "the open loop's gain is not below 1 at half the rate of its frame, so that no delay follows from its phase"
        ),
        "contradiction": (
            "what is proved for a set contradicts the exact intervals of one of its members, so one of the two is wrong"
        ),
    }
)
"""The most severe last."""


class Doubt:
    """The numbers of the reasons in MEANINGS, which records hold in place of their words; NONE: certified."""

    NONE, ROUNDING, COUNTS, CROWDED, SEARCH, OVERFLOW, UNSTABLE, DEFECTIVE, FAST, CONTRADICTION = (
        range(len(MEANINGS))
    )


def words(codes: Any) -> Any:
    """Return the words of numeric `codes` as an array of objects."""
    import numpy as np

    return np.array(list(MEANINGS), dtype=object)[np.asarray(codes, int)]
