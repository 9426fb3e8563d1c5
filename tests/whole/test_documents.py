"""The documents cannot rot: what they list is what the program has, their code runs, and all links lead somewhere."""

import doctest
import inspect
import json
import os
import pathlib
import re
import sys
import tomllib
from importlib import import_module

import jsonschema
import pytest

import wavesweep
from wavesweep.capabilities import WITHOUT_SUMMARY
from wavesweep.identification.table import FitOptions
from wavesweep.program.cli import main
from wavesweep.program.cli.entry import COMMANDS
from wavesweep.program.spec import describing
from wavesweep.program.sweep.running import WorkOptions

ROOT = pathlib.Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {path.name: path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs").glob("*.md"))}
MANUAL = "\n".join(PAGES.values())
RECIPES = ROOT / "sweeps" / "recipes"
BESIDE = (*("ARCHITECTURE.md", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE"),)
TEXTS = {name: (ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "sweeps/paper/README.md", *BESIDE)} | {
    f"docs/{name}": text for name, text in PAGES.items()
}


def section(title):
    """The page of that title."""
    return next(text for text in PAGES.values() if text.startswith(f"# {title}\n"))


@pytest.fixture(scope="module")
def reference():
    """The program that makes the reference."""
    sys.path.insert(0, str(ROOT / "docs"))
    yield import_module("reference")
    sys.path.remove(str(ROOT / "docs"))


def test_the_site_has_every_command_key_block_and_column(reference, monkeypatch):
    """And each part that is made from the code has its place."""
    assert sorted(reference.MARK.findall(MANUAL)) == sorted(reference.MADE)
    assert {*COMMANDS} - OTHERWISE - {*WITHOUT_SUMMARY} == set(reference.SAMPLED)
    site = filled(reference, monkeypatch)
    assert [name for name in COMMANDS if f"\n## wavesweep {name}\n" not in site["commands.md"]] == []
    options = {word for name in COMMANDS for word in reference.switches(name) if word.startswith("-")}
    assert [word for word in options if f"`{word}`" not in site["commands.md"]] == []
    assert [path for path in describing.EVERY_KEY if f"\n| `{path}` |" not in site["keys.md"]] == []
    kinds = {path.removeprefix("block."): kind["keys"] for path, kind in describing.named("block").items()}
    parts = dict(re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", site["blocks.md"], re.MULTILINE | re.DOTALL))
    assert [(kind, key) for kind, own in kinds.items() for key in own if f"\n| `{key}` |" not in parts[kind]] == []
    tables = re.findall(r"^## (.*)\n\n(\| column [\s\S]*?)\n\n", site["tables.md"], re.MULTILINE)
    shown = {
        (kind, column) for names, rows in tables for kind in names.split(", ") for column in re.findall(r"\n\| `(.*?)`", rows)
    }
    assert shown == {(kind, field.name) for kind, fields in reference.columns().items() for field in fields}


def filled(reference, monkeypatch):
    """The pages as the site has them, but for what takes runs of commands."""
    monkeypatch.setitem(reference.MADE, "summaries", str)
    return {name: reference.filled(text) for name, text in PAGES.items()}


def test_a_forge_shows_the_pages_whole():
    """No directives of the site's builder, and all figures stand beside the pages."""
    assert [name for name, text in TEXTS.items() if re.search(r"^```{", text, re.MULTILINE)] == []
    shown = re.findall(r"!\[.*?\]\((.*?)\)", MANUAL)
    assert [path for path in shown if not (ROOT / "docs" / path).exists()] == []
    drawn = {f"figures/{path.name}" for path in (ROOT / "docs" / "figures").iterdir()}
    assert drawn == {path for path in shown if path.startswith("figures/")}


def test_a_page_opens_with_what_one_gets():
    """A picture, a transcript or a file; only the notes of the design have none."""
    opening = re.compile(r"^(    \S|!\[|```)", re.MULTILINE)
    without = [name for name, text in PAGES.items() if not opening.search("\n".join(text.splitlines()[:12]))]
    assert without == ["design-notes.md"]


@pytest.mark.slow
def test_what_commands_print_as_json_fits_the_schema_of_the_documents(reference, capsys):
    schema = jsonschema.Draft202012Validator(json.loads((ROOT / "docs" / "summary.schema.json").read_text(encoding="utf-8")))
    printed = {name: each for name, _, each in reference.sampled()}
    assert set(printed) == set(reference.SAMPLED)
    for name, each in printed.items():
        assert [f"{name}: {error.message[:200]}" for error in schema.iter_errors(each)] == []
    for words in (["zwidth", "missing.toml"], ["zwidth"], ["bode", "missing.toml", "--nothing"]):
        code = main([*words, "--json"])
        failed = json.loads(capsys.readouterr().out)
        schema.validate(failed)
        assert (code, failed["exit_code"]) == (2, 2)
        assert failed["error"]


PICTURES = re.findall(r"^!\[.*\]\(figures/([\w-]+)\.png\)$", PAGES["gallery.md"], re.MULTILINE)


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize("name", PICTURES)
def test_the_commands_of_the_gallery_draw(name, reference):
    assert len(reference.draw(name)) > 10_000


OTHERWISE = {"keys"}  # what it prints has a page of its own


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


@pytest.mark.parametrize("page", ["README.md", "docs/library.md"])
def test_the_library_example_runs_as_it_stands(page, monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    exec(re.search(r"```python\n(.*?)```", TEXTS[page], re.DOTALL).group(1), names)  # noqa: S102 - the document's own code
    assert names["table"].certified.all()


WITH_EXAMPLES = {"compile", "Loop.stable_intervals", "Loop.response", "zwidth", "simulate"}
BY_NAME = {"zwidth": WorkOptions, "identify": FitOptions}  # what their **work and **asked take


def test_docstrings_of_the_library_have_every_parameter_and_examples_that_run(reference):
    stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}

    def written(title):
        return sorted(name for names, _, _ in reference.entries(found.get(title, "")) for name in names.split(", "))

    calls = {name: call for name, call in reference.public() if not inspect.isclass(call)}
    for name, call in calls.items():
        said, found = reference.sections(call)
        asked = sorted(f"{stars.get(each.kind, '')}{each.name}" for each in reference.parameters(call))
        assert (name, written("Parameters")) == (name, asked)
        assert (name, written("Other Parameters")) == (name, sorted(BY_NAME[name].__annotations__) if name in BY_NAME else [])
        assert (name, said.count("\n"), "Returns" in found, "Examples" in found) == (name, 0, True, name in WITH_EXAMPLES)
        examples = doctest.DocTestParser().get_doctest(inspect.getdoc(call), {}, name, None, None)
        assert doctest.DocTestRunner().run(examples).failed == 0
    assert {*WITH_EXAMPLES, *BY_NAME} <= {*calls}


@pytest.mark.slow
def test_a_type_checker_knows_the_library_and_finds_slips(tmp_path):
    """As an editor does: the README's example has no fault, and its names have types, so that each misspelling is found."""
    from mypy import api as mypy

    example = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)
    slips = ["wavesweep.zwidht(loop.spec)", "wavesweep.zwidth(loop.spec, jbos=3)", "loop.plot_zwith()", "loop.margins(cuts=1)"]
    (tmp_path / "right.py").write_text(example, encoding="utf-8")
    (tmp_path / "slips.py").write_text(example + "\n".join(slips), encoding="utf-8")
    options = ["--python-executable", sys.executable, "--cache-dir", os.devnull, "--follow-imports=silent"]
    depth = sys.getrecursionlimit()
    said, _, code = mypy.run([*options, *(str(tmp_path / name) for name in ("right.py", "slips.py"))])
    sys.setrecursionlimit(depth)  # mypy raises it, and other tests are of what recurses too deep
    first = example.count("\n") + 1
    faults = [int(line) for line in re.findall(r"^.*slips\.py:(\d+): error", said, re.MULTILINE)]
    assert (code, "right.py" in said, faults) == (1, False, [*range(first, first + len(slips))]), said


@pytest.mark.slow
def test_the_first_example_of_the_engine_has_types_throughout(tmp_path):
    mypy = pytest.importorskip("mypy.api")
    page = (ROOT / "docs" / "engine.md").read_text(encoding="utf-8")
    lines = re.findall(r"^(?:>>>|\.\.\.) (.*)$", re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0], re.MULTILINE)
    (tmp_path / "first.py").write_text("\n".join(lines), encoding="utf-8")
    options = ["--strict", "--python-executable", sys.executable, "--cache-dir", os.devnull, "--follow-imports=silent"]
    depth = sys.getrecursionlimit()
    said, _, code = mypy.run([*options, str(tmp_path / "first.py")])
    sys.setrecursionlimit(depth)
    assert code == 0, said


def test_links_lead_somewhere(reference, monkeypatch):
    """To a file that there is and, where the link names one, to a heading in it: of a page, as it is on the site."""
    texts = TEXTS | {f"docs/{name}": text for name, text in filled(reference, monkeypatch).items()}
    anchors = {
        (ROOT / name).resolve(): {anchor(title) for title in re.findall(r"^#+ (.*)$", text, re.MULTILINE)}
        for name, text in texts.items()
    }
    lost = []
    for name, text in texts.items():
        for link in re.findall(r"\]\((?!http)([^)\s]*)\)", text):
            path, _, heading = link.partition("#")
            target = ((ROOT / name).parent / path if path else ROOT / name).resolve()
            if not target.exists() or (heading and heading not in anchors[target]):
                lost.append((name, link))
    assert lost == []


def anchor(title):
    """What a heading is linked by."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


def test_documents_name_files_that_there_are():
    """Files and folders of the project in their prose; code and commands are run by other tests."""
    for name, text in TEXTS.items():
        prose = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
        named = re.findall(r"`((?:\.ci|wavesweep|tests|sweeps|benchmarks)/[\w./-]*)`", prose)
        assert (name, [path for path in named if not (ROOT / path).exists()]) == (name, [])


def test_the_page_on_what_takes_how_long_has_the_questions_that_are_measured():
    from what_takes_how_long import QUESTIONS

    questions = PAGES["speed.md"].partition("## Beside")[0]
    shown = re.findall(r"^\| (.+?) \| (.+?) \| [\d.]+ (?:ms|s|min) \|$", questions, re.MULTILINE)
    assert shown == [(question, loop) for question, loop, _ in QUESTIONS]


@pytest.mark.parametrize("path", ["docs/_static/site.css", "wavesweep/explore/page.css", "wavesweep/reports/report_page.py"])
def test_a_page_that_is_dark_on_a_screen_is_light_on_paper(path):
    """What makes figures dark stands within a query for screens, alone in its line or in the block that the query begins."""
    for block in re.split(r"(?=@media)", (ROOT / path).read_text(encoding="utf-8")):
        dark = "invert(" in block or "#17191c" in block
        assert not dark or re.match(r"@media screen\b", block), block[:80]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("row", "spec", "sweep"), [("the same, b = 40", "pmw", "sweep.b=[40]"), ("direct coupling", "dc-slow", "")]
)
def test_the_study_of_frames_in_any_order_has_what_is_proved(row, spec, sweep):
    """Whole newtons per metre, rounded inwards, with the result in the next frame: the step elapsed, and nominal."""
    *_, later = re.search(rf"^\| {row}.*\|$", PAGES["for-all.md"], re.MULTILINE)[0].strip("| ").split(" | ")
    _, shown = later.split("; ")
    for step, value in zip(("elapsed", "nominal"), shown.split(", "), strict=True):
        changes = [f"environment.step={step}", "environment.delay=frame", *filter(None, [sweep])]
        table = wavesweep.zwidth(wavesweep.load(ROOT / f"sweeps/for-all/{spec}.toml", changes))
        assert int(value) == int(table[table.guarantee == "for_all"].high.max())
