"""Messages tick by tick, against a march that finds from when messages come which one is held."""

import numpy as np
import pytest
from scipy.linalg import expm
from support.networks import back, growth, random_messages, random_network, spec_of

import wavesweep
from tests.for_all.test_messages import integrator
from wavesweep.engine._switched import patterns
from wavesweep.engine.errors import UsageError
from wavesweep.for_all import message_rings
from wavesweep.for_all.channel_families import channels_of
from wavesweep.for_all.message_patterns import growing_pattern, messages_of, nearest_pattern, realised
from wavesweep.for_all.message_rings import ring_of_messages
from wavesweep.for_all.ring_search import bracket_ring, decide_ring
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals


def ring(tables):
    spec = load(tables)
    values = dict(spec.values)
    return ring_of_messages(spec.drawing, values, channels_of(spec.drawing, values), "numbers.K")


@pytest.mark.parametrize("seed", [0, 7])
def test_what_is_held_grows_as_its_messages_do(seed):
    """Also with delays behind channels, which the ring has before them."""
    source = np.random.default_rng(seed)
    loop = random_network(source)
    found = ring(spec_of(loop))
    places = len(found.slots)
    for periods in (1, 2, 5):
        steps = [np.flatnonzero(found.place == at % places) for at in range(periods * places)]
        word = realised(found, tuple(int(source.choice(own)) for own in steps))
        assert all(found.follows[one, other] for one, other in zip(word, (*word[1:], word[0]), strict=True))
        messages = messages_of(found, word)
        for channel, late in zip(loop["channels"], messages.values(), strict=True):
            lost = "".join("x" if each is None else "." for each in late * 3)
            assert "x" * (channel["lost"] + 1) not in lost
            assert all(each is None or 0 <= each <= channel["late"] for each in late)
        K = source.uniform(0, 5000)
        assert patterns.growth(found.at(K), word) == pytest.approx(growth(loop, K, list(messages.values())), rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_whatever_messages_do_what_is_held_is_looked_at(seed):
    """And what is looked at can be held."""
    source = np.random.default_rng(2000 + seed)
    loop = random_network(source) | {"delays": [0, 0], "control": 1}
    found, seen = ring(spec_of(loop)), set()
    for _ in range(300):
        messages = random_messages(loop, source)
        for k in range(found.loop.drawn.ticks * (6 + len(messages[0]))):
            held = zip(loop["channels"], messages, strict=True)
            seen |= {(k % found.loop.drawn.ticks, at, back(channel, late, k)[0]) for at, (channel, late) in enumerate(held)}
    assert seen == {(symbol.tick, at, each) for symbol in found.symbols for at, each in enumerate(symbol.back)}


@pytest.mark.parametrize("seed", range(3))
def test_what_is_held_is_half_the_newest_and_half_the_oldest_but_for_a_rest_with_a_gain(seed):
    """Of messages that rise and fall slowly, those that are all in time have a rest that is as large as the gain allows."""
    source = np.random.default_rng(3000 + seed)
    loop = random_network(source) | {"delays": [0, 0], "control": 1}
    gain, count = (found := ring(spec_of(loop))).gain, 240
    slow, rough = np.cos(2 * np.pi * np.arange(count) / count), source.normal(size=count)
    for messages, sent in (([[0], [0]], slow), (random_messages(loop, source), slow), (random_messages(loop, source), rough)):
        differences = np.square(np.diff(sent, append=sent[0])).sum()
        for at, (channel, late) in enumerate(zip(loop["channels"], messages, strict=True)):
            rest = 0.0
            for k in range(count * channel["every"]):
                older, last = back(channel, late, k)
                oldest = found.loop.choices[k % len(found.loop.choices)][at][-1]
                ends = (sent[last % count] + sent[(last - oldest) % count]) / 2
                rest += (sent[(last - older) % count] - ends) ** 2
            most = gain.gains[at] * differences
            assert (0.95 if late == [0] else 0) * most < rest < most * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_what_a_small_gain_proves_survives_messages_and_what_refutes_grows(seed):
    source = np.random.default_rng(1000 + seed)
    loop = random_network(source)
    found = ring(spec_of(loop))
    end = found.gain.reached(60.0, 20000.0)
    assert end > 1000
    assert found.gain.reached(60.0, 0.0) == 0
    assert all(growth(loop, end * part, random_messages(loop, source)) < 1 for part in (0.3, 1) for _ in range(6))
    decision = decide_ring(found, 20000.0)
    assert decision.verdict == "refuted"
    assert growth(loop, 20000.0, list(messages_of(found, decision.word).values())) >= 1 - 1e-9
    assert not found.gain.proved(0.0, 20000.0)


def test_an_integrator_tick_by_tick_is_stable_up_to_its_longest_hold():
    """`K T < 2/(n + 1)`, if n messages in a row may be lost."""
    found = ring(integrator(lost=2))
    proof = bracket_ring(found, (0.0, 3.0))
    assert proof.low < 1e-3
    assert 0.55 < proof.high < 2 / 3 <= proof.above.x < 2 / 3 * (1 + 1e-3)
    assert sorted(messages_of(found, proof.above.word)["net"], key=str) == [0, None, None]
    assert [decide_ring(found, K).verdict for K in (0.5, 0.67)] == ["proved", "refuted"]


@pytest.mark.slow
def test_a_proof_that_has_reached_the_number_in_question_goes_no_farther():
    found = ring(integrator(late=40))
    told = []
    proof = bracket_ring(found, (0.0, 0.05), lambda *report: told.append(report), value=0.02)
    assert proof.low <= 0.02 <= proof.high < 0.05
    assert len(told) == 1
    assert (proof.below.word, proof.above.word) == ((), ())


@pytest.mark.parametrize(("late", "proved", "open_"), [(40, 1.2, 1.6), (100, 0.98, 1.02), (300, 0.98, 1.02)])
def test_an_integrator_whose_messages_are_late_by_any_of_many_ticks_has_a_small_gain(late, proved, open_):
    """About the newest message it is `K late < 1`; about the middle nearly 3/2, from where the loop is unstable."""
    gain = ring(integrator(late=late)).gain
    assert gain.proved(proved / late, proved / late)
    assert not gain.proved(open_ / late, open_ / late)


def test_a_channel_behind_another_has_a_small_gain_though_little_of_a_message_is_left_after_it():
    gain = ring(masses_in_a_row(late=10)).gain
    assert gain.proved(1.0, 1.0)
    assert not gain.proved(1000.0, 1000.0)


def masses_in_a_row(**keys):
    """A mass that a spring holds, pushed by what went through two channels, one behind another."""
    channel = {"type": "channel", **keys}
    mass = {"type": "mass", "mass": 1.0, "damping": 20.0, "stiffness": 100.0}
    wire = {"a.u": "K*x.x", "b.u": "a.y", "x.f": "-b.y"}
    return {"rates": {"tick_hz": 1000}, "numbers": {"K": 1.0}, "block": {"x": mass, "a": channel, "b": channel}, "wire": wire}


def test_a_loop_whose_gain_is_below_one_is_proved_by_peaks_however_late_messages_are():
    """Without overshoot it is K/100, at rest; beyond it half of a second of 0 and half of 1/K is unstable."""
    peaks = ring(masses_in_a_row(late=400)).gain.peaks
    assert peaks.proved(0.0, 95.0)
    assert peaks.proved(99.0, 99.0)
    assert not peaks.proved(101.0, 101.0)


@pytest.mark.parametrize(("every", "late"), [(1, 30), (4, 9)])
def test_peaks_have_the_sum_of_a_response_that_is_marched(every, late):
    """What is read in each tick is any of the last messages: the response of a mass, sampled when it sends."""
    spec = masses_in_a_row(every=every, late=late)
    spec["block"]["x"] |= {"damping": 4.0}
    spec["wire"] = {"a.u": "K*x.x", "x.f": "-a.y"}
    del spec["block"]["b"]
    flow = expm(1e-3 * np.array([[0, 1, 0], [-100, -4, 1], [0, 0, 0]]))
    state, total = flow[:2, 2], 0.0
    for _ in range(8000):
        total += abs(state[0])
        state = flow[:2, :2] @ state
    peaks = ring(spec).gain.peaks
    assert peaks.proved(0.995 / total, 0.995 / total)
    assert not peaks.proved(1.005 / total, 1.005 / total)
    assert not peaks.proved(0.5 / total, 1.1 / total)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 12))])
