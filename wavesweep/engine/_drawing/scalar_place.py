"""Numbers that are scalar gains of a drawing: in which wire or gain, and what else reads them.

These are the functions behind the methods of `Drawing`, whose drawings they take.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.engine._drawing.expressions import Tree

# keys of blocks that decide how a loop is built
STRUCTURE = ("every", "phase", "steps", "order", "n", "late", "lost")
HAND = "ports.hand."  # keys of the hand's port


@lru_cache(maxsize=256)  # a compiled loop is asked again and again
def scalar_place(drawing: Any, number: str) -> str:
    """The path of the only wire that is not within a plant, of the factor of the only gain, or of
    the output of the only word of firmware that reads a number, if it is linear in it; else empty.

    The ports may read the number too (see `seen_by_hand`), which changes nothing of the loop.
    """
    words = {}  # of firmware: blocks whose cores are transfer functions
    for block, core in zip(drawing.blocks, drawing.cores, strict=True):
        if core.type != block.type:
            words[f"block.{block.name}"] = dict(core.keys)
    path = _only_reader(drawing, number, words)
    word = words.get(path.removesuffix(".y"))
    trees = [tree for tree_path, tree in drawing.trees() if tree_path == path]
    if path.startswith("wire."):
        is_factor = not _split(drawing, path.removeprefix("wire."), number)
    elif word:
        is_factor = not any(_reads(tree, number) for tree in word["den"])
        trees = word["num"]
    else:
        gains = {f"block.{block.name}.k" for block in drawing.blocks if block.type == "gain"}
        is_factor = path in gains
    return path if is_factor and all(tree.degree(number) <= 1 for tree in trees) else ""


def _reads(tree: Tree, number: str) -> bool:
    """Whether a tree reads a number."""
    return tree.reads(number)


def _only_reader(drawing: Any, number: str, words: Mapping[str, Any]) -> str:
    """The path of what alone reads a number, other than ports; empty if there is more. words:
    paths of blocks of firmware."""
    readers = set()
    for path in _readers(drawing, number):
        block = path.rpartition(".")[0]
        if not path.startswith("ports."):
            readers.add(f"{block}.y" if block in words and not decides(path) else path)
    gains_within_plants = [gain for _, terms in drawing.couplings for _, gain in terms]
    if len(readers) != 1 or any(_reads(gain, number) for gain in gains_within_plants):
        return ""
    return readers.pop()


def _split(drawing: Any, port: str, number: str) -> bool:
    """Whether a number multiplies what a dead time brings to a plant, or both what it reads of
    plants and other signals."""
    multiplied = {signal for signal, gain in dict(drawing.wires)[port] if _reads(gain, number)}
    brought: set[str] = set()
    sensed: set[str] = set()
    for plant in drawing.plants:
        brought.update(f"{name}.y" for arrives_at, name in plant.arriving if arrives_at == port)
        sensed.update(signal for signal, name in plant.sensed if f"{name}.u" == port)
    if multiplied & brought:
        return True
    return bool(multiplied & sensed) and bool(multiplied - sensed)


@lru_cache(maxsize=256)
def shares_wire(drawing: Any, number: str, second: str) -> bool:
    """Whether another number is the factor of other terms in the same wire, see `scalar_place`."""
    place = scalar_place(drawing, number)
    table, _, port = place.partition(".")
    if table != "wire" or scalar_place(drawing, second) != place:
        return False
    if port.rpartition(".")[0] in drawing.dead_times:
        return False
    gains = [tree for path, tree in drawing.trees() if path == place]
    return not any(_reads(gain, number) and _reads(gain, second) for gain in gains)


@lru_cache(maxsize=256)
def seen_by_hand(drawing: Any, number: str) -> bool:
    """Whether the signals at the hand's port read a number themselves."""
    return any(path.startswith(HAND) for path in _readers(drawing, number))


@lru_cache(maxsize=256)
def _readers(drawing: Any, number: str) -> set[str]:
    """The paths of all that reads a number."""
    return {path for path, tree in drawing.trees() if _reads(tree, number)}


def decides(path: str) -> bool:
    """Whether the key of a block decides how the loop is built."""
    return path.startswith("block.") and path.rpartition(".")[2] in STRUCTURE
