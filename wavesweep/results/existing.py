"""Results that are already there: whose are they, and may they be replaced?"""

from __future__ import annotations

import json
import os
from pathlib import Path

from wavesweep.errors import UsageError

SUFFIXES = (".csv", ".parquet", ".png", ".datapackage.json")


def refuse_other_spec(kind: str, directory: str | Path, sha256: str) -> None:
    """Raise UsageError where the directory holds a table of this kind that another spec made, or nobody knows which.

    Results of the same spec may be replaced: the new ones are equal.
    """
    found = existing_sha256(kind, directory)
    if found is None or found == sha256:
        return
    maker = f"another spec (SHA-256 {found[:12]}…, this one has {sha256[:12]}…)" if found else "an unknown origin"
    raise UsageError(
        f"{Path(directory) / kind}.*: found results of {maker}; give --force to replace them, or another --out"
    )


def existing_sha256(kind: str, directory: str | Path) -> str | None:
    """Give the SHA-256 of the spec whose results are there, "" where none can be told, None where there are none."""
    files = [Path(directory) / f"{kind}{suffix}" for suffix in SUFFIXES]
    if not any(file.exists() for file in files):
        return None
    try:
        package = json.loads(files[-1].read_text(encoding="utf-8"))
        return str(package["wavesweep"]["spec_sha256"])
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        # Files without a readable package of ours are somebody's all the same: say so, do not replace them.
        return ""


def discard(kind: str, directory: str | Path) -> None:
    """Remove the files of a table that is there, if one is; whose it is, `refuse_other_spec` has been asked before."""
    for suffix in SUFFIXES:
        (Path(directory) / f"{kind}{suffix}").unlink(missing_ok=True)


def refuse_unusable(directory: str | Path) -> None:
    """Raise UsageError where the folder for the results is none, or cannot be made or written to."""
    place = Path(directory).absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    if not place.is_dir():
        raise UsageError(f"{directory}: {place} is a file; name another folder for the results")
    if not os.access(place, os.W_OK | os.X_OK):
        raise UsageError(f"{directory}: {place} may not be written to; name another folder for the results")
