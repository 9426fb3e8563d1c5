"""python-control sees the same loop: poles and frequency response of the lifted system."""

import control
import numpy as np
import pytest
from support.lifted import same_spectrum
from support.responses import loop_of
from support.specs import KINDS, random_values, values_of

from wavesweep.analysis.response.steady import respond
from wavesweep.diagram import draw
from wavesweep.lifted.at_wall import cut_at_wall
from wavesweep.lifted.cut import close
from wavesweep.lifted.frame import lifted_system


def state_space(values, output="device.x"):
    """The lifted loop, and its drawing; `dc` is lifted to the ratio of the others."""
    drawing, ratio = draw(values), values["rates.ratio"]
    whole = lifted_system(drawing, ratio, values["environment.K_VE"], values["environment.B_VE"], output)
    A = np.eye(len(whole.states)) + whole.E
    period = ratio / values["rates.fast_hz"]
    return control.StateSpace(A, whole.B, whole.C, whole.D, dt=period, remove_useless_states=False)


@pytest.mark.parametrize("kind", KINDS)
def test_poles_are_those_of_the_cut_loop_and_drift(kind):
    values = values_of(kind, K_VE=200.0)
    found = state_space(values).poles()
    delta = np.linalg.eigvals(close(cut_at_wall(draw(values)), 200.0, 1.0))
    wanted = (1 + delta) ** (20 if kind == "dc" else 1)
    found = found[(np.abs(found - 1) > 1e-7) & (np.abs(found) > 1e-3)]
    assert same_spectrum(found, wanted[np.abs(wanted) > 1e-3], 1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_the_alias_sum_of_its_frequency_response_is_what_the_hand_feels(kind, seed):
    """`x` at the hand's own frequency is the phasor mean of the lifted response to a frame of phasors."""
    values = random_values(100 + seed, kind)
    T, ratio = 1 / values["rates.fast_hz"], values["rates.ratio"]
    frequency = np.array([0.003, 0.02, 0.11, 0.43]) / T
    position, force = state_space(values), state_space(values, "f_m")
    found = respond(loop_of(values), frequency)
    admittance, impedance = found.admittance, found.impedance
    for i, f in enumerate(frequency):
        phasor = np.exp(2j * np.pi * f * T * np.arange(ratio))
        z = np.exp(2j * np.pi * f * T * ratio)
        x, f_m = (phasor.conj() @ np.atleast_2d(G(z)) @ phasor / ratio for G in (position, force))
        assert abs(admittance[i] - x) <= 1e-9 * abs(x)
        assert abs(impedance[i] - f_m / x) <= 1e-9 * abs(f_m / x)
