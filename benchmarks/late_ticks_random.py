"""Random loops with late ticks: what share is proved of what no pattern of ticks refutes.

python benchmarks/late_ticks_random.py FIRST COUNT   COUNT loops from the seed FIRST on, a line for each (JSON)
python benchmarks/late_ticks_random.py spec SEED     one of them, as tables
"""

import json
import sys
import time

import numpy as np

from wavesweep.late_ticks.patterns import growing
from wavesweep.late_ticks.rows import records_for_ticks, refuse
from wavesweep.late_ticks.tick_curves import late_ticks
from wavesweep.program.analyses.interval_jobs import records_of_loop
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

KINDS = ("dc-slow", "dc-lm", "dc-vc", "dc-vc-lm", "pmw", "pmw-lm", "pmw-mean", "drawn")
MOST = 20000.0  # N/m: the end of the range, or 1.3 of the limit if no tick is late


def haptic(kind, rng):
    """A loop with a controller by name, and what is swept."""
    pick = rng.choice
    ratio = int(pick([1, 2, 5, 10, 20]))
    low_mass = float(10 ** rng.uniform(-1.3, -0.3))
    delays = ["frame", 0, int(rng.integers(0, ratio + 1))]
    tables = {
        "rates": {"fast_hz": float(pick([500.0, 1000.0, 1000.0, 1000.0, 2000.0])), "ratio": ratio},
        "device": {"mass": low_mass, "damping": rng.uniform(0.5, 4), "velocity": str(pick(["difference", "exact"]))},
        "environment": {
            "K_VE": 1.0,
            "B_VE": float(pick([0, 0, 1, 3])),
            "integration": str(pick(["explicit", "implicit", "trapezoidal"])),
            "delay": delays[rng.integers(3)],
        },
        "controller": {"kind": kind},
    }
    if rng.random() < 0.3:
        tables["device"]["delay"] = int(rng.integers(1, 4))
    if rng.random() < 0.4:
        tables["operator"] = {"mass": rng.uniform(0.02, 0.4), "damping": rng.uniform(0.5, 3), "stiffness": 0.0}
    if kind.startswith("pmw"):
        tables["controller"] |= {"b": float(pick([10, 20, 25, 38.5, 60])), "Kp": float(pick([0, 0, rng.uniform(5, 25)]))}
    if kind in ("pmw", "pmw-lm"):
        tables["filters"] = {"lp1": {"order": int(pick([1, 1, 2])), "cutoff_hz": float(pick([8.57, 10, 20]))}}
    if kind == "pmw-lm":
        lp2 = {"order": 2, "cutoff_hz": float(pick([15.9, 20]))}
        tables["filters"] |= {"hp": {"order": 1, "cutoff_hz": 10.0}, "lp2": lp2}
    if kind.endswith("lm"):
        tables["local_model"] = {"K_LM": float(pick([100, 300, 500])), "B_LM": float(pick([0, 0, 0.416]))}
    if "vc" in kind:
        tables["controller"] |= {"K_VC": float(pick([625, 1000, 2000])), "B_VC": float(pick([2, 5.17]))}
    along = "environment.K_VE"
    if rng.random() < 0.2:
        tables["environment"]["K_VE"] = float(10 ** rng.uniform(0.5, 2.5))
        along = "environment.B_VE"
    return tables, along, tables["rates"]["fast_hz"]


def drawn(rng):
    """The speed loop of a drive at two rates, along its gain, or its integral gain."""
    hz = float(rng.choice([4000, 10000]))
    numbers = {
        "J": float(10 ** rng.uniform(-4.5, -3.5)),
        "D": 1e-4,
        "Tc": rng.uniform(2e-4, 1e-3),
        "f": rng.uniform(100, 500),
        "kp": float(10 ** rng.uniform(-2, -1)),
        "ki": float(10 ** rng.uniform(-1, 1)),
    }
    block = {
        "motor": {"type": "inertia", "inertia": "J", "damping": "D"},
        "current": {"type": "tf", "num": [1], "den": ["Tc", 1]},
        "measured": {"type": "lowpass", "cutoff_hz": "f"},
        "control": {"type": "pi", "kp": "kp", "ki": "ki", "every": int(rng.choice([1, 5, 10]))},
    }
    wire = {
        "measured.u": "motor.v",
        "control.u": "ref - measured.y",
        "current.u": "control.y",
        "motor.f": "0.05*current.y - load",
    }
    ports = {"inputs": {"ref": "ref", "load": "load"}, "outputs": {"speed": "motor.v"}}
    tables = {"rates": {"tick_hz": hz}, "numbers": numbers, "block": block, "wire": wire, "ports": ports}
    return tables, str(rng.choice(["kp", "kp", "ki"])), hz


