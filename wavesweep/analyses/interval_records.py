"""Records of intervals, and what the hand feels at their ends."""

from collections.abc import Callable

import numpy as np

from wavesweep.stability import Intervals

FIELDS = (
    ("slice", "<i4"),
    ("intervals", "<i4"),
    ("interval", "<i4"),
    ("low", "<f8"),
    ("high", "<f8"),
    ("low_omega", "<f8"),
    ("high_omega", "<f8"),
    ("certified", "?"),
    ("residual", "<f8"),
    ("doubt", "i1"),
)
FELT = ("felt_low", "felt_high")
LINES = ("low_hz", "high_hz")
_LAST = tuple((name, "<f8") for name in (*FELT, *LINES))
RECORD = np.dtype([*FIELDS, *_LAST])
END_HANDS = {end: tuple(f"{end}_hand_{part}" for part in ("mass", "damping", "stiffness")) for end in ("low", "high")}
# Guarantees for hands have the hand that sets each end as well, and whether they are proved for every hand.
HAND_RECORD = np.dtype([*FIELDS, *((name, "<f8") for names in END_HANDS.values() for name in names), ("settled", "?"), *_LAST])


def records_of(found: Intervals) -> np.ndarray:
    """The intervals as records, sorted by slice (numbered from 0 in the chunk)."""
    records = np.zeros(found.column.size, RECORD)
    records["slice"] = found.column
    records["intervals"], records["interval"] = found.count, np.maximum(found.index, 0)
    for name in ("low", "high", "low_omega", "high_omega", "certified", "residual", "doubt"):
        records[name] = getattr(found, name)
    return records


BESIDE = 1e-4  # of an end, how far from it is looked where a mode has the frame's own period there
AGREED = 1e-3  # relative difference of two such looks, beyond which nothing is felt that is the same on both sides


def felt_at_ends(records: np.ndarray, rows: np.ndarray, stiffness: Callable) -> None:
    """Fill in the stiffness felt at both ends of these rows, along a number that is no wall.

    stiffness(some, p): that of the loops of the rows `some`, at these values of the number. A 0 takes a branch out of the loop,
    so ends at 0 are computed apart. At a crossing of z = 1 a frame does not determine the state at rest, since a mode that
    alternates from tick to tick repeats in it; the stiffness is smooth there, and follows from both sides.
    """
    p, omega = (
        np.concatenate([records[name][rows] for name in names]) for names in (("low", "high"), ("low_omega", "high_omega"))
    )
    own, found = np.tile(np.arange(rows.size), 2), np.empty(p.size)
    with np.errstate(all="ignore"):
        for some in (np.flatnonzero(p == 0), np.flatnonzero(p != 0)):
            if some.size:
                found[some] = stiffness(own[some], p[some])
        at = np.flatnonzero((omega == 0) & (p != 0))
        if at.size:
            sides = np.multiply.outer([1 - BESIDE, 1 + BESIDE, 1 - 2 * BESIDE, 1 + 2 * BESIDE], p[at])
            beside = stiffness(np.tile(own[at], 4), sides.ravel()).reshape(4, -1)
            near, far = beside[0] + beside[1], beside[2] + beside[3]
            found[at] = np.where(np.abs(near - far) <= AGREED * np.abs(near), (4 * near - far) / 6, np.nan)
    for name, part in zip(FELT, np.split(found, 2), strict=True):
        records[name][rows] = part
