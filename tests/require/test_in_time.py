"""[sweep] require and wishes of responses in time: overshoot and settling of a step, and white noise."""

import tomllib
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from meaning.reading import machine_of, with_numbers
from meaning.required import misjudged, value_of
from scipy.linalg import expm, solve_discrete_lyapunov

import wavesweep
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.engine.frames import Bounded
from wavesweep.program.spec import load
from wavesweep.require import enclosed, maps, time_intervals
from wavesweep.require.disc_panels import HALF_RIM
from wavesweep.require.gain_bound import MEASURES
from wavesweep.require.wish import WISHES

T = 0.01  # s
ENDS = {"from": "ref", "to": "own"}
INTEGRATOR = {
    "rates": {"tick_hz": 1 / T},
    "numbers": {"K": 10.0},
    "block": {"p": {"type": "tf", "num": [1], "den": [1, 0]}, "c": {"type": "gain"}},
    "wire": {"p.u": "c.y", "c.u": "K*(ref - p.y)"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"own": "p.y"}},
    "sweep": {"along": "K", "K": {"start": 1, "stop": 250}},
}


STIFF = {
    "rates": {"tick_hz": 10},
    "numbers": {"K": 0.3},
    "block": {"x": {"type": "mass", "mass": 1.0, "damping": 13.0, "stiffness": 22.0}, "h": {"type": "delay", "steps": 3}},
    "wire": {"h.u": "x.x", "x.f": "ref - 100*K*h.y"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"own": "x.x"}},
}

LATE = {
    "rates": {"tick_hz": 500},
    "numbers": {"g": 1.0},
    "block": {
        "c": {"type": "pi", "kp": "g", "ki": "g/0.036"},
        "late": {"type": "delay", "seconds": 0.01},
        "p": {"type": "tf", "num": [1], "den": [0.0365, 1]},
    },
    "wire": {"c.u": "ref - p.y", "late.u": "c.y", "p.u": "late.y"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"own": "p.y"}},
}
CUT_LEVELS = {"Ms": 1.5, "disk": 1.0, "gain": 2.5, "phase_deg": 62.0}


def several_rates(every, phase):
    blocks = INTEGRATOR["block"] | {"c": {"type": "gain", "every": every, "phase": phase}}
    return INTEGRATOR | {"block": blocks}


@pytest.mark.parametrize(
    ("measure", "level", "low", "high"),
    [
        ("overshoot", {"at_most": 0.3}, 1.0, 1.3 / T),  # (1 - s)^k beyond the end, s = K T
        ("step_settling", {"at_most": 0.1}, (1 - 0.02**0.1) / T, (1 + 0.02**0.1) / T),  # also from 0 on
        ("step_settling", {"at_most": 0.1, "within": 0.3}, (1 - 0.3**0.1) / T, (1 + 0.3**0.1) / T),
        pytest.param("rms", {"at_most": 0.5}, 1.0, 0.4 / T, marks=pytest.mark.slow),  # the root of s/(2 - s)
    ],
)
def test_responses_of_an_integrator_have_closed_forms(measure, level, low, high):
    start = 0 if measure == "step_settling" else 1
    loop = wavesweep.compile(INTEGRATOR | {"sweep": {"along": "K", "K": {"start": start, "stop": 250}}})
    (row,) = loop.stable_intervals(require={measure: {**ENDS, **level}}).itertuples()
    assert (row.certified, row.high_set_by, row.high_omega) == (True, measure, 0.0)
    assert (row.low, row.high) == (pytest.approx(low, rel=1e-8), pytest.approx(high, rel=1e-8))


