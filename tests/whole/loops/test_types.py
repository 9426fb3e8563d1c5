"""Every type of block does the same wherever it is written: in frames, in the simulation, in balls and in C."""

import shutil

import numpy as np
import pytest
from flint import arb
from scipy.linalg import null_space, orth
from support.exports import made, present, written

import wavesweep
from wavesweep import UsageError, load
from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._loops.integrator_modes import equations_of
from wavesweep.engine._monodromy.periodic import Ticks, frame_of
from wavesweep.engine._sets.enclosed_loop import EnclosedLoop, Side
from wavesweep.engine.loop import Loops
from wavesweep.simulation.from_spec import simulated

METHODS = "explicit", "implicit", "trapezoidal"
CASES = [
    ("mass", {"mass": 0.4, "damping": 3.0, "stiffness": 20.0}),
    ("inertia", {"inertia": 0.4, "damping": 3.0, "stiffness": 20.0}),
    ("spring", {"k": 30.0, "d": 0.5}),
    ("mass_matrix", {"mass": [[0.4, 0.1], [0.1, 0.3]], "damping": [[3, 0], [0, 2]], "stiffness": [[20, 5], [5, 30]]}),
    ("mass_matrix", {"mass": [[0.4, 0.3, 0.2]], "damping": [[3, 2, 1]], "through": [[1, 0], [0, 1], [0.5, -0.3]]}),
    ("ss", {"A": [[-3, 1], [0.2, -5]], "B": [[1], [2]], "C": [[1, -1]], "D": [[0.3]]}),
    ("ss", {"A": [[0.5, 0.2], [-0.1, 0.8]], "B": [[1], [0.3]], "C": [[0.4, -0.6]], "D": [[0.2]], "discrete": True}),
    ("tf", {"num": [0.2, 3], "den": [0.5, 4]}),
    ("tf", {"num": [0.4, -0.3, 0.1], "den": [1, -0.7, 0.2], "discrete": True}),
    ("tf", {"num": [0.4, -0.3, 0.1, 0.2], "den": [1, 0.9, 0, 0], "discrete": True}),
    ("gain", {"k": 0.7}),
    ("delay", {"steps": 2}),
    ("delay", {"steps": 0}),
    ("hold", {}),
    ("impulse", {}),
    ("saturation", {"high": 1e3, "low": -2e3}),
    ("channel", {"late": 1, "lost": 1, "missing": "zero"}),
    ("difference", {}),
    *(("integrator", {"method": method}) for method in METHODS),
    ("butterworth", {"order": 3, "cutoff_hz": 30.0}),
    ("butterworth", {"order": 2, "cutoff_hz": 30.0, "pass": "high"}),
    ("lowpass", {"a": 0.3}),
    ("lowpass", {"cutoff_hz": 20.0}),
    *(("pi", {"kp": 0.5, "ki": 2.0, "method": method}) for method in METHODS),
    *(("pid", {"kp": 0.5, "ki": 2.0, "kd": 0.002, "tau": 0.01, "method": method}) for method in METHODS),
    ("lead", {"zero_hz": 10.0, "pole_hz": 45.0}),
    ("notch", {"frequency_hz": 40.0, "q": 2.0, "depth": 0.1}),
    ("biquad", {"b0": 0.2, "b1": -0.5, "b2": 0.7, "a1": -1.2, "a2": 0.5}),
    ("fir", {"coefficients": [0.4, -0.3, 0.1, 0.2]}),
    ("fir", {"coefficients": [0.7]}),
    ("mean", {"n": 4}),
    ("wave", {"b": 5.0, "gives": "force"}),
    ("wave", {"b": 5.0, "gives": "velocity"}),
    *(("avatar", {"b": 5.0, "integration": method}) for method in METHODS),
    *(("local_model", {"b": 5.0, "K": 40.0, "B": 0.5, "integration": method}) for method in METHODS),
]
IDS = [f"{kind}-{'-'.join(map(str, keys.values()))}"[:40] for kind, keys in CASES]
EVERY_TYPE = pytest.mark.parametrize(("kind", "keys"), CASES, ids=IDS)


