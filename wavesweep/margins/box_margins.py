"""Margins that hold for all numbers of [for_all]: searched for the worst numbers, then proved for
all of them.

A factor k of the signal is one more number of the loop, and a margin is a path of k that starts at
1, over its size p: gains `exp(p)` and `exp(-p)`, the phase `exp(j p)`, the disk `k = (1 + p exp(j
psi))/(1 - p exp(j psi))`. [for_all] proves that all loops along the path are stable, for all
numbers of the box; one with complex k is a real loop of twice the size. Where frames are
polynomials in k, a disk is proved on its rim alone, as the spectral radius of a frame that is
analytic in k has no peak inside. Delays are no factors of a frame: they are checked with bounds
that are sampled, see `Arc`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain, product

import numpy as np

from wavesweep.engine.blocks import timing
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.drawing import GAIN, TWIN, name_of, path_of, with_complex_factor
from wavesweep.engine.expressions import parse, with_trees
from wavesweep.engine.frames import Frames, balance, inverse, on_circle
from wavesweep.engine.intervals import Cover, FunctionValues, Resolution, any_positive
from wavesweep.engine.intervals import Side as Expressed
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Side
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.margins.broken_loops import broken_at, with_block
from wavesweep.margins.lifted_margins import margins_of
from wavesweep.margins.loop_margins import LARGEST_GAIN_FACTOR, BrokenLoop, Margin, disk_margins
from wavesweep.program.analyses.claims import (
    STABLE,
    Claim,
    Property,
    Status,
    own_scope,
    ranges_of,
)
from wavesweep.program.spec import Axis, Spec

TRIED_NEAR_REFUTED = 4e-3  # of a margin that is refuted, how far from it a proof is tried
SETTLED_WITHIN = 1e-2  # of a margin, how far proof and refutation may be apart
STEP_HALVINGS = 6  # of the steps of the search for the worst numbers
SHARES = 1.0, 0.97, 0.9, 0.7  # of a margin, tried in turn
FRAMES = 200_000  # that the check of a delay may take
PROOF_ROUNDS = 6  # of search and proof
SWEEPS = 12  # of balancing
ENTRY_ROUNDINGS = 16.0  # errors of the entries of a frame, in roundings of their sizes
INWARD = 1e-12  # of a size that is proved, for the rounding of its factor
SIZE, ANGLE = "size at the cut", "angle at the cut"  # numbers of no spec
LOGARITHM = Side(path_of(GAIN), 0.0)
DISK = tuple(
    with_trees(parse(text), {"p": ("name", SIZE, 0), "psi": ("name", ANGLE, 0)})
    for text in ("(1 - p*p)/(1 - 2*p*cos(psi) + p*p)", "2*p*sin(psi)/(1 - 2*p*cos(psi) + p*p)")
)
# real and imaginary part of a factor, and the sides of a proof along it
TURNED = {
    "phase": (("cos", ("name", SIZE, 0), 0), ("sin", ("name", SIZE, 0), 0), [Side(path_of(SIZE))]),
    "disk": (*DISK, [Side(path_of(SIZE)), Side(path_of(ANGLE))]),
}
OTHER_GAINS = np.array([0.5, 2.0])  # of the cut, between which what drifts is looked for
ENDS = {
    "gain_up": np.log(LARGEST_GAIN_FACTOR),
    "gain_down": np.log(LARGEST_GAIN_FACTOR),
    "phase": np.pi,
    "delay_frames": np.inf,
    "disk": 1.0,
}


METHOD_FOR_ALL = (
    "gains, phase and disk proved along their factors of the signal by forms that decrease, over Taylor models of ticks; "
    "the delay checked: functions of L beside its arc, interpolated over all numbers with sampled bounds, positive by "
    "Bernstein coefficients; refuted by the worst numbers found"
)


@dataclass(frozen=True, slots=True)
class BoxMargin:
    """A margin of all loops of a box.

    value: what is proved, of a delay what is checked, NaN if nothing is. refuted: the least that a
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
    refusal = (
        "messages may be late or lost"
        if varying == ["messages"]
        else f"{', '.join(varying)} of [for_all] may vary"
    )
    return f"margins for all need constant numbers, and {refusal}" if varying else ""


