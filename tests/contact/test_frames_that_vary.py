"""Walls that push and never pull while frames vary: against a march of its own, and what is said."""

import math
import re
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from meaning.attacked import contradictions, growth
from meaning.members import Frame
from meaning.walls import judge_walls

import wavesweep
from wavesweep.capabilities import offered
from wavesweep.contact.coming_rests import _Rests, edges_of
from wavesweep.contact.on_check import facts
from wavesweep.contact.rows import records_in_frames, records_through_contact, refuse
from wavesweep.contact.rows_in_frames import in_frames
from wavesweep.contact.stored_check import Stored, _bernstein_coefficient, falls
from wavesweep.contact.stored_search import find_stored
from wavesweep.contact.verdict import of_wall
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import Bounded
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
    [(1, 140.14, 143.80, "a wall, in frames of 33"), (16, 74.30, 74.81, "the linear wall, frames ")],
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


@pytest.mark.parametrize(("lengths", "kind"), [(LENGTHS, "pmw"), ([19, 20, 21], "pmw"), (LENGTHS, "pmw-lm")])
def test_rests_of_waves_are_enclosed_for_frames_at_random(lengths, kind):
    """omega of long random sequences, by its recursion, lies in the hull of its node, though frames are
    known to a thousandth alone.

    A local model turns what it shrinks in a frame, and a set is held by several in a row alone.
    """
    spec = load(waves(lengths) | {"controller": {"kind": kind, "b": 10.0}})
    frames = in_frames(rules_of(spec), dict(spec.values), [K, B]).frames
    n = frames.changes.shape[-1] - 1
    errors = 1e-3 * np.abs(frames.changes)
    frames = replace(frames, changes_error=errors)
    edges = {(each.source, each.frame, each.target): each for each in edges_of(frames, 1, 2)}
    rng = np.random.default_rng(1)
    for _ in range(40):
        rest = np.zeros(n)
        word = rng.integers(0, len(lengths), 160)
        if rng.uniform() < 0.5:
            word = np.resize(word[: rng.integers(1, 4)], 160)
        for here, following in zip(word[-2::-1], word[::-1], strict=False):
            edge = edges[here, here, following]
            off = rng.choice([-1, 1]) * np.sign(np.append(rest, 1.0))
            moved = np.append(rest, 1.0) @ (frames.changes[here] + off[:, None] * errors[here])
            turned, rest = moved[n], rest + moved[:n]
        assert edge.turned[0] <= turned <= edge.turned[1]
        low, high = edge.vertices.min(0) - edge.errors, edge.vertices.max(0) + edge.errors
        assert (low <= rest).all()
        assert (rest <= high).all()


def test_the_rests_before_a_frame_hold_the_worst_of_all_errors():
    """Every corner of a set of rests, moved by a frame whose entries are off by all that they may."""
    rng = np.random.default_rng(2)
    rests = _Rests(np.array([-1, 0]), rng.normal(size=(2, 3)), rng.normal(size=(2, 3, 3)) * [1, 0.5, 0.1], rng.random((2, 3)))
    A = Bounded(rng.normal(size=(3, 3)), rng.random((3, 3)))
    step, pushed = (Bounded(rng.normal(size=n), rng.random(n)) for n in (3, 4))
    corners = np.array(list(product([-1, 1], repeat=6)))
    omega = rests.middle[:, None] + corners[:, :3] @ rests.G.mT + corners[:, 3:] * rests.errors[:, None]
    vertices, off = rests.hull(2)
    frames = SimpleNamespace(follows=np.ones((1, 1), bool))
    moved = rests.before(frames, 0, A.part(None), step.part(None, slice(None), None))
    for sign in (-1, 1):
        most = (sign * vertices).max(0) + off
        assert (sign * omega <= most).all()
        most = (sign * moved.middle + np.abs(moved.G).sum(2) + moved.errors)[:, None]
        worst = sign * (omega @ A.value.T + step.value) + np.abs(omega) @ A.error.T + step.error
        assert (worst <= most).all()
    turned = omega @ pushed.value[:3] + pushed.value[3]
    off = np.abs(omega) @ pushed.error[:3] + pushed.error[3]
    least, most = rests.turned(pushed)
    assert least <= (turned - off).min() < (turned + off).max() <= most


