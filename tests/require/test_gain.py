"""[sweep] require = { gain = ... }: stable intervals in which a gain stays below a level at all frequencies."""

import pathlib

import numpy as np
import pytest
from meaning.reading import machine_of, with_numbers
from meaning.required import lifted_of, misjudged, value_of
from meaning.responses import at_angle
from scipy.linalg import expm
from scipy.optimize import brentq

import wavesweep
from wavesweep.engine._monodromy.periodic import in_a_row
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import Bounded
from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load
from wavesweep.require import factors
from wavesweep.require.at_cut import seen_at_cut
from wavesweep.require.between import needed, typical_between
from wavesweep.require.frame_gain import of_tick, then
from wavesweep.require.gain_bound import CutBound
from wavesweep.require.maps import over_frame

STRING = pathlib.Path(__file__).parents[2] / "sweeps" / "examples" / "vehicle-string.toml"
T = 0.01  # s, the period of the integrator
INTEGRATOR = {
    "rates": {"tick_hz": 1 / T},
    "numbers": {"K": 10.0},
    "block": {"p": {"type": "tf", "num": [1], "den": [1, 0]}},
    "wire": {"p.u": "K*(ref - p.y - dist)"},
    "ports": {"inputs": {"dist": "dist", "ref": "ref"}, "outputs": {"error": "p.y + dist", "own": "p.y"}},
    "sweep": {"along": "K", "K": {"start": -5, "stop": 250}},
}


def bounded(source, signal, level, **more):
    return {"gain": {"from": source, "to": signal, "at_most": level}, **more}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "signal", "level", "end"), [("dist", "error", 1.7, (2 - 2 / 1.7) / T), ("dist", "error", 1e4, (2 - 2e-4) / T)]
)
def test_the_sensitivities_of_an_integrator_have_closed_forms(source, signal, level, end):
    """`(z - 1)/(z - 1 + K T)` and `K T/(z - 1 + K T)`, both largest at z = -1."""
    loop = wavesweep.compile(INTEGRATOR)
    (row,) = loop.stable_intervals(require=bounded(source, signal, level)).itertuples()
    assert (row.certified, row.low, row.low_set_by, row.high_set_by) == (True, 0, "mode", "gain")
    assert (row.high, row.high_omega) == (pytest.approx(end, rel=1e-9), pytest.approx(np.pi / T))
    assert (row.low_hz, row.high_hz) == (0, pytest.approx(np.nan, nan_ok=True))


# Poles and zeros of a loop that is stable with small gains and with large ones.
DEN, NUM = [1, 2.692, 2.788, 1.336, 0.258], [1, 1.247, 0.82, 0.111]


