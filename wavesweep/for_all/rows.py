"""Intervals that hold for all numbers of [for_all]: what is proved, and the nearest values
beyond that are refuted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from textwrap import shorten
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.drawing import SHARES, faults, name_of, path_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.intervals import SHARE_OF_SPAN, Intervals, blank_records
from wavesweep.engine.loop import Loops
from wavesweep.engine.switched import (
    SOON,
    Bracket,
    LeftOpen,
    Verdict,
    brackets_on_average,
    grows_everywhere,
    parts_that_decay,
)
from wavesweep.for_all.at_cut import RMS, of_required
from wavesweep.for_all.at_rest import least_felt
from wavesweep.for_all.claimed import scope_of
from wavesweep.for_all.frame_families import DELAY, RATIO, refuse
from wavesweep.for_all.members import claims_hold, nowhere
from wavesweep.for_all.random_ports import RandomPorts
from wavesweep.for_all.unknown import PROVED_FROM_ZERO, Case, Part, proofs, searched
from wavesweep.for_all.varying import (
    GROW,
    Rules,
    bracketed_over,
    decided_along,
    decided_over,
    placed,
    told,
)
from wavesweep.program.analyses.claims import (
    MEAN_SQUARE,
    SETTLED_WITHIN,
    Claim,
    Property,
    Scope,
    Status,
    required_by,
)
from wavesweep.program.analyses.interval_jobs import PROVED_RECORD, Guarantee
from wavesweep.program.number_words import (
    in_all_digits,
    rounded_down,
    span_around,
    span_in_words,
)
from wavesweep.program.row_kinds import LEFT_OPEN, TEXT
from wavesweep.program.spec import Spec
from wavesweep.program.spec.studies import K_VE_SPAN
from wavesweep.program.sweep.grid import loops_of, own_loop
from wavesweep.program.tables.refuters import Refuters, in_a_sentence

MOST_CASES = 256  # combinations of numbers that have values in place of a range
MOST_UNKNOWN = 5  # ranges
TRIED_NEAR_REFUTED = 4e-3  # of an end that is refuted, how far from it a proof is tried
# words in the column `guarantee` of rows that hold for more than the spec's own numbers
GUARANTEES = ("for_all", "mean_square")
# operations of a proof over ranges beside what varies, of each design that is looked at
QUICK = 3e10
END_EXACTNESS = 1e-8  # of an end that a root mean square sets, see `require.at_random`
FROM_ABOUT_ZERO = 0.01  # of the high end, from which on such a proof counts as one from about 0 on
BEGINS = 0.9  # of FROM_ABOUT_ZERO, down to which such a proof goes
CONTRADICTED = "the proof and a constant rate contradict each other: please report it"
REQUIRED = (
    "; of margins the factor of the signal at the cut is one of these numbers, and frames are divided by the radius that modes "
    "have to be within"
)

RANDOM_RMS = "; a root mean square by the linear equation of second moments under noise, with bounds, on panels of the number"


@dataclass(frozen=True, slots=True)
class ForAllGuarantee(Guarantee):
    """The numbers of [for_all], as `IntervalQuery.guarantee`."""

    rules: Rules
    status = Status.PROVED

    @property
    def kind(self) -> str:
        """The word of its rows in the column `guarantee`."""
        return GUARANTEES[self.rules.at_random]

    @property
    def own_ticks(self) -> bool:  # type: ignore[override]
        """Whether noise is new in the ticks of the spec."""
        return bool(self.rules.at_random and self.rules.require)

    @property
    def what(self) -> Property:
        """What its rows say of their loops."""
        if self.rules.at_random and not self.rules.require:
            return MEAN_SQUARE
        return required_by(self.rules.require, drawn=bool(self.rules.drawing))

    def scope(self, spec: Spec) -> Scope:
        """The loops that its rows are of."""
        return scope_of(spec, self.rules, own_cases(self.rules, spec))

    @property
    def method(self) -> str:
        """How the intervals are found, in a line."""
        if self.rules.at_random:
            return (
                "quadratic forms at the nodes of the chain of losses or of frames, which decay on average, proved by Cholesky "
                "with bounds on rounding; refuted by an eigenvalue of the second moments outside the unit circle"
                f"{RANDOM_RMS if self.rules.require else ''}"
            )
        if self.rules.vary:
            return (
                "quadratic norms on a graph of frames, or of messages, in which all shrink, or those of a small gain of messages "
                "that are not in time, in every part of the box of all numbers, proved by Cholesky with bounds on all errors; "
                "refuted by numbers and a pattern of frames, or of messages, that grows"
            )
        return (
            "a quadratic form in every cell of the box of all numbers, a polynomial of these, which decreases: the frame is "
            "enclosed as a Taylor model, and the form proved by Cholesky with bounds on all errors; refuted by the exact "
            "intervals of the worst numbers found"
            f"{REQUIRED if self.rules.require else ''}"
        )

    def records_of(self, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
        """The intervals of one loop."""
        return intervals_for_all(self.rules, loop, along, span)

    def felt(self, loop: Loops, along: str, values: np.ndarray) -> np.ndarray:
        """The least of all loops of the rules."""
        return felt_for_all(self.rules, loop, along, values)


def _unsuitable_ranges(spec, along):
    """Yield what is expected of the numbers of [for_all] and what is found, for all that intervals
    along a number cannot be held for."""
    for_all = spec.for_all
    drawing, _ = own_loop(spec, along)
    ranges = [axis for axis in for_all.unknown if not axis.choices]
    listed = [axis for axis in for_all.unknown if axis.choices]
    read = _read_by_probabilities(drawing)
    chance = [axis.name for axis in ranges if {axis.path, along} & read]
    if chance:
        expected = "values of numbers, where probabilities of messages are read from one"
        yield expected, f"the range of {', '.join(chance)}"
    swept = [axis.name for axis in for_all.axes if axis.path == along]
    if swept:
        yield "another number than that of the intervals", ", ".join(swept)
    if len(ranges) > MOST_UNKNOWN:
        yield f"at most {MOST_UNKNOWN} ranges", f"{len(ranges)}"
    timed = [axis.name for axis in for_all.unknown if name_of(axis.path) in drawing.timing]
    if name_of(along) not in drawing.timing:
        timed = [axis.name for axis in ranges if axis.name in timed]
    elif timed:
        timed.append(along)
    if len(timed) > 1:
        expected = "one number that dead times follow from, and no list of another along it"
        yield expected, ", ".join(timed)
    in_parts = [axis.name for axis in ranges if axis.structural]
    if in_parts:
        expected = "a list of values, values = [...], of a number that decides how the loop is built and need not be whole"
        yield expected, f"the range of {', '.join(in_parts)}"
    cases = np.prod([len(axis.choices) for axis in listed], initial=1.0)
    if cases > MOST_CASES:
        expected = f"at most {MOST_CASES} combinations of values; list fewer, values = [...]"
        yield expected, f"{cases:g}"


def refuse_unsuitable_ranges(spec: Spec, along: str, *, cut: bool = True) -> None:
    """Raise UsageError for numbers that intervals along a number cannot be held for; along: empty
    for a design alone.

    cut: whether frames are cut open at the number.
    """
    rules = Rules.of(spec)
    fault = next(_unsuitable_ranges(spec, along), None)
    if fault:
        raise UsageError(f"[for_all]: expected {fault[0]}, found {fault[1]}")
    if rules.vary and cut:
        with placed(spec):
            for rule in filter(None, (rules, rules.on_average())):
                rule.family(spec.values, along)


def _read_by_probabilities(drawing) -> set[str]:
    """The numbers from which the probabilities of messages follow."""
    trees = (tree for block in drawing.channels for key, tree in block.keys if key in SHARES)
    return {path_of(name) for tree in trees for name in tree.names}


def intervals_for_all(
    rules: Rules, loop: Loops, along: str, span: tuple[float, float]
) -> np.ndarray:
    """Intervals of a loop for all numbers of [for_all] along the number `along` within span =
    (low, high), as records."""
    loop = _Loop(rules, along, span, loop)
    beside_ranges = any(case.ranges for case in loop.cases)
    if rules.vary and beside_ranges and not rules.at_random and (why := loop.nowhere()):
        # What constant members refute everywhere needs no proof beside it.
        return recorded([], loop.certified, agreed=True, none=True, why=why)
    rows = loop.varying() if rules.vary else loop.intervals()
    agreed = claims_hold(rules, loop.cases, rows)
    why = ""
    if rules.at_random:
        none = not rows and (loop.too_loud or loop.grows_everywhere())
        why = GROW if none else ""
        if loop.too_loud:
            why = loud(rms_of(rules.require).at_most)
    elif rules.vary:
        why = "" if rows else loop.nowhere()
        none = bool(why)
    else:
        none = not rows and not searched(loop.cases, span)  # some member is unstable at every value
        if none:
            why = loop.nowhere()
    records = recorded(rows, loop.certified, agreed=agreed, none=none, why=why)
    if rules.at_random and rules.require:  # a root mean square on panels, with sampled rims
        records["argument"] = Intervals.SAMPLED
    return records


@dataclass(frozen=True, slots=True)
class Row:
    """What is proved, and the part of the span that nothing refutes, with the texts of its ends and
    of what is open."""

    low: float
    high: float
    part: Part
    span: tuple[float, float]
    text: str
    left_open: str = ""

    @property
    def settled(self) -> bool:
        """Whether proof and refutation, or the ends of proof and span, are near to each other: the
        column `settled`."""
        part = self.part
        low_edge = part.low if part.low_by is not None else self.span[0]
        high_edge = part.high if part.high_by is not None else self.span[1]
        if low_edge == 0 and part.low_by is None:
            low_is_near = self.low <= (1 + SETTLED_WITHIN) * PROVED_FROM_ZERO * part.high
        else:
            low_is_near = is_near(self.low, low_edge)
        return low_is_near and is_near(self.high, high_edge)


def cases_of(rules: Rules, along: str, span: tuple[float, float], loop: Loops) -> list[Case]:
    """Return a case for each combination of the numbers of [for_all] that have values, with the
    ranges of the others, and for each margin that is required.

    A range of a number that dead times follow from is in pieces, in each of which these have the
    same whole ticks.
    """
    if name_of(along) not in loop.drawing.timing:
        loop = loop.unbuilt  # each case has the whole ticks of its own dead times
    drawing, values = loop
    unknown = [
        axis for axis in rules.for_all.unknown if axis.path in drawing.reads or axis.path in values
    ]
    listed = [axis for axis in unknown if axis.choices]
    ranges = [axis for axis in unknown if axis not in listed]
    gains = [axis.path for axis in ranges]  # that are drawn even where the spec's own number is 0
    cases = []
    for combination in product(*(axis.choices for axis in listed)):
        fixed = dict(zip((axis.path for axis in listed), combination, strict=True))
        fixed_values = values | fixed
        _refuse_faults(rules, values, fixed)
        if rules.drawing is None and rules.with_frame and RATIO in fixed:
            fixed_values[DELAY] = fixed_values[RATIO]
        drawing = rules.drawing_of(fixed_values, (along, *gains))
        for axes, whole_ticks in _pieces(drawing, fixed_values, ranges):
            loops = Loops(drawing, fixed_values | whole_ticks)
            varied = {along: span} if along else {}
            for required, sides, bound in of_required(rules, loops, axes, varied):
                cases.append(Case(required, along, span, sides, fixed, bound))
    return cases


def felt_for_all(rules: Rules, loop: Loops, along: str, values: np.ndarray) -> np.ndarray:
    """The least stiffness that the hand feels at rest of all loops of the rules, see `least_felt`."""
    span = (float(values.min()), float(values.max()))
    return least_felt(cases_of(rules, along, span, loop), values, vary=rules.vary)


def own_cases(rules: Rules, spec: Spec) -> list[Case]:
    """The cases of a spec's own design."""
    design = Loops(own_loop(spec).drawing, dict(spec.values))
    return cases_of(rules, "", (0.0, 0.0), design)


