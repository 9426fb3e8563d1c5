"""Columns that can fail: each is certified with the right ends, or is in doubt as it was.

`expected.csv` has the right ends of each, from `witness.py`; what is answered: certified, a word of doubt, or the name of an
error; what the answer took; and "slow" if that is more than a seventh of a second. `WAVESWEEP_UPDATE=1` writes these anew:
a certificate that is gained has to be written there, one that is lost is a fault.
"""

import numpy as np
import pytest

pytest.importorskip("wavesweep.prove", reason="what is answered is what doubles and balls prove together")
from hard.columns import UPDATE, Counted, ends_of, expected, questions, text_of, update
from hard.witness import Column

import wavesweep

pytestmark = pytest.mark.slow
QUESTIONS, EXPECTED = questions(), expected()
SAME = 1e-9  # of an end, and 1e-12 of the range: what docs/accuracy.md promises along any number
MORE = 2  # times as much work as was needed once


def columns():
    slow = {name for name, row in EXPECTED.items() if row["lane"] == "slow"}
    return [pytest.param(name, marks=[pytest.mark.slow] * (name in slow)) for name in QUESTIONS]


@pytest.mark.sample(40)
@pytest.mark.parametrize("name", columns())
def test_a_column_is_answered_as_well_as_before(name, monkeypatch):
    _, _, spec, span = QUESTIONS[name]
    counted, rows = Counted(monkeypatch), []
    try:
        table = wavesweep.compile(spec).stable_intervals()
        answer = table["doubt"].iloc[0] or "certified"
        rows = [(low, high) for low, high in zip(table["low"], table["high"], strict=True) if np.isfinite(low)]
    except Exception as error:  # noqa: BLE001 - a fault is an answer, which the file names
        answer = type(error).__name__
    work = {cell: getattr(counted, cell) for cell in ("eigenvalue_problems", "ball_operations")}
    if UPDATE:
        update(name, answer=answer, **work)
    row = expected()[name] if UPDATE else EXPECTED[name]
    right, slack = ends_of(row["ends"]), 1e-12 * (span[1] - span[0])
    for low, high in rows:  # also of a column in doubt, whatever of it is known
        assert any(a - SAME * abs(a) - slack <= low and high <= b + SAME * abs(b) + slack for a, b in right), (rows, right)
    if answer == "certified":
        found, known = ([end for pair in pairs for end in pair] for pairs in (rows, right))
        assert found == pytest.approx(known, rel=SAME, abs=slack)
    assert answer == row["answer"], "if it is gained, WAVESWEEP_UPDATE=1 writes it; if it is lost, that is a fault"
    assert all(amount <= MORE * float(row[cell]) + 100 for cell, amount in work.items()), work


@pytest.mark.sample(4)
@pytest.mark.parametrize("name", QUESTIONS)
def test_the_right_ends_are_those_of_the_characteristic_equation(name):
    family, numbers, _, span = QUESTIONS[name]
    ends = Column(family, numbers, span).ends()
    if UPDATE:
        update(name, ends=text_of(ends))
    row = expected()[name] if UPDATE else EXPECTED[name]
    right = [end for pair in ends_of(row["ends"]) for end in pair]
    assert [end for pair in ends for end in pair] == pytest.approx(right, rel=1e-13, abs=1e-15)
