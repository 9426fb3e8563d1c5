"""The device under held forces, against scipy's matrix exponential and 50 digits."""

import numpy as np
import pytest
import scipy.linalg
from support import exact
from support.specs import values_of

import wavesweep
from wavesweep.engine._keys.key import SMALLEST
from wavesweep.engine._loops.blocks import held
from wavesweep.engine._loops.blocks import mass as mass_block

# mass (kg), damping (N*s/m), stiffness (N/m), period (s): the paper's; free of friction; heavily overdamped; with a
# spring in the hand; stiff and overdamped; heavy and slow.
CALM = [
    (0.1, 1.5, 0.0, 1e-3), (0.1, 0.0, 0.0, 1e-3), (1e-4, 50.0, 0.0, 1e-3), (0.1, 1.5, 800.0, 1e-3),
    (1e-3, 40.0, 300.0, 0.01), (80.0, 1e-3, 1e-3, 1e-4),
]  # fmt: skip
# These ring within the tick, and so their entries may pass through zero.
RINGING = [(0.1, 0.0, 800.0, 0.02), (0.05, 0.3, 20000.0, 5e-3)]


def block_of(mass, damping, stiffness, period):
    return mass_block("device", period, mass, damping, stiffness)


@pytest.mark.parametrize(("mass", "damping", "stiffness", "period"), RINGING)
def test_a_tick_is_the_exponential_of_the_plant(mass, damping, stiffness, period):
    """scipy's expm is good to a few ulp, times the norm that it squares away, of each column's largest entry."""
    block = block_of(mass, damping, stiffness, period)
    plant = np.array([[-damping / mass, -stiffness / mass, 1 / mass], [1, 0, 0], [0, 0, 0]])
    whole = scipy.linalg.expm(plant * period)[:2]
    found = np.hstack([block.E + np.eye(2), block.B])
    lost = 1e-15 * (100 + np.abs(plant * period).sum())
    assert np.all(np.abs(found - whole) <= lost * np.abs(whole).max(axis=0))


@pytest.mark.parametrize(("mass", "damping", "stiffness", "period"), CALM)
def test_every_entry_keeps_its_digits(mass, damping, stiffness, period):
    """Relative to each entry, not to the largest, and in delta form, where 1 - exp(-tiny) would have lost them."""
    block = block_of(mass, damping, stiffness, period)
    values = values_of("dc", mass=mass, damping=damping, stiffness=stiffness)
    flow, push = exact.zero_order_hold(values, exact.mp.mpf(period))
    wanted = [[flow[1][1] - 1, flow[1][0], push[1]], [flow[0][1], flow[0][0] - 1, push[0]]]
    found = np.hstack([block.E, block.B])
    for row, line in zip(found, wanted, strict=True):
        for have, want in zip(row, line, strict=True):
            assert abs(have - want) <= 1e-13 * abs(want)


@pytest.mark.parametrize(("kind", "limit"), [("dc", 3000.0), ("dc-slow", 150.0)])
def test_the_least_mass_has_the_limit_of_a_bare_damper(kind, limit):
    """A damper alone under a held force moves by F T/d in a step of T: stable to 2 d/T of the wall's own period."""
    tables = {"controller": {"kind": kind}, "device": {"mass": SMALLEST}, "environment": {"B_VE": 0.0}}
    table = wavesweep.compile(tables).stable_intervals(span=(0.0, 2e4))
    assert table["low"].tolist() == [0.0]
    np.testing.assert_allclose(table["high"], limit, rtol=1e-9)


def test_a_spring_that_turns_more_often_in_a_tick_than_doubles_can_count_is_not_known():
    """After 1e26 turns the phase is lost; rounding alone would bring the mass to rest, which it never comes to."""
    assert np.isnan(block_of(1e-38, 0.0, 22.5, 7e6).E).all()
    turning = np.array([[[0.0, -1e10], [1e10, 0.0]], [[0.0, -0.01], [0.01, 0.0]]])
    (lost, kept), *_ = held(turning, np.eye(2), np.full(2, 1e7))
    assert np.isnan(lost).all()
    np.testing.assert_allclose(kept + np.eye(2), [[np.cos(1e5), -np.sin(1e5)], [np.sin(1e5), np.cos(1e5)]], rtol=1e-6)


def test_a_long_chain_of_masses_moves_as_the_exponential_of_its_matrix_says():
    """Of 60 masses, whose matrix has few entries; scipy takes Pade's approximation, and all of them."""
    masses = 60
    springs = np.diag(np.full(masses, -2.0)) + np.eye(masses, k=1) + np.eye(masses, k=-1)
    rates = np.block([[0.1 * springs, 500 * springs], [np.eye(masses), np.zeros((masses, masses))]])
    forces = np.eye(2 * masses, masses)
    E, G, *_ = held(rates, forces, 1e-3)
    whole = scipy.linalg.expm(1e-3 * np.block([[rates, forces], [np.zeros((masses, 3 * masses))]]))
    np.testing.assert_allclose(E, whole[: 2 * masses, : 2 * masses] - np.eye(2 * masses), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(G, whole[: 2 * masses, 2 * masses :], rtol=1e-12, atol=1e-18)
