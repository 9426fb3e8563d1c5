"""A spec as a machine, with other numbers in it, and what of it drifts."""

from copy import deepcopy

import numpy as np
from meaning import doubles
from meaning.machine import Machine, at_one, radius
from meaning.specs import PATHS

from wavesweep.checker.reader import loop_of


def machine_of(tables: dict, cut: str = "") -> Machine:
    """Of a drawing perhaps with an input "cut", which is added to the signal `cut` where it is read."""
    return Machine(loop_of(tables, doubles, cut).schedule())


def with_numbers(tables: dict, numbers: dict) -> dict:
    """The spec with other numbers, by their paths or the names that a drawing gives them."""
    changed = deepcopy(tables)
    for name, value in numbers.items():
        path = PATHS.get(name, name) if "controller" in tables else f"numbers.{name.removeprefix('numbers.')}"
        table, _, key = path.rpartition(".")
        inner = changed
        for each in table.split("."):
            inner = inner.setdefault(each, {})
        inner[key] = value
    return changed


def drift_of(tables: dict, monodromy: np.ndarray | None = None) -> int:
    """How many eigenvalues stay at 1 if numbers other than 0 are moved: what no wall of the loop opposes.

    monodromy: of these tables, if it is known.
    """
    counts = [at_one(machine_of(tables).monodromy() if monodromy is None else monodromy)]
    for seed in range(2):
        if not counts[-1]:
            return 0
        random = np.random.default_rng(seed)
        moved = deepcopy(tables)
        if "controller" in tables:
            moved.setdefault("environment", {}).update({"K_VE": random.uniform(5.0, 50.0), "B_VE": random.uniform(0.1, 1.0)})
            moved["controller"]["b"] = moved["controller"].get("b", 25.0) * random.uniform(0.9, 1.1)
            device = moved.setdefault("device", {})
            if "preset" not in device:
                device["mass"] = device.get("mass", 0.1) * random.uniform(0.9, 1.1)
        else:
            for name, value in moved["numbers"].items():
                if isinstance(value, float) and name != "h":  # a period: cutoffs would pass half a rate
                    moved["numbers"][name] = value * random.uniform(0.9, 1.1)
        counts.append(at_one(machine_of(moved).monodromy()))
    return min(counts)


def radius_of(tables: dict, drift: int) -> float:
    return radius(machine_of(tables).monodromy(), drift)
