"""A page of a loop of many ticks a frame begins at once, with a range that shows its limit and a signal with quick margins."""

import pytest

from wavesweep.explore import answers
from wavesweep.explore.explorer_page import Page
from wavesweep.explore.sliders import sliders_of
from wavesweep.program.spec import load

DRONE = {
    "rates": {"tick_hz": 1000.0},
    "numbers": {"kr": 20.0, "kx": 2.0},
    "block": {
        "body": {"type": "mass", "mass": 1.0, "damping": 1.0},
        "rate": {"type": "hold"},
        "fix": {"type": "gain", "k": "kx", "every": 40},
    },
    "wire": {"rate.u": "kr*(fix.y - body.v)", "fix.u": "ref - body.x", "body.f": "rate.y"},
    "ports": {"inputs": {"ref": {"signal": "ref", "unit": "m"}}, "outputs": {"x": {"signal": "body.x", "unit": "m"}}},
    "sweep": {"along": "kr", "kr": {"start": 1.0, "stop": 50000.0}, "kx": [2.0, 3.0]},
}


def test_a_page_begins_with_a_signal_that_is_not_made_in_every_tick():
    cuts = Page(load(DRONE | {"sweep": {"along": "kx", "kx": {"start": 0.0, "stop": 40.0}}}), 0.0).shown["cuts"]
    assert cuts[0] == "fix.y"
    assert set(cuts) == {"fix.y", "rate.y", "body.x", "body.v"}


def test_the_range_of_a_number_that_is_no_gain_shows_its_limit_without_a_proof(monkeypatch):
    spec = load(DRONE)
    limit = 2 / 0.001  # m/T: what a held damping takes of a mass
    monkeypatch.setattr(answers, "_columns", lambda *_: pytest.fail("columns were proved"))
    sliders = {slider.path: slider for slider in sliders_of(spec)}
    plane = answers.fitted(spec, sliders, "numbers.kx", "numbers.kr", (2.0, 3.0))
    assert limit < plane.y_span[1] < 1.6 * limit
