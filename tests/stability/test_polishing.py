"""Roots of critical functions to rounding, and the panels that they were found on."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

import wavesweep
from wavesweep.monodromy.batches import CACHED, in_parts
from wavesweep.stability import labelled, panels, polishing, stable_along_any
from wavesweep.stability.frames import Frames
from wavesweep.stability.guardian_maps import ONE, PAIR
from wavesweep.stability.panels import Found
from wavesweep.stability.polishing import _nearest, polished, vectors_of


def turning(size, angle):
    """A pair of eigenvalues of that size and angle, less identity, `(..., 2, 2)`."""
    E = np.zeros((*np.shape(size), 2, 2), np.result_type(size, angle))
    E[..., 0, 0] = E[..., 1, 1] = size * np.cos(angle) - 1
    E[..., 0, 1], E[..., 1, 0] = size * np.sin(angle), -size * np.sin(angle)
    return E


@pytest.mark.parametrize("slow", [1e-12, 1e-11])
@pytest.mark.parametrize("off", [1e-9, 1e-7, -1e-5])
def test_two_real_eigenvalues_next_to_one_hide_no_crossing(slow, off):
    """Their product differs from 1 by less than that of a pair does next to the place where it crosses, at p = 1."""

    def evaluate(_, p):
        E = np.zeros((p.size, 4, 4), p.dtype)
        E[:, :2, :2] = turning(np.exp(0.1 * (p - 1)), 0.7 + 0.2 * p)
        E[:, 2, 2], E[:, 3, 3] = -slow, -2 * slow
        return E

    one, none = np.array([0]), (np.zeros(0, int), np.zeros(0), np.zeros(0))
    found = panels.Found(one, np.array([PAIR]), np.array([1 + off]), np.array([1e-2]), one, none, none, none, one > 0, one > 0)
    loop = SimpleNamespace(pieces=SimpleNamespace(degree=one), piece=lambda column, _: 0 * column)
    ends = polished(evaluate, loop, found, (0.5, 1.6), lambda p: 1e-9 * np.abs(p))
    assert ends.theta.tolist() == [pytest.approx(0.9)]
    assert ends.good.all()
    np.testing.assert_allclose(ends.value, 1.0, rtol=1e-9)


def test_a_frame_that_is_not_known_is_no_end():
    """Newton's method may meet a value at which the loop has no frame; LAPACK would raise an error."""
    _, miss, *_ = _nearest(np.full((2, 3, 3), np.nan), np.array([PAIR, ONE]))
    assert (miss == np.inf).all()


