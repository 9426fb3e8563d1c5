"""Steps that vary: marches from the table in the documents, against `simulate` and against the frames of proofs.

Each type of block is written down here once more from its rule alone: a function of what it remembers, its input, the time h
since its last run and the time before that, which gives its output and what it remembers then.
"""

import gc
from functools import reduce

import numpy as np
import pytest
from scipy.linalg import expm
from support.frames import frames_of_drawing
from support.missing import needed

import wavesweep
from wavesweep.engine._drawing.block_types import TYPES, BlockType
from wavesweep.engine._loops import blocks
from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import load

T, PATTERN, K = 1e-3, [16, 33, 16, 25, 33, 33], 3.0
METHODS = "explicit", "implicit", "trapezoidal"
STEP = expm(T * np.array([[-0.5 / 0.3, -10 / 0.3, 1 / 0.3], [1, 0, 0], [0, 0, 0]]))


def integral(method):
    """Of the last y and u."""

    def run(m, u, h, before):
        y = m[0] + {"explicit": before * m[1], "implicit": h * u, "trapezoidal": h * (u + m[1]) / 2}[method]
        return y, (y, u)

    return run


def pid(kp, ki, method, kd=0.0, tau=0.0):
    """Of those of the integral, and the last slope."""
    total = integral(method)

    def run(m, u, h, before):
        i, now = total(m, u, h, before)
        d = (tau * m[2] + u - m[1]) / (tau + h)
        return kp * u + ki * i + kd * d, (*now, d)

    return run


def end_of_wave(method, shown, b=5.0, stiffness=40.0, damping=0.5):
    """Of the last x and v; the velocity is what solves its rule with that of the force. shown: output of v, x and the wave."""

    def run(m, wave, h, _):
        def place(v):
            return m[0] + (h * (v + m[1]) / 2 if method == "trapezoidal" else h * v)

        def force(v):
            return stiffness * (m[0] if method == "explicit" else place(v)) + damping * v

        def wrong(v):
            return v - (np.sqrt(2 * b) * wave - force(v)) / b

        v = wrong(0.0) / (wrong(0.0) - wrong(1.0))
        return shown(v, place(v), wave - np.sqrt(2 / b) * force(v)), (place(v), v)

    return run


def recursion(m, u, *_):
    y = 0.4 * u - 0.3 * m[0] + 0.1 * m[1] + 0.7 * m[2] - 0.2 * m[3]
    return y, (u, m[0], y, m[2])


def states(m, u, *_):
    return 0.4 * m[0] - 0.6 * m[1] + 0.2 * u, (0.5 * m[0] + 0.2 * m[1] + u, -0.1 * m[0] + 0.8 * m[1] + 0.3 * u)


def lowpass(share):
    def run(m, u, h, _):
        y = m[0] + share(h) * (u - m[0])
        return y, (y,)

    return run


# Type, keys, how many numbers it remembers, and what it does in a run.
CASES = [
    ("gain", {"k": 1.7}, 0, lambda m, u, *_: (1.7 * u, m)),
    ("hold", {}, 0, lambda m, u, *_: (u, m)),
    ("saturation", {"high": 1e6}, 0, lambda m, u, *_: (u, m)),
    ("delay", {"steps": 3}, 3, lambda m, u, *_: (m[2], (u, *m[:2]))),
    ("fir", {"coefficients": [0.5, -0.3, 0.6]}, 2, lambda m, u, *_: (0.5 * u - 0.3 * m[0] + 0.6 * m[1], (u, m[0]))),
    ("mean", {"n": 3}, 2, lambda m, u, *_: ((u + m[0] + m[1]) / 3, (u, m[0]))),
    ("difference", {}, 1, lambda m, u, h, _: ((u - m[0]) / h, (u,))),
    ("biquad", {"b0": 0.4, "b1": -0.3, "b2": 0.1, "a1": -0.7, "a2": 0.2}, 4, recursion),
    ("tf", {"num": [0.4, -0.3, 0.1], "den": [1, -0.7, 0.2], "discrete": True}, 4, recursion),
    ("ss", {"A": [[0.5, 0.2], [-0.1, 0.8]], "B": [[1], [0.3]], "C": [[0.4, -0.6]], "D": [[0.2]], "discrete": True}, 2, states),
    ("lowpass", {"a": 0.3}, 1, lowpass(lambda _: 0.3)),
    ("lowpass", {"cutoff_hz": 3.0}, 1, lowpass(lambda h: 6 * np.pi * h / (1 + 6 * np.pi * h))),
    ("wave", {"b": 5.0}, 0, lambda m, u, *_: (0.1 * (5 * u - np.sqrt(10) * u) + np.sqrt(10) * u - u, m)),
]
for each in METHODS:
    CASES += [
        ("integrator", {"method": each}, 2, integral(each)),
        ("pi", {"kp": 0.4, "ki": 3.0, "method": each}, 3, pid(0.4, 3.0, each)),
        ("pid", {"kp": 0.4, "ki": 3.0, "kd": 0.01, "method": each}, 3, pid(0.4, 3.0, each, 0.01)),
        ("pid", {"kp": 0.4, "ki": 3.0, "kd": 0.1, "tau": 0.02, "method": each}, 3, pid(0.4, 3.0, each, 0.1, 0.02)),
        ("avatar", {"b": 5.0, "integration": each}, 2, end_of_wave(each, lambda v, x, out: out + 2 * x + 0.1 * v)),
        ("local_model", {"b": 5.0, "K": 40.0, "B": 0.5, "integration": each}, 2, end_of_wave(each, lambda *each: each[2])),
    ]
