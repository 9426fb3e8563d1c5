"""Logs of devices that no line explains: the truth is in the intervals, or there are none."""

import numpy as np
import pytest
from simulated_logs import of_curves

import wavesweep
from wavesweep.identification.curves import with_curve
from wavesweep.identification.device_spec import spec_text
from wavesweep.identification.explained import identified
from wavesweep.identification.model import Model
from wavesweep.identification.prediction import predicted
from wavesweep.identification.table import identify


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "measured", "at", "missing"),
    [
        ("saturating", "velocity", 0, "saturating mass"),
        ("sided damping", "position", 0, "sided damping"),
        ("hardening", "velocity", 3, "hardening"),
    ],
)
def test_a_curve_of_the_motion_is_named_and_the_numbers_beside_it_are_those_of_the_device(kind, measured, at, missing):
    log = of_curves(kind, at + 1, 0, 0.4, measured)[at]
    model = Model(measured=measured)
    fit, verdict = identified(model, log.force, log.reading - log.reading[0], log.period, log.step)
    assert (verdict.explained, verdict.missing, verdict.withheld) == (False, missing, False)
    assert verdict.share > 0.95
    truth = log.truth | {"log_mass": np.log(log.truth["mass"])}
    for name, value, half in zip(fit.model.names, fit.theta, fit.half, strict=True):
        assert abs(value - truth[name]) <= 1.2 * half, name


@pytest.mark.slow
def test_noise_tells_the_delay_beside_friction_that_depends_on_direction():
    """Where the device moves from tick to tick on straight lines, the delay is 0.009 of a tick too small here."""
    log = of_curves("sided friction", 8, 0, 1.0)[7]
    found = predicted(Model(measured="velocity"), log.force, log.reading, log.period, log.step)
    fit = with_curve("sided friction", found.place)
    delay = fit.theta[found.model.names.index("delay")]
    assert delay == pytest.approx(log.truth["delay"], abs=0.002)
    assert fit.theta[0] == pytest.approx(np.log(log.truth["mass"]), abs=0.002)


@pytest.mark.slow
def test_friction_that_depends_on_direction_gives_no_intervals_to_a_line():
    log = of_curves("sided friction", 1, 0, 0.4, "position")[0]
    _, verdict = identified(Model(), log.force, log.reading - log.reading[0], log.period, log.step)
    assert (verdict.missing, verdict.withheld) == ("friction", True)
    assert verdict.lacking > 0.1 * log.force.std()


@pytest.mark.slow
def test_numbers_of_a_model_that_lacks_a_resonance_have_no_intervals(tmp_path):
    """The words, the table and the spec say so, and how large the force is that it lacks."""
    log = of_curves("resonance", 2, 0, 0.4)[1]
    rows = np.stack([log.period * np.arange(len(log.force)), log.force, log.reading], axis=1)
    np.savetxt(tmp_path / "arm.csv", rows, "%.12g", ",", header="time,force,velocity", comments="")
    facts = identify(str(tmp_path / "arm.csv"), resolution=log.step).facts
    assert (facts["missing"], facts["residual"]["withheld"]) == ("resonance", True)
    assert {each["low"] for each in facts["parameters"].values()} == {None}
    spec = tmp_path / "device.toml"
    spec.write_text(spec_text(facts))
    assert "# The model does NOT explain the log; no number has an interval." in spec.read_text()
    assert wavesweep.load(spec).for_all is None
