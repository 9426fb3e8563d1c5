"""Intervals of a number with a passive port, with every passive hand, or with a passive channel:
searched, then checked.

A finder looks at values of the number. An interval that it finds is checked by the sign of a
determinant over the number and the angle, with bounds that are sampled (see
`engine._stability.positive`). What lies outside is refuted by angles at which energy is taken out
(see `passive.over_ranges`), or because the loop is unstable.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.intervals import Resolution, Side, positive
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import is_stable
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.held_loop import HeldLoop
from wavesweep.passive.channel import channel_of
from wavesweep.passive.over_ranges import (
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
from wavesweep.program.analyses.interval_jobs import records_of_loop

TRIED = np.concatenate(
    [[0.0], np.geomspace(1e-4, 0.03, 8), np.linspace(0.06, np.pi, 40)]
)  # rad per frame, for a worst angle
TRIED_FIRST = 33  # values of the number
CUTS = 15  # points of one round of refinement
STOP_BEFORE_END = 1e-7  # of an end, or of the range at 0: where a proof stops before the end
# of an end, or of an interval, that may lie between what is proved and what is refuted
GAP_OF_END = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class PassiveRanges:
    """Checked intervals of a number, `(intervals,)` each, and whether both of their ends are known
    to GAP_OF_END.

    complete: whether it is checked that there are no others, but for GAP_OF_END about each end.
    frequency: gives that which sets an end (rad/s), of its value and the sign of the direction in
    which it is left.
    """

    low: np.ndarray
    high: np.ndarray
    certified: np.ndarray
    complete: bool
    frequency: Callable[[float, int], float]


def port_ranges(loop: HeldLoop, path: str, span: tuple[float, float]) -> PassiveRanges:
    """Where the hand's port is passive for forces that are held over a tick; see `port_margin`.
    loop: a single one."""
    return _where_stable(loop, path, span, _OneMap(port_maps(loop, path, span)))


def pair_ranges(loop: HeldLoop, path: str, span: tuple[float, float]) -> PassiveRanges:
    """Where a loop with two ports is absolutely stable; see `passive.two_ports`. loop: a single
    one."""
    return _where_stable(loop, path, span, Pair(pairs_of(loop, path, span)))


def _where_stable(loop, path, span, way):
    """The intervals in which a way is passive, within those of stability by itself, of states
    that no port sees too."""
    records = records_of_loop(Loops(loop.drawing, loop.values), path, span)
    found = records[records["intervals"] > 0]
    stable = list(zip(found["low"].tolist(), found["high"].tolist(), strict=True))
    modes = {}
    for end in ("low", "high"):
        modes.update(zip(found[end].tolist(), found[f"{end}_omega"].tolist(), strict=True))
    ranges = _Ranges(loop, path, span, (way,), stable, modes)
    return ranges.answered(bool(records["certified"].all()))


def hand_ranges(loop: HeldLoop, path: str, span: tuple[float, float]) -> PassiveRanges:
    """Where the loop is stable with every passive hand; see `reaction_maps`.

    loop: a single one, whose hand holds a mass of which nothing reads the velocity. The guarantee
    is for continuous hands of any mass and stiffness, including nonlinear and time-varying ones,
    and for none: the device by itself is stable.
    """
    free = loop.changed(dict.fromkeys(HAND, 0.0))
    return _where_stable(free, path, span, _OneMap(reaction_maps(free, path, span)))


def channel_ranges(
    loop: HeldLoop, path: str, span: tuple[float, float], tolerance: float
) -> PassiveRanges:
    """Where the wave channel adds at most `tolerance` (J per J sent) to its waves; see
    `channel_norm`. loop: a single one."""
    at_end = loop.changed({path: span[1]})
    joined = channel_of(loop.drawing, at_end.values).joined
    directions = ("whole",) if joined else ("outward", "inward")
    ways = tuple(_OneMap(channel_maps(loop, path, each, 1 + tolerance)) for each in directions)
    return _Ranges(loop, path, span, ways, [span], {}).answered(known=True)


@dataclass(frozen=True, slots=True, eq=False)
class _OneMap:
    """Loops are passive along a number where they are stable and the Hermitian part of one map
    is positive at all angles."""

    maps: Maps

    def passive(self, p: np.ndarray) -> np.ndarray:
        """Whether loops at values of the number are stable and no eigenvalue is negative,
        `(n,)`."""
        lifted, _ = self.maps(p)
        finite = np.isfinite(lifted.E).all((-1, -2)) & np.isfinite(lifted.T).all((-1, -2))
        finite[finite] = is_stable(lifted.E[finite])
        finite[finite] = least(lifted.at(finite)).value <= 0
        return finite

    def open_in(self, low: float, high: float, cover: Covering) -> list[np.ndarray] | float | None:
        """The parts of an interval that are not proved, a value at which the opposite is so, or
        None without a proof."""
        # One of the loops is passive: it is stable, and its Hermitian part positive at one angle.
        middle = np.array([(low + high) / 2])
        lifted, _ = self.maps(middle)
        if not is_stable(lifted.E).all():
            return None
        (hermitian,), (size,), _ = Witness(self.maps, middle[0], 1.0).hermitian(middle)
        least_of_one, *_ = np.linalg.eigvalsh(hermitian)
        if least_of_one <= 1e-12 * size.max():
            return None
        # No eigenvalue changes its sign where the determinant is not 0 at any angle.
        covered = cover(Determinant(self.maps), [[low, 0.0], [high, np.pi]], 100_000)
        if covered is None:
            return None
        if len(covered.negative):
            return float(covered.negative[0, 0])
        return [box[:, 0] for box in covered.open]

    def witness(self, low: float, high: float) -> Witness:
        """What takes energy in the middle of two values, at the angle where it is farthest from
        rounding."""
        p = (low + high) / 2
        lifted, _ = self.maps(np.array([p]))
        same = np.zeros(TRIED.size, int)  # the loop at p, at each of the angles
        smallest = lifted.smallest(same, TRIED)
        with np.errstate(all="ignore"):
            _, size = with_sizes(lifted.at(same), TRIED)
            beyond_rounding = smallest / size.max((-1, -2))
        theta = TRIED[np.nanargmin(beyond_rounding)]
        return Witness(self.maps, p, float(theta))

    def deciding(self, p: float) -> tuple[float, float]:
        """The smallest eigenvalue over all angles, and its angle (rad per frame)."""
        lifted, _ = self.maps(np.array([p]))
        peak = least(lifted, np.inf)
        return -float(peak.value[0]), float(peak.theta[0])


@dataclass(frozen=True, slots=True, eq=False)
class _Ranges:
    """What is asked: where loops are passive along a number.

    ways: what has to be passive. stable: intervals outside of which nothing is passive; modes: the
    frequency (rad/s) of the mode that sets each of their ends.
    """

    loop: HeldLoop
    path: str
    span: tuple[float, float]
    ways: tuple[_OneMap | Pair, ...]
    stable: list[tuple[float, float]]
    modes: dict[float, float]

    def answered(self, known: bool) -> PassiveRanges:
        """The intervals with their proofs; known: whether all intervals of stability are."""
        ends, proofs, gaps = self._searched(known)
        refuted = [
            is_refuted for is_refuted, _ in gaps
        ]  # below the first interval, between two, above
        intervals = []
        near = []
        certified = []
        for at, (found, (proved, _)) in enumerate(zip(ends, proofs, strict=True)):
            is_near = proved is not None and self._close(proved, found)
            intervals.append(proved or found)
            near.append(is_near)
            certified.append(known and is_near and refuted[at] and refuted[at + 1])
        low, high = np.array(intervals).reshape(-1, 2).T
        complete = known and all(near) and all(refuted)
        return PassiveRanges(low, high, np.array(certified, bool), complete, self._frequency)

    def _searched(self, known: bool):
        """The ends of the intervals, their proofs, and what is refuted between them.

        Values at which a proof finds the opposite of what it is to prove are looked at as well, and
        the search begins again.
        """
        searched: list[float] = []
        for _ in range(6):  # rounds of a search that proofs contradict
            lows, highs = runs_of(self._passive, self.span, searched)
            ends = list(zip(lows.tolist(), highs.tolist(), strict=True))
            proofs = [self._proved(*pair) for pair in ends]
            edges = [self.span[0], *(end for pair in ends for end in pair), self.span[1]]
            gaps = [
                self._refuted(low, high) for low, high in zip(edges[::2], edges[1::2], strict=True)
            ]
            # Rounding of a box may lead out of the range.
            against = [float(np.clip(p, *self.span)) for _, p in (*proofs, *gaps) if p is not None]
            if not known or not against or set(against) <= set(searched):
                break
            searched += against
        return ends, proofs, gaps

    def _passive(self, p):
        low, high = np.array(self.stable).reshape(-1, 2, 1).swapaxes(0, 1)
        inside = ((low <= p) & (p <= high)).any(0)
        if inside.any():
            for way in self.ways:
                inside[inside] = way.passive(p[inside])
        return inside

    def _away(self, end: float, sign: int) -> float:
        """A value beside an end, in the direction of the sign; an end of the range itself."""
        if end in self.span:
            return end
        wide = self.span[1] - self.span[0]
        return end + sign * STOP_BEFORE_END * max(abs(end), GAP_OF_END * wide)

    def _close(self, part, ends) -> bool:
        wide = ends[1] - ends[0]
        return all(
            abs(proved_end - end) <= GAP_OF_END * max(abs(end), wide)
            for proved_end, end in zip(part, ends, strict=True)
        )

    def _proved(self, low: float, high: float) -> tuple[tuple[float, float] | None, float | None]:
        """What is proved between two ends, None without; and a value at which it is not so, if
        the proof found one."""
        low = self._away(low, 1)
        high = self._away(high, -1)
        if not (low < high and any(a <= low and high <= b for a, b in self.stable)):
            return None, None
        open_ = []
        for way in self.ways:
            opened = way.open_in(low, high, cover_of(self.loop, self.path))
            if not isinstance(opened, list):
                return None, opened
            open_ += opened
        return largest_free(low, high, open_), None

    def _refuted(self, low: float, high: float) -> tuple[bool, float | None]:
        """Whether nothing between two ends of intervals is passive; and a value that is, if one
        is found."""
        low = self._away(low, 1)
        high = self._away(high, -1)
        queue = []
        for a, b in self.stable:
            if max(low, a) < min(high, b):
                queue.append((max(low, a), min(high, b)))
        ends = {end for pair in queue for end in pair}
        least_wide = GAP_OF_END / 2 * (self.span[1] - self.span[0])
        for _ in range(100):  # pieces of a gap
            if not queue:
                return True, None
            a, b = queue.pop()
            p = (a + b) / 2
            if self._passive(np.array([p]))[0]:
                return False, p
            if any(self._takes(way, a, b) for way in self.ways):
                continue
            narrow = min(least_wide, GAP_OF_END * max(abs(a), abs(b)))
            if b - a > narrow:
                queue += [(a, p), (p, b)]
            elif all(
                abs(p - end) > 2 * narrow for end in ends
            ):  # the ends are as exact as this, and nothing else is
                return False, None
        return False, None

    def _takes(self, way, low: float, high: float) -> bool:
        """Whether all values of a piece are proved not to be passive, by what takes energy
        there."""
        covered = cover_of(self.loop, self.path)(
            way.witness(low, high),
            [[low], [high]],
            300,  # values of the number, at most
        )
        return covered is not None and not len(covered.open)

    def _frequency(self, p: float, sign: int) -> float:
        """The frequency that sets an end (rad/s): of a mode, or at which energy is taken out beyond
        it, in the direction of the sign."""
        nearest = min(self.modes, key=lambda end: abs(end - p), default=np.inf)
        if abs(p - nearest) <= 2 * abs(self._away(nearest, sign) - nearest):
            return self.modes[nearest]
        wide = self.span[1] - self.span[0]
        refuted = p + sign * GAP_OF_END * max(abs(p), GAP_OF_END * wide)
        beyond = float(np.clip(refuted, *self.span))
        drawn = self.loop.changed({self.path: beyond}).drawn()
        _, angle = min(way.deciding(beyond) for way in self.ways)
        return angle / float(np.real(drawn.period) * drawn.ticks)


def runs_of(passive, span, more) -> tuple[np.ndarray, np.ndarray]:
    """Low and high ends of runs of values that pass, refined all together by multisection. A 0 is
    looked at by itself.

    more: values that are tried first, in addition to TRIED_FIRST of them.
    """
    low, high = map(float, span)

    def passed(points):
        is_passive = np.zeros(points.size, bool)
        # A zero takes a branch out of the loop, and is asked about by itself.
        for alike in (np.flatnonzero(points == 0), np.flatnonzero(points != 0)):
            if alike.size:
                is_passive[alike] = passive(points[alike])
        return is_passive

    # evenly in the square root: the soft end matters most, and 0 belongs to the range
    points = np.union1d(low + (high - low) * np.linspace(0, 1, TRIED_FIRST) ** 2, more)
    good = passed(points)
    change = np.flatnonzero(good[1:] != good[:-1])
    before = points[change]
    after = points[change + 1]
    inside = np.where(good[change], before, after)
    outside = np.where(good[change], after, before)
    # Of the range, to which an end is refined.
    while change.size and np.abs(inside - outside).max() > 1e-10 * (high - low):
        away = (outside - inside)[:, None]
        between = inside[:, None] + away * np.arange(1, CUTS + 1) / (CUTS + 1)
        passed_between = passed(between.reshape(-1)).reshape(between.shape)
        count = np.where(passed_between.all(-1), CUTS, passed_between.argmin(-1))
        marks = np.concatenate([inside[:, None], between, outside[:, None]], axis=-1)
        inside = np.take_along_axis(marks, count[:, None], -1)[:, 0]
        outside = np.take_along_axis(marks, count[:, None] + 1, -1)[:, 0]
    rising = good[change + 1]
    lows = np.concatenate([points[:1][good[:1]], inside[rising]])
    highs = np.concatenate([inside[~rising], points[-1:][good[-1:]]])
    return lows, highs


def cover_of(loop: HeldLoop, path: str) -> Covering:
    """What covers boxes of a number of the loop, and of an angle; a box with a loop that has no
    solution has no cover."""
    resolution = Resolution(loop.drawing, loop.values, [Side(path)])

    def resolved(low, high):
        return not resolution.unresolved(np.array([[low], [high]])).any()

    def cover(functions, box, most):
        try:
            limits = loop.domain(path, (box[0][0], box[1][0]))
            return positive(functions, box, limits, resolved, most)
        except IllPosedLoopError:
            return None

    return cover


def largest_free(
    low: float, high: float, spans: Iterable[Sequence[float]]
) -> tuple[float, float] | None:
    """The largest part of an interval that some spans leave free; None if none does."""
    free = []
    at = low
    for a, b in sorted((float(a), float(b)) for a, b in spans):
        if a > at:
            free.append((at, min(a, high)))
        at = max(at, b)
    if at < high:
        free.append((at, high))
    parts = [(a, b) for a, b in free if a < b]
    return max(parts, key=lambda part: part[1] - part[0], default=None)
