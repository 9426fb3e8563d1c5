"""What a report says: the lines, tables and figures that other commands give for one spec;
nothing is computed here alone."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from shlex import quote
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from wavesweep.capabilities import modules, offered
from wavesweep.engine.errors import WavesweepError
from wavesweep.haptics.controllers import HAND
from wavesweep.program.analyses.claim_words import (
    beyond_the_ends,
    claimed,
    known_in_words,
    of_intervals,
    verdict_lines,
    walls_in_words,
)
from wavesweep.program.analyses.claims import Claim, Property, Status
from wavesweep.program.columns import whose_column
from wavesweep.program.number_words import in_all_digits
from wavesweep.program.row_kinds import row_kinds
from wavesweep.reports import report_page as html
from wavesweep.reports.sentences import (
    claims_of_rows,
    counterexamples,
    interval_rows,
    question,
    words_of_spec,
)

if TYPE_CHECKING:
    from wavesweep.program.analyses.claims import Verdict
    from wavesweep.program.spec import Spec
    from wavesweep.program.tables.kind import Line
    from wavesweep.program.tables.table import Table

INTERVALS, RESPONSE = "Stable intervals", "Frequency response"
WISHES = "What is wished for"
PANEL = 'id="axes_'  # is in the SVG of a figure with panels
TIMING = "When it samples, computes and acts"
SAME = (
    "With --proof a command says which rows have a proof file, which wavesweep verify has a checker of its own read; it computes "
    "rows of the tables again as well. The last command gives this file. On a processor of another type, or with another version "
    "of numpy, last digits may differ, and so may the hashes."
)


@dataclass(frozen=True)
class ReportRequest:
    """What is asked of a report in addition to the spec.

    cut: the signal for the margins, by default the one at which the spec asks for them. hands: words for
    guarantees, see `hands_of`. overrides: the texts of --set that the spec was loaded with.
    at_work: is called with what is done from now on, and gives a function of (done, total) or None.
    """

    cut: str = ""
    hands: tuple[str, ...] = ()
    overrides: tuple[str, ...] = ()
    at_work: Callable[[str], Any] = lambda _: None


@dataclass(frozen=True)
class ReportSection:
    """A table as the report has it: its summary, its figure, and the command that makes it with the
    hash of its CSV.

    known: how its numbers are; empty of the intervals, which are the answer.
    """

    title: str
    known: str
    table: Table
    lines: tuple[Line, ...]
    svg: str
    command: str
    sha256: str


def _in_order(sections: Iterable[ReportSection], number: int) -> Iterator[str]:
    """Yield the sections with their figures, from this number on."""
    for section in sections:
        if not section.known:
            continue
        yield html.element("h2", section.title)
        yield html.element("p", section.known, "small")
        yield html.listing(section.lines)
        if section.svg:
            yield html.figure(section.svg, number, f"{section.title}: {section.command}")
            number += 1


def report(spec: Spec, asked: ReportRequest) -> str:
    """The report of a spec as the text of an HTML file; the same spec and request give the same
    text.

    Errors: UsageError for words that name no hands. What the spec does not allow is in the report,
    with the reason.
    """
    settings = [f" --set {quote(override)}" for override in asked.overrides]
    name = quote(f"{spec.name}.toml") + "".join(settings)
    sections: dict[str, ReportSection] = {}
    missing = []

    def leave_out(title, error):
        # The page leaves the folder of the spec.
        text = str(error).replace(str(spec.source), f"{spec.name}.toml")
        missing.append((f"{title}: {' '.join(text.split())}", False))

    for title, (command, make) in _tables(spec, asked).items():
        watch = asked.at_work(title.lower())
        try:
            sections[title] = _found(title, make(watch), f"wavesweep {command.format(name)}")
        except WavesweepError as error:
            leave_out(title, error)
    asked.at_work("the spec's own numbers")
    swept = sections[INTERVALS].table if INTERVALS in sections else None
    design_lines, judged, how_known = _own_lines(spec, swept)
    body = [html.element("h1", spec.name), html.element("p", question(spec), "question")]
    if words := words_of_spec(spec):
        body.append(html.element("p", f"In the words of the spec: {words}", "small"))
    asked.at_work("the wishes")
    try:
        body += _wishes(spec)
    except WavesweepError as error:
        leave_out(WISHES, error)
    body += [
        *_answer(spec, sections.get(INTERVALS), design_lines[0], judged),
        *_counterexamples(spec, sections.get(INTERVALS)),
    ]
    body += [
        html.element("h2", "The spec's own numbers"),
        html.element("p", how_known, "small"),
        html.listing(design_lines),
    ]
    number = 1 + (INTERVALS in sections)
    if svg := _picture_of_time(spec):
        body.append(html.figure(svg, number, f"{TIMING}: wavesweep check {name} --plot"))
        number += 1
    body += _in_order(sections.values(), number)
    body += [html.element("h2", "Not in this report"), html.listing(missing)] if missing else []
    return html.page(
        spec.name,
        [*body, *_verification(spec, sections.values(), name, asked), *_text(spec, asked)],
    )


def _tables(spec: Spec, asked: ReportRequest) -> dict[str, tuple[str, Callable[[Any], Table]]]:
    """Title -> the command of the table of a section, with {} for the spec, and a function of the
    watcher of its progress that makes the table.
    """
    from wavesweep.program.tables import interval_table as intervals
    from wavesweep.program.tables import response_table as responses
    from wavesweep.program.tables.hand_rows import hands_of

    hands = hands_of(asked.hands)
    along_wall = not spec.drawing and spec.names.find(spec.along).path == spec.wall[0]
    command = ("zwidth" if along_wall else "stability-region") + " {}" + _for_hands(asked)
    kind = command.partition(" ")[0] + ("-hands" if hands else "")
    tables = {
        INTERVALS: (
            command,
            lambda watch: replace(
                intervals.intervals(spec, hands=hands, progress=watch), kind=kind
            ),
        )
    }
    for part in sorted(modules("section"), key=lambda each: each.PLACE):
        for title, said, make in part.sections(spec, asked.cut):
            tables[title] = said, lambda _, make=make: make()
    return tables | {RESPONSE: ("bode {}", lambda _: responses.responses([spec]))}


def _for_hands(asked: ReportRequest) -> str:
    return "".join(f" --for-hands {quote(word)}" for word in asked.hands)


def _found(title: str, table: Table, command: str) -> ReportSection:
    """A table written, drawn and summarised, as its command does all of it."""
    from wavesweep.program import results
    from wavesweep.program.plots import drawn
    from wavesweep.program.tables import kind_named

    kind, notices = (
        kind_named(table.kind),
        [(str(notice), False) for notice in table.facts.get("notices", ())],
    )
    tally = kind.tally(table)
    csv, svg = results.pictured(
        drawn(table, lambda text: notices.append((text, False))).watched(tally.add)
    )
    if PANEL not in svg:  # nothing to be drawn, as of a limit that a range ends
        svg = ""
    lines = (*kind.lines(tally.numbers(table.facts)), *notices)
    claims = [Claim.read(fact) for fact in table.facts["claims"].values()]
    how_known = "" if title == INTERVALS else known_in_words(claims)
    return ReportSection(title, how_known, table, lines, svg, command, sha256(csv).hexdigest())


def _own_lines(spec: Spec, swept: Table | None) -> tuple[list[Line], Verdict, str]:
    """The lines about the spec's own numbers, each with whether it warns, the verdict on what the
    spec asks, and how the ranges and the modes in these lines are known.

    swept: the spec's table of intervals, None without one.
    """
    from wavesweep.program.analyses.assumptions import over_preset, unusual
    from wavesweep.program.analyses.claims import Verdict
    from wavesweep.program.analyses.own_design import own_claim, own_design, own_lines

    found = own_design(spec)
    lines = [*own_lines(spec, found)]
    judging = offered("verdict")
    claims = [*claims_of_rows(spec, swept)] if swept else []
    if judging:
        found |= judging.further(spec, found | {"swept": swept.columns if swept else {}})
        claims += found["claims"]
        lines += [line for _, line in judging.verdict_lines(spec, found)]
    lines += [*unusual(spec), *over_preset(spec)]
    warning = re.compile("not certified|not known|not stable|UNSTABLE")
    marked = [(line, bool(warning.search(line))) for line in lines]
    own = own_claim(spec, found)
    claims_of_lines = []
    if limits := found.get("limits"):
        ranges = Property("ranges of each number alone", "figures")
        certified = all(limit["certified"] for limit in limits)
        status = Status.CERTIFIED if certified else Status.COMPUTED
        claims_of_lines.append(replace(own, what=ranges, status=status, reason=""))
    modes = Property("modes and what is felt", "figures")
    claims_of_lines.append(replace(own, what=modes, status=Status.COMPUTED, reason=""))
    return marked, Verdict.of(spec, [own, *claims]), known_in_words(claims_of_lines)


def _picture_of_time(spec: Spec) -> str:
    """The picture of time as SVG; empty if no capability draws it, or nothing runs in ticks."""
    timing = offered("timing")
    if timing is None or not timing.has_moments(spec):
        return ""
    from wavesweep.program.plots.figure_files import save
    from wavesweep.program.plots.style import about_figure

    with TemporaryDirectory() as folder:
        figure = Path(folder, "timing.svg")
        save(timing.timing(spec), figure, about_figure("timing", {"spec_name": spec.name}))
        return figure.read_text(encoding="utf-8")


def _assumed(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield what the rows of a table assume: the model, the methods, and the claims."""
    if facts["assumes"]:
        yield f"The model: {facts['assumes']}."
    for method in facts["methods"].values():
        yield f"Method: {method}."
    claims = {word: Claim.read(fact) for word, fact in facts["claims"].items()}
    for word, claim in claims.items():
        subject = f"Rows of {row_kinds()[word].legend}" if len(claims) > 1 else "Rows"
        yield f"{subject}: {claimed(claim)}."
    for wall in dict.fromkeys(walls_in_words(claim.scope) for claim in claims.values()):
        yield f"{wall}."