@pytest.mark.slow
def test_a_step_that_ends_at_zero_settles_within_a_value_with_its_unit():
    """The error (1 - K T)^k of a step, and y/K of a load of 1 by ten ticks after it."""
    tables = INTEGRATOR | {
        "wire": {"p.u": "c.y + load", "c.u": "K*(ref - p.y)"},
        "ports": {
            "inputs": {"ref": "ref", "load": "load"},
            "outputs": {"off": {"signal": "ref - p.y", "unit": "m"}, "own": {"signal": "p.y", "unit": "m"}},
        },
    }
    loop = wavesweep.compile(tables | {"sweep": {"along": "K", "K": {"start": 1, "stop": 190}}})
    settled = {"at_most": 0.1, "within": "20 mm"}
    (row,) = loop.stable_intervals(require={"step_settling": {"from": "ref", "to": "off", **settled}}).itertuples()
    assert row.certified
    assert (row.low, row.high) == (pytest.approx((1 - 0.02**0.1) / T, rel=1e-8), pytest.approx((1 + 0.02**0.1) / T, rel=1e-8))
    settled = {"at_most": 0.05, "within": "0.5 cm"}
    (row,) = loop.stable_intervals(require={"step_settling": {"from": "load", "to": "own", **settled}}).itertuples()
    assert row.certified
    assert abs(1 - row.low * T) ** 5 / row.low == pytest.approx(0.005, rel=1e-7)


@pytest.mark.parametrize(("to", "within", "said"), [("own", "20 mm", "no output of"), ("place", "3 kg", "> 0 in m")])
def test_a_distance_in_another_unit_than_that_of_the_output_is_refused(to, within, said):
    outputs = {"own": "p.y", "place": {"signal": "p.y", "unit": "m"}}
    required = {"step_settling": {"from": "ref", "to": to, "at_most": 0.1, "within": within}}
    with pytest.raises(SpecError, match=said):
        load(
            INTEGRATOR
            | {"ports": {"inputs": {"ref": "ref"}, "outputs": outputs}, "sweep": {**INTEGRATOR["sweep"], "require": required}}
        )


LAG = {
    "rates": {"tick_hz": 1 / T},
    "numbers": {"K": 0.3},
    "block": {"x": {"type": "ss", "discrete": True, "A": [[0.5]], "B": [[1]], "C": [[1]]}},
    "wire": {"x.u": "ref - K*x.y"},
    "ports": {"inputs": {"ref": "ref"}, "outputs": {"own": "x.y"}},
}


@pytest.mark.parametrize(
    ("levels", "low", "high"),
    [
        pytest.param({"step_settling": 6 * T}, -(0.02 ** (1 / 6)), 0.02 ** (1 / 6), marks=pytest.mark.slow),
        ({"overshoot": 0.2, "rms": 1.3}, -((1 - 1 / 1.69) ** 0.5), 0.2),
    ],
)
def test_nothing_is_open_where_modes_are_slow_or_where_another_requirement_refutes(levels, low, high):
    """A mode of 0.5 - K overshoots by as much as it is below 0, which is not known next to 1."""
    loop = wavesweep.compile(LAG)
    (row,) = loop.stable_intervals(
        "K", (-1, 2), require={name: {**ENDS, "at_most": level} for name, level in levels.items()}
    ).itertuples()
    assert row.certified
    assert (row.low, row.high) == (pytest.approx(0.5 + low, rel=1e-8), pytest.approx(0.5 + high, rel=1e-8))


def test_noise_in_a_stiff_mass_is_refuted_up_to_the_end_of_stability():
    """`x'' + 13 x' + (22 + 100 K z^-3) x = w`, with no spring at K = -0.22."""
    require = {"rms": {**ENDS, "at_most": 0.0138}}
    (row,) = wavesweep.compile(STIFF).stable_intervals("K", (-1, 0), require=require).itertuples()
    assert row.certified
    assert misjudged(STIFF, "K", (-1.0, 0.0), require) == []


@pytest.mark.parametrize(
    ("measure", "level"),
    [("rms", 0.7), *(pytest.param(*each, marks=pytest.mark.slow) for each in (("overshoot", 0.2), ("step_settling", 0.23)))],
)
def test_ends_of_several_rates_are_those_of_marches(measure, level):
    require = {measure: {**ENDS, "at_most": level}}
    assert misjudged(several_rates(3, 1), "K", (1.0, 250.0), require) == []


@pytest.mark.slow
@pytest.mark.parametrize(("measure", "level"), [("overshoot", 0.3), ("step_settling", 10.0), ("rms", 1.0)])
def test_ends_of_frames_of_hundreds_of_ticks_are_those_of_marches(measure, level):
    require = {measure: {**ENDS, "at_most": level}}
    assert misjudged(several_rates(300, 17), "K", (0.2, 0.66), require) == []


