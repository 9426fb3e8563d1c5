"""What a spec means, from its documents alone: the instants of one period of its loop, with their equations.

`loop_of` takes the tables of a spec and an arithmetic (`Arithmetic` in loops.py), in which it computes every coefficient:
doubles, or numbers that are enclosed while others have any value of a range. It shares nothing with the package's own reader.
"""

import re

from .controllers import Controller
from .drawings import Drawing
from .names import OF_BLOCKS, RULES, flat
from .names import path_of as path_of
from .names import with_numbers as with_numbers

OTHERS = {
    "sweep",
    "bode",
    "simulate",
    "measured",
    "design",
    "for_all",
}  # tables that are not the loop itself
PORTS = {
    "hand": {"force", "displacement", "reaction", "turns", "volts"},
    "wall": {"stiffness", "damping"},
    "environment": {"force", "displacement"},
    "inputs": {"signal", "unit"},
    "outputs": {"signal", "unit"},
}
NAME = re.compile(r"[\w.]+")
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

    cut: an output of a block, to which an input "!cut" is added where it is read, whenever the block runs; of a controller
    the force of the encoder's end, or of the wall.
    """
    if "controller" in tables:
        return Controller(tables, arithmetic, cut)
    return Drawing(tables, arithmetic, cut)


def wall_of(tables: dict) -> list[str]:
    """The names of the stiffness and the damping of the wall of a spec, as `with_numbers` takes them."""
    if "controller" in tables:
        return ["K_VE", "B_VE"]
    wall = tables.get("ports", {}).get("wall", {})
    return [wall[key] for key in ("stiffness", "damping") if key in wall]


def unknown_key(tables: dict, loop: Controller | Drawing) -> str | None:
    """A key of the spec that the reader does not know, so that what it says of the loop may not be all; None if there is none.

    To be called after `schedule()`.
    """
    if isinstance(loop, Controller):
        unknown = (
            path for path in flat(tables) if path.split(".")[0] not in OTHERS and path not in RULES
        )
        return next(unknown, None)
    tables = loop.key.tables
    tables_known = {"rates", "numbers", "block", "signals", "wire", "ports"}
    own = [table for table in tables if table not in tables_known | OTHERS]
    own += [f"rates.{key}" for key in tables["rates"] if key != "tick_hz"]
    for port, entry in tables.get("ports", {}).items():
        named = port in ("inputs", "outputs")
        parts = [part for part in entry.values() if isinstance(part, dict)] if named else [entry]
        keys = {key for part in parts for key in part} - PORTS.get(port, set())
        own += [f"ports.{port}.{key}" for key in keys] + [f"ports.{port}"] * (port not in PORTS)
        units = [part["unit"] for part in parts if "unit" in part]
        own += [f"ports.{port}: unit = {unit}" for unit in units if not isinstance(unit, str)]
    for name, block in loop.blocks.items():
        free = {"type"} | (LIMITS | MESSAGES) & OF_BLOCKS.get(block["type"], {}).keys()
        unread = [key for key in block if key not in free and (name, key) not in loop.read]
        own += [f"block.{name}.{key}" for key in unread]
    own += [f"wire.{port}" for port in loop.wires if f"wire.{port}" not in loop.key.asked]
    texts = {
        path: str(value)
        for path, value in flat(tables).items()
        if not path.startswith("ports.wall.") and not path.endswith((".unit", ".description"))
    }
    of_wires = [text for path, text in texts.items() if not path.startswith("ports.")]
    read = {name for text in of_wires for name in NAME.findall(text)}
    own += [f"ports: {signal}" for signal in sorted(loop.inputs() - read)]
    mentioned = read.union(*(NAME.findall(text) for text in texts.values()))
    own += [f"numbers.{name}" for name in loop.numbers if name not in mentioned]
    own += [f"signals.{name}" for name in loop.signals if "." not in name and name not in mentioned]
    return own[0] if own else None
