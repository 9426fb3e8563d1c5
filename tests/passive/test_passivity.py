"""Passivity over the axes of a sweep: each row is the loop's own, and what repeats is computed once."""

from pathlib import Path

import numpy as np
import pytest
from support.held import channel_norm, port_margin

from wavesweep.passive import channel
from wavesweep.passive import port_jobs as analysis
from wavesweep.passive.table import passivity
from wavesweep.program.spec import find_key, load

OWN = ["channel_norm", "channel_omega", "port_margin", "port_omega", "channel_passive", "port_passive"]
OWN += ["stable", "damping_needed", "channel_hz", "port_hz"]
AXES = {
    "K_VE": [0.0, 300.0],
    "filters.lp1.order": [1, 3],
    "b": [10.0, 25.0, 40.0],
    "K_LM": [100.0, 200.0],  # pmw has no local model: its rows are repeated
    "rates.slow_hz": [50.0, 100.0],
}


def spec_of(kind="pmw", **axes):
    return load({"controller": {"kind": kind}, "sweep": axes})


@pytest.mark.slow
def test_each_row_is_what_the_loop_of_its_values_has():
    run = passivity(spec_of(**AXES))
    assert list(run.columns) == [*AXES, *OWN]
    assert run.facts["slices"] == {"computed": 24, "skipped": 24, "certified": 24}
    for row in range(48):
        at = {find_key(name).path: run.columns[name][row].item() for name in AXES}
        values = dict(spec_of().with_values(at).values)
        norm, port = channel_norm(values), port_margin(values)
        expected = (norm.norm, norm.omega, port.margin, port.omega, norm.passive, port.passive, port.stable)
        for name, value in zip(OWN[:-3], expected, strict=True):
            assert run.columns[name][row] == pytest.approx(value, rel=1e-9, abs=1e-15), name


def test_a_channel_is_computed_once_for_all_loops_around_it(monkeypatch):
    seen = []

    def watched(drawing, values):
        seen.append(np.size(values["filters.lp1.cutoff_hz"]))
        return channel.channel_norm(drawing, values)

    monkeypatch.setattr(analysis, "channel_norm", watched)
    passivity(spec_of("pmw-lm", b=[10.0, 25.0, 40.0], **{"filters.lp1.cutoff_hz": [5.0, 10.0]}, B_VE=[0.0, 1.0]))
    assert seen == [2]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dc", "dc-slow", "dc-lm"])
def test_without_waves_there_is_no_norm_and_no_energy_is_added(kind):
    run = passivity(spec_of(kind, B_VE=[0.5, 1.0]))
    assert np.isnan(run.columns["channel_norm"]).all()
    assert np.isnan(run.columns["channel_omega"]).all()
    assert run.columns["channel_passive"].tolist() == [True, True]
    assert any("no wave channel" in notice for notice in run.facts["notices"])


def test_a_loop_that_keeps_no_digit_has_no_margin():
    run = passivity(spec_of("dc", K_VE=[100.0, 1e9], **{"rates.ratio": [1000]}))
    assert np.isfinite(run.columns["port_margin"][0])
    unstable = ~np.isfinite(run.columns["port_margin"])
    assert np.array_equal(unstable, np.isnan(run.columns["port_omega"]))
    assert run.columns["port_passive"].dtype == bool


@pytest.mark.slow
def test_a_channel_is_known_at_any_rates_and_in_any_drawing():
    """At 60 Hz beside 1 kHz, where sampling is uneven; and drawn waves have the norm of the built-in ones."""
    rates = [50.0, 60.0, 62.5]
    norm = passivity(spec_of(**{"rates.slow_hz": rates})).columns["channel_norm"]
    assert norm[0] > norm[1] > norm[2] > 1
    for kind, given in (("pmw", {}), ("pmw-lm", {"Kp": 20})):
        recipe = Path(__file__).parents[2] / f"sweeps/recipes/controllers/{kind}.toml"
        drawn = passivity(load(recipe, ["sweep.B=[0, 1, 15]"])).columns
        expected = passivity(load({"controller": {"kind": kind} | given})).columns
        for name in ("channel_norm", "channel_omega"):
            np.testing.assert_allclose(drawn[name], expected[name][0], rtol=1e-10)
        assert not drawn["channel_passive"].any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "given"),
    [("dc", {})],
)
def test_a_drawn_controller_has_the_margins_of_the_built_in_one(kind, given):
    """At rest as well, where the smallest eigenvalue is the same at all low frequencies but for rounding."""
    recipe = Path(__file__).parents[2] / f"sweeps/recipes/controllers/{kind}.toml"
    drawn = passivity(load(recipe, ["sweep.B={start=0, stop=15, num=7}"])).columns
    walls = {"sweep": {"B_VE": drawn["B"].tolist()}, "environment": {"K_VE": 500}}
    built_in = passivity(load({"controller": {"kind": kind}} | walls | given)).columns
    np.testing.assert_allclose(drawn["port_margin"], built_in["port_margin"], rtol=1e-8, atol=1e-15)
    np.testing.assert_array_equal(drawn["port_passive"], built_in["port_passive"])
