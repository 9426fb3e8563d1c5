"""What each printed line with a number has to be: a shape for each, which holds its numbers against the closed form.

A line with a number that has no shape is a fault: nobody has said what it claims.
"""

# ruff: noqa: ARG001 (a function has the numbers of its line, also those that it does not need)
import re
from dataclasses import dataclass, replace
from itertools import product
from math import acos, asin, floor, hypot, inf, isfinite, log, log10, pi, prod, radians, sqrt

import numpy as np
from words.loops import AT_RANDOM, CONSERVES, STOP, VARYING, T, greatest, least

N = r"(-?(?:\d[\d.]*(?:e[+-]?\d+)?|inf))"
OUTWARDS = 1e-10  # relative: by which an end may lie beyond the closed form's, which rounds too
PROVED = 1e-2  # relative: by which a proof for all may miss an end
DIGITS = 2e-5  # relative: of six digits, and what follows from two of them
BEYOND = r"(?: \((?:where the search starts|the edge of that axis)\))?"
AT = rf"(?: at c = {N}{BEYOND})?"
SHAPES = []


@dataclass
class Run:
    """What a command said of a case; word: of which rows a line is; rows, claims, facts: of the table of intervals; table: rows
    of the table of the command; figure: number of the last figure of a report."""

    case: object
    command: str
    word: str = "spec"
    rows: tuple = ()
    claims: dict = None
    facts: dict = None
    table: tuple = ()
    cut: str = ""
    figure: int = 0

    def members(self, c=None):
        """Of whom a line is."""
        return self.case.all_of(c) if self.word in ("for_all", "mean_square") else self.case.own(c)

    def factors(self):
        """The values of c in the swept rows."""
        return self.case.tables["sweep"].get("c", [None])

    def sets(self, c=None):
        """The intervals of K, for one c or of each swept one."""
        return [self.case.inside(self.members(each)) for each in ([c] if c else self.factors())]


def shape(pattern, command=""):
    """A function that holds the numbers of a line of this pattern."""

    def kept(function):
        SHAPES.append((re.compile(pattern), command, function))
        return function

    return kept


def known(run, line):
    """The shape of a line and what it has of it; None of a line without one."""
    shapes = [(pattern, function) for pattern, command, function in SHAPES if run.command.startswith(command)]
    return next(((function, found) for pattern, function in shapes if (found := pattern.fullmatch(line))), None)


def hold(run, line):
    """Hold a line against the closed form."""
    found = known(run, line)
    assert found, f"nothing says what this claims: {run.case.seed} {run.command}: {line}"
    function, said = found
    numbers = [None if each is None else float(each) if re.fullmatch(N, each) else each for each in said.groups()]
    held = function(run, *numbers)
    assert held is None or held, (run.case.seed, run.command, run.word, line)


def near(first, second, digits=DIGITS):
    """Whether a printed number is another one, in six digits."""
    return abs(first - second) <= digits * max(abs(first), abs(second)) + 1e-9


def within(low, high, intervals):
    """Whether a range lies in one of some intervals."""
    return any(a <= low * (1 + OUTWARDS) and high <= b * (1 + OUTWARDS) for a, b in intervals)


def are_ends(low, high, intervals, digits=DIGITS):
    """Whether a range is one of some intervals, but for rounding to the safe side; digits: of a proof, how near it comes."""
    low, high = float(low), float(high)
    return within(low, high, intervals) and any(near(low, a, digits) and near(high, b, digits) for a, b in intervals)


def is_cell(run, value, *columns):
    """Whether a bound is that of one of some columns of a row of the table of intervals, rounded to the safe side."""
    up = {*columns} & {"low", "fails_from"}
    cells = [row[column] for row in run.rows for column in columns if row.get("guarantee", "spec") == run.word]
    return any(near(value, each) and (value - each) * (1 if up else -1) >= -1e-12 * abs(each) for each in cells)


def gain(run, K):
    """f(K)."""
    zeros = run.case.zeros
    return (K - zeros[0]) * (K - zeros[1]) / zeros[1] if zeros else K


def at_rest(run):
    """Where y settles after a step."""
    numbers = run.case.tables["numbers"]
    c, f = numbers["c"], gain(run, numbers["K"])
    drive = c * f if run.case.asks == "gain" else c
    return drive / (run.case.leak + c * f) if run.case.leak or f else 0.0


def pole(run, n, c, K):
    """That of a frame."""
    return run.case.held(n, c, gain(run, K))


def own(run):
    """The pole of the spec's own frame without what drifts, and its length (s)."""
    numbers = run.case.tables["numbers"]
    seconds = numbers["n"] * T
    if run.case.asks == CONSERVES:
        return 1.0, seconds
    if not run.case.leak and gain(run, numbers["K"]) == 0:
        return 0.0, seconds
    return pole(run, numbers["n"], numbers["c"], numbers["K"]), seconds


def noise(run, lost):
    """The root mean square of y under white noise of 1 in r, the mean over all ticks, with samples lost with a probability.

    With g as at the head of `loops`, s = n (T c)^2 and m = lost/(1 - lost), a frame begins with E x^2 = X,
    X = s/(2 g - g^2 (1 + 2 m)), and holds h with E h^2 = X and E x h = X (1 - m g); its tick j has x - (j/n) g h and
    the noise of j ticks, j s/n.
    """
    numbers = run.case.tables["numbers"]
    n, c = numbers["n"], numbers["c"]
    g = 1 - pole(run, n, c, numbers["K"])
    s = n * (T * c) ** 2
    m = lost / (1 - lost)
    X = s / (2 * g - g**2 * (1 + 2 * m))
    part = np.arange(n) / n
    return sqrt(np.mean(X * (1 - 2 * part * g * (1 - m * g) + (part * g) ** 2) + part * s))


