"""Names of numbers in [sweep], [for_all] and claims: one number has one name, and one quantity one key."""

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from .devices import DEFAULTS
from .keys import BLOCKS, CONTROLLER, FILTER, Rule, rules
from .loops import Unreadable

SYMBOLS = {  # axes of a sweep by their short names
    "K_VE": "environment.K_VE",
    "B_VE": "environment.B_VE",
    "b": "controller.b",
    "Kp": "controller.Kp",
    "K_VC": "controller.K_VC",
    "B_VC": "controller.B_VC",
    "K_LM": "local_model.K_LM",
    "B_LM": "local_model.B_LM",
}
EDGES = ("passband_hz", "stopband_hz", "passband_db", "stopband_db")
FILTERS = ("lp1", "hp", "lp2")
RULES = rules(CONTROLLER)
DISPLACED = {"rates.ratio": ["rates.slow_hz"], "rates.slow_hz": ["rates.ratio"]}
for _name in FILTERS:
    RULES |= {f"filters.{_name}.{key}": rule for key, rule in rules(FILTER).items()}
    for _edge in EDGES:
        DISPLACED[f"filters.{_name}.{_edge}"] = [
            f"filters.{_name}.order",
            f"filters.{_name}.cutoff_hz",
        ]
OF_BLOCKS = {
    kind: rules(f"every whole 1 100000\nphase whole 0 99999\n{text}")
    for kind, text in BLOCKS.items()
}
OWN = {  # keys of tables that are no numbers; in a drawn loop a number of the same name comes first, but for along
    "sweep": ("along", "require"),
    "bode": ("frequency_hz", "from", "to"),
    "for_all": ("lost", "loss", "contact", "tick"),
    "vary": (),
}
PARTS = {
    "for_all": {"start", "stop", "values", "varying", "shares", "next"}
}  # of a number; of others num and scale
PARTS_OF_AXES = PARTS["for_all"] | {"num", "scale"}


def rule_of(tables: dict, path: tuple[str, ...]) -> Rule | None:
    """What a key may be; None of a number of a drawing, which its readers know."""
    if "controller" in tables:
        return RULES.get(".".join(path))
    if path[0] != "block":
        return None
    return OF_BLOCKS.get(tables["block"][path[1]]["type"], {}).get(path[2])


def path_of(tables: dict, name: str) -> tuple[str, ...]:
    """Where a number stands. Unreadable for what is none, and for one that follows from others."""
    if "controller" in tables:
        path = SYMBOLS.get(name, name)
        if path in RULES and not RULES[path].words:
            return tuple(path.split("."))
        raise Unreadable(f"{name} is no number of this spec")
    numbers = tables.get("numbers", {})
    number = name if name in numbers else name.removeprefix("numbers.")
    if number in numbers:
        entry = numbers[number]
        if isinstance(entry.get("value") if isinstance(entry, dict) else entry, str):
            raise Unreadable(f"{name} follows from other numbers")
        return "numbers", number
    if name == "rates.tick_hz":
        return "rates", "tick_hz"
    for block, keys in tables.get("block", {}).items():
        of_class = (
            keys["type"] in tables.get("type", {})
            or keys["type"] in DEFAULTS
            or keys["type"].startswith("wall")
        )
        text, prefix = (number, f"{block}_") if of_class else (name, f"block.{block}.")
        key = text.removeprefix(prefix)
        rule = OF_BLOCKS.get(keys["type"], {}).get(key)
        if "." in key and key.rpartition(".")[2] in PARTS_OF_AXES:
            continue  # of the number before it
        numeric = text.startswith(prefix) and (of_class or (rule and not rule.words))
        if numeric and not isinstance(keys.get(key), str | dict | list):
            return "block", block, key
    raise Unreadable(f"{name} is no number of this spec")


def called(tables: dict, name: str) -> str:
    """The one name of a number: of a controller its path, of a drawing the name that expressions have."""
    table, *rest = path_of(tables, name)
    if table == "numbers":
        return rest[0]
    if table == "block" and rule_of(tables, (table, *rest)) is None:
        return "_".join(rest)
    return ".".join((table, *rest))


def quantity(tables: dict, name: str) -> str:
    """The one name of what a number says: the slow rate says the ratio."""
    path = called(tables, name)
    return "rates.ratio" if path == "rates.slow_hz" else path


