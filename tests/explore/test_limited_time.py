"""Answers of a page that take too long are cut, and the process that computes them ends."""

import time
from functools import partial

import pytest

from wavesweep.explore.limited_time import LimitedAnswers


@pytest.fixture
def limited():
    answers = LimitedAnswers(partial(dict, size=abs, wait=time.sleep), 0.5)  # s
    yield answers
    answers.end()


def test_an_answer_is_what_a_function_gives_and_its_error_is_raised(limited):
    assert limited.of("size")(-3) == 3
    with pytest.raises(TypeError):
        limited.of("size")("three")


def test_an_answer_that_takes_too_long_is_cut_and_others_come_after_it(limited):
    begun = time.monotonic()
    assert limited.of("wait")(600) == {"error": "takes longer than 0.5 s", "cut": True}
    assert time.monotonic() - begun < 300
    assert [limited.of("size")(-3) for _ in range(3)] == [3, 3, 3]
