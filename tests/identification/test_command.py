"""`wavesweep identify` from the log to its spec, its files and its words."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from identify_coverage import RATE, marched, moved

from wavesweep import load
from wavesweep.program import results

EXAMPLES = Path(__file__).parents[2] / "sweeps" / "examples"


@pytest.fixture
def pushed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("pushed.csv").write_bytes((EXAMPLES / "pushed.csv").read_bytes())
    return "pushed.csv"


def test_a_short_log_of_a_device_without_friction_has_its_numbers(wavesweep, tmp_path, monkeypatch):
    """Of a march in numpy, with white noise of a micrometre: 200 readings in 0.2 s."""
    monkeypatch.chdir(tmp_path)
    random = np.random.default_rng(0)
    force = random.uniform(-1, 1, 25).repeat(8)
    position = marched(0.1, 0.7, force, 1.25, 0.0, 0.0) + 1e-6 * random.standard_normal(200)
    columns = np.c_[np.arange(200) / RATE, force, position]
    np.savetxt("log.csv", columns, delimiter=",", header="time,force,position", comments="", fmt="%.12g")
    assert wavesweep("identify", "log.csv", "--out", "no/device.toml")[0] == 2
    assert not Path("results").exists()
    code, out, err = wavesweep("identify", "log.csv", "--out", "device.toml", "--no-plot", "--json")
    assert code == 0, err
    found = json.loads(out)
    assert (found["explained"], found["missing"], found["samples"]) == (True, "", 200)
    assert (found["duration_s"], found["rate_hz"]) == pytest.approx((0.2, RATE))
    for name, value, width in (("mass", 0.1, 1e-3), ("damping", 0.7, 1e-2), ("delay", 1.25, 0.03), ("offset", 0.0, 1e-4)):
        parameter = found["parameters"][name]
        assert parameter["low"] < value < parameter["high"], name
        assert width / 100 < parameter["high"] - parameter["low"] < width, name
    device = load("device.toml")
    assert device.values["device.mass"] == found["parameters"]["mass"]["value"]
    assert {axis.path for axis in device.for_all.axes} == {f"device.{key}" for key in ("mass", "damping", "dead_time")}
    table = results.read(Path("results/log/identify.csv"))
    assert np.sqrt(np.nanmean(table["residual"] ** 2)) == pytest.approx(1e-6, rel=0.15)
    assert np.isfinite(table["residual"]).sum() > 180
    Path("device.toml").write_text('controller.kind = "dc"\n')
    code, _, err = wavesweep("identify", "log.csv", "--out", "device.toml", "--no-plot")
    assert (code, "device.toml: found a spec that identify did not write; give --overwrite" in err) == (2, True)


@pytest.mark.slow
def test_a_spec_that_every_command_accepts_and_a_table_with_its_figure(wavesweep, pushed):
    code, out, _ = wavesweep("identify", pushed, "--friction", "--out", "device.toml", "--json")
    assert code == 0
    found = json.loads(out)
    assert (found["explained"], found["missing"]) == (True, "")
    truth = {"mass": 0.08, "damping": 0.6, "friction": 0.15, "delay": 2.0}
    for name, value in truth.items():
        assert found["parameters"][name]["low"] < value < found["parameters"][name]["high"]
    assert (found["duration_s"], found["rate_hz"]) == pytest.approx((1.0, 1000.0))
    device = load("device.toml")
    assert device.values["rates.fast_hz"] == pytest.approx(1000.0)
    assert device.values["device.mass"] == found["parameters"]["mass"]["value"]
    ranges = {axis.path: (axis.start, axis.stop) for axis in device.for_all.axes}
    assert ranges["device.damping"] == tuple(found["parameters"]["damping"][end] for end in ("low", "high"))
    assert device.simulate["friction"] == found["parameters"]["friction"]["value"]
    folder = Path("results/pushed")
    names = {f"identify{suffix}" for suffix in (".csv", ".parquet", ".png", ".datapackage.json")}
    assert {path.name for path in folder.iterdir()} == names
    table = results.read(folder / "identify.csv")
    assert np.nanmax(abs(table["residual"])) <= 1.1e-5
    assert wavesweep("verify", str(folder))[0] == 0


@pytest.mark.slow
def test_what_is_missing_is_said(wavesweep, pushed):
    code, _, err = wavesweep("identify", pushed, "--no-plot")
    assert code == 0
    assert (
        "the model does not explain the log, so no number has an interval: it lacks Coulomb friction; --friction fits it" in err
    )
    assert re.search(
        r"what it lacks is a force of 0\.1\d* N rms, \d+ % of that of the log; this effect explains \d+ % of it", err
    )
    assert "# The model does NOT explain the log" in Path("results/pushed/device.toml").read_text()


@pytest.mark.slow
def test_a_current_has_the_bounds_of_the_motors_constant_in_its_intervals(wavesweep, tmp_path, monkeypatch):
    """A motor of 0.05 N*m/A within 4 %, read by a tachometer: mass and damping are known to 4 % and their own intervals."""
    monkeypatch.chdir(tmp_path)
    torque = 0.5 * np.sin(2 * np.pi * np.cumsum(np.linspace(1, 12, 600)) / RATE)
    speed = np.diff(moved(0.06, 0.8, torque), prepend=0.0) * RATE  # half a tick late
    rows = np.c_[np.arange(600) / RATE, torque / 0.05, speed]
    np.savetxt(tmp_path / "motor.csv", rows, delimiter=",", header="time,current,speed", comments="", fmt="%.9g")
    code, out, _ = wavesweep("identify", "motor.csv", "--motor-constant", "0.048..0.052", "--no-plot", "--json")
    assert code == 0
    mass = json.loads(out)["parameters"]["mass"]
    assert mass["unit"] == "kg*m^2"
    assert mass["low"] == pytest.approx(0.96 * 0.06, rel=2e-3)
    assert mass["high"] == pytest.approx(1.04 * 0.06, rel=2e-3)
    assert "resolution" not in (tmp_path / "results/motor/device.toml").read_text()
