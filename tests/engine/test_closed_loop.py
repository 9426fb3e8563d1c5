"""The front of the engine: loops from matrices, from python-control and from drawings, against loops that are run by hand."""

import doctest
import re
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.linalg import expm

from wavesweep.engine import StateSpaceBlock, loop_from_blocks, loop_from_drawing
from wavesweep.engine.errors import UsageError

ROOT = Path(__file__).parents[2]
RATE, EVERY, PHASE, KI = 500.0, 4, 1, 3.0
A, B, C = np.array([[0.0, 1.0], [-40.0, -3.0]]), np.array([[0.0], [25.0]]), np.array([[1.0, 0.0]])
WIRES = {"plant.u": "k*control.y + load", "control.u": "ref - plant.y"}


def pi_loop(plant=None, controller=None, **numbers):
    """A plant of second order and a PI controller that runs in every fourth tick, from the second one on."""
    plant = StateSpaceBlock(A, B, C) if plant is None else plant
    if controller is None:
        period = EVERY / RATE
        controller = StateSpaceBlock([[1.0]], [[period]], [[KI]], [[1.0 + KI * period]], every=EVERY, phase=PHASE)
    outputs = {"y": "plant.y", "u": "control.y"}
    return loop_from_blocks(
        {"plant": plant, "control": controller},
        WIRES,
        rate_hz=RATE,
        numbers={"k": 2.0, **numbers},
        inputs=["ref", "load"],
        outputs=outputs,
    )


def march(k, state, ref, load):
    """The same loop, tick by tick: state (x, v, integral, held output); y and u of every tick, and the state after the last."""
    M = expm(np.block([[A, B], [np.zeros((1, 3))]]) / RATE)
    shown, period = [], EVERY / RATE
    x, integral, held = np.array(state[:2]), state[2], state[3]
    for tick, (r, d) in enumerate(zip(ref, load, strict=True)):
        if tick % EVERY == PHASE:
            error = r - x[0]
            held, integral = error + KI * (integral + period * error), integral + period * error
        shown.append((x[0], held))
        x = M[:2, :2] @ x + M[:2, 2] * (k * held + d)
    return np.array(shown), np.array([*x, integral, held])


def lifted_by_hand(k):
    """A and C of a frame, by a frame from every unit state, and B and D by a frame from every unit input."""
    ticks, unit = range(EVERY), np.eye(2 * EVERY)
    frames = [march(k, state, np.zeros(EVERY), np.zeros(EVERY)) for state in np.eye(4)]
    driven = [march(k, np.zeros(4), row[0::2], row[1::2]) for row in unit]
    assert len(ticks) == EVERY
    return [np.array([part[at].ravel() for part in parts]).T for parts in (frames, driven) for at in (1, 0)]


def test_poles_radius_and_lifted_matrices_are_those_of_the_loop_run_by_hand():
    loop = pi_loop()
    frame, C_frame, B_frame, D_frame = lifted_by_hand(5.0)
    poles = loop.poles({"k": 5.0})
    assert np.sort_complex(poles.z) == pytest.approx(np.sort_complex(np.linalg.eigvals(frame)), abs=1e-12)
    assert np.exp(poles.s[:2] * loop.frame_s) == pytest.approx(poles.z[:2], rel=1e-12)
    assert loop.spectral_radius({"k": [1.0, 5.0]}) == pytest.approx(
        [np.abs(np.linalg.eigvals(lifted_by_hand(k)[0])).max() for k in (1.0, 5.0)], rel=1e-12
    )
    lifted = loop.lifted({"k": 5.0})
    assert lifted.inputs == tuple(f"{name}[{tick}]" for tick in range(4) for name in ("ref", "load"))
    assert pytest.approx(D_frame, abs=1e-13) == lifted.D
    assert pytest.approx(C_frame @ frame @ B_frame, abs=1e-13) == lifted.C @ lifted.A @ lifted.B


@pytest.mark.parametrize("name", ["k", "rates.tick_hz"])
def test_a_loop_is_stable_just_inside_every_end_and_not_just_outside(name):
    loop = pi_loop()
    intervals = loop.stable_intervals(name, (0.01, 1000.0) if name == "k" else (20.0, 5000.0))
    assert intervals.certified.all()
    assert intervals.low.size == 1
    end = intervals.high[0] if name == "k" else intervals.low[0]
    inside, outside = (1 - 1e-7, 1 + 1e-7) if name == "k" else (1 + 1e-7, 1 - 1e-7)
    if name == "k":
        assert np.abs(np.linalg.eigvals(lifted_by_hand(end * inside)[0])).max() < 1
        assert np.abs(np.linalg.eigvals(lifted_by_hand(end * outside)[0])).max() > 1
    assert loop.spectral_radius({name: [end * inside, end * outside]}) == pytest.approx([1, 1], abs=1e-6)
    assert (loop.spectral_radius({name: [end * inside, end * outside]}) < 1).tolist() == [True, False]


