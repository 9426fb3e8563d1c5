"""The tables of a drawn loop and of [design], explained for `wavesweep keys`."""

from collections.abc import Iterator, Mapping
from typing import Any

from wavesweep.errors import UsageError
from wavesweep.spec.block_types import COLUMNS, EVERY, PHASE, RUN_COLUMNS, TICK_HZ, TYPES, BlockType
from wavesweep.spec.checking import expectation, nearest, show
from wavesweep.spec.design import WISHES, WishKind
from wavesweep.spec.keys import Key

LISTS = {
    "list": "a list of numbers",
    "rows": "a list of rows of numbers",
    "ports": "a list of names",
    "boolean": "true or false",
}
TABLES = {
    "numbers": "numbers of a drawn loop: NAME = value, or { value = ..., unit = ..., description = ... }; each may be an axis, "
    'and so may a number in a block, "block.NAME.KEY"; NAME = "expression" follows from other numbers, which may be axes',
    "type": "classes of blocks: [type.NAME.block.motor], and tables numbers, signals, wire and ports = { inputs = [names], "
    "outputs = { name = expression } } of the same; a block of that type gives its numbers",
    "signals": 'names of signals: NAME = "expression", for wires and ports',
    "wire": 'wires: "block.port" = "expression", linear in the outputs of blocks ("block.port"), in [signals] and '
    "signals from outside, of the same tick; prev(...) is a signal as it was before the tick; terms between plants act "
    "continuously, all others at a plant are held over a tick",
    "ports": (
        "hand = { force = NAME, displacement = expression, reaction = expression, turns = true or false } for bode, "
        "passivity and simulate; it turns if they are a torque and an angle; "
        "wall = { stiffness = number, damping = number } for zwidth; "
        "inputs = { NAME = signal }, signals from outside that wires read, and outputs = { NAME = expression }, each perhaps "
        "{ signal = ..., unit = ... }, for bode, simulate and to_control"
    ),
    "design.vary": "numbers that the search may change: NAME = { start, stop, scale } or a list of choices",
    "design.wish": "NAME = { at_least or at_most = bound, ... }; without a bound the quantity is to be as good as possible",
    "design.for_all": (
        "what each design has to hold for, of which the worst counts: NAME = [values] of device, hand, delay or a ratio "
        '("one key/another"); hand = { mass = [...], damping = [...], stiffness = [...] }'
    ),
    "for_all": (
        "what every answer has to hold for: NAME = { start, stop } or { values = [...] } of a number that is not known, with "
        "varying = true of one that may change from frame to frame (rates.ratio, environment.delay, or the number in every of "
        "blocks); lost = slow results in a row that may fail to come, of which the last one is held"
    ),
    "rates.tick_hz": f"{TICK_HZ.description} (Hz): {expectation(TICK_HZ)}, or an expression in numbers",
}


def is_drawn(name: str) -> bool:
    """Whether a name belongs to one of these tables."""
    return _table(name) != "" or name.partition(".")[0] == "block"


def _table(name):
    """The table that a name is or belongs to; empty for any other name."""
    return next((table for table in TABLES if name == table or name.startswith(f"{table}.")), "")


def lines(name: str) -> Iterator[str]:
    """Yield lines about one of these tables, all types of blocks, or one of them. Raises UsageError for any other name."""
    if table := _table(name):
        yield f"{table}: {TABLES[table]}" if table.startswith("rates") else f"[{table}]  {TABLES[table]}"
        yield from (_wish(wish, kind) for wish, kind in WISHES.items() if table == "design.wish")
        if taken := {"numbers": COLUMNS, "ports": COLUMNS | RUN_COLUMNS}.get(table):
            yield f"  names of columns of tables, which none may have: {', '.join(sorted(taken))}"
        return
    if name == "block":
        width = max(map(len, TYPES))
        yield "[block.NAME]  type = one of"
        for kind, each in TYPES.items():
            yield f"  {kind:{width}}  {_ports(each)}"
            yield f"  {'':{width}}    {each.description}"
        yield from _common()
        yield "`wavesweep keys block.TYPE` lists the keys of a type."
        return
    kind = _kind(name)
    yield f'type = "{kind}": {TYPES[kind].description}'
    yield f"  ports: {_ports(TYPES[kind])}"
    yield f"  where steps vary: {_steps(TYPES[kind])}"
    for key in TYPES[kind].keys.values():
        unit = f" {key.unit}" if key.unit not in ("", "1") else ""
        yield f"  {key.path}: {key.description} ({_takes(key)}{unit}; {_default(key)})"
    yield from _common()


def record(name: str) -> dict[str, Any]:
    """The same as JSON."""
    if table := _table(name):
        wishes = {
            wish: {"unit": kind.unit, "bound": kind.bound, "options": list(kind.options), "description": kind.description}
            for wish, kind in WISHES.items()
            if table == "design.wish"
        }
        return {table: {"description": TABLES[table]} | ({"wishes": wishes} if wishes else {})}
    kinds = TYPES if name == "block" else {_kind(name): TYPES[_kind(name)]}
    return {f"block.{kind}": _of_type(each) for kind, each in kinds.items()}


def _wish(name: str, kind: WishKind) -> str:
    options = f"; options: {', '.join(kind.options)}" if kind.options else ""
    return f"  {name} ({'without unit' if kind.unit == '1' else kind.unit}, {kind.bound}): {kind.description}{options}"


def _kind(name):
    kind = name.partition(".")[2]
    if name.partition(".")[0] != "block" or kind not in TYPES:
        hint = nearest(kind, TYPES)
        raise UsageError(f"{name} is no table or type of a drawn loop" + (f"; did you mean block.{hint}?" if hint else ""))
    return kind


def _ports(kind: BlockType) -> str:
    if kind.ports is None:
        return "inputs -> outputs"
    pairs = kind.ports.values() if isinstance(kind.ports, Mapping) else [kind.ports]
    return "; or ".join(f"{', '.join(inputs)} -> {', '.join(outputs)}" for inputs, outputs in pairs)


def _takes(key: Key) -> str:
    most = "" if key.high is None else f" and <= {key.high:g}"
    return ", ".join(map(str, key.choices)) or LISTS.get(key.type) or f"{expectation(key)}{most}"


def _default(key: Key) -> str:
    if key.required or key.default is None:
        return "required" if key.required else "absent by default"
    return f"by default {show(list(key.default) if isinstance(key.default, tuple) else key.default)}"


def _common() -> Iterator[str]:
    yield f"  every: {EVERY.description} (by default 1); phase: {PHASE.description} (by default 0)"
    yield "  every key that is a number takes an expression in numbers, as text"


def _of_type(kind: BlockType) -> dict[str, Any]:
    keys = {
        key.path: {"type": key.type, "unit": key.unit, "default": key.default, "required": key.required}
        | {"minimum": key.low, "maximum": key.high, "above_minimum": key.above_low}
        | {"choices": list(key.choices) or None, "description": key.description}
        for key in (*kind.keys.values(), EVERY, PHASE)
    }
    return {"description": kind.description, "ports": _ports(kind), "steps": _steps(kind), "keys": keys}


def _steps(kind: BlockType) -> str:
    return kind.steps or ("runs in every tick" if kind.plant else "refused")
