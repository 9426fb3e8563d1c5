"""Frames with long delays, against closed forms."""

import numpy as np
import pytest

import wavesweep


@pytest.mark.parametrize(("steps", "stiffness", "damping"), [(150, 0.5, 3.0), (150, 0.0, 3.0)])
def test_a_spring_behind_a_long_delay(steps, stiffness, damping):
    """`X = G/(1 + (K + B (1 - 1/z)/T) G/z^N + 2 T/(m (z - 1)))`; under a held force `G = T^2 (z + 1)/(2 m (z - 1)^2)`.

    Without a spring the positions drift, and the delay's states are taken relative to that of the mass.
    """
    blocks = {"m": {"type": "mass", "mass": 0.3}, "net": {"type": "delay", "steps": steps}, "rate": {"type": "difference"}}
    wires = {"net.u": "m.x", "rate.u": "net.y", "m.f": f"hand - {stiffness}*net.y - {damping}*rate.y - 2.0*m.v"}
    ports = {"hand": {"force": "hand", "displacement": "m.x"}}
    loop = wavesweep.compile({"rates": {"tick_hz": 1000}, "block": blocks, "wire": wires, "ports": ports})
    frequency = np.array([0.05, 0.7, 3.3, 20.0, 180.0])
    rows = loop.response(frequency)
    z, T = np.exp(2j * np.pi * frequency / 1000), 1e-3
    G, velocity = T**2 * (z + 1) / (2 * 0.3 * (z - 1) ** 2), T / (0.3 * (z - 1))
    exact = G / (1 + (stiffness + damping * (1 - 1 / z) / T) * G / z**steps + 2.0 * velocity)
    np.testing.assert_allclose(rows.admittance_re + 1j * rows.admittance_im, exact, rtol=1e-11)
