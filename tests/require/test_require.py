"""[sweep] require: intervals in which every mode is within a radius per T_s or per tick, or settles in a time."""

from fractions import Fraction

import numpy as np
import pytest
from meaning.required import misjudged
from support.specs import KINDS

import wavesweep
from wavesweep.engine._monodromy.radius import errors_within, within
from wavesweep.engine._search.frames_along import FramesAlong
from wavesweep.engine._search.question import Question
from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.specs import intervals_of_specs
from wavesweep.require.disc_panels import HALF_RIM, SAFE

FRAME, SETTLED = 0.02, 0.02  # s of the default rates; what is left of a mode that has settled
SPEC = {
    "controller": {"kind": "pmw"},
    "environment": {"integration": "explicit"},
    "sweep": {"require": {"radius": 0.97}, "B_VE": [0.0, 1.0, 5.0], "K_VE": {"start": 0, "stop": 2000}},
}


def with_require(**numbers):
    return {**SPEC, "sweep": {**SPEC["sweep"], "require": numbers}}


@pytest.mark.parametrize("kind", KINDS)
def test_a_time_is_the_radius_of_its_frame(kind):
    loop = wavesweep.compile({"controller": {"kind": kind}})
    time = FRAME * np.log(SETTLED) / np.log(0.97)
    one, other = (loop.stable_intervals(require=require, B_VE=[1.0, 5.0]) for require in ({"radius": 0.97}, {"settling": time}))
    assert one.certified.all()
    assert np.allclose(one[["low", "high"]], other[["low", "high"]], rtol=1e-9, equal_nan=True)
    both = loop.stable_intervals(require={"radius": 0.99, "settling": time}, B_VE=[1.0, 5.0])
    assert both.equals(other)
    constant = loop.stable_intervals(require={"time_constant": -FRAME / np.log(0.97)}, B_VE=[1.0, 5.0])
    assert np.allclose(one[["low", "high"]], constant[["low", "high"]], rtol=1e-9, equal_nan=True)


IMAGES = {  # an oscillator of a program, whose images an arm of 13 Hz shows more, from K = -0.3806 on
    "rates": {"tick_hz": 1000},
    "numbers": {"K": -0.3},
    "block": {
        "arm": {"type": "mass", "mass": 1.0, "damping": 3.0, "stiffness": (2 * np.pi * 13) ** 2},
        "program": {"type": "biquad", "b0": 0.0, "b1": 1.0, "b2": 0.0, "a1": "K", "a2": 0.9, "every": 50},
    },
    "wire": {"program.u": "10*arm.x", "arm.f": "20*program.y"},
}


@pytest.mark.slow
def test_lines_of_a_panel_and_a_disc_hold_those_of_every_value_in_both():
    """Told by the middle and a circle about it, held against `poles` at values of the panel."""
    frames = FramesAlong.of(Question("numbers.K", (-1.0, 1.0)), own_loop(load(IMAGES)), 1)

    def lines_at(K):
        rows = wavesweep.compile(IMAGES | {"numbers": {"K": K}}).poles()
        return rows.z_re + 1j * rows.z_im - 1, 2 * np.pi * rows.shown_hz * 0.05

    r = np.random.default_rng(3)
    tight = 0
    changed = 0
    for _ in range(12):
        size = 10 ** r.uniform(-3, -1)
        middle = -0.3806 + size * r.uniform(-2, 2)
        here, before = (array.to_numpy() for array in lines_at(middle))
        there, shown = (array.to_numpy() for array in lines_at(middle + size * r.choice([-1, 1])))
        delta = here[here.imag > 0]
        nearest = np.abs(there[:, None] - delta).argmin(0)
        radius = np.abs(there[nearest] - delta) + 1e-9
        p = np.append(middle, middle + 2 * size * HALF_RIM)
        (told,) = frames.turns(np.zeros(1, int), p[None], delta[None], radius[None], SAFE)
        spread = -np.log1p(-radius / np.abs(1 + delta)) + 1e-6
        assert (shown[nearest] > told[:, 1] - spread).all()
        assert (shown[nearest] < told[:, 2] + spread).all()
        changed += int((np.abs(shown[nearest] - before[here.imag > 0]) > 3).sum())
        tight += int((told[:, 2] - told[:, 1] < 1).sum())
    assert tight >= 12 > changed > 2


def test_a_mode_has_its_own_line_also_where_nothing_runs_in_most_ticks():
    """The arm rings at 13 Hz with 0.0145, and from sample to sample at 7 Hz, which would be 0.027."""
    loop = wavesweep.compile(IMAGES)
    (row,) = loop.stable_intervals("K", (-0.5, 0.5), require={"damping_ratio": 0.02}).itertuples()
    assert (row.certified, row.intervals) == (True, 0)
    assert loop.poles().shown_damping_ratio.min() < 0.02


