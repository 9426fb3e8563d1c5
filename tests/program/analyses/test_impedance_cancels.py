"""A wave line without hold or delay passes on what it takes: its impedance cancels in every tick, and digits with it.

The avatar follows the device, so nothing of the loop depends on the impedance, and that of 1 N*s/m tells the truth.
"""

import numpy as np
import pytest

import wavesweep

IMPEDANCES = 10.0 ** np.arange(-4, 15, 2)
USUAL = (IMPEDANCES >= 1) & (IMPEDANCES < 1e5)


def line(b, damping=1.5, **tables):
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 500.0, "B": 1.0, "m": 0.1, "b": float(b)},
        "block": {
            "device": {"type": "mass", "mass": "m", "damping": damping},
            "end": {"type": "wave", "b": "b"},
            "avatar": {"type": "avatar", "b": "b", "integration": tables.pop("integration", "implicit")},
        },
        "wire": {
            "end.v": "device.v",
            "end.in": "avatar.out",
            "avatar.in": "end.out",
            "avatar.f": "K*avatar.x_spring + B*avatar.v",
            "device.f": "hand - end.force",
        },
        "ports": {
            "hand": {"force": "hand", "displacement": "device.x", "reaction": "end.force"},
            "wall": {"stiffness": "K", "damping": "B"},
        },
        **tables,
    }


@pytest.mark.slow
@pytest.mark.parametrize("damping", [1.5, 1e-6])
def test_responses_are_within_their_bounds(damping):
    def responses(b):
        found = wavesweep.bode(line(b, damping, bode={"frequency_hz": [0.0, 1.0, 10.0, 40.0]}))
        return [found[f"{name}_re"] + 1j * found[f"{name}_im"] for name in NAMES], [found[f"{name}_error"] for name in NAMES]

    truths, of_truths = responses(1.0)
    for b in IMPEDANCES:
        for found, error, truth, of_truth in zip(*responses(b), truths, of_truths, strict=True):
            known = found.notna()
            assert (np.abs(found / truth - 1) <= error + of_truth)[known].all(), b
            assert known.all() or not 1e-4 < b < 1e12


NAMES = "admittance", "impedance"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("along", "span", "integration", "damping"),
    [("K", {"start": 0, "stop": 2e5}, "implicit", 1.5), ("B", {"start": 0, "stop": 1e4}, "explicit", 1e-6)],
)
def test_what_is_certified_does_not_depend_on_the_impedance(along, span, integration, damping):
    def table(b):
        return wavesweep.stability_region(line(1.0, damping, integration=integration, sweep={along: span, "b": b}), along)

    truth = table([1.0])
    ends = [f"{along}_low", f"{along}_high"] if along in truth else ["low", "high"]
    found = table(IMPEDANCES.tolist())
    assert table(IMPEDANCES[USUAL].tolist())["certified"].all()
    assert truth["certified"].all()
    for b, rows in found[found["certified"]].groupby("b"):
        np.testing.assert_allclose(rows[ends], truth[ends], rtol=1e-9, err_msg=str(b))


def test_a_spectral_radius_is_right_or_missing():
    radii = [wavesweep.compile(line(b)).spectral_radius() for b in (1.0, *IMPEDANCES, 1e15)]
    known = np.isfinite(radii)
    np.testing.assert_allclose(np.array(radii)[known], radii[0], rtol=1e-3)
    assert known[:-1][1:][USUAL].all()
    truth, hidden = (wavesweep.compile(line(b, 1e-6)).spectral_radius() for b in (1.0, 1e15))
    assert np.isnan(hidden) or hidden == pytest.approx(truth, rel=1e-9)