def _refuse_faults(rules, values, fixed) -> None:
    """Refuse numbers with which a drawn loop cannot be built, such as a part of a tick in
    `every`."""
    if not rules.drawing or not fixed:
        return
    numbers = {path: number for path, number in values.items() if not np.ndim(number)}
    for path, expected, text_found in faults(rules.drawing, numbers | fixed):
        place = ", ".join(f"{name_of(name)} = {number:g}" for name, number in fixed.items())
        refuse(path, expected, f"{text_found} with {place} of [for_all]")


def _pieces(drawing, values, ranges):
    """Yield ranges in which dead times have the same whole ticks, and these ticks."""
    timed = next((axis for axis in ranges if name_of(axis.path) in drawing.timing), None)
    if not timed:
        yield ranges, {}
        return
    for (low, high), whole_ticks in Loops(drawing, values).pieces(
        timed.path, (timed.start, timed.stop)
    ):
        yield (
            [replace(axis, start=low, stop=high) if axis is timed else axis for axis in ranges],
            whole_ticks,
        )


def rms_of(require: Any) -> Any:
    """The bound on a root mean square that a requirement has."""
    return next(gain for gain in require.bound.gains if gain.word == RMS)


def loud(at_most: float) -> str:
    """What is beyond a level, in words."""
    return f"a root mean square of more than {at_most:.15g}"


