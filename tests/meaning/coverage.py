"""Which keys of a spec the random specs have, and which of these they leave to their defaults."""

import contextlib
import io
import json
import re
import tomllib
from collections import Counter

from meaning import doubles
from meaning.required import KEYS
from meaning.specs import linkage, spec_text

from wavesweep.checker.reader import loop_of
from wavesweep.checker.reader.drawings import DEVICES, PLANTS

QUESTIONS = {
    "bode",
    "for_all",
    "simulate",
    "measured",
    "design",
}  # tables that are no part of the loop; of [sweep] what is required
NOT_READ = {  # keys of a spec that the interpreter does not read, and why
    "environment.step": "about frames that vary",
    "ports.hand.turns": "a unit",
    "ports.hand.volts": "a unit",
    "block.ss.file": "the matrices in another file",
    "ports.wall": "which numbers zwidth is about",
    "ports.environment": "a second port, for passivity alone",
    "block.saturation.low": "the linear loop is within its limits",
    **{
        f"block.{kind}.{key}": "the linear loop is within its limits"
        for kind in ("integrator", "pi", "pid")
        for key in ("high", "low", "anti_windup", "tracking_s")
    },
    **{
        f"block.channel.{key}": "the loop's own messages are all in time"
        for key in ("late", "lost", "loss", "burst", "burst_end", "burst_loss")
    },
    **{f"block.{kind}.phase": "a plant runs in every tick" for kind in PLANTS - {"ss", "tf", *DEVICES}},
    **{f"block.{kind}.every": "a plant runs in every tick" for kind in PLANTS - {"ss", "tf", *DEVICES}},
}


def drawn(specs: int) -> tuple[Counter[str], Counter[str]]:
    """How many of so many specs have each key, and how many are read without it. Devices of several axes come in addition."""
    given: Counter[str] = Counter()
    left_out: Counter[str] = Counter()
    texts = [tomllib.loads(spec_text(number, quick=True)) for number in range(specs)]
    texts += [linkage(seed, kind) for seed in range(specs // 20) for kind in DEVICES]
    for tables in texts:
        loop = loop_of(tables, doubles)
        loop.schedule()
        own = {path for table, inside in tables.items() if table not in ("block", "sweep") for path in _paths(table, inside)}
        for inside in (tables, *(inside for table, inside in tables.items() if table.startswith("type."))):
            for keys in inside.get("block", {}).values():
                own |= {f"block.{keys.get('type')}.{key}" for key in keys}
        given.update(own)
        left_out.update(loop.key.asked - own)
    return given, left_out


def _paths(path, value):
    yield path
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _paths(f"{path}.{key}", inner)


def uncovered(given: Counter[str]) -> list[str]:
    """Keys of `wavesweep keys` that no spec has, and that are not listed; and those listed that some have, or that are none."""
    known = keys_of_schema() | keys_of_devices()
    return sorted((known - given.keys() - NOT_READ.keys()) | (NOT_READ.keys() & given.keys()) | (NOT_READ.keys() - known))


def lines(specs: int) -> tuple[list[str], list[str]]:
    """A line for each key, and the keys that are missing."""
    given, left_out = drawn(specs)
    known = keys_of_schema() | keys_of_devices()
    missing = uncovered(given)
    found = [f"{'given':>8} {'left out':>8}"]
    found += [f"{given[key]:8d} {left_out[key]:8d} {key}" for key in sorted(known - NOT_READ.keys())]
    found += [f"{'-':>8} {'-':>8} {key}: {why}" for key, why in NOT_READ.items()]
    counted = len((known - NOT_READ.keys()) & given.keys())
    return [*found, f"{counted} keys in {specs} specs; not drawn: {', '.join(missing) or 'none'}"], missing


def _printed(*arguments: str) -> str:
    from wavesweep.program.cli import main

    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main(["keys", *arguments]) == 0
    return printed.getvalue()


def keys_of_schema() -> set[str]:
    schema = json.loads(_printed("--schema"))
    found = set()
    for part in (schema["then"], schema["else"]):
        require = part["properties"]["sweep"]["properties"]["require"]
        assert {path.removeprefix("require.") for path in _leaves("require", require)} == KEYS
        for table, inside in part["properties"].items():
            if table not in {"block", "sweep", *QUESTIONS}:
                found |= set(_leaves(table, inside))
    for choice in schema["else"]["properties"]["block"]["additionalProperties"]["allOf"]:
        kind = choice["if"]["properties"]["type"]["const"]
        found |= {f"block.{kind}.{key}" for key in choice["then"]["properties"] if key != "type"}
    return found


def keys_of_devices() -> set[str]:
    """Of the lines `  KEY: what it is (number UNIT; by default ...)`."""
    found = set()
    for kind in (*DEVICES, "wall", "wall-3d"):
        found |= {f"block.{kind}.{key}" for key in re.findall(r"^  (\w+): .*\(number", _printed(f"block.{kind}"), re.MULTILINE)}
    assert len(found) > 70
    return found


def _leaves(path, schema):
    tables = [form for form in schema.get("anyOf", []) if "properties" in form]
    if tables:  # or a list of such tables
        (schema,) = tables
    if path in {"ports.wall", "ports.environment", "type"} or not schema.get("properties"):
        yield path
        return
    for key, value in schema["properties"].items():
        yield from _leaves(f"{path}.{key}", value)
