"""What encoder, friction and motors do to a loop, against simulations with them, which share nothing with the bounds."""

import numpy as np
import pytest
from meaning.specs import controller
from scipy.linalg import block_diag
from support.specs import nested, values_of

import wavesweep
from wavesweep.engine._loops.from_drawing import REACTION
from wavesweep.haptics.held_loop import device_of
from wavesweep.program.analyses.hardware_limits import (
    ROUNDING,
    hardware_of,
    limits_of_walls,
    peak_of_encoder,
    readings,
)
from wavesweep.program.analyses.own_design import own_design
from wavesweep.program.sweep.grid import own_loop
from wavesweep.simulation import table as simulation
from wavesweep.simulation.hardware import Effects
from wavesweep.simulation.march import simulate

STEP = 5e-5  # m, of the encoder


def marched(drawn, inputs, signal):
    """A signal of blocks that are given by matrices, tick by tick from rest."""
    blocks = [placed.block for placed in drawn.placed]
    outputs = [f"{block.name}.{port}" for block in blocks for port in block.outputs]
    known = [*outputs, *inputs]

    def row(name):
        """What a signal is of the outputs and inputs."""
        if name in known:
            return np.eye(len(known))[known.index(name)]
        return sum((gain * row(source) for source, gain in drawn.sums.get(name, {}).items()), np.zeros(len(known)))

    E, B, C, D = (block_diag(*(getattr(block, name) for block in blocks)) for name in "EBCD")
    sums = np.array([row(f"{block.name}.{port}") for block in blocks for port in block.inputs])
    owners = {side: [n for n, each in enumerate(blocks) for _ in getattr(each, side)] for side in ("states", "outputs")}
    x, y, shown, found = np.zeros(len(E)), np.zeros(len(outputs)), row(signal), []
    for record in zip(*inputs.values(), strict=True):
        runs = np.array([len(found) % placed.every == placed.phase for placed in drawn.placed])
        now, moves = runs[owners["outputs"]], runs[owners["states"]]
        through = (D @ sums)[now]
        given = C[now] @ x + through @ np.concatenate([np.where(now, 0.0, y), record])
        y[now] = np.linalg.solve(np.eye(now.sum()) - through[:, : len(y)][:, now], given)
        whole = np.concatenate([y, record])
        x[moves] += (E @ x + B @ (sums @ whole))[moves]
        found.append(shown @ whole)
    return np.array(found)


def forces_of_errors(spec, ticks):
    """The force in each tick (row) after a reading that is wrong by 1 m in one tick (column), by marching."""
    loop = own_loop(spec)
    drawn = readings(loop.drawn(), device_of(loop.drawing))
    found = np.zeros((ticks, ticks))
    for phase in range(drawn.ticks):
        inputs = {name: np.zeros(ticks) for name in drawn.inputs} | {ROUNDING: np.arange(ticks) == phase}
        after = marched(drawn, inputs, REACTION)
        for frame in range(phase, ticks, drawn.ticks):
            found[frame - phase :, frame] = after[: ticks - frame + phase]
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "changes"),
    [("dc", {"K_VE": 800.0, "damping": 5.0}), ("pmw-lm", {"K_VE": 300.0, "Kp": 20.0, "damping": 5.0})],
)
def test_the_peak_gain_is_the_sum_of_a_marched_loops_forces(kind, changes):
    spec = wavesweep.load(nested(values_of(kind, velocity="difference", ratio=5, **changes)))
    ticks = 3600
    forces = forces_of_errors(spec, ticks)
    found = peak_of_encoder(own_loop(spec))
    last = forces[-5:]  # a row for each phase of the frame; what is older than the run has settled
    assert found.excess <= 1e-6 * found.gain
    assert np.abs(last).sum(1).max() == pytest.approx(found.gain, rel=1e-6)
    after = np.cumsum(forces[:, ::-1], axis=1)[:, ::-1]  # of a step from each tick on
    assert np.abs(after[:, :1000]).max() == pytest.approx(found.step, rel=1e-6)


@pytest.mark.slow
def test_no_run_with_an_encoder_goes_beyond_the_bound():
    rng, bounded = np.random.default_rng(0), 0
    for number in range(30):
        tables = controller(number, quick=True)
        tables["device"]["velocity"] = "difference"
        spec = wavesweep.load(tables)
        peak = peak_of_encoder(own_loop(spec)) if own_design(spec)["stable"] else None
        if peak is None:  # nothing is said
            continue
        bounded += 1
        for force in (
            rng.normal(0, 10 ** rng.uniform(-2, 1), 800),
            np.where(np.arange(800) > 50, 10 ** rng.uniform(-2, 1), 0.0),
        ):
            with_encoder, without = (
                simulate(spec.values, force, Effects(resolution=step)).signals["f_m"] for step in (STEP, 0.0)
            )
            assert np.abs(with_encoder - without).max() <= peak.gain * STEP / 2 * (1 + 1e-9) + 1e-12, number
    assert bounded >= 5


