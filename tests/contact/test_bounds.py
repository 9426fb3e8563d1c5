"""Parts of contact against calculations of their own: units, reaches of multipliers, motions, and what rows record."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.contact.test_proof import SLOW, any_multiplier, sampled_device, wall_loop
from wavesweep.contact import rows, stretches, verdict
from wavesweep.contact.motions import motion_at
from wavesweep.contact.multipliers import LAGS, Sampled
from wavesweep.contact.rows import LINEAR, Row
from wavesweep.contact.stored_search import WallSamples
from wavesweep.contact.stretches import Line, Piece, pieces_of
from wavesweep.contact.wall_loop import WallsAlong
from wavesweep.program.tables.refuters import Refuters


@pytest.mark.parametrize("drifts", [False, True])
def test_units_change_no_product(drifts):
    """Frames keep their eigenvalues, and what is read its product with what is moved."""
    random = np.random.default_rng(2)
    spread = 10.0 ** random.uniform(-4, 4, 3)
    moved = random.normal(size=(2, 3, 4)) * 0.1 * np.append(spread, 1.0) / spread[:, None]
    read = random.normal(size=(2, 2, 4)) * np.append(spread, 1.0)
    slide = random.normal(size=(2, 4)) * np.append(spread, 1.0) * drifts
    frames = WallSamples(moved, read, slide, drifts, np.ones((2, 2), bool))
    scaled, units, unit = frames.in_units()
    for ours, theirs in zip(scaled.moved[:, :, :3], moved[:, :, :3], strict=True):
        np.testing.assert_allclose(np.poly(ours), np.poly(theirs), rtol=1e-9, atol=1e-12)
    products = [each.read[:, :, :3] @ each.moved[:, :, 3:] for each in (scaled, frames)]
    np.testing.assert_allclose(products[0] * unit, products[1], rtol=1e-12)
    np.testing.assert_allclose(scaled.moved[:, :, 3] * units, moved[:, :, 3], rtol=1e-12)
    assert abs(scaled.moved[:, :3, 3]).max() < 10


@pytest.mark.parametrize(("index", "fixed"), [(0, 1.5), (1, 60.0)])
def test_a_multiplier_reaches_as_far_as_it_serves_and_a_motion_is_one_of_the_loop(index, fixed):
    """By the sampled mass alone: `1 + L` is `1 - K x - B v` of the responses to the wall's force."""
    walls = WallsAlong(wall_loop(SLOW), index, fixed)
    A, b = sampled_device()

    def opened(value, angles):
        K, B = (value, fixed) if index == 0 else (fixed, value)
        z = np.exp(1j * angles)
        x, v = np.linalg.solve(z[:, None, None] * np.eye(2) - A, np.broadcast_to(-b[:, None] + 0j, (angles.size, 2, 1)))[
            ..., 0
        ].T
        return 1 - K * x - B * v

    sampled = Sampled.of(walls.loop, np.array([1.234, 4.0]))
    assert 1.234 in sampled.angles
    assert sampled.angles.max() <= np.pi
    (wall,) = walls.at(2.0)
    assert sampled.opened(wall) == pytest.approx(opened(2.0, sampled.angles), rel=1e-6)
    rng, limited, places = np.random.default_rng(4), 0, np.linspace(-50, 400, 91)
    for _ in range(20):
        multiplier = any_multiplier(rng)
        least = [(multiplier.at(sampled.angles) * opened(value, sampled.angles)).real.min() for value in places]
        low, high = sampled.reach(multiplier, walls)
        serves = places[np.array(least) > 0]
        if serves.size and -45 < low < high < 395:
            limited += 1
            assert low < serves[0] < low + 5.001
            assert high - 5.001 < serves[-1] < high
    assert limited > 3
    best, margin = sampled.multiplier(walls.at(1.0, 3.0))
    shares = []
    for wall in walls.at(1.0, 3.0):
        lifted = opened(wall[index], sampled.angles)
        sizes = 1 + np.abs(sampled.responses) @ wall + wall[0] * abs(sampled.residue)
        shares.append((best.at(sampled.angles) * lifted).real / np.minimum(np.abs(lifted), sizes))
    assert np.min(shares) == pytest.approx(margin, rel=1e-4)
    assert margin > 0
    assert best.before.size == best.after.size == LAGS
    assert min(best.before.min(), best.after.min()) >= 0
    assert best.before.sum() + best.after.sum() < 1
    motion = motion_at(walls, 900.0 if index == 0 else 40.0)
    period = motion.force.size
    turns = 2 * np.pi * np.arange(1, period) / period
    parts = np.fft.fft(motion.reading - motion.force)[1:] / np.fft.fft(motion.force)[1:]
    shown = np.abs(np.fft.fft(motion.force)[1:]) > 1e-3 * period
    assert parts[shown] == pytest.approx(-opened(motion.value, turns)[shown], rel=1e-6)
    assert motion.push == pytest.approx(motion.force.mean())
    order = np.argsort(motion.reading)
    rise = np.diff(motion.force[order])
    assert ((rise >= 0) & (rise <= np.diff(motion.reading[order]))).all()
    assert motion_at(walls, 1.0) is None