@pytest.mark.slow
def test_a_settling_that_jumps_where_a_sample_enters_its_band_is_certified():
    """Of a motor with a load on a spring; against marches on both sides of its ends."""
    tables = tomllib.loads((Path(__file__).parents[2] / "sweeps/templates/two-mass.toml").read_text("utf-8"))
    del tables["sweep"]
    asked = {"step_settling": {"from": "ref", "to": "motor_speed", "at_most": 0.2}}
    (row,) = wavesweep.compile(tables).stable_intervals("kp", (0, 2), require=asked).itertuples()
    assert row.certified

    def settled(kp):
        step = {"from": "ref", "input": "step", "at_s": 0.0, "duration_s": 0.4}
        changed = tables | {"numbers": tables["numbers"] | {"kp": kp}, "simulate": step}
        off = np.abs(wavesweep.compile(changed).simulate()["motor_speed"] - 1) > 0.02  # it integrates
        return (np.flatnonzero(off)[-1] + 1) / tables["rates"]["tick_hz"]

    for end, outwards in ((row.low, -1), (row.high, 1)):
        assert settled(end * (1 - 1e-5 * outwards)) <= 0.2
        assert settled(end * (1 + 1e-5 * outwards)) > 0.2


@pytest.mark.slow
def test_noise_is_bounded_next_to_both_ends_of_stability():
    """The stiff mass with a slow mode; against a Lyapunov equation of its states with the three delayed places."""
    (row,) = wavesweep.compile(STIFF).stable_intervals("K", (-1, 2), require={"rms": {**ENDS, "at_most": 20.0}}).itertuples()
    assert row.certified
    over = expm(0.1 * np.array([[0, 1, 0], [-22, -13, 1], [0, 0, 0]]))
    for end in (row.low, row.high):
        A = np.zeros((5, 5))
        A[:2, :2] = over[:2, :2]
        A[:2, 4] = -100 * end * over[:2, 2]
        A[2, 0] = A[3, 2] = A[4, 3] = 1.0
        B = np.append(over[:2, 2], np.zeros(3))
        assert np.sqrt(solve_discrete_lyapunov(A, np.outer(B, B))[0, 0]) == pytest.approx(20.0, rel=0.02)


def squares_of(maps):
    """E, G G', O' O and T T' of E, G, O and T of one tick."""
    E, G, O, T = maps
    return E, G @ G.mT, O.mT @ O, T @ T.mT


def of_ratio(ratio, rate):
    """E, G, O and T of a lag of second order with this rate (rad/s), for complex damping ratios."""
    matrices = []
    for each in ratio:
        flow = np.array([[0, 1, 0], [-(rate**2), -2 * rate * each, rate**2], [0, 0, 0]])
        A = expm(T * flow)
        matrices.append((A[:2, :2] - np.eye(2), A[:2, 2:], np.array([[1.0, 0]]), np.zeros((1, 1))))
    return [Bounded(np.array(each)[None], 1e-16 * np.abs(each)[None]) for each in zip(*matrices, strict=True)]


