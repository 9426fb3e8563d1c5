"""The sampled model of a log: a device with Coulomb friction under a force that is held over a tick
and may be late.

    m a + d v + k x = f(t - D T) + f_0 - F_c sgn(v)

or two masses on a spring, of which the force moves the first:

    m_1 a_1 + d_1 v_1 + p = f(t - D T) + f_0,    m_2 a_2 + d_2 v_2 = p,    p = k (x_1 - x_2) + d (v_1 - v_2)

Fitted are the logarithm of the mass, the other free numbers of the device, and numbers of the log
alone: its initial position and velocity, a constant force (gravity, the offset of an amplifier, the
rest of a spring), and the offset of a sensor of velocity or acceleration, its bias.

A log of velocities or accelerations leaves some of these open: the position, of a velocity's bias b
and the force f_0 all but f_0 + d b, of an acceleration's f_0 and initial velocity all but f_0 - d
v_0, unless a spring or friction tells them apart. What is left open is 0. An accelerometer gives
the mean over the tick before, as one that adds up its samples does.
"""

from bisect import bisect_left
from dataclasses import dataclass
from math import copysign, exp, expm1, inf, sqrt, tanh

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter

from wavesweep.engine.blocks import impulse_and_step, motion
from wavesweep.engine.doubles import NEXT_TO_ZERO

TWIST = ("twist", "slip")  # of two masses at the first row: x_1 - x_2 and v_1 - v_2
OWN = ("start", "velocity", "offset", "bias", *TWIST)  # numbers of the log alone
# of the second mass, its spring and damper
COUPLED = ("log_load", "load_damping", "log_coupling", "coupling_damping")
UNSEEN = {
    "position": ("bias",),
    "velocity": ("start", "bias"),
    "acceleration": ("start", "velocity"),
}  # without a spring
ORDER = {"position": 0, "velocity": 1, "acceleration": 2}  # of the derivative that is measured
LARGEST_LOG_MASS = 100.0  # logarithm of the largest mass that is tried
TICKS_AT_ONCE = 1024  # ticks that are marched at a time
SMALL = 1e-4  # powers of e whose series is used
DIFFERENCE_STEP = 1e-4  # of finite differences, relative to the scale of a number


@dataclass(frozen=True)
class Model:
    """The numbers that are fitted.

    spring, friction, load: whether the model has them; load: a second mass on a spring. delay: in
    ticks, None if it is fitted. without: those of `OWN` that are 0, in addition to those that do
    not show in what is measured, a position, a velocity or an acceleration.
    """

    spring: bool = False
    friction: bool = False
    delay: float | None = None
    without: tuple[str, ...] = ()
    measured: str = "position"
    load: bool = False

    @property
    def own(self) -> tuple[str, ...]:
        """Those of `OWN` that the log may show."""
        moving = self.measured != "position" and (self.spring or self.friction)
        unseen = (*(("start",) if moving else UNSEEN[self.measured]), *(() if self.load else TWIST))
        return tuple(name for name in OWN if name not in unseen)

    @property
    def names(self) -> tuple[str, ...]:
        """The numbers that are fitted, in the order of a vector of them."""
        free = (
            [*COUPLED] * self.load
            + ["stiffness"] * self.spring
            + ["friction"] * self.friction
            + ["delay"] * (self.delay is None)
            + [name for name in self.own if name not in self.without]
        )
        return ("log_mass", "damping", *free)

    def numbers(self, theta: np.ndarray) -> dict[str, float]:
        """All numbers of the device and the log by their names; theta: the vector."""
        fitted = dict(zip(self.names, map(float, theta), strict=True))
        fixed = {"stiffness": 0.0, "friction": 0.0, "delay": self.delay or 0.0} | dict.fromkeys(
            OWN, 0.0
        )
        numbers = fixed | fitted
        logs = {"mass": "log_mass"} | (
            {"load_mass": "log_load", "coupling_stiffness": "log_coupling"} if self.load else {}
        )
        sizes = {
            name: exp(min(max(fitted[log], -LARGEST_LOG_MASS), LARGEST_LOG_MASS))
            for name, log in logs.items()
        }
        return numbers | sizes | {"friction": abs(numbers["friction"])}


def readings(
    model: Model, theta: np.ndarray, force: np.ndarray, period: float, skip: int = 0
) -> np.ndarray:
    """What is measured at the start of each tick from tick `skip` on, `(ticks - skip,)`; there the
    initial numbers hold.

    force: N, of all ticks; period: s. The force before the log is not known. With `skip` above the
    delay, by a tick more for an acceleration, it is not needed; otherwise the first one is used.
    """
    return measured(model.numbers(theta), model.measured, force, period, skip)


