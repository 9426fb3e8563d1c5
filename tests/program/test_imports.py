"""The order of the layers, and what an import may cost."""

import ast
import importlib
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import wavesweep
from wavesweep.capabilities import CAPABILITIES

PACKAGE = Path(wavesweep.__file__).parent
NAMES = [each.name for each in CAPABILITIES]

# Data flows to the right, imports point to the left: first the engine, then haptics, then the program. What stands above may
# use all of it.
ENGINE = (
    "errors",
    "doubles",
    "arguments",
    "components",
    "rows",
    "_state_space",
    "doubts",
    "_keys",
    "_drawing",
    "_loops",
    "_monodromy",
    "_stability",
    "loop",
    "_response",
    "_energy",
    "_sets",
    "_switched",
    "_search",
    "closed_loop",
    "loop_sources",
)
# Modules of the engine with names of its rooms for everybody outside, which load what is asked for.
DOORS = ("blocks", "drawing", "expressions", "frames", "intervals", "keys", "norms", "poles", "response", "sets", "switched")
OPEN = (*DOORS, *(room for room in ENGINE if not room.startswith("_")))
NAMES_THROUGH = 265  # names of the engine that are imported from outside: a new one asks for a place in one of its modules
PROGRAM = (
    "bundled",
    "platform_compat",
    "atomic_files",
    "columns",
    "number_words",
    "row_kinds",
    "reading",
    "spec",
    "store",
    "sweep",
    "analyses",
    "tables",
    "results",
    "plots",
    "cli",
)
HAPTICS = (
    "controllers",
    "controller_page",
    "direct",
    "virtual_coupling",
    "pmw",
    "held_loop",
    "resting",
    "felt",
)
HOUSES = {"engine": (*ENGINE, *DOORS), "haptics": HAPTICS, "program": PROGRAM}
LAYERS = tuple(f"{house}.{room}" for house, rooms in HOUSES.items() for room in rooms)
TOP = len(LAYERS)
MODULE = re.compile(r"wavesweep(\.[a-z_]+)+")
HEAVY = ("clarabel", "flint", "numpy", "scipy", "pandas", "matplotlib", "control", "joblib", "pyarrow")


def layer_of(module):
    """The layer of a dotted name below engine, haptics and program; the library and the package itself stand above all."""
    room = ".".join(module.split(".")[1:3])
    return LAYERS.index(room) if room in LAYERS else TOP


def capability_of(module):
    """The capability that a dotted name belongs to, empty for the three houses and what stands above."""
    room = (*module.split(".")[1:2], "")[0]
    return room if room in NAMES else ""


@cache
def nodes_of(source):
    """All syntax nodes of a file."""
    return list(ast.walk(ast.parse(source.read_text(encoding="utf-8"))))