@shape(
    r"Wrote .* in \S+ s|(?:still [a-z ]+|at work(?: on [a-z ]*)?) after \d+ (?:s|min|h)(?:; [a-z ,]*)?"
    r"|all \d+ done after \d+ (?:s|min|h)[;,]?.*|assumes: kept.*"
)
def nothing(run, *_):
    """Times that a clock has measured."""


@shape(rf"  white noise of 1 in r: rms of y {N}, {N} with all in time", "check")
def white_noise(run, at_random, in_time):
    return near(at_random, noise(run, run.case.members["lost"])) and near(in_time, noise(run, 0.0))


@shape(
    rf"(?:.*: )?{N} of {N} done \({N} %\)(?:, \d+ certified)? after \d+ (?:s|min|h)(?:; [a-z ,]*)?"
    rf"(?:; (?:design \d+ of \d+: )?[\w.]+ proved from {N} to {N}(?: so far \({N} % of the way\)| on {N} % of the box so far))?"
    r"(?:, about \d+ (?:s|min|h) left)?(?:; [a-z \[\]]*)?"
)
def progress(run, done, count, share, low, high, *shares):
    assert share == int(100 * done / count)
    assert done < count
    assert run.command != "stability-region" or count == len(run.factors()) * len(run.claims), count
    if low is None:
        return True
    return any(within(low, high, each) for each in run.case.proved) and max(filter(None, shares)) <= 100


@shape(rf"(?:  )?(?:K |The model: |.* Assumes: )?(?:assumes: )?linear while \|s.u\| <= {N}; simulate keeps to these limits\.?")
def limits_of_wall(run, limit):
    return limit == run.case.tables["block"]["s"]["high"]


@shape(rf"{N} rows without a reliable value \(rounding\)", "bode")
def no_value(run, count):
    unsure = run.case.asks == CONSERVES or abs(abs(own(run)[0]) - 1) < 1e-9
    return unsure and count == sum(each["doubt"] == "rounding" for each in run.table)


@shape(rf"({N}) of {N} curves? of loops not known to be stable, see the column doubt", "bode")
@shape(rf"({N}) of {N} curves? of unstable loops, without a steady response \(of mine\)", "bode")
def unstable_rows(run, count, _, of_all):
    """Curves of each output and factor."""
    z = abs(own(run)[0])
    assert z >= 1 - 1e-9 or run.case.asks == CONSERVES or "c" in run.table[0], z
    curves = {(row.get("c"), row["to_output"]) for row in run.table}
    unstable = {(row.get("c"), row["to_output"]) for row in run.table if not row["stable"]}
    return (count, of_all) == (len(unstable), len(curves))


@shape(r"mine: stable with the spec's own numbers; check answers with s at its limits, or any curve of slopes from 0 to 1")
def left_to_check(run):
    """Which proof through contact has no row."""
    return run.case.asks == "contact" and [*run.claims] == ["spec"]


def of_members(run, said):
    """Whether a phrase names the frames, numbers, messages and levels that are asked about, all of them and no others.

    Each phrase that is known is taken out, and no number may be left.
    """
    case, members = run.case, run.case.members
    asked = case.tables.get("for_all", {})
    said = re.sub(r"\.(?= |$)", "", said)  # at the end of a sentence, where it is no part of a number

    def values(found):
        assert "start" not in asked.get(found[1], {}), said
        assert {float(each) for each in found[2].split(", ")} == {*members[found[1]]}, said
        return ""

    def span(found):
        assert near(float(found[2]), min(members[found[1]])), said
        assert near(float(found[3]), max(members[found[1]])), said
        return ""

    def frames(found):
        own = [case.own_length]
        assert {int(each) for each in found[1].split(", ")} == {*(members["n"] if "any order" in found[2] else own)}, said
        return ""

    def probability(found):
        assert case.asks == AT_RANDOM, said
        assert near(float(found[1]), members["lost"]), said
        return ""

    def level(found):
        assert float(found[1]) == case.level, said
        return ""

    def radius(found):
        z, seconds = own(run)
        assert near(float(found[1]), abs(z)), said
        assert near(float(found[2]), 1e3 * seconds), said
        return ""

    for pattern, held in (
        (rf"spectral radius {N} per frame of {N} ms", radius),
        (r"\b([nc]) (?:of|=|is|in) (-?[\d.]+(?:, -?[\d.]+)*)", values),
        (rf"\b([nc]|mass) from {N} to {N}", span),
        (rf"lost with probability {N}", probability),
        (r"frames of (\d[\d, ]*) ticks?( in any order|)", frames),
        (rf"(?:within|at least|at most|down to 2 % in|[≤≥]) {N}", level),
        (r"slopes from 0 to 1\b|, seed 0\b", ""),
    ):
        left = said = re.sub(pattern, held, said)
    assert not re.search(r"\d", left), left
    if case.asks == "losses" and "messages" in said:
        assert (
            re.search("all in time|late or lost", said)
            or ("never two in a row", "never three in a row")[len(members["n"]) - 2] in said
        ), said
    return True


@shape(rf"{N} curves? of {N} frequencies", "bode")
def curves(run, count, frequencies):
    """What comes through of a sine at its own frequency, for a frame from `x` at its sample on."""
    assert count * frequencies == len(run.table), len(run.table)
    numbers = run.case.tables["numbers"]
    leak, n, c, f = run.case.leak, numbers["n"], numbers["c"], gain(run, numbers["K"])
    drive = c * f if run.case.asks == "gain" else c
    for row in run.table:
        if run.case.asks == CONSERVES or not row["stable"] or "c" in row:
            continue
        turn = np.exp(2j * pi * row["frequency_hz"] * T)
        # x in each tick as a multiple of x at the sample, and of the sine.
        held, driven = [1.0], [0.0]
        for tick in range(n):
            held.append((1 - leak * T) * held[-1] - T * c * f)
            driven.append((1 - leak * T) * driven[-1] + T * drive * turn**tick)
        sampled = driven[n] / (turn**n - held[n])
        seen = sum((held[tick] * sampled + driven[tick]) / turn**tick for tick in range(n)) / n
        assert abs(complex(row["response_re"], row["response_im"]) - seen) <= 1e-8 * abs(seen) + 2 * row["response_error"], row
    return True