def measured(numbers, quantity: str, force: np.ndarray, period: float, skip: int = 0) -> np.ndarray:
    """The same for numbers by their names; quantity: a position (m), a velocity (m/s) or an
    acceleration (m/s^2).

    With `turning` (m/s) among the numbers friction is F_c tanh(v/turning); with `sided` as well, the
    offset acts while the device moves alone, as f_0 |tanh(v/turning)|.
    """
    if not abs(numbers["delay"]) < len(force):
        return np.full(len(force) - skip, np.nan)
    if "load_mass" in numbers:
        return (
            two_masses(numbers, force, period, skip)[int(quantity == "position")] + numbers["bias"]
        )
    # the mean over a tick is that over the next one, with a force that is a tick later
    ahead = quantity == "acceleration"
    push, pulls, full = _pushes(numbers | {"delay": numbers["delay"] + ahead}, force, period, skip)
    push = np.pad(push, ((0, 0), (0, int(ahead))))
    pulls = tuple((seconds, np.pad(pull, (0, int(ahead)))) for seconds, pull in pulls)
    row = int(quantity == "position")
    if numbers.get("turning"):
        places = _turning(numbers, pulls, row)
    elif numbers["friction"]:
        places = _sliding(numbers, push, pulls, full, period, row)
    else:
        places = _linear(numbers, push, period, row)
    return (np.diff(places) / period if ahead else places) + numbers["bias"]


def _pushes(numbers, force, period, skip):
    """What the force of each tick adds to velocity and position by its end, `(2, ticks)`; its two
    parts; the effect of 1 N.

    A force that is `D = n + p` ticks late, 0 <= p < 1, is that of tick `k - n - 1` for `p T`, and
    that of tick `k - n` then: the parts are pairs of seconds and N.
    """
    whole_ticks = int(np.floor(numbers["delay"]))
    fraction = numbers["delay"] - whole_ticks
    now, before = (
        late(force, ticks)[skip:] + numbers["offset"] for ticks in (whole_ticks, whole_ticks + 1)
    )
    full = reach(numbers, period)
    rest = reach(numbers, (1 - fraction) * period)
    push = np.outer(rest, now) + np.outer(full - rest, before)
    return push, ((fraction * period, before), ((1 - fraction) * period, now)), full


def two_masses(numbers, force: np.ndarray, period: float, skip: int) -> np.ndarray:
    """Velocity and position of the first mass, and position minus that of the second one, at each
    tick, `(3, ticks - skip)`.

    Both velocities and the twist are `s[k+1] = A s[k] + B (f[k-1], f[k])`, which has three modes,
    each of which is a filter of the first order; the position adds up.
    """
    whole_ticks = int(np.floor(numbers["delay"]))
    fraction = numbers["delay"] - whole_ticks
    before = late(force, whole_ticks + 1)[skip:]
    now = late(force, whole_ticks)[skip:]
    pushes = np.stack([before, now]) + numbers["offset"]
    unknown = np.full((3, len(force) - skip), np.nan)
    A, B = tick_of_two(numbers, period, fraction)
    if not np.isfinite(A).all():
        return unknown
    modes, V = np.linalg.eig(A[:3, :3])
    if not 0 < np.abs(np.linalg.det(V)) < np.inf:
        return unknown
    velocity = numbers["velocity"]
    first = np.array([velocity, velocity - numbers["slip"], numbers["twist"]], dtype=complex)
    driven = np.linalg.solve(V, np.column_stack([first, B[:3] @ pushes[:, :-1]]))
    in_modes = []
    for mode, row in zip(modes, driven, strict=True):
        in_modes.append(lfilter([1.0], [1.0, -mode], row))
    states = (V @ np.stack(in_modes)).real
    steps = A[3, :3] @ states[:, :-1] + B[3] @ pushes[:, :-1]
    place = numbers["start"] + np.append(0.0, np.cumsum(steps))
    return np.stack([states[0], place, states[2]])


def tick_of_two(numbers, period, part):
    """A tick of two masses: the matrix of (v_1, v_2, x_1 - x_2, x_1), and the effects of a force
    before and after its part."""
    first, two, k, d = (
        numbers[name] for name in ("mass", "load_mass", "coupling_stiffness", "coupling_damping")
    )
    rates = np.zeros((5, 5))
    rates[0] = [-(numbers["damping"] + d) / first, d / first, -k / first, 0, 1 / first]
    rates[1, :3] = d / two, -(numbers["load_damping"] + d) / two, k / two
    rates[2, :2], rates[3, 0] = (1.0, -1.0), 1.0
    with np.errstate(all="ignore"):
        before = expm(rates * (part * period))
        after = expm(rates * ((1 - part) * period))
    return (after @ before)[:4, :4], np.stack([after[:4, :4] @ before[:4, 4], after[:4, 4]], axis=1)


