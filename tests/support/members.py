"""Random specs with claims about sets, and members of these sets, computed by a march or by the plain loop of one member.

A drawn loop is a mass that two holds, or channels, and a hidden block push; it is marched here tick by tick. A loop of a
built-in controller has members that are plain loops of one length of frames, with one hand.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

import wavesweep
from support.specs import nested, random_values

SURELY = 1e-7  # above 1, from which on a radius contradicts
SHARES = 0.5, 1 - 1e-6  # of an interval, where it is asked beside a random one
EVERY = {"n": lambda n: n, "2*n": lambda n: 2 * n, "n+1": lambda n: n + 1, "k": lambda n: 3 * n}  # k = "3*n"
VARY = "rates.ratio"


@dataclass(frozen=True)
class Claim:
    """A spec, its number along which it is claimed, the hands, and a draw of a member's radius at a value of the number."""

    tables: dict
    along: str
    hands: str
    member: object
    kind: str
    facts: dict = field(default_factory=dict)

    def rows(self):
        """The ends that are claimed, (low, high), () where the spec is refused."""
        try:
            table = wavesweep.zwidth(self.tables, self.along, self.hands or ())
        except (wavesweep.SpecError, wavesweep.UsageError) as error:
            self.facts["refused"] = str(error)
            return []
        table = table[table["intervals"] > 0]
        if "guarantee" in table:
            table = table[table["guarantee"] != "spec"]
        if "hand" in table:
            table = table[table["hand"] == self.hands.partition(":")[0]]
        return table[["low", "high"]].to_numpy().tolist()

    def contradicted(self, rng, tries):
        """A member that a row of the claim does not hold for, with the value of the number and its radius; None without."""
        rows = self.rows()
        self.facts["rows"] = len(rows)
        for low, high in rows * (tries if rows else 0):
            share = rng.choice([*SHARES, rng.random()])
            value = low + share * (high - low)
            radius, member = self.member(rng, value)
            if radius > 1 + SURELY:
                return {"value": value, "radius": float(radius), "member": member, "row": (low, high)}
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
    tick: float = 1e-3
    missing: str = "held"

    def march(self, K, frames, hand=(0.0, 0.0, 0.0)):
        """The map of a word of frames: (ticks, whether the first hold takes its sample), all with a sample at their begin.

        States: position, velocity, what both holds show, the hidden block, and the last position.
        """
        samples = [(there if tick == 0 else None, tick == 0) for ticks, there in frames for tick in range(ticks)]
        return self.marched(K, samples, hand)

    def marched(self, K, samples, hand=(0.0, 0.0, 0.0)):
        """The map of some ticks: whether the first hold gets a sample, None while it holds, and whether the second does."""
        mass, damping, stiffness = (
            own + more for own, more in zip((self.mass, self.damping, self.stiffness), hand, strict=True)
        )
        flow = expm(np.array([[0, 1, 0], [-stiffness / mass, -damping / mass, 1 / mass], [0, 0, 0]]) * self.tick)[:2]
        a, gain, push = self.hidden
        x, v, held, speed, h, last = np.eye(6)
        for comes, runs in samples:
            held = held if comes is None else x if comes else 0 * x if self.missing == "zero" else held
            speed, last = (x - last) / self.tick if runs else speed, x
            f = self.sign * K * held - self.B * speed + push * h
            h = a * h + gain * x
            x, v = flow @ np.array([x, v, f])
        return np.array([x, v, held, speed, h, last])

    def at_rates(self, K, first, second, hand=(0.0, 0.0, 0.0)):
        """The map of a frame in which both holds have a rate of their own."""
        ticks = range(int(np.lcm(first, second)))
        return self.marched(K, [(True if tick % first == 0 else None, tick % second == 0) for tick in ticks], hand)

    def tables(self, first, second, **more):
        """The spec of the loop: the keys of both holds."""
        a, gain, push = self.hidden
        hidden = push or gain or abs(a) > 1
        blocks = {"m": {"type": "mass", "mass": self.mass, "damping": self.damping, "stiffness": self.stiffness}}
        blocks["h"] = {"type": "hold", **first}
        wires = {"h.u": "m.x", "m.f": f"push + {self.sign!r}*K*h.y"}
        if self.B:
            blocks |= {"d": {"type": "difference"}, "s": {"type": "hold", **second}}
            wires |= {"d.u": "m.x", "s.u": "d.y", "m.f": wires["m.f"] + f" - {self.B!r}*s.y"}
        if hidden:
            blocks["z"] = {"type": "ss", "discrete": True, "A": [[a]], "B": [[1.0]], "C": [[1.0]]}
            wires |= {"z.u": f"{gain!r}*m.x", "m.f": wires["m.f"] + f" + {push!r}*z.y"}
        return {
            "rates": {"tick_hz": 1 / self.tick},
            "numbers": {"K": 50.0},
            "block": blocks,
            "wire": wires,
            "ports": {"hand": {"force": "push", "displacement": "m.x"}},
            "sweep": {"along": "K", "K": {"start": 0, "stop": 2000}},
            **more,
        }


