"""Whether a front can be trusted, and what a design costs.

    python benchmarks/design_studies.py random sweeps/design/front.toml results/front/design.csv --designs 100000
    python benchmarks/design_studies.py seeds sweeps/design/plain.toml --seeds 0 1 2
    python benchmarks/design_studies.py batch

`random` draws designs uniformly and counts those that beat a row of the front: as good in both wishes and better in one by
more than 2 %, and better in both by more than 2 %. `seeds` compares the hypervolumes of searches from several seeds, in the
logarithm of the stiffness above 100 N/m and the error below 1.5. `batch` times unrelated designs of pmw-lm, a slice each.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import pandas
from joblib import Parallel, delayed

from wavesweep.designs.search import designs_of
from wavesweep.designs.study import design, job_of
from wavesweep.designs.wishes import evaluate
from wavesweep.program.analyses.interval_jobs import at_points
from wavesweep.program.spec import Axis, load

BETTER, PART = 1.02, 512
REFERENCE = np.array([-np.log(100.0), 1.5])


def hypervolume(objectives, reference):
    """The area that two objectives, to be made small, dominate up to a reference point."""
    kept = objectives[(objectives < reference).all(axis=1)]
    kept = kept[np.argsort(kept[:, 0], kind="stable")]
    ends = np.append(kept[:, 0], reference[0])
    return float((np.diff(ends) * (reference[1] - np.minimum.accumulate(kept[:, 1]))).sum())


def worth(source, seed, count, least):
    """Stiffest wall (N/m) and error of so many random designs, and whether both are certified.

    The error is looked at only for designs that reach the stiffness `least`, and missing for the others.
    """
    spec = load(source)
    job = job_of(spec)
    wishes = {wish.name: wish for wish in spec.design.wishes}
    designs = designs_of(spec.design.vary, np.random.default_rng(seed).random((count, len(spec.design.vary))))
    stiffest = evaluate(spec, [wishes["z_width"]], job.scenarios, designs, job.stop)["z_width"]
    found = np.stack([stiffest.value, np.full(count, np.nan), stiffest.certified], axis=1)
    some = np.flatnonzero(stiffest.value >= least)
    if some.size:
        few = {path: values[some] for path, values in designs.items()}
        error = evaluate(spec, [wishes["transparency"]], job.scenarios, few, job.stop)["transparency"]
        found[some, 1], found[some, 2] = error.value, found[some, 2] * error.certified
    return found


def random(source, table, designs, jobs, seed):
    """Count random designs that beat a row of the front."""
    front, started = pandas.read_csv(table), time.perf_counter()
    stiffness, error = front.z_width.to_numpy(), front.transparency.to_numpy()
    counts, worst, known, done = np.zeros(2, int), 1.0, 0, 0
    parts = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(worth)(source, [seed, number], PART, stiffness.min()) for number in range(-(-designs // PART))
    )
    for found in parts:
        sure = (found[:, 2] == 1) & np.isfinite(found[:, 1])
        z, e = found[sure, 0][:, None], found[sure, 1][:, None]
        done, known = done + len(found), known + int(sure.sum())
        more, less = z / stiffness, error / e
        beats = (more >= 1) & (less >= 1)
        counts += [
            np.any(beats & (np.maximum(more, less) > BETTER), axis=1).sum(),
            np.any(np.minimum(more, less) > BETTER, 1).sum(),
        ]
        worst = max(worst, float(np.minimum(more, less).max(initial=0)))
    print(
        f"{source}: {done:,} random designs, {known:,} of them as stiff as some row, {time.perf_counter() - started:.0f} s: "
        f"{counts[0]} beat a row by more than 2 % in one wish, {counts[1]} in both; the largest lead in both is {worst - 1:.2%}"
    )


def seeds(source, numbers, jobs):
    """Print the hypervolume of each seed."""
    found = []
    for seed in numbers:
        table = pandas.DataFrame(design(load(source, [f"design.seed={seed}"]), jobs=jobs).columns)
        objectives = np.stack([-np.log(table.z_width), table.transparency], axis=1)
        found.append(hypervolume(objectives, REFERENCE))
        print(f"{source}, seed {seed}: {len(table)} designs, hypervolume {found[-1]:.4f}", flush=True)
    print(f"largest over smallest: {max(found) / min(found):.4f}")


def batch(count):
    """Time the stable intervals of so many unrelated designs."""
    spec, rng = load({"controller": {"kind": "pmw-lm"}, "environment": {"integration": "explicit"}}), np.random.default_rng(0)
    ranges = {
        "controller.b": (5, 100),
        "controller.Kp": (1, 100),
        "local_model.K_LM": (50, 2000),
        "environment.B_VE": (0.1, 10),
    }
    points = {path: np.exp(rng.uniform(*np.log(ends), count)) for path, ends in ranges.items()}
    axis = Axis("K_VE", "environment.K_VE", (), 0.0, 20000.0, False)
    for size in (count, 500):
        started = time.perf_counter()
        rows = [
            at_points(spec, axis, {path: values[start : start + size] for path, values in points.items()})
            for start in range(0, count, size)
        ]
        seconds, sure = time.perf_counter() - started, np.concatenate([part["certified"] for part in rows]).mean()
        print(f"{count:,} designs in batches of {size}: {seconds:.2f} s, {sure:.2%} of the rows certified")


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("what", choices=("random", "seeds", "batch"))
    options.add_argument("study", nargs="?", type=Path)
    options.add_argument("table", nargs="?", type=Path)
    options.add_argument("--designs", type=int, default=100_000)
    options.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--jobs", type=int, default=2)
    given = options.parse_args()
    if given.what == "batch":
        batch(10_000)
    elif given.what == "seeds":
        seeds(given.study, given.seeds, given.jobs)
    else:
        random(given.study, given.table, given.designs, given.jobs, given.seed)


if __name__ == "__main__":
    main()
