"""Characteristic polynomials between samples: right within their bound, and left out where they cannot be known."""

import mpmath
import numpy as np
import pytest
from support.specs import values_of

from wavesweep.monodromy.cut import close
from wavesweep.stability.guardian_maps import (
    EPS,
    SURELY_UNSTABLE,
    characteristic,
    from_coefficients,
    from_eigenvalues,
    from_polynomials,
    surely_unstable_by_traces,
)
from wavesweep.stability.interpolated import DEGREES, chebyshev, interpolated_loop, nodes
from wavesweep.stability.non_nilpotent import MoreStatesError, RecalledError, living, of_order, typical
from wavesweep.stability.panels import RIM
from wavesweep.sweep.open_loops import wall_cut

EVERYWHERE = (-np.inf, np.inf)


def of_loops(path, **changes):
    """Frames of a wave loop over a number, and those of a second column with twice the wall."""
    own = values_of("pmw-lm", Kp=20.0, **changes)

    def evaluate(column, p):
        return close(wall_cut(own | {path: p}), 100.0 * (1 + column), 1.0)

    return evaluate


def follow(evaluate, span, columns, bounds):
    """All states of these columns interpolated_loop."""
    sizes = typical(evaluate, span, columns)[1]
    return interpolated_loop(evaluate, span, columns, bounds, sizes, np.ones(sizes.shape[-1], bool))


def between(loop, column, p):
    """The interpolated polynomials of some columns at p, `(points,)`, which are interpolated: coefficients, errors, sizes."""
    piece = loop.piece(column, p[:, None])
    assert (loop.pieces.degree[piece] > 0).all()
    return loop.polynomials(piece, p[:, None])


def exactly(loop, column, p, size):
    """The same computed at every point, in units of that size."""
    units = loop.units[column]
    E = loop.computed(column, p[:, None])[0][:, 0] * (units[:, None, :] / units[:, :, None])
    c, _, own = characteristic(E)
    return c * (own / size) ** np.arange(len(c) - 1, -1, -1)[:, None]


@pytest.mark.sample(2)
@pytest.mark.parametrize("imaginary", [0.0, 0.02])
@pytest.mark.parametrize(
    ("path", "span"), [("controller.b", (10.0, 20.0)), ("device.mass", (0.1, 0.3)), ("local_model.K_LM", (1.0, 400.0))]
)
def test_polynomials_between_samples_are_right_within_their_bound(path, span, imaginary):
    loop = follow(of_loops(path), span, 2, EVERYWHERE if path.endswith("K_LM") else (0.0, np.inf))
    column = np.repeat([0, 1], 30)
    p = np.random.default_rng(0).uniform(*span, 60) + (1j * imaginary * (span[1] - span[0]) if imaginary else 0)
    c, reach, size = between(loop, column, p)
    off = np.abs(c - exactly(loop, column, p, size)) / EPS
    assert (off <= 2 * reach).all()  # the others are rounded as well
    assert (reach <= 1e5 * np.maximum(np.abs(c).max(0), 1)).all()


def test_the_rim_of_a_piece_is_what_was_computed_there():
    """A panel that is a piece asks for its rim again: the interpolant there would be off by 10^5 roundings and more."""
    loop = follow(of_loops("controller.b"), (10.0, 20.0), 2, EVERYWHERE)
    pieces = np.flatnonzero(loop.pieces.degree > 0)
    rim = loop.pieces.at(RIM)[pieces]
    c, reach, size = loop.polynomials(pieces, rim)
    computed, _ = loop.computed(loop.pieces.column[pieces], rim)
    units = loop.units[loop.pieces.column[pieces]]
    E = (computed * (units[:, None, None, :] / units[:, None, :, None])).reshape(-1, *computed.shape[2:])
    exact, error, own = characteristic(E)
    power = (own / size) ** np.arange(len(c) - 1, -1, -1)[:, None]
    np.testing.assert_array_equal(c, exact * power)
    np.testing.assert_array_equal(reach[:-1], (error * power)[:-1])
    beside = loop.polynomials(pieces, rim * (1 + 1e-12))[1]
    assert (beside[:-1] > 100 * reach[:-1]).any()


def test_what_vanishes_at_every_sample_is_not_followed():
    def evaluate(_, p):
        x = (p - 0.5) / 0.535  # the samples reach 3.5 % into the neighbours
        return (-0.5 + 1e-6 * chebyshev(x, DEGREES[-1])[1])[..., None, None] * np.ones((1, 1))

    loop = follow(evaluate, (0.0, 1.0), 1, EVERYWHERE)
    assert loop.pieces.low.size > 1  # the piece that sees nothing was cut
    p = np.linspace(0.0, 1.0, 301)
    some = loop.pieces.degree[loop.piece(np.zeros(301, int), p[:, None])] > 0
    assert some.any()
    c, reach, size = between(loop, np.zeros(some.sum(), int), p[some])
    assert (np.abs(c - exactly(loop, np.zeros(some.sum(), int), p[some], size)) <= 2 * EPS * reach).all()


