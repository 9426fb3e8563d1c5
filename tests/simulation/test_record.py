import numpy as np
import pytest

from wavesweep.simulation.inputs import sine, stepped_sine
from wavesweep.simulation.march import simulate
from wavesweep.simulation.record import estimate

# The loop of Fig. 6 (`pmw-lm`, Kp = 20, the rest by default): exact responses, from 40-digit arithmetic.
FREQUENCIES = [2.0, 11.25, 24.0]
ADMITTANCE = [0.002110555449958508 - 0.00039083673027948867j, -0.0014802912366873651 - 0.0006476792414664813j]
IMPEDANCE = [474.0092044976317 + 66.08168183969795j, -63.810265190939276 + 159.75604530111897j]


@pytest.mark.slow
def test_a_stepped_sine_measures_the_exact_responses(values):
    record = stepped_sine(1000.0, FREQUENCIES, settle=6.0, periods=3)
    table = estimate(simulate(values("pmw-lm", Kp=20.0), record.force).signals, record.tones, 1000.0, 20)
    np.testing.assert_allclose(table["frequency_hz"], FREQUENCIES)
    np.testing.assert_allclose(table["omega_Ts"], 2 * np.pi * np.array(FREQUENCIES) * 0.02)
    admittance = table["admittance_re"] + 1j * table["admittance_im"]
    np.testing.assert_allclose(admittance[:2], ADMITTANCE, rtol=1e-7)
    np.testing.assert_allclose(table["impedance_abs"][:2], np.abs(IMPEDANCE), rtol=1e-7)
    np.testing.assert_allclose(table["impedance_deg"][:2], np.degrees(np.angle(IMPEDANCE)), rtol=1e-7)
    np.testing.assert_allclose(table["admittance_abs"], np.abs(admittance), rtol=1e-14)


def test_images_do_not_leak_into_a_stretch_of_broken_frames(values):
    """Above the slow rate the loop's answer at the image is the larger one; 7 periods of 61 Hz are 5.7 frames."""
    record = sine(1000.0, 61.0, seconds=6.2, settle=6.0)
    seen = simulate(values("dc-slow", K_VE=80.0), record.force).signals
    long = stepped_sine(1000.0, [61.0], settle=6.0, periods=244)
    reference = simulate(values("dc-slow", K_VE=80.0), long.force).signals
    short, whole = (estimate(s, r.tones, 1000.0, 20) for s, r in ((seen, record), (reference, long)))
    assert short["admittance_abs"] == pytest.approx(whole["admittance_abs"], rel=1e-9)
    assert short["impedance_deg"] == pytest.approx(whole["impedance_deg"], rel=1e-9)


def test_an_offset_does_not_matter(values):
    record = sine(1000.0, 5.0, seconds=5.0)
    loop = values("pmw")
    with_drift = simulate(loop, record.force, x=0.05).signals
    for name, column in estimate(simulate(loop, record.force).signals, record.tones, 1000.0, 20).items():
        assert estimate(with_drift, record.tones, 1000.0, 20)[name] == pytest.approx(column, rel=1e-8)
