"""When slow results are in place where rates do not divide, against times by hand and the interpreter of the documents."""

from fractions import Fraction
from math import ceil, floor

import pytest
from meaning.judge import judge_intervals
from meaning.reading import drift_of, with_numbers

import wavesweep as package
from wavesweep.haptics.controller_page import Slow


def in_place(tick: int, frame: Fraction, late) -> int:
    """The number of the last result whose time has come by a tick; its step is at `number * frame` ticks."""
    late = frame if late == "frame" else late
    number = floor(Fraction(tick) / frame) + 1
    while number * frame + late > tick:
        number -= 1
    return number


def spec(kind: str, fast_hz: float, slow_hz: float, late):
    return {
        "rates": {"fast_hz": fast_hz, "slow_hz": slow_hz},
        "device": {"velocity": "difference"},
        "environment": {"integration": "explicit", "delay": late},
        "controller": {"kind": kind},
        "sweep": {"K_VE": {"start": 0, "stop": 20000}, "B_VE": [1.0]},
    }


def test_a_result_is_in_place_when_its_time_has_come():
    """By hand, of 2.5 ticks to a frame: steps at 0, 2.5 and 5."""
    frame = Fraction(5, 2)
    assert [in_place(tick, frame, "frame") for tick in range(6)] == [-1, -1, -1, 0, 0, 1]
    assert [in_place(tick, frame, 0) for tick in range(6)] == [0, 0, 0, 1, 1, 2]
    assert [in_place(tick, frame, 3) for tick in range(7)] == [-2, -1, -1, 0, 0, 0, 1]


def shown_by(slow: Slow, frame: Fraction) -> list[int]:
    """Numbers of the results that the blocks of a page show in the ticks of a frame, some frames after the start."""
    computed = kept = before = shown = -1
    found = []
    for tick in range(6 * frame.numerator):
        at = tick % frame.numerator
        computed += slow.reads.count(at)
        kept = computed if at in slow.stored or not slow.stored else kept
        if at in slow.shown:
            shown, before = (kept if slow.by == "hold" else before), kept
        found.append(shown if slow.shown else kept)
    return found


def test_the_blocks_of_a_page_show_each_result_when_its_time_has_come():
    """For frames of a tick, of two and of up to 11, whole and not, and all delays."""
    kinds = set()
    for frame in {Fraction(ticks, steps) for ticks in range(1, 12) for steps in range(1, ticks // 2 + 1)} | {Fraction(1)}:
        for late in ["frame", *range(ceil(frame) + 1)]:
            slow = Slow.of({"rates.ratio": float(frame), "environment.delay": frame if late == "frame" else late})
            kinds.add((slow.by, bool(slow.stored), bool(slow.shown)))
            right = [in_place(tick, frame, late) for tick in range(6 * frame.numerator)]
            assert shown_by(slow, frame)[3 * frame.numerator :] == right[3 * frame.numerator :], (frame, late)
    assert len(kinds) == 5


@pytest.mark.parametrize(("slow_hz", "right"), [(400.0, 576.5787485710594), (60.0, 96.11155302501459)])
def test_the_next_frame_is_an_instant_and_no_number_of_ticks(slow_hz, right):
    (row,) = package.compile(spec("dc-slow", 1000.0, slow_hz, "frame")).stable_intervals().itertuples()
    assert row.certified
    assert row.high == pytest.approx(right, rel=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rates.slow_hz", "rates.ratio"])
def test_the_next_frame_stays_the_next_one_where_the_rate_is_swept(name):
    values = [500.0, 400.0, 60.0] if name == "rates.slow_hz" else [2, 5, 20]
    swept = package.compile(spec("dc-slow", 1000.0, 60.0, "frame")).stable_intervals(**{name: values})
    for value, high in zip(values, swept.high, strict=True):
        slow_hz = value if name == "rates.slow_hz" else 1000 / value
        (alone,) = package.compile(spec("dc-slow", 1000.0, slow_hz, "frame")).stable_intervals().high
        assert high == pytest.approx(alone, rel=1e-9)


LATE = [
    (60.0, "frame"), (60.0, 17), (400.0, 0), (400.0, 3), (300.0, 4), (500.0, 2), (1000.0, "frame"),
    (480.0, "frame"), (480.0, 2), (480.0, 3),  # hardly more than two ticks to a frame: two results may be under way at once
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("slow_hz", "late"), LATE)
@pytest.mark.parametrize("kind", ["dc-slow", "pmw"])
def test_ends_of_results_that_are_late_are_those_of_the_documents(kind, slow_hz, late):
    tables = spec(kind, 1000.0, slow_hz, late)
    loop = package.compile(tables)
    assert loop.stable_intervals().certified.all()
    tables["sweep"]["along"] = "K_VE"
    drift = drift_of(with_numbers(tables, {"K_VE": 300.0}))
    found = judge_intervals(tables, drift, loop)
    assert [one for one in found if not one.same] == []
    assert kind == "pmw" or "high end" in {one.what for one in found}