# The verdict, in `check` and `why`.


AT_AN_END = 1e-9  # relative: nearer to an end a value is not told from it
UNSETTLED = 0.02  # relative: between what is proved and what is refuted


@shape(
    r"(?:mine, drawn|the spec's own design): (.*)"
    r"|  ((?:proved|as required|not (?:as required|stable|known)|does not come)\b.*)",
    ("check", "why"),
)
def verdict(run, said, again):
    said = said or again
    of_members(run, said.partition(": ")[0])
    if found := re.search(r": (\w = .*, (?:met|as required) in .*?)(?:, which is not certified: .*)?$", said):
        hold(run, "  " + found[1].replace(", ", ": ", 1))
    case = run.case
    members = case.members if case.asks in ("numbers", *VARYING) else case.own()
    K = case.tables["numbers"]["K"]
    truth = case.inside(members)
    so = within(K, K, truth) or case.start > K
    if own_is_asked(case):
        so = so and abs(own(run)[0]) < 1 - 1e-12
    if said.startswith("not known"):
        unsure = UNSETTLED if case.asks in ("numbers", "contact", *VARYING) else AT_AN_END
        ends = [end for pair in truth for end in pair]
        at_end = any(abs(K - end) <= unsure * end for end in ends)
        return at_end or case.asks in ("contact", CONSERVES) or abs(abs(own(run)[0]) - 1) < 1e-9
    holds = re.match(r"(proved )?(stable|as required|to come to rest)", said) is not None
    if run.case.level and re.search("as required, .*[0-9]", said):
        assert f"{run.case.level:g}" in said, said
    if ": " in said and "own numbers" not in said:
        assert fails(run, said.partition(": ")[2], run.case.tables["numbers"]["K"]), said
    return holds == so


def own_is_asked(case):
    """Whether the spec's own loop is among those that it asks about."""
    numbers = case.tables["numbers"]
    others = case.members["c"]
    lengths = case.members["n"]
    ranged = "start" in case.tables.get("for_all", {}).get("c", {})
    own_c = min(others) <= numbers["c"] <= max(others) if ranged else numbers["c"] in others
    return own_c and numbers["n"] in lengths


def fails(run, refuter, K):
    """Whether what a sentence names does not have what is asked at a value of K."""
    numbers = dict(run.case.tables["numbers"])
    if found := re.search(rf"c = {N}", refuter):
        numbers["c"] = float(found[1])
        swept = run.case.tables["sweep"].get("c", ())
        assert numbers["c"] in swept or min(run.case.members["c"]) <= numbers["c"] <= max(run.case.members["c"])
    if found := re.search(rf"n = {N}", refuter):
        numbers["n"] = int(float(found[1]))
    frames = [numbers["n"]]
    if "frames " in refuter:
        text = refuter.partition("frames ")[2]
        frames = [int(each) for each in re.findall(r"(?<!x )\b\d+", text)]
        assert {*frames} <= {*run.case.members["n"]}, refuter
    if "messages" in refuter:
        return fails_by_losses(run, refuter, K, numbers)
    if run.case.asks in ("frames", "both", "losses", "numbers", "nothing", "contact"):
        # What is named is of the spec, or of its [for_all].
        return prod(abs(pole(run, n, numbers["c"], K)) for n in frames) >= 1 - 1e-9
    if run.case.asks == AT_RANDOM:
        return "second moments" in refuter and not within(K, K, run.case.inside(run.case.members))
    intervals = run.case.inside({"n": frames, "c": [numbers["c"]]})
    # At an end the loop is just no longer as required.
    return not any(low * (1 + OUTWARDS) < K < high * (1 - OUTWARDS) for low, high in intervals)


def fails_by_losses(run, refuter, K, numbers):
    """Whether a pattern of messages, repeated, makes x grow."""
    text = refuter.rpartition("h: ")[2]
    text = re.sub(r"\(([^()]*) x (\d+)\)|(in time|lost) x (\d+)", lambda m: ", ".join([m[1] or m[3]] * int(m[2] or m[4])), text)
    text = re.sub(r"(\d+) lost", lambda m: ", ".join(["lost"] * int(m[1])), text)
    pattern = [each.strip(" ().") for each in text.split(",")]
    assert {*pattern} <= {"in time", "lost"}, refuter
    in_a_row = max(len(each) for each in re.sub("[^l]", " ", "".join(each[0] for each in pattern * 2)).split(" "))
    assert in_a_row < len(run.case.members["n"]), (in_a_row, refuter)
    x, held, size = 1.0, 1.0, 1.0
    for _ in range(200):
        for message in pattern:
            held = held if message == "lost" else x
            x -= numbers["n"] * T * numbers["c"] * gain(run, K) * held
        scale = max(abs(x), abs(held))
        size, x, held = size * scale, x / scale, held / scale
    return size >= 1e-3


@shape(rf"  own numbers([^:]*): (stable|UNSTABLE) \(spectral radius {N} per frame of {N} ms\)", "check")
def own_radius(run, names, said, radius, ms):
    for name, value in re.findall(rf"\b([nc]) = {N}", names):
        assert float(value) == run.case.tables["numbers"][name], names
    z, seconds = own(run)
    return near(radius, abs(z)) and near(ms, 1e3 * seconds) and (abs(z) < 1) == (said == "stable")


