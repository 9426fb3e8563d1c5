"""Intervals of a number with a passive port, with every passive hand, or with a passive channel: searched, then checked.

A finder looks at values of the number. An interval that it finds is checked by the sign of a determinant over the number and
the angle, interpolated with bounds that are sampled (see `engine.stability.positive`). What lies outside is refuted by angles
at which energy is taken out (see `passive.over_ranges`), or because the loop is unstable.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops
from wavesweep.engine.loops.resolution import Resolution, Side
from wavesweep.engine.search.interval_search import Search
from wavesweep.engine.stability.positive import positive
from wavesweep.engine.stability.spectrum import is_stable
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.held_loop import HeldLoop
from wavesweep.passive.any_hand import runs_of
from wavesweep.passive.channel import channel_of
from wavesweep.passive.over_ranges import (
    ANGLES,
    Covering,
    Determinant,
    Maps,
    Witness,
    channel_maps,
    least,
    port_maps,
    reaction_maps,
    with_sizes,
)
from wavesweep.passive.two_ports import Pair, pairs_of

TRIED = np.concatenate([[0.0], np.geomspace(1e-4, 0.03, 8), np.linspace(0.06, np.pi, 40)])  # rad per frame, for a worst angle
POINTS = 20_000  # of number and angle that the proof of a panel may take
FEW = 300  # values of the number that the proof of a piece of a gap may take
PIECES = 100  # of a gap
ROUNDS = 6  # of a search that proofs contradict
NEAR = 1e-7  # of an end, or of the range at 0: where a proof stops before the end
CLOSE = 1e-4  # of an end, or of an interval, that may lie between what is proved and what is refuted


@dataclass(frozen=True, slots=True, eq=False)
class PassiveRanges:
    """Checked intervals of a number, `(intervals,)` each, and whether both of their ends are known to CLOSE.

    complete: whether it is checked that there are no others, but for CLOSE about each end. worst: gives the angular frequency
    (rad/s) at which energy is taken out at a value of the number.
    """

    low: np.ndarray
    high: np.ndarray
    certified: np.ndarray
    complete: bool
    worst: Callable[[float], float]


def port_ranges(loop: HeldLoop, path: str, span: tuple[float, float]) -> PassiveRanges:
    """Where the hand's port is passive for forces that are held over a tick; see `port_margin`. loop: a single one."""
    return _where_stable(loop, path, span, _OneMap(port_maps(loop, path, span)))


def pair_ranges(loop: HeldLoop, path: str, span: tuple[float, float]) -> PassiveRanges:
    """Where a loop with two ports is absolutely stable; see `passive.two_ports`. loop: a single one."""
    return _where_stable(loop, path, span, Pair(pairs_of(loop, path, span)))


def _where_stable(loop, path, span, way):
    """The intervals in which a way is passive, within those of stability by itself, of states that no port sees too."""
    groups = ((np.zeros(1, int), Loops(loop.drawing, loop.values)),)
    records = Search(path, span, groups, lines=False, checked=True).records()
    stable = [(float(record["low"]), float(record["high"])) for record in records if record["intervals"]]
    return _Ranges(loop, path, span, (way,), stable).answered(bool(records["certified"].all()))


def hand_ranges(loop: HeldLoop, path: str, span: tuple[float, float]) -> PassiveRanges:
    """Where the loop is stable with every passive hand; see `damping_needed`.

    loop: a single one, whose hand holds a mass of which nothing reads the velocity. The guarantee is for continuous hands of
    any mass and stiffness, including nonlinear and time-varying ones, and for none: the device by itself is stable.
    """
    free = loop.changed(dict.fromkeys(HAND, 0.0))
    return _where_stable(free, path, span, _OneMap(reaction_maps(free, path, span)))


def channel_ranges(loop: HeldLoop, path: str, span: tuple[float, float], tolerance: float) -> PassiveRanges:
    """Where the wave channel adds at most `tolerance` (J per J sent) to its waves; see `channel_norm`. loop: a single one."""
    ways = ("whole",) if channel_of(loop.drawing, loop.changed({path: span[1]}).values).joined else ("outward", "inward")
    maps = tuple(_OneMap(channel_maps(loop, path, direction, 1 + tolerance)) for direction in ways)
    return _Ranges(loop, path, span, maps, [span]).answered(known=True)


