"""The summary of any kind of table warns of rows in doubt, with their number, and says nowhere that all are certified."""

import re
from dataclasses import replace

import numpy as np
import pytest

from wavesweep.margins.broken_loops import cuts_of
from wavesweep.margins.table import margins
from wavesweep.poles.table import poles
from wavesweep.program.columns import whose_column
from wavesweep.program.spec import load
from wavesweep.program.tables import kind_named, kinds
from wavesweep.program.tables.hand_rows import hands_of
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.response_table import responses
from wavesweep.program.tables.specs import intervals_of_specs
from wavesweep.sensitivity.table import why
from wavesweep.simulation.table import simulate

WALL = {"controller": {"kind": "dc-slow"}, "rates": {"ratio": 4}, "device": {"velocity": "difference"}}
SWEPT = WALL | {"sweep": {"K_VE": {"start": 0, "stop": 3000}, "B_VE": [1.0, 2.0, 3.0]}}
SINE = {"simulate": {"input": "stepped-sine", "amplitude": 1.0, "frequency_hz": [2.0, 3.0, 5.0]}}
TABLES = {
    "zwidth": lambda: intervals(load(SWEPT), "K_VE", jobs=1),
    "zwidth-hands": lambda: intervals(load(SWEPT), "K_VE", jobs=1, hands=hands_of(["passive"])),
    "zwidth-for-all": lambda: intervals(load(SWEPT | {"for_all": {"device.mass": [0.1, 0.11]}}), "K_VE", jobs=1),
    "zwidth-specs": lambda: intervals_of_specs([load(SWEPT), replace(load(SWEPT), name="other")], jobs=1),
    "bode": lambda: responses([load(WALL | {"bode": {"frequency_hz": [1.0, 2.0, 5.0]}})]),
    "simulate-response": lambda: simulate(load(WALL | SINE))[1],
    "why": lambda: why(load(SWEPT), "K_VE"),
    "margins": lambda: margins(load(WALL), cuts_of(load(WALL))[0]),
    "poles": lambda: poles(load(WALL)),
    "poles-over": lambda: poles(load(SWEPT), "B_VE"),
}
ALL = re.compile(r"\ball \d+ \w+ (certified|not certified \(s)|the only row is (certified|not certified \(s)")


def said(table, columns):
    """The lines of a summary of a table with these columns."""
    kind = kind_named(table.kind)
    tally = kind.tally(table)
    tally.add(columns)
    return list(kind.lines(tally.numbers(table.facts)))


def in_doubt(columns, rows):
    """The columns with these rows in doubt."""
    changed = {name: column.copy() for name, column in columns.items()}
    for name, value in (("certified", False), ("settled", False), ("doubt", "rounding")):
        if name in changed:
            changed[name][rows] = value
    return changed


def test_every_summary_of_doubts_is_held():
    """Kinds of tables whose rows may be in doubt say so by one of the functions of the tables above."""
    doubting = {kind.lines.__code__ for kind in kinds().values() if {"certified", "doubt"} & set(kind.names)}
    assert doubting <= {kind_named(make().kind).lines.__code__ for make in TABLES.values()}


@pytest.mark.parametrize("name", TABLES)
def test_rows_in_doubt_are_a_warning_with_their_number(name):
    """Of a table of several hands, guarantees or specs the rows of each one in turn."""
    table = TABLES[name]()
    columns = table.columns
    own = int((columns["doubt"] != "").sum()) if "doubt" in columns else 0
    assert [line for line, warning in said(table, columns) if warning and "not certified" in line] == [] or own
    whose = whose_column(columns)
    words = columns[whose] if whose else np.full(len(next(iter(columns.values()))), "")
    for word in dict.fromkeys(words.tolist()):
        rows = np.flatnonzero(words == word)[:2]
        changed = in_doubt(columns, rows)
        doubts = int((changed["doubt"][words == word] != "").sum()) if "doubt" in changed else len(rows)
        lines = said(table, changed)
        number = re.compile(rf"\b{doubts} (of \d+ )?(row|value|pole|derivative)s?\b")
        assert [line for line, warning in lines if warning and number.search(line)], (word, lines)
        certain = [line for line, _ in lines if ALL.search(line)]
        assert all(word and word not in line.partition(": ")[0] for line in certain), (word, certain)


@pytest.mark.slow
def test_what_sampled_bounds_stand_for_is_not_certified():
    table = TABLES["zwidth-hands"]()
    text = "\n".join(line for line, _ in said(table, table.columns))
    words = {}
    for part in re.split(r"^(?! )", text, flags=re.MULTILINE):
        words[part.partition("(")[2].partition(")")[0]] = "not certified (sampled bounds)" in part
    assert (words["free"], words["passive"]) == (False, True)
