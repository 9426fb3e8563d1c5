"""How far certified ends of stable intervals are from the true ones, over random loops of many kinds.

    OPENBLAS_NUM_THREADS=1 python benchmarks/end_errors.py [--specs 400] [--jobs 2] [--condition NAME]

Prints the table of `docs/accuracy.md`: a row per condition with the median, the 99 % quantile and the worst error of
all certified ends, each relative to the end itself. Along the wall's stiffness and damping the truth is from ball arithmetic
that isolates every crossing (`support.certified`); along any other number, from Newton's method on the characteristic
determinant at 512 bits (`support.balls`). A certified column whose intervals are others than there are is named and makes
the exit code 1.
"""

import argparse
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import floor, inf, log10, pi
from pathlib import Path

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))  # the witnesses are those of the tests
from stress import constructed
from stress.judge import judge
from stress.specs import Question, long_filters, spread, usual, wild
from support import balls, certified
from support.specs import nested

import wavesweep

BITS = 512
SHARP = 1e-19  # relative radius of the balls that are called the truth
WALL_SPANS = {"K_VE": (0.0, 20000.0), "B_VE": (0.0, 300.0)}
OTHER_SPANS = {"controller.b": (0.5, 200.0), "local_model.K_LM": (0.0, 5000.0), "controller.Kp": (0.0, 200.0),
               "device.mass": (0.01, 3.0)}  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """Of one loop. errors: of every certified end, relative to it. columns, certified: how many. wrong: certified columns
    with other intervals than there are."""

    errors: tuple[float, ...]
    columns: int
    certified: int
    wrong: int


@dataclass(frozen=True)
class Condition:
    """Random loops of one kind. examine(seed) gives the outcome of one; share: of the loops asked for, for slow ones."""

    name: str
    examine: Callable[[int], Outcome]
    share: float = 1.0


def waves(r, **changes):
    """A loop over waves that somebody might build."""
    return usual(r) | {"controller.kind": str(r.choice(["pmw", "pmw-lm"]))} | changes


def first_order(r):
    """Every filter of first order."""
    return waves(r, **{f"filters.{name}.order": 1 for name in ("lp1", "hp", "lp2")})


def direct(r):
    """Direct coupling to the slow wall."""
    return usual(r) | {"controller.kind": str(r.choice(["dc-slow", "dc-lm"]))}


def many_ticks(r):
    """200 to 1000 ticks in a frame of 20 ms."""
    ratio = round(spread(r, 200, 1000))
    rates = {"rates.ratio": ratio, "rates.fast_hz": 50.0 * ratio, "environment.delay": int(r.integers(0, ratio + 1))}
    return waves(r) | rates | {f"filters.{name}.cutoff_hz": spread(r, 2, 100) for name in ("lp1", "hp", "lp2")}


def light(r):
    """A device of 1 mg to 1 g in nobody's hand, coupled directly: over waves it is stable everywhere or nowhere."""
    hand = {f"operator.{name}": 0.0 for name in ("mass", "damping", "stiffness")}
    return direct(r) | hand | {"device.mass": spread(r, 1e-6, 1e-3)}


def along_wall(make, along, seed) -> Outcome:
    """One random loop with three columns along the wall's stiffness or damping."""
    r = np.random.default_rng(seed)
    values = make(r)
    most = min(15.0, values["device.mass"] * values["rates.fast_hz"])  # a light device bears no more damping
    fixed = r.uniform(0, most, 3) if along == "K_VE" else [spread(r, 1, 2e4) for _ in range(3)]
    return outcome(Question(values, along, WALL_SPANS[along], tuple(map(float, fixed))))


def merging(seed) -> Outcome:
    """Three columns next to where two crossings merge, or one reaches an end of the circle."""
    return outcome(constructed.question(seed))


class SharpWitness(certified.Witness):
    """One whose ends are known to far more digits than a double has."""

    def regions(self, along, span, fixed):
        """All regions of one column, at as many bits as that takes."""
        return self.ask(lambda compiled: _sharp(compiled.regions(along, span, fixed)))


def _sharp(regions):
    for end in (end for region in regions for end in (region.low, region.high)):
        if end.rad() > SHARP * abs(end.mid()):
            raise certified.Undecided
    return regions


def outcome(question) -> Outcome:
    """Judge a question along the wall by ball arithmetic."""
    verdicts = [v for v in judge(question, SharpWitness(question.values)) if v.kind not in ("refused", "undecided")]
    sure = [v for v in verdicts if v.certified]
    wrong = [v for v in sure if v.error == inf]
    errors = [error for v in sure if v not in wrong for error in _relative(v, question.span)]
    return Outcome(tuple(errors), len(verdicts), len(sure), len(wrong))


def _relative(verdict, span):
    """Errors of the ends that are crossings; those at the ends of the span are where the span was put."""
    for answered, true in zip(verdict.answered, verdict.truth, strict=False):
        for mine, there in zip(answered[:2], true[:2], strict=True):
            if there not in span and mine not in span:
                yield abs(mine - there) / abs(there)