def margins_for_all(spec: Spec, cut: str) -> tuple[list[BoxMargin], Claim]:
    """The gain, phase, delay and disk margins of the spec's loop, broken at a signal, for all
    numbers of its [for_all], and what is claimed of which loops."""
    own = own_scope(spec)
    spec, cut = with_block(spec, cut)
    axes, boxes = spec.for_all.unknown, spec.for_all.boxes
    listed = [axis for axis in axes if axis.values or axis.structural]
    ranges = [axis for axis in axes if axis not in listed]
    paths = [axis.path for axis in listed]
    cases = []
    for values in product(*map(boxes.values_of_range, listed)):
        cases += _cases(spec, cut, ranges, dict(zip(paths, values, strict=True)))
    covered = [
        (dict(zip(case.ranged, case.box.T.tolist(), strict=True)), case.fixed) for case in cases
    ]
    scope = replace(own, numbers=ranges_of([axis.path for axis in axes], covered))
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
    known = any(not np.isnan(margin.value) for margin in rows)
    status = Status.PROVED if known else Status.UNKNOWN
    checked = "the delay margin checked" if "delay_frames" in cases[0].names else ""
    return rows, Claim(Property("margins", "figures"), scope, status, checked)


def _cases(spec, cut, ranges, fixed) -> Iterator["_Case"]:
    """Yield the case of a spec, or one for each part of a range in which dead times have the
    same whole ticks."""
    if fixed:
        spec = spec.with_values(fixed)
    drawing = spec.drawing or loop_drawing(dict(spec.values), tuple(axis.path for axis in ranges))
    drawing, values = Loops(drawing, spec.values).with_gain_at(cut)
    timed = next((axis for axis in ranges if name_of(axis.path) in timing(drawing)), None)
    pieces = [((0.0, 0.0), {})]
    if timed:
        pieces = Loops(drawing, values).pieces(timed.path, (timed.start, timed.stop))
    for (low, high), whole_ticks in pieces:
        axes = []
        for axis in ranges:
            if axis.path in drawing.reads:
                axes.append(replace(axis, start=low, stop=high) if axis is timed else axis)
        yield _Case(spec, cut, Loops(drawing, {**values, **whole_ticks}), axes, fixed)


def _for_all_cases(found, name) -> BoxMargin:
    """The margin of all cases, from what is proved of each, and its worst loop."""
    proved = min(size for _, size, _, _ in found)
    case, _, point, worst = min(found, key=lambda each: size_of(each[-1]))
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
    doubt = max(margin.doubt for *_, margin in found)
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


