"""Margins of a loop at a signal that is made several times in a frame, against eigenvalues with the factor put in."""

import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm
from support.drawn import random_tables

import wavesweep
from wavesweep import UsageError, load
from wavesweep.engine._drawing.drawing import path_of
from wavesweep.margins.broken_loops import GAIN, broken_at
from wavesweep.margins.lifted_margins import LiftedLoop, margins_of
from wavesweep.program.sweep.grid import own_loop

CASCADE = Path(__file__).parents[2] / "sweeps" / "recipes" / "cascade.toml"


def radius_of(spec, signal):
    """The spectral radius of the frame with factors k of the signal, from blocks that have it among their numbers."""
    own = own_loop(spec)
    loop = own.with_gain_at(signal)
    drift = loop.changed({path_of(GAIN): np.array([0.5, 2.0])}).drift()

    def radius(k):
        E = loop.changed({path_of(GAIN): np.atleast_1d(k)}).frames(drift)
        return np.abs(1 + np.linalg.eigvals(E)).max(-1)

    return radius


def agrees(spec, signal, found, seed=0):
    """How many margins have a limit: at it an eigenvalue is on the circle, and factors within the margins are stable."""
    radius, rng, ends = radius_of(spec, signal), np.random.default_rng(seed), 0
    each = {margin.name: margin for margin in found}
    up, down = each["gain_up"].value, max(each["gain_down"].value, 1e-6)
    turn, a = np.radians(each["phase"].value), each["disk"].value
    disk = np.sqrt(rng.random(300)) * np.exp(2j * np.pi * rng.random(300)) * a / 2 * (1 - 1e-7)
    assert (radius(np.exp(rng.uniform(np.log(down), np.log(up), 200) * (1 - 1e-9))) < 1).all()
    assert (radius(np.exp(1j * rng.uniform(-turn, turn, 200) * (1 - 1e-8))) < 1).all()
    assert (radius((1 + disk) / (1 - disk)) < 1).all()
    if each["gain_up"].limited:
        assert radius(up) == pytest.approx(1, abs=1e-7)
        assert radius(up * (1 + 1e-6)) > 1
        ends += 1
    if each["gain_down"].limited:
        assert radius(down) == pytest.approx(1, abs=1e-7)
        assert radius(down * (1 - 1e-6)) > 1
        ends += 1
    if each["phase"].limited:
        assert radius(np.exp(1j * turn)) == pytest.approx(1, abs=1e-7)
        assert radius(np.exp(1j * turn * (1 + 1e-6))) > 1
        ends += 1
    rim = a / 2 * (1 + 1e-6) * np.exp(1j * np.linspace(0, np.pi, 4001))
    assert (radius((1 + rim) / (1 - rim)) > 1 - 1e-9).any() or a == 2
    return ends


def test_a_signal_that_is_made_five_times_in_a_frame_has_margins():
    """The inner loop of a cascade: its gain margins are the ends of the stable interval along its gain."""
    spec = load(CASCADE)
    loop = broken_at(spec, "speed.y")
    found, doubt = margins_of(loop)
    assert (type(loop), loop.times, doubt) == (LiftedLoop, 5, 0)
    each = {margin.name: margin for margin in found}
    assert not any(margin.doubt for margin in found)
    (row,) = wavesweep.compile(spec).stable_intervals("k", (0.1, 20000)).itertuples()
    assert each["gain_up"].value == pytest.approx(row.high / 100, rel=1e-9)
    assert each["gain_down"].value == pytest.approx(row.low / 100, rel=1e-9)
    assert agrees(spec, "speed.y", found) == 3
    assert each["disk_gain"].value < each["gain_up"].value
    assert each["disk_phase"].value < each["phase"].value
    assert "delay_frames" not in each


@pytest.mark.slow
@pytest.mark.asks("simulation")
@pytest.mark.parametrize("changes", [["J=0.02", "kp=10", "ki=500", "kv=50"], []])
def test_three_integrators_hide_no_small_eigenvalue_of_the_return_ratio(changes):
    """A servo drive: at low frequencies L has an eigenvalue beyond 1e16 next to others of size 1.

    As it is shipped, doubles leave a stretch of the gain in doubt, which balls prove.
    """
    spec = load(CASCADE.parents[1] / "templates/position-loop.toml", changes)
    found, doubt = margins_of(broken_at(spec, "speed.y"))
    assert (agrees(spec, "speed.y", found), doubt) == (3, 0)