def late(force: np.ndarray, ticks: int) -> np.ndarray:
    """The force, delayed by some ticks; before the log it has its first value."""
    rows = len(force)
    ticks = min(max(ticks, -rows), rows)
    if ticks > 0:
        return np.concatenate([np.full(ticks, force[0]), force[:-ticks]])
    if ticks < 0:
        return np.concatenate([force[-ticks:], np.full(-ticks, force[-1])])
    return force


def reach(numbers, length):
    """Velocity and position after a unit force over `length` seconds from rest."""
    mass = numbers["mass"]
    s, g, *_ = impulse_and_step(numbers["damping"] / mass, numbers["stiffness"] / mass, length)
    return np.array([float(s), float(g)]) / mass


def step(numbers, period):
    """The matrix of velocity and position over a tick."""
    mass = numbers["mass"]
    damping = numbers["damping"] / numbers["mass"]
    stiffness = numbers["stiffness"] / numbers["mass"]
    s, g, *_ = impulse_and_step(damping, stiffness, period)
    return np.eye(2) + motion(s, g, -damping, -stiffness, mass)[0]


def of_modes(total, rate, tone, ratio, share):
    """The numbers of two masses (`total`, in kg) from modes, whose dampers are in proportion to
    these, of rate 1/s.

    tone: of the resonance (Hz), with its damping ratio. share: of the load, relative to the first
    mass. Their admittance at the first mass is `1/(M s^2 + rate M s) + share/M/(s^2 + 2 z w s +
    w^2)`.
    """
    turn = 2 * np.pi * tone
    first = total / (1 + share)
    two = total * share / (1 + share)
    both = first * two / total
    numbers = {
        "log_mass": np.log(first),
        "damping": rate * first,
        "log_load": np.log(two),
        "load_damping": rate * two,
    }
    return numbers | {
        "log_coupling": np.log(turn**2 * both),
        "coupling_damping": max(2 * ratio * turn - rate, 0.0) * both,
    }


def resonance(force, tone, ratio, period, late, quantity):
    """What a resonance (Hz) with a damping ratio adds to a reading per unit of residue: `1/(s^2
    + 2 z w s + w^2)`."""
    unit = {
        "mass": 1.0,
        "damping": 4 * np.pi * tone * ratio,
        "stiffness": (2 * np.pi * tone) ** 2,
        "friction": 0.0,
        "delay": late,
    }
    return measured(unit | dict.fromkeys(OWN, 0.0), quantity, force, period)


def _linear(numbers, push, period, row):
    """x[k+2] - (p1 + p2) x[k+1] + p1 p2 x[k] = ..., one pole after the other, which is accurate for
    poles near 1.

    row: 0 for the velocity in place of the position, which follows the same equation.
    """
    A = step(numbers, period)
    half = numbers["damping"] / (2 * numbers["mass"])
    root = np.sqrt(complex(half * half - numbers["stiffness"] / numbers["mass"]))
    fast = -half - root
    slow = numbers["stiffness"] / numbers["mass"] / fast if fast else 0.0  # the sum would cancel
    fast_decay = np.exp(fast * period)
    two = np.exp(slow * period)
    if not root.imag:
        fast_decay = fast_decay.real
        two = two.real
    state = np.array([numbers["velocity"], numbers["start"]])
    other_row = 1 - row
    first = A[row] @ state + push[row, 0]
    drive = (
        push[row, 1:-1]
        + A[row, other_row] * push[other_row, :-2]
        - A[other_row, other_row] * push[row, :-2]
    )
    outer = np.concatenate([[first - fast_decay * state[row]], drive])
    inner = lfilter([1.0], [1.0, -two], outer)
    return lfilter([1.0], [1.0, -fast_decay], np.concatenate([[state[row]], inner])).real


