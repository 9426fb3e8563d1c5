"""Texts for users, compared with files of expected texts.

`WAVESWEEP_UPDATE=1` writes the files anew; their difference in version control is then what a user would see differently.
"""

import os
from pathlib import Path


def assert_expected(path: Path, text: str) -> None:
    """Compare a text with that of a file."""
    if os.environ.get("WAVESWEEP_UPDATE"):
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8"), f"{path.name} differs; WAVESWEEP_UPDATE=1 writes it anew"