@shape(
    rf"(?:mine, drawn|  own numbers[^:]*): not known whether .* \(spectral radius 1 per frame of {N} ms, but for rounding\)",
    "check",
)
def on_the_circle(run, ms):
    return near(abs(own(run)[0]), 1, 1e-12)


@shape(rf"  \[for_all\] leaves the spec's own (\w) = {N} out", "check")
def left_out(run, name, value):
    return value == run.case.tables["numbers"][name] and value not in run.case.members[name]


@shape(rf"  for the spec's own c = {N}, of \[sweep\] {N}, {N}", "check")
def of_sweep(run, value, *others):
    return value == 1 and [*others] == run.case.tables["sweep"]["c"]


def along(run, name, required):
    """The intervals of a number with the spec's others; required: with what the spec requires, or of stability alone."""
    numbers = run.case.tables["numbers"]
    if name == "K":
        return run.case.inside(run.case.own(), required)
    f = gain(run, numbers["K"])
    low, high = run.case.bounds(numbers["n"], 1.0, required)
    if f == 0:  # what is stored drifts, or decays whatever c is
        return [(0.1, 10.0)] if low <= 0 < high else []
    low, high = sorted((low / f, high / f))
    return [(max(low, 0.1), min(high, 10.0))] if max(low, 0.1) < min(high, 10.0) else []


SPAN = rf"{N}{BEYOND} to (?:at least )?{N}"
SPANS = rf"((?:{SPAN})(?: and {SPAN})*)".replace(N, N.replace("(-", "(?:-"))


@shape(
    rf"  (K|c) = {N}(?: \w+)?: (stable|met|as required) from {N}{BEYOND} to (?:at least )?{N}{BEYOND}"
    rf"( \((?:down|up) to [^()]* times its value\))?(?:; also in {SPANS})?",
    "check",
)
def span_of(run, name, value, what, low, high, may, also):
    found = along(run, name, what != "stable")
    assert are_ends(low, high, found), (low, high, found)
    assert low <= value <= high
    assert near(value, run.case.tables["numbers"][name]), value
    if may:
        for way, factor in re.findall(rf"(down|up) to {N}", may):
            end = high if way == "up" else low
            assert near(float(factor), end / value, 0.01), (factor, end / value)
            inwards = float(factor) - end / value if way == "down" else end / value - float(factor)
            assert inwards >= -DIGITS * end / value, (factor, end / value)
    for a, b in re.findall(rf"{N}{BEYOND} to {N}", also or ""):
        assert are_ends(a, b, found), (a, b, found)
    return True


@shape(rf"(?:  |.*: )(K|c) = {N}(?: \w+)?(?:: (on an end)| (on an end))?[:,] (stable|met|as required) in {SPANS}", "check")
def spans_of(run, name, value, first, second, what, said):
    found = along(run, name, what != "stable")
    assert near(value, run.case.tables["numbers"][name]), value
    for a, b in re.findall(SPAN, said):
        assert are_ends(a, b, found), (a, b, found)
    at_end = any(abs(value - end) <= AT_AN_END * end for pair in found for end in pair)
    assert at_end == bool(first or second)
    return at_end or not within(value, value, found) or value < run.case.start


@shape(rf"  (K|c) = {N} was (not )?found to meet it: (?:met|as required) in {SPANS}", "check")
def found_to_meet(run, name, value, none, said):
    return within(value, value, along(run, name, True)) != bool(none)


@shape(rf"  (K|c) = {N}(?: \w+)?: not known \((\w+)\)", "check")
def not_known(run, name, value, doubt):
    return run.case.asks == CONSERVES and value == run.case.tables["numbers"][name]


@shape(rf"\s*(?:c = {N}: )?K none, not known from {N} to {N}", "stability-region")
def open_slice(run, c, low, high):
    assert c in run.factors()
    return run.case.asks == CONSERVES and not run.rows[0]["certified"] and [low, high] == [run.case.start, STOP]


@shape(rf"\s*{N} of {N} rows? not certified \(crowded {N}\)", "stability-region")
@shape(r"\s*the only row is not certified \(crowded\)", "stability-region")
def in_doubt(run, some=1, count=1, again=1):
    rows = [each for each in run.rows if not each["certified"]]
    return run.case.asks == CONSERVES and some == again == len(rows) and count == len(run.rows)


@shape(
    rf"\s*{N} of {N} rows? not certified \(search {N}\) search: of part of the range nothing could be proved .*",
    "stability-region",
)
def unsearched(run, some, count, again):
    doubts = [each["doubt"] for each in run.rows if each.get("guarantee", "spec") == run.word]
    stable_for_none = min(run.case.members["c"]) <= 0
    return stable_for_none and some == again == doubts.count("search") and count == len(doubts)


@shape(
    rf"more than 1 % between what is proved and what is refuted at an end is not known in {N} rows? of for_all",
    "stability-region",
)
def unsettled(run, count):
    return count == sum(each.get("guarantee") == "for_all" and not each["settled"] for each in run.rows)


@shape(rf"  (stable|met|as required) at (every|no) value in the range: (\w) {N} to {N}", "check")
def searched(run, what, which, name, low, high):
    found = along(run, name, what != "stable")
    assert are_ends(low, high, found) if which == "every" else not found, found
    assert name == "K" or (low, high) == (0.1, 10.0)


@shape(
    rf"  slowest mode: falls to 1/e in {N} s, damping ratio (?:not known|{N})(?:, {N} Hz)?(?: and {N} Hz)?(?:, .*)?", "check"
)
def slowest(run, tau, ratio, hz, second):
    z, seconds = own(run)
    assert second is None or near(second, round(second * seconds) / seconds, 1e-3), second  # an image of the frames
    return mode_of(z, seconds, tau, ratio, hz)


@shape(r"  slowest mode: over within a frame", "check")
def over(run):
    return abs(own(run)[0]) < 1e-9


