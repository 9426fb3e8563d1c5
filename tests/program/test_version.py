"""A version is that of a release, with its section in the changelog, or ends in .dev0 with a section of what is unreleased."""

import re
from pathlib import Path

import wavesweep

ROOT = Path(__file__).parents[2]


def test_a_release_has_its_notes_and_what_follows_it_is_marked():
    first, *others = re.findall(r"^## ([\w.]+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)[1]
    released = others[0] if first == "Unreleased" else first
    assert cited == released
    assert wavesweep.__version__ == released or first == "Unreleased"
    assert wavesweep.__version__.endswith(".dev0") == (first == "Unreleased")
