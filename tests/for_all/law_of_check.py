"""Whether the rows of random sets of loops and `check` of single values agree: `python -m for_all.law_of_check 300` in tests/,
or from a seed on, `... 40 300`."""

import sys

import numpy as np
from meaning.sets import ALONE, KINDS, set_of

from wavesweep.capabilities import offered
from wavesweep.contact.verdict import of_wall
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.for_all.rows import verdict
from wavesweep.for_all.varying import Rules
from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

PLACES = (1.01e-3, 0.02, 0.2, 0.5, 0.8, 0.95, 0.985, 1.001, 1.02, 1.3)  # of what nothing refutes


def answer(spec, kind):
    """What `check` says of the spec's own wall, in the terms of a kind of rows."""
    if kind == "contact":
        rules = offered("rules").Rules.of(spec) if spec.for_all else None
        return of_wall(spec, rules)["verdict"]
    if spec.tick:
        from wavesweep.late_ticks.rows import claim

        return claim(spec).status.name.lower()
    return verdict(spec, Rules.of(spec).on_average() if kind == "mean_square" else None)["verdict"]


def broken(seed, kinds=KINDS):
    """The values at which row and `check` differ, in words, how many were asked, and the share of the widest part that nothing
    refutes that is proved, NaN without a row."""
    tables = set_of(seed, kinds)
    along = tables["sweep"]["along"]
    stop = tables["sweep"][along]["stop"]
    try:
        columns = intervals(load(tables), jobs=1, along=along).columns
    except (SpecError, UsageError):  # contact of which no proof is known, and constant numbers that vary
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
        said = answer(load(tables, [f"{along}={x!r}"]), kind)
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
    kinds = KINDS + ALONE
    found = {seed: broken(seed, kinds) for seed in range(first, first + count)}
    for seed, (faults, *_) in found.items():
        for fault in faults:
            print(f"{seed} ({kinds[seed % len(kinds)].__name__}): {fault}")
    wrong = sum(bool(faults) for faults, *_ in found.values())
    print(f"{count} sets, {sum(asked for _, asked, _ in found.values())} values: {wrong} sets with faults")
    shares = np.array([share for *_, share in found.values()])
    told = np.nanpercentile(shares, [0, 10, 50])
    print("share that is proved: least {:.4f}, tenth {:.4f}, median {:.4f}".format(*told))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
