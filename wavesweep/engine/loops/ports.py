"""The hand's port of a drawn loop: the names of its signals."""

from dataclasses import dataclass

from wavesweep.engine.drawing.drawing import Drawing
from wavesweep.engine.loops.from_drawing import OUTPUT, POSITION, REACTION


@dataclass(frozen=True, slots=True)
class Ports:
    """The hand's port of a drawn loop: the input `force` (N), and the signals of its position (m) and of the force against it.

    reaction: empty if none is known; then the impedance is that of the whole port, force over position. others: input and
    position of each further port, or axis of the hand, of which no reaction is known.
    """

    force: str
    position: str
    reaction: str = ""
    others: tuple[tuple[str, str], ...] = ()

    @property
    def forces(self) -> list[str]:
        """The inputs of the ports."""
        return [self.force, *(force for force, _ in self.others)]

    @property
    def signals(self) -> tuple[str, ...]:
        """The outputs of the ports."""
        return (self.position, *(position for _, position in self.others), *([self.reaction] if self.reaction else ()))


def hand_of(drawing: Drawing) -> Ports:
    """The signals at the port of a hand that the drawing has."""
    return Ports(drawing.hand[0], POSITION, REACTION if drawing.hand[2] is not None else "")


def axes_of(drawing: Drawing) -> Ports:
    """The signals at the port of a hand with all its axes."""
    further = tuple((force, OUTPUT + name) for name, force, _ in drawing.further)
    return Ports(drawing.hand[0], POSITION, others=further)
