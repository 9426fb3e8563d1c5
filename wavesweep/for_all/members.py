"""Members of what a claim is about: loops at constant frames, whose exact intervals a row for all
of them has to lie within.

They are computed by the way of constant rates, which shares neither the plan of frames nor the
proofs: a contradiction is a fault of the one or of the other.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from wavesweep.engine.drawing import name_of
from wavesweep.engine.intervals import Search
from wavesweep.engine.loop import Loops
from wavesweep.engine.switched import corners_of
from wavesweep.for_all.frame_families import DELAY, RATIO
from wavesweep.for_all.unknown import Case
from wavesweep.for_all.varying import Rules
from wavesweep.program.analyses.mode_in_the_way import mode_in_the_way, outside
from wavesweep.program.number_words import in_all_digits, lasting, span_in_words

NO_CONTRADICTION = 1e-6  # of an end, or of a radius: no contradiction


def members(rules: Rules, case: Case, changes: Mapping[str, float] | None = None) -> list[Loops]:
    """Return loops of a case at constant frames; changes: other numbers of all, such as those of no
    hand.

    Unknown numbers have the spec's own values, or the nearest of their ranges, and dead times their
    own whole ticks. None where constant frames are not among what is claimed: with messages lost at
    random, or a step that is not the time of a frame.
    """
    if rules.at_random:
        return []
    constant = _at_constant_frames(rules, _own(case, changes))
    return [
        Loops(rules.drawing_of(numbers, (case.along,)), numbers).unbuilt for numbers in constant
    ]


def _own(case: Case, changes: Mapping[str, float] | None = None) -> dict[str, object]:
    """The values of a case, and of its ranges those of the spec or the nearest ones; changes:
    see `members`."""
    values = {**case.values, **(changes or {})}
    for axis in (
        axis_of_range for axis_of_range in case.ranges if axis_of_range.path not in (changes or {})
    ):
        values[axis.path] = float(np.clip(values[axis.path], axis.start, axis.stop))
    return values


def _at_constant_frames(rules, values) -> Iterator[dict[str, object]]:
    """Yield the numbers of the members: combinations of a few values of the numbers that vary
    from frame to frame."""
    varied = [axis for axis in rules.for_all.changing if not rules.messages]
    choices = []
    for axis in varied:
        tried = axis.choices
        spread = {
            # Six values of each number that varies, its ends among them, beside the spec's own.
            tried[i]
            for i in np.linspace(0, len(tried) - 1, 6).astype(int).tolist()
        }
        choices.append(sorted(spread | ({values[axis.path]} & {*tried})))
    for combination in product(*choices):
        numbers = values | dict(zip((axis.path for axis in varied), combination, strict=True))
        frames_differ = any(
            numbers[axis.path] != values[axis.path] and axis.path != DELAY for axis in varied
        )
        if frames_differ and not rules.elapsed:
            continue
        if rules.drawing is None and rules.with_frame:
            numbers[DELAY] = numbers[RATIO]
        yield numbers


def claims_hold(
    rules: Rules,
    cases: Sequence[Case],
    rows: Sequence | None = None,
    changes: Mapping[str, float] | None = None,
) -> bool:
    """Return whether no member of some cases contradicts what is claimed of all: a claim that one
    does gives way.

    rows: the intervals that are claimed, along the number of the cases; None for a claim about its
    own value. changes: see `members`.
    """
    if not rules.vary and any(_contradicted(case, rows) for case in cases if case.ranges):
        return False
    loops = [(loop, case) for case in cases for loop in members(rules, case, changes)]
    if rows is None:
        return not any(bool((loop.read.radii() > 1 + NO_CONTRADICTION).any()) for loop, _ in loops)
    return all(_within(rows, loop, case.along, case.span) for loop, case in loops if rows)


def _contradicted(case, rows):
    """Whether some member that is drawn at random is unstable at the case's own value, or within
    a row."""
    if rows is None:
        return case.contradicts()
    return any(case.contradicts(row.low, row.high) for row in rows)


def _within(rows, loop, along, span):
    """Whether rows lie within the stable intervals of a loop, as far as these are certified."""
    stable = _certified(loop, along, span)
    if stable is None:
        return True
    wider = []
    for low, high in stable:
        wider.append((low - NO_CONTRADICTION * abs(low), high + NO_CONTRADICTION * abs(high)))
    return all(any(low <= row.low and row.high <= high for low, high in wider) for row in rows)


def nowhere(rules: Rules, case: Case, span: tuple[float, float]) -> str:
    """Return what rules out every value at which all members of a case would be stable, in words;
    empty if nothing does.

    It is the first member without a stable value or, of all together, that their certified
    intervals have nothing in common beyond rounding.
    """
    common = [span]
    met = ""
    for label, loop in _named(rules, case):
        stable = _certified(loop, case.along, span)
        if stable is None:
            continue
        before = common
        both = [(max(low, a), min(high, b)) for low, high in common for a, b in stable]
        common = [
            (low, high)
            for low, high in both
            if low - NO_CONTRADICTION * abs(low) <= high + NO_CONTRADICTION * abs(high)
        ]
        if not common:
            beside = f"; with {met}, it is in {_spans(before)}" if met else ""
            name = case.along.rpartition(".")[2]
            if stable:
                return f"with {label} {name} is stable in {_spans(stable)}{beside}"
            return f"with {label} no {name} is stable{_nearest(loop, name, case, span)}{beside}"
        met = "those before" if met else label
    return ""


def _nearest(loop: Loops, name: str, case: Case, span: tuple[float, float]) -> str:
    """The value of the number at which a loop comes nearest to being stable, and the mode that
    grows there; empty if none is found."""
    mode = mode_in_the_way(loop, case.along, span, outside)
    time = mode.get("time_constant_s")
    if time is None or time > 0:  # nothing grows there
        return ""
    grows = f"{mode['hz']:.4g} Hz, {lasting(time)}"
    return f" (nearest of those looked at: {name} = {mode['value']:.6g}: {grows})"


def _spans(stable: Sequence[tuple[float, float]]) -> str:
    return " and ".join(span_in_words(*interval) for interval in stable)


def _named(rules: Rules, case: Case) -> Iterator[tuple[str, Loops]]:
    """Yield the members of a case, with what each is: its frames, or the numbers at a corner of
    the box."""
    fixed = ", ".join(
        f"{name_of(path)} = {in_all_digits(value)}" for path, value in case.fixed.items()
    )
    if rules.vary and rules.at_random:
        return
    if rules.vary:
        for numbers in _at_constant_frames(rules, _own(case)):
            said = [fixed] if fixed else []
            for axis in rules.for_all.changing:
                name = "frames" if axis.path == RATIO else f"{axis.name} ="
                said.append(f"{name} {in_all_digits(numbers[axis.path])}")
            loops = Loops(rules.drawing_of(numbers, (case.along,)), numbers).unbuilt
            yield ", ".join(said) or "constant frames", loops
        return
    for corner in corners_of(case.box):
        numbers = {each.path: float(x) for each, x in zip(case.ranges, corner, strict=True)}
        said = [fixed] if fixed else []
        said += [f"{name_of(path)} = {in_all_digits(value)}" for path, value in numbers.items()]
        yield ", ".join(said) or "the spec's own numbers", case.loop.changed(numbers)


def _certified(loop: Loops, along: str, span: tuple[float, float]):
    """The stable intervals of a loop; None if they are not certified."""
    searched = Search(along, span, ((np.zeros(1, int), loop.read),), lines=False, checked=True)
    records = searched.records()
    if not records["certified"].all():
        return None
    return [
        (float(record["low"]), float(record["high"])) for record in records if record["intervals"]
    ]