def test_a_radius_is_per_step_of_the_slow_loop_also_if_rates_do_not_divide():
    tables = {"controller": {"kind": "dc-slow"}, "rates": {"slow_hz": 60}}
    assert misjudged(tables, "K_VE", (0.0, 2000.0), {"radius": 0.9}) == []


@pytest.mark.parametrize("every", [7, 50])
def test_what_is_required_does_not_change_with_a_block_that_only_looks(every):
    logger = {"log": {"type": "hold", "every": every}}
    tables = JOINTS | {"block": {name: JOINTS["block"][name] for name in ("arm", "x", "v")}}
    tables["wire"] = {name: JOINTS["wire"][name] for name in ("x.u", "v.u", "arm.f")}
    tables["numbers"] = {name: value for name, value in JOINTS["numbers"].items() if name != "slow"}
    seen = tables | {"block": tables["block"] | logger, "wire": tables["wire"] | {"log.u": "arm.x"}}
    seen["wire"] |= {"arm.f": tables["wire"]["arm.f"] + " - 1e-9*log.y"}
    one, other = (
        wavesweep.compile(each).stable_intervals("kp", (0.0, 400.0), require={"radius": 0.99}) for each in (tables, seen)
    )
    assert one.certified.all()
    assert other.certified.all()
    np.testing.assert_allclose(one[["low", "high"]], other[["low", "high"]], rtol=1e-6)


JOINTS = {
    "rates": {"tick_hz": 1000},
    "numbers": {"kp": 60.0, "kd": 2.0, "m": 0.1, "d": 2.0, "slow": 3.0},
    "block": {
        "arm": {"type": "mass", "mass": "m", "damping": "d"},
        "x": {"type": "hold", "every": 5},
        "v": {"type": "difference", "every": 5},
        "other": {"type": "mass", "mass": 0.2, "damping": 4.0},
        "shown": {"type": "lowpass", "cutoff_hz": "slow", "every": 2},
    },
    "wire": {"x.u": "arm.x", "v.u": "arm.x", "arm.f": "-kp*x.y - kd*v.y", "other.f": "-kp*other.x + x.y", "shown.u": "arm.x"},
}


RATIO = 0.4
TURN = np.exp(-np.pi * RATIO / np.sqrt(1 - RATIO**2))  # |z| of a negative eigenvalue of that damping ratio


@pytest.mark.slow
def test_the_damping_ratio_of_an_integrator_and_of_an_oscillator_has_closed_forms():
    """z = 1 - K T, and the mass `m x'' + d x' + k x`, whose damping ratio is `d/(2 sqrt(k m))` at any rate above its own."""
    integrator = {"type": "tf", "num": [1], "den": [1, 0]}
    tables = {"rates": {"tick_hz": 50}, "numbers": {"K": 1.0}, "block": {"p": integrator}, "wire": {"p.u": "-K*p.y"}}
    (row,) = wavesweep.compile(tables).stable_intervals("K", (-5.0, 200.0), require={"damping_ratio": RATIO}).itertuples()
    assert (row.certified, row.low) == (True, pytest.approx(0, abs=1e-9))
    assert row.high == pytest.approx(50 * (1 + TURN), rel=1e-9)
    assert row.high_omega == pytest.approx(50 * np.pi)
    (row,) = wavesweep.compile(tables).stable_intervals("K", (0.0, 200.0), require={"damping_ratio": 0.9}).itertuples()
    assert (row.certified, row.high) == (True, pytest.approx(50 * 1.1, rel=1e-9))  # over within a frame up to z = -0.1
    (row,) = wavesweep.compile(tables).stable_intervals("K", (0.0, 1e12), require={"damping_ratio": RATIO}).itertuples()
    assert (row.certified, row.low) == (True, 0)
    assert row.high == pytest.approx(50 * (1 + TURN), rel=1e-9)
    body = {"m": {"type": "mass", "mass": "m", "damping": 3.0, "stiffness": "k"}, "seen": {"type": "hold"}}
    tables = {
        "rates": {"tick_hz": 200},
        "numbers": {"m": 1.0, "k": 9.0},
        "block": body,
        "wire": {"m.f": "0*seen.y", "seen.u": "m.x"},
    }
    loop = wavesweep.compile(tables)
    for along, span, end in (("k", (1.0, 100.0), 9 / 4 / RATIO**2), ("m", (0.1, 10.0), 9 / 4 / RATIO**2 / 9)):
        (row,) = loop.stable_intervals(along, span, require={"damping_ratio": RATIO}).itertuples()
        assert (row.certified, row.low) == (True, span[0])
        assert row.high == pytest.approx(end, rel=1e-8)


