"""Late ticks held against a march by hand: the matrices, the patterns that refute, and what is proved."""

import numpy as np
import pytest
from meaning.members import LateTicks, with_numbers

from wavesweep.late_ticks import bracket as bracketing
from wavesweep.late_ticks.bracket import Search, bracket, started
from wavesweep.late_ticks.patterns import growing, word_of
from wavesweep.late_ticks.tick_curves import DEGREE, late_ticks
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

pytestmark = pytest.mark.asks("for_all")
WALL = "environment.K_VE"
DIRECT = {"kind": "dc-slow"}
ON = 1e-6  # of a spectral radius: the eigenvalue at 1 of what drifts


def tables_of(ratio, delay, mass, damping, B, velocity, controller, filters=None):
    """A wall at the slow rate."""
    return {
        "rates": {"fast_hz": 1000.0, "ratio": ratio},
        "device": {"mass": mass, "damping": damping, "velocity": velocity},
        "environment": {"B_VE": B, "integration": "explicit", "delay": delay},
        "controller": controller,
        "filters": filters or {},
    }


def loop_at_random(rng):
    """Direct coupling, or waves behind a filter."""
    ratio = int(rng.integers(1, 9))
    delay = int(rng.integers(1, ratio + 1))
    numbers = float(10 ** rng.uniform(-1.3, 0)), float(rng.uniform(0.5, 3)), float(rng.choice([0.0, rng.uniform(0, 3)]))
    velocity = str(rng.choice(["exact", "difference"]))
    waves = {"kind": "pmw", "b": float(rng.uniform(3, 30)), "Kp": float(rng.choice([0.0, 20.0]))}
    filters = {"lp1": {"order": 1, "cutoff_hz": float(rng.uniform(5, 30))}}
    which = (waves, filters) if rng.random() < 0.5 else ({"kind": "dc-slow"},)
    return tables_of(ratio, delay, *numbers, velocity, *which)


def growths(tables, K, lengths):
    """What a pattern of lengths (s) multiplies each mode by, the largest first, by a march of the documents' reading."""
    march = LateTicks(with_numbers(tables, {"K_VE": float(K)})).march(tuple(lengths))
    return np.sort(np.abs(np.linalg.eigvals(march)))[::-1]


def ticks_of(tables, interval):
    """The ticks of a spec along its wall, by the number of cells."""
    loop = own_loop(load(tables), WALL)
    return lambda cells: late_ticks(loop, WALL, interval, cells)


def product_of(ticks, x, pattern):
    """The matrix of a pattern of ticks at a stiffness."""
    A = ticks.family.at(x)
    product = np.eye(A.shape[-1])
    for symbol in word_of(ticks, pattern):
        product = A[symbol] @ product
    return product


@pytest.mark.parametrize("seed", range(4))
def test_patterns_grow_as_a_march_does(seed):
    rng = np.random.default_rng(seed)
    tables = loop_at_random(rng)
    ticks = ticks_of(tables, (1e-3, 1e-3 * (1 + rng.uniform(0.02, 0.4))))(1)
    pattern = tuple(rng.integers(0, len(ticks.lengths), 2 * tables["rates"]["ratio"]).tolist())
    radius = np.abs(np.linalg.eigvals(product_of(ticks, 100.0, pattern))).max()
    marched = growths(tables, 100.0, ticks.lengths[list(pattern)])
    drifts = marched[np.abs(marched - 1) > ON]
    assert np.isclose(radius, drifts[0], rtol=1e-6) or np.isclose(radius, marched[0], rtol=1e-6)


def test_every_length_of_a_cell_lies_within_its_control_points():
    """A tick of any length is a convex combination of the control points, up to the bound."""
    from scipy.special import comb

    tables = tables_of(3, 3, 0.1, 1.5, 1.0, "difference", DIRECT)
    ticks = ticks_of(tables, (0.9e-3, 1.4e-3))(1)
    E, dE = ticks.family.enclosed(80.0)
    for t in (0.13, 0.5, 0.92):
        length = ticks.lengths[0] + t * (ticks.lengths[1] - ticks.lengths[0])
        (exact,) = np.split(ticks_of(tables, (length, 1.4e-3))(1).family.enclosed(80.0)[0][:1], 1)
        weights = [comb(DEGREE, j) * t**j * (1 - t) ** (DEGREE - j) for j in range(DEGREE + 1)]
        between = np.tensordot(weights, E[: DEGREE + 1], (0, 0))
        assert (np.abs(between - exact[0]) <= dE[: DEGREE + 1].max(0) * (1 + 1e-9)).all()
    assert dE.max() > 0


def test_nothing_is_reached_whose_norms_no_checker_confirms(monkeypatch):
    monkeypatch.setattr(Search, "proved", lambda _, *ends: len(ends) == 1)
    found = bracket(ticks_of(tables_of(1, 1, 0.1, 1.5, 1.0, "exact", DIRECT), (1e-3, 1.2e-3)), (0.0, 1000.0))
    assert (found.low, found.high) == (300.0, 300.0)


def test_a_proof_goes_on_for_more_than_a_hundred_steps_to_a_wall_next_to_none():
    tables = tables_of(2, 2, 0.3, 0.3, 0.0, "difference", DIRECT)
    assert started(ticks_of(tables, (0.5e-3, 1e-3)), [20.0]).walked(1e-3).x == 1e-3


def test_forms_of_degree_four_prove_an_oscillation_that_no_quadratic_form_does(monkeypatch):
    """Waves at one rate, two states: no pattern that is found makes 70 N/m unstable, and quadratic forms end at 43 N/m."""
    tables = tables_of(1, 0, 0.168, 1.15, 0.0, "exact", {"kind": "pmw-mean", "b": 10.0})
    ticks_with = ticks_of(tables, (0.5e-3, 1e-3))
    assert growing(ticks_with(1), 70.0)[0] < 1
    assert started(ticks_with, [70.0]).search.squares == 1
    monkeypatch.setattr(bracketing, "MOST_SQUARES", 0)
    assert started(ticks_with, [70.0]) is None


def test_what_changes_twice_in_a_turn_of_a_slow_mode_makes_it_grow():
    """Frames repeated for ever do not grow, and a turn, which is 25 frames, by 1.1 % a frame."""
    tables = tables_of(2, 2, 0.1, 1.0, 0.0, "exact", {"kind": "pmw-mean", "b": 5.0})
    ticks = ticks_of(tables, (0.5e-3, 1e-3))(1)
    rate, pattern = growing(ticks, 700.0)
    marched = growths(tables, 700.0, ticks.lengths[list(pattern)])
    assert np.isclose(marched[0], rate ** (len(pattern) / 2), rtol=1e-6)
    assert rate > 1.01
    for frame in ([0, 0], [0, -1], [-1, 0], [-1, -1]):
        assert growths(tables, 700.0, ticks.lengths[frame])[0] < 1.001
