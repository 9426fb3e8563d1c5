"""Absolute stability of a teleoperator, against Llewellyn's criterion in closed form and random passive terminations."""

import pathlib
import re

import numpy as np
import pytest
from support.teleoperator import FREE, radius, termination

import wavesweep
from wavesweep.engine._stability.positive import Cover
from wavesweep.haptics.held_loop import held_loop
from wavesweep.passive import two_ports
from wavesweep.passive.port_jobs import curves
from wavesweep.passive.port_rows import curve, index, pair_margin
from wavesweep.passive.table import _index_lines
from wavesweep.passive.two_ports import Pair, pairs_of, worst
from wavesweep.program.sweep.grid import own_loop
from wavesweep.program.tables.hand_rows import hands_of

SPEC = pathlib.Path(__file__).parents[2] / "sweeps" / "examples" / "two-channel.toml"
NUMBERS = {"K": 400.0, "B": 8.0, "g": 0.3, "m": 0.5, "d": 2.0, "n": 5, "late": 1}


def loop_with(*paths, **numbers):
    spec = wavesweep.load(SPEC, [f"{name}={value}" for name, value in numbers.items()])
    return held_loop(own_loop(spec, *paths))


@pytest.mark.slow
@pytest.mark.parametrize("late", [2])
def test_the_limit_at_one_rate_is_llewellyns_at_rest(late):
    loop, (K, B, d, T) = loop_with("numbers.g", n=1, late=late), (400, 8, 2, 1e-3)
    b = d + B - K * T / 2
    limit = 4 * d * b / (4 * K * (2 * late + 0.5) * T * b + (B - K * (2 * late + 1) * T) ** 2)
    (row,) = hands_of("ports").guarantees[0].records(loop, "numbers.g", (0.0, 1.5))
    assert row["certified"]
    assert 0 < limit - row["high"] < 1e-4 * limit
    assert row["high_omega"] == 0


def test_margin_and_index_of_impedances_are_those_of_their_closed_forms():
    rng = np.random.default_rng(5)
    Z = rng.normal(size=(40, 2, 2)) + 1j * rng.normal(size=(40, 2, 2)) + 2 * np.eye(2)
    a, b, c = Z[:, 0, 0].real, Z[:, 1, 1].real, Z[:, 0, 1] * Z[:, 1, 0]
    both = np.abs(c) + c.real
    np.testing.assert_allclose(worst(Z).shunt, (a + b) / 2 - np.sqrt((a - b) ** 2 / 4 + both / 2), atol=1e-12)
    own = (a > 0) & (b > 0)
    np.testing.assert_allclose(index(Z)[own], np.clip(2 * a * b / both, 1e-3, 1e3)[own], rtol=1e-5)


@pytest.mark.slow
def test_no_passive_terminations_destabilise_what_is_proved_and_some_do_what_is_refuted():
    rng, verdicts = np.random.default_rng(7), []
    for _ in range(8):
        numbers = {name: NUMBERS[name] * 10 ** rng.uniform(-0.4, 0.4) for name in "KBgmd"}
        numbers |= {"n": int(rng.integers(1, 6)), "late": int(rng.integers(0, 2))}
        found = pair_margin(loop_with(**numbers))
        assert found.certified
        assert radius((FREE, FREE), **numbers) < 1 + 1e-9
        pairs = ([termination(rng, rng.integers(4)) for _ in range(2)] for _ in range(60))
        unstable = [radius(pair, **numbers) > 1 + 1e-8 for pair in pairs]
        assert any(unstable) <= (not found.stable)
        verdicts.append((found.stable, any(unstable)))
    assert {(True, False), (False, True)} <= set(verdicts)


@pytest.mark.slow
def test_the_counterexample_is_unstable_by_the_loops_own_poles():
    loop = loop_with(g=1.0)
    found = pair_margin(loop)
    assert found.certified
    assert found.damping < 0
    m, k, n, s = map(float, re.findall(r"[\d.e+-]+(?= kg| N/m)", found.counterexample))
    ends = {"block.leader": (m, k), "block.follower": (n, s)}
    tables = wavesweep.load(SPEC, ["g=1.0"]).tables()
    for block, (mass, stiffness) in ends.items():
        tables["block"][block.partition(".")[2]] |= {"mass": NUMBERS["m"] + mass, "stiffness": stiffness}
    del tables["numbers"]["m"]
    assert wavesweep.compile(tables).spectral_radius() > 1 + 1e-9


def test_arms_whose_positions_both_return():
    """A spring holds the leader, and the follower follows it: no constant forces move anything on."""
    tables = wavesweep.load(SPEC, ["n=1", "late=0", "g=0.5"]).tables()
    tables["block"]["leader"]["stiffness"] = 100.0
    found = pair_margin(held_loop(own_loop(wavesweep.load(tables))))
    assert found.certified
    assert found.stable


def test_what_a_cover_leaves_open_is_not_proved(monkeypatch):
    monkeypatch.setattr(two_ports, "BOXES", 20)
    pair = Pair(pairs_of(loop_with(n=1), "", (0.0, 0.0)))
    assert pair.open_in(0.0, 0.0, lambda _, box, __: Cover(np.array([box]), np.zeros((0, 2)))) != []


@pytest.mark.slow
def test_a_sweep_without_values_has_the_curve_of_the_specs_own_loop():
    spec = wavesweep.load(SPEC, ["sweep.n="])
    (of_grid,) = curves(spec, ())
    own = curve(held_loop(own_loop(spec)))
    for name, column in own.items():
        np.testing.assert_array_equal(of_grid[name], column)


def test_an_index_at_the_end_of_its_range_is_at_most_that():
    (least,) = index(np.array([[[1e-9, 1.0], [1.0, 1e-9]]], complex))
    ((line, _),) = _index_lines({"llewellyn": float(least), "frequency_hz": 2.0})
    assert line == "Llewellyn's index: at most 0.001, the least that is looked for, of those computed, at 2 Hz"
