"""A channel whose messages are all in time is a hold: nothing is proved beside its loop, and nothing is refused."""

import wavesweep

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
