"""A layered layout of boxes and the nets between them: columns from the inputs on, in as many rows of columns as fit.

The method is that of K. Sugiyama, S. Tagawa, M. Toda, IEEE Trans. SMC 11 (1981): wires that close a loop are set aside, each
box is one column behind the last box that it reads, a net that passes a column has a place of its own there, boxes are put in
order by the means of their neighbours, and then moved towards these.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

SWEEPS = 12


@dataclass(frozen=True, slots=True)
class Box:
    """Something that is drawn in a column: its width (inch), its height (rows), and the rows and nets of its ports.

    inputs: row, net and width (inch) of the label of the wire. A place that a net passes has no width and is not `real`.
    """

    width: float
    rows: int
    inputs: tuple[tuple[int, str, float], ...]
    outputs: tuple[tuple[int, str], ...]
    real: bool = True


@dataclass(slots=True)
class Band:
    """A row of columns: the boxes in each, as numbers, from above; and the row at which each begins, or half a row."""

    columns: list[list[int]]
    top: dict[int, float] = field(default_factory=dict)


def lay_out(boxes: Sequence[Box], width: float, channel: float) -> tuple[list[Box], list[Band]]:
    """Return the boxes, with places for nets that pass at their end, and the bands, of about that width (inch) at most.

    channel: width (inch) of the space between two columns, without labels.
    """
    layer = _layers(boxes)
    count = 1 + max(layer, default=0)
    columns = [[i for i in range(len(boxes)) if layer[i] == c] for c in range(count)]
    everything, bands = list(boxes), []
    for group in _groups(boxes, columns, width, channel):
        band = Band(group)
        _let_pass(everything, band)
        _put_in_order(everything, band)
        _move(everything, band)
        bands.append(band)
    return everything, bands


def _layers(boxes):
    """The column of each box: one behind the last box that it reads, wires that close a loop set aside."""
    forward, layer = _forward(boxes), [0] * len(boxes)
    for _ in boxes:
        for i, j in forward:
            layer[j] = max(layer[j], layer[i] + 1)
    for i, box in enumerate(boxes):  # what reads nothing stands next to its first reader
        later = [layer[j] for a, j in forward if a == i]
        if not box.inputs and later:
            layer[i] = min(later) - 1
    return layer


def _forward(boxes):
    """Pairs (box, box that reads it), from the inputs on, without those that close a loop."""
    maker = {net: i for i, box in enumerate(boxes) for _, net in box.outputs}
    readers = [[] for _ in boxes]
    for j, box in enumerate(boxes):
        for i in dict.fromkeys(maker[net] for _, net, _ in box.inputs):
            readers[i].append(j)
    found, state = [], [0] * len(boxes)

    def visit(i):
        state[i] = 1
        for j in readers[i]:
            if state[j] != 1:
                found.append((i, j))
            if state[j] == 0:
                visit(j)
        state[i] = 2

    for i in sorted(range(len(boxes)), key=lambda i: bool(boxes[i].inputs)):
        if state[i] == 0:
            visit(i)
    return found


def _groups(boxes, columns, width, channel):
    """The columns in groups that are not wider than the width."""
    groups, used = [], np.inf
    for column in columns:
        labels = max((label for i in column for _, _, label in boxes[i].inputs), default=0.0)
        need = max((boxes[i].width for i in column), default=0.0) + labels + channel
        if used + need > width:
            groups.append([])
            used = 0.0
        groups[-1].append(column)
        used += need
    return groups


def _let_pass(boxes, band):
    """Add places for the nets that go on over a column of the band."""
    at = {i: c for c, column in enumerate(band.columns) for i in column}
    for i, start in list(at.items()):
        for _, net in boxes[i].outputs:
            ends = [c for j, c in at.items() if c > start and any(other == net for _, other, _ in boxes[j].inputs)]
            for c in range(start + 1, max(ends, default=0)):
                band.columns[c].append(len(boxes))
                boxes.append(Box(0.0, 1, ((0, net, 0.0),), ((0, net),), real=False))


def _links(boxes, left, right):
    """(box and row at the left, box and row at the right) of each wire between two columns next to each other."""
    makers = {net: (i, row) for i in left for row, net in boxes[i].outputs}
    return [(*makers[net], j, row) for j in right for row, net, _ in boxes[j].inputs if net in makers]


def _put_in_order(boxes, band):
    """Order each column by the means of its neighbours, and keep the order with the fewest crossings."""
    best, fewest = [list(column) for column in band.columns], np.inf
    for sweep in range(SWEEPS):
        crossings = sum(_crossings(boxes, *pair) for pair in pairwise(band.columns))
        if crossings < fewest:
            best, fewest = [list(column) for column in band.columns], crossings
        steps = list(pairwise(range(len(band.columns))))
        for one, two in steps if sweep % 2 == 0 else steps[::-1]:
            fixed, free = (band.columns[n] for n in ((one, two) if sweep % 2 == 0 else (two, one)))
            means = {i: [] for i in free}
            for i, a, j, b in _links(boxes, band.columns[one], band.columns[two]):
                near, far, row = (j, i, a) if sweep % 2 == 0 else (i, j, b)
                means[near].append(fixed.index(far) + row / (1 + boxes[far].rows))
            goals = {i: (float(np.mean(means[i] or n)), n) for n, i in enumerate(free)}
            free.sort(key=goals.get)
    band.columns = best


def _crossings(boxes, left, right):
    place = {i: 1000 * n for n, i in enumerate(left)} | {j: 1000 * n for n, j in enumerate(right)}
    ends = np.array([(place[i] + a, place[j] + b) for i, a, j, b in _links(boxes, left, right)]).reshape(-1, 2)
    one, other = ends[:, None], ends[None]
    return int(((one[..., 0] < other[..., 0]) & (one[..., 1] > other[..., 1])).sum())


def _move(boxes, band):
    """Move the boxes of each column, in their order, to rows at which their wires are straight, as far as they can be."""
    for column in band.columns:
        row = 0
        for i in column:
            band.top[i] = row
            row += boxes[i].rows + 1
    steps = [(one, two, True) for one, two in pairwise(range(len(band.columns)))]
    back = [(one, two, False) for one, two, _ in steps[::-1]]
    for one, two, rightward in [*steps, *back] * 4 + steps:
        links = _links(boxes, band.columns[one], band.columns[two])
        column = band.columns[two if rightward else one]
        wanted = {}
        for i, a, j, b in links:
            near, row = (j, band.top[i] + a - b) if rightward else (i, band.top[j] + b - a)
            wanted.setdefault(near, []).append(row)
        _place(boxes, band, column, {i: float(np.median(rows)) for i, rows in wanted.items()})
    least = min(band.top.values(), default=0)
    band.top = {i: row - least for i, row in band.top.items()}


def _place(boxes, band, column, wanted):
    """Rows as near as possible to those that are wanted, in the order of the column: those that violate it share a mean."""
    from scipy.optimize import isotonic_regression

    above = np.cumsum([0, *(boxes[i].rows + 1 for i in column)])[: len(column)]
    goals = np.array([wanted.get(i, band.top[i]) for i in column], float) - above
    weights = [1.0 if i in wanted else 0.1 for i in column]
    rows = np.floor(isotonic_regression(goals, weights=weights).x + 0.5) + above if len(column) else above
    band.top |= dict(zip(column, rows.astype(int).tolist(), strict=True))
