"""The error of the response over a band is that of the whole band, also beside resonances and with loops that are unstable."""

import numpy as np
import pytest

import wavesweep
from wavesweep.designs.family import scenarios_of
from wavesweep.designs.wishes import evaluate
from wavesweep.program.spec import load


def over(tables, b, **wish):
    spec = load(tables | {"design": {"vary": {"b": {"start": 5, "stop": 60}}, "wish": wish}})
    return evaluate(spec, spec.design.wishes, scenarios_of(spec), {"controller.b": np.array(b)}, 2000.0)


@pytest.mark.parametrize("band", [(0.1, 10.0), (2.0, 6.0)])
def test_the_error_of_the_response_is_its_mean_over_a_band_with_a_resonance(band):
    """The resonance of direct coupling to the wall of 100 N/m, at 5 Hz, has a damping ratio of 0.02."""
    tables = {"controller": {"kind": "pmw", "Kp": 20.0, "b": 10.0}, "device": {"damping": 0.1}, "environment": {"B_VE": 0.02}}
    edges = np.log(np.geomspace(*band, 301))
    node, weight = np.polynomial.legendre.leggauss(8)
    places = (edges[:-1, None] + np.diff(edges)[:, None] * (1 + node) / 2).ravel()
    own, ideal = (
        wavesweep.compile(tables | {"controller": controller}).response(np.exp(places), K_VE=100.0)
        for controller in (tables["controller"], {"kind": "dc"})
    )
    ratio = (own.admittance_re + 1j * own.admittance_im) / (ideal.admittance_re + 1j * ideal.admittance_im)
    mean = np.abs(np.log(ratio.to_numpy())) ** 2 @ np.tile(weight, 300) / 600
    found = over(tables, [10.0], transparency={"band_hz": [*band], "walls": [100], "B_VE": [0.02]})["transparency"]
    assert found.certified[0]
    assert found.value[0] == pytest.approx(np.sqrt(mean), rel=2e-5)


def test_over_a_band_unstable_designs_alone_have_no_value():
    tables = {"controller": {"kind": "pmw-lm", "Kp": 1e5}, "environment": {"integration": "explicit", "delay": 1}}
    found = over(tables, [10.0, 20.0], transparency={"band_hz": [0.1, 10], "walls": [100]})
    assert np.isnan(found["transparency"].value).all()
