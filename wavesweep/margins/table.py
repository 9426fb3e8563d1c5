"""How far a loop is from instability at one signal, at which it is broken: the table `margins`."""

import time
from collections.abc import Iterator, Mapping, Sequence
from math import isclose, pi
from typing import Any

import numpy as np

from wavesweep.engine.doubts import words
from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses.claim_words import in_words
from wavesweep.program.analyses.claims import Claim, Property, Status, own_scope
from wavesweep.program.columns import RATIO, Columns, joined
from wavesweep.program.number_words import in_time, rounded_down, rounded_up
from wavesweep.program.spec import Spec
from wavesweep.program.tables.kind import (
    Kind,
    Line,
    Numbers,
    SingleBlockSummary,
    counted_doubts,
    from_spec,
    in_doubt,
    plain,
)
from wavesweep.program.tables.table import Table, facts_of, held

GAINS = "gains from the certified stable interval around 1 of a factor of the signal; peaks by level sets"
DELAY = "; a delay in seconds from the certified stable interval about 0 of a dead time behind the signal"
CROSSINGS = "; crossings of the gain 1 from the pencil of the level 1/2 of the real part of 1/(1 + L), found to rounding"
RIM = "; of the lifted signal the certified stable intervals of its phase, and of complex factors on the rim of a disk"
NO_DELAY = "no delay margin: the loop bears each dead time that is tried, or readers of the signal would round it to ticks"
UNITS = {
    "phase": "deg",
    "delay": "s",
    "delay_frames": "frame",
    "disk_phase": "deg",
}  # of margins that have one
SAID = {
    "gain_up": "gain may grow by a factor up to",
    "gain_down": "gain may fall by a factor down to",
    "phase": "phase margin",
    "delay": "delay margin (dead time)",
    "delay_frames": "delay margin (fewer whole frames than)",
    "disk": "disk margin",
    "disk_gain": "  gain alone within the disk, up or down by a factor of",
    "disk_phase": "  phase alone within the disk",
    "sensitivity": "peak sensitivity Ms",
    "complementary": "peak complementary sensitivity Mt",
}

# of a lifted signal, after those of one factor
BY_SINGULAR_VALUES = ("sensitivity", "complementary")
ROUNDED_UP = ("gain_down", *BY_SINGULAR_VALUES)  # the others hold up to their value


def margins(spec: Spec, cut: str = "") -> Table:
    """The margins of the spec's own loop, broken at a signal; of the lifted loop if it is made
    several times in a frame.

    With unknown numbers in [for_all] there are rows of the margins that hold for all of them as
    well. cut: the signal, "block.port" or a name in [signals]; by default that at
    which the spec asks for margins, or else an actuator's. Errors: UsageError for a signal at which the loop cannot be broken, or a loop
    that is not known to be stable.
    """
    from wavesweep.margins.broken_loops import broken_at, default_cut, lines_at
    from wavesweep.margins.dead_time_margin import in_seconds
    from wavesweep.margins.lifted_margins import margins_of
    from wavesweep.program.analyses.assumptions import over_preset

    started = time.perf_counter()
    cut = cut or default_cut(spec)
    loop = broken_at(spec, cut)
    margins_found, doubt = margins_of(loop)
    margins_found = in_seconds(spec, cut, margins_found, loop.times)
    if not margins_found:
        reason = f"not known to be ({words([doubt])[0]})" if doubt else "not"
        raise UsageError(
            f"margins: expected a loop that is stable, found one that is {reason}; wavesweep check judges it"
        )
    bound = np.array([margin.bound for margin in margins_found])
    hz = lines_at(loop, margins_found)
    columns = _columns(cut, margins_found, bound, hz)
    in_time = DELAY if "delay" in columns["margin"] else ""
    methods = {"margins": f"{GAINS}{in_time}{RIM if loop.times > 1 else CROSSINGS}"}
    status = Status.CERTIFIED if columns["certified"].any() else Status.UNKNOWN
    claims = {"spec": Claim(Property("margins", "figures"), own_scope(spec), status)}
    notices = [f"{axis.name} is not swept here, {held(spec, axis.path)}" for axis in spec.sweep]
    if loop.times == 1 and not any(name.startswith("delay") for name in columns["margin"]):
        notices.append(NO_DELAY)
    if spec.for_all:
        from wavesweep.margins.box_margins import METHOD_FOR_ALL, margins_for_all, refused

        if said := refused(spec):
            notices.append(said)
        else:
            of_all, claims["for_all"] = margins_for_all(spec, cut)
            columns = _with_those_for_all(columns, cut, of_all)
            methods["for_all"] = METHOD_FOR_ALL
    counts = {"computed": 1, "skipped": 0, "certified": int(columns["certified"].all())}
    timings = {"compute_s": time.perf_counter() - started}
    facts = facts_of(
        spec,
        methods,
        counts,
        timings,
        [*notices, *over_preset(spec)],
        claims=claims,
    )
    return Table.of(
        "margins", columns, facts | {"cut": cut, "period_s": loop.period, "times": loop.times}
    )


def _columns(cut: str, found: Sequence[Any], bound: np.ndarray, hz: np.ndarray) -> Columns:
    doubts = words([margin.doubt for margin in found])
    return {
        "cut": np.full(len(found), cut, object),
        "margin": np.array([margin.name for margin in found], object),
        "value": np.array([margin.value for margin in found]),
        "unit": np.array([UNITS.get(margin.name, RATIO) for margin in found], object),
        "omega": np.array([margin.omega for margin in found]),
        "bound": bound,
        "certified": doubts == "",
        "doubt": doubts,
        "limited": np.array([margin.limited for margin in found]),
        "hz": hz,
    }