def cut_integrator(every, slow):
    """An integrator under a gain that runs once in `every` ticks; a block that only reads runs once in `slow`."""
    wire = {"p.u": "c.y", "c.u": "K*(ref - p.y)", "look.u": "p.y"}
    blocks = {"c": {"type": "gain", "every": every, "phase": every // 2}, "look": {"type": "delay", "every": slow}}
    return INTEGRATOR | {"block": INTEGRATOR["block"] | blocks, "wire": wire, "ports": {"inputs": {"ref": "ref"}}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("every", "margins", "end", "set_by"),
    [
        (1, {"Ms": 1.7}, 2 - 2 / 1.7, "Ms"),
        (4, {"disk": 0.5, "Ms": 1.25}, 0.4, "Ms"),
        (1, {"gain": 2.0}, 1.0, "gain"),
        (4, {"gain": 1.5}, 4 / 3, "gain"),
        (1, {"phase_deg": 40.0}, 2 * np.sin(np.radians(50)), "phase"),
    ],
)
def test_margins_at_a_cut_are_those_of_its_own_samples(every, margins, end, set_by):
    """Of `L = s/(z - 1)` with s = K T every: at z = -1 it is -s/2, `S` is 2/(2 - s) and `abs(S - 1/2)` (2 + s)/(2 - s)/2; it is
    of size 1 at sin(theta/2) = s/2, with 90 deg - theta/2 left."""
    loop = wavesweep.compile(cut_integrator(every, 1))
    (row,) = loop.stable_intervals(require={"margins": {"cut": "c.y", **margins}}).itertuples()
    assert (row.certified, row.low, row.low_set_by, row.high_set_by) == (True, 0, "mode", f"{set_by} at c.y")
    assert row.high == pytest.approx(end / T / every, rel=1e-8)


RIGID, MODES = (1e6, 12.5), [(1.0, 0.05, 4000.0), (0.023, 0.005, 2200.0)]  # share, damping ratio, Hz
FLEXIBLE = {
    "rates": {"tick_hz": "1/7e-5"},
    "numbers": {"g": 100.0},
    "block": {
        "rigid": {"type": "tf", "num": [RIGID[0]], "den": [1, RIGID[1], 0]},
        "comp": {"type": "tf", "discrete": True, "num": [1, -1.926, 0.927369], "den": [1, -0.294, -0.706]},
        **{
            f"m{at}": {"type": "tf", "num": [f"{a}*(2*pi*{f})**2"], "den": [1, f"4*pi*{f}*{d}", f"(2*pi*{f})**2"]}
            for at, (a, d, f) in enumerate(MODES)
        },
    },
    "wire": {"comp.u": "-g*(m0.y + m1.y)", "m0.u": "rigid.y", "m1.u": "rigid.y", "rigid.u": "comp.y"},
}


def flexible(theta):
    """The loop of FLEXIBLE with g = 1 at angles, by the exponential of its states: place and speed of each part."""
    A, B, C = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    A[0, 1], A[1, 1], B[1] = 1, -RIGID[1], RIGID[0]
    for at, (share, damping, hz) in zip((2, 4), MODES, strict=True):
        w = 2 * np.pi * hz
        A[at, at + 1], A[at + 1, at], A[at + 1, at + 1], A[at + 1, 0], C[at] = 1, -w * w, -2 * damping * w, w * w, share
    over = expm(7e-5 * np.block([[A, B[:, None]], [np.zeros((1, 7))]]))
    z = np.exp(1j * theta)
    states = np.linalg.solve(z[:, None, None] * np.eye(6) - over[:6, :6], over[:6, 6:])[..., 0]
    return states @ C * (z * z - 1.926 * z + 0.927369) / (z * z - 0.294 * z - 0.706)


def test_a_frame_is_seen_in_units_in_which_its_states_are_alike():
    """Those of FLEXIBLE are of sizes from 1e-11 to 1; and what is seen is the sensitivity."""
    spec = load(FLEXIBLE)
    loops, route, _ = seen_at_cut(Loops(spec.drawing, dict(spec.values)), CutBound("comp.y", 2.0, 0.0))
    _, port, _, g = typical_between(loops, "numbers.g", (10, 40), 1, route, "margins")
    E, G, O, T = (part.value for part in over_frame(port, needed(port.maps), g.shape, np.arange(1)))
    assert max(np.abs(part).max() for part in (E, G, O, T)) < 100
    z = np.exp(0.0621j)
    seen = T + O @ np.linalg.solve((z - 1) * np.eye(E.shape[-1]) - E, G)
    assert seen.ravel() == pytest.approx(1 / (1 + g * flexible(np.array([0.0621]))), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("margins", "span", "least", "peak"),
    [
        ({"Ms": 2.0}, (18.231, 18.232), lambda L: abs(1 + L) - 0.5, (0.06, 0.065)),
        ({"Ms": 2.0}, (38, 38.5), lambda L: abs(1 + L) - 0.5, (1.65, 1.7)),
        ({"disk": 0.5}, (19, 20), lambda L: 2 - abs(1 / (1 + L) - 0.5), (0.03, 0.1)),
    ],
)
def test_margins_end_beside_a_mode_with_little_damping_where_its_frequency_response_does(margins, span, least, peak):
    required = {"margins": {"cut": "comp.y", **margins}}
    (row,) = wavesweep.compile(FLEXIBLE).stable_intervals("g", span, require=required).itertuples()
    assert row.certified
    (end,) = {row.low, row.high} - set(span)
    L = flexible(np.linspace(*peak, 2001))
    assert brentq(lambda g: least(g * L).min(), *span) == pytest.approx(end, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "second", "set_by", "end"),
    [
        ({"Ms": 1.25}, {"Ms": 2.0}, "Ms at c.y", 0.4),  # 2 - 2/Ms
        ({"Ms": 2.0}, {"Ms": 1.25}, "Ms at d.y", 0.4),
        ({"Ms": 2.0}, {"gain": 4.0}, "gain at d.y", 0.5),  # 2/gain
        ({"phase_deg": 60.0}, {"gain": 1.5}, "phase at c.y", 1.0),  # 2 sin(30 deg)
    ],
)
def test_of_several_cuts_the_one_that_sets_an_end_is_named(first, second, set_by, end):
    """Two integrators, each under a gain of its own, `L = s/(z - 1)` with s = K T at either cut."""
    loop = cut_integrator(1, 1)
    wire = {"p.u": "c.y", "c.u": "-K*p.y", "q.u": "d.y", "d.u": "-K*q.y"}
    blocks = {"p": loop["block"]["p"], "c": loop["block"]["c"], "q": loop["block"]["p"], "d": loop["block"]["c"]}
    loop = loop | {"block": blocks, "wire": wire, "ports": {}}
    margins = [{"cut": "c.y", **first}, {"cut": "d.y", **second}]
    (row,) = wavesweep.compile(loop).stable_intervals(require={"margins": margins}).itertuples()
    assert (row.certified, row.high_set_by) == (True, set_by)
    assert row.high == pytest.approx(end / T, rel=1e-6)


@pytest.mark.slow
def test_a_gain_margin_holds_between_the_ends_of_its_factors():
    """The loop is stable with gains up to 0.417 and from 0.65 to 2.5: those from 0.385 to 0.41 are so with both ends of the
    range, 1/1.7 and 1.7, and with factors in between they are in the hole."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 0.4},
        "block": {"p": {"type": "tf", "num": NUM, "den": DEN, "discrete": True}, "c": {"type": "gain", "k": "K"}},
        "wire": {"c.u": "p.y", "p.u": "c.y"},
        "sweep": {"along": "K", "K": {"start": 0.385, "stop": 0.41}},
    }
    loop = wavesweep.compile(tables)
    for factor in (1 / 1.7, 1.0, 1.7):
        (row,) = loop.stable_intervals(span=(0.385 * factor, 0.41 * factor)).itertuples()
        assert (row.certified, row.low, row.high) == (True, 0.385 * factor, 0.41 * factor)
    (row,) = loop.stable_intervals(require={"margins": {"cut": "c.y", "gain": 1.7}}).itertuples()
    assert (row.certified, row.intervals) == (True, 0)


@pytest.mark.slow
def test_an_end_that_a_phase_inside_the_range_sets_is_that_of_a_march():
    """Just beyond the end the loop is unstable with phases about 40 deg, and stable with the last one, 47.27 deg; the
    controller runs in every other tick."""
    A = [[-0.5727, -0.9087, 0.0934], [1, 0, 0], [0, 1, 0]]
    C = [[-0.1506, 0.6282, 0.5898]]
    tables = {
        "rates": {"tick_hz": 100},
        "numbers": {"K": 0.01},
        "block": {
            "p": {"type": "ss", "discrete": True, "A": A, "B": [[1], [0], [0]], "C": C, "D": [[0]]},
            "c": {
                "type": "ss",
                "discrete": True,
                "A": [[-0.0109]],
                "B": [[1]],
                "C": [["0.8701*K"]],
                "D": [["-2.5431*K"]],
                "every": 2,
            },
        },
        "wire": {"p.u": "-c.y", "c.u": "p.y"},
        "sweep": {"along": "K", "K": {"start": 0, "stop": 2}},
    }
    (row,) = wavesweep.compile(tables).stable_intervals(require={"margins": {"cut": "c.y", "phase_deg": 47.27}}).itertuples()

    assert row.certified
    assert misjudged(tables, "K", (0.0, 2.0), {"margins": {"cut": "c.y", "phase_deg": 47.27}}) == []


@pytest.mark.slow
def test_what_is_not_shown_of_factors_with_the_work_of_a_slice_is_in_doubt(monkeypatch):
    """With gains of 1.2 either way the ends are 1.2 times less, or more, than those of stability."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 0.4},
        "block": {"p": {"type": "tf", "num": NUM, "den": DEN, "discrete": True}, "c": {"type": "gain", "k": "K"}},
        "wire": {"c.u": "p.y", "p.u": "c.y"},
        "sweep": {"along": "K", "K": {"start": 0, "stop": 3}},
    }
    loop = wavesweep.compile(tables)
    first, second = loop.stable_intervals().itertuples()
    monkeypatch.setattr(factors, "MOST_WORK", 1e6)
    found = list(loop.stable_intervals(require={"margins": {"cut": "c.y", "gain": 1.2}}).itertuples())
    assert [(row.certified, row.doubt) for row in found] == [(False, "search")] * 2
    assert 0 <= found[0].low < found[0].high < first.high / 1.2
    assert second.low * 1.2 < found[1].low < found[1].high < second.high / 1.2