@pytest.mark.parametrize("degree", DEGREES)
def test_an_interpolant_goes_through_its_points_and_the_other_polynomial_vanishes_there(degree):
    x, transform = nodes(degree)
    values = np.exp(x)
    basis, vanishing = chebyshev(x, degree)
    np.testing.assert_allclose(basis @ (transform @ values), values, rtol=1e-13)
    np.testing.assert_allclose(vanishing, 0, atol=1e-13)
    between, most = chebyshev(np.linspace(-1, 1, 2001), degree)
    np.testing.assert_allclose(between @ (transform @ values), np.exp(np.linspace(-1, 1, 2001)), rtol=1e-13)
    assert np.abs(most).max() <= 1 + 1e-12
    np.testing.assert_array_equal(nodes(DEGREES[-1])[0][:: DEGREES[-1] // degree], x)


def test_what_overflows_or_has_a_pole_is_computed_at_every_point():
    def evaluate(_, p):
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            return (0.1 / (0.3 - p))[..., None, None] * np.ones((2, 2))

    loop = follow(evaluate, (0.0, 1.0), 1, EVERYWHERE)
    degree = loop.pieces.degree[loop.piece(np.zeros(3, int), np.array([[0.29], [0.31], [0.9]]))]
    assert degree[0] == degree[1] == 0
    assert degree[2] > 0


def test_no_point_beyond_the_bounds_is_asked_for():
    seen = []

    def evaluate(_, p):
        seen.append(p.ravel())
        return np.exp(p)[..., None, None] * np.eye(3)

    follow(evaluate, (1.0, 5.0), 1, (0.9, 8.0))
    asked = np.concatenate(seen)
    assert asked.real.min() >= 0.9
    assert asked.real.max() <= 8.0


def test_the_polynomials_of_a_column_do_not_depend_on_the_others():
    evaluate = of_loops("controller.b")
    together = follow(evaluate, (5.0, 200.0), 2, (0.0, np.inf))
    alone = follow(lambda column, p: evaluate(column + 1, p), (5.0, 200.0), 1, (0.0, np.inf))
    p = np.linspace(5.0, 200.0, 50)
    some = together.pieces.degree[together.piece(np.ones(50, int), p[:, None])] > 0
    assert some.any()
    one, other = (
        between(loop, which[some], p[some]) for loop, which in ((together, np.ones(50, int)), (alone, np.zeros(50, int)))
    )
    for part, same in zip(one, other, strict=True):
        assert np.array_equal(part, same)
    for part, same in zip(from_polynomials(*one), from_polynomials(*other), strict=True):
        assert np.array_equal(part, same)


def test_the_functions_of_a_polynomial_alone_have_the_same_bits_as_among_others():
    c, reach, size = characteristic(np.random.default_rng(4).normal(size=(600, 5, 5)))
    together = from_polynomials(c, reach, size)
    for column in (0, 17, 511, 512, 599):
        some = slice(column, column + 1)
        for one, all_ in zip(from_polynomials(c[:, some], reach[:, some], size[some]), together, strict=True):
            assert np.array_equal(one[:, 0], all_[:, column])


def test_a_state_that_is_left_out_changes_no_critical_function():
    E = np.random.default_rng(3).normal(size=(20, 3, 3))
    padded = of_order(lambda *_: E, 5, np.ones(3, bool), None, None).E
    assert padded.shape == (20, 5, 5)
    for few, more in zip(from_eigenvalues(E)[:2], from_eigenvalues(padded)[:2], strict=True):
        np.testing.assert_allclose(more[:3], few[:3], rtol=1e-12, atol=1e-12)
    with pytest.raises(MoreStatesError):
        of_order(lambda *_: E, 2, np.ones(3, bool), None, None)


@pytest.mark.parametrize("matrices", [1, 7])
def test_traces_that_are_known_change_no_bit(matrices):
    E = np.random.default_rng(8).normal(size=(matrices, 5, 5))
    E[-1, 0, 0] = np.inf if matrices > 1 else 0.0  # a frame that overflows
    _, traces = surely_unstable_by_traces(E)
    for one, other in zip(from_eigenvalues(E), from_eigenvalues(E, 1.0, traces), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("size", [1.0, 1e3])
def test_traces_tell_unstable_frames_of_many_states_from_stable_ones(size):
    """40 states, 36 of them a delay: a modulus of 1.5 is told, unless eigenvalues cancel in both sums, and 0.999 never."""
    random = np.random.default_rng(11)
    A = np.zeros((60, 40, 40))
    A[:, range(1, 37), range(36)] = 1.0
    A[:, 36:, 36:] = random.normal(size=(60, 4, 4))
    radius = np.abs(np.linalg.eigvals(A[:, 36:, 36:])).max(-1)
    goal = np.where(np.arange(60) % 2, 1.5, 0.999)
    A[:, 36:, 36:] *= (goal / radius)[:, None, None]
    A[:, 0, 36:] = size * random.normal(size=(60, 4))
    sure, (phase, log, error) = surely_unstable_by_traces(A - np.eye(40))
    assert not sure[goal < 1].any()
    for part, own in zip(from_coefficients(A - np.eye(40))[:2], (phase, log), strict=True):
        np.testing.assert_array_equal(part[SURELY_UNSTABLE], own)  # beside the real axis they come from coefficients
    assert sure[goal > 1].mean() > 0.8
    with mpmath.workdps(40):
        for which in (0, 1):
            z = [mpmath.mpc(value) ** 16 for value in np.linalg.eigvals(A[which, 36:, 36:])]
            total, squares = mpmath.fsum(z), mpmath.fsum(value**2 for value in z)
            exact = (total / 40) ** 2 + (total**2 - squares) / (40 * 39) - 2
            found = phase[which] * mpmath.exp(log[which])
            assert abs(found / exact - 1) < 1e-11
            assert abs(found / exact - 1) <= EPS * error[which]


def forgetful():
    """Frames with a chain of two held values behind two states, and a value that nothing enters: I + E."""
    random = np.random.default_rng(5)
    A = np.zeros((7, 5, 5))
    A[:, :2, :2] = 0.4 * random.normal(size=(7, 2, 2))
    A[:, 2, :2], A[:, 3, 2] = random.normal(size=(7, 2)), 1.0  # nothing reads the last of the chain
    A[:, 0, 4], A[:, 4, 4] = 2.0, 1e-16  # nothing enters it, and it is forgotten
    return A


def test_states_that_are_forgotten_within_a_frame_are_left_out():
    A = forgetful()
    kept = living(np.abs(A))
    assert (kept == [True, True, False, False, False]).all()
    few, E = A[:, :2, :2] - np.eye(2), A - np.eye(5)
    for one, other in zip(from_coefficients(few)[:2], from_eigenvalues(E)[:2], strict=True):
        np.testing.assert_allclose(one[:3], other[:3], rtol=1e-10, atol=1e-10)
    A[3, 0, 3] = 1e-3  # in one of the columns it is read
    assert (living(np.abs(A)).sum(1) == [2, 2, 2, 4, 2, 2, 2]).all()
    assert living(np.zeros((2, 3, 3))).sum(1).tolist() == [1, 1]  # one state stays
    A[3, 0, 0] = np.inf  # which says nothing of the others
    assert living(np.abs(A))[3].sum() == 4


def test_a_state_that_is_recalled_at_other_values_is_noticed():
    E, column = forgetful() - np.eye(5), np.array([0, 0, 1, 1, 2, 2, 2])
    kept = living(np.abs(E + np.eye(5)))[0]
    assert of_order(lambda *_: E, 2, kept, column, None).E.shape == (7, 2, 2)
    E[3, 0, 3] = 1e-3
    with pytest.raises(RecalledError) as error:
        of_order(lambda *_: E, 2, kept, column, None)
    assert error.value.columns.tolist() == [1]
    with pytest.raises(RecalledError) as error:
        of_order(lambda *_: E[:, :4, :4], 2, kept, column, None)
    assert error.value.columns.tolist() == [0, 1, 2]


def test_columns_that_forget_a_state_in_different_ways_do_not_recall_it_together():
    """In one nothing reads the last state, in the other nothing enters it."""
    A = np.zeros((2, 2, 2))
    A[:, 0, 0], A[0, 1, 0], A[1, 0, 1] = 0.5, 1.0, 1.0
    kept = living(A)
    assert (kept == [True, False]).all()
    found = of_order(lambda *_: A - np.eye(2), 1, kept[0], np.array([0, 1]), None).E
    assert found.ravel().tolist() == [-0.5, -0.5]


def test_interpolation_at_the_nodes_costs_few_roundings():
    for degree in DEGREES:
        with mpmath.workdps(40):
            exact = [[mpmath.cos(mpmath.pi * k * j / degree) for j in range(degree + 1)] for k in range(degree + 1)]
        _, transform = nodes(degree)
        scaled = transform * (degree / 2)
        scaled[:, [0, -1]] *= 2
        scaled[[0, -1]] *= 2
        assert np.abs(scaled - np.array(exact, float)).max() < 2 * EPS
