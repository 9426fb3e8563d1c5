"""Rows and verdicts of specs whose ticks are late, and what is refused beside them."""

from types import SimpleNamespace

import numpy as np
import pytest
from meaning.attacked import contradictions

import wavesweep
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.engine.switched import Bracket, Refuted
from wavesweep.late_ticks import rows as late_rows
from wavesweep.late_ticks.patterns import in_words as pattern_in_words
from wavesweep.late_ticks.tick_curves import late_ticks
from wavesweep.program.sweep.grid import own_loop

pytestmark = pytest.mark.asks("for_all")
SPEC = {
    "rates": {"fast_hz": 1000.0, "ratio": 3},
    "device": {"mass": 0.1, "damping": 1.5, "velocity": "difference"},
    "environment": {"K_VE": 100.0, "B_VE": 1.0, "integration": "explicit", "delay": "frame"},
    "controller": {"kind": "dc-slow"},
    "sweep": {"along": "K_VE", "K_VE": {"start": 0, "stop": 2000}},
    "for_all": {"tick": {"late": 0.0002}},
}


def changed(**tables):
    return {**SPEC, **tables}


def rows_of(spec):
    table = wavesweep.compile(spec).stable_intervals(along="K_VE", span=(0, 2000))
    return table[table["guarantee"] == "for_all"].iloc[0]


@pytest.mark.slow
def test_a_row_lies_within_that_of_ticks_on_time_and_next_to_what_refutes_it():
    late = rows_of(SPEC)
    less = rows_of(changed(for_all={"tick": {"start": 0.001, "stop": 0.00105}}))
    assert late["certified"]
    assert late["low"] < 0.1
    assert late["high"] < less["high"] < late["fails_from"] * 1.2
    assert 0.97 * late["fails_from"] < late["high"] < late["fails_from"]
    assert late["counterexample"].startswith("ticks of 1.2, 1.2, 1")
    assert contradictions(SPEC) == []


TWO_INTERVALS = {
    "rates": {"fast_hz": 1000.0, "ratio": 20},
    "device": {"mass": 0.1, "damping": 1.5, "velocity": "exact"},
    "environment": {**SPEC["environment"], "delay": 0},
    "controller": {"kind": "pmw", "b": 25.0},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
}
FROM_ZERO = Bracket(0.05, 780.0, above=Refuted(785.0, text="ticks of 1.1 ms"))
FAR = Bracket(0.05, 780.0, above=Refuted(790.0, text="ticks of 1.1 ms"))
TO_THE_END = Bracket(2600.0, 4448.0, Refuted(2570.0, text="ticks of 1.3 ms"))
FAILS = Bracket(3000.0, 3000.0, above=Refuted(3000.0, text="ticks of 1.2 ms"))
OPEN = "within environment.K_VE 0 to 0.05"
FAILED = "within environment.K_VE 2523 to 4449, refuted at 3000 by ticks of 1.2 ms"


@pytest.mark.parametrize(
    ("first", "second", "rows", "left_open"),
    [
        (FROM_ZERO, TO_THE_END, [(0.05, 780, np.nan, 785, True), (2600, 4448, 2570, 4448.82, False)], [OPEN, ""]),
        (FAR, FAILS, [(0.05, 780, np.nan, 790, False)], [f"{OPEN}; {FAILED}"]),
        (None, FAILS, [(np.nan, np.nan, np.nan, 3000, False)], [f"within environment.K_VE 0 to 799.8; {FAILED}"]),
    ],
    ids=["both are proved", "one is refuted", "nothing is proved"],
)
def test_each_interval_on_time_is_told_with_what_is_proved_or_refuted(monkeypatch, first, second, rows, left_open):
    monkeypatch.setattr(late_rows, "bracket", lambda _, about: second if about[0] else first)
    loop = own_loop(wavesweep.load(changed(**TWO_INTERVALS)), "environment.K_VE")
    found = late_rows.records_for_ticks(loop, "environment.K_VE", (0.0, 20000.0), (1e-3, 1.2e-3))
    columns = ["low", "high", "fails_below", "fails_from", "settled"]
    assert np.allclose(found[columns].tolist(), rows, rtol=1e-6, equal_nan=True)
    assert found["left_open"].tolist() == left_open


