"""Intervals that hold for every passive hand, whatever the frames do: where they end, by what, and what is refused."""

import numpy as np
import pytest
from support.specs import values_of

pytest.importorskip("wavesweep.passive", reason="every hand at constant frames is known by it")
pytest.importorskip("wavesweep.check")
from support.held import damping_needed

from wavesweep.check.verdict import verdict, verdict_lines
from wavesweep.engine.errors import UsageError
from wavesweep.for_all.every_hand import damping
from wavesweep.for_all.every_hand_proof import EveryHand
from wavesweep.program.spec import load
from wavesweep.program.tables.hand_rows import hands_of
from wavesweep.program.tables.interval_table import intervals, rows_again

VARYING = {"rates.ratio": {"values": [4, 6], "varying": True}}
DRAWN = {
    "rates": {"tick_hz": 1000},
    "numbers": {"k": 100, "n": 6, "d": 5},
    "block": {
        "handle": {"type": "mass", "mass": 0.1, "damping": "d"},
        "speed": {"type": "difference"},
        "wall": {"type": "hold", "every": "n"},
        "late": {"type": "hold", "every": "n", "phase": 1},
    },
    "wire": {"handle.f": "f_h - late.y", "speed.u": "handle.x", "wall.u": "k*handle.x + 1*speed.y", "late.u": "wall.y"},
    "ports": {"hand": {"force": "f_h", "displacement": "handle.x"}},
    "for_all": {"n": {"values": [4, 6], "varying": True}},
    "sweep": {"along": "k", "k": {"start": 0, "stop": 2000}},
}


def spec_of(kind="dc-slow", for_all=None, sweep=None, **more):
    device = {"velocity": "difference", "damping": 5.0} | more
    sweep = sweep or {"K_VE": {"start": 0, "stop": 2000}, "B_VE": [1.0]}
    environment = {"integration": "explicit", "delay": 1, "K_VE": 100.0, "B_VE": 1.0}
    tables = {"controller": {"kind": kind}, "device": device, "environment": environment, "sweep": sweep}
    return load(tables | {"for_all": VARYING | (for_all or {})})


def passive(spec, along=None):
    run = intervals(spec, along, hands_of("passive"))
    rows = run.columns["hand"] == "passive"
    return {name: column[rows].tolist() for name, column in run.columns.items()}


def longest(K_VE, B_VE=1.0):
    """The damping that the longest frame needs for ever."""
    values = values_of("dc-slow", K_VE=K_VE, B_VE=B_VE, **{"rates.ratio": 6, "environment.delay": 1})
    return float(damping_needed(values | {"device.velocity": "difference", "environment.integration": "explicit"}).damping)


@pytest.mark.slow
def test_walls_end_where_the_longest_frame_needs_all_of_the_damping():
    spec = spec_of(sweep={"K_VE": {"start": 0, "stop": 2000}, "B_VE": [0.0]})
    rows = passive(spec, "K_VE")
    assert (rows["low"], rows["certified"], rows["settled"]) == ([0.0], [True], [True])
    assert longest(rows["high"][0], 0.0) < 5 < longest(rows["fails_from"][0], 0.0)
    assert rows["fails_from"][0] < (1 + 2e-5) * rows["high"][0]
    assert rows["counterexample"][0].startswith("frames 6, a h")
    again = next(iter(rows_again(spec, "K_VE", hands_of("passive"), [1])))
    assert again["high"].tolist() == rows["high"]


def test_the_least_damping_of_the_device():
    damped = {"along": "device.damping", "device.damping": {"start": 0, "stop": 20}, "K_VE": [50.0, 100.0]}
    rows = passive(spec_of(sweep=damped))
    np.testing.assert_allclose(rows["low"], [longest(50.0), longest(100.0)], rtol=2e-5)
    assert rows["high"] == [20.0, 20.0]


def test_the_verdict_has_the_damping_that_is_needed():
    assert damping(spec_of())["needed"] == pytest.approx(longest(100.0), rel=1e-6)
    short = damping(spec_of(damping=1.0))
    assert short["device"] == 1.0 < short["refuted"]
    assert short["by"].startswith("frames 6, a hand that moves at ")
    assert damping(spec_of("pmw")) is None
    assert damping(spec_of(velocity="exact")) is None
    felt = DRAWN | {"wire": DRAWN["wire"] | {"wall.u": "k*handle.x + 1*handle.v"}}
    assert damping(load(DRAWN)) is not None
    assert damping(load(felt)) is None


LOSSES = {
    "environment": {"integration": "explicit", "delay": 1, "K_VE": 150},
    "device": {"velocity": "difference", "damping": 6},
    "controller": {"kind": "dc-slow"},
    "for_all": {"loss": 0.5},
    "sweep": {"K_VE": {"start": 0, "stop": 2000}},
}


@pytest.mark.slow
@pytest.mark.parametrize(("lost", "delay"), [(1, 0), (2, 1), (3, 0)])
def test_losses_in_a_row_need_the_damping_of_frames_so_many_times_as_long(lost, delay):
    spec = LOSSES | {"environment": LOSSES["environment"] | {"delay": delay}, "for_all": {"lost": lost}}
    constant = {"rates.ratio": 20 * (lost + 1), "environment.delay": delay, "device.velocity": "difference"}
    values = values_of("dc-slow", K_VE=150.0, B_VE=1.0, **constant, **{"environment.integration": "explicit"})
    found = damping(load(spec))
    needs = float(damping_needed(values).damping)
    assert (found["needed"], found["refuted"]) == pytest.approx((needs, needs), rel=1e-6)