def rows_of(rules: Rules, loop: Loops, along: str, span: tuple[float, float]) -> list[Row]:
    """The rows of loops whose frames vary, see `intervals_for_all`."""
    return _Loop(rules, along, span, loop).varying()


class _Loop:
    """One loop of a sweep with all numbers of [for_all]."""

    def __init__(self, rules: Rules, along: str, span: tuple[float, float], loop: Loops):
        self.rules, self.along, self.span = rules, along, span
        self.cases = cases_of(rules, along, span, loop)
        self.too_loud = False  # whether a root mean square is proved to be too large everywhere

    @property
    def certified(self) -> bool:
        """Whether the search was."""
        return all(case.certified for case in self.cases)

    def nowhere(self) -> str:
        """What rules out every value with constant members alone, in words; empty if nothing does."""
        reasons = (nowhere(self.rules, case, self.span) for case in self.cases)
        return next(filter(None, reasons), "")

    def intervals(self) -> list[Row]:
        """The rows of loops whose numbers are constant."""
        proved_parts = proofs(self.cases, self.span, TRIED_NEAR_REFUTED)
        return [self._near(interval, proved) for interval, proved in proved_parts if proved]

    def _near(self, part, proved) -> Row:
        """The proof reaches over this much of a part."""
        text = text_of_part(part)
        return Row(proved.low, proved.high, part, self.span, text, open_in_words(proved.open))

    def varying(self) -> list[Row]:
        """The rows of loops whose frames vary."""
        if self.rules.at_random:
            return self._on_average()
        rows = []
        for interval in searched(self.cases, self.span):
            bracketed_cases = [
                self._bracketed(case, (interval.low, interval.high)) for case in self.cases
            ]
            if None not in bracketed_cases:
                rows.append(all_of(bracketed_cases))
        return [row for row in rows if row.low < row.high]

    def _bracketed(self, case, about) -> Row | None:
        bracket = self.bracketed(case, about)
        return bracket and self._row(case, bracket)

    def bracketed(
        self, case: Case, about: tuple[float, float], value: float = np.nan
    ) -> Bracket | None:
        """What is proved and refuted of a case about an interval; value: see `bracket_ring`."""
        return bracketed_over(
            self.rules, case.values, self.along, case.ranges, self.span, about, value
        )

    def _on_average(self) -> list[Row]:
        """The rows of what is at random: what the intervals of all cases have in common."""
        rows = [Row(*self.span, Part(*self.span), self.span, text="")]
        for case in self.cases:
            middles = {axis.path: (axis.start + axis.stop) / 2 for axis in case.ranges}
            family = self.rules.family(case.values | middles, self.along)
            if case.ranges or family.family.drift is not None:
                over_ranges = (
                    self._bracketed(case, interval)
                    for interval in parts_that_decay(family, *family.probable(*self.span))
                )
                rows_of_case = list(filter(None, over_ranges))
            else:
                rows_of_case = [
                    self._row(case, told(bracket, lambda _, of_case=family: of_case))
                    for bracket in brackets_on_average(family, self.span)
                ]
            if self.rules.require:
                rows_of_case = [
                    part for row in rows_of_case for part in self._of_small_rms(case, row)
                ]
            both = [all_of(pair) for pair in product(rows, rows_of_case)]
            rows = [row for row in both if row.low < row.high]
        return rows

    def _of_small_rms(self, case: Case, row: Row) -> list[Row]:
        """The parts of a row in which a root mean square is as required."""
        bound = rms_of(self.rules.require)
        ports = RandomPorts.of(self.rules, case.values, self.along, self.span, bound)
        found = offered("bound").along_at_random(ports, (row.low, row.high), bound.at_most)
        if found.doubt.any():
            return []
        self.too_loud |= bool(row.settled and (found.index < 0).all())
        by = case.fixed | {loud(bound.at_most): None}
        parts = []
        for interval in np.flatnonzero(found.index >= 0):
            low, high = found.low[interval], found.high[interval]
            # An end is in the middle of a gap that is twice as wide at most.
            gaps = 2 * END_EXACTNESS * (np.abs([low, high]) + SHARE_OF_SPAN * (row.high - row.low))
            part = row.part
            if not np.isnan(found.low_omega[interval]):
                part = replace(part, low=low - gaps[0], low_by=by)
                low = low + gaps[0]
            if not np.isnan(found.high_omega[interval]):
                part = replace(part, high=high + gaps[1], high_by=by)
                high = high - gaps[1]
            parts.append(replace(row, low=low, high=high, part=part, text=text_of_part(part)))
        return parts

    def grows_everywhere(self) -> bool:
        """Whether the mean square of some case is proved to grow at every value."""
        families = (
            self.rules.family(case.values, self.along) for case in self.cases if not case.ranges
        )
        return any(
            family.family.drift is None and grows_everywhere(family, *self.span)
            for family in families
        )

    def _row(self, case, bracket: Bracket) -> Row:
        ends = [bracket.below, bracket.above]
        by = [case.named(end.point) | {end.text: None} if end.word else None for end in ends]
        low = bracket.below.x if bracket.below.word else bracket.low
        high = bracket.above.x if bracket.above.word else bracket.high
        part = Part(low, high, *by)
        left_open = open_in_words(bracket.open)
        places = []
        for refuted, edge, end in zip(by, self.span, (bracket.low, bracket.high), strict=True):
            if refuted is None and end != edge:  # where the proof ends, and not what it is of
                places.append(span_around(*sorted((edge, end)), 4))
        if places and not (case.ranges or left_open):
            left_open = f"within {name_of(self.along)} {' and '.join(places)}"
        return Row(bracket.low, bracket.high, part, self.span, text_of_part(part), left_open)


