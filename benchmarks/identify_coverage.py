"""How often the intervals of `wavesweep identify` contain the truth, and how often a wrong model is called explained.

    PYTHONPATH=. python benchmarks/identify_coverage.py [LOGS [SEED [KIND...]]]
    PYTHONPATH=. python benchmarks/identify_coverage.py LOGS SEED beside SECONDS FILE MINUTES [KIND...]

The second form is of logs on which more acts than they say (`simulated_logs.py`): Coulomb friction, a Stribeck curve, a
drift, a hand, two masses with and without a drift, and curves of the motion ("drag, of velocity", "saturating, of position");
of 1e-4 to 100 kg, with encoders of 1e-4 to 1e-8 m, 0 to 4 ticks late. It takes the kinds in turn, a log of each, keeps what it
found in a file of JSON lines, and goes on from there if it is called again; after so many minutes it stops. MINUTES 0 prints
what a file has.

Logs come from marches in this file, which share no code with the fit: mass, damping, force, delay (a fraction of a tick, too),
the speed at the start, the encoder and the place of its steps are random, and so is the force before the first row. A line
for each kind of log: the share of logs whose intervals of 95 % contain mass, damping, delay and friction, half the width
of the interval of the mass over the mass (median), what was called missing, and the seconds of a log. From `euler` on the kinds
are those that the model does not explain, held against the same truth.
"""

import json
import sys
import time
from dataclasses import replace
from itertools import product
from math import exp, log
from pathlib import Path

import numpy as np
from simulated_logs import CURVES, of_curves, of_one_mass, of_two_masses
from simulated_logs import KINDS as SIMULATED

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.identification.explained import identified
from wavesweep.identification.model import Model

RATE = 1000.0  # Hz
FORCES = ("pulse", "chirp", "noise", "steps")
BEFORE = 10  # ticks of force before the first row
NUMBERS = ("mass", "damping", "delay", "friction", "load_mass", "load_damping", "coupling_stiffness", "coupling_damping")
LOGARITHMS = {"mass": "log_mass", "load_mass": "log_load", "coupling_stiffness": "log_coupling"}

# Rows, errors beside rounding (deviation in steps of the encoder, correlation of neighbours), what is special.
KINDS = {
    "quantised": (1000, 0.0, 0.0, ""),
    "noise of 0.005 q": (1000, 0.005, 0.0, ""),
    "noise of 0.03 q": (1000, 0.03, 0.0, ""),
    "noise of 0.1 q": (1000, 0.1, 0.0, ""),
    "noise of 0.3 q": (1000, 0.3, 0.0, ""),
    "white": (1000, 1.0, 0.0, ""),
    "white, no encoder": (1000, 1.0, 0.0, "unrounded"),
    "coloured 0.95": (1000, 1.0, 0.95, ""),
    "coloured 0.99": (1000, 1.0, 0.99, ""),
    "one wild reading": (1000, 0.0, 0.0, "wild"),
    "spring": (1000, 0.0, 0.0, "spring"),
    "friction": (1000, 0.0, 0.0, "sliding"),
    "friction, white": (1000, 1.0, 0.0, "sliding"),
    "velocity": (1000, 0.0, 0.0, "velocity"),
    "velocity, white": (1000, 1.0, 0.0, "velocity"),
    "velocity, coloured": (1000, 1.0, 0.95, "velocity"),
    "velocity, friction": (1000, 1.0, 0.0, "velocity sliding"),
    "velocity, spring": (1000, 1.0, 0.0, "velocity spring"),
    "acceleration": (1000, 0.0, 0.0, "acceleration"),
    "acceleration, white": (1000, 1.0, 0.0, "acceleration"),
    "acceleration, spring": (1000, 1.0, 0.0, "acceleration spring"),
    "acceleration, instant": (1000, 1.0, 0.0, "acceleration at an instant"),
    "10^4 acceleration": (10_000, 3.0, 0.0, "acceleration"),
    "coupled": (2000, 1.0, 0.0, "coupled"),
    "coupled, coloured 0.95": (2000, 1.0, 0.95, "coupled"),
    "coupled, velocity": (2000, 1.0, 0.0, "coupled velocity"),
    "300 quantised": (300, 0.0, 0.0, ""),
    "300 white": (300, 1.0, 0.0, ""),
    "300 coloured 0.95": (300, 1.0, 0.95, ""),
    "10^4 quantised": (10_000, 0.0, 0.0, ""),
    "10^4 white": (10_000, 1.0, 0.0, ""),
    "10^4 coloured 0.95": (10_000, 1.0, 0.95, ""),
    "10^5 quantised": (100_000, 0.0, 0.0, ""),
    "10^5 white": (100_000, 1.0, 0.0, ""),
    "10^5 coloured 0.95": (100_000, 1.0, 0.95, ""),
    "10^6 quantised": (1_000_000, 0.0, 0.0, ""),
    "10^6 white": (1_000_000, 1.0, 0.0, ""),
    "euler": (1000, 0.0, 0.0, "euler"),
    "two masses, 30 Hz": (1000, 0.0, 0.0, "two masses 30"),
    "two masses, 120 Hz": (1000, 0.0, 0.0, "two masses 120"),
    "bad encoder": (1000, 0.0, 0.0, "bad encoder"),
    "saturation": (1000, 0.0, 0.0, "saturation"),
    "friction left out": (1000, 0.0, 0.0, "rubbing"),
    "delay held at 0": (1000, 0.0, 0.0, "held"),
}