def test_a_wall_is_passive_below_both_limits_of_abbott_and_okamura():
    """`K <= min(2 d/T, 2 f_c/D)` of a spring alone without a delay; nothing is said of other walls."""
    device = {"mass": 0.1, "damping": 1.5, "velocity": "difference"}
    for changes, friction, passive in (
        ({"K_VE": 2900.0}, 0.1, True),
        ({"K_VE": 3100.0}, 0.1, False),
        ({"K_VE": 2900.0}, 0.07, False),
        ({"K_VE": 2900.0, "B_VE": 1.0}, 0.1, None),
    ):
        wall = {"B_VE": 0.0, **changes}
        tables = {"controller": {"kind": "dc"}, "device": device, "environment": wall}
        found = hardware_of(wavesweep.load(tables | {"simulate": {"resolution": STEP, "friction": friction}}))
        assert found.get("passive") is passive


def worst_forces(spec, signs):
    """Forces of the hand that keep a device within a step of its encoder, in each tick on the side of these signs.

    The encoder then reads 0 in every tick, and is wrong by minus the position.
    """
    values, tick = spec.values, 1 / spec.values["rates.fast_hz"]
    mass, damping = (values[f"device.{part}"] + values[f"operator.{part}"] for part in ("mass", "damping"))
    decay = np.exp(-damping / mass * tick)
    from_v, of_f = mass / damping * (1 - decay), (tick - mass / damping * (1 - decay)) / damping
    x, v, net = 0.0, 0.0, []
    for target in np.append(signs[1:], 0.0) * -STEP / 2 * (1 - 1e-6):
        net.append((target - x - from_v * v) / of_f)
        x, v = target, v * decay + net[-1] * (1 - decay) / damping
    return np.array(net)


@pytest.mark.parametrize("kind", ["dc", "pmw"])
def test_the_worst_hand_comes_near_the_bound(kind):
    """The controller reads 0 and exerts nothing, so that the hand alone moves the device."""
    spec = wavesweep.load(nested(values_of(kind, velocity="difference", ratio=5, K_VE=300.0, B_VE=3.0, damping=5.0)))
    ticks = 400
    row = forces_of_errors(spec, ticks)[-1]
    force = worst_forces(spec, np.sign(row))
    with_encoder, without = (simulate(spec.values, force, Effects(resolution=step)).signals["f_m"] for step in (STEP, 0.0))
    bound = peak_of_encoder(own_loop(spec)).gain * STEP / 2
    assert bound / 3 < np.abs(with_encoder - without).max() <= bound


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "rests"), [(0.9, True), (1.2, False)])
def test_friction_holds_a_device_between_two_steps_of_its_encoder_up_to_its_limit(factor, rests):
    """A hand that presses half a step deep: beyond the limit neither of both readings lets the device rest."""
    tables = nested(values_of("dc", mass=0.1, damping=0.3, B_VE=0.0)) | {"simulate": {"resolution": STEP, "friction": 0.02}}
    limit = limits_of_walls(wavesweep.load(tables))["holds_to"]
    assert limit == pytest.approx(2 * 0.02 / STEP)
    walls = {**tables, "environment": {**tables["environment"], "K_VE": factor * limit}}
    ticks = np.arange(6000)
    force = factor * limit * STEP * 20.5 * np.minimum(ticks / 2000, 1.0)
    end = wavesweep.compile(walls).simulate(force)["x"].to_numpy()[-1000:]
    assert bool(np.ptp(end) == 0) is rests


RUBBING = {
    "device": {"mass": 0.045, "damping": 0.5, "velocity": "difference"},
    "controller": {"kind": "dc-slow"},
    "environment": {"K_VE": 300.0, "B_VE": 1.0, "delay": 1},
}


def rubbed(push, friction=0.26, parts=100, ticks=2000):
    """Positions of RUBBING in each tick after a push from 0.1 to 0.15 s, by small steps in which friction stops or brakes."""
    T, x, v, last, wall, held, rows = 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, []
    for k in range(ticks):
        rows.append(x)
        held = wall if k % 20 == 1 else held
        wall = 300.0 * x + (x - last) / T if k % 20 == 0 else wall
        last, force = x, push * (100 <= k < 150) - held
        for _ in range(parts):
            if v == 0 and abs(force) <= friction:
                break
            new = v + T / parts / 0.045 * (force - 0.5 * v - np.copysign(friction, v or force))
            v, before = (new, v) if v * new >= 0 else (0.0, v)
            x += T / parts * (v + before) / 2
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize(("push", "rests"), [(0.5, True), (1.0, False)])
def test_friction_brings_an_unstable_loop_to_rest_after_a_small_push(push, rests):
    tables = RUBBING | {"simulate": {"friction": 0.26, "input": "pulse", "amplitude": push, "duration_s": 2.0}}
    found, (run, *_) = wavesweep.verdict(tables), simulation.simulate(wavesweep.load(tables).asking("simulate"))
    moving = np.flatnonzero(np.diff(rubbed(push)))[-1] + 1
    rest_s = simulation._run_numbers(run.columns, run.facts)["rest_s"]
    assert not found["stable"]
    assert (rest_s is not None) == (moving < 1900) == rests
    if rests:
        assert rest_s == pytest.approx(moving * 1e-3, abs=2e-3)
