"""Walls that push and never pull while frames vary: against a march of its own, and what is said."""

import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from meaning.attacked import contradictions, growth
from meaning.members import Frame
from meaning.walls import judge_walls

import wavesweep
from wavesweep.capabilities import offered
from wavesweep.checker import balls, contact
from wavesweep.checker.balls import Refused
from wavesweep.contact.on_check import facts
from wavesweep.contact.rows import records_in_frames, records_through_contact, refuse
from wavesweep.contact.rows_in_frames import InFrames, fit_frames
from wavesweep.contact.verdict import of_wall
from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses.claim_words import scope_in_words
from wavesweep.program.analyses.claims import PUSHES
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import loops_of

pytestmark = pytest.mark.asks("for_all")
K, B = "environment.K_VE", "environment.B_VE"
LENGTHS = [16, 20, 25, 33]


def slow(delay=1, **more):
    """A slow wall without waves, with frames in any order."""
    ratio = {"values": LENGTHS, "varying": True}
    return {
        "device": {"mass": 0.1, "damping": 1.5, "velocity": "difference"},
        "environment": {"delay": delay, "B_VE": 1.0, "K_VE": 120.0},
        "controller": {"kind": "dc-slow"},
        "for_all": {"contact": True, "rates.ratio": ratio},
        "sweep": {"K_VE": {"start": 0, "stop": 2000}},
    } | more


def waves(lengths):
    return {
        "device": {"velocity": "difference"},
        "environment": {"integration": "explicit", "delay": 1, "B_VE": 5.0, "K_VE": 100.0},
        "controller": {"kind": "pmw", "b": 10.0},
        "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
        "for_all": {"contact": True, "rates.ratio": {"values": lengths, "varying": True}},
        "sweep": {"K_VE": {"start": 0, "stop": 2000}},
    }


def rules_of(spec):
    return offered("rules").Rules.of(spec)