@pytest.mark.parametrize(
    ("interval", "motion", "expected"),
    [
        ((0.0, 100.0), None, (0.0, 99.98, np.nan, 100.0, LINEAR)),  # to the end of the linear loop
        ((0.0, 100.0), 120.0, (0.0, 99.98, np.nan, 120.0, "a wall")),
        ((0.0, 500.0), None, (0.0, 500.0, np.nan, np.nan, "")),  # to the end of what is looked at
        ((10.0, 500.0), None, (10.098, 500.0, 10.0, np.nan, "")),
    ],
)
def test_a_row_is_a_stretch_in_a_linear_interval_and_what_refutes_beyond_it(monkeypatch, interval, motion, expected):
    line = SimpleNamespace(walls=None, stretch=lambda low, high: SimpleNamespace(low=low, high=high))

    class Found:
        value = motion

        def __str__(self):
            return "a wall"

    monkeypatch.setattr(rows, "motion_beyond", lambda _walls, end, _limit: Found() if motion and end > 50 else None)
    row = rows._row(line, interval, (0.0, 500.0))
    low, high, below, beyond, said = expected
    assert row[:4] == pytest.approx((low, high, below, beyond), nan_ok=True)
    assert row.refuters == Refuters(LINEAR if interval[0] else "", said)
    line.stretch = lambda _low, _high: None
    assert rows._row(line, interval, (0.0, 500.0)) is None


def test_records_say_what_is_open_and_why_there_is_nothing():
    span = (0.0, 500.0)
    settled = Row(10.0, 100.0, 9.5, 100.9, Refuters("b", "c"))
    wide = Row(10.0, 100.0, np.nan, 101.1, Refuters("", "c"))
    ends = Row(0.0, 500.0, np.nan, np.nan, Refuters("", ""))
    found = rows._recorded([settled, wide, ends], "", span, "numbers.wall.K")
    assert found["low"].tolist() == [10, 10, 0]
    assert found["high"].tolist() == [100, 100, 500]
    np.testing.assert_equal(found["fails_below"], [9.5, np.nan, np.nan])
    np.testing.assert_equal(found["fails_from"], [100.9, 101.1, np.nan])
    assert found["settled"].tolist() == [True, False, True]
    assert found["left_open"].tolist() == ["", "within wall.K 0 to 10 and 100 to 101.1", ""]
    assert found["certified"].all()
    (nothing,), (refuted,) = rows._recorded([], "", span), rows._recorded([], "unstable", span)
    assert [(row["intervals"], row["certified"], row["doubt"] > 0, row["settled"]) for row in (nothing, refuted)] == [
        (0, False, True, False),
        (0, True, False, True),
    ]
    assert refuted["counterexample"] == "unstable"


