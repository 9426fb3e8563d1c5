"""Frames of varying length in [simulate], against a march in plain numpy and against frames of one length."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import butter

from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import load
from wavesweep.simulation.from_spec import simulated
from wavesweep.simulation.record import recorded

FIG4 = {
    "controller": {"kind": "pmw", "b": 10.0},
    "environment": {"integration": "explicit", "delay": 1, "B_VE": 1.0},
    "device": {"velocity": "difference"},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
}
WORST = [16, 16, 20, 33, 33]  # of frames of 16, 20, 25 and 33 ticks


def fig4(frames, **tables):
    return load({name: FIG4[name] | tables.get(name, {}) for name in FIG4} | {"simulate": {"frames": frames}})


def marched(values, force, pattern, nominal=None):
    """The device's position under the hand's force, by the loop's difference equations, tick by tick.

    pattern: (ticks, delay) of each frame, None for a result that is lost. nominal: ticks of the wall's step; by default the
    time since the last frame.
    """
    T, b, m, d = 1e-3, values["controller.b"], values["device.mass"], values["device.damping"]
    K, B, root = values["environment.K_VE"], values["environment.B_VE"], np.sqrt(2 * b)
    step = expm(T * np.array([[-d / m, 0, 1 / m], [1, 0, 0], [0, 0, 0]]))
    (b0, b1), (_, a1) = butter(1, values["filters.lp1.cutoff_hz"], fs=1 / T)
    v = x = before = u = y = x_s = out = shown = 0.0
    elapsed, frame, k, rows = pattern[-1][0], 0, 0, []
    for f in force:
        ticks, delay = pattern[frame % len(pattern)]
        ended = pattern[(frame - 1) % len(pattern)]
        if (k == delay) or (k == 0 and ended[0] == ended[1]):
            shown = out
        wave = root * (x - before) / T - shown
        u, y = wave, b0 * wave + b1 * u - a1 * y
        pull = f - b * (x - before) / T + root * shown
        if k == 0:
            speed = (root * y - K * x_s) / (b + B)
            out = y - np.sqrt(2 / b) * (K * x_s + B * speed)
            x_s += (nominal or elapsed) * T * speed
        rows.append(x)
        before = x
        v, x = step[:2, :2] @ (v, x) + step[:2, 2] * pull
        k += 1
        if k == ticks:
            elapsed, frame, k = ticks, frame + 1, 0
    return np.array(rows)


@pytest.mark.parametrize("step", ["elapsed", "nominal"])
@pytest.mark.parametrize(
    ("frames", "pattern"),
    [
        (WORST, [(ticks, 1) for ticks in WORST]),
        ([5, {"ticks": 9, "delay": 9}, {"ticks": 7, "delay": 3}], [(5, 1), (9, 9), (7, 3)]),
        ([{"ticks": 20, "lost": True}, 20, {"ticks": 4, "lost": True}], [(20, None), (20, 1), (4, None)]),
        ([1, 3, {"ticks": 2, "delay": 2}, 1], [(1, 1), (3, 1), (2, 2), (1, 1)]),
    ],
)
def test_a_march_in_plain_numpy_has_the_same_motion(step, frames, pattern):
    spec = fig4(frames, environment={"K_VE": 200.0, "step": step})
    force = np.random.default_rng(1).normal(size=600)
    expected = marched(spec.values, force, pattern, 20 if step == "nominal" else None)
    np.testing.assert_allclose(simulated(spec, force).signals["x"], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


EFFECTS = {"wall": 0.002, "late": 9, "dropped": 0.3, "jitter": 0.2, "friction": 0.05, "max_force": 2.0}


@pytest.mark.sample(14)
@pytest.mark.slow
@pytest.mark.parametrize("effects", [{}, EFFECTS])
@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm", "dc-vc", "dc-vc-lm", "pmw", "pmw-lm"])
@pytest.mark.parametrize(("ratio", "delay"), [(1, 0), (2, 1), (7, 0), (7, 2), (7, "frame")])
def test_frames_of_one_length_are_those_of_the_ratio_to_the_last_bit(kind, ratio, delay, effects):
    loop = {"controller": {"kind": kind, "Kp": 20.0}, "rates": {"ratio": ratio}, "filters": FIG4["filters"]}
    loop |= {"environment": {"integration": "trapezoidal", "delay": delay, "K_VE": 80.0}}
    force = 0.3 + np.random.default_rng(1).normal(size=80)
    specs = [load(loop | {"simulate": effects | more}) for more in ({}, {"frames": [ratio] * 3})]
    own, framed = (recorded(simulated(spec, force)) for spec in specs)
    for name in own:
        np.testing.assert_array_equal(framed[name], own[name], err_msg=name)


DRAWN = {
    "rates": {"tick_hz": 1000},
    "numbers": {"n": 6},
    "block": {
        "m": {"type": "mass", "mass": 0.5, "damping": 2.0},
        "slow": {"type": "integrator", "every": "n", "method": "implicit"},
        "speed": {"type": "difference", "every": "n", "phase": 1},
        "later": {"type": "hold", "every": "n", "phase": 2},
    },
    "wire": {"slow.u": "m.x", "speed.u": "m.x", "later.u": "100*slow.y + 3*speed.y", "m.f": "push - later.y"},
    "ports": {"hand": {"force": "push", "displacement": "m.x"}},
}


def test_blocks_of_a_drawn_loop_follow_each_at_its_phase():
    """A difference in the second tick of a frame is over the time since that tick of the frame before."""
    pattern, force = [4, 7, 5], np.random.default_rng(1).normal(size=100)
    step = expm(1e-3 * np.array([[-4, 0, 2], [1, 0, 0], [0, 0, 0]]))
    v = x = total = before = speed = held = 0.0
    gap, frame, k, rows = pattern[-1] * 1e-3, 0, 0, []
    for f in force:
        if k == 0:
            total += gap * x
        if k == 1:
            speed, before = (x - before) / gap, x
        if k == 2:
            held = 100 * total + 3 * speed
        rows.append(x)
        v, x = step[:2, :2] @ (v, x) + step[:2, 2] * (f - held)
        k += 1
        if k == pattern[frame % 3]:
            gap, frame, k = k * 1e-3, frame + 1, 0
    seen = recorded(simulated(load(DRAWN | {"simulate": {"frames": pattern}}), force))
    np.testing.assert_allclose(seen["x"], rows, rtol=0, atol=1e-12 * np.abs(rows).max())
    np.testing.assert_array_equal(seen["phase"][:17], [*range(4), *range(7), *range(5), 0])
    np.testing.assert_array_equal(seen["frame"][[0, 3, 4, 10, 11, 15, 16, 20]], [0, 0, 1, 1, 2, 2, 3, 4])


def test_energy_out_of_the_channel_is_counted_over_the_step_of_each_frame():
    """What the avatar takes up is its force times its way, which the wall's spring and damper see."""
    seen = simulated(fig4([5, 9, 7]), np.random.default_rng(1).normal(size=84))
    first = np.isin(np.arange(84) % 21, [0, 5, 14])
    force, speed = (seen.signals[name][first] for name in ("F_s", "x_dot_s"))
    way = 1e-3 * np.resize([7, 5, 9], first.sum()) * speed
    assert seen.energy.slow[-1] == pytest.approx((force * way).sum(), rel=1e-12)


TWO = {**DRAWN, "block": DRAWN["block"] | {"later": {"type": "hold", "every": 5}}}
FILTER = {**DRAWN, "block": DRAWN["block"] | {"slow": {"type": "butterworth", "order": 1, "cutoff_hz": 9, "every": "n"}}}


@pytest.mark.parametrize(
    ("tables", "frames", "words"),
    [
        ({"controller": {"kind": "dc"}}, [20], "a slow environment, or blocks with `every` above 1, found none"),
        (FIG4 | {"environment": {"delay": 17}}, [20, 16], "at least 17 ticks, environment.delay, found 16"),
        (DRAWN, [20, 2], "more than 2 ticks, a block's phase, found 2"),
        (TWO, [20, 5], "slow blocks with the same `every`, found 5, 6"),
        (FILTER, [20, 5], r"slow blocks whose types have a rule for steps that vary .*, found slow \(butterworth\)"),
    ],
)
def test_frames_that_a_loop_cannot_have_are_refused(tables, frames, words):
    with pytest.raises(UsageError, match=f"simulate.frames: expected {words}"):
        simulated(load(tables | {"simulate": {"frames": frames}}), [1.0])