def test_a_gain_margin_beside_a_slower_loop_has_a_frequency_up_to_half_the_rate_of_the_frame():
    """A loop at 1 kHz oscillates at 699 rad/s; a loop of its own at 50 Hz makes frames of 20 ms, in which it is an alias."""
    fast = {
        "rates": {"tick_hz": 1000},
        "block": {"p": {"type": "tf", "num": [2], "den": [1e-6, 0.002, 1, 0]}, "c": {"type": "gain"}},
        "wire": {"p.u": "c.y", "c.u": "-p.y"},
    }
    slow = {"q": {"type": "tf", "num": [3.0], "den": [1, 0]}, "s": {"type": "hold", "every": 20}}
    both = fast | {"block": fast["block"] | slow, "wire": fast["wire"] | {"q.u": "s.y", "s.u": "-q.y"}}
    alone, beside = (margins_of(broken_at(load(tables), "c.y"))[0][0] for tables in (fast, both))
    assert beside.value == pytest.approx(alone.value, rel=1e-9)
    rate = 2 * np.pi * 50
    assert alone.omega > rate / 2
    assert beside.omega == pytest.approx(abs(alone.omega - 2 * rate), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_random_loops_are_stable_within_their_margins(seed):
    """Every signal of a random loop that is made more than once in a frame."""
    spec, met = load(random_tables(seed)), 0
    drawing = own_loop(spec).drawing
    for signal in sorted({source for _, terms in drawing.wires for source, _ in terms if "." in source}):
        try:
            loop = broken_at(spec, signal)
        except UsageError:
            continue
        found, _ = margins_of(loop)
        if isinstance(loop, LiftedLoop) and found and not any(margin.doubt for margin in found):
            met += agrees(spec, signal, found, seed)
    assert met > 0


@pytest.mark.asks("simulation")
def test_a_loop_is_broken_at_what_a_plant_of_several_blocks_shows():
    """As at a block that samples it, and at the torque, the loop being one; between two ticks it cannot be broken."""
    path = Path(__file__).parents[2] / "sweeps" / "templates" / "two-mass.toml"
    tables = load(path).tables()
    block, wire = tables["block"] | {"sample": {"type": "hold"}}, tables["wire"] | {"sample.u": "motor.v"}
    sampled = tables | {"block": block, "wire": wire | {"control.u": "ref - sample.y"}}
    at = {"motor.v": tables, "sample.y": sampled, "notch.y": tables}
    found = {signal: wavesweep.compile(each).margins(signal) for signal, each in at.items()}
    found = {signal: each[~each["margin"].str.startswith("delay")] for signal, each in found.items()}
    for signal in ("sample.y", "notch.y"):
        np.testing.assert_allclose(found["motor.v"].value, found[signal].value, rtol=1e-9)
    assert found["motor.v"].certified.all()
    with pytest.raises(UsageError, match=r"found 'motor\.v'"):
        wavesweep.compile(tables | {"wire": tables["wire"] | {"torque.u": "notch.y - 1e-3*motor.v"}}).margins("motor.v")


INTEGRATOR = """
[rates]
tick_hz = 1000
[block.plant]
type = "tf"
num = [1]
den = [1, 0]
[block.late]
type = "delay"
[block.seldom]
type = "hold"
every = {every}
[wire]
"late.u" = "plant.y"
"seldom.u" = "plant.y"
"plant.u" = "-700*late.y - 1e-7*seldom.y"
"""


def test_the_frequency_of_a_margin_is_the_line_that_a_spectrum_shows():
    """A block that hardly acts makes a frame of ten ticks; without it nothing is folded."""
    from wavesweep.margins.table import margins

    alone, lifted = (margins(load(tomllib.loads(INTEGRATOR.format(every=n))), "late.y").columns for n in (1, 10))
    own = {name: (omega, hz) for name, omega, hz in zip(*(alone[name] for name in ("margin", "omega", "hz")), strict=True)}
    folded = []
    for name, omega, hz in zip(*(lifted[name] for name in ("margin", "omega", "hz")), strict=True):
        assert hz == pytest.approx(own[name][0] / (2 * np.pi), rel=1e-4, nan_ok=True), name
        assert own[name][1] == pytest.approx(own[name][0] / (2 * np.pi), rel=1e-9, nan_ok=True), name
        folded += [name] if omega / (2 * np.pi) < 0.9 * hz else []
    assert folded == ["gain_up", "phase", "disk", "disk_gain", "disk_phase", "sensitivity", "complementary"]


def two_rates(slow):
    """A loop at 1 kHz with a PI controller, and around it a slower one over a second lag; `slow`: its gain."""
    return load(
        {
            "rates": {"tick_hz": 1000},
            "numbers": {"g": slow, "kp": 0.8, "ki": 20.0},
            "block": {
                "lag": {"type": "tf", "num": [1], "den": [0.01, 1]},
                "far": {"type": "tf", "num": [1], "den": [0.02, 1]},
                "c": {"type": "pi", "kp": "kp", "ki": "ki"},
                "outer": {"type": "gain", "k": "g", "every": 4},
            },
            "wire": {"outer.u": "-far.y", "c.u": "outer.y - lag.y", "lag.u": "c.y", "far.u": "lag.y"},
        }
    )


@pytest.mark.parametrize("cycles", [3, 41, 97])  # in 200 ticks, so that 41 and 97 are above half the rate of the frame
def test_at_its_own_rate_a_signal_has_the_response_that_a_sine_shows(cycles):
    """Tick by tick, with the loop cut at the controller's output: what comes back, at the frequency of the sine."""
    state, held, total, back = np.zeros(2, complex), 0.0, 0.0, []
    whole = expm(1e-3 * np.array([[-100, 0, 100], [50, -50, 0], [0, 0, 0]]))  # both lags, and the force that is held
    sine = np.exp(2j * np.pi * cycles / 200 * np.arange(1200))
    for tick, pushed in enumerate(sine):
        held = -5.0 * state[1] if tick % 4 == 0 else held
        total += 20e-3 * (held - state[0])
        back.append(0.8 * (held - state[0]) + total)
        state = whole[:2, :2] @ state + whole[:2, 2] * pushed
    last = slice(1000, 1200)
    mean, drift = np.mean(np.conj(sine[last]) * np.array(back)[last]), np.ptp(np.abs(np.array(back[-200:]) - back[-400:-200]))
    assert drift < 1e-9
    loop = broken_at(two_rates(5.0), "c.y")
    found = loop.at_line(2 * np.pi * cycles / 200 * 4)
    assert -mean == pytest.approx(found, rel=1e-7)
    assert np.abs(loop.response(2 * np.pi * cycles / 200 * 4) - found).min() > 5e-5 * abs(found)  # and is no eigenvalue


UNREAD = """
[rates]
tick_hz = 100
[block.plant]
type = "tf"
num = [2.37]
den = [1, 1.1, 2.37]
[block.rate]
type = "difference"
[block.sample]
type = "hold"
every = 4
[wire]
"rate.u" = "plant.y"
"sample.u" = "rate.y"
"plant.u" = "-4.0*sample.y"
"""


def test_a_signal_whose_samples_are_not_all_read_has_the_margins_of_what_reads_it():
    """One factor on what is made in every tick, and on the sample of every fourth that alone reads it, is the same factor."""
    loop = wavesweep.compile(tomllib.loads(UNREAD))
    often, seldom = (loop.margins(cut).set_index("margin") for cut in ("rate.y", "sample.y"))
    for name in ("gain_up", "gain_down", "phase", "disk"):
        assert often["value"][name] == pytest.approx(seldom["value"][name], rel=1e-7), name
        assert often["hz"][name] == pytest.approx(seldom["hz"][name], rel=1e-6, nan_ok=True), name


def peaks_on_a_grid(loop):
    """The largest singular values of S and S - 1, from H at 4000 angles and near the largest one."""
    E, T, O, G = (part[0] for part in (loop.returned.E, loop.returned.T, loop.returned.O, loop.returned.G))

    def sizes(theta, less):
        H = T + O @ np.linalg.solve((np.exp(1j * theta) - 1)[:, None, None] * np.eye(len(E)) - E, G + 0j)
        return np.linalg.norm(np.linalg.inv(np.eye(len(T)) - H) - less * np.eye(len(T)), 2, (-2, -1))

    found = []
    for less in (0, 1):
        theta = np.concatenate([np.geomspace(1e-4, 0.1, 1000), np.linspace(0.1, np.pi, 3000)])
        for _ in range(4):
            size = sizes(theta, less)
            best = int(np.argmax(size))
            theta = np.linspace(theta[max(best - 1, 0)], theta[min(best + 1, len(theta) - 1)], 1000)
        found.append((size[best], theta[0]))
    return found


DRIFTS = [  # a position that nothing opposes with Kp = 0, by constant factors, or by factors that the signal changes
    ("command.y", {"rates": {"ratio": 5}, "device": {"velocity": "difference", "dead_time": 0.0009}}, []),
    ("lp1.y", {"rates": {"ratio": 5}, "device": {"velocity": "difference"}}, ["controller.kind=pmw-mean"]),
    ("encoder.out", {"rates": {"ratio": 5}, "device": {"velocity": "difference"}}, ["controller.kind=pmw-lm"]),
    ("device.x", {"rates": {"ratio": 5}, "device": {"velocity": "difference"}}, ["controller.kind=pmw-mean"]),
]


@pytest.mark.slow
@pytest.mark.parametrize(("signal", "tables", "changes"), DRIFTS)
def test_what_drifts_hides_no_peak(signal, tables, changes):
    tables = tables | {"environment": {"K_VE": 70, "B_VE": 4, "delay": 5}, "controller": {"kind": "pmw", "b": 3}}
    loop = broken_at(load(tables | {"filters": {"lp1": {"order": 0}}}, changes), signal)
    found = {margin.name: margin for margin in margins_of(loop)[0]}
    for name, (size, theta) in zip(("sensitivity", "complementary"), peaks_on_a_grid(loop), strict=True):
        assert found[name].value == pytest.approx(size, rel=1e-6 if theta < 2e-4 else 1e-9), name
        assert not found[name].doubt
    if signal == "command.y":
        assert [round(found[name].value, 6) for name in ("sensitivity", "complementary")] == [1.100277, 1.001291]
        assert [round(found[name].omega, 1) for name in ("sensitivity", "complementary")] == [146.3, 6.1]


@pytest.mark.slow
def test_a_signal_that_moves_what_drifts_has_peaks_without_a_limit_and_a_disk_that_is_met():
    tables = {"rates": {"ratio": 5}, "device": {"velocity": "difference"}, "environment": {"K_VE": 0, "B_VE": 4, "delay": 5}}
    spec = load(tables | {"controller": {"kind": "dc-slow"}})
    found = {margin.name: margin for margin in margins_of(broken_at(spec, "device.x"))[0]}
    assert not any(found[name].limited for name in ("sensitivity", "complementary"))
    assert found["disk"].value == pytest.approx(1.23757105, rel=1e-8)
    agrees(spec, "device.x", found.values())


def test_the_error_of_a_response_is_that_of_entries_that_are_off_by_all_they_may_be():
    r = np.random.default_rng(3)
    E, B, C, D = (r.normal(size=shape) for shape in ((2, 2), (2, 1), (1, 2), (1, 1)))
    sizes = [size * r.uniform(0.5, 1.0, each.shape) for size, each in zip((1e-7, 1e-6, 1e-6, 1e-5), (E, B, C, D), strict=True)]
    cut = SimpleNamespace(with_integrator=lambda: (E, B, C, D), errors_with_integrator=lambda: sizes, dD=sizes[3])
    returned = SimpleNamespace(T=D[None])
    slope, error = LiftedLoop.slope_and_error(SimpleNamespace(cut=cut, returned=returned), 0.8)

    def L(theta, E, B, C, D):
        return -(C @ np.linalg.solve((np.exp(1j * theta) - 1) * np.eye(2) - E, B) + D).item()

    assert slope == pytest.approx((L(0.8 + 1e-6, E, B, C, D) - L(0.8 - 1e-6, E, B, C, D)) / 2e-6, rel=1e-6)
    moved = [
        [each + size * r.choice([-1, 1], size.shape) for each, size in zip((E, B, C, D), sizes, strict=True)]
        for _ in range(300)
    ]
    most = max(abs(L(0.8, *each) - L(0.8, E, B, C, D)) for each in moved)
    assert 0.7 * error < most <= error * (1 + 1e-4)
