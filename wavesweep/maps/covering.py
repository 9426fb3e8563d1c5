"""A plane of numbers in parts, in each of which a form proves how many eigenvalues are outside.

The largest part that is open is always tried next, with others of its size, and halved along the
number that moves its slack most if it is not proved.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import product
from typing import NamedTuple

import numpy as np

from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Polynomials, Sides
from wavesweep.engine.switched import FramesOver, constant_frames, inertia_of_cells

# of polynomials of two and three numbers: of more, parts take longer each, and of less there are more
ORDER = 6, 4
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
    that may stay open; most: parts that are tried. report: is called with thousandths proved.
    """
    sides = Sides.of(loop, paths, ends)
    plane = _Coordinates(sides, sides.places(ends), ends, logarithmic)
    frames = _frames_over(loop, plane)
    waiting = [_Part(-1.0, 0, plane.whole, None)]
    put = 1  # parts that were put into the queue
    done: list[tuple[_Part, int]] = []
    open_ = 1.0
    tried = 0
    while waiting and open_ > wanted and tried < most:
        batch = [heappop(waiting) for _ in range(min(AT_ONCE, len(waiting)))]
        tried += len(batch)
        verdicts = _judged(frames, batch, sides)
        for index in np.flatnonzero(verdicts.ended).tolist():
            done.append((batch[index], int(verdicts.outside[index])))
            if verdicts.outside[index] != OPEN:
                open_ += batch[index].order
        for box, matrices in _halves(batch, verdicts):
            heappush(waiting, _Part(-plane.share(box), put, box, matrices))
            put += 1
        if report:
            report(int(1000 * (1 - open_)), 1000, None)
    done += [(part, OPEN) for part in sorted(waiting)]
    boxes = np.array([part.box for part, _ in done])
    outside = np.array([number for _, number in done])
    return Plane(plane.numbers(boxes), outside, np.array([-part.order for part, _ in done]))


@dataclass(frozen=True, slots=True, eq=False)
class _Coordinates:
    """A plane of numbers, whose parts are boxes in places of sides, `(2, numbers)` each.

    whole, ends: the plane as a box, and as numbers. logarithmic: see `covered`.
    """

    sides: Sides
    whole: np.ndarray
    ends: np.ndarray
    logarithmic: np.ndarray

    def numbers(self, boxes: np.ndarray) -> np.ndarray:
        """The ends of parts as numbers, those of the plane without rounding."""
        numbers = np.where(boxes == self.whole[0], self.ends[0], self.sides.numbers(boxes))
        return np.where(boxes == self.whole[1], self.ends[1], numbers)

    def share(self, box: np.ndarray) -> float:
        """The share of a part in the plane."""
        size = np.diff(scaled(self.numbers(box), self.logarithmic), axis=0)
        return float((size / np.diff(scaled(self.ends, self.logarithmic), axis=0)).prod())


def _frames_over(loop: Loops, plane: _Coordinates) -> FramesOver:
    """The frames over the plane, in pieces if eigenvalues are large in it."""
    sides = plane.sides
    order = ORDER[len(sides) - 2]
    frames = constant_frames(loop, sides, plane.whole, order)
    largest = _largest_at_corners(frames, plane.whole)
    if largest <= FAR:
        return frames
    pieces = 1 + int(np.log(largest) / np.log(FAR))
    return constant_frames(loop, sides, plane.whole, order, pieces=pieces)


class _Verdicts(NamedTuple):
    """What is proved of parts.

    outside: how many eigenvalues, or OPEN. ended: whether a part is proved or too narrow. side: along
    which another one is halved. matrices: enclosed, None of a part in which they are not known well
    enough for its halves.
    """

    outside: np.ndarray
    ended: np.ndarray
    side: np.ndarray
    matrices: list[Polynomials | None]


def _judged(frames: FramesOver, batch: Sequence["_Part"], sides: Sides) -> _Verdicts:
    """What forms prove of some parts."""
    enclosed = _enclosed(frames, batch, sides)
    bounded = [index for index, found in enumerate(enclosed) if not isinstance(found, int)]
    side = np.array([found if isinstance(found, int) else 0 for found in enclosed])
    outside = np.full(len(batch), OPEN)
    matrices: list[Polynomials | None] = [None] * len(batch)
    if bounded:
        of_cells = _side_by_side([enclosed[index] for index in bounded])
        inertia = inertia_of_cells(of_cells, len(frames.symbols))
        outside[bounded] = inertia.outside
        side[bounded] = np.nan_to_num(inertia.moves, nan=np.inf).argmax(-1)
        for index, rest in zip(bounded, inertia.rest, strict=True):
            if rest < SHARED:
                matrices[index] = enclosed[index]
    boxes = np.array([part.box for part in batch])
    narrow = _width(boxes, side) < NARROWEST * _size(boxes, sides)[np.arange(len(side)), side]
    return _Verdicts(outside, (outside != OPEN) | narrow, side, matrices)


def _halves(
    batch: Sequence["_Part"], verdicts: _Verdicts
) -> Iterator[tuple[np.ndarray, Polynomials | None]]:
    """Yield the halves of open parts, the lower ones first, with their matrices if these are known: number
    by number, so that those along one are made together."""
    for number in np.unique(verdicts.side).tolist():
        halved = np.flatnonzero(~verdicts.ended & (verdicts.side == number)).tolist()
        known = [index for index in halved if verdicts.matrices[index] is not None]
        of_halves = [[], []]
        if known:
            of_halves = _halves_of_known([verdicts.matrices[index] for index in known], number)
        for upper in (0, 1):
            matrices = dict(zip(known, of_halves[upper], strict=True))
            for index in halved:
                box = batch[index].box.copy()
                box[1 - upper, number] = batch[index].box[:, number].mean()
                yield box, matrices.get(index)


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
    enclosed: list[Polynomials | int | None] = [part.known for part in batch]
    new = [index for index, part in enumerate(batch) if part.known is None]
    if new:
        boxes = np.array([batch[index].box for index in new])
        away = OUTWARD * _size(boxes, sides)
        wider = np.stack([boxes[:, 0] - away, boxes[:, 1] + away], 1)
        for index, found in zip(new, frames.over(wider), strict=True):
            enclosed[index] = found if isinstance(found, int) else found.matrices
    return enclosed


def _side_by_side(matrices):
    """Matrices of several parts, `(pieces, n, n)` each, in a row."""
    terms = np.concatenate([of_part.terms for of_part in matrices], 1)
    rest = np.concatenate([of_part.rest for of_part in matrices])
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
        halves.append([moved.of(of_part) for of_part in pieces])
    return halves