@pytest.mark.parametrize(("radius", "rate", "doublings"), [(0.02, 10.0, 48), (0.02, 0.3, 48), (1e-7, 10.0, 7)])
def test_what_is_known_on_a_panel_holds_for_all_of_it(radius, rate, doublings, monkeypatch):
    """Against sums of the response at damping ratios on the panel, by its two modes; the peak at 0.3 rad/s comes late."""
    monkeypatch.setattr(enclosed, "MOST_DOUBLINGS", doublings)
    panel = of_ratio(0.3 + radius * np.append(0.0, HALF_RIM), rate)
    found = {
        "overshoot": enclosed.step(panel),
        "settling": enclosed.step(panel, settling=True),
        "later": enclosed.step(panel, 0.02, settling=True, after=30),
        "noise": enclosed.mean_square(squares_of(panel), 1),
    }
    times = np.arange(round(150 / rate / T))
    for ratio in 0.3 + radius / 2 * np.linspace(-1, 1, 5):
        (E,), (G,), (O,), _ = (matrix[0] for matrix, _ in of_ratio([ratio], rate))
        modes, vectors = np.linalg.eig(E)
        shares = (O @ vectors)[0] * np.linalg.solve(vectors, G + 0j)[:, 0]
        impulse = ((1 + modes) ** times[:, None] @ shares).real
        response = np.append(0.0, np.cumsum(impulse))
        true = {
            "overshoot": response.max() - 1,
            "settling": np.flatnonzero(np.abs(response - 1) > 0.02)[-1] + 1,
            "later": np.abs(response - 1)[31:].max(),
            "noise": (impulse**2).sum(),
        }
        for name, value in true.items():
            assert found[name].low[0] <= value * (1 + 1e-9)
            assert value <= found[name].high[0] * (1 + 1e-9)
    if doublings == 48:
        assert found["noise"].high[0] - found["noise"].low[0] < 10 * radius * true["noise"]


def wished(tables, K, *, ranked=False, **wishes):
    from wavesweep.designs.family import scenarios_of
    from wavesweep.designs.wishes import evaluate

    sweep = {"vary": {"K": {"start": 1, "stop": 250}}, "wish": wishes}
    spec = load({name: value for name, value in tables.items() if name != "sweep"} | {"design": sweep})
    return evaluate(spec, spec.design.wishes, scenarios_of(spec), {"numbers.K": np.array(K)}, 1.0, ranked=ranked)


@pytest.mark.asks("designs")
def test_wishes_of_one_response_multiply_its_frame_once(monkeypatch):
    made = []
    whole = time_intervals.over_frame
    monkeypatch.setattr(time_intervals, "over_frame", lambda *about: made.append(about) or whole(*about))
    wished(INTEGRATOR, [21.0, 43.0], overshoot={"at_most": 1.0, **ENDS}, step_settling={"at_most": 1.0, **ENDS})
    assert len(made) == 1


@pytest.mark.asks("designs")
@pytest.mark.parametrize("measure", ["overshoot", "step_settling"])
def test_what_a_search_ranks_by_is_the_response_that_is_proved(measure, monkeypatch):
    """A step's error falls to 1 - K T of itself in a tick: by itself, or to and fro. The last is unstable."""
    gains = [21.0, 44.0, 152.0, 195.0, 210.0]
    wish = {measure: {"at_most": 1.0, **ENDS}}
    expected = [0.0, 0.0, 0.52, 0.95] if measure == "overshoot" else [0.17, 0.07, 0.06, 0.77]
    proved = wished(INTEGRATOR, gains, **wish)
    monkeypatch.setattr(enclosed, "_over_blocks", None)  # nothing is proved
    for found in (proved, wished(INTEGRATOR, gains, ranked=True, **wish)):
        assert found[measure].value == pytest.approx([*expected, np.nan], rel=1e-8, abs=1e-9, nan_ok=True)
        assert found[measure].certified.all()


@pytest.mark.asks("designs")
@pytest.mark.parametrize(("every", "phase"), [(1, 0), (3, 1)])
def test_wishes_of_responses_in_time_are_those_of_marches(every, phase):
    tables = several_rates(every, phase)
    found = wished(tables, [20.0, 45.0, 60.0, 300.0], **{name: {"at_most": 1.0, **ENDS} for name in MEASURES})
    for name in MEASURES:
        for at, K in enumerate((20.0, 45.0, 60.0)):
            expected = value_of(machine_of(with_numbers(tables, {"K": K})), name, ENDS) * (T if name == "step_settling" else 1)
            assert found[name].value[at] == pytest.approx(expected, rel=1e-8, abs=1e-9)
            assert found[name].certified[at]
        assert np.isnan(found[name].value[3])  # unstable
    assert np.isnan(wished(tables, [300.0], overshoot={"at_most": 1.0, **ENDS})["overshoot"].value[0])


