"""Intervals along a number in which a loop is stable for ticks of all lengths in any order, and
the verdict on its own values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from textwrap import shorten

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.engine.drawing import name_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.switched import Bracket
from wavesweep.haptics.felt import dcgain_of, felt_of
from wavesweep.late_ticks.bracket import bracket, decided
from wavesweep.late_ticks.tick_curves import TWO_VALUES, late_ticks
from wavesweep.program.analyses.claims import (
    STABLE,
    Claim,
    Scope,
    Status,
    Tick,
    own_scope,
)
from wavesweep.program.analyses.interval_jobs import Guarantee, records_of_loop
from wavesweep.program.number_words import in_all_digits, span_around
from wavesweep.program.row_kinds import TEXT
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop
from wavesweep.program.tables.refuters import Refuters, in_a_sentence

MOST_FRAME_PLACES = 256  # ticks in a frame


@dataclass(frozen=True, slots=True)
class LateTicksGuarantee(Guarantee):
    """Ticks that take any time of an interval (s), as `IntervalQuery.guarantee`."""

    interval: tuple[float, float]
    kind = "for_all"
    own_ticks = True
    status = Status.PROVED
    method = (
        "quadratic norms at each tick of a frame, in which ticks of all lengths shrink, proved by Cholesky with bounds on all "
        "errors; refuted by a pattern of short and long ticks that grows"
    )

    def scope(self, spec: Spec) -> Scope:
        """The loops that its rows are about: those of the spec's own numbers, with these ticks."""
        return replace(own_scope(spec), tick=Tick(*self.interval))

    def records_of(self, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
        """The intervals of one loop."""
        return records_for_ticks(loop, along, span, self.interval)

    def felt(self, loop: Loops, along: str, values: np.ndarray) -> np.ndarray:
        """What is felt at rest whatever times the ticks take, NaN if something drifts."""
        loops = loop.changed({along: values})
        if dcgain_of(loops) is None:
            return np.full(values.shape, np.nan)
        return felt_of(loops, values.size)


def refuse(spec: Spec, along: str) -> None:
    """Raise UsageError for a number that intervals cannot be held for; along: empty for a design
    alone."""
    design = own_loop(spec, along) if along else own_loop(spec)
    drawn = design.drawn()
    if drawn.ticks > MOST_FRAME_PLACES:
        expected = f"a frame of at most {MOST_FRAME_PLACES} ticks"
        raise UsageError(f"[for_all] tick: expected {expected}, found {drawn.ticks}")
    if along and not design.drawing.scalar_place(name_of(along)):
        expected = "intervals along a number that one wire or gain reads linearly, such as K_VE"
        raise UsageError(f"[for_all] tick: expected {expected}, found {name_of(along)}")
    varied = {**design.values, along: TWO_VALUES} if along else design.values
    if along and Loops(design.drawing, varied).drift().varying:
        expected = f"a loop whose position at rest does not depend on {name_of(along)}"
        text_found = "one that rests elsewhere with each value, as a wave line beside a spring at the hand; check is of one value"
        raise UsageError(f"[for_all] tick: expected {expected}, found {text_found}")


def records_for_ticks(
    loop: Loops, along: str, span: tuple[float, float], interval: tuple[float, float]
) -> np.ndarray:
    """Intervals of a loop along a number within span = (low, high), for ticks of an interval (s) in
    any order, as records.

    A row lies within an interval of the loop whose ticks are all on time.
    """
    rules = offered("rules")
    ticks_with = lru_cache(lambda cells: late_ticks(loop, along, interval, cells))
    nominal = records_of_loop(loop, along, span)
    certified = bool(nominal["certified"].all())
    rows = []
    refuted = []  # the least number of an interval of which nothing is proved
    unproved = []  # such intervals in words
    for interval_on_time in nominal[nominal["intervals"] > 0]:
        about = float(interval_on_time["low"]), float(interval_on_time["high"])
        bracket_found = bracket(ticks_with, about)
        if bracket_found and bracket_found.low < bracket_found.high:
            on_time = f"ticks of {1e3 / float(loop.rate):.6g} ms"
            if not interval_on_time["certified"]:
                on_time = ""
            rows.append(_row(bracket_found, about, span, along, on_time))
            continue
        within = f"within {name_of(along)} {span_around(*about, 4)}"
        if bracket_found and bracket_found.above.text:
            above = bracket_found.above
            refuted.append(above)
            within += f", refuted at {in_all_digits(above.x)} by {above.text}"
        unproved.append(within)
    records = rules.recorded(rows, certified, agreed=True, none=not nominal["intervals"].any())
    if refuted and not rows:
        records["fails_from"] = refuted[0].x
        records["counterexample"] = shorten(refuted[0].text, TEXT, placeholder=" ...")
    for number, record in enumerate(records):
        open_parts = [rows[number].left_open] if rows and rows[number].left_open else []
        text = "; ".join([*open_parts, *unproved])
        record["left_open"] = shorten(text, 160, placeholder=" ...")  # characters of the column
    return records


def _row(bracket_found: Bracket, about, span, along, on_time: str):
    """What is proved along a number; on_time: what refutes the ends of the interval of ticks that are all on
    time, empty if it is not known."""
    rules = offered("rules")
    below, above = bracket_found.below, bracket_found.above
    if not below.text and about[0] > span[0]:
        below = replace(below, x=about[0], text=on_time)
    if not above.text and about[1] < span[1]:
        above = replace(above, x=about[1], text=on_time)
    low = below.x if below.text else bracket_found.low
    high = above.x if above.text else bracket_found.high
    part = rules.Part(low, high, below.text or None, above.text or None)
    places = []
    sides = zip(span, (below, above), (bracket_found.low, bracket_found.high), strict=True)
    for edge, refuted, end in sides:
        if not refuted.text and end != edge:
            places.append(span_around(*sorted((edge, end)), 4))
    left_open = f"within {name_of(along)} {' and '.join(places)}" if places else ""
    text = Refuters(below.text, above.text).written(TEXT)
    return rules.Row(bracket_found.low, bracket_found.high, part, span, text, left_open)


def claim(spec: Spec) -> Claim:
    """What is known of the spec's own loop for all ticks of its [for_all]."""
    refuse(spec, "")
    interval = spec.tick.interval(spec.tick_hz)
    design = own_loop(spec)
    verdict, pattern = decided(lambda cells: late_ticks(design, "", interval, cells))
    scope = replace(own_scope(spec), tick=Tick(*interval))
    return Claim(STABLE, scope, Status[verdict.upper()], in_a_sentence(pattern))