def test_a_response_is_that_of_the_loop_run_until_it_is_steady():
    loop, hz = pi_loop(), np.array([0.0, 9.0])
    response = loop.response(hz, "ref", "y", {"k": [0.8, 1.0]})
    assert response.value.shape == (2, 2)
    assert response.stable.all()
    assert (response.error < 1e-10).all()
    ticks = np.arange(11_000)
    for row, k in zip(response.value, (0.8, 1.0), strict=True):
        for value, f in zip(row, hz, strict=True):
            turn = 2 * np.pi * f * ticks / RATE
            wave = np.exp(1j * turn)
            shown = march(k, np.zeros(4), wave, 0 * ticks)[0][-1000:, 0]  # whole periods
            assert value == pytest.approx((shown / wave[-1000:]).mean(), rel=1e-6)


def test_gains_are_the_extremes_of_the_lifted_map_over_the_circle():
    loop = pi_loop()
    frame, C_frame, B_frame, D_frame = lifted_by_hand(2.0)
    z = np.exp(1j * np.linspace(0, np.pi, 20_001))[:, None, None]
    H = C_frame[0::2] @ np.linalg.solve(z * np.eye(4) - frame, B_frame[:, 0::2] + 0 * z) + D_frame[0::2, 0::2]
    norm, index = loop.hinf_norm("ref", "y", {"k": 2.0}), loop.passivity_index("ref", "y", {"k": 2.0})
    assert norm.certified
    largest = np.linalg.svd(H, compute_uv=False).max()  # of a grid: a little less than the peak between its points
    assert largest <= norm.value <= 1.0001 * largest
    angle = np.angle(z[np.linalg.svd(H, compute_uv=False).max(-1).argmax(), 0, 0])
    assert norm.frequency_hz == pytest.approx(angle / (2 * np.pi * loop.frame_s), rel=1e-3)
    assert index.certified
    smallest = np.linalg.eigvalsh((H + H.conj().swapaxes(-1, -2)) / 2).min()
    assert 1.0001 * smallest <= index.value <= smallest
    unstable = loop.stable_intervals("k", (0.0, 1000.0)).high[0] * 1.01
    assert loop.hinf_norm("ref", "y", {"k": [2.0, unstable]}).value.tolist() == [norm.value, np.inf]
    assert loop.passivity_index("ref", "y", {"k": unstable}).value == -np.inf


def test_an_output_that_drifts_has_no_bound_on_its_gain_and_its_velocity_has():
    loop = loop_from_drawing(
        {
            "rates": {"tick_hz": 1000},
            "numbers": {"d": 2.0},
            "block": {"body": {"type": "mass", "mass": 0.5}},
            "wire": {"body.f": "f - d*body.v"},
            "ports": {"inputs": {"f": "f"}, "outputs": {"x": "body.x", "v": "body.v"}},
        }
    )
    assert loop.spectral_radius() < 1
    assert loop.hinf_norm("f", "x").value == np.inf
    assert loop.passivity_index("f", "x").value == -np.inf
    assert loop.hinf_norm("f", "v").value == pytest.approx(0.5, rel=1e-9)  # 1/d, at 0 Hz


def test_a_loop_that_is_unstable_where_its_output_does_not_see_it_has_no_finite_gain():
    plant = StateSpaceBlock([[1.0, 0.0], [0.0, -2.0]], [[1.0], [1.0]], [[0.0, 1.0]])
    loop = loop_from_blocks({"p": plant}, {"p.u": "r"}, rate_hz=100, inputs=["r"], outputs={"y": "p.y"})
    assert loop.spectral_radius() == pytest.approx(np.exp(0.01))
    norm, index = loop.hinf_norm("r", "y"), loop.passivity_index("r", "y")
    assert (norm.value, norm.certified) == (np.inf, True)
    assert (index.value, index.certified) == (-np.inf, True)


def test_what_continuous_blocks_give_each_other_acts_continuously_and_is_named():
    """A gain between two plants is the eigenvalue of the whole; behind a hold it is that of the sampled one."""
    filtered = StateSpaceBlock([[-30.0]], [[30.0]], [[1.0]])
    blocks = {"plant": StateSpaceBlock(A, B, C), "sensor": filtered}

    def highest(wires, **more):
        loop = loop_from_blocks(blocks | more, wires, rate_hz=50, numbers={"kp": 1.0})
        return loop, loop.stable_intervals("kp", (0, 1000)).high[0]

    loop, continuous = highest({"plant.u": "-kp*sensor.y", "sensor.u": "plant.y"})
    assert loop.assumptions == (
        "plant.u: (-kp)*sensor.y acts continuously, other terms are held over each tick",
        "sensor.u: (1)*plant.y acts continuously, other terms are held over each tick",
    )
    whole = np.block([[A, -continuous * B], [30.0 * C, np.array([[-30.0]])]])
    assert np.linalg.eigvals(whole).real.max() == pytest.approx(0.0, abs=1e-9)
    held, sampled = highest({"plant.u": "-kp*held.y", "held.u": "sensor.y", "sensor.u": "plant.y"}, held={"type": "hold"})
    assert held.assumptions == ("sensor.u: (1)*plant.y acts continuously, other terms are held over each tick",)
    assert sampled < 0.9 * continuous


