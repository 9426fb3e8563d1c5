"""Whether the rows of random sets of loops and `check` of single values agree: `python -m tests.for_all.law_of_check 300`,
or from a seed on, `... 40 300`."""

import sys

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.contact.verdict import of_wall
from wavesweep.engine.errors import UsageError
from wavesweep.for_all.rows import verdict
from wavesweep.for_all.varying import Rules
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

KINDS = [
    *("list", "range", "box", "frames", "delays", "both", "lost", "contact", "contact of a list", "contact in frames"),
    *("one value", "three ranges", "chances", "late ticks", "contact of one value", "contact of waves"),
    *("contact of a coupling", "messages", "messages both ways", "messages of a range", "messages at random"),
]
PLACES = (1.01e-3, 0.02, 0.2, 0.5, 0.8, 0.95, 0.985, 1.001, 1.02, 1.3)  # of what nothing refutes


def messages(rng, kind):
    """A PD on a mass, whose messages are late and lost, one way or both."""
    every = int(rng.choice([2, 5, 10, 20]))
    net = {"type": "channel", "every": every, "late": int(rng.integers(0, every + 1)), "lost": int(rng.integers(0, 3))}
    if kind == "messages at random":
        net = {"type": "channel", "every": every, "loss": float(rng.uniform(0.02, 0.4))}
    mass = float(rng.uniform(0.05, 0.2))
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"g": 1.0, "m": mass, "k": float(rng.uniform(2, 30))},
        "block": {"plant": {"type": "mass", "mass": "m", "damping": 1.0}, "net": net},
        "wire": {"net.u": "g*(-k*plant.x - plant.v)", "plant.f": "net.y"},
        "sweep": {"along": "g", "g": {"start": 0, "stop": 500}},
    }
    if kind == "messages both ways":
        spec["block"]["back"] = net
        spec["wire"] = {"back.u": "k*plant.x + plant.v", "net.u": "-g*back.y", "plant.f": "net.y"}
    return spec, {"m": {"start": mass, "stop": 1.5 * mass}} if kind == "messages of a range" else {}


def random_set(seed):
    """A spec with [for_all] of each kind in turn."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    if kind.startswith("messages"):
        return messages(rng, kind)
    controllers = {"contact in frames": "dc-slow", "contact of waves": "pmw", "contact of a coupling": "dc-vc"}
    ratio = int(rng.choice([4, 10, 20]))
    spec = {
        "controller": {"kind": str(rng.choice(["pmw", "dc-slow"])), "b": 12.0},
        "rates": {"ratio": ratio},
        "environment": {
            "integration": "explicit",
            "delay": int(rng.integers(0, ratio + 1)),
            "B_VE": float(rng.choice([0.5, 1, 2])),
        },
        "device": {"velocity": "difference", "mass": float(rng.uniform(0.07, 0.2)), "damping": float(rng.uniform(0.8, 2))},
        "sweep": {"K_VE": {"start": 0, "stop": 20000}},
    }
    spec["controller"]["kind"] = controllers.get(kind, spec["controller"]["kind"])
    if kind == "contact of a coupling":  # a harder one is unstable without a wall
        spec["controller"] |= {"K_VC": 50.0, "B_VC": 5.0}
    mass = {"start": 0.07, "stop": 0.07 * float(rng.uniform(1.1, 2.5))}
    frames = {"values": sorted({ratio, ratio + int(rng.integers(1, 4)), 2 * ratio}), "varying": True}
    rules = {
        "list": {"device.mass": [0.08, 0.11, 0.15]},
        "range": {"device.mass": mass},
        "box": {"device.mass": mass, "operator.stiffness": {"start": 0, "stop": 300}},
        "frames": {"rates.ratio": frames},
        "delays": {"environment.delay": {"values": [0, ratio // 2, ratio], "varying": True}},
        "both": {"rates.ratio": frames, "device.mass": mass},
        "lost": {"lost": int(rng.integers(1, 3))},
        "contact": {"contact": True},
        "contact of a list": {"contact": True, "device.mass": [0.08, 0.15]},
        "one value": {"device.mass": [0.11]},
        "three ranges": {
            "device.mass": mass,
            "operator.stiffness": {"start": 0, "stop": 100},
            "device.damping": {"start": 0.9, "stop": 1.1},
        },
        "chances": {"rates.ratio": frames | {"shares": [3, 1, 1][: len(frames["values"])]}},
        "late ticks": {"tick": {"late": float(rng.uniform(1e-4, 1e-3))}},
        "contact of one value": {"contact": True, "operator.stiffness": [100.0]},
    }
    in_frames = {"contact": True, "rates.ratio": frames}
    rules |= dict.fromkeys(("contact in frames", "contact of waves", "contact of a coupling"), in_frames)
    return spec, rules[kind]


def answer(spec, kind):
    """What `check` says of the spec's own wall, in the terms of a kind of rows."""
    if kind == "contact":
        rules = offered("rules").Rules.of(spec) if spec.for_all else None
        return of_wall(spec, rules)["verdict"]
    if spec.tick:
        from wavesweep.late_ticks.rows import claim

        return claim(spec).status.name.lower()
    return verdict(spec, Rules.of(spec).on_average() if kind == "mean_square" else None)["verdict"]


