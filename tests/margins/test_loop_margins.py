"""Margins of a broken loop against dense grids of an open loop that scipy samples, refined, and against python-control."""

import tomllib
import warnings
from contextlib import suppress
from copy import deepcopy
from types import SimpleNamespace

import control
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.signal import cont2discrete
from support.drawn import ARM

from wavesweep import UsageError, load
from wavesweep.engine.doubts import words
from wavesweep.margins import figure, library
from wavesweep.margins.broken_loops import broken_at, cuts_of, default_cut, factor_at, lines_at, with_block
from wavesweep.margins.lifted_margins import margins_of
from wavesweep.margins.section import sections
from wavesweep.program.api import compile as compiled

GRID = np.unique(np.concatenate([np.geomspace(1e-7, np.pi, 8001), np.linspace(1e-5, np.pi, 8001)])[:-1])
W = 2 * np.pi
ARM_SPEC = tomllib.loads(ARM)


def margins(spec, cut):
    found, doubt = margins_of(broken_at(load(spec), cut))
    assert doubt == 0
    return {each.name: each for each in found}


def sampled(num, den, tick_hz):
    """A plant whose output is fed back at every tick."""
    plant = {"type": "tf", "num": num, "den": den}
    wires = {"plant.u": "c.y", "c.u": "-plant.y"}
    return {"rates": {"tick_hz": tick_hz}, "block": {"plant": plant, "c": {"type": "gain"}}, "wire": wires}


def random_spec(rng):
    """A plant at every tick, and behind a sampler a slower controller with or without a delay."""
    ticks = int(rng.choice([1, 2, 5, 20]))
    period = 10 ** rng.uniform(-4, -1)
    w, z = 10 ** rng.uniform(-2, -0.3, 3) * np.pi / period, rng.uniform(0.02, 1, 3)
    pair, other = ([1, 2 * z[i] * w[i], w[i] ** 2] for i in (0, 1))
    num, den = (
        ([w[0] ** 2], pair),
        ([w[0] * w[1]], [1, w[0], 0]),
        ([w[0] ** 2 * w[1] ** 2 / w[2], w[0] ** 2 * w[1] ** 2], np.polymul(pair, other)),
        ([w[0]], [1, rng.uniform(-0.3, 0.3) * w[0]]),
    )[rng.integers(4)]
    k, late = 10 ** rng.uniform(-1, 0.7), int(rng.integers(0, 3))
    over = [k * (1 + 0.5 * z[1]), -k] if rng.random() < 0.3 else [k]
    under = [1, 0] if rng.random() < 0.5 else [1, -rng.uniform(0, 0.9)]
    spec = sampled([float(v) for v in num], [float(v) for v in den], ticks / period)
    spec["block"]["c"] = {"type": "tf", "num": over, "den": under, "discrete": True, "every": ticks}
    return (later(spec, late) if late else spec), period


def later(spec, frames, signal="c.y", port="plant.u"):
    """The loop with whole frames of delay more."""
    spec = deepcopy(spec)
    every = spec["block"][signal.partition(".")[0]].get("every", 1)
    name = f"late{len(spec['block'])}"
    spec["block"][name] = {"type": "delay", "steps": frames, "every": every}
    spec["wire"][f"{name}.u"] = spec["wire"][port]
    spec["wire"][port] = f"{name}.y"
    return spec


def open_loop(spec, period):
    """L of a random spec as a function of the angle, and as a system of python-control."""
    plant, c = spec["block"]["plant"], spec["block"]["c"]
    A, B, C, D = control.ssdata(control.ss(control.tf(plant["num"], plant["den"])))
    A, B, C, D, _ = cont2discrete((A, B, C, D), period)
    late = next((each["steps"] for each in spec["block"].values() if each["type"] == "delay"), 0)

    def L(theta):
        z = np.exp(1j * np.asarray(theta, float))
        state = np.linalg.solve(z[..., None, None] * np.eye(len(A)) - A, B + 0j * z[..., None, None])
        return (C @ state + D)[..., 0, 0] * np.polyval(c["num"], z) / np.polyval(c["den"], z) * z**-late

    whole = control.ss(A, B, C, D, period) * control.ss(control.tf(c["num"], c["den"], period))
    return L, whole * control.ss(control.tf([1], [1] + [0] * late, period)) if late else whole


