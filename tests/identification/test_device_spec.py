"""What the spec of a device says of its numbers."""

import tomllib

import numpy as np
import pytest

from wavesweep.identification.device_spec import late, negative, spec_text, spoken


@pytest.mark.parametrize(
    ("ends", "told"),
    [((-1.1, -0.9), ""), ((-2.1, -1.9), "2 ticks ahead of its force"), ((-5.0, 1.0), "from -5 to 1 ticks"), ((-1.0, 5.0), "")],
    ids=["rows with the position after their force", "two ticks ahead", "unknown", "a usual delay"],
)
def test_a_position_ahead_of_its_force_is_told_unless_it_is_that_after_it(ends, told):
    low, high = ends
    delay = {"value": (low + high) / 2, "low": low, "high": high, "unit": "tick"}
    sentences = list(negative({"mass": {"low": 0.1}, "delay": delay}))
    assert len(sentences) == bool(told)
    assert told in "".join(sentences)


def number(value, share, unit="kg"):
    return {"value": value, "low": value * (1 - share), "high": value * (1 + share), "unit": unit}


def facts_of(**parameters):
    facts = {"parameters": parameters, "period_s": 2e-3, "spec_name": "log", "turns": False, "missing": "", "explained": True}
    return facts | {"measured": "position", "asked": {}, "resolution": 1e-5}


def test_the_spec_of_two_masses_has_their_numbers_and_a_controller_a_tenth_as_fast_as_their_resonance():
    values = {
        "mass": 0.2,
        "damping": 0.5,
        "load_mass": 0.3,
        "load_damping": 0.4,
        "coupling_stiffness": 480.0,
        "coupling_damping": 0.6,
    }
    facts = facts_of(**{name: number(value, 0.1) for name, value in values.items()}, delay=number(1.5, 0.1, "tick"))
    text = spec_text(facts | {"missing": "unseen"})
    spec = tomllib.loads(text)
    numbers = {name: found["value"] for name, found in spec["numbers"].items()}
    expected = {"Jm": 0.2, "D": 0.5, "Jl": 0.3, "Dl": 0.4, "k": 480.0, "d": 0.6, "tau": 3e-3}
    turn = np.sqrt(480 * (1 / 0.2 + 1 / 0.3))
    expected |= {"f": turn / 2 / np.pi, "kp": 0.5 * turn / 10, "ki": 0.5 * (turn / 10) ** 2 / 10}
    assert {name: numbers[name] for name in expected} == pytest.approx(expected, rel=2e-3)
    assert spec["for_all"]["Jl"] == pytest.approx({"start": 0.27, "stop": 0.33})
    assert spec["for_all"]["Dl"]["values"] == pytest.approx([0.36, 0.44])
    assert "tick_hz = 500.0" in text
    assert "has the ends of its interval as values" in text
    assert "cannot tell whether the model is enough" in text


@pytest.mark.parametrize(
    ("delay", "key", "value"),
    [
        ((1.95, 2.0, 2.05), "delay", 2),
        ((1.2, 1.5, 1.8), "dead_time", 3e-3),
        ((-0.3, 0.02, 0.09), "", None),
        ((None, 1.4, None), "delay", 1),
    ],
)
def test_a_delay_is_in_whole_ticks_where_the_log_tells_that_it_is_and_else_a_dead_time(delay, key, value):
    low, ticks, high = delay
    mass = number(0.1, 0.01) if low is not None else {"value": 0.1, "low": None, "high": None, "unit": "kg"}
    facts = facts_of(
        mass=mass, friction=number(0.2, 0.1, "N"), delay={"value": ticks, "low": low, "high": high, "unit": "tick"}
    )
    assert late(facts) == key
    spec = tomllib.loads(spec_text(facts))
    assert spec["device"].get(key) == value
    assert spec["rates"]["fast_hz"] == 500
    assert spec["simulate"] == {"resolution": 1e-5, "friction": 0.2}
    ranges = {"device.mass": {"start": 0.099, "stop": 0.101}, "device.dead_time": {"start": 2.4e-3, "stop": 3.6e-3}}
    expected = {path: ends for path, ends in ranges.items() if low is not None and (key == "dead_time" or "mass" in path)}
    assert {path: pytest.approx(ends) for path, ends in expected.items()} == spec.get("for_all", {})


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((0.12344, 0.123456789, 0.12347), "0.123457 kg (0.12344 to 0.12347)"),
        ((0.05, 0.12345, 0.25), "0.123 kg (0.05 to 0.25)"),
        ((0.1, 0.1, 0.1), "0.1 kg, given"),
        ((None, 0.1234, None), "0.12 kg (no interval)"),
    ],
)
def test_a_number_is_said_with_two_digits_beyond_its_interval(ends, text):
    assert spoken(dict(zip(("low", "value", "high"), ends, strict=True)) | {"unit": "kg"}) == text
