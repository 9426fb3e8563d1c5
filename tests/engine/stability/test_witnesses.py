"""Every reported end, and what lies between, before witnesses that know nothing of polynomials."""

import numpy as np
import pytest
from support import exact
from support.intervals import NUMBER, cut_of, intervals_of, mislabelled
from support.specs import nested, random_values, values_of

import wavesweep
from wavesweep.engine._monodromy.cut import FIRST
from wavesweep.engine._search.open_loops import Opened
from wavesweep.engine._stability.stable import stable_intervals

pytestmark = pytest.mark.slow

K_SPAN, B_SPAN = (0, 20000.0), (0, 300.0)


def columns(seed, along):
    """Zero and three random values of the other wall parameter, over their range of use."""
    r = np.random.default_rng(seed)
    return np.concatenate([[0], r.uniform(0, 15, 3) if along == "K_VE" else np.exp(r.uniform(0, 9, 3))])


@pytest.mark.parametrize("along", ["K_VE", "B_VE"])
def test_random_loops_are_labelled_as_a_fine_scan_of_eigenvalues_says(along):
    """Loops of all kinds, 4 columns each, 350 points a column; K_VE = 0 and B_VE = 0 among the columns."""
    span = K_SPAN if along == "K_VE" else B_SPAN
    for seed in range(8):
        cut, fixed = cut_of(random_values(seed)), columns(seed, along)
        found = stable_intervals(cut, NUMBER[along], span, fixed[None])
        assert mislabelled(cut, along, span, fixed, found) == [], seed


def test_random_columns_along_the_stiffness_are_all_certified():
    """A fallback that gives up, or a proof that became too timid, shows here."""
    for seed in range(120):
        found = stable_intervals(cut_of(random_values(seed)), FIRST, K_SPAN, columns(seed, "K_VE")[None])
        assert found.certified.all(), seed


@pytest.mark.parametrize("along", ["K_VE", "B_VE"])
def test_dominance_finds_what_the_polynomial_finds(along, monkeypatch):
    """The two ways share nothing but the loop; both prove nearly every column."""
    span, fixed, compared = *((K_SPAN, "B_VE") if along == "K_VE" else (B_SPAN, "K_VE")), 0
    for seed in range(0, 60, 20):
        loop, axis = wavesweep.compile(nested(random_values(seed))), {fixed: columns(seed, along)[1:]}
        usual = loop.stable_intervals(along, span, **axis)
        with monkeypatch.context() as patch:
            patch.setattr(Opened, "of", lambda *_, **__: None)
            other = loop.stable_intervals(along, span, **axis)
        for column in axis[fixed]:
            one, two = (found[found[fixed] == column] for found in (usual, other))
            if one.certified.all() and two.certified.all():
                ends = ["low", "high", "low_omega", "high_omega"]
                np.testing.assert_allclose(one[ends], two[ends], rtol=1e-9)
                compared += 1
    assert compared > 7


HARD = [  # in double precision: a long filter with slow poles, and next to no damping
    ("pmw", {"lp1_order": 12, "lp1_cutoff_hz": 10.0, "integration": "explicit"}),
    ("dc", {"velocity": "difference"}),
]


@pytest.mark.parametrize(("kind", "changes"), HARD)
def test_ends_of_hard_loops_hold_at_50_digits(kind, changes):
    """Each end, polished on the model's equations in 50 digits: angle and wall parameter good to 1e-9."""
    values = values_of(kind, **changes)
    found, loop = intervals_of(values, span=K_SPAN), exact.frame(values)
    assert found.certified.all()
    ends = [(e, w) for e, w in zip((*found.low, *found.high), (*found.low_omega, *found.high_omega), strict=True)]
    real = [(end, omega * float(loop.period)) for end, omega in ends if np.isfinite(omega) and omega > 0]
    assert real
    for end, theta in real:
        angle = exact.mp.pi
        if theta < 3.1415926:
            angle = exact.mp.findroot(lambda t: exact.mp.im(loop.value_at(t, "K_VE", 1.0)), exact.mp.mpf(theta))
        wanted = exact.mp.re(loop.value_at(angle, "K_VE", 1.0))
        assert abs(theta - angle) <= 1e-9 * angle
        assert abs(end - wanted) <= 1e-9 * wanted