@pytest.mark.asks("designs")
def test_a_step_is_known_where_a_state_ends_at_rest_but_for_rounding():
    """That of a motor whose torque is 0 when its angle has come to the reference."""
    tick, lag, inertia, damping, kp, ki, kd, tau = 0.001, 0.001, 0.0012, 0.004, 1.0, 2.0, 0.03, 0.002
    tables = {
        "rates": {"tick_hz": 1 / tick},
        "numbers": {"K": kp},
        "block": {
            "amp": {"type": "tf", "num": [1], "den": [lag, 1]},
            "arm": {"type": "inertia", "inertia": inertia, "damping": damping},
            "pid": {"type": "pid", "kp": "K", "ki": ki, "kd": kd, "tau": tau},
        },
        "wire": {"arm.f": "amp.y", "amp.u": "pid.y", "pid.u": "ref - arm.x"},
        "ports": {"inputs": {"ref": "ref"}, "outputs": {"own": "arm.x"}},
    }
    found = wished(tables, [kp], overshoot={"at_most": 1.0, **ENDS})["overshoot"]
    assert found.certified[0]
    assert found.value[0] == pytest.approx(value_of(machine_of(tables), "overshoot", ENDS), rel=1e-8)
    assert [WISHES[name]["unit"] for name in MEASURES] == ["1", "s", ""]


@pytest.mark.parametrize(
    ("require", "said"),
    [
        ({"rms": {"from": "ref", "to": "own"}}, "expected all of rms.from, rms.to, rms.at_most, found none of rms.at_most"),
        ({"overshoot": {**ENDS, "to": "won", "at_most": 1}}, "require.overshoot.to: expected an output of the loop (own)"),
        ({"rms": {**ENDS, "from": "own", "at_most": 1}}, "rms.from: expected an input of the loop (ref)"),
        ({"step_settling": {**ENDS, "at_most": 0}}, "step_settling.at_most: expected a number > 0, found 0"),
    ],
)
def test_what_can_not_be_required_of_a_response_is_said(require, said):
    with pytest.raises(SpecError) as raised:
        wavesweep.load(INTEGRATOR | {"sweep": INTEGRATOR["sweep"] | {"require": require}})
    assert said in str(raised.value)


@pytest.mark.parametrize(
    ("changes", "require", "said"),
    [
        ({"outputs": {"own": "c.y"}}, "overshoot", "expected a step that ends at another value than 0"),
        ({"outputs": {"own": "0.3*ref - 0.3*p.y"}}, "overshoot", "expected a step that ends at another value than 0"),
        ({"outputs": {"own": "p.y"}}, "rms", "expected a frame of at most 1000 ticks"),
    ],
)
def test_what_has_no_value_is_refused(changes, require, said):
    tables = several_rates(3 if require == "overshoot" else 1001, 0)
    loop = wavesweep.compile(tables | {"ports": INTEGRATOR["ports"] | changes})
    with pytest.raises(UsageError, match=said):
        loop.stable_intervals(require={require: {**ENDS, "at_most": 0.1}})


@pytest.mark.parametrize(
    "require",
    [
        {"radius": 0.98},
        {"rms": ENDS | {"at_most": 0.3}},
        pytest.param({"damping_ratio": 0.4}, marks=pytest.mark.slow),
        *(
            pytest.param({name: ENDS | {"at_most": level}}, marks=pytest.mark.slow)
            for name, level in (
                ("overshoot", 0.13),
                ("step_settling", 0.12),
                ("step_settling", 0.5),
                ("gain", 1.2),
                ("peak", 1.2),
            )
        ),
        *(pytest.param({"margins": {"cut": "c.y", name: level}}, marks=pytest.mark.slow) for name, level in CUT_LEVELS.items()),
    ],
)
def test_the_residual_is_that_of_what_sets_the_end(require):
    """Behind a dead time and along a gain from 0, where whatever bounds later samples is not sharp."""
    (row,) = wavesweep.compile(LATE).stable_intervals("g", (0.0, 8.0), require=require).itertuples()
    assert row.certified
    assert row.high < 8
    assert 0 < row.residual < 1e-7