@pytest.mark.parametrize("seed", range(6))
def test_ends_are_those_that_were_put_there(seed):
    """Pairs and single eigenvalues that cross at known values, seen through an unknown change of coordinates."""
    random = np.random.default_rng(seed)
    at, steep = np.sort(random.uniform(1, 9, 3)), random.uniform(0.01, 0.3, 3) * random.choice([-1, 1], 3)
    angles, T = random.uniform(0.3, 2.8, 2), np.linalg.qr(random.normal(size=(5, 5)))[0]

    def evaluate(_, p):
        E = np.zeros((*p.shape, 5, 5), p.dtype)
        for i in range(2):
            E[..., 2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = turning(np.exp(steep[i] * (p - at[i])), angles[i] + 0.02 * p)
        E[..., 4, 4] = np.exp(steep[2] * (p - at[2])) * (1 if seed % 2 else -1) - 1
        return T.T @ E @ T

    found = stable_along_any(evaluate, (0.5, 9.5), 1, np.ones(1))
    low = max([0.5, *at[steep < 0]])
    high = min([9.5, *at[steep > 0]])
    assert found.certified.all()
    if low < high:
        assert found.low.tolist() == [pytest.approx(low, rel=1e-11)]
        assert found.high.tolist() == [pytest.approx(high, rel=1e-11)]
    else:
        assert found.count.tolist() == [0]


@pytest.mark.parametrize("end", [-1, 1])
def test_roots_that_crowd_next_to_an_end_take_few_panels(end):
    """Two roots 2e-5 apart at 0.97 of the span: a panel of a fourth is next, and not a half."""
    asked = []

    def sample(column, x):
        asked.append(len(column) * np.isrealobj(x))
        x = end * x
        value = ((x - 0.97) ** 2 - 1e-10)[None]
        size = np.abs(value)
        return value / size, np.log(size), np.ones(size.shape)

    found = panels.panel_roots(sample, np.zeros(1, int), -np.ones(1), np.ones(1), 1, 1e-9, 512)
    assert sorted(end * found.x) == [pytest.approx(0.97 - 1e-5, abs=1e-6), pytest.approx(0.97 + 1e-5, abs=1e-6)]
    assert sum(asked) <= 12


@pytest.mark.parametrize("bound", [-1.1, -1.001])
def test_no_samples_are_taken_where_the_ellipse_of_a_panel_is_beyond_the_bounds(bound):
    """A root of 1 - x**2/4 - exp(x + 0.3) within them."""
    asked = []

    def sample(_, x):
        asked.append(x)
        value = (1 - x**2 / 4 - np.exp(x + 0.3))[None]
        size = np.abs(value)
        return value / size, np.log(size), np.ones(size.shape)

    found = panels.panel_roots(sample, np.zeros(1, int), -np.ones(1), np.ones(1), 1, 1e-9, 512, (bound, np.inf))
    root = brentq(lambda x: 1 - x**2 / 4 - np.exp(x + 0.3), -1, 1)
    assert np.abs(found.x - root) <= found.within
    assert found.within.tolist() == [pytest.approx(0, abs=0.2)]
    assert not found.lost[0].size
    real, rims = ([x for x in asked if np.iscomplexobj(x) == imaginary] for imaginary in (False, True))
    assert sum(map(len, real)) == sum(map(len, rims))
    assert min(x.real.min() for x in asked) > bound


def test_bounds_within_the_span_end_the_search():
    asked = []

    def sample(_, x):
        asked.append(len(x))
        return x[None] * 0 + 1, x.real[None] * 0, np.ones((1, *x.shape))

    found = panels.panel_roots(sample, np.zeros(1, int), -np.ones(1), np.ones(1), 1, 1e-4, 64, (0.3, np.inf))
    assert sum(asked) < 500
    assert not found.x.size
    assert found.lost[0].size
    assert found.lost[1].min() == -1


@pytest.mark.parametrize("kind", [float, complex])
def test_a_batch_in_parts_has_the_same_bits(kind):
    E = np.random.default_rng(1).normal(size=(2 * CACHED // (25 * 8) + 7, 5, 5)).astype(kind) - np.eye(5)
    assert np.array_equal(in_parts(lambda part: E[part], E.shape[:1], 5, kind), E)


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize("form", ["(p-0.3)**2/(p+0.1)", "(p-0.3)**2*(1+3*p)"])
def test_ends_next_to_each_other_keep_their_digits(form):
    """A hole of a millionth: det A = s (1 - form), so its ends solve `form = 1 - 1/s`; a slope over its width is wrong."""
    A = [["0.4", "0.9"], [f"(0.4*1.1-s*(1-{form}))/0.9", "1.1"]]
    block = {"type": "ss", "discrete": True, "A": A, "B": [[0], [0]], "C": [[1, 0]], "outputs": ["y"]}
    tables = {"rates": {"tick_hz": 1000}, "numbers": {"p": 0.5, "s": 1.0}, "block": {"a": block}, "wire": {"a.u": 0}}
    s = 1 + np.geomspace(1e-6, 1e-4, 160) ** 2
    found = wavesweep.compile(tables).stable_intervals("p", (0, 1), s=s)
    known = found[found.certified]
    assert known.s.nunique() > 100
    for value, rows in known.groupby("s"):
        level = (value - 1) / value
        for side in (-1, 1):
            end = 0.3
            for _ in range(50):  # (p - 0.3)^2 is the level over the other factor, which varies slowly
                factor = 1 / (end + 0.1) if "/" in form else 1 + 3 * end
                end = 0.3 + side * np.sqrt(level / factor)
            ends = rows[["low", "high"]].to_numpy().ravel()
            assert np.abs(ends - end).min() <= 1e-9 * (end + 1e-5)


@pytest.mark.parametrize(("pivot", "wanted"), [(1.0, 2e-12), (0.4, 1e-6)])
def test_digits_that_an_entry_has_lost_are_told_beside_it_unless_a_loop_comes_near_its_pole(pivot, wanted):
    found = Frames(np.zeros((2, 1, 1)), np.array([[pivot], [1.0]]), np.array([16e6, 1.0]))
    moved = polishing._by_condition(np.full((2, 1), 1e-12), found)
    assert moved == pytest.approx([wanted])


def test_an_entry_that_is_smaller_than_its_own_error_says_nothing_of_it():
    found = Frames(np.zeros((2, 1, 1)), np.ones((2, 1)), np.array([1e16, 1.0]))
    assert polishing._by_condition(np.array([[0.0], [1e-12]]), found) == pytest.approx([2e-12])


def test_vectors_of_an_eigenvalue_beside_a_delay_that_has_too_few():
    """A chain of five delays in another basis, and an eigenvalue -1 that it drives."""
    E = np.diag([-1.0] * 5 + [-2.0]) + np.diag([1.0] * 5, -1)
    turned = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0]
    E = (turned @ E @ turned.T)[None]
    left, right = vectors_of(E, np.array([-2.0 + 0j]))
    np.testing.assert_allclose(left @ E, -2 * left, atol=1e-12)
    np.testing.assert_allclose(E @ right, -2 * right, atol=1e-12)
    np.testing.assert_allclose(left @ right, 1.0, rtol=1e-12)


def test_a_pair_that_crosses_at_a_small_angle_is_no_meeting():
    """Next to z = 1, where nothing else is."""
    angle = 5e-4
    pair = f"{float(-2 * np.cos(angle))!r} * (1 + p)"
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"p": 0.1},
        "block": {"a": {"type": "tf", "discrete": True, "num": [1], "den": [1, pair, "(1 + p)**2"]}},
        "wire": {"a.u": 0},
    }
    (row,) = wavesweep.compile(tables).stable_intervals("p", (-0.3, 0.2)).itertuples()
    assert row.certified
    assert row.low == -0.3
    assert row.high == pytest.approx(0, abs=1e-14)
    assert row.high_omega == pytest.approx(1000 * angle, rel=1e-6)


