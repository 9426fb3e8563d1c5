"""The columns of `families.toml`, what is right and what is answered today, as rows of `expected.csv`."""

import csv
import os
import tomllib
from copy import deepcopy
from itertools import product
from pathlib import Path

import numpy as np

FAMILIES = tomllib.loads((Path(__file__).parent / "families.toml").read_text(encoding="utf-8"))
EXPECTED = Path(__file__).parent / "expected.csv"
HEAD = ("column", "ends", "answer", "eigenvalue_problems", "ball_operations")
UPDATE = bool(os.environ.get("WAVESWEEP_UPDATE"))
IN_KEYS = {"b": "controller", "B_VE": "environment"}  # tables of the keys of a built-in controller


def questions():
    """Name of each column -> (family, the numbers that it has, its spec as tables, the range)."""
    found = {}
    for family, tables in FAMILIES.items():
        sweep = tables["sweep"]
        along = sweep["along"]
        lists = {name: values for name, values in sweep.items() if isinstance(values, list)}
        for values in product(*lists.values()):
            numbers, spec = dict(zip(lists, values, strict=True)), deepcopy(tables)
            for name, value in numbers.items():
                spec[IN_KEYS.get(name, "numbers")][name] = value
            spec["sweep"] = {"along": along, along: sweep[along]}
            span = float(sweep[along]["start"]), float(sweep[along]["stop"])
            found[" ".join([family, *(f"{name}={value}" for name, value in numbers.items())])] = family, numbers, spec, span
    return found


def expected():
    """The rows of the file by their columns."""
    if not EXPECTED.exists():
        return {}
    with EXPECTED.open(encoding="utf-8", newline="") as file:
        return {row["column"]: row for row in csv.DictReader(file)}


def update(column, **cells):
    """Write cells of a row anew; rows are in the order of the families. The ends of a new one are set by hand."""
    rows = expected()
    rows[column] = dict.fromkeys(HEAD, "") | rows.get(column, {}) | {"column": column} | cells
    with EXPECTED.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, HEAD, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows[name] for name in questions() if name in rows)


def ends_of(text):
    """Intervals from a cell."""
    return [tuple(map(float, part.split(" to "))) for part in text.split("; ") if part]


class Counted:
    """Counts eigenvalue problems and operations of ball arithmetic."""

    def __init__(self, patch):
        from wavesweep.prove.ball_polynomials import Budget

        self.eigenvalue_problems = self.ball_operations = 0
        for name in ("eig", "eigvals"):
            patch.setattr(np.linalg, name, self.counting(getattr(np.linalg, name)))
        use = Budget.use

        def counted(budget, operations):
            self.ball_operations += round(operations)
            use(budget, operations)

        patch.setattr(Budget, "use", counted)

    def counting(self, solve):
        def counted(matrix):
            self.eigenvalue_problems += int(np.prod(np.shape(matrix)[:-2]))
            return solve(matrix)

        return counted