def force_of(kind, source, ticks=2000):
    """A force (N) of random size, per tick, with that of the ticks before."""
    times, size = np.arange(-BEFORE, ticks) / RATE, source.uniform(0.5, 2.0)
    if kind == "pulse":
        return np.where((times >= 0.1) & (times < 0.1 + source.uniform(0.03, 0.1)), size, 0.0)
    if kind in ("chirp", "sweep"):
        octaves = np.log(60.0 if kind == "chirp" else 300.0) * RATE / ticks  # from 0.5 to 30 Hz, or to 150 Hz
        return size * np.sin(2 * np.pi * (0.5 * np.expm1(octaves * times) / octaves + source.uniform()))
    if kind == "steps":
        return size * np.repeat(source.uniform(-1, 1, len(times) // 60 + 1), 60)[: len(times)]
    return size * source.standard_normal(len(times))


def moved(mass, damping, force, friction=0.0, spring=0.0):
    """The position (m) at each tick of a device on a table, from rest, by the simulation."""
    tables = {
        "controller": {"kind": "dc"},
        "rates": {"fast_hz": RATE},
        "device": {"mass": mass, "damping": damping},
        "operator": {"stiffness": spring},
        "environment": {"K_VE": 0.0, "B_VE": 0.0},
    }
    return wavesweep.compile(tables).simulate(force, friction=friction)["x"].to_numpy()


def marched(mass, damping, force, late=0.0, velocity=0.0, friction=0.0, measured="position"):
    """The position (m), or velocity, at each tick by the solution of m v' = f - d v - F sgn v from one change to the next."""
    whole, part = divmod(late, 1.0)
    now, rate, x, v, places = np.concatenate([np.full(int(whole) + 1, force[0]), force]), damping / mass, 0.0, velocity, []
    for tick in range(len(force)):
        places.append(x if measured == "position" else v)
        for push, seconds in ((now[tick], part / RATE), (now[tick + 1], (1 - part) / RATE)):
            left = seconds
            while left > 0 and (v or abs(push) > friction):
                end = (push - (friction if (v or push) > 0 else -friction)) / damping
                stop = log(1 - v / end) / rate if v * end < 0 else left
                t = min(stop, left)
                x += end * t + (v - end) * (1 - exp(-rate * t)) / rate
                v, left = 0.0 if stop <= t < left else end + (v - end) * exp(-rate * t), left - t
    return np.array(places)


def euler(mass, damping, force, velocity):
    """The same by Euler's rule."""
    x, v, places = 0.0, velocity, []
    for push in force:
        places.append(x)
        x, v = x + v / RATE, v + (push - damping * v) / mass / RATE
    return np.array(places)


def linear(A, push, force, late, state, row=0):
    """A state at each tick of x' = A x + push f, the first one, with the force a part of a tick late."""
    from scipy.linalg import expm

    size, (whole, part) = len(A), divmod(late, 1.0)
    wide = np.zeros((size + 1, size + 1))
    wide[:size, :size], wide[:size, size] = A, push
    now, steps = np.concatenate([np.full(int(whole) + 1, force[0]), force]), [expm(wide * s / RATE) for s in (part, 1 - part)]
    state, places = np.append(state, 0.0), []
    for tick in range(len(force)):
        places.append(state[row])
        for at, step in enumerate(steps):
            state[size] = now[tick + at]
            state = step @ state
    return np.array(places)


def two_masses(mass, damping, force, hertz=30.0, late=0.0, share=0.25, ratio=0.03):
    """The same of a device of which a share of the mass hangs on a spring, with a resonance at `hertz`."""
    one, two = (1 - share) * mass, share * mass
    stiffness = (2 * np.pi * hertz) ** 2 * one * two / mass
    losses = 2 * ratio * stiffness / (2 * np.pi * hertz)
    return coupled(one, damping, two, 0.0, stiffness, losses, force, late)


def coupled(one, damping, two, drag, stiffness, losses, force, late=0.0, velocity=0.0, measured="position"):
    """The same of two masses on a spring with losses, both of which begin with a velocity, at the side of the force."""
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1.0
    A[1] = [-stiffness / one, -(damping + losses) / one, stiffness / one, losses / one]
    A[3] = [stiffness / two, losses / two, -stiffness / two, -(drag + losses) / two]
    return linear(A, [0, 1 / one, 0, 0], force, late, np.array([0, velocity, 0, velocity]), int(measured != "position"))


def drive(source):
    """Numbers of two masses: a resonance of 10 to 80 Hz, damped by 1 to 10 %, of a load of 0.3 to 5 times the motor."""
    one, share = source.uniform(0.03, 0.3), np.exp(source.uniform(*np.log([0.3, 5])))
    rate, turn, ratio = source.uniform(1, 10), *np.exp(source.uniform(*np.log([[20 * np.pi, 0.01], [160 * np.pi, 0.1]])))
    both = one * share / (1 + share)
    damping, drag = rate * one * np.array([1, share]) * source.uniform(0.2, 2, 2)
    return (one, damping, one * share, drag, turn**2 * both, 2 * ratio * turn * both)


def read(places, resolution, source):
    """What an encoder shows, whose steps begin anywhere."""
    offset = source.uniform()
    return resolution * np.floor(places / resolution + offset + 0.5)


def log_of(kind, source, force_kind):
    """Truth by names, force (N), reading (m), step of the encoder (m), and the model that is fitted."""
    rows, deviation, colour, special = KINDS[kind]
    mass, damping, late = source.uniform(0.03, 0.3), source.uniform(0.2, 2.0), source.choice([0, 2, source.uniform(0, 6)])
    force, velocity = force_of(force_kind, source, rows), source.choice([0.0, source.uniform(-0.2, 0.2)])
    friction = 0.1 * np.abs(force).max() if special.endswith(("sliding", "rubbing")) else 0.0
    sensor = next((name for name in ("velocity", "acceleration") if name in special), "position")
    felt = np.clip(force, *(np.array([-0.7, 0.7]) * np.abs(force).max())) if special == "saturation" else force
    load = {}
    if special.startswith("coupled"):
        numbers, force = drive(source), force_of("sweep", source, rows) if force_kind == "chirp" else force
        places = coupled(*numbers, force, late, 0.25 * velocity, sensor)
        mass, damping, *rest = numbers
        load = dict(zip(NUMBERS[4:], rest, strict=True))
    elif special.startswith("two"):
        places = two_masses(mass, damping, felt, float(special.split()[-1]), late)
    elif special == "euler":
        places, late = euler(mass, damping, felt, velocity), 0.5  # the delay that its rule amounts to
    elif special.endswith("spring"):
        A = np.array([[0, 1], [-40 / mass, -damping / mass]])
        places = linear(A, [0, 1 / mass], felt, late, [0.0, velocity], int(sensor != "position"))
    else:
        places = marched(mass, damping, felt, late, velocity, friction, sensor)
    if special.endswith("instant"):  # just before the force changes, with an offset
        before = felt[np.clip(np.arange(len(felt)) - int(late) - 1, 0, None)]
        places = (before - damping * places) / mass + source.uniform(-0.3, 0.3)
    elif sensor == "acceleration":  # the mean over the tick before, with an offset
        places = np.diff(places, prepend=velocity) * RATE + source.uniform(-0.3, 0.3)
    places, force = places[BEFORE:], force[BEFORE:]
    q = min(10 ** source.uniform(-6, -4) if sensor == "position" else np.ptp(places) / 100, np.ptp(places) / 30)
    if special == "bad encoder":
        places = places + 2 * q * np.sin(2 * np.pi * places / (60 * q))
    errors = source.standard_normal(rows + 500) if deviation else np.zeros(rows + 500)
    if colour:
        from scipy.signal import lfilter

        errors = np.sqrt(1 - colour**2) * lfilter([1.0], [1.0, -colour], errors)
    places = places + deviation * q * errors[500:]
    position = places if special == "unrounded" else read(places, q, source)
    if special == "wild":
        position[source.integers(rows)] += 1e-3
    model = Model(
        special.endswith("spring"), special.endswith("sliding"), 0.0 if special == "held" else None, (), sensor, bool(load)
    )
    truth = {"mass": mass, "damping": damping, "delay": late, "friction": friction} | load
    return truth, force, position, 0.0 if special == "unrounded" else q, model


def study(kind, logs, seed=0):
    """Of each log: which intervals contain the truth, half the width of that of the mass, what is missing, and seconds."""
    source = np.random.default_rng([seed, *kind.encode()])
    for at in range(logs):
        truth, force, position, q, model = log_of(kind, source, FORCES[at % len(FORCES)])
        started = time.perf_counter()
        try:
            fit, verdict = identified(model, force, position, 1 / RATE, q)
        except UsageError as refused:
            yield None, np.nan, str(refused)[:30], time.perf_counter() - started
            continue
        reach = fit.half + fit.extra
        known = dict(zip(fit.model.names, np.c_[fit.theta - reach, fit.theta + reach], strict=True))
        truth |= {log: np.log(truth[name]) for name, log in LOGARITHMS.items() if name in truth}
        named = [LOGARITHMS.get(name, name) for name in NUMBERS]
        wide = [name for name in ("log_load", "log_coupling") if name in known and np.ptp(known[name]) > np.log(2)]
        inside = (
            None if wide else [low <= truth[name] <= high for name in named if name in known for low, high in [known[name]]]
        )
        yield inside, float(np.diff(known["log_mass"])[0]) / 2, verdict.missing, time.perf_counter() - started


def simulated(kind, logs, seed, seconds):
    """Logs of a kind on which more acts than they say."""
    curve, _, measured = kind.partition(", of ")
    if curve in CURVES:
        return of_curves(curve, logs, seed, seconds, measured)
    if kind.startswith("two masses"):
        return of_two_masses(0.1 if kind.endswith("drift") else 0.0, logs, seed, seconds)
    return of_one_mass(kind, logs, seed, seconds)


def outcome(kind, log_of_kind):
    """Which intervals of a log contain the truth, by name, the error of the mass, half its interval, and CPU seconds.

    Of a log whose numbers have no intervals, what is missing in place of the first. Where that is friction or a resonance, it
    is fitted again with it, as the command says to do; the truth is then that of two masses. The command refuses a mass that
    may be anything within a factor of three, and two masses of which load or coupling may be anything within two: "open".
    """
    _, _, measured = kind.partition(", of ")
    truth = log_of_kind.truth
    rubs = truth.get("friction", 0.0) > 0
    model = Model(friction=rubs, load=kind.startswith("two masses"), measured=measured or "position")
    started = time.process_time()
    origin = 0.0 if measured == "velocity" else log_of_kind.reading[0]
    log_again = log_of_kind.force, log_of_kind.reading - origin, log_of_kind.period, log_of_kind.step
    try:
        fit, verdict = identified(model, *log_again)
        if verdict.withheld and verdict.missing == "friction" and not rubs:
            fit, verdict = identified(replace(model, friction=True), *log_again)
        if verdict.withheld and verdict.missing == "resonance" and log_of_kind.hung:
            truth = log_of_kind.hung | {"delay": truth["delay"]}
            fit, verdict = identified(replace(model, load=True), *log_again)
    except UsageError:
        return {"inside": "refused", "seconds": time.process_time() - started}
    used = time.process_time() - started
    if verdict.withheld:
        return {"inside": verdict.missing, "seconds": used}
    reach = dict(zip(fit.model.names, fit.half + fit.extra, strict=True))
    coupled_open = any(2 * reach.get(name, 0.0) > log(2) for name in ("log_load", "log_coupling"))
    if coupled_open or 2 * reach["log_mass"] >= log(3):
        return {"inside": "open", "seconds": used}
    found = dict(zip(fit.model.names, fit.theta, strict=True))
    truth = truth | {LOGARITHMS[name]: log(truth[name]) for name in LOGARITHMS if name in truth}
    known = [name for name in found if name in truth and reach[name] < np.inf]
    off = {name: (found[name] - truth[name]) / reach[name] for name in known}
    inside = {name: bool(abs(share) <= 1) for name, share in off.items()}
    error = abs(found["log_mass"] - truth["log_mass"])
    return {"inside": inside, "off": off, "error": error, "half": float(reach["log_mass"]), "seconds": used}


def share_of(inside, name):
    """A number whose interval has the truth in so many logs, and the share's own interval of 95 % (Clopper and Pearson)."""
    from scipy.stats import beta

    held, logs = sum(inside), len(inside)
    low = beta.ppf(0.025, held, logs - held + 1) if held else 0.0
    high = beta.ppf(0.975, held + 1, logs - held) if held < logs else 1.0
    return f"{name} {held} of {logs} ({low:.2f} to {high:.2f})"


def beside(logs, seed, seconds, file, minutes, kinds):
    """Print a line for each kind of simulated log, once so many minutes are over or all logs are done."""
    of_motion = [f"{curve}, of {measured}" for curve in CURVES for measured in ("velocity", "position")]
    kinds = kinds or [*SIMULATED, "two masses", "two masses, drift", *of_motion]
    kept = {}
    if file.exists():
        for line in file.read_text().splitlines():
            record = json.loads(line)
            kept[tuple(record["log"])] = record
    made = {}
    stop = time.monotonic() + 60 * minutes
    for at, kind in product(range(logs), kinds):
        key = (kind, logs, seed, seconds, at)
        if key in kept or time.monotonic() > stop:
            continue
        if kind not in made:
            made[kind] = simulated(kind, logs, seed, seconds)
        kept[key] = outcome(kind, made[kind][at])
        with file.open("a") as lines:
            print(json.dumps({"log": key, **kept[key]}), file=lines)
    for kind in kinds:
        told(kind, seconds, [kept[key] for key in kept if key[:4] == (kind, logs, seed, seconds)])


def told(kind, seconds, outcomes):
    """Print the line of a kind."""
    answered = [each for each in outcomes if not isinstance(each["inside"], str)]
    words = [each["inside"] for each in outcomes if isinstance(each["inside"], str)]
    without = ", ".join(f"{word} {words.count(word)}" for word in sorted({*words})) or "all"
    if not answered:
        print(f"{kind:18} {seconds:g} s: none of {len(outcomes)} with intervals ({without})")
        return
    inside = [each["inside"] for each in answered]
    names = max(inside, key=len)
    shares = ", ".join(share_of([each[name] for each in inside if name in each], name) for name in names)
    half, error = (100 * np.array([each[name] for each in answered]) for name in ("half", "error"))
    used = [each["seconds"] for each in outcomes]
    print(
        f"{kind:18} {seconds:g} s: {len(answered)} of {len(outcomes)} with intervals ({without}); {shares}; "
        f"mass half-width {np.median(half):.2g} %, error {np.median(error):.2g} %, at most {error.max():.2g}; "
        f"{np.median(used):.2f} CPU s (most {max(used):.2f})"
    )


def main():
    if sys.argv[3:4] == ["beside"]:
        logs, seed, seconds = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[4])
        beside(logs, seed, seconds, Path(sys.argv[5]), float(sys.argv[6]), sys.argv[7:])
        return
    logs = int(sys.argv[1]) if len(sys.argv) > 1 else 80
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    for kind in sys.argv[3:] or KINDS:
        inside, half, missing, seconds = zip(*study(kind, logs, seed), strict=True)
        held = np.mean([each for each in inside if each], axis=0)
        words = ", ".join(f"{word or 'explained'} {missing.count(word)}" for word in sorted(set(missing)))
        names = [name for name in NUMBERS if (name != "friction" or "friction" in kind or "sliding" in KINDS[kind][3])]
        shares = ", ".join(f"{name} {share:.3f}" for name, share in zip(names, held, strict=False))
        shares += f" of {sum(each is not None for each in inside)}"
        print(f"{kind:18} {shares}; half-width {np.nanmedian(half):.1e}; {words}; {np.mean(seconds):.2f} s", flush=True)


if __name__ == "__main__":
    main()
