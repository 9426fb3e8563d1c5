"""The table of filter choices, and waves that gain energy in a march exactly where the norm says that they may."""

import numpy as np
import pytest
from support.held import channel_norm
from support.waves_through import run_back, run_out, worst_wave

from wavesweep.passive import filter_table, sufficient_order


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
@pytest.mark.parametrize(("order", "cutoff_hz"), [(1, 10.0), (2, 30.0), (3, 60.0)])
def test_a_marched_wave_gains_the_square_of_the_norm(values, kind, order, cutoff_hz):
    """A long wave comes as near to it as the filters' coming and going lets it, and no nearer than the norm."""
    v = values(kind, **{"filters.lp1.order": order, "filters.lp1.cutoff_hz": cutoff_hz})
    limit = float(channel_norm(v).outward) ** 2
    gains = [run_out(v, worst_wave(v, frames)).gain for frames in (20, 80, 640)]
    assert limit > 1
    assert gains[0] < gains[1] < gains[2] <= limit
    assert gains[2] == pytest.approx(limit, rel=3e-3)
    assert gains[2] > 1


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("tone_hz", [0.0, 7.0, 25.0, 50.0])
def test_no_wave_gains_energy_where_the_norm_is_one(values, tone_hz):
    v = values("pmw", **{"filters.lp1.order": 8})
    assert channel_norm(v).passive
    rng = np.random.default_rng(3)
    shapes = [
        worst_wave(v, 100), rng.standard_normal(4000), np.cumsum(rng.standard_normal(2000)),
        np.cos(2 * np.pi * tone_hz * np.arange(4000) / 1000), np.ones(20), np.eye(1, 40)[0],
    ]  # fmt: skip
    for sent in shapes:
        assert run_out(v, sent).gain <= 1 + 1e-10


def test_the_paper_s_first_order_filter_lets_aliasing_add_a_tenth(values):
    v = values("pmw")
    seen = run_out(v, worst_wave(v, 640))
    assert seen.gain == pytest.approx(1.0533**2, rel=2e-3)
    assert seen.energy_out > seen.energy_in


@pytest.mark.parametrize("delay", [0, 7, 20])
def test_on_the_way_back_two_equal_constant_waves_become_one_of_twice_their_energy(values, delay):
    v = values("pmw-lm", **{"environment.delay": delay})
    gains = [run_back(v, np.ones(frames), np.ones(20 * frames)).gain for frames in (20, 400)]
    assert 1 < gains[0] < gains[1] <= float(channel_norm(v).inward) ** 2
    assert gains[1] == pytest.approx(2.0, rel=5e-3)


def test_the_table_says_what_each_order_and_cutoff_costs(values):
    table = filter_table(values("pmw"), orders=(1, 2, 4), cutoffs_hz=(5.0, 10.0, 25.0))
    assert {column.shape for column in table.values()} == {(9,)}
    assert table["certified"].all()
    ten = table["lp1_cutoff_hz"] == 10.0
    rounded = [round(norm, digits) for norm, digits in zip(table["channel_norm"][ten], (4, 4, 7), strict=True)]
    assert rounded == [1.0533, 1.0017, 1.0000024]
    assert sufficient_order(table) == {5.0: 2, 10.0: 4, 25.0: None}
    assert sufficient_order(table, energy_gain=0.2)[10.0] == 1


def test_a_high_pass_of_the_same_order_and_cutoff_makes_the_way_out_gain_more(values):
    table = filter_table(values("pmw"), orders=(1, 3), cutoffs_hz=(10.0,))
    assert (table["bank_norm"] > table["channel_norm"]).all()