def random_spec(seed):
    """Tables without a range, what is swept, and the table of ticks."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    tables, along, hz = drawn(rng) if kind == "drawn" else haptic(kind, rng)
    shares = [(1, 1 + float(rng.choice([0.05, 0.1, 0.2, 0.5]))), (0.8, 1.2), (0.5, 1.0), (0.95, 2.0)]
    low, high = shares[rng.choice(4, p=[0.4, 0.3, 0.15, 0.15])]
    return tables, along, {"start": low / hz, "stop": high / hz}


def ranged(tables, along, tick, stop):
    """A spec with its range."""
    axis = along.rpartition(".")[2]
    sweep = {"along": axis, axis: {"start": 0.0, "stop": stop}}
    return load(tables | {"for_all": {"tick": tick}, "sweep": sweep})


def answered(seed):
    """What is known of a random loop, as a dict; None if no value is stable where no tick is late."""
    tables, along, tick = random_spec(seed)
    own = records_of_loop(own_loop(load(tables), along), along, (0.0, MOST))
    own = own[own["intervals"] > 0]
    if not own.size:
        return None
    stop = min(MOST, 1.3 * float(own["high"].max()))
    spec = ranged(tables, along, tick, stop)
    refuse(spec, along)
    loop = own_loop(spec, along)
    interval = spec.tick.interval(spec.tick_hz)
    begun = time.process_time()
    rows = records_for_ticks(loop, along, (0.0, stop), interval)
    took = time.process_time() - begun
    on_time = [(float(row["low"]), min(stop, float(row["high"]))) for row in own]
    refuted = []  # of an interval without a row, the share of 16 values that a pattern refutes
    for low, high in on_time:
        rate = 0.0
        if not any(low - 1e-9 <= row["low"] <= high for row in rows):
            ticks = late_ticks(loop, along, interval)
            values = low + (high - low) * np.array([1e-3, *(np.arange(1, 16) + 0.5) / 16])
            rate = float(np.mean([growing(ticks, value)[0] >= 1 for value in values]))
        refuted.append(rate)
    columns = ("low", "high", "fails_below", "fails_from")
    return {
        "seed": seed,
        "kind": KINDS[seed % len(KINDS)],
        "along": along,
        "tick": tick,
        "cpu": took,
        "refuted": refuted,
        "on_time": on_time,
        "rows": [{name: float(row[name]) for name in columns} for row in rows],
    }


def share(found):
    """What is proved over what nothing refutes, of the intervals if no tick is late."""
    proved = left = 0.0
    for (low, high), refuted in zip(found["on_time"], found["refuted"], strict=True):
        left += (1 - refuted) * (high - low)
        for row in found["rows"]:
            if low - 1e-9 <= row["low"] <= high:
                proved += row["high"] - row["low"]
                left -= max(0.0, np.nan_to_num(row["fails_below"] - low))
                left -= max(0.0, np.nan_to_num(high - row["fails_from"]))
    return proved / left if left else 1.0


def main():
    """Print the figures of each loop, and those of all."""
    if sys.argv[1] == "spec":
        print(random_spec(int(sys.argv[2])))
        return
    seed, count = map(int, sys.argv[1:3])
    shares, took = [], []
    while len(shares) < count:
        found = answered(seed)
        seed += 1
        if found is None:
            continue
        found["share"] = share(found)
        print(json.dumps(found), flush=True)
        shares.append(found["share"])
        took.append(found["cpu"])
    least, tenth, median = np.quantile(shares, [0, 0.1, 0.5])
    print(f"{count} loops: least {least:.3f}, tenth percentile {tenth:.3f}, median {median:.4f}")
    print(f"{np.median(took):.2g} CPU s in the median, {max(took):.3g} at most, {sum(took):.4g} in all")


if __name__ == "__main__":
    main()
