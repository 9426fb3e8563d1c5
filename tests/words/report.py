"""What a report says of a loop: each text with a number is a line of a command, or has a shape here.

Its tables are those of the commands, rounded to the safe side, and its hashes those of their files.
"""

# ruff: noqa: ARG001 (a function has the numbers of its line, also those that it does not need)
import re
from hashlib import sha256
from importlib.metadata import version
from math import floor, log, log10
from pathlib import Path

import pandas
from words.loops import STOP, T, greatest
from words.page import texts_of
from words.sentences import N, fails, hold, is_cell, known, loops, mode_at_end, near, of_members, own, pole, shape

# Of which commands the lines of a section are.
SECTIONS = {
    "Answer": ("stability-region", "check"),
    "The spec's own numbers": ("check",),
    "What sets the limits": ("why",),
    "Margins": ("margins",),
    "Simulation": ("simulate",),
    "Frequency response": ("bode",),
}
TABLES = {"Frequency response": "bode-ports", "What sets the limits": "why", "Simulation": "simulate", "Margins": "margins"}
COLUMNS = {  # of the table of intervals, by their heads
    "K from": "low",
    "to": "high",
    "refuted below": "fails_below",
    "refuted from": "fails_from",
    "lower limit oscillates at (Hz)": "low_hz",
    "upper limit oscillates at (Hz)": "high_hz",
    "lower limit set by": "low_set_by",
    "upper limit set by": "high_set_by",
}
UP, DOWN = ("low", "fails_from"), ("high", "fails_below")  # how bounds are rounded
TENTH_DIGITS = 1e-12  # relative: by which a rounded bound may miss one that has few digits
THREE_DIGITS = 6e-3  # relative: half of the third one, and what follows from it


def last_digit(value, digits):
    """What a value is short of at most that is rounded down to so many digits."""
    return 10.0 ** (floor(log10(abs(value))) + 1 - digits) * (1 + 1e-9)


def hold_page(run, verdict):
    """The headline of the report is the verdict, and each text with a number holds."""
    page = Path("r.html").read_text(encoding="utf-8")
    texts = texts_of(page)
    (headline,) = [text for _, kind, text in texts if kind == "strong"]
    (doubt,) = re.findall(r'<div class="verdict( doubt)?">', page)
    assert doubt or verdict["answer"] == "yes"
    if verdict["answer"] == "no":
        assert re.search(" not (stable|as required)", headline), headline
    run.figure = 0
    run.cut = ""
    head = []
    before = None
    rows = iter(run.rows)
    for section, kind, text in texts:
        if section != before:
            before = section
            run.word = "spec"
        if found := re.match(r".*? \((\w+)\):$", text):
            run.word = found[1]
        cells = [each.strip() for each in text.split("|")]
        if section == "Answer" and kind == "tr":
            head = head or cells
            if cells != head:
                hold_cells(run, dict(zip(head, cells, strict=False)), next(rows))
        elif kind == "pre":
            assert text.startswith("wavesweep ") or text == Path("mine.toml").read_text(encoding="utf-8").strip(), text
        elif re.search(r"\d", text) and kind != "h1":
            commands = ["drawn"] if kind == "drawn" else ["report", *SECTIONS.get(section, ())]
            hold_text(run, section, commands, text)
    assert next(rows, None) is None


def hold_text(run, section, commands, text):
    """A text of the page is a line of one of some commands, which may be indented there."""
    path = Path(f"t/{TABLES.get(section)}.csv")
    run.table = pandas.read_csv(path).to_dict("records") if path.exists() else ()
    for run.command in commands:
        for line in (text, f"  {text}"):
            if known(run, line):
                hold(run, line)
                return
    hold(run, text)


def hold_cells(run, cells, row):
    """A row of the table is that of the file: bounds to the safe side, frequencies in six digits."""
    for title, cell in cells.items():
        value = row.get(COLUMNS.get(title))
        if title == "c":
            assert near(float(cell), row["c"], 1e-6), cells
        elif title == "for":
            assert cell == {"spec": "nominal numbers", "for_all": "proved for all"}.get(row["guarantee"], cell), cells
        elif title == "proof":
            how = run.claims[row.get("guarantee", "spec")]["status"]
            assert cell.startswith(how if row["certified"] else "not certified"), (cells, how)
        elif title.endswith("set by") and cell:
            assert cell == value, (cells, row)
        elif cell in ("", "none"):
            assert pandas.isna(value), (cells, row)
        else:
            name, shown = COLUMNS[title], float(cell)
            assert near(shown, value, 1.1e-5), (cells, row)
            assert name not in UP or shown >= value * (1 - TENTH_DIGITS), (cells, row)
            assert name not in DOWN or shown <= value * (1 + TENTH_DIGITS), (cells, row)


@shape(rf"For which K from {N} to {N}(?:, for each of c = {N}, {N},)? is (.*)\?", "report")
def question(run, start, stop, one, other, said):
    several = run.case.tables["sweep"].get("c", [])
    assert len(several) < 2 or [one, other] == several, said
    assert not run.case.level or f"{run.case.level:g}" in said, said
    return (start, stop) == (run.case.start, STOP) and of_members(run, said)