def _turning(numbers, parts, row):
    """Velocity (row 0) or position (row 1) at the start of each tick, with friction
    F_c tanh(v/v_t), which lets a device that sticks creep.

    A step of h is that of the equation with a straight line for the friction near v: with
    J = F_c (1 - tanh^2)/(m v_t) + d/m and z = J h, the velocity changes by h phi_1(z) a and the
    position by h v + h^2 phi_2(z) a, with phi_1 = (1 - e^-z)/z and phi_2 = (1 - phi_1)/z. Near 0
    the velocity changes by about a quarter of v_t in a step, unless this would be less than 1/256
    of a part; elsewhere friction is constant. parts: (seconds, force in each tick) of the parts of a
    tick in turn.

    With `sided` the offset f_0, which all forces have in them, acts as f_0 |tanh(v/v_t)|: the rest
    f_0 (1 - |tanh|) is taken off, and F_c - f_0 sgn(v) is in the place of F_c in J. A fit tries it
    for f_0 below F_c.
    """
    friction, damping, stiffness = (
        numbers[name] / numbers["mass"] for name in ("friction", "damping", "stiffness")
    )
    turning = numbers["turning"]
    near = 6.0 * turning  # speeds of a turn, beyond which friction is constant to 1e-5
    sided = numbers["offset"] / numbers["mass"] if numbers.get("sided") else 0.0
    v = numbers["velocity"]
    x = numbers["start"]
    states = []
    for pushes in zip(*(push.tolist() for _, push in parts), strict=True):
        states.append((v, x)[row])
        for (seconds, _), push in zip(parts, pushes, strict=True):
            seconds_left = seconds
            while seconds_left > 0:
                side = tanh(v / turning)
                net = (
                    push / numbers["mass"] - friction * side - damping * v - sided * (1 - abs(side))
                )
                pulled = abs(net - stiffness * x) + NEXT_TO_ZERO
                longest = (abs(v) - near if abs(v) > near else turning / 4) / pulled
                # Steps in which a part of a tick is marched through a turn.
                h = min(seconds_left, max(longest, seconds / 256))
                a = net - stiffness * (x + v * h / 2)
                moving_friction = friction - copysign(sided, v)
                z = (moving_friction * (1 - side * side) / turning + damping) * h
                phi_1 = -expm1(-z) / z if abs(z) > SMALL else 1 - z / 2
                phi_2 = (1 - phi_1) / z if abs(z) > SMALL else 0.5 - z / 6
                x += h * v + h * h * phi_2 * a
                v += h * phi_1 * a
                seconds_left -= h
    return np.array(states)


def _sliding(numbers, push, parts, full, period, row):
    """The same with friction, tick by tick; a tick in which the device stops or starts is divided
    there.

    Without a spring the speed does not depend on the position: while no force can stop the device
    within a tick the speed alone is followed, and a device at rest waits for a force above
    friction.
    """
    friction = numbers["friction"]
    stiffness = numbers["stiffness"]
    (first, before), (then, now) = parts
    strongest = np.maximum(np.abs(before), np.abs(now)) if first else np.abs(now)
    after_tick, (by_v, by_x), (vv, xv) = (
        _tick(numbers, period, full, first, then),
        friction * full,
        step(numbers, period)[:, 0],
    )
    # No force turns a faster device round within a tick, and none below friction moves one at rest.
    if stiffness:
        safe = inf
    else:
        safe = float(by_v + strongest.max() * full[0]) / max(min(vv, 1.0), NEXT_TO_ZERO)
    v = numbers["velocity"]
    x = numbers["start"]
    moved = np.empty(len(now))
    speeds = np.empty(len(now))
    for begin in range(0, len(now), TICKS_AT_ONCE):
        block = slice(begin, begin + TICKS_AT_ONCE)
        to_v, to_x, early, late = (
            values[block].tolist() for values in (*push, before if first else now, now)
        )
        drives = {side: (push[0, block] - side * by_v).tolist() for side in (1.0, -1.0)}
        starts = [
            *np.flatnonzero((strongest[block] > friction) | bool(stiffness)).tolist(),
            len(late),
        ]
        series, changes = (
            [],
            {},
        )  # of the position, in ticks that are not those of a device that slides
        while True:
            if v == 0.0:
                series += [0.0] * (starts[bisect_left(starts, len(series))] - len(series))
            elif abs(v) > safe:
                v = _slid(series, v, float(vv), drives[copysign(1.0, v)], safe)
            if (tick := len(series)) == len(late):
                break
            series.append(v)
            v, place = after_tick(v, x, early[tick], late[tick], to_v[tick], to_x[tick])
            x, changes[tick] = place, place - x
        speeds[block] = series
        slides = np.sign(speeds[block])
        moved[block] = xv * speeds[block] + np.where(
            slides == 0, 0.0, push[1, block] - slides * by_x
        )
        moved[block][list(changes)] = list(changes.values())
    if row:
        return numbers["start"] + np.append(0.0, np.cumsum(moved[:-1]))
    return speeds


