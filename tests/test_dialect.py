"""The docstrings are in one dialect: plain sentences, conditions with "if", no words of our own, every parameter named."""

import ast
import importlib
import inspect
import re
from collections import Counter
from pathlib import Path

import pytest

import wavesweep

PACKAGE = Path(wavesweep.__file__).parent
ROOT = PACKAGE.parent

FOLDERS = tuple(sorted({source.parent.relative_to(PACKAGE).as_posix() for source in PACKAGE.rglob("*.py")}))
KERNEL = "analysis/intervals/compiled", "lifted/compiled"  # they load numba, an optional extra
# Rates per thousand words.
MOST = {"what": 1.0, "where": 1.0, "how": 1.5}
LEAST_IF = 3.0

PRIVATE = (
    r"as ever", r"for ever", r"stand(s|ing)? in", r"hangs? on", r"talks?", r"nobody", r"of use", r"march(es|ed|ing)?",
    r"vouch(es|ed)?", r"told", r"whatsoever", r"on (its|their) way", r"looked at", r"asked for", r"a word",
    r"moods?", r"of ours",
)  # fmt: skip
DOCUMENTS = (
    *("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"),
    *("wavesweep/ACCURACY.md", "wavesweep/SAFETY.md", "wavesweep/TABLES.md"),
)
PLACES = (ast.Module, ast.ClassDef, ast.FunctionDef)


def docstrings(folder):
    """(place, docstring) of all modules, classes and functions directly in a folder of the package."""
    for source in sorted((PACKAGE / folder).glob("*.py")):
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if isinstance(node, PLACES) and (text := ast.get_docstring(node)):
                yield f"{source.relative_to(PACKAGE)}: {getattr(node, 'name', 'module')}", text


def rates(texts):
    """How often each word of interest occurs per thousand words, and the number of all words."""
    words = Counter(re.findall(r"[a-z']+", " ".join(texts).lower()))
    return {word: 1000 * words[word] / words.total() for word in (*MOST, "if")}


def private(text):
    """The private words in a text."""
    return [match.group() for word in PRIVATE for match in re.finditer(rf"\b{word}\b", text, re.IGNORECASE)]


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS)
def test_nouns_and_conditions_are_those_of_plain_english(folder):
    found = rates([text for _, text in docstrings(folder)])
    assert {word: rate for word, rate in found.items() if rate > MOST.get(word, float("inf"))} == {}
    # The package's own files have few words, and the docstrings of the paper's statements are cells of a table.
    assert folder in (".", "paper/statements") or found["if"] >= LEAST_IF


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS)
def test_docstrings_have_no_private_words(folder):
    assert {place: words for place, text in docstrings(folder) if (words := private(text))} == {}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_documents_have_no_private_words(name):
    assert private((ROOT / name).read_text(encoding="utf-8")) == []


def test_the_measures_see_the_words():
    assert private("Talk goes to stderr, as ever; it hangs on nobody.") == ["as ever", "hangs on", "Talk", "nobody"]
    sixth = pytest.approx(1000 / 6)
    assert rates(["What it is, if it is."]) == {"what": sixth, "where": 0, "how": 0, "if": sixth}


@pytest.mark.slow
@pytest.mark.parametrize("folder", FOLDERS)
def test_a_docstring_begins_with_a_sentence_of_its_own(folder):
    summaries = {place: text.split("\n\n")[0] for place, text in docstrings(folder)}
    assert [place for place, summary in summaries.items() if not summary.endswith((".", ":"))] == []


@pytest.mark.slow
def test_modules_and_public_names_have_docstrings():
    bare = []
    for source in PACKAGE.rglob("*.py"):
        module = ast.parse(source.read_text(encoding="utf-8"))
        public = [node for node in module.body if isinstance(node, PLACES) and not node.name.startswith("_")]
        nodes = [module, *public] if module.body else []
        bare += [f"{source.name}: {getattr(node, 'name', 'module')}" for node in nodes if not ast.get_docstring(node)]
    assert bare == []


def functions(folder):
    """(place, function, its text and the stage's) of all functions that a stage exports, and methods of exported classes."""
    stage = importlib.import_module(".".join(("wavesweep", *(part for part in folder.split("/") if part != "."))))
    names = ("Loop",) if folder == "loop" else getattr(stage, "__all__", ()) or vars(stage).get("_HOMES", ())
    for name in names:
        exported = getattr(stage, name)
        for part in vars(exported).values() if inspect.isclass(exported) else (exported,):
            if inspect.isfunction(part) and not part.__name__.startswith("_"):
                yield f"{folder}/{name}", part, f"{part.__doc__} {stage.__doc__}"


@pytest.mark.parametrize("folder", [*FOLDERS, "loop"])
def test_exported_functions_name_their_parameters(folder):
    """In their own docstring, or in that of the stage if all of its functions have the same parameters."""
    if folder in KERNEL:
        pytest.importorskip("numba")
    for place, function, text in functions(folder):
        names = [name for name in inspect.signature(function).parameters if name not in ("self", "_")]
        assert [name for name in names if not re.search(rf"\b{name}\b", text)] == [], f"{place}: {function.__name__}"
