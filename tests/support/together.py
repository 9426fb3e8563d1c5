"""Random loops whose numbers matter together, and a climb over members by matrices of its own.

Factors of several numbers are large in a small part of a box alone: products that vanish on the
edges and in the middle, ridges, rings, holes of any width, decades, powers. A loop reads one of
them in a gain, a stiffness, two couplings of a ring or a dead time, beside frames that vary,
messages that are late or lost, or both at random. Matrices of members are written here tick by
tick, and eigenvalues are numpy's: nothing of the package is asked.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from scipy.linalg import expm

import wavesweep
from wavesweep.for_all.rows import verdict
from wavesweep.program.spec import load

SURELY = 1e-7  # above 1, from which on a radius contradicts a proof
FALSELY = 1e-5  # below 1, from which on that of the worst member contradicts a refutation
SCATTERED = 400  # members that are tried first
KEPT, MOVES, STEPS = 12, 6, 32  # of a climb: members, their moves, and the steps
BOLDER, FINER = 1.5, 0.6  # the next step of a member that has moved, or has not
WORST = -4.0, 0.3  # powers of ten of what the radius of the worst member is off 1
WIDTHS = -2.5, -0.2  # powers of ten of widths, relative to half a range
DIGITS = 4  # of random numbers in texts
CALIBRATIONS = 2
TICK = 0.01
FUNCTIONS = {name: getattr(np, name) for name in ("sqrt", "sin", "cos", "exp", "log", "pi")}


@dataclass(frozen=True)
class Number:
    """A number with a range, in which `unit`, a text, is -1 to 1; decades: by its logarithm."""

    name: str
    low: float
    high: float
    decades: bool = False

    @property
    def unit(self) -> str:
        """The text of -1 to 1."""
        if self.decades:
            return f"(log({self.name})/{float(np.log(self.high))!r})"
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        return self.name if (middle, half) == (0, 1) else f"(({self.name} - {middle!r})/{half!r})"

    def at(self, unit: np.ndarray) -> np.ndarray:
        """The number where the text is `unit`."""
        if self.decades:
            return np.clip(self.high**unit, self.low, self.high)
        middle, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        return np.clip(middle + half * unit, self.low, self.high)


def rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def number(rng, name: str, decades: bool = True) -> Number:
    """A number from -1 to 1, of a range elsewhere, or of decades about 1."""
    kind = rng.choice(["plain", "plain", "elsewhere", "decades" if decades else "plain"])
    if kind == "decades":
        high = rounded(10 ** rng.uniform(0.5, 4))
        return Number(name, 1 / high, high, decades=True)
    if kind == "elsewhere":
        low = rounded(rng.uniform(-2, 5))
        return Number(name, low, rounded(low + 10 ** rng.uniform(-1, 2)))
    return Number(name, -1.0, 1.0)


def of_one(rng, u: str) -> str:
    """A factor of one number, which often vanishes on the edges and in the middle."""
    k = int(rng.integers(1, 5))
    chebyshev = np.polynomial.chebyshev.cheb2poly(np.eye(12)[int(rng.integers(3, 12))])
    terms = [f"{c:g}*{u}**{i}" for i, c in enumerate(chebyshev) if c and i]
    return str(
        rng.choice(
            [
                f"({u} - {u}**3)",
                f"({u}**5 - 1.5*{u}**3 + 0.5*{u})",
                f"({u}*({u}**2 - 1)*({u}**2 - 0.5)*({u}**2 - 0.25))",
                f"sin({k}*pi*{u})",
                f"sin({k}*pi*{u})**2",
                f"(1 - {u}**2)**{k}",
                f"({u}**3*(1 - {u}**2)**{k})",
                f"((2 + {u})/3)**{rounded(rng.uniform(0.3, 9))!r}",
                f"(1 - ({'+'.join(terms)})**2)".replace("+-", "-"),
            ]
        )
    )


def of_two(rng, u: str, v: str) -> tuple[str, list[tuple[float, float]]]:
    """A factor of two numbers, and places at which it is large, as units."""
    a, b = (rounded(each) for each in rng.uniform(-0.95, 0.95, 2))
    w, r = rounded(10 ** rng.uniform(*WIDTHS)), rounded(rng.uniform(0.2, 0.9))
    turns = int(rng.integers(1, 4))
    along = [(each, each - a) for each in np.linspace(-1, 1, 9) if abs(each - a) <= 1]
    around = [(r * np.cos(angle), r * np.sin(angle)) for angle in np.linspace(0, 6, 9)]
    ridge, hole = f"({u} - {v} - {a!r})", f"(({u} - {a!r})**2 + ({v} - {b!r})**2)"
    texts = [
        (f"exp(-({ridge}/{w!r})**2)", along),
        (f"1/(1 + ({ridge}/{w!r})**2)", along),
        (f"1/(1 + {hole}/{w * w!r})", [(a, b)]),
        (f"exp(-{hole}/{w * w!r})", [(a, b)]),
        (f"1/(1 + (({u}**2 + {v}**2 - {r * r!r})/{w!r})**2)", around),
        (f"sin({turns}*pi*({u} + {v}))*sin({turns}*pi*({u} - {v}))", []),
        (f"({u}*{v}*(1 - {u}**2*{v}**2))", []),
        (f"(({u} - {v})*({u} + {v})*(1 - {u}**2)*(1 - {v}**2))", []),
        (f"(1 - ({u} - {v})**2/4)**{int(rng.integers(2, 12))}", []),
        (f"1/(1 + ({ridge}/{w!r})**2)*(1 - {u}**2)*(1 - {v}**2)", along),
    ]
    return texts[int(rng.integers(len(texts)))]


def beside(places: np.ndarray, count: int) -> np.ndarray:
    """The places with so many units of one number more."""
    units = np.tile(np.linspace(-1, 1, count), len(places))
    return np.hstack([np.repeat(places, count, 0), units[:, None]])


@dataclass(frozen=True)
class Factor:
    """A text, and units at which it may be large, `(places, numbers)`."""

    text: str
    places: np.ndarray


def factor(rng, numbers: list[Number]) -> Factor:
    """A factor of one to three numbers."""
    units = [each.unit for each in numbers]
    if len(units) == 1:
        return Factor(of_one(rng, *units), np.zeros((0, 1)))
    if rng.random() < 0.4:
        text = "*".join(of_one(rng, unit) for unit in units)
        return Factor(text, np.zeros((0, len(units))))
    text, places = of_two(rng, *units[:2])
    others = [of_one(rng, unit) for unit in units[2:]]
    places = np.array(places).reshape(-1, 2)
    places = beside(places, 21) if others else places
    return Factor("*".join([f"({text})", *others]), places)


def evaluate(text: str, numbers: list[Number], points: np.ndarray) -> np.ndarray:
    """The values of a text at points `(points, numbers)`."""
    known = FUNCTIONS | {each.name: points[:, i] for i, each in enumerate(numbers)}
    return np.broadcast_to(eval(text, known), len(points))  # noqa: S307 - its own text


@dataclass(frozen=True)
class Together:
    """A loop with numbers that have ranges, and what varies beside them.

    maps: from points and an amplitude to the matrices of each symbol, `(symbols, points, n, n)`.
    """

    kind: str
    numbers: list[Number]
    places: np.ndarray
    tables: dict
    maps: Callable[[np.ndarray, float], np.ndarray]
    varied: "Varies"

    def radii(self, points: np.ndarray, amplitude: float) -> np.ndarray:
        """The largest growth of a word per symbol, or that of the second moments."""
        with np.errstate(all="ignore"):
            A = np.nan_to_num(self.maps(points, amplitude), nan=1e9, posinf=1e9, neginf=-1e9)
        if self.varied.shares:
            n = A.shape[-1]
            moments = np.einsum("s,spij,spkl->pikjl", self.varied.shares, A, A)
            return _radius(moments.reshape(-1, n * n, n * n))
        found = np.zeros(len(points))
        for word in self.varied.words:
            whole = A[word[0]]
            for symbol in word[1:]:
                whole = A[symbol] @ whole
            found = np.maximum(found, _radius(whole) ** (1 / len(word)))
        return found

    @property
    def box(self) -> np.ndarray:
        """The low and high ends of the numbers."""
        return np.array([[each.low for each in self.numbers], [each.high for each in self.numbers]])

    def climb(self, amplitude: float, starts: np.ndarray | None = None) -> tuple[float, np.ndarray]:
        """The worst radius that is found, and its point."""
        rng = np.random.default_rng(5)
        count = len(self.numbers)
        units = [rng.uniform(-1, 1, (SCATTERED, count)), self.places]
        units.append(np.array(list(product([-1, 0, 1], repeat=count)), float))
        units = np.concatenate(units)
        points = np.stack([each.at(units[:, i]) for i, each in enumerate(self.numbers)], -1)
        points = points if starts is None else np.concatenate([points, starts])
        radii = self.radii(points, amplitude)
        best = np.argsort(-radii)[:KEPT]
        points, radii, step = points[best], radii[best], np.full((len(best), 1), 0.3)
        wide = np.array([each.decades for each in self.numbers])
        half = np.ptp(self.box, axis=0) / 2
        for _ in range(STEPS):
            moves = rng.normal(size=(MOVES, len(points), count)) * step
            moves[: MOVES // 2] *= rng.random((MOVES // 2, len(points), count)) < 1 / count
            moved = np.where(wide, points * np.exp(moves * 3), points + moves * half)
            moved = np.clip(moved, *self.box).reshape(-1, count)
            reached = self.radii(moved, amplitude).reshape(MOVES, -1)
            better = reached.max(0) > radii
            at = reached.argmax(0)
            chosen = moved.reshape(MOVES, -1, count)[at, np.arange(len(points))]
            points = np.where(better[:, None], chosen, points)
            radii = np.maximum(radii, reached.max(0))
            step = step * np.where(better, BOLDER, FINER)[:, None]
        best = int(np.argmax(radii))
        return float(radii[best]), points[best]

    @property
    def amplitude(self) -> float:
        """That with which the worst member is off 1 by what the spec's seed says."""
        return self.tables["numbers"]["A"]


