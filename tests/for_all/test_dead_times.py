"""Ranges of a dead time, and intervals along one for all of [for_all], against the exact intervals of their members."""

import numpy as np
import pytest
from support.specs import nested, values_of

import wavesweep
from wavesweep.for_all.channel_families import frames_with_messages
from wavesweep.for_all.rows import cases_of
from wavesweep.for_all.varying import Rules
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop


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


def behind_a_channel(line, **more):
    """A mass that a channel of 70 ms and then a dead time hold, on ticks of 10 ms."""
    return {
        "rates": {"tick_hz": 100},
        "numbers": {"s": 15.0, "tau": 0.05},
        "block": {
            "x": {"type": "mass", "mass": 2, "damping": 1.68},
            "ca": {"type": "channel", "every": 7, "lost": 1},
            "z": {"type": "delay", **line},
        },
        "wire": {"ca.u": "-s*x.x", "z.u": "ca.y", "x.f": "z.y"},
        "sweep": {"along": "s", "s": {"start": 0, "stop": 40}},
    } | more


def as_rows_have_it(loops):
    """The loop with the whole ticks of its dead times."""
    _, built = next(loops.built_alike(np.zeros(1, int)))
    return built


def radii_of_orders(loops, along):
    """The spectral radii of a step in time, and of one with the lost one after it, at 14 of the number along."""
    family = frames_with_messages(*loops, along)
    first, *others = family.at(14.0)
    return sorted(np.abs(np.linalg.eigvals(other @ first)).max() for other in (first, *others))


@pytest.mark.parametrize("tau", [0.05, 0.07, 0.033, 0.131, 0.14])
def test_a_dead_time_behind_losses_is_that_of_its_seconds_whatever_the_tick(tau):
    """Loops of rows are built with the whole ticks of dead times, which are counted anew in the tick of messages."""
    spec = load(behind_a_channel({"seconds": "tau"}, numbers={"s": 15.0, "tau": tau}))
    unbuilt = own_loop(spec, "numbers.s")
    built = as_rows_have_it(unbuilt)
    found = radii_of_orders(built, "numbers.s")
    assert found == pytest.approx(radii_of_orders(unbuilt, "numbers.s"), rel=1e-12)
    finer = behind_a_channel({"steps": round(1000 * tau)})  # counted in ticks of 1 ms
    finer |= {"rates": {"tick_hz": 1000}, "numbers": {"s": 15.0}}
    finer["block"]["ca"]["every"] = 70
    assert found == pytest.approx(radii_of_orders(own_loop(load(finer), "numbers.s"), "numbers.s"), rel=1e-9)


def test_listed_dead_times_have_the_whole_ticks_of_their_own():
    """And those of a range of them, in each of its pieces."""
    of_list = load(behind_a_channel({"seconds": "tau"}, for_all={"tau": {"values": [0.02, 0.131]}}))
    own = own_loop(of_list, "numbers.s")
    for case in cases_of(Rules.of(of_list), "numbers.s", (0.0, 40.0), as_rows_have_it(own)):
        exact = load(behind_a_channel({"seconds": "tau"}, numbers={"s": 15.0, "tau": case.fixed["numbers.tau"]}))
        radii = radii_of_orders((case.loop.drawing, case.values), "numbers.s")
        assert radii == pytest.approx(radii_of_orders(own_loop(exact, "numbers.s"), "numbers.s"), rel=1e-12)