def rows_of(tables):
    spec = load(tables)
    return records_in_frames(rules_of(spec), loops_of(spec, dict(spec.values), K), K, (0.0, 2000.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("delay", "high", "refuted", "by"),
    [(1, 140.52, 143.80, "a wall, in frames of 33"), (16, 74.686, 74.81, "the linear wall, frames ")],
)
def test_no_march_goes_on_where_it_is_proved_and_one_does_where_the_nearest_of_both_refutes(delay, high, refuted, by):
    """What refutes is a motion, or the linear wall, one of the class, in a pattern of frames.

    The linear wall is proved to 146.9 N/m with a delay of a tick, where a motion refutes less.
    """
    (row,) = rows_of(slow(delay))
    assert row["certified"]
    assert row["high"] == pytest.approx(high, rel=5e-3)
    assert row["low"] < 1
    assert row["fails_from"] == pytest.approx(refuted, rel=1e-2)
    assert row["counterexample"].startswith(by)
    assert contradictions(slow(delay)) == []


def loop_of(tables):
    spec = load(tables)
    return fit_frames(rules_of(spec), dict(spec.values), list(spec.wall))


def test_the_check_refuses_forms_that_do_not_serve():
    """Forms of one wall at another, weights below 0, and frames that are known to 3 % alone."""
    loop = loop_of(slow())
    graph = loop.graphs[0]
    found = loop.found(graph, (120.0, 1.0))
    assert loop.serves(found)
    assert not loop.serves(replace(found, walls=((150.0, 1.0),)))
    assert not loop.found(graph, (0.0, 1.0))  # without stiffness the device stays where it is put
    assert not loop.serves(replace(found, stored=replace(found.stored, h=0.0)))
    rough = replace(loop.frames, changes_error=3e-2 * np.abs(loop.frames.changes))
    assert not replace(loop, frames=rough).serves(found)
    for weights in (replace(found.stored, h=-1e-6), replace(found.stored, weights=found.stored.weights - 1e-6)):
        with pytest.raises(Refused, match="not below 0"):
            loop.serves(replace(found, stored=weights))


def held_wall():
    """A wall whose force comes a sample late, before a mass on a spring."""
    return {
        "rates": {"tick_hz": 1000.0},
        "numbers": {"K": 400.0, "B": 3.0, "n": 1},
        "block": {
            "x": {"type": "mass", "mass": 0.3, "damping": 0.6, "stiffness": 6.0},
            "c": {"type": "hold", "every": "n"},
            "z": {"type": "delay", "steps": 1},
        },
        "wire": {"c.u": "K*x.x + B*x.v", "z.u": "c.y", "x.f": "push - z.y"},
        "ports": {"wall": {"stiffness": "K", "damping": "B"}, "hand": {"force": "push", "displacement": "x.x"}},
        "for_all": {"contact": True, "n": {"values": [1, 9, 11], "varying": True}},
        "sweep": {"K": {"start": 0, "stop": 900}},
    }


@pytest.mark.parametrize("hand", [0.0, 200.0])
def test_what_a_form_falls_by_is_what_its_inequalities_leave(hand):
    """At states and forces at random, with weights of each edge; a drift is in no part of it."""
    loop = loop_of(slow(operator={"stiffness": hand}))
    assert loop.samples.drifts == (hand == 0)
    K, B = 60 * loop.unit, 2 * loop.unit
    rng = np.random.default_rng(8)
    n = loop.frames.changes.shape[-1] - 1
    h, g, a = 0.5, 0.0 if hand == 0 else 0.25, 0.125
    P, after = (each + each.T for each in rng.integers(-9, 9, (2, n + 3, n + 3)))
    forms = [[[int(x) << balls.BITS for x in row] for row in each] for each in (P, after)]
    for frame, sampled in enumerate(loop._sampled(Fraction(K), Fraction(B))):
        F = contact.left_over_of(sampled, *forms, tuple(map(Fraction, (h, g, a)))).parts[()]
        *z, u = rng.normal(size=n + 4)
        *eta, x, v, u_before = z
        p = rng.normal() if hand == 0 else 0.0
        now = np.array([*eta, u])
        read = loop.frames.rows[frame] @ now + [p, 0.0]
        moved = loop.frames.changes[frame] @ now
        following = np.array([*(eta + moved[:n]), read[0] - p - moved[n], read[1], u])
        f_before, f = K * (x + p) + B * v - u_before, K * read[0] + B * read[1] - u
        fallen = z @ P @ z - following @ after @ following - g * f * u
        fallen -= (h + a) * u * (f - f_before) + a * u_before * (f_before - f)
        whole = np.array([*z, u])
        assert whole @ (np.array(F, float) / balls.ONE) @ whole == pytest.approx(fallen, rel=1e-9)


def test_what_is_stored_falls_in_a_march_of_frames_at_random():
    """With walls that begin late, rise steeply and have a limit; f with its force solves `f - d u = e' eta`."""
    loop = loop_of(held_wall())
    assert not loop.found(loop.graphs[0], (451.0, 3.0))  # where a motion goes on
    found = loop.found(loop.graphs[0], (400.0, 3.0))
    assert (found.stored.weights > 1e-6).any()
    stiffness, damping = 400 * loop.unit, 3 * loop.unit
    ((L,),) = found.stored.L
    frames = loop.frames
    n = frames.changes.shape[-1] - 1
    rng = np.random.default_rng(5)
    for steep, start, limit in ((0.5, 0.0, np.inf), (40.0, 0.2, 3.0), (1e4, 0.0, 1.0)):

        def force(f, steep=steep, start=start, limit=limit):
            return min(limit, steep * max(0.0, f - start))

        def stored(f, steep=steep, start=start, limit=limit):
            """The integral of the force."""
            way = max(0.0, f - start)
            risen = min(way, limit / steep)
            return steep * risen**2 / 2 + (limit * (way - risen) if way > risen else 0.0)

        z = np.append(rng.normal(size=n), [0.0, 0.0, 0.0])
        before = np.inf
        for _ in range(60):
            frame = rng.integers(len(frames.follows))
            rows = frames.rows[frame]
            e = stiffness * rows[0] + damping * rows[1]
            low, high = -1e9, 1e9
            for _ in range(120):
                middle = (low + high) / 2
                low, high = (middle, high) if middle - (e[n] - 1) * force(middle) < e[:n] @ z[:n] else (low, middle)
            own = np.append(z[:n], force(low))
            last = stiffness * z[n] + damping * z[n + 1] - z[n + 2]
            now = np.square(L @ z).sum() + found.stored.h * stored(last)
            assert now <= before * (1 + 1e-9)
            before = now
            z = np.concatenate([z[:n] + frames.changes[frame][:n] @ own, rows @ own, own[n:]])


@pytest.mark.slow
def test_a_wall_before_a_spring_is_proved_from_soft_to_stiff():
    """Without the wall's last sample it was proved from 120 to 199 N/m."""
    spec = load(held_wall())
    (row,) = records_in_frames(rules_of(spec), loops_of(spec, dict(spec.values), "numbers.K"), "numbers.K", (0.0, 900.0))
    assert row["low"] < 1
    assert 0.97 * row["fails_from"] < row["high"] < row["fails_from"] == pytest.approx(450.136, rel=1e-5)


@pytest.mark.parametrize(
    ("stiffness", "said"), [(139.0, "proved"), (142.0, "unknown"), (144.0, "a wall, in frames of 33"), (150.0, "the linear")]
)
def test_the_verdict_on_a_wall_while_frames_vary(stiffness, said):
    """Proved by forms that know the next frame; the nearest of what refutes is a motion, and farther on
    a pattern of frames, in which a march grows."""
    tables = slow()
    tables["environment"]["K_VE"] = stiffness
    spec = load(tables)
    told = facts(spec)
    found = told["contact"]
    assert (found["counterexample"] or found["verdict"]).startswith(said)
    (claim,) = told["claims"]
    assert claim.status.name.lower() == found["verdict"]
    assert f"16, 20, 25, 33 ticks in any order with {PUSHES}" in scope_in_words(claim.scope)
    if said == "the linear":
        word = tuple(Frame(int(each), 1) for each in found["counterexample"].rpartition("frames ")[2].split(", "))
        assert growth(tables, word) > 1


def test_a_row_while_frames_vary_is_what_single_walls_are(monkeypatch):
    """And nothing, if what lies between these is not proved."""
    tables = slow()
    tables["for_all"]["rates.ratio"]["values"] = [16, 33]
    spec = load(tables)
    asked = rules_of(spec), loops_of(spec, dict(spec.values), K), K, (90.0, 200.0)
    (row,) = records_in_frames(*asked)
    assert row["low"] == 90
    assert 139.5 < row["high"] < 141
    assert row["fails_from"] == pytest.approx(143.8, rel=1e-3)
    assert row["counterexample"].startswith("a wall, in frames of 33 ticks")
    assert not row["settled"]
    assert re.fullmatch(r"within environment.K_VE 1[34]\d\.?\d* to 143\.[89]", row["left_open"])
    monkeypatch.setattr(InFrames, "serves", lambda _, piece: len(piece.walls) == 1)
    (row,) = records_in_frames(*asked)
    assert (row["intervals"], row["certified"]) == (0, False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lengths", "delay", "proved", "word", "unstable"),
    [(LENGTHS, 1, 95.0, (16, 16, 33, 33, 16), 200.0), ([20, 40], "frame", 60.0, (20,) * 4 + (40,) * 4, 80.0)],
)
def test_waves_are_proved_while_frames_vary(lengths, delay, proved, word, unstable):
    """At most of the linear wall's 116.5 and 77 N/m."""
    tables = waves(lengths)
    tables["environment"] |= {"B_VE": 0.0, "K_VE": proved, "delay": delay}
    spec = load(tables)
    assert of_wall(spec, rules_of(spec))["verdict"] == "proved"
    (found,) = judge_walls(tables, tables, {"high": proved, "counterexample": ""}, np.random.default_rng(0))
    assert found.same, found
    assert growth(tables, tuple(Frame(ticks, delay) for ticks in word), K_VE=unstable) > 1


def test_a_wall_whose_force_may_be_lost_is_refused_with_its_reason():
    tables = slow()
    tables["for_all"] |= {"lost": 1}
    with pytest.raises(UsageError, match="one whose results may be lost"):
        refuse(load(tables), K)


def drawn(share, first):
    """A mass before a wall that reads `share` times its place, by which its force is divided."""
    return {
        "rates": {"tick_hz": 1000.0},
        "numbers": {"K": 40.0, "Bw": 1.0, "n": 3, "share": share},
        "block": {
            "x": {"type": "mass", "mass": first, "damping": 15.0},
            "dv": {"type": "difference", "every": "n"},
            "c": {"type": "hold", "every": "n"},
        },
        "wire": {"dv.u": "x.x", "c.u": "share*(K*x.x + Bw*dv.y)", "x.f": "push - c.y/share"},
        "ports": {"wall": {"stiffness": "K", "damping": "Bw"}, "hand": {"force": "push", "displacement": "x.x"}},
        "for_all": {"contact": True, "n": {"values": [3, 14], "varying": True}},
        "sweep": {"along": "K", "K": {"start": 0, "stop": 4000}},
    }


@pytest.mark.parametrize("share", [-1.0, 3.0])
def test_how_a_wall_is_written_does_not_change_what_is_proved(share):
    """With a minus before it, or in other units: the class is the same, and so is the loop."""
    walls = [(500.0, 1.0), (2400.0, 1.0), (100.0, 60.0)]
    found = []
    for each in (1.0, share):
        loop = loop_of(drawn(each, 1.0))
        found.append([bool(loop.found(loop.graphs[1], wall)) for wall in walls])
    assert found[0] == found[1] == [True, False, True]


def test_numbers_in_a_list_alone_are_loops_of_constant_frames():
    """Their rows are what each value has as the spec's own number, and `check` knows the same."""
    ends = []
    for stiffness in (100.0, 300.0):
        tables = waves([20]) | {"operator": {"stiffness": stiffness}, "for_all": {"contact": True}}
        spec = load(tables)
        (row,) = records_through_contact(loops_of(spec, dict(spec.values), K), K, (0.0, 2000.0))
        ends.append(row["high"])
    for values in ([100.0], [100.0, 300.0]):
        tables = waves([20]) | {"for_all": {"contact": True, "operator.stiffness": values}}
        (row,) = rows_of(tables)
        assert row["high"] == pytest.approx(min(ends[: len(values)]), rel=1e-3)
    tables["environment"]["K_VE"] = 0.99 * row["high"]
    assert of_wall(load(tables), rules_of(load(tables)))["verdict"] == "proved"


@pytest.mark.slow
def test_a_row_goes_down_in_pieces_as_small_as_its_proofs_are():
    tables = slow(rates={"ratio": 10}, environment={"delay": 1, "B_VE": 0.0})
    frames = {"values": [4, 10, 18], "varying": True}
    delays = {"values": [1, 2], "varying": True}
    tables["for_all"] = {"contact": True, "rates.ratio": frames, "environment.delay": delays}
    (row,) = rows_of(tables)
    assert 138 < row["high"] < 141.05 < row["fails_from"] < 145
    assert row["low"] <= 1e-3 * row["high"]


@pytest.mark.slow
def test_a_row_whose_forms_only_just_serve_at_its_end_is_no_sliver():
    """Waves with a stiff hand, two lengths of frames: single walls are proved from 2.6 N/m to the end of the range. Forms of a
    wall that is only just proved may serve at no other, so a search down from there could stop at once. It goes to a thousandth
    of the end."""
    tables = {
        "rates": {"ratio": 16},
        "device": {"mass": 0.23, "damping": 3.06, "velocity": "difference"},
        "environment": {"B_VE": 0.0, "integration": "trapezoidal", "delay": 1},
        "controller": {"kind": "pmw", "b": 10.0, "Kp": 8.07},
        "operator": {"mass": 0.234, "damping": 2.25, "stiffness": 170.0},
        "filters": {"lp1": {"order": 1, "cutoff_hz": 3.0}},
        "for_all": {"contact": True, "rates.ratio": {"values": [12, 16], "varying": True}},
        "sweep": {"K_VE": {"start": 0, "stop": 26000}},
    }
    rows = wavesweep.zwidth(tables)
    (row,) = rows[rows["guarantee"] == "contact"].itertuples()
    assert row.settled
    assert row.low < 30
    assert row.high == 26000
