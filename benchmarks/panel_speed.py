"""What a slice costs along numbers that are no single gain of a frame, in batches of a hundred with certificate and DataFrame.

    OPENBLAS_NUM_THREADS=1 python benchmarks/panel_speed.py [--recipes] [--least] [--rounds 5]

Beside each, in turn: eigenvalues at 100 values of the number, which know nothing of what lies between. Medians of some rounds.
--least: only the cases with a least ratio, a third of what it was when these lines were written; the exit code is 1 if one is
below.
--recipes: every recipe along each of its smooth numbers instead, from 0.3 to 3 times its value, for 100 values of another one.
"""

import argparse
import sys
import tomllib
from pathlib import Path

import numpy as np

import wavesweep
from bench.measuring import seconds
from wavesweep.program.platform_compat import keep_memory

RECIPES = Path(__file__).parents[1] / "sweeps" / "recipes"
BANK = {"controller": {"kind": "pmw-lm", "b": 25.0, "Kp": 20.0}}
ENGINE = {"device": {"velocity": "difference"}, "environment": {"integration": "explicit", "delay": "frame", "K_VE": 200.0}}
USUAL = BANK | ENGINE  # as `init pmw-lm` writes it
IMPEDANCES, MASSES = {"b": np.linspace(10, 60, 100)}, {"device.mass": np.linspace(0.1, 0.5, 100)}
LONG = {  # a frame of 1,000 ticks
    "rates": {"tick_hz": 1000},
    "numbers": {"K": 0.5, "m": 0.2, "c": 2.0},
    "block": {
        "device": {"type": "mass", "mass": "m", "damping": "c"},
        "scene": {"type": "hold", "every": 1000},
        "force": {"type": "hold", "every": 1000},
    },
    "wire": {"device.f": "force.y", "scene.u": "device.x", "force.u": "-K*scene.y"},
}


def uneven(kind, rate):
    """A loop as `init` writes it, of an engine whose rate need not divide that of the device."""
    filters = {"lp1": {"order": 1, "cutoff_hz": 10.0}}
    return ENGINE | {"controller": {"kind": kind, "b": 25.0}, "rates": {"slow_hz": rate}, "filters": filters}


def chain(masses, ticks):
    """Masses in a row, the first on a spring that is read once in so many ticks: two states each, and what is held."""
    neighbours = {i: [j for j in (i - 1, i + 1) if 0 <= j < masses] for i in range(masses)}
    forces = {f"m{i}.f": " ".join(f"-k*(m{i}.x-m{j}.x)-0.2*(m{i}.v-m{j}.v)" for j in near) for i, near in neighbours.items()}
    first, others = {"type": "mass", "mass": "m", "damping": 0.5}, {"type": "mass", "mass": 0.1, "damping": 0.5}
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"m": 0.2, "k": 50.0, "K": 20.0},
        "block": {f"m{i}": others if i else first for i in range(masses)} | {"h": {"type": "hold", "every": ticks}},
        "wire": forces | {"h.u": "m0.x", "m0.f": forces["m0.f"] + " - K*h.y"},
    }


