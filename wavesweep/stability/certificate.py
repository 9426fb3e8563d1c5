"""Reasons of doubt about a row of a table: the words of the column `doubt`, and their meanings."""

DOUBTS = {
    "": "the row is certified",
    "rounding": "rounding of the loop's own entries could move a number beyond its tolerance, or change stable to unstable",
    "counts": "the counts of unstable eigenvalues do not fit the crossings that were found, or are not known everywhere",
    "crowded": "crossings or poles lie too close together to prove that none is missed",
    "search": "part of the range could not be searched with proof",
    "overflow": "the frame's matrix overflows or is lost in rounding, so part of the range, or the response, is not known",
    "unstable": "the loop is unstable and has no steady response: the numbers are those of its equations",
    "defective": "two eigenvalues meet where the interval ends, which has no derivative there that doubles can find",
    "fast": "the open loop's gain is not below 1 at half the rate of its frame, so that no delay follows from its phase",
}
"""Word -> meaning, the most severe last; tables show the most severe of a slice."""
OF_INTERVALS = ("rounding", "counts", "crowded", "search", "overflow")
OF_RESPONSES = ("rounding", "overflow", "unstable")
OF_DERIVATIVES = (*OF_INTERVALS, "defective")
OF_MARGINS = (*OF_INTERVALS, "fast")
INCOMPLETE = ("counts", "crowded", "search", "overflow")
"""If a row has one of these, part of its range may be neither known to be stable nor known to be unstable."""

FELT_ALIKE = 1e-9  # relative difference of stiffnesses felt, below which none of them is the larger one
SPARED = 1e-6  # relative error of a response up to which a row has no doubt

NONE, ROUNDING, COUNTS, CROWDED, SEARCH, OVERFLOW, UNSTABLE, DEFECTIVE, FAST = range(len(DOUBTS))


def words(codes):
    """Return the words of numeric `codes` as an array of objects."""
    import numpy as np

    return np.array(list(DOUBTS), dtype=object)[np.asarray(codes, int)]
