"""Wires between boxes in columns, at right angles: tracks between the columns, and lanes below each row of columns.

A wire to the next column takes a track between the two. Any other wire goes down to a lane, along it, and to a track in front
of the box that reads it. So no wire passes through a box.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from wavesweep.picture.layers import Band, Box

ROW = 0.19  # inch, of a row of ports
TRACK = 0.1  # inch, between two tracks or lanes
SPACE = 0.1  # inch, at both sides of the tracks between two columns
APART = 0.04  # inch, at which two lines can be told apart

Line = tuple[str, float, float, float, float]
"""Net, and x and y of both ends (inch); y goes down."""


@dataclass(frozen=True, slots=True)
class Routes:
    """Places in inches: left edge and top of each real box; the lines of all nets; the end of each wire; size of the whole."""

    places: dict[int, tuple[float, float]]
    lines: list[Line]
    ends: dict[tuple[int, int], tuple[float, float]]
    width: float
    height: float


@dataclass(slots=True)
class _Track:
    """A net between two columns: rows at which it comes from the left and goes to the right, and whether it goes to lanes."""

    net: str
    left: list[float]
    right: list[float]
    down: bool = False
    up: bool = False
    x: float = 0.0

    @property
    def straight(self):
        return not self.down and not self.up and self.left == self.right

    def span(self):
        rows = self.left + self.right
        return (-1e9 if self.up else min(rows)), (1e9 if self.down else max(rows))


def route(boxes: Sequence[Box], bands: Sequence[Band]) -> Routes:
    """Return the routes of all nets between the boxes of these bands."""
    source = {
        net: b for b, band in enumerate(bands) for c in band.columns for i in c if boxes[i].real for _, net in boxes[i].outputs
    }
    for b, band in enumerate(bands):
        _stagger(boxes, band, b, source)
    tracks = [_tracks(boxes, band, b, source) for b, band in enumerate(bands)]
    lanes, margin = _needs(tracks, source)
    left = TRACK * (1 + len(margin))
    x_of, widths = [], []
    for b, band in enumerate(bands):
        columns, x = [], left
        for c in range(len(band.columns) + 1):
            inside = [each for each in tracks[b][c] if not each.straight]
            _order(inside)
            for n, track in enumerate(inside):
                track.x = x + SPACE + TRACK * n
            if c < len(band.columns):
                labels = max((label for i in band.columns[c] for _, _, label in boxes[i].inputs), default=0.0)
                x += SPACE + TRACK * len(inside) + (SPACE if inside else 0.0) + labels
                width = max((boxes[i].width for i in band.columns[c]), default=0.0)
                columns.append((x, width))
                x += width
            else:
                x += SPACE + TRACK * len(inside)
        x_of.append(columns)
        widths.append(x)
    _tell_apart(bands, tracks, x_of)
    return _drawn(boxes, bands, tracks, x_of, lanes, margin, max(widths, default=left) + 2 * APART)


def _tracks(boxes, band, b, source):
    """The nets between the columns of a band, in front of each column and behind the last one."""
    found = []
    for c in range(len(band.columns) + 1):
        before = band.columns[c - 1] if c else []
        after = band.columns[c] if c < len(band.columns) else []
        left = {net: (band.top[i] + row, boxes[i].real) for i in before for row, net in boxes[i].outputs}
        right = {}
        for j in after:
            for row, net, _ in boxes[j].inputs:
                right.setdefault(net, []).append(band.top[j] + row)
        here = []
        for net in dict.fromkeys((*left, *right)):
            rows = right.get(net, [])
            if net in left:
                here.append(_Track(net, [left[net][0]], rows))
            elif net in source:
                from_above = source[net] < b
                here.append(_Track(net, [], rows, down=not from_above, up=from_above))
        found.append(here)
    return found


FEW = 12  # tracks, up to which any two are exchanged on trial; of more tracks only neighbours
CLASH = 1000  # in place of so many crossings


def _stagger(boxes, band, b, source):
    """Lower columns by half a row if wires in front of them would lie on one line in any order of their tracks."""
    for c in range(1, len(band.columns)):
        here = [track for track in _tracks(boxes, band, b, source)[c] if not track.straight]
        _order(here)
        if _total(here) >= CLASH:
            for i in (i for column in band.columns[c:] for i in column):
                band.top[i] += 0.5


def _needs(tracks, source):
    """The nets in the lanes below each band, and those that go from lane to lane at the left of all.

    Each net goes down to its lane behind its box; tracks that lead nowhere are dropped.
    """
    lanes, margin = [{} for _ in range(len(tracks) + 1)], {}
    ends = [(b, track.net) for b, columns in enumerate(tracks) for here in columns for track in here if not track.left]
    for b, net in ends:
        start = source[net]
        gap = b if start >= b else b - 1
        lanes[start][net] = lanes[gap][net] = None
        if gap != start:
            margin[net] = None
    for columns, nets in zip(tracks, lanes, strict=False):
        begun = set()
        for here in columns:
            for track in here:
                if track.left and track.net not in begun:
                    begun.add(track.net)
                    track.down = track.net in nets
            here[:] = [track for track in here if track.right or track.down]
    return [list(each) for each in lanes], list(margin)


def _order(tracks):
    """Order the tracks between two columns: no two wires on one line, and few crossings."""
    tracks.sort(key=lambda track: sum(track.left + track.right) / len(track.left + track.right))
    pairs = [(i, j) for i, j in combinations(range(len(tracks)), 2) if j == i + 1 or len(tracks) <= FEW]
    improved = True
    while improved:
        improved = False
        for i, j in pairs:
            other = [*tracks[:i], tracks[j], *tracks[i + 1 : j], tracks[i], *tracks[j + 1 :]]
            if _total(other) < _total(tracks):
                tracks[:], improved = other, True


def _total(tracks):
    """Crossings of tracks in this order, and clashes of wires on one line."""
    total = 0
    for one, two in combinations(tracks, 2):
        (a, b), (c, d) = one.span(), two.span()
        total += sum(c < row < d for row in one.right) + sum(a < row < b for row in two.left)
        total += CLASH * len(set(one.right) & set(two.left))
    return total


def _tell_apart(bands, tracks, x_of):
    """Move bands to the right until no line from above runs along one from below in the lanes between them."""
    for b in range(1, len(bands)):
        above = [track.x for here in tracks[b - 1] for track in here if track.down]
        below = [track for here in tracks[b] for track in here if track.up]
        while any(abs(x - track.x) < APART for x in above for track in below):
            for track in (track for here in tracks[b] for track in here):
                track.x += APART
            x_of[b] = [(x + APART, width) for x, width in x_of[b]]


def _drawn(boxes, bands, tracks, x_of, lanes, margin, width):
    """The routes, once each track has its place along x."""
    beside = {net: TRACK * (n + 0.5) for n, net in enumerate(margin)}
    # The places (inch) at which lines come to the lane of each net.
    reach = []
    for b in range(len(bands)):
        coming = [track for here in tracks[b] for track in here if track.down]
        coming += [track for here in (tracks[b + 1] if b + 1 < len(tracks) else ()) for track in here if track.up]
        reach.append({net: [track.x for track in coming if track.net == net] for net in lanes[b]})
        for net in beside.keys() & reach[b].keys():
            reach[b][net].append(beside[net])
    numbers = [_lane_numbers(each) for each in reach]
    places, lines, ends, y, lane_y = {}, [], {}, 0.0, []
    for b, band in enumerate(bands):
        rows = max((band.top[i] + boxes[i].rows for c in band.columns for i in c), default=0)
        top, y = y, y + ROW * rows
        lane_y.append({net: y + TRACK * (1 + n) for net, n in numbers[b].items()})
        for c, (x, column) in zip(band.columns, x_of[b], strict=True):
            for i in c:
                box = boxes[i]
                at = x + (column - box.width) / 2 if box.real else x
                if box.real:
                    places[i] = (at, top + ROW * band.top[i])
                else:
                    middle = top + ROW * (band.top[i] + 0.5)
                    lines.append((box.outputs[0][1], x, middle, x + column, middle))
        lines += _in_band(boxes, band, tracks[b], x_of[b], top, lane_y, b, ends)
        y += TRACK * (1 + max(numbers[b].values(), default=-1)) + (2 * ROW if b + 1 < len(bands) else 0.0)
    for b in range(len(bands)):
        lines += [(net, min(xs), lane_y[b][net], max(xs), lane_y[b][net]) for net, xs in reach[b].items()]
    for net, x in beside.items():
        levels = [each[net] for each in lane_y if net in each]
        lines.append((net, x, min(levels), x, max(levels)))
    return Routes(places, [line for line in lines if line[1:3] != line[3:]], ends, width, y)


def _lane_numbers(reach):
    """A lane for each net, such that nets in one lane do not meet; short ones are near the boxes."""
    taken, numbers = [], {}
    for net in sorted(reach, key=lambda net: max(reach[net]) - min(reach[net])):
        low, high = min(reach[net]) - TRACK, max(reach[net]) + TRACK
        free = (n for n, spans in enumerate(taken) if all(high < a or b < low for a, b in spans))
        n = next(free, len(taken))
        if n == len(taken):
            taken.append([])
        taken[n].append((low, high))
        numbers[net] = n
    return numbers


def _in_band(boxes, band, tracks, x_of, top, lane_y, b, ends):
    """The lines of the wires between the columns of a band, and the ends of the wires at the boxes."""
    left_end = {}  # where a net leaves its column
    for c, here in enumerate(tracks):
        before = band.columns[c - 1] if c else []
        for i in before:
            x, column = x_of[c - 1]
            edge = x + (column + boxes[i].width) / 2 if boxes[i].real else x + column
            left_end |= {(c, net): edge for _, net in boxes[i].outputs}
        for track in here:
            level = {row: top + ROW * (row + 0.5) for row in track.left + track.right}
            for row in track.left:
                end = _edge(boxes, band, x_of, c, track, row) if track.straight else track.x
                yield track.net, left_end[c, track.net], level[row], end, level[row]
            for row in track.right:
                edge = _edge(boxes, band, x_of, c, track, row, ends, top)
                if not track.straight:
                    yield track.net, track.x, level[row], edge, level[row]
            if not track.straight:
                ys = list(level.values())
                ys += [lane_y[b][track.net]] if track.down else []
                ys += [lane_y[b - 1][track.net]] if track.up else []
                yield track.net, track.x, min(ys), track.x, max(ys)


def _edge(boxes, band, x_of, c, track, row, ends=None, top=0.0):
    """Where the wire of a net in a row ends at a box of column c, or goes on through the column."""
    x, column = x_of[c]
    for j in band.columns[c]:
        for own, net, _ in boxes[j].inputs:
            if net == track.net and band.top[j] + own == row:
                edge = x + (column - boxes[j].width) / 2 if boxes[j].real else x
                if ends is not None and boxes[j].real:
                    ends[j, own] = (edge, top + ROW * (row + 0.5))
                return edge
    raise ValueError(f"no box in column {c} reads {track.net} in row {row}")


def dots(lines: Sequence[Line]) -> set[tuple[str, float, float]]:
    """Net, x and y of the points at which a net branches."""
    found = set()
    for net in dict.fromkeys(line[0] for line in lines):
        own = [[round(each, 6) for each in line[1:]] for line in lines if line[0] == net]
        for x, y in {end for a, b, c, d in own for end in ((a, b), (c, d))}:
            ends = sum((x, y) in ((a, b), (c, d)) for a, b, c, d in own)
            inside = [min(a, c) <= x <= max(a, c) and min(b, d) <= y <= max(b, d) for a, b, c, d in own]
            if 2 * sum(inside) - ends > 2:  # two ends of a line that it is inside, one of a line that ends there
                found.add((net, x, y))
    return found
