"""What drifts in a loop, as the checker counts it: directions of its memory that every equation keeps."""

from collections import defaultdict
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from wavesweep.checker import balls, contact, drifts, file, frame, port
from wavesweep.checker.balls import Refused
from wavesweep.checker.reader.loops import INPUT

PLACES = [
    Fraction(place, 1000) for place in (480, 1, 310, 770, 999)
]  # of the sides, that are looked at
NOTHING = (0, 0)  # the enclosure of 0
ABSENT = 1e-12  # of a direction: a share that is 0 but for rounding
# of a power of two, so that ratios such as 1 and the root of 2 are not told apart by rounding
BESIDE_HALVES = 0.2


def drifts_of(
    tables: dict, claim: file.Claim, member: Mapping[str, Any] | None = None
) -> list[list[str]]:
    """Return what takes part in each drift of the loops of a claim, first a memory of its own. member:
    values of listed numbers."""
    kinds = file.schedules_of(tables, claim, member or {})[0]
    found = []
    for names in _directions(kinds, claim.sides):
        if port.PUSH not in names:
            found.append(names)
        elif port.PLACE in names:
            found.append(sorted(names, key=lambda name: name != port.PLACE))
    return found


def drifts_and_rest(
    tables: dict, claim: file.Claim, member: Mapping[str, Any]
) -> tuple[list[list[str]], list[str]]:
    """Return the drifts of a loop cut at its wall, and what drifts besides while the wall is not
    touched. Errors: Refused if that is more than one position."""
    schedules = file.schedules_of(tables, claim, member)[0]
    cuts, free = file.cut_at_wall(tables, schedules)
    untouched = [*free.values()]
    every = _directions(cuts, claim.sides)
    own = [names for names in every if contact.FORCE not in names]
    held = [
        sorted(names, key=lambda name: name != contact.FORCE)
        for names in every
        if contact.FORCE in names
    ]
    fixed = {names[0] for names in own}
    live = frame.Frames(frame.steps_of(cuts)).live
    silent = {name for names in own if drifts.is_unread(untouched, names, live) for name in names}
    rows = []
    for row in drifts.at_rest(untouched, live - silent):
        rows.append({name: share for name, share in row.items() if name not in fixed})
    rests = [*_next(list(filter(None, rows)), live - silent - fixed, _cells(claim.sides))]
    if len(rests) > 1:
        raise Refused("more than one position drifts while the wall is not touched")
    rest = sorted(*rests, key=lambda name: name.startswith(contact.LAST)) if rests else []
    return own + held, rest


def _cells(sides):
    cells = []
    for place in PLACES if sides else PLACES[:1]:
        point = {}
        for name, (low, high) in sides.items():
            point[name] = (low + (high - low) * place,) * 2
        cells.append(balls.Cell(point))
    return cells


def _directions(kinds, sides):
    """The drifts of schedules of all kinds of frames."""
    schedules = [*kinds.values()]
    live = frame.Frames(frame.steps_of(kinds)).live
    live = {name for name in live if not name.startswith(INPUT)}
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
    """Yield drifts of equations at rest, as the checker solves them, each with a lead of its own.

    Leads are memories against which no other share grows much over the places; of those that are
    alike in this up to a power of two, the first by name.
    """
    variables = sorted({name for row in rows for name in row} - live)
    memory = sorted(live)
    names = variables + memory
    first = _kept(rows, names, cells[0])
    if not first:
        return
    kept = [first, *(_kept(rows, names, cell) for cell in cells[1:])]
    powers = _steadiness(kept, memory[::-1])
    eliminated = [memory[::-1][at] for at in np.argsort(powers, kind="stable")]
    kept = [_kept(rows, variables + eliminated, cell) for cell in cells]
    leads = [*kept[0]]
    if any([*directions] != leads for directions in kept) or not live.issuperset(leads):
        return
    for lead in reversed(leads):
        moved = {name for directions in kept for name in directions[lead]}
        ordered = [name for name in memory + variables if name in moved]
        drift = [*dict.fromkeys([lead, *(name.partition(drifts.APART)[0] for name in ordered)])]
        try:
            drifts.drift_of(rows, drift, cells[0])
        except Refused:
            continue
        yield drift


def _kept(rows, names, cell):
    """Return the directions that the equations at rest keep at a point, `{lead: {name: share}}`.

    Each lead is 1 in its own direction and 0 in the others. By Gauss and Jordan in enclosures, in
    whole numbers: a share is 0 by algebra, not by rounding. names: in the order of elimination;
    leads are those that no equation is left for.
    """
    ring = cell.ring
    rows = [{name: share.value(cell) for name, share in row.items()} for row in rows]
    holders = defaultdict(set)  # of each name, the places of rows that have it
    for place, row in enumerate(rows):
        for name in row:
            holders[name].add(place)
    waiting = {*range(len(rows))}
    solved = {}
    for name in names:
        size, place = max(
            ((_size(rows[place][name]), -place) for place in holders[name] & waiting),
            default=(0, 0),
        )
        if not size:
            continue
        pivot = rows[-place]
        waiting.remove(-place)
        inverse = ring.reciprocal(pivot.pop(name))
        for column in pivot:
            pivot[column] = ring.multiply(inverse, pivot[column])
        for other in holders[name] - {-place}:
            _eliminate(ring, rows[other], name, pivot)
            for column in pivot:
                holders[column].add(other)
        solved[name] = pivot
    directions = {name: {name: balls.UNIT} for name in names if name not in solved}
    for name, shares in solved.items():
        for lead, share in shares.items():
            if lead in directions and _size(share):
                directions[lead][name] = balls.negative(share)
    return directions


def _size(ball):
    """The least size of what is enclosed, at a point; 0 if that may be 0."""
    radius, middle = ball
    return max(abs(middle) - radius, 0)


def _eliminate(ring, row, name, shares):
    """Take from a row the multiple of an equation, `name + shares = 0`, that leaves it without the name."""
    factor = balls.negative(row.pop(name))
    for column, share in shares.items():
        term = ring.multiply(factor, share)
        row[column] = balls.add(row[column], term) if column in row else term


def _steadiness(kept, memory):
    """Return the least share of each memory over the places, as against the middle and against the
    memory that grows most there, in powers of two."""
    sizes = []
    for directions in kept:
        shares = [
            [own.get(name, NOTHING)[1] / balls.ONE for name in memory]
            for own in directions.values()
        ]
        basis, _ = np.linalg.qr(np.transpose(shares))
        sizes.append(np.linalg.norm(basis, axis=1).clip(ABSENT))
    ratios = np.array(sizes) / sizes[0]
    least = (ratios / ratios.max(axis=1, keepdims=True)).min(axis=0)
    return np.where(sizes[0] > ABSENT, np.round(np.log2(least) + BESIDE_HALVES), -np.inf)
