"""Loops of several rates against limits that are known in closed form, the built-in loops, and products tick by tick."""

from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from support.drawings import T, random_drawing

import wavesweep
from wavesweep.engine._loops import blocks
from wavesweep.engine._loops.multirate import MultirateLoop, ScheduledBlock
from wavesweep.engine._monodromy.cut import FIRST
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._monodromy.open_frame import cut_of, open_frame
from wavesweep.engine._monodromy.periodic import Ticks, frame_of, products_of_rows, then
from wavesweep.engine._monodromy.product import product_with_errors, product_with_tight_errors
from wavesweep.engine._monodromy.rounding import both
from wavesweep.engine._stability.along_any import stable_along_any
from wavesweep.engine._stability.sampled_frames import ParametricFrames
from wavesweep.engine._stability.stable import stable_intervals
from wavesweep.engine.doubles import ENTRY_ROUNDING
from wavesweep.engine.errors import UsageError


def along_any(draw, span):
    """The stable intervals along p by eigenvalues, and whether they are certified."""
    drift, first = MarginalModes.of(draw(7.3), draw(8.9)), draw(7.3)
    period = np.array([float(first.period) * first.ticks])
    found = stable_along_any(ParametricFrames(lambda _, p: drift.closed_frame(draw(p)), period), span)
    return list(zip(found.low.tolist(), found.high.tolist(), strict=True)), bool(found.certified.all())


def cut_at(drawn, drift, read):
    frame = open_frame(drawn, drift, "w", read)
    return frame and cut_of(frame, drift, len(read))


def exactly(draw, read, span, damped=""):
    """The same along a number that is cut out: `draw(other)` has its product as the input "w"."""
    watched = (read, damped) if damped else (read,)
    cut = cut_at(draw(1.1), MarginalModes.of(draw(1.1), draw(0.7), watched), watched)
    if cut is None:
        return None, None
    found = stable_intervals(cut if cut.batch else cut.at(np.newaxis), FIRST, span, np.zeros((1, 1)))
    return list(zip(found.low.tolist(), found.high.tolist(), strict=True)), bool(found.certified.all())


def pd(kp, kd, **sums):
    return MultirateLoop(T, (ScheduledBlock(blocks.mass("m", T, 0.2)),), {"m.f": {"m.x": -kp, "m.v": -kd} | sums}, ("w",))


def test_pd_on_a_mass_with_forces_held_over_a_tick():
    """kp < 2 kd/T and kd < 2 m/T, both ways."""
    assert along_any(lambda p: pd(p, 3.0), (0, 20000)) == ([(0, pytest.approx(6000, rel=1e-9))], True)
    ends, certified = exactly(lambda kd: pd(0.0, kd + 1.9, w=-1.0), "m.x", (0, 20000))
    assert certified
    assert ends == [(0, pytest.approx(6000, rel=1e-9))]
    ends, certified = along_any(lambda p: pd(100.0, p), (0, 2000))
    assert certified
    assert ends == [(pytest.approx(100 * T / 2, rel=1e-9), pytest.approx(400, rel=1e-9))]


@pytest.mark.parametrize(("ticks", "t"), [(0, 0.4), (1, 0.3), (3, 0.2), (7, 0.1)])
def test_an_undamped_mass_with_difference_velocity_and_delay(ticks, t):
    mass, R = 0.1, 4 * np.sin(t / 2) ** 2 / np.cos(t / 2)
    b = R * np.sin((ticks + 0.5) * t) / np.sin(t)
    K = (R * np.cos((ticks + 0.5) * t) - b * (1 - np.cos(t))) * mass / T**2

    def draw(p):
        placed = [blocks.mass("m", T, mass), blocks.defined("difference", "v", T), blocks.defined("delay", "z", T, steps=ticks)]
        sums = {"v.u": {"m.x": 1.0}, "z.u": {"m.x": p, "v.y": b * mass / T}, "m.f": {"z.y": -1.0}}
        return MultirateLoop(T, tuple(map(ScheduledBlock, placed)), sums)

    ends, certified = along_any(draw, (1e-3 * K, 5 * K))  # from 0 on it takes balls, as both poles are 1 there
    assert certified
    assert ends[0][1] == pytest.approx(K, rel=1e-9)


@pytest.mark.parametrize(("share", "phase"), [(0.5, 10), (0.2, 4), (0.75, 15), (0.3, 6)])
def test_an_integrator_behind_a_network(share, phase):
    """d x' = f, sampled and held every h, late by r h: K h/d < min(1/r, 1/(1/2 - r)) (Zhang, Branicky, Phillips 2001)."""
    h, d = 0.02, 1.3
    tick, limit = h / 20, min(1 / share, 1 / (0.5 - share) if share < 0.5 else np.inf)

    def draw(wire):
        placed = (
            ScheduledBlock(blocks.ss("x", tick, [[0.0]], [[1 / d]], [[1.0]], [[0.0]], ("f",), ("x",))),
            ScheduledBlock(blocks.defined("hold", "s", h), 20, 0),
            ScheduledBlock(blocks.defined("hold", "a", h), 20, phase),
        )
        return MultirateLoop(tick, placed, {"s.u": {"x.x": 1.0}, **wire}, ("w",))

    expected = [(0, pytest.approx(limit * d / h, rel=1e-9))]
    assert along_any(lambda p: draw({"a.u": {"s.y": -p}, "x.f": {"a.y": 1.0}}), (0, 600)) == (expected, True)
    # The gain before the second hold, and behind it.
    assert exactly(lambda _: draw({"a.u": {"w": -1.0}, "x.f": {"a.y": 1.0}}), "s.y", (0, 600)) == (expected, True)
    assert exactly(lambda _: draw({"a.u": {"s.y": 1.0}, "x.f": {"w": -1.0}}), "a.y", (0, 600)) == (expected, True)