@shape(rf"With its own K = {N}: (.*)\.", "report")
def headline_of(run, K, said):
    run.command = "check"
    hold(run, f"mine, drawn: {said}")
    return near(K, run.case.tables["numbers"]["K"], 1e-6)


@shape(rf"mine, drawn: (stable|UNSTABLE) \(spectral radius {N} per frame of {N} ms\)", "report")
def own_line(run, said, radius, ms):
    z, seconds = own(run)
    return near(radius, abs(z)) and near(ms, 1e3 * seconds) and (abs(z) < 1) == (said == "stable")


@shape(r"((?:Rows|By what each line names|Ranges|Limits|Margins|A run|Responses)\b.*)", "report")
@shape(r"(?:K )?((?:elasticity: .* )?(?:(?:low|high) end, K = .* no bars|[A-Z][a-z]*[, ]).*)", "drawn")
def claimed(run, said):
    slow = rf"step response: c = {N}(?:; c = {N})*"
    found = re.search(slow, said)
    for each in re.findall(rf"c = {N}", found[0] if found else ""):
        assert float(each) in run.case.members["c"], said
        assert abs(pole(run, run.case.own_length, float(each), run.case.tables["numbers"]["K"])) > 0.999, said
    for each in re.findall(rf"end, K = {N}: no bars", said):
        assert any(near(float(each), row["limit_value"], 1e-4) for row in run.table), said
    return of_members(run, re.sub(rf"{slow}|cut off around -1|end, K = {N}: no bars(?:, as a limit of 0\b)?", "", said))


@shape(r"Figure (\d+)\. ([^:]*): wavesweep [a-z-]* mine\.toml(?: --plot| --cut [hp]\.y| --set simulate\.input=step)?", "report")
def caption(run, number, title):
    run.figure += 1
    return number == run.figure


@shape(r"SHA-256 of verified/(\S+)\.csv \| ([0-9a-f]{64})", "report")
def hash_of_table(run, name, digits):
    return digits == sha256(Path(f"t/{name}.csv").read_bytes()).hexdigest()


@shape(r"SHA-256 of the resolved spec \| ([0-9a-f]{64})", "report")
def hash_of_spec(run, digits):
    return digits == run.facts["spec_sha256"]


@shape(r"((?:wavesweep|numpy) \| \S+)", "report")
def versions(run, said):
    name, _, number = said.partition(" | ")
    return number == version(name)


# What is refuted beyond the ends.


def place(run, said):
    """Of which member a line is, as the beginning of a refuter; of whose rows, by their name, is kept."""
    found = re.search(rf"\bc = {N}", said)
    legends = {"proved for all": "for_all", "proved in mean square": "mean_square"}
    run.word = next((word for legend, word in legends.items() if legend in said), "spec")
    return f"c = {found[1]}, " if found else ""


@shape(
    rf"(?:(.*) \| )?K = {N} \| eigenvalue {N} per frame, modulus 1 \+ {N}: (?:an oscillation of {N} Hz|without oscillation), "
    rf"grows by a factor of e in {N} s",
    "report",
)
def grows_beyond(run, said, K, eigenvalue, more, hz, seconds):
    n = run.case.own_length
    found = re.search(rf"c = {N}", said or "")
    c = float(found[1]) if found else run.case.tables["numbers"]["c"]
    z = pole(run, n, c, K)
    assert near(eigenvalue, z, 1e-5), (eigenvalue, z)
    # K has seven digits, so what is beyond 1 has fewer.
    spare = 1e-6 * abs(pole(run, n, c, K * 1.001) - z) / 0.001
    assert abs(more - (abs(z) - 1)) <= spare + THREE_DIGITS * more, (more, z)
    frame = n * T
    assert abs(frame / seconds - log(abs(z))) <= spare + THREE_DIGITS * log(abs(z)), (seconds, z)
    return abs(z) > 1 and (z > 0 if hz is None else near(hz, 0.5 / frame, 1e-3))


@shape(rf"(?:(.*) \| )?K = {N} \| (messages h: .*|frames .*|[cn] = .*|not .*|.*second moments.*)", "report")
def fails_beyond(run, said, K, refuter):
    if "messages" in refuter:
        refuter = re.sub(r"\b0\b", "in time", refuter.replace("messages h:", "messages of h:"))
    member = place(run, said or "")
    assert is_cell(run, K, "fails_from") or is_cell(run, K, "fails_below"), K
    return fails(run, member + refuter, K)


# Figures.


@shape(rf"largest([a-z, ]*): (?:at least )?{N}(?:, from {N})?", "drawn")
def largest_drawn(run, of, high, low):
    place(run, of)
    truth = max(map(greatest, run.sets()))
    assert high <= truth * (1 + TENTH_DIGITS), (high, truth)
    assert near(high, truth, 1e-2 if run.word == "for_all" else 2e-4), (high, truth)
    lows = [row["low"] for row in run.rows if row.get("guarantee", "spec") == run.word]
    return low is None or any(-TENTH_DIGITS * each <= low - each <= last_digit(each, 5) for each in lows)


