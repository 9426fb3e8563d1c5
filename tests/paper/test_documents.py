"""The two tables of words, as their readers see them."""

import numpy as np
import pytest

from wavesweep.paper.documents import choices_text, counted, statements_text
from wavesweep.paper.open_choices import FIELDS
from wavesweep.paper.readings import CHOICES


def test_every_statement_has_a_row_and_a_line_on_how_it_is_judged(judged):
    table, tests = statements_text(judged).split("## How each is judged")
    assert table.count("\n| ") == len(judged["number"]) + 2 + len(dict.fromkeys(choice.path for choice in CHOICES)) + 2
    assert tests.strip().count("\n") == len(judged["number"]) - 1
    assert counted(judged) in table


def test_a_bar_in_a_cell_does_not_end_it(judged):
    text = statements_text(judged)
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert {line.replace("\\|", "").count("|") for line in rows} == {8, 4}


@pytest.mark.slow
def test_the_study_holds_every_combination_once(choices):
    assert list(choices) == [field.name for field in FIELDS]
    names = ("integration", "velocity", "delay", "b", "lp1_order", "lp1_cutoff_hz")
    combinations = set(zip(*(choices[name].tolist() for name in names), strict=True))
    assert len(combinations) == len(choices["b"]) == 3 * 2 * 3 * 3 * 3 * 3


@pytest.mark.slow
def test_the_page_of_open_choices_fits_a_page_and_has_the_inferred_sets(choices):
    text = choices_text(choices)
    assert len(text.splitlines()) < 60
    assert "| explicit | exact | 0 | 25 | 1 | 8.57 | 799.7 |" in text
    assert "| explicit | difference | 1 | 10 | 1 | 10 | 798.5 | 100 |" in text
    assert np.isnan(choices["K_at_1"][choices["integration"] == "implicit"]).all()