def _of_nobody(spec: Spec, table: Table) -> Iterator[str]:
    """Yield that a device with a port for a hand is held by none, if rows are of the spec's own numbers."""
    with_port = not spec.drawing or spec.drawing.hand
    if (
        with_port
        and "spec" in table.facts["claims"]
        and not any(spec.values.get(key) for key in HAND)
    ):
        yield "Nobody holds the device: --for-hands has rows for hands"


def _answer(
    spec: Spec, intervals: ReportSection | None, own: Line, judged: Verdict
) -> Iterator[str]:
    """The verdict on what the spec asks, and the intervals of the sweep, with what the proof
    assumes.

    own: the first line about the spec's own numbers; judged: the verdict.
    """
    yield html.element("h2", "Answer")
    first, *others = verdict_lines(judged, _own_place(spec))
    title = f"{first}."
    good = judged.status > Status.UNKNOWN
    lines = [(line.strip(), not good) for line in others]
    if not intervals:
        yield html.verdict(good, title, "The ranges of its numbers follow below.", [*lines, own])
        return
    rows = interval_rows(intervals.table)
    doubtful = any(warned for _, warned in intervals.lines)
    # Lines of single slices repeat the rows that follow.
    repeats = bool(rows) and not whose_column(intervals.table.columns)
    for text, warning in intervals.lines:
        if warning or not (repeats and text.startswith("  ")):
            lines.append((text, warning))
    how_known = _known(intervals.table, doubtful=doubtful)
    yield html.verdict(good and not doubtful, title, how_known, [*lines, own])
    if rows:
        yield html.table(*rows)
    else:
        yield html.element("p", f"All rows: {intervals.command}", "small")
    yield html.figure(intervals.svg, 1, f"{intervals.title}: {intervals.command}")
    yield html.element("h2", "What the proof assumes")
    lines = [*_assumed(intervals.table.facts), *_of_nobody(spec, intervals.table)]
    yield html.listing((line, False) for line in lines)


