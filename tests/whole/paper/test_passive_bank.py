"""The way in of a filter bank: no LP2 makes it passive, two complementary filters do, and what that costs."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from reproduce.passive_bank import (
    AS_DRAWN,
    BEHIND,
    IN_PLACE,
    PLAIN,
    SCALED,
    Design,
    inward_norm,
    page,
    passive_bank,
)
from reproduce.specs import load_paper
from wavesweep.engine._monodromy.interconnect import connect
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import drawing_of_page


def lifted_gain(page, values, theta):
    """Largest singular value of the way in over a frame, (v_s, v_l) -> v_m, tick after tick from the drawing's blocks.

    A frame's input is the wave v_s over the root of M, so that it counts with its own period, and the M values of v_l.
    """
    drawn = Loops(drawing_of_page(page), values).drawn()
    blocks = [each.block for each in drawn.placed if each.block.name in ("lp2", "v_2", "f1", "f2")]
    of_Kp = "device", "x_s", "avatar.x"
    terms = {name: gain for name, gain in drawn.sums["encoder.in"].items() if not name.startswith(of_Kp)}
    v_1 = "v_1_shown.y" if any("v_1_shown.y" in each for each in drawn.sums.values()) else "avatar.out"
    way = connect("way", blocks, {**drawn.sums, "encoder.in": terms}, (v_1, "local.out"), ("encoder.in",))
    n, M = len(way.states), drawn.ticks
    state, fed = np.eye(n), np.zeros((n, M + 1))
    from_state, from_fed = [], []
    for k in range(M):
        wave = np.zeros((2, M + 1))
        wave[0, 0], wave[1, 1 + k] = 1 / np.sqrt(M), 1
        from_state.append(way.C @ state)
        from_fed.append(way.C @ fed + way.D @ wave)
        state, fed = state + way.E @ state, fed + way.E @ fed + way.B @ wave
    C, D = np.concatenate(from_state), np.concatenate(from_fed)
    z = np.exp(1j * np.asarray(theta))[:, None, None]
    return np.linalg.norm(C @ np.linalg.solve(z * np.eye(n) - state, fed + 0 * z) + D, 2, axis=(-2, -1))


def loop(**overrides):
    return {**load_paper("fig6").values, **overrides}


@pytest.mark.sample(4)
@pytest.mark.slow
@pytest.mark.parametrize("local_delay", [0, 1])
@pytest.mark.parametrize("design", [IN_PLACE, BEHIND])
@pytest.mark.parametrize(("order", "cutoff"), [(1, 10.0), (2, 5.0), (4, 80.0)])
def test_complementary_filters_make_the_way_in_exactly_passive(design, order, cutoff, local_delay):
    values = loop(**{"local_model.delay": local_delay})
    drawn = page(Design(design, order, cutoff, local_delay), values)
    theta = np.random.default_rng(7).uniform(0, np.pi, 200)
    gains = lifted_gain(drawn, values, theta)
    assert gains.max() <= 1 + 1e-12
    assert lifted_gain(drawn, values, [1e-7]) == pytest.approx(1, abs=1e-12)
    assert inward_norm(drawn, values) == pytest.approx(1, abs=1e-12)


def test_waves_marched_through_the_filters_gain_no_energy():
    """The filters are scipy's and share no code with the drawing's: random and constant waves, energies added up."""
    rng, M, frames = np.random.default_rng(3), 20, 400
    waves = {
        "random": (rng.normal(size=frames), rng.normal(size=frames * M)),
        "constant": (np.ones(frames), np.ones(frames * M)),
    }
    gains = {name: [marched_gain(slow, local, M, alone) for alone in (False, True)] for name, (slow, local) in waves.items()}
    assert max(gain for gain, _ in gains.values()) <= 1
    assert gains["constant"][0] == pytest.approx(0.5, abs=0.01)  # F1 passes the one wave, F2 stops the other
    assert gains["constant"][1] == pytest.approx(2, abs=0.02)  # hold and LP2 pass both: their sum has twice the energy


def marched_gain(slow, local, M, as_drawn):
    """Energy of v_m over that of v_s and v_l, once with hold and LP2, once with F1 and F2."""
    rest = np.zeros(4000)
    sent = [np.concatenate([np.repeat(slow, M), rest]), np.concatenate([local, rest])]
    lp2, f1, f2 = (butter(*each, fs=1000.0, output="sos") for each in ((2, 20.0), (1, 10.0), (1, 10.0, "high")))
    total = (sent[0] if as_drawn else sosfilt(f1, sent[0])) + sosfilt(lp2 if as_drawn else f2, sent[1])
    return float(np.square(total).sum() / (M * np.square(slow).sum() + np.square(local).sum()))


@pytest.fixture(scope="module")
def banks():
    return passive_bank().columns


@pytest.mark.slow
def test_a_passive_way_in_costs_what_the_bank_gains_at_low_frequencies(banks):
    drawn_low, plain_low, scaled_low = (banks["low"][banks["design"] == name] for name in (AS_DRAWN, PLAIN, SCALED))
    filtered = banks["low"][(banks["order"] > 0) & banks["stable"]]
    assert drawn_low.max() < 0.1 * plain_low.min()
    assert filtered.min() > 0.8 * plain_low.min()
    # No filters, but less of each wave: nearer on average, and half as stiff at rest.
    assert 5 * drawn_low.max() < scaled_low.min() < filtered.min()
    assert banks["felt"][banks["design"] == SCALED].max() < 250
    assert banks["felt"][banks["stable"] & (banks["order"] > 0)].min() > 490
