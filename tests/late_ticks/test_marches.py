"""Late ticks held against a march by hand: the matrices, the patterns that refute, and what is proved."""

from dataclasses import replace

import numpy as np
import pytest

from tests.late_ticks.march import Program
from wavesweep.late_ticks import bracket as bracketing
from wavesweep.late_ticks.bracket import Search, bracket, started
from wavesweep.late_ticks.patterns import growing, word_of
from wavesweep.late_ticks.tick_curves import DEGREE, late_ticks
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

pytestmark = pytest.mark.asks("for_all")
WALL = "environment.K_VE"
ON = 1e-6  # of a spectral radius: the eigenvalue at 1 of what drifts


def program(rng, most=8):
    """A loop with numbers at random."""
    ratio = int(rng.integers(1, most + 1))
    return Program(
        waves=bool(rng.random() < 0.5),
        ratio=ratio,
        delay=int(rng.integers(1, ratio + 1)),
        mass=float(10 ** rng.uniform(-1.3, 0)),
        damping=float(rng.uniform(0.5, 3)),
        K=100.0,
        B=float(rng.choice([0.0, rng.uniform(0, 3)])),
        difference=bool(rng.random() < 0.5),
        b=float(rng.uniform(3, 30)),
        cutoff_hz=float(rng.uniform(5, 30)),
        Kp=float(rng.choice([0.0, 20.0])),
    )


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
    loop = program(rng)
    interval = loop.tick, loop.tick * (1 + rng.uniform(0.02, 0.4))
    ticks = ticks_of(loop.tables, interval)(1)
    pattern = tuple(rng.integers(0, len(ticks.lengths), 2 * loop.ratio).tolist())
    radius = np.abs(np.linalg.eigvals(product_of(ticks, loop.K, pattern))).max()
    marched = loop.growth(ticks.lengths[list(pattern)])
    drifts = marched[np.abs(marched - 1) > ON]
    assert np.isclose(radius, drifts[0], rtol=1e-6) or np.isclose(radius, marched[0], rtol=1e-6)


def test_every_length_of_a_cell_lies_within_its_control_points():
    """A tick of any length is a convex combination of the control points, up to the bound."""
    from scipy.special import comb

    loop = Program(False, 3, 3, 0.1, 1.5, 80.0, 1.0, difference=True)
    ticks = ticks_of(loop.tables, (0.9e-3, 1.4e-3))(1)
    E, dE = ticks.family.enclosed(loop.K)
    for t in (0.13, 0.5, 0.92):
        length = ticks.lengths[0] + t * (ticks.lengths[1] - ticks.lengths[0])
        (exact,) = np.split(ticks_of(loop.tables, (length, 1.4e-3))(1).family.enclosed(loop.K)[0][:1], 1)
        weights = [comb(DEGREE, j) * t**j * (1 - t) ** (DEGREE - j) for j in range(DEGREE + 1)]
        between = np.tensordot(weights, E[: DEGREE + 1], (0, 0))
        assert (np.abs(between - exact[0]) <= dE[: DEGREE + 1].max(0) * (1 + 1e-9)).all()
    assert dE.max() > 0


def contradiction(seed, most=8):
    """What a march says against a proof of a loop at random: the pattern, or None; and whether anything was proved."""
    rng = np.random.default_rng(seed)
    loop = program(rng, most)
    interval = loop.tick, loop.tick * (1 + float(rng.choice([0.05, 0.1, 0.2, 0.4])))
    ticks_with = ticks_of(loop.tables, interval)
    found = bracket(ticks_with, (0.0, 500.0))
    if found is None or not found.low < found.high:
        return None, False
    for share in (0.02, 0.5, 1.0):
        K = found.low + share * (found.high - found.low)
        at = Program(**{**loop.__dict__, "K": float(K)})
        patterns = [rng.uniform(*interval, int(rng.integers(1, 4)) * loop.ratio) for _ in range(6)]
        ticks = ticks_with(1)
        _, worst = growing(ticks, K)
        patterns.append(ticks.lengths[list(worst)])
        for lengths in patterns:
            if at.growth(lengths)[0] > 1 + ON:
                return lengths, True
    if found.above.word:
        beyond = Program(**{**loop.__dict__, "K": found.above.x * (1 + 1e-6)})
        lengths = ticks_with(1).lengths[list(found.above.word)]
        if beyond.growth(lengths)[0] < 1 - ON:
            return lengths, True
    return None, True


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_no_march_contradicts_a_proof(seed):
    assert contradiction(seed, most=3) == (None, True)


