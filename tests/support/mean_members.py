"""Claims about ranges of a number that loops read through expressions with peaks, poles and steps of any width."""

import numpy as np

import wavesweep
from support.expressions import expression
from support.members import NO_HAND, Claim, Pushed, hand_of, margins_for_all, radius_of, word_of


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

    def member(rng, value, name):
        factor = np.exp(1j * np.radians(value)) if name == "phase" else value
        return radius_of(loop.at_rates(K * q.at(place := q.q(rng)) * factor, *every)), {"q": place, "margin": name}

    return Claim(tables, "K", "", member, f"mean margins {q.text}", rows_of=margins_for_all)