def _radius(matrices):
    return np.abs(np.linalg.eigvals(matrices)).max(-1)


def calibrated(rng, loop: Together, inside: bool) -> Together | None:
    """The loop with an amplitude whose worst member is a little inside or outside of 1; or None."""
    off = float(10 ** rng.uniform(*WORST))
    aim, amplitude = max(1 - off, 0.9) if inside else 1 + off, 1.0
    for _ in range(CALIBRATIONS):  # the worst place may be elsewhere with another amplitude
        _, place = loop.climb(amplitude)
        low, high = 1e-6, 1e6
        if loop.radii(place[None], low)[0] > aim or loop.radii(place[None], high)[0] < aim:
            return None
        for _ in range(60):
            amplitude = float(np.sqrt(low * high))
            beyond = loop.radii(place[None], amplitude)[0] > aim
            low, high = (low, amplitude) if beyond else (amplitude, high)
    worst, _ = loop.climb(amplitude)
    if (worst < 1) != inside:
        return None
    loop.tables["numbers"]["A"] = float(f"{amplitude:.9g}")
    return loop


def spec(numbers: list[Number], blocks: dict, wires: dict, varied: "Varies") -> dict:
    """The tables of a spec, with numbers of its own inside of their ranges."""
    at_first = {each.name: float(each.at(np.array(0.3))) for each in numbers}
    ranges = {each.name: {"start": each.low, "stop": each.high} for each in numbers}
    return {
        "rates": {"tick_hz": 1 / TICK},
        "numbers": {"A": 1.0, **at_first, **varied.numbers},
        "block": blocks,
        "wire": wires,
        "for_all": ranges | varied.tables,
    }