def test_a_loop_keeps_the_numbers_that_it_is_at():
    loop = loop_from_drawing(
        {
            "rates": {"tick_hz": 1000},
            "numbers": {"kp": 100.0, "n": 2},
            "block": {"mass": {"type": "mass", "mass": 0.1, "damping": 1.0}, "late": {"type": "delay", "steps": "n"}},
            "wire": {"late.u": "mass.x", "mass.f": "-kp*late.y"},
        }
    )
    changed = {"kp": 300.0, "n": 3}
    assert loop.at(changed).numbers == changed
    assert loop.numbers == {"kp": 100.0, "n": 2}
    np.testing.assert_array_equal(loop.at(changed).spectral_radius(), loop.spectral_radius(changed))
    np.testing.assert_array_equal(loop.at(changed).spectral_radius({"n": 2}), loop.spectral_radius({"kp": 300.0}))
    with pytest.raises(UsageError, match="expected numbers for a single loop"):
        loop.at({"kp": [1.0, 2.0]})


def test_systems_of_python_control_are_blocks_and_the_lifted_loop_is_one():
    period = EVERY / RATE
    z = control.tf([1, 0], [1], period)
    controller = control.tf(1.0, 1.0, period) + KI * period * z / (z - 1)
    ours = pi_loop(controller=StateSpaceBlock([[1.0]], [[period]], [[KI]], [[1.0 + KI * period]], every=EVERY))
    theirs = pi_loop(control.ss(A, B, C, 0), controller)
    assert theirs.stable_intervals("k", (0, 1000)).high == pytest.approx(ours.stable_intervals("k", (0, 1000)).high, rel=1e-9)
    back = ours.lifted().to_control()
    assert isinstance(back, control.StateSpace)
    assert back.dt == period
    assert np.abs(back.poles()).max() == pytest.approx(float(ours.spectral_radius()), rel=1e-9)
    with pytest.raises(UsageError, match=r"a sample time of whole ticks of 0\.002 s, found dt = 0\.003"):
        pi_loop(controller=control.tf([1], [1, 0], 0.003))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda loop: loop.spectral_radius({"kk": 1.0}), "kk: expected one of the numbers k; did you mean k?"),
        (lambda loop: loop.spectral_radius({"k": "high"}), "k: expected a finite number"),
        (lambda loop: loop.poles({"k": [1.0, 2.0]}), "expected numbers for a single loop"),
        (lambda loop: loop.stable_intervals("k", (2.0, 1.0)), "span: expected (low, high), low < high"),
        (lambda loop: loop.stable_intervals("k", (0.0, 1.0), {"k": 3.0}), "k: expected other numbers than the one"),
        (lambda loop: loop.response(1.0, "y", "y"), "expected an input of the loop, one of ref, load, found 'y'"),
        (lambda loop: loop.response(300.0, "ref", "y"), "frequency_hz: expected numbers from 0 to 250 Hz"),
        (lambda loop: loop.spectral_radius({"rates.tick_hz": -1.0}), "makes no loop: rates.tick_hz: expected a number > 0"),
    ],
)
def test_a_wrong_call_says_what_was_expected(call, message):
    with pytest.raises(UsageError, match=re.escape(message)):
        call(pi_loop())


def test_a_prover_is_asked_about_what_doubles_leave_in_doubt():
    asked = []

    def prover(_, along, period):
        asked.append((along, period.size))

    loop_from_drawing(
        {
            "rates": {"tick_hz": 10},
            "numbers": {"k": 1.0},
            "block": {
                "turn": {"type": "ss", "discrete": True, "A": [["cos(k)", "sin(k)"], ["-sin(k)", "cos(k)"]]}
                | {"B": [[0], [0]], "C": [[1, 0]]}
            },
            "wire": {"turn.u": "turn.y"},
        }
    ).stable_intervals("k", (0.5, 1.0), prover=prover)
    assert asked == [("numbers.k", 1)]


@pytest.mark.parametrize("source", [loop_from_blocks.__doc__, loop_from_drawing.__doc__])
def test_the_examples_of_the_docstrings_run(source):
    examples = doctest.DocTestParser().get_doctest(source, {}, "front", None, None)
    assert doctest.DocTestRunner().run(examples).failed == 0


@pytest.mark.slow
def test_the_page_of_the_engine_shows_what_its_lines_print():
    page = (ROOT / "docs/engine.md").read_text(encoding="utf-8")
    lines = "\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL))
    runner = doctest.DocTestRunner()
    assert runner.run(doctest.DocTestParser().get_doctest(lines, {}, "engine.md", None, None)).failed == 0
    assert runner.tries > 10
