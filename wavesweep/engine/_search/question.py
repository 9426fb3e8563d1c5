"""What a search for stable intervals is asked, and the slices that it is asked about."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wavesweep.engine._drawing.drawing import name_of
from wavesweep.engine._search.open_loops import FindPort, Opened
from wavesweep.engine._stability.intervals import Intervals
from wavesweep.engine.loop import Loops


class RequiredRegion(Protocol):
    """Where the eigenvalues of a drawing's frame have to be; without a bound, within the unit
    circle.

    The search takes a bound on their size as the unit circle of frames over its radius. What else
    is bounded has a search of its own, `intervals`, beside it. cost: s per slice of that search, 0
    without one. on_radius: the bounds on the size alone; None if there are none. on_circle: whether a
    mode that meets its bound is on the circle of that radius. gains: those of the whole loop that
    are bounded too. of_modes: what is required of eigenvalues alone; None if nothing is.
    """

    cost: float
    on_radius: "RequiredRegion | None"
    on_circle: bool
    gains: tuple[Any, ...]
    of_modes: "RequiredRegion | None"

    def over(self, frames: float) -> "RequiredRegion":
        """The same for so many frames in place of one."""

    def radius_of(self, period: np.ndarray) -> np.ndarray:
        """The radius of loops with these periods of a frame, in s. Errors: UsageError if it is
        too small."""

    def logarithms(self, period: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """The logarithms of eigenvalues of that frequency (rad/s) that just meet a bound, `(...,
        bounds)`."""

    def intervals(self, frames: Any, span: tuple[float, float]) -> Intervals:
        """All intervals in which eigenvalues are where they have to be, apart from their size;
        frames: `FramesAlong` the number."""

    def within_gain(
        self, gain: Any, frames: Any, span: tuple[float, float], stable: Intervals
    ) -> Intervals:
        """All intervals along a number in which one of the gains is within its bound, as far as
        they are in `stable`.

        An omega at an end that the gain sets has a minus.
        """

    def method(self, on_circle: str) -> str:
        """How the intervals are found, in a line; on_circle: how those of the unit circle are."""

    def refuse_rates(self, name: str) -> None:
        """Raise UsageError if no intervals can be found along the number `name`, which changes
        the time of a frame."""


# From loops, the path of a number and the periods of their frames (s) to what
# `tiles.proved_by_balls` asks; None: no prover.
Prover = Callable[[Loops, str, np.ndarray], Callable[..., Any] | None]


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """Where along the number with the path `along`, within span = (low, high), loops are stable.

    prover: is asked about columns in doubt. bound: on the eigenvalues of a frame, in place of the
    unit circle. find_port: of a port that loops without the number are to show, see `open_loops`.
    """

    along: str
    span: tuple[float, float]
    prover: Prover | None = None
    bound: RequiredRegion | None = None
    find_port: FindPort | None = None

    @property
    def number(self) -> str:
        """Name of the number in the drawing."""
        return name_of(self.along)


@dataclass(frozen=True, slots=True, eq=False)
class Slices:
    """The loops of `size` slices; opened: the same without the number, None if it is not one
    scalar gain of a frame."""

    loops: Loops
    size: int
    opened: Opened | None = None


# Finds the intervals of the slices by the methods that come after one.
Rest = Callable[[Question, Slices], Intervals]