@pytest.mark.parametrize(
    ("margins", "said"),
    [
        ({"cut": "c.y", "gain": 1}, "expected a number >= 1.001"),
        ({"gain": 2}, "expected cut, and one of Ms, disk, gain, phase_deg, found none of cut"),
        ([{"cut": "c.y", "Ms": 2}, {"cut": "c.y"}], "expected cut, and one of Ms, disk, gain, phase_deg, found none of Ms"),
        ({"cut": "look.y", "Ms": 2}, "expected an output of a block that some wire reads at a tick (c.y, p.y)"),
        ({"cut": "look.y", "Ms": 2, "seen": 1}, 'expected a signal of a loop, found "look.y", which does not come back'),
    ],
)  # fmt: skip
def test_what_margins_can_not_be_required_is_said(margins, said):
    tables = cut_integrator(1, 1)
    if "seen" in margins and margins.pop("seen"):
        tables["block"] = tables["block"] | {"more": {"type": "delay"}}
        tables["wire"] = tables["wire"] | {"more.u": "look.y"}
    with pytest.raises(wavesweep.SpecError) as raised:
        wavesweep.load(tables | {"sweep": INTEGRATOR["sweep"] | {"require": {"margins": margins}}})
    assert said in str(raised.value)


def test_a_disk_of_a_signal_that_is_made_several_times_in_a_frame_is_refused():
    loop = wavesweep.compile(cut_integrator(3, 6))
    with pytest.raises(UsageError, match="expected Ms in its place"):
        loop.stable_intervals(require={"margins": {"cut": "c.y", "disk": 0.5}})