def broken(seed):
    """The values at which row and `check` differ, in words, how many were asked, and the share of the widest part that nothing
    refutes that is proved, NaN without a row."""
    tables, rules = random_set(seed)
    along = tables["sweep"].get("along", "K_VE")
    stop = tables["sweep"][along]["stop"]
    spec = load(tables | {"for_all": rules})
    try:
        columns = intervals(spec, jobs=1).columns
    except UsageError:  # contact of which no proof is known
        return [], 0, np.nan
    kind = next(kind for kind in ("contact", "mean_square", "for_all") if kind in columns["guarantee"])
    rows = np.flatnonzero(columns["guarantee"] == kind)
    row = {name: column[rows[0]] for name, column in columns.items()}
    end = row["fails_from"] if row["fails_from"] > 0 else float(stop)
    faults = []
    for place in PLACES:
        x = place * float(end)
        if x > stop:
            continue
        said = answer(load(tables | {"for_all": rules}, [f"{along}={x!r}"]), kind)
        within = bool(((columns["low"][rows] <= x) & (x <= columns["high"][rows])).any())
        if said == "proved" and not within and place <= 0.99 and not row["left_open"]:
            faults.append(f"{x:.6g} ({place} of {end:.6g}) is proved by check, and in no row")
        if within and said != "proved":
            faults.append(f"{x:.6g} ({place} of {end:.6g}) is in a row, and {said} by check")
        if said == "proved" and not row["intervals"] and row["certified"]:
            faults.append(f"{x:.6g} is proved by check where no value is said to be stable")
    low, high = columns["low"][rows], columns["high"][rows]
    widest = np.argmax(np.nan_to_num(high - low))
    fails = [np.nan_to_num(columns[name][rows], nan=end) for name, end in (("fails_below", 0), ("fails_from", stop))]
    return faults, len(PLACES), ((high - low) / (fails[1] - fails[0]))[widest]


def main():
    """Print the faults of so many sets, and how much of what nothing refutes is proved; 1 if there are faults."""
    first, count = map(int, ("0", *sys.argv[1:])[-2:])
    found = {seed: broken(seed) for seed in range(first, first + count)}
    for seed, (faults, *_) in found.items():
        for fault in faults:
            print(f"{seed} ({KINDS[seed % len(KINDS)]}): {fault}")
    wrong = sum(bool(faults) for faults, *_ in found.values())
    print(f"{count} sets, {sum(asked for _, asked, _ in found.values())} values: {wrong} sets with faults")
    shares = np.array([share for *_, share in found.values()])
    told = np.nanpercentile(shares, [0, 10, 50])
    print("share that is proved: least {:.4f}, tenth {:.4f}, median {:.4f}".format(*told))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
