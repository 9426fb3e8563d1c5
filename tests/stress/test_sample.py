"""A sample of `python -m tests.stress`, of every family: no certified row is wrong, nothing crashes, no warning."""

import pytest
from stress import climbs
from stress.command import NAMES, verdicts

pytestmark = pytest.mark.slow

MANY = {  # of the slow ones; else 20
    "responses": 8, "numbers": 3, "constructed": 3, "long_filters": 4, "windows": 3, "wild": 6, "any_number": 40,
}  # fmt: skip


@pytest.mark.sample(2)
@pytest.mark.parametrize("family", [name for name in NAMES if name not in {"climbs", "hands"}])  # see below and test_hands
def test_certified_rows_are_right(family):
    """Ends to 1e-9, counts exactly; and most rows are certified."""
    found = [(seed, v) for seed in range(MANY.get(family, 20)) for v in verdicts(family, seed)]
    assert [(seed, v) for seed, v in found if v.certified and v.kind != "right"] == []
    assert sum(v.certified for _, v in found) > 0.4 * len(found)


def test_a_spring_whose_phase_is_lost_in_a_tick_is_in_doubt():
    """It turns 1e26 times in a tick; that it comes to rest, as rounding says, was certified."""
    assert [v.certified for v in verdicts("any_number", 30)] == [False]


def test_entries_whose_products_overflow_are_no_fault():
    """Of a wild loop, unstable without its wall: over a frame its entries grow to 1e235."""
    assert {(v.kind, v.certified) for v in verdicts("wild", 13400031)} == {("right", True)}


def test_what_is_not_known_of_an_ill_posed_loop_needs_no_warning():
    """Its samples on the circle are no numbers, and a wall whose input overflows may have crossings anywhere."""
    assert {v.kind for v in verdicts("nearly_ill_posed", 24200922)} <= {"right", "refused"}  # as ill-posed, by a whisker


def test_a_short_climb_to_the_worst_end_stays_within_what_is_promised():
    (worst,) = climbs.judge(0, steps=10)
    assert worst.certified
    assert worst.kind == "right"
