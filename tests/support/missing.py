"""The capabilities that ARCHITECTURE.md lists and that are not there: a copy may be without some."""

import re
from pathlib import Path

import pytest

import wavesweep
from wavesweep.capabilities import CAPABILITIES

_, _, listed = (Path(__file__).parents[2] / "ARCHITECTURE.md").read_text(encoding="utf-8").partition("## The capabilities")
LISTED = re.findall(r"^\| `(\w+)/` \|", listed.partition("\n## ")[0], re.MULTILINE)
THERE = {each.name for each in CAPABILITIES}
MISSING = {name for name in LISTED if not (Path(wavesweep.__file__).parent / name).is_dir()}


def needed(name: str) -> None:
    """Skip a test that asks for this capability, where a copy is without it; where nothing is taken away it has to be there."""
    if name in MISSING:
        pytest.skip(f"asks for {name}, which is taken away")
    assert name in THERE, name