@pytest.mark.slow
def test_no_overshoot_is_certified_down_to_the_slowest_mode():
    """From a gain of 0 on, of an integrator by itself, and behind a lag, whose end is that of a march."""
    require = {"overshoot": {**ENDS, "at_most": 0.05}}
    (row,) = wavesweep.compile(INTEGRATOR).stable_intervals("K", (0, 150), require=require).itertuples()
    assert (row.certified, row.low) == (True, 0)
    assert row.high == pytest.approx(105, rel=1e-8)
    lag = {"type": "tf", "num": [0.41], "den": [1, -1.2, 0.61], "discrete": True}
    blocks = {"p": INTEGRATOR["block"]["p"], "c": lag}
    tables = INTEGRATOR | {"block": blocks}
    (row,) = wavesweep.compile(tables).stable_intervals("K", (0, 150), require=require).itertuples()
    assert (row.certified, row.low) == (True, 0)
    overshoots = [
        value_of(machine_of(with_numbers(tables, {"K": row.high * side})), "overshoot", ENDS) for side in (1 - 1e-6, 1 + 1e-6)
    ]
    assert overshoots[0] <= 0.05 < overshoots[1]


def test_a_product_of_matrices_with_large_errors_holds_its_corners():
    wide = Bounded(np.ones((1, 1)), np.ones((1, 1)))
    assert (wide @ wide).error >= 2 * 2 - 1


def test_bounds_of_the_maps_of_a_frame_hold_and_do_not_grow_from_tick_to_tick():
    """Ticks `A = [3/2, -1; 1, -1/2]` forget, with eigenvalues of 1/2, and the sizes of their entries grow by 2.1 each; their
    states are in even units, and every other one reads no input."""
    ticks, n = 40, 2
    e, b, c, d = (np.array(rows) for rows in ([[0.5, -1.0], [1.0, -1.5]], [[0.7], [0.2]], [[0.7, 0.2]], [[0.9]]))
    tick = (e, b, c, d)
    deaf = e, 0 * b, c, 0 * d
    sizes = [[0 * part for part in tick]] * 2
    port = SimpleNamespace(kind=np.arange(ticks) % 2, maps=[tick, deaf], sizes=sizes)
    found = maps.over_frame(port, np.arange(n), (1,), np.arange(port.kind.size))
    exact = np.vectorize(Fraction)
    e, b, c, d = (exact(part) for part in tick)
    states = [np.hstack([np.eye(n, dtype=int), np.zeros((n, ticks), int)]) + Fraction(0)]
    outputs = []
    for at in range(ticks):
        inputs = (np.arange(n + ticks) == n + at) & (at % 2 == 0)
        outputs.append(c @ states[-1] + d * inputs)
        states.append(states[-1] + e @ states[-1] + b * inputs)
    states = states[-1] - states[0]
    outputs = np.vstack(outputs)
    for (value, error), true in zip(found, (states[:, :n], states[:, n:], outputs[:, :n], outputs[:, n:]), strict=True):
        assert (np.abs(exact(value[0]) - true) <= exact(error[0])).all()
        assert error.max() < 1e-13


@pytest.mark.parametrize(("step", "settled"), [(0, 4), (1, 3)])
def test_ticks_until_a_response_stays_within_its_band_are_counted_from_the_step(step, settled):
    """Frames of two ticks: half of the end at most in the first, 0.7 and 0.9 of it in the second, and the end from then on."""
    ends = Bounded(np.ones((1, 1, 2)), np.zeros((1, 1, 2)))
    T = np.array([[[[0.5, 0.0], [0.25, 0.25]]]])
    about = T[..., step:].sum(-1, keepdims=True), np.array([step]), ends
    found, at_last, later = (
        enclosed._Step(*about, settling=True, band=enclosed.BAND, after=after, unsure=enclosed.UNSURE)
        for after in (None, settled - 2, settled - 1)
    )
    for each in (found, at_last, later):
        each.look(np.array([-0.3, -0.1, 0.0, 0.0]).reshape(1, 1, 4, 1))
    assert found.low.tolist() == found.high.tolist() == [[settled] * len(enclosed.UNSURE)]
    assert at_last.low[0, 0] == at_last.high[0, 0] == pytest.approx(0.1)
    assert later.high.max() == 0
