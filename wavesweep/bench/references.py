"""Reference numbers at 50 digits, shipped with the package; `tests/benchmarks/references.py` makes them."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from wavesweep.errors import WavesweepError

FILE = Path(__file__).with_name("references.json")


@cache
def references() -> dict[str, Any]:
    """Read the file."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def checked(part: dict[str, Any], digest: str, name: str) -> dict[str, Any]:
    """Give the part back; WavesweepError where the question has changed since the references were made."""
    if part["digest"] != digest:
        raise WavesweepError(
            f"the references of {name} belong to another question than the benchmark now asks; "
            "tests/benchmarks/references.py makes them anew"
        )
    return part
