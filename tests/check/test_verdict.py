"""The verdict on a spec's own design, against the library's own answers and laws of the model."""

from pathlib import Path

import numpy as np
import pytest
from meaning.reading import radius_of, with_numbers
from support.specs import nested, values_of

import wavesweep
from wavesweep.check import room_of_numbers as judging
from wavesweep.check.verdict import verdict_lines
from wavesweep.program.analyses.claim_words import walls_in_words
from wavesweep.program.analyses.claims import own_scope
from wavesweep.program.spec import SYMBOLS, load

ROOT = Path(__file__).parents[2]

WAVES = values_of("pmw", integration="explicit", velocity="difference", delay=1, b=10.0)


def verdict(values):
    return wavesweep.verdict(nested(values))


def limit_of(found, name):
    return next(each for each in found["limits"] if each["name"] == name)


@pytest.mark.slow
def test_the_limits_are_the_ends_of_the_stable_interval_about_the_value():
    found = verdict(WAVES)
    assert found["stable"]
    assert limit_of(found, "K_VE")["high"] == pytest.approx(798.521, abs=1e-2)
    for name in ("K_VE", "b"):
        limit, path = limit_of(found, name), SYMBOLS[name]
        assert limit["certified"]
        for end, inside in (("low", 1.001), ("high", 0.999)):
            if limit[end]:
                radius = [
                    float(wavesweep.compile(nested(WAVES | {path: limit[end] * each})).spectral_radius())
                    for each in (inside, 2 - inside)
                ]
                assert radius[0] < 1 < radius[1]


def test_an_unstable_design_is_called_so_and_has_no_slowest_mode():
    found = verdict(WAVES | {"environment.K_VE": 900.0})
    assert not found["stable"]
    assert found["spectral_radius"] > 1
    assert found["slowest"] is None
    assert limit_of(found, "K_VE")["stable"] is False


def test_the_delay_may_grow_to_the_last_tick_that_is_stable():
    found = verdict(WAVES)["delay"]
    for delay, stable in ((found["most"], True), (found["most"] + 1, False)):
        changed = WAVES | {"environment.delay": delay}
        assert (wavesweep.compile(nested(changed)).spectral_radius() < 1) == stable


def test_direct_coupling_at_the_fast_rate_feels_the_wall_as_it_is():
    felt = verdict(values_of("dc", K_VE=300.0, B_VE=2.0))["felt"]
    assert felt["stiffness"] == pytest.approx(300.0, rel=1e-9)
    assert felt["damping"] == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize(("K", "B"), [(100.0, 0.01), (2000.0, 0.003), (5000.0, 0.2)])
@pytest.mark.parametrize("ratio", [1, 20])
def test_a_damping_far_below_the_stiffness_is_not_taken_for_none(K, B, ratio):
    tables = {"controller": {"kind": "dc"}, "environment": {"K_VE": K, "B_VE": B}, "device": {"damping": 10.0}}
    felt = wavesweep.verdict(tables | {"rates": {"fast_hz": 4000.0, "ratio": ratio}})["felt"]
    assert felt["damping"] == pytest.approx(B, rel=1e-4)


def with_a_slow_part(stiffness, damping, slow, seconds):
    """A wall with a part `slow/(seconds s + 1)`, N/m."""
    return {
        "rates": {"tick_hz": 1000},
        "block": {
            "arm": {"type": "mass", "mass": 0.44, "damping": 7.0},
            "creep": {"type": "tf", "num": [slow], "den": [seconds, 1.0]},
        },
        "wire": {"creep.u": "arm.x", "arm.f": f"hand - {stiffness}*arm.x - {damping}*arm.v - creep.y"},
        "ports": {
            "hand": {"force": "hand", "displacement": "arm.x", "reaction": f"{stiffness}*arm.x + {damping}*arm.v + creep.y"}
        },
    }


@pytest.mark.parametrize(
    ("stiffness", "slow", "seconds"), [(6800.0, 0.00831, 80.0), (680.0, 0.0831, 8.0), (50.0, 0.00831, 80.0)]
)
def test_a_slow_part_of_a_wall_is_felt(stiffness, slow, seconds):
    """It takes `slow seconds` of the damping. Above its own frequency looks at 1.5 N*s/m agree, better than those below."""
    damping = wavesweep.verdict(with_a_slow_part(stiffness, 1.5, slow, seconds))["felt"]["damping"]
    assert damping == pytest.approx(1.5 - slow * seconds, rel=2e-3)


def test_a_late_wall_is_felt_with_less_damping():
    """A force that is late by tau has the damping B - K tau: half a frame of hold here."""
    felt = verdict(values_of("dc-slow", K_VE=50.0, B_VE=3.0))["felt"]
    assert felt["damping"] == pytest.approx(3.0 - 50.0 * 0.0095, rel=2e-2)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_no_damping_is_felt_as_none():
    """Without a wall, and with the wall of an immediate coupling that has no damping, the impedance is real."""
    for K in (0.0, 500.0):
        felt = wavesweep.verdict({"controller": {"kind": "dc"}, "environment": {"K_VE": K, "B_VE": 0.0}})["felt"]
        assert (felt["stiffness"], felt["damping"], felt["rigid"]) == (K, 0.0, False)


