"""Two masses over a network whose messages are late or lost, marched tick by tick: who holds which message is found from when
each comes. Nothing of the package is used."""

import numpy as np
from scipy.linalg import expm

MASTER, SLAVE = (0.25, 3.0, 100.0), (1.2, 4.0, 0.0)  # mass, damping, stiffness
STIFF, DAMP, LOCAL = 400.0, 25.0, 3.0  # the slave's position control, and damping at the master


def random_network(source):
    """Rates, delays and losses of both channels, and of the slave's control, in ticks of 1 ms."""
    every = int(source.integers(3, 9))
    channels = []
    for _ in range(2):
        late, lost = int(source.integers(0, 3 * every)), int(source.integers(3))
        channels.append({"every": every, "phase": int(source.integers(every)), "late": late, "lost": lost})
    channels[0]["late"] += every
    return {"channels": channels, "delays": source.integers(0, 7, 2).tolist(), "control": int(source.choice([1, 2, every]))}


def spec_of(loop, K=60.0, stop=20000.0):
    """The same as the tables of a spec."""
    there, back = ({"type": "channel", **keys} for keys in loop["channels"])
    blocks = {"there": there, "back": back, "control": {"type": "hold", "every": loop["control"]}}
    wires, shown = {"there.u": "master.x", "back.u": "slave.x"}, {}
    for name, steps in zip(("there", "back"), loop["delays"], strict=True):
        shown[name] = f"{name}.y"
        if steps:
            blocks[f"{name}5"] = {"type": "delay", "steps": steps}
            wires[f"{name}5.u"], shown[name] = f"{name}.y", f"{name}5.y"
    wires["control.u"] = f"{STIFF}*({shown['there']} - slave.x) - {DAMP}*slave.v"
    wires |= {"slave.f": "control.y", "master.f": f"push - K*(master.x - {shown['back']}) - {LOCAL}*master.v"}
    keys = ("mass", "damping", "stiffness")
    masses = {
        name: {"type": "mass", **dict(zip(keys, own, strict=True))}
        for name, own in loop.get("masses", {"master": MASTER, "slave": SLAVE}).items()
    }
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": K},
        "block": {**masses, **blocks},
        "wire": wires,
        "ports": {"inputs": {"push": "push"}, "outputs": {"x": "master.x"}},
        "sweep": {"along": "K", "K": {"start": 0, "stop": stop}},
    }


def random_messages(loop, source):
    """What happens to the messages of a pattern: late by so many ticks, or None."""
    count, patterns = int(source.integers(1, 7)), []
    often = source.random()
    for channel in loop["channels"]:
        while True:
            late = [int(each) for each in source.integers(0, channel["late"] + 1, count)]
            if often < 0.5:
                late = [int(source.choice([0, channel["late"]])) for _ in late]
            late = [None if source.random() < 0.3 else each for each in late]
            again = "".join("x" if each is None else "." for each in late * (channel["lost"] + 2))
            if "x" * (channel["lost"] + 1) not in again:
                break
        patterns.append(late)
    return patterns


def back(channel, late, k):
    """How many messages back the one is that a receiver holds in tick k, and the number of the last one that is sent."""
    last = (k - channel["phase"]) // channel["every"]
    for n in range(last, last - 1000, -1):
        wait = late[n % len(late)]
        if wait is not None and channel["phase"] + n * channel["every"] + wait <= k:
            return last - n, last
    raise AssertionError(late)


def growth(loop, K, messages, drifts=0):
    """The spectral radius of a pattern of messages that is repeated for ever, without so many eigenvalues next to 1."""
    held = []
    for mass, damping, stiffness in loop.get("masses", {"master": MASTER, "slave": SLAVE}).values():
        flow = expm(1e-3 * np.array([[0, 1, 0], [-stiffness / mass, -damping / mass, 1 / mass], [0, 0, 0]]))
        held.append(flow[:2])
    kept = [channel["late"] // channel["every"] + channel["lost"] + 3 for channel in loop["channels"]]
    size = 5 + sum(kept) + sum(loop["delays"])
    rows = iter(np.eye(size))
    master, slave = (np.array([next(rows), next(rows)]) for _ in range(2))
    force = next(rows)
    sent = [{-1 - n: next(rows) for n in range(count)} for count in kept]
    lines = [[next(rows) for _ in range(steps)] for steps in loop["delays"]]
    period = np.lcm(loop["channels"][0]["every"] * len(messages[0]), loop["control"])
    for k in range(int(period)):
        shown = []
        for at, (channel, late) in enumerate(zip(loop["channels"], messages, strict=True)):
            older, last = back(channel, late, k)
            if (k - channel["phase"]) % channel["every"] == 0:
                sent[at][last] = (master, slave)[at][0]
            value = sent[at][last - older]
            lines[at] = [value, *lines[at]]
            shown.append(lines[at].pop())
        if k % loop["control"] == 0:
            force = STIFF * (shown[0] - slave[0]) - DAMP * slave[1]
        pull = -K * (master[0] - shown[1]) - LOCAL * master[1]
        master, slave = held[0] @ [*master, pull], held[1] @ [*slave, force]
    history = []
    for at, channel in enumerate(loop["channels"]):
        last = (int(period) - 1 - channel["phase"]) // channel["every"]
        history += [sent[at][last - n] for n in range(kept[at])]
    z = np.linalg.eigvals(np.array([*master, *slave, force, *history, *lines[0], *lines[1]]))
    return np.abs(z[np.argsort(np.abs(z - 1))[drifts:]]).max()
