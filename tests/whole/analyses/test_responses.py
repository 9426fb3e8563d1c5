"""The table of responses: several specs, axes that only some of them read, and the static limit."""

import numpy as np
import pytest
from meaning.reading import machine_of
from support.tables import same

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses import response_jobs as analysis
from wavesweep.program.tables.response_table import responses


def test_an_axis_that_a_spec_does_not_read_has_no_value_there():
    specs = [
        wavesweep.load({"controller": {"kind": "pmw"}, "bode": {"frequency_hz": [0.0, 1.0], "b": [20.0, 40.0]}}),
        wavesweep.load({"controller": {"kind": "dc"}, "bode": {"frequency_hz": [0.0, 1.0]}}),
        wavesweep.load({"controller": {"kind": "pmw", "b": 30.0}, "bode": {"frequency_hz": [0.0, 1.0]}}),
    ]
    columns = responses(specs).columns
    assert columns["b"].tolist()[:4] == [20, 20, 40, 40]
    assert np.isnan(columns["b"][columns["controller"] == "dc"]).all()
    assert columns["b"].tolist()[-2:] == [30, 30]
    assert columns["frequency_hz"].tolist() == [0, 1] * 4
    assert np.isfinite(columns["impedance_abs"]).all()
    assert columns["impedance_re"][4] == pytest.approx(500.0, rel=1e-14)


@pytest.mark.slow
def test_chunks_hold_whole_curves_and_a_checkpoint_gives_the_same_bits(tmp_path, monkeypatch):
    bode = {"frequency_hz": [0.0, 1.0, 10.0], "K_VE": [0.0, 100.0], "K_LM": [1.0, 2.0], "b": [10.0, 20.0, 40.0]}
    spec = wavesweep.load({"controller": {"kind": "pmw"}, "bode": bode})
    monkeypatch.setattr(analysis, "RESPONSES_OF_CHUNK", 20 * 6)  # two curves of three frequencies
    told = []
    whole = responses([spec, spec], progress=lambda *counts: told.append(counts)).columns
    assert told[-1] == (36, 36, None)
    assert len(told) == 8  # one before each spec

    def stop(done, *_):
        if done == 24:
            raise KeyboardInterrupt

    place = tmp_path / ".bode.sqlite"
    with pytest.raises(KeyboardInterrupt) as caught:
        responses([spec, spec], progress=stop, checkpoint=place)
    assert f"6 of 18 responses are kept in {place}; the same" in caught.value.__notes__[0]
    again = responses([spec, spec], checkpoint=place)
    assert again.facts["timings"]["slices_from_checkpoint"] == 24
    same(again.columns, whole)
    again.forget()
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(
        UsageError, match=r"\[bode\]: every combination is computed, and rates.ratio = 10, environment.delay = 15 makes no loop"
    ):
        responses(
            [wavesweep.load({"controller": {"kind": "pmw"}, "bode": {"rates.ratio": [20, 10], "environment.delay": [0, 15]}})]
        )


def free_mass(every=20, **changes):
    """A mass that nothing brakes, before a wall without stiffness and damping."""
    numbers = {"K": 0.0, "B": 0.0, "m": 0.1, "d": 0.0} | changes
    return {
        "rates": {"tick_hz": 1000},
        "numbers": numbers,
        "block": {"arm": {"type": "mass", "mass": "m", "damping": "d"}, "wall": {"type": "hold", "every": every}},
        "wire": {"wall.u": "K*arm.x + B*arm.v", "arm.f": "hand - wall.y"},
        "ports": {"hand": {"force": "hand", "displacement": "arm.x"}},
    }