@pytest.mark.slow
@pytest.mark.asks("simulation")
def test_the_slowest_mode_has_the_frequency_that_is_seen_within_the_frame():
    """The peak of the spectrum of the displacements after a pulse, once faster modes have gone.

    It is of the sampled damping of the waves, at 251 Hz. Seen once a frame, at 30.3 Hz, it is at 251.1 - 8*30.3 = 8.7 Hz.
    """
    spec = load(ROOT / "sweeps/examples/first-hour.toml").with_values({"b": 90.5})
    slowest = wavesweep.verdict(spec)["slowest"]
    ticks = int(10 * slowest["time_constant_s"] * spec.tick_hz)
    moved = np.diff(wavesweep.compile(spec).simulate(np.eye(1, ticks)[0], wall=None).x.to_numpy())[ticks // 2 :]
    frequency = np.fft.rfftfreq(moved.size, 1 / spec.tick_hz)
    # Of differences, which have no offset; over the frequency it is that of positions again.
    line = np.abs(np.fft.rfft(moved * np.hanning(moved.size)))
    found = frequency[1 + np.argmax(line[1:] / frequency[1:])]
    assert slowest["omega"] / (2 * np.pi) == pytest.approx(found, abs=2 * frequency[1])


def late(k, ticks, **numbers):
    """A level that is corrected by k times what it was so many ticks ago; the tick is 0.1 s."""
    return {
        "rates": {"tick_hz": 10},
        "numbers": {"k": k, "tau": 0.1 * ticks} | numbers,
        "block": {
            "level": {"type": "tf", "num": [1], "den": [1, 0]},
            "late": {"type": "delay", "seconds": "tau"},
            "hold": {"type": "hold"},
        },
        "wire": {"late.u": "level.y", "hold.u": "-k*late.y", "level.u": "hold.y"},
    }


@pytest.mark.slow
def test_a_dead_time_may_grow_up_to_where_its_eigenvalues_leave_the_circle(monkeypatch):
    monkeypatch.setattr(judging, "PIECES_OF_RANGE", 1e7)
    found = limit_of(wavesweep.verdict(late(0.9, 8)), "tau")
    assert found["certified"]
    assert (found["low"], found["stopped"]) == (None, True)  # the dead time of the own values to the first end, and no further
    inside, outside = (radius_of(with_numbers(late(0.9, 8), {"tau": found["high"] * share}), 0) for share in (0.9999, 1.0001))
    assert inside < 1 < outside
    assert found["to"] == pytest.approx(np.ceil(found["high"] / 0.1) * 0.1, rel=1e-12)


@pytest.mark.slow
def test_a_range_that_takes_long_ends_next_to_the_value(monkeypatch):
    monkeypatch.setattr(judging, "PIECES_OF_RANGE", 0)
    spec = load(late(0.02, 48))
    found = limit_of(wavesweep.verdict(spec), "tau")
    assert (found["stable"], found["certified"], found["stopped"]) == (True, True, True)
    assert (found["from"] <= 4.8 <= found["to"], found["to"] - found["from"]) == (True, pytest.approx(0.1))
    text = "\n".join(line for _, line in verdict_lines(spec, wavesweep.verdict(spec)))
    assert "--set sweep.along=tau --set 'sweep.tau={start=0.48, stop=48}'" in text


def test_a_range_that_would_cross_a_pole_ends_before_it():
    tables = {
        "rates": {"tick_hz": 100},
        "numbers": {"phi": 1.0},
        "block": {"lag": {"type": "tf", "num": [1], "den": [1, 1]}, "hold": {"type": "hold"}},
        "wire": {"hold.u": "-2/sin(phi)*lag.y", "lag.u": "hold.y"},
    }
    found = limit_of(wavesweep.verdict(tables), "phi")
    assert (found["stable"], found["certified"], found["low"], found["high"]) == (True, True, None, None)
    assert 0.98 * np.pi < found["to"] < np.pi
    decay = np.exp(-0.01)  # over a tick; a gain g makes it decay - g (1 - decay)
    assert decay - 2 / np.sin(found["to"]) * (1 - decay) > -1


def test_a_value_at_a_limit_is_not_in_what_is_stable():
    """`x' = (1 - 2 k) x` alternates for ever at k = 1."""
    sums = {"type": "tf", "num": [1], "den": [1, -1], "discrete": True}
    tables = {"rates": {"tick_hz": 1}, "numbers": {"k": 1.0}, "block": {"sum": sums}, "wire": {"sum.u": "-2*k*sum.y"}}
    found = wavesweep.verdict(tables)
    assert not found["stable"]
    assert limit_of(found, "k")["stable"] is False
    assert limit_of(found, "k")["intervals"] == [[0.1, pytest.approx(1.0, rel=1e-9)]]


def test_the_range_of_a_sweep_is_searched_as_well():
    drive = wavesweep.verdict(ROOT / "sweeps/templates/drive.toml")  # kp = 0.1, swept from 0.01 to 10
    limit = limit_of(drive, "kp")
    assert (limit["from"], limit["to"]) == (0.01, 10.0)
    assert limit["high"] == pytest.approx(2.88564, abs=1e-5)


@pytest.mark.parametrize("side", [-1, 1])
def test_what_is_searched_of_a_pose_ends_before_it_is_singular(side):
    """The far arm of a five-bar is stretched, 0.23 m long, where the motor is 0.03 m beside the middle and y = 0.15 m."""
    stretched = (0.23**2 - 0.15**2) ** 0.5 - 0.03
    spec = load(ROOT / "sweeps/templates/five-bar.toml", [f"x={side * 0.99 * stretched}"])
    value = spec.values["numbers.x"]
    low, high = judging._next_to(spec, "numbers.x", value, judging.searched(spec, "x", "numbers.x"))
    assert -stretched < low < value < high < stretched


def test_a_dead_time_of_zero_is_searched_up_to_the_tick_in_which_stability_ends():
    """An integrator `x + T u` whose `u = -k x` is n ticks late is stable up to `k T = 2 sin(pi/(4 n + 2))`: here n = 7 at most.

    What comes within a tick is used in the next one.
    """
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"k": 200.0, "L": 0.0},
        "block": {"p": {"type": "integrator"}, "late": {"type": "delay", "seconds": "L"}},
        "wire": {"late.u": "-k*p.y", "p.u": "late.y"},
    }
    spec = load(tables)
    limit = judging._limit(spec, "L", "numbers.L", judging.searched(spec, "L", "numbers.L"))
    assert limit["certified"]
    assert (limit["high"], limit["to"]) == pytest.approx((0.007, 0.008), rel=1e-9)


