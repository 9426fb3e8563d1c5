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
    for channel in channels:
        if not (channel["late"] or channel["lost"]):  # it would be a hold
            channel["lost"] = 1
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


def random_blocks(source):
    """A mass, and blocks of random types and rates in a row, each of which reads the mass, a push and blocks before it.

    Two are channels; at least one of the others runs when a channel sends. late: the pattern of each channel.
    """
    names = [f"b{i}" for i in range(int(source.integers(4, 8)))]
    sending = source.choice(len(names) - 1, 2, replace=False).tolist()
    every = [int(each) for each in source.choice([1, 2, 3, 4, 6], len(names))]
    every[-1] = every[sending[0]] = int(source.integers(2, 6))
    phase = [int(source.integers(each)) for each in every]
    phase[-1] = phase[sending[0]]
    blocks, late = {}, {}
    for i, name in enumerate(names):
        keys = {"type": "channel", "missing": str(source.choice(["held", "zero"]))}
        if i in sending:
            late[name] = source.choice([0, 0, 1, 2, 3, 7, None], source.integers(1, 6)).tolist()
        else:
            kind = str(source.choice(["hold", "delay", "integrator", "lowpass"]))
            keys = {"type": kind} | {"integrator": {"method": "implicit"}, "lowpass": {"a": 0.3}}.get(kind, {})
        read = ["mass.x", "mass.v", "push", *(f"{each}.y" for each in names[:i])]
        picked = sorted(source.choice(len(read), min(3, len(read)), replace=False).tolist()) if i else [0, 1, 2]
        terms = {read[j]: float(source.uniform(-1, 1)) for j in picked}
        blocks[name] = {**keys, "every": every[i], "phase": phase[i], "u": terms}
    force = {f"{name}.y": float(source.uniform(-0.3, 0.3)) for name in names}
    return {"tick": 0.1, "blocks": blocks, "force": force | {"push": 1.0}, "late": late}


def spec_of_blocks(loop, **simulate):
    """The tables of such a loop, with its pattern of messages."""

    def summed(terms):
        return " + ".join(f"({gain!r})*{name}" for name, gain in terms.items())

    blocks = {name: {key: value for key, value in keys.items() if key != "u"} for name, keys in loop["blocks"].items()}
    messages = {name: ["lost" if each is None else each for each in row] for name, row in loop["late"].items()}
    return {
        "rates": {"tick_hz": 1 / loop["tick"]},
        "block": {"mass": {"type": "mass", "mass": 0.5, "damping": 1.0, "stiffness": 2.0}, **blocks},
        "wire": {f"{name}.u": summed(keys["u"]) for name, keys in loop["blocks"].items()} | {"mass.f": summed(loop["force"])},
        "ports": {"inputs": {"push": "push"}, "outputs": {"place": "mass.x"} | {name: f"{name}.y" for name in blocks}},
        "simulate": {"input": "noise", "duration_s": 12, "messages": messages} | simulate,
    }


class Receiver:
    """What a channel of `random_blocks` shows; late: its pattern."""

    def __init__(self, keys, late):
        self.zero, self.late, self.shown, self.sent, self.waiting = keys["missing"] == "zero", late, 0.0, 0, []

    def begin(self, k, runs):
        """Show what has arrived by tick k."""
        newest = max((each for each in self.waiting if each[0] <= k), key=lambda each: each[1], default=None)
        if newest:
            self.shown, self.waiting = newest[2], [each for each in self.waiting if each[1] > newest[1]]
        elif runs and self.zero:
            self.shown = 0.0

    def send(self, k, u):
        own = self.late[self.sent % len(self.late)]
        self.sent += 1
        if own == 0:
            self.shown, self.waiting = u, []
        elif own is not None:
            self.waiting.append((k + own, self.sent, u))
        return self.shown


def marched_blocks(loop, push, dropped=False):
    """The place of the mass and what each block gives, to blocks of every tick, in each tick.

    dropped: whether each result of a block that does not run in every tick, and is no channel, is lost on the way to blocks of
    every tick.
    """
    flow = expm(np.array([[0, 1, 0], [-4.0, -2.0, 2.0], [0, 0, 0]]) * loop["tick"])[:2]
    blocks, x, v, rows = loop["blocks"], 0.0, 0.0, []
    channels = {name: Receiver(blocks[name], late) for name, late in loop["late"].items()}
    absent = {name for name, keys in blocks.items() if dropped and keys["every"] > 1 and name not in channels}
    given, before = dict.fromkeys(blocks, 0.0), dict.fromkeys(blocks, 0.0)
    for k, f in enumerate(push):

        def read(terms, *, slow, outside=(x, v, f)):
            shown = {f"{name}.y": 0.0 if name in absent and not slow else value for name, value in given.items()}
            known = dict(zip(("mass.x", "mass.v", "push"), outside, strict=True)) | shown
            return sum(gain * known[name] for name, gain in terms.items())

        for name, keys in blocks.items():
            runs = k % keys["every"] == keys["phase"]
            if name in channels:
                channels[name].begin(k, runs)
                given[name] = channels[name].shown
            if runs:
                u, last = read(keys["u"], slow=keys["every"] > 1), given[name]
                given[name] = {
                    "channel": lambda u, _, name=name, k=k: channels[name].send(k, u),
                    "hold": lambda u, _: u,
                    "delay": lambda *_, name=name: before[name],
                    "integrator": lambda u, y, keys=keys: y + keys["every"] * loop["tick"] * u,
                    "lowpass": lambda u, y: y + 0.3 * (u - y),
                }[keys["type"]](u, last)
                before[name] = u
        rows.append([x, *(0.0 if name in absent else value for name, value in given.items())])
        x, v = flow @ np.array([x, v, read(loop["force"], slow=False)])
    return np.array(rows)