def test_nothing_is_proved_beside_losses_at_random_of_which_any_number_may_be_in_a_row():
    spec = load(LOSSES)
    assert damping(spec) is None
    assert not any("passive hand" in line for _, line in verdict_lines(spec, verdict(spec)))


def test_a_delay_in_ticks_is_not_that_of_a_frame_though_it_is_as_long_as_the_spec_s_own():
    """Frames of 4 and 5 with a result that is 4 ticks late need what frames of 5 alone do, and with a frame's delay others."""
    constant = {"device.velocity": "difference", "environment.integration": "explicit", "rates.ratio": 5}
    local = {"local_model.K_LM": 615.9, "local_model.B_LM": 0.0}
    for delay, ticks, needs in ((4, 4, 2.2547), ("frame", 5, 1.6437)):
        wall = {"integration": "explicit", "delay": delay, "K_VE": 48.94, "B_VE": 1.0}
        tables = {
            "controller": {"kind": "dc-lm"},
            "environment": wall,
            "device": {"velocity": "difference"},
            "rates": {"ratio": 4},
        }
        varying = {"for_all": {"rates.ratio": {"values": [4, 5], "varying": True}}}
        found = damping(load(tables | varying | {"local_model": {"K_LM": 615.9, "B_LM": 0.0}}))
        values = values_of("dc-lm", K_VE=48.94, B_VE=1.0, **constant | local | {"environment.delay": ticks})
        alone = float(damping_needed(values).damping)
        assert (found["needed"], alone) == (pytest.approx(alone, rel=1e-6), pytest.approx(needs, rel=1e-4))


LOG = {"type": "ss", "discrete": True, "A": [["a"]], "B": [[1]], "C": [[1]], "inputs": ["u"], "outputs": ["y"]}


def with_log(every, log, a, spring):
    """A mass on a held spring k, with a block `log` of one state, and a spring of its own."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"k": 50.0, "a": a, "s": spring} | ({"n": 4} if every == "n" else {}),
        "block": {
            "m": {"type": "mass", "mass": 0.1, "damping": 5.0, "stiffness": "s"},
            "h": {"type": "hold", "every": every},
            "log": LOG,
        },
        "wire": {"h.u": "m.x", "m.f": "push - k*h.y", "log.u": log},
        "ports": {"hand": {"force": "push", "displacement": "m.x"}},
        "sweep": {"along": "k", "k": {"start": -40, "stop": 40}},
    }
    return load(tables | ({"for_all": {"n": {"values": [2, 4], "varying": True}}} if every == "n" else {}))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("every", "log", "a", "spring", "proved"),
    [  # what the log reads, its factor, a spring, and what is proved
        (4, "m.x", 0.5, 0, (0, 40)),
        ("n", "0", -1.1, 0, None),
        (4, "m.x", 0.5, 20, (-20, 40)),
        ("n", "m.x", 0.5, -20, (20, 40)),
    ],
)
def test_a_device_without_a_hand_has_one_that_is_passive(every, log, a, spring, proved):
    """What is unstable by itself is so with some passive hand: blocks that the hand does not meet, springs that push away."""
    rows = passive(with_log(every, log, a, spring))
    assert rows["intervals"] == [bool(proved)]
    if proved:
        assert (rows["low"][0], rows["high"][0]) == pytest.approx(proved, abs=1e-3)
        assert rows["certified"] == [True]


def test_what_contradicts_the_device_alone_is_in_doubt_and_asks_to_be_reported(monkeypatch):
    monkeypatch.setattr(EveryHand, "pulls", lambda *_: False)  # a proof that forgets the springs that push away
    spec = with_log("n", "m.x", 0.5, -60)
    rows = passive(spec)
    assert (rows["certified"], rows["doubt"]) == ([False], ["contradiction"])
    found = damping(spec)
    assert (found["needed"], found["doubt"]) == (None, "contradiction")
    assert any("please report it" in line for _, line in verdict_lines(spec, verdict(spec)))


@pytest.mark.parametrize(
    ("spec", "words", "said"),
    [
        (spec_of("pmw"), "passive", "expected a wall without waves"),
        (spec_of(), "port", "one proof covers every passive hand"),
        (spec_of("pmw"), "port", "found one$"),
        (spec_of(velocity="exact"), "box", "found one$"),
        (load(LOSSES), "passive", "found loss, with which any number in a row may be lost"),
        (spec_of(velocity="exact"), "passive", "expected device.velocity"),
        (
            spec_of(for_all={"environment.B_VE": {"start": 0, "stop": 1}}, sweep={"K_VE": [1.0, 2.0]}),
            "passive",
            "ranges of the device",
        ),
        (
            spec_of(sweep={"along": "rates.fast_hz", "rates.fast_hz": {"start": 500, "stop": 900}}),
            "passive",
            "along a number that",
        ),
    ],
)
def test_what_it_cannot_do_says_so_and_suggests_what_it_can(spec, words, said):
    with pytest.raises(UsageError, match=said):
        intervals(spec, None if spec.along else "K_VE", hands_of(words))
