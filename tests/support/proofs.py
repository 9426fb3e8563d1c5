"""Proof files by hand: a spec and lines, as the checker reads them."""

import contextlib
import gzip
import hashlib
import io
import json
import tomllib

from wavesweep.checker import VERSION, file
from wavesweep.checker.__main__ import main
from wavesweep.program import cli


def question_of(spec: str, lines: list[dict]) -> list[dict]:
    """What is asked where claims are all that is asked."""
    try:
        sets = tomllib.loads(spec).get("for_all", {})
    except tomllib.TOMLDecodeError:
        sets = {}
    question = []
    for line in lines:
        if isinstance(line.get("claim"), str) and isinstance(sides := line.get("sides", {}), dict):
            points = {name: ends[0] for name, ends in sides.items() if isinstance(ends, list) and ends[:1] == ends[-1:] != []}
            wide = {name: ends for name, ends in sides.items() if name not in points and name not in sets}
            kind = {"refuted": "for all", "goes on": "contact"}.get(line["claim"], line["claim"])
            question.append({"claim": kind, "numbers": line.get("numbers", {}) | points, "sides": wide})
            question[-1] |= {key: line[key] for key in ("radius", "gain") if key in line}
    return question


def checked(folder, spec: str, lines: list[dict], header: dict | None = None) -> tuple[int, str]:
    """Exit code of the checker and what it prints, of a spec and the lines after the first."""
    claims = sum("claim" in line for line in lines)
    first = {"format": file.FORMAT, "sha256": hashlib.sha256(spec.encode()).hexdigest(), "claims": claims}
    question = question_of(spec, lines)
    is_map = any("open" in line for line in lines) or any(len(part["sides"]) > 1 for part in question)
    first |= {"of": "map" if is_map else "design", "question": question}
    (folder / "spec.toml").write_text(spec)
    with gzip.open(folder / "spec.proof", "wt") as out:
        for line in (first | (header or {}), *lines):
            out.write(json.dumps(line) + "\n")
    return checked_file(folder / "spec.toml", folder / "spec.proof")


def checked_file(spec, file) -> tuple[int, str]:
    """Exit code and sentences after the first one, which has the version; each line is one that a terminal shows whole."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        code = main([str(spec), str(file)])
    said = printed.getvalue()
    assert all(len(line) < 120 for line in said.splitlines())
    return code, said.replace("\n    ", " ").removeprefix(f"wavesweep checker {VERSION}\n")


def written(folder, text: str, command: str, *words) -> tuple:
    """The spec of a command with --proof, and its proof file."""
    spec = folder / "spec.toml"
    spec.write_text(text)
    assert not cli.main([command, str(spec), "--proof", "--out", str(folder / "out"), *words])
    return spec, folder / "out" / f"{command}.proof"


def lines_of(proof) -> list[dict]:
    with gzip.open(proof) as file:
        return [json.loads(line) for line in file]


def changed(proof, change) -> None:
    """Write a proof file again with other lines."""
    lines = [change(line) for line in lines_of(proof)]
    with gzip.open(proof, "wt") as file:
        file.writelines(json.dumps(line) + "\n" for line in lines)