def by_grid(L):
    """Every margin from a dense grid, each refined by a root finder or by a search between its neighbours."""
    values = L(GRID)

    def roots(of):
        size = of(values)
        at = np.flatnonzero(np.sign(size[:-1]) != np.sign(size[1:]))
        return np.array([brentq(lambda t: float(of(L(t))), GRID[i], GRID[i + 1], xtol=1e-300, rtol=1e-15) for i in at])

    found, at_rest = {}, np.inf
    angles = np.append(roots(np.imag), np.pi)
    real = L(angles)
    real = real.real[np.abs(real.imag) < 1e-6 * np.abs(real)]
    real = real[np.abs(real) < 1e8]  # an integrator's grows without end
    with suppress(np.linalg.LinAlgError):  # of an integrator
        at_rest = complex(L(0.0))
        real = np.append(real, at_rest.real)
    gains = -1 / real
    found["gain_up"] = gains[gains > 1].min(initial=np.inf)
    found["gain_down"] = gains[(gains < 1) & (gains > 1e-6)].max(initial=-np.inf)
    ones = roots(lambda some: np.log(np.abs(some)))
    lag = np.angle(-L(ones)) if ones.size else ones
    found["phase"] = np.degrees(np.abs(lag).min(initial=np.inf))
    found["delay_frames"] = ((lag % (2 * np.pi)) / ones).min(initial=np.inf)
    for name, less in (("sensitivity", 0), ("complementary", 1), ("disk", 0.5)):
        size = np.abs(1 / (1 + values) - less)
        i = int(np.argmax(size))
        ends = GRID[max(i - 1, 0)], GRID[min(i + 1, GRID.size - 1)]
        near = minimize_scalar(lambda t, less=less: -abs(1 / (1 + L(t)) - less), bounds=ends, options={"xatol": 1e-13})
        best = max(float(size[i]), -near.fun, abs(1 / (1 + at_rest) - less))
        found[name] = 1 / best if name == "disk" else best
    unlimited = {"gain_up": 1e6, "gain_down": 0.0, "phase": 180.0, "delay_frames": 1e6}
    return {name: value if np.isfinite(value) and value < 1e6 else unlimited[name] for name, value in found.items()}


@pytest.mark.parametrize(
    ("num", "den", "gain"),
    [([2], [1, 3, 2, 0], 2.79278620), ([1.1 * W**2], [1, 0.4 * W, W**2], 2.38419629)],  # python-control, issues 465 and 523
)
@pytest.mark.parametrize("cut", ["plant.y", "c.y"])
def test_two_published_gain_margins(num, den, gain, cut):
    found = margins(sampled(num, den, 20), cut)
    assert found["gain_up"].value == pytest.approx(gain, abs=5e-9)
    assert (found["gain_down"].value, found["gain_down"].limited) == (0, False)
    assert not any(each.doubt for each in found.values())


@pytest.mark.parametrize(("pole", "limited"), [(4e-6, True), (4e-7, False)])
def test_a_gain_may_fall_without_limit_if_its_limit_is_below_a_millionth(pole, limited):
    """`x+ = (1 + pole - k) x` is stable from k = pole on, if the factor of the signal is k."""
    spec = sampled([1.0], [1.0, -1.0 - pole], 100)
    spec["block"]["plant"]["discrete"] = True
    down = margins(spec, "c.y")["gain_down"]
    assert down.limited == limited
    assert down.value == (pytest.approx(pole, rel=1e-8) if limited else 0)


@pytest.mark.parametrize(("gain", "known"), [(1.0, False), (1.5, True)])
def test_a_mode_on_the_circle_is_not_said_to_be_unstable(gain, known):
    """`x+ = -gain x`"""
    spec = sampled([gain], [1.0, 0.0], 100)
    spec["block"]["plant"]["discrete"] = True
    found, doubt = margins_of(broken_at(load(spec), "c.y"))
    assert (found, words([doubt])[0]) == ([], "" if known else "rounding")


