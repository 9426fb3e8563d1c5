"""Random loops of one pole, of which all that commands say is known in closed form.

In each tick `x[k+1] = x[k] + T (r - a x[k] - c f(K) y)`, where y is x at the last sample that came through and f is K, or
`(K - u)(K - v)/v`, which is 0 at u and v. So a frame of n ticks multiplies x by `q - g`, where `q = (1 - a T)^n`,
`g = c f(K) (1 - q)/a` (`n T c f(K)` with a = 0). With up to m samples lost in a row it is as if n were `(m + 1) n`, with a = 0.
If each is lost with probability p, its mean square decays for 0 < g < 2 (1 - p)/(1 + p), with a = 0.

A loop that conserves is a mass on a spring by leapfrog, `v+ = v - T K x`, `x+ = x + T v+`: of it nothing may be said.
"""

from dataclasses import dataclass, field
from itertools import product
from math import exp, inf, log, pi, sqrt

import numpy as np

T = 0.001
START, STOP = 1.0, 5000.0
ASKS = (
    "nothing",
    "frames",
    "numbers",
    "both",
    "losses",
    "contact",
    "radius",
    "settling",
    "damping_ratio",
    "gain",
    "Ms",
    "disk",
)
# Of every tenth seed, in place of those.
AT_RANDOM, CONSERVES = "at random", "conserves"
VARYING = ("frames", "both", "losses", AT_RANDOM)
OF_ONE_TICK = ("damping_ratio", "gain", "Ms", "disk")  # which have a closed form without a hold


@dataclass
class Case:
    """A random spec: its tables, what it asks, the values of its members, and how f depends on K."""

    seed: int
    asks: str
    tables: dict
    members: dict = field(default_factory=dict)
    zeros: tuple = ()
    leak: float = 0.0
    level: float = 0.0
    tick: float = T

    @property
    def start(self):
        """Where the range of K begins."""
        return self.tables["sweep"]["K"]["start"]

    @property
    def own_length(self):
        """Ticks of the spec's own frame."""
        return self.tables["numbers"]["n"]

    @property
    def proved(self):
        """The intervals of each slice in which all members are stable."""
        return [self.inside(self.all_of(c)) for c in self.tables["sweep"].get("c", [None])]

    def held(self, n, c, f):
        """Pole of the frame with a sample of f(K) = f."""
        q = (1 - self.leak * self.tick) ** n
        return q - c * f * ((1 - q) / self.leak if self.leak else n * self.tick)

    def bounds(self, n, c, required, lost=0.0):
        """The open interval of values f for which a frame has what is asked; required: with [sweep] require.

        lost: the probability that a sample is lost.
        """
        q = (1 - self.leak * self.tick) ** n
        low, high = q - 1, q + 1  # of g
        if lost:
            high = 2 * (1 - lost) / (1 + lost)
        if required and self.asks == "radius":
            low, high = q - self.level**n, q + self.level**n
        if required and self.asks == "settling":
            size = exp(-n * self.tick * log(50) / self.level)
            low, high = q - size, q + size
        if required and self.asks == "damping_ratio":
            # Less than a tenth after a tick has every damping ratio.
            high = 1 + max(exp(-pi * self.level / sqrt(1 - self.level**2)), 0.1)
        if required and self.asks == "gain":
            high = 2 * self.level / (1 + self.level)
        if required and self.asks == "Ms":
            high = 2 - 2 / self.level
        if required and self.asks == "disk":
            high = 2 * (2 - self.level) / (2 + self.level)
        per = c * ((1 - q) / self.leak if self.leak else n * self.tick)
        return tuple(sorted((low / per, high / per)))

    def inside(self, members, required=True):
        """The intervals of K in START to STOP with what is asked of all members, as (low, high)."""
        if self.asks == CONSERVES:
            return []
        lost = members.get("lost", 0.0)
        pairs = [self.bounds(n, c, required, lost) for n, c in product(members["n"], members["c"])]
        low = max(each[0] for each in pairs)
        high = min(each[1] for each in pairs)
        if low >= high:
            return []
        if not self.zeros:
            found = [(low, high)]
        else:
            u, v = self.zeros
            middle, half = (u + v) / 2, (v - u) / 2

            def at(f):  # how far from the middle (K - u)(K - v)/v is f
                return sqrt(max(half**2 + v * f, 0.0))

            found = [(middle - at(high), middle - at(low)), (middle + at(low), middle + at(high))]
            if half**2 + v * low < 0:
                found = [(middle - at(high), middle + at(high))]
        clipped = [(max(a, self.start), min(b, STOP)) for a, b in found]
        return [(a, b) for a, b in clipped if a < b]

    def own(self, c=None):
        """The spec's own member, or with another c."""
        numbers = self.tables["numbers"]
        return {"n": [numbers["n"]], "c": [numbers["c"] if c is None else c]}

    def all_of(self, c=None):
        """All members, or with another c."""
        return self.members if c is None else self.members | {"c": [c]}


