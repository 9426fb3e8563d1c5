"""Drawn loops without a state: nothing can grow in them, so they are stable wherever their direct terms have a solution."""

import numpy as np
import pytest

import wavesweep

GAIN = {"type": "gain"}
DELAY = {"type": "delay", "steps": 3}
HELD = {"type": "gain", "every": 4, "phase": 1}


def around(k, start, stop, blocks=None, through="a.y"):
    """A gain that is fed by its own output, k times."""
    return {
        "rates": {"tick_hz": 1000.0},
        "numbers": {"k": 0.5},
        "block": {"a": GAIN, **(blocks or {})},
        "wire": {"a.u": f"{k}*{through}", **{f"{name}.u": "a.y" for name in blocks or {}}},
        "sweep": {"along": "k", "k": {"start": start, "stop": stop}},
    }


@pytest.mark.whole
@pytest.mark.slow
@pytest.mark.parametrize(
    "spec",
    [
        around("k", -3.0, 0.9),
        around("k*k", -0.9, 0.9, {"d": DELAY}),  # whose states nothing reads
    ],
)
def test_it_is_stable_where_its_direct_terms_have_a_solution(spec):
    table = wavesweep.stability_region(spec)
    span = spec["sweep"]["k"]
    assert table[["low", "high", "certified"]].to_numpy().tolist() == [[span["start"], span["stop"], True]]
    assert wavesweep.compile(spec).spectral_radius(k=0.5) == 0
    found = wavesweep.verdict(spec)
    assert (found["stable"], found["slowest"]["time_constant_s"]) == (True, 0)


@pytest.mark.slow
@pytest.mark.whole
@pytest.mark.parametrize(("stop", "blocks"), [(3.0, {}), (1 + 1e-10, {"h": HELD})])
def test_nothing_is_certified_over_a_value_without_a_solution(blocks, stop):
    """a = k a has none at k = 1: this is an open place of the row. Beside it the loop is stable."""
    table = wavesweep.stability_region(around("k", -3.0, stop, blocks))
    np.testing.assert_allclose(table[["low", "high"]], [[-3.0, stop]], atol=1e-8)
    assert table[["certified", "doubt", "open_places"]].to_numpy().tolist() == [[False, "search", 1]]
    np.testing.assert_allclose(table[["open_low", "open_high"]], [[1.0, 1.0]], atol=1e-8)
    assert table["open_low"][0] < 1
    assert table["open_high"][0] >= min(stop, 1)
