"""Random specs with claims about sets, and members of these sets, computed by a march or by the plain loop of one member.

A drawn loop is a mass that two holds, or a hold and a channel, and a hidden block push, or two such masses; it is marched here
tick by tick. A loop of a built-in controller has members that are plain loops of one length of frames, with one hand, and
words of frames that `simulate` runs, or the march of a slow wall.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg import expm

import wavesweep
from support.marched_hands import growth, random_hand
from support.specs import nested, random_values
from wavesweep.for_all import every_hand
from wavesweep.program.spec import load

SURELY = 1e-7  # above 1, from which on a radius contradicts
CLEARLY = 1e-3  # below 1, from which on a value that no row has is missing
GRID = 40  # values among which those are looked for
NO_HAND = 0.0, 0.0, 0.0
HAND = "operator.mass", "operator.damping", "operator.stiffness"
BOX, IN_WORDS = ((0.01, 0.1), (0.0, 1.0), (0.0, 300.0)), "box:mass=0.01..0.1,damping=0..1,stiffness=0..300"
GROWS, FIRST = 3.0, 1.1  # of steps from one third of a run to the next, which contradicts, and of a first, short run
SETTLED = 1e-6  # of the largest step, below which others are rounding
SLOW = "dc-slow", "dc-lm", "pmw", "pmw-lm"  # controllers with frames, the first two without waves
ZERO = -1  # in place of the tick of a sample
SHARES = 0.5, 1 - 1e-6  # of an interval, where it is asked beside a random one
EVERY = {"n": lambda n: n, "2*n": lambda n: 2 * n, "n+1": lambda n: n + 1, "k": lambda n: 3 * n}  # k = "3*n"
VARY = "rates.ratio"


@dataclass(frozen=True)
class Claim:
    """A spec, its number along which it is claimed, the hands, and a draw of a member's radius at a value of the number.

    whole: the radius of all that is claimed of, where it is one matrix; then no stable value may be missing among the rows.
    rows_of: a function of the spec in place of its intervals. share: of the tries, for members that take longer.
    """

    tables: dict
    along: str
    hands: str
    member: Callable
    kind: str
    whole: Callable | None = None
    rows_of: Callable | None = None
    share: float = 1.0
    facts: dict = field(default_factory=dict)

    @cached_property
    def rows(self):
        """The rows that are claimed, each with low, high and more; none where the spec is refused."""
        try:
            if self.rows_of:
                return self.rows_of(self.tables)
            table = wavesweep.zwidth(self.tables, self.along, self.hands or ())
        except (wavesweep.SpecError, wavesweep.UsageError) as error:
            self.facts["refused"] = str(error)
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
        """What the claim does not hold for: a member or a stable value that is missing, with the number's value; or None.

        longer: a factor of every interval, with which the claim is false.
        """
        for row in self.stated * max(1, round(tries * self.share)):
            share = rng.choice([*SHARES, rng.random()]) * longer
            value = row["low"] + share * (row["high"] - row["low"])
            radius, member = self.member(rng, value, **row.get("of", {}))
            if radius > 1 + SURELY:
                return {"value": value, "radius": float(radius), "member": member, "row": (row["low"], row["high"])}
        return self.missing(rng, self.stated) if self.whole and self.rows else None

    def missing(self, rng, stated):
        """A stable value outside of all rows, or a place at which a row is said to be refuted, and is not."""
        span = self.tables["sweep"][self.along]
        for row in stated:
            for refuted in (row.get("fails_below"), row.get("fails_from")):
                if refuted is not None and refuted > span["start"] and (radius := self.whole(refuted)) < 1 - SURELY:
                    return {"value": refuted, "radius": radius, "refuted": True, "row": (row["low"], row["high"])}
        if "fails_from" not in self.rows[0] and not all(row["certified"] for row in self.rows):
            return None
        ends = [(_outer(row, "low", "fails_below", -1), _outer(row, "high", "fails_from", 1)) for row in stated]
        for value in span["start"] + (span["stop"] - span["start"]) * rng.random(GRID):
            if not any(low <= value <= high for low, high in ends) and (radius := self.whole(value)) < 1 - CLEARLY:
                return {"value": value, "radius": radius, "missing": True, "row": ends}
        return None


def _outer(row, end, refuted, sign):
    """Up to where a row says something: its end, or what is refuted beyond it, and away from it by rounding."""
    known = [each for each in (row[end], row.get(refuted)) if each is not None and np.isfinite(each)]
    return sign * max(sign * each for each in known) + sign * SURELY * abs(row["high"])


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
    third: int = 1

    def march(self, K, frames, hand=NO_HAND):
        """The map of a word of frames: (ticks, whether the first hold takes its sample), all with a sample at their begin."""
        begins = np.cumsum([0, *(ticks for ticks, _ in frames)])
        shows, runs = [None] * int(begins[-1]), [False] * int(begins[-1])
        for begin, (_, there) in zip(begins, frames, strict=False):
            runs[begin], shows[begin] = True, int(begin) if there else ZERO if self.missing == "zero" else None
        return self.marched(K, shows, runs, hand)

    def marched(self, K, shows, runs, hand=NO_HAND):
        """The map of some ticks. States: position, velocity, what both holds show, the hidden block, and the last position.

        shows: the tick of the sample that the first hold shows from now on, None while it holds. runs: whether the second does.
        """
        mass, damping, stiffness = (
            own + more for own, more in zip((self.mass, self.damping, self.stiffness), hand, strict=True)
        )
        flow = expm(np.array([[0, 1, 0], [-stiffness / mass, -damping / mass, 1 / mass], [0, 0, 0]]) * self.tick)[:2]
        a, gain, push = self.hidden
        x, v, held, speed, h, last = np.eye(6)
        places = []
        for tick, (shown, steps) in enumerate(zip(shows, runs, strict=True)):
            places.append(x)
            held = held if shown is None else 0 * x if shown == ZERO else places[shown]
            speed, last = (x - last) / self.tick if steps else speed, x
            f = self.sign * K * held - self.B * speed + push * h
            if tick % self.third == 0:
                h = a * h + gain * x
            x, v = flow @ np.array([x, v, f])
        return np.array([x, v, held, speed, h, last])

    def at_rates(self, K, first, second, hand=NO_HAND):
        """The map of a frame in which all blocks have a rate of their own."""
        ticks = range(int(np.lcm.reduce([first, second, self.third])))
        return self.marched(K, [tick if tick % first == 0 else None for tick in ticks], [t % second == 0 for t in ticks], hand)

    def of_messages(self, K, late, every, second):
        """The map of some messages, each late by some ticks, or None of one that is lost; all arrive before the map ends."""
        ticks, newest, shows = len(late) * every, -1, []
        for tick in range(ticks):
            here = [i for i, each in enumerate(late) if each is not None and i * every + each == tick and i > newest]
            newest = max(here, default=newest)
            nothing = ZERO if self.missing == "zero" and tick % every == 0 else None
            shows.append(newest * every if here else nothing)
        return self.marched(K, shows, [tick % second == 0 for tick in range(ticks)])

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
            blocks["z"] = {"type": "ss", "every": self.third, "discrete": True, "A": [[a]], "B": [[1.0]], "C": [[1.0]]}
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


def pushed(rng, missing="held", third=1):
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
        third=third,
    )


def three_rates(rng):
    """A loop whose blocks have rates of their own, and those of both holds."""
    first, second, third = (int(each) for each in rng.choice([1, 2, 3, 4, 6], 3))
    return pushed(rng, third=third if rng.random() < 0.5 else 1), first, second


def drawn_hands(rng):
    """Every passive hand, or a box of hands, of a drawn loop with up to three rates."""
    loop, *every = three_rates(rng)
    box = None if rng.random() < 0.6 else BOX
    words = "passive" if box is None else IN_WORDS

    def member(rng, K):
        hand = hand_of(rng, box)
        return radius_of(loop.at_rates(K, *every, hand)), {"hand": hand}

    tables = loop.tables({"every": every[0]}, {"every": every[1]})
    return Claim(tables, "K", words, member, "drawn hands" if box is None else "drawn box")


def drawn_alone(rng):
    """A drawn loop with up to three rates by itself, all of whose stable values are claimed."""
    loop, *every = three_rates(rng)

    def whole(K):
        return radius_of(loop.at_rates(K, *every))

    tables = loop.tables({"every": every[0]}, {"every": every[1]})
    return Claim(tables, "K", "", lambda _, K: (whole(K), {}), "drawn alone", whole)


def drawn_frames(rng):
    """Frames that vary in any order, with `every` an expression of the number; some for every passive hand, or a range."""
    loop, numbers = pushed(rng), sorted({int(each) for each in rng.choice([1, 2, 3], 2, replace=False)})
    name = str(rng.choice(list(EVERY)))
    other = name if rng.random() < 0.8 else str(rng.choice(list(EVERY)))
    lengths = [EVERY[name](n) for n in numbers]
    kind = str(rng.choice(["", "passive", "range"], p=[0.6, 0.3, 0.1]))
    masses = loop.mass, 1.1 * loop.mass

    def member(rng, K):
        hand = hand_of(rng) if kind == "passive" else NO_HAND
        if kind == "range":
            hand = float(rng.choice([0.0, rng.random(), 1.0])) * (masses[1] - masses[0]), 0.0, 0.0
        if other != name:  # only numbers that stay: then holds have rates of their own
            n = int(rng.choice(numbers))
            every = [EVERY[name](n), EVERY[other](n)]
            return radius_of(loop.at_rates(K, *every, hand)), {"n": n, "hand": hand}
        word = word_of(rng, lengths)
        return radius_of(loop.march(K, [(ticks, True) for ticks in word], hand)), {"word": word, "hand": hand}

    more = {"for_all": {"n": {"values": numbers, "varying": True}}}
    tables = loop.tables({"every": name}, {"every": other}, **more)
    tables["numbers"] |= {"n": numbers[0]} | ({"k": "3*n"} if "k" in (name, other) else {})
    if kind == "range":
        tables["numbers"]["w"], tables["block"]["m"]["mass"] = masses[0], "w"
        tables["for_all"]["w"] = {"start": masses[0], "stop": masses[1]}
    return Claim(tables, "K", kind if kind == "passive" else "", member, ", ".join(filter(None, ["drawn frames", kind])))


def word_of(rng, lengths):
    """Some frames, often one for ever."""
    return [int(each) for each in rng.choice(lengths, 1 if rng.random() < 0.4 else int(rng.integers(2, 7)))]


def drawn_messages(rng):
    """Messages that are late or lost in any pattern."""
    every = int(rng.choice([1, 2, 3]))
    second = every * int(rng.choice([1, 1, 2]))
    loop = pushed(rng, str(rng.choice(["held", "zero"])))
    lost, late = ((1, 0), (2, 0), (0, 1), (0, 2), (1, 1))[int(rng.integers(5))]

    def member(rng, K):
        word, count = [], int(rng.integers(1, 6)) * second // every
        while len(word) < count:
            in_a_row = next((i for i, each in enumerate(reversed(word)) if each is not None), len(word))
            word.append(None if in_a_row < lost and rng.random() < 0.5 else int(rng.integers(0, late + 1)))
        word[-1] = 0  # so that repetitions keep to the number in a row
        word = [each and min(each, (count - i) * every - 1) for i, each in enumerate(word)]
        return radius_of(loop.of_messages(K, word, every, second)), {"late": word}

    tables = loop.tables({"every": every, "missing": loop.missing, "lost": lost, "late": late}, {"every": second})
    tables["block"]["h"]["type"] = "channel"
    return Claim(tables, "K", "", member, "messages" if not late else "late messages")


def mean_square(rng):
    """Messages that are lost at random, along a gain, or along their probability."""
    every, missing = int(rng.choice([1, 2, 3])), str(rng.choice(["held", "zero"]))
    loop, p, gain = pushed(rng, missing), float(rng.uniform(0, 0.6)), float(10 ** rng.uniform(0, 3))
    along = str(rng.choice(["K", "p"]))

    def whole(value):
        K, share = (value, p) if along == "K" else (gain, value)
        come, lost = (loop.march(K, [(every, there)]) for there in (True, False))
        return radius_of((1 - share) * np.kron(come, come) + share * np.kron(lost, lost))

    first = {"every": every, "missing": missing, "loss": "p"}
    tables = loop.tables(
        first, {"every": every}, sweep={"along": along, along: {"start": 0, "stop": 2000 if along == "K" else 1}}
    )
    tables["numbers"] |= {"K": gain, "p": p}
    tables["block"]["h"]["type"] = "channel"
    return Claim(tables, along, "", lambda _, value: (whole(value), {}), f"mean square along {along}", whole)


def ranged(rng, rates=(1, 2, 4), widest=3.0):
    """A loop, its rates, and the ends of its mass, which is not known."""
    loop, every = pushed(rng), [int(each) for each in rng.choice(rates, 2)]
    return loop, every, (loop.mass, float(loop.mass * rng.uniform(1.2, widest)))


def with_range(loop, every, ends, **more):
    """The tables of a loop whose mass is between two ends."""
    tables = loop.tables({"every": every[0]}, {"every": every[1]}, for_all={"w": {"start": ends[0], "stop": ends[1]}}, **more)
    tables["numbers"]["w"], tables["block"]["m"]["mass"] = ends[0], "w"
    return tables


def drawn_ranges(rng):
    """A number that is not known, but constant."""
    loop, every, ends = ranged(rng)

    def member(rng, K):
        mass = float(rng.choice([*ends, rng.uniform(*ends)]))
        return radius_of(loop.at_rates(K, *every, (mass - loop.mass, 0.0, 0.0))), {"mass": mass}

    return Claim(with_range(loop, every, ends), "K", "", member, "drawn ranges")


def margins_for_all(tables):
    """What is claimed of gain and phase at the first hold, for all of a range."""
    margins = wavesweep.compile(tables).margins("h.y")
    margins = margins[(margins["guarantee"] == "for_all") & margins["value"].notna()].set_index("margin")["value"]
    nearest = {"gain_up": 1.0, "gain_down": 1.0, "phase": 0.0}
    return [{"low": nearest[name], "high": margins[name], "of": {"name": name}} for name in nearest if name in margins]


def box_margins(rng):
    """Gain and phase of the first hold that a loop may lose for every mass of a range."""
    loop, every, ends = ranged(rng, (1, 2), 1.2)
    gains = 10 ** rng.uniform(-1, 3, 10)
    K = next((float(K) for K in gains if radius_of(loop.at_rates(K, *every)) < 1), float(gains[0]))

    def member(rng, value, name):
        mass = float(rng.choice([*ends, rng.uniform(*ends)]))
        factor = np.exp(1j * np.radians(value)) if name == "phase" else value
        return radius_of(loop.at_rates(K * factor, *every, (mass - loop.mass, 0.0, 0.0))), {"mass": mass, "margin": name}

    tables = with_range(loop, every, ends)
    tables["numbers"]["K"] = K
    return Claim(tables, "K", "", member, "margins of a box", rows_of=margins_for_all)


def terminated(loops, K, g, hands, tick=1e-3):
    """The map of a tick of two masses, coupled by a spring of which a share g comes back, with a passive network at each.

    hands: mass, damping and stiffness of each network, as trapezoids: their forces are held over a tick and take out no
    energy. States: positions, velocities, both springs' forces, which are a tick late, and each mass's force and step.
    """
    state = np.eye(10)
    x, v, held, inertial, step = (list(state[i : i + 2]) for i in range(0, 10, 2))
    new = K * (x[0] - x[1])
    forces = -g * held[0], held[1]
    for i, (loop, (mass, damping, stiffness)) in enumerate(zip(loops, hands, strict=True)):
        matrix = np.array([[0, 1, 0], [-loop[2] / loop[0], -loop[1] / loop[0], 1 / loop[0]], [0, 0, 0]])
        flow = expm(matrix * tick)[:2]
        own = -inertial[i] + 2 * mass / tick**2 * step[i] - stiffness * x[i]  # and -yields times the step of this tick
        yields = 2 * mass / tick**2 + damping / tick + stiffness / 2
        free = flow[0] @ np.array([x[i], v[i], forces[i] + own]) - x[i]
        moved = free / (1 + flow[0, 2] * yields)
        v[i] = flow[1] @ np.array([x[i], v[i], forces[i] + own - yields * moved])
        inertial[i] = -inertial[i] - 2 * mass / tick**2 * (moved - step[i]) if mass else 0 * moved
        x[i], step[i] = x[i] + moved, moved
    return np.array([*x, *v, new, new, *inertial, *step])


def two_ports(rng):
    """A loop with two ports, coupled by a spring whose force comes back a tick late, for every pair of passive networks."""
    loops = [
        (float(10 ** rng.uniform(-2, 0)), float(10 ** rng.uniform(-1, 1)), float(rng.choice([0.0, 50.0]))) for _ in range(2)
    ]
    K = float(10 ** rng.uniform(1, 3.5))
    blocks = {
        name: dict(zip(("type", "mass", "damping", "stiffness"), ("mass", *loop), strict=True))
        for name, loop in zip("ab", loops, strict=True)
    }
    blocks |= {"net": {"type": "delay", "steps": 1}}
    wires = {"net.u": f"{K!r}*(a.x - b.x)", "a.f": "hand - g*net.y", "b.f": "contact + net.y"}
    ports = {"hand": {"force": "hand", "displacement": "a.x"}, "environment": {"force": "contact", "displacement": "b.x"}}
    tables = {"rates": {"tick_hz": 1000}, "numbers": {"g": 0.1}, "block": blocks, "wire": wires, "ports": ports}
    tables["sweep"] = {"along": "g", "g": {"start": 0, "stop": 2}}

    def member(rng, g):
        hands = [hand_of(rng), hand_of(rng)]
        return radius_of(terminated(loops, K, g, hands)), {"hands": hands}

    return Claim(tables, "g", "ports", member, "two ports", share=5.0)


def built_in(rng):
    """A built-in controller with every passive hand, a box of hands, frames that vary, or both; members are plain loops."""
    values = random_values(int(rng.integers(2**31)))
    ratio = int(rng.choice([2, 3, 4, 6]))
    lengths = sorted({ratio, *(int(each) for each in rng.choice([2, 3, 4, 5, 6], 2))})
    with_frame = rng.random() < 0.3
    vary, words = rng.random() < 0.6, ""
    values |= {"controller.kind": str(rng.choice(SLOW))} if vary else {}
    if not vary or rng.random() < 0.6:
        words = "passive" if vary or rng.random() < 0.6 else IN_WORDS
        values |= {"controller.kind": str(rng.choice(SLOW[:2]))} if vary else {}
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
        if vary and words and values["controller.kind"] == "dc-slow" and rng.random() < 0.5:
            word, hand = word_of(rng, lengths), random_hand(rng)
            device = values["device.mass"], values["device.damping"]
            frames = [(ticks, ticks if with_frame else late) for ticks in word]
            wall, tick = (K, values["environment.B_VE"]), 1 / values["rates.fast_hz"]
            return growth(hand, device, wall, frames, tick), {"word": word, "hand": hand}
        own = values | {"rates.ratio": length, "environment.delay": late, "environment.K_VE": K}
        hand = hand_of(rng, box) if words else None
        if hand:
            own |= dict(zip(HAND, hand, strict=True))
        return float(wavesweep.compile(nested(own)).spectral_radius()), {"ticks": length, "hand": hand}

    kind = f"built in{', frames' if vary else ''}{', ' + words.partition(':')[0] if words else ''}"
    return Claim(tables, "K_VE", words, member, kind)


def every_hand_damping(rng):
    """The damping that `check` says is enough for every passive hand while frames vary; members resonate with a light device.

    A hand that holds the device with a spring leaves nothing but its damping at their frequency, so that any lack of it shows.
    """
    values = random_values(int(rng.integers(2**31)), str(rng.choice(SLOW[:2])))
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

    return Claim(tables, "K_VE", "", member, "damping for every hand", rows_of=rows_of)


def run(tables, word, ticks):
    """By how much the steps of a loop grow between the second and the last third of a run of some frames, repeated."""
    seconds = ticks / tables["rates"]["fast_hz"]
    given = {"frames": word, "input": "pulse", "width_s": 1 / tables["rates"]["fast_hz"], "duration_s": seconds}
    steps = np.abs(np.diff(wavesweep.compile(tables | {"simulate": given}).simulate()["x"]))
    _, middle, last = np.array_split(steps, 3)  # a run that overflows ends early
    return float(last.max() / max(middle.max(), SETTLED * steps.max()))


def built_in_words(rng):
    """A built-in controller whose frames vary, or when their results come, or whether; members are runs of some frames."""
    values = random_values(int(rng.integers(2**31)), str(rng.choice(SLOW))) | {"environment.K_VE": 100.0}
    lengths = sorted({int(each) for each in rng.choice([2, 3, 4, 5, 6], 2, replace=False)})
    way = str(rng.choice(["frames", "delays", "lost", "next frame"]))
    delays = [0, 1] if way == "delays" else [int(rng.choice([0, 1, 2]))]
    if way in ("delays", "lost"):
        lengths = lengths[-1:]
    values |= {"rates.ratio": lengths[0], "environment.delay": "frame" if way == "next frame" else delays[0]}
    tables = nested(values) | {"sweep": {"K_VE": {"start": 0, "stop": 3000}}}
    tables["environment"]["step"] = str(rng.choice(["elapsed", "nominal"]))
    tables["for_all"] = {
        "lost": {"lost": 1},
        "delays": {"environment.delay": {"values": delays, "varying": True}},
    }.get(way, {VARY: {"values": lengths, "varying": True}})

    def member(rng, K):
        word = [{"ticks": ticks} for ticks in word_of(rng, lengths)]
        for before, frame in zip([None, *word], word, strict=False):
            if way != "next frame":
                frame["delay"] = int(rng.choice(delays))
            if way == "lost" and before and not before.get("lost"):
                frame["lost"] = bool(rng.random() < 0.5)
        own = tables | {"environment": tables["environment"] | {"K_VE": K}}
        return (1.0 if run(own, word, 600) < FIRST else max(1.0, run(own, word, 6000) / GROWS)), {"word": word}

    return Claim(tables, "K_VE", "", member, f"built in, words of {way}", share=0.2)


KINDS = (
    drawn_hands,
    drawn_frames,
    drawn_messages,
    drawn_ranges,
    built_in,
    drawn_alone,
    mean_square,
    box_margins,
    two_ports,
    built_in_words,
    every_hand_damping,
)