def test_what_peaks_prove_survives_messages(seed):
    source = np.random.default_rng(4000 + seed)
    loop = random_network(source)
    peaks = ring(spec_of(loop)).gain.peaks
    end = max(K for K in np.geomspace(1, 2e4, 25) if peaks.proved(K, K))
    assert 10 < end < 2e4
    assert all(growth(loop, end, random_messages(loop, source)) < 1 for _ in range(12))


@pytest.mark.slow
@pytest.mark.parametrize("missing", ["held", "zero"])
def test_the_stiffness_at_rest_over_a_network_is_that_of_messages_in_time_unless_lost_ones_are_zero(missing):
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 50.0, "B": 1.0},
        "block": {
            "tool": {"type": "mass", "mass": 0.5, "damping": 8.0},
            "net": {"type": "channel", "every": 4, "lost": 1, "missing": missing},
        },
        "wire": {"net.u": "K*tool.x + B*tool.v", "tool.f": "hand - net.y"},
        "ports": {"hand": {"force": "hand", "displacement": "tool.x"}, "wall": {"stiffness": "K", "damping": "B"}},
        "sweep": {"K": {"start": 0, "stop": 5000}},
    }
    found = intervals(load(tables)).columns
    (row,) = np.flatnonzero((found["guarantee"] == "for_all") & found["certified"])
    assert 0 < found["high"][row] < 5000
    assert found["felt_high"][row] == pytest.approx(found["high"][row] if missing == "held" else np.nan, nan_ok=True, rel=1e-9)


