"""The checker is alone: what it shares with the package would be wrong in both."""

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from checker.test_hand_made import ABOVE, BELOW, OUTSIDE, SPEC, WITHIN
from support.proofs import checked

import wavesweep.checker

FOLDER = Path(wavesweep.checker.__file__).parent
SOURCES = sorted(FOLDER.rglob("*.py"))


def test_it_imports_the_standard_library_and_itself():
    for source in SOURCES:
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                within = len(source.relative_to(FOLDER).parts)
                assert node.level <= within, source
                names = [] if node.level else [node.module]
            else:
                continue
            for name in names:
                assert name.split(".")[0] in sys.stdlib_module_names, (source, name)


def test_an_import_loads_nothing_of_the_package():
    """`python -I -S` has no place where other packages could be found."""
    names = [".".join(("wavesweep.checker", *path.relative_to(FOLDER).with_suffix("").parts)) for path in SOURCES]
    modules = [name.removesuffix(".__init__") for name in names if not name.endswith("__main__")]
    code = f"import sys; sys.path.insert(0, {str(FOLDER.parents[1])!r}); import {', '.join(modules)}; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=True)
    loaded = {name for name in run.stdout.split() if name.startswith("wavesweep")}
    assert loaded == {"wavesweep", "wavesweep.checker", *modules}


def test_the_folder_runs_wherever_it_is_copied(tmp_path):
    """Its first line has its own version, whatever stands beside it."""
    lines = [BELOW, WITHIN, ABOVE | {"outside": 1}, OUTSIDE]
    _, words = checked(tmp_path, SPEC, lines)
    shutil.copytree(FOLDER, tmp_path / "reviewed", ignore=shutil.ignore_patterns("__pycache__"))
    command = [sys.executable, "-S", "-m", "reviewed", "spec.toml", "spec.proof"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (1, "")
    assert run.stdout.replace("\n    ", " ") == f"wavesweep checker {wavesweep.checker.VERSION}\n{words}"


@pytest.mark.slow
def test_the_archive_runs_where_nothing_is_installed(tmp_path):
    lines = [BELOW, WITHIN, ABOVE | {"outside": 1}, OUTSIDE]
    assert checked(tmp_path, SPEC, lines)[0] == 1
    archive = tmp_path / "checker.pyz"
    script = FOLDER.parents[1] / ".ci/checker.py"
    subprocess.run([sys.executable, script, archive], check=True)
    command = [sys.executable, "-I", "-S", archive, tmp_path / "spec.toml"]
    run = subprocess.run([*command, tmp_path / "spec.proof"], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (1, "")
    assert "\n1 of 2 claims proved\n" in run.stdout
    assert subprocess.run(command, capture_output=True, check=False).returncode == 2
    assert subprocess.run([*command, tmp_path / "spec.toml"], capture_output=True, check=False).returncode == 2
