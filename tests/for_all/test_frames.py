"""Frames of varying length against the loop at one length, and against a march in plain numpy."""

import numpy as np
import pytest
from meaning.attacked import contradictions
from meaning.attacked import growth as growth_of
from meaning.members import Frame
from support.frames import frames_of_controller, frames_of_drawing
from support.specs import INTEGRATIONS, nested, values_of

import wavesweep
from wavesweep.engine._monodromy.cut import FIRST
from wavesweep.engine._monodromy.drift import MarginalModes
from wavesweep.engine._stability.stable import stable_intervals
from wavesweep.engine._switched.any_order import bracket
from wavesweep.engine._switched.loop_frames import Symbol
from wavesweep.engine._switched.patterns import growth, is_refuted, shortest_through
from wavesweep.engine.frames import open_loops
from wavesweep.engine.loop import Loops
from wavesweep.for_all.frame_families import FramesInAnyOrder
from wavesweep.for_all.plan import FRAME, LOST
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.haptics.controllers import WALL
from wavesweep.program.spec import load

LENGTHS = 16, 20, 25, 33


def fig4(kind="pmw", **changes):
    """The loop of Figure 4, or the same walls under another controller."""
    values = values_of(kind)
    return {
        **values,
        "controller.b": 10.0,
        "filters.lp1.order": 1,
        "filters.lp1.cutoff_hz": 8.57,
        "environment.integration": "explicit",
        "environment.B_VE": 1.0,
        "device.velocity": "difference",
        **changes,
    }


def large(eigenvalues):
    """The eigenvalues that are not next to 0, sorted."""
    return np.sort_complex(eigenvalues[np.abs(eigenvalues) > 1e-4])


@pytest.mark.slow
@pytest.mark.sample(20)
@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm", "dc-vc", "dc-vc-lm", "pmw", "pmw-lm"])
@pytest.mark.parametrize("integration", INTEGRATIONS)
@pytest.mark.parametrize(("ticks", "delay"), [(1, 0), (1, 1), (7, 0), (7, 2), (7, FRAME)])
def test_one_length_for_ever_is_the_loop_of_that_ratio(kind, integration, ticks, delay):
    values = fig4(kind, **{"environment.integration": integration, "controller.Kp": 20.0 * (ticks > 1), "rates.ratio": 5})
    frames = frames_of_controller(values, FramesInAnyOrder((ticks,), (delay,)))
    alone = values | {"rates.ratio": ticks, "environment.delay": ticks if delay == FRAME else delay, "environment.K_VE": 35.0}
    drawing = loop_drawing(alone)
    read = {path: alone[path] for path in alone if path in drawing.reads}
    E = MarginalModes.of(*Loops(drawing, read).twins()).closed_frame(Loops(drawing, read).drawn())
    expected, found = (large(np.linalg.eigvals(each)) for each in (np.eye(len(E)) + E, frames.at(35.0)[0]))
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("kind", ["dc-slow", "pmw-mean"])
def test_a_result_comes_with_the_next_frame_of_a_ratio_that_is_not_known(kind):
    tables = {
        "controller": {"kind": kind},
        "environment": {"integration": "explicit", "delay": "frame"},
        "sweep": {"B_VE": [1.0]},
    }
    found = wavesweep.zwidth({**tables, "for_all": {"rates": {"ratio": [18, 25]}}}).set_index("guarantee").loc["for_all"]
    alone = [wavesweep.zwidth({**tables, "rates": {"ratio": ratio}}).high.max() for ratio in (18, 25)]
    assert found.certified
    assert found.high == pytest.approx(min(alone), rel=1e-9)


def marched(K, word, **asked):
    """What a pattern of frames multiplies the motion by, by the documents' own reading of the same loop."""
    return growth_of(nested(fig4()) | {"for_all": asked}, tuple(Frame(*each) for each in word), K_VE=K)


@pytest.mark.slow
def test_patterns_grow_as_in_a_march():
    rng = np.random.default_rng(5)
    frames = FramesInAnyOrder(LENGTHS, (1, 8, FRAME))
    family = frames_of_controller(fig4(), frames)
    varied = {"rates.ratio": {"values": [*LENGTHS], "varying": True}}
    for K in (150.0, 400.0, 900.0):
        pattern = [(int(rng.choice(LENGTHS)), frames.delays[rng.integers(3)]) for _ in range(3)]
        word = tuple(family.symbols.index(Symbol(*each)) for each in pattern)
        expected = marched(K, [(ticks, "frame" if delay == FRAME else delay) for ticks, delay in pattern], **varied)
        assert growth(family.at(K), word) == pytest.approx(expected, rel=1e-7)


def test_results_that_are_lost_hold_the_last_one_and_not_too_many_in_a_row():
    family = frames_of_controller(fig4(), FramesInAnyOrder((20,), (1,), lost=2))
    kinds = [(each.delay, each.lost) for each in family.symbols]
    assert kinds == [(1, 0), (LOST, 1), (LOST, 2)]
    np.testing.assert_array_equal(family.follows, [[True, True, False], [True, False, True], [True, False, False]])
    assert growth(family.at(300.0), (0, 1)) == pytest.approx(marched(300.0, [(20, 1), (20, None)], lost=2), rel=1e-7)


