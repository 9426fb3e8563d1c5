"""A layered layout of boxes and the wires between them: columns from the inputs on, in as many
bands of columns as fit.

Wires that close a loop are set aside, and each box is one column behind the last box that it reads
(K. Sugiyama, S. Tagawa, M. Toda, IEEE Trans. SMC 11, 1981). A wire to the next column has a track
between the two. Any other goes down to a lane below its band, along it, and to a track in front of
the box that reads it; bands are joined at the left of all boxes. So no wire passes through a box.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

import numpy as np

ROW = 0.19  # inch, of a row of ports
TRACK = 0.1  # inch, between two tracks or lanes, and beside the tracks of two columns
LINES_APART = 0.04  # inch, at which two lines can be told apart

Line = tuple[str, float, float, float, float]  # net, and x and y of both ends (inch); y goes down


@dataclass(frozen=True, slots=True)
class Box:
    """Something that is drawn in a column: its width (inch), its height (rows), and the rows and
    nets of its ports.

    inputs: row, net and width (inch) of the label of the wire.
    """

    width: float
    rows: int
    inputs: tuple[tuple[int, str, float], ...]
    outputs: tuple[tuple[int, str], ...]


@dataclass(frozen=True, slots=True)
class Routes:
    """Places in inches: left edge and top of each box; the lines of all nets; the end of each
    wire; size of the whole."""

    places: Mapping[int, tuple[float, float]]
    lines: Sequence[Line]
    ends: Mapping[tuple[int, int], tuple[float, float]]
    width: float
    height: float


@dataclass(slots=True)
class _Track:
    """A net between two columns: the (box, row) that it comes from at the left and goes to at
    the right; whether to a lane."""

    net: str
    left: list[tuple[int, int]]
    right: list[tuple[int, int]]
    lane: bool
    x: float = 0.0


def lay_out(boxes: Sequence[Box], width: float, beside: float = 0.0) -> Routes:
    """The places and routes of a picture of about that width (inch) at most; beside: what of it
    wires between bands take."""
    bands = _bands(boxes, width - beside)
    top: dict[int, float] = {}
    tracks = []
    for columns in bands:
        top |= _rows(boxes, columns)
        tracks_of_band = []
        for number, (before, after) in enumerate(pairwise([[], *columns, []])):
            nets = _between(boxes, before, after)
            order = _in_order(nets, top)
            if order is None:  # half a row lower, no two wires can be on one line
                for column in columns[number:]:
                    for i in column:
                        top[i] += 0.5
                order = _in_order(nets, top)
            tracks_of_band.append(order)
        tracks.append(tracks_of_band)
    routes = _routes(boxes, bands, top, tracks)
    if routes.width <= width or beside:
        return routes
    return lay_out(boxes, width, routes.width - width)


def _bands(boxes, width):
    """The columns, in groups that are not wider than the width."""
    columns = _columns(boxes)
    bands = []
    used = np.inf
    outputs = set()
    for column in columns:
        inputs = {net for i in column for _, net, _ in boxes[i].inputs}
        nets_before = outputs | inputs
        outputs = {net for i in column for _, net in boxes[i].outputs}
        need = (
            _widest_label(boxes, column)
            + _widest(boxes, column)
            + 2 * TRACK
            + TRACK * len(nets_before)
        )
        if used + need + TRACK * len(outputs) > width:
            bands.append([])
            used = 0.0
        bands[-1].append(column)
        used += need
    return bands


def _widest(boxes, column):
    return max((boxes[i].width for i in column), default=0.0)


def _widest_label(boxes, column):
    return max((label for i in column for _, _, label in boxes[i].inputs), default=0.0)


def _columns(boxes):
    layers = _layers(boxes)
    columns = [[] for _ in range(1 + max(layers, default=0))]
    for i, layer in enumerate(layers):
        columns[layer].append(i)
    return columns


def _forward(readers, order):
    """The pairs of a box and a reader of it that close no loop, by depth-first search; order: in
    which boxes are begun with."""
    forward = []
    unseen, being_visited, done = range(3)
    state = [unseen] * len(readers)

    def visit(i):
        state[i] = being_visited
        for j in readers[i]:
            if state[j] != being_visited:  # a wire back to it closes a loop
                forward.append((i, j))
            if state[j] == unseen:
                visit(j)
        state[i] = done

    for i in order:
        if state[i] == unseen:
            visit(i)
    return forward


def _layers(boxes):
    """The column of each box: one behind the last box that it reads; what reads nothing stands
    before its first reader."""
    maker = {}
    for i, box in enumerate(boxes):
        for _, net in box.outputs:
            maker[net] = i
    readers = [[] for _ in boxes]
    for j, box in enumerate(boxes):
        for i in {maker[net] for _, net, _ in box.inputs}:
            readers[i].append(j)
    sources_first = sorted(range(len(boxes)), key=lambda i: bool(boxes[i].inputs))
    forward = _forward(readers, sources_first)
    layer = [0] * len(boxes)
    for _ in boxes:  # a way through all of them is the longest
        for i, j in forward:
            layer[j] = max(layer[j], layer[i] + 1)
    at_readers = list(layer)
    for i, box in enumerate(boxes):
        if not box.inputs and readers[i]:
            at_readers[i] = min(layer[j] for j in readers[i]) - 1
    return at_readers


def _rows(boxes, columns):
    """The row at which each box begins; the columns are put in order, so that wires to the next one
    are straight and few cross.

    In turns to the right and to the left each column follows the last one: a box wants the median
    of the rows at which one of its wires is straight, and boxes that would overlap share a mean.
    """
    top = {}
    for column in columns:
        top |= dict(zip(column, _stacked(boxes, column).tolist(), strict=True))
    wires = [_wires_between(boxes, left, right) for left, right in pairwise(columns)]
    for turn in range(9):  # odd, so that the last one goes to the right
        rightward = turn % 2 == 0
        steps = range(len(wires)) if rightward else reversed(range(len(wires)))
        for step in steps:
            column = columns[step + 1] if rightward else columns[step]
            _straighten(boxes, column, wires[step], top, rightward)
    least = min(top.values(), default=0)
    return {i: row - least for i, row in top.items()}


def _wires_between(boxes, column, right):
    """The wires from a column to the next: box and row of both ends."""
    made = {}
    for i in column:
        for row, net in boxes[i].outputs:
            made[net] = (i, row)
    wires = []
    for j in right:
        for row, net, _ in boxes[j].inputs:
            if net in made:
                wires.append((*made[net], j, row))
    return wires


def _stacked(boxes, column):
    """The rows at which boxes begin that stand closely below each other."""
    heights = [boxes[i].rows + 1 for i in column]
    return np.cumsum([0, *heights])[: len(column)]


def _straighten(boxes, column, wires, top, rightward):
    """Put a column in order, and its rows in `top`, so that wires from its left, or else to its
    right, are nearly straight."""
    from scipy.optimize import isotonic_regression

    wanted = {}
    for i, a, j, b in wires:
        if rightward:
            wanted.setdefault(j, []).append(top[i] + a - b)
        else:
            wanted.setdefault(i, []).append(top[j] + b - a)
    goals = {i: float(np.median(wanted.get(i, top[i]))) for i in column}
    column.sort(key=lambda i: goals[i] + boxes[i].rows / 2)
    above = _stacked(boxes, column)
    rows = above
    if column:
        weights = [1.0 if i in wanted else 0.1 for i in column]
        offsets = np.array([goals[i] for i in column]) - above
        offsets = isotonic_regression(offsets, weights=weights).x
        rows = (np.floor(offsets + 0.5) + above).astype(int)
    top |= dict(zip(column, rows.tolist(), strict=True))


def _between(boxes, before, after):
    """The nets between two columns of a band."""
    tracks = {}
    for i in before:
        for row, net in boxes[i].outputs:
            tracks[net] = _Track(net, [(i, row)], [], lane=False)
    for j in after:
        for row, net, _ in boxes[j].inputs:
            if net not in tracks:
                tracks[net] = _Track(net, [], [], lane=True)
            tracks[net].right.append((j, row))
    for j, box in enumerate(boxes):
        if j not in after:
            for _, net, _ in box.inputs:
                if net in tracks:  # it is read elsewhere
                    tracks[net].lane = True
    return list(tracks.values())


def _rows_at_left(track, top):
    return {top[i] + row for i, row in track.left}


def _rows_at_right(track, top):
    return {top[i] + row for i, row in track.right}


def _in_order(tracks, top):
    """The tracks from the left on, such that no two wires lie on one line; None if there is no such
    order.

    Wires that come from the left turn first, of those that go down the lowest, of those that go up
    the highest.
    """

    def turn(track):
        left = min(_rows_at_left(track, top), default=0)
        right = min(_rows_at_right(track, top), default=0)
        if not track.left:
            return True, right
        goes_down = track.lane or right > left
        return False, -left if goes_down else left

    nets = {track.net: track for track in sorted(tracks, key=turn)}
    earlier = {}
    for later, track in nets.items():
        right = _rows_at_right(track, top)
        earlier[later] = [
            net for net, other in nets.items() if net != later and _rows_at_left(other, top) & right
        ]
    try:
        return [nets[net] for net in TopologicalSorter(earlier).static_order()]
    except CycleError:
        return None


def _lines_of_track(track, leaves, enters, lane):
    """The line along a track, and those to the ports that it joins; lane: the place of its lane,
    if it has one."""
    lines = [(track.net, *start, track.x, start[1]) for start in leaves]
    lines += [(track.net, track.x, end[1], *end) for end in enters]
    ys = [end[1] for end in leaves + enters] + lane
    lines.append((track.net, track.x, min(ys), track.x, max(ys)))
    return lines


def _routes(boxes, bands, top, tracks):
    """The places of boxes, tracks and lanes in inches, and the lines."""
    lane_places = _places_of_joints(tracks)
    left = max(lane_places.values(), default=-TRACK / 2) + 1.5 * TRACK
    places = {}
    lines = []
    ends = {}
    joints = {}
    width = left
    y = 0.0

    def port_place(port, at_right):
        i, row = port
        x = places[i][0] + at_right * boxes[i].width
        return x, round(places[i][1] + ROW * (row + 0.5), 9)

    for columns, band in zip(bands, tracks, strict=True):
        lefts, right = _across(columns, band, boxes, top, left)
        places |= {i: (x, y + ROW * top[i]) for i, x in lefts.items()}
        y += ROW * max((top[i] + boxes[i].rows for column in columns for i in column), default=0)
        band_tracks = [track for between in band for track in between]
        spans = {}
        for track in band_tracks:
            if track.lane:
                spans.setdefault(track.net, [lane_places.get(track.net, track.x)]).append(track.x)
        level = {net: y + TRACK * (1 + lane) for net, lane in _packed(spans).items()}
        for net, xs in spans.items():
            lines.append((net, min(xs), level[net], max(xs), level[net]))
        for track in band_tracks:
            leaves = [port_place(port, at_right=1) for port in track.left]
            enters = [port_place(port, at_right=0) for port in track.right]
            lane = [level[track.net]] if track.lane else []
            lines += _lines_of_track(track, leaves, enters, lane)
            ends |= dict(zip(track.right, enters, strict=True))
        for net, lane_y in level.items():
            if net in lane_places:
                joints.setdefault(net, []).append(lane_y)
        width = max(width, right)
        y = max([y, *level.values()])
        if columns is not bands[-1]:
            y += 2 * ROW
    for net, levels in joints.items():
        lines.append((net, lane_places[net], min(levels), lane_places[net], max(levels)))
    lines = [line for line in lines if line[1:3] != line[3:]]
    return Routes(places, lines, ends, width + 2 * LINES_APART, y)


def _across(columns, band, boxes, top, left_edge):
    """The left edges of the boxes of a band by their numbers, and where it ends; its tracks get
    their places between the columns."""
    lefts = {}
    x = left_edge
    for column, between in zip([*columns, []], band, strict=True):
        x += TRACK
        for track in between:
            track.x = x
            rows = _rows_at_left(track, top) | _rows_at_right(track, top)
            is_straight = len(rows) <= 1 and not track.lane
            if not is_straight:
                x += TRACK
        x += TRACK + _widest_label(boxes, column)
        wide = _widest(boxes, column)
        for i in column:
            lefts[i] = x + (wide - boxes[i].width) / 2
        x += wide
    return lefts, x


def _places_of_joints(tracks):
    """At the left of all boxes, the x of each net that joins lanes of several bands."""
    bands_of = defaultdict(list)
    for number, band in enumerate(tracks):
        for net in {track.net for between in band for track in between if track.lane}:
            bands_of[net].append(number)
    joined = {net: bands_of[net] for net in sorted(bands_of) if len(bands_of[net]) > 1}
    return {net: TRACK * (lane + 0.5) for net, lane in _packed(joined).items()}


def _packed(spans: Mapping[str, Iterable[float]]) -> dict[str, int]:
    """A lane for each net, such that nets in one lane do not meet; short ones are near the
    boxes."""
    occupied = defaultdict(list)
    lanes = {}
    for net in sorted(spans, key=lambda net: max(spans[net]) - min(spans[net])):
        low = min(spans[net])
        high = max(spans[net])
        lane = 0
        while any(a <= high + TRACK and low <= b + TRACK for a, b in occupied[lane]):
            lane += 1
        lanes[net] = lane
        occupied[lane].append((low, high))
    return lanes


def dots(lines: Sequence[Line]) -> list[tuple[str, float, float]]:
    """Net, x and y of the points at which a net branches, in the same order in every run."""
    joints = set()
    for net in dict.fromkeys(line[0] for line in lines):
        own_lines = [
            [round(coordinate, 6) for coordinate in line[1:]] for line in lines if line[0] == net
        ]
        starts = [(a, b) for a, b, _, _ in own_lines]
        stops = [(c, d) for _, _, c, d in own_lines]
        for x, y in {*starts, *stops}:
            ending = sum((x, y) in pair for pair in zip(starts, stops, strict=True))
            through = 0
            for a, b, c, d in own_lines:
                within_x = min(a, c) <= x <= max(a, c)
                within_y = min(b, d) <= y <= max(b, d)
                through += within_x and within_y
            if (
                2 * through - ending > 2
            ):  # two ends of a line that it is inside, one of a line that ends there
                joints.add((net, x, y))
    return sorted(joints)