SPRINGS = {"K": np.linspace(5, 40, 100)}
CASES = (
    ("pmw-lm, 9 states", BANK, "b", (5, 200), {"K_VE": np.linspace(100, 3000, 100)}),
    ("pmw-lm, 9 states", BANK, "b", (5, 200), MASSES),
    ("pmw-lm, 9 states", BANK, "Kp", (1, 100), IMPEDANCES),
    ("pmw-lm, 9 states", BANK, "K_LM", (0, 3000), IMPEDANCES),
    ("pmw-lm, 9 states", BANK, "device.mass", (0.05, 1), IMPEDANCES),
    ("pmw-lm, 9 states", BANK, "filters.lp1.cutoff_hz", (2, 60), IMPEDANCES),
    ("pmw-lm at 60 Hz, 50 ticks", BANK | {"rates": {"slow_hz": 60}}, "K_VE", (0, 20000), IMPEDANCES),
    ("pmw-lm, usual engine", USUAL, "b", (5, 200), {"K_VE": np.linspace(100, 1500, 100)}),
    ("pmw-lm, usual engine", USUAL, "Kp", (1, 100), IMPEDANCES),
    ("pmw-lm, usual engine", USUAL, "device.mass", (0.05, 1), IMPEDANCES),
    *(
        (f"{kind} at {rate} Hz, usual engine", uneven(kind, rate), "K_VE", (0, 5000), IMPEDANCES)
        for kind in ("pmw", "pmw-lm")
        for rate in (60, 72, 90)
    ),
    ("teleoperation.toml, 13 states", RECIPES / "teleoperation.toml", "c", (0.1, 10), {"kp": np.linspace(40, 60, 100)}),
    ("policy.toml, 5 states", RECIPES / "policy.toml", "f", (0.1, 60), {"zeta": np.linspace(0.5, 2, 100)}),
    ("two-rate-wall.toml, 4 states", RECIPES / "two-rate-wall.toml", "K", (0, 3000), {"B": np.linspace(1, 10, 100)}),
    ("1,000 ticks, 4 states", LONG, "m", (0.01, 1), {"K": np.linspace(0.1, 2, 100)}),
    *(
        (f"chain of {2 * masses + 1} states, {ticks} ticks", chain(masses, ticks), along, span, SPRINGS)
        for masses in (5, 9)
        for ticks in (20, 1000)
        for along, span in (("m", (0.05, 1)), ("k", (20, 100)))
    ),
)


LEAST = {  # ratio of a case, by its loop and the number
    ("pmw-lm, 9 states", "K_LM"): 0.8,
    ("pmw-lm, usual engine", "b"): 0.22,
    ("policy.toml, 5 states", "f"): 0.14,
    ("two-rate-wall.toml, 4 states", "K"): 0.44,
}


def recipes():
    """Yield a case for every smooth number of every recipe."""
    for path in sorted(RECIPES.glob("*.toml")):
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
        tables.pop("sweep", None)
        given = {name: entry["value"] if isinstance(entry, dict) else entry for name, entry in tables["numbers"].items()}
        values = {name: value for name, value in given.items() if isinstance(value, float) and value}
        for name, value in values.items():
            other = next((each for each in values if each != name), None)
            if other and not wavesweep.compile(tables).spec.names.find(name).structural:
                yield path.name, tables, name, (0.3 * value, 3 * value), {other: values[other] * np.linspace(0.8, 1.2, 100)}


def main():
    """Print a line per case; 1 if one is too slow, and it is asked for."""
    keep_memory()  # as commands do
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recipes", action="store_true", help="every recipe along each of its smooth numbers")
    parser.add_argument("--least", action="store_true", help="only cases with a least ratio, which they have to reach")
    parser.add_argument("--rounds", type=int, default=5, help="pairs of calls, of which the median counts")
    asked, slow = parser.parse_args(), []
    print("| loop | along | over | ms a slice | eigenvalues at 100 values (ms) | ratio | certified | intervals |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, source, along, span, axes in recipes() if asked.recipes else CASES:
        least = LEAST.get((name, along), 0.0)
        if asked.least and not least:
            continue
        loop = wavesweep.compile(source)
        values = np.geomspace(*span, 100) if span[0] > 0 else np.linspace(*span, 101)[1:]

        def exact(loop=loop, along=along, span=span, axes=axes):
            return loop.stable_intervals(along, span, **axes)

        def scan(loop=loop, along=along, values=values, axes=axes):
            return loop.spectral_radius(**axes, **{along: values})

        times = np.array([(seconds(exact), seconds(scan)) for _ in range(1 + asked.rounds)][1:]) * 1e3 / 100
        (ours, theirs), ratio, table = np.median(times, axis=0), np.median(times[:, 1] / times[:, 0]), exact()
        print(
            f"| {name} | {along} | {', '.join(axes)} | {ours:.2f} | {theirs:.2f} | {ratio:.2f} | "
            f"{table.certified.mean():.0%} | {int((table.intervals > 0).sum())} |",
            flush=True,
        )
        if ratio < least:
            slow.append(f"{name} along {along}: ratio {ratio:.2f}, expected at least {least}")
    if slow:
        print("\n".join(slow), file=sys.stderr)
    return int(bool(slow) and asked.least)


if __name__ == "__main__":
    sys.exit(main())