def mode_of(z, seconds, tau, ratio, hz):
    """Whether a mode of a pole has this time, damping ratio and frequency."""
    if abs(z) < 1e-9:
        return tau < 1e-6
    assert near(tau, abs(seconds / log(abs(z))), 6e-4), (tau, seconds / log(abs(z)))
    if not hz:
        return z > 0 and ratio in (None, 1.0)
    assert z < 0
    assert near(hz, 0.5 / seconds, 2e-4)
    return ratio is None or near(ratio, damping_of(z), 6e-3)


# The table of intervals.


@shape(r"((?:stable|stable in mean square|as required, .*|comes to rest) (?:for|with) .*) \(\w+\):", "stability-region")
def head(run, said):
    return of_members(run, said)


SET_BY = r", set by (?:a mode|(?:gain|Ms|disk)(?: at h\.y)?)"
WHAT = r"(?:(?:stable|proved) K|K (?:with|which) .*?|proved K .*?)"


@shape(
    rf"\s*largest ({WHAT}): (?:(just below) )?{N}(?: \((?:stable|proved|met) from {N} on\))?{AT}"
    rf"(?:{SET_BY}|, refuted at {N} by (.*))?",
    "stability-region",
)
def largest(run, what, just_below, high, low, c, refuted, refuter):
    of_members(run, what)
    sets = run.sets(c)
    truth = max(map(greatest, sets))
    assert high <= truth * (1 + OUTWARDS), (high, truth)
    assert high >= truth * (0.99 if run.word == "for_all" else 1 - DIGITS), (high, truth)
    assert just_below or is_cell(run, high, "high"), high
    if low is not None:
        assert any(within(low, high * (1 - 1e-15), each) for each in sets), (low, high, sets)
        assert is_cell(run, low, "low"), low
    if refuted is not None:
        assert is_cell(run, refuted, "fails_from"), refuted
        assert high < refuted or (just_below and high <= refuted), (high, refuted)
        assert refuted >= truth * (1 - OUTWARDS), (refuted, truth)
        named = refuter if c is None or "c =" in refuter else f"c = {c}, {refuter}"
        assert fails(run, named, refuted), (named, refuted)
    return True


@shape(rf"\s*smallest ({WHAT}): (?:just above )?{N}{AT}(?:{SET_BY}|, refuted at {N} by (.*))?", "stability-region")
def smallest(run, what, low, c, refuted, refuter):
    of_members(run, what)
    truth = min(map(least, run.sets(c)))
    assert low >= truth * (1 - OUTWARDS), (low, truth)
    assert is_cell(run, low, "low"), low
    return refuted is None or (
        is_cell(run, refuted, "fails_below") and refuted <= truth * (1 + OUTWARDS) and fails(run, refuter, refuted)
    )


@shape(rf"\s*(stable|proved|with .*?) for every K (?:from {N} )?up to:? {N}{AT}( .*)?", "stability-region")
def every(run, what, low, high, c, more):
    if others := re.search(r", and in (\d+) other rows?", more or ""):
        alike = [each for each in run.rows if each["interval"] == 0 and near(each["high"], high, 1e-5)]
        assert len(alike) == int(others[1]) + 1, more
        more = more.replace(others[0], "")
    assert not re.search(r"\d", more or ""), more
    digits = PROVED if run.word == "for_all" else DIGITS
    return of_members(run, what) and are_ends(
        run.case.start if low is None else low, high, run.case.inside(run.members(c)), digits
    )


@shape(rf"\s*(no )?({WHAT}) for all of them(?: is known)?:? ?(.*)", "stability-region")
def in_common(run, none, what, said):
    rows = [each for each in run.rows if each.get("guarantee", "spec") == run.word]
    assert (none is not None) == (not hold_in_common(rows, "c", said)), said
    return of_members(run, what)


def hold_in_common(rows, axis, said):
    """What the rows of all values of an axis have in common, as intervals, are the spans that are said, and each end is one
    of the value that is named with it."""
    common = [(-inf, inf)]
    for value in {row[axis] for row in rows}:
        own = [(row["low"], row["high"]) for row in rows if row[axis] == value and row["intervals"]]
        both = ((max(low, a), min(high, b)) for low, high in common for a, b in own)
        common = [(low, high) for low, high in both if low < high]
    for end, value in re.findall(rf"{N}(?: [^\d ]+)? \(at {axis} = {N}", said):
        ends = [row[column] for row in rows if row[axis] == float(value) for column in ("low", "high")]
        assert any(near(float(end), each) for each in ends), (end, value, ends)
    spans = re.findall(rf"{N}(?: \(at [^)]*\))? to {N}", said)
    assert len(spans) == len(common), (spans, common)
    assert all(are_ends(low, high, common) for low, high in spans), (spans, common)
    return common


@shape(
    rf"{N} slices?: {N} (?:stable )?intervals?( with .*?)?(?:, {N} slices? with a hole)?(?:, {N} slices? with open places)?",
    "stability-region",
)
def counts(run, slices, count, what, holes, open_):
    of_members(run, what or "")
    rows = [each for each in run.rows if each.get("guarantee", "spec") == "spec"]
    assert slices == len(run.factors())
    assert count == sum(each["intervals"] > 0 for each in rows)
    assert count == sum(map(len, run.sets()))
    assert (open_ or 0) == sum(each.get("open_places", 0) > 0 for each in rows)
    return (holes or 0) == sum(len(each) > 1 for each in run.sets())


@shape(rf"\s*(?:c = {N}: )?K (.*)", "stability-region")
def slices(run, c, said):
    assert c is None or c in run.factors()
    spans = re.findall(rf"{N} to {N}", said)
    truth = run.case.inside(run.members(c))
    return len(spans) == len(truth) and all(are_ends(a, b, truth) for a, b in spans)


