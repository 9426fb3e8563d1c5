"""Controllers at rates that do not divide: against their own lifting where they do, and against a run of events in time."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import butter, tf2ss

from wavesweep.engine._loops.from_drawing import FACTOR, PRODUCT
from wavesweep.engine._monodromy.open_ticks import OpenTicks
from wavesweep.haptics.controllers import CONTROLLERS, WALL
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

BASE = {"controller": {"Kp": 20.0}, "environment": {"K_VE": 700.0, "B_VE": 3.0}}


def spec_of(kind, **tables):
    return load({name: {**BASE.get(name, {}), **tables.get(name, {})} for name in {*BASE, *tables}} | {
        "controller": {**BASE["controller"], "kind": kind, **tables.get("controller", {})}
    })  # fmt: skip


def radius(spec):
    return own_loop(spec).radii().item()


def run(values, ratio, state, frames_run):
    """Plain waves or direct coupling by events in time: fast ticks at n, slow steps at k ratio, the fast tick first.

    state: everything that the loop remembers, `(n,)`; given back after so many frames of fast ticks.
    """
    T, m, d = 1 / values["rates.fast_hz"], values["device.mass"], values["device.damping"]
    b, order, delay = values["controller.b"], values["filters.lp1.order"], values["environment.delay"]
    M = expm(np.array([[0, 1, 0], [0, -d / m, 1 / m], [0, 0, 0]]) * T)
    A, B, C, D = tf2ss(*butter(order, values["filters.lp1.cutoff_hz"] * 2 * T))
    (x, v), f, s = state[:2], state[2 : 2 + order].reshape(-1, 1), state[2 + order]
    held, results = state[3 + order], dict(zip((-3, -2, -1), state[4 + order :], strict=True))  # shown, and the last results
    waves, root = values["controller.kind"] == "pmw", np.sqrt(2 * b)

    def step(held, x, v, f, s):
        """The result of a slow step and the next start of its avatar, if `held` is shown."""
        if not waves:
            return values["environment.K_VE"] * x + values["environment.B_VE"] * v, s
        return avatar((C @ f)[0, 0] + D[0, 0] * (root * v - held), s, values, float(ratio) * T)

    for n in range(frames_run * ratio.numerator):
        held = next((results[k] for k in results if -(-k * ratio // 1) + delay == n), held)
        k = next((k for k in range(n + 1) if n <= k * ratio < n + 1), None)
        if k is not None and k * ratio == n and delay == 0:
            # The result of a step in the very tick closes a loop of direct terms: two tries tell its solution.
            zero, one = (step(tried, x, v, f, s)[0] for tried in (0.0, 1.0))
            held = zero / (1 - (one - zero))
        if k is not None:
            results[k], s = step(held, x, v, f, s)
        f_m = b * v - root * held if waves else held
        f = A @ f + B * (root * v - held)
        x, v, _ = M @ [x, v, -f_m]
    return np.array([x, v, *f.ravel(), s, held, *(results[k] for k in sorted(results)[-3:])])


def avatar(u, s, values, step):
    """The wave that goes back and the next start of the step, explicitly integrated."""
    b, K, B = (values[path] for path in ("controller.b", *WALL))
    velocity = (np.sqrt(2 * b) * u - K * s) / (b + B)
    return u - np.sqrt(2 / b) * (K * s + B * velocity), s + step * velocity


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dc-slow", "pmw"])
@pytest.mark.parametrize(
    ("slow_hz", "delay"), [(60.0, 0), (60.0, 1), (60.0, 15), (60.0, 16), (400.0, 0), (300.0, 2), (61.538, 15)]
)
def test_rates_that_do_not_divide_give_the_loop_of_a_run_in_time(kind, slow_hz, delay):
    slow_hz = 1000 / 16.25 if slow_hz == 61.538 else slow_hz
    spec = spec_of(
        kind, rates={"slow_hz": slow_hz}, controller={"Kp": 0.0}, environment={"integration": "explicit", "delay": delay}
    )
    assert isinstance(spec.values["rates.ratio"], float)
    ratio = Fraction(spec.values["rates.ratio"]).limit_denominator(1000)
    values, size = spec.values, 4 + spec.values["filters.lp1.order"] + 3
    whole = np.stack([run(values, ratio, unit, 2) for unit in np.eye(size)], axis=1)
    found = np.abs(np.linalg.eigvals(whole)) ** 0.5
    largest = found[np.abs(found - 1) > 1e-9].max()  # of direct coupling the avatar's state is not read
    assert radius(spec) == pytest.approx(largest, rel=1e-9)


@pytest.mark.sample(7)
@pytest.mark.parametrize("path", WALL)
@pytest.mark.parametrize("kind", CONTROLLERS)
@pytest.mark.parametrize("delay", [0, 7])
def test_ticks_cut_at_the_wall_and_closed_again_are_those_with_the_wall(kind, delay, path):
    """Of three loops at three walls each, which a batch would connect one by one."""
    loop = own_loop(spec_of(kind, environment={"delay": delay}, rates={"slow_hz": 60.0}))
    mass, p = np.array([0.1, 0.3, 0.7]), np.array([[0.5, 80.0, 3000.0]])
    some = loop.changed({"device.mass": mass, path: 1.0})
    ticks = OpenTicks.of(some.drawn(path), some.drawn(), PRODUCT, FACTOR)
    drift = loop.changed({path: np.array([0.5, 2.0])}).drift()
    found = drift.frames_of(ticks.closed(np.arange(3)[:, None], p))
    whole = loop.changed({"device.mass": mass[:, None], path: p}).frames(drift)
    np.testing.assert_allclose(found, whole, rtol=0, atol=1e-12 * np.abs(whole).max())
