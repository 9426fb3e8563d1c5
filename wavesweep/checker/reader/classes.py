"""Classes of blocks written out: [type.NAME] and the device types that the documents describe as classes."""

import ast

from .expressions import parsed
from .loops import Unreadable
from .names import flat

MOST = 1000  # blocks of classes: one that has itself as a block would never end


def written_out(tables: dict) -> dict:
    """The same spec without classes: blocks `left.motor`, numbers `left_kp`, signals `left.angle`."""
    classes = tables.get("type", {})
    whole = {**tables, **{name: flat(tables.get(name, {})) for name in ("wire", "signals")}}
    for _ in range(MOST):
        blocks = whole.get("block", {})
        instances = [name for name, block in blocks.items() if block.get("type") in classes]
        if not instances:
            whole.pop("type", None)
            return whole
        whole = _one(whole, instances[0], classes[blocks[instances[0]]["type"]])
    raise Unreadable(f"more than {MOST} blocks of classes, or a class in itself")


def _names_outside(name: str, drawing: dict) -> dict[str, str]:
    """What numbers, blocks, signals and inputs of the class of block `name` are called in the loop."""
    names = {number: f"{name}_{number}" for number in drawing.get("numbers", {})}
    for part in (*drawing.get("block", {}), *drawing.get("signals", {})):
        names[part] = f"{name}.{part}"
    for port in drawing.get("ports", {}).get("inputs", []):
        names[port] = f"{name}.{port}"
    return names


def _one(tables: dict, name: str, drawing: dict) -> dict:
    """The block `name` replaced by the blocks of its class."""
    unknown = drawing.keys() - {"numbers", "block", "signals", "wire", "ports"}
    if unknown:
        raise Unreadable(f"the key {min(unknown)} of a class is not known")
    blocks = dict(tables["block"])
    instance = dict(blocks.pop(name))
    instance.pop("type")
    numbers = dict(tables.get("numbers", {}))
    signals = dict(tables["signals"])
    wires = dict(tables["wire"])
    drawing = {**drawing, **{part: flat(drawing.get(part, {})) for part in ("wire", "signals")}}
    ports = drawing.get("ports", {})
    names = _names_outside(name, drawing)
    made = [*names.values(), *(f"{name}.{output}" for output in ports.get("outputs", {}))]
    before = {*numbers, *blocks, *signals}
    taken = [new for new in made if new in before or made.count(new) > 1]
    taken += [port for port in drawing.get("wire", {}) if f"{name}.{port}" in wires]
    if taken:
        raise Unreadable(f"{taken[0]} of the class of {name} is there twice")
    for block, keys in drawing.get("block", {}).items():
        changed = {key: _renamed(value, names) for key, value in keys.items() if key != "type"}
        changed |= instance.pop(block, {})
        blocks[f"{name}.{block}"] = {"type": keys["type"], **changed}
    for number, value in drawing.get("numbers", {}).items():
        set_here = number in instance
        numbers[names[number]] = instance.pop(number) if set_here else _renamed(value, names)
    for key in instance:
        raise Unreadable(f"block.{name}.{key} is no number and no block of its class")
    texts = drawing["signals"], ports.get("outputs", {}), drawing["wire"]
    for target, meanings in zip((signals, signals, wires), texts, strict=True):
        for key, text in meanings.items():
            target[f"{name}.{key}"] = _renamed(text, names)
    for port in ports.get("inputs", []):
        signals[f"{name}.{port}"] = wires.pop(f"{name}.{port}")
    return {**tables, "block": blocks, "numbers": numbers, "signals": signals, "wire": wires}


class _Rename(ast.NodeTransformer):
    def __init__(self, names):
        self.names = names

    def visit_Name(self, node):
        new = self.names.get(node.id)
        return ast.parse(new, mode="eval").body if new else node


def _renamed(value, names):
    """An expression, or lists of them, with the class's own names."""
    if isinstance(value, list):
        return [_renamed(entry, names) for entry in value]
    if isinstance(value, dict):
        return {key: _renamed(entry, names) for key, entry in value.items()}
    if not isinstance(value, str):
        return value
    try:
        node = parsed(value)
    except Unreadable:  # a word
        return value
    return ast.unparse(_Rename(names).visit(node))