def drawn(seed):
    """A random case."""
    rng = np.random.default_rng(seed)
    asks = str(rng.choice(ASKS, p=[0.08, 0.14, 0.12, 0.12, 0.12, 0.1, *[0.32 / 6] * 6]))
    asks = {4: AT_RANDOM, 9: CONSERVES}.get(seed % 10, asks)
    lengths = sorted(rng.choice([1, 2, 3, 4, 6], size=rng.integers(1, 4), replace=False).tolist())
    own = 1 if asks in (*OF_ONE_TICK, CONSERVES) else int(rng.choice(lengths)) if rng.random() < 0.8 else 5
    factors = sorted(rng.choice([-1.0, 0.5, 1.0, 2.0], p=[0.1, 0.3, 0.3, 0.3], size=2, replace=False).tolist())
    stiffness = float(np.round(2 / (T * max(lengths) * 2) * rng.choice([0.3, 0.9, 1.5, 3.0]), 3))
    case = Case(seed, asks, {}, {"n": [own], "c": [1.0]})
    if asks not in (*VARYING, "contact", "damping_ratio", CONSERVES) and rng.random() < 0.35:
        case.zeros = (float(rng.choice([200.0, 400.0])), float(rng.choice([900.0, 1500.0])))
    if asks == "contact" or (asks in ("nothing", "numbers") and rng.random() < 0.3):
        case.leak = float(rng.choice([20.0, 50.0]))
    f = "K*h.y" if not case.zeros else f"(K - {case.zeros[0]})*(K - {case.zeros[1]})/{case.zeros[1]}*h.y"
    leak = f" - {case.leak}*p.y" if case.leak else ""
    case.tables = tables = {
        "rates": {"tick_hz": 1 / T},
        "numbers": {"K": stiffness, "n": own, "c": 1.0},
        "block": {"p": {"type": "integrator"}, "h": {"type": "hold", "every": "n"}},
        "wire": {"h.u": "p.y", "p.u": f"c*r{leak} - c*{f}" if asks != "gain" else f"c*{f.replace('h.y', 'r')} - c*{f}"},
        "ports": {"inputs": {"r": "r"}, "outputs": {"y": "p.y"}},
        "sweep": {"along": "K", "K": {"start": START, "stop": STOP}},
    }
    if asks in ("frames", "both"):
        tables["for_all"] = {"n": {"values": lengths, "varying": True}}
        case.members["n"] = lengths
    if asks in ("numbers", "both"):
        one = {"values": factors} if rng.random() < 0.5 else {"start": factors[0], "stop": factors[-1]}
        tables.setdefault("for_all", {})["c"] = one
        case.members["c"] = factors
    if asks == "losses":
        lost = int(rng.integers(1, 3))
        tables["block"]["h"] = {"type": "channel", "every": "n", "lost": lost}
        case.members["n"] = [own * (1 + each) for each in range(lost + 1)]
    if asks == AT_RANDOM:
        lost = float(rng.choice([0.05, 0.2, 0.4]))
        tables["block"]["h"] = {"type": "channel", "every": "n", "loss": lost}
        tables["sweep"]["K"]["start"] = float(rng.choice([0.0, START]))
        case.members["lost"] = lost
    if asks == CONSERVES:
        tables["block"] |= {"v": {"type": "integrator"}, "g": {"type": "hold", "every": "n"}}
        tables["wire"] = {"h.u": "p.y", "g.u": "v.y - c*K/1000*h.y", "p.u": "g.y", "v.u": "c*r - c*K*h.y"}
    if asks == "contact":
        tables["block"]["s"] = {"type": "saturation", "low": -5.0, "high": 5.0}
        tables["wire"] |= {"s.u": "K*h.y", "p.u": f"c*r{leak} - c*s.y"}
        tables["for_all"] = {"contact": True}
    required(case, rng)
    if rng.random() < 0.25 and "c" not in tables.get("for_all", {}):
        tables["sweep"]["c"] = [0.5, 1.0]
    return case


def required(case, rng):
    """Give the case what it requires."""
    wants = case.tables["sweep"]
    levels = {
        "radius": (0.8, 0.97),
        "settling": (0.01, 0.2),
        "damping_ratio": (0.1, 0.6),
        "gain": (1.1, 4.0),
        "Ms": (1.2, 3.0),
        "disk": (0.3, 1.5),
    }
    if case.asks not in levels:
        return
    case.level = level = float(np.round(rng.uniform(*levels[case.asks]), 3))
    if case.asks == "gain":
        wants["require"] = {"gain": {"from": "r", "to": "y", "at_most": level}}
    elif case.asks in ("Ms", "disk"):
        wants["require"] = {"margins": {"cut": "h.y", case.asks: level}}
    else:
        wants["require"] = {case.asks: level}


def least(intervals):
    """The lowest value of intervals; infinite of none."""
    return min((low for low, _ in intervals), default=inf)


def greatest(intervals):
    """The highest value of intervals; minus infinity of none."""
    return max((high for _, high in intervals), default=-inf)