def radius_of(matrix):
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def pushed(rng, missing="held"):
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
        missing=missing,
    )


def drawn_hands(rng):
    """Every passive hand, or a box of hands, of a drawn loop with one or two rates."""
    loop, every = pushed(rng), [int(each) for each in rng.choice([1, 2, 4, 6], 2)]
    box = None if rng.random() < 0.6 else ((0.01, 0.1), (0.0, 1.0), (0.0, 300.0))
    words = "box:mass=0.01..0.1,damping=0..1,stiffness=0..300" if box else "passive"

    def member(rng, K):
        hand = hand_of(rng, box)
        return radius_of(loop.at_rates(K, *every, hand)), {"hand": hand}

    tables = loop.tables({"every": every[0]}, {"every": every[1]})
    return Claim(tables, "K", words, member, "drawn hands" if box is None else "drawn box")


def drawn_frames(rng):
    """Frames that vary in any order, with `every` an expression of the number; some for every passive hand."""
    loop, numbers = pushed(rng), sorted({int(each) for each in rng.choice([1, 2, 3], 2, replace=False)})
    name = str(rng.choice(list(EVERY)))
    other = name if rng.random() < 0.8 else str(rng.choice(list(EVERY)))
    lengths = [EVERY[name](n) for n in numbers]
    passive = rng.random() < 0.3

    def member(rng, K):
        hand = hand_of(rng) if passive else (0.0, 0.0, 0.0)
        word = [int(each) for each in rng.choice(lengths, int(rng.integers(1, 7)))]
        if rng.random() < 0.4:
            word = word[:1]
        if other != name:  # only numbers that stay: then holds have rates of their own
            n = int(rng.choice(numbers))
            every = [EVERY[name](n), EVERY[other](n)]
            return radius_of(loop.at_rates(K, *every, hand)), {"n": n, "hand": hand}
        return radius_of(loop.march(K, [(ticks, True) for ticks in word], hand)), {"word": word, "hand": hand}

    more = {"for_all": {"n": {"values": numbers, "varying": True}}}
    tables = loop.tables({"every": name}, {"every": other}, **more)
    tables["numbers"] |= {"n": numbers[0]} | ({"k": "3*n"} if "k" in (name, other) else {})
    return Claim(tables, "K", "passive" if passive else "", member, "drawn frames, passive" if passive else "drawn frames")


