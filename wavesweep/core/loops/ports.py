"""The hand's port of a drawn loop: the names of its signals."""

from dataclasses import dataclass

from wavesweep.core.drawing.drawing import Drawing
from wavesweep.core.loops.from_drawing import POSITION, REACTION


@dataclass(frozen=True, slots=True)
class Ports:
    """The hand's port of a drawn loop: the input `force` (N), and the signals of its position (m) and of the force against it.

    reaction: empty if none is known; then the impedance is that of the whole port, force over position. other: input and
    position of a second port, of which no reaction is known.
    """

    force: str
    position: str
    reaction: str = ""
    other: tuple[str, str] | None = None

    @property
    def forces(self) -> list[str]:
        """The inputs of the ports."""
        return [self.force, *(self.other or ())[:1]]

    @property
    def signals(self) -> tuple[str, ...]:
        """The outputs of the ports."""
        return (self.position, *(self.other or ())[1:], *([self.reaction] if self.reaction else ()))


def hand_of(drawing: Drawing) -> Ports:
    """The signals at the port of a hand that the drawing has."""
    return Ports(drawing.hand[0], POSITION, REACTION if drawing.hand[2] is not None else "")


def feels(drawing: Drawing) -> bool:
    """Whether a loop has a hand that may feel a wall."""
    return bool(drawing.hand and drawing.wall)
