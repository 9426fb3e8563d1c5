"""Circuits from logs of a voltage and the current that it drives, against a march with matrix exponentials."""

import json

import numpy as np
import pytest
from scipy.linalg import expm

import wavesweep
from wavesweep.engine.errors import UsageError

RATE = 20000.0  # Hz
COIL = {"inductance": 2e-3, "resistance": 0.4}
LCL = COIL | {"second_inductance": 1.5e-3, "second_resistance": 0.3, "capacitance": 8e-6, "capacitor_resistance": 0.2}
UNITS = {"inductance": "H", "resistance": "ohm", "capacitance": "F"}


def equations(inductance, resistance, second_inductance, second_resistance, capacitance, capacitor_resistance):
    """Rates of the currents and the capacitor's voltage, and what a volt at the converter adds."""
    r = capacitor_resistance
    rates = [
        [-(resistance + r) / inductance, r / inductance, -1 / inductance],
        [r / second_inductance, -(second_resistance + r) / second_inductance, 1 / second_inductance],
        [1 / capacitance, -1 / capacitance, 0],
    ]
    return np.array(rates), np.array([1 / inductance, 0, 0])


def log_of(rates, by_volts, path, rows, header="time,voltage,current"):
    """A log of noise, held over a tick, and of the first current in steps of 1 mA."""
    volts = np.random.default_rng(4).choice([-20.0, 20.0], rows // 5).repeat(5)
    n = len(by_volts)
    tick = expm(np.block([[rates, by_volts[:, None]], [np.zeros((1, n + 1))]]) / RATE)
    state = np.zeros(n)
    amperes = []
    for push in volts:
        amperes.append(state[0])
        state = tick[:n, :n] @ state + tick[:n, n] * push
    columns = np.arange(len(volts)) / RATE, volts, np.round(np.array(amperes) * 1e3) / 1e3
    np.savetxt(path, np.stack(columns, axis=1), "%.9g", ",", header=header, comments="")


def assert_within(parameters, truth):
    for name, value in truth.items():
        number = parameters[name]
        assert number["low"] <= value <= number["high"], name
        assert number["high"] - number["low"] < 0.05 * value, name
        assert number["unit"] == next(unit for kind, unit in UNITS.items() if name.endswith(kind))


@pytest.mark.slow
def test_a_coil_has_henry_and_ohm_and_a_spec_that_every_command_takes(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    L, R = COIL.values()
    log_of(np.array([[-R / L]]), np.array([1 / L]), tmp_path / "coil.csv", 1500)
    code, out, _ = wavesweep("identify", "coil.csv", "--resolution", "1e-3", "--json", "--out", "coil.toml")
    assert code == 0
    found = json.loads(out)
    assert_within(found["parameters"], COIL)
    assert (found["circuit"], found["explained"]) == (True, True)
    assert wavesweep("check", "coil.toml", "--strict")[0] == 0


@pytest.mark.slow
def test_an_lcl_filter_has_its_six_numbers(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    log_of(*equations(**LCL), tmp_path / "log.csv", 4000, "t,u (V),i1 (A)")
    found = wavesweep("identify", "log.csv", "--column", "current=i1 (A)", "--lcl", "--no-plot", "--out", "lcl.toml")
    assert found[0] == 0
    assert "second_inductance 0.0015" in found[2]
    assert "a quarter of the inductance" in found[2]
    assert wavesweep("check", "lcl.toml", "--strict")[0] == 0


def test_a_circuit_has_no_friction(tmp_path):
    log_of(*equations(**LCL), tmp_path / "log.csv", 60)
    with pytest.raises(UsageError, match="take --lcl and --delay; leave the other options of the fit out"):
        wavesweep.identify(tmp_path / "log.csv", friction=True)