@shape(r"\s*(nowhere stable in the swept range: .*)", "stability-region")
@shape(r"\s*((?:no K|no stable K|nowhere) .*)", "stability-region")
def nowhere(run, said):
    """The member that is named is stable at none, and grows at the value that is named as is said."""
    named = {name: [float(value)] for name, value in re.findall(rf"\b([nc]) = {N}", said)}
    members = run.members() | named
    if named:
        truth = run.case.inside(members)
        assert not truth or greatest(truth) < run.case.start * 1.01, said
        assert all(min(run.case.members[name]) <= each[0] <= max(run.case.members[name]) for name, each in named.items()), said
    found = re.search(rf"nearest of those looked at: K = {N}: {N} Hz, grows by a factor of e in {N} s", said)
    if found and len(members["n"]) == len(members["c"]) == 1:
        K, hz, seconds = map(float, found.groups())
        frame = members["n"][0] * T
        z = pole(run, members["n"][0], members["c"][0], K)
        assert near(hz, 0.0 if z > 0 else 0.5 / frame, 1e-3), said
        assert near(seconds, frame / log(abs(z)), 5e-3), said
    return any(not each or greatest(each) < run.case.start * 1.01 for each in run.sets())


@shape(rf"\s*(?:all {N} rows|the only row is|the only row) (?:are )?certified", "stability-region")
def all_certified(run, count):
    rows = [each for each in run.rows if each.get("guarantee", "spec") == run.word]
    return all(each["certified"] for each in rows) and count in (None, len(rows))


@shape(rf"\s*frames of (.*) ticks decide: without those of (.*) no end moves by more than {N} %", "stability-region")
def decide(run, some, others, share):
    """Of what is refuted by the frames that decide nothing is proved, so that no end moves beyond it."""
    numbers, without = ([int(each) for each in re.findall(r"\d+", str(of).removesuffix(".0"))] for of in (some, others))
    assert sorted(numbers + without) == run.case.members["n"], (numbers, without)
    hold_share(run, share)
    whole = run.case.inside(run.case.members)
    part = run.case.inside(run.case.members | {"n": numbers})
    return not whole or abs(greatest(whole) - greatest(part)) <= share / 100 * greatest(part) + 1e-9


def hold_share(run, share):
    """A share is the widest gap between what is proved for all and what is refuted, rounded up to two digits."""
    proved = [row for row in run.rows if row["guarantee"] == "for_all"]
    gaps = [1 - row["high"] / row["fails_from"] for row in proved if row["fails_from"] > 0]
    gaps += [1 - row["fails_below"] / row["low"] for row in proved if row.get("fails_below", 0) > 0]
    widest = max(100 * max(gaps), 0.01)
    assert 0 <= share - widest + 1e-9 <= 10.0 ** (floor(log10(widest)) - 1) + 1e-9, (share, gaps)


@shape(r"mine: (?:modes|responses|limits|margins|a run) for messages of h all in time; zwidth, .* and check answer (for .*)")
def answered_elsewhere(run, said):
    """Of messages that may be lost there are rows in the tables of these commands."""
    return run.case.asks == AT_RANDOM and "mean_square" in run.claims and of_members(run, said)


@shape(r"mine: ((?:modes|responses|limits|margins|a run) with .*)")
@shape(r"margins proved (for .*) \(for_all\):", "margins")
def assumed(run, said):
    return of_members(run, said)


# Margins, of L = g/(z - q).


@dataclass
class Loop:
    """L = g/(z - q) for one member: its margins."""

    g: float
    q: float

    @property
    def up(self):
        return (1 + self.q) / self.g if self.g > 0 else (self.q - 1) / self.g

    @property
    def phase_deg(self):
        x = (1 + self.q**2 - self.g**2) / (2 * self.q)
        if abs(x) > 1 or self.g <= 0:
            return inf
        z = complex(x, sqrt(1 - x * x))
        from cmath import phase

        return 180 - phase(z - self.q) * 180 / pi

    @property
    def crossing(self):
        """Where abs(L) is 1 (rad per frame)."""
        return acos((1 + self.q**2 - self.g**2) / (2 * self.q)) if isfinite(self.phase_deg) else 0.0

    @property
    def Ms(self):
        return max(abs((z - self.q) / (z - self.q + self.g)) for z in (1, -1))

    @property
    def Mt(self):
        return max(abs(self.g / (z - self.q + self.g)) for z in (1, -1))

    @property
    def disk(self):
        return 2 / max(abs((z - self.q - self.g) / (z - self.q + self.g)) for z in (1, -1))


def loops(run, all_members):
    members = run.case.members if all_members else run.case.own()
    return [loop_of(run, n, c) for n, c in product(members["n"], members["c"])]


def loop_of(run, n, c):
    # At p.y the leak is cut too.
    q = 1.0 if run.cut == "p.y" else (1 - run.case.leak * T) ** n
    return Loop(q - pole(run, n, c, run.case.tables["numbers"]["K"]), q)


REST = rf"(?:, at {N} rad/s \({N} Hz\))?(?:, refuted from {N} on by (.*))?"


