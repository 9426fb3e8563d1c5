"""Loops whose messages are late or lost, marched tick by tick with queues of messages. Nothing of the package is used."""

import numpy as np
from scipy.linalg import expm


def random_loop(source):
    """A mass behind two channels, or one and a hold, of random rates, delays and losses, as numbers."""
    every = [(1, 1), (2, 2), (3, 3), (4, 2), (2, 3)][source.integers(5)]
    channels = [
        {
            "every": int(ticks),
            "phase": int(source.integers(ticks)),
            "late": int(source.integers(min(2 * ticks, 5) + 1)) if source.random() < 0.6 else 0,
            "lost": int(source.integers(3)),
            "missing": str(source.choice(["held", "zero"])),
        }
        for ticks in every
    ]
    numbers = source.uniform(0.1, 2, 5).tolist()
    return {"tick": 10 ** source.uniform(-2, 0), "numbers": numbers, "channels": channels}


def spec_of(loop):
    mass, damping, stiffness, a, b = loop["numbers"]
    up, down = ({"type": "channel", **keys} for keys in loop["channels"])
    return {
        "rates": {"tick_hz": 1 / loop["tick"]},
        "numbers": {"g": 0.1},
        "block": {
            "plant": {"type": "mass", "mass": mass, "damping": damping, "stiffness": stiffness},
            "up": up,
            "down": down,
        },
        "wire": {"up.u": f"{a!r}*plant.x + {b!r}*plant.v", "down.u": "-g*up.y", "plant.f": "down.y + push"},
        "ports": {"inputs": {"push": "push"}, "outputs": {"pos": "plant.x"}},
        "sweep": {"along": "g", "g": {"start": 0, "stop": 100}},
    }


def marched(loop, g, ticks, late, state, waiting, push=0.0):
    """Signals after so many ticks, as rows over some basis: position, velocity and what both channels show; and their messages
    under way, as (tick of arrival, number, row). push: a force in the first tick."""
    mass, damping, stiffness, a, b = loop["numbers"]
    flow = expm(np.array([[0, 1, 0], [-stiffness / mass, -damping / mass, 1 / mass], [0, 0, 0]]) * loop["tick"])[:2]
    (x, v, *shown), waiting, sent = state, [list(each) for each in waiting], [0, 0]
    for k in range(ticks):
        for i, channel in enumerate(loop["channels"]):
            newest = max((each for each in waiting[i] if each[0] <= k), key=lambda each: each[1], default=None)
            runs = k % channel["every"] == channel["phase"]
            if newest:
                shown[i], waiting[i] = newest[2], [each for each in waiting[i] if each[1] > newest[1]]
            elif runs and channel["missing"] == "zero":
                shown[i] = 0 * x
            if runs:
                read, own = (a * x + b * v if i == 0 else -g * shown[0]), late[i][sent[i] % len(late[i])]
                sent[i] += 1
                if own == 0:
                    shown[i], waiting[i] = read, []
                elif own is not None:
                    waiting[i].append((k + own, sent[i], read))
        x, v = flow @ np.array([x, v, shown[1] + push * (k == 0)])
    return [x, v, *shown], [[(at - ticks, n - sent[i], row) for at, n, row in each] for i, each in enumerate(waiting)]
