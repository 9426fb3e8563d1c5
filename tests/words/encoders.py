"""What `check` says of encoder, friction and motors at a direct wall, held against a march of the loop tick by tick.

Between two samples device and operator move exactly under a force that is held. A wall takes a sample of position and velocity
once in n ticks, `F = K (x + e) + B v`, with the error e of the encoder; a velocity by difference is of two such readings.
"""

import re
from pathlib import Path

import numpy as np
from words.devices import Device, T
from words.law import said_by, unfolded
from words.sentences import N

from wavesweep.program.spec.writing import as_toml


def drawn(seed):
    """A wall at some share of the stiffest one, and what is known of the hardware."""
    rng = np.random.default_rng(seed)
    n = int(rng.choice([1, 2, 5, 10]))
    device = {"mass": float(np.round(rng.uniform(0.05, 0.3), 3)), "damping": float(np.round(rng.uniform(0.3, 3.0), 3))}
    tables = {
        "rates": {"fast_hz": 1 / T} | ({"ratio": n} if n > 1 else {}),
        "device": {**device, "velocity": str(rng.choice(["exact", "difference"]))},
        "controller": {"kind": "dc-slow" if n > 1 else "dc"},
        "simulate": {
            "resolution": float(np.round(10 ** rng.uniform(-6, -4), 7)),
            "friction": float(np.round(rng.uniform(0.01, 0.2), 3)),
            "max_force": 3.0,
        },
    }
    case = Device(seed, "hardware", tables)
    K = rng.uniform(0.1, 0.4) * case.walls(n, 0.0)[1]
    B = rng.choice([0.0, 0.1]) * device["damping"]
    tables["environment"] = {"K_VE": float(np.round(K, 2)), "B_VE": float(np.round(B, 4))}
    return case, n


def marched(case, n, errors):
    """Force, position and velocity in each tick `(ticks, 3, runs)`, with errors of the encoder `(ticks, runs)`."""
    A, G = case.matrices(1)
    K, B = case.tables["environment"].values()
    differs = case.tables["device"]["velocity"] == "difference"
    state = np.zeros((2, errors.shape[1]))
    before = force = 0.0
    found = []
    for tick, e in enumerate(errors):
        read = state[0] + e
        if tick % n == 0:
            force = K * read + B * ((read - before) / T if differs else state[1])
        found.append((force, *state))
        before = read
        state = A @ state - G * force
    return np.array(found)


def largest(case, n):
    """The largest force after a step of the encoder at any time, and most of force, position and velocity by all errors."""
    K, B = case.tables["environment"].values()
    radius = abs(np.linalg.eigvals(case.frame(n, K, B))).max()
    frames = 10 + int(np.log(1e-6) / np.log(radius))  # what comes later is less than a millionth
    errors = np.zeros((frames * n, n))
    errors[:n] = np.eye(n)
    in_all = np.abs(marched(case, n, errors)).reshape(frames, n, 3, n).sum((0, 3))  # of each tick of a frame
    steps = np.abs(marched(case, n, np.cumsum(errors, axis=0))[:, 0])
    return steps.max(), in_all.max(0)


def hold_encoder(seed):
    """Hold what is said of the hardware; in a folder of its own."""
    case, n = drawn(seed)
    Path("mine.toml").write_text(as_toml(case.tables), encoding="utf-8")
    said = "\n".join(unfolded(said_by("check", "mine.toml", "--all")[2]))

    def numbers(pattern):
        found = re.search(pattern, said)
        assert found, (seed, pattern, said)
        return [float(each) if re.fullmatch(N, each) else each for each in found.groups()]

    resolution, friction, max_force = case.tables["simulate"].values()
    K, B = case.tables["environment"].values()
    step, by_all = largest(case, n)
    told = numbers(rf"encoder: a step of {N} m moves the force by up to {N} N, all rounding by at most {N}")
    told += numbers(rf"rounding moves the device by at most {N} m and {N} m/s")
    true = np.array([resolution, step * resolution, *by_all * resolution / 2])
    assert (true * (1 - 1e-9) <= told).all(), (seed, told, true)
    assert (np.array(told) <= true * (1 + 1.1e-3)).all(), (seed, told, true)
    holds = 2 * friction / resolution
    passive = 2 * case.tables["device"]["damping"] / (n * T)
    rubs, up_to = numbers(rf"friction: {N} N holds against the encoder's steps up to {N} N/m felt")
    assert rubs == friction
    assert holds * (1 - 1e-5) <= up_to <= holds * (1 + 1e-12), (seed, said)
    assert passive * (1 - 1e-5) <= numbers(rf"damping: walls up to {N} N/m without B_VE")[0] <= passive * (1 + 1e-12)
    if B == 0:
        (energy,) = numbers("together: the wall (generates no|may generate) energy")
        assert (energy == "generates no") == (min(holds, passive) >= K), (seed, said)
    assert np.allclose(numbers(rf"pressed {N} m deep, slowly, with their {N} N"), [max_force / K, max_force], rtol=1e-3)
