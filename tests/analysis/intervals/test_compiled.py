"""The compiled kernel against numpy, which is its reference; a run that uses it says so, others do not load it."""

import errno
import subprocess
import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from flint import arb_mat, ctx
from support import certified
from support.specs import nested, random_values

import wavesweep
from wavesweep import kernel, results, sweep
from wavesweep.analysis.doubt import NONE
from wavesweep.analysis.intervals import critical, stable, stable_intervals
from wavesweep.analysis.intervals.arcs import arc_crossings
from wavesweep.analysis.intervals.bernstein import change_of_basis, largest_bernstein, roots_by_sign
from wavesweep.analysis.intervals.boundary import end_errors
from wavesweep.analysis.intervals.interpolated import DEGREES, Pieces, interpolated_loop
from wavesweep.analysis.intervals.living import typical
from wavesweep.analysis.intervals.panels import NODE, RIM
from wavesweep.analysis.spectrum import count_outside
from wavesweep.bench.this_tool import profile_rows
from wavesweep.diagram import draw
from wavesweep.errors import UsageError, WavesweepError
from wavesweep.lifted import close, cut_at_wall
from wavesweep.results.verify import verify
from wavesweep.spec import load
from wavesweep.sweep.checkpoint import identity_of
from wavesweep.sweep.interval_job import job_of

pytest.importorskip("numba")

FIXED = {"K_VE": np.array([[0.0, 0.3, 2.0, 7.0, 40.0]]), "B_VE": np.array([[0.0, 20.0, 300.0, 2000.0, 9000.0]])}
SPANS = {"K_VE": (0.0, 20000.0), "B_VE": (0.0, 300.0)}


def both(cut, along, fixed):
    """The intervals by numpy and by the kernel."""
    found = []
    for name in (kernel.NUMPY, kernel.NUMBA):
        with kernel.using(name):
            found.append(stable_intervals(cut, along, SPANS[along], fixed))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("along", ["K_VE", "B_VE"])
@pytest.mark.parametrize("seed", range(60))
def test_the_kernel_finds_what_numpy_finds(seed, along):
    cut = cut_at_wall(draw(random_values(7000 + seed))).at(np.newaxis)
    numpys, kernels = both(cut, along, FIXED[along])
    known = np.isin(numpys.column, kernels.column[kernels.certified]) & numpys.certified
    assert known.sum() == numpys.certified.sum()
    others = np.isin(kernels.column, numpys.column[numpys.certified])
    for name in ("column", "index", "count"):
        np.testing.assert_array_equal(getattr(kernels, name)[others], getattr(numpys, name)[known])
    size = SPANS[along][1]
    for name in ("low", "high"):
        np.testing.assert_allclose(getattr(kernels, name)[others], getattr(numpys, name)[known], rtol=1e-9, atol=1e-14 * size)
    for name in ("low_omega", "high_omega"):
        np.testing.assert_allclose(getattr(kernels, name)[others], getattr(numpys, name)[known], rtol=1e-6, atol=1e-6)


def test_most_columns_are_proved_by_the_kernel_itself(monkeypatch):
    left, numpys = [], stable._by_numpy

    def counting(cut, owner, *given):
        left.append(owner.size)
        return numpys(cut, owner, *given)

    monkeypatch.setattr(stable, "_by_numpy", counting)
    with kernel.using(kernel.NUMBA):
        for seed in range(40):
            cut = cut_at_wall(draw(random_values(7000 + seed, "pmw-lm"))).at(np.newaxis)
            stable_intervals(cut, "K_VE", SPANS["K_VE"], FIXED["K_VE"])
    assert sum(left) < 0.2 * 40 * FIXED["K_VE"].size