@pytest.mark.slow
def test_an_interval_over_a_network():
    """A message each 4 ticks, up to 7 late both ways."""
    channel = {"every": 4, "phase": 0, "late": 7, "lost": 0}
    loop = {"channels": [channel, channel], "delays": [0, 2], "control": 2}
    found = ring(spec_of(loop))
    told = []
    proof = bracket_ring(found, (0.0, 20000.0), lambda *report: told.append(report))
    assert [high for _, high, _ in told] == sorted(high for _, high, _ in told)  # what is told never shrinks
    assert proof.low == 0
    assert 5000 < proof.high < proof.above.x < 20000
    source = np.random.default_rng(2)
    assert all(growth(loop, proof.high, random_messages(loop, source)) < 1 for _ in range(60))
    messages = messages_of(found, proof.above.word)
    assert growth(loop, proof.above.x, list(messages.values())) >= 1 - 1e-9


def test_two_free_arms_drift_together_and_no_message_holds_them_back():
    """Each may be where it is: of what remains, every pattern of messages decays."""
    source = np.random.default_rng(5)
    channel = {"every": 4, "phase": 0, "late": 6, "lost": 1}
    masses = {"master": (0.25, 3.0, 0.0), "slave": (1.2, 4.0, 0.0)}
    loop = {"channels": [channel, channel | {"phase": 1}], "delays": [2, 0], "control": 2, "masses": masses}
    assert wavesweep.verdict(spec_of(loop, 60.0))["for_all"]["verdict"] == "proved"
    for _ in range(20):
        messages = random_messages(loop, source)
        assert growth(loop, 60.0, messages, drifts=1) < 1
        assert growth(loop, 60.0, messages) == pytest.approx(1, abs=1e-9)


def within(K, low, high, slave=1.2):
    """Networks with masters of all masses of a range."""
    channel = {"every": 4, "phase": 0, "late": 7, "lost": 1}
    masses = {"master": ("m", 3.0, 100.0), "slave": (slave, 4.0, 0.0)}
    loop = {"channels": [channel, channel], "delays": [0, 2], "control": 2, "masses": masses}
    tables = spec_of(loop, K)
    return loop, tables | {"numbers": {"K": K, "m": low}, "for_all": {"m": {"start": low, "stop": high}}}