@pytest.mark.parametrize(("seed", "many"), [(1, 2), pytest.param(0, 30, marks=pytest.mark.slow)])
def test_margins_of_random_loops(seed, many):
    """Against the grid to 1e-9; whole frames that last less than the delay margin leave the loop stable."""
    rng, stable, agree = np.random.default_rng(seed), 0, {"gain": 0, "phase": 0, "disk": 0}
    while stable < many:
        spec, period = random_spec(rng)
        found, doubt = margins_of(broken_at(load(spec), "c.y"))
        assert doubt == 0
        radius = compiled(spec).spectral_radius()
        assert bool(found) == (radius < 1)
        if not found:
            continue
        stable += 1
        found = {each.name: each for each in found}
        L, system = open_loop(spec, period)
        wanted = by_grid(L)
        for name, value in wanted.items():
            each = found[name]
            assert words([each.doubt])[0] == ("fast" if name == "delay_frames" and abs(L(np.pi)) >= 1 else "")
            if not each.doubt:
                assert each.value == pytest.approx(value, rel=1e-9), (seed, stable, each)
                assert each.limited == (value not in (1e6, 0.0, 180.0))
                assert each.bound < 1e-8
        frames = found["delay_frames"].value
        if 1 <= frames < 40:
            assert compiled(later(spec, int(frames * (1 - 1e-9)))).spectral_radius() < 1
        for name, right in by_control(system, found).items():
            agree[name] += right
    assert min(agree.values()) >= 2 * many // 3  # of them; margins misses crossings in some, and interpolates others


