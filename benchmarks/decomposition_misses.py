"""How often D-decomposition by hand (`bench.rivals.decomposed`) misses intervals of random loops.

    OPENBLAS_NUM_THREADS=1 python benchmarks/decomposition_misses.py [--specs 300]

Along K_VE, three columns a loop; a column is missed where the number of stable intervals is another than ball arithmetic
says. Beside it, how many columns this tool certifies, and how many of these are wrong.
"""

import argparse
import sys
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))  # the witnesses are those of the tests
from end_errors import WALL_SPANS, direct, first_order, waves
from stress.judge import judge
from stress.specs import Question, long_filters
from support.specs import nested

from bench.rivals import decomposed
from wavesweep.program.spec import load

ANGLES = (45, 180, 450, 2000)


def tally(make, seed):
    """(columns, certified, certified and wrong, *columns missed with each number of angles)."""
    r = np.random.default_rng(seed)
    values, (low, high) = make(r), WALL_SPANS["K_VE"]
    damping = sorted(r.uniform(0, 15, 3).tolist())
    verdicts = judge(Question(values, "K_VE", (low, high), tuple(damping)))
    spec = load({**nested(values), "sweep": {"K_VE": {"start": low, "stop": high}, "B_VE": damping}})
    known = [(column, len(v.truth)) for column, v in enumerate(verdicts) if v.kind not in ("refused", "undecided")]
    missed = [sum(there != found[column] for column, there in known) for found in (counts(spec, n) for n in ANGLES)]
    sure = [v for v in verdicts if v.certified]
    return np.array([len(known), len(sure), sum(v.kind == "wrong" for v in sure), *missed])


def counts(spec, angles):
    """Intervals per column; -1 where LAPACK gives up."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return np.bincount(decomposed(spec, angles).column, minlength=3)
    except np.linalg.LinAlgError:
        return np.full(3, -1)


def main():
    """Print a line per kind of loop."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--specs", type=int, default=300, help="random loops of each kind")
    specs = parser.parse_args().specs
    whole = 0
    for make, share in ((first_order, 1), (waves, 1), (direct, 1), (long_filters, 4)):
        part = sum(tally(make, seed) for seed in range(max(1, specs // share)))
        print(line(make.__name__, part), flush=True)
        whole = whole + part
    print(line("together", whole))


def line(name, counted):
    """What a tally says."""
    columns, certified, wrong, *missed = counted
    each = ", ".join(f"{count} with {angles} angles" for count, angles in zip(missed, ANGLES, strict=True))
    return f"{name}: {columns} columns, {certified} certified, {wrong} of these wrong; D-decomposition misses {each}"


if __name__ == "__main__":
    main()