@pytest.mark.parametrize("along", ["K_VE", "B_VE"])
def test_columns_have_the_same_bits_alone(along):
    cut = cut_at_wall(draw(random_values(7003, "pmw-lm") | {"controller.b": np.linspace(5, 60, 9)}))
    fixed = np.repeat(FIXED[along], 9, axis=0)
    with kernel.using(kernel.NUMBA):
        whole = stable_intervals(cut, along, SPANS[along], fixed)
        for loop in (0, 4, 8):
            one = stable_intervals(cut.at(slice(loop, loop + 1)), along, SPANS[along], fixed[:1, 2:4])
            at = np.isin(whole.column, [5 * loop + 2, 5 * loop + 3])
            for name in ("low", "high", "low_omega", "high_omega", "residual", "doubt"):
                assert np.array_equal(getattr(one, name), getattr(whole, name)[at], equal_nan=True)
    assert (whole.doubt == NONE).all()


def test_a_wall_that_reads_nothing_is_no_division_by_zero():
    cut = cut_at_wall(draw(random_values(7003, "pmw"))).at(np.newaxis)
    numpys, kernels = both(replace(cut, C=0 * cut.C, D=0 * cut.D), "B_VE", FIXED["B_VE"])
    np.testing.assert_array_equal(kernels.count, numpys.count)
    np.testing.assert_array_equal(kernels.doubt, numpys.doubt)


def in_lanes(numbers):
    """Complex numbers `(..., LANES)` as the kernel's vectors."""
    return np.stack([numbers.real, numbers.imag], axis=-2).ravel()


def from_lanes(vectors):
    """The kernel's vectors as complex numbers `(vectors, LANES)`."""
    parts = vectors.reshape(-1, 2, 8)
    return parts[:, 0] + 1j * parts[:, 1]


@pytest.mark.parametrize("n", [1, 3, 8, 15])
def test_lanes_solve_what_numpy_solves(n):
    from wavesweep.analysis.intervals.compiled.curve import _row_order
    from wavesweep.analysis.intervals.compiled.solving import _room, _solved_transposed, _states

    random = np.random.default_rng(n)
    E, B = random.normal(size=(n, n)) * 10.0 ** random.uniform(-6, 0, (n, 1)), random.normal(size=n)
    w, given = np.exp(1j * np.geomspace(1e-4, np.pi, 8)) - 1, random.normal(size=(n, 8)) + 1j * random.normal(size=(n, 8))
    room = _room(n)
    room[3][1, :16] = in_lanes(w)
    _states(E, B, _row_order(E, 0.1), room)
    states, left = from_lanes(room[2][0]), np.empty(16 * n)
    _solved_transposed(n, room[0], room[1], in_lanes(given), left)
    for lane in range(8):
        A = w[lane] * np.eye(n) - E
        whole = np.linalg.solve(A, B)
        np.testing.assert_allclose(states[:, lane], whole, rtol=1e-12, atol=1e-13 * np.abs(whole).max())
        back = np.linalg.solve(A.T, given[:, lane])
        np.testing.assert_allclose(from_lanes(left)[:, lane], back, rtol=1e-9, atol=1e-11 * np.abs(back).max())


def test_a_lane_is_what_it_is_whatever_the_others_are():
    """One has a row exchanged of its own: its pivot is 0 in the order that suits the rest."""
    from wavesweep.analysis.intervals.compiled.solving import _room, _states

    E, B, w = np.array([[0.5, 1.0], [1.0, 0.25]]), np.ones(2), np.array([0.5, 0.1, 1j, -2, -1, 1e-3, 0.2j, 3], complex)
    room, alone = _room(2), _room(2)
    room[3][1, :16] = in_lanes(w)
    _states(E, B, np.arange(2), room)
    for lane in range(8):
        alone[3][1, :16] = in_lanes(np.full(8, w[lane]))
        _states(E, B, np.arange(2), alone)
        assert np.array_equal(from_lanes(alone[2][0])[:, 3], from_lanes(room[2][0])[:, lane])
        np.testing.assert_allclose(from_lanes(room[2][0])[:, lane], np.linalg.solve(w[lane] * np.eye(2) - E, B), rtol=1e-14)
    assert not np.array_equal(room[1][:, 0], room[1][:, 1])


