"""Parts that decide what is required, each against a calculation that does not share it."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from support.margin_cut import factors_of, largest, tables_with

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.frames import Bounded
from wavesweep.engine.loop import Loops
from wavesweep.program.analyses.claims import Status
from wavesweep.program.spec import load
from wavesweep.require.between import Between
from wavesweep.require.bound import Bound, words_of
from wavesweep.require.by_forms import ByForms
from wavesweep.require.damped import Damped
from wavesweep.require.disc_panels import GOOD, OPEN
from wavesweep.require.discs import _radii, _with_others
from wavesweep.require.factors import _room
from wavesweep.require.gain_bound import GainBound
from wavesweep.require.maps import _joined
from wavesweep.require.on_check import _status
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
