"""Margins that hold for all numbers of [for_all]: searched for the worst numbers, then proved for
all of them.

A factor k of the signal is one more number of the loop, and a margin is a path of k that starts at
1, over its size p: gains `exp(p)` and `exp(-p)`, the phase `exp(j p)`, the disk `k = (1 + p exp(j
psi))/(1 - p exp(j psi))`. [for_all] proves that all loops along the path are stable, for all
numbers of the box; one with complex k is a real loop of twice the size. Where frames are
polynomials in k, a disk is proved on its rim alone, as the spectral radius of a frame that is
analytic in k has no peak inside. A delay is in whole frames, each of which is proved as a loop of
its own; if no loop of the box has a limit, all factors `|k| <= 1` are: an eigenvalue `|z| >= 1`
with n frames of delay is one with the factor `z^-n`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, product

import numpy as np

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.drawing import (
    GAIN,
    name_of,
    path_of,
)
from wavesweep.engine.expressions import Tree, parse
from wavesweep.engine.intervals import Resolution
from wavesweep.engine.intervals import Side as Expressed
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Side
from wavesweep.engine.switched import INWARD
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.margins.broken_loops import broken_at, with_block
from wavesweep.margins.lifted_margins import margins_of
from wavesweep.margins.loop_margins import LARGEST_GAIN_FACTOR, Margin, disk_margins
from wavesweep.program.analyses.claims import (
    SETTLED_WITHIN,
    STABLE,
    Claim,
    Property,
    Status,
    own_scope,
    ranges_of,
)
from wavesweep.program.analyses.factors_at_cut import comes_back_at_once, on_circle
from wavesweep.program.spec import Axis, Spec

TRIED_NEAR_REFUTED = 4e-3  # of a margin that is refuted, how far from it a proof is tried
MOST_FRAMES = 32  # of delay that are proved one by one
SIZE, ANGLE = "size at the cut", "angle at the cut"  # numbers of no spec
LOGARITHM = Side(path_of(GAIN), 0.0)
SIZE_AND_ANGLE = {"p": Tree.name(SIZE), "psi": Tree.name(ANGLE)}
# real and imaginary part of a factor, and the sides of a proof along it
TURNED = {
    "phase": (
        Tree("cos", (Tree.name(SIZE),)),
        Tree("sin", (Tree.name(SIZE),)),
        [Side(path_of(SIZE))],
    ),
    "disk": (
        *on_circle(*SIZE_AND_ANGLE.values(), 1.0),
        [Side(path_of(SIZE)), Side(path_of(ANGLE))],
    ),
    "delay_frames": (
        parse("p*cos(psi)").with_trees(SIZE_AND_ANGLE),
        parse("p*sin(psi)").with_trees(SIZE_AND_ANGLE),
        [Side(path_of(SIZE)), Side(path_of(ANGLE))],
    ),
}
RIM = np.linspace(np.pi / 64, np.pi, 64)  # angles of a disk at which worse numbers are looked for
ENDS = {
    "gain_up": np.log(LARGEST_GAIN_FACTOR),
    "gain_down": np.log(LARGEST_GAIN_FACTOR),
    "phase": np.pi,
    "delay_frames": np.inf,
    "disk": 1.0,
}


METHOD_FOR_ALL = (
    "gains, phase and disk proved along their factors of the signal by forms that decrease, over Taylor models of ticks, the "
    "delay frame by frame; refuted by the worst numbers found"
)


@dataclass(frozen=True, slots=True)
class BoxMargin:
    """A margin of all loops of a box.

    value: what is proved, NaN if nothing is. refuted: the least that a
    loop of the box was seen to have, NaN without; omega: its frequency, rad/s; counterexample: the
    numbers of that loop. settled: whether both are within SETTLED_WITHIN of each other. limited:
    whether there is a limit. doubt: why nothing is proved, a code.
    """

    name: str
    value: float
    refuted: float
    omega: float
    counterexample: str
    settled: bool
    limited: bool
    doubt: int = Doubt.NONE


def refused(spec: Spec) -> str:
    """Why there are no margins for all of the spec's [for_all], empty if there are. Errors:
    UsageError for too many numbers."""
    varying = spec.for_all.boxes.varying(spec)
    if varying == ["messages"]:
        refusal = "messages may be late or lost"
    else:
        refusal = f"{', '.join(varying)} of [for_all] may vary"
    said = "no margins for every case: they need numbers that are constant, and here"
    return f"{said} {refusal}" if varying else ""


def margins_for_all(spec: Spec, cut: str) -> tuple[list[BoxMargin], Claim]:
    """The gain, phase, delay and disk margins of the spec's loop, broken at a signal, for all
    numbers of its [for_all], and what is claimed of which loops."""
    scope_of_design = own_scope(spec)
    spec, cut = with_block(spec, cut)
    axes = spec.for_all.unknown
    boxes = spec.for_all.boxes
    listed = [axis for axis in axes if axis.choices]
    ranges = [axis for axis in axes if axis not in listed]
    paths = [axis.path for axis in listed]
    cases = []
    for values in product(*(axis.choices for axis in listed)):
        cases += _cases(spec, cut, ranges, dict(zip(paths, values, strict=True)))
    covered = []
    for case in cases:
        ends = dict(zip(case.ranged, case.box.T.tolist(), strict=True))
        covered.append((ends, case.fixed))
    scope = replace(scope_of_design, numbers=ranges_of([axis.path for axis in axes], covered))
    unstable = next(chain.from_iterable(case.unstable() for case in cases), None)
    if unstable is not None:
        text = boxes.numbers_in_words(unstable)
        refuted = [
            BoxMargin(name, np.nan, np.nan, np.nan, text, settled=True, limited=True)
            for name in cases[0].names
        ]
        return refuted, Claim(STABLE, scope, Status.REFUTED, text)
    rows = []
    for name in cases[0].names:
        margin = _for_all_cases([(case, *case.margin(name)) for case in cases], name)
        rows += _with_gain_and_phase(margin) if margin.name == "disk" else [margin]
    is_known = any(not np.isnan(margin.value) for margin in rows)
    status = Status.PROVED if is_known else Status.UNKNOWN
    return rows, Claim(Property("margins", "figures"), scope, status)


def _cases(spec, cut, ranges, fixed) -> Iterator["_Case"]:
    """Yield the case of a spec, or one for each part of a range in which dead times have the
    same whole ticks."""
    if fixed:
        spec = spec.with_values(fixed)
    drawing = spec.drawing or loop_drawing(dict(spec.values), tuple(axis.path for axis in ranges))
    drawing, values = Loops(drawing, spec.values).with_gain_at(cut)
    timed = next((axis for axis in ranges if name_of(axis.path) in drawing.timing), None)
    pieces = [((0.0, 0.0), {})]
    if timed:
        pieces = Loops(drawing, values).pieces(timed.path, (timed.start, timed.stop))
    for (low, high), whole_ticks in pieces:
        axes = []
        for axis in ranges:
            if axis.path in drawing.reads:
                axes.append(replace(axis, start=low, stop=high) if axis is timed else axis)
        yield _Case(spec, cut, Loops(drawing, {**values, **whole_ticks}), axes, fixed)


def _for_all_cases(proofs, name) -> BoxMargin:
    """The margin of all cases, from what is proved of each, and its worst loop."""
    proved = min(size for _, size, _, _ in proofs)
    case, _, point, worst = min(proofs, key=lambda proof: size_of(proof[-1]))
    least = size_of(worst)
    within_range = bool(np.isfinite(least) and least < ENDS[name])
    settled = bool(proved >= (1 - SETTLED_WITHIN) * min(least, ENDS[name]))
    refuted = np.nan
    omega = np.nan
    counterexample = ""
    if within_range:
        refuted = worst.value
        omega = worst.omega
        counterexample = case.boxes.numbers_in_words(case.named(point))
    doubt = max(margin.doubt for *_, margin in proofs)
    value = np.nan
    if proved > 0:
        value = _value(name, proved)
    elif not doubt:
        doubt = Doubt.SEARCH
    limited = within_range or not settled
    return BoxMargin(name, value, refuted, omega, counterexample, settled, limited, doubt)


def size_of(margin: Margin) -> float:
    """How far a margin lets a signal go, see above; a delay in frames. Infinite without a limit."""
    if not margin.limited or margin.doubt:
        return np.inf
    match margin.name:
        case "phase":
            return np.radians(margin.value)
        case "delay_frames":
            return margin.value
        case "disk":
            return margin.value / 2
    return abs(np.log(margin.value))


def _factors(name, size):
    """Factors of a margin that lets a signal go so far; of a disk those of its rim, and of a delay
    one with which no loop is stable."""
    match name:
        case "gain_up":
            return [np.exp(size)]
        case "gain_down":
            return [np.exp(-size)]
        case "phase":
            return [np.exp(1j * min(size, np.pi))]  # half a turn is every phase, if none is too far
        case "disk":
            turned = min(size, 1.0) * np.exp(1j * RIM)
            return (1 + turned) / (1 - turned)
    return [np.inf]


def _value(name, size):
    """The value of a margin that lets a signal go so far, the inverse of `size_of`; of one without
    a limit 0 for `gain_down`, and LARGEST_GAIN_FACTOR for `gain_up` and for a delay in frames."""
    match name:
        case "delay_frames":
            return min(size, LARGEST_GAIN_FACTOR)
        case "gain_up":
            return float(np.exp(size))
        case "gain_down":
            if size < ENDS[name]:
                return float(np.exp(-size))
            return 0.0
        case "phase":
            return float(np.degrees(size))
    return float(2 * size)


def _with_gain_and_phase(disk: BoxMargin) -> Iterator[BoxMargin]:
    """The disk margin with its gain and its phase."""
    of_proved = disk_margins(disk.value, disk.omega, 0.0, Doubt.NONE)
    of_refuted = disk_margins(disk.refuted, disk.omega, 0.0, Doubt.NONE)
    for proved, refuted in zip(of_proved, of_refuted, strict=True):
        value = np.nan if np.isnan(disk.value) else proved.value
        refuted_value = refuted.value if refuted.limited else np.nan
        limited = proved.limited or np.isfinite(refuted.omega)
        yield replace(disk, name=proved.name, value=value, refuted=refuted_value, limited=limited)


class _Case:
    """Loops broken at a signal, whose numbers have ranges.

    loop: with a gain at the signal. fixed: the values of the others among those that are listed.
    """

    def __init__(
        self, spec: Spec, cut: str, loop: Loops, ranges: Sequence[Axis], fixed: Mapping[str, object]
    ):
        self.spec = spec
        self.cut = cut
        self.fixed = fixed
        self.boxes = spec.for_all.boxes
        self.ranged = [axis.path for axis in ranges]
        self.broken = {}
        self.known = {}
        self.box = np.array([(axis.start, axis.stop) for axis in ranges], float).reshape(-1, 2).T
        self.loop = loop.read
        once = broken_at(self.spec, cut).cut
        self.names = [name for name in ENDS if name != "delay_frames" or once]

    def named(self, point) -> dict[str, object]:
        """The numbers of a point of the box."""
        return {**self.fixed, **dict(zip(self.ranged, point, strict=True))}

    def _broken(self, point):
        """The loop of a point of the box, broken at the signal."""
        if point not in self.broken:
            self.broken[point] = broken_at(self.spec.with_values(self.named(point)), self.cut)
        return self.broken[point]

    def _exceeds(self, point, factors) -> bool:
        """Whether a loop of the box is not stable with one of some factors, in doubles: a search for
        the worst numbers asks for the margins of those alone."""
        return bool((self._broken(point).growth(np.asarray(factors) + 0j) >= 0).any())

    def _at(self, point) -> dict[str, Margin] | None:
        """The margins of a loop of the box; None if it is not stable."""
        if point not in self.known:
            margins, doubt = margins_of(self._broken(point))
            by_name = {margin.name: margin for margin in margins}
            self.known[point] = by_name if margins or doubt else None
        return self.known[point]

    @cached_property
    def _corners(self):
        """The corners of the box, its middle, and where expressions are least or largest."""
        extremes = Resolution(*self.loop, list(map(Expressed, self.ranged))).extremes(self.box)
        points = [
            *product(*self.box.T.tolist()),
            tuple(self.box.mean(0).tolist()),
            *map(tuple, extremes.tolist()),
        ]
        return points if self.ranged else [()]

    def unstable(self) -> Iterator[dict[str, object]]:
        """Yield the numbers with which a loop at a corner or in the middle of the box is not
        stable."""
        for point in self._corners:
            if self._exceeds(point, [1.0]) and self._at(point) is None:
                yield self.named(point)

    def margin(self, name: str) -> tuple[float, tuple[float, ...], Margin]:
        """The size of a margin that is proved for the whole box, 0 for none, and the worst loop
        found, with its margin."""
        point, worst = self._worst(name, [])
        if not self.ranged:
            return (0.0 if worst.doubt else size_of(worst)), point, worst
        if worst.doubt:
            return 0.0, point, worst
        shares, proved = [1.0, 0.97, 0.9, 0.7], 0.0  # shares of a margin, tried in turn
        for _ in range(6):  # rounds of search and proof
            size = min(size_of(worst), ENDS[name])
            aim = size
            if name != "delay_frames":
                whole = size == ENDS[name] and name != "disk"
                aim *= shares[0] * (1.0 if whole else 1 - TRIED_NEAR_REFUTED)
            proved, met = self._proved(name, aim)
            point, worst = self._worst(name, met)
            if size_of(worst) >= size:
                # Of other margins than the disk a proof that does not begin has the same begin.
                if proved > 0 or name != "disk" or not shares[1:]:
                    break
                shares.pop(0)
        return proved, point, worst

    def _worst(self, name, met):
        """The point with the least margin that a search finds, and this margin; one in doubt if
        there is one."""

        def size(point):
            margins = self._at(point)
            margin = margins and margins.get(name)
            if margin is None or margin.doubt:
                return -np.inf
            return size_of(margin)

        def worse(best, points):
            """The worst of some points that is worse than the best one."""
            for point in points:
                least = size(best)
                if np.isneginf(least):
                    break
                if point in self.known or self._exceeds(point, _factors(name, least)):
                    best = min(best, point, key=size)
            return best

        best = worse(self._corners[0], [*self.known, *self._corners, *met])
        halvings = 6 if self.ranged else 0  # of the steps of the search for the worst numbers
        for halving in range(halvings):
            steps = np.diag(self.box[1] - self.box[0]) * 0.5 ** (halving + 1)
            near = np.clip(best + np.concatenate([steps, -steps]), *self.box)
            best = worse(best, map(tuple, near.tolist()))
        margins = self._at(best) or {}
        return best, margins.get(name, Margin(name, np.nan, np.nan, np.nan, Doubt.SEARCH))

    def _proved(self, name, size) -> tuple[float, list[tuple[float, ...]]]:
        """The size of a margin, up to this one, that is proved, and points next to which it may
        be smaller."""
        if name == "delay_frames" and np.isfinite(size):
            return self._late(size)
        # any delay is of the factors p e^(i psi), p <= 1
        stable = self._stable(name, min(size, ENDS["disk"]) if name == "delay_frames" else size)
        proved = abs(stable.end)
        if name == "disk" and self._delayed and not stable.whole:
            proved = 0.0
        if name == "delay_frames":
            proved = size if stable.whole else 0.0
        if proved < ENDS[name]:
            proved *= 1 - INWARD
        return proved, [] if stable.met is None else [stable.met[-len(self.ranged) :]]

    @cached_property
    def _delayed(self):
        """Whether the rim of a disk is enough."""
        varied = dict(zip(self.ranged, self.box.T.tolist(), strict=True))
        return not comes_back_at_once(Loops(*self.loop), varied)

    def _stable(self, name, size):
        """What is proved of the factors of a margin up to a size, see above, for the whole box."""
        rest = self.ranged, self.box, name != "gain_down"
        if name in TURNED:
            re, im, sides = TURNED[name]
            loops = Loops(*self.loop).with_complex_factor(re, im)
            ends = np.array([[0.0, 0.0], [size, np.pi]])[:, : len(sides)]
            ends[0, 0] = size if name != "phase" and self._delayed else 0.0
            return self.boxes.proved_stable(loops, sides, ends, *rest)
        if name == "gain_up":
            ends = np.array([[0.0], [size]])
        else:
            ends = np.array([[-size], [0.0]])
        return self.boxes.proved_stable(Loops(*self.loop), [LOGARITHM], ends, *rest)

    def _late(self, size) -> tuple[float, list[tuple[float, ...]]]:
        """What is proved of delays of fewer whole frames than `size`, see `_proved`: that many, if
        all are."""
        for frames in range(min(int(np.ceil(size)), MOST_FRAMES)):
            loops = Loops(*self.loop).later_at_gain(frames)
            none = np.zeros((2, 0))
            stable = self.boxes.proved_stable(loops, [], none, self.ranged, self.box, up=True)
            if not stable.whole:
                return float(frames), [stable.met]
        return min(size, float(MOST_FRAMES)), []