def _own_place(spec: Spec) -> str:
    """The value of the spec's own design on the axis of the sweep."""
    along = spec.along and spec.names.find(spec.along)
    if not along:
        return "With its own numbers"
    unit = "" if along.unit in ("", "1") else f" {along.unit}"
    return f"With its own {spec.along} = {in_all_digits(spec.values[along.path])}{unit}"


def _known(table: Table, *, doubtful: bool) -> str:
    """How the intervals of the sweep are known; doubtful: whether some line about them is a
    warning."""
    if doubtful and table.columns["certified"].all():
        return "The intervals are certified, but not known everywhere: a line below says where."
    if doubtful:
        return "Not all of the intervals are certified."
    claims = [Claim.read(fact) for fact in table.facts["claims"].values()]
    some = bool(table.columns["intervals"].any())
    said = [of_intervals(claim, some=some) for claim in claims]
    if len({*said}) == 1:
        return said[0]
    return "How the intervals are known stands in each row."


def _wishes(spec: Spec) -> list[str]:
    """Each wish of the spec, what is asked and what is reached; nothing without one."""
    module = offered("wished")
    if not (module and spec.design):
        return []
    rows, claims = module.wished(spec)
    return [
        html.element("h2", WISHES),
        html.table(("wish", "asked", "reached by the spec's own numbers", "met"), rows),
        html.element("p", known_in_words(claims), "small"),
    ]


