"""The equations of drawn loops at rest in exact numbers: arithmetic, and the shifts that they leave."""

import math
import tomllib
from fractions import Fraction

import numpy as np
import pytest
from support.drawn import as_blocks, random_tables
from support.specs import KINDS

import wavesweep
from wavesweep.engine._drawing.parsing import parse
from wavesweep.engine._loops import blocks
from wavesweep.engine._loops.integrator_modes import decimal, shifts, value_in_fractions
from wavesweep.engine._loops.multirate import MultirateLoop, ScheduledBlock
from wavesweep.engine._monodromy.periodic import Ticks, frame_of
from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load


def value(text, **numbers):
    return value_in_fractions(parse(text), {name: decimal(number) for name, number in numbers.items()})


NUMBERS = {"a": 0.1, "b": -1.7e-9, "c": 123456.789}
A, B, C = (Fraction(repr(number)) for number in NUMBERS.values())


@pytest.mark.parametrize(
    ("text", "exact"),
    [
        ("a + b - 3*c", A + B - 3 * C),
        ("a/b/c", A / B / C),
        ("-(a - 2)**3/(1 - c)**2", -((A - 2) ** 3) / (1 - C) ** 2),
        ("a**-2 + b**40", A**-2 + B**40),
        ("1/(a*b) - 1/a/b", Fraction(0)),
        ("0.1 + 0.2 - 0.3", Fraction(0)),
        ("sqrt(2.25) - 1.5", Fraction(0)),
        ("(4*a)**0.5/sqrt(1000*a)", Fraction(math.sqrt(0.4)) / 10),
    ],
)
def test_expressions_are_those_of_decimals(text, exact):
    assert value(text, **NUMBERS) == exact


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_no_tick_changes_what_a_shift_moves(seed):
    """Where nothing reads what moves but what moves with it."""
    spec = load(random_tables(seed))
    _unchanged(spec)


def _unchanged(spec):
    drift, drawn = Loops(spec.drawing, spec.values).drift(), Loops(spec.drawing, spec.values).twins()[0]
    E = frame_of(Ticks.of(drawn, alone=True))
    for lead, others in drift.constant:
        shift = np.zeros(len(drift.states))
        shift[[lead, *(state for state, _ in others)]] = [1.0, *(factor for _, factor in others)]
        assert np.all(np.abs(E @ shift) <= 1e-11 * (np.abs(E) @ np.abs(shift)))
    return len(drift.constant)


WITH_WALL = {("dc", 0.0): 0, ("dc", 30.0): 0, ("dc-", 0.0): 0, ("dc-", 30.0): 0, ("pmw", 0.0): 1, ("pmw", 30.0): 1}


@pytest.mark.sample(10)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("velocity", ["exact", "difference"])
@pytest.mark.parametrize("integration", ["explicit", "implicit", "trapezoidal"])
def test_the_drift_of_a_controller_drawn_as_blocks_is_exact(kind, velocity, integration):
    for wall in (0.0, 500.0):
        for spring in (0.0, 30.0):
            values = load(
                {
                    "controller": {"kind": kind},
                    "device": {"velocity": velocity},
                    "operator": {"stiffness": spring},
                    "environment": {"integration": integration, "K_VE": wall},
                }
            ).values
            free = (spring == 0) + (kind.startswith("pmw"))  # without a wall, as the avatar too
            assert _unchanged(load(as_blocks(values))) == (free if wall == 0 else WITH_WALL[kind[:3], spring])


@pytest.mark.parametrize(("k", "exact"), [(45, False), (48, False), (None, True)])
def test_a_loop_that_is_built_in_python_has_a_drift_only_if_its_entries_cancel_exactly(k, exact):
    """A mode at 1 + 2^-k in a turned basis, which the gain does not reach, beside one at exactly 1."""
    turn = np.array([[1.0, 3.0], [0.5, 2.0]])
    back = np.linalg.inv(turn)
    E = turn @ np.diag([0.0 if k is None else 2.0**-k, -0.5]) @ back
    ports = (turn @ [[0.0], [1.0]]).tolist(), (np.array([[0.0, 1.0]]) @ back).tolist(), [[0.0]]
    block = blocks.ss("g", 1.0, (E + np.eye(2)).tolist(), *ports, ("u",), ("y",), discrete=True)
    found = shifts(MultirateLoop(1.0, (ScheduledBlock(block, 1, 0),), {"g.u": {"g.y": -0.5}}), {"g"})
    assert found == ([pytest.approx({"g.x0": 1.0, "g.x1": 0.5})] if exact else [])


@pytest.mark.parametrize("den", [[1.0, -1.0], [1.0, -1.0, 0.0], [2.0, -2.5, 0.5, 0.0, 0.0]])
def test_a_pole_at_1_before_delays_drifts_with_what_they_keep(den):
    """A velocity is added up and pushes the mass that has it: at rest any sum is held by the spring."""
    blocks = {
        "m": {"type": "mass", "mass": 0.2, "damping": 1.0, "stiffness": 30.0},
        "i": {"type": "tf", "discrete": True, "num": [0.1, 0.05, 0.02][: len(den)], "den": den},
    }
    wires = {"i.u": "m.v", "m.f": "i.y"}
    assert _unchanged(load({"rates": {"tick_hz": 100}, "block": blocks, "wire": wires})) == 1


BILATERAL = """
[rates]
tick_hz = 1000
[numbers]
b = 5.0
kh = 50.0
ke = 100.0
[block.master]
type = "mass"
mass = 0.2
damping = 0.3
stiffness = "kh"
[block.sent]
type = "wave"
b = "b"
[block.there]
type = "delay"
steps = 10
[block.received]
type = "wave"
b = "b"
gives = "velocity"
[block.back]
type = "delay"
steps = 10
[block.slave]
type = "integrator"
method = "explicit"
[wire]
"sent.v" = "master.v"
"sent.in" = "back.y"
"master.f" = "-sent.force"
"there.u" = "sent.out"
"received.in" = "there.y"
"slave.u" = "received.v"
"received.f" = "ke*slave.y + 0.5*received.v"
"back.u" = "received.out"
[sweep]
along = "ke"
ke = { start = 0, stop = 20000 }
"""


@pytest.mark.asks("prove")
def test_a_sprung_master_and_a_slave_on_a_spring_share_a_force_that_nothing_changes():
    # At rest the waves carry any force; the two springs follow it, and so the shift has the root of 2b in it.
    loop = wavesweep.compile(tomllib.loads(BILATERAL))
    for name, span in (("ke", (0, 20000)), ("b", (0.1, 500))):
        (row,) = loop.stable_intervals(name, span).itertuples()
        assert row.certified
        below, above = loop.spectral_radius(**{name: [row.high * (1 - 1e-6), row.high * (1 + 1e-6)]})
        assert below < 1 < above