@dataclass(frozen=True, slots=True, eq=False)
class _OneMap:
    """Loops are passive along a number where they are stable and the Hermitian part of one map is positive at all angles."""

    maps: Maps

    def passive(self, p: np.ndarray) -> np.ndarray:
        """Whether loops at values of the number are stable and no eigenvalue is negative, `(n,)`."""
        lifted, _ = self.maps(p)
        finite = np.isfinite(lifted.E).all((-1, -2)) & np.isfinite(lifted.T).all((-1, -2))
        finite[finite] = is_stable(lifted.E[finite])
        finite[finite] = least(lifted.at(finite)).value <= 0
        return finite

    def open_in(self, low: float, high: float, cover: Covering) -> list[np.ndarray] | float | None:
        """The parts of an interval that are not proved, a value at which the opposite is so, or None without a proof."""
        middle, open_ = np.array([(low + high) / 2]), []
        matrix, size, _ = Witness(self.maps, middle[0], 1.0).hermitian(middle)
        if not is_stable(self.maps(middle)[0].E).all() or np.linalg.eigvalsh(matrix[0])[0] <= 1e-12 * size[0].max():
            return None
        for first, last in pairwise(ANGLES):
            covered = cover(Determinant(self.maps), [[low, first], [high, last]], POINTS)
            if covered is None or len(covered.unstable):
                return None if covered is None else float(covered.unstable[0, 0])
            open_ += [box[:, 0] for box in covered.open]
        return open_

    def witness(self, low: float, high: float) -> Witness:
        """What takes energy in the middle of two values, at the angle where it is farthest from rounding."""
        lifted, _ = self.maps(np.array([p := (low + high) / 2]))
        smallest = lifted.smallest(np.zeros(TRIED.size, int), TRIED)
        with np.errstate(all="ignore"):
            _, size = with_sizes(lifted.at(np.zeros(TRIED.size, int)), TRIED)
            theta = TRIED[np.nanargmin(smallest / size.max((-1, -2)))]
        return Witness(self.maps, p, float(theta))

    def angle(self, p: float) -> float:
        """An angle with about the smallest eigenvalue (rad per frame)."""
        lifted, _ = self.maps(np.array([p]))
        return float(TRIED[np.nanargmin(lifted.smallest(np.zeros(TRIED.size, int), TRIED))])