def test_margins_at_several_cuts_are_what_each_alone_has_in_common():
    """A position loop above a speed loop, broken at the position controller's output and at the force."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 20.0},
        "block": {"x": {"type": "mass", "mass": 1}, "c": {"type": "hold"}, "d": {"type": "hold"}},
        "wire": {"c.u": "-K*x.x", "d.u": "c.y - 30*x.v", "x.f": "d.y"},
        "sweep": {"along": "K", "K": {"start": 0, "stop": 2000}},
    }
    cuts = [{"cut": "c.y", "phase_deg": 60.0}, {"cut": "d.y", "Ms": 1.3}]
    ends = []
    for margins in (*cuts, cuts):
        own = tables | {"sweep": tables["sweep"] | {"require": {"margins": margins}}}
        (row,) = wavesweep.stability_region(own).itertuples()
        assert (row.certified, row.low) == (True, 0)
        ends.append(row.high)
    assert ends[2] == min(ends) < max(ends)
    assert wavesweep.load(wavesweep.load(own).tables()).require == wavesweep.load(own).require
    assert "60 deg at c.y and Ms of at most 1.3 at d.y" in str(wavesweep.verdict(own))


@pytest.mark.slow
def test_a_gain_and_a_radius_are_what_both_have_in_common():
    loop = wavesweep.compile(INTEGRATOR)
    (row,) = loop.stable_intervals(require=bounded("dist", "error", 1.7, radius=0.9)).itertuples()
    assert (row.certified, row.low_set_by, row.high_set_by) == (True, "mode", "gain")
    assert (row.low, row.high) == (pytest.approx(0.1 / T), pytest.approx((2 - 2 / 1.7) / T))
    (row,) = loop.stable_intervals(require=bounded("dist", "error", 50.0, radius=0.9)).itertuples()
    assert (row.certified, row.high_set_by, row.high) == (True, "mode", pytest.approx(1.9 / T))
    (row,) = loop.stable_intervals(require=bounded("dist", "error", 0.9)).itertuples()
    assert (row.certified, row.intervals) == (True, 0)  # at z = -1 it is 1 or more


def test_a_gain_that_nearly_is_the_level_at_rest_is_not_taken_as_it_in_a_band_without_rest():
    """`|H|^2 - 1 = s (b - 1) (b + 1 - a)/(s (1 - a) + a^2)` of `H = b + a (1 - b)/(z - 1 + a)`, with `s = |z - 1|^2`.

    It falls with s below b = 1, so that a level next to 1 is met at the low end of the band.
    """
    a, level, theta = 0.5, 1 - 5e-10, 2e-4
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"a": a, "b": 0.5},
        "block": {"x": {"type": "delay"}},
        "wire": {"x.u": "(1 - a)*x.y + r"},
        "ports": {"inputs": {"r": "r"}, "outputs": {"y": "b*r + a*(1 - b)*x.y"}},
        "sweep": {"along": "b", "b": {"start": 0.2, "stop": 1.2}},
    }
    loop = wavesweep.compile(tables)
    s = 4 * np.sin(theta / 2) ** 2
    short = (1 - level**2) * (s * (1 - a) + a**2) / s
    limit = np.roots([-1, a, 1 - a - short]).max()
    assert limit < 0.996
    band = {"band_hz": [theta * 1000 / (2 * np.pi), 500]}
    (row,) = loop.stable_intervals(require={"gain": bounded("r", "y", level)["gain"] | band}).itertuples()
    assert not (row.certified and row.high > limit)
    (row,) = loop.stable_intervals(require=bounded("r", "y", 1.0)).itertuples()
    assert row.certified
    assert row.high == pytest.approx(1, rel=1e-8)


def beyond_rest(tables, h, angles):
    """By how much the square of the gain of a headway is above 1 at angles per tick, over that of the angle."""
    lifted = lifted_of(machine_of(with_numbers(tables, {"h": float(h)})), tables["sweep"]["require"]["gain"])
    sizes = np.array([np.linalg.norm(at_angle(lifted, angle * len(lifted[3])), 2) for angle in angles])
    return (sizes**2 - 1) / (2 - 2 * np.cos(angles))


@pytest.mark.slow
@pytest.mark.parametrize("commands", [1, 2])
def test_a_gain_that_is_the_level_at_rest_is_decided_beside_it(commands):
    """Of a string of cars, whose gain at rest is 1 for every headway."""
    tables = wavesweep.load(STRING).tables()
    tables["block"]["radio"]["every"] = commands
    (row,) = wavesweep.stability_region(wavesweep.load(tables)).itertuples()
    assert (row.certified, row.low_set_by, row.high) == (True, "gain", 3.0)
    assert f"h > {row.low:.5f} s" in STRING.read_text(encoding="utf-8")
    angles = np.concatenate([np.geomspace(1e-4, 0.02, 50), row.low_omega * 0.05 + np.linspace(-0.02, 0.02, 2001)])
    for h, swells in ((row.low * (1 - 1e-6), True), (row.low * (1 + 1e-6), False)):
        assert (beyond_rest(tables, h, angles).max() > 0) == swells


def test_a_band_has_its_gain_alone_and_ends_where_it_ends():
    """`|z - 1| <= level |z - 1 + K T|` at the highest frequency, since it grows with it."""
    gain = bounded("dist", "error", 0.5)["gain"] | {"band_hz": [0.0, 2.0]}
    (row,) = wavesweep.compile(INTEGRATOR).stable_intervals(require={"gain": gain}).itertuples()
    w = np.exp(2j * np.pi * 2.0 * T) - 1
    end = brentq(lambda K: abs(w) - 0.5 * abs(w + K * T), 1, 100, xtol=1e-12)
    assert (row.certified, row.low_set_by, row.low) == (True, "gain", pytest.approx(end, rel=1e-8))
    assert (row.low_omega, row.high, row.high_set_by) == (pytest.approx(2 * np.pi * 2.0), pytest.approx(2 / T), "mode")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratio", "delay", "along", "span", "shown", "band"),
    [
        (3, 2, "K_VE", (5.0, 1500.0), "f_m", (9.0, 140.0)),
        (2, 0, "B_VE", (0.1, 20.0), "x", (20.0, 240.0)),
        (45, 3, "K_VE", (5.0, 300.0), "F_s", (0.0, 11.0)),
    ],
)
def test_the_gain_of_a_controller_is_below_the_level_inside_and_not_outside(ratio, delay, along, span, shown, band):
    """In short frames and in long ones; the level is that of a value within the span."""
    tables = {
        "controller": {"kind": "dc-slow"},
        "rates": {"ratio": ratio},
        "environment": {"K_VE": 60.0, "B_VE": 1.0, "delay": delay},
    }
    gain = {"from": "f_h", "to": shown, "band_hz": [*band]}
    level = value_of(machine_of(with_numbers(tables, {along: span[0] + 0.1 * (span[1] - span[0])})), "gain", gain)
    assert misjudged(tables, along, span, {"gain": gain | {"at_most": level}}) == []


@pytest.mark.parametrize("seed", range(6))
def test_directions_in_which_the_form_is_negative_are_counted_without_its_inputs(seed):
    """`level^2 - H* H` of all inputs of a frame has as many negative eigenvalues as its joins and its states tell."""
    r = np.random.default_rng(seed)
    n, kinds = 3, [0, 1, 1, 1, 1, 2, 1]
    maps = [tuple(0.5 * r.normal(size=shape) for shape in ((n, n), (n, 1), (1, n), (1, 1))) for _ in range(3)]
    A, B, C, D = np.eye(n), np.zeros((n, 0)), np.zeros((0, n)), np.zeros((0, 0))
    for e, b, c, d in (maps[kind] for kind in kinds):
        D = np.block([[D, np.zeros((len(D), 1))], [c @ B, d]])
        C = np.concatenate([C, c @ A])
        A, B = A + e @ A, np.concatenate([B + e @ B, b], 1)
    z = np.exp(1j * r.uniform(0.1, 3))
    H = D + C @ np.linalg.solve(z * np.eye(n) - A, B + 0j)
    counts = set()
    for level in np.linalg.norm(H, 2) * np.array([0.02, 0.2, 0.6, 0.9, 1.1, 3.0]):
        ticks = [of_tick(*(Bounded(part[None], 0 * part[None]) for part in tick), level**2, 1) for tick in maps]
        frame = in_a_row(kinds, ticks, then)
        moved = np.eye(n) + frame.E[0][0] - z * np.eye(n)
        form = np.block([[-frame.G[0][0], moved], [moved.conj().T, frame.Q[0][0]]])
        truth = (np.linalg.eigvalsh(level**2 * np.eye(7) - H.conj().T @ H) < 0).sum()
        assert (np.linalg.eigvalsh(form) < 0).sum() - n + frame.below[0] == truth
        counts.add(int(truth))
    assert len(counts) > 2


GAIN = "sweep.require.gain"


@pytest.mark.parametrize(
    ("gain", "expected"),
    [
        (
            bounded("dust", "own", 1.0)["gain"],
            f'{GAIN}.from: expected an input of the loop (dist, ref), found "dust"; did you mean `dist`',
        ),
        ({"from": "ref", "to": "own"}, f"{GAIN}: expected all of gain.from, gain.to, gain.at_most, found none of gain.at_most"),
        (bounded("ref", "own", 0.0)["gain"], f"{GAIN}.at_most: expected a number > 0, found 0"),
        (
            bounded("ref", "own", 1.0)["gain"] | {"band_hz": [2, 1]},
            f"{GAIN}.band_hz: expected the lower frequency first, found [2, 1]",
        ),
    ],
)
def test_what_cannot_be_required_is_one_clear_line(gain, expected):
    with pytest.raises(UsageError, match=r"^" + expected.translate({ord(each): f"\\{each}" for each in "[]()."})):
        wavesweep.load(INTEGRATOR | {"sweep": INTEGRATOR["sweep"] | {"require": {"gain": gain}}})


def test_bands_beyond_half_the_rate_and_outputs_that_drift_are_refused():
    spec = {"controller": {"kind": "dc-slow"}, "sweep": {"along": "K_VE", "K_VE": {"start": 5, "stop": 50}}}
    spec["sweep"]["require"] = {"gain": bounded("f_h", "x", 1.0)["gain"] | {"band_hz": [1, 501]}}
    with pytest.raises(
        UsageError, match=r"band_hz: expected frequencies up to 25 Hz, half the rate of the frames.*, found 501"
    ):
        wavesweep.stability_region(wavesweep.load(spec))
    free = {**INTEGRATOR, "block": INTEGRATOR["block"] | {"q": {"type": "tf", "num": [1], "den": [1, 0]}}}
    free |= {"wire": INTEGRATOR["wire"] | {"q.u": "p.y"}, "ports": {"inputs": {"ref": "ref"}, "outputs": {"place": "q.y"}}}
    free["wire"]["p.u"] = "K*(ref - p.y)"
    with pytest.raises(UsageError, match=r"gain\.to: expected an output that comes to rest, found place, which drifts"):
        wavesweep.compile(free).stable_intervals(require=bounded("ref", "place", 1.0))
    free["block"] = free["block"] | {"far": {"type": "integrator"}, "change": {"type": "difference"}}
    free["wire"] |= {"far.u": "p.y", "change.u": "far.y", "p.u": "K*(ref - p.y - change.y)"}
    with pytest.raises(UsageError, match=r"margins\.cut: expected a signal that comes to rest, found 'far\.y', which drifts"):
        wavesweep.compile(free).stable_intervals(require={"margins": {"cut": "far.y", "Ms": 2.0}})


@pytest.mark.parametrize(
    ("controller", "stop", "high"),
    [
        pytest.param({"kind": "dc-slow"}, 5000, 2999.976, marks=pytest.mark.slow),
        pytest.param({"kind": "dc-slow"}, 1e9, 996.646, marks=pytest.mark.slow),
        ({"kind": "pmw", "Kp": 40}, 50, 50),
    ],
)
def test_a_gain_that_holds_from_a_wall_of_zero_on_begins_there(controller, stop, high):
    """Without a wall the position drifts: next to it a pole is 1, but for less than rounding can tell."""
    slow = {"integration": "explicit", "delay": 0 if stop == 5000 else 1}
    sweep = {"K_VE": {"start": 0, "stop": stop}, "require": {"gain": {"from": "f_h", "to": "v", "at_most": 1.0}}}
    table = wavesweep.zwidth({"rates": {"ratio": 1}, "environment": slow, "controller": controller, "sweep": sweep})
    (row,) = table.itertuples()
    assert (row.low, row.certified, row.open_places) == (0, True, 0)
    assert row.high == pytest.approx(high, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1, -1])
def test_a_disk_margin_holds_from_a_drift_on_that_lies_within_the_range(sign):
    """A mass under a hold of 4 ticks, whose force comes 3 ticks later: against samples on the circle; of either sign."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 1.0},
        "block": {
            "p": {"type": "mass", "mass": 0.2, "damping": 2.0},
            "h": {"type": "hold", "every": 4},
            "d": {"type": "delay", "steps": 3},
        },
        "wire": {"h.u": "p.x", "d.u": "h.y", "p.f": f"w - {sign}*K*d.y"},
        "ports": {"inputs": {"w": "w"}, "outputs": {"x": "p.x"}},
    }
    require = {"margins": {"cut": "h.y", "disk": 0.8}}
    span = sorted((-20 * sign, 300 * sign))
    (row,) = wavesweep.compile(tables).stable_intervals("K", span, require=require).itertuples()
    assert (row.certified, (row.low, row.high)[::sign][0]) == (True, 0)
    assert misjudged(tables, "K", span, require) == []


