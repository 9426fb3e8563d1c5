"""Claims about ranges of a number that loops read through expressions with peaks, poles and steps of any width."""

from dataclasses import dataclass

import numpy as np

import wavesweep
from support.members import NO_HAND, Claim, Pushed, hand_of, radius_of, word_of

WIDTHS = -4.5, -0.5  # powers of ten of the range, of what a peak or a step is wide
BESIDE = 0.0, 0.5, -0.5, 1.0, -1.0, 3.0  # widths from its middle, where members are looked for


@dataclass(frozen=True)
class Expression:
    """A factor, 1 away from what is narrow: its text in q, its value, the range of q, and places next to what is narrow."""

    text: str
    at: object
    span: tuple[float, float]
    places: tuple[float, ...]

    def q(self, rng):
        """A value in the range, mostly next to what is narrow."""
        low, high = self.span
        if rng.random() < 0.3:
            return float(rng.choice([low, high, rng.uniform(low, high)]))
        return float(np.clip(rng.choice(self.places), low, high))


def expression(rng):
    """A random factor, up to three times as large or almost 0 where it peaks."""
    kind = str(rng.choice(["lorentz", "lorentz", "spike", "gauss", "pole", "step", "pulses", "corner", "matched", "decades"]))
    low, width = float(rng.choice([0.0, 1.0, -2.0])), float(10 ** rng.uniform(0, 2))
    high, h = low + width, float(rng.choice([-0.95, 0.5, 1.0, 2.0]))
    w, c = width * float(10 ** rng.uniform(*WIDTHS)), float(rng.uniform(low, high))
    match kind:
        case "lorentz":
            text = f"{h * w**2!r}/((q - {c!r})**2 + {w**2!r})"
        case "spike":
            text = f"{h * w!r}/sqrt((q - {c!r})**2 + {w**2!r})"
        case "gauss":
            text = f"{h!r}*exp(-((q - {c!r})/{w!r})**2)"
        case "pole":  # next to the range
            c, sign = (low - w, 1) if rng.random() < 0.5 else (high + w, -1)
            text = f"{sign * h * w!r}/(q - {c!r})"
        case "step":
            w = max(w, width / 600)  # so that the exponential is a double
            text = f"{h!r}/(1 + exp(({c!r} - q)/{w!r}))"
        case "pulses":
            a, turn = float(10 ** rng.uniform(1, 4)), 2 * np.pi / (width * float(10 ** rng.uniform(-2, 0)))
            c, w = low + float(rng.integers(0, 40)) * np.pi / turn, 1 / (turn * a**0.5)
            text = f"{h!r}*exp(-{a!r}*(1 - cos({turn!r}*(q - {c!r}))))"
        case "corner":
            text = f"{h / width!r}*sqrt((q - {c!r})**2 + {w**2!r})"
        case "matched":  # the power into a load, most where it is as large as that of the source
            c = low
            text = f"{4 * h * w!r}*(q - {low - w!r})/(q - {low - 2 * w!r})**2"
        case _:
            low, high = 1e-3, float(10 ** rng.uniform(-2, 7))
            c = w = float(np.exp(rng.uniform(np.log(low), np.log(high))))
            text = f"{4 * h * c!r}*q/(q + {c!r})**2"
    text = "1 + " + text.replace("--", "+")
    at = eval(f"lambda q: {text}", {name: getattr(np, name) for name in ("sqrt", "exp", "cos")})  # noqa: S307 - its own text
    return Expression(text, at, (low, high), tuple(float(c + step * w) for step in BESIDE))


def loop_of(rng, third=1):
    """A loop that is stable for some walls, of which a few resonate sharply."""
    mass, sharp = float(10 ** rng.uniform(-2, 0)), rng.random() < 0.4
    damping = float(10 ** (rng.uniform(-6, -1) if sharp else rng.uniform(-1, 1)))
    stiffness = float(10 ** rng.uniform(1, 3)) if sharp else 0.0
    B = float(rng.uniform(0.05, 1.0)) if sharp or rng.random() < 0.5 else 0.0
    return Pushed(mass, damping, stiffness, -1.0, B, (0.0, 0.0, 0.0), third=third)


def wall_of(rng, loop, every):
    """A wall that is stable, and up to three times as stiff is not, if there is one."""
    walls = np.geomspace(1e-2, 1e5, 60)
    stable = [radius_of(loop.at_rates(K, *every)) < 1 - 1e-9 for K in walls]
    last = next((i for i in range(len(walls) - 1, -1, -1) if stable[i]), 0)
    return float(walls[last] * rng.uniform(0.4, 0.95))


