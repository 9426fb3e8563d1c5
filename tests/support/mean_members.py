"""Claims about a number that loops read through expressions with peaks, poles and steps of any width."""

import numpy as np

import wavesweep
from support.expressions import expression
from support.members import NO_HAND, Claim, Pushed, hand_of, radius_of


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