@dataclass(frozen=True, slots=True, eq=False)
class _Ranges:
    """What is asked: where loops are passive along a number.

    ways: what has to be passive. stable: intervals outside of which nothing is passive.
    """

    loop: HeldLoop
    path: str
    span: tuple[float, float]
    ways: tuple[_OneMap | Pair, ...]
    stable: list[tuple[float, float]]

    def answered(self, known: bool) -> PassiveRanges:
        """The intervals with their proofs; known: whether all intervals of stability are."""
        ends, proofs, gaps = self._searched(known)
        intervals = [proved for proved, _ in proofs]
        near = [interval is not None and self._close(interval, pair) for interval, pair in zip(intervals, ends, strict=True)]
        both_refuted = [below and above for (below, _), (above, _) in pairwise(gaps)]
        certified = [known and below and above for below, above in zip(near, both_refuted, strict=True)]
        low, high = np.array([interval or pair for interval, pair in zip(intervals, ends, strict=True)]).reshape(-1, 2).T
        complete = known and all(near) and all(refuted for refuted, _ in gaps)
        return PassiveRanges(low, high, np.array(certified, bool), complete, self._frequency)

    def _searched(self, known: bool):
        """The ends of the intervals, their proofs, and what is refuted between them.

        Values at which a proof finds the opposite of what it is to prove are looked at as well, and the search begins again.
        """
        searched: list[float] = []
        for _ in range(ROUNDS):
            ends = list(zip(*(column.tolist() for column in runs_of(self._passive, self.span, searched)), strict=True))
            proofs = [self._proved(*pair) for pair in ends]
            edges = [self.span[0], *(end for pair in ends for end in pair), self.span[1]]
            gaps = [self._refuted(low, high) for low, high in zip(edges[::2], edges[1::2], strict=True)]
            against = [float(np.clip(p, *self.span)) for _, p in (*proofs, *gaps) if p is not None]  # rounding of a box
            if not known or not against or set(against) <= set(searched):
                break
            searched += against
        return ends, proofs, gaps

    def _passive(self, p):
        low, high = np.array(self.stable).reshape(-1, 2, 1).swapaxes(0, 1)
        inside = ((low <= p) & (p <= high)).any(0)
        for direction in self.ways if inside.any() else ():
            inside[inside] = direction.passive(p[inside])
        return inside

    def _away(self, end: float, sign: int) -> float:
        """A value beside an end, in the direction of the sign; an end of the range itself."""
        wide = self.span[1] - self.span[0]
        return end if end in self.span else end + sign * NEAR * max(abs(end), CLOSE * wide)

    def _close(self, part, ends) -> bool:
        return all(
            abs(proved_end - end) <= CLOSE * max(abs(end), ends[1] - ends[0])
            for proved_end, end in zip(part, ends, strict=True)
        )

    def _proved(self, low: float, high: float) -> tuple[tuple[float, float] | None, float | None]:
        """What is proved between two ends, None without; and a value at which it is not so, if the proof found one."""
        low, high = self._away(low, 1), self._away(high, -1)
        if not (low < high and any(a <= low and high <= b for a, b in self.stable)):
            return None, None
        open_ = []
        for direction in self.ways:
            opened = direction.open_in(low, high, cover_of(self.loop, self.path))
            if not isinstance(opened, list):
                return None, opened
            open_ += opened
        return largest_free(low, high, open_), None

    def _refuted(self, low: float, high: float) -> tuple[bool, float | None]:
        """Whether nothing between two ends of intervals is passive; and a value that is, if one is found."""
        low, high = self._away(low, 1), self._away(high, -1)
        queue = [(max(low, a), min(high, b)) for a, b in self.stable if max(low, a) < min(high, b)]
        least, ends = CLOSE / 2 * (self.span[1] - self.span[0]), {end for pair in queue for end in pair}
        for _ in range(PIECES):
            if not queue:
                return True, None
            a, b = queue.pop()
            p = (a + b) / 2
            if self._passive(np.array([p]))[0]:
                return False, p
            if any(self._takes(direction, a, b) for direction in self.ways):
                continue
            narrow = min(least, CLOSE * max(abs(a), abs(b)))
            if b - a > narrow:
                queue += [(a, p), (p, b)]
            elif all(abs(p - end) > 2 * narrow for end in ends):  # the ends are as exact as this, and nothing else is
                return False, None
        return False, None

    def _takes(self, way, low: float, high: float) -> bool:
        """Whether all values of a piece are proved not to be passive, by what takes energy there."""
        covered = cover_of(self.loop, self.path)(way.witness(low, high), [[low], [high]], FEW)
        return covered is not None and not len(covered.open)

    def _frequency(self, p: float) -> float:
        drawn = self.loop.changed({self.path: p}).drawn()
        angle = max(direction.angle(p) for direction in self.ways)
        return angle / float(np.real(drawn.period) * drawn.ticks)


def cover_of(loop: HeldLoop, path: str) -> Covering:
    """What covers boxes of a number of the loop, and of an angle; a box with a loop that has no solution has no cover."""

    def cover(functions, box, most):
        bounds, sides = np.array([[-np.inf], [np.inf]]).repeat(len(box[0]), 1), [Side(path), *[Side()] * (len(box[0]) - 1)]
        try:
            bounds[:, 0] = loop.domain(path, (box[0][0], box[1][0]))
            return positive(functions, box, bounds, most, Resolution(loop.drawing, loop.values, sides))
        except IllPosedLoopError:
            return None

    return cover


def largest_free(low: float, high: float, spans: Iterable[Sequence[float]]) -> tuple[float, float] | None:
    """The largest part of an interval that some spans leave free; None if none does."""
    edges, free, at = sorted((float(a), float(b)) for a, b in spans), [], low
    for a, b in edges:
        if a > at:
            free.append((at, min(a, high)))
        at = max(at, b)
    if at < high:
        free.append((at, high))
    return max(((a, b) for a, b in free if a < b), key=lambda span: span[1] - span[0], default=None)
