"""The loop cut at the wall: its transfer functions at 50 digits, its poles, its drift."""

import numpy as np
import pytest
from support import exact
from support.specs import KINDS, random_values, values_of

from wavesweep.engine._monodromy.cut import ADVANCE, OFFSET, VELOCITY
from wavesweep.haptics.controller_page import wall_cut

SPECS = [(kind, seed) for kind in KINDS for seed in (range(2) if kind == "dc" else range(5))]


def wall_reads(cut, w):
    """(G_x, G_v) at `w = z - 1`."""
    state = np.linalg.solve(w * np.eye(cut.E.shape[-1]) - cut.E, cut.B + 0j)
    G = (cut.C @ state + cut.D)[:, 0]
    return (G[ADVANCE] / w if cut.integrates else 0) + G[OFFSET], G[VELOCITY]


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), SPECS)
def test_what_the_wall_reads_is_what_the_equations_say(kind, seed):
    """G_x and G_v on the circle, a hundredth of a turn from z = 1 and further."""
    values = random_values(seed, kind)
    cut, frame = wall_cut(values), exact.frame(values)
    for theta in (0.06, 0.9, 3.0):
        z = exact.mp.expj(theta)
        for found, wanted in zip(wall_reads(cut, complex(z - 1)), frame.transfer(z), strict=True):
            assert abs(found - wanted) <= 1e-10 * abs(wanted)


@pytest.mark.slow
@pytest.mark.parametrize(("K_LM", "Kp", "stiffness"), [(0.0, 0.0, 0.0), (500.0, 20.0, 100.0)])
def test_drifts_together_leave_no_eigenvalue_at_one(stiffness, Kp, K_LM):
    """A local model without stiffness drifts by itself, beside or instead of hand and avatar."""
    values = values_of("pmw-lm", stiffness=stiffness, Kp=Kp, K_LM=K_LM)
    cut = wall_cut(values)
    found = 1 + np.linalg.eigvals(cut.closed(500.0, 1.0))
    assert np.abs(found - 1).min() > 1e-4
    assert np.abs(found).max() == pytest.approx(float(exact.spectral_radius(values)), abs=1e-11)