def test_ranges_beside_messages_are_proved_by_a_small_gain_and_refuted_by_messages():
    source = np.random.default_rng(4)
    loop, tables = within(400.0, 0.2, 0.3)
    assert wavesweep.verdict(tables)["for_all"]["verdict"] == "proved"
    for m in source.uniform(0.2, 0.3, 12):
        masses = loop["masses"] | {"master": (m, 3.0, 100.0)}
        assert growth(loop | {"masses": masses}, 400.0, random_messages(loop, source)) < 1
    found = wavesweep.verdict(within(20000.0, 0.2, 0.3)[1])["for_all"]
    assert found["verdict"] == "refuted"
    mass, said = found["counterexample"].removeprefix("m = ").split(", messages ")
    messages = [[None if each == "lost" else int(each) for each in own.split(": ")[1].split(", ")] for own in said.split("; ")]
    masses = loop["masses"] | {"master": (float(mass), 3.0, 100.0)}
    assert growth(loop | {"masses": masses}, 20000.0, messages) >= 1 - 1e-9


def test_messages_that_are_zero_are_not_looked_at_tick_by_tick():
    tables = spec_of(
        {"channels": [{"every": 10, "late": 40, "lost": 1, "missing": "zero"}] * 2, "delays": [0, 0], "control": 1}
    )
    with pytest.raises(UsageError, match="expected at most 600 ways"):
        wavesweep.stability_region(tables)


def two_ways(stop):
    """A mass over a network whose messages may be lost or late both ways, 9 and 13 ticks beside 4."""
    return {
        "rates": {"tick_hz": 200},
        "numbers": {"K": 0.2},
        "block": {
            "x": {"type": "mass", "mass": 1.0, "damping": 3.0, "stiffness": 10.0},
            "sc": {"type": "channel", "every": 4, "late": 9, "lost": 1},
            "ca": {"type": "channel", "every": 4, "phase": 1, "late": 13},
        },
        "wire": {"sc.u": "x.x", "ca.u": "-K*(20*sc.y + 2*x.v)", "x.f": "ca.y"},
        "sweep": {"along": "K", "K": {"start": 0, "stop": stop}},
    }


@pytest.mark.slow
def test_what_messages_refute_does_not_depend_on_how_far_a_range_goes():
    found = ring(two_ways(20))
    near = nearest_pattern(found, 3.9, 6.0)
    far = nearest_pattern(found, 3.5, 300.0)
    assert near.x == far.x < 5.25
    assert near.word == far.word
    assert np.isnan(nearest_pattern(found, 4.5, 5.0).x)


@pytest.mark.slow
def test_a_channel_is_refuted_no_later_than_by_messages_that_are_all_late():
    """A message each 7 ticks that is 37 late is a dead time of 37 ticks and a hold of 7."""
    tables = two_ways(20)
    tables["block"] = {"x": tables["block"]["x"], "ca": {"type": "channel", "every": 7, "late": 37}}
    tables["wire"] = {"ca.u": "-K*(20*x.x + 2*x.v)", "x.f": "ca.y"}
    delayed = tables | {"block": tables["block"] | {"ca": {"type": "hold", "every": 7}, "z": {"type": "delay", "steps": 37}}}
    delayed["wire"] = tables["wire"] | {"z.u": "ca.y", "x.f": "z.y"}
    end = wavesweep.compile(delayed).stable_intervals(along="K", span=(0, 20))["high"][0]
    proof = bracket_ring(ring(tables), (0.0, 20.0))
    assert 0 < proof.high < proof.above.x <= end * (1 + 1e-6)


@pytest.mark.slow
def test_a_pattern_that_grows_between_numbers_at_which_it_decays_is_found():
    """Messages each 8 ms both ways, up to 21 ms late, two in a row lost: four make the loop unstable from 6551 to some 7100."""
    channel = {"every": 16, "phase": 0, "late": 42, "lost": 2}
    leader, follower = (0.18, 2.7, 60.0), (0.7, 5.0, 0.0)
    tables = spec_of({"channels": [channel, channel], "delays": [0, 0], "control": 1})
    tables["rates"] = {"tick_hz": 2000}
    keys = ("mass", "damping", "stiffness")
    for name, own in (("master", leader), ("slave", follower)):
        tables["block"][name] = {"type": "mass", **dict(zip(keys, own, strict=True))}
    del tables["block"]["control"]
    tables["block"]["speed"] = {"type": "difference"}
    tables["wire"] = {
        "speed.u": "master.x",
        "there.u": "master.x",
        "back.u": "slave.x",
        "master.f": "push - K*(master.x - back.y) - speed.y",
        "slave.f": "250*(there.y - slave.x) - 18*slave.v",
    }
    found = ring(tables)
    refuted = nearest_pattern(found, 5000.0, 20000.0)
    assert refuted.x < 6562
    assert patterns.growth(found.at(refuted.x), refuted.word) >= 1 - 1e-9
    assert patterns.growth(found.at(8000.0), refuted.word) < 1