@dataclass(frozen=True)
class Varies:
    """What varies beside the ranges, of a block that samples and holds: its keys, tables and words.

    steps: of each symbol, the ticks after its begin at which the block takes the sample of its
    begin, None for never; ticks: of each symbol.
    """

    name: str
    keys: dict
    tables: dict = field(default_factory=dict)
    numbers: dict = field(default_factory=dict)
    steps: tuple[int | None, ...] = (0,)
    ticks: tuple[int, ...] = (1,)
    words: tuple[tuple[int, ...], ...] = ((0,),)
    shares: tuple[float, ...] = ()


def words(symbols: int, longest: int) -> tuple[tuple[int, ...], ...]:
    return tuple(word for n in range(1, longest + 1) for word in product(range(symbols), repeat=n))


def varies(rng) -> Varies:
    """Constant frames, frames that vary, messages, or both at random."""
    kinds = ["alone", "frames", "frames at random", "lost", "late", "lost at random"]
    kind = str(rng.choice(kinds))
    every = int(rng.integers(1, 4))
    first, second = sorted(rng.choice([1, 2, 3, 4], 2, replace=False).tolist())
    frames = {"values": [first, second], "varying": True}
    of_frames = {"numbers": {"n": first}, "steps": (0, 0), "ticks": (first, second)}
    share = rounded(rng.uniform(0.1, 0.9))
    channel = {"type": "channel", "every": every}
    match kind:
        case "alone":
            return Varies(kind, {"type": "hold", "every": every}, ticks=(every,))
        case "frames":
            keys = {"type": "hold", "every": "n"}
            return Varies(kind, keys, {"n": frames}, words=words(2, 3), **of_frames)
        case "frames at random":
            keys, frames["shares"] = {"type": "hold", "every": "n"}, [share, 1 - share]
            return Varies(kind, keys, {"n": frames}, shares=(share, 1 - share), **of_frames)
        case "lost":
            in_a_row = tuple(word for word in words(2, 4) if (1, 1) not in _pairs(word))
            return Varies(kind, {**channel, "lost": 1}, {}, {}, (0, None), (every,) * 2, in_a_row)
        case "late":
            channel["every"] = every + 1
            steps, ticks = (0, 1), (every + 1,) * 2
            return Varies(kind, {**channel, "late": 1}, {}, {}, steps, ticks, words(2, 3))
        case _:
            keys, shares = {**channel, "loss": share}, (1 - share, share)
            return Varies(kind, keys, {}, {}, (0, None), (every,) * 2, (), shares)


