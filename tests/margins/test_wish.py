"""Margins at a cut as wishes of `design`."""

import numpy as np
import pytest

from wavesweep.margins import broken_loops, lifted_margins
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


def found(tables, K, **given):
    spec = load(tables)
    scenarios = family.scenarios_of(spec)
    return wishes.evaluate(spec, spec.design.wishes, scenarios, {"numbers.K": K}, 1.0, **given)


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


@pytest.mark.parametrize(("K", "delayed"), [(30.0, 0), (50.0, 1)])
def test_what_a_search_ranks_by_are_the_margins_that_are_proved(K, delayed):
    """Of a signal that is made four times in a frame, whose gain may grow or fall to the limit, or of an unstable loop."""
    blocks = TABLES["block"] | {"slow": {"type": "delay", "steps": delayed, "every": 4}}
    wire = {"p.u": "c.y + 0.2*p.y", "c.u": "ref - 0.9*p.y - 0.1*slow.y", "slow.u": "p.y"}
    wish = {name: TABLES["design"]["wish"][name] for name in ("gain", "phase_deg")}
    tables = TABLES | {"block": blocks, "wire": wire, "design": TABLES["design"] | {"wish": wish}}
    seen, proved = (found(tables, np.array([0.01, K, 900.0]), ranked=ranked) for ranked in (True, False))
    for name in wish:
        assert proved[name].certified.all()
        assert np.isfinite(proved[name].value).tolist() == [False, True, False]
        assert seen[name].value == pytest.approx(proved[name].value, rel=2e-6, nan_ok=True)


def test_designs_of_a_generation_are_broken_at_a_cut_in_one_go(monkeypatch):
    """By all wishes there."""
    broken = []
    proved = broken_loops.broken_in
    monkeypatch.setattr(broken_loops, "broken_in", lambda *about: broken.append(about) or proved(*about))
    wish = {name: TABLES["design"]["wish"][name] for name in ("gain", "phase_deg")}
    tables = TABLES | {"design": TABLES["design"] | {"wish": wish}}
    measured = found(tables, np.array([47.0, 71.0, 210.0]), ranked=True)
    assert len(broken) == 1
    s = np.array([0.47, 0.71])  # K T; |L| is 1 where s = 2 sin(t/2)
    assert measured["gain"].value == pytest.approx([*(2 / s), np.nan], rel=1e-5, nan_ok=True)
    left = 90 - np.degrees(np.arcsin(s / 2))
    assert measured["phase_deg"].value == pytest.approx([*left, np.nan], rel=1e-5, nan_ok=True)


def test_margins_are_proved_for_the_numbers_of_for_all_and_for_the_worst_between(monkeypatch):
    """The gain of the sensor is largest in the middle of the range of r."""
    blocks = TABLES["block"] | {"slow": {"type": "hold", "every": 4}}
    wire = {"p.u": "c.y", "c.u": "ref - (1 + r - r*r)*(0.9*p.y + 0.1*slow.y)", "slow.u": "p.y"}
    wish = {"wish": {"gain": TABLES["design"]["wish"]["gain"]}}
    tables = TABLES | {"block": blocks, "wire": wire, "design": TABLES["design"] | wish}
    spec = load(tables | {"numbers": {"K": 10.0, "r": 0.0}, "for_all": {"r": {"start": 0, "stop": 1}}})
    tried = [{"numbers.r": r} for r in (0.0, 0.25, 0.5, 0.75, 1.0)]
    proofs = []
    proved = lifted_margins.margins_of
    monkeypatch.setattr(lifted_margins, "margins_of", lambda *about: proofs.append(about) or proved(*about))
    measured = wishes.evaluate(spec, spec.design.wishes, tried, {"numbers.K": np.array([10.0])}, 1.0)["gain"]
    alone = wishes.evaluate(spec, spec.design.wishes, tried[2:3], {"numbers.K": np.array([10.0])}, 1.0)["gain"]
    assert len(proofs) == 3 + 1
    assert (measured.value, measured.scenario, measured.certified) == (alone.value, 2, True)


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