def steps(**numbers):
    """Multiple time steps (r-RESPA): a fast spring kicks in every step h, a slow one in every N-th, as integrators draw it."""
    numbers = {"h": 0.1, "N": 8, "k1": 1.0, "k2": 0.1} | numbers
    kicks = {"type": "integrator", "method": "implicit"}
    block = {"x": {"type": "integrator", "method": "explicit"}, "v": kicks, "w": kicks | {"every": "N"}}
    wire = {"x.u": "v.y + w.y", "v.u": "-k1*x.y", "w.u": "-k2*x.y"}
    return {"rates": {"tick_hz": "1/h"}, "numbers": numbers, "block": block, "wire": wire}


@pytest.mark.parametrize(("N", "first"), [(2, True), (40, False)])
def test_the_slow_spring_of_multiple_time_steps_has_its_closed_form(N, first):
    """2 W cot(N t/2)/(N h), an eigenvalue -1, and beyond N t = pi it is -2 W tan(N t/2)/(N h), an eigenvalue 1."""
    h = 0.1
    t = np.arccos(1 - h**2 / 2)
    end = 2 * np.sin(t) / h / (N * h) * (1 / np.tan(N * t / 2) if first else -np.tan(N * t / 2))
    (row,) = wavesweep.compile(steps(N=N)).stable_intervals("k2", (0.0, 120.0), require={"bounded": True}).itertuples()
    assert (row.certified, row.low) == (True, 0)
    assert row.high == pytest.approx(end, rel=1e-9)
    assert row.high_omega == pytest.approx(np.pi / (N * h) if first else 0, abs=1e-9)


@pytest.mark.slow
def test_a_loop_that_conserves_is_bounded_where_its_trace_is_below_2():
    r, along, span = np.random.default_rng(0), "k1", (0.1, 30.0)
    numbers = {"h": r.uniform(0.05, 0.5), "N": int(r.integers(1, 12)), "k1": r.uniform(0.2, 3), "k2": r.uniform(0.01, 1)}
    table = wavesweep.compile(steps(**numbers)).stable_intervals(along, span, require={"bounded": True})
    rows = list(table.itertuples())
    ends = [end for row in rows for end, omega in ((row.low, row.low_omega), (row.high, row.high_omega)) if omega >= 0]
    assert table.certified.all()
    for value in [*r.uniform(*span, 10), *(end + side * 1e-7 * (abs(end) + 0.01) for end in ends for side in (-1, 1))]:
        at = numbers | {along: value}
        h, frame = at["h"], np.eye(2)
        for step in range(at["N"]):
            kick = h * at["k1"] + (at["N"] * h * at["k2"] if step == 0 else 0)
            frame = np.array([[1, h], [0, 1]]) @ np.array([[1, 0], [-kick, 1]]) @ frame
        if span[0] < value < span[1]:
            assert any(row.low < value < row.high for row in rows) == (abs(np.trace(frame)) < 2)


def test_a_damping_ratio_and_a_radius_are_what_both_have_in_common():
    loop = wavesweep.compile(load(JOINTS))
    both, ratio, radius = (
        loop.stable_intervals("kp", (0.0, 400.0), require=require)
        for require in ({"damping_ratio": 0.5, "radius": 0.995}, {"damping_ratio": 0.5}, {"radius": 0.995})
    )
    assert both.certified.all()
    assert (both.low[0], both.high[0]) == (max(ratio.low[0], radius.low[0]), min(ratio.high[0], radius.high[0]))


CONSERVES = (
    "sweep.require.bounded: expected a loop that conserves, whose eigenvalues are z and 1/z in pairs, found one that takes or "
    "gives energy; leave bounded out, and stable intervals are found"
)


@pytest.mark.parametrize(
    ("require", "expected"),
    [
        ({"bounded": True, "radius": 0.9}, "sweep.require.bounded: expected true alone, found other requirements as well"),
        ({"bounded": True}, CONSERVES),
        ({"damping_ratio": 1}, "sweep.require.damping_ratio: expected a number <= 0.999, found 1"),
        ({"settling": 1e-4}, "sweep.require.settling: expected at least 0.00567 s where a frame takes 0.02 s, found 0.0001"),
    ],
)
def test_what_cannot_be_required_is_one_clear_line(require, expected):
    with pytest.raises(UsageError) as error:
        wavesweep.zwidth(with_require(**require))
    assert str(error.value) == expected
    with pytest.raises(UsageError) as error:
        wavesweep.compile(SPEC).stable_intervals(require=require)
    assert str(error.value) == expected