def tables_of(loop, every, q, **more):
    """The spec of a loop whose wall is multiplied by the expression."""
    tables = loop.tables({"every": every[0]}, {"every": every[1]}, **more)
    tables["numbers"] |= {"q": q.span[0]}
    tables["wire"]["m.f"] = tables["wire"]["m.f"].replace("K*h.y", f"K*({q.text})*h.y")
    return tables


def rates(rng):
    return [int(each) for each in rng.choice([1, 1, 2, 4], 2)]


def along(rng, hands):
    loop, every, q = loop_of(rng), rates(rng), expression(rng)
    K = wall_of(rng, loop, every)
    tables = tables_of(loop, every, q, sweep={"along": "q", "q": dict(zip(("start", "stop"), q.span, strict=True))})
    tables["numbers"]["K"] = K * (0.1 if hands else 1.0)

    def at(value, hand=NO_HAND):
        return radius_of(loop.at_rates(tables["numbers"]["K"] * q.at(value), *every, hand))

    def member(rng, value, low, high):
        value, hand = (q.q(rng) if rng.random() < 0.5 else value), hand_of(rng) if hands else NO_HAND
        return (at(value, hand) if low < value < high else 0.0), {"q": value, "hand": hand}

    def rows_of(tables):
        found = wavesweep.zwidth(tables, "q", hands or ())
        found = found[(found["hand"] == hands) if hands else found["certified"]]
        return [row | {"of": {"low": row["low"], "high": row["high"]}} for row in found.to_dict("records")]

    return Claim(tables, "q", hands, member, f"along, {hands} {q.text}", None if hands else at, rows_of)


def mean_alone(rng):
    """All stable values of a number that is read through an expression."""
    return along(rng, "")


def mean_hands(rng):
    """Values of such a number with which a loop is stable for every passive hand."""
    return along(rng, "passive")


def _over(q, tables, **more):
    tables["for_all"] = {"q": dict(zip(("start", "stop"), q.span, strict=True)), **more}
    top = tables["numbers"]["K"]
    tables["sweep"] = {"along": "K", "K": {"start": 0, "stop": 3 * top}}
    return tables


def mean_range(rng):
    """A range of such a number, perhaps with frames that vary or messages that are lost beside it."""
    loop, every, q = loop_of(rng), rates(rng), expression(rng)
    beside = str(rng.choice(["", "", "", "frames", "messages"]))
    if beside:
        every = [2, 2] if beside == "frames" else [every[0], every[0]]
    K = wall_of(rng, loop, every)
    tables = tables_of(loop, every, q)
    tables["numbers"]["K"] = K
    tables = _over(q, tables)
    if beside == "frames":
        tables["numbers"]["n"] = 2
        for name in {"h", "s"} & tables["block"].keys():
            tables["block"][name]["every"] = "n"
        tables["for_all"]["n"] = {"values": [2, 3], "varying": True}
    if beside == "messages":
        tables["block"]["h"] |= {"type": "channel", "lost": 1}

    def member(rng, value):
        value, own = value * q.at(place := q.q(rng)), {"q": place}
        if beside == "frames":
            word = word_of(rng, [2, 3])
            return radius_of(loop.march(value, [(ticks, True) for ticks in word])), own | {"word": word}
        if beside == "messages":
            late = [None if i % 2 and rng.random() < 0.7 else 0 for i in range(int(rng.integers(1, 6)))]
            late[-1] = 0
            return radius_of(loop.of_messages(value, late, *every)), own | {"late": late}
        return radius_of(loop.at_rates(value, *every)), own

    return Claim(tables, "K", "", member, f"mean range {beside} {q.text}")


def mean_margins(rng):
    """Gain and phase of the wall that a loop may lose for every value of such a number."""
    loop, every, q = loop_of(rng), rates(rng), expression(rng)
    K = wall_of(rng, loop, every) / 3
    tables = tables_of(loop, every, q)
    tables["numbers"]["K"] = K
    tables = _over(q, tables)

    def rows_of(tables):
        margins = wavesweep.compile(tables).margins("h.y")
        margins = margins[(margins["guarantee"] == "for_all") & margins["value"].notna()].set_index("margin")["value"]
        nearest = {"gain_up": 1.0, "gain_down": 1.0, "phase": 0.0}
        return [{"low": nearest[name], "high": margins[name], "of": {"name": name}} for name in nearest if name in margins]

    def member(rng, value, name):
        factor = np.exp(1j * np.radians(value)) if name == "phase" else value
        return radius_of(loop.at_rates(K * q.at(place := q.q(rng)) * factor, *every)), {"q": place, "margin": name}

    return Claim(tables, "K", "", member, f"mean margins {q.text}", rows_of=rows_of)


MEAN = (mean_alone, mean_hands, mean_range, mean_margins)
