"""Cells along one number, each with a form, up to windows about the crossings between them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import copysign, sqrt
from typing import Any

import numpy as np

from wavesweep.checker import balls, file, form
from wavesweep.checker.balls import Refused
from wavesweep.proofs.forms import form_of

WINDOW = 1e-9  # half of a window about a crossing, of its value
NARROWEST = 1e-12  # relative: a cell below which nothing is proved
AROUND = 0.02  # of half of a cell: half of the next cell about a crossing within it
LOOKED_AT = np.linspace(-1, 1, 33)  # places of a cell at which eigenvalues are counted
MOST_CELLS = 1000  # that are tried along a stretch
WIDER = 20.0  # times as wide as the last cell with a form: beyond it one is divided without a trial
ON_CIRCLE = 1e-10  # from it: a mode that stays there
ORDER = 3  # of the matrices in doubles


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell from low to high. line: what the file says of it."""

    low: float
    high: float
    line: dict[str, Any]
    outside: int


# what gives a cell of a box, or the terms of its matrix
Find = Callable[[dict[str, tuple[float, float]]], Cell | list[np.ndarray]]


def exactly(value: float) -> Fraction:
    """Return the decimals by which a double is written."""
    return Fraction(repr(value))


def cell_of(family: file.Family, box: dict[str, tuple[float, float]]) -> Cell | list[np.ndarray]:
    """Return a cell of one side, or a point without sides, with a form that the checker accepts; or
    the terms of its matrix, none if it is not bounded there."""
    cell = balls.Cell({name: (exactly(low), exactly(high)) for name, (low, high) in box.items()})
    try:
        A = family.matrix("", cell)
    except Refused:
        return []
    keys = [(power,) for power in range(ORDER + 1)] if cell.width else [()]
    nothing = np.zeros((len(A.error),) * 2)
    terms = [
        np.array(A.parts[key], float) / balls.ONE if key in A.parts else nothing for key in keys
    ]
    low, high = next(iter(box.values()), (0.0, 0.0))
    if not len(nothing):
        return Cell(low, high, {"L": [], "signs": ""}, 0)
    found = form_of(terms)
    if found is None:
        return terms
    line: dict[str, Any] = {
        "L": written(found.L),
        "signs": "".join("+" if sign > 0 else "-" for sign in found.signs),
    }
    if found.slopes:
        line["Q"] = [[[at + 1], written(each)] for at, each in enumerate(found.slopes)]
    if found.turn:
        line["turn"] = found.turn
    signs = [int(sign) for sign in found.signs]
    P = file.form_from(line, cell, signs)
    if form.decreases(P, [(None, A, P)], found.turn):
        return Cell(low, high, line, signs.count(-1))
    return terms


def stays_on_circle(family: file.Family, point: dict[str, tuple[float, float]]) -> bool:
    """Return whether a mode is next to the unit circle at a point."""
    terms = cell_of(family, point)
    if isinstance(terms, Cell) or not terms:
        return False
    sizes = np.abs(np.linalg.eigvals(terms[0]))
    return bool(np.abs(sizes - 1).min() < ON_CIRCLE)


def written(matrix: np.ndarray, digits: int = 17) -> list[list[str]]:
    """Return the entries of a form in so many digits; 0 in place of those that the checker does not
    read for being too small, and of -0."""
    rows = np.where(np.abs(matrix) < 10.0**-balls.EXPONENT, 0.0, matrix).tolist()
    if digits == 17:
        return [[repr(x) for x in row] for row in rows]
    return [[f"{x:.{digits}g}" for x in row] for row in rows]


def cells_along(
    name: str, low: float, high: float, ends: Sequence[float], find: Find
) -> list[Cell]:
    """Return the cells of a range in order, with gaps where none are found. ends: crossings that
    are known. find: gives the cell of a box, or the terms of its matrix, as `cell_of`."""
    cells = []
    at = low
    for end in sorted(ends):
        before, after = (end + sign * WINDOW * abs(end) for sign in (-1, 1))
        if at < before:
            cells += cells_between(name, (at, before), (low, high), [*ends], find)
        at = after
    cells += cells_between(name, (at, high), (low, high), [*ends], find)
    return sorted(cells, key=lambda cell: cell.low)


