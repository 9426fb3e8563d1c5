"""What drifts in a loop, as the checker counts it: directions of its memory that every equation keeps."""

from fractions import Fraction

import numpy as np

from wavesweep.checker import balls, file, frame
from wavesweep.checker.reader import loop_of, with_numbers

PLACES = Fraction(31, 100), Fraction(77, 100)  # of the sides, at which equations are looked at
SAME = 1e-11  # singular values up to which a direction is kept
LEAST = 1e-9  # share of a direction
LARGEST_DENOMINATOR = 10**6


def drifts_of(tables: dict, claim: file.Claim) -> list[dict[str, Fraction]]:
    """Return the drifts of the own loop with the numbers and over the sides of a claim."""
    values = {**claim.numbers, **{name: balls.side(name) for name in claim.sides}}
    schedule = loop_of(with_numbers(tables, values), balls).schedule()
    live = sorted(frame.Frames(frame.steps_of({"": schedule})).live)
    rows = []
    for place in PLACES:
        point = {}
        for name, (low, high) in claim.sides.items():
            point[name] = (low + (high - low) * place,) * 2
        rows += _equations(schedule, balls.Cell(point))
    names = list(dict.fromkeys([*live, *(name for row in rows for name in row)]))
    column = {name: at for at, name in enumerate(names)}
    matrix = np.zeros((len(rows), len(names)))
    for at, row in enumerate(rows):
        size = max(map(abs, row.values()), default=1.0) or 1.0
        for name, share in row.items():
            matrix[at, column[name]] = share / size
    _, values_of, directions = np.linalg.svd(matrix)
    kept = directions[np.append(values_of, np.zeros(len(names) - len(values_of))) < SAME]
    found = []
    for direction in _echelon(kept, len(live)):
        exact = {}
        for name, share in zip(names, direction, strict=True):
            if abs(share) > LEAST:
                exact[name] = Fraction(float(share)).limit_denominator(LARGEST_DENOMINATOR)
        if frame.is_drift(schedule, exact):
            found.append(exact)
    return found


def _equations(schedule, cell):
    """Yield what every equation of the instants and of the motion leaves of memory and variables."""
    for instant, moves in (
        *((each, False) for each in schedule.kinds.values()),
        (schedule.motion, True),
    ):
        for kind in (instant.equations, instant.writes):
            for name, terms in kind.items():
                derivative = moves and kind is instant.writes
                row = {} if derivative else {name: -1.0}
                for other, share in terms.items():
                    if not other.startswith("!"):
                        value = balls.number(share).value(cell)[1] / balls.ONE
                        row[other] = row.get(other, 0.0) + value
                yield row


def _echelon(kept, live):
    """Directions of the memory, the first columns, in a row echelon form."""
    kept = kept.copy()
    found: list[np.ndarray] = []
    for at in range(live):
        if not len(kept):
            break
        pivot = int(np.argmax(np.abs(kept[:, at])))
        if abs(kept[pivot, at]) < LEAST:
            continue
        direction = kept[pivot] / kept[pivot, at]
        kept = np.delete(kept, pivot, 0)
        kept = kept - kept[:, [at]] * direction
        found = [each - each[at] * direction for each in found]
        found.append(direction)
    return found