def _pairs(word):
    return zip(word, (*word[1:], word[0]), strict=True)


def symbols_of(varied: Varies, tick: np.ndarray, sampled: np.ndarray, held: int) -> np.ndarray:
    """The matrices of the symbols, from that of a tick without a sample, `(points, n, n)`.

    sampled: the row, `(n,)` or `(points, n)`, of what is sampled at the begin; held: its state.
    """
    n = tick.shape[-1]
    found = []
    for step, ticks in zip(varied.steps, varied.ticks, strict=True):
        whole = np.broadcast_to(np.eye(n), tick.shape).copy()
        for at in range(ticks):
            if at == step:
                whole[..., held, :] = sampled
            whole = tick @ whole
        found.append(whole)
    return np.stack(found)


def several(rng, most: int = 3) -> list[Number]:
    return [number(rng, name) for name in "pqr"[: int(rng.choice([2, 2, 2, most]))]]


def one_delay(rng) -> Together:
    """A delay of a tick whose gain is large in a small part, and a hold beside it."""
    numbers, varied = several(rng), varies(rng)
    of = factor(rng, numbers)
    base, slow = (rounded(each) for each in rng.uniform(0.05, 0.5, 2))
    wires = {"h.u": "x.y", "x.u": f"({base!r} + A*{of.text})*x.y + {slow!r}*h.y"}
    blocks = {"x": {"type": "delay"}, "h": varied.keys}
    tables = spec(numbers, blocks, wires, varied)

    def maps(points, amplitude):
        tick = np.zeros((len(points), 2, 2))
        tick[:, 0, 0] = base + amplitude * evaluate(of.text, numbers, points)
        tick[:, 0, 1] = slow
        tick[:, 1, 1] = 1.0
        return symbols_of(varied, tick, np.array([1.0, 0.0]), 1)

    return Together("delay", numbers, of.places, tables, maps, varied)


