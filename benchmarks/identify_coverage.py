"""How often the intervals of `wavesweep identify` contain the truth, and how often a wrong model is called explained.

    PYTHONPATH=. python benchmarks/identify_coverage.py [LOGS [SEED [EFFECT...]]]

Logs come from the simulation, which shares no code with the fit, and those of a resonance from a march of two masses. Mass,
damping, force and the place of the encoder's steps are random. A line for each kind of force and each encoder: the share of
logs whose intervals of 95 % contain mass, damping and delay, and of logs that are explained.
"""

import sys
import time

import numpy as np

import wavesweep
from wavesweep.identification.fit import fitted
from wavesweep.identification.model import Model
from wavesweep.identification.verdict import judged

RATE = 1000.0  # Hz
FORCES, ENCODERS = ("pulse", "chirp", "noise"), (1e-6, 1e-5, 1e-4)


def force_of(kind, source, ticks=2000):
    """A force (N) of random size, per tick."""
    times, size = np.arange(ticks) / RATE, source.uniform(0.5, 2.0)
    if kind == "pulse":
        return np.where((times >= 0.1) & (times < 0.1 + source.uniform(0.03, 0.1)), size, 0.0)
    if kind == "chirp":
        octaves = np.log(60.0) * RATE / ticks  # from 0.5 to 30 Hz
        return size * np.sin(2 * np.pi * 0.5 * np.expm1(octaves * times) / octaves)
    return size * source.standard_normal(ticks)


def moved(mass, damping, force, friction=0.0, spring=0.0):
    """The position (m) at each tick of a device on a table."""
    tables = {
        "controller": {"kind": "dc"},
        "rates": {"fast_hz": RATE},
        "device": {"mass": mass, "damping": damping},
        "operator": {"stiffness": spring},
        "environment": {"K_VE": 0.0, "B_VE": 0.0},
    }
    return wavesweep.compile(tables).simulate(force, friction=friction)["x"].to_numpy()


def two_masses(mass, damping, force, hertz=30.0, share=0.25, ratio=0.03):
    """The same of a device of which a share of the mass hangs on a spring, with a resonance at `hertz`."""
    from scipy.linalg import expm

    one, two = (1 - share) * mass, share * mass
    stiffness = (2 * np.pi * hertz) ** 2 * one * two / mass
    losses = 2 * ratio * stiffness / (2 * np.pi * hertz)
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = 1.0
    A[1] = [-stiffness / one, -(damping + losses) / one, stiffness / one, losses / one, 1 / one]
    A[3] = [stiffness / two, losses / two, -stiffness / two, -losses / two, 0.0]
    step, state, places = expm(A / RATE), np.zeros(5), []
    for push in force:
        places.append(state[0])
        state[4] = push
        state = step @ state
    return np.array(places)


def read(places, resolution, source):
    """What an encoder shows, whose steps begin anywhere."""
    offset = source.uniform()
    return resolution * np.floor(places / resolution + offset + 0.5)


def log_of(kind, resolution, source, effect="none"):
    """Truth (mass in kg, damping in N*s/m, delay in ticks), force and reading of a log, with an effect or without."""
    mass, damping, force = source.uniform(0.03, 0.3), source.uniform(0.2, 3.0), force_of(kind, source)
    if effect == "resonance":
        places = two_masses(mass, damping, force)
    else:
        places = moved(mass, damping, force, friction=0.05 if effect in ("friction", "sliding") else 0.0)
    position = read(places, resolution, source)
    if effect == "late":  # the motors had it two ticks after the log
        force = np.concatenate([force[2:], np.zeros(2)])
    return (mass, damping, 2.0 * (effect == "late")), force, position


MODELS = {
    "none": Model(),
    "sliding": Model(friction=True),
    "friction": Model(),
    "resonance": Model(),
    "late": Model(delay=0.0),
}


def study(effect, kind, resolution, logs, seed=0):
    """Shares of logs whose intervals contain mass, damping and delay, the words for what is missing, and seconds of each."""
    source, inside, missing, started = np.random.default_rng(seed), [], [], time.perf_counter()
    model = MODELS[effect]
    for _ in range(logs):
        truth, force, position = log_of(kind, resolution, source, effect)
        fit = fitted(model, force, position, 1 / RATE, resolution)
        half = dict(zip(fit.model.names, fit.half, strict=True))
        errors = {
            "log_mass": np.log(fit.numbers["mass"] / truth[0]),
            "damping": fit.numbers["damping"] - truth[1],
            "delay": fit.numbers["delay"] - truth[2],
        }
        inside.append([abs(errors[name]) <= half.get(name, np.inf) for name in errors])
        missing.append(judged(fit, force, position, 1 / RATE).missing)
    return np.mean(inside, axis=0), missing, (time.perf_counter() - started) / logs


def main():
    logs = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    effects = sys.argv[3:] or list(MODELS)
    for effect in effects:
        for kind in FORCES:
            for resolution in ENCODERS:
                inside, missing, seconds = study(effect, kind, resolution, logs, seed)
                words = ", ".join(f"{word or 'explained'} {missing.count(word)}" for word in sorted(set(missing)))
                held = (
                    f"mass {inside[0]:.3f}, damping {inside[1]:.3f}, delay {inside[2]:.3f}; "
                    if effect in ("none", "sliding")
                    else ""
                )
                print(f"{effect:9} {kind:5} {resolution:g} m: {held}{words}; {seconds:.2f} s", flush=True)


if __name__ == "__main__":
    main()