def _value(name, size):
    match name:
        case "delay_frames":
            return min(size, LARGEST_GAIN_FACTOR)
        case "gain_up":
            return float(np.exp(size))
        case "gain_down":
            return float(np.exp(-size)) if size < ENDS[name] else 0.0
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
        self.spec, self.cut, self.fixed = spec, cut, fixed
        self.boxes = spec.for_all.boxes
        self.ranged, self.known = [axis.path for axis in ranges], {}
        self.box = np.array(
            [[axis.start for axis in ranges], [axis.stop for axis in ranges]], float
        )
        self.loop = loop.read
        broken = broken_at(self.spec, cut)
        self.names = [
            name for name in ENDS if name != "delay_frames" or isinstance(broken, BrokenLoop)
        ]
        self.rated = any(name_of(path) in loop.drawing.rating for path in self.ranged)
        if not ranges:
            return
        paths = [path_of(GAIN), *self.ranged]
        limits = [
            self.loop.domain(path, tuple(ends))
            for path, ends in zip(self.ranged, self.box.T, strict=True)
        ]
        self.limits = np.array(limits).T
        drift = self.boxes.drift_over(self.loop, paths, np.column_stack([OTHER_GAINS, self.box]))
        self.frames_at = partial(self.boxes.frames_over, self.loop, paths, drift)

    def named(self, point) -> dict[str, object]:
        """The numbers of a point of the box."""
        return {**self.fixed, **dict(zip(self.ranged, point, strict=True))}

    def _at(self, point) -> dict[str, Margin] | None:
        """The margins of a loop of the box; None if it is not stable."""
        if point not in self.known:
            margins, doubt = margins_of(
                broken_at(self.spec.with_values(self.named(point)), self.cut)
            )
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
        return (self.named(point) for point in self._corners if self._at(point) is None)

    def margin(self, name: str) -> tuple[float, tuple[float, ...], Margin]:
        """The size of a margin that is proved for the whole box, 0 for none, and the worst loop
        found, with its margin."""
        point, worst = self._worst(name, [])
        if not self.ranged:
            return (0.0 if worst.doubt else size_of(worst)), point, worst
        if worst.doubt or (name == "delay_frames" and self.rated):
            return 0.0, point, worst
        shares, proved = [*SHARES], 0.0
        for _ in range(PROOF_ROUNDS):
            size = min(size_of(worst), ENDS[name])
            end = 1.0 if size == ENDS[name] and name != "disk" else 1 - TRIED_NEAR_REFUTED
            proved, met = self._proved(name, shares[0] * end * size)
            point, worst = self._worst(name, met)
            if size_of(worst) >= size:
                if proved > 0 or not shares[1:]:
                    break
                shares.pop(0)
        return proved, point, worst

    def _worst(self, name, met):
        """The point with the least margin that a search finds, and this margin; one in doubt if
        there is one."""

        def size(point):
            margins = self._at(point)
            margin = margins and margins.get(name)
            return -np.inf if margin is None or margin.doubt else size_of(margin)

        best = min([*self._corners, *met, *self.known], key=size)
        for halving in range(1, 1 + STEP_HALVINGS if self.ranged else 1):
            steps = np.diag(self.box[1] - self.box[0]) * 0.5**halving
            near = np.clip(best + np.concatenate([steps, -steps]), *self.box)
            best = min([best, *map(tuple, near.tolist())], key=size)
        margins = self._at(best) or {}
        return best, margins.get(name, Margin(name, np.nan, np.nan, np.nan, Doubt.SEARCH))

    def _proved(self, name, size) -> tuple[float, list[tuple[float, ...]]]:
        """The size of a margin, up to this one, that is proved, and points next to which it may
        be smaller."""
        if name == "delay_frames":
            covered = self._delay(size)
            met = np.concatenate([covered.unstable[:, 1:], covered.open[-1:, :, 1:].mean(1)])
            return (0.0 if len(covered.open) else size), [tuple(pair) for pair in met.tolist()]
        found = self._stable(name, size)
        proved = abs(found.end)
        if name == "disk" and self._delayed and not found.whole:
            proved = 0.0
        if proved < ENDS[name]:
            proved *= 1 - INWARD
        return proved, [] if found.met is None else [found.met[-len(self.ranged) :]]

    @cached_property
    def _delayed(self):
        """Whether the signal comes back in no tick at once, so that frames have no poles in its
        factor and the rim is enough.

        What depends on the factor anywhere does so at a place that nobody has chosen.
        """
        place = self.box[0] + (self.box[1] - self.box[0]) * (
            np.sqrt(np.arange(2, 2 + len(self.ranged))) % 1
        )
        pivots = self.closed(OTHER_GAINS, np.array([place, place])).pivots
        return bool((pivots[0] == pivots[1]).all())

    def _stable(self, name, size):
        """What is proved of the factors of a margin up to a size, see above, for the whole box."""
        rest = self.ranged, self.box, name != "gain_down"
        if name in TURNED:
            re, im, sides = TURNED[name]
            drawing = with_complex_factor(self.loop.drawing, re, im)
            built = {path: self.loop.values[path.replace(TWIN, "")] for path in drawing.building}
            ends = np.array([[0.0, 0.0], [size, np.pi]])[:, : len(sides)]
            ends[0, 0] = size if name == "disk" and self._delayed else 0.0
            return self.boxes.proved_stable(
                Loops(drawing, {**self.loop.values, **built}), sides, ends, *rest
            )
        ends = np.array([[0.0], [size]]) if name == "gain_up" else np.array([[-size], [0.0]])
        return self.boxes.proved_stable(Loops(*self.loop), [LOGARITHM], ends, *rest)

    def _delay(self, frames) -> Cover:
        """The check that so many frames of delay, and fewer, leave the loop stable."""
        half = min(
            np.pi / frames, np.pi
        )  # the angle up to which the arc is less than half a circle
        edge = min(2 * np.pi / frames, np.pi)  # and a whole one
        stretches = [(edge, np.pi, ("below",))]
        if half < edge:
            stretches.append((half, edge, ("below", "above", "beyond")))
        if half > 0:
            stretches.append((0.0, half, ("below", "above", "past", "before")))
        for low, high, ways in stretches:
            arcs = [Arc(self.closed, frames, arc_way) for arc_way in ways]
            box = np.column_stack([[low, high], self.box])
            limits = np.column_stack([[-np.inf, np.inf], self.limits])
            resolution = Resolution(*self.loop, [Expressed(), *map(Expressed, self.ranged)])
            covered = any_positive(arcs, box, limits, FRAMES, resolution)
            if len(covered.open):
                break
        return covered

    def closed(self, k, x) -> Frames:
        """The frames of loops with the numbers x, `(n, numbers)`, and factors k of the signal,
        `(n,)`."""
        return self.frames_at(np.column_stack([k, x]))


