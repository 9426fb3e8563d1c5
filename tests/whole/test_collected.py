"""No folder has lost tests: `collected.csv` beside this file has how many each had, and falls only by a commit that says so.

A folder of data that has moved, or a file whose name is no longer that of tests, takes tests away without a failure.
`WAVESWEEP_UPDATE=1` writes the numbers of today.
"""

import csv
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COUNTS = Path(__file__).parent / "collected.csv"


def collected() -> Counter[str]:
    """The number of tests of each folder, whatever their marks, as pytest finds them in a process of its own."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "WAVESWEEP_"))}
    asked = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", "", "-p", "no:cacheprovider", "tests"]
    found = subprocess.run(asked, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout[-2000:]
    tests = [line.partition("::")[0] for line in found.stdout.splitlines() if "::" in line]
    return Counter(str(Path(file).parent.as_posix()) for file in tests)


@pytest.mark.slow
def test_no_folder_has_fewer_tests_than_it_had(counted):
    with COUNTS.open(encoding="utf-8") as file:
        before = {row["folder"]: int(row["tests"]) for row in csv.DictReader(file)}
    found = counted if counted.keys() >= before.keys() else collected()  # where this run was asked for some of them
    if "WAVESWEEP_UPDATE" in os.environ:
        lines = [f"{folder},{found[folder]}" for folder in sorted(found)]
        COUNTS.write_text("\n".join(["folder,tests", *lines, ""]), encoding="utf-8")
        return
    fewer = {folder: f"{found[folder]} tests, {number} before" for folder, number in before.items() if found[folder] < number}
    assert not fewer, "say so in the commit, and write the numbers anew with WAVESWEEP_UPDATE=1"
    assert not found.keys() - before.keys(), "folders without a number: write them with WAVESWEEP_UPDATE=1"
