"""What a spec means, from its documents alone: the instants of one period of its loop, with their equations.

`loop_of` takes the tables of a spec and an arithmetic (`Arithmetic` in loops.py), in which it computes every coefficient:
doubles, or numbers that are enclosed while others have any value of a range. It shares nothing with the package's own reader.
"""

from .controllers import KEYS, SYMBOLS, Controller
from .drawings import Drawing
from .loops import Unreadable

OTHERS = {
    "sweep",
    "bode",
    "simulate",
    "measured",
    "design",
    "for_all",
}  # tables that are not the loop itself
PORTS = {"hand", "wall", "environment", "inputs", "outputs"}
LIMITS = {"high", "low", "anti_windup", "tracking_s"}  # the linear loop is within them
MESSAGES = {
    "late",
    "lost",
    "missing",
    "loss",
    "burst",
    "burst_end",
    "burst_loss",
}  # the loop's own are all in time


def loop_of(tables: dict, arithmetic, cut: str = "") -> Controller | Drawing:
    """The loop of a spec; `schedule()` of it has its instants, `key.asked` the keys that were read.

    cut: in a drawing an output of a block, to which an input "!cut" is added where it is read, whenever the block runs.
    """
    if "controller" in tables:
        return Controller(tables, arithmetic)
    return Drawing(tables, arithmetic, cut)


def wall_of(tables: dict) -> list[str]:
    """The names of the stiffness and the damping of the wall of a spec, as `with_numbers` takes them."""
    if "controller" in tables:
        return ["K_VE", "B_VE"]
    wall = tables.get("ports", {}).get("wall", {})
    return [wall[key] for key in ("stiffness", "damping") if key in wall]


def with_numbers(tables: dict, values: dict) -> dict:
    """The same spec with other numbers, by their names in [sweep] and [for_all]."""
    places: dict[tuple, str] = {}
    for name, value in values.items():
        path = path_of(tables, name)
        other = places.setdefault(path, name)
        if other != name:
            raise Unreadable(f"{other} and {name} are one number")
        tables = _changed(tables, path, value)
    return tables


def path_of(tables, name: str) -> tuple[str, ...]:
    """Where a number stands in a spec, by any of its names."""
    if "controller" in tables:
        path = SYMBOLS.get(name, name)
        table, _, key = path.rpartition(".")
        if key not in KEYS.get(table, ()):
            raise Unreadable(f"{name} is no number of this spec")
        return tuple(path.split("."))
    if name in tables.get("numbers", {}):
        return "numbers", name
    if name == "rates.tick_hz":
        return "rates", "tick_hz"
    for block, keys in tables.get("block", {}).items():
        if name.startswith(f"{block}_"):  # of a class or of a device
            return "block", block, name.removeprefix(f"{block}_")
        path = name.removeprefix(f"block.{block}.").split(".")
        if name.startswith(f"block.{block}.") and _within(keys, path):
            return "block", block, *path
    raise Unreadable(f"{name} is no number of this spec")


def _within(table, path) -> bool:
    for name in path:
        if not isinstance(table, dict) or name not in table:
            return False
        table = table[name]
    return not isinstance(table, dict)


def _changed(table, path, value):
    first, *rest = path
    before = table.get(first, {})
    return {**table, first: _changed(before, rest, value) if rest else value}


def unknown_key(tables: dict, loop: Controller | Drawing) -> str | None:
    """A key of the spec that the reader does not know, so that what it says of the loop may not be all; None if there is none.

    To be called after `schedule()`.
    """
    if isinstance(loop, Controller):
        known = {f"{table}.{key}" for table, keys in KEYS.items() for key in keys}
        return next(
            (
                path
                for path in _leaves(tables)
                if path.split(".")[0] not in OTHERS and path not in known
            ),
            None,
        )
    tables = loop.key.tables
    known = {"rates", "numbers", "block", "signals", "wire", "ports"}
    own = [table for table in tables if table not in known | OTHERS]
    own += [f"rates.{key}" for key in tables["rates"] if key != "tick_hz"]
    own += [f"ports.{key}" for key in tables.get("ports", {}) if key not in PORTS]
    for name, block in loop.blocks.items():
        extra = {
            "integrator": LIMITS,
            "pi": LIMITS,
            "pid": LIMITS,
            "saturation": LIMITS,
            "channel": MESSAGES,
        }
        free = {"type"} | extra.get(block["type"], set())
        own += [
            f"block.{name}.{key}"
            for key in block
            if key not in free and (name, key) not in loop.read
        ]
    own += [f"wire.{port}" for port in loop.wires if f"wire.{port}" not in loop.key.asked]
    return own[0] if own else None


def _leaves(table, before=""):
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{before}{key}.")
        else:
            yield before + key