def test_solutions_are_refined():
    """Rows in the worst order and entries over nine decades: what is left is rounding of each equation's own terms."""
    from wavesweep.analysis.intervals.compiled.curve import _row_order
    from wavesweep.analysis.intervals.compiled.solving import _room, _states

    random, n = np.random.default_rng(2), 12
    w = np.exp(1j * np.geomspace(1e-3, np.pi, 8)) - 1
    for _ in range(20):
        E = random.normal(size=(n, n)) * 10.0 ** random.uniform(-9, 0, (n, 1))
        B, room = random.normal(size=n) * np.abs(E).sum(1), _room(n)
        room[3][1, :16] = in_lanes(w)
        _states(E, B, _row_order(E, 0.1)[::-1].copy(), room)
        x = from_lanes(room[2][0])
        terms = np.abs(w * x) + np.abs(E) @ np.abs(x) + np.abs(B)[:, None]
        assert np.all(np.abs(w * x - E @ x - B[:, None]) <= n * np.finfo(float).eps * terms)


def test_a_singular_system_has_no_number_and_no_error():
    from wavesweep.analysis.intervals.compiled.solving import _room, _states

    room = _room(3)
    room[3][1, :16] = 0.0
    _states(np.ones((3, 3)), np.ones(3), np.arange(3), room)
    assert np.isnan(room[2][0]).any()


@pytest.mark.parametrize("along", ["K_VE", "B_VE"])
@pytest.mark.parametrize("seed", [0, 1, 2, 4, 5])
def test_what_rounding_moves_is_bounded_and_no_more_than_numpy_says(seed, along):
    """Every entry of a loop moved at random by a million roundings."""
    from wavesweep.analysis.intervals.compiled import _arrays
    from wavesweep.analysis.intervals.compiled.curve import _end, _judged, _polished, _row_order
    from wavesweep.analysis.intervals.compiled.solving import _room

    cut = cut_at_wall(draw(random_values(7010 + seed, "pmw-lm"))).at(np.newaxis)
    arrays, random, top = [part[0] for part in _arrays(cut)], np.random.default_rng(seed), SPANS[along][1]
    crossing = arc_crossings(cut, along, FIXED[along][0, 2:3], SPANS[along])
    at = np.flatnonzero((crossing.theta > 0) & (crossing.theta < np.pi) & (np.abs(crossing.value) < top))[:1]
    assert at.size
    theta, y = np.repeat(crossing.theta[at], 8), np.full(8, FIXED[along][0, 2])
    room, value, good = _room(len(arrays[0])), np.empty(8), np.empty(8, bool)
    facts = cut.integrates, along == "K_VE", _row_order(arrays[0], 0.1)
    _polished((*arrays, *facts), y, theta, value, good, top, room)
    assert good.all()
    residual, moved, usual = np.empty((3, 8))
    _end((*arrays, *facts), 1.0, y, value, theta, 0.0, residual, moved, usual, room)
    numpys = end_errors(cut, along, y[:1], value[:1], np.exp(1j * theta[:1]) - 1, np.zeros(1, bool))
    assert residual[0] <= 64 * usual[0] + 1e-14
    assert 0 < moved[0] <= 1.5 * numpys[1][0]
    seen = []
    for _ in range(100):
        rounded = [part * (1 + 2.0**-32 * random.choice([-1.0, 1.0], part.shape)) for part in arrays]
        there, other = theta.copy(), np.empty(8)
        _polished((*rounded, *facts), y, there, other, good, top, room)
        seen.append(abs(other[0] - value[0]) * 2.0**-20)
    assert 1e-3 * moved[0] < max(seen) < moved[0]
    judged = np.empty(8)
    for condition, off, doubted in ((1.0, 0.0, False), (1e9, 0.0, True), (1.0, 1e-6, True)):
        _judged((*arrays, *facts), condition, y, value * (1 + off), theta, top, judged, room)
        assert np.isinf(judged).all() == doubted