SHOWN = {"avatar": "s.out + 2*s.x + 0.1*s.v", "local_model": "s.out", "wave": "0.1*s.force + s.out"}
INPUTS = {
    "avatar": {"s.in": "m.x + 0.1*m.v", "s.f": "40*s.x_spring + 0.5*s.v"},
    "local_model": {"s.in": "m.x + 0.1*m.v"},
    "wave": {"s.in": "m.x + 0.1*m.v", "s.v": "m.x + 0.1*m.v"},
}


def loop_with(kind, keys, **tables):
    """A mass on a spring whose slow block reads it and pushes it."""
    return load(
        {
            "rates": {"tick_hz": 1 / T},
            "numbers": {"n": 20, "K": K},
            "block": {
                "m": {"type": "mass", "mass": 0.3, "damping": 0.5, "stiffness": 10.0},
                "s": {"type": kind, "every": "n", **keys},
            },
            "wire": INPUTS.get(kind, {"s.u": "m.x + 0.1*m.v"}) | {"m.f": f"push - K*({SHOWN.get(kind, 's.y')})"},
            "ports": {"hand": {"force": "push", "displacement": "m.x"}},
            **tables,
        }
    )


def marched(run, state, push):
    """Positions in every tick of a march through the pattern, and the state after it: v, x, the block's output and memory."""
    v, x, shown, *memory = state
    before, gap = (ticks * T for ticks in PATTERN[-2:])
    frame, k, rows = 0, 0, []
    for f in push:
        if k == 0:
            shown, memory = run(memory, x + 0.1 * v, gap, before)
        rows.append(x)
        v, x = STEP[:2, :2] @ (v, x) + STEP[:2, 2] * (f - K * shown)
        k += 1
        if k == PATTERN[frame % len(PATTERN)]:
            before, gap, frame, k = gap, k * T, frame + 1, 0
    return np.array(rows), [v, x, shown, *memory]


def large(matrix):
    """Eigenvalues that are not next to 0, sorted by their absolute values."""
    found = np.linalg.eigvals(matrix)
    return np.sort_complex(np.round(found[np.abs(found) > 1e-5], 12))


@pytest.mark.sample(16)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "keys", "size", "run"), CASES, ids=[f"{kind}-{[*keys.values()][-1:]}" for kind, keys, *_ in CASES]
)
def test_a_type_with_a_rule_moves_and_decays_as_the_table_says(kind, keys, size, run):
    push = np.random.default_rng(1).normal(size=400)
    expected, _ = marched(run, [0.0] * (3 + size), push)
    needed("simulation")
    from wavesweep.simulation import from_spec as simulation

    found = simulation.simulated(loop_with(kind, keys, simulate={"frames": PATTERN}), push).signals["x"]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    spec, still = loop_with(kind, keys), np.zeros(sum(PATTERN))
    family = frames_of_drawing(spec.drawing, spec.values, tuple(sorted({*PATTERN})), "numbers.K")
    of_length = dict(zip((each.ticks for each in family.symbols), family.at(K), strict=True))
    pattern = reduce(lambda whole, ticks: of_length[ticks] @ whole, PATTERN, np.eye(len(of_length[PATTERN[0]])))
    whole = np.array([marched(run, unit, still)[1] for unit in np.eye(3 + size)]).T
    np.testing.assert_allclose(large(pattern), large(whole), atol=1e-9)


RULED = {name for name, kind in TYPES.items() if kind.steps}


def test_every_type_has_a_march_or_runs_in_every_tick_or_is_refused():
    assert {kind for kind, *_ in CASES} == RULED
    assert {name for name, kind in TYPES.items() if not (kind.steps or kind.plant)} == {
        "butterworth",
        "channel",
        "impulse",
        "lead",
        "notch",
    }


VARYING = {"for_all": {"n": {"values": [16, 33], "varying": True}}, "sweep": {"along": "K", "K": {"start": 0, "stop": 5}}}
OTHERS = {
    "butterworth": {"order": 2, "cutoff_hz": 3.0},
    "lead": {"zero_hz": 2.0, "pole_hz": 8.0},
    "notch": {"frequency_hz": 3.0, "q": 2.0},
    "second": {"cutoff_hz": 3.0},
}


@pytest.fixture
def second(monkeypatch):
    """A type that somebody adds: a low-pass of second order, of which nobody said what it does where steps vary."""
    (table,) = gc.get_referents(TYPES)
    known = TYPES["lowpass"]
    monkeypatch.setitem(table, "second", BlockType({"cutoff_hz": known.keys["cutoff_hz"]}, known.ports, "a low-pass"))
    monkeypatch.setattr(blocks, "second", lambda *own, cutoff_hz: blocks.butterworth(*own, 2, cutoff_hz), raising=False)


@pytest.mark.slow
@pytest.mark.usefixtures("second")
@pytest.mark.parametrize("kind", OTHERS)
def test_a_type_without_a_rule_is_refused_by_name(kind):
    refused = rf"have a rule for steps that vary .*, found s \({kind}\)"
    with pytest.raises(UsageError, match=refused):
        wavesweep.stability_region(loop_with(kind, OTHERS[kind], **VARYING))
    needed("simulation")
    from wavesweep.simulation import from_spec as simulation

    with pytest.raises(UsageError, match=refused):
        simulation.simulated(loop_with(kind, OTHERS[kind], simulate={"frames": PATTERN}), [1.0])