def margin(run, value, omega, hz, refuted, refuter, of, better=1):
    """A margin is no better than that of the worst loop, and is refuted where it is worse than that; the table has both."""
    constant = run.word == "for_all"
    truth = min(of(each) * better for each in loops(run, constant)) * better
    rows = [row for row in run.table if row.get("guarantee", "spec") == run.word]
    cells = [row[name] for row in rows for name in ("value", "fails_from", "fails_below") if name in row]
    assert better * value <= better * truth * (1 + better * 1e-9), (value, truth)
    assert any(near(value, each) for each in cells), (value, cells)
    if refuted is None:
        assert near(value, truth, 1e-4), (run.command, value, truth)
    else:
        assert any(near(refuted, each) for each in cells), (refuted, cells)
        assert better * refuted >= better * truth * (1 - better * 1e-9), (refuted, truth)
        assert better * value <= better * refuted
        members = run.case.members
        with_numbers = {name: float(number) for name, number in re.findall(rf"([nc]) = {N}", refuter)}
        assert refuter == ", ".join(f"{name} = {number:g}" for name, number in with_numbers.items()), refuter
        n = int(with_numbers.get("n", run.case.own_length))
        c = with_numbers.get("c", run.case.tables["numbers"]["c"])
        assert n in members["n"], refuter
        assert min(members["c"]) <= c <= max(members["c"]), refuter
        assert better * of(loop_of(run, n, c)) <= better * refuted * (1 + better * 1e-6), (refuted, refuter)
    flat = abs(own(run)[0]) < 1e-9  # the closed loop is then a delay, as large at all frequencies
    if omega is not None and refuted is None and not flat:
        places = {pi, 0.0, *(each.crossing for each in loops(run, constant))}
        assert any(near(omega * own(run)[1], place, 1e-3) for place in places), (omega, places)
    return omega is None or near(omega, 2 * pi * hz, 1e-3)


@shape(rf"gain may grow by a factor up to:? {N}{REST}", "margins")
def grows(run, *rest):
    return margin(run, *rest, lambda each: each.up)


@shape(rf"phase margin {N} deg{REST}", "margins")
def phase_margin(run, *rest):
    return margin(run, *rest, lambda each: each.phase_deg)


@shape(rf"disk margin {N}{REST}", "margins")
def disk_margin(run, *rest):
    return margin(run, *rest, lambda each: each.disk)


@shape(rf"  gain alone within the disk, up or down by a factor of {N}{REST}", "margins")
def gain_in_disk(run, *rest):
    return margin(run, *rest, lambda each: (2 + each.disk) / (2 - each.disk) if each.disk < 2 else inf)


@shape(rf"  phase alone within the disk {N} deg{REST}", "margins")
def phase_in_disk(run, *rest):
    from math import atan

    return margin(run, *rest, lambda each: 2 * atan(each.disk / 2) * 180 / pi)


@shape(rf"peak sensitivity Ms {N}{REST}", "margins")
def peak(run, *rest):
    return margin(run, *rest, lambda each: each.Ms, -1)


@shape(rf"peak complementary sensitivity Mt {N}{REST}", "margins")
def complementary(run, *rest):
    return margin(run, *rest, lambda each: each.Mt, -1)


@shape(rf"delay margin \(fewer whole frames than\) {N}{REST}", "margins")
def delay_margin(run, *rest):
    return margin(run, *rest, lambda each: radians(each.phase_deg) / each.crossing if each.crossing else inf)


@shape(rf"broken at ([hp].y), (?:once in|in every tick of) {N} ms", "margins")
def broken(run, cut, ms):
    run.cut = cut
    return near(ms, 1e3 * own(run)[1])


@shape(rf"{N} of {N} rows not certified \((.*)\)", "margins")
def doubted(run, some, count, words):
    doubts = [each["doubt"] for each in run.table if not each["certified"]]
    named = {word: int(number) for word, number in re.findall(r"(\S+) (\d+)", words)}
    return some == len(doubts) and count == len(run.table) and named == {each: doubts.count(each) for each in doubts}


@shape(r"(no(?:thing|t stable) for .*): (.*) \(for_all\)", "margins")
def no_margin(run, said, refuter):
    return of_members(run, said) and fails(run, refuter, run.case.tables["numbers"]["K"])


@shape(rf"(K|c) is not swept here, held at the spec's {N}")
def held_at(run, name, value):
    return value == run.case.tables["numbers"][name]


# Motions, modes, and what sets a limit.


def marched(run, held_output):
    """y in each tick of the run's input, samples and losses, or what is held of it."""
    numbers = run.case.tables["numbers"]
    c, f, leak = numbers["c"], gain(run, numbers["K"]), run.case.leak
    drive = c * f if run.case.asks == "gain" else c
    x, held, values = 0.0, 0.0, []
    for row in run.table:
        held = x if row["phase"] == 0 and row.get("late", 0) == 0 else held
        values.append(held if held_output else x)
        push = f * held
        if run.case.asks == "contact":
            push = min(max(push, -5.0), 5.0)
        x += T * (drive * row["r"] - leak * x - c * push)
    return values


@shape(
    rf"(h\.)?y (?:settles at|is {N} at the end, where the linear loop settles at) {N}"
    rf"(?:, peak {N} reached {N} s after the step)?(?:, within 2 % from {N} s after (?:it|the step) on)?",
    "simulate",
)
def settles(run, held_output, ends, at, peak, peak_s, seconds):
    last = at_rest(run)
    values = marched(run, held_output)
    started = next(tick for tick, row in enumerate(run.table) if row["r"])
    assert near(at, last), (at, last)
    assert ends is None or near(ends, values[-1]), (ends, values[-1])
    top = max(map(abs, values))
    tops = [tick for tick, value in enumerate(values) if abs(value) >= top * (1 - 1e-12)]
    assert near(top, abs(peak)) if peak else top <= 1.0021 * abs(last), (peak, top, last)
    assert peak is None or any(near(peak_s, (tick - started) * T, 6e-4) for tick in tops), (peak_s, tops)
    away = [tick for tick, value in enumerate(values) if abs(value - last) > 0.02 * abs(last)]
    return (
        near(seconds, (away[-1] + 1 - started) * T, 6e-4)
        if seconds
        else ends is not None or away[-1:] in ([], [len(values) - 1])
    )


@shape(rf"UNSTABLE: the linear loop diverges \(spectral radius {N} per frame\)", "simulate")
def diverges(run, radius):
    return near(radius, abs(own(run)[0]), 1e-3) and radius >= 1


