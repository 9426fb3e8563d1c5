"""A search for the largest or the smallest number ends at the last value with which all wishes are met."""

import pytest

from wavesweep.designs.study import design
from wavesweep.program.spec import load

RATE = 100.0  # Hz


def follower(**wish):
    """y += k T (r - y): its step overshoots by k T - 1, and it is stable for k T < 2."""
    return load(
        {
            "rates": {"tick_hz": RATE},
            "numbers": {"k": 10.0},
            "block": {"y": {"type": "integrator", "method": "explicit"}},
            "wire": {"y.u": "k*(r - y.y)"},
            "ports": {"inputs": {"r": "r"}, "outputs": {"y": "y.y"}},
            "design": {"population": 8, "generations": 2, "vary": {"k": {"start": 1, "stop": 500}}, "wish": wish},
        }
    )


def held_mass(for_all=None, **wish):
    """A mass under a force that is held over T: stable for kd < 2 m/T and 0 < kp < 2 kd/T."""
    return load(
        {
            "rates": {"tick_hz": RATE},
            "numbers": {"m": 1.0, "kp": 50.0, "kd": 20.0},
            "block": {"m": {"type": "mass", "mass": "m"}, "pd": {"type": "hold"}},
            "wire": {"pd.u": "kp*m.x + kd*m.v", "m.f": "-pd.y"},
            "design": {
                "population": 8,
                "generations": 2,
                "vary": {"kp": {"start": 10, "stop": 1e5}, "kd": {"start": 1, "stop": 60}},
                "wish": wish,
            },
        }
        | ({"for_all": for_all} if for_all else {})
    )


def notice_of(table):
    (notice,) = (text for text in table.facts["notices"] if "best design" in text or "in steps" in text)
    return notice


@pytest.mark.slow
def test_an_overshoot_is_met_up_to_its_last_value():
    table = design(follower(largest="k", overshoot={"at_most": 0.05, "from": "r", "to": "y"}))
    assert table.columns["k"][0] == pytest.approx(1.05 * RATE, rel=1e-8)
    assert notice_of(table) == "largest: with the best design's other numbers all wishes are met up to k = 105, exactly"


def test_what_cannot_be_required_is_said_to_be_looked_for_in_steps():
    """[sweep] require takes phases of 0.01 degrees and more."""
    table = design(follower(largest="k", phase_deg={"at_least": 0.001, "cut": "y.y"}))
    assert 2 * RATE - 2 < table.columns["k"][0] < 2 * RATE
    assert notice_of(table) == "largest: k was looked at in steps of 0.2 % of its range, not exactly"


@pytest.mark.parametrize("for_all", [None, {"m": {"start": 1, "stop": 2}}])
@pytest.mark.slow
def test_the_other_numbers_follow_to_the_ends_of_their_ranges(for_all):
    columns = design(held_mass(for_all, largest="kp")).columns
    assert columns["kd"][0] == pytest.approx(60, rel=1e-3)
    assert columns["kp"][0] == pytest.approx(2 * columns["kd"][0] * RATE, rel=1e-6)


@pytest.mark.slow
def test_the_smallest_number_is_the_first_that_meets_all():
    """The frame of dt = T has the determinant 1 - kd T + kp T^2/2, which is at most r^2 of modes of the size r."""
    table = design(held_mass(smallest="kd", settling={"at_most": 1.2}))
    again = {name: column[0].item() for name, column in table.columns.items() if name in ("kp", "kd")}
    assert again["kd"] < 20
    assert table.columns["settling"][0] == pytest.approx(1.2, rel=1e-5)
