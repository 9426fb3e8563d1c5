"""Everything that a design has to hold for: combinations of the numbers of [for_all], and the
walls of a wish."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from math import prod

import numpy as np

from wavesweep.engine.drawing import name_of
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.spec import Spec

# in place of the number of a scenario, if a value is what is proved for all of [for_all]
OF_ALL = -1

Scenario = Mapping[str, float | int]
"""Values of numbers by their paths."""


def described(scenarios: Sequence[Scenario], index: int) -> str:
    """Return the words for what sets a worst value: the scenario of that number, empty if it is the
    spec's own, or what is proved, OF_ALL."""
    if index == OF_ALL:
        return "[for_all]"
    return ", ".join(f"{name_of(path)}={value:.12g}" for path, value in scenarios[index].items())


def scenarios_of(spec: Spec, between: int = 0) -> list[Scenario]:
    """Return every combination of values that a spec's designs are tried with.

    between: number of further values between two neighbouring values of each range or list; of
    whole numbers all that make a loop are.
    """
    return [dict(combination) for combination in product(*_choices(spec, between))]


def count_of(spec: Spec, between: int = 0) -> int:
    """Return the number of `scenarios_of`, without making them."""
    return prod(map(len, _choices(spec, between)))


def frames_are_tried(spec: Spec) -> bool:
    """Whether designs are tried with each number that varies from frame to frame as a constant one.

    It is a member of what they have to hold for then, unless steps are those of a frame of the
    spec's own length. What is proved of walls needs no such members.
    """
    of_frames = [
        wish for wish in spec.design.wishes if wish.word != "z_width" and not wish.kind.reads
    ]
    channels = spec.drawing and spec.drawing.channels
    return bool(of_frames) and spec.step == "elapsed" and not channels


def _choices(spec, between):
    """Return the choices of each number, as pairs of its path and a value."""
    choices = []
    if not spec.for_all:
        return choices
    for axis in spec.for_all.axes:
        values = axis.values or (axis.start, axis.stop)
        if axis not in spec.for_all.changing:
            filled = _filled(values, between, axis.structural)
        elif not frames_are_tried(spec):
            continue
        elif axis.values:  # frames between these are none of the set
            filled = values
        else:
            filled = _filled(values, between, True)
        pairs = []
        for value in filled:
            if value in values or _makes_a_loop(spec, axis, value):
                pairs.append((axis.path, value))
        choices.append(pairs)
    return choices


def _makes_a_loop(spec, axis, value):
    """Whether a value between those of the axis suits the spec, as the steps of a delay that are
    half of it do."""
    if not axis.structural:
        return True
    try:
        return bool(spec.with_values({axis.path: value}))
    except (UsageError, SpecError):
        return False


def _filled(values, between, structural):
    """Return the values, with `between` further ones between each two neighbours, or all whole
    numbers."""
    ordered = sorted(set(values))
    if not between or len(ordered) < 2:
        return ordered
    if structural and not all(value == int(value) for value in ordered):
        return ordered
    if structural:
        return list(range(int(ordered[0]), int(ordered[-1]) + 1))
    pieces = [np.linspace(a, b, between + 2)[:-1] for a, b in pairwise(ordered)]
    return [*np.concatenate(pieces).tolist(), ordered[-1]]


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Designs x scenarios x walls as points; the index of the design changes most slowly.

    changes: path -> value of each point. shape: (designs, scenarios, walls).
    """

    changes: Mapping[str, np.ndarray]
    shape: tuple[int, int, int]

    @property
    def size(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape))

    def some(self, index) -> "Points":
        """Return some of the points, each as a design of its own."""
        changes = {path: column[index] for path, column in self.changes.items()}
        return Points(changes, (len(index), 1, 1))

    def worst(self, values, more: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return the worst value of each design, `(designs,)`, and the scenario that has it.

        more: whether larger values are better. A missing value counts as the worst.
        """
        flat = np.reshape(values, (self.shape[0], -1))
        order = np.where(np.isnan(flat), -np.inf, flat if more else -flat)
        worst_place = np.argmin(order, axis=1)
        return flat[np.arange(len(flat)), worst_place], worst_place // self.shape[2]

    def all_of(self, flags) -> np.ndarray:
        """Return whether a flag is set at all points of each design."""
        return np.reshape(flags, (self.shape[0], -1)).all(axis=1)


def points_of(
    designs: Mapping[str, np.ndarray],
    scenarios: Sequence[Scenario],
    walls: Mapping[str, Sequence[float]],
) -> Points:
    """Return the product of designs, scenarios and walls.

    designs: path -> value of each design. walls: path of the wall -> its values, all combined.
    """
    count, combinations = len(next(iter(designs.values()))), list(product(*walls.values()))
    shape = (count, len(scenarios), len(combinations))
    design, scenario, wall = (index.reshape(-1) for index in np.indices(shape))
    changes = {path: np.asarray(values)[design] for path, values in designs.items()}
    for path in scenarios[0]:
        changes[path] = np.array([values[path] for values in scenarios])[scenario]
    for path, values in zip(walls, zip(*combinations, strict=True), strict=True):
        changes[path] = np.array(values)[wall]
    return Points(changes, shape)
