"""Random specs with claims about sets, and members of these sets, computed by a march or by the plain loop of one member.

A drawn loop is a mass that two holds and a hidden block push; it is marched here tick by tick. Of a built-in controller members
are plain loops of one length of frames, with one hand, or the march of a slow wall. Sets without hands: tests/meaning.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import expm

import wavesweep
from support.marched_hands import growth, random_hand
from support.specs import nested, random_values
from wavesweep.for_all import every_hand
from wavesweep.program.spec import load

SURELY = 1e-7  # above 1, from which on a radius contradicts
NO_HAND = 0.0, 0.0, 0.0
HAND = "operator.mass", "operator.damping", "operator.stiffness"
BOX, IN_WORDS = ((0.01, 0.1), (0.0, 1.0), (0.0, 300.0)), "box:mass=0.01..0.1,damping=0..1,stiffness=0..300"
DIRECT = "dc-slow", "dc-lm"  # controllers with frames, without waves
SHARES = 0.5, 1 - 1e-6  # of an interval, where it is asked beside a random one
VARY = "rates.ratio"
TICK = 1e-3  # s, of a drawn loop


@dataclass(frozen=True)
class Claim:
    """A spec, its number along which it is claimed, the hands, and a draw of a member's radius at a value of the number.

    rows_of: a function of the spec in place of its intervals.
    """

    tables: dict
    along: str
    hands: str
    member: Callable
    rows_of: Callable | None = None

    @cached_property
    def rows(self):
        """The rows that are claimed, each with low, high and more; none where the spec is refused."""
        try:
            if self.rows_of:
                return self.rows_of(self.tables)
            table = wavesweep.zwidth(self.tables, self.along, self.hands or ())
        except (wavesweep.SpecError, wavesweep.UsageError):
            return []
        if "guarantee" in table:
            table = table[table["guarantee"] != "spec"]
        if "hand" in table:
            table = table[table["hand"] == self.hands.partition(":")[0]]
        return table.to_dict("records")

    @cached_property
    def stated(self):
        """The rows that are intervals."""
        return [row for row in self.rows if row.get("intervals", 1) > 0]

    def contradicted(self, rng, tries, longer=1.0):
        """A member that the claim does not hold for, with the number's value; or None.

        longer: a factor of every interval, with which the claim is false.
        """
        for row in self.stated * tries:
            share = rng.choice([*SHARES, rng.random()]) * longer
            value = row["low"] + share * (row["high"] - row["low"])
            radius, member = self.member(rng, value, **row.get("of", {}))
            if radius > 1 + SURELY:
                return {"value": value, "radius": float(radius), "member": member, "row": (row["low"], row["high"])}
        return None


def hand_of(rng, box=None):
    """Mass, damping and stiffness of a hand: none, light and heavy ones, or one of a box."""
    if box:
        return tuple(float(rng.choice([low, high, rng.uniform(low, high)])) for low, high in box)
    if rng.random() < 0.2:
        return 0.0, 0.0, 0.0
    sizes = 10 ** rng.uniform((-5, -3, -1), (2, 1, 7))
    return tuple((sizes * (rng.random(3) < (0.5, 0.3, 0.7))).tolist())


@dataclass(frozen=True)
class Pushed:
    """The loop of `drawn`, marched tick by tick; see there."""

    mass: float
    damping: float
    stiffness: float
    sign: float
    B: float
    hidden: tuple[float, float, float]
    third: int = 1

    def at_rates(self, K, first, second, hand=NO_HAND):
        """The map of a frame in which all blocks have a rate of their own.

        States: position, velocity, what both holds show, the hidden block, and the last position.
        """
        mass, damping, stiffness = (
            own + more for own, more in zip((self.mass, self.damping, self.stiffness), hand, strict=True)
        )
        flow = expm(np.array([[0, 1, 0], [-stiffness / mass, -damping / mass, 1 / mass], [0, 0, 0]]) * TICK)[:2]
        a, gain, push = self.hidden
        x, v, held, speed, h, last = np.eye(6)
        for tick in range(int(np.lcm.reduce([first, second, self.third]))):
            held = x if tick % first == 0 else held
            speed, last = (x - last) / TICK if tick % second == 0 else speed, x
            f = self.sign * K * held - self.B * speed + push * h
            if tick % self.third == 0:
                h = a * h + gain * x
            x, v = flow @ np.array([x, v, f])
        return np.array([x, v, held, speed, h, last])

    def tables(self, first, second, **more):
        """The spec of the loop; first, second: ticks between two runs of both holds."""
        a, gain, push = self.hidden
        hidden = push or gain or abs(a) > 1
        blocks = {"m": {"type": "mass", "mass": self.mass, "damping": self.damping, "stiffness": self.stiffness}}
        blocks["h"] = {"type": "hold", "every": first}
        wires = {"h.u": "m.x", "m.f": f"push + {self.sign!r}*K*h.y"}
        if self.B:
            blocks |= {"d": {"type": "difference"}, "s": {"type": "hold", "every": second}}
            wires |= {"d.u": "m.x", "s.u": "d.y", "m.f": wires["m.f"] + f" - {self.B!r}*s.y"}
        if hidden:
            blocks["z"] = {"type": "ss", "every": self.third, "discrete": True, "A": [[a]], "B": [[1.0]], "C": [[1.0]]}
            wires |= {"z.u": f"{gain!r}*m.x", "m.f": wires["m.f"] + f" + {push!r}*z.y"}
        return {
            "rates": {"tick_hz": 1 / TICK},
            "numbers": {"K": 50.0},
            "block": blocks,
            "wire": wires,
            "ports": {"hand": {"force": "push", "displacement": "m.x"}},
            "sweep": {"along": "K", "K": {"start": 0, "stop": 2000}},
            **more,
        }


def radius_of(matrix):
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def pushed(rng, third=1):
    """A random loop: most have a positive wall, some push, stand on a negative spring or hold a block that runs away."""
    mass = float(10 ** rng.uniform(-2, 0))
    unstable = rng.random() < 0.3
    hidden = (
        float(rng.uniform(1.001, 1.2) if unstable else rng.uniform(-0.9, 0.99)),
        *(rng.normal(size=2) * (rng.random(2) < 0.4)),
    )
    return Pushed(
        mass,
        float(10 ** rng.uniform(-1, 1)),
        float(rng.choice([0.0, 0.0, 10 ** rng.uniform(0, 3), -(10 ** rng.uniform(0, 2))])),
        float(rng.choice([-1.0, -1.0, 1.0])),
        float(rng.choice([0.0, rng.uniform(0, 2)])),
        tuple(map(float, hidden if rng.random() < 0.4 else (0.0, 0.0, 0.0))),
        third=third,
    )


def drawn_hands(rng):
    """Every passive hand, or a box of hands, of a drawn loop with up to three rates."""
    *every, third = (int(each) for each in rng.choice([1, 2, 3, 4, 6], 3))
    loop = pushed(rng, third if rng.random() < 0.5 else 1)
    box = None if rng.random() < 0.6 else BOX
    words = "passive" if box is None else IN_WORDS

    def member(rng, K):
        hand = hand_of(rng, box)
        return radius_of(loop.at_rates(K, *every, hand)), {"hand": hand}

    return Claim(loop.tables(*every), "K", words, member)


def word_of(rng, lengths):
    """Some frames, often one for ever."""
    return [int(each) for each in rng.choice(lengths, 1 if rng.random() < 0.4 else int(rng.integers(2, 7)))]


def margins_for_all(tables):
    """What is claimed of gain and phase at the first hold, for all of a range."""
    margins = wavesweep.compile(tables).margins("h.y")
    margins = margins[(margins["guarantee"] == "for_all") & margins["value"].notna()].set_index("margin")["value"]
    nearest = {"gain_up": 1.0, "gain_down": 1.0, "phase": 0.0}
    return [{"low": nearest[name], "high": margins[name], "of": {"name": name}} for name in nearest if name in margins]


def box_margins(rng):
    """Gain and phase of the first hold that a loop may lose for every mass of a range."""
    loop, every = pushed(rng), [int(each) for each in rng.choice([1, 2], 2)]
    ends = loop.mass, 1.2 * loop.mass
    rng.random()  # as the seed of the test has it
    gains = 10 ** rng.uniform(-1, 3, 10)
    K = next((float(K) for K in gains if radius_of(loop.at_rates(K, *every)) < 1), float(gains[0]))

    def member(rng, value, name):
        mass = float(rng.choice([*ends, rng.uniform(*ends)]))
        factor = np.exp(1j * np.radians(value)) if name == "phase" else value
        return radius_of(loop.at_rates(K * factor, *every, (mass - loop.mass, 0.0, 0.0))), {"mass": mass, "margin": name}

    tables = loop.tables(*every, for_all={"w": {"start": ends[0], "stop": ends[1]}})
    tables["numbers"] |= {"K": K, "w": ends[0]}
    tables["block"]["m"]["mass"] = "w"
    return Claim(tables, "K", "", member, rows_of=margins_for_all)


def built_in(rng):
    """A built-in controller with every passive hand or a box of hands, perhaps in frames that vary; members are plain loops."""
    values = random_values(int(rng.integers(2**31)))
    ratio = int(rng.choice([2, 3, 4, 6]))
    lengths = sorted({ratio, *(int(each) for each in rng.choice([2, 3, 4, 5, 6], 2))})
    with_frame = rng.random() < 0.3
    vary = rng.random() < 0.6
    words = "passive" if vary or rng.random() < 0.6 else IN_WORDS
    values |= {"controller.kind": str(rng.choice(DIRECT))} if vary else {}
    values |= {"environment.integration": "explicit", "device.velocity": "difference", "local_model.B_LM": 0.0}
    values |= dict.fromkeys(HAND, 0.0)
    values |= {
        "rates.ratio": ratio,
        "environment.delay": "frame" if with_frame else int(rng.choice([0, 1, 2, min(lengths), ratio])),
        "device.damping": float(10 ** rng.uniform(-0.5, 1)),
        "environment.B_VE": float(rng.choice([0.0, rng.uniform(0, 2)])),
    }
    if words == "passive":
        values["device.mass"] = float(10 ** rng.uniform(-3, 0))  # a light device is the worst of hands
    if not with_frame:
        values["environment.delay"] = min(values["environment.delay"], min(lengths) if vary else ratio)
    tables = nested(values) | {"sweep": {"K_VE": {"start": 0, "stop": 3000}}}
    tables["environment"]["step"] = "elapsed"
    if vary:
        tables["for_all"] = {VARY: {"values": lengths, "varying": True}}
    box = BOX if words == IN_WORDS else None

    def member(rng, K):
        length = int(rng.choice(lengths)) if vary else ratio
        late = length if with_frame else values["environment.delay"]
        if vary and values["controller.kind"] == "dc-slow" and rng.random() < 0.5:
            word, hand = word_of(rng, lengths), random_hand(rng)
            device = values["device.mass"], values["device.damping"]
            frames = [(ticks, ticks if with_frame else late) for ticks in word]
            wall, tick = (K, values["environment.B_VE"]), 1 / values["rates.fast_hz"]
            return growth(hand, device, wall, frames, tick), {"word": word, "hand": hand}
        own = values | {"rates.ratio": length, "environment.delay": late, "environment.K_VE": K}
        hand = hand_of(rng, box)
        own |= dict(zip(HAND, hand, strict=True))
        return float(wavesweep.compile(nested(own)).spectral_radius()), {"ticks": length, "hand": hand}

    return Claim(tables, "K_VE", words, member)


def every_hand_damping(rng):
    """The damping that `check` says is enough for every passive hand while frames vary; members resonate with a light device.

    A hand that holds the device with a spring leaves nothing but its damping at their frequency, so that any lack of it shows.
    """
    values = random_values(int(rng.integers(2**31)), str(rng.choice(DIRECT)))
    lengths = sorted({int(each) for each in rng.choice([2, 3, 4, 5, 6], 2, replace=False)})
    delay = rng.choice(["frame", "0", "1", str(lengths[0])])
    values |= {"rates.ratio": lengths[0], "environment.delay": "frame" if delay == "frame" else int(delay)}
    values |= {"environment.integration": "explicit", "device.velocity": "difference", "local_model.B_LM": 0.0}
    values |= dict.fromkeys(HAND, 0.0) | {"device.mass": 1e-4}
    values["environment.K_VE"], values["local_model.K_LM"] = (10 ** rng.uniform(1, 3, 2)).tolist()
    values["environment.B_VE"] = float(rng.choice([0.0, rng.uniform(0, 1)]))
    tables = nested(values) | {"for_all": {VARY: {"values": lengths, "varying": True}}}
    tables["environment"]["step"] = "elapsed"

    def rows_of(tables):
        needed = (every_hand.damping(load(tables)) or {}).get("needed")
        return [{"low": 1.5 * needed, "high": needed}] if needed else []  # the nearer to the second, the more it says

    def member(rng, value):
        length = int(rng.choice(lengths))
        own = values | {"rates.ratio": length, "device.damping": float(value)}
        own["environment.delay"] = length if delay == "frame" else int(delay)
        own["operator.mass"] = float(10 ** rng.uniform(-4, -2))
        lines = np.pi * values["rates.fast_hz"] / length * np.arange(1, length + 1)  # where samples may keep their phase
        omega = np.append(lines * rng.uniform(0.97, 1.03, (20, length)), np.pi * values["rates.fast_hz"] * rng.random(100))
        stiffness = (own["operator.mass"] + values["device.mass"]) * omega**2
        radius = wavesweep.compile(nested(own)).spectral_radius(**{"operator.stiffness": stiffness})
        facts = {"ticks": length, "mass": own["operator.mass"], "omega": float(omega[radius.argmax()])}
        return float(radius.max()), facts

    return Claim(tables, "K_VE", "", member, rows_of=rows_of)