def test_the_check_refuses_forms_that_do_not_serve():
    """Forms of one wall at another, a weight below 0, and rests that move against a push."""
    spec = load(slow())
    loop = in_frames(rules_of(spec), dict(spec.values), [K, B])
    (found,) = loop.found((120.0, 1.0))
    walls = loop.wall(120.0, 1.0), loop.wall(150.0, 1.0)
    assert falls(loop.conditions, [(found, walls[0])])
    assert not falls(loop.conditions, [(found, walls[1])])
    assert not falls(loop.conditions, [(found, each) for each in walls])
    wall = loop.wall(20.0, 1.0)
    (soft,) = loop.found((20.0, 1.0))
    assert not loop.found((0.0, 1.0))  # without stiffness the device stays where it is put
    fall = [falls(loop.conditions, [(replace(soft, h=h), wall)]) for h in (0.0, -1e-6)]
    assert fall == [True, False]
    wall = loop.wall(120.0, 1.0)
    conditions = replace(loop.conditions, R=loop.conditions.R * -1.0)
    (found,) = find_stored(conditions, [wall])
    assert (np.linalg.eigvalsh(found.P) > 0).all()
    assert not falls(conditions, [(found, wall)])


@pytest.mark.parametrize("hand", [0.0, 200.0])
def test_the_condition_between_two_walls_is_a_polynomial_of_its_coefficients(hand):
    """F of walls, forms and weights that are a share between two, by Bernstein's sum of degree 3."""
    spec = load(slow(operator={"stiffness": hand}))
    loop = in_frames(rules_of(spec), dict(spec.values), [K, B])
    assert loop.frames.drifts == (hand == 0)
    walls = loop.wall(120.0, 1.0), loop.wall(60.0, 2.0)
    rng = np.random.default_rng(3)
    terms = [loop.conditions.terms(wall) for wall in walls]
    count, size, _ = terms[0].own.value.shape
    forms = []
    for each in rng.normal(size=(2, 1, size - 1, size - 1)):
        forms.append(Stored(each + each.mT, *rng.random(2), rng.random((count, len(terms[0].beside)))))
    parts = [_bernstein_coefficient(loop.conditions, forms, terms, k).value for k in range(4)]
    for s in (0.0, 0.3, 1.0):
        mean = [(1 - s) * np.array(a) + s * np.array(b) for a, b in zip(*walls, strict=True)]
        between = Stored(*((1 - s) * getattr(forms[0], of) + s * getattr(forms[1], of) for of in ("P", "g", "h", "beside")))
        own = [loop.conditions.terms(mean)]
        F = _bernstein_coefficient(loop.conditions, [between], own, 0).value
        summed = sum(math.comb(3, k) * s**k * (1 - s) ** (3 - k) * parts[k] for k in range(4))
        assert summed == pytest.approx(F, abs=1e-12)


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


def test_what_a_form_falls_by_is_what_its_inequalities_leave():
    """At states and forces at random, with weights of each edge."""
    spec = load(held_wall())
    loop = in_frames(rules_of(spec), dict(spec.values), list(spec.wall))
    wall = loop.wall(70.0, 3.0)
    terms = loop.conditions.terms(wall)
    rng = np.random.default_rng(8)
    count, size, _ = terms.own.value.shape
    P = rng.normal(size=(1, size - 1, size - 1))
    form = Stored(P + P.mT, *rng.random(2), rng.random((count, 2)))
    F = _bernstein_coefficient(loop.conditions, [form], [terms], 0).value
    for at, edge in enumerate(edges_of(loop.frames, 0, 2)):
        *z, u = rng.normal(size=size)
        *eta, x, v, u_before = z
        now = np.array([*eta, u])
        read = loop.frames.rows[edge.frame] @ now
        after = np.array([*(eta + loop.frames.changes[edge.frame, :-1] @ now), *read, u])
        f_before = wall[0] * x + wall[1] * v - u_before
        f = wall @ read - u
        g, a = form.beside[at]
        left = z @ form.P[0] @ z - after @ form.P[0] @ after - 2 * (form.g + g) * u * f
        left -= 2 * (form.h + a) * u * (f - f_before) + 2 * a * u_before * (f_before - f)
        assert np.array([*z, u]) @ F[at] @ [*z, u] == pytest.approx(left, rel=1e-9)


