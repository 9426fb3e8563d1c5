"""No folder has lost tests: `collected.csv` beside this file has how many each had, and falls only by a commit that says so.

A folder of data that has moved, or a file whose name is no longer that of tests, takes tests away without a failure.
`WAVESWEEP_UPDATE=1` writes the numbers of today.
"""

import ast
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


def values_of(decorator: ast.Call) -> dict[str, set[str]]:
    """The different values of each name of a `parametrize` whose rows are written out."""
    names, rows = decorator.args[:2]
    names = ast.unparse(names).strip("()'\"").replace("'", "").replace(" ", "").split(",")
    if not isinstance(rows, ast.List) or any(isinstance(row, ast.Starred) for row in rows.elts):
        return {}
    parameters = [
        row.args if ast.unparse(row).startswith("pytest.param(") else [row] if len(names) == 1 else getattr(row, "elts", [])
        for row in rows.elts
    ]
    columns = zip(*parameters, strict=False)
    return {name: {ast.dump(value) for value in column} for name, column in zip(names, columns, strict=False)}


def branches_of(test: ast.FunctionDef) -> set[str]:
    """The names on which a test branches."""
    conditions = []
    for node in ast.walk(test):
        match node:
            case ast.If(test=condition) | ast.IfExp(test=condition) | ast.While(test=condition) | ast.Match(subject=condition):
                conditions.append(condition)
            case ast.comprehension(ifs=ifs):
                conditions += ifs
    return {node.id for condition in conditions for node in ast.walk(condition) if isinstance(node, ast.Name)}


def idle_branches(source: str) -> list[str]:
    """The tests that branch on a parameter of one value."""
    tests = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
    draws = [(test, each) for test in tests for each in test.decorator_list if "parametrize(" in ast.unparse(each)]
    return [
        f"{test.name}: {name}"
        for test, decorator in draws
        for name, values in values_of(decorator).items()
        if len(values) == 1 and name in branches_of(test)
    ]


def test_what_a_test_branches_on_has_more_than_one_value():
    drawn = "@pytest.mark.parametrize({})\ndef test_it(seed, K):\n    assert K if seed % 2 else not K\n"
    assert idle_branches(drawn.format('"seed", [0]')) == idle_branches(drawn.format('("seed", "K"), [(0, 1), (0, 2)]'))
    assert idle_branches(drawn.format('"seed", [0]')) == ["test_it: seed"]
    assert idle_branches(drawn.format('"seed", [0, 1]')) == idle_branches(drawn.format('"K", [0]')) == []
    found = {path: idle_branches(path.read_text(encoding="utf-8")) for path in (ROOT / "tests").rglob("test_*.py")}
    assert {path: tests for path, tests in found.items() if tests} == {}
