"""The order of the layers, and what an import may cost."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import wavesweep
import wavesweep.plots

PACKAGE = Path(wavesweep.__file__).parent

# Data flows to the right, imports point to the left. What stands above all may use all of it.
LAYERS = (
    "errors",
    "bundled",
    "platform_compat",
    "atomic_files",
    "controllers",
    "reproducibility",
    "arguments",
    "columns",
    "doubts",
    "spec",
    "loops",
    "monodromy",
    "stability",
    "response",
    "passive",
    "robust",
    "identification",
    "simulation",
    "prove",
    "store",
    "sweep",
    "analyses",
    "tables",
    "export",
    "results",
    "search",
    "plots",
)
TOP = len(LAYERS)
MODULE = re.compile(r"wavesweep(\.[a-z_]+)+")
HEAVY = ("flint", "numpy", "scipy", "pandas", "matplotlib", "control", "joblib", "pyarrow")


def layer_of(module):
    """The layer of a dotted name below `wavesweep`; the command line and the package itself stand above all."""
    room = module.split(".")[1] if "." in module else ""
    return LAYERS.index(room) if room in LAYERS else TOP


def imports_of(source):
    """Dotted names of what a file imports of ours, wherever in the file it does so; a text may be the name of a module too."""
    found = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            # `from wavesweep import spec` names a room, `from wavesweep.spec import load` is in it already.
            below = node.module == "wavesweep"
            found |= {f"{node.module}.{alias.name}" if below else node.module for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(f"relative import in {source.name}")
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and MODULE.fullmatch(node.value):
            found.add(node.value)
    return {name for name in found if name.split(".")[0] == "wavesweep" or name.startswith("relative")}


SOURCES = sorted(PACKAGE.rglob("*.py"))


def test_imports_point_left():
    for source in SOURCES:
        own = layer_of(".".join(("wavesweep", *source.relative_to(PACKAGE).with_suffix("").parts)))
        # `__version__` is a name of the package that everybody may read.
        names = imports_of(source) - {"wavesweep.__version__"}
        assert [name for name in names if name.startswith("relative")] == [], source
        assert [name for name in names if layer_of(name) > own] == [], source


def test_the_simulator_knows_nothing_of_blocks_and_lifting():
    sources = set((PACKAGE / "simulation").rglob("*.py"))
    names = {name for source in sources for name in imports_of(source)}
    rooms = [LAYERS.index(room) for room in ("loops", "monodromy", "stability", "response", "passive")]
    assert {name for name in names if layer_of(name) in rooms} <= {"wavesweep.loops.controllers", "wavesweep.loops.page"}


def loaded_by(program):
    """The modules that a new interpreter has loaded at the end of a program."""
    listing = f"{program}\nimport sys\nprint('\\nmodules', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", listing], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split()[1:])


@pytest.mark.parametrize(
    "program",
    [
        "import wavesweep",
        "import wavesweep; wavesweep.load({'controller': {'kind': 'pmw'}})",
        "from wavesweep.cli import main; main(['--help'])",
        "from wavesweep.cli import main; main(['zwidth', '--help'])",
        "from wavesweep.cli import main; main(['explain', 'crowded'])",
    ],
)
def test_nothing_heavy_is_loaded_before_it_is_used(program):
    loaded = loaded_by(program)
    assert "wavesweep" in loaded
    assert loaded & {*HEAVY, "importlib.metadata"} == set()
    rooms = {name.split(".")[1] for name in loaded if name.startswith("wavesweep.")}
    assert rooms == set() if program == "import wavesweep" else not rooms & {"sweep", "stability"}


@pytest.mark.slow
def test_a_small_run_loads_neither_pandas_nor_scipy_and_check_no_matplotlib(tmp_path):
    spec = tmp_path / "wall.toml"
    spec.write_text('[controller]\nkind = "pmw"\n[sweep]\nK_VE = { start = 0, stop = 2000 }\nB_VE = [0.5, 1.0]\n')
    arguments = ["zwidth", str(spec), "--no-plot", "--quiet", "--out", str(tmp_path / "out")]
    loaded = loaded_by(f"from wavesweep.cli import main\nassert main({arguments!r}) == 0")
    assert {"numpy", "pyarrow.parquet"} <= loaded
    assert loaded & {"pandas", "scipy", "matplotlib", "control", "joblib", "pyarrow.compute", "importlib.metadata"} == set()
    assert not {name for name in loaded if name.startswith(("wavesweep.robust", "wavesweep.prove"))}
    # Arrow would import pandas where the exception of a signal is dropped.
    for suffix in ("csv", "parquet"):
        written = str(tmp_path / "out" / f"zwidth.{suffix}")
        assert "pandas" not in loaded_by(f"from wavesweep import results\nresults.read_table({written!r})")
    assert not {"matplotlib", "wavesweep.plots"} & loaded_by(
        f"from wavesweep.cli import main\nassert main(['check', {str(spec)!r}, '--quiet']) == 0"
    )
