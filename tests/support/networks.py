"""Two masses over a network whose messages are late or lost: who holds which message is found from when each comes, and what
grows by the interpreter of the documents. Nothing of the package is used."""

from meaning.machine import radius
from meaning.members import Messages

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
    return radius(Messages(spec_of(loop, K)).march(dict(zip(("there", "back"), messages, strict=True))), drifts)