def test_a_pair_that_crosses_beside_z_1_is_no_root_there():
    """The pair is nearer to z = 1 than the real eigenvalue, and on the circle."""
    pair = np.array([[np.cos(0.01), np.sin(0.01)], [-np.sin(0.01), np.cos(0.01)]])
    E = np.zeros((1, 3, 3))
    E[0, :2, :2], E[0, 2, 2] = pair - np.eye(2), 0.05
    assert _nearest(E, np.array([ONE]))[1][0] == np.inf
    E[0, 2, 2] = 0.005
    assert _nearest(E, np.array([ONE]))[1][0] == pytest.approx(1.005**2 - 1)
    assert _nearest(E, np.array([PAIR]))[1][0] == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize(
    ("roots", "lost", "wanted"),
    [
        ([], (), True),
        ([0.3, 0.4, 0.6], (), True),
        ([0.51, 0.52, 0.53, 0.54], (), False),  # two leave, and two enter
        ([0.3, 2.0], (), True),
        ([0.1, 0.3, 0.6, 0.7, 0.8, 0.9], (), True),  # and they are unstable at half of it too
        ([], (0.9, 1.1), False),  # there may be more roots
        ([], (1.1, 1.2), True),
    ],
)
def test_a_part_is_unstable_throughout_if_too_few_roots_are_in_it(roots, lost, wanted):
    """Two eigenvalues are unstable at both ends of the part from 0 to 1."""
    none, roots = (np.zeros(0, int), np.zeros(0), np.zeros(0)), np.array(roots)
    open_ = (np.zeros(1, int), np.array(lost[:1]), np.array(lost[1:])) if lost else none
    nothing = np.zeros(roots.size)
    found = Found(nothing.astype(int), nothing + ONE, roots, nothing, nothing, open_, none, none, *np.zeros((2, 1), bool))
    E = np.diag([0.5, 0.5, -0.5])

    def evaluate(_, p):
        return Frames.of(np.broadcast_to(E, (p.size, 3, 3)))

    part = np.zeros(1, int), np.zeros(1), np.ones(1)
    assert labelled.never_stable(evaluate, found, *part).tolist() == [wanted]