def _with_those_for_all(columns_of_design: Columns, cut: str, found: Sequence[Any]) -> Columns:
    """The rows of the spec's own numbers and, behind them, those of [for_all], with the columns
    of these."""
    of_all = _columns(cut, found, np.zeros(len(found)), np.full(len(found), np.nan))
    both = joined([columns_of_design, of_all])
    rows = len(columns_of_design["cut"])
    none = np.full(rows, np.nan)
    refuted = np.array([margin.refuted for margin in found])
    down = np.array([margin.name == "gain_down" for margin in found])
    return {
        **both,
        "guarantee": np.array(["spec"] * rows + ["for_all"] * len(found), object),
        "fails_below": np.concatenate([none, np.where(down, refuted, np.nan)]),
        "fails_from": np.concatenate([none, np.where(down, np.nan, refuted)]),
        "settled": np.concatenate(
            [columns_of_design["certified"], [margin.settled for margin in found]]
        ),
        "counterexample": np.array(
            [""] * rows + [margin.counterexample for margin in found], object
        ),
    }


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    whose = columns.get("guarantee", np.full(len(columns["cut"]), "spec", object))

    def rows(of: str, *more: str) -> Numbers:
        names = ("value", "unit", "omega", "doubt", "limited", "hz", *more)
        numbers = {}
        for row in np.flatnonzero(whose == of):
            numbers[columns["margin"][row]] = {name: plain(columns[name][row]) for name in names}
        return numbers

    doubts = counted_doubts(columns["doubt"])
    tally = {"rows": len(whose), "doubts": doubts}
    tally |= {"cut": facts["cut"], "period_s": facts["period_s"], "times": facts.get("times", 1)}
    tally["margins"] = rows("spec")
    if "guarantee" in columns:
        tally["claim"] = facts["claims"]["for_all"]
        of_all = rows("for_all", "fails_below", "fails_from", "settled", "counterexample")
        if of_all:
            tally["for_all"] = of_all
    return tally


def _lines(facts: Numbers) -> Iterator[Line]:
    """Yield the lines of the summary, each with whether it warns: where the loop is broken, its margins,
    then those that hold for all of [for_all]."""
    of_all = facts.get("for_all", {})
    said = ""
    if of_all:
        claim = Claim.read(facts["claim"])
        said = f"{in_words(claim)} (for_all)"
        if claim.status is Status.REFUTED:  # what is refuted comes first
            yield said, True
            of_all = {}
    times = facts["times"]
    period = in_time(facts["period_s"])
    if times == 1:
        yield f"broken at {facts['cut']}, once in {period}", False
    else:
        runs = f"broken at {facts['cut']}, which runs {times} times per {period}"
        all_of = {2: "both", 3: "all three", 4: "all four"}.get(times, f"all {times}")
        yield f"{runs}; a margin is for one factor on {all_of} values", False
    of_any_form = f"peaks of inputs of any form, over all {times} values: largest singular values"
    for name, margin in facts["margins"].items():
        if times > 1 and name == BY_SINGULAR_VALUES[0]:
            yield of_any_form, False
        yield _line(name, margin, _at_frequency(margin["omega"], margin["hz"]))
    yield from in_doubt(facts["doubts"], facts["rows"], "not certified")
    if of_all:
        yield f"{said}:", False
        for name, margin in of_all.items():
            yield _line(name, margin, _refuted(margin))


def _at_frequency(omega: float, hz: float | None) -> str:
    """Where a margin is reached; omega: rad/s, as it is seen once a frame."""
    if hz is None:
        return ""
    if isclose(2 * pi * hz, omega, rel_tol=1e-6, abs_tol=1e-9):
        return f", at {omega:.5g} rad/s ({hz:.4g} Hz)"
    return f", at {hz:.4g} Hz (seen once a frame: {omega / (2 * pi):.4g} Hz)"


def _refuted(margin: Mapping[str, Any]) -> str:
    """Where a margin for all of a box is refuted, and by what."""
    below = margin["fails_below"]
    end = margin["fails_from"]
    if below is not None:
        where = f"below {rounded_down(below)}"
    elif end is not None:
        where = f"from {rounded_up(end)} on"
    else:
        return ""
    return f", refuted {where} by {margin['counterexample']}"


def _line(name: str, margin: Numbers, more: str) -> Line:
    """The line of a margin, rounded to the safe side, and whether it warns; more: words behind its size."""
    doubt = f"not certified ({margin['doubt']})" if margin["doubt"] else ""
    if margin["value"] is None:
        return f"{SAID[name]}: {doubt}{more}", True
    if not margin["limited"]:
        return f"{SAID[name]}: {doubt or 'no limit'}", bool(doubt)
    if margin["unit"] in (RATIO, UNITS["delay_frames"]):
        unit = ""
    else:
        unit = f" {margin['unit']}"
    if name in ROUNDED_UP:
        size = rounded_up(margin["value"])
    else:
        size = rounded_down(margin["value"])
    return f"{SAID[name]} {size}{unit}{more}{doubt and ', '}{doubt}", bool(doubt)


KINDS = (
    Kind(
        "margins",
        lambda _: SingleBlockSummary(_numbers),
        _lines,
        figure="wavesweep.margins.figure.margins",
        again=from_spec(margins, "cut"),
        vouched=("value",),
    ),
)