@pytest.mark.parametrize("n", [2, 5, 9, 16])
def test_signs_decide_as_they_do_in_numpy(n):
    from wavesweep.analysis.intervals.compiled.isolating import _pieces, _roots

    random = np.random.default_rng(n)
    rows = random.normal(size=(400, n)) * 0.5 ** np.arange(n)
    rows[::5] = np.round(rows[::5], 1)
    rows /= np.abs(rows).max(-1, keepdims=True)
    noise = 10.0 ** random.uniform(-16, -3, 400)
    (row, value, _, slope), complete = roots_by_sign(rows, noise)
    pieces = _pieces(n)
    for i in range(400):
        values, slopes = np.empty(n), np.empty(n)
        count = _roots(rows[i].copy(), noise[i], change_of_basis(n), largest_bernstein(n - 1), 0.0, pieces, values, slopes)
        assert (count >= 0) == complete[i]
        if complete[i]:
            np.testing.assert_allclose(values[:count], value[row == i], rtol=1e-12, atol=1e-15)
            np.testing.assert_array_equal(slopes[:count], slope[row == i])


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("n", [1, 2, 3, 6, 9, 14])
def test_characteristic_polynomials_and_functions_are_those_of_numpy_to_their_errors(n, kind):
    random = np.random.default_rng(n)
    E = random.normal(size=(40, n, n)) * 10.0 ** random.uniform(-4, 1, (40, n, 1)) + 0 * np.zeros(1, kind)
    E = E + (0.3j * random.normal(size=E.shape) if kind is complex else 0)
    E[0], E[1, :, 0], E[2] = 0.0, 0.0, np.diag(np.arange(n))
    found = []
    for name in (kernel.NUMPY, kernel.NUMBA):
        with kernel.using(name):
            c = critical.characteristic(E)
            found.append((c, critical.from_polynomials(*c), critical.from_coefficients(E)))
    (numpys, *numpy_values), (kernels, *kernel_values) = found
    np.testing.assert_array_equal(kernels[2], numpys[2])
    assert (np.abs(kernels[0] - numpys[0]) <= 8 * n * np.finfo(float).eps * (numpys[1] + kernels[1])).all()
    for (phase, log, error), (other, other_log, other_error) in zip(numpy_values, kernel_values, strict=True):
        believed = np.finfo(float).eps * np.minimum(error, other_error) < 1e-3
        assert believed.mean() > 0.8
        ratio = other[believed] * np.exp(other_log[believed] - log[believed]) / phase[believed]
        off = np.abs(1 - ratio)
        assert (off <= 4 * np.finfo(float).eps * (8 * n + np.maximum(error, other_error)[believed])).all()
        np.testing.assert_allclose(other_error[believed], error[believed], rtol=0.1)


@pytest.mark.parametrize("points", [20, 8])
def test_functions_between_samples_are_those_of_numpy_to_their_errors(points):
    loop, place = wavesweep.compile({"controller": {"kind": "pmw-lm"}}), RIM if points == RIM.size else NODE

    def evaluate(column, p):
        values = loop.spec.values | {"device.mass": p, "controller.b": 20.0 + 10.0 * column}
        return close(cut_at_wall(draw(values)), 100.0, 1.0)

    sizes = typical(evaluate, (0.1, 0.4), 2)[1]
    whole = interpolated_loop(evaluate, (0.1, 0.4), 2, (0.0, np.inf), sizes, np.ones(sizes.shape[-1], bool))
    pieces = whole.pieces
    assert (pieces.degree > 0).all()
    piece = np.repeat(np.arange(pieces.column.size), 3)
    half = pieces.half[piece] * np.tile([1.0, 0.3, 0.01], pieces.column.size)  # the first panel of each is the piece itself
    p = pieces.middle[piece, None] + half[:, None] * place
    found = []
    for name in (kernel.NUMPY, kernel.NUMBA):
        with kernel.using(name):
            found.append(whole.functions(piece, p))
    (phase, log, error), (other, other_log, other_error) = found
    off = np.abs(1 - other * np.exp(other_log - log) / phase)
    believed = np.finfo(float).eps * error < 1e-3
    assert believed.mean() > 0.8
    assert (off <= 4 * np.finfo(float).eps * (100 + np.maximum(error, other_error)))[believed].all()
    np.testing.assert_allclose(other_error[believed], error[believed], rtol=0.1)