@pytest.mark.slow
@pytest.mark.asks("check")
def test_check_says_for_which_ticks_the_loop_is_stable():
    (question,) = wavesweep.verdict(SPEC)["questions"]
    assert question["status"] == "proved"
    assert question["scope"]["tick"] == {"low": 0.001, "high": pytest.approx(0.0012)}
    high = changed(environment={**SPEC["environment"], "K_VE": 500.0})
    (question,) = wavesweep.verdict(high)["questions"]
    assert question["status"] == "refuted"
    assert "ticks of 1.2, 1.2, 1 ms" in question["reason"]


def test_the_ticks_of_a_refuter_are_those_of_the_set():
    """Rounded to six digits 1.12345678 ms would be a tick that is longer than any."""
    ticks = SimpleNamespace(lengths=[1e-3, 1.12345678e-3], places=1)
    assert pattern_in_words(ticks, (1, 1, 0)) == "ticks of 1.12345678, 1.12345678, 1 ms"


def test_a_tick_is_late_by_up_to_all_of_what_is_written():
    tick = wavesweep.load(SPEC).tick
    assert tick.interval(1000.0) == pytest.approx((0.001, 0.0012))
    assert "1 to 1.2 ms" in tick.in_words(1000.0)


@pytest.mark.parametrize(
    ("for_all", "words"),
    [
        ({"tick": {"start": 0.0011, "stop": 0.0012}}, "own tick of 0.001 s"),
        ({"tick": {"start": 0.0009}}, "either late, or start and stop"),
        ({"tick": {"late": 10.0}}, "10000 of the spec's own ticks"),
        ({"tick": {"late": 0.0002, "steps": "measured"}}, "divides by the measured time is not"),
        ({"tick": {"late": 0.0002}, "contact": True}, "tick alone in [for_all]"),
        ({"tick": {"late": 0.0002}, "lost": 1}, "tick alone in [for_all]"),
    ],
)
def test_what_is_not_proved_is_refused_at_reading(for_all, words):
    with pytest.raises(SpecError, match=words.replace("[", r"\[")):
        wavesweep.load(changed(for_all=for_all))


def test_ticks_of_a_minute_may_be_late():
    tank = {"type": "tf", "num": [1], "den": [1, 1e-4]}
    tables = {"rates": {"tick_hz": 1 / 60}, "block": {"tank": tank}, "wire": {"tank.u": "-0.002*tank.y"}}
    assert wavesweep.load(tables | {"for_all": {"tick": {"late": 60.0}}}).tick.late == 60.0


def test_rates_that_do_not_divide_and_numbers_inside_the_device_are_refused():
    with pytest.raises(SpecError, match="a whole number of ticks in a frame"):
        wavesweep.load(changed(rates={"fast_hz": 1000.0, "slow_hz": 60.0}))
    along = {"along": "device.damping", "device.damping": {"start": 1, "stop": 2}}
    loop = wavesweep.compile(changed(sweep=along))
    with pytest.raises(UsageError, match="one wire or gain reads"):
        loop.stable_intervals(along="device.damping", span=(1, 2))


@pytest.mark.slow
def test_lengths_are_divided_where_curves_need_it_alone():
    """Ticks of up to 31 times their own time need few cells, and the short ones the fewest."""
    loop = own_loop(wavesweep.load(changed(rates={"ratio": 1})))
    ticks = late_ticks(loop, "", (1e-3, 31e-3))
    assert ticks.cells < 16
    assert ticks.lengths[0] == 1e-3
    assert ticks.lengths[-1] == pytest.approx(31e-3)
    widths = np.diff(np.log(ticks.lengths))
    assert widths[0] > 1.5 * widths[-1]
