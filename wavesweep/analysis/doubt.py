"""Why a row of a table cannot be vouched for: the few words that tables use, in one place."""

DOUBTS = {
    "": "the row is certified",
    "rounding": "rounding of the loop's own entries could move a number by more than is promised, or a label to the other side",
    "counts": "the counts of unstable eigenvalues do not fit the crossings that were found",
    "crowded": "crossings or poles lie too close together to prove that none is missed",
    "search": "part of the range could not be searched with proof",
    "overflow": "the frame's matrix overflows, so nothing can be said of part of the range, or of the response",
    "unstable": "the loop is unstable, so no steady response exists: the numbers are those of its equations",
}
"""Word -> meaning, the gravest last; tables show the gravest of a slice."""
OF_INTERVALS = ("rounding", "counts", "crowded", "search", "overflow")
OF_RESPONSES = ("rounding", "overflow", "unstable")
INCOMPLETE = ("counts", "crowded", "search", "overflow")
"""Those with which part of a range may be neither known to be stable nor known to be unstable."""

NONE, ROUNDING, COUNTS, CROWDED, SEARCH, OVERFLOW, UNSTABLE = range(len(DOUBTS))


def words(codes):
    """The words of numeric codes, an array of objects."""
    import numpy as np

    return np.array(list(DOUBTS), dtype=object)[np.asarray(codes, int)]