def _slid(series, v, vv, drive, safe):
    """Add the speeds of a device that slides to a series, as long as it is faster than `safe`;
    the next speed is returned."""
    low, high = (safe, inf) if v > 0 else (-inf, -safe)
    for push in drive[len(series) :]:
        after = vv * v + push
        if not low < after < high:
            break
        series.append(v)
        v = after
    return v


def _tick(numbers, period, full, first, then):
    """A function from velocity, position, the two forces of a tick and what they add, to the
    velocity and position after it."""
    friction = numbers["friction"]
    stiffness = numbers["stiffness"]
    (vv, vx), (xv, xx) = step(numbers, period).tolist()
    by_v, by_x = (friction * full).tolist()
    (half_v, half_x), (by_half, _) = (
        step(numbers, first)[0].tolist(),
        reach(numbers, first).tolist(),
    )
    law = numbers["mass"], numbers["damping"], stiffness, friction

    def after_tick(v, x, first_push, two, to_v, to_x):
        net = first_push - stiffness * x
        if v == 0.0 and abs(net) <= friction and abs(two - stiffness * x) <= friction:
            return 0.0, x
        side = copysign(1.0, v or net) if v or abs(net) > friction else 0.0
        after = vv * v + vx * x + to_v - side * by_v
        # Where the force changes within the tick it may have stopped before, and started again.
        if after * side > 0.0 and (
            not first
            or (half_v * v + half_x * x + (first_push - side * friction) * by_half) * side > 0.0
        ):
            return after, xv * v + xx * x + to_x - side * by_x
        for seconds, pull in ((first, first_push), (then, two)):
            v, x = _through_rest(law, v, x, pull, seconds) if seconds else (v, x)
        return v, x

    return after_tick


def _through_rest(law, v, x, pull, seconds):
    """Velocity and position after `seconds` seconds in which the device stops, under a constant force,
    by Taylor's series.

    law: mass, damping, stiffness and friction.
    """
    mass, damping, stiffness, friction = law
    for _ in range(4):  # more reversals within a tick would not be visible in a log
        net = pull - stiffness * x
        if v == 0.0 and abs(net) <= friction:
            return 0.0, x
        a = (net - copysign(friction, v or net) - damping * v) / mass
        jerk = -(damping * a + stiffness * v) / mass
        snap = -(damping * jerk + stiffness * a) / mass
        if v == 0.0:
            t = seconds
            return t * (a + t * (jerk / 2 + t * snap / 6)), x + t * (
                t * (a / 2 + t * (jerk / 6 + t * snap / 24))
            )
        stop = inf
        square = a * a - 2 * jerk * v
        below = copysign(sqrt(square), v) - a if square >= 0 else 0.0
        if v * below > 0:  # the first time at which v + a t + jerk t^2/2 is 0
            stop = 2 * v / below
        if stop < seconds:
            slope = a + stop * (jerk + stop * snap / 2)
            stop -= (v + stop * (a + stop * (jerk / 2 + stop * snap / 6))) / slope if slope else 0.0
        t = min(stop, seconds)
        x += t * (v + t * (a / 2 + t * (jerk / 6 + t * snap / 24)))
        if stop >= seconds:
            return v + t * (a + t * (jerk / 2 + t * snap / 6)), x
        v = 0.0
        seconds = seconds - stop
    return v, x


def euler(numbers, period):
    """The error of Euler's rule in the logarithm of the mass and in the damping: the share T
    d/2m."""
    share = period * abs(numbers["damping"]) / (2 * numbers["mass"])
    return np.array([share, share * abs(numbers["damping"])])


def sensitivities(
    model: Model, theta: np.ndarray, force: np.ndarray, period: float, steps, skip: int = 0
) -> np.ndarray:
    """Derivatives of what is measured with respect to the numbers, `(ticks - skip, numbers)`, by
    central differences.

    steps: of the numbers. With friction they should be as wide as the intervals, since a stop makes
    them kink.
    """
    columns = []
    for index, size in enumerate(steps):
        if model.names[index] == "bias" or (model.names[index] == "start" and not model.spring):
            # Without a spring all positions move with the first one.
            columns.append(np.ones(len(force) - skip))
            continue
        step = np.zeros(len(theta))
        step[index] = size
        ahead = readings(model, theta + step, force, period, skip)
        behind = readings(model, theta - step, force, period, skip)
        columns.append((ahead - behind) / (2 * size))
    return np.stack(columns, axis=1)
