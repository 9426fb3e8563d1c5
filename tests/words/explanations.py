"""What `explain` says of columns: each number in it is a phrase that is known, and holds of the table that has the column.

A phrase is taken out of a text once it is held, and no number may be left.
"""

# ruff: noqa: ARG001 (a function has the rows and the column of its phrase, also if it does not need them)
import re
from functools import cache
from itertools import chain
from math import log, pi, sqrt

import pandas

from wavesweep.program.tables import HOMES
from wavesweep.program.tables.fields import DOUBTS, columns_of

PHRASES = []


def phrase(pattern):
    """A function that holds what a phrase says of the rows of a table, and of one of its columns."""

    def kept(function):
        PHRASES.append((re.compile(pattern), function))
        return function

    return kept


@cache
def meanings():
    """All that is explained: the entries of each word."""
    found = {word: [{"meaning": each.meaning, "advice": each.advice}] for word, each in DOUBTS.items() if word}
    for field in chain.from_iterable(map(columns_of, HOMES)):
        for word, meaning in {field.name: field.description, **field.values}.items():
            found.setdefault(word, []).append({"meaning": meaning, "advice": field.advice})
    return found


def hold_columns(table):
    """Each column of a table and each word in it is explained, and what is said of it is so."""
    rows = table.to_dict("records")
    words = [
        each for name in ("guarantee", "hand", "doubt", "margin") if name in table for each in table[name].dropna().unique()
    ]
    for word in (*words, *(each for each in table.columns if each in meanings())):
        hold_entries(word, rows)


def hold_entries(word, rows=()):
    """All that is said of a word is known, and holds of some rows."""
    for entry in meanings()[word]:
        left = f"{entry['meaning']} {entry['advice']}".strip()
        for pattern, function in PHRASES:
            if pattern.search(left):
                left = pattern.sub("", left)
                held = function([row for row in rows if word in row], word)
                assert held is None or held, (word, pattern.pattern)
        assert not re.search(r"\d", left), (word, left)


def have(rows, *names):
    """The rows with values in all of some columns."""
    return [row for row in rows if all(name in row and not pandas.isna(row[name]) for name in names)]


# Units, names, examples, and rules of thumb, which say nothing of a run.
@phrase(r"\(1/s\)|m/s\^2|\(W\^\(1/2\)\)|H2|l1 norm|v_2|x_0|LP1|1/admittance|\b1/e\b|-3 dB")
@phrase(r"\|1/\(1 \+ L\)\||\|L/\(1 \+ L\)\||every factor (?:between it and 1 over it|\(1 \+ a d/2\)/\(1 - a d/2\), \|d\| < 1)")
@phrase(r"an input between -1 and 1|white noise .* of 1\b|within 2 % of the final value|over fitted minus 1")
@phrase(r"usual designs have less than (?:2|1\.5)|poles within 1e-3 of each other|K = \{ start = 0, stop = 100 \}")
def no_claim(rows, name):
    """What is not about numbers of a table."""


@phrase(r"within 1e-6 of this end|by more than 1e-10, relative|-1 where it never comes")
@phrase(r"channel_norm(?: less |\^2 - )1|; 1 where the file has none")
def of_other_runs(rows, name):
    """What would be seen in tables that no run of the law has: late results, filters, corners, logs."""


@phrase(r"\(1 or 0\)|with [01]\b|\b1 if the row is fitted; 0 in the first rows")
@phrase(r"Where the column limited is 0 there is no limit")
def a_flag(rows, name):
    return name not in ("certified", "settled", "stable", "corner", "limited") or all(
        row[name] in (0, 1) for row in have(rows, name)
    )


@phrase(r"from 0(?: \(|;|$|, )|happens at 0\b")
def counted_from_0(rows, name):
    return not rows or min(row[name] for row in rows) == 0


@phrase(r"open places? .*?; 0 in a certified row")
def no_open_places(rows, name):
    return all(row[name] == 0 for row in have(rows, "certified", name) if row["certified"])


@phrase(r"within 1 % of what is refuted|an end of 0 within|next to 0 the proof ends there")
def settled(rows, name):
    known = have(rows, "settled", "fails_from", "high")
    return all(row["fails_from"] <= row["high"] * 1.0101 for row in known if row["settled"])


@phrase(r"(?:stable|passive)[^;]* (?:where it is at most|below|above|up to) [01]\b|at exactly 1\b")
@phrase(r"the open loop's gain is not below 1|absolutely stable above [01]")
def limit_of_norms(rows, name):
    return all((row["channel_norm"] <= 1) == row["channel_passive"] for row in have(rows, "channel_norm", "channel_passive"))


@phrase(r"above 1 it grows")
def grows(rows, name):
    return all((row["radius"] > 1) == (row["time_constant_s"] < 0) for row in have(rows, "radius", "time_constant_s"))


@phrase(r"missing of z = 0 and z = 1")
def of_eigenvalues(rows, name):
    return all(
        abs(row["damping_ratio"] + row["s_re"] / abs(complex(row["s_re"], row["s_im"]))) < 1e-9
        for row in have(rows, "damping_ratio", "s_re", "s_im")
    )


@phrase(r"1/sqrt\(1 \+ \(2 pi shown_hz time_constant_s\)\^2\)")
def of_lines(rows, name):
    known = have(rows, "shown_hz", "time_constant_s", "shown_damping_ratio")
    expected = [1 / sqrt(1 + (2 * pi * row["shown_hz"] * row["time_constant_s"]) ** 2) for row in known]
    return all(abs(abs(row["shown_damping_ratio"]) - each) < 1e-9 for row, each in zip(known, expected, strict=True))


NO_LIMIT = {"gain_down": 0.0, "phase": 180.0, "disk": 2.0, "disk_phase": 180.0}  # others 1e6


@phrase(r"without a limit 0 for gain_down, 1e6 for other gains and for peaks, 180 deg|(?:1e6|180|\b0) means: (?:by )?any")
def without_a_limit(rows, name):
    known = have(rows, "limited", "value")
    return all(row["value"] == NO_LIMIT.get(row["margin"], 1e6) for row in known if row["certified"] and not row["limited"])


@phrase(r"\bbound is at most 1e-6")
def bound_of_margins(rows, name):
    return all(row["bound"] <= 1e-6 for row in have(rows, "bound", "margin") if row["certified"])


@phrase(r"\b0 if this is 0|missing if the number is 0")
def of_a_number_of_0(rows, name):
    return all(row["elasticity"] == 0 for row in have(rows, "elasticity", "value") if row["value"] == 0)


@phrase(r"the derivatives by 1e-8")
def derivatives(rows, name):
    known = have(rows, "slope", "elasticity", "value", "limit_value")
    pairs = [(row["elasticity"] * row["limit_value"], row["slope"] * row["value"]) for row in known if row["certified"]]
    return all(abs(first - second) <= 1e-8 * abs(first) + 1e-12 for first, second in pairs)


@phrase(r"at most that of sweep\.K_VE or 20000")
def widest(rows, name):
    return all(row["z_width"] <= 20000 for row in have(rows, "z_width"))


@phrase(r"falls to 2 %: ln\(50\) = 3\.912 time constants")
def settling(rows, name):
    known = have(rows, "settling", "time_constant")
    return round(log(50), 3) == 3.912 and all(abs(row["settling"] / row["time_constant"] - log(50)) < 1e-6 for row in known)
