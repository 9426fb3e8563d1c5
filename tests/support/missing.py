"""The capabilities that ARCHITECTURE.md lists and that are not there: a copy may be without some."""

import re
from pathlib import Path

from wavesweep.capabilities import CAPABILITIES

_, _, listed = (Path(__file__).parents[2] / "ARCHITECTURE.md").read_text(encoding="utf-8").partition("## The capabilities")
THERE = {each.name for each in CAPABILITIES}
MISSING = set(re.findall(r"^\| `(\w+)/` \|", listed.partition("\n## ")[0], re.MULTILINE)) - THERE