def open_in_words(open_: LeftOpen | None) -> str:
    """Which part of the numbers next to a proof was neither proved nor refuted, as a text."""
    if open_ is None:
        return ""
    places = []
    for path, low, high in zip(open_.paths, *open_.ends, strict=True):
        places.append(f"{name_of(path)} {span_around(low, high, 4)}")
    share = f"{100 * open_.share:.3g} %, " if len(open_.paths) > 1 else ""
    return shorten(f"{share}within {', '.join(places)}", LEFT_OPEN, placeholder=" ...")


def is_near(first: float, second: float) -> bool:
    """Whether an end that is proved is so near to one that is refuted that it counts as settled."""
    return abs(first - second) <= SETTLED_WITHIN * max(abs(second), abs(first))


def text_of_part(part: Part) -> str:
    """What refutes the ends of a part."""
    return Refuters(*(numbers_in_words(by or {}) for by in (part.low_by, part.high_by))).written(
        TEXT
    )


def numbers_in_words(by: Mapping[str, object]) -> str:
    """Numbers, by their paths, as a text; None for a text among the paths."""
    return ", ".join(
        name_of(path) if value is None else f"{name_of(path)} = {in_all_digits(value)}"
        for path, value in by.items()
    )


def all_of(rows: Sequence[Row]) -> Row:
    """What several rows of a span have in common, whose parts overlap."""
    low, high = max(rows, key=lambda row: row.low), min(rows, key=lambda row: row.high)
    below, above = (
        max(rows, key=lambda row: row.part.low).part,
        min(rows, key=lambda row: row.part.high).part,
    )
    interval = Part(
        below.low, above.high, below.low_by, above.high_by, below.low_omega, above.high_omega
    )
    return Row(
        low.low,
        high.high,
        interval,
        low.span,
        text_of_part(interval),
        high.left_open or low.left_open,
    )


