"""`python -m tests.stress`: as many specs as asked for, and a tally."""

import argparse
import sys
import traceback
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial

from stress import climbs, constructed, hands, numbers, responses, windows
from stress.judge import judge
from stress.specs import FAMILIES, question

JUDGES = {
    "numbers": numbers.judge, "windows": windows.judge, "climbs": climbs.judge, "hands": hands.judge,
    "responses": responses.verdicts, "constructed": lambda number: judge(constructed.question(number)),
}  # fmt: skip
NAMES = (*FAMILIES, *JUDGES)


def main():
    """Parse, run, print; the exit code is 1 where a certified row is wrong or anything crashed."""
    parser = argparse.ArgumentParser(prog="python -m tests.stress", description=__doc__)
    parser.add_argument("--specs", type=int, default=1000, help="how many, dealt out over the families")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--family", choices=NAMES, action="append", help="only of these families")
    parser.add_argument("--jobs", type=int, default=1, help="worker processes")
    chosen = parser.parse_args()
    families = chosen.family or list(NAMES)
    numbers = range(chosen.first, chosen.first + chosen.specs)
    work = partial(attempt, families)
    if chosen.jobs == 1:
        results = map(work, numbers)
        sys.exit(tally(results))
    with ProcessPoolExecutor(chosen.jobs) as pool:
        sys.exit(tally(pool.map(work, numbers, chunksize=8)))


def attempt(families, number):
    """(name of the spec, verdicts, traceback of a crash)."""
    family = families[number % len(families)]
    name = f"{family} {number}"
    try:
        return name, verdicts(family, number), ""
    except Exception:  # noqa: BLE001 a crash is a finding, and the others are still to run
        return name, [], traceback.format_exc()


def verdicts(family, number):
    """What became of every column of this spec."""
    return JUDGES[family](number) if family in JUDGES else judge(question(number, family))


def tally(results) -> int:
    """Print what is wrong as it comes, and the counts at the end."""
    counts, why, crashes, specs, worst = Counter(), Counter(), 0, 0, 0.0
    for name, columns, crash in results:
        specs += 1
        if specs % 1000 == 0:
            print(specs, dict(counts), file=sys.stderr, flush=True)
        crashes += bool(crash)
        if crash:
            print("CRASH", name, *crash.splitlines()[-3:], flush=True)
        for column, v in enumerate(columns):
            counts[v.kind, v.certified] += v.rows
            if not v.certified and v.kind != "refused":
                why[name.split()[0], v.why] += v.rows
            if v.certified and v.kind in ("wrong", "loose", "undecided"):
                print(v.kind.upper(), name, "column", column, f"{v.error:.1e}", v.answered[:4], v.truth[:4], flush=True)
            if v.certified and v.kind == "right":
                worst = max(worst, v.error)
    print(f"{specs} specs, {crashes} crashes; rows by verdict and whether certified:")
    for (kind, sure), rows in sorted(counts.items()):
        print(f"  {kind:10} {'certified' if sure else 'not certified':14} {rows}")
    print(f"largest relative error of a right certified end: {worst:.1e}")
    for (family, reason), rows in sorted(why.items()):
        print(f"  not certified: {family:18} {reason:26} {rows}")
    return int(crashes > 0 or counts["wrong", True] > 0)