def by_control(system, found):
    """Which margins python-control has alike."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gain, phase, *_ = control.margin(control.tf(system))
        disk, *_ = control.disk_margins(system, np.geomspace(1e-4, np.pi, 2000) / system.dt)
    own = [found[name].value if found[name].limited else 1e300 for name in ("gain_up", "gain_down", "phase")]
    return {
        "gain": np.isclose(min(gain, 1e300), own[:2], rtol=1e-6).any(),
        "phase": np.isclose(min(phase, 1e300), own[2], rtol=1e-3),
        "disk": np.isclose(disk, found["disk"].value, rtol=1e-3),
    }


def test_the_gain_margin_of_a_loop_of_two_rates_is_an_end_along_its_gain():
    """The number kp of the arm multiplies net.y alone, which is made once in 20 ticks."""
    loop = compiled(load(ARM_SPEC))
    rows = loop.stable_intervals("kp", (0, 1e4))
    found = loop.margins("net.y").set_index("margin")
    assert found.loc["gain_up", "value"] == pytest.approx(rows.high.iloc[-1] / 240, rel=1e-11)
    assert found.loc["gain_up", "omega"] == pytest.approx(rows.high_omega.iloc[-1], rel=1e-9)
    assert found.certified.all()
    frames = found.loc["delay_frames", "value"]
    steps = {
        k: compiled(load(ARM_SPEC, [f"block.net.steps={1 + k}"])).spectral_radius() for k in (int(frames), int(frames) + 1)
    }
    assert [radius < 1 for radius in steps.values()] == [True, False]


@pytest.mark.parametrize("size", [1.0, 0.999])
def test_a_gain_of_one_at_rest_is_that_of_a_rotation_by_180_degrees(size):
    """L = size (1 - a)/(z - a) falls from there on: a rotation by 180 degrees would end stability at size 1."""
    found = margins(recursion([0.5 * size], [1, -0.5]), "c.y")
    assert (found["phase"].doubt, found["phase"].value) == (0, 180)
    assert found["phase"].limited == (size == 1)
    assert (found["delay_frames"].doubt, found["delay_frames"].limited) == (0, False)


def test_a_disk_that_reaches_all_gains_has_no_largest():
    """L is 0 at rest and has a positive real part elsewhere: no gain, however large, ends stability."""
    found = margins(recursion([0.1, -0.1], [1, -0.5]), "c.y")
    assert found["disk"].value == pytest.approx(2, rel=1e-9)
    assert found["disk_phase"].value == pytest.approx(90, rel=1e-9)
    for name in ("gain_up", "disk_gain"):
        assert (found[name].value, found[name].limited, found[name].doubt) == (1e6, False, 0)


def recursion(num, den):
    """A loop of one discrete transfer function, fed back with the opposite sign."""
    return {
        "rates": {"tick_hz": 100},
        "block": {"c": {"type": "tf", "num": num, "den": den, "discrete": True}},
        "wire": {"c.u": "-c.y"},
    }


def test_no_delay_margin_from_a_gain_that_is_large_at_half_the_rate():
    """L = (2 z - 0.8)/(z - 0.5): the loop is stable, but not with any delay of a frame."""
    spec = recursion([2, -0.8], [1, -0.5])
    found = margins(spec, "c.y")
    assert (words([found["delay_frames"].doubt])[0], np.isnan(found["delay_frames"].value)) == ("fast", True)
    assert compiled(later(spec, 1, port="c.u")).spectral_radius() > 1
    assert (found["phase"].value, found["phase"].limited, found["phase"].doubt) == (180, False, 0)


def test_a_loop_of_a_plant_and_a_dead_time_is_cut_where_that_arrives_at_a_tick():
    """As with a hold between them; |L(0)| is 1, next to which a crossing would mean a rotation by 180 degrees."""
    tables = {
        "rates": {"tick_hz": 50},
        "block": {"plant": {"type": "tf", "num": [1], "den": [1, 1]}, "dead": {"type": "delay", "seconds": 0.2}},
        "wire": {"dead.u": "plant.y", "plant.u": "ref - dead.y"},
        "ports": {"inputs": {"ref": "ref"}, "outputs": {"y": "plant.y"}},
    }
    alone = margins(tables, "dead.y")
    tables["block"]["h"] = {"type": "hold"}
    tables["wire"] |= {"h.u": "-dead.y", "plant.u": "ref + h.y"}
    held = margins(tables, "h.y")
    assert alone.keys() == held.keys()
    for name, margin in held.items():
        assert (margin.doubt, alone[name].doubt) == (0, 0)
        assert alone[name].value == pytest.approx(margin.value, rel=1e-9)
    assert (held["phase"].value, held["phase"].omega, held["delay_frames"].limited) == (180, 0, False)
    T = 0.02
    theta = brentq(lambda theta: 10 * theta + np.angle(np.exp(1j * theta) - np.exp(-T)) - np.pi, 0.1, 0.3)
    gain = abs(np.exp(1j * theta) - np.exp(-T)) / (1 - np.exp(-T))
    assert held["gain_up"].value == pytest.approx(gain, rel=1e-9)


def test_a_name_for_what_a_slow_block_holds_has_the_margins_of_that_block():
    """Its samples are those of the block's runs, though a plant reads it in every tick."""
    named = deepcopy(ARM_SPEC)
    reader = next(port for port, text in named["wire"].items() if "net.y" in str(text))
    named["signals"] = {**named.get("signals", {}), "sent": "net.y"}
    named["wire"][reader] = named["wire"][reader].replace("net.y", "sent")
    own, found = margins(ARM_SPEC, "net.y"), margins(named, "sent")
    assert found.keys() == own.keys()
    for name, margin in own.items():
        assert found[name].value == pytest.approx(margin.value, rel=1e-7)


@pytest.mark.parametrize(
    ("cut", "said"),
    [
        ("net.u", r"an output of a block that some wire reads at a tick \(.*net\.y.*\), found 'net.u'; did you mean `net.y`"),
        ("nothing", "found 'nothing'"),
    ],
)
def test_signals_that_break_no_loop_are_refused(cut, said):
    with pytest.raises(UsageError, match=said):
        broken_at(load(ARM_SPEC), cut)


def test_a_loop_over_a_network_is_cut_where_its_messages_come():
    """A damper beside the channels acts on the mass as well: it is no margin of a network, there and back.

    One channel alone is the bus of a drive.
    """
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 50.0},
        "block": {"m": {"type": "mass", "mass": 0.3, "damping": 8.0}, "b": {"type": "difference"}}
        | {"there": {"type": "channel", "lost": 1}, "back": {"type": "channel", "lost": 1}},
        "wire": {"b.u": "m.x", "there.u": "m.x", "back.u": "there.y", "m.f": "-2*b.y - K*back.y"},
    }
    assert default_cut(load(tables)) == "back.y"
    tables["block"]["back"] = {"type": "hold"}
    assert default_cut(load(tables)) == "b.y"