def share_from_zero(rules: Rules) -> float:
    """From which share of a wall on walls of designs are proved: next to 0 many loops only just
    decay."""
    if rules.vary and rules.ranges:
        return FROM_ABOUT_ZERO
    return 2 * PROVED_FROM_ZERO


def proved_from_zero(spec: Spec, path: str, stop: float, rules: Rules) -> float:
    """Return up to what stiffness of a wall, at most `stop`, all loops of the rules are proved
    to be stable from `share_from_zero` of it on."""
    rules = replace(rules, work=QUICK, begins=BEGINS * FROM_ABOUT_ZERO)
    rows = intervals_for_all(rules, loops_of(spec, dict(spec.values), path), path, (0.0, stop))
    share = share_from_zero(rules)
    from_zero = rows[(rows["intervals"] > 0) & (rows["low"] <= share * rows["high"])]
    return float(from_zero["high"].max(initial=0.0))


def reason_of(facts: Mapping[str, str]) -> str:
    """Why a verdict is not known."""
    if facts.get("doubt"):
        return CONTRADICTED
    return facts.get(
        "known", "neither proved nor refuted: see what `wavesweep stability-region` proves"
    )


def claim(spec: Spec, rules: Rules) -> tuple[Claim, dict[str, str]]:
    """What is known of all loops of some rules, as a claim about the plans that the proof used,
    and as `verdict` has it."""
    facts = verdict(spec, rules)
    status = Status[facts["verdict"].upper()]
    reason = ""
    if status is Status.REFUTED and rules.at_random:
        reason = facts["counterexample"]
    elif status is Status.REFUTED:
        modes = rules.require and rules.require.bound.of_modes  # a refuter of which may be stable
        reason = f"{'not' if modes else 'unstable'} with {in_a_sentence(facts['counterexample'])}"
    elif status is Status.UNKNOWN:
        reason = reason_of(facts)
    else:
        reason = facts.get("known", "")
    rows = ForAllGuarantee(rules)
    return Claim(rows.what, rows.scope(spec), status, reason), facts