@shape(r"the linear loop is not known to be stable \(spectral radius 1 per frame, but for rounding\)", "simulate")
def on_the_circle_of_run(run):
    return near(abs(own(run)[0]), 1, 1e-12)


@shape(rf"drawn, r: step: {N}(?: of {N})? ticks, {N} s", "simulate")
def ran(run, ticks, asked, seconds):
    return ticks == len(run.table) and near(seconds, ticks * T) and (ticks if asked is None else asked) == 10 / T


@shape(rf"stopped after tick {N}, {N} s: numbers overflow; the rows end before it", "simulate")
def stopped(run, tick, seconds):
    """Where what grows by z in each frame is beyond the range of doubles."""
    z, frame = own(run)
    expected = log(1.8e308) / log(abs(z)) * frame / T
    return near(seconds, tick * T) and near(tick, expected, 0.05) and tick == len(run.table)


@shape(
    rf"  (?:{N} Hz, damping ratio {N}|no oscillation), (falls to 1/e|grows by a factor of e)"
    rf" in {N} s(?:, UNSTABLE)?: p integral",
    "poles",
)
def mode(run, hz, ratio, way, tau):
    z, seconds = own(run)
    assert (way == "grows by a factor of e") == (abs(z) > 1)
    return mode_of(z, seconds, tau, ratio, hz)


@shape(
    rf"  {N} Hz, damping ratio {N}, stays, rounding hides whether it is stable: [pv] integral(?:, [pv] integral)?",
    "poles",
)
def stays(run, hz, ratio):
    """A mass on a spring turns by `2 asin(T sqrt(K) / 2)` in a tick."""
    if run.case.asks != CONSERVES:
        z, seconds = own(run)
        return near(z, -1) and near(hz, 0.5 / seconds, 5e-4)
    turn = 2 * asin(T * sqrt(run.case.tables["numbers"]["K"]) / 2)
    assert str(ratio) != "-0.0", ratio
    return ratio == 0 and near(hz, turn / (2 * pi * T), 5e-4)


@shape(rf"{N} of {N} poles? not known to be stable or unstable \(rounding {N}\)", "poles")
def unsure_poles(run, some, count, again):
    doubts = sum(each["doubt"] == "rounding" for each in run.table)
    return some == again == doubts and count == len(run.table)


@shape(rf"{N} poles? per (?:frame|tick) of {N} ms", "poles")
def modes(run, count, ms):
    return count == len(run.table) and near(ms, 1e3 * own(run)[1])


@shape(
    rf"K: not certified \(crowded\), so no derivatives are given, and no stable interval is known in {N} to {N}"
    rf", not known from {N} to {N}",
    "why",
)
def nothing_known(run, *ends):
    return run.case.asks == CONSERVES and [*ends] == [run.case.start, STOP] * 2


@shape(r"K: stable from (.*)", "why")
def whole(run, said):
    spans = re.findall(rf"{N} to {N}", said)
    truth = run.case.inside(run.case.own(), required=False)
    return len(spans) == len(truth) and all(are_ends(a, b, truth) for a, b in spans)


@shape(rf"(low|high) end, K = {N}: set by (.*)", "why")
def end(run, which, value, said):
    truth = run.case.inside(run.case.own(), required=False)
    assert any(near(value, pair[which == "high"], 1e-5) for pair in truth), (value, truth)
    run.end = value
    return mode_at_end(run, which, value, said, 3)


def mode_at_end(run, which, value, said, digits):
    """Whether a phrase says which mode is on the circle at an end, and its damping ratio a tenth of the end inside.

    digits: of the ratio.
    """
    numbers = run.case.tables["numbers"]
    n, c = numbers["n"], numbers["c"]
    low, high = min(run.case.inside(run.case.own(), required=False), key=lambda pair: abs(pair[which == "high"] - value))
    away = min(0.1 * (abs(value) or high - low), (high - low) / 2)
    turns = pole(run, n, c, value) < 0
    found = re.fullmatch(
        rf"(?:an oscillation of {N} rad/s \({N} Hz\)|a mode without oscillation[a-z ]*)(?:, damping ratio {N} just inside)?",
        said,
    )
    assert found, said
    omega, hz, ratio = (each and float(each) for each in found.groups())
    assert (omega is not None) == turns, said
    assert omega is None or (near(omega, pi / (n * T), 1e-4) and near(hz, 0.5 / (n * T), 1e-3)), said
    expected = damping_of(pole(run, n, c, high - away if which == "high" else low + away))
    return ratio is None or abs(ratio - expected) <= 0.51 * 10.0 ** (floor(log10(expected)) + 1 - digits)


def damping_of(z):
    """The damping ratio of a pole of a frame, by the line at which it turns or does not."""
    return 1.0 if z >= 0 else -log(-z) / hypot(log(-z), pi)


@shape(r"  (1 % more .*)", "why")
def moves(run, said):
    """By how many per cent an end moves for one per cent of a number, by a difference over a thousandth of that."""
    found = re.findall(rf"1 % more (c|rates\.tick_hz)(?: \(same periods in ticks\))?(?: moves it)? (up|down) by {N} %", said)
    assert len(found) == said.count("%") / 2, said

    def end_at(name, factor):
        c = factor if name == "c" else None
        case = run.case if name == "c" else replace(run.case, tick=T / factor)
        truth = case.inside(case.own(c), required=False)
        return min((end for pair in truth for end in pair), key=lambda each: abs(each - run.end))

    for name, way, share in found:
        expected = (end_at(name, 1.00001) / end_at(name, 0.99999) - 1) / 2e-5
        assert near(float(share) * (1 if way == "up" else -1), expected, 6e-3), (name, share, expected)
    return True


@shape(r"  the limit is 0, which has no changes in per cent; the column slope has its derivatives", "why")
def of_zero(run):
    return run.end == 0


@shape(r"  states that take part: p integral 100 %", "why")
def states(run):
    return True
