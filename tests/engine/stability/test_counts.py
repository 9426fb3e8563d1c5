"""Unstable eigenvalues that are not counted but follow from the crossings: the same number, or they are counted."""

from dataclasses import replace

import numpy as np
import pytest
from support.intervals import NUMBER, cut_of
from support.specs import random_values

from wavesweep.engine._monodromy.cut import FIRST
from wavesweep.engine._stability import regions, stable
from wavesweep.engine._stability.stable import stable_intervals

K_FIXED = np.concatenate([[0], np.random.default_rng(5).uniform(0, 15, 11)])


@pytest.mark.slow
@pytest.mark.parametrize(("along", "span", "fixed"), [("K_VE", (0, 2e4), K_FIXED)])
def test_counts_that_follow_are_those_of_eigenvalues(along, span, fixed, monkeypatch):
    """24 loops of all kinds, 12 columns each: most follow, and every one of these is counted here after all."""
    usual, seen = regions._first_counts, []

    def compared(owner, above, followed, least, count):
        begins, counted = usual(owner, above, followed, least, count)
        rest = np.flatnonzero(~counted)
        seen.append((owner.size, rest.size))
        np.testing.assert_array_equal(count(rest), begins[rest])
        return begins, counted

    monkeypatch.setattr(regions, "_first_counts", compared)
    for seed in range(24):
        stable_intervals(cut_of(random_values(seed)), NUMBER[along], span, fixed[None])
    columns, followed = np.sum(seen, axis=0)
    assert followed > 0.5 * columns > 100


def test_a_wrong_growth_is_noticed_and_every_column_is_counted(monkeypatch):
    """One direction turned round in the last column: its count does not fit the first one's, and all are counted."""
    cut = cut_of(random_values(3, "pmw"))
    right, usual = stable_intervals(cut, FIRST, (0, 2e4), K_FIXED[None]), stable.crossings

    def wrong(*arguments):
        found = usual(*arguments)
        growth = found.growth_to_infinity.copy()
        growth[-1] += 2.0
        return replace(found, growth_to_infinity=growth)

    monkeypatch.setattr(stable, "crossings", wrong)
    counted = []
    first = regions._first_counts

    def listening(*arguments):
        counted.append(first(*arguments)[1])
        return first(*arguments)

    monkeypatch.setattr(regions, "_first_counts", listening)
    found = stable_intervals(cut, FIRST, (0, 2e4), K_FIXED[None])
    assert counted
    assert counted[0].all()
    assert found.certified.all()
    np.testing.assert_array_equal(found.high, right.high)


@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
@pytest.mark.parametrize("along", ["K_VE", "B_VE"])
def test_units_of_the_states_do_not_matter(kind, along):
    """States counted in units that differ by 2^60, as those of a transfer function do; the same intervals, certified."""
    cut = cut_of(random_values(3, kind))
    units = 2.0 ** np.linspace(-30, 30, cut.E.shape[-1]).round()
    ratio, column = units / units[:, None], units[:, None]
    other = replace(
        cut, E=cut.E * ratio, B=cut.B / column, C=cut.C * units, dE=cut.dE * ratio, dB=cut.dB / column, dC=cut.dC * units
    )
    assert np.abs(other.E).max() > stable.UNEVEN
    found, same = (stable_intervals(each, NUMBER[along], (0, 2e4), np.array([[0.5, 5.0]])) for each in (other, cut))
    assert same.certified.all()
    assert found.certified.all()
    np.testing.assert_array_equal(found.count, same.count)
    for name in ("low", "high", "low_omega", "high_omega"):
        np.testing.assert_allclose(getattr(found, name), getattr(same, name), rtol=1e-10)
