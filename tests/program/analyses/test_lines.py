"""Which frequency an oscillation shows within the frame, against the spectrum of a simulation just beyond the end."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine._search.lines_of_loops import lines_of
from wavesweep.program.analyses.poles import poles

RATES = {"drive": 8000.0, "wall": 1000.0}
STATES = {"drive": ["mv", "mx", "lv", "lx"], "wall": ["x", "v"]}
BEYOND = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4)  # of an end: how far beyond it the loop is simulated, whatever grows as it should


def drive(n, m, **numbers):
    """Two inertias with a shaft, a speed controller in every m-th tick and a position controller in every n-th."""
    return {
        "rates": {"tick_hz": RATES["drive"]},
        "numbers": {"kp": 20.0, "kv": 0.3, "ks": 3000.0, "n": n, "m": m} | numbers,
        "block": {
            "motor": {"type": "inertia", "inertia": 0.001, "damping": 0.002},
            "load": {"type": "inertia", "inertia": 0.0015, "damping": 0.002},
            "shaft": {"type": "spring", "k": "ks", "d": 0.01},
            "position": {"type": "gain", "k": "kp", "every": "n"},
            "speed": {"type": "gain", "k": "kv", "every": "m"},
        },
        "wire": {
            "shaft.x1": "motor.x",
            "shaft.x2": "load.x",
            "shaft.v1": "motor.v",
            "shaft.v2": "load.v",
            "motor.f": "speed.y + shaft.f1 + push",
            "load.f": "shaft.f2",
            "position.u": "-motor.x",
            "speed.u": "position.y - motor.v",
        },
        "ports": {
            "inputs": {"push": "push"},
            "outputs": {"mv": "motor.v", "mx": "motor.x", "lv": "load.v", "lx": "load.x"},
        },
    }


def wall(kind, ratio, mass=0.1, stiffness=0.0, velocity="exact", integration="implicit", B_VE=1.0, damping=1.5, **more):
    """A device and a wall. more: of `[controller]`."""
    return {
        "rates": {"ratio": ratio},
        "device": {"mass": mass, "damping": damping, "velocity": velocity},
        "operator": {"stiffness": stiffness},
        "environment": {"K_VE": 100.0, "B_VE": B_VE, "integration": integration},
        "controller": {"kind": kind, **more},
    }


def strongest(tables, along, end, kind):
    """The strongest line (Hz) just beyond an end, of states whose spectra are given equal energy, and the resolution."""
    duration = {"drive": 1.0, "wall": 6.0}[kind]
    pushed = {"input": "pulse", "at_s": 0.0, "width_s": 0.004, "duration_s": duration, "amplitude": 1e-9}
    pushed |= {"from": "push"} if kind == "drive" else {}
    for beyond in BEYOND:
        spec = wavesweep.load(tables | {"simulate": pushed}, [f"{along}={float(end) * (1 + beyond)!r}"])
        (run,) = wavesweep.simulate(spec)
        moved = run[STATES[kind]].to_numpy()
        if len(moved) == round(duration * RATES[kind]) and np.abs(moved).max() < 1e12 * np.abs(moved[:200]).max():
            break
    moved = moved[len(moved) // 2 :]
    window = np.hanning(len(moved))[:, None]
    energy = np.abs(np.fft.rfft((moved - moved.mean(0)) * window, axis=0)) ** 2
    line = (energy / energy.sum(0)).sum(1)
    line = np.convolve(line, np.ones(3), "same")  # the window has three
    return np.argmax(line) * RATES[kind] / len(moved), RATES[kind] / len(moved)


@pytest.mark.whole
@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "tables", "along", "span"),
    [
        ("drive", drive(16, 2), "kv", (0.001, 20)),
        ("wall", wall("dc-slow", 10, 0.0095, 1e5, "difference", "trapezoidal", 0.0, 0.017), "K_VE", (0, 1e5)),
        ("wall", wall("pmw-lm", 20, b=25.0, Kp=20.0), "Kp", (0, 7e3)),
    ],
)
def test_an_end_has_the_frequency_that_a_spectrum_of_a_simulation_shows(kind, tables, along, span):
    rows = wavesweep.compile(tables).stable_intervals(along, span)
    row = rows[rows.high_omega.notna()].iloc[0]
    found, resolution = strongest(tables, along, row.high, kind)
    assert abs(row.high_hz - row.high_omega / (2 * np.pi)) > 5 * resolution  # an image
    assert row.high_hz == pytest.approx(found, abs=2.5 * resolution)


@pytest.mark.parametrize("ticks", [7, 8])
def test_shares_of_lines_are_means_over_states_in_any_units(ticks):
    s, at = np.array([np.log(1.5) + 0.4j]), np.arange(ticks)
    line = np.exp((s + 2j * np.pi * np.arange(3)[:, None]) * at / ticks)  # of 0, 1 and 2 turns per frame
    mixed = np.sqrt(0.9) * line[2] + np.sqrt(0.1) * line[0]
    base, second = 0.4 / (2 * np.pi) / 0.02, (0.4 / (2 * np.pi) + 2) / 0.02
    assert lines_of(np.stack([mixed, 1e6 * line[0]])[None], s, np.array([0.02]))[0] == pytest.approx(
        [base, second]
    )  # 0.55, 0.45
    assert lines_of(mixed[None, None], s, np.array([0.02]))[0] == pytest.approx([second, np.nan], nan_ok=True)


@pytest.mark.whole
@pytest.mark.slow
def test_two_lines_are_told_of_a_mode_that_position_and_velocity_show_at_different_ones():
    tables = wall("pmw", 20, velocity="difference", b=202.4)
    first = poles(wavesweep.load(tables))
    (run,) = wavesweep.simulate(tables | {"simulate": {"input": "pulse", "duration_s": 12.0, "amplitude": 1e-9}})
    shown = []
    for name in STATES["wall"]:
        moved = run[name].to_numpy()[4000:]
        energy = np.abs(np.fft.rfft((moved - moved.mean()) * np.hanning(len(moved))))
        shown.append(np.argmax(energy) * RATES["wall"] / len(moved))
    assert sorted(shown) == pytest.approx(sorted([first["shown_hz"][0], first["second_hz"][0]]), abs=0.3)
    assert max(shown) > 100 * min(shown)
