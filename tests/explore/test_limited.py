"""A slider whose range other numbers cut says so, with the reason."""

import wavesweep
from wavesweep.explore.sliders import sliders_of


def test_a_slider_that_ends_early_says_why():
    spec = {"controller": {"kind": "pmw"}, "rates": {"ratio": 33}, "environment": {"delay": 33}}
    said = {slider.path: slider.limited for slider in sliders_of(wavesweep.load(spec))}
    assert said["rates.ratio"].startswith("ends at 33, for 1 is refused (environment.delay: expected ")
    assert {path for path, limited in said.items() if limited} == {"rates.ratio"}
