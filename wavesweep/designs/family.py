"""Everything that a design has to hold for: combinations of devices, hands, timings and ratios,
and the walls of a wish."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from math import prod

import numpy as np

from wavesweep.designs.keys import HAND_KEYS, in_order
from wavesweep.engine.drawing import name_of
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.spec import Spec

WALL_STIFFNESS = "environment.K_VE"
# in place of the number of a scenario, if a value is what is proved for all of [for_all]
OF_ALL = -1


@dataclass(frozen=True, slots=True)
class Scenario:
    """Values by path, and ratios: path of a number -> (path of the other one, the first over the
    second)."""

    values: Mapping[str, float | int]
    ratios: Mapping[str, tuple[str, float]]

    def described(self) -> str:
        """Return the scenario in the words of a table; empty if it is the spec's own."""
        texts = [f"{name_of(path)}={value:.12g}" for path, value in self.values.items()]
        texts += [
            f"{number}/{reference}={ratio:g}" for number, (reference, ratio) in self.ratios.items()
        ]
        return ", ".join(texts)


def described(scenarios: Sequence[Scenario], at: int) -> str:
    """Return the words for what sets a worst value: the scenario of that number, or what is
    proved, OF_ALL."""
    if at == OF_ALL:
        return "[for_all]"
    return scenarios[at].described()


def scenarios_of(spec: Spec, between: int = 0) -> list[Scenario]:
    """Return every combination of values that a spec's [design] has to hold for.

    between: number of further values between two neighbouring values of each range; of whole
    numbers all that make a loop are.
    """
    scenarios = []
    for combination in product(*_choices(spec, between)):
        values = {path: value for path, value in combination if not isinstance(value, tuple)}
        scenarios.append(
            Scenario(
                values, {path: value for path, value in combination if isinstance(value, tuple)}
            )
        )
    return scenarios


def count_of(spec: Spec, between: int = 0) -> int:
    """Return the number of `scenarios_of`, without making them."""
    return prod(map(len, _choices(spec, between)))


def _choices(spec, between):
    """Return the choices of each number, as pairs of its path and a value, or of the other path
    and a ratio."""
    choices, design = [], spec.design
    for axis in design.for_all:
        values = _filled(axis.values, between, axis.structural)
        choices.append(
            [
                (axis.path, value)
                for value in values
                if value in axis.values or _makes_a_loop(spec, axis, value)
            ]
        )
    for name in HAND_KEYS:
        if name in design.hand:
            values = _filled(design.hand[name], between, False)
            choices.append([(f"operator.{name}", value) for value in values])
    for number, reference, values in design.ratios:
        choices.append([(number, (reference, value)) for value in _filled(values, between, False)])
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
    if structural:
        return list(range(int(ordered[0]), int(ordered[-1]) + 1))
    pieces = [np.linspace(a, b, between + 2)[:-1] for a, b in pairwise(ordered)]
    return [*np.concatenate(pieces).tolist(), ordered[-1]]


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Designs x scenarios x walls as points; the index of the design changes most slowly.

    changes: path -> value of each point. ties: paths whose value is a factor of the wall's
    stiffness. shape: (designs, scenarios, walls).
    """

    changes: Mapping[str, np.ndarray]
    ties: tuple[str, ...]
    shape: tuple[int, int, int]

    @property
    def size(self) -> int:
        """Number of points."""
        return int(np.prod(self.shape))

    def some(self, index) -> "Points":
        """Return some of the points, each as a design of its own."""
        return Points(
            {path: column[index] for path, column in self.changes.items()},
            self.ties,
            (len(index), 1, 1),
        )

    def worst(self, values, more: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return the worst value of each design, `(designs,)`, and the scenario that has it.

        more: whether larger values are better. A missing value counts as the worst.
        """
        flat = np.reshape(values, (self.shape[0], -1))
        order = np.where(np.isnan(flat), -np.inf, flat if more else -flat)
        at = np.argmin(order, axis=1)
        return flat[np.arange(len(flat)), at], at // self.shape[2]

    def all_of(self, flags) -> np.ndarray:
        """Return whether a flag is set at all points of each design."""
        return np.reshape(flags, (self.shape[0], -1)).all(axis=1)


def points_of(
    own: Mapping[str, object],
    designs: Mapping[str, np.ndarray],
    scenarios: Sequence[Scenario],
    walls: Mapping[str, Sequence[float]],
) -> Points:
    """Return the product of designs, scenarios and walls.

    own: the spec's values. designs: path -> value of each design. walls: path of the wall -> its
    values, all combined.
    """
    count, combinations = len(next(iter(designs.values()))), list(product(*walls.values()))
    shape = (count, len(scenarios), len(combinations))
    design, scenario, wall = (index.reshape(-1) for index in np.indices(shape))
    changes = {path: np.asarray(values)[design] for path, values in designs.items()}
    for path in scenarios[0].values:
        changes[path] = np.array([state.values[path] for state in scenarios])[scenario]
    for path, values in zip(walls, zip(*combinations, strict=True), strict=True):
        changes[path] = np.array(values)[wall]
    ties = []
    for path, reference, _ in in_order(
        [(path, other, None) for path, (other, _) in scenarios[0].ratios.items()]
    ):
        factor = np.array([scenario_ratio.ratios[path][1] for scenario_ratio in scenarios])[
            scenario
        ]
        if reference == WALL_STIFFNESS and reference not in changes:
            ties.append(path)
            changes[path] = factor
        else:
            ties += [path] if reference in ties else []
            changes[path] = factor * changes.get(reference, own[reference])
    return Points(changes, tuple(ties), shape)
