"""Frames between samples: right within their bound, and not followed where they cannot be known."""

import numpy as np
import pytest
from support.specs import values_of

from wavesweep.analysis.intervals.critical import from_eigenvalues
from wavesweep.analysis.intervals.interpolated import NODE, MoreStatesError, _of_order, followed_frames
from wavesweep.diagram import draw
from wavesweep.lifted import close, cut_at_wall

EVERYWHERE = (-np.inf, np.inf)


def of_loops(path, **changes):
    """Frames of a wave loop over a number, and those of a second column with twice the wall."""
    own = values_of("pmw-lm", Kp=20.0, **changes)

    def evaluate(column, p):
        return close(cut_at_wall(draw(own | {path: p})), 100.0 * (1 + column), 1.0)

    return evaluate


@pytest.mark.parametrize(
    ("path", "span"), [("controller.b", (10.0, 20.0)), ("device.mass", (0.1, 0.3)), ("local_model.K_LM", (1.0, 400.0))]
)
def test_frames_between_samples_are_right_within_their_bound(path, span):
    evaluate = of_loops(path)
    frames = followed_frames(evaluate, span, 2, EVERYWHERE if path.endswith("K_LM") else (0.0, np.inf))
    column = np.repeat([0, 1], 30)
    p = np.random.default_rng(0).uniform(*span, (60, 1))
    found, bound = frames.at(column, p)
    exact = evaluate(column, p[:, 0])
    units = frames.units[column]
    off = np.abs(found[:, 0] - exact) * (units[:, None, :] / units[:, :, None])
    assert frames.followed.all()
    assert (off.max((1, 2)) <= 2 * bound).all()  # what the frames are held against is rounded as well
    assert (bound < 1e-12 * np.abs(exact * (units[:, None, :] / units[:, :, None])).max()).all()


def test_what_vanishes_at_every_sample_is_not_followed():
    hidden = np.polynomial.chebyshev.Chebyshev.basis(NODE.size)

    def evaluate(_, p):
        x = (p - 0.5) / 0.535  # the samples reach 3.5 % into the neighbours
        return (-0.5 + 1e-6 * hidden(x))[:, None, None] * np.eye(2)

    frames = followed_frames(evaluate, (0.0, 1.0), 1, EVERYWHERE)
    assert frames.low.size > 1  # the piece that sees nothing was cut
    p = np.linspace(0.0, 1.0, 301)[:, None]
    found, _ = frames.at(np.zeros(301, int), p)
    np.testing.assert_allclose(found[:, 0], evaluate(np.zeros(301, int), p[:, 0]), rtol=0, atol=1e-13)


def test_what_overflows_or_has_a_pole_is_computed_at_every_point():
    def evaluate(_, p):
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            return (1 / (p - 0.3))[:, None, None] * np.ones((2, 2))

    frames = followed_frames(evaluate, (0.0, 1.0), 1, EVERYWHERE)
    assert not frames.followed.all()
    p = np.array([[0.29], [0.31], [0.9]])
    found, bound = frames.at(np.zeros(3, int), p)
    exact = evaluate(np.zeros(3, int), p[:, 0])
    np.testing.assert_allclose(found[:, 0], exact, rtol=1e-12)
    assert bound[0] == bound[1] == 0


def test_no_point_beyond_the_bounds_is_asked_for():
    seen = []

    def evaluate(_, p):
        seen.append(p)
        return np.exp(p)[:, None, None] * np.eye(3)

    followed_frames(evaluate, (1.0, 5.0), 1, (0.9, 8.0))
    asked = np.concatenate(seen)
    assert asked.real.min() >= 0.9
    assert asked.real.max() <= 8.0


def test_the_frames_of_a_column_do_not_depend_on_the_others():
    evaluate = of_loops("controller.b")
    together = followed_frames(evaluate, (5.0, 200.0), 2, (0.0, np.inf))
    alone = followed_frames(lambda column, p: evaluate(column + 1, p), (5.0, 200.0), 1, (0.0, np.inf))
    p = np.linspace(5.0, 200.0, 50)[:, None]
    one, other = together.at(np.ones(50, int), p), alone.at(np.zeros(50, int), p)
    assert np.array_equal(one[0], other[0])
    assert np.array_equal(one[1], other[1])


def test_a_state_that_is_left_out_changes_no_critical_function():
    E = np.random.default_rng(3).normal(size=(20, 3, 3))
    padded = _of_order(lambda *_: E, 5, None, None)
    assert padded.shape == (20, 5, 5)
    for few, more in zip(from_eigenvalues(E)[:2], from_eigenvalues(padded)[:2], strict=True):
        np.testing.assert_allclose(more, few, rtol=1e-12, atol=1e-12)
    with pytest.raises(MoreStatesError):
        _of_order(lambda *_: E, 2, None, None)
