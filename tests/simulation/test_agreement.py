"""The marched loop answers a stepped sine as the lifted one says, though the two share no code."""

import numpy as np
import pytest
from support.responses import loop_of

from wavesweep.engine._response.steady import respond
from wavesweep.simulation.inputs import stepped_sine
from wavesweep.simulation.march import simulate
from wavesweep.simulation.record import estimate

pytestmark = pytest.mark.slow

FREQUENCIES = np.linspace(1.3, 48.8, 10)
# Each at a stiffness for which it is stable; what settles slowest is pmw's exchange of position, 0.065 a second.
LOOPS = {
    "dc": (500.0, 500.0),
    "dc-slow": (80.0, 500.0),
    "dc-lm": (80.0, 40.0),
    "dc-vc": (500.0, 500.0),
    "dc-vc-lm": (300.0, 300.0),
    "pmw": (500.0, 500.0),
    "pmw-lm": (500.0, 500.0),
}


@pytest.mark.sample(1)
@pytest.mark.parametrize("kind", LOOPS)
def test_the_march_and_the_lifting_agree_at_10_frequencies(values, kind):
    K_VE, K_LM = LOOPS[kind]
    loop = values(kind, K_VE=K_VE, K_LM=K_LM, Kp=20.0)
    record = stepped_sine(1000.0, FREQUENCIES, settle=8.0 if "pmw" in kind else 3.0, periods=3, least=0.5)
    simulation = simulate(loop, record.force)
    seen = estimate(simulation.signals, record.tones, 1000.0, simulation.frame)
    found = respond(loop_of(loop), FREQUENCIES)
    lifted = found.admittance, found.impedance
    for name, response in zip(("admittance", "impedance"), lifted, strict=True):
        off = np.abs(seen[f"{name}_re"] + 1j * seen[f"{name}_im"] - response) / np.abs(response)
        # 2e-12 is seen, and 5e-11 for the impedance of dc-slow, where the held force has images 40 times as large.
        assert off.max() < 5e-10
