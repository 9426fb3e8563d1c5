import numpy as np
import pytest

from wavesweep.errors import UsageError
from wavesweep.simulation import Effects, Tone, estimate, simulate
from wavesweep.simulation.inputs import sine, stepped_sine

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


@pytest.mark.slow
def test_nonideal_parts_show_in_the_estimate(values):
    """A device with friction gives way less to a small force than to a large one."""
    record = sine(1000.0, 3.0, seconds=4.0)
    loop, options = values("pmw-lm", Kp=20.0), Effects(friction=0.26, resolution=5.5e-5, max_force=3.3)
    found = [
        estimate(simulate(loop, size * record.force, options).signals, record.tones, 1000.0, 20)["admittance_abs"][0]
        for size in (0.5, 1.0, 2.0)
    ]
    assert found == sorted(found)
    assert found[0] < 0.9 * found[2]


def test_no_tones_give_an_empty_table(values):
    table = estimate(simulate(values("dc"), np.ones(10)).signals, (), 1000.0, 1)
    assert all(len(column) == 0 for column in table.values())


def test_a_stretch_too_short_for_the_images_is_refused(values):
    with pytest.raises(UsageError, match="expected at least 60 ticks, three frames, to tell it from its images, found 30"):
        estimate(simulate(values("pmw"), np.ones(100)).signals, [Tone(11.0, 0, 30)], 1000.0, 20)
