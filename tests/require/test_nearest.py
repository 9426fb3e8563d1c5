"""Which of several requirements fails where no value meets all, against a scan of the closed form."""

import numpy as np
import pytest

import wavesweep

SPEC = {
    "rates": {"tick_hz": 1000.0},
    "numbers": {"k": 50.0},
    "block": {"x": {"type": "tf", "num": [1], "den": [1, 0]}, "d": {"type": "delay"}},
    "wire": {"d.u": "r - k*x.y", "x.u": "d.y"},
    "ports": {"inputs": {"r": "r"}, "outputs": {"x": "x.y"}},
}


@pytest.mark.asks("margins")
def test_the_value_nearest_to_all_requirements_is_told_with_what_each_is_there():
    """An integrator behind a tick of delay: L = k T/((z - 1) z); settling is that of its slower root."""
    margins = {"cut": "d.y", "phase_deg": 85, "Ms": 1.5}
    sweep = {"along": "k", "k": {"start": 0, "stop": 1000}, "require": {"settling": 0.02, "margins": margins}}
    table = wavesweep.stability_region({**SPEC, "sweep": sweep})
    assert table.intervals.tolist() == [0]
    found = table.attrs["facts"]["in_the_way"]
    said = {word: (of["value"], of["bound"]) for word, of in found["requirements"].items()}
    gain = found["value"] * 1e-3
    z = np.exp(1j * np.linspace(1e-4, np.pi, 400_001))
    loop = gain / ((z - 1) * z)
    crossover = np.abs(np.abs(loop) - 1).argmin()
    slow = np.abs(np.roots([1, -1, gain])).max()
    expected = {"settling": (-np.log(50) * 1e-3 / np.log(slow), 0.02)}
    expected["phase at d.y"] = (180 + np.degrees(np.angle(loop[crossover])), 85)
    expected["Ms at d.y"] = (np.abs(1 / (1 + loop)).max(), 1.5)
    assert said.keys() == expected.keys()
    for word, (value, bound) in expected.items():
        assert said[word] == pytest.approx((value, bound), rel=1e-3), word
    assert said["phase at d.y"][0] < 85 < 1.1 * said["phase at d.y"][0]