def test_what_is_stored_falls_in_a_march_of_frames_at_random():
    """With walls that begin late, rise steeply and have a limit; f with its force solves `f - d u = e' eta`."""
    spec = load(held_wall())
    loop = in_frames(rules_of(spec), dict(spec.values), list(spec.wall))
    assert not loop.found((451.0, 3.0))  # where a motion goes on
    (found,) = loop.found((400.0, 3.0))
    assert (found.beside[:, 1] > 0.01).any()
    stiffness, damping = loop.wall(400.0, 3.0)
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
            now = z @ found.P[0] @ z + 2 * found.h * stored(last)
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


def test_weights_below_zero_are_refused():
    spec = load(held_wall())
    loop = in_frames(rules_of(spec), dict(spec.values), list(spec.wall))
    wall = loop.wall(100.0, 3.0)
    (found,) = loop.found((100.0, 3.0))
    lighter = found.beside.copy()
    lighter.ravel()[lighter.argmin()] = -1e-12
    fall = [falls(loop.conditions, [(replace(found, beside=each), wall)]) for each in (found.beside, lighter)]
    assert fall == [True, False]


@pytest.mark.parametrize(
    ("stiffness", "said"),
    [(139.0, "proved"), (142.0, "unknown"), (144.0, "a wall, in frames of 33"), (150.0, "the linear")],
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
    at_one = "wavesweep.contact.rows_in_frames.falls"
    monkeypatch.setattr(at_one, lambda conditions, ends: len(ends) == 1 and falls(conditions, ends))
    (row,) = records_in_frames(*asked)
    assert (row["intervals"], row["certified"]) == (0, False)


@pytest.mark.parametrize("lengths", [[20, 33], [20, 40], [20, 25, 40]])
def test_a_force_moves_the_rest_of_waves_away_from_the_wall_where_frames_are_missed(lengths):
    """At a delay of a frame; the largest and the least that frames to come leave of it are those of some words."""
    spec = load(waves(lengths) | {"environment": {"integration": "explicit", "delay": "frame", "B_VE": 1.0}})
    frames = in_frames(rules_of(spec), dict(spec.values), [K, B]).frames
    n = frames.changes.shape[-1] - 1
    every = []
    for word in product(range(len(lengths)), repeat=5):
        rest = np.zeros(n)
        for frame in np.resize(word, 90):
            change = frames.changes[frame]
            turned = np.append(rest, 1.0) @ change[:, n]
            rest = rest + np.append(rest, 1.0) @ change[:, :n]
        every.append(turned)
    room = 0.45 * (max(every) - min(every))
    turned = [edge.turned for edge in edges_of(frames, 0, 2)]
    assert min(every) - room < min(least for least, _ in turned) <= min(every)
    assert max(every) <= max(most for _, most in turned) < min(0, max(every) + room)


def test_waves_behind_a_slow_amplifier_are_taken_where_frames_of_three_lengths_are_missed():
    """Rests are told apart by enough frames to come to see that each force moves them away from the wall."""
    tables = waves([17, 34, 51]) | {"filters": {"lp1": {"order": 1, "cutoff_hz": 4}}}
    tables["device"] = {"mass": 0.08, "damping": 0.6, "delay": 2, "velocity": "difference"}
    tables["environment"] = {"integration": "explicit", "delay": "frame", "B_VE": 1.0}
    spec = load(tables)
    loop = in_frames(rules_of(spec), dict(spec.values), [K, B])
    assert loop.conditions.are_met_by_rests


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
    with pytest.raises(UsageError, match="moves its rest away from it, as where results are lost"):
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
        "ports": {
            "wall": {"stiffness": "K", "damping": "Bw"},
            "hand": {"force": "push", "displacement": "x.x"},
        },
        "for_all": {"contact": True, "n": {"values": [3, 14], "varying": True}},
        "sweep": {"along": "K", "K": {"start": 0, "stop": 4000}},
    }


@pytest.mark.parametrize("share", [-1.0, 3.0])
def test_how_a_wall_is_written_does_not_change_what_is_proved(share):
    """With a minus before it, or in other units: the class is the same, and so is the loop."""
    walls = [(500.0, 1.0), (2400.0, 1.0), (100.0, 60.0)]
    found = []
    for each in (1.0, share):
        spec = load(drawn(each, 1.0))
        loop = in_frames(rules_of(spec), dict(spec.values), list(spec.wall))
        found.append([bool(loop.found(wall)) for wall in walls])
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
    """Waves with a stiff hand, two lengths of frames: single walls are proved from 2.6 N/m to the end of the range."""
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
