"""Margins at a cut as wishes of `design`."""

import numpy as np
import pytest

from wavesweep.margins.broken_loops import broken_at
from wavesweep.margins.lifted_margins import margins_of
from wavesweep.margins.table import margins
from wavesweep.program.spec import load

wishes = pytest.importorskip("wavesweep.designs.wishes")
family = pytest.importorskip("wavesweep.designs.family")

T = 0.01  # s
CUT = {"cut": "c.y"}
TABLES = {  # an integrator under a gain: L = K T/(z - 1)
    "rates": {"tick_hz": 1 / T},
    "numbers": {"K": 10.0},
    "block": {"p": {"type": "tf", "num": [1], "den": [1, 0]}, "c": {"type": "gain", "k": "K"}},
    "wire": {"p.u": "c.y", "c.u": "ref - p.y"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"own": "p.y"}},
    "design": {
        "vary": {"K": {"start": 1, "stop": 250}},
        "wish": {
            "Ms": {"at_most": 1.6, **CUT},
            "gain": {"at_least": 2, **CUT},
            "phase_deg": {"at_least": 40, **CUT},
            "disk": {"at_least": 0.6, **CUT},
        },
    },
}


def found(tables, K):
    spec = load(tables)
    scenarios = family.scenarios_of(spec)
    return wishes.evaluate(spec, spec.design.wishes, scenarios, {"numbers.K": K}, 1.0)


@pytest.mark.slow
def test_margins_of_an_integrator_have_closed_forms():
    """S at z = -1 is 2/(2 - s) with s = K T; |L| is 1 where s = 2 sin(t/2), with a phase of 90 deg - t/2 left; gain 2/s."""
    K = np.array([50.0, 75.0, 210.0])
    measured = found(TABLES, K)
    s = K[:2] * T
    left = 90 - np.degrees(np.arcsin(s / 2))
    closed = {"Ms": 2 / (2 - s), "gain": 2 / s, "phase_deg": left, "disk": 2 * (2 - s) / (2 + s)}
    for name, value in closed.items():
        assert measured[name].value[:2] == pytest.approx(value, rel=1e-6)
        assert np.isnan(measured[name].value[2])  # unstable from 200 on
        assert measured[name].certified[:2].all()


@pytest.mark.slow
def test_margins_of_several_rates_are_those_of_the_table():
    blocks = TABLES["block"] | {"c": {"type": "gain", "k": "K", "every": 4, "phase": 1}}
    tables = TABLES | {"block": blocks}
    measured = found(tables, np.array([8.0, 12.0]))
    for number, K in enumerate((8.0, 12.0)):
        columns = margins(load(tables | {"numbers": {"K": K}}), "c.y").columns
        table = dict(zip(columns["margin"], columns["value"], strict=True))
        assert measured["Ms"].value[number] == table["sensitivity"]
        assert measured["phase_deg"].value[number] == table["phase"]
        assert measured["gain"].value[number] == table["gain_up"]


@pytest.mark.asks("require")
def test_margins_are_those_of_the_cut_that_the_spec_asks_for():
    loop = {name: table for name, table in TABLES.items() if name != "design"}
    assert margins(load(loop)).columns["cut"][0] == "c.y"
    sweep = {"along": "K", "K": {"start": 1, "stop": 250}}
    required = sweep | {"require": {"margins": {"cut": "p.y", "Ms": 2.0}}}
    assert margins(load(loop | {"sweep": required})).columns["cut"][0] == "p.y"
    wished = TABLES["design"] | {"wish": {"Ms": {"at_most": 2, "cut": "p.y"}}}
    assert margins(load(loop | {"design": wished})).columns["cut"][0] == "p.y"


@pytest.mark.parametrize("every", [1, 4])
def test_margins_that_are_asked_for_alone_are_those_of_all(every):
    """Also that a loop is not stable."""
    blocks = TABLES["block"] | {"c": {"type": "gain", "k": "K", "every": every}, "slow": {"type": "hold", "every": 4}}
    wire = {"p.u": "c.y", "c.u": "ref - 0.9*p.y - 0.1*slow.y", "slow.u": "p.y"}
    spec = load(TABLES | {"block": blocks, "wire": wire})
    whole, doubt = margins_of(broken_at(spec, "c.y"))
    assert not doubt
    for margin in whole:
        if margin.name not in ("disk_gain", "disk_phase"):
            alone, doubt = margins_of(broken_at(spec, "c.y"), [margin.name])
            assert not doubt
            assert margin in alone
            assert len(alone) < len(whole)
    unstable = load(TABLES | {"block": blocks, "wire": wire, "numbers": {"K": 900.0}})
    assert margins_of(broken_at(unstable, "c.y"), ["sensitivity"]) == ([], 0)