def _counterexamples(spec: Spec, intervals: ReportSection | None) -> Iterator[str]:
    """What is unstable beyond the certified intervals."""
    if intervals and (rows := counterexamples(spec, intervals.table)):
        yield html.element("h2", "Refuted beyond")
        claims = [Claim.read(fact) for fact in intervals.table.facts["claims"].values()]
        yield html.element("p", beyond_the_ends(claims), "small")
        yield html.table(("with", "value", "what refutes it"), rows)


def _verification(
    spec: Spec, found: Iterable[ReportSection], name: str, asked: ReportRequest
) -> Iterator[str]:
    """Versions, digests, and the commands that give all of it again."""
    from wavesweep.program.platform_compat import versions

    found = list(found)
    again = f"wavesweep report {name}{_for_hands(asked)}" + (
        f" --cut {quote(asked.cut)}" if asked.cut else ""
    )
    folders = []  # one more for a kind of table that is there already
    for entry in found:
        others = sum(each[0] == entry.table.kind for each in folders)
        folders.append((entry.table.kind, f"verified-{others + 1}" if others else "verified"))
    commands = []
    for entry, (_, folder) in zip(found, folders, strict=True):
        proof = " --proof" if entry.title == INTERVALS else ""
        commands.append(f"{entry.command}{proof} --out {folder}")
    for folder in dict.fromkeys(folder for _, folder in folders):
        commands.append(f"wavesweep verify {folder}")
    yield html.element("h2", "How to verify this report")
    yield html.element("p", f"Save the spec below as {spec.name}.toml, and run:")
    yield html.element("pre", "\n".join([*commands, again]))
    yield html.element("p", SAME, "small")
    used = versions()
    rows = [
        ("wavesweep", used["tool_version"]),
        ("numpy", used["numpy_version"]),
        ("SHA-256 of the resolved spec", spec.sha256),
    ]
    rows += [
        (f"SHA-256 of {folder}/{kind}.csv", entry.sha256)
        for entry, (kind, folder) in zip(found, folders, strict=True)
    ]
    yield html.table(("what", "version or hash"), rows)


def _text(spec: Spec, asked: ReportRequest) -> Iterator[str]:
    """The spec as it was written; that of nested tables as TOML."""
    from wavesweep.program.spec.writing import as_toml

    yield html.element("h2", f"The spec, {spec.name}.toml")
    if asked.overrides:
        yield html.element(
            "p", f"With these keys set to other values: {', '.join(asked.overrides)}", "small"
        )
    yield html.element("pre", spec.source_place.text or as_toml(spec.tables()))