@pytest.mark.asks("passive", "sensitivity")
def test_what_is_about_stability_alone_refuses_it():
    gain = {"from": "f_h", "to": "v", "at_most": 1.0, "band_hz": [1.0, 5.0]}
    for refused in (
        lambda: wavesweep.zwidth(SPEC, for_hands="passive"),
        lambda: wavesweep.why(SPEC),
        lambda: intervals_of_specs([load(SPEC)]),
        lambda: wavesweep.compile(SPEC).stable_intervals("rates.fast_hz", (500.0, 2000.0), require={"settling": 0.5}),
        lambda: wavesweep.compile(SPEC).stable_intervals("rates.fast_hz", (500.0, 2000.0), require={"gain": gain}),
    ):
        with pytest.raises(UsageError, match=r"stability alone|changes the time of a frame"):
            refused()


def test_bounds_on_errors_hold_in_rational_arithmetic():
    r = np.random.default_rng(5)
    E = r.normal(size=(200, 3, 3)) * 10.0 ** r.uniform(-9, 1, (200, 3, 3)) - np.eye(3) * r.integers(0, 2, (200, 1, 1))
    radius = 10.0 ** r.uniform(-6, -1e-7, 200)
    found, bound = within(E, radius), errors_within(E, 0 * E, radius)
    for at in np.ndindex(E.shape):
        rho, own = Fraction(radius[at[0]]), at[1] == at[2]
        exact = (Fraction(E[at]) + (1 - rho if own else 0)) / rho
        assert abs(Fraction(found[at]) - exact) <= Fraction(bound[at])
    assert np.array_equal(within(-np.eye(2)[None], radius[:1]), -np.eye(2)[None])  # set anew in every frame


SAMPLED = {  # a drive whose velocity is a difference of means of readings: its loop has a real eigenvalue at -0.124
    "rates": {"tick_hz": 1000},
    "numbers": {"KP": 160.18, "KV": 243.45, "M": 95.1089, "Fv": 203.5034, "g": 35.15065188248547},
    "block": {
        "axis": {"type": "mass", "mass": "M", "damping": "Fv"},
        "two": {"type": "mean", "n": 2},
        "dq": {"type": "difference"},
    },
    "wire": {"two.u": "axis.x", "dq.u": "two.y", "axis.f": "-g*KV*(KP*axis.x + dq.y)"},
    "sweep": {"along": "KP", "KP": {"start": 0, "stop": 5000}},
}


def sampled_modes(KP, g=35.15065188248547, M=95.1089, Fv=203.5034, KV=243.45, T=1e-3):
    """Eigenvalues of the drive, run by hand: position, velocity, the reading before, and the mean before."""
    decay = np.exp(-Fv / M * T)
    moved, turned = (1 - decay) * M / Fv, (T - (1 - decay) * M / Fv) / Fv
    u = -g * KV * np.array([KP + 1 / (2 * T), 0, 1 / (2 * T), -1 / T])
    rows = [np.array([1, moved, 0, 0]) + turned * u, np.array([0, decay, 0, 0]) + (1 - decay) / Fv * u]
    return np.linalg.eigvals([*rows, [1, 0, 0, 0], [0.5, 0, 0.5, 0]])


@pytest.mark.parametrize("which", [{"modes": "oscillating"}, {"slower_than": 0.001}])
def test_modes_that_do_not_count_need_no_damping_ratio(which):
    """The end is where the pair of the drive has the ratio, by its eigenvalues run by hand."""
    table = wavesweep.compile(SAMPLED).stable_intervals(require={"damping_ratio": 0.7, **which})
    (row,) = table.itertuples()
    assert row.certified
    assert row.low == 0
    assert row.high == pytest.approx(52.699, abs=1e-3)
    for KP, kept in ((row.high * (1 - 1e-7), True), (row.high * (1 + 1e-7), False)):
        s = np.log(np.array([z for z in sampled_modes(KP).astype(complex) if abs(z.imag) > 1e-9]))
        assert ((-s.real / np.abs(s)).min(initial=1.0) > 0.7) == kept


