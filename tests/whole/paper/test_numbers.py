"""The numbers behind the statements, where a formula or another way to them is at hand."""

import numpy as np
import pytest
from support.exact import march

from reproduce.felt_responses import respond
from reproduce.paper_loops import BASE
from reproduce.specs import load_paper
from reproduce.statements.aliasing import _gain_of_a_constant
from wavesweep.engine._loops.filters import butterworth


def test_the_limit_of_figure_4_is_a_line_of_slope_two_over_the_frame(paper):
    # Forward Euler oscillates from frame to frame there: K_VE - 2 B_VE/T_s is all that the wall shows at z = -1.
    ((low, high),) = paper.limit_families("fig4", BASE, [{"B_VE": 1}, {"B_VE": 15}])
    assert (high - low) / 14 == pytest.approx(2 / 0.02, rel=1e-9)


def test_limits_that_hang_on_the_filters_and_on_the_local_models_delay(paper):
    # As another program has them: Figure 5 with HP of second order and LP2 at 80 Hz, LP2 without a delay to ring with.
    walls = [{"K_LM": K, "filters.hp.order": 2} for K in (0, 500, 1000, 2000, 3000)]
    assert paper.limit_families("fig6", BASE, walls)[0] == pytest.approx([np.inf, 5415, 7978, np.inf, np.inf], rel=1e-4)
    walls = [{"K_LM": K, "filters.lp2.cutoff_hz": 80} for K in (0, 500, 1000, 2000, 3000)]
    assert paper.limit_families("fig6", BASE, walls)[0] == pytest.approx([5300, 5163, 6452, 9988, 6196], rel=1e-4)
    between = [{**each, "K_LM": K} for each, K in zip(walls, (200, 2800), strict=False)]
    assert paper.limit_families("fig6", BASE, between)[0] == pytest.approx([4687, 16737], rel=1e-4)
    prompt = {"environment.integration": "explicit", "local_model.delay": 0}
    both = paper.limit_families("fig6", BASE, [prompt, {**prompt, "filters.lp2.order": 0}])
    assert both[0] == pytest.approx([435.4, 686.6], abs=0.05)


@pytest.mark.parametrize(("order", "norm"), [(1, 1.0533), (2, 1.0017), (4, 1.0000024)])
def test_a_low_pass_lets_a_little_alias(order, norm, paper):
    (found,) = paper.channels("pmw", BASE, {"filters.lp1.order": order})
    assert found.norm == pytest.approx(norm, abs=0.51 * 10 ** -len(str(norm).split(".")[1]))
    assert not found.passive


@pytest.mark.parametrize(("order", "cutoff", "excess"), [(1, 10.0, None), (8, 10.0, 5.85e-12), (12, 24.0, None)])
def test_what_a_constant_wave_gains_is_what_lp1_lets_alias(order, cutoff, excess, paper):
    values = {**load_paper("pmw").values, "filters.lp1.order": order, "filters.lp1.cutoff_hz": cutoff}
    found = _gain_of_a_constant(values)
    block = butterworth("lp1", order, cutoff, 1e-3)
    images = np.exp(2j * np.pi * np.arange(1, 20) / 20) - 1
    power = sum(abs((block.C @ np.linalg.solve(w * np.eye(order) - block.E, block.B) + block.D)[0, 0]) ** 2 for w in images)
    assert found == pytest.approx(np.sqrt(1 + power) - 1, rel=1e-6 if found > 1e-9 else 1e-3)
    assert excess is None or found == pytest.approx(excess, rel=1e-2)
    (norm,) = paper.channels("pmw", BASE, {"filters.lp1.order": order, "filters.lp1.cutoff_hz": cutoff})
    assert 0 < found <= norm.norm - 1 + 1e-10


@pytest.mark.parametrize(("order", "aliased"), [(1, 1e-2), (4, 3e-4), (8, 1e-6)])
def test_the_static_admittance_is_that_of_a_delay_between_waves(order, aliased):
    spec = load_paper("pmw", (f"filters.lp1.order={order}",))
    warped = 2000 * np.tan(np.pi * 10 / 1000)
    delay = 1 / (warped * np.sin(np.pi / (2 * order))) + 9.5e-3  # LP1's at DC, and the mean of the hold
    static = abs(respond(spec, [1e-3]).admittance[0])
    # To what LP1 lets alias, which vanishes with its order.
    assert static - 1 / 500 == pytest.approx(delay / 50, rel=aliased)


@pytest.mark.slow
def test_the_position_term_makes_the_static_stiffness_that_of_the_wall():
    # Marched and not lifted: 1 N held on the device until nothing moves any more.
    spec = load_paper("fig6")
    assert 1 / march(spec.values, np.ones(20_000))["x"][-1] == pytest.approx(500, rel=1e-6)
