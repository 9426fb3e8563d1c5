"""The README cannot rot: what it lists is what the program has, and what it shows as code runs."""

import pathlib
import re

import pytest

from wavesweep.cli.entry import COMMANDS
from wavesweep.spec import KEYS

README = (pathlib.Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def section(title):
    """The text under a heading, up to the next one."""
    return README.split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]


def test_every_command_stands_in_the_readme_with_its_help():
    rows = dict(re.findall(r"^\| `wavesweep ([a-z-]+).*?` \| (.*?) \|$", section("Commands"), re.MULTILINE))
    assert rows == dict(COMMANDS)


def test_every_key_stands_in_the_readme_with_its_unit_and_default():
    rows = re.findall(r"^\| `([\w.]+)` \| (.*?) \| (.*?) \| (.*?) \|$", section("Keys of a spec"), re.MULTILINE)
    assert rows == [
        (key.path, key.unit if key.unit not in ("", "1") else "", default(key), key.description) for key in KEYS.values()
    ]


def default(key):
    """How the README shows a default."""
    if key.required:
        return "required: " + ", ".join(key.choices)
    return "" if key.default is None else str(key.default)


def test_the_library_example_runs_as_it_stands(monkeypatch):
    monkeypatch.chdir(pathlib.Path(__file__).parents[1])
    code = re.search(r"```python\n(.*?)```", section("As a library"), re.DOTALL).group(1)
    names = {}
    exec(code, names)  # noqa: S102 - the document's own code
    assert names["table"].certified.all()
    assert names["radius"].shape == (2, 3)


@pytest.mark.parametrize("path", re.findall(r"\]\((?!http)([^)#]+)\)", README))
def test_links_lead_somewhere(path):
    assert (pathlib.Path(__file__).parents[1] / path).exists()