@pytest.mark.parametrize("late", [0.0002, 0.001, 0.0016])
def test_a_force_that_arrives_between_two_ticks_has_the_margins_of_its_own_delay(late):
    """The phase at the crossover follows from a plant that is sampled with a hold that is divided in two."""
    K, B, m, d, T = 300.0, 0.5, 0.1, 1.5, 1e-3
    tables = {"controller": {"kind": "dc"}, "environment": {"K_VE": K, "B_VE": B}}
    spec = load(tables | {"device": {"mass": m, "damping": d, "velocity": "difference", "dead_time": late}})
    assert next(iter(cuts_of(spec))) == "command.y"
    ticks = int(np.ceil(late / T - 1e-9))
    first = ticks - late / T  # share of a tick in which the newer force acts

    plant = np.array([[0, 1], [0, -d / m]]), np.array([[0], [1 / m]]), np.eye(2), np.zeros((2, 1))

    def loop(w):
        z, steps = np.exp(1j * w * T), []
        for share in (late / T - ticks + 1, first):
            A, b, *_ = cont2discrete(plant, share * T)
            steps.append((A, b[:, 0]))
        (A, b), (A2, b2) = steps
        x = np.linalg.solve(z * np.eye(2) - A2 @ A, (A2 @ b) * z**-ticks + b2 * z ** (1 - ticks))[0]
        return (K + B * (1 - 1 / z) / T) * x

    crossing = brentq(lambda w: abs(loop(w)) - 1, 20, 100)
    found = {margin.name: margin for margin in margins_of(broken_at(spec, "command.y"))[0]}
    assert found["phase"].value == pytest.approx(np.degrees(np.angle(-loop(crossing))), rel=1e-8)
    assert found["phase"].omega == pytest.approx(crossing, rel=1e-8)
    with pytest.raises(UsageError, match=r"found 'amplifier\.y'"):
        broken_at(spec, "amplifier.y")


def test_a_loop_without_states_has_the_margins_of_its_gain():
    """Where an end of a margin leaves the direct terms without a solution, the frequency is that of the margin."""
    block = {"g": {"type": "gain", "k": 0.5}, "h": {"type": "gain"}}
    for L, every in ((0.5, 1), (-0.5, 1), (0.5, 2)):
        slow = {"h": {"type": "delay", "steps": 0, "every": every}} if every > 1 else {}
        spec = load({"rates": {"tick_hz": 10}, "block": block | slow, "wire": {"g.u": "h.y", "h.u": f"{-2 * L}*g.y"}})
        broken = broken_at(spec, "h.y")
        found = {each.name: each.value for each in margins_of(broken)[0]}
        assert found["sensitivity"] == pytest.approx(1 / (1 + L), rel=1e-8)
        assert found["complementary"] == pytest.approx(abs(L / (1 + L)), rel=1e-8)
        assert found["disk"] == pytest.approx(2 * min(1, abs((1 + L) / (1 - L))), rel=1e-6)
        assert (lines_at(broken, margins_of(broken)[0]) >= 0).any()


OF_TWO = np.array(
    [-np.exp(-1j * np.pi / 3), 0.5 + 0.5j, 1e-9]
)  # eigenvalues of a return ratio; the last is of what nobody reads


@pytest.mark.parametrize(
    ("name", "value", "L"),
    [
        ("phase", 60.0, OF_TWO[0]),
        ("phase", 135.0, OF_TWO[1]),
        ("sensitivity", 9.0, OF_TWO[0]),
        ("complementary", 9.0, OF_TWO[0]),
        ("disk", 9.0, OF_TWO[0]),
        ("gain_up", 2.5, -1 / 2.5),
    ],
)
def test_the_factor_of_a_margin_puts_the_eigenvalue_that_sets_it_at_minus_one(name, value, L):
    broken = SimpleNamespace(period=0.1, response=lambda theta: OF_TWO if theta == 2.0 else OF_TWO[2:])
    assert factor_at(name, value, 20.0, broken) == pytest.approx(-1 / L)
    assert factor_at(name, value, np.nan, broken) is None
    if name != "gain_up":
        assert factor_at(name, value, 1.0, broken) is None  # nothing comes back


