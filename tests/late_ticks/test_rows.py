"""Rows and verdicts of specs whose ticks are late, and what is refused beside them."""

import pytest

import wavesweep
from wavesweep.engine.errors import SpecError, UsageError

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


@pytest.mark.slow
@pytest.mark.asks("check")
def test_check_says_for_which_ticks_the_loop_is_stable():
    said = wavesweep.verdict(SPEC)
    (question,) = said["questions"]
    assert said["answer"] == "yes"
    assert question["status"] == "proved"
    assert question["scope"]["tick"] == {"low": 0.001, "high": pytest.approx(0.0012)}
    high = changed(environment={**SPEC["environment"], "K_VE": 500.0})
    refuted = wavesweep.verdict(high)
    assert refuted["answer"] == "no"
    assert "ticks of 1.2, 1.2, 1 ms" in refuted["questions"][0]["reason"]


def test_a_tick_is_late_by_up_to_all_of_what_is_written():
    tick = wavesweep.load(SPEC).tick
    assert tick.interval(1000.0) == pytest.approx((0.001, 0.0012))
    assert "1 to 1.2 ms" in tick.in_words(1000.0)


@pytest.mark.parametrize(
    ("for_all", "words"),
    [
        ({"tick": {"start": 0.0011, "stop": 0.0012}}, "own tick of 0.001 s"),
        ({"tick": {"start": 0.0009}}, "either late, or start and stop"),
        ({"tick": {"late": 0.0002, "steps": "measured"}}, "divides by the measured time is not"),
        ({"tick": {"late": 0.0002}, "contact": True}, "tick alone in [for_all]"),
        ({"tick": {"late": 0.0002}, "lost": 1}, "tick alone in [for_all]"),
        (
            {"tick": {"late": 0.0002}, "device.mass": {"start": 0.1, "stop": 0.2}},
            "tick alone in [for_all]",
        ),
    ],
)
def test_what_is_not_proved_is_refused_at_reading(for_all, words):
    with pytest.raises(SpecError, match=words.replace("[", r"\[")):
        wavesweep.load(changed(for_all=for_all))


def test_rates_that_do_not_divide_and_numbers_inside_the_device_are_refused():
    with pytest.raises(SpecError, match="a whole number of ticks in a frame"):
        wavesweep.load(changed(rates={"fast_hz": 1000.0, "slow_hz": 60.0}))
    along = {"along": "device.damping", "device.damping": {"start": 1, "stop": 2}}
    loop = wavesweep.compile(changed(sweep=along))
    with pytest.raises(UsageError, match="one wire or gain reads"):
        loop.stable_intervals(along="device.damping", span=(1, 2))