def along_other(path, seed) -> Outcome:
    """One random loop with a local model along a number of its own."""
    r = np.random.default_rng(seed)
    values = waves(r, **{"controller.kind": "pmw-lm"})
    table = wavesweep.compile(nested(values)).stable_intervals(path, OTHER_SPANS[path])
    sure, frame = bool(table.certified.all()), values["rates.ratio"] / values["rates.fast_hz"]
    ends = [(row.low, row.low_omega) for row in table.itertuples()] + [(row.high, row.high_omega) for row in table.itertuples()]
    turning = [(end, omega * frame) for end, omega in ends if sure and end > 0 and omega > 0]  # at z = 1 drift may stand too
    errors = [abs(end / true_end(values, path, end, theta) - 1) for end, theta in turning]
    return Outcome(tuple(errors), 1, int(sure), 0)


def true_end(values, path, end, theta) -> float:
    """Where `det(exp(j theta) I - A)` vanishes next to (end, theta): Newton's method with differences."""
    ctx.prec = BITS
    p, turning = arb(end), theta < pi * (1 - 1e-12)
    angle, step = (arb(theta) if turning else arb.pi()), arb(2) ** (-BITS // 3)
    for _ in range(40):
        here, beside = determinant(values, path, p, angle), determinant(values, path, p * (1 + step), angle)
        slope = (beside - here) / (p * step)
        if turning:
            turn = (determinant(values, path, p, angle + step) - here) / step
            across = slope.real * turn.imag - slope.imag * turn.real
            move = (here.imag * turn.real - here.real * turn.imag) / across
            angle = (angle + (here.real * slope.imag - here.imag * slope.real) / across).mid()
        else:
            move = -here.real / slope.real
        p = (p + move).mid()
        if abs(move) < abs(p) * arb(10) ** -25:
            return float(p)
    raise ArithmeticError(f"no zero of the determinant next to {path} = {end!r}")


def determinant(values, path, p, angle) -> acb:
    """`det(exp(j angle) I - A)` of the closed loop with the number p at `path`."""
    values = values | {path: p}
    loop = balls.frame(values)
    read = loop.x * arb(values["environment.K_VE"]) + loop.v * arb(values["environment.B_VE"])
    row = arb_mat([[read[0, k] / (1 - read[0, loop.size]) for k in range(loop.size)]])
    A, z = acb_mat(loop.A + loop.B * row), acb(0, angle).exp()
    return (acb_mat(loop.size, loop.size, [z if i == j else 0 for i in range(loop.size) for j in range(loop.size)]) - A).det()


CONDITIONS = (
    Condition("first-order filters, along K_VE", partial(along_wall, first_order, "K_VE")),
    Condition("first-order filters, along B_VE", partial(along_wall, first_order, "B_VE")),
    Condition("filters up to 4th order, along K_VE", partial(along_wall, waves, "K_VE")),
    Condition("filters up to 4th order, along B_VE", partial(along_wall, waves, "B_VE")),
    Condition("direct coupling to the slow wall, along K_VE", partial(along_wall, direct, "K_VE")),
    Condition("direct coupling to the slow wall, along B_VE", partial(along_wall, direct, "B_VE")),
    Condition("filters of 6th to 12th order, along K_VE", partial(along_wall, long_filters, "K_VE"), 0.25),
    Condition("ratio 200 to 1000, along K_VE", partial(along_wall, many_ticks, "K_VE")),
    Condition("a device of 1 mg to 1 g, along K_VE", partial(along_wall, light, "K_VE")),
    Condition("every key over its whole range, along K_VE", partial(along_wall, wild, "K_VE")),
    Condition("two crossings that merge, along both", merging, 0.25),
    Condition("along b", partial(along_other, "controller.b"), 0.5),
    Condition("along K_LM", partial(along_other, "local_model.K_LM"), 0.5),
    Condition("along Kp", partial(along_other, "controller.Kp"), 0.5),
    Condition("along device.mass", partial(along_other, "device.mass"), 0.5),
)  # fmt: skip


def rounded_up(error: float) -> str:
    """One digit, never less than the error."""
    power = floor(log10(max(error, 1e-16)))
    return f"{np.ceil(max(error, 1e-16) / 10.0**power - 1e-9) * 10.0**power:.0e}"


def row(name, outcomes) -> str:
    """The line of the document's table."""
    errors = np.array([error for one in outcomes for error in one.errors])
    columns, certified = (sum(getattr(one, part) for one in outcomes) for part in ("columns", "certified"))
    counts = f"{certified:,} of {columns:,} | {errors.size:,}"
    quantiles = (rounded_up(float(np.quantile(errors, share))) for share in (0.5, 0.99, 1.0))
    return f"| {name} | {counts} | {' | '.join(quantiles)} |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--specs", type=int, default=400, help="random loops of each condition; a part of it of slow ones")
    parser.add_argument("--jobs", type=int, default=2, help="worker processes")
    parser.add_argument("--condition", action="append", help="only this one; may be given again")
    chosen, wrong = parser.parse_args(), 0
    print("| condition | certified columns | ends | median | 99 % | worst |\n| --- | --- | --- | --- | --- | --- |")
    with ProcessPoolExecutor(chosen.jobs) as pool:
        for condition in CONDITIONS:
            if chosen.condition and condition.name not in chosen.condition:
                continue
            outcomes = list(pool.map(condition.examine, range(max(1, round(chosen.specs * condition.share))), chunksize=8))
            print(row(condition.name, outcomes), flush=True)
            for seed, one in enumerate(outcomes):
                wrong += one.wrong
                if one.wrong:
                    print(f"WRONG: {condition.name}, loop {seed}", file=sys.stderr)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