def ring(rng) -> Together:
    """Delays in a ring, each coupling a factor of numbers of its own."""
    numbers, varied, count = several(rng), varies(rng), int(rng.choice([2, 2, 3]))
    texts = [of_one(rng, numbers[0].unit), of_one(rng, numbers[1].unit)]
    texts += ["1" if len(numbers) < 3 else of_one(rng, numbers[2].unit)] * (count - 2)
    numbers = numbers[:count]
    names, slow = "abc"[:count], rounded(rng.uniform(0.01, 0.3))
    wires = {"h.u": "a.y", "a.u": f"A*{texts[0]}*{names[-1]}.y + {slow!r}*h.y"}
    for before, name, text in zip(names, names[1:], texts[1:], strict=False):
        wires[f"{name}.u"] = f"{text}*{before}.y"
    blocks = {name: {"type": "delay"} for name in names} | {"h": varied.keys}
    tables = spec(numbers, blocks, wires, varied)

    def maps(points, amplitude):
        tick = np.zeros((len(points), count + 1, count + 1))
        for i, text in enumerate(texts):
            tick[:, i, i - 1 if i else count - 1] = evaluate(text, numbers, points)
        tick[:, 0, count - 1] *= amplitude
        tick[:, 0, count] = slow
        tick[:, count, count] = 1.0
        return symbols_of(varied, tick, np.eye(count + 1)[0], count)

    return Together("ring", numbers, np.zeros((0, len(numbers))), tables, maps, varied)


def mass(rng) -> Together:
    """A mass at a sampled spring that is stiff in a small part; perhaps of any mass, or period."""
    numbers, varied = several(rng), varies(rng)
    of, kind = factor(rng, numbers), str(rng.choice(["mass", "mass of a number", "period"]))
    m, d, k = (rounded(each) for each in 10 ** rng.uniform((-1, 0, 0), (0, 1, 2)))
    stiffness = f"A*(0.2 + ({of.text})**2)"
    by = numbers[-1].unit
    heavy = f"({m!r}*(1 + 0.5*{by}))" if kind == "mass of a number" else repr(m)
    period = f"({TICK!r}*(1 + 0.5*{by}))" if kind == "period" else repr(TICK)
    blocks = {"x": {"type": "mass", "mass": heavy, "damping": d, "stiffness": k}, "h": varied.keys}
    wires = {"h.u": "x.x", "x.f": f"-{stiffness}*h.y"}
    tables = spec(numbers, blocks, wires, varied)
    tables["rates"]["tick_hz"] = f"1/{period}"

    def maps(points, amplitude):
        M, T = (evaluate(text, numbers, points) for text in (heavy, period))
        rates = np.zeros((len(points), 3, 3))
        rates[:, 0, 1] = 1.0
        rates[:, 1, 0], rates[:, 1, 1] = -k / M, -d / M
        rates[:, 1, 2] = 1 / M
        tick = expm(rates * T[:, None, None])
        force = -amplitude * (0.2 + evaluate(of.text, numbers, points) ** 2)
        tick[:, :2, 2] *= force[:, None]
        return symbols_of(varied, tick, np.array([1.0, 0.0, 0.0]), 2)

    return Together(kind, numbers, of.places, tables, maps, varied)


def turning(rng, p: Number) -> tuple[str, np.ndarray]:
    """A text from 0 to 1 that rises and falls in the range of a number, and units where it does."""
    u, c = p.unit, rounded(rng.uniform(-0.9, 0.9))
    w, k = rounded(10 ** rng.uniform(*WIDTHS)), int(rng.integers(1, 4))
    texts = [
        f"(1 - {u}**2)**{2 * k}",
        f"1/(1 + (({u} - {c!r})/{w!r})**2)",
        f"exp(-(({u} - {c!r})/{w!r})**2)",
        f"sin({k}*pi*{u})**2",
        f"((1 + sin({2 * k}*pi*{u}))/2)",
    ]
    texts += [f"2*{p.name}/(1 + {p.name}**2)"] * (3 if p.decades else 0)
    about = c + w * np.linspace(-3, 3, 13)
    return str(rng.choice(texts)), np.concatenate([about, np.linspace(-1, 1, 201)])[:, None]