def test_what_is_not_finite_between_samples_is_not_known():
    from wavesweep.analysis.intervals.compiled.functions import interpolated as by_kernel

    wrong = np.zeros((1, DEGREES[-1] + 1, 3))
    wrong[0, 0] = np.nan
    one, none = np.ones(1), np.zeros((1, 3))
    pieces = Pieces(
        *(0 * one.astype(int), 0 * one, one, one / 2, one / 2, np.full(1, DEGREES[0])),
        *(wrong, none, none, none[..., None, :] + 0j, none[..., None, :], one),
    )
    phase, log, error = by_kernel(pieces, np.zeros(1, int), np.zeros((1, 2)))
    assert np.isnan(phase).all()
    assert (log == np.inf).all()
    assert (error == critical.MOST_ERROR).all()


def test_a_polynomial_of_zeros_has_no_functions_and_no_error():
    c, reach, size = np.zeros((4, 2), complex), np.zeros((4, 2)), np.ones(2)
    with kernel.using(kernel.NUMBA):
        _, log, error = critical.from_polynomials(c, reach, size)
    assert (log[critical.PAIR] == -np.inf).all()
    assert (error[critical.PAIR] == critical.MOST_ERROR).all()


def test_slices_along_any_number_are_those_of_numpy():
    loop, found = wavesweep.compile({"controller": {"kind": "pmw-lm"}}), []
    for name in (kernel.NUMPY, kernel.NUMBA):
        with kernel.using(name):
            found.append(loop.stable_intervals("device.mass", (0.05, 1.0), b=[12.0, 25.0, 40.0]))
    numpys, kernels = found
    assert kernels.certified.all()
    np.testing.assert_array_equal(kernels.intervals, numpys.intervals)
    np.testing.assert_allclose(kernels.low, numpys.low, rtol=1e-9)
    np.testing.assert_allclose(kernels.high, numpys.high, rtol=1e-9)


@pytest.mark.parametrize("along", ["K_VE", "B_VE"])
@pytest.mark.parametrize("kind", ["pmw", "pmw-lm"])
def test_closed_loops_and_their_counts_are_those_of_numpy(kind, along):
    from wavesweep.analysis.intervals.compiled import _arrays, counting
    from wavesweep.analysis.intervals.compiled.labelling import _closed

    cut = cut_at_wall(draw(random_values(7003, kind))).at(np.newaxis)
    value, fixed = np.linspace(0, SPANS[along][1], 40), np.repeat(FIXED[along][0], 8)
    owner, column = np.zeros(40, int), np.arange(40)
    A, known = _closed(*_arrays(cut), cut.integrates, along == "K_VE", owner, fixed, column, value)
    numpys = close(cut.at(owner), *((value, fixed) if along == "K_VE" else (fixed, value)))
    np.testing.assert_allclose(A, numpys, rtol=1e-14, atol=1e-14 * np.abs(numpys).max())
    count, sure = count_outside(numpys)
    found = counting.count_outside(A)
    told = found >= 0
    assert told.sum() > 35
    np.testing.assert_array_equal(np.where(sure, count, -1)[told], found[told])
    value[5] = np.inf
    _, known = _closed(*_arrays(cut), cut.integrates, along == "K_VE", owner, fixed, column, value)
    assert not known[5]
    assert known.sum() == 39


@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_eigenvalues_counted_by_signs_are_those_of_ball_arithmetic(n):
    """They are next to the circle; the ill-conditioned ones are not sure, and none that is sure is wrong."""
    from wavesweep.analysis.intervals.compiled import counting

    random, told, before = np.random.default_rng(n), [], ctx.prec
    ctx.prec = 2000
    try:
        for _ in range(60):
            radius = 1 + random.choice([-1, 1], n) * 10.0 ** random.uniform(-16 / n, 0, n)
            own = np.diag(radius * random.choice([-1, 1], n) - 1) + np.triu(random.normal(size=(n, n)), 1)
            change = np.linalg.qr(random.normal(size=(n, n)))[0] * 2.0 ** random.integers(-8, 8, n)
            E = np.linalg.solve(change, own @ change)
            found = counting.count_outside(E[None])[0]
            told.append(found >= 0)
            whole = arb_mat(n, n, E.ravel().tolist()) + arb_mat(n, n, np.eye(n).ravel().tolist())
            if found >= 0:
                assert found == certified.count_outside(whole.charpoly())
    finally:
        ctx.prec = before
    assert 10 <= sum(told) < 60