@pytest.mark.parametrize("seed", range(8))
def test_a_frame_is_the_product_of_its_ticks(seed):
    drawn = random_drawing(seed)
    ticks = Ticks.of(drawn)
    whole = np.eye(len(ticks.states))
    for kind in ticks.kind:
        whole = (np.eye(len(whole)) + ticks.maps[kind].E) @ whole
    assert np.abs(frame_of(ticks) + np.eye(len(whole)) - whole).max() < 1e-12 * max(1, np.abs(whole).max())


@pytest.mark.slow
@pytest.mark.parametrize("length", [1, 2, 60, 300])
def test_the_bound_on_the_rounding_of_a_frame_is_none_too_large(length):
    """Damped turns in other units, in an order that repeats little; exact by fractions. Sizes alone grow by 3 % in a tick."""
    r = np.random.default_rng(length)
    kinds, angles, units = r.integers(0, 3, length), (0.02, 0.03, 0.04), np.array([[1.0, 0.1], [10.0, 1.0]])
    turns = [np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) for angle in angles]
    changes = [0.999 * turn * units - np.eye(2) for turn in turns]
    exact = [[Fraction(i == j) for j in range(2)] for i in range(2)]
    ticks = [[[Fraction(each[i, j]) + (i == j) for j in range(2)] for i in range(2)] for each in changes]
    for kind in kinds.tolist():
        exact = [[sum(row[k] * exact[k][j] for k in range(2)) for j in range(2)] for row in ticks[kind]]
    for bounded, most in ((partial(product_with_errors, per_loop=False), 100), (product_with_tight_errors, 20)):
        E, dE = bounded(kinds, changes, [np.abs(each) for each in changes])
        off = np.array([[float(abs(Fraction(E[i, j]) + (i == j) - exact[i][j])) for j in range(2)] for i in range(2)])
        assert np.all(off <= dE)
        assert np.all(dE <= most * length * np.finfo(float).eps * units)
    errors = ENTRY_ROUNDING * np.abs(changes)
    rows = [kinds.tolist(), kinds[: length // 2 + 1].tolist(), kinds[::-1].tolist()]
    together = products_of_rows(rows, (np.array(changes), errors), both)
    for at, row in enumerate(rows):
        E, dE = product_with_errors(np.array(row), changes, [np.abs(each) for each in changes], per_loop=True)
        assert (np.abs(together[0][at] - E) <= dE + together[1][at]).all()
        assert (together[1][at] <= 3 * dE).all()
        assert (together[1][at] >= dE / 3).all()
    off = np.array([[float(abs(Fraction(together[0][0, i, j]) + (i == j) - exact[i][j])) for j in range(2)] for i in range(2)])
    assert (off <= together[1][0]).all()


def test_a_state_that_a_tick_forgets_is_forgotten_exactly():
    """A sum of the two would leave the rounding of -1 - 0.3 + 0.3, which a later tick passes on."""
    random = np.random.default_rng(1)
    first, second = random.normal(size=(2, 6, 4, 4))
    first[:, :, 1], second[:, 2, :] = -np.eye(4)[1], -np.eye(4)[2]
    found = np.eye(4) + then(first, second)
    assert (found[:, :, 1] == 0).all()
    assert (found[:, 2, :] == 0).all()
    np.testing.assert_allclose(found, (np.eye(4) + second) @ (np.eye(4) + first), atol=1e-14)
    second[3, 2, 0] = 0.1  # which one of the matrices does not forget
    assert (np.eye(4) + then(first, second))[3, 2].any()


@pytest.mark.parametrize(
    ("sums", "found"),
    [
        ({"h.uu": {"arm.x": 1.0}}, "h.uu"),
        ({"h.u": {"leg.x": 1.0}}, "leg.x"),
        ({"h.u": {"arm.x": 1.0}, "arm.f": {"arm.f": 1.0}}, "arm.f"),
        ({"h.u": {"a": 1.0}, "a": {"c": 1.0}, "c": {"a": 1.0}}, "a, c"),
    ],
)
def test_junctions_of_unknown_names_and_rings_of_them_are_refused(sums, found):
    arm, hold = ScheduledBlock(blocks.mass("arm", 1e-3, 0.1)), ScheduledBlock(blocks.defined("hold", "h", 5e-3), 5)
    with pytest.raises(UsageError, match=rf"a drawn loop: expected .*, found .*{found}"):
        wavesweep.compile(MultirateLoop(1e-3, (arm, hold), sums))
    with pytest.raises(UsageError, match="different names, found arm"):
        wavesweep.compile(MultirateLoop(1e-3, (arm, arm), {}))
    with pytest.raises(UsageError, match="period > 0"):
        wavesweep.compile(MultirateLoop(None, (arm, hold), {}))
