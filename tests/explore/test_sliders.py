"""Which numbers a page varies, in which range, and the spec with them as a file."""

import tomllib
from contextlib import suppress

import pytest
from support.specs import shipped

from wavesweep.engine.errors import SpecError
from wavesweep.explore.answers import first_plane
from wavesweep.explore.sliders import changed, number_of, sliders_of, text_of
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import keys_of

SPECS = [path for path in shipped() if "[block." not in path.read_text(encoding="utf-8")]
EDGES = {"passband_hz": 5.0, "stopband_hz": 40.0, "passband_db": 1.0, "stopband_db": 20.0}


@pytest.mark.sample(24)
@pytest.mark.slow
@pytest.mark.parametrize("path", shipped(), ids=lambda path: path.stem)
def test_every_number_that_a_loop_reads_has_a_slider_whose_ends_make_a_loop(path):
    """A notch rules out a tenth of its rate, and four times its frequency: the sliders end before."""
    spec = load(path)
    sliders = {slider.path: slider for slider in sliders_of(spec)}
    read = {path for path in keys_of(spec) if spec.names.keys[path].numeric}
    if "rates.slow_hz" in spec.given:
        read = read - {"rates.ratio"} | {"rates.slow_hz"}
    assert spec.drawing or read <= set(sliders)
    for slider in sliders.values():
        assert slider.low <= slider.value <= slider.high
        assert slider.low < slider.high
        assert slider.scale == "linear" or slider.low > 0
        for end in (slider.low, slider.high, *((slider.search or ()) if not spec.drawing else ())):
            assert number_of(changed(spec, {slider.path: end}), slider.path) == pytest.approx(end, rel=1e-15)


def test_a_gain_of_zero_hides_no_slider():
    spec = load({"controller": {"kind": "pmw-lm"}, "local_model": {"K_LM": 0.0, "B_LM": 0.0}})
    assert {"local_model.K_LM", "local_model.B_LM", "filters.hp.cutoff_hz"} <= {each.path for each in sliders_of(spec)}


def test_band_edges_are_varied_in_place_of_what_follows_from_them():
    spec = load({"controller": {"kind": "pmw"}, "filters": {"lp1": EDGES}})
    sliders = {slider.path: slider for slider in sliders_of(spec)}
    assert {f"filters.lp1.{edge}" for edge in EDGES} <= set(sliders)
    assert "filters.lp1.cutoff_hz" not in sliders
    assert sliders["filters.lp1.stopband_hz"].value == 40.0
    other = changed(spec, {"filters.lp1.stopband_hz": 15.0})
    assert other.values["filters.lp1.order"] > spec.values["filters.lp1.order"]
    again = load(tomllib.loads(text_of(other)))
    assert dict(again.values) == dict(other.values)
    assert again.sha256 == other.sha256


def test_a_slow_rate_that_does_not_divide_is_varied_itself():
    spec = load({"controller": {"kind": "pmw"}, "rates": {"slow_hz": 60.0}})
    paths = {slider.path: slider.value for slider in sliders_of(spec)}
    assert paths["rates.slow_hz"] == 60.0
    assert "rates.ratio" not in paths
    assert load(tomllib.loads(text_of(spec))).sha256 == spec.sha256


@pytest.mark.asks("simulation")
def test_the_copied_text_is_one_that_every_command_takes():
    """Frequencies, a swept cutoff and a sine that the lower rate rules out."""
    tables = {"controller": {"kind": "pmw"}, "bode": {"frequency_hz": {"start": 0.1, "stop": 400.0, "num": 9, "scale": "log"}}}
    tables |= {"sweep": {"filters.lp1.cutoff_hz": [10.0, 300.0]}, "simulate": {"frequency_hz": 300.0}}
    again = load(tomllib.loads(text_of(changed(load(tables), {"rates.fast_hz": 500.0}))))
    assert (again.frequency_hz[-1], len(again.frequency_hz), again.sweep) == (250.0, 9, ())
    few = changed(load(tables | {"bode": {"frequency_hz": [1.0, 300.0]}}), {"rates.fast_hz": 500.0})
    assert load(tomllib.loads(text_of(few))).frequency_hz == (1.0,)


def test_the_copied_text_is_the_same_request():
    for path in SPECS:
        spec = load(path)
        assert load(tomllib.loads(text_of(spec))).sha256 == spec.sha256
        other = changed(spec, {"device.mass": 0.123, "environment.K_VE": 321.0})
        again = load(tomllib.loads(text_of(other)))
        assert again.sha256 == other.sha256 != spec.sha256


KEPT = {
    "ratio": {"rates": {"ratio": 5}},
    "slow rate": {"rates": {"slow_hz": 50.0}},
    "uneven": {"rates": {"slow_hz": 60.0}},
    "delay of a frame": {"rates": {"slow_hz": 50.0}, "environment": {"delay": "frame"}},
    "band": {"filters": {"lp1": {"passband_hz": 8.0, "stopband_hz": 90.0, "passband_db": 3.0, "stopband_db": 20.0}}},
}


@pytest.mark.parametrize("name", KEPT)
def test_no_slider_shows_a_number_that_the_loop_does_not_have(name):
    """Whatever one slider is set to, the loop has the numbers that the others still show."""
    spec = load({"controller": {"kind": "pmw"}, **KEPT[name]})
    sliders, moved = sliders_of(spec), 0
    for slider in sliders:
        for value in slider.stops or (slider.low, slider.high):
            with suppress(SpecError):
                other = changed(spec, {slider.path: value})
                shown = {each.path: each.value for each in sliders} | {slider.path: value}
                assert {path: number_of(other, path) for path in shown} == pytest.approx(shown, rel=1e-12), slider.path
                moved += value != slider.value
    assert moved > len(sliders)


def test_rates_of_a_spec_that_keeps_the_slow_one_stop_where_they_divide():
    spec = load({"controller": {"kind": "pmw"}, "rates": {"fast_hz": 1000.0, "slow_hz": 50.0}})
    sliders = {slider.path: slider for slider in sliders_of(spec)}
    assert sliders["rates.fast_hz"].stops[:3] == (50.0, 100.0, 150.0)
    assert all((1000.0 / stop).is_integer() for stop in sliders["rates.slow_hz"].stops if stop.is_integer())
    assert {changed(spec, {"rates.slow_hz": stop}).uneven for stop in sliders["rates.slow_hz"].stops} == {False}
    assert load(tomllib.loads(text_of(spec))).given >= {"rates.slow_hz"}


def test_a_page_opens_over_what_is_swept():
    """The wall where it is swept, and else the other numbers."""
    planes = {
        ("environment.K_VE", "environment.B_VE"): {"K_VE": {"start": 0, "stop": 5000}},
        ("environment.K_VE", "controller.b"): {"K_VE": {"start": 0, "stop": 5000}, "b": [20.0, 40.0]},
        ("controller.b", "device.mass"): {"along": "b", "b": {"start": 2, "stop": 100}, "device.mass": [0.05, 0.1]},
    }
    for (y, x), sweep in planes.items():
        spec = load({"controller": {"kind": "pmw"}, "sweep": sweep})
        plane = first_plane(spec, sliders_of(spec))
        assert (plane.y, plane.x) == (y, x)