def test_a_count_by_signs_that_is_not_sure_is_left_to_eigenvalues():
    from wavesweep.analysis.intervals.compiled import counting

    apart = np.array(
        [[[-0.5, 0.0], [0.0, 0.5]], [[-1e-9, 1.0], [0.0, -1e-9]], [[np.nan, 1.0], [0.0, 1.0]], [[-1.0, 1.0], [2.0, 0.5]]]
    )
    assert counting.count_outside(apart).tolist() == [1, -1, -1, 1]
    with kernel.using(kernel.NUMBA):
        count, sure = count_outside(apart)
    assert sure.tolist() == [True, False, False, True]
    assert count[sure].tolist() == [1, 1]


def test_both_ends_of_a_stable_interval_are_judged_before_the_kernel_proves_it():
    """If rounding of the loop may be large, a column with an end inside the range is left, whichever end it is."""
    from wavesweep.analysis.intervals import compiled

    owner, alone = np.zeros(5, int), {"low": 0, "high": 0}
    for seed, along in product(range(40), SPANS):
        cut = cut_at_wall(draw(random_values(7000 + seed))).at(np.newaxis)
        given, (low, high) = (owner, along, FIXED[along][0] + 0.1, SPANS[along]), SPANS[along]
        found, _ = compiled.proved(cut, *given)
        left = compiled.proved(replace(cut, condition=1e12), *given)[1]
        one = (found.count == 1) & (found.column < 5)
        for name, inner, outer in (("low", found.low > low, found.high == high), ("high", found.high < high, found.low == low)):
            single = found.column[one & inner & outer]
            alone[name] += single.size
            assert np.isin(single, left).all()
    assert min(alone.values()) >= 3


@pytest.mark.parametrize(("last", "agreed"), [(3, 4.0), (2, np.nan), (-1, np.nan)])
def test_the_first_and_the_last_column_of_a_loop_have_to_agree(last, agreed):
    from wavesweep.analysis.intervals.compiled.labelling import _agreed

    bounds, start, counted = np.tile([[0.0], [10.0]], 3), np.arange(4), np.array([True, False, True])
    above, begins = np.array([0.0, 5.0, 1.0]), np.array([4, -1, last])
    assert np.array_equal(_agreed(0, 3, start, bounds, 10.0, counted, above, begins), agreed, equal_nan=True)


def test_regions_that_come_out_stable_are_counted_in_counted_columns_and_where_they_are_narrow():
    """Two crossings of two eigenvalues in each of three columns; the last regions are stable, the one between narrow or not."""
    from wavesweep.analysis.intervals.compiled.labelling import OPEN, _followed

    rise, start, owner = np.tile([0.0, -2.0], 3), np.arange(0, 7, 2), np.zeros(3, int)
    counted, seen = np.array([True, False, True]), np.array([2, 2])
    for width, claimed in ((5.0, [1, 5]), (1e-8, [1, 3, 5])):
        bounds = np.array([[0.0, 5.0] * 3, [5.0, 10.0] * 3])
        bounds[1, 3] = 5.0 + width
        state = np.full(3, OPEN)
        begins, found = _followed(owner, state, start, bounds, 10.0, counted, seen, np.zeros(3), rise)
        assert begins.tolist() == [2, 2, 2]
        assert found.tolist() == claimed
        assert (state == OPEN).all()