@pytest.mark.slow
def test_a_channel_that_sends_in_every_tick_is_proved_beside_a_range():
    """The register of its oldest message acts on nothing, in an enclosure too."""
    tables = {
        "rates": {"tick_hz": 100},
        "numbers": {"m": 1.0},
        "block": {"a": {"type": "mass", "mass": "m", "damping": 3, "stiffness": 5}, "net": {"type": "channel", "late": 12}},
        "wire": {"net.u": "-2*a.x - 0.5*a.v", "a.f": "net.y"},
        "for_all": {"m": {"start": 0.9, "stop": 1.1}},
    }
    found = wavesweep.verdict(tables)["for_all"]
    assert (found["verdict"], found["known"]) == ("proved", "by a small gain")


def test_what_a_ring_takes_is_bounded_by_the_entries_of_its_matrices(monkeypatch):
    """200 messages under way give 201 matrices of 200 states: of what is held only the newest and the oldest stay."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 30.0},
        "block": {"m": {"type": "mass", "mass": 1, "damping": 1}, "net": {"type": "channel", "late": 200}},
        "wire": {"net.u": "-K*m.x - 0.2*m.v", "m.f": "net.y"},
    }
    assert [each.back for each in ring(tables).symbols] == [(0,), (200,)]
    tables["block"]["net"]["late"] = 20
    assert len(ring(tables).symbols) == 21
    monkeypatch.setattr(message_rings, "MOST_ENTRIES", 500.0)
    with pytest.raises(UsageError, match=r"channels net: 2\d states, most of them messages .*at most 15"):
        ring(tables).symbols  # noqa: B018 - which are made when they are asked for


@pytest.mark.slow
@pytest.mark.parametrize(("tick_hz", "faster", "late"), [(4000, 1, 60), (8000, 1, 60), (8000, 2, 8), (16000, 4, 16)])
def test_a_fast_loop_behind_slow_messages_is_proved_in_units_of_its_own(tick_hz, faster, late):
    """A joint at several kHz whose set point comes each 40 ticks or more: a form of it has eigenvalues from 1e-17 to 16
    in the units of the spec. Of messages that are late by few ticks, frames keep 2e-10 of a state. It is held against all
    messages that a climb finds."""
    tables = {
        "rates": {"tick_hz": tick_hz},
        "numbers": {"K": 40.0},
        "block": {
            "motor": {"type": "inertia", "inertia": 0.25, "damping": 2.0},
            "arm": {"type": "inertia", "inertia": 0.275, "damping": 0.2},
            "sea": {"type": "spring", "k": 350.0, "d": 0.3},
            "drive": {"type": "tf", "num": [1], "den": [0.0004, 1]},
            "tloop": {"type": "pid", "kp": 2.0, "ki": 20.0, "kd": 0.06, "tau": 0.001},
            "cmd": {"type": "hold"},
            "speed": {"type": "difference", "every": 4 * faster},
            "imp": {"type": "hold", "every": 4 * faster},
            "plan": {"type": "integrator", "every": 40 * faster},
            "net": {"type": "channel", "every": 40 * faster, "late": late, "lost": 1},
        },
        "wire": {
            "sea.x1": "motor.x",
            "sea.v1": "motor.v",
            "sea.x2": "arm.x",
            "sea.v2": "arm.v",
            "tloop.u": "imp.y - sea.f2",
            "cmd.u": "imp.y + tloop.y",
            "drive.u": "cmd.y",
            "motor.f": "drive.y + sea.f1",
            "arm.f": "sea.f2",
            "speed.u": "arm.x",
            "imp.u": "K*(net.y - arm.x) - 2*speed.y",
            "plan.u": "0 - arm.x",
            "net.u": "plan.y",
        },
    }
    assert wavesweep.verdict(tables)["for_all"]["verdict"] == "proved"
    rate, _ = growing_pattern(ring(tables), 40.0, periods=(1, 2, 3))
    assert 0 < rate < 1