@pytest.mark.parametrize("alone", [False, True])
def test_a_mass_in_free_space_is_no_damper(alone):
    """Its velocity is read by nothing but its position, which drifts: x = T^2/(2m) (z + 1)/(z - 1)^2 f."""
    tables = free_mass()
    if alone:
        del tables["block"]["wall"], tables["wire"]["wall.u"], tables["numbers"]["K"], tables["numbers"]["B"]
        tables["wire"]["arm.f"] = "hand"
    loop, frequency = wavesweep.compile(tables), np.array([0.1, 1.0, 10.0, 300.0])
    found, z = loop.response(frequency), np.exp(2j * np.pi * frequency * 1e-3)
    expected = 1e-6 / 0.2 * (z + 1) / (z - 1) ** 2
    np.testing.assert_allclose(found.admittance_re + 1j * found.admittance_im, expected, rtol=1e-12)
    assert loop.spectral_radius() == 1
    assert not found.stable.any()
    assert np.isnan(loop.passivity().port_margin[0])  # the map has a pole on the circle


def test_a_long_frame_that_contracts_keeps_its_digits():
    """Holds of 33 and 32 ticks are in step again after 1,056."""
    hold = {name: {"type": "hold", "every": every} for name, every in (("a", 33), ("b", 32))}
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"k": 5.0},
        "block": {"m": {"type": "mass", "mass": 0.5, "damping": 1.0}} | hold,
        "wire": {"a.u": "m.x", "b.u": "a.y", "m.f": "hand - k*b.y"},
        "ports": {"hand": {"force": "hand", "displacement": "m.x"}},
    }
    frequency, machine = [0.1, 1.0, 10.0], machine_of(tables)
    found = wavesweep.compile(tables).response(frequency)
    assert set(found.doubt) == {""}
    assert found.admittance_error.max() < 1e-9
    expected = [machine.response(hertz, "hand", ["hand displacement"])["hand displacement"] for hertz in frequency]
    np.testing.assert_allclose(found.admittance_re + 1j * found.admittance_im, expected, rtol=1e-9)


def with_integral(leak=0.0, ki=500.0):
    """A servo with integral action, felt at its axis; leak: share of the integral that is lost in each tick."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 200.0, "ki": ki, "kd": 3.0, "leak": leak},
        "block": {
            "axis": {"type": "mass", "mass": 0.2, "damping": 0.5},
            "speed": {"type": "difference"},
            "sum": {"type": "integrator"},
            "out": {"type": "hold", "every": 2},
        },
        "wire": {
            "speed.u": "axis.x",
            "sum.u": "axis.x - 1000*leak*sum.y",
            "out.u": "kp*axis.x + ki*sum.y + kd*speed.y",
            "axis.f": "hand - out.y",
        },
        "ports": {"hand": {"force": "hand", "displacement": "axis.x"}},
    }


def test_integral_action_is_rigid_at_rest():
    """Towards 0 Hz the position is s/ki of the force: no admittance, an impedance without bound, and no doubt of either."""
    columns = wavesweep.bode(with_integral() | {"bode": {"frequency_hz": [0.0, 1e-3]}})
    assert columns["doubt"].tolist() == ["", ""]
    assert columns["admittance_abs"][0] == 0.0
    assert np.isnan(columns[["impedance_re", "impedance_abs", "impedance_error"]].iloc[0]).all()
    assert columns["admittance_abs"][1] == pytest.approx(2 * np.pi * 1e-3 / 500.0, rel=1e-4)
    assert wavesweep.verdict(with_integral())["felt"] == {"stiffness": None, "damping": None, "rigid": True}


@pytest.mark.slow
@pytest.mark.parametrize("leak", [1e-2, 1e-6, 1e-9])
def test_an_integral_that_leaks_is_as_stiff_as_what_is_left_of_it(leak):
    columns = wavesweep.bode(with_integral(leak) | {"bode": {"frequency_hz": [0.0]}})
    assert columns["impedance_re"][0] == pytest.approx(200.0 + 500.0 * 0.001 / leak, rel=1e-6)
    assert columns["doubt"].tolist() == [""]
    assert not wavesweep.verdict(with_integral(leak))["felt"]["rigid"]
