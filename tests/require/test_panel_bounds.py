"""Panels of a number and discs about eigenvalues: what they are judged by."""

from types import SimpleNamespace

import numpy as np
import pytest

import wavesweep
from wavesweep.engine.frames import Bounded
from wavesweep.require import factors, pencil
from wavesweep.require.between import Between
from wavesweep.require.by_discs import _LoopsInDiscs
from wavesweep.require.disc_panels import BAD, GOOD, HALF_RIM, OPEN
from wavesweep.require.discs import Spiral
from wavesweep.require.enclosed import _SlowMode, _with_slow_mode, mean_square
from wavesweep.require.frame_gain import _exceeds


@pytest.mark.parametrize(
    ("low", "high", "label"), [(0.4, 0.6, GOOD), (0.0, 0.2, OPEN), (0.8, 1.0, OPEN)], ids=["inside", "below", "above"]
)
def test_a_disc_that_leaves_what_is_known_leaves_its_panel_open(low, high, label):
    frames = lambda _column, p: SimpleNamespace(pivots=np.ones((p.size, 1)))  # noqa: E731 - one line among others
    errors = lambda _column, p: (np.full((p.size, 1, 1), -0.5, complex), np.full((p.size, 1, 1), 1e-15))  # noqa: E731
    family = SimpleNamespace(frames=frames, errors=errors)
    loops = _LoopsInDiscs(family, False, np.array([0]), 1, np.array([0]), Spiral(0.5))
    found = loops.label(np.array([0]), np.array([low]), np.array([high]), (np.array([0.0]), np.array([1.0])))
    assert found.tolist() == [label]


def test_a_panel_is_looked_at_where_the_loop_may_be_stable_and_bad_elsewhere():
    seen = []

    def labelled(_, low, high, __):
        seen.append((low.tolist(), high.tolist()))
        return np.full(low.size, GOOD)

    stable = SimpleNamespace(column=np.array([0, 0]), low=np.array([1.0, 6.0]), high=np.array([2.0, 8.0]))
    judge = SimpleNamespace(columns=np.array([0]), stable=stable, _labelled=labelled)
    panels = np.array([0.0, 2.5, 5.0]), np.array([1.5, 2.9, 9.0])
    assert Between.label(judge, np.zeros(3, int), *panels, None).tolist() == [GOOD, BAD, GOOD]
    assert seen == [([1.0, 6.0], [1.5, 8.0])]


def test_modes_in_a_disc_are_on_one_side_of_the_spiral_whatever_they_turn():
    r = np.random.default_rng(3)
    z = 10 ** r.uniform(-2, 0.3, (400, 1)) * np.exp(1j * r.uniform(-np.pi, np.pi, (400, 1)))
    turns = np.angle(z) + 2 * np.pi * r.integers(-1, 2, z.shape)
    spiral = Spiral(0.5, gone=0.05, ticks=5)

    def beyond(z, turns):
        return spiral.told(np.repeat(np.abs(turns)[..., None], 3, -1)).beyond(z - 1)

    own = beyond(z, turns)
    room = spiral.told(np.repeat(np.abs(turns)[..., None], 3, -1)).room(z - 1)
    assert (room > 0).mean() > 0.9
    for way in np.exp(2j * np.pi * np.arange(16) / 16):
        moved = z + 0.999 * np.maximum(room, 0) * way
        assert (beyond(moved, turns + np.angle(moved / z)) * own >= 0).all()


@pytest.mark.parametrize("arc", [(0.7, 2.1), (0.1, 3.0)])
def test_the_distance_from_an_arc_is_that_from_its_nearest_place(arc):
    r = np.random.default_rng(1)
    d = r.normal(size=300) + 1j * r.normal(size=300)
    angles = np.linspace(*arc, 4001)
    places = pencil._mapped(np.concatenate([angles, -angles]))
    nearest = np.abs(1 + d[:, None] - places).min(-1)
    assert pencil.off_arc(d[None], np.array([arc]))[0] == pytest.approx(nearest, abs=4e-3)


@pytest.mark.parametrize("turning", [False, True])
def test_what_is_shown_of_factors_holds_for_all_numbers_and_factors_of_a_piece(turning):
    """Of loops of two states and an input that change in proportion to the number, in doubles at many of both."""
    r, count, half = np.random.default_rng(2), 600, 0.3
    shapes = (2, 2), (2, 1), (1, 2), (1, 1)
    middle = [r.normal(size=(count, *shape)) * 0.5 for shape in shapes]
    middle[0] -= np.eye(2)
    slope = [r.normal(size=(count, *shape)) * 10 ** r.uniform(-3, -0.5, (count, 1, 1)) for shape in shapes]
    rim = np.append(0, 2 * HALF_RIM)[:, None, None]
    maps = [
        Bounded(a[:, None] + b[:, None] * rim, np.zeros((count, len(rim), *a.shape[1:])))
        for a, b in zip(middle, slope, strict=True)
    ]
    f, u, rest = factors.Range(-1.0, 1.0, turning).about(np.zeros(count), np.full(count, half))
    shown, *_ = factors.clear(maps, f, 1j if turning else 1.0, u, rest)
    assert 0.1 < shown.mean() < 0.9
    outside = []
    for p in (-1, -0.5, 0, 0.5, 1):
        own = [a + b * p for a, b in zip(middle, slope, strict=True)]
        for v in np.linspace(-half, half, 5):
            factor = np.full(count, np.exp(1j * v if turning else v))
            frames = np.eye(2) + factors._with_factor(*own, factor)[0]
            outside.append((np.abs(np.linalg.eigvals(frames[shown])) > 1).sum(-1))
    assert (np.array(outside) == outside[0]).all()


