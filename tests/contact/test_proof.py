"""A wall that pushes and never pulls: proofs held against responses and motions from elsewhere."""

import re
from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.linalg import expm

import wavesweep
from wavesweep.contact.motions import motion_beyond
from wavesweep.contact.multipliers import Multiplier
from wavesweep.contact.stretches import Line
from wavesweep.contact.sums_of_squares import serves
from wavesweep.contact.wall_loop import WallLoop, WallsAlong
from wavesweep.engine._search.open_loops import open_loops
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

WALL = ("environment.K_VE", "environment.B_VE")
MASS, DAMPING, PERIOD = 0.1, 1.5, 0.02
SLOW = {"controller": {"kind": "dc-slow"}, "device": {"mass": MASS, "damping": DAMPING}, "rates": {"ratio": 20}}
FIG4 = {
    "controller": {"kind": "pmw", "b": 10.0},
    "environment": {"integration": "explicit", "delay": 1, "B_VE": 1.0},
    "device": {"velocity": "difference"},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 10.0}},
}


def wall_loop(spec) -> WallLoop:
    """The loop of a spec cut at its wall."""
    return WallLoop.of(open_loops(own_loop(load(spec), WALL[0]).read, *WALL).cut)


def sampled_device():
    """The device over a frame, `x[k+1] = A x[k] + b f[k]` of position and speed, f held."""
    continuous = np.array([[0.0, 1.0, 0.0], [0.0, -DAMPING / MASS, 1 / MASS], [0.0, 0.0, 0.0]])
    held = expm(continuous * PERIOD)
    return held[:2, :2], held[:2, 2]


def any_multiplier(rng, lags=6):
    """Weights at random, most of them zero, with a sum below 1."""
    weights = rng.random(2 * lags) * (rng.random(2 * lags) < 0.4)
    weights *= rng.random() / max(weights.sum(), 1e-3)
    return Multiplier(weights[:lags], weights[lags:])


def test_what_is_proved_holds_at_every_angle_of_a_response_computed_elsewhere():
    """A sampled mass by python-control at thousands of angles; both answers occur often."""
    rng, loop = np.random.default_rng(93), wall_loop(SLOW)
    angles = np.concatenate([np.geomspace(1e-6, 0.1, 400), np.linspace(0.1, np.pi, 4000)])
    A, b = sampled_device()
    system = control.ss(A, -b[:, None], np.eye(2), 0, PERIOD)
    x, v = system(np.exp(1j * angles), squeeze=True)
    said = []
    for _ in range(300):
        multiplier, wall = any_multiplier(rng), rng.random(2) * np.array([200.0, 4.0])
        lags = np.arange(1, 7)
        back = np.exp(-1j * np.outer(angles, lags))
        M = 1 - back @ multiplier.before - back.conj() @ multiplier.after
        values = (M * (1 - wall[0] * x - wall[1] * v)).real
        proved = serves(loop, wall[None], multiplier)
        assert not proved or values.min() > 0
        assert proved or values.min() < 1e-4 * np.abs(values).max()
        said.append(proved)
    assert 30 < sum(said) < 270


@pytest.mark.parametrize(
    "multiplier",
    [Multiplier(np.array([0.6]), np.array([0.4])), Multiplier(np.array([-0.1]), np.array([0.2]))],
    ids=["the sum is 1", "a weight is negative"],
)
def test_weights_of_no_multiplier_prove_nothing(multiplier):
    assert not serves(wall_loop(SLOW), np.array([[10.0, 1.0]]), multiplier)


def test_a_pole_that_a_wall_drives_outwards_is_refused():
    """A wall of negative stiffness: the residue of its pole at z = 1 has the wrong sign."""
    nothing = Multiplier(np.zeros(1), np.zeros(1))
    assert serves(wall_loop(SLOW), np.array([[1.0, 0.0]]), nothing)
    assert not serves(wall_loop(SLOW), np.array([[-1.0, 0.0]]), nothing)


