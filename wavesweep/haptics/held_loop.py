"""Loops that a hand holds: which block is the device, the loop with a hand on it, and its ticks
as the hand sees them."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from wavesweep.engine.blocks import MultirateLoop, Ports
from wavesweep.engine.drawing import AT, TYPES, Drawing, DrawnBlock, scalars
from wavesweep.engine.expressions import Tree
from wavesweep.engine.loop import Loops
from wavesweep.engine.response import Port
from wavesweep.haptics.controllers import HAND


class HeldLoop(Loops):
    """Loops of one structure that a hand holds."""

    __slots__ = ()

    @property
    def device(self) -> str | None:
        """Name of the mass or inertia that the hand holds; None if the hand is not the mass, damping and
        stiffness of one."""
        return device_of(self.drawing)

    def at(self, index: int) -> "HeldLoop":
        """Return one loop of the batch, by its flat index."""
        batch = self.batch
        values = {
            k: np.broadcast_to(v, batch).flat[index].item() if np.ndim(v) else v
            for k, v in self.values.items()
        }
        return HeldLoop(self.drawing, values)

    def with_hand(self) -> "HeldLoop":
        """Return the loops whose device has the mass, damping and stiffness of a hand as well,
        as the numbers `HAND`."""
        added = dict.fromkeys(HAND, 0.0)
        if self.drawing.reads.issuperset(HAND):
            drawing = self.drawing
        else:
            drawing = with_hand(self.drawing, self.device, HAND)
        return HeldLoop(drawing, {**added, **self.values})

    @property
    def reads_velocity(self) -> bool:
        """Whether something reads the velocity of the device as a point sample, or its position
        between two ticks."""
        velocity, sensed = f"{self.device}.v", f"{self.device}.x{AT}"
        terms = [term for sums in self.drawn().sums.values() for term in sums.items()]
        return any(np.any(gain) and (name.startswith((velocity, sensed))) for name, gain in terms)

    @property
    def parts(self) -> dict[str, Any]:
        """The parts of a tick in each of which the force on the device is held: its port in
        each, and its share of the tick."""
        plant = next(
            (plant for plant in self.drawing.plants if plant.members[0].name == self.device), None
        )
        if plant is None or not plant.arriving:
            return {f"{self.device}.f": 1.0}
        ((port, name),) = plant.arriving
        later = self.dead_times()[name].share
        return {port: 1.0 - later, f"{port}{AT}{name}": later}

    def port(self, drawn: MultirateLoop | None = None) -> Port:
        """Return the loops from the hand's forces to the displacements in the tick.

        drawn: the blocks of the loops, if the caller has them.
        """
        with np.errstate(all="ignore"):
            ports = Ports.of_axes(self.drawing)
            return Port.of(drawn or self.drawn(), ports, self.drift(watched=ports.signals))


def held_loop(loops: Loops) -> HeldLoop:
    """Return the loops with a hand."""
    return HeldLoop(*loops.read)


@lru_cache(maxsize=256)
def device_of(drawing: Drawing) -> str | None:
    """Return the mass or inertia that the hand's force acts on, and nothing else, and whose position
    is the displacement of the hand.

    Nothing else acts on it continuously.
    """
    if drawing.hand is None or drawing.further:
        return None
    force, displacement, _ = drawing.hand
    pushed = [(port, dict(terms)[force]) for port, terms in drawing.wires if force in dict(terms)]
    masses = {f"{block.name}.f": block.name for block in drawing.apart if TYPES[block.type].body}
    if len(pushed) != 1 or pushed[0][0] not in masses or not pushed[0][1].is_number(1.0):
        return None
    name = masses[pushed[0][0]]
    (signal, gain), *rest = displacement
    if not rest and signal == f"{name}.x" and gain.is_number(1.0):
        return name
    return None


def device_keys(loop: HeldLoop) -> tuple[Any, Any, Any]:
    """Return mass (kg), damping (N*s/m) and stiffness (N/m) of the device without a hand."""
    block = next(block for block in loop.drawing.blocks if block.name == loop.device)
    keys = dict(block.keys)
    numbers = {**scalars(loop.values), **dict.fromkeys(HAND, 0.0)}
    return tuple(keys[key].values(numbers) for key in _keys_of(block))


@lru_cache(maxsize=64)
def with_hand(drawing: Drawing, device: str, paths: tuple[str, ...]) -> Drawing:
    """Return the drawing whose device has a further mass, damping and stiffness, the numbers
    with these paths."""

    def held(block):
        if block.name != device:
            return block
        added = dict(zip(_keys_of(block), paths, strict=True))
        keys = []
        for name, tree in block.keys:
            keys.append((name, tree + Tree.name(added[name]) if name in added else tree))
        return replace(block, keys=tuple(keys))

    return replace(drawing, blocks=tuple(map(held, drawing.blocks)))


def _keys_of(block: DrawnBlock) -> tuple[str, str, str]:
    """The keys of a body for its mass or inertia, damping and stiffness."""
    return TYPES[block.type].body, "damping", "stiffness"
