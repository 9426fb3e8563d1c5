"""When slow results are in place where rates do not divide, against a march in exact time without the package's blocks."""

from fractions import Fraction
from itertools import pairwise
from math import ceil, exp, floor, pi, sqrt, tan

import numpy as np
import pytest

import wavesweep as package
from wavesweep import load
from wavesweep.haptics.controller_page import Slow

MASS, DAMPING, B_VE = 0.1, 1.5, 1.0  # kg, N s/m, N s/m: the defaults
B, CUTOFF_HZ = 25.0, 10.0  # N s/m of the waves, Hz of LP1
KEPT = 4  # of the last results, more than are ever under way


def in_place(tick: int, frame: Fraction, late) -> int:
    """The number of the last result whose time has come by a tick; its step is at `number * frame` ticks."""
    late = frame if late == "frame" else late
    number = floor(Fraction(tick) / frame) + 1
    while number * frame + late > tick:
        number -= 1
    return number


def plant(fast_hz: float):
    """x and v of a mass with damping after a tick, from x, v and the force that is held over it."""
    T, r = 1 / fast_hz, DAMPING / MASS
    decay = exp(-r * T)
    travel = (1 - decay) / r
    A = np.array([[1.0, travel], [0.0, decay]])
    return A, np.array([(T - travel) / DAMPING, (1 - decay) / DAMPING])


def direct(K: float, fast_hz: float, frame: Fraction, late, start: np.ndarray) -> np.ndarray:
    """State after the common frame, of x, v, x a tick ago, and the last results: the force that a slow wall samples."""
    A, G = plant(fast_hz)
    x, v, before, *results = start
    results = list(results)  # that of step -1 first
    done = -1
    for tick in range(frame.numerator):
        for step in range(done + 1, frame.denominator):
            if floor(step * frame) == tick:
                results.insert(0, K * x + B_VE * (x - before) * fast_hz)
                done = step
        force = results[done - in_place(tick, frame, late)]
        (x, v), before = A @ [x, v] - G * force, x
    return np.array([x, v, before, *results[:KEPT]])


def waves(K: float, fast_hz: float, frame: Fraction, late, start: np.ndarray) -> np.ndarray:
    """The same of waves to an explicit avatar: x, v, x a tick ago, LP1's state, the avatar, and the last waves."""
    A, G = plant(fast_hz)
    a = tan(pi * CUTOFF_HZ / fast_hz)
    x, v, before, low, avatar, *results = start
    results = list(results)
    done = -1
    for tick in range(frame.numerator):
        # No result is in place as it is computed in what is tried here, so the wave does not go round within the tick.
        computed = done + any(floor(step * frame) == tick for step in range(frame.denominator))
        assert computed == done or in_place(tick, frame, late) < computed
        returned = results[done - in_place(tick, frame, late)]
        measured = (x - before) * fast_hz
        force = B * measured - sqrt(2 * B) * returned
        wave = sqrt(2 * B) * measured - returned
        filtered = low + a / (1 + a) * wave  # bilinear: y (1 + a) = y' (1 - a) + a (u + u')
        low = ((1 - a) * filtered + a * wave) / (1 + a)
        if computed > done:
            speed = (sqrt(2 * B) * filtered - K * avatar) / (B + B_VE)
            results.insert(0, filtered - sqrt(2 / B) * (K * avatar + B_VE * speed))
            avatar += speed * float(frame) / fast_hz
            done = computed
        (x, v), before = A @ [x, v] - G * force, x
    return np.array([x, v, before, low, avatar, *results[:KEPT]])


def radius(march, K: float, fast_hz: float, frame: Fraction, late) -> float:
    """The largest modulus of the frame's eigenvalues without the drift of x at exactly 1."""
    n = (3 if march is direct else 5) + KEPT
    matrix = np.array([march(K, fast_hz, frame, late, unit) for unit in np.eye(n)]).T
    found = np.linalg.eigvals(matrix)
    if march is waves:
        found = np.delete(found, np.argmin(abs(found - 1)))
    return max(abs(found))


def limit(march, fast_hz: float, slow_hz: float, late, low: float, high: float) -> float:
    frame = Fraction(int(fast_hz), int(slow_hz))
    for _ in range(40):
        middle = (low + high) / 2
        if radius(march, middle, fast_hz, frame, late) < 1:
            low = middle
        else:
            high = middle
    return low


def spec(kind: str, fast_hz: float, slow_hz: float, late):
    return load(
        {
            "rates": {"fast_hz": fast_hz, "slow_hz": slow_hz},
            "device": {"velocity": "difference"},
            "environment": {"integration": "explicit", "delay": late},
            "controller": {"kind": kind},
            "sweep": {"K_VE": {"start": 0, "stop": 20000}, "B_VE": [B_VE]},
        }
    )


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
    assert limit(direct, 1000.0, slow_hz, "frame", 0.5 * right, 2 * right) == pytest.approx(right, rel=1e-11)


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
@pytest.mark.parametrize(("kind", "march"), [("dc-slow", direct), ("pmw", waves)])
def test_ends_of_results_that_are_late_are_those_of_a_march_in_time(kind, march, slow_hz, late):
    if late == 0 and march is waves:
        pytest.skip("the wave goes round within the tick")
    frame = Fraction(1000, int(slow_hz))
    table = package.compile(spec(kind, 1000.0, slow_hz, late)).stable_intervals()
    assert table.certified.all()
    for end in {*table.low, *table.high} - {0.0, 20000.0}:
        below, above = (radius(march, end * share, 1000.0, frame, late) < 1 for share in (1 - 1e-8, 1 + 1e-8))
        assert below != above
    for low, high in pairwise([0.0, *np.ravel([*zip(table.low, table.high, strict=True)]), 20000.0]):
        if low < high:
            middle = (low + high) / 2
            inside = ((table.low < middle) & (middle < table.high)).any()
            assert inside == (radius(march, middle, 1000.0, frame, late) < 1)