def with_numbers(tables: dict, values: dict) -> dict:
    """The same spec with other numbers, by their names in [sweep] and [for_all], without the keys that say the same otherwise."""
    named: dict[str, str] = {}
    for name in values:
        name_before = named.setdefault(quantity(tables, name), name)
        if name_before != name:
            raise Unreadable(f"{name_before} and {name} are one number")
        for displaced in DISPLACED.get(name, ()):
            tables = changed(tables, tuple(displaced.split(".")))
    for name, value in values.items():
        tables = changed(tables, path_of(tables, name), value)
    return tables


def changed(table: dict, path: tuple[str, ...], *value) -> dict:
    """The same tables with another value at a path, or with none."""
    first, *rest = path
    if rest:
        return {**table, first: changed(table.get(first, {}), (*rest,), *value)}
    remaining = {key: inside for key, inside in table.items() if key != first}
    return remaining | dict.fromkeys([first], *value) if value else remaining


def flat(table: dict, before: str = "") -> dict[str, Any]:
    """Nested tables as one, its names with dots."""
    flattened = {}
    for key, value in table.items():
        flattened |= (
            flat(value, f"{before}{key}.") if isinstance(value, dict) else {before + key: value}
        )
    return flattened


def axes(tables: dict, table: str, inside: dict) -> Iterator[tuple[str, Any]]:
    """The numbers of a table with what it says of them, by the names that they have there: the longest that a path begins with."""
    entries: dict[str, Any] = {}
    for path, value in leaves(inside):
        names = [".".join(path[:length]) for length in range(len(path), 0, -1)]
        numbers = [name for name in names if _is_number(tables, name)]
        if path[0] in OWN[table] and (path[0] == "along" or path[0] not in numbers):
            continue
        name = numbers[0] if numbers else names[0]
        path_of(tables, name)
        part = names[0][len(name) + 1 :]
        entry = entries.get(name, {})
        if name in entries and (not part or not isinstance(entry, dict) or part in entry):
            raise Unreadable(f"{name} stands in [{table}] twice")
        entries[name] = {**entry, part: value} if part else value
    yield from entries.items()


def leaves(table: dict) -> Iterator[tuple[list[str], Any]]:
    """What is no table, and tables of nothing, by the names that lead there."""
    for key, value in table.items():
        inner = leaves(value) if isinstance(value, dict) and value else [([], value)]
        yield from (([*key.split("."), *path], leaf) for path, leaf in inner)


def _is_number(tables: dict, name: str) -> bool:
    with suppress(Unreadable):
        return bool(path_of(tables, name))
    return False


def values_of(table: str, name: str, entry) -> list:
    """The values of a number, or the ends of its range."""
    parts = {"start", "stop"}
    if isinstance(entry, list):
        entry = {"values": entry}
    elif not isinstance(entry, dict) or entry.keys() - PARTS.get(
        table, {"start", "stop", "num", "scale"}
    ):
        raise Unreadable(f"{table}.{name} is no list of values and no table of start and stop")
    listed = entry.get("values")
    if isinstance(listed, list) and listed and not entry.keys() & parts:
        return listed
    if "values" in entry or entry.keys() & parts != parts:
        raise Unreadable(f"{table}.{name} has to have either start and stop or a list of values")
    return [entry["start"], entry["stop"]]


def one_key_each(tables: dict, arithmetic) -> list[dict]:
    """The numbers of [sweep] and [for_all], all at their least value and all at their largest.

    Unreadable for a number that tables have by two names, for a range that none is, and for values that a key cannot have.
    """
    ends: list[dict] = [{}, {}]
    first: dict[str, tuple[str, str]] = {}
    with_design = {**tables, "vary": tables.get("design", {}).get("vary", {})}
    for table in OWN:
        for name, entry in axes(tables, table, with_design.get(table, {})):
            where, name_before = first.get(quantity(tables, name), ("", name))
            if name_before != name or where in (table, *["sweep"] * (table == "for_all")):
                raise Unreadable(
                    f"{name_before} of [{where}] and {name} of [{table}] are one number"
                )
            first[quantity(tables, name)] = table, name
            rule = rule_of(tables, path_of(tables, name)) or Rule()
            values = values_of(table, name, entry)
            for value in values:
                rule.refuse(f"{table}.{name}", value, arithmetic)
            if isinstance(entry, dict) and "stop" in entry and values[0] > values[1]:
                raise Unreadable(
                    f"{table}.{name} goes from {float(values[0]):g} down to {float(values[1]):g}"
                )
            if table in ("sweep", "for_all"):
                for index, end in enumerate((min, max)):
                    ends[index][name] = end(values)
    return ends
