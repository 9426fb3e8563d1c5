"""A layered layout of boxes and the wires between them: columns from the inputs on, in as many bands of columns as fit.

Wires that close a loop are set aside, and each box is one column behind the last box that it reads (K. Sugiyama, S. Tagawa,
M. Toda, IEEE Trans. SMC 11, 1981). A wire to the next column has a track between the two. Any other goes down to a lane below
its band, along it, and to a track in front of the box that reads it; bands are joined at the left of all boxes. So no wire
passes through a box.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import count, pairwise

import numpy as np

SWEEPS = 9  # odd, so that the last one goes to the right
ROW = 0.19  # inch, of a row of ports
TRACK = 0.1  # inch, between two tracks or lanes
SPACE = 0.1  # inch, at both sides of the tracks between two columns
APART = 0.04  # inch, at which two lines can be told apart

Line = tuple[str, float, float, float, float]  # net, and x and y of both ends (inch); y goes down


@dataclass(frozen=True, slots=True)
class Box:
    """Something that is drawn in a column: its width (inch), its height (rows), and the rows and nets of its ports.

    inputs: row, net and width (inch) of the label of the wire.
    """

    width: float
    rows: int
    inputs: tuple[tuple[int, str, float], ...]
    outputs: tuple[tuple[int, str], ...]


@dataclass(frozen=True, slots=True)
class Routes:
    """Places in inches: left edge and top of each box; the lines of all nets; the end of each wire; size of the whole."""

    places: Mapping[int, tuple[float, float]]
    lines: Sequence[Line]
    ends: Mapping[tuple[int, int], tuple[float, float]]
    width: float
    height: float


@dataclass(slots=True)
class _Track:
    """A net between two columns: the (box, row) that it comes from at the left and goes to at the right; whether to a lane."""

    net: str
    left: list[tuple[int, int]]
    right: list[tuple[int, int]]
    lane: bool
    x: float = 0.0


def lay_out(boxes: Sequence[Box], width: float, beside: float = 0.0) -> Routes:
    """The places and routes of a picture of about that width (inch) at most; beside: what of it wires between bands take."""
    bands, top, tracks = _bands(boxes, width - beside), {}, []
    for columns in bands:
        top |= _rows(boxes, columns)
        tracks.append([])
        for number, (before, after) in enumerate(pairwise([[], *columns, []])):
            here = _between(boxes, before, after)
            if (order := _in_order(here, top)) is None:  # half a row lower, no two wires can be on one line
                top |= {i: top[i] + 0.5 for column in columns[number:] for i in column}
                order = _in_order(here, top)
            tracks[-1].append(order)
    routes = _routes(boxes, bands, top, tracks)
    return routes if routes.width <= width or beside else lay_out(boxes, width, routes.width - width)


def _bands(boxes, width):
    """The columns, in groups that are not wider than the width."""
    layer = _layers(boxes)
    bands, used, outputs = [], np.inf, set()
    for c in range(1 + max(layer, default=0)):
        column = [i for i in range(len(boxes)) if layer[i] == c]
        nets = outputs | {net for i in column for _, net, _ in boxes[i].inputs}
        outputs = {net for i in column for _, net in boxes[i].outputs}
        labels = max((label for i in column for _, _, label in boxes[i].inputs), default=0.0)
        need = max((boxes[i].width for i in column), default=0.0) + labels + 2 * SPACE + TRACK * len(nets)
        if used + need + TRACK * len(outputs) > width:
            bands.append([])
            used = 0.0
        bands[-1].append(column)
        used += need
    return bands


def _forward(readers, order):
    """The pairs of a box and a reader of it that close no loop, by depth-first search; order: in which boxes are begun with."""
    forward, state = [], [0] * len(readers)

    def visit(i):
        state[i] = 1
        for j in readers[i]:
            if state[j] != 1:  # a wire back to a box that is being visited closes a loop
                forward.append((i, j))
            if state[j] == 0:
                visit(j)
        state[i] = 2

    for i in order:
        if state[i] == 0:
            visit(i)
    return forward


def _layers(boxes):
    """The column of each box: one behind the last box that it reads; what reads nothing stands before its first reader."""
    maker = {net: i for i, box in enumerate(boxes) for _, net in box.outputs}
    reads = [{maker[net] for _, net, _ in box.inputs} for box in boxes]
    readers = [[j for j, read in enumerate(reads) if i in read] for i in range(len(boxes))]
    layer = [0] * len(boxes)
    for i, j in _forward(readers, sorted(range(len(boxes)), key=lambda i: bool(boxes[i].inputs))) * len(boxes):
        layer[j] = max(layer[j], layer[i] + 1)
    return [
        layer[i] if box.inputs else min((layer[j] - 1 for j in readers[i]), default=layer[i]) for i, box in enumerate(boxes)
    ]


def _rows(boxes, columns):
    """The row at which each box begins; the columns are put in order, so that wires to the next one are straight and few cross.

    In turns to the right and to the left each column follows the last one: a box wants the median of the rows at which one of
    its wires is straight, and boxes that would overlap share a mean.
    """
    top, links = {}, []
    for column in columns:
        top |= dict(zip(column, _stacked(boxes, column).tolist(), strict=True))
    for left, right in pairwise(columns):
        made = {net: (i, row) for i in left for row, net in boxes[i].outputs}
        links.append([(*made[net], j, row) for j in right for row, net, _ in boxes[j].inputs if net in made])
    for turn in range(SWEEPS):
        rightward = turn % 2 == 0
        for step in range(len(links)) if rightward else reversed(range(len(links))):
            _straighten(boxes, columns[step + rightward], links[step], top, rightward)
    least = min(top.values(), default=0)
    return {i: row - least for i, row in top.items()}


def _stacked(boxes, column):
    """The rows at which boxes begin that stand closely below each other."""
    return np.cumsum([0, *(boxes[i].rows + 1 for i in column)])[: len(column)]


def _straighten(boxes, column, wires, top, rightward):
    """Put a column in order, and its rows in `top`, so that wires from its left, or else to its right, are nearly straight."""
    from scipy.optimize import isotonic_regression

    wanted = {}
    for i, a, j, b in wires:
        near, row = (j, top[i] + a - b) if rightward else (i, top[j] + b - a)
        wanted.setdefault(near, []).append(row)
    goals = {i: float(np.median(wanted.get(i, top[i]))) for i in column}
    column.sort(key=lambda i: goals[i] + boxes[i].rows / 2)
    above = _stacked(boxes, column)
    weights = [1.0 if i in wanted else 0.1 for i in column]
    rows = isotonic_regression(np.array([goals[i] for i in column]) - above, weights=weights).x if column else above
    top |= dict(zip(column, (np.floor(rows + 0.5) + above).astype(int).tolist(), strict=True))


def _between(boxes, before, after):
    """The nets between two columns of a band."""
    left = {net: [(i, row)] for i in before for row, net in boxes[i].outputs}
    wires = [(net, (j, row)) for j in after for row, net, _ in boxes[j].inputs]
    elsewhere = {net for j, box in enumerate(boxes) if j not in after for _, net, _ in box.inputs}
    tracks = {net: _Track(net, left.get(net, []), [], net not in left or net in elsewhere) for net in (*left, *dict(wires))}
    for net, port in wires:
        tracks[net].right.append(port)
    return list(tracks.values())


def _levels(track, top):
    """The rows at which a net comes from the left and goes on to the right."""
    return [{top[i] + row for i, row in side} for side in (track.left, track.right)]


def _in_order(tracks, top):
    """The tracks from the left on, such that no two wires lie on one line; None if there is no such order.

    Wires that come from the left turn first, of those that go down the lowest, of those that go up the highest.
    """

    def turn(track):
        left, right = (min(side, default=0) for side in _levels(track, top))
        return not track.left, right if not track.left else -left if track.lane or right > left else left

    nets = {track.net: track for track in sorted(tracks, key=turn)}
    lefts = {net: _levels(track, top)[0] for net, track in nets.items()}
    earlier = {later: [net for net in nets if net != later and lefts[net] & _levels(nets[later], top)[1]] for later in nets}
    try:
        return [nets[net] for net in TopologicalSorter(earlier).static_order()]
    except CycleError:
        return None


def _routes(boxes, bands, top, tracks):
    """The places of boxes, tracks and lanes in inches, and the lines."""
    down = [{track.net for between in band for track in between if track.lane} for band in tracks]
    joined = {net: [b for b, nets in enumerate(down) if net in nets] for net in sorted(set().union(*down))}
    lane_places = {net: TRACK * (n + 0.5) for net, n in _packed({net: of for net, of in joined.items() if len(of) > 1}).items()}
    left = max(lane_places.values(), default=-TRACK / 2) + 1.5 * TRACK
    places, lines, ends, lanes, width, y = {}, [], {}, {}, left, 0.0

    def point(i, row, side):
        return places[i][0] + side * boxes[i].width, round(places[i][1] + ROW * (row + 0.5), 9)

    for columns, band in zip(bands, tracks, strict=True):
        x, band_tracks = left, [track for between in band for track in between]
        for column, between in zip([*columns, []], band, strict=True):
            x += SPACE
            for track in between:
                track.x = x
                x += TRACK * (track.lane or len(set().union(*_levels(track, top))) > 1)  # or it is straight
            x += SPACE + max((label for i in column for _, _, label in boxes[i].inputs), default=0.0)
            wide = max((boxes[i].width for i in column), default=0.0)
            places |= {i: (x + (wide - boxes[i].width) / 2, y + ROW * top[i]) for i in column}
            x += wide
        y += ROW * max((top[i] + boxes[i].rows for column in columns for i in column), default=0)
        spans = {}
        for track in (track for track in band_tracks if track.lane):
            spans.setdefault(track.net, [lane_places.get(track.net, track.x)]).append(track.x)
        level = {net: y + TRACK * (1 + n) for net, n in _packed(spans).items()}
        lines += [(net, min(xs), level[net], max(xs), level[net]) for net, xs in spans.items()]
        for track in band_tracks:
            leaves, enters = ([point(*port, side) for port in ports] for side, ports in ((1, track.left), (0, track.right)))
            lines += [(track.net, *start, track.x, start[1]) for start in leaves]
            lines += [(track.net, track.x, end[1], *end) for end in enters]
            ends |= dict(zip(track.right, enters, strict=True))
            ys = [leaf[1] for leaf in leaves + enters] + ([level[track.net]] if track.lane else [])
            lines.append((track.net, track.x, min(ys), track.x, max(ys)))
        for net in (net for net in level if net in lane_places):
            lanes.setdefault(net, []).append(level[net])
        width, y = max(width, x), max([y, *level.values()]) + 2 * ROW * (columns is not bands[-1])
    lines += [(net, lane_places[net], min(levels), lane_places[net], max(levels)) for net, levels in lanes.items()]
    return Routes(places, [line for line in lines if line[1:3] != line[3:]], ends, width + 2 * APART, y)


def _packed(spans: Mapping[str, Iterable[float]]) -> dict[str, int]:
    """A lane for each net, such that nets in one lane do not meet; short ones are near the boxes."""
    occupied, numbers = defaultdict(list), {}
    for net in sorted(spans, key=lambda net: max(spans[net]) - min(spans[net])):
        low, high = min(spans[net]), max(spans[net])
        numbers[net] = next(n for n in count() if all(high + TRACK < a or b + TRACK < low for a, b in occupied[n]))
        occupied[numbers[net]].append((low, high))
    return numbers


def dots(lines: Sequence[Line]) -> set[tuple[str, float, float]]:
    """Net, x and y of the points at which a net branches."""
    joints = set()
    for net in dict.fromkeys(line[0] for line in lines):
        own_lines = [[round(coordinate, 6) for coordinate in line[1:]] for line in lines if line[0] == net]
        for x, y in {end for a, b, c, d in own_lines for end in ((a, b), (c, d))}:
            ends = sum((x, y) in ((a, b), (c, d)) for a, b, c, d in own_lines)
            inside = [min(a, c) <= x <= max(a, c) and min(b, d) <= y <= max(b, d) for a, b, c, d in own_lines]
            if 2 * sum(inside) - ends > 2:  # two ends of a line that it is inside, one of a line that ends there
                joints.add((net, x, y))
    return joints
