"""`python -m tests.meaning`: as many random specs as asked for, held against the package, and a tally."""

import argparse
import os
import sys
import tempfile
import traceback
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial

from meaning.attacked import judge_attacked
from meaning.coverage import lines
from meaning.faults import judge_fault
from meaning.judge import Found, compiled, judge
from meaning.pairs import judge_pair
from meaning.rewritten import judge_rewritten
from meaning.sets_rewritten import judge_rewritten_set
from meaning.specs import spec_text


def main():
    """Print what differs as it comes, and the counts at the end; the exit code is 1 if anything does."""
    parser = argparse.ArgumentParser(prog="python -m tests.meaning", description=__doc__)
    parser.add_argument("--specs", type=int, default=1000, help="how many")
    parser.add_argument("--seed", type=int, default=0, help="number of the first one")
    parser.add_argument("--jobs", type=int, default=1, help="worker processes")
    parser.add_argument("--ticks", type=int, default=120, help="of a simulation")
    parser.add_argument("--ends", type=int, default=1, help="ends and responses of each so manieth spec alone")
    parser.add_argument("--coverage", action="store_true", help="how many specs have each key, and no comparisons")
    parser.add_argument("--rewritten", type=int, default=0, help="so many specs against the same in other words, and no others")
    parser.add_argument("--rewritten-sets", type=int, default=0, help="so many specs with sets against the same in other words")
    parser.add_argument("--attacked", type=int, default=0, help="so many specs with sets, attacked, and no others")
    parser.add_argument("--pairs", type=int, default=0, help="so many specs with two keys that may override each other")
    parser.add_argument(
        "--faults", type=int, default=0, help="so many commands with random specs and options, for a moment each"
    )
    parser.add_argument("--required", type=int, default=10, help="requirements of each so manieth of these alone")
    chosen = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if chosen.coverage:
        found, missing = lines(chosen.specs)
        print(*found, sep="\n")
        sys.exit(bool(missing))
    numbers = range(chosen.seed, chosen.seed + chosen.specs)
    work = partial(attempt, chosen.ticks, chosen.ends, chosen.ends * chosen.required)
    if chosen.rewritten:
        numbers = range(chosen.seed, chosen.seed + chosen.rewritten)
        work = partial(attempt_of, rewritten_of)
    if chosen.attacked:
        numbers = range(chosen.seed, chosen.seed + chosen.attacked)
        work = partial(attempt_of, judge_attacked)
    if chosen.rewritten_sets:
        numbers = range(chosen.seed, chosen.seed + chosen.rewritten_sets)
        work = partial(attempt_of, judge_rewritten_set)
    if chosen.faults:
        numbers = range(chosen.seed, chosen.seed + chosen.faults)
        work = partial(attempt_of, judge_fault)
    if chosen.pairs:
        numbers = range(chosen.seed, chosen.seed + chosen.pairs)
        work = partial(attempt_of, judge_pair)
    if chosen.jobs == 1:
        sys.exit(tally(map(work, numbers)))
    with ProcessPoolExecutor(chosen.jobs) as pool:
        sys.exit(tally(pool.map(work, numbers, chunksize=8)))


def attempt(ticks: int, ends: int, required: int, number: int) -> tuple[int, list[Found], str]:
    """(number, comparisons, why there are none)."""
    text = spec_text(number)
    with tempfile.TemporaryDirectory() as folder:
        try:
            loop = compiled(text, folder)
            return number, judge(text, loop, ticks, whole=number % ends == 0, required=number % required == 0), ""
        except Exception:  # noqa: BLE001 what goes wrong is a finding, and the others are still to run
            return number, [], traceback.format_exc()


def attempt_of(judged, number: int) -> tuple[int, list[Found], str]:
    """The same of another law, a function from the number of a spec to what it finds."""
    try:
        return number, judged(number), ""
    except Exception:  # noqa: BLE001 as above
        return number, [], traceback.format_exc()


def rewritten_of(number: int) -> list[Found]:
    """What `judge_rewritten` finds, in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return judge_rewritten(number, folder)


def tally(results) -> int:
    """Print what differs, and how many comparisons of each kind there were."""
    counts: Counter[str] = Counter()
    wrong = 0
    for number, found, fault in results:
        counts["specs"] += 1
        bad = [one for one in found if not one.same]
        for one in found:
            counts[one.what.partition(" at ")[0] + ("" if one.same else " DIFFERS")] += 1
        if fault:
            counts["refused, or failed"] += 1
        if bad or fault:
            wrong += 1
            print(
                f"spec {number}", *(f"  {one.what}: {one.mine!s:.200} here, {one.theirs!s:.200} there" for one in bad), sep="\n"
            )
            print(fault, end="", flush=True)
        if counts["specs"] % 1000 == 0:
            print(dict(counts), file=sys.stderr, flush=True)
    print(*(f"{count:8d} {what}" for what, count in sorted(counts.items())), sep="\n")
    return int(wrong > 0)