def test_a_loop_is_cut_first_at_a_rare_signal_of_a_controller_that_a_plant_reads():
    """And no more often than 200 times in a frame."""
    block = {"plant": {"type": "tf", "num": [1], "den": [1, 1]}, "fast": {"type": "gain"}, "slow": {"type": "hold", "every": 4}}
    block |= {"filter": {"type": "lowpass", "cutoff_hz": 1}, "shown": {"type": "gain"}}
    wire = {
        "plant.u": "fast.y + slow.y",
        "fast.u": "-filter.y",
        "slow.u": "-plant.y",
        "filter.u": "plant.y",
        "shown.u": "fast.y",
    }
    spec = {"rates": {"tick_hz": 10}, "block": block, "wire": wire}
    unheard = {"fast.u": "-filter.y + 0*shown.y", "plant.u": "slow.y"}
    with pytest.raises(UsageError, match="which does not come back to itself"):
        broken_at(load(spec | {"wire": wire | unheard}), "shown.y")
    assert cuts_of(load(spec)) == ["slow.y", "fast.y", "filter.y", "plant.y"]
    spec["block"]["slow"]["every"] = 201
    assert cuts_of(load(spec)) == ["slow.y"]
    with pytest.raises(UsageError, match=r"made at most 200 times in a frame, found 'fast.y': 201 times"):
        broken_at(load(spec), "fast.y")


@pytest.mark.parametrize(
    ("text", "clock"), [("slow.y", (4, 1)), ("slow.y + plant.y", (2, 1)), ("other.y + slow.y", (2, 1)), ("plant.y", (2, 1))]
)
def test_a_block_for_a_named_signal_runs_with_what_it_reads_or_else_with_what_reads_it(text, clock):
    block = {"plant": {"type": "tf", "num": [1], "den": [1, 1]}, "slow": {"type": "hold", "every": 4, "phase": 1}}
    block |= {"other": {"type": "hold", "every": 2}, "reader": {"type": "hold", "every": 2, "phase": 1}}
    wire = {"plant.u": "-reader.y", "slow.u": "plant.y", "other.u": "plant.y", "reader.u": "sent"}
    tables = {"rates": {"tick_hz": 10}, "block": block, "wire": wire, "signals": {"sent": text}}
    spec, output = with_block(load(tables), "sent")
    assert output == "cut_at_sent.y"
    own = spec.tables()["block"]["cut_at_sent"]
    assert (own.get("every", 1), own.get("phase", 0)) == clock


def test_a_report_has_a_section_for_each_signal_that_a_spec_asks_about():
    def told(spec, cut=""):
        return [(title, command) for title, command, _ in sections(spec, cut)]

    spec = sampled([1], [1, 1], 10)
    assert told(load(spec)) == [("Margins", "margins {} --cut c.y")]
    assert told(load(spec), "plant.y") == [("Margins", "margins {} --cut plant.y")]
    with pytest.raises(UsageError, match=r"found 'c\.u'"):
        told(load(spec), "c.u")
    spec["block"]["c"]["k"] = "k"
    asked = [{"cut": "plant.y", "Ms": 2.0}, {"cut": "c.y", "Ms": 2.0}]
    both = load(
        spec | {"numbers": {"k": 1.0}, "sweep": {"along": "k", "k": {"start": 0, "stop": 2}, "require": {"margins": asked}}}
    )
    assert told(both) == [(f"Margins at {cut}", f"margins {{}} --cut {cut}") for cut in ("plant.y", "c.y")]


def test_a_family_of_curves_is_drawn_for_several_values_alone(monkeypatch):
    families = []
    monkeypatch.setattr(figure, "margins", lambda _columns, _facts, family: families.append(family))
    monkeypatch.setattr(library, "drawn_into", lambda _ax, draw, **_options: draw())
    spec = sampled([1], [1, 1], 10) | {"numbers": {"k": 1.0}}
    spec["block"]["c"]["k"] = "k"
    for axes in ({}, {"k": [0.5, 2.0]}):
        compiled(load(spec)).plot_margins("c.y", **axes)
    assert [[name for name, _ in family] for family in families] == [[], ["k = 0.5", "k = 2"]]
