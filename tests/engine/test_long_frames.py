"""The H-infinity norm over frames of many ticks: found without matrices of all inputs, and proved by stored energy."""

import numpy as np
import pytest
from panel_speed import LONG, chain

from wavesweep.engine import loop_from_drawing
from wavesweep.engine._energy import long_frames, norms
from wavesweep.engine._energy.lifted_map import TickMaps
from wavesweep.engine._energy.long_frames import is_above, largest_gains
from wavesweep.engine._energy.norms import squared_norm


def random_ticks(seed, ticks=12):
    """A stable loop with two kinds of tick, of one and of two inputs."""
    random, n = np.random.default_rng(seed), 4
    maps = []
    for m in (1, 2):
        A = random.normal(size=(n, n))
        A *= random.uniform(0.6, 0.99) / np.abs(np.linalg.eigvals(A)).max()
        maps.append((A - np.eye(n), random.normal(size=(n, m)), random.normal(size=(1, n)), random.normal(size=(1, m))))
    kind = random.integers(0, 2, ticks)
    ticks = TickMaps(tuple(tuple(matrix[None] for matrix in tick) for tick in maps), kind)
    radius = np.abs(1 + np.linalg.eigvals(ticks.frame(measured=False)[0])).max()
    for E, *_ in ticks.maps if radius > 0.95 else ():
        E[...] = (np.eye(n) + E) * (0.95 / radius) ** (1 / len(kind)) - np.eye(n)
    return ticks


@pytest.mark.parametrize("seed", range(6))
def test_the_largest_gain_is_a_singular_value(seed):
    lifted, theta = random_ticks(seed).lifted(), np.array([0.0, 0.4, 2.0, np.pi])
    exact = np.linalg.svd(lifted.response(np.zeros(4, int), theta), compute_uv=False)[:, 0]
    found = largest_gains(lifted, theta)
    assert (found <= exact * (1 + 1e-13)).all()
    assert found.max() == pytest.approx(exact.max(), rel=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_a_level_is_proved_above_the_norm_and_never_below(seed):
    """The norm is that of responses at thousands of angles, and of the level sets of the lifted loop."""
    ticks = random_ticks(seed)
    theta = np.linspace(0, np.pi, 2001)
    exact = float(squared_norm(ticks).value[0])
    assert ticks.lifted().largest_square(np.zeros(theta.size, int), theta).max() <= exact * (1 + 1e-12)
    proved = [is_above(ticks, exact * (1 + by)) for by in (-1e-2, -1e-6, -1e-9, -1e-11, 1e-10, 1e-6, 1.0)]
    assert not any(proved[:4])
    assert all(proved[4:])


@pytest.mark.parametrize("changed", [0, 1, 2, 3])
def test_no_energy_is_proved_of_a_loop_within_its_rounding(changed):
    """A matrix that is positive but for what its errors may be is not taken for positive."""
    matrix = np.diag([1.0, 2.0, 3.0, 4.0])[None]
    error = np.zeros((1, 4, 4))
    assert long_frames._all_positive(matrix, error, np.ones(4))
    error[0, changed, :] = error[0, :, changed] = matrix[0, changed, changed] / 4
    error[0, changed, changed] = matrix[0, changed, changed] / 2
    assert not long_frames._all_positive(matrix, error, np.ones(4))


@pytest.mark.parametrize(("ticks", "read"), [(100, "m0.x"), (200, "m1.v")])
def test_the_norm_over_many_ticks_is_that_of_the_lifted_loop(monkeypatch, ticks, read):
    tables = chain(2, ticks)
    tables["numbers"]["K"] = 0.2
    tables["wire"]["m0.f"] += " + F"
    loop = loop_from_drawing(tables | {"ports": {"inputs": {"F": "F"}, "outputs": {"y": read}}})
    found = loop.hinf_norm("F", "y")
    monkeypatch.setattr(norms, "MOST_DENSE_SIGNALS", 1000)
    exact = loop.hinf_norm("F", "y")
    assert found.certified
    assert float(found.value) == pytest.approx(float(exact.value), rel=1e-10)


@pytest.mark.parametrize(("share", "looser"), [(0.01, 1), (0.5, 1), (0.9, 3), (0.99, 100)])
def test_the_norm_over_long_frames_is_proved_up_to_limits_of_stability(monkeypatch, share, looser):
    """No loop is left to eigenvalues at each angle, which take a hundred times as long."""
    monkeypatch.setattr(norms, "_by_responses", None)
    monkeypatch.setattr(long_frames, "LOOSER", looser)
    tables = chain(2, 300)
    tables["wire"]["m0.f"] += " + F"
    loop = loop_from_drawing(tables | {"ports": {"inputs": {"F": "F"}, "outputs": {"y": "m0.x"}}})
    limit = float(loop.stable_intervals("K", (0.0, 1000.0)).high[0])
    assert loop.hinf_norm("F", "y", {"K": share * limit}).certified


def test_energies_that_a_tick_hardly_changes_are_kept_with_enough_digits(monkeypatch):
    """A position that is read 50 times in a frame of 500 ticks, for a force that changes once: ends of digits count."""
    monkeypatch.setattr(norms, "_by_responses", None)
    blocks = LONG["block"] | {
        "scene": {"type": "hold", "every": 10},
        "force": {"type": "hold", "every": 500, "phase": 3},
    }
    wires = LONG["wire"] | {"device.f": "force.y + F"}
    ports = {"inputs": {"F": "F"}, "outputs": {"y": "device.v"}}
    loop = loop_from_drawing(LONG | {"block": blocks, "wire": wires, "ports": ports})
    limit = float(loop.stable_intervals("K", (0.0, 1000.0)).high[0])
    assert loop.hinf_norm("F", "y", {"K": 0.9 * limit}).certified