@cache
def imports_of(source):
    """Dotted names of what a file imports of ours, wherever in the file it does so; a text may be the name of a module too."""
    found = set()
    for node in nodes_of(source):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            # `from wavesweep import spec` names a room, `from wavesweep.program.spec import load` is in it already.
            below = node.module == "wavesweep"
            found |= {f"{node.module}.{alias.name}" if below else node.module for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(f"relative import in {source.name}")
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and MODULE.fullmatch(node.value):
            place = PACKAGE.parent / node.value.replace(".", "/")
            found |= {node.value} if place.is_dir() or place.with_suffix(".py").is_file() else set()
    return {name for name in found if name.split(".")[0] == "wavesweep" or name.startswith("relative")}


SOURCES = sorted(PACKAGE.rglob("*.py"))


def dotted(source):
    """The dotted name of a file of the package."""
    return ".".join(("wavesweep", *source.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")


DOTTED = {dotted(source) for source in SOURCES}


def test_imports_within_engine_haptics_and_program_point_left():
    of_houses = ("relative", *(f"wavesweep.{house}." for house in HOUSES))
    for source in (source for house in HOUSES for source in (PACKAGE / house).rglob("*.py")):
        layer = layer_of(dotted(source))
        names = {name for name in imports_of(source) if name.startswith(of_houses)}
        assert [name for name in names if name.startswith("relative")] == [], source
        assert [name for name in names if layer_of(name) > layer] == [], source


def test_the_engine_imports_nothing_but_itself_and_reads_no_files():
    """It knows no program, no capability, no TOML and no files: loops in, arrays out."""
    files = {"tomllib", "csv", "click", "pandas", "pyarrow", "matplotlib", "joblib", "pathlib", "os"}
    for source in (PACKAGE / "engine").rglob("*.py"):
        assert [name for name in imports_of(source) if not name.startswith("wavesweep.engine")] == [], source
        nodes = nodes_of(source)
        loaded = {alias.name.split(".")[0] for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        loaded |= {node.module.split(".")[0] for node in nodes if isinstance(node, ast.ImportFrom)}
        assert loaded & files == set(), source


COMMANDS = ("zwidth", "stability-region", "bode", *(name for each in CAPABILITIES for name in each.commands))
GUESTS = "|".join(
    (
        *(r"fails_from", r"fails_below", r"set_by", r"\bgain or mode\b", r"\bzwidth\b"),  # columns and kinds of tables
        *("K_VE", "B_VE", "K_LM", "B_LM", "fast_hz", "slow_hz", "passband_hz"),  # keys of a controller
        r"\[(sweep|bode|simulate|for_all|measured|design|filters|rates|device|operator|controller|environment)\]",
        rf"\bwavesweep ({'|'.join(COMMANDS)}|keys|init|plot|verify)\b",
        rf"wavesweep[./]({'|'.join(('haptics', 'program', *NAMES))})\b",
        r"(?<![-\w])--[a-z]",  # options of commands
    )
)


def test_the_engine_knows_no_guest():
    """No column of the program, no key of a controller, no table of a spec, no command and no option, in code or in words."""
    found = {
        f"{source.relative_to(PACKAGE)}:{number}: {line.strip()}"
        for source in (PACKAGE / "engine").rglob("*.py")
        for number, line in enumerate(source.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(GUESTS, line)
    }
    assert sorted(found) == []


def test_a_capability_imports_the_three_houses_alone_and_these_no_capability():
    edges = {
        f"{own} -> {capability_of(name)}"
        for source in SOURCES
        if (own := dotted(source).removeprefix("wavesweep.")) not in ("wavesweep", "capabilities")
        for name in imports_of(source)
        if capability_of(name) not in ("", own.split(".")[0])
    }
    assert sorted(edges) == []


def imported_names(source):
    """Pairs of a module of the engine and a name that a file has of it, by import or as an attribute of the module."""
    found = set()
    modules = {}
    for node in nodes_of(source):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("wavesweep.engine"):
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                if full in DOTTED:
                    modules[alias.asname or alias.name] = full
                else:
                    found.add((node.module, alias.name))
    for node in nodes_of(source):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in modules:
            found.add((modules[node.value.id], node.attr))
    return found


@cache
def outside():
    """The files of the package outside of the engine, and the names of it that they ask for."""
    sources = [source for source in SOURCES if not dotted(source).startswith("wavesweep.engine")]
    return {source: imported_names(source) for source in sources}


def offered_by(room):
    """Pairs of a module and a name of it that a door of the engine has, as type checkers read it."""
    tree = ast.parse((PACKAGE / "engine" / f"{room}.py").read_text(encoding="utf-8"))
    nodes = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and "._" in node.module]
    return {(node.module, alias.name) for node in nodes for alias in node.names}


def test_everybody_outside_goes_through_the_public_modules_of_the_engine():
    """Modules with an underscore are for the engine alone."""
    asked = outside()
    for source, names in asked.items():
        rooms = {f"{module}.{name}".split(".")[2] for module, name in names if module != "wavesweep.engine"}
        assert rooms <= set(OPEN), source
    assert len(set().union(*asked.values())) <= NAMES_THROUGH


@pytest.mark.whole
def test_doors_have_no_name_that_nobody_asks_for():
    asked = set().union(*outside().values())
    for room in DOORS:
        expected = {name for module, name in asked if module == f"wavesweep.engine.{room}"}
        assert {name for _, name in offered_by(room)} == expected, room


def defined(module, name):
    """The function or class of that name in a module, as a syntax tree; None if it is neither."""
    path = PACKAGE.parent.joinpath(*module.split(".")).with_suffix(".py")
    kinds = ast.FunctionDef, ast.ClassDef
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return next((node for node in tree.body if isinstance(node, kinds) and node.name == name), None)


@pytest.mark.parametrize("room", DOORS)
def test_what_goes_through_a_door_is_documented_and_typed(room):
    for module, name in offered_by(room):
        node = defined(module, name)
        if isinstance(node, ast.FunctionDef):
            functions = [node]
        else:
            functions = [each for each in (node.body if node else ()) if isinstance(each, ast.FunctionDef)]
        for function in functions:
            if function.name.startswith("_"):
                continue
            parameters = [*function.args.args, *function.args.kwonlyargs]
            bare = [each.arg for each in parameters if each.annotation is None and each.arg not in ("self", "cls")]
            assert bare == [], (module, name, function.name)
            assert function.returns is not None, (module, name, function.name)
            assert ast.get_docstring(function), (module, name, function.name)
        assert node is None or ast.get_docstring(node), (module, name)


@pytest.mark.parametrize("room", DOORS)
def test_a_door_has_the_names_that_it_says(room):
    """What type checkers read and what is loaded on demand are the same names of the same modules."""
    listed = offered_by(room)
    tree = ast.parse((PACKAGE / "engine" / f"{room}.py").read_text(encoding="utf-8"))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and ast.unparse(node.func) == "on_demand"]
    sources = ast.literal_eval(calls[0].args[0])
    assert {(f"wavesweep.engine.{source}", name) for source, names in sources.items() for name in names} == listed
    door = importlib.import_module(f"wavesweep.engine.{room}")
    for module, name in listed:
        assert getattr(door, name) is getattr(importlib.import_module(module), name)
    with pytest.raises(AttributeError, match="is none of the names"):
        door.no_such_name  # noqa: B018


def test_a_search_for_intervals_loads_no_response():
    """What is felt at rest is loaded where it is asked for."""
    loaded = loaded_by("import wavesweep.engine._search.interval_search")
    assert not {name for name in loaded if name.startswith(("wavesweep.engine._response.", "wavesweep.engine._energy."))}


def test_no_modules_import_each_other_in_a_circle():
    """Imports within functions and for type checkers count too: what stands in a circle can only be read at once.

    `seams` alone may name types of all that is offered, since it has nothing but types.
    """
    files, imports = {dotted(source) for source in SOURCES} - {"wavesweep.program.seams"}, {}
    for source in SOURCES:
        nodes = [node for node in nodes_of(source) if isinstance(node, ast.ImportFrom)]
        names = {(node.module, f"{node.module}.{alias.name}") for node in nodes for alias in node.names}
        imports[dotted(source)] = {name if name in files else module for module, name in names} & files
    while loose := {name for name in imports if not imports[name] or not any(name in others for others in imports.values())}:
        imports = {name: others - loose for name, others in imports.items() if name not in loose}
    assert imports == {}


def test_every_folder_is_engine_haptics_program_a_capability_or_the_checker():
    """What the checker may import is read in tests/checker."""
    folders = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").is_file()}
    assert folders - {*HOUSES, "checker"} == set(NAMES)


def test_the_checker_is_imported_by_those_whose_claims_have_to_pass_it():
    folders = {
        source.relative_to(PACKAGE).parts[0]
        for source in PACKAGE.rglob("*.py")
        if any(name.startswith("wavesweep.checker") for name in imports_of(source))
    }
    assert folders - {"checker"} == {"proofs", "contact"} & set(NAMES)


def test_the_simulator_knows_nothing_of_blocks_and_lifting():
    beside = {"experiment.py", "table.py", "figure.py", "command.py", "library.py"}  # which show the linear loop beside it
    sources = {source for source in (PACKAGE / "simulation").rglob("*.py") if source.name not in beside}
    names = {name for source in sources for name in imports_of(source)}
    rooms = [
        LAYERS.index(f"engine.{room}")
        for room in ("_loops", "_monodromy", "_stability", "_response", "blocks", "frames", "poles", "response")
    ]
    known = {name for name in names if layer_of(name) in rooms}
    assert known <= {
        "wavesweep.haptics.controllers",
        "wavesweep.haptics.controller_page",
    }
    assert not {name for name in names if capability_of(name) == "passive"}


def loaded_by(program):
    """The modules that a new interpreter has loaded at the end of a program."""
    listing = f"{program}\nimport sys\nprint('\\nmodules', *sys.modules)"
    done = subprocess.run([sys.executable, "-c", listing], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split()[1:])


HELP = "from wavesweep.program.cli import main; main(['--help'])"


@pytest.mark.parametrize(
    "program",
    [
        "import wavesweep",
        "import wavesweep; wavesweep.load({'controller': {'kind': 'pmw'}})",
        HELP,
        "from wavesweep.program.cli import main; main(['zwidth', '--help'])",
    ],
)
def test_nothing_heavy_is_loaded_before_it_is_used(program):
    loaded = loaded_by(program)
    assert "wavesweep" in loaded
    assert loaded & {*HEAVY, "importlib.metadata"} == set()
    assert program != HELP or not loaded & {"dataclasses", "pathlib"}
    rooms = {name.split(".")[2] for name in loaded if name.startswith("wavesweep.program.")}
    assert rooms == set() if program == "import wavesweep" else not rooms & {"sweep", "stability"}


@pytest.mark.whole
@pytest.mark.slow
def test_a_small_run_loads_neither_pandas_nor_scipy_and_check_neither_scipy_nor_matplotlib(tmp_path):
    spec = tmp_path / "wall.toml"
    spec.write_text('[controller]\nkind = "pmw"\n[sweep]\nK_VE = { start = 0, stop = 2000 }\nB_VE = [0.5, 1.0]\n')
    arguments = ["zwidth", str(spec), "--no-plot", "--quiet", "--out", str(tmp_path / "out")]
    loaded = loaded_by(f"from wavesweep.program.cli import main\nassert main({arguments!r}) == 0")
    assert {"numpy", "pyarrow.parquet"} <= loaded
    heavy = {"pandas", "scipy", "matplotlib", "control", "joblib", "importlib.metadata", "pint"}
    assert loaded & (heavy | {"flint", "numpy.ma", "wavesweep.passive.hands"}) == set()
    assert not {name for name in loaded if name.startswith(("wavesweep.engine._switched", "wavesweep.prove.columns"))}
    # Arrow would import pandas where the exception of a signal is dropped.
    written = [str(tmp_path / "out" / f"zwidth.{suffix}") for suffix in ("csv", "parquet")]
    program = f"from wavesweep import results\nfor each in {written!r}:\n    results.read_table(each)"
    assert "pandas" not in loaded_by(program)
    assert not {"matplotlib", "wavesweep.program.plots", "scipy.linalg", "flint", "numpy.ma", "pint"} & loaded_by(
        f"from wavesweep.program.cli import main\nassert main(['check', {str(spec)!r}]) == 0"
    )


def test_a_unit_that_is_as_expected_is_read_without_the_library():
    program = """
from wavesweep.program.spec import load
from wavesweep.program.reading.units import column_named, converted, unit_in, unit_of
load({"controller": {"kind": "pmw"}}, ["device.mass=0.045", "b=40", "controller.kind=dc"])
assert column_named(["t", "force_N", "position"], ("force", "f"), "N") == ("force_N", "N")
assert unit_in("push (N)", "N") == "N" and unit_of("N", "N").factor == 1
"""
    assert "pint" not in loaded_by(program)
    assert "pint" in loaded_by(program + 'unit_of("mN", "N")')
