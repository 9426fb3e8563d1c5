"""Intervals along every axis of random specs, against eigenvalues: run as a program for as many specs as wanted.

    python tests/support/axes.py 500

Every certified end is looked at just inside and just outside, and every certified column at 200 points of a scan.
"""

import collections
import pathlib
import sys

import numpy as np

import wavesweep
from wavesweep.errors import UsageError

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))  # as a program it finds `support` like the tests do
from support.specs import nested, random_values

STEP = 1e-8  # relative, from an end to the eigenvalues that are looked at there
ROUNDING = 1e-11  # a spectral radius this near to 1 says nothing
SPANS = {
    "K_VE": (0, 20000), "B_VE": (0, 50), "K_LM": (0, 5000), "B_LM": (0, 50), "Kp": (0, 200), "b": (0.5, 200),
    "device.mass": (0.01, 3), "device.damping": (0, 20), "operator.stiffness": (0, 2000), "operator.mass": (0, 1),
    "filters.lp1.cutoff_hz": (1, 100), "filters.lp2.cutoff_hz": (1, 100),
}  # fmt: skip


def faults_along(loop, axis, span):
    """(faults, ends looked at, rows, certified rows) of one loop along one axis."""
    table = loop.stable_intervals(along=axis, span=span)
    low, high = span
    points = np.sort(np.concatenate([np.linspace(low, high, 152)[1:-1], np.geomspace(max(low, 1e-3 * high), high, 52)[1:-1]]))
    inside = [(end * (1 + side * STEP), True) for end, side in _ends(table)]
    outside = [(end * (1 - side * STEP), False) for end, side in _ends(table)]
    stable = np.zeros(points.size, bool)
    for row in table.itertuples():
        stable |= (points > row.low) & (points < row.high)
    probes = np.array([value for value, _ in inside + outside] + points.tolist())
    claims = np.array([claim for _, claim in inside + outside] + stable.tolist())
    excess = loop.spectral_radius(**{axis: probes}) - 1
    wrong = (claims != (excess < 0)) & (np.abs(excess) > ROUNDING)
    faults = [(axis, probe, claim, out) for probe, claim, out in zip(probes[wrong], claims[wrong], excess[wrong], strict=True)]
    return faults if table.certified.all() else [], len(inside), len(table), int(table.certified.sum())


def _ends(table):
    for row in table.itertuples():
        for end, omega, side in ((row.low, row.low_omega, 1), (row.high, row.high_omega, -1)):
            if row.certified and end > 0 and not np.isnan(omega):
                yield end, side


def examine(values):
    """Faults of one spec along every axis that it reads, and counts per axis."""
    loop, faults, counts = wavesweep.compile(nested(values)), [], collections.Counter()
    for axis, (low, high) in SPANS.items():
        limit = 0.45 * values["rates.fast_hz"] if axis.endswith("cutoff_hz") else high
        try:
            wrong, ends, rows, certified = faults_along(loop, axis, (low, min(high, limit)))
        except UsageError:
            continue  # a key that this controller does not read
        faults += wrong
        counts.update({("ends", axis): ends, ("rows", axis): rows, ("certified", axis): certified})
    return faults, counts


def main(count):
    """Print the tally over the first `count` random specs; leave with 1 where a certified row is wrong."""
    total, faults = collections.Counter(), []
    for seed in range(count):
        wrong, counts = examine(random_values(seed))
        total += counts
        faults += [(seed, *fault) for fault in wrong]
    for axis in SPANS:
        rows, sure, ends = (total[name, axis] for name in ("rows", "certified", "ends"))
        print(f"{axis:24} {rows:6} rows, {rows - sure:4} not certified, {ends:6} ends looked at from both sides")  # noqa: T201
    print(f"{count} specs, {len(faults)} faults in certified columns: {faults[:10]}")  # noqa: T201 - a program says what it found
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 500))