WALL_AT_ONE_RATE = Program(False, 1, 1, 0.1, 1.5, 100.0, 1.0, difference=False)


@pytest.mark.slow
def test_a_bracket_ends_next_to_the_pattern_that_grows_in_a_march():
    loop = Program(False, 2, 2, 0.1, 1.5, 100.0, 1.0, difference=False)
    ticks_with = ticks_of(loop.tables, (1e-3, 1.2e-3))
    found = bracket(ticks_with, (0.0, 2000.0))
    assert found.low == pytest.approx(1e-4 * found.high)
    assert 0.99 * found.above.x < found.high < found.above.x
    lengths = ticks_with(1).lengths[list(found.above.word)]
    beside = [replace(loop, K=found.above.x * factor).growth(lengths)[0] for factor in (1 - 1e-4, 1 + 1e-4)]
    assert beside[0] < 1 + ON
    assert beside[1] > 1 + ON


def test_nothing_is_reached_whose_norms_no_checker_confirms(monkeypatch):
    monkeypatch.setattr(Search, "proved", lambda _, *ends: len(ends) == 1)
    found = bracket(ticks_of(WALL_AT_ONE_RATE.tables, (1e-3, 1.2e-3)), (0.0, 1000.0))
    assert (found.low, found.high) == (300.0, 300.0)


def test_a_proof_goes_on_for_more_than_a_hundred_steps_to_a_wall_next_to_none():
    loop = Program(False, 2, 2, 0.3, 0.3, 100.0, 0.0, difference=True)
    assert started(ticks_of(loop.tables, (0.5e-3, 1e-3)), [20.0]).walked(1e-3).x == 1e-3


def test_forms_of_degree_four_prove_an_oscillation_that_no_quadratic_form_does(monkeypatch):
    """Waves at one rate, two states: no pattern that is found makes 70 N/m unstable, and quadratic forms end at 43 N/m."""
    tables = {
        "rates": {"fast_hz": 1000.0, "ratio": 1},
        "device": {"mass": 0.168, "damping": 1.15, "velocity": "exact"},
        "environment": {"K_VE": 70.0, "B_VE": 0.0, "integration": "explicit", "delay": 0},
        "controller": {"kind": "pmw-mean", "b": 10.0},
    }
    ticks_with = ticks_of(tables, (0.5e-3, 1e-3))
    assert growing(ticks_with(1), 70.0)[0] < 1
    assert started(ticks_with, [70.0]).search.squares == 1
    monkeypatch.setattr(bracketing, "MOST_SQUARES", 0)
    assert started(ticks_with, [70.0]) is None


def test_what_changes_twice_in_a_turn_of_a_slow_mode_makes_it_grow():
    """Frames repeated for ever do not grow, and a turn, which is 25 frames, by 1.1 % a frame."""
    loop = Program(True, 2, 2, 0.1, 1.0, 700.0, 0.0, difference=False, b=5.0, mean=True)
    ticks = ticks_of(loop.tables, (0.5e-3, 1e-3))(1)
    rate, pattern = growing(ticks, loop.K)
    marched = loop.growth(ticks.lengths[list(pattern)])
    assert np.isclose(marched[0], rate ** (len(pattern) / loop.ratio), rtol=1e-6)
    assert rate > 1.01
    for frame in ([0, 0], [0, -1], [-1, 0], [-1, -1]):
        assert loop.growth(ticks.lengths[frame])[0] < 1.001