def _units(frames):
    return balance(np.abs(frames.E), SWEEPS)[1][0]


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """Functions of angle (rad per frame) and numbers that are positive where L stays away from an
    arc: see `Functions`.

    With s frames of delay the loop has an eigenvalue on the unit circle where `-L = exp(j s
    theta)`. For all s from 0 to `frames` this is an arc of the unit circle from 1 on. No value of
    -L on the arc lies inside of the circle ("below"), outside of it ("above"), beyond the arc's
    chord ("beyond") or, if the arc is less than half a circle, on the other side of the line
    through 0 and its end ("past") or its begin ("before"). If one of these holds at every angle,
    and L is inside of the circle at pi, no delay up to `frames` moves an eigenvalue across the
    circle. At angles whose arc is a whole circle "below" has to hold. With `det(z - A) = D` without
    the signal and `D + N` with it, L is N/D.
    """

    WAYS = "below", "above"
    closed: Callable[[np.ndarray, np.ndarray], Frames]
    frames: float
    way: str

    def units(self, middle) -> np.ndarray:
        """The units in which the states have similar sizes, `(n,)`."""
        return _units(self.closed(np.ones(1), middle[None, 1:]))

    def values(self, x, units):
        """Phase, logarithm, error and pivots at points `(n, 1 + numbers)`."""
        closed = self.closed(np.repeat([0.0, 1.0], len(x)), np.concatenate([x[:, 1:]] * 2))
        E = (closed.E * (units / units[:, None])).reshape(2, 1, len(x), units.size, units.size)
        w = on_circle(np.stack([x[:, 0], -x[:, 0]]))[..., None, None] * np.eye(units.size)
        phase, log = np.linalg.slogdet(w - E)
        # to first order, the relative change of a determinant is the trace of the inverse times the
        # change of the matrix
        change = ENTRY_ROUNDINGS * (np.abs(E) + np.abs(w))
        relative = (np.abs(inverse(w - E).mT) * change).sum((-1, -2))
        pivots = closed.pivots.reshape(2, len(x), -1)
        scale = log.max((0, 1))
        determinants = phase * pivots[:, None, :, 0] * np.exp(log - scale)
        errors = np.abs(determinants) * relative
        # each at the angle and its negative, whose product is that with the conjugate
        D = determinants[0]
        N = determinants[1] - determinants[0]
        dD = errors[0]
        dN = errors[1] + errors[0]
        size_of_D = D[0] * D[1]
        error_of_D = (dD * np.abs(D[::-1])).sum(0)
        if self.way in self.WAYS:
            size_of_N = N[0] * N[1]
            error_of_N = (dN * np.abs(N[::-1])).sum(0)
            sign = 1 if self.way == "below" else -1
            value = (size_of_D - size_of_N) * sign
            error = error_of_D + error_of_N
        else:
            level, angle = self._line(self.frames * x[:, 0])
            turn = np.exp(np.multiply.outer([-1j, 1j], angle)) / 2
            value = level * size_of_D + (N * D[::-1] * turn).sum(0)
            error_across = np.abs(turn) * (dN * np.abs(D[::-1]) + np.abs(N) * dD[::-1])
            error = np.abs(level) * error_of_D + error_across.sum(0)
        size = np.abs(value)
        return FunctionValues(
            (value / size)[None],
            (np.log(size) + 2 * scale)[None],
            (error / size)[None],
            pivots.prod(0),
        )

    def _line(self, end):
        """The line that values of -L do not reach, by its level and its angle; end: the angle of
        the arc's end."""
        if self.way == "beyond":
            return np.cos(end / 2), end / 2
        if self.way == "past":
            return 0.0, end - np.pi / 2
        return 0.0, np.full_like(end, np.pi / 2)