def verdict(spec: Spec, rules: Rules | None = None) -> dict[str, str]:
    """Whether the spec's own loop is stable for all numbers of its [for_all]: verdict ("proved",
    "refuted" or "unknown"), counterexample, the numbers with which it is unstable, and kind,
    what it is about. known: of constant numbers whose proof did not end, what is proved and
    what is open, and of a proof by other than norms its means, as a text. rules: others than those of the spec."""
    refuse_unsuitable_ranges(spec, "")
    rules = rules or Rules.of(spec)
    random = rules.for_all.shares
    if rules.messages:
        at_random = "both" if random else "mean_square"
    elif random:
        at_random = "frames"
    else:
        at_random = "results"
    if rules.at_random:
        kind = at_random
    elif rules.messages and not rules.for_all.axes:
        kind = "messages"
    else:
        kind = "for_all"
    return _verdict(spec, rules) | {"kind": kind}


def _verdict(spec, rules):
    texts = {}
    loop = _Loop(rules, "", (0.0, 0.0), Loops(own_loop(spec).drawing, dict(spec.values)))
    for number, case in enumerate(loop.cases):
        said, numbers, text = _case_verdict(spec, rules, number, case)
        if said == "refuted":
            return {"verdict": said, "counterexample": numbers_in_words(numbers)}
        texts[said] = texts.get(said) or text
    decided = "unknown" if "unknown" in texts else "proved"
    covered = {"verdict": decided, "counterexample": ""}
    if what_is_known := texts.get(decided):
        covered["known"] = what_is_known
    if decided == "proved" and not claims_hold(rules, loop.cases):
        return covered | {"verdict": "unknown", "doubt": "contradiction"}
    return covered