def dead_time(rng) -> Together | None:
    """A plant behind a hold and a dead time that rises and falls, beside another number or none."""
    p = number(rng, "p")
    text, places = turning(rng, p)
    numbers, gain = [p], "1"
    if rng.random() < 0.5:
        numbers.append(number(rng, "q"))
        gain = f"(0.5 + 0.5*{of_one(rng, numbers[1].unit)})"
        places = beside(places, 9)
    omega, zeta = rounded(10 ** rng.uniform(1, 2.5)), rounded(10 ** rng.uniform(-1.5, 0.2))
    least, more = rounded(TICK * rng.uniform(0.05, 1.5)), rounded(TICK * 10 ** rng.uniform(-1, 0.4))
    seconds = f"{least!r} + {more!r}*{text}"
    stiffness, damping = omega * omega, 2 * zeta * omega
    blocks = {
        "x": {"type": "tf", "num": [stiffness], "den": [1, damping, stiffness]},
        "c": {"type": "hold"},
        "l": {"type": "delay", "seconds": seconds},
    }
    wires = {"c.u": f"-A*{gain}*x.y", "l.u": "c.y", "x.u": "l.y"}
    varied = Varies("alone", {})
    tables = spec(numbers, blocks, wires, varied)
    longest = int(np.ceil((least + more) / TICK)) + 1
    rates = np.array([[0, 1, 0], [-stiffness, -damping, stiffness], [0, 0, 0]], float)

    def moved(seconds):
        flow = expm(rates * seconds[:, None, None])
        return flow[:, :2, :2], flow[:, :2, 2]

    def maps(points, amplitude):
        late = evaluate(seconds, numbers, points)
        whole = np.ceil(late / TICK * (1 - 1e-12)).astype(int)
        share = whole - late / TICK
        last, acts = moved(share * TICK)
        _, before = moved((1 - share) * TICK)
        flow, _ = moved(np.full(len(points), TICK))
        feedback = -amplitude * evaluate(gain, numbers, points)
        A = np.zeros((len(points), 2 + longest, 2 + longest))
        A[:, :2, :2] = flow
        place, every = np.arange(2, 2 + longest), np.arange(len(points))
        A[:, place[1:], place[:-1]] = 1.0  # the newest of the last forces is the first
        A[:, 2, 0] = feedback
        A[every, :2, 1 + whole] += (last @ before[..., None])[..., 0]
        newest = whole == 1
        A[every[~newest], :2, whole[~newest]] += acts[~newest]
        A[newest, :2, 0] += acts[newest] * feedback[newest, None]
        return A[None]

    return Together("dead time", numbers, places, tables, maps, varied)


KINDS = {make.__name__: make for make in (one_delay, ring, mass, dead_time)}


def drawn(name: str, seed: int, inside: bool = False) -> Together:
    """A loop of a kind, whose worst member is a little outside of the circle, or inside."""
    rng = np.random.default_rng([seed, list(KINDS).index(name), 89])
    loop = None
    while loop is None:
        loop = calibrated(rng, KINDS[name](rng), inside)
    return loop


def judged(loop: Together) -> dict:
    """What the package says, and the worst member here; `wrong` if one contradicts the other."""
    said = verdict(load(loop.tables))
    if said["verdict"] != "refuted":
        worst, place = loop.climb(loop.amplitude)
        wrong = said["verdict"] == "proved" and worst > 1 + SURELY
    else:
        told = dict(re.findall(r"(\w+) = ([^ ,]+)", said["counterexample"]))
        place = np.array([float(told[each.name]) for each in loop.numbers])
        worst = loop.radii(place[None], loop.amplitude)[0]
        if worst < 1:  # a text has six digits, too few for a narrow place
            worst, place = loop.climb(loop.amplitude, place[None])
        wrong = worst < 1 - FALSELY
    return {"said": said["verdict"], "worst": float(worst), "at": place.tolist(), "wrong": bool(wrong)}


def rows_held(loop: Together) -> dict | None:
    """A row along the amplitude that a member contradicts, or None."""
    sweep = {"along": "A", "A": {"start": 0, "stop": 2 * loop.amplitude}}
    table = wavesweep.stability_region(loop.tables | {"sweep": sweep})
    for row in table[(table.guarantee != "spec") & (table.intervals > 0)].to_dict("records"):
        for share in (0.5, 1 - 1e-6):
            value = row["low"] + share * (row["high"] - row["low"])
            worst, place = loop.climb(value)
            if worst > 1 + SURELY:
                return {"value": value, "worst": worst, "at": place.tolist(), "high": row["high"]}
    return None
