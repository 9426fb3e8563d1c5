"""A channel whose messages are all in time is a hold: nothing is proved beside its loop, and nothing is refused."""

import pytest

import wavesweep
from wavesweep.program.spec import load

KINDS = {"hold": {"type": "hold", "every": "n"}, "channel": {"type": "channel", "every": "n"}}


def tables(kind, **more):
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 0.5, "n": 5},
        "block": {"motor": {"type": "inertia", "inertia": 0.02, "damping": 0.05}, "link": KINDS[kind] | more},
        "wire": {"link.u": "motor.v", "motor.f": "-kp*link.y"},
        "sweep": {"along": "kp", "kp": {"start": 0.01, "stop": 50}, "n": [2, 5]},
    }


def test_a_channel_that_loses_nothing_has_the_rows_of_a_hold():
    found, held = (wavesweep.stability_region(tables(kind)) for kind in ("channel", "hold"))
    assert found.columns.tolist() == held.columns.tolist()
    assert found.equals(held)


def test_it_may_stand_beside_frames_that_vary_as_a_hold_may():
    varying = {"for_all": {"n": {"values": [2, 5], "varying": True}}, "sweep": {"along": "kp", "kp": {"start": 1, "stop": 50}}}
    found, held = (wavesweep.stability_region(tables(kind) | varying) for kind in ("channel", "hold"))
    assert found.high.tolist() == held.high.tolist()


def test_its_spec_is_written_as_a_channel_and_can_still_lose_messages():
    spec = load(tables("channel"))
    assert spec.tables()["block"]["link"]["type"] == "channel"
    assert spec.for_all is None
    assert load(tables("channel", lost=1)).for_all is not None
    rows = wavesweep.compile(tables("channel")).stable_intervals(**{"block.link.lost": [0, 1]})
    assert set(rows["guarantee"]) == {"spec", "for_all"}
    with pytest.raises(wavesweep.UsageError):
        wavesweep.compile(tables("hold")).stable_intervals(**{"block.link.lost": [0, 1]})
