"""Closed-loop poles, their states and root loci, against closed forms."""

import tomllib

import numpy as np
import pytest
from support.drawn import DRIVE

import wavesweep
from wavesweep.check.locus import ends_on_circle, poles_over
from wavesweep.core.analyses.asked import axes_asked
from wavesweep.core.spec import load

# Two springs and masses that do not act on each other, m x'' + d x' + k x = 0, and a filter that only watches.
APART = {
    "rates": {"tick_hz": 500},
    "block": {
        "one": {"type": "mass", "mass": 1.0, "damping": 0.8, "stiffness": 400.0},
        "two": {"type": "mass", "mass": 2.0, "damping": 8.0, "stiffness": 20000.0},
        "watch": {"type": "lowpass", "a": 0.25, "every": 2},
    },
    "wire": {"one.f": "0", "two.f": "0", "watch.u": "one.x"},
}


def test_poles_of_springs_are_those_of_their_equations():
    found = wavesweep.compile(APART).poles()
    assert found.attrs["units"]["s_re"] == "1/s"
    s = found.s_re + 1j * found.s_im
    wanted = {
        "one": (-0.4 + 1j * np.sqrt(400 - 0.16), 20.0, 0.02),
        "two": (-2.0 + 1j * np.sqrt(1e4 - 4.0), 100.0, 0.02),
    }
    for name, (pole, natural, ratio) in wanted.items():
        rows = found[found.states.str.startswith(name)]
        assert len(rows) == 2
        assert s[rows.index[0]] == pytest.approx(pole, rel=1e-10)
        assert s[rows.index[1]] == pytest.approx(pole.conjugate(), rel=1e-10)
        np.testing.assert_allclose(rows.damping_ratio, ratio, rtol=1e-9)
        np.testing.assert_allclose(rows.time_constant_s, 1 / (ratio * natural), rtol=1e-9)
        np.testing.assert_allclose(rows.frequency_hz, abs(pole.imag) / (2 * np.pi), rtol=1e-9)
        assert {*", ".join(rows.states).split(", ")} == {f"{name} position", f"{name} velocity"}
    (watch,) = found[found.states.str.startswith("watch")].radius
    assert watch == pytest.approx(0.75, rel=1e-12)
    assert found.radius.is_monotonic_decreasing


def test_the_radius_is_that_of_the_loop_and_drift_is_left_out():
    own = wavesweep.compile(tomllib.loads(DRIVE))
    found = own.poles()
    assert found.radius[0] == pytest.approx(own.spectral_radius(), rel=1e-12)
    assert not found.states.str.contains("position").any()


def test_check_names_the_states_of_the_slowest_mode_and_of_the_least_damped():
    found = wavesweep.verdict(APART)
    assert found["slowest"]["states"][0].startswith("one")
    assert found["least_damped"] is None or found["least_damped"]["damping_ratio"] <= found["slowest"]["damping_ratio"]
    heavy = {**APART, "block": APART["block"] | {"two": {"type": "mass", "mass": 2.0, "damping": 2.0, "stiffness": 20000.0}}}
    found = wavesweep.verdict(heavy)
    assert (found["slowest"]["states"][0][:3], found["least_damped"]["states"][0][:3]) == ("one", "two")
    assert found["least_damped"]["damping_ratio"] == pytest.approx(0.005, rel=1e-6)


def test_a_root_locus_has_the_poles_of_every_value_and_its_ends_are_on_the_circle():
    spec = load(tomllib.loads(DRIVE))
    (axis,) = axes_asked(spec, {"kp": [0.2, 5.0, 40.0]})
    numbers, z = poles_over(spec, axis)
    for kp in axis.values:
        own = wavesweep.compile(spec.with_values({"kp": kp})).poles()
        np.testing.assert_allclose(np.sort(np.abs(z[numbers == kp])), np.sort(own.radius), rtol=0, atol=1e-9)
    (end,) = ends_on_circle(spec, axis)
    (interval,) = wavesweep.compile(spec).stable_intervals("kp", (0.2, 40.0)).high
    assert (end[0], end[3]) == (interval, True)
    assert end[1].size
    np.testing.assert_allclose(np.abs(end[1]), 1, rtol=0, atol=1e-9)


def test_the_figure_of_a_root_locus_marks_certified_ends():
    own = wavesweep.compile(tomllib.loads(DRIVE))
    canvas = own.plot_root_locus("kp")
    (legend,) = [text.get_text() for text in canvas.legends[0].get_texts()]
    (row,) = own.stable_intervals("kp").itertuples()
    assert legend == f"kp = {row.high:.6g}, {row.high_hz:.4g} Hz"
