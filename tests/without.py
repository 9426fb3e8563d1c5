"""The house without some capabilities: `python -m tests.without NAME...` runs, in a copy, the tests that are left.

Words behind `--` go to pytest: `python -m tests.without margins -- -m slow`.

`all` leaves engine, haptics and program alone; then the tables of the paper's specs have to be the same bytes as with
everything there.
"""

import ast
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from wavesweep.capabilities import CAPABILITIES

ROOT = Path(__file__).parents[1]
NAMES = tuple(each.name for each in CAPABILITIES)
SPECS = {f"sweeps/templates/{name}.toml": "axes" for name in ("delta", "five-bar")}  # that draw blocks of a capability
ASKED = (("zwidth", "fig4"), ("zwidth", "fig5"), ("stability-region", "fig4-b25"), ("bode", "fig6"))


def copy_without(names, folder):
    """Copy the files that git tracks, without the folders, the tests and the lines of some capabilities."""
    listed = subprocess.run(
        [shutil.which("git"), "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    gone = tuple(f"{top}/{name}/" for name in names for top in ("wavesweep", "tests"))
    gone += tuple(spec for spec, needed in SPECS.items() if needed in names)
    compiled = f".{sys.implementation.cache_tag}.pyc"  # which the time of its source goes with
    for name in listed:
        if not name.startswith(gone) and (ROOT / name).is_file():
            place = (ROOT / name).parent / "__pycache__" / f"{Path(name).stem}{compiled}"
            for each in (ROOT / name, *([place] if place.is_file() else [])):
                there = folder / each.relative_to(ROOT)
                there.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(each, there)
    listing = folder / "wavesweep" / "capabilities.py"
    listing.write_text(without_lines(listing.read_text(encoding="utf-8"), names), encoding="utf-8")


def without_lines(text, names):
    """The list of capabilities without some of them."""
    lines = text.splitlines(keepends=True)
    calls = (
        node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call) and ast.unparse(node.func) == "Capability"
    )
    for call in sorted(calls, key=lambda each: -each.lineno):
        if ast.literal_eval(call.args[0]) in names:
            del lines[call.lineno - 1 : call.end_lineno]
    return "".join(lines)


def run(folder, package, *arguments):
    """Run Python in a folder with the package of a checkout or of a copy."""
    environment = {**os.environ, "PYTHONPATH": str(package)}
    return subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, check=False)


def tables_of(folder, package):
    """The bytes of the tables of the paper's specs, as the package of a checkout or of a copy writes them into a folder."""
    paper, options = ROOT / "sweeps" / "paper", ["--no-plot", "--quiet", "--overwrite"]
    calls = [[command, f"{paper / name}.toml", "--out", f"results/{name}", *options] for command, name in ASKED]
    run(folder, package, "-c", f"from wavesweep.program.cli import main\nfor words in {calls!r}:\n    main(words)")
    found = {name: [*(folder / "results" / name).glob("*.csv")] for _, name in ASKED}
    return {(name, path.name): path.read_bytes() for name, paths in found.items() for path in paths}


def main(arguments):
    """Take capabilities away in a copy, and return the exit code of the tests that are left."""
    arguments, more = (
        (arguments[: arguments.index("--")], arguments[arguments.index("--") + 1 :]) if "--" in arguments else (arguments, [])
    )
    names = NAMES if arguments == ["all"] else tuple(arguments)
    if not names or set(names) - set(NAMES):
        print(f"usage: python -m tests.without all, or names of {', '.join(NAMES)}", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as made:
        folder, whole = Path(made) / "left", Path(made) / "whole"
        whole.mkdir()
        copy_without(names, folder)
        code = run(
            folder, folder, "-m", "pytest", "-q", "-n", "2", "--dist", "worksteal", "-p", "no:cacheprovider", *more
        ).returncode
        if names == NAMES:
            left, there = tables_of(folder, folder), tables_of(whole, ROOT)
            different = [key for key in there.keys() | left.keys() if there.get(key) != left.get(key)]
            print(
                "tables of the paper's specs:",
                f"differ: {different}" if different or not there else f"{len(there)} the same bytes",
            )
            code = code or int(bool(different) or not there)
        return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