def _case_verdict(spec, rules, number, case):
    """The verdict on a case, if it is refuted the numbers with which it is unstable, and what is
    proved of one that is not."""
    if rules.vary:
        said, by = _decided(spec, rules, number, case)
        return said, case.fixed | by, "".join(by)
    if not case.ranges:
        numbers = case.unstable()
        if numbers is None:
            return ("proved", {}, "")
        return ("refuted", numbers, "")
    covered = None if case.begins_unstable() else case.cover()
    if covered is not None and covered.whole:
        return "proved", {}, ""
    numbers = case.unstable()
    if numbers is None and covered is not None and covered.unstable:
        numbers = case.unstable(np.array(covered.unstable))
    if numbers is not None:
        return "refuted", numbers, ""
    return "unknown", {}, "" if covered is None else _partly(case, covered)


def _partly(case, covered):
    """What is proved of a case whose proof has not ended, and what holds it up, as a text."""
    if covered.open is None:
        return ""
    first = case.ranges[0]
    fixed = f" with {numbers_in_words(case.fixed)}" if case.fixed else ""
    if covered.low < covered.high:
        proved = f"proved for {first.name} {span_in_words(covered.low, covered.high, 4)}{fixed}, open from there"
    else:
        proved = f"open from {first.name} = {rounded_down(covered.low, 4)} on{fixed}"
    return f"{proved} ({open_in_words(covered.open)})"


def _decided(spec, rules, number, case):
    """Whether a case whose frames vary is stable, and what it is not stable with.

    What is not decided soon is asked of the intervals along the wall, or the spec's own number, as
    the tables have them: their proofs go on from numbers at which norms are found at once, and the
    patterns that set their ends are found nearer to them.
    """
    loop_and_ranges = rules, case.values, case.ranges
    if spec.wall:
        path = spec.wall[0]
    else:
        path = spec.along and spec.names.find(spec.along).path
    if not path or rules.at_random:
        return decided_over(*loop_and_ranges)
    said, alone = decided_over(*loop_and_ranges, SOON)
    if said != Verdict.UNKNOWN:
        return said, alone
    value = float(spec.values[path])
    axis = next((axis for axis in spec.sweep if axis.path == path), None)
    low, high = (axis.start, axis.stop) if axis else K_VE_SPAN
    span = min(value, low), max(value, high)
    loop = _Loop(rules, path, span, loops_of(spec, dict(spec.values), path))
    along = loop.cases[number]
    for interval in searched(loop.cases, span):
        try:
            bracket = loop.bracketed(along, (interval.low, interval.high), value)
        except UsageError:  # its frames cannot be cut there
            return decided_over(*loop_and_ranges)
        said, by = decided_along(rules, along.values, path, along.ranges, value, bracket)
        if said != Verdict.UNKNOWN:
            return said, by
    return said, alone


def recorded(
    rows: Sequence[Row], certified: bool, *, agreed: bool, none: bool = False, why: str = ""
) -> np.ndarray:
    """Return the rows as records of PROVED_RECORD.

    agreed: whether no member of what they are about contradicts them. none: whether it is known
    that there are none; why: what rules them out.
    """
    records = blank_records(
        *(np.array([getattr(row, end) for row in rows]) for end in ("low", "high")), PROVED_RECORD
    )
    records["certified"] = bool(rows or (none and certified))
    records["doubt"] = np.where(records["certified"], Doubt.NONE, Doubt.SEARCH)
    records["settled"] = none and certified
    if none and certified:
        records["counterexample"] = shorten(why, TEXT, placeholder=" ...")
    for number, row in enumerate(rows):
        records["fails_below"][number] = row.part.low if row.part.low_by is not None else np.nan
        records["fails_from"][number] = row.part.high if row.part.high_by is not None else np.nan
        records["low_omega"][number], records["high_omega"][number] = (
            row.part.low_omega,
            row.part.high_omega,
        )
        records["settled"][number], records["counterexample"][number] = row.settled, row.text
        records["left_open"][number] = row.left_open
    if not agreed:
        records["certified"], records["settled"], records["doubt"] = (
            False,
            False,
            Doubt.CONTRADICTION,
        )
    return records
