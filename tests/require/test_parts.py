"""Parts that decide what is required, each against a calculation that does not share it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from support.margin_cut import factors_of, largest, tables_with

from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.engine.frames import Bounded
from wavesweep.engine.loop import Loops
from wavesweep.program.analyses.claims import Status
from wavesweep.program.spec import load
from wavesweep.require.between import Between
from wavesweep.require.bound import Bound, words_of
from wavesweep.require.by_forms import ByForms
from wavesweep.require.damped import Damped
from wavesweep.require.disc_panels import BAD, GOOD, OPEN, _merged
from wavesweep.require.discs import RequiredCircle, Spiral, _radii, _with_others, eigenvectors
from wavesweep.require.factors import _room
from wavesweep.require.frame_gain import _units
from wavesweep.require.gain_bound import GainBound
from wavesweep.require.maps import _joined
from wavesweep.require.on_check import _along, _status, facts
from wavesweep.require.sines import Panel


def test_bounds_on_modes_stand_beside_those_on_gains_and_are_said():
    gain = GainBound("f_h", "x", 2.0)
    damped = Damped(0.4)
    assert Bound(gains=(gain,)).of_modes is None
    assert Bound(radius=0.9, gains=(gain,)).of_modes == Bound(radius=0.9)
    assert Bound(damped=damped, bounded=True, gains=(gain,)).on_radius is None
    assert Bound(radius=0.9, damped=damped).on_radius == Bound(radius=0.9)
    told = {"at_most": 2.0, "from": "f_h", "to": "x"}
    every = "every mode within 0.9 per frame"
    assert words_of({"radius": 0.9}, "frame") == every
    assert words_of({"damping_ratio": 0.4}, "frame") == damped.words()
    assert words_of({"radius": 0.9, "damping_ratio": 0.4}, "frame") == f"{every} and {damped.words()}"
    of_gain = "a gain of at most 2 from f_h to x in the energy of all ticks"
    assert words_of({"gain": told}, "frame") == f"stability and {of_gain}"
    at_cut = {"cut": "c.y", "gain": 2.0, "phase_deg": 40.0}
    said = "a gain margin of at least 2, up and down, and a phase margin of at least 40 deg at c.y"
    assert words_of({"radius": 0.9, "margins": at_cut}, "frame") == f"{every} and {said}"


@pytest.mark.parametrize(
    ("value", "certified", "status"),
    [
        (1.5, True, Status.CERTIFIED),
        (1.5, False, Status.UNKNOWN),
        (1.0, True, Status.UNKNOWN),  # an end that a mode sets
        (2.0, True, Status.CERTIFIED),  # the end of what is looked at
        (3.0, True, Status.REFUTED),
        (3.0, False, Status.UNKNOWN),
    ],
)
def test_a_design_has_what_its_row_shows_and_nothing_at_an_end(value, certified, status):
    row = {
        "low": 1.0,
        "high": 2.0,
        "low_omega": 5.0,
        "high_omega": np.nan,
        "open_low": 0.0,
        "open_high": 4.0,
        "certified": certified,
    }
    rows = {name: np.array([cell]) for name, cell in row.items()} | {"doubt": np.array(["" if certified else "search"])}
    assert _status(rows, value, [(1.0, 2.0)]) is status
    beside = rows | {"open_low": np.array([2.5]), "open_high": np.array([2.6])}  # what is open of a search that was given up
    assert _status(beside, value, [(1.0, 2.0)]) is (
        Status.UNKNOWN if value == 1 else Status.REFUTED if value == 3 else Status.CERTIFIED
    )


def test_panels_and_values_without_a_solution_leave_the_others_as_they_are():
    def judge(p):
        if (p == 2.0).any():
            raise IllPosedLoopError("none")

    def labelled(_column, low, _high, _bounds):
        judge(low)
        return np.full(low.size, GOOD)

    def worst_at(_column, p):
        judge(p)
        return p, p + 1

    between = SimpleNamespace(labelled=labelled, worst_at=worst_at)
    between._labelled = lambda *panels: Between._labelled(between, *panels)
    between.worst = lambda *values: Between.worst(between, *values)
    low = np.arange(5.0)
    assert between._labelled(np.zeros(5, int), low, low + 1, []).tolist() == [GOOD, GOOD, OPEN, GOOD, GOOD]
    np.testing.assert_equal(between.worst(0, low), ([0, 1, np.nan, 3, 4], [1, 2, np.nan, 4, 5]))


def test_discs_hold_the_eigenvalues_in_both_units_and_those_that_meet_in_a_row_are_together():
    r = np.random.default_rng(5)
    delta = r.normal(size=(300, 4)) + 1j * r.normal(size=(300, 4))
    entries = 10 ** r.uniform(-3, -0.5, (300, 4, 4))
    place = SimpleNamespace(room=lambda _: np.full(delta.shape, 0.4))
    moved = entries * np.exp(2j * np.pi * r.random(entries.shape))
    values = np.linalg.eigvals(moved + delta[:, None, :] * np.eye(4))
    for radius in _radii(delta, entries, place):
        assert (np.abs(values[:, :, None] - delta[:, None, :]) <= radius[:, None, :] * (1 + 1e-12)).any(-1).all()
    row = np.append(np.arange(7.0), 20.0)[None] + 0j  # each meets the next one alone
    assert _with_others(row, np.full((1, 8), 0.5), np.eye(8, dtype=bool)[:1]).tolist() == [[True] * 7 + [False]]
    sizes = r.uniform(0, 0.6, delta.shape)
    some = r.random(delta.shape) < 0.3
    for discs, size, first, found in zip(delta, sizes, some, _with_others(delta, sizes, some), strict=True):
        _, group = connected_components(np.abs(discs[:, None] - discs) <= size[:, None] + size)
        assert found.tolist() == np.isin(group, group[first]).tolist()


def test_room_is_the_least_distance_of_a_line_from_the_circle():
    r = np.random.default_rng(6)
    d = r.normal(size=(200, 3)) * 0.6 - 0.4 + 1j * r.normal(size=(200, 3)) * 0.6
    slope, u = r.normal(size=(200, 3)) * np.exp(1j * r.uniform(-np.pi, np.pi, (200, 3))), r.uniform(0, 0.8, (200, 1))
    sizes = np.abs(1 + d[..., None] + slope[..., None] * (u[..., None] * np.linspace(-1, 1, 4001)))
    crosses = (sizes.min(-1) < 1) & (sizes.max(-1) > 1)
    least = np.where(crosses, 0.0, np.abs(sizes - 1).min(-1))
    assert 0.1 < crosses.mean() < 0.9
    np.testing.assert_allclose(_room(d, slope, u), least, atol=1e-5)


def test_ticks_in_a_row_and_the_gain_of_a_sine_hold_for_entries_that_are_off_by_all_they_may_be():
    r = np.random.default_rng(7)
    shapes, off = [(1, 2, 2), (1, 2, 1), (1, 1, 2), (1, 1, 1)], 0.02
    ticks = [[r.normal(size=shape) * 0.4 for shape in shapes] for _ in range(2)]
    bounded = [[Bounded(each + 0j, np.full(each.shape, off)) for each in tick] for tick in ticks]
    joined = _joined(*map(tuple, bounded))
    theta = np.array([0.0, 0.3, 1.1, 2.9])
    panel = Panel(joined, 1.3, np.array([0, np.pi]), at_rest=False)
    middle, error = panel.both(theta, 1)[0][0], panel.error(theta)
    farthest = np.zeros(theta.size)
    for _ in range(200):
        (E_1, B_1, C_1, D_1), (E_2, B_2, C_2, D_2) = (
            [each[0] + off * r.choice([-1, 1], each[0].shape) for each in tick] for tick in ticks
        )
        A_1, A_2 = np.eye(2) + E_1, np.eye(2) + E_2
        wanted = (
            A_2 @ A_1 - np.eye(2),
            np.hstack([A_2 @ B_1, B_2]),
            np.vstack([C_1, C_2 @ A_1]),
            np.block([[D_1, 0 * D_1], [C_2 @ B_1, D_2]]),
        )
        for found, member in zip(joined, wanted, strict=True):
            assert (np.abs(found.value[0] - member) <= found.error[0] + 1e-15).all()
        nearby = Panel([Bounded.exact(each[None] + 0j) for each in wanted], 1.3, np.array([0, np.pi]), at_rest=False)
        farthest = np.maximum(farthest, np.abs(nearby.both(theta, 1)[0][0] - middle))
    assert (farthest > 0.05 * error).all()
    for angle, value in zip(theta, middle, strict=True):
        z = np.exp(1j * angle)
        E, G, O, T = (each.value[0] for each in joined)
        h = np.array([1, 1 / z]) @ (O @ np.linalg.solve((z**2 - 1) * np.eye(2) - E, G) + T) @ np.array([1, z]) / 2
        assert value == pytest.approx(1.3**2 - abs(h) ** 2, rel=1e-9)


def test_the_worst_factor_of_a_margin_is_that_of_own_matrices():
    spec = load(tables_with({"cut": "c.y", "phase_deg": 40.0}, (50.0, 900.0)))
    forms = ByForms(Loops(spec.drawing, dict(spec.values)), "numbers.kp", "c.y", "phase_deg", 40.0, (50.0, 900.0))
    for kp in (60.0, 800.0):
        growth, _ = forms._worst(*forms._with_factor, kp)
        assert growth == pytest.approx(np.log(largest(1.0, kp, factors_of("phase_deg", 40.0, 4001))), abs=1e-6)


def test_a_time_to_settle_is_a_radius_of_frames_and_ends_are_on_the_radius_or_the_spiral():
    """Of frames of 1 and of 4 ms; an eigenvalue below a tenth, or e^-2 of a mode that is as fast as 2 ms, is gone."""
    period = np.array([1e-3, 4e-3])
    bound = Bound(radius=0.9, times=(("settling", 0.05),))
    assert bound.radius_of(period) == pytest.approx([0.9, 50.0 ** (-4 / 50)])
    assert bound.over(2).radius_of(period) == pytest.approx([50.0 ** (-1 / 50), 50.0 ** (-4 / 50)])
    with pytest.raises(
        UsageError, match=r"sweep.require.settling: expected at least 0.00114 s where a frame takes 0.004 s, found 0.001"
    ):
        Bound(times=(("settling", 0.001),)).radius_of(period)
    spiral = replace(bound, damped=Damped(0.1, slower_than=2e-3, clocks=9.0))
    (ends,) = spiral.logarithms(period[1:], np.array([700.0]))
    assert np.exp(ends[0]) == pytest.approx(50.0 ** (-4 / 50) * np.exp(2.8j))
    slope = 0.1 / np.sqrt(0.99)
    turns = np.abs(2.8 + 2 * np.pi * np.arange(-3, 4))
    assert ends[1:].real == pytest.approx(np.maximum(-slope * turns, -2.0))
    assert 0 < (slope * turns > 2.0).sum() < 7
    z = np.array([0.5, 0.8]) * np.exp(2.8j)
    missed = spiral.beyond(z - 1, np.array([2.8, 2.8]), 4e-3)
    assert missed == pytest.approx(np.maximum(np.log(np.abs(z)) + np.log(50) * 4 / 50, np.log(np.abs(z)) + slope * 2.8))
    assert bound.beyond(z - 1, np.zeros(2), 4e-3) == pytest.approx(np.log(np.abs(z)) + np.log(50) * 4 / 50)
    assert Bound(bounded=True).beyond(z - 1, np.zeros(2), 4e-3) == pytest.approx(np.abs(z) - 1)


@pytest.mark.parametrize(
    ("bound", "refused"),
    [
        (Bound(times=(("settling", 1.0),)), "expected radius in its place, found settling"),
        (Bound(damped=Damped(0.5, slower_than=0.1)), "expected all modes, found slower_than"),
        (Bound(gains=(GainBound("f_h", "x", 1.0, (1.0, 5.0)),)), "expected a gain at all frequencies, found band_hz"),
        (Bound(radius=0.9, damped=Damped(0.5), gains=(GainBound("f_h", "x", 1.0, None),)), ""),
    ],
)
def test_along_a_rate_what_is_in_seconds_is_refused(bound, refused):
    if not refused:
        assert bound.refuse_rates("rates.fast_hz") is None
        return
    with pytest.raises(UsageError, match=rf"rates.fast_hz changes the time of a frame: {refused}; or list"):
        bound.refuse_rates("rates.fast_hz")


def test_modes_that_conserve_are_on_the_circle_where_each_is_alone_with_its_image():
    turn = np.exp(1j * np.array([0.5, 1.5, 2.5]))
    z = np.stack([turn, turn, turn, np.array([1.2, 1 / 1.2, 1j]), np.array([0.3, 0.5, 1j]), np.array([1.01, 1 / 1.01, 1j])])
    radius = np.array([[0.1] * 3, [0.4, 0.6, 0.1], [0.1, 0.1, 1.2], [0.01] * 3, [0.3, 0.3, 0.01], [0.015, 0.015, 0.01]])
    circle = RequiredCircle()
    found = circle.label(z - 1, radius, circle.room(z - 1))
    assert found.tolist() == [GOOD, OPEN, OPEN, BAD, GOOD, OPEN]
    apart = 2 * np.sin(0.5)
    assert circle.room(turn[None] - 1) == pytest.approx(np.full((1, 3), apart / 2.5))
    assert circle.room(np.array([[0.1, 5.0]]) - 1) == pytest.approx(np.array([[0.05, 4.9 / 2.5]]))
    rotation = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    held = np.block([[rotation, np.zeros((2, 1))], [np.ones((1, 2)), np.zeros((1, 1))]])  # a value that is held
    circle.refuse(held[None] - np.eye(3))
    with pytest.raises(UsageError, match="expected a loop that conserves"):
        circle.refuse(0.999 * rotation[None] - np.eye(2))


def test_eigenvalues_at_zero_have_vectors_that_are_apart():
    """Of a chain of three held values beside a mode at 0.5: eigenvectors of the chain would all be the same."""
    A = np.diag([1.0, 1.0, 0.0], 1) + np.diag([0.0, 0.0, 0.0, 0.5])
    A[0, 3] = 2.0
    delta, V = eigenvectors(A[None] - np.eye(4), 1e-3)
    assert np.sort(np.abs(1 + delta[0])) == pytest.approx([0, 0, 0, 0.5], abs=1e-9)
    assert np.linalg.cond(V[0]) < 20
    triangle = np.linalg.solve(V[0], A @ V[0])
    assert np.tril(triangle, -1) == pytest.approx(np.zeros((4, 4)), abs=1e-12)


def test_a_mode_of_a_negative_eigenvalue_needs_no_ratio_of_pairs_and_a_pair_must_not_become_real():
    spiral = Spiral(0.5, gone=1e-9, pairs=True, ticks=1)
    z = np.array([[-0.6, 0.9], [-0.6, -0.62], [-0.5 + 0.05j, -0.5 - 0.05j]])
    room = spiral.room(z - 1)
    assert room[0] == pytest.approx([0.4, 0.9 * -np.expm1(np.log(0.9) * np.sqrt(0.75))])
    assert spiral.label(z - 1, np.full((3, 2), 0.005), room).tolist() == [GOOD, GOOD, BAD]
    assert spiral.label(z - 1, np.full((3, 2), 0.03), room).tolist() == [GOOD, OPEN, BAD]
    assert room[2] == pytest.approx([0.05, 0.05])
    assert replace(spiral, pairs=False).label(z - 1, np.full((3, 2), 0.005), room).tolist() == [BAD, BAD, BAD]


def test_states_have_units_in_which_both_forms_are_alike_where_both_move_them():
    r = np.random.default_rng(3)
    G, Q = (np.apply_along_axis(np.diag, -1, 10.0 ** r.uniform(-9, 9, (5, 4))) for _ in range(2))
    G[0, 1, 1], Q[1, 2, 2] = 0.0, np.nan
    units = _units(-G, Q)
    alike = np.diagonal(G, axis1=-2, axis2=-1) / units**2, np.diagonal(Q, axis1=-2, axis2=-1) * units**2
    there = units != 1
    assert there.sum() == 18
    np.testing.assert_allclose(alike[0][there], alike[1][there])


DECAYS = {  # x' = -c K x, sampled each 0.1 s: z = 1 - c K/10 is within 0.9 for c K from 1 to 19
    "rates": {"tick_hz": 10},
    "numbers": {"c": 1.0, "K": 10.0},
    "block": {"x": {"type": "integrator"}},
    "wire": {"x.u": "-c*K*x.y"},
    "sweep": {"along": "K", "K": {"start": 0, "stop": 30}, "c": [1.0, 2.0], "require": {"radius": 0.9}},
}


@pytest.mark.parametrize(
    ("K", "c", "status", "reason"),
    [
        (10.0, 1.0, Status.CERTIFIED, ""),
        (0.5, 1.0, Status.REFUTED, "K = 0.5, met in "),
        (1.0, 1.0, Status.UNKNOWN, "K = 1 on an end, met in "),
        (9.7, 2.0, Status.REFUTED, "K = 9.7, met in "),
        (9.0, 3.0, Status.REFUTED, "K = 9, met in "),
    ],
)
def test_a_design_is_judged_by_the_rows_of_its_own_table_or_else_by_a_look_along_their_number(K, c, status, reason):
    spec = load(DECAYS | {"numbers": {"c": c, "K": K}})
    assert _along(spec) == "K"
    timed = {"numbers": {"n": 1, "c": c, "K": K}, "block": {"x": {"type": "integrator", "every": "n"}}}
    assert _along(load({name: table for name, table in (DECAYS | timed).items() if name != "sweep"})) == "c"  # n is a time
    ends = {"low": [1.0, 0.5], "high": [19.0, 9.5], "open_low": [np.nan] * 2, "open_high": [np.nan] * 2}
    swept = {name: np.array(column) for name, column in (ends | {"low_omega": [1.0, 1.0], "high_omega": [1.0, 1.0]}).items()}
    swept |= {"c": np.array([1.0, 2.0]), "certified": np.ones(2, bool), "doubt": np.array(["", ""])}
    for own in ({}, {"swept": swept}):
        found = facts(spec, own)
        (claim,) = found["claims"]
        assert claim.status is status
        assert claim.reason.startswith(reason)
        assert bool(claim.reason) == bool(reason)
        assert found["required"]["certified"]
        assert found["required"]["intervals"] == [pytest.approx((1 / c, 19 / c))]
        if own and c < 3:
            assert (found["required"]["from"], found["required"]["to"]) == (0, 30)
    unsure = swept | {"certified": np.zeros(2, bool), "doubt": np.array(["search", ""])}
    (claim,) = facts(spec, {"swept": unsure})["claims"]
    assert claim.status is (Status.UNKNOWN if c < 3 else status)
    assert ("which is not certified" in claim.reason) is (c < 3 and K != 1)


def test_panels_that_settle_within_a_gap_are_open_and_those_of_a_drift_at_the_low_end_too():
    """Ends are exact to 8; the larger label of two partitions holds, and the drift begins to show at 30."""
    accuracy = SimpleNamespace(of=lambda edges, _width: np.full(edges.size, 8.0), slow=1.0, begun=np.array([0.03]))
    domain = SimpleNamespace(width=1000.0, span=(0.0, 1000.0))
    edges = np.array([0.0, 20.0, 25.0, 100.0, 104.0, 104.9, 109.0, 200.0, 206.0, 208.0, 214.0, 300.0])
    first = np.array([GOOD, OPEN, GOOD, OPEN, GOOD, OPEN, GOOD, OPEN, GOOD, OPEN, BAD, GOOD])
    second = np.array([0.0, 110.0, 500.0]), np.array([GOOD, GOOD, OPEN])
    found, label = _merged(0, [(edges, first), second], domain, accuracy)
    assert found.tolist() == [0, 25, 100, 109, 200, 214, 300, 500]
    assert label.tolist() == [OPEN, GOOD, OPEN, GOOD, OPEN, BAD, GOOD, OPEN]
    wide = edges + np.where(edges > 206, 3.0, 0.0)  # a panel of 5 between others of 6 is no gap
    assert _merged(0, [(wide, first)], domain, accuracy)[1].tolist() == [OPEN, GOOD, OPEN, GOOD, OPEN, GOOD, OPEN, BAD, GOOD]