def tables_of(kind, keys, **more):
    """A mass on a spring, whose motion a block reads, and which it pushes with all that it gives; holds are next to plants."""
    given = TYPES[kind].keys
    inputs, outputs = TYPES[kind].ports_of({name: keys.get(name, key.default) for name, key in given.items()})
    plant = TYPES[kind].is_plant({"discrete": keys.get("discrete", False)})
    read = {f"b.{port}": f"{1 - 0.3 * i}*m.x + 0.1*m.v" for i, port in enumerate(inputs)}
    shown = " + ".join(f"{0.3 + 0.2 * i}*b.{port}" for i, port in enumerate(outputs))
    held = {}
    if plant:
        held = {f"s{i}": {"type": "hold", "every": "n"} for i in range(len(inputs) + 1)}
        read = {f"s{i}.u": text for i, text in enumerate(read.values())} | {port: f"s{i}.y" for i, port in enumerate(read)}
        read |= {f"s{len(inputs)}.u": shown}
        shown = f"s{len(inputs)}.y"
    body = {"type": "mass", "mass": 0.3, "damping": 2.0, "stiffness": 400.0}
    return {
        "rates": {"tick_hz": 300},
        "numbers": {"g": 0.8, "n": 3},
        "block": {"m": body, "b": {"type": kind, **keys} | ({} if plant else {"every": "n"}), **held},
        "wire": {**read, "m.f": f"push - g*({shown})"},
        "ports": {"hand": {"force": "push", "displacement": "m.x"}},
        **more,
    }


def test_every_type_is_tried():
    assert {kind for kind, _ in CASES} == TYPES.keys()


@EVERY_TYPE
def test_frames_and_the_simulation_move_a_mass_alike(kind, keys):
    spec = load(tables_of(kind, keys))
    push = np.random.default_rng(3).normal(size=90)
    ticks, x, rows = Ticks.of(Loops(spec.drawing, spec.values).drawn(), ("m.x",)), 0.0, []
    state = np.zeros(len(ticks.states))
    for k, f in enumerate(push):
        each = ticks.maps[ticks.kind[k % ticks.kind.size]]
        x = each.C @ state + each.D[:, 0] * f
        rows.append(x[0])
        state = state + each.E @ state + each.B[:, 0] * f
    found = simulated(spec, push).signals["x"]
    np.testing.assert_allclose(found, rows, rtol=0, atol=1e-11 * np.abs(rows).max())


@EVERY_TYPE
def test_frames_in_doubles_and_in_balls_have_the_same_eigenvalues(kind, keys):
    """By the traces of their powers, whatever their states are."""
    spec = load(tables_of(kind, keys))
    doubles = frame_of(Ticks.of(Loops(spec.drawing, spec.values).drawn(), alone=True))
    doubles = doubles + np.eye(len(doubles))
    ticks = pytest.importorskip("wavesweep.prove.ticks")
    frame, _ = ticks.BallLoop(spec.drawing, spec.values, "numbers.g").frame(arb(0.8))
    balls = np.array([[float(entry.mid()) for entry in row] for row in frame.tolist()])
    for power in (1, 2, 3, 5):
        one, other = (np.trace(np.linalg.matrix_power(each, power)) for each in (doubles, balls))
        assert one == pytest.approx(other, rel=1e-11, abs=1e-11)


def at_rest(E, B, C, D):
    """The projector onto the inputs and outputs that may stay, `0 = E x + B u` and `y = C x + D u`."""
    p, m = np.shape(D)
    n = len(E)
    E, B, C, D = (np.reshape(each, shape) for each, shape in zip((E, B, C, D), ((n, n), (n, m), (p, n), (p, m)), strict=True))
    staying = null_space(np.hstack([E, B]), rcond=1e-9)
    shown = orth(np.vstack([staying[n:], np.hstack([C, D]) @ staying]), rcond=1e-9)
    return shown @ shown.T