def test_a_gain_margin_along_a_dead_time_takes_few_pieces_of_the_factors(monkeypatch):
    """Small eigenvalues of a delay of four ticks have nearly the same vector."""
    monkeypatch.setattr(factors, "MOST_WORK", 1e6)
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"tau": 0.0045},
        "block": {"p": {"type": "mass", "mass": 0.2, "damping": 2.0}, "d": {"type": "delay", "seconds": "tau"}},
        "wire": {"d.u": "20*p.x", "p.f": "w - d.y"},
        "ports": {"inputs": {"w": "w"}, "outputs": {"x": "p.x"}},
    }
    wanted = {"margins": {"cut": "d.y", "gain": 3.0}}
    (row,) = wavesweep.compile(tables).stable_intervals("tau", (0.004, 0.005), require=wanted).itertuples()
    assert (row.low, row.high, row.certified) == (0.004, 0.005, True)


@pytest.mark.parametrize(("half_width", "beyond"), [(0.05, True), (0.2, False)])
def test_a_gain_is_too_large_only_where_it_is_on_all_of_the_panel(half_width, beyond):
    """The gain is the number itself, times that of a lag; at 0.8 of the middle it is below 0.9 of it."""
    numbers = 1 + 2 * half_width * np.append(0.0, HALF_RIM)[None, :, None, None]
    one = Bounded.exact(np.ones(numbers.shape))
    maps = (one * -0.5, one, Bounded.exact(numbers), one * 0.0)
    at_middle = 1 / abs(np.exp(1j) - 0.5)
    assert _exceeds(maps, 0.9 * at_middle, np.array([1.0])).tolist() == [beyond]


def test_a_mean_square_is_enclosed_whatever_entries_are_within_their_errors():
    """Noise through a frame, `sum |O A^k G|^2 + |T|^2`, of outputs that are off by all that they may be."""
    r = np.random.default_rng(4)
    E = r.normal(size=(1, 1, 3, 3)) * 0.1 - 0.6 * np.eye(3)
    G, O, T = r.normal(size=(1, 1, 3, 1)), r.normal(size=(1, 1, 1, 3)), r.normal(size=(1, 1, 1, 1))
    off = 1e-3 * np.abs(O)
    exact = (np.zeros_like(each) for each in (E, G, T))
    e, g, t = exact
    of_E, of_G, of_O, of_T = (Bounded(*pair) for pair in ((E + 0j, e), (G + 0j, g), (O + 0j, off), (T + 0j, t)))
    found = mean_square((of_E, of_G @ of_G.mT, of_O.mT @ of_O, of_T @ of_T.mT), 1)
    A, G, T = E[0, 0] + np.eye(3), G[0, 0], T[0, 0]
    for way in (-1, 1):
        output = (O + way * off * np.sign(O))[0, 0]
        powers = [np.linalg.matrix_power(A, k) @ G for k in range(400)]
        value = sum(((output @ each) ** 2).sum() for each in powers) + (T**2).sum()
        assert found.low[0] <= value <= found.high[0]
    assert found.high[0] < 1.1 * value


def test_outputs_beside_a_slow_mode_are_off_by_no_more_than_is_said():
    """A mode of 1 - 1e-4 and a turn by 0.9, of members whose entries are off by all that they may be, frame by frame."""
    r = np.random.default_rng(6)
    units = np.eye(3) + 0.2 * r.normal(size=(3, 3))
    turn = 0.9 * np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    A = units @ np.block([[np.eye(1) * (1 - 1e-4), np.zeros((1, 2))], [np.zeros((2, 1)), turn]]) @ np.linalg.inv(units)
    O, start = r.normal(size=(1, 3)), r.normal(size=(3, 1))
    points = np.ones((1, 1 + HALF_RIM.size, 1, 1))
    there, mode = _SlowMode.of(points * (A - np.eye(3)))
    assert there.tolist() == [0]
    shown = []
    seen = SimpleNamespace(look=lambda outputs: shown.append(outputs[0, 0, 0, 0].real), value=lambda rest: rest)
    for of_A, of_O, of_start in ((1e-9, 0.0, 0.0), (0.0, 1e-9, 0.0), (0.0, 0.0, 1e-9)):
        shown.clear()
        pairs = (A - np.eye(3), of_A), (O, of_O), (start, of_start)
        rest = _with_slow_mode(*(Bounded(points * each, points * size * np.abs(each)) for each, size in pairs), seen, mode)
        most = 0.0
        for _ in range(40):
            E, row, state = (each * (1 + size * r.choice([-1.0, 1.0], each.shape)) for each, size in pairs)
            for output in shown:
                most = max(most, abs((row @ state).item() - output))
                state = state + E @ state
        assert 1e-11 < most <= rest.off_so_far[0, 0]