@pytest.mark.parametrize(("unstable", "kind", "wanted"), [(1, PAIR, True), (1, ONE, False), (2, PAIR, False)])
def test_pairs_alone_leave_an_odd_number_outside(unstable, kind, wanted):
    """Three roots next to each other, and so many eigenvalues outside at both ends."""
    none, nothing = (np.zeros(0, int), np.zeros(0), np.zeros(0)), np.zeros(3)
    roots = np.array([0.51, 0.52, 0.53])
    found = Found(nothing.astype(int), nothing + kind, roots, nothing, nothing, none, none, none, *np.zeros((2, 3), bool))
    E = np.diag([0.5] * unstable + [-0.5] * (3 - unstable))

    def evaluate(_, p):
        return Frames.of(np.broadcast_to(E, (p.size, 3, 3)))

    part = np.zeros(1, int), np.zeros(1), np.ones(1)
    assert labelled.never_stable(evaluate, found, *part).tolist() == [wanted]


def test_next_to_two_eigenvalues_vectors_are_sought_farther_away():
    """At z = 1 with a second eigenvalue 0.951, where a matrix a rounding beside is singular; the end solves a quadratic."""
    rows = [["0", "-(0.94105 + p + p*p)"], ["1", 1.951]]
    block = {"type": "ss", "discrete": True, "A": rows, "B": [[1.0], [0.0]], "C": [[0.0, 1.0]], "outputs": ["y"]}
    tables = {"rates": {"tick_hz": 1000}, "numbers": {"p": 0.3}, "block": {"a": block}, "wire": {"a.u": 0}}
    (row,) = wavesweep.compile(tables).stable_intervals("p", (-0.4, 1.6)).itertuples()
    assert row.certified
    assert row.low == pytest.approx(0.009852919968102188, rel=1e-13)


@pytest.mark.sample(2)
@pytest.mark.parametrize("apart", [1e-7, 1e-8, 2e-9, 1e-9])
def test_an_end_of_one_of_two_pairs_that_nearly_coincide_is_right_or_in_doubt(apart):
    """Coupled to its twin, whose vectors are in its own; the end is where the last entry of its block is -1."""
    end, angle = 4.3389802407545804e-05, 0.06081193099446768
    rows = [
        ["0", f"-(1 - {apart})", "0", "0", 1.303240432101923],
        ["1", angle, -0.2559611134950909, "0", "0"],
        ["0", "0", 0.8454375816516613, -0.20601037288640878, -0.3836576922445406],
        ["0", "0", "0", "0", f"-(1 - 0.08748955721828816*(p - {end!r}))"],
        ["0", "0", "0", "1", angle],
    ]
    block = {"type": "ss", "discrete": True, "A": rows, "B": [[1.0]] * 5, "C": [[1.0] * 5], "outputs": ["y"]}
    tables = {"rates": {"tick_hz": 1}, "numbers": {"p": 0.7}, "block": {"a": block}, "wire": {"a.u": 0}}
    (row,) = wavesweep.compile(tables).stable_intervals("p", (-1.0, 1.0)).itertuples()
    assert row.certified == (apart > 5e-8)
    assert not row.certified or abs(row.low - end) < 6e-14
