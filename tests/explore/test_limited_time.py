"""Answers of a page that take too long are cut, and what computes them ends."""

import threading
import time

import pytest

from wavesweep.explore import explorer_page
from wavesweep.explore.explorer_page import Page
from wavesweep.explore.limited_time import within
from wavesweep.program.spec import load


def test_a_call_gives_what_it_returns_and_what_it_raises():
    assert within(60, lambda: 3) == 3
    with pytest.raises(KeyError):
        within(60, lambda: {}["missing"])


def test_a_call_that_takes_too_long_is_cut_and_ends():
    ended = threading.Event()

    def endless():
        try:
            while True:
                time.sleep(0.001)
        finally:
            ended.set()

    with pytest.raises(TimeoutError):
        within(0.05, endless)
    assert ended.wait(60)


def test_a_page_says_that_an_answer_was_cut(monkeypatch):
    page = Page(load({"controller": {"kind": "pmw"}}), answer_s=0.05)
    monkeypatch.setattr(explorer_page, "text_of", lambda _: threading.Event().wait(1))
    assert page.answers["toml"]({"values": {}}) == {"error": "takes longer than 0.05 s", "cut": True}
