"""On which side of the circle an eigenvalue is that leaves 1 where the span begins, against eigenvalues of 60 digits."""

import mpmath
import numpy as np
import pytest

import wavesweep
from wavesweep.engine._stability import covering, leaving_one
from wavesweep.engine._stability.along_any import stable_along_any
from wavesweep.engine._stability.sampled_frames import ParametricFrames
from wavesweep.engine.doubles import EPS

OFF = 1e-11  # of the entries at 0, what they may be off by


def family(seed):
    """Matrices less identity, `F(p) = F0 + p F1 + p^2 F2`, whose first column is 0 at p = 0, in mixed states.

    Others are anywhere, some next to the circle or next to 1. In the mixed states entries are off
    by what they may be off by, but F(0) is singular.
    """
    r, n = np.random.default_rng(seed), 4
    F = r.normal(size=(3, n, n)) * [[[0.4]], [[10.0 ** r.uniform(-2, 1)]], [[10.0 ** r.uniform(-2, 1)]]]
    F[0] -= np.eye(n) * [0, *(1 - r.choice([-1, 1], n - 1) * (1 - 10.0 ** r.uniform(-6, 0, n - 1)))]
    F[1, 0, 0] = r.choice([-1, 1]) * 10.0 ** r.uniform(-4, 1)
    F[0, :, 0] = 0
    mixed = np.linalg.qr(r.normal(size=(n, n)))[0] * 10.0 ** r.uniform(-2, 2, n)
    back = np.linalg.inv(mixed)
    error = OFF * np.abs(mixed @ F[0] @ back)
    off = error * r.uniform(-0.9, 0.9, (n, n))

    def matrices(_, p):
        p = np.ravel(p)[:, None, None]
        return mixed @ (F[0] + p * F[1] + p**2 * F[2]) @ back + off

    def outside(p):
        """The number of eigenvalues outside, and whether it is sure."""
        with mpmath.workdps(60):
            terms = [mpmath.matrix(each.tolist()) for each in F]
            w = mpmath.eig(terms[0] + mpmath.mpf(p) * terms[1] + mpmath.mpf(p) ** 2 * terms[2], left=False, right=False)
            return sum(abs(1 + each) > 1 for each in w)

    return matrices, error, outside


def proved(matrices, error=0.0):
    """How far it is proved from 0 on, and how many are outside there."""
    found = []

    def keep(*given):
        found.append(covering_proof(*given))
        return found[-1]

    errors = lambda _, p: (matrices(_, p), error + 4 * EPS * np.abs(matrices(_, p)))  # noqa: E731
    covering_proof = covering.proved_from_one
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(covering, "proved_from_one", keep)
        stable_along_any(ParametricFrames(matrices, np.ones(1), errors=errors), (0.0, 1.0), from_one=True)
    return [(float(reached[0]), int(outside[0])) for reached, outside in found]


def test_the_side_is_that_of_the_eigenvalues():
    reaching = 0
    for seed in range(60):
        matrices, error, outside = family(seed)
        for reached, count in proved(matrices, error):
            if reached > 0:
                reaching += 1
                assert {outside(reached * share) for share in (1e-12, 1e-4, 0.3, 1.0)} == {count}
    assert reaching > 30


def test_what_does_not_leave_1_with_a_speed_is_not_told():
    """An eigenvalue 1 - p^2, and two of them that leave 1 as +-sqrt(p)."""
    for at_p in (lambda p: [[-p * p, 0 * p], [0 * p, 0 * p - 0.5]], lambda p: [[0 * p, p], [1 + 0 * p, 0 * p]]):
        assert all(reached == 0 for reached, _ in proved(lambda _, p, at=at_p: np.moveaxis(np.array(at(np.ravel(p))), -1, 0)))


def uneven(rate, b=25.0, delay="frame"):
    """A spec as `init pmw` writes it, of an engine whose rate need not divide."""
    return {
        "rates": {"fast_hz": 1000, "slow_hz": rate},
        "device": {"mass": 0.1, "damping": 1.5, "velocity": "difference"},
        "environment": {"integration": "explicit", "delay": delay},
        "controller": {"kind": "pmw", "b": b},
        "filters": {"lp1": {"order": 1, "cutoff_hz": 10.0}},
    }


@pytest.mark.slow
def test_what_nothing_reads_without_a_wall_leaves_the_other_modes_their_digits():
    """A frame in which a position is read with 1e-300 of itself has eigenvectors as if it were 0, of many loops at once too."""
    spec = uneven(72)
    spec["device"] |= {"mass": 0.04502, "damping": 0.2987, "dead_time": 0.001488}
    spec |= {"controller": {"kind": "pmw-lm", "b": 10.0, "Kp": 0.0}, "local_model": {"K_LM": 100.0}}
    axes = {"B_VE": [1.0, 1.5, 2.0, 2.5], "b": [5.0, 10.0], "K_LM": [100, 300]}
    assert wavesweep.compile(spec).stable_intervals("K_VE", (0, 2000), **axes)["certified"].all()


@pytest.mark.asks("prove")
@pytest.mark.parametrize("rate", [60, 72])
def test_a_stiffness_is_told_from_none_without_balls_where_rates_do_not_divide(rate, monkeypatch):
    """The virtual wall stops the drift of the device, and nothing else does."""
    loop = wavesweep.compile(uneven(rate))
    asked = []
    monkeypatch.setattr("wavesweep.prove.columns.prove_column", lambda *given, **_: asked.append(given))
    found = loop.stable_intervals("K_VE", (0, 5000), B_VE=[0.5, 3.0, 10.0])
    assert found["certified"].all()
    assert (found["low"] == 0).sum() == 3
    assert (found["low_omega"][found["low"] == 0] == 0).all()
    assert not asked


def test_the_inverse_of_the_other_eigenvalues_is_bounded_for_all_that_entries_may_be():
    """Against inverses of matrices whose entries are as far off as they may be, `entries + 2 G`, in every way."""
    r, n = np.random.default_rng(5), 4
    far = r.uniform(0.5, 1, (1, n - 1))
    G = r.uniform(0, 0.02, (1, n, n))
    entries = r.uniform(0, 0.05, (1, n, n))
    names = ("speed", "unsure", "outside", "e0", "e1", "e2", "B0", "B1", "B2", "B3")
    beside = leaving_one._BesideOne(
        one=np.array([0]), others=np.arange(1, n)[None], far=far, G=G, **dict.fromkeys(names, np.zeros(1))
    )
    bound, resolved = beside._inverse_of_others(np.array([0]), entries)
    assert resolved.all()
    most = (entries + 2 * G)[0, 1:, 1:]
    ways = r.choice([-1, 1], (300, n - 1, n - 1))
    sizes = np.abs(np.linalg.inv(np.diag(far[0]) + most * np.concatenate([ways, [-np.ones_like(most)]])))
    assert (sizes <= bound[0] * (1 + 1e-12)).all()
    assert sizes.max(0) == pytest.approx(bound[0])  # the last way reaches it