def test_compiled_code_is_beside_the_sources_or_in_the_users_cache(monkeypatch, tmp_path):
    from wavesweep.lifted.compiled import caching

    monkeypatch.setattr(caching.config, "CACHE_DIR", "")
    monkeypatch.setattr(caching, "__file__", str(tmp_path / "compiled" / "caching.py"))
    earlier = tmp_path / "compiled" / "__pycache__" / "wavesweep-0123456789abcdef"
    earlier.mkdir(parents=True)
    place = caching._place()
    assert place.parent == earlier.parent
    assert not earlier.exists()
    monkeypatch.setattr(caching.os, "access", lambda *_: False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert caching._place().parent == tmp_path / "cache" / "wavesweep"


SMALL = {
    "controller": {"kind": "pmw-lm"},
    "sweep": {"along": "K_VE", "K_VE": {"start": 0, "stop": 20000}, "B_VE": [0.5, 1.0, 5.0], "b": [10.0, 20.0]},
}  # fmt: skip


def test_a_table_says_by_which_kernel_it_was_made(tmp_path):
    with kernel.using(kernel.NUMBA):
        table = sweep.intervals(load(SMALL), jobs=1)
        results.publish(table, tmp_path)
        assert any("to the bit" in sentence for sentence in verify(tmp_path).checked)
    assert table.facts["kernel"].startswith("numba 0.")
    assert any("to 1e-09" in sentence for sentence in verify(tmp_path).checked)
    assert verify(tmp_path).differences == ()
    assert "kernel" not in sweep.intervals(load(SMALL), jobs=1).facts


@pytest.mark.slow
def test_workers_use_the_kernel_of_the_run():
    spec = load(SMALL)
    with kernel.using(kernel.NUMBA):
        here, there = (sweep.intervals(spec, jobs=jobs, backend=backend).columns for jobs, backend in ((1, None), (2, "loky")))
    for name, column in here.items():
        assert column.astype(str).tolist() == there[name].astype(str).tolist()


def test_the_benchmark_knows_the_stages_of_the_kernel():
    with kernel.using(kernel.NUMBA):
        rows = list(profile_rows(repeats=1))
    assert {"compiled kernel", "draw and discretise"} <= {row["method"] for row in rows}
    assert "polish" not in {row["method"] for row in rows}


def test_chunks_of_another_kernel_are_of_another_run():
    job = job_of(load(SMALL), None)
    with kernel.using(kernel.NUMBA):
        other = identity_of(job)
    assert other.keys() - identity_of(job).keys() == {"kernel"}


def test_another_word_or_a_missing_extra_gets_a_message_that_says_what_to_do(monkeypatch):
    loop = wavesweep.compile(nested(random_values(7003, "pmw")))
    monkeypatch.setenv(kernel.VARIABLE, "cuda")
    with pytest.raises(UsageError, match="WAVESWEEP_KERNEL=cuda: expected numpy or numba"):
        loop.stable_intervals()
    monkeypatch.setenv(kernel.VARIABLE, kernel.NUMBA)
    monkeypatch.setattr(kernel, "_installed", lambda: False)
    with pytest.raises(WavesweepError, match=r"pip install 'wavesweep\[numba\]'"):
        loop.stable_intervals()


@pytest.mark.slow
def test_numba_is_loaded_only_if_it_is_chosen(monkeypatch):
    program = (
        "import sys, wavesweep\nwavesweep.compile({'controller': {'kind': 'pmw'}}).stable_intervals()\n"
        "print('numba' in sys.modules)"
    )
    said = []
    for word in ("", kernel.NUMBA):
        monkeypatch.setenv(kernel.VARIABLE, word)
        said.append(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.strip())
    assert said == ["False", "True"]


def test_compiled_code_belongs_to_all_sources_of_the_package(tmp_path):
    """A constant of any module may be in it."""
    from wavesweep.lifted.compiled import caching

    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "constants.py").write_text("BALANCING = 3\n")
    before = caching._place(tmp_path)
    assert caching._place(tmp_path) == before
    (tmp_path / "inner" / "constants.py").write_text("BALANCING = 0\n")
    assert caching._place(tmp_path) != before
    assert caching._place() == caching.PLACE


def test_a_full_disk_and_a_user_without_a_home_do_not_stop_the_kernel(monkeypatch):
    from numba.core.caching import Cache

    from wavesweep.lifted.compiled import caching

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Cache, "save_overload", full)

    def double(x):
        return 2 * x

    assert caching.compiled(double)(3) == 6
    monkeypatch.setattr(caching, "PLACE", None)
    assert caching.compiled(double)(3.5) == 7.0

    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(caching.os, "access", lambda *_: False)
    monkeypatch.setattr(caching.config, "CACHE_DIR", "")
    monkeypatch.setattr(caching.Path, "home", homeless)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert caching._place() is None
