"""Closed-loop poles, their states and root loci, against closed forms, python-control, and what a march shows."""

import json
import tomllib

import control
import numpy as np
import pytest
from meaning.reading import machine_of, with_numbers
from support.drawn import APART, DRIVE

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.poles.table import ends_on_circle
from wavesweep.program.analyses.asked import axes_asked
from wavesweep.program.analyses.poles import poles
from wavesweep.program.spec import load
from wavesweep.program.tables import kind_named
from wavesweep.program.tables.columns import in_order


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


def test_a_root_locus_has_the_poles_of_every_value_and_its_ends_are_on_the_circle():
    spec = load(tomllib.loads(DRIVE))
    (axis,) = axes_asked(spec, {"kp": [0.2, 5.0, 40.0]})
    found = poles(spec, axis)
    numbers, z = found["kp"], found["z_re"] + 1j * found["z_im"]
    for kp in axis.values:
        own = wavesweep.compile(spec.with_values({"kp": kp})).poles()
        np.testing.assert_allclose(np.sort(np.abs(z[numbers == kp])), np.sort(own.radius), rtol=0, atol=1e-9)
    (end,) = ends_on_circle(spec, axis)
    (interval,) = wavesweep.compile(spec).stable_intervals("kp", (0.2, 40.0)).high
    assert (end[0], end[4]) == (interval, True)
    assert end[1]
    np.testing.assert_allclose(np.hypot(end[1], end[2]), 1, rtol=0, atol=1e-9)


def test_at_one_rate_they_are_what_damp_of_python_control_has():
    T, K, B, m, d = 1e-3, 900.0, 3.0, 0.1, 0.5
    plant = control.c2d(control.ss([[0, 1], [0, -d / m]], [[0], [1 / m]], np.eye(2), np.zeros((2, 1))), T)
    natural, ratio, z = control.damp(control.ss(plant.A - plant.B @ [[K, B]], plant.B, plant.C, plant.D, T), doprint=False)
    loop = {"controller": {"kind": "dc"}, "environment": {"K_VE": K, "B_VE": B}, "device": {"mass": m, "damping": d}}
    found = wavesweep.compile(loop).poles()
    assert found.stable.all()
    np.testing.assert_allclose(np.sort_complex(found.s_re + 1j * found.s_im), np.sort_complex(np.log(z) / T), rtol=1e-10)
    np.testing.assert_allclose(found.damping_ratio, ratio, rtol=1e-9)
    np.testing.assert_allclose(found.shown_damping_ratio, ratio, rtol=1e-9)
    np.testing.assert_allclose(found.shown_hz, natural * np.sqrt(1 - ratio**2) / (2 * np.pi), rtol=1e-9)


@pytest.mark.parametrize(("K", "stable"), [(60.0, True), (900.0, False)])
def test_at_several_rates_they_are_those_of_a_march(K, stable):
    """A slow wall, 20 ticks of 1 ms, by the documents' own reading."""
    loop = {"controller": {"kind": "dc-slow"}, "environment": {"K_VE": K, "B_VE": 1.0}}
    wanted = np.linalg.eigvals(machine_of(loop).monodromy())
    found = wavesweep.compile(loop).poles()
    z = (found.z_re + 1j * found.z_im)[found.radius > 0]
    np.testing.assert_allclose(np.sort_complex(z), np.sort_complex(wanted[np.abs(wanted) > 1e-9]), rtol=1e-7)
    assert found.stable[found.radius > 0].all() == stable
    assert (found.time_constant_s[found.radius > 0] > 0).all() == stable


def test_the_damping_of_an_image_is_that_of_the_line_that_a_spectrum_shows():
    """An undamped-looking 450 Hz mode in a frame of 20 ms: from frame to frame it is slow, and the ratio much too large."""
    loop = {
        "rates": {"tick_hz": 2000},
        "block": {
            "one": {"type": "mass", "mass": 1.0, "damping": 20.0, "stiffness": (2 * np.pi * 450.0) ** 2},
            "watch": {"type": "lowpass", "a": 0.25, "every": 40},
        },
        "wire": {"one.f": "0", "watch.u": "one.x"},
    }
    found = wavesweep.compile(loop).poles()
    row = found[found.states.str.startswith("one")].iloc[0]
    assert row.frequency_hz < 25
    assert row.shown_hz == pytest.approx(450.0, rel=1e-5)
    assert row.shown_damping_ratio == pytest.approx(10.0 / (2 * np.pi * 450.0), rel=1e-6)


