"""Ranges of a dead time, and intervals along one for all of [for_all], against the exact intervals of their members."""

import pytest
from support.specs import nested, values_of

import wavesweep


def loop(**device):
    own = values_of("dc", B_VE=0.5) | {"device.velocity": "difference", "environment.K_VE": 700.0}
    return nested(own | {f"device.{name}": value for name, value in device.items()})


def row_of(tables, along, stop, **ranges):
    """The row for all of [for_all]."""
    asked = {"along": along, along: {"start": 0, "stop": stop}}
    for_all = {f"device.{name}": {"start": low, "stop": high} for name, (low, high) in ranges.items()}
    found = wavesweep.stability_region(tables | {"sweep": asked, "for_all": for_all})
    return found[found.guarantee == "for_all"].to_dict("records")[0]


@pytest.mark.slow
@pytest.mark.parametrize("low", [0.0007, 0.0])
def test_a_range_of_a_dead_time_is_held_in_each_of_its_pieces_of_a_tick(low):
    row = row_of(loop(), "K_VE", 3000, dead_time=(low, 0.0013))
    ends = {late: wavesweep.compile(loop(dead_time=late)).stable_intervals("K_VE", (0, 3000)).high[0] for late in (low, 0.0013)}
    assert row["settled"]
    assert row["counterexample"] == "device.dead_time = 0.0013"
    assert row["fails_from"] == pytest.approx(ends[0.0013], rel=1e-9)
    assert 0.99 * ends[0.0013] < row["high"] < ends[0.0013] < ends[low]
