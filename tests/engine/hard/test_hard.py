"""Columns that can fail: each is certified with the right ends, or is in doubt as it was.

`expected.csv` has the right ends of each, which were the roots of its characteristic equation in ball arithmetic; what is
answered: certified, a word of doubt, or the name of an error; and what the answer took. `WAVESWEEP_UPDATE=1` writes answers
anew: a certificate that is gained has to be written there, one that is lost is a fault.
"""

import numpy as np
import pytest

pytest.importorskip("wavesweep.prove", reason="what is answered is what doubles and balls prove together")
from hard.columns import UPDATE, Counted, ends_of, expected, questions, update

import wavesweep

pytestmark = pytest.mark.slow
QUESTIONS, EXPECTED = questions(), expected()
SAME = 1e-9  # of an end, and 1e-12 of the range: what docs/accuracy.md promises along any number
MORE = 2  # times as much work as was needed once


@pytest.mark.sample(40)
@pytest.mark.parametrize("name", QUESTIONS)
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