@pytest.mark.asks("simulation")
@pytest.mark.parametrize(("effect", "size", "word"), [("friction", 0.3, "friction"), ("resolution", 1e-4, "encoder")])
def test_what_a_simulation_adds_and_the_answers_leave_out_is_said(effect, size, word):
    plain = {"controller": {"kind": "dc"}, "simulate": {"friction": 0.0, "resolution": 0.0}}
    loops = [wavesweep.compile(plain), wavesweep.compile(plain | {"simulate": plain["simulate"] | {effect: size}})]
    one, other = (loop.simulate(np.ones(50))["x"].to_numpy() for loop in loops)
    assert abs(one - other).max() > 1e-3 * abs(one).max()
    assert len({float(loop.spectral_radius()) for loop in loops}) == 1
    assert word in walls_in_words(own_scope(loops[1].spec))


@pytest.mark.slow
def test_a_range_ends_where_its_key_does_or_before_a_pole_there(monkeypatch):
    """A share of a lowpass may be 1. A notch at half of its rate may not: what crowds towards it is left out."""
    from wavesweep.check.room_of_numbers import limits
    from wavesweep.prove import columns

    monkeypatch.setattr(columns, "prove_column", lambda *_, **__: pytest.fail("a proof in balls was asked for"))
    blocks = {
        "p": {"type": "mass", "mass": 1.0, "damping": 5.0},
        "low": {"type": "lowpass", "a": "a", "every": 2},
        "n": {"type": "notch", "frequency_hz": "fn", "q": 1.5, "depth": 0.2, "every": 2},
    }
    wires = {"low.u": "p.x", "n.u": "low.y", "p.f": "-20*n.y + hand"}
    tables = {"rates": {"tick_hz": 1000.0}, "numbers": {"a": 0.3, "fn": 100.0}, "block": blocks, "wire": wires}
    tables["ports"] = {"hand": {"force": "hand", "displacement": "p.x"}}
    share, notch = limits(load(tables))
    assert (share["to"], share["of_key"], share["high"]) == (1.0, [False, True], None)
    assert (notch["to"], notch["of_key"], notch["high"]) == (pytest.approx(249.85, rel=1e-6), [False, True], None)
    assert share["certified"]
    assert notch["certified"]


def test_what_the_answer_refutes_is_refuted_in_each_entry():
    """Nothing is known of walls that push while results are lost, but the linear wall is one of them, and is not stable."""
    tables = {
        "controller": {"kind": "dc-slow"},
        "environment": {"K_VE": 3000, "delay": 1},
        "for_all": {"contact": True, "lost": 2},
    }
    found = wavesweep.verdict(tables)
    assert found["answer"] == "no"
    assert found["contact"]["verdict"] == "refuted"
    assert found["contact"]["counterexample"]
