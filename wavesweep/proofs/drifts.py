"""What drifts in a loop, as the checker counts it: directions of its memory that every equation keeps."""

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from wavesweep.checker import balls, contact, drifts, file, frame
from wavesweep.checker.balls import Refused
from wavesweep.checker.reader import wall_of

PLACES = [
    Fraction(place, 1000) for place in (480, 1, 310, 770, 999)
]  # of the sides, that are looked at
SAME = 1e-11  # singular values up to which a direction is kept
LEAST = 1e-12  # share of a direction
LEAST_OWN = 1e-7  # share of a memory that may stand for a direction: others may be rounding


def drifts_of(
    tables: dict, claim: file.Claim, member: Mapping[str, Any] | None = None
) -> list[list[str]]:
    """Return what takes part in each drift of the loops of a claim, first a memory of its own. member:
    values of listed numbers."""
    kinds = file.schedules_of(tables, claim, member or {})[0]
    return _directions(kinds, claim.sides)


def drifts_and_rest(
    tables: dict, claim: file.Claim, member: Mapping[str, Any]
) -> tuple[list[list[str]], list[str]]:
    """Return the drifts of a loop cut at its wall, and what drifts besides while the wall is not
    touched. Errors: Refused if that is more than one position."""
    schedules = file.schedules_of(tables, claim, member)[0]
    cut, free = contact.opened(schedules[""], wall_of(tables)[0])
    every = _directions({"": cut}, claim.sides)
    own = [names for names in every if contact.FORCE not in names]
    held = [
        sorted(names, key=lambda name: name != contact.FORCE)
        for names in every
        if contact.FORCE in names
    ]
    fixed = {names[0] for names in own}
    live = frame.Frames(frame.steps_of({"": cut})).live
    silent = {name for names in own if drifts.is_unread([free], names, live) for name in names}
    rows = []
    for row in drifts.at_rest([free], live - silent):
        rows.append({name: share for name, share in row.items() if name not in fixed})
    rests = [*_next(list(filter(None, rows)), live - silent - fixed, _cells(claim.sides))]
    if len(rests) > 1:
        raise Refused("more than one position drifts while the wall is not touched")
    return own + held, rests[0] if rests else []


def _cells(sides):
    cells = []
    for place in PLACES:
        point = {}
        for name, (low, high) in sides.items():
            point[name] = (low + (high - low) * place,) * 2
        cells.append(balls.Cell(point))
    return cells


def _directions(kinds, sides):
    """The drifts of schedules of all kinds of frames."""
    schedules = [*kinds.values()]
    live = frame.Frames(frame.steps_of(kinds)).live
    cells = _cells(sides)
    unread: list[list[str]] = []
    while True:
        silent = {name for drift in unread for name in drift}
        found = [*_next(drifts.at_rest(schedules, live - silent), live - silent, cells)]
        new = [drift for drift in found if drifts.is_unread(schedules, drift, live)]
        if not new:
            return unread + found
        unread += new


def _next(rows, live, cells):
    """Yield drifts of equations at rest, as the checker solves them."""
    others = {name for row in rows for name in row} - live
    names = [*sorted(live), *sorted(others)]
    kept = [_kept(rows, names, cell) for cell in cells]
    for pivot, shares in _echelon(kept, len(live)):
        taking_part = [
            names[at].partition(drifts.APART)[0] for at in np.flatnonzero(shares > LEAST)
        ]
        drift = [names[pivot], *dict.fromkeys(taking_part)]
        try:
            v = drifts.drift_of(rows, drift, cells[0])
        except Refused:
            continue
        taking_part = [
            name.partition(drifts.APART)[0]
            for name, share in v.items()
            if any(_is_share(share, cell) for cell in cells)
        ]
        yield [*dict.fromkeys(taking_part)]


def _is_share(number, cell):
    """Whether it is not 0, as that of a name which the directions have by rounding alone."""
    radius, middle = number.value(cell)
    return abs(middle) > radius


def _kept(rows, names, cell):
    """Orthogonal directions of memory and variables that the equations at rest keep at a point."""
    column = {name: at for at, name in enumerate(names)}
    matrix = np.zeros((len(rows), len(names)))
    for at, row in enumerate(rows):
        for name, share in row.items():
            matrix[at, column[name]] = share.value(cell)[1] / balls.ONE
    matrix /= np.abs(matrix).max(axis=1, keepdims=True, initial=1e-300)
    _, sizes, directions = np.linalg.svd(matrix)
    return directions[np.append(sizes, np.zeros(len(names) - len(sizes))) < SAME]


def _echelon(kept: Sequence[np.ndarray], live: int) -> Iterator[tuple[int, np.ndarray]]:
    """Yield a memory of each drift, of the first columns, that no other has, and its largest shares."""
    count = len(kept[0])
    if any(len(each) != count for each in kept):
        return
    # Memory against which no other share grows much, as against the middle.
    sizes = np.array([np.linalg.norm(each[:, :live], axis=0) for each in kept])
    ratios = np.where(
        sizes[0] > LEAST_OWN * sizes[0].max(initial=0), sizes / np.maximum(sizes[0], LEAST), 0.0
    )
    away = (ratios / np.maximum(ratios.max(axis=1, keepdims=True), LEAST)).min(axis=0)
    pivots: list[int] = []
    for at in np.argsort(-away, kind="stable").tolist():
        if np.linalg.matrix_rank(kept[0][:, [*pivots, at]], tol=LEAST) > len(pivots):
            pivots.append(at)
    if len(pivots) == count:
        shares = [np.abs(np.linalg.solve(each[:, pivots], each)) for each in kept]
        largest = np.max(shares, axis=0)
        largest[:, pivots] = 0
        yield from zip(pivots, largest, strict=True)
