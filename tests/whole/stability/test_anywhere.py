"""Stable intervals along numbers that enter the loop in any way, held against eigenvalues and against the exact way."""

import numpy as np
import pytest
from meaning.judge import judge_intervals
from meaning.reading import drift_of

import wavesweep
from wavesweep.engine._stability.along_any import stable_along_any
from wavesweep.engine._stability.sampled_frames import ParametricFrames

BANK = {"controller": {"kind": "pmw-lm", "Kp": 20.0}, "environment": {"integration": "explicit", "K_VE": 1000.0}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "axis", "high"),
    [
        ("dc-slow", "operator.stiffness", 2000.0),
        ("dc-vc", "controller.K_VC", 5000.0),
        ("dc-vc-lm", "controller.B_VC", 100.0),
        ("pmw-lm", "operator.mass", 1.0),
    ],
)
def test_intervals_along_couplings_and_hands_are_those_of_the_documents(kind, axis, high):
    environment = {"integration": "explicit", "K_VE": 100.0 if kind.startswith("dc") else 1000.0}
    tables = {"controller": {"kind": kind, "Kp": 20.0}, "environment": environment}
    tables["sweep"] = {"along": axis, axis: {"start": 0.01 * high, "stop": high}}
    loop = wavesweep.compile(tables)
    assert loop.stable_intervals().certified.all()
    ends = judge_intervals(tables, drift_of(tables), loop)
    assert [one for one in ends if not one.same] == []


def test_along_the_wall_it_finds_what_the_exact_way_finds():
    """The general way, used on K_VE itself, whose ends are known exactly: holes and ends at z = -1 included."""
    from wavesweep.haptics.controller_page import wall_cut

    spec = {
        "controller": {"kind": "pmw"},
        "environment": {"integration": "explicit"},
        "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
    }
    loop = wavesweep.compile(spec)
    cut = wall_cut(loop.spec.values).at(np.newaxis)
    exact = loop.stable_intervals(span=(1.0, 20000.0))
    frames = ParametricFrames(lambda column, K: cut.at(column).closed(K, 1.0), np.full(1, 0.02))
    found = stable_along_any(frames, (1.0, 20000.0))
    assert found.certified.all()
    np.testing.assert_allclose(found.low, exact.low, rtol=1e-9)
    np.testing.assert_allclose(found.high, exact.high, rtol=1e-9)
    np.testing.assert_allclose(found.high_omega, exact.high_omega, rtol=1e-6)


def turning(size, angle):
    """A pair of eigenvalues of that size and angle, less identity, `(..., 2, 2)`."""
    E = np.zeros((*np.shape(size), 2, 2), np.result_type(size, angle))
    E[..., 0, 0] = E[..., 1, 1] = size * np.cos(angle) - 1
    E[..., 0, 1], E[..., 1, 0] = size * np.sin(angle), -size * np.sin(angle)
    return E


def test_a_pair_of_real_eigenvalues_with_product_one_is_no_end():
    """diag(p, 1/2) crosses at p = 1; at p = 2 the two are reciprocal, which changes nothing."""

    def evaluate(_, p):
        E = np.zeros((*p.shape, 2, 2), p.dtype)
        E[..., 0, 0], E[..., 1, 1] = p - 1, -0.5
        return E

    found = stable_along_any(ParametricFrames(evaluate, np.ones(1)), (0.1, 5.0))
    assert found.count.tolist() == [1]
    assert found.certified.all()
    np.testing.assert_allclose(found.high, 1.0, rtol=1e-12)


@pytest.mark.slow
def test_two_close_crossings_are_both_found():
    """A pair of eigenvalues that leaves the circle for 1e-6 of the span only."""

    def evaluate(_, p):
        return turning(1 + 1e-4 * (1e-12 - (p - 0.37) ** 2), 0.5)

    found = stable_along_any(ParametricFrames(evaluate, np.ones(1)), (0.0, 1.0))
    if found.certified.all():
        np.testing.assert_allclose(found.high[0], 0.37 - 1e-6, atol=1e-9)
        np.testing.assert_allclose(found.low[1], 0.37 + 1e-6, atol=1e-9)
    assert found.count[0] == 2 or not found.certified.any()


def test_a_loop_of_many_states_is_proved_where_it_is_stable_and_where_it_is_not():
    random = np.random.default_rng(5)
    turn, _ = np.linalg.qr(random.normal(size=(16, 16)))

    def evaluate(_, p):
        z = np.zeros((*p.shape, 16), p.dtype)
        z[..., 0], z[..., 1:] = p, np.linspace(-0.6, 0.6, 15)
        return turn @ (z[..., None] * turn.T) - np.eye(16)

    for span, highs in (((0.1, 5.0), [1.0]), ((3.0, 5.0), [])):
        found = stable_along_any(ParametricFrames(evaluate, np.ones(1)), span)
        assert found.certified.all()
        np.testing.assert_allclose(found.high[found.count > 0], highs, rtol=1e-9)


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

    found = stable_along_any(ParametricFrames(evaluate, np.ones(1)), (0.5, 9.5))
    low = max([0.5, *at[steep < 0]])
    high = min([9.5, *at[steep > 0]])
    assert found.certified.all()
    if low < high:
        assert found.low.tolist() == [pytest.approx(low, rel=1e-11)]
        assert found.high.tolist() == [pytest.approx(high, rel=1e-11)]
    else:
        assert found.count.tolist() == [0]


@pytest.mark.parametrize("apart", [1e-7, 1e-9])
def test_an_end_of_one_of_two_pairs_that_nearly_coincide_is_proved(apart):
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
    assert row.certified
    assert abs(row.low - end) < 6e-14
