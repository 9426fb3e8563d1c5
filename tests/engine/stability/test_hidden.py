"""Crossings that hide next to an end of the circle."""

from support.intervals import intervals_of
from support.specs import values_of

# Next to nothing holds the hand back: a pair crosses 1e-5 rad from z = 1, at 1.0087e-3 N/m by 512-bit ball arithmetic.
ADRIFT = {
    "fast_hz": 5000.0, "ratio": 1, "delay": 1, "mass": 0.08916639642954888, "damping": 0.0, "velocity": "difference",
    "operator__mass": 0.2618371161416836, "b": 6.804162063814219e-05, "lp1_cutoff_hz": 29.43786256666377,
}  # fmt: skip


def test_a_crossing_next_to_the_end_is_missed_only_without_a_certificate():
    """The wall parameter of z = 1 itself, 0 N/m, is not inside the span; that of 1e-5 rad is."""
    found = intervals_of(values_of("pmw", **ADRIFT), fixed=0.0)
    assert abs(found.low[0] - 0.0010087221126784019) < 1e-9 or not found.certified[0]


def test_the_ends_of_an_undamped_loop_stay_certified():
    """Twice at z = 1, at 0 N/m, and nothing within 1e-7 rad of it that could be told from that."""
    found = intervals_of(values_of("dc-slow", damping=0.0), span=(0, 1e6), fixed=[1.0, 3.0])
    assert found.certified.all()
