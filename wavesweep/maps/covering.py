"""A plane of numbers in parts, in each of which a form proves how many eigenvalues are outside.

The largest part that is open is always tried next, with others of its size, and halved along the
number that moves its slack most if it is not proved.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count, product
from typing import NamedTuple

import numpy as np

from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Polynomials, Sides
from wavesweep.engine.switched import constant_frames, inertia_of_cells

ORDER = (
    6,
    4,
)  # of polynomials of two and three numbers: of more, parts take longer each, and of less there are more
AT_ONCE = 128  # parts
# of the slack: what the rest of a part's polynomials may cost for its halves to go on with them
SHARED = 0.003
# of a place, or of 1 for a logarithm: parts are proved wider by this, so that the rounding of their
# ends is within
OUTWARD = 1e-12
NARROWEST = 1e-5  # of a place, or of 1 for a logarithm: parts that are narrower stay open
# of half of a part: by which its halves are taken wider, as OUTWARD is below it from NARROWEST on
WIDER = 1e-6
FAR = 2e3  # an eigenvalue of a frame, from which on it is taken in pieces that are no larger
CORNER = 1e-6  # of the plane, at its corners
OPEN = -1


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """Parts of a plane.

    ends: of each, as numbers, `(parts, 2, numbers)`. outside: how many eigenvalues are outside the
    unit circle in all of it, OPEN where it is not known. share: of the plane, which adds up to 1.
    """

    ends: np.ndarray
    outside: np.ndarray
    share: np.ndarray


def covered(
    loop: Loops,
    paths: Sequence[str],
    ends: np.ndarray,
    logarithmic: np.ndarray,
    wanted: float,
    most: int,
    report: Callable[[int, int, None], None] | None = None,
) -> Plane:
    """Return the parts of the plane of some numbers from `ends[0]` to `ends[1]`.

    logarithmic: of which numbers shares of the plane are those of the logarithm. wanted: the share
    that may stay open; most: parts that are tried. report: is called with what is
    proved, in thousandths.
    """
    sides = Sides.of(loop, paths, ends)
    whole = sides.places(ends)
    order = ORDER[len(sides) - 2]
    frames = constant_frames(loop, sides, whole, order)
    largest = _largest_at_corners(frames, whole)
    if largest > FAR:
        pieces = 1 + int(np.log(largest) / np.log(FAR))
        frames = constant_frames(loop, sides, whole, order, pieces=pieces)
    pieces = len(frames.symbols)
    span = scaled(ends, logarithmic)

    def numbers_of(boxes):
        """The ends of parts as numbers, those of the plane without rounding."""
        numbers = np.where(boxes == whole[0], ends[0], sides.numbers(boxes))
        return np.where(boxes == whole[1], ends[1], numbers)

    def queued(boxes, known):
        """Put parts into the queue, and add up their shares."""
        places = scaled(numbers_of(boxes), logarithmic)
        shares = (np.diff(places, axis=1)[:, 0] / np.diff(span, axis=0)).prod(-1)
        for box, share, of_box in zip(boxes, shares.tolist(), known, strict=True):
            heappush(waiting, _Part(-share, next(numbers), box, of_box))

    numbers = count()
    waiting: list[_Part] = []
    done: list[tuple[_Part, int]] = []
    queued(whole[None], [None])
    open_ = 1.0
    tried = 0
    while waiting and open_ > wanted and tried < most:
        batch = [heappop(waiting) for _ in range(min(AT_ONCE, len(waiting)))]
        tried += len(batch)
        known = _enclosed(frames, batch, sides)
        with_bound = [at for at, each in enumerate(known) if not isinstance(each, int)]
        side = np.array([0 if at in with_bound else each for at, each in enumerate(known)])
        outside = np.full(len(batch), OPEN)
        keep = np.zeros(len(batch), bool)
        if with_bound:
            found = inertia_of_cells(_side_by_side([known[at] for at in with_bound]), pieces)
            outside[with_bound] = found.outside
            keep[with_bound] = found.rest < SHARED
            side[with_bound] = np.nan_to_num(found.moves, nan=np.inf).argmax(-1)
        boxes = np.array([part.box for part in batch])
        narrow = _width(boxes, side) < NARROWEST * _size(boxes, sides)[np.arange(len(side)), side]
        for at in np.flatnonzero((outside != OPEN) | narrow).tolist():
            done.append((batch[at], int(outside[at])))
            if outside[at] != OPEN:
                open_ += batch[at].order
        for number in range(len(paths)):
            chosen = np.flatnonzero((outside == OPEN) & ~narrow & (side == number))
            kept = [at for at in chosen.tolist() if keep[at]]
            halves = _halves_of_known([known[at] for at in kept], number) if kept else ([], [])
            for upper in (False, True):
                half = boxes[chosen].copy()
                half[:, 1 - upper, number] = boxes[chosen, :, number].mean(1)
                of_kept = dict(zip(kept, halves[upper], strict=True))
                queued(half, [of_kept.get(at) for at in chosen.tolist()])
        if report:
            report(int(1000 * (1 - open_)), 1000, None)
    done += [(part, OPEN) for part in sorted(waiting)]
    boxes = np.array([part.box for part, _ in done])
    outside = np.array([each for _, each in done])
    return Plane(
        numbers_of(boxes),
        outside,
        np.array([-part.order for part, _ in done]),
    )


def _largest_at_corners(frames, whole):
    """The size of the largest eigenvalue at the corners of the plane, 1 where they have no bound."""
    inward = CORNER * (whole[1] - whole[0])
    boxes = []
    for corner in product((0, 1), repeat=len(inward)):
        low = np.where(corner, whole[1] - inward, whole[0])
        boxes.append([low, low + inward])
    largest = 1.0
    for found in frames.over(np.array(boxes)):
        if not isinstance(found, int):
            largest = max(largest, np.abs(np.linalg.eigvals(found.matrices.terms[0])).max())
    return largest


class _Part(NamedTuple):
    """A part that is open: minus its share of the plane, a number of its own, its box as places of
    sides, and its matrices if those of a part around it are known well enough."""

    order: float
    number: int
    box: np.ndarray
    known: Polynomials | None


def scaled(numbers: np.ndarray, logarithmic: np.ndarray) -> np.ndarray:
    """Return the coordinates in which shares are counted: logarithms of some numbers."""
    return np.where(logarithmic, np.log(np.where(logarithmic, numbers, 1.0)), numbers)


def _size(boxes, sides):
    """The sizes of places by which their rounding counts, `(parts, sides)`."""
    plain = np.array([np.isnan(side.zero) for side in sides])
    return np.where(plain, 0.0, 1.0) + np.abs(boxes).max(1)


def _width(boxes, side):
    return np.diff(boxes, axis=1)[np.arange(len(boxes)), 0, side]


def _enclosed(frames, batch, sides):
    """The matrices of parts, or of those without a bound the side along which they have to be
    halved."""
    known: list[Polynomials | int | None] = [part.known for part in batch]
    new = [at for at, each in enumerate(known) if each is None]
    if new:
        boxes = np.array([batch[at].box for at in new])
        away = OUTWARD * _size(boxes, sides)
        wider = np.stack([boxes[:, 0] - away, boxes[:, 1] + away], 1)
        for at, found in zip(new, frames.over(wider), strict=True):
            known[at] = found if isinstance(found, int) else found.matrices
    return known


def _side_by_side(matrices):
    """Matrices of several parts, `(pieces, n, n)` each, in a row."""
    terms = np.concatenate([each.terms for each in matrices], 1)
    rest = np.concatenate([each.rest for each in matrices])
    return Polynomials(terms, rest, matrices[0].numbers, matrices[0].order)


def _halves_of_known(matrices, number):
    """The matrices of the lower and of the upper halves of parts."""
    whole = _side_by_side(matrices)
    half = np.ones(whole.numbers)
    half[number] = 0.5 + WIDER
    pieces = np.arange(len(whole.rest)).reshape(len(matrices), -1)
    halves = []
    for sign in (-1, 1):
        middle = np.zeros(whole.numbers)
        middle[number] = 0.5 * sign
        moved = whole.within(middle, half)
        halves.append([moved.of(own) for own in pieces])
    return halves