def test_a_stretch_is_of_pieces_from_the_first_end_that_is_proved_downwards(monkeypatch):
    """A proof reaches down by 50 at most, and not above 95: after 97 of 100 the first piece begins at 90."""
    asked = []

    def proved(_line, low, high, *, whole=True):
        asked.append((low, high))
        if high > 95 or (whole and high - low > 50):
            return None
        return Piece(max(low, high - 50), high, None)

    monkeypatch.setattr(stretches, "motion_beyond", lambda *_: None)
    monkeypatch.setattr(Line, "proved", proved)
    monkeypatch.setattr(Line, "_seed", lambda *_: 10.0)
    monkeypatch.setattr(Line, "end", lambda _line, _seed, limit: limit)
    found = Line(None, None).stretch(0.0, 100.0)
    assert [(piece.low, piece.high) for piece in found.pieces] == [(40.0, 90.0), (0.0, 40.0)]
    assert (found.low, found.high) == (0.0, 90.0)
    assert [high for _, high in dict.fromkeys(asked)] == pytest.approx([100, 99.9, 99.7, 99, 97, 90, 40])
    monkeypatch.setattr(stretches, "motion_beyond", lambda *_: SimpleNamespace(value=45.0))
    (whole,) = Line(None, None).stretch(5.0, 100.0).pieces
    assert (whole.low, whole.high) == (5.0, pytest.approx(5 + 0.998 * 40))  # next to a motion that goes on
    device = np.array([[0.5, 0.1, 0.2], [0.0, 0.3, 0.4]]), np.ones((2, 3)), 0.01, (0, 1.0)
    for top, expected in ((90.0, found.pieces), (96.0, ())):
        assert [(piece.low, piece.high) for piece in pieces_of(*device, (0.0, top))] == [
            (each.low, each.high) for each in expected
        ]


def test_an_end_is_as_near_to_where_multipliers_cease_to_serve_as_is_asked():
    """From either side: one of a value serves 3 beyond it, and none serves beyond 123.4 or below 17."""
    sampled = SimpleNamespace(reach=lambda value, _walls: (max(value - 3, 17.0), min(value + 3, 123.4)))
    sampled.multiplier = lambda value: (value, 1.0 if 17 <= value <= 123.4 else -1.0)
    line = Line(SimpleNamespace(at=float), sampled)
    assert line.end(60.0, 500.0) == pytest.approx(123.4, rel=1e-2)
    assert line.end(60.0, 500.0) <= 123.4
    assert 17 <= line.end(60.0, 0.0) < 19
    assert line.end(60.0, 62.0) == 62.0


@pytest.mark.parametrize(
    ("unstable", "proved", "radius", "motion", "expected"),
    [
        (None, True, 0.5, "", ("unknown", "")),  # no loop of one wall
        (True, True, 0.5, "", ("refuted", "no contact at all: it grows")),
        (False, True, 2.0, "a wall", ("proved", "")),
        (False, False, 1.1, "a wall", ("refuted", LINEAR)),
        (False, False, 1.0, "a wall", ("refuted", "a wall")),
        (False, False, 0.9, "", ("unknown", "")),
    ],
)
def test_a_verdict_is_a_proof_or_else_what_refutes(monkeypatch, unstable, proved, radius, motion, expected):
    loop = None if unstable is None else SimpleNamespace(unstable=unstable, without_wall="it grows")
    line = SimpleNamespace(walls=None, proved=lambda low, high: proved and low == high == 300.0)
    monkeypatch.setattr(verdict, "WallLoop", SimpleNamespace(of=lambda _cut: loop))
    monkeypatch.setattr(verdict, "WallsAlong", lambda *about: about)
    monkeypatch.setattr(verdict, "Line", SimpleNamespace(of=lambda about: line if about[1:] == (0, 2.0) else None))
    monkeypatch.setattr(verdict, "radius_of", lambda frame: radius * (frame == (300.0, 2.0)))
    monkeypatch.setattr(verdict, "motion_at", lambda _walls, value: motion if value == 300.0 else "")
    cut = SimpleNamespace(closed=lambda *wall: wall)
    monkeypatch.setattr(verdict, "wall_cut", lambda _loop: cut)
    monkeypatch.setattr(verdict, "loops_of", lambda _spec, values, along: (values, along))
    spec = SimpleNamespace(values={"K": 300.0, "B": 2.0}, wall=("K", "B"))
    assert tuple(verdict.of_wall(spec).values()) == expected
    members = [("n = 1", "first"), ("n = 2", "second")]
    answers = {"first": {"verdict": "proved", "counterexample": ""}, "second": {"verdict": "refuted", "counterexample": "x"}}
    monkeypatch.setattr(verdict, "constant_members", lambda _rules, _own: members)
    monkeypatch.setattr(verdict, "_with_wall", lambda member, _spec: answers[member])
    assert verdict.of_wall(spec, rules=True) == {"verdict": "refuted", "counterexample": "n = 2, x"}
    answers["second"] = {"verdict": "unknown", "counterexample": ""}
    assert verdict.of_wall(spec, rules=True) == {"verdict": "unknown", "counterexample": ""}