@EVERY_TYPE
def test_blocks_in_doubles_and_in_fractions_come_to_rest_alike(kind, keys):
    spec = load(tables_of(kind, keys))
    drawn = Loops(spec.drawing, spec.values).drawn()
    (block,) = (each.block for each in drawn.placed if each.block.name == "b")
    rest = equations_of(spec.drawing, spec.values, (), "", [each.block for each in drawn.placed])
    states = [name for name in rest.changes if name.startswith("b.")]
    inputs = [f"b.{port}" for port in block.inputs]

    def rows(sums, names):
        return [[float(each.get(name, 0)) for name in names] for each in sums]

    changes = [rest.changes[name] for name in states]
    outputs = []
    for port in block.outputs:
        whole = dict(rest.outputs[f"b.{port}"])
        for name in [name for name in whole if name in rest.states and name not in states]:
            factor = whole.pop(name)
            for source, share in rest.states[name].items():
                whole[source] = whole.get(source, 0) + factor * share
        outputs.append(whole)
    found = at_rest(rows(changes, states), rows(changes, inputs), rows(outputs, states), rows(outputs, inputs))
    exact = at_rest(block.E, block.B, block.C, block.D)
    np.testing.assert_allclose(found, exact, rtol=0, atol=1e-9)


def by_a_number(value):
    """A key's numbers times w, of lists within lists too."""
    if isinstance(value, list):
        return [*map(by_a_number, value)]
    return f"{value}*w" if isinstance(value, float) else value


@EVERY_TYPE
def test_ticks_over_a_cell_enclose_those_of_all_its_numbers(kind, keys):
    tables = tables_of(kind, {name: by_a_number(value) for name, value in keys.items()})
    tables["numbers"]["w"] = 1.0
    tables["wire"]["m.f"] = tables["wire"]["m.f"].replace("g*", "g*w*")  # of a block without numbers
    spec = load(tables)
    drawing, values = spec.drawing, dict(spec.values)
    paths, middle, half = ["numbers.g", "numbers.w"], np.array([0.8, 1.0]), np.array([0.1, 0.01])
    drawn = Loops(drawing, values).drawn()
    running, order = drawn.schedule()
    model = EnclosedLoop(drawing, values, [Side(path) for path in paths], 3).over(np.stack([middle - half, middle + half]))
    ticks = [model.tick(drawn, int(np.argmax(order == each)), drawn.held()) for each in range(len(running))]
    for s in ((-1.0, -1.0), (1.0, -1.0), (0.3, -0.7), (1.0, 1.0)):
        at = dict(zip(paths, (middle + half * s).tolist(), strict=True))
        exact = Ticks.of(Loops(drawing, values | at).drawn(), alone=True).maps
        for tick, wanted in zip(ticks, exact, strict=True):
            value = np.tensordot((np.array(s) ** tick.exponents).prod(1), tick.terms, 1)
            assert (np.abs(value - wanted.E) <= tick.rest + 1e-13 * (1 + np.abs(wanted.E))).all()
            assert np.max(tick.rest) < 1e-3  # or it would enclose other blocks too


@pytest.mark.slow
@pytest.mark.sample(6)
@EVERY_TYPE
def test_no_bit_differs_between_the_simulation_and_c(kind, keys, tmp_path):
    if "gcc" not in present() or not shutil.which("make"):
        pytest.skip("no gcc")
    tables = tables_of(kind, keys, simulate={"input": "noise", "duration_s": 0.3})
    if kind in ("spring", "ss", "tf") and not keys.get("discrete"):
        with pytest.raises(UsageError, match=r"whose outputs follow its inputs a tick later, found block\.b with direct terms"):
            written(tables, tmp_path)
        return
    written(tables, tmp_path)
    code, said = made(tmp_path, "check", "gcc", "-O0")
    assert (code, said[-16:]) == (0, " no bit differs\n"), said


@pytest.mark.slow
@pytest.mark.sample(3)
@pytest.mark.parametrize(("kind", "keys"), [case for case in CASES if "trapezoidal" not in case[1].values()])
def test_frames_that_vary_are_judged_or_refused_by_name(kind, keys):
    """A type that runs between frames needs a rule for steps that vary; without one nothing is said of it."""
    varying = {"for_all": {"n": {"values": [3, 4], "varying": True}}, "sweep": {"along": "g", "g": {"start": 0, "stop": 1}}}
    tables = tables_of(kind, keys) | varying
    if not TYPES[kind].steps and "every" in tables["block"]["b"]:
        with pytest.raises(UsageError, match=rf"have a rule for steps that vary .*, found b \({kind}\)"):
            wavesweep.stability_region(tables)
    else:
        table = wavesweep.stability_region(tables)
        assert (table["doubt"].eq("") == table["certified"].astype(bool)).all()