def cells_between(name, stretch, rims, anchors, find):
    """The cells of a stretch without crossings that are known.

    rims: ends of the whole range, which may be next to the circle. anchors: the known crossings.
    """
    low, high = rims
    at_rim = WINDOW * (high - low)
    waiting = [stretch]
    done = []
    widest = np.inf
    for _ in range(MOST_CELLS):
        if not waiting:
            break
        start, stop = waiting.pop()
        middle = _middle(start, stop, anchors)
        if stop - start > widest and start not in rims and stop not in rims:
            waiting += [(middle, stop), (start, middle)]
            continue
        found = find({name: (start, stop)})
        if isinstance(found, Cell):
            done.append(found)
            widest = WIDER * (stop - start)
            continue
        if stop <= low + at_rim or start >= high - at_rim:
            continue
        crossing = _crossing(found, start, stop)
        if crossing is None:
            if start == low or stop == high:
                middle = low + at_rim if start == low else high - at_rim
                anchors.append(low if start == low else high)
            if stop - start > NARROWEST * max(abs(start), abs(stop)) and start < middle < stop:
                waiting += [(middle, stop), (start, middle)]
            continue
        least = WINDOW * abs(crossing)
        half = max(AROUND * (stop - start) / 2, least)
        before = max(start, crossing - half)
        after = min(stop, crossing + half)
        anchors.append(crossing)
        pieces = [(after, stop), (start, before)]
        if half > least:
            pieces.append((before, after))
        waiting += [piece for piece in pieces if piece[0] < piece[1]]
    return done


def _crossing(terms, start, stop):
    """Where the number of eigenvalues outside changes within a cell, by its matrix in doubles."""
    if len(terms) < 2 or not np.abs(terms[-1]).sum() < AROUND * np.abs(terms[0]).sum():
        return None

    def excess(places):
        powers = places[:, None, None, None] ** np.arange(len(terms))[:, None, None]
        return np.abs(np.linalg.eigvals((powers * np.array(terms)).sum(1))) - 1

    counts = (excess(LOOKED_AT) > 0).sum(-1)
    changes = np.flatnonzero(np.diff(counts))
    if not changes.size:
        return None
    low, high = LOOKED_AT[changes[0]], LOOKED_AT[changes[0] + 1]
    for _ in range(50):
        middle = (low + high) / 2
        if (excess(np.array([middle])) > 0).sum() == counts[changes[0]]:
            low = middle
        else:
            high = middle
    return float((start + stop) / 2 + (stop - start) / 2 * low)


def _middle(start, stop, anchors):
    """Where a cell is cut: by factors of the distance to a crossing that is near."""
    for anchor in sorted(anchors, key=lambda each: min(abs(start - each), abs(stop - each)))[:1]:
        near, far = sorted((start - anchor, stop - anchor), key=abs)
        if abs(far) > 4 * abs(near) > 0 and near * far > 0:
            return anchor + copysign(sqrt(near * far), far)
    return (start + stop) / 2


def stretches(cells: Sequence[Cell]) -> Iterator[list[Cell]]:
    """Yield the runs of cells without a gap and with the same number of eigenvalues outside."""
    run: list[Cell] = []
    for cell in cells:
        if run and (cell.low, cell.outside) != (run[-1].high, run[-1].outside):
            yield run
            run = []
        run.append(cell)
    if run:
        yield run


def tree(name: str, cells: Sequence[Cell]) -> Iterator[dict[str, Any]]:
    """Yield the lines of neighbouring cells in the order of the file."""
    if len(cells) == 1:
        yield cells[0].line
        return
    half = len(cells) // 2
    yield {"split": name, "at": repr(cells[half].low)}
    yield from tree(name, cells[:half])
    yield from tree(name, cells[half:])
