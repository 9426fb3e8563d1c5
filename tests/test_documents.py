"""The documents cannot rot: what they list is what the program has, their code runs, and all links lead somewhere."""

import json
import pathlib
import re
import shlex
import subprocess
import sys
import tomllib

import pytest

import wavesweep
from wavesweep.cli import main
from wavesweep.cli.entry import COMMANDS
from wavesweep.controllers import CONTROLLERS
from wavesweep.spec import KEYS
from wavesweep.spec.block_types import TYPES

ROOT = pathlib.Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {path.name: path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs").glob("*.md"))}
MANUAL = "\n".join(PAGES.values())
RECIPES = ROOT / "sweeps" / "recipes"
BESIDE = (
    *("ARCHITECTURE.md", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE"),
    *("wavesweep/ACCURACY.md", "wavesweep/SAFETY.md", "wavesweep/TABLES.md"),
)
TEXTS = {
    name: (ROOT / name).read_text(encoding="utf-8")
    for name in ("README.md", "sweeps/paper/README.md", "sweeps/examples/FIRST-HOUR.md", *BESIDE)
} | {f"docs/{name}": text for name, text in PAGES.items()}
LINKS = [(name, link) for name, text in TEXTS.items() for link in re.findall(r"\]\((?!http)([^)]*)\)", text)]


def section(title):
    """The page of that title."""
    return next(text for text in PAGES.values() if text.startswith(f"# {title}\n"))


def test_every_command_stands_in_the_documents_with_its_help():
    rows = dict(re.findall(r"^\| `wavesweep ([a-z-]+).*?` \| (.*?) \|$", section("Commands"), re.MULTILINE))
    assert rows == dict(COMMANDS)


def test_every_key_stands_in_the_documents_with_its_unit_and_default():
    rows = re.findall(r"^\| `([\w.]+)` \| (.*?) \| (.*?) \| (.*?) \|$", section("Keys of a spec"), re.MULTILINE)
    assert rows == [
        (key.path, key.unit if key.unit not in ("", "1") else "", default(key), key.description) for key in KEYS.values()
    ]


def test_the_verdict_shown_is_the_programs(monkeypatch, capfd):
    monkeypatch.chdir(ROOT)
    shown = re.search(r"^    \$ wavesweep (check \S+)\n((?:    .*\n)+)", MANUAL, re.MULTILINE)
    assert main(shown[1].split()) == 0
    lines = shown[2].splitlines(keepends=True)
    assert capfd.readouterr().out.startswith("".join(line.removeprefix("    ") for line in lines))


SUMMARIZED = """
[controller]
kind = "pmw"
[sweep]
B_VE = [1, 2]
[simulate]
duration_s = 1
settle_s = 0.5
wall = 0.001
late = 3
max_force = 1
[design]
generations = 1
population = 8
[design.vary]
b = { start = 5, stop = 50 }
[design.wish]
z_width = { B_VE = [1] }
[design.for_all]
hand = { stiffness = [0, 100] }
"""
OF_DATA = ("numbers", "at", "doubts", "elasticities", "best", "own", "units", "hands", "specs")  # whose keys are names or words
ONCE = ("slices",)  # whose keys are documented once, for all tables


@pytest.fixture(scope="module")
def summaries(tmp_path_factory):
    """The objects that commands write with --json over one small spec, by command."""
    (folder := tmp_path_factory.mktemp("summaries")).joinpath("mine.toml").write_text(SUMMARIZED)
    names = (
        "zwidth",
        "zwidth --for-hands box",
        "bode",
        "compare",
        "simulate",
        "passivity --filters",
        "why",
        "design --for-hands box",
    )
    found = {}
    for name in (*names, "check --plot", "export --to c", "verify results/mine"):
        first, *rest = name.split()
        spec, switches = ["mine.toml"] if first != "verify" else [], ["--no-plot", "--overwrite"] if name in names else []
        command = [sys.executable, "-m", "wavesweep", first, *spec, *rest, "--json", *switches]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        found[name] = json.loads(done.stdout)
    return found


def all_keys(found, passed=()):
    """The keys of nested objects and of the objects in lists, without those that are data."""
    if isinstance(found, dict):
        below = (all_keys(value, passed) for key, value in found.items() if key not in (*OF_DATA, *passed))
        return set(found).union(*below)
    return set().union(*(all_keys(value, passed) for value in found)) if isinstance(found, list) else set()


def quoted(text):
    """The words of a text that stand in backticks alone."""
    return set(re.findall(r"`(\w+)`", text))


@pytest.mark.thorough
def test_the_keys_of_the_summaries_in_the_documents_are_exactly_those_of_the_programs(summaries):
    part = PAGES["results.md"].split("\n## The summary as JSON\n", 1)[1]
    whole, tables = (dict(re.findall(r"^\| (`.*?) \| (.*?) \|", each, re.MULTILINE)) for each in part.split("\nA table of", 1))
    written = set().union(*summaries.values())
    assert quoted(" ".join(whole)) == written | {"verdicts", "lines"}  # of paper and bench

    found = {kind: table for each in summaries.values() for kind, table in each.get("tables", {}).items()}
    documented = {kind: quoted(keys) for kinds, keys in tables.items() for kind in re.findall(r"`(.*?)`", kinds)}
    assert set(documented) == set(found) - {"zwidth", "zwidth-hands", "compare"}
    assert {kind: all_keys(found[kind], ONCE) for kind in documented} == documented

    by_name = [summaries["zwidth --for-hands box"]["tables"]["zwidth-hands"], summaries["compare"]["tables"]["compare"]]
    inner = [each for table in by_name for each in (table.get("hands") or table["specs"]).values()]
    inner.append(summaries["zwidth"]["tables"]["zwidth"])
    intervals = part.split("\nA table of intervals", 1)[1].split("The other tables:")[0]
    values = {"stability", "range", "unknown", "hand", "compare"}  # that `ended_by` may have, a column, and a command
    assert quoted(intervals) - values == set().union(*map(all_keys, [*by_name, *inner]))


def test_the_reasons_of_a_limit_are_the_programs(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(ROOT)
    shown = re.search(r"^    \$ wavesweep (why .*)\n((?:    .*\n)+)", MANUAL, re.MULTILINE)
    assert main([*shlex.split(shown[1]), "--no-plot", "--out", str(tmp_path)]) == 0
    assert "".join(line.removeprefix("    ") for line in shown[2].splitlines(keepends=True)) in capfd.readouterr().err


def test_every_controller_stands_on_its_page():
    text = PAGES["controllers.md"]
    assert [kind for kind in CONTROLLERS if f"| `{kind}` |" not in text and f"## {kind}\n" not in text] == []


def test_the_first_screen_shows_lines_of_the_first_hour():
    """A test runs those."""
    first = README.split("\n## ", 1)[0]
    page = (ROOT / "sweeps/examples/FIRST-HOUR.md").read_text(encoding="utf-8")
    shown = [line for line in re.findall(r"^    (.*)$", first, re.MULTILINE) if not line.startswith(("$", "python3"))]
    assert len(shown) == 5, shown
    assert [line for line in shown if line not in page] == []


def test_every_type_of_block_stands_in_the_documents_with_its_keys_and_ports():
    rows = re.findall(r"^\| `(\w+)` \| (.*?) \| (.*?) \| (.*?) \|$", section("Draw your own loop"), re.MULTILINE)
    assert [row[:2] for row in rows] == [(name, kind.description) for name, kind in TYPES.items()]
    for (_, _, keys, ports), kind in zip(rows, TYPES.values(), strict=True):
        assert re.findall(r"`(\w+)`", keys) == list(kind.keys)
        defaults = {
            key.path: str(key.default).lower() for key in kind.keys.values() if key.type in ("number", "integer", "boolean")
        }
        for name, value in re.findall(r"`(\w+)` \(([^)]*)\)", keys):
            assert defaults.get(name, value) == value
        pairs = kind.ports.values() if kind.by else [kind.ports] if kind.ports else []
        assert [port in ports for pair in pairs for side in pair for port in side] == [True] * sum(
            len(i) + len(o) for i, o in pairs
        )


@pytest.mark.slow
def test_the_drawn_loop_of_the_page_is_a_recipe_with_its_limits():
    text = section("Draw your own loop")
    tables = tomllib.loads(re.search(r"```toml\n(.*?)```", text, re.DOTALL).group(1))
    assert tables == tomllib.loads((RECIPES / "policy.toml").read_text(encoding="utf-8"))
    found = wavesweep.stability_region(tables)
    assert found.certified.all()
    limits = [f"{high:.4f}" for high in found.query("g == 0 and zeta == 2").high]
    assert limits == list(re.search(r"`f < (\S+) Hz` and `(\S+) Hz`", text).groups())


def test_every_recipe_stands_in_the_documents_with_the_numbers_of_its_comment():
    rows = re.findall(r"^\| \[(\S+)\]\(\.\./sweeps/recipes/\1\.toml\) \| .*? \| (.*?) \|$", MANUAL, re.MULTILINE)
    assert sorted(name for name, _ in rows) == sorted(path.stem for path in RECIPES.glob("*.toml"))
    for name, answer in rows:
        comment = (RECIPES / f"{name}.toml").read_text(encoding="utf-8").split("\n\n[", 1)[0]
        numbers = re.findall(r"\d+\.\d+|\d{4,}", answer)
        assert numbers
        assert [number for number in numbers if number not in comment] == []


def default(key):
    """How the page shows a default."""
    if key.required:
        return "required: " + ", ".join(key.choices)
    return "" if key.default is None else str(key.default)


@pytest.mark.parametrize("page", ["README.md", "docs/library.md"])
def test_the_library_example_runs_as_it_stands(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    exec(re.search(r"```python\n(.*?)```", TEXTS[page], re.DOTALL).group(1), names)  # noqa: S102 - the document's own code
    assert names["table"].certified.all()


@pytest.mark.parametrize(("name", "link"), LINKS)
def test_links_lead_somewhere(name, link):
    """To a file that there is and, where the link names one, to a heading in it."""
    path, _, heading = link.partition("#")
    target = (ROOT / name).parent / path if path else ROOT / name
    assert target.exists()
    if heading:
        assert heading in [
            anchor(title) for title in re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE)
        ]


def anchor(title):
    """What a heading is linked by."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


@pytest.mark.parametrize("name", BESIDE)
def test_the_readme_links_to_every_document(name):
    assert ("README.md", name) in LINKS


@pytest.mark.parametrize("name", TEXTS)
def test_documents_name_files_that_there_are(name):
    """Files and folders of the project in their prose; code and commands are run by other tests."""
    prose = re.sub(r"```.*?```", "", TEXTS[name], flags=re.DOTALL)
    named = re.findall(r"`((?:\.ci|wavesweep|tests|sweeps)/[\w./-]*)`", prose)
    assert [path for path in named if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("name", TEXTS)
def test_documents_name_no_place_on_a_machine(name):
    assert re.findall(r"(?<![\w.])/(?:home|root|tmp|opt|work|mnt|Users|var)/\S*", TEXTS[name]) == []


def test_the_citation_names_the_version_and_license_of_the_package():
    import yaml

    citation = yaml.safe_load(TEXTS["CITATION.cff"])
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()
    assert citation["version"] == wavesweep.__version__
    assert citation["license"] == project["license"] == "MIT"
    assert [author["name"] for author in citation["authors"]] == [author["name"] for author in project["authors"]]
    assert TEXTS["LICENSE"].startswith("MIT License")
    assert all(f"Copyright (c) 2026 {author['name']}" in TEXTS["LICENSE"] for author in project["authors"])
