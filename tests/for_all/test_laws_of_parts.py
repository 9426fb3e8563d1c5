"""What proofs of [for_all] are made of, each by a law of its own."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.frames import plan_of_controller
from support.specs import values_of

import wavesweep
from wavesweep import SpecError
from wavesweep.engine._switched.folded import counted_from_rest, shift_of
from wavesweep.engine.frames import MarginalModes
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Side
from wavesweep.for_all import noise
from wavesweep.for_all.boxes import proved_stable
from wavesweep.for_all.frame_families import FramesInAnyOrder
from wavesweep.for_all.hand_box import box_in_words
from wavesweep.for_all.wall_frames import wall_frames
from wavesweep.program.analyses.claims import Status
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop


def ticks_that_keep(rest, E):
    """Changes of ticks, of which the first column lets each keep a shift of the first state with others that follow it."""
    return np.concatenate([-E @ rest[:, None], E], -1)


def test_states_counted_from_a_rest_follow_maps_of_their_own_and_bounds_hold_for_ticks_beside():
    r = np.random.default_rng(3)
    drift = MarginalModes(("a", "b", "c", "d"), (), (0,), ())
    rest, other = r.normal(size=(2, 4, 3)), 1e-9 * r.normal(size=(2, 4, 3))
    V = r.normal(size=3)
    E, moved = ticks_that_keep(V, rest), ticks_that_keep(V + 1e-9 * r.normal(size=3), rest + other)
    dE = np.abs(moved - E)
    found, dV = shift_of(E, dE, drift)
    counted, error = counted_from_rest(E[0], dE[0], found, dV, drift)
    x = r.normal(size=4)
    before, after = (each[1:] - V * each[0] for each in (x, x + E[0] @ x))
    np.testing.assert_allclose(after, before + counted @ before, rtol=1e-12)
    V_moved, _ = shift_of(moved, 0 * dE, drift)
    counted_moved, _ = counted_from_rest(moved[0], 0 * dE[0], V_moved, 0 * dV, drift)
    for one, two, bound in ((found, V_moved, dV), (counted, counted_moved, error)):
        assert (np.abs(one - two) <= bound).all()
        assert bound.max() < 1e-6


INTEGRATOR = {
    "rates": {"tick_hz": 1.0},
    "numbers": {"k": 1.0, "c": 1.0},
    "block": {"sum": {"type": "integrator"}},
    "wire": {"sum.u": "-k*c*sum.y"},
}


@pytest.mark.parametrize(("stop", "whole"), [(1.8, True), (3.0, False)])
def test_all_loops_of_a_box_are_proved_up_to_the_first_that_is_not_stable(stop, whole):
    """`0 < k c < 2` for c of 0.9 to 1.1."""
    ends, box = np.array([[0.5], [stop]]), np.array([[0.9], [1.1]])
    found = proved_stable(own_loop(load(INTEGRATOR)), [Side("numbers.k")], ends, ["numbers.c"], box, up=True)
    assert (found.whole, found.end if whole else np.prod(found.met) >= 2) == (whole, stop if whole else True)
    assert 1.5 < found.end < 2 / 1.1


def test_a_box_of_one_hand_has_the_intervals_of_that_hand():
    box = box_in_words("stiffness=300..300,mass=0.1..0.1,damping=3..3")
    assert box_in_words("mass=0.1..0.4,stiffness=0..3").word == "box:mass=0.1..0.4,damping=2..10,stiffness=0..3"
    tables = {"controller": {"kind": "dc-slow"}, "rates": {"ratio": 5}}
    hand = {"mass": 0.1, "damping": 3.0, "stiffness": 300.0}
    free, held = (own_loop(load(tables | {"operator": each})) for each in ({}, hand))
    (row,) = box.records_of(free, "environment.K_VE", (0.0, 2e4))
    assert (row["low"], row["settled"], row["certified"]) == (0, True, True)
    radii = [Loops(*held.changed({"environment.K_VE": row["high"] * (1 + side * 1e-8)}).read).radii()[0] for side in (-1, 1)]
    assert radii[0] < 1 < radii[1]
    assert {name: row[f"high_hand_{name}"] for name in hand} == hand


def test_walls_of_designs_are_ranked_by_the_frames_of_each_of_them():
    """Together they have the walls that each has alone, beyond which a short pattern of frames grows."""
    tables = {"controller": {"kind": "dc-slow"}, "for_all": {"rates.ratio": {"values": [4, 6], "varying": True}}}
    dampings = ((1.0, 0.0), (3.0, 1.0), (2.0, 0.0))  # of the device, and of the wall
    specs = [load(tables | {"device": {"damping": own}, "environment": {"B_VE": B}}) for own, B in dampings]
    ranking = specs[0].for_all.ranking(specs[0])
    limits = np.full(3, 1e4)
    together = ranking.stiffest(specs, "environment.K_VE", 1e4, limits)
    alone = [ranking.stiffest([spec], "environment.K_VE", 1e4, limits[:1])[0] for spec in specs]
    np.testing.assert_allclose(together, alone, rtol=1e-3)
    assert np.argsort(together).tolist() == [0, 2, 1]
    verdicts = [ranking.verdict(specs[1].with_values({"environment.K_VE": share * together[1]})) for share in (0.9, 1.1)]
    assert verdicts == ["proved", "refuted"]


@pytest.mark.parametrize(("kind", "sprung", "damped"), [("dc-slow", 0.0, True), ("pmw", 0.0, False), ("dc-slow", 300.0, True)])
def test_frames_without_a_wall_have_the_modes_of_the_loop_once_it_is_put_back(kind, sprung, damped):
    """Of constant frames of each length; a device that floats has its place as a state of its own."""
    K, B, ratios = 150.0, 2.0 * damped, (4, 7)
    keys = {"device": {"velocity": "difference"}, "operator": {"stiffness": sprung}}
    keys["environment"] = {"integration": "explicit", "delay": 1, "K_VE": K, "B_VE": B}
    values = values_of(kind, **{f"{table}.{name}": value for table, row in keys.items() for name, value in row.items()})
    wall = ["environment.K_VE", "environment.B_VE"][: 1 + damped]
    found = wall_frames(plan_of_controller(values, FramesInAnyOrder(ratios, (1,)), wall), wall)
    assert (found.drifts, found.names) == (sprung == 0, ("4 ticks", "7 ticks"))
    assert found.follows.tolist() == [[True, True]] * 2
    for ratio, change, rows in zip(ratios, found.changes, found.rows, strict=True):
        n = len(change) - 1
        read = K * np.append(rows[0, :n], found.drifts) + B * np.append(rows[1, :n], 0.0)
        force = read / (1 - K * rows[0, n] - B * rows[1, n])
        frame = np.eye(n + 1)
        frame[:, :n] += change[:, :n]
        modes = np.linalg.eigvals(frame + np.outer(change[:, n], force))
        exact = wavesweep.compile({"controller": {"kind": kind}, "rates": {"ratio": ratio}} | keys).poles()
        sizes = [np.sort(np.abs(each))[::-1] for each in (modes[modes != 1], exact.z_re + 1j * exact.z_im)]
        np.testing.assert_allclose(*(each[: n + found.drifts] for each in sizes), atol=1e-7)
    for error, of in ((found.changes_error, found.changes), (found.rows_error, found.rows)):
        assert (error >= 0).all()
        assert error.max() < 1e-12 * (1 + np.abs(of).max())


HELD = INTEGRATOR | {
    "numbers": {"k": 0.1, "n": 2, "c": 1.0},
    "block": {"sum": {"type": "integrator", "every": "n"}},
    "sweep": {"along": "k", "k": {"start": 0, "stop": 2}},
}
VARYING = {"values": [1, 2], "varying": True}


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"n": {"varying": True}}, "for_all.n: expected start and stop, or values, found neither"),
        ({"n": {"start": 1, "values": [1]}}, "for_all.n: expected either start and stop or values, found both"),
        (
            {"n": VARYING | {"shares": [1, 2], "next": [[1, 0], [0, 1]]}},
            "for_all.n: expected either shares or next, found both",
        ),
        ({"n": {"values": [1, 2], "shares": [1, 2]}}, "values and varying = true beside shares, found others"),
        ({"n": {"values": [2, 2]}}, "for_all.n: expected values that differ, found 2, 2"),
        ({"n": VARYING | {"next": [[1, 0]]}}, "for_all.n.next: expected 2 lists, one for each value"),
        ({"n": VARYING | {"next": [1, 0]}}, "for_all.n.next: expected 2 lists, one for each value"),
        (
            {"n": VARYING | {"shares": [[1, 0], [0, 1]]}},
            "for_all.n.shares: expected a list of 2 weights, found a list of lists",
        ),
        ({"n": VARYING | {"shares": [0, 0]}}, "for_all.n.shares: expected a weight above 0 in each list, found none"),
        ({"n": {"values": [*range(1, 66)], "varying": True}}, "expected at most 64 values of a number that varies"),
        ({"k": {"start": 1, "stop": 2}}, "for_all.k: expected a number that [sweep] does not have as well, found k"),
        ({"lost": 1}, "for_all.lost: expected no lost or loss beside a drawn loop"),
    ],
)
def test_what_a_number_may_be_is_said_in_one_line(asked, said):
    assert load(HELD | {"for_all": {"n": VARYING | {"shares": [1, 3]}}}).for_all
    with pytest.raises(SpecError) as refused:
        load(HELD | {"for_all": asked})
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("squares", "status", "reason"),
    [
        ([(0.1, 0.9), (0.2, 1.0)], Status.PROVED, ""),
        ([(0.1, 0.9), (0.5, 1.1)], Status.UNKNOWN, "between 0.5 and 1.1"),
        ([(0.5, 1.1), (1.2, 1.3)], Status.REFUTED, "1.2 with c = 2"),
    ],
)
def test_a_root_mean_square_is_judged_by_its_worst_case(monkeypatch, squares, status, reason):
    cases = [SimpleNamespace(fixed={"numbers.c": float(c)}, ranges=[], values=square) for c, square in enumerate(squares, 1)]
    bound = SimpleNamespace(at_most=1.0)
    monkeypatch.setattr(noise, "own_cases", lambda *_: cases)
    monkeypatch.setattr(noise, "rms_of", lambda _: bound)
    monkeypatch.setattr(noise, "RandomPorts", SimpleNamespace(of=lambda _rules, values, *_: values))
    monkeypatch.setattr(noise, "offered", lambda _: SimpleNamespace(root_mean_square=lambda ports: ports))
    assert noise._of_cases(SimpleNamespace(require=None), None) == (status, reason)
    cases[0].ranges = ["a range"]
    assert noise._of_case(None, cases[0], bound) == (0.0, np.inf)