def drawn_messages(rng):
    """Messages lost in any pattern, or at random."""
    at_random, every = rng.random() < 0.5, int(rng.choice([1, 2, 3]))
    loop = pushed(rng, str(rng.choice(["held", "zero"])))
    most, p = int(rng.integers(1, 3)), float(rng.uniform(0, 0.6))
    keys = {"loss": p} if at_random else {"lost": most}
    first = {"every": every, "missing": loop.missing, **keys}

    def member(rng, K):
        if at_random:
            come, lost = (loop.march(K, [(every, there)]) for there in (True, False))
            return radius_of((1 - p) * np.kron(come, come) + p * np.kron(lost, lost)), {"p": p}
        word = []
        for _ in range(int(rng.integers(1, 6))):
            word += [(every, True)] + [(every, False)] * int(rng.integers(0, most + 1))
        return radius_of(loop.march(K, word)), {"word": word}

    tables = loop.tables(first, {"every": every})
    tables["block"]["h"]["type"] = "channel"
    return Claim(tables, "K", "", member, "mean square" if at_random else "messages")


def drawn_ranges(rng):
    """Numbers that are not known, but constant, in a range or of a list."""
    loop, every = pushed(rng), [int(each) for each in rng.choice([1, 2, 4], 2)]
    ends = loop.mass, float(loop.mass * rng.uniform(1.2, 3))

    def member(rng, K):
        mass = float(rng.choice([*ends, rng.uniform(*ends)]))
        return radius_of(loop.at_rates(K, *every, (mass - loop.mass, 0.0, 0.0))), {"mass": mass}

    tables = loop.tables({"every": every[0]}, {"every": every[1]}, for_all={"w": {"start": ends[0], "stop": ends[1]}})
    tables["numbers"]["w"], tables["block"]["m"]["mass"] = ends[0], "w"
    return Claim(tables, "K", "", member, "drawn ranges")


def built_in(rng):
    """A built-in controller with every passive hand, a box of hands, frames that vary, or both; members are plain loops."""
    values = random_values(int(rng.integers(2**31)))
    ratio = int(rng.choice([2, 3, 4, 6]))
    lengths = sorted({ratio, *(int(each) for each in rng.choice([2, 3, 4, 5, 6], 2))})
    delay = int(rng.choice([0, 1, 2, ratio]))
    with_frame = rng.random() < 0.3
    vary, words = rng.random() < 0.6, ""
    if not vary or rng.random() < 0.6:
        words = "passive" if vary or rng.random() < 0.6 else "box:mass=0.01..0.1,damping=0..1,stiffness=0..300"
        kinds = ["dc-slow", "dc-lm"]
        values |= {"controller.kind": str(rng.choice(kinds)) if vary else values["controller.kind"]}
        values |= {"environment.integration": "explicit", "device.velocity": "difference", "local_model.B_LM": 0.0}
        values |= dict.fromkeys(("operator.mass", "operator.damping", "operator.stiffness"), 0.0)
    values |= {
        "rates.ratio": ratio,
        "environment.delay": "frame" if with_frame else min(delay, min(lengths) if vary else ratio),
    }
    values |= {
        "device.damping": float(10 ** rng.uniform(-0.5, 1)),
        "environment.B_VE": float(rng.choice([0.0, rng.uniform(0, 2)])),
    }
    tables = nested(values) | {"sweep": {"K_VE": {"start": 0, "stop": 3000}}}
    tables["environment"]["step"] = "elapsed"
    if vary:
        tables["for_all"] = {VARY: {"values": lengths, "varying": True}}
    box = ((0.01, 0.1), (0.0, 1.0), (0.0, 300.0)) if words.startswith("box") else None

    def member(rng, K):
        length = int(rng.choice(lengths)) if vary else ratio
        late = length if with_frame else values["environment.delay"]
        own = values | {"rates.ratio": length, "environment.delay": late, "environment.K_VE": K}
        hand = hand_of(rng, box) if words else None
        if hand:
            own |= dict(zip(("operator.mass", "operator.damping", "operator.stiffness"), hand, strict=True))
        return float(wavesweep.compile(nested(own)).spectral_radius()), {"ticks": length, "hand": hand}

    kind = f"built in{', frames' if vary else ''}{', ' + words.partition(':')[0] if words else ''}"
    return Claim(tables, "K_VE", words, member, kind)


KINDS = drawn_hands, drawn_frames, drawn_messages, drawn_ranges, built_in
