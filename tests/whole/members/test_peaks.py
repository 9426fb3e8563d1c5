"""Claims about a number that a loop reads through peaks, poles and steps of any width hold for members right beside these."""

import numpy as np
import pytest
from support.expressions import expression
from support.members import NO_HAND, SURELY, Pushed, hand_of, radius_of

import wavesweep

TRIES = 40  # members of each interval that is claimed, most of them next to what is narrow
CLEARLY = 1e-3  # below 1, from which on a value that no row has is missing


def loop_of(rng):
    """A loop that is stable for some walls, of which a few resonate sharply."""
    mass, sharp = float(10 ** rng.uniform(-2, 0)), rng.random() < 0.4
    damping = float(10 ** (rng.uniform(-6, -1) if sharp else rng.uniform(-1, 1)))
    stiffness = float(10 ** rng.uniform(1, 3)) if sharp else 0.0
    B = float(rng.uniform(0.05, 1.0)) if sharp or rng.random() < 0.5 else 0.0
    return Pushed(mass, damping, stiffness, -1.0, B, (0.0, 0.0, 0.0))


def wall_of(rng, loop, every):
    """A wall that is stable, and up to three times as stiff is not, if there is one."""
    walls = np.geomspace(1e-2, 1e5, 60)
    stable = [radius_of(loop.at_rates(K, *every)) < 1 - 1e-9 for K in walls]
    last = next((i for i in range(len(walls) - 1, -1, -1) if stable[i]), 0)
    return float(walls[last] * rng.uniform(0.4, 0.95))


def contradiction(rng, hands):
    """Where the rows of a random loop along q, whose wall is multiplied by the expression, contradict its eigenvalues."""
    loop, every, q = loop_of(rng), [int(each) for each in rng.choice([1, 1, 2, 4], 2)], expression(rng)
    K = wall_of(rng, loop, every) * (0.1 if hands else 1.0)
    tables = loop.tables(*every, sweep={"along": "q", "q": dict(zip(("start", "stop"), q.span, strict=True))})
    tables["numbers"] |= {"q": q.span[0], "K": K}
    tables["wire"]["m.f"] = tables["wire"]["m.f"].replace("K*h.y", f"K*({q.text})*h.y")
    table = wavesweep.zwidth(tables, "q", hands or ())
    table = table[(table["hand"] == hands) if hands else table["certified"]]
    rows = list(zip(table.low, table.high, strict=True))

    def at(value, hand=NO_HAND):
        return radius_of(loop.at_rates(K * q.at(value), *every, hand))

    for low, high in rows * TRIES:
        value = q.q(rng) if rng.random() < 0.5 else low + rng.random() * (high - low)
        hand = hand_of(rng) if hands else NO_HAND
        if low < value < high and at(value, hand) > 1 + SURELY:
            return q.text, rows, value, hand
    for value in () if hands or not len(table) else rng.uniform(*q.span, TRIES):
        near = any(low - SURELY * abs(low) <= value <= high + SURELY * abs(high) for low, high in rows)
        if not near and at(value) < 1 - CLEARLY:
            return q.text, rows, value, "missing"
    return None


@pytest.mark.slow
@pytest.mark.parametrize("ten", [0, 99])
def test_intervals_along_an_expression_hold_between_their_ends(ten):
    found = {seed: contradiction(np.random.default_rng([seed, 77]), "") for seed in range(10 * ten, 10 * ten + 10)}
    assert {seed: each for seed, each in found.items() if each} == {}


@pytest.mark.slow
@pytest.mark.asks("passive")
@pytest.mark.parametrize("seed", [15, 24])
def test_intervals_for_every_passive_hand_hold_where_an_expression_peaks(seed):
    assert contradiction(np.random.default_rng([seed, 77]), "passive") is None
