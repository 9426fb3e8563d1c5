"""Logs of devices on which more acts than the log says, marched from one change of the force to the next.

    m v' = f(t - D T) + h(t) + f_0 - d v - F(v) sgn v,    F(v) = F_c + (F_s - F_c) exp(-(v/v_s)^2)

The solution between two changes is exact, and so are the moments at which Coulomb friction stops the device; of a Stribeck
curve (F_s above F_c) the friction is held over a sixteenth of a tick. h is the force of a hand, or of a cable, that the log
does not have. It shares no code with the package.
"""

from dataclasses import dataclass, field

import numpy as np

PARTS = 16  # of a tick
KINDS = {  # friction, hand over force; what else is special
    "plain": (0.0, 0.0, ""),
    "Coulomb": (0.12, 0.0, ""),
    "Stribeck": (0.12, 0.0, "stribeck"),
    "drift": (0.0, 0.1, "drift"),
    "drift, Coulomb": (0.12, 0.1, "drift"),
    "hand": (0.0, 0.15, "hand"),
    "hand, Coulomb": (0.12, 0.15, "hand"),
}
CURVES = (
    "saturating",
    "sided friction",
    "sided damping",
    "drag",
    "hardening",
    "saturating force",
    "resonance",
    "drift of the sensor",
)
FORCES = {"chirp": 10.0, "noise": 60.0, "steps": 20.0, "sines": 10.0}  # accelerations (m/s^2)


@dataclass(frozen=True, eq=False)
class SimulatedLog:
    """A log with the numbers of its device (SI), the delay in ticks, and the step of its encoder.

    hung: the numbers of the two masses, if a part of the mass hangs on a spring.
    """

    truth: dict[str, float]
    force: np.ndarray
    reading: np.ndarray
    period: float
    step: float
    force_kind: str
    hung: dict[str, float] = field(default_factory=dict)