def test_a_gain_that_is_too_large_next_to_a_wall_of_zero_does_not_begin_there():
    """The largest gain is 0.4 at any resonance, 1 over the damping of the device and of the wall."""
    sweep = {"K_VE": {"start": 0, "stop": 5000}, "require": {"gain": {"from": "f_h", "to": "v", "at_most": 0.399}}}
    table = wavesweep.zwidth({"rates": {"ratio": 1}, "controller": {"kind": "dc-slow"}, "sweep": sweep})
    assert not table.intervals.any()


def test_a_lifted_gain_of_an_input_that_is_read_once_in_n_ticks_is_the_root_of_n():
    """A command is read every 32 ticks and held: its energy is of one tick, that of what is held of 32."""
    held = {"type": "hold", "every": 32}
    body = {"type": "mass", "mass": "m", "damping": 1.0, "stiffness": 1.0}
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"m": 0.1},
        "block": {"held": held, "body": body},
        "wire": {"held.u": "ref", "body.f": "0*held.y"},
        "ports": {"inputs": {"ref": "ref"}, "outputs": {"shown": "held.y"}},
    }
    loop = wavesweep.compile(tables)
    root = np.sqrt(32)
    for level, meets in ((root * (1 + 1e-6), True), (root * (1 - 1e-6), False)):
        gain = {"from": "ref", "to": "shown", "at_most": level}
        (row,) = loop.stable_intervals("m", (0.05, 0.2), require={"gain": gain}).itertuples()
        assert row.certified
        assert bool(row.intervals) == meets