def test_errors_of_the_frame_count():
    """A wall next to its limit is not proved if the frame is known to 1e-4 only."""
    loop = wall_loop(FIG4)
    line = Line.of(WallsAlong(loop, 0, 5.0))
    piece = line.proved(0.0, 1198.0)
    assert serves(loop, line.walls.at(0.0, 1198.0), piece.multiplier)
    rough = replace(loop, E=loop.E._replace(error=1e-4 * np.abs(loop.E.value)))
    assert not serves(rough, line.walls.at(0.0, 1198.0), piece.multiplier)


def level_wall(motion):
    """A wall that is level about the points of a motion and rises with slope 1 between them."""
    order = np.argsort(motion.reading)
    reading, force = motion.reading[order], motion.force[order]
    room = (np.diff(reading) - np.diff(force)) / 2
    corners = np.concatenate([reading[:-1] + room, reading[1:] - room])
    return np.sort(corners), np.repeat(force, 2)[1:-1]


def march(wall, readings, forces, push, state, frames):
    """The forces of a wall on a sampled mass, of the equations of this test alone."""
    A, b = sampled_device()
    found = []
    for _ in range(frames):
        found.append(np.interp(wall @ state, readings, forces))
        state = A @ state + b * (push - found[-1])
    return np.array(found)


def test_a_motion_that_refutes_goes_on_though_it_is_disturbed():
    """Direct coupling to the slow wall: marched from a start that is off by a thousandth."""
    line = Line.of(WallsAlong(wall_loop(SLOW), 0, 0.3))
    linear = wavesweep.compile(SLOW).stable_intervals(along="K_VE", span=(0, 500), B_VE=[0.3])
    interval = float(linear.high[0])
    stretch = line.stretch(0.0, interval)
    motion = motion_beyond(line.walls, stretch.high, interval, inside=3e-3)
    assert 0.1 * interval < stretch.high < motion.value < interval
    A, b = sampled_device()
    wall, period = np.array([motion.value, 0.3]), motion.force.size
    steady = np.zeros(2)
    for k in range(400 * period):
        steady = A @ steady + b * (motion.push - motion.force[k % period])
    steady[0] += (motion.reading[0] - wall @ steady) / wall[0]
    readings, forces = level_wall(motion)
    assert (np.diff(forces) >= -1e-12).all()
    assert (np.diff(readings) - np.diff(forces) >= -1e-12).all()
    disturbed = steady + np.array([1e-3 * motion.reading.max() / wall[0], 0.0])
    found = march(wall, readings, forces, motion.push, disturbed, 2000)
    assert np.ptp(found[-period:]) > 0.5 * np.ptp(motion.force)


@pytest.mark.parametrize("inside", [1e-3, 1e-5, 1e-7])
def test_the_forces_that_are_printed_refute(inside):
    """However near to where the motion begins to exist: marched with the printed forces alone, the wall that they ask for
    has slopes from 0 to 1."""
    line = Line.of(WallsAlong(wall_loop(SLOW), 0, 0.3))
    linear = wavesweep.compile(SLOW).stable_intervals(along="K_VE", span=(0, 500), B_VE=[0.3])
    motion = motion_beyond(line.walls, 100.0, float(linear.high[0]), inside=inside)
    text = str(motion)
    points = [tuple(map(float, pair.split(", "))) for pair in re.findall(r"\(([^)]*)\)", text)]
    push = float(text.rpartition(" ")[2])
    forces = np.array([force for _, force in points])
    A, b = sampled_device()
    wall, readings = np.array([motion.value, 0.3]), []
    state = np.zeros(2)
    for k in range(400 * forces.size):
        readings.append(wall @ state)
        state = A @ state + b * (push - forces[k % forces.size])
    last = np.array(readings[-forces.size :])
    order = np.argsort(last)
    rise, run = np.diff(forces[order]), np.diff(last[order])
    assert (rise >= 0).all()
    assert (run - rise >= -1e-9 * np.ptp(last)).all()
    printed = np.array([reading for reading, _ in points])
    assert printed - printed.min() == pytest.approx(last - last.min(), abs=10.0 ** (1 - motion.digits) * np.ptp(last))
