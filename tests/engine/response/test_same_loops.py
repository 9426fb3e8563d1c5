"""Responses of loops that are the same, or nearly so, and whose frames are computed on other roads."""

import numpy as np
import pytest
from support.responses import loop_of
from support.specs import values_of

import wavesweep
from wavesweep.engine._response.static import dcgain
from wavesweep.engine._response.steady import static_response


def seen(blocks, wires):
    """Admittance and impedance of a mass whose velocity a hold at another rate sees as a signal."""
    tables = {
        "rates": {"tick_hz": 1000},
        "block": {"arm": {"type": "mass", "mass": 0.1, "damping": 1.5}, "h": {"type": "hold", "every": 4}, **blocks},
        "wire": {"arm.f": "push - 300*h.y", **wires},
        "ports": {"hand": {"force": "push", "displacement": "arm.x", "reaction": "300*h.y"}},
    }
    return wavesweep.compile(tables).response([0.0, 1.0, 37.0, 250.0])


def test_a_difference_of_positions_is_that_of_a_position_and_a_delay_of_it():
    found = seen({"d": {"type": "difference"}}, {"d.u": "arm.x", "h.u": "arm.x + 0.01*d.y"})
    right = seen({"d": {"type": "delay", "steps": 1}}, {"d.u": "arm.x", "h.u": "arm.x + 10*(arm.x - d.y)"})
    for name in ("admittance_re", "admittance_im", "impedance_re", "impedance_im"):
        assert found[name].to_numpy() == pytest.approx(right[name].to_numpy(), rel=1e-10, abs=1e-13)


def test_a_coupling_without_a_wall_is_the_limit_of_soft_walls():
    """Without a wall nothing holds the scene, and the tool follows the device for ever."""
    loop = wavesweep.compile({"controller": {"kind": "dc-vc"}, "environment": {"delay": 1}})
    free, held = (loop.response([3.0, 40.0, 333.0], K_VE=stiffness) for stiffness in (0.0, 1e-8))
    for name in ("admittance_re", "admittance_im", "impedance_re", "impedance_im"):
        assert free[name].to_numpy() == pytest.approx(held[name].to_numpy(), rel=1e-6)


def test_the_error_of_a_static_response_has_the_rounding_of_its_last_steps():
    loop = loop_of(values_of("dc-slow"))
    (position, _), (off, _), _ = dcgain(loop)
    assert static_response(loop).admittance_error > off / np.abs(position)