@shape(rf"c = {N}", "drawn")
def panel(run, c):
    return c in (*run.factors(), *run.case.members["c"])


@shape(rf"{N} Hz [a-z]+(?:, [a-z]+)*", "drawn")
@shape(rf"slow Nyquist frequency, {N} Hz", "drawn")
def rate(run, hz):
    """That of a tick or of a frame, or half of it."""
    return any(near(hz, each / T, 6e-4) for each in (1, 1 / longest(run), 0.5 / run.case.tables["numbers"]["n"]))


def longest(run):
    """Ticks of the frame that is drawn: the longest of several that vary, else the spec's own."""
    lengths = run.case.members["n"]
    vary = run.case.asks in ("frames", "both") and len(lengths) > 1
    return max(lengths) if vary else run.case.tables["numbers"]["n"]


@shape(rf"a frame of {N} ms", "drawn")
def frame_of(run, ms):
    return near(ms, 1e3 * longest(run) * T, 6e-4)


# The legend of the margins, whose rows are held where the command prints them.


@shape(
    rf"(gain up|gain down|phase|delay|delay frames|disk margin) {N}(?:°| ms)?(?: \({N} dB\))?(?: at {N} Hz)?(, proved .*)?",
    "drawn",
)
def margin_drawn(run, name, value, decibels, hz, proved):
    word = "for_all" if proved else "spec"
    assert of_members(run, proved or "")
    rows = [row for row in run.table if row.get("guarantee", "spec") == word]
    row = next(row for row in rows if row["margin"] == name.removesuffix(" margin").replace(" ", "_"))
    truth = row["value"] * (1e3 if name == "delay" else 1)
    assert abs(value - truth) < last_digit(truth, 4 if "delay" in name else 3), (value, truth)
    assert value >= truth if name == "gain down" else value <= truth * (1 + TENTH_DIGITS), (value, truth)
    if decibels is not None:
        expected = 20 * log10(truth)
        assert abs(decibels - expected) < last_digit(expected, 3)
        assert (decibels - expected) * (1 if name == "gain down" else -1) >= -1e-9 * abs(expected)
    return hz is None or near(hz, row["hz"], 1e-3)


def steps(run):
    """How `T = L/(1 + L)` comes to 1 after a step, as shares, in each of 4,000 frames."""
    (loop,) = loops(run, False)
    z = loop.q - loop.g
    return [1 - z**frame for frame in range(4000)]


def is_time(run, frames, time, unit):
    """Whether a printed time is that of so many samples of the signal that is cut, or of a tick in place of none."""
    return near(time / (1e3 if unit == "ms" else 1), frames * own(run)[1] or T, 1e-3)


@shape(rf"rise time (?:< )?{N} (m?s)", "drawn")
def rises(run, time, unit):
    """From the first sample above a tenth to the first above nine tenths; within a tick it is said that it is shorter."""
    shares = steps(run)
    first, second = (next(frame for frame, share in enumerate(shares) if share >= level) for level in (0.1, 0.9))
    return is_time(run, second - first, time, unit)


@shape(rf"within 2 % after {N} (m?s)", "drawn")
def settled_drawn(run, time, unit):
    away = [frame for frame, share in enumerate(steps(run)) if abs(share - 1) > 0.02]
    return is_time(run, away[-1] + 1, time, unit)


@shape(rf"overshoot {N} % at {N} (m?s)", "drawn")
def overshoots(run, share, time, unit):
    shares = steps(run)
    most = max(shares)
    return near(share, 100 * (most - 1), 1e-3) and is_time(run, shares.index(most), time, unit)


@shape(r"gain 1", "drawn")
def circle(run):
    """The circle at which the gain of L is 1."""


# The titles and notes of the other figures.


@shape(rf"{N} without effect", "drawn")
def without_effect(run, count):
    ends = {row["limit_value"] for row in run.table}
    unmoved = [sum(row["limit_value"] == end and abs(row["elasticity"]) < 1e-9 for row in run.table) for end in ends]
    return count > 0 and count in unmoved


@shape(rf"(high|low) end, K = {N} (an oscillation .*|a mode .*) p integral 100 %", "drawn")
def limit_drawn(run, which, value, said):
    """It has fewer digits than the line, and is rounded inwards."""
    truth = run.case.inside(run.case.own(), required=False)
    end = min((pair[which == "high"] for pair in truth), key=lambda each: abs(each - value))
    inwards = end - value if which == "high" else value - end
    assert -TENTH_DIGITS * abs(end) <= inwards <= last_digit(end or 1, 5), (value, end)
    return mode_at_end(run, which, end, said, 2)


@shape(rf"(un)?stable: spectral radius {N} per frame(?:; stopped, numbers overflow)?", "drawn")
def radius_drawn(run, un, radius):
    size = abs(own(run)[0])
    return near(radius, size, 1e-3) and (size >= 1 + 1e-9) == bool(un)