def force_of(kind: str, ticks: int, period: float, source: np.random.Generator) -> np.ndarray:
    """A force in units of its size."""
    times = period * np.arange(ticks)
    if kind == "chirp":
        first, last = 2 / times[-1] + 0.5, min(0.1 / period, 60.0)
        return np.sin(2 * np.pi * (first * times + (last - first) * times**2 / 2 / times[-1]))
    if kind == "steps":
        return np.sign(source.standard_normal(ticks // 20 + 1)).repeat(20)[:ticks]
    if kind == "sines":
        phases = source.uniform(0, 2 * np.pi, 5)
        tones = np.array([0.7, 1.9, 4.3, 9.1, 17.0])
        return np.sin(2 * np.pi * np.outer(times, tones) + phases).sum(axis=1) / 2
    return source.standard_normal(ticks)


def marched(mass, damping, coulomb, stribeck, slow, pushes, lengths):
    """Positions at the ticks, `(ticks, logs)`, from rest.

    pushes: forces of each part of a tick, `(ticks, parts, logs)`, and lengths: of the parts, `(parts, logs)`, in units of time
    in which a tick is 1. The others are of each log: kg, N*s/m, N, N beyond Coulomb's at rest, and the speed of a Stribeck
    curve (m/s).
    """
    rate = damping / mass
    x = np.zeros_like(mass)
    v = np.zeros_like(mass)
    places = np.empty((len(pushes), len(mass)))
    for tick, parts in enumerate(pushes):
        places[tick] = x
        for push, length in zip(parts, lengths, strict=True):
            friction = coulomb + stribeck * np.exp(-((v / slow) ** 2))
            way = np.where(v == 0, np.sign(push) * (np.abs(push) > friction), np.sign(v))
            end = (push - way * friction) / damping  # the speed that it would reach
            after = end + (v - end) * np.exp(-rate * length)
            with np.errstate(all="ignore"):
                stop = np.where(after * way < 0, np.log1p(-v / end) / rate, length)
            stop = np.where(way == 0, 0.0, stop)
            x = x + end * stop + (v - end) * -np.expm1(-rate * stop) / rate
            # What is left of the part, after a stop.
            left = length - stop
            turned = np.sign(push) * (np.abs(push) > coulomb + stribeck)
            end_two = (push - turned * (coulomb + stribeck)) / damping
            end_two = np.where(turned == 0, 0.0, end_two)
            x = x + np.where(left > 0, end_two * (left - -np.expm1(-rate * left) / rate), 0.0)
            v = np.where(left > 0, end_two * -np.expm1(-rate * left), after)
    return places


def of_one_mass(kind: str, logs: int, seed: int, seconds: float, rate_hz: float = 1000.0) -> list[SimulatedLog]:
    """Logs of random devices of a kind, all of one length."""
    source = np.random.default_rng([seed, *kind.encode(), int(1000 * seconds)])
    rub, hand, special = KINDS[kind]
    period = 1 / rate_hz
    ticks = round(seconds * rate_hz)
    mass = 10 ** source.uniform(-4, 2, logs)
    damping = mass * 10 ** source.uniform(-0.5, 1, logs)
    delay = source.integers(0, 4 * PARTS + 1, logs) / PARTS
    kinds = [list(FORCES)[at % len(FORCES)] for at in range(logs)]
    sizes = np.array([FORCES[each] for each in kinds]) * mass
    force = np.stack([size * force_of(each, ticks, period, source) for each, size in zip(kinds, sizes, strict=True)], axis=1)
    beside = 0.03 * sizes * source.standard_normal(logs) + np.zeros((ticks, logs))
    if hand:
        walk = np.cumsum(source.standard_normal((ticks, logs)), axis=0)
        walk = (walk - walk.mean(axis=0)) / walk.std(axis=0)
        beside += hand * sizes * walk
    if special == "hand":  # that sways, and trembles
        times = period * np.arange(ticks)[:, None]
        beside += 0.5 * hand * sizes * np.sin(2 * np.pi * (0.6 * times + source.uniform(size=logs)))
        beside += 0.1 * hand * sizes * np.sin(2 * np.pi * (source.uniform(8, 12, logs) * times + source.uniform(size=logs)))
    coulomb = rub * sizes
    stribeck = 0.6 * coulomb * (special == "stribeck")
    # Friction that falls with speed is held over a sixteenth of a tick; else a tick has two parts, before and after the force
    # of the log changes.
    lengths = np.stack([delay % 1.0, 1.0 - delay % 1.0])
    if special == "stribeck":
        lengths = np.full((PARTS, logs), 1.0 / PARTS)
    begun = np.cumsum(lengths, axis=0) - lengths
    at = np.floor(np.arange(ticks)[:, None, None] + begun - delay).astype(int)
    late = np.where(at < 0, 0.0, np.take_along_axis(force[:, None], np.maximum(at, 0), axis=0))
    pushes = late + beside[:, None]
    slow = 0.02 * sizes / mass / 5
    # A tick is the unit of time: v is per tick, and a force moves T^2 as far.
    unit = period**2
    places = marched(mass, damping * period, coulomb * unit, stribeck * unit, slow * period, pushes * unit, lengths)
    steps = np.minimum(10 ** source.uniform(-8, -4, logs), np.ptp(places, axis=0) / 50)
    noise = source.choice([0.0, 1.0], logs) * steps
    places = places + noise * source.standard_normal(places.shape)
    reading = steps * np.round(places / steps)
    named = zip(mass, damping, coulomb, delay, strict=True)
    truths = [dict(zip(("mass", "damping", "friction", "delay"), map(float, each), strict=True)) for each in named]
    return [
        SimulatedLog(truth, force[:, at], reading[:, at], period, float(steps[at]), kinds[at])
        for at, truth in enumerate(truths)
    ]


def of_two_masses(hand: float, logs: int, seed: int, seconds: float, rate_hz: float = 4000.0) -> list[SimulatedLog]:
    """Logs of random motors with a load on a shaft under noise; hand: a walking torque on the motor, over that of the log.

    The solution between two changes of the torque is exact: it is that of matrix exponentials.
    """
    from scipy.linalg import expm

    source = np.random.default_rng([seed, int(1000 * hand), int(1000 * seconds)])
    period = 1 / rate_hz
    ticks = round(seconds * rate_hz)
    found = []
    for _ in range(logs):
        motor = 10 ** source.uniform(-4, -1)
        load = motor * source.uniform(0.4, 3)
        turn = 2 * np.pi * source.uniform(20, 90)
        both = motor * load / (motor + load)
        stiffness = turn**2 * both
        losses = 2 * source.uniform(0.01, 0.05) * turn * both
        drag, load_drag = motor * source.uniform(1, 4), load * source.uniform(0.5, 2)
        delay = source.integers(0, 4 * PARTS + 1) / PARTS
        torque = 400 * (motor + load) * source.standard_normal(ticks)
        walk = np.cumsum(source.standard_normal(ticks))
        beside = hand * torque.std() * (walk - walk.mean()) / walk.std()
        flow = np.zeros((5, 5))
        flow[0, 1] = flow[2, 3] = 1.0
        flow[1] = [-stiffness / motor, -(drag + losses) / motor, stiffness / motor, losses / motor, 1 / motor]
        flow[3] = [stiffness / load, losses / load, -stiffness / load, -(load_drag + losses) / load, 0.0]
        part = delay % 1.0
        early, after = (expm(flow * period * share) for share in (part, 1 - part))
        late = np.concatenate([np.zeros(int(delay) + 1), torque])
        state = np.zeros(5)
        places = np.empty(ticks)
        for tick in range(ticks):
            places[tick] = state[0]
            for step, push in ((early, late[tick]), (after, late[tick + 1])):
                state[4] = push + beside[tick]
                state = step @ state
        step = min(2 * np.pi / source.choice([2000, 20000]), np.ptp(places) / 50)
        names = ("mass", "damping", "load_mass", "load_damping", "coupling_stiffness", "coupling_damping", "delay")
        values = (motor, drag, load, load_drag, stiffness, losses, delay)
        truth = dict(zip(names, map(float, values), strict=True))
        reading = step * np.round(places / step)
        found.append(SimulatedLog(truth, torque, reading, period, float(step), "noise"))
    return found


def of_curves(kind: str, logs: int, seed: int, seconds: float, measured: str = "velocity") -> list[SimulatedLog]:
    """Logs of random devices at 1 kHz with a force that is a curve of the motion, by Runge and Kutta in eighths of a tick.

    Friction turns round in less than that under noise: there the steps are a 64th of a tick (in eighths noise moved the mass
    by up to 5e-4).

    The mass that "saturating" divides by 1 + 0.3 (v/v_0)^2, by 2.8 at most, is that of an inductance of which the speed is the
    current. v_0 is the rms of the speed without the curve. A sensor drifts by 5 % of its rms.
    """
    source = np.random.default_rng([seed, *kind.encode(), len(measured)])
    period, ticks = 1e-3, round(1e3 * seconds)
    parts = 64 if kind == "sided friction" else 8
    mass = 10 ** source.uniform(-3, 0, logs)
    damping = mass * 10 ** source.uniform(0.3, 1.3, logs)
    delay = source.integers(0, 25, logs) / 8
    # Steps move some devices one way only, and one that saturates by a smaller force.
    usable = [each for each in FORCES if each != "steps" or not kind.startswith(("sided", "saturating force"))]
    kinds = [usable[at % len(usable)] for at in range(logs)]
    force = np.empty((ticks, logs))
    for at, each in enumerate(kinds):
        push = force_of(each, ticks, period, source)
        if each in ("chirp", "sines"):  # from another phase the device would move one way only
            push = np.gradient(push) / np.abs(np.gradient(push)).max()
        force[:, at] = FORCES[each] * mass[at] * push
    usual = _usual_speed(mass, damping, force, period)
    pushed = force.std(axis=0)
    hung = 0.25 * mass * (kind == "resonance")
    turn = 2 * np.pi * source.uniform(15, 60, logs)
    spring = turn**2 * hung * 0.75
    losses = 2 * 0.03 * turn * hung * 0.75

    def slopes(state, push):
        place, speed, place_two, speed_two = state
        share = speed / usual
        net = push - damping * speed
        if kind == "saturating force":
            most = 0.6 * np.abs(force).max(axis=0)
            net = np.clip(push, -most, most) - damping * speed
        if kind == "sided friction":
            net = net - 0.2 * pushed * (np.tanh(200 * share) + 0.4 * np.abs(np.tanh(200 * share)))
        if kind == "sided damping":
            net = net - 0.4 * damping * np.abs(speed)
        if kind == "drag":
            net = net - damping * share * np.abs(speed)
        if kind == "hardening":
            net = net - 0.3 * pushed * (place / (0.1 * usual)) ** 3
        if kind == "saturating":
            net = net * (1 + 0.3 * np.minimum(share**2, 6.0))
        pull = spring * (place - place_two) + losses * (speed - speed_two)
        two = pull / hung if kind == "resonance" else 0.0 * pull
        return np.stack([speed, (net - pull) / (mass - hung), speed_two, two])

    state = np.zeros((4, logs))
    states = np.empty((ticks, 2, logs))
    step = period / parts
    for tick in range(ticks):
        states[tick] = state[:2]
        for part in range(parts):
            at = np.floor(tick + part / parts - delay + 1e-9).astype(int)
            push = np.where(at < 0, 0.0, force[np.maximum(at, 0), np.arange(logs)])
            one = slopes(state, push)
            two = slopes(state + step / 2 * one, push)
            three = slopes(state + step / 2 * two, push)
            four = slopes(state + step * three, push)
            state = state + step / 6 * (one + 2 * two + 2 * three + four)
    places = states[:, int(measured == "velocity")]
    if kind == "drift of the sensor":
        walk = np.cumsum(source.standard_normal(places.shape), axis=0)
        places = places + 0.05 * places.std(axis=0) * (walk - walk.mean(axis=0)) / walk.std(axis=0)
    steps = np.ptp(places, axis=0) * 10 ** source.uniform(-4, -2.5, logs)
    places = places + source.choice([0.0, 1.0], logs) * steps * source.standard_normal(places.shape)
    reading = steps * np.round(places / steps)
    named = zip(mass, damping, delay, strict=True)
    truths = [dict(zip(("mass", "damping", "delay"), map(float, each), strict=True)) for each in named]
    of_two = np.stack([mass - hung, damping, hung, 0.0 * hung, spring, losses])
    names = ("mass", "damping", "load_mass", "load_damping", "coupling_stiffness", "coupling_damping")
    made = []
    for at, truth in enumerate(truths):
        two = dict(zip(names, map(float, of_two[:, at]), strict=True)) if kind == "resonance" else {}
        made.append(SimulatedLog(truth, force[:, at], reading[:, at], period, float(steps[at]), kinds[at], two))
    return made


def _usual_speed(mass, damping, force, period):
    """The rms of the speed of a device with no more than its damping."""
    decay = np.exp(-damping / mass * period)
    speed = np.zeros_like(mass)
    square = np.zeros_like(mass)
    for push in force:
        speed = speed * decay + push / damping * (1 - decay)
        square += speed**2
    return np.sqrt(square / len(force))