def test_words_that_may_not_be_repeated_refute_nothing():
    """Only one result may be lost in a row, so none of these patterns occurs, though their products grow."""
    family = frames_of_controller(fig4(), FramesInAnyOrder((20,), (0,), lost=1))
    (lost,) = (i for i, each in enumerate(family.symbols) if each.delay == LOST)
    one_lost = next(word for word in shortest_through(family.follows) if lost in word)
    assert is_refuted(family, one_lost, 3000.0)
    for word in ((lost,), (*one_lost, lost), (lost, *one_lost)):
        assert growth(family.at(3000.0), word) > 1
        assert not is_refuted(family, word, 3000.0)
    five = frames_of_controller(fig4(), FramesInAnyOrder((16, 20), (1,), lost=5))
    longest = shortest_through(five.follows)[-1]
    assert [(five.symbols[i].ticks, five.symbols[i].lost) for i in longest] == [(20, count) for count in range(6)]


@pytest.mark.slow
def test_losses_beside_results_that_are_in_place_at_once_end_where_a_march_does():
    tables = {
        "rates": {"ratio": 5},
        "environment": {"delay": 0, "B_VE": 1.0},
        "controller": {"kind": "dc-slow"},
        "for_all": {"lost": 3},
        "sweep": {"along": "K_VE", "K_VE": {"start": 0, "stop": 2000}},
    }
    (row,) = wavesweep.stability_region(tables).query("guarantee == 'for_all'").itertuples()
    assert row.settled
    assert row.felt_high == pytest.approx(row.high, rel=1e-9)
    assert contradictions(tables) == []


@pytest.mark.parametrize(
    ("kind", "number", "integration", "frames"),
    [
        ("dc-lm", "local_model.K_LM", "explicit", FramesInAnyOrder((20, 33))),
        ("pmw", "environment.K_VE", "explicit", FramesInAnyOrder((20, 33))),
        ("pmw", "environment.K_VE", "implicit", FramesInAnyOrder((20,), (0, 5))),
    ],
)
def test_matrices_between_two_numbers_are_at_one_place_of_a_curve(kind, number, integration, frames):
    """At most as far from it as the bounds. The last case has two algebraic loops through the number."""
    loop = fig4(kind, **{"environment.K_VE": 50.0, "environment.integration": integration})
    family = frames_of_controller(loop, frames, number)
    E, dE = family.hull(100.0, 400.0)
    for s in np.linspace(0, 1, 7):
        weights = [(1 - s) ** 2, 2 * s * (1 - s), s**2] if len(E) == 3 else [1 - s, s]
        inside = sum(weight * each for weight, each in zip(weights, E, strict=True))
        found, own = family.enclosed(100.0 + 300 * s)
        assert (np.abs(found - inside) <= dE.max(0) + own).all()


@pytest.mark.parametrize("elapsed", [True, False])
def test_a_drawn_loop_has_the_frames_of_the_controller_that_it_draws(elapsed):
    values = fig4(**{"environment.delay": 1})
    drawing = loop_drawing(values)
    read = {path: values[path] for path in values if path in drawing.reads}
    drawn = frames_of_drawing(drawing, read, LENGTHS, "environment.K_VE", elapsed=elapsed)
    own = frames_of_controller(values, FramesInAnyOrder(LENGTHS, elapsed=elapsed))
    for one, other in zip(drawn.at(300.0), own.at(300.0), strict=True):
        np.testing.assert_allclose(large(np.linalg.eigvals(one)), large(np.linalg.eigvals(other)), atol=1e-9)


PERIODIC = {
    "rates": {"tick_hz": 1000},
    "numbers": {"K": 900.0, "n": 4},
    "block": {
        "m": {"type": "mass", "mass": 0.5, "damping": 2.0},
        "slow": {"type": "hold", "every": "n"},
        "speed": {"type": "difference", "every": "n", "phase": 1},
        "later": {"type": "hold", "every": "n", "phase": 2},
    },
    "wire": {"slow.u": "m.x", "speed.u": "m.x", "later.u": "K*slow.y + 3*speed.y", "m.f": "-later.y"},
    "for_all": {"n": {"values": [4, 7], "varying": True}},
}


def test_periods_of_blocks_that_run_after_the_sample_are_those_of_the_frame_before():
    """A difference in the second tick of a frame is over the time since that tick of the frame before."""
    spec = load(PERIODIC)
    family = frames_of_drawing(spec.drawing, spec.values, (4, 7), "numbers.K")
    assert {(each.ticks, each.step) for each in family.symbols} == {(4, 4), (4, 7), (7, 4), (7, 7)}
    pairs = [(each.ticks, each.step) for each in family.symbols]
    word = tuple(map(pairs.index, ((4, 7), (7, 4), (7, 7))))
    assert growth(family.at(900.0), word) == pytest.approx(growth_of(PERIODIC, (Frame(4), Frame(7), Frame(7))), rel=1e-7)


def test_one_length_alone_is_the_interval_of_today():
    values = fig4(**{"environment.delay": 1})
    cut = open_loops(Loops(loop_drawing(values), values).read, *WALL, per_loop=True).cut
    today = stable_intervals(cut.as_batch(1), FIRST, (0.0, 5000.0), np.array([[1.0]]))
    found = bracket(frames_of_controller(values, FramesInAnyOrder((20,))), 20.0, (0.0, 5000.0), 1e-6)
    assert found.high == pytest.approx(today.high[0], rel=1e-6)
    assert found.low == pytest.approx(today.low[0], abs=1e-6)
    assert found.above.x == pytest.approx(today.high[0], rel=1e-9)