def test_a_loop_on_the_edge_is_not_called_stable_and_one_that_overflows_has_a_row_that_says_so():
    edge = {
        "rates": {"tick_hz": 1000},
        "block": {"one": {"type": "mass", "mass": 1.0, "stiffness": 100.0}},
        "wire": {"one.f": "0"},
    }
    found = wavesweep.compile(edge).poles()
    assert found.doubt.tolist() == ["rounding"] * 2
    assert not found.stable.any()
    wild = {"controller": {"kind": "dc-lm"}, "rates": {"ratio": 500}, "local_model": {"K_LM": 1e9}}
    (row,) = wavesweep.compile(wild).poles().itertuples()
    assert (row.doubt, row.stable, np.isnan(row.radius)) == ("overflow", False, True)


def test_the_command_writes_a_table_a_figure_and_json_over_a_number(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drive.toml").write_text(DRIVE)
    code, out, _ = wavesweep("poles", "drive.toml", "--json", "--no-plot")
    (own,) = json.loads(out)["tables"].values()
    assert (code, own["over"], own["modes"][0]["stable"]) == (0, None, True)
    code, _, err = wavesweep("poles", "drive.toml", "--over", "kp", "--set", "sweep.kp={start=0.2, stop=40}", "--out", "kp")
    assert (code, "300 values of kp, 0.2 to 40" in err, "a stable interval ends at kp = " in err) == (0, True, True)
    assert {path.suffix for path in (tmp_path / "kp").iterdir()} == {".csv", ".parquet", ".png", ".json"}
    assert wavesweep("verify", "kp")[0] == 0
    assert wavesweep("plot", "kp/poles.csv", "--out", "again")[0] == 0
    assert (tmp_path / "again/poles.png").read_bytes() == (tmp_path / "kp/poles.png").read_bytes()
    code, _, err = wavesweep("poles", "drive.toml", "--over", "kq")
    assert (code, "kq: expected the name of a numeric key" in err) == (2, True)


def test_the_number_of_a_root_locus_is_a_column_of_the_table_that_is_read_though_no_axis_has_it():
    table = dict.fromkeys(("kq", "kp", *kind_named("poles").names), 0.0)
    assert "kq" in in_order("poles", table, {"over": "kq", "spec": {"sweep": {}}})


@pytest.mark.parametrize("values", [60, 3])
def test_a_root_locus_has_lines_through_the_poles_of_a_held_force_and_the_whole_circle(values):
    """Also where its poles go far from one value to the next."""
    loop = {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 20.0, "kd": 0.4},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 0.02, "stiffness": 250.0}, "s": {"type": "hold", "every": 5}},
        "wire": {"s.u": "-kp*m.x - kd*m.v", "m.f": "s.y"},
    }
    numbers = np.linspace(1.0, 400.0 * 60 / values, values)
    (axes, _) = wavesweep.compile(loop).plot_root_locus("kp", numbers.tolist()).axes
    (lines,) = [each for each in axes.collections if hasattr(each, "get_segments") and len(each.get_segments()) > values / 2]
    vertices = np.concatenate(lines.get_segments()) @ np.array([1, 1j])
    for kp in numbers:
        for pole in np.linalg.eigvals(machine_of(with_numbers(loop, {"kp": float(kp)})).monodromy()):
            assert abs(pole) < 1e-9 or np.abs(vertices - pole).min() < 1e-9
    assert axes.get_xlim()[0] <= -1 < 1 <= axes.get_xlim()[1]


def test_ends_are_rounded_into_their_intervals():
    ends = [{"value": 1.0000014, "hz": 1.0, "certified": True, "low": True}]
    ends.append({"value": 116.99167, "hz": 2.0, "certified": True, "low": False})
    found = {"period_s": 0.01, "over": "K", "values": 300, "from": 0.5, "to": 200, "poles": 3, "ends": ends, "doubts": {}}
    lines = [text for text, _ in kind_named("poles").lines(found)]
    assert lines[1:] == ["  a stable interval ends at K = 1.00001, 1 Hz", "  a stable interval ends at K = 116.991, 2 Hz"]


@pytest.mark.slow
def test_a_frame_of_more_states_than_spectra_are_computed_of_is_refused():
    spec = load({"controller": {"kind": "dc-vc"}, "device": {"delay": 1000}})
    with pytest.raises(UsageError, match=r"poles: expected a frame of at most 400 states, .*found 10\d\d"):
        poles(spec)