def test_a_pair_that_becomes_real_needs_no_ratio_any_more_and_is_certified_up_to_there():
    """z^2 + a z + 0.3 = 0: a pair of size 0.55 turns to z = -0.55 as a grows, and is two real ones from a = 2 sqrt(0.3) on."""
    second = {"type": "ss", "discrete": True, "A": [[0, 1], [-0.3, "-a"]], "B": [[0], [1]], "C": [[1, 0]]}
    tables = {"rates": {"tick_hz": 1}, "numbers": {"a": 0.5}, "block": {"p": second}, "wire": {"p.u": "0"}}
    found = wavesweep.compile(tables).stable_intervals(
        "a", (-1.2, 1.29), require={"damping_ratio": 0.3, "modes": "oscillating"}
    )
    size, spiral = np.sqrt(0.3), 0.3 / np.sqrt(1 - 0.09)
    angle = -np.log(size) / spiral  # where the pair is on the spiral
    assert found.certified.all()
    assert found.high.iloc[0] == pytest.approx(-2 * size * np.cos(angle), rel=1e-9)
    assert found.low.iloc[1] == pytest.approx(2 * size, rel=1e-9)
    assert found.high.iloc[1] == 1.29
    all_modes = wavesweep.compile(tables).stable_intervals("a", (-1.2, 1.29), require={"damping_ratio": 0.3})
    assert all_modes.high.max() == pytest.approx(found.high.iloc[0], rel=1e-9)


def test_an_answer_nowhere_names_the_mode_that_is_in_the_way():
    table = intervals(load(SAMPLED | {"sweep": SAMPLED["sweep"] | {"require": {"damping_ratio": 0.7}}}), jobs=1)
    mode = table.facts["in_the_way"]
    real = min(sampled_modes(mode["value"]), key=lambda z: z.real)
    assert (mode["z_re"], mode["z_im"]) == (pytest.approx(real.real, rel=1e-6), 0)
    assert mode["time_constant_s"] == pytest.approx(-1e-3 / np.log(-real.real), rel=1e-6)
    assert mode["hz"] == pytest.approx(500)


DRIFTS = {
    "rates": {"tick_hz": 1000},
    "numbers": {"B": 1.4},
    "block": {"dev": {"type": "mass", "mass": 0.3}, "h": {"type": "hold"}},
    "wire": {"dev.f": "-h.y"},
}


def drifting(spring, gains, **numbers):
    """A mass on a spring, and integrators of its speed with these gains: all but one combination of its positions drifts."""
    names = [f"i{at}" for at in range(len(gains))]
    tables = DRIFTS | {"numbers": DRIFTS["numbers"] | numbers}
    tables["block"] = DRIFTS["block"] | {name: {"type": "integrator"} for name in names}
    integrals = "".join(f" + {gain}*{name}.y" for gain, name in zip(gains, names, strict=True))
    wires = {f"{name}.u": "dev.v" for name in names}
    return tables | {"wire": DRIFTS["wire"] | wires | {"h.u": f"{spring}*dev.x + B*dev.v{integrals}"}}


@pytest.mark.parametrize(
    ("spring", "gains", "span"),
    [
        ("K", (0.5, -0.5), (0.0, 2000.0)),
        ("K", (0.5, -0.3), (0.0, 2000.0)),
        ("K", (0.5, -0.5, 0.2), (0.0, 2000.0)),
        ("4/K", (0.5, -0.5, 0.2), (0.001, 30.0)),
    ],
)
@pytest.mark.parametrize("require", [{"radius": 0.9989}, {"settling": 3.9}])
def test_what_drifts_beside_another_drift_is_no_mode_that_misses_what_is_required(spring, gains, span, require):
    assert misjudged(drifting(spring, gains, K=4.0), "K", span, require) == []


@pytest.mark.slow
@pytest.mark.parametrize(("slow_hz", "ratio"), [(60, 0.1), (1000 / 16, 0.05), (1000 / 17, 0.1)])
def test_a_damping_ratio_is_of_the_mode_s_own_line_and_not_of_its_alias(slow_hz, ratio):
    """17 Hz is an alias of 2.7 Hz in the 50 ms in which 60 Hz and 1 kHz are in step; ratios of 16 and 17 are beside it."""
    rates = {"slow_hz": 60} if slow_hz == 60 else {"ratio": round(1000 / slow_hz)}
    tables = {"controller": {"kind": "dc-slow"}, "rates": rates, "operator": {"stiffness": 1000.0}}
    (row,) = wavesweep.compile(tables).stable_intervals("K_VE", (0, 2000), require={"damping_ratio": ratio}).itertuples()
    assert (row.certified, row.low) == (True, 0.0)
    assert 16 < row.high_hz < 18
    assert misjudged(tables, "K_VE", (0.0, 2000.0), {"damping_ratio": ratio}) == []
