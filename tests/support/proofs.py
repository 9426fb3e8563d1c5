"""Proof files by hand: a spec and lines, as the checker reads them."""

import contextlib
import gzip
import hashlib
import io
import json

from wavesweep.checker.__main__ import main


def checked(folder, spec: str, lines: list[dict], header: dict | None = None) -> tuple[int, str]:
    """Exit code of the checker and what it prints, of a spec and the lines after the first."""
    claims = sum("claim" in line for line in lines)
    first = {"format": "wavesweep proof 1", "sha256": hashlib.sha256(spec.encode()).hexdigest(), "claims": claims}
    (folder / "spec.toml").write_text(spec)
    with gzip.open(folder / "spec.proof", "wt") as file:
        for line in (first | (header or {}), *lines):
            file.write(json.dumps(line) + "\n")
    return checked_file(folder / "spec.toml", folder / "spec.proof")


def checked_file(spec, file) -> tuple[int, str]:
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        code = main([str(spec), str(file)])
    return code, printed.getvalue()
