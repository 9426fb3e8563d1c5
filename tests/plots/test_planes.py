"""Lines of a plane that follow intervals from column to column."""

from wavesweep.plots.planes import _followed
from wavesweep.plots.refine import NARROW, Curve, Interval


def column(*intervals, incomplete=False):
    return tuple(Interval(low, high, True, True, True) for low, high in intervals), incomplete


def test_an_interval_that_is_not_known_in_a_column_has_not_ended_there():
    both, one = column((0, 1200), (1280, 1390)), column((1283, 1387))
    for known in (True, False):
        part = one if known else (one[0], True)
        curve = Curve({6.4: both, 6.45: part, 6.5: both}, {(6.4, 6.45): NARROW, (6.45, 6.5): NARROW})
        chains, jumps, _, bars = _followed(curve)
        assert jumps == ([[(6.4, 1200), (6.4, 0)], [(6.5, 0), (6.5, 1200)]] if known else [])
        assert not bars
        assert [len(chain) for chain in chains].count(3) == 1
