"""Proofs of both sides of an end, of random specs, are refused once a word of the spec or of the proof is another.

`python -m proofs.mutations 0 50` draws 40 changes for each. A change that is not refused says the same only if the package,
that reads the changed spec by itself, finds the end where the proof has it. It ends with 1 if one does not.
"""

import json
import sys
import tempfile
import tomllib
from collections import Counter
from copy import deepcopy
from pathlib import Path

import numpy as np
from meaning.judge import compiled
from meaning.specs import KINDS, METHODS, spec_text, toml
from support.proofs import checked

from wavesweep.checker.balls import Refused
from wavesweep.checker.file import spec_of
from wavesweep.engine.errors import SpecError
from wavesweep.proofs.claims import claim_at
from wavesweep.proofs.of_table import checked_name

CHANGES = 40
NEAR = 1e-7  # of an end: where both sides are proved
WORDS = (METHODS, KINDS, ("exact", "difference"), ("low", "high"), ("force", "velocity"), ("held", "zero"), ("mass", "inertia"))
OF_THE_LOOP = ("rates", "numbers", "block", "signals", "wire", "type", "controller", "device", "environment", "operator")
OF_THE_LOOP += ("local_model", "filters")


def end_of(loop) -> tuple[str, float] | None:
    """A number by its name in claims, and a certified end of a stable interval within its range."""
    axis = next((axis for axis in loop.spec.sweep if axis.name == loop.spec.along), None)
    if axis is None or axis.structural:
        return None
    span = float(axis.start), float(axis.stop)
    rows = loop.stable_intervals(along=axis.name, span=span)
    own = rows["guarantee"] == "spec" if "guarantee" in rows else rows["certified"]
    for end in [*rows["high"][own & rows["certified"]], *rows["low"][own & rows["certified"]]]:
        if span[0] < end * (1 - NEAR) and end * (1 + NEAR) < span[1]:
            return checked_name(axis.path), float(end)
    return None


def both_sides(text: str, number: str, end: float) -> list[dict]:
    """Claims and forms just below and above an end; nothing if they are the same, or a form is missing."""
    tables = spec_of(text.encode())
    try:
        below, above = (claim_at(tables, "modes", {number: repr(end * share)}) for share in (1 - NEAR, 1 + NEAR))
    except Refused:
        return []
    return [] if below[0]["outside"] == above[0]["outside"] else below + above


def leaves(tables: dict, path=()):
    for key, value in tables.items():
        if isinstance(value, dict):
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key), value


def others(key: str, value):
    """What may stand in place of a value."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield value + 1
    elif isinstance(value, float):
        yield value * 1.001 + (value == 0)
    elif isinstance(value, list):
        for at, entry in enumerate(value):
            for other in others(key, entry):
                yield [*value[:at], other, *value[at + 1 :]]
    else:
        words = [word for each in WORDS if value in each for word in each if word != value]
        yield from words or [f"1.001*({value})", f"-({value})"]


def changed_specs(text: str):
    """(what is changed, text) of everything that the loop of a spec reads."""
    tables = tomllib.loads(text)
    for path, value in leaves(tables):
        if path[0] not in OF_THE_LOOP:
            continue
        name = ".".join(path)
        for other in others(path[-1], value):
            yield f"{name} = {other!r}", toml(_with(tables, path, path[-1], other))
        if path[-1] in ("seconds", "steps"):
            key = "steps" if path[-1] == "seconds" else "seconds"
            yield f"{name} as {key}", toml(_with(tables, path, key, 2 if key == "steps" else 0.0013))
        if path[-1] not in ("type", "kind"):
            yield f"no {name}", toml(_with(tables, path, None, None))


def _with(tables, path, key, value):
    found = deepcopy(tables)
    inner = found
    for each in path[:-1]:
        inner = inner[each]
    del inner[path[-1]]
    if key is not None:
        inner[key] = value
    return found


def changed_files(lines: list[dict]):
    """(what is changed, lines) of a proof."""
    for at, line in enumerate(lines):
        changes = []
        if "claim" in line:
            (number, value), *_ = line["numbers"].items()
            other = lines[(at + 2) % len(lines)]["numbers"][number]
            changes = [{"outside": line["outside"] + 1}, {"numbers": {number: other}}, {"claim": "for all"}]
            changes += [
                {"states": line["states"][1:]},
                {"drifts": line["drifts"][1:]} if line["drifts"] else {"drifts": [["@x"]]},
            ]
            changes += [{"sides": {number: [value, other] if float(value) < float(other) else [other, value]}, "numbers": {}}]
        else:
            flipped = "".join({"+": "-", "-": "+"}[sign] for sign in line["signs"])
            changes = [{"signs": flipped}, {"open": True}, {"L": line["L"][1:]}]
        for change in changes:
            yield f"line {at}: {json.dumps(change)[:60]}", [*lines[:at], line | change, *lines[at + 1 :]]
        yield f"no line {at}", [*lines[:at], *lines[at + 1 :]]


def says_the_same(text: str, number: str, end: float, folder: Path) -> bool:
    """Whether the package has the end of a changed spec where it was."""
    try:
        loop = compiled(text, folder)
    except SpecError:  # of a key that this loop does not read
        return True
    found = end_of(loop)
    return found is not None and found[0] == number and abs(found[1] - end) <= NEAR * abs(end)


def run(text: str, seed: int, folder: Path, say) -> Counter:
    """How many changes are refused, and say the same; say: called with each that does neither."""
    asked = end_of(compiled(text, folder))
    lines = both_sides(text, *asked) if asked else []
    if not lines or checked(folder, text, lines)[0]:
        return Counter()
    changes = [(what, other, lines) for what, other in changed_specs(text)]
    changes += [(what, text, other) for what, other in changed_files(lines)]
    random = np.random.default_rng(seed)
    counts = Counter(proofs=1)
    for at in random.permutation(len(changes))[:CHANGES]:
        what, spec, proof = changes[at]
        if checked(folder, spec, proof)[0]:
            counts["refused"] += 1
        elif spec != text and says_the_same(spec, *asked, folder):
            counts["say the same"] += 1
        else:
            counts["not refused"] += 1
            say(what)
    return counts


def main(arguments: list[str]) -> int:
    total = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(*map(int, arguments)):
            found = run(spec_text(number, quick=True), number, Path(folder), lambda what, at=number: print(f"{at}: {what}"))  # noqa: T201
            total += found
            print(number, dict(found), flush=True)  # noqa: T201
    print(dict(total))  # noqa: T201
    return int(bool(total["not refused"]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
