"""Tables of specs by two commits, held against each other.

    python benchmarks/two_commits.py BEFORE [AFTER] [--specs FILE ...] [--commands WORD ...]

Every spec, all shipped ones without --specs, goes through the commands, each in a process of its own. Numbers may differ by
1e-9 of themselves; what differs by more is printed, row by row. What both commits refuse with the same words is the same.
AFTER is the checkout as it is, unless a commit is named. The exit code is 1 if anything differs.
"""

import argparse
import csv
import math
import os
import resource
import subprocess
import sys
import tempfile
from itertools import zip_longest
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
COMMANDS = ("check", "zwidth", "stability-region", "bode", "passivity", "simulate")
SAME = 1e-9  # relative, of numbers
ENDS_AFTER = 300  # processor seconds of a command


def checked_out(commit: str, folder: Path) -> Path:
    """The package as it is in a commit, in a folder."""
    folder.mkdir()
    packed = subprocess.run(["git", "archive", commit, "wavesweep", "sweeps"], cwd=HERE, capture_output=True, check=True)  # noqa: S607
    subprocess.run(["tar", "-x", "-C", str(folder)], input=packed.stdout, check=True)  # noqa: S607
    return folder


def said(checkout: Path, command: str, spec: Path, out: Path) -> tuple[dict[str, list[dict[str, str]]], float]:
    """The tables that a command writes, by their names, with its words as one more; and its processor seconds."""
    words = [sys.executable, "-m", "wavesweep", command, str(spec)]
    if command != "check":
        words += ["--no-plot", "--quiet", "--out", str(out)]
    if command not in ("check", "simulate"):
        words += ["--jobs", "1"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        ["prlimit", f"--cpu={ENDS_AFTER}", *words],  # noqa: S607
        env=os.environ | {"PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"},
        cwd=checkout,
        capture_output=True,
        text=True,
        check=False,
    )
    text = done.stdout if done.returncode in {0, 1} else done.stderr
    if done.returncode < 0:
        text = f"no end after {ENDS_AFTER} s"
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    tables = {}
    for path in sorted(out.rglob("*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            tables[path.name] = list(csv.DictReader(file))
    if not tables:
        tables["words"] = [{"line": line} for line in text.replace(str(out), "OUT").splitlines()]
    return tables, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def same(one: str, other: str) -> bool:
    """Whether two cells say the same."""
    if one == other:
        return True
    try:
        return math.isclose(float(one), float(other), rel_tol=SAME, abs_tol=SAME**2)
    except ValueError:
        return False


def differences(before: list[dict[str, str]], after: list[dict[str, str]]) -> list[str]:
    """A line for each row that differs."""
    found = []
    for number, (one, other) in enumerate(zip_longest(before, after), 1):
        if one is None or other is None:
            found.append(f"row {number}: {'only after' if one is None else 'only before'}: {other or one}")
            continue
        changed = []
        for name in {**one, **other}:
            cells = one.get(name, "no such column"), other.get(name, "no such column")
            if not same(*cells):
                changed.append(f"{name}: {cells[0]} -> {cells[1]}")
        if changed:
            found.append(f"row {number}: {'; '.join(changed)}")
    return found


def main() -> int:
    """Compare, and print what differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after", nargs="?")
    parser.add_argument("--specs", nargs="*", type=Path, default=sorted(HERE.glob("sweeps/**/*.toml")))
    parser.add_argument("--commands", nargs="*", default=COMMANDS)
    given = parser.parse_args()
    tables = 0
    differing = 0
    seconds = [0.0, 0.0]
    with tempfile.TemporaryDirectory() as folder:
        sides = [checked_out(given.before, Path(folder) / "before")]
        sides.append(checked_out(given.after, Path(folder) / "after") if given.after else HERE)
        for spec in given.specs:
            for command in given.commands:
                print(f"{command} {spec.name}", file=sys.stderr, flush=True)
                results = []
                for side, checkout in enumerate(sides):
                    with tempfile.TemporaryDirectory() as out:
                        written, spent = said(checkout, command, spec.resolve(), Path(out) / "out")
                    results.append(written)
                    seconds[side] += spent
                before, after = results
                for name in {**before, **after}:
                    tables += 1
                    lines = differences(before.get(name, []), after.get(name, []))
                    differing += bool(lines)
                    for line in lines:
                        print(f"{command} {spec.name} {name}: {line}", flush=True)
    cost = f"{seconds[0]:.0f} and {seconds[1]:.0f} processor s, {seconds[1] / seconds[0]:.2f} times"
    print(f"{tables} tables, {differing} differ; {cost}")
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main())
