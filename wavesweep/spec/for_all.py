"""What every answer has to hold for, the table [for_all]: numbers that are not known, or vary from frame to frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from wavesweep.errors import Mistake
from wavesweep.spec.axes import Axis, axis_place, build_axis
from wavesweep.spec.checking import Rejected, check, show
from wavesweep.spec.design import Design
from wavesweep.spec.keys import BUILT_IN, Key, Names
from wavesweep.spec.reading import Leaf
from wavesweep.spec.sorting import Sorted

LOST = Key(
    "for_all.lost", "integer", 0, "1", "slow results in a row that may fail to come; the last one is held", low=0, high=16
)
MOST_VARYING = 64  # values of a number that varies


@dataclass(frozen=True, slots=True)
class ForAll:
    """The table [for_all].

    axes: the range or the values of each number. varying: paths of those that may change from frame to frame; the others are
    not known, but constant. lost: so many results of the slow environment in a row may fail to come.
    """

    axes: tuple[Axis, ...]
    varying: frozenset[str] = frozenset()
    lost: int = 0

    @property
    def changing(self) -> tuple[Axis, ...]:
        """The numbers that may be another one in every frame; one of a single value is constant."""
        return tuple(axis for axis in self.axes if axis.path in self.varying and len(values_of_range(axis)) > 1)

    @property
    def unknown(self) -> tuple[Axis, ...]:
        """The numbers that are constant."""
        return tuple(axis for axis in self.axes if axis not in self.changing)

    def ends(self, design: Design) -> tuple[Axis, ...]:
        """The numbers that are constant as axes of [design.for_all], which the search looks at: their ends, or their values.

        Those that the design varies, or holds for already, are none.
        """
        known = {axis.path for axis in (*design.vary, *design.for_all)}
        others = (axis for axis in self.unknown if axis.path not in known)
        return tuple(replace(axis, values=axis.values or (axis.start, axis.stop), scale=None) for axis in others)

    def beside(self, design: Design) -> ForAll:
        """The same, and the values of [design.for_all] for numbers that it does not have itself."""
        known = {axis.path for axis in self.axes}
        hand = ((f"operator.{part}", values) for part, values in design.hand.items())
        axes = [axis for axis in design.for_all if axis.path not in known]
        axes += [Axis(path, path, values, min(values), max(values), False) for path, values in hand if path not in known]
        return replace(self, axes=(*self.axes, *axes))

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        found: dict[str, object] = {axis.name: _written(axis, axis.path in self.varying) for axis in self.axes}
        return found | ({"lost": self.lost} if self.lost else {})


def values_of_range(axis: Axis) -> tuple:
    """The values of a range, those of a whole number one by one."""
    return axis.values or tuple(range(int(axis.start), int(axis.stop) + 1))


def _written(axis, varying):
    range_ = {"values": list(axis.values)} if axis.scale is None else {"start": axis.start, "stop": axis.stop}
    return range_ | ({"varying": True} if varying else {})


def build_for_all(leaves: Sorted, names: Names = BUILT_IN) -> tuple[ForAll | None, list[Mistake]]:
    """Return the table and its mistakes; None if the spec has none."""
    axes, varying, mistakes, lost = [], set(), [], 0
    for name, parts in leaves.axes["for_all"].items():
        axis, varies, wrong = _range(name, dict(parts), names)
        mistakes += wrong
        if axis:
            axes.append(axis)
            varying |= {axis.path} if varies else set()
    if leaves.lost:
        try:
            lost = check(LOST, leaves.lost.value)
        except Rejected as error:
            mistakes.append(leaves.lost.mistake(LOST.path, error.expected, error.found))
    return (ForAll(tuple(axes), frozenset(varying), lost) if axes or lost else None), mistakes


def _range(name: str, parts: dict[str, Leaf], names: Names) -> tuple[Axis | None, bool, list[Mistake]]:
    label, varying = f"for_all.{name}", parts.pop("varying", None)
    if varying is not None and not isinstance(varying.value, bool):
        return None, False, [varying.mistake(f"{label}.varying", "true or false", show(varying.value))]
    varies = bool(varying and varying.value)
    if not parts:
        return None, varies, [varying.mistake(label, "start and stop, or values", "neither", of_key=True)]
    if "values" in parts:
        if len(parts) > 1:
            leaf = Leaf(None, axis_place(parts))
            return None, varies, [leaf.mistake(label, "either start and stop or values", "both", of_key=True)]
        parts = {"": parts["values"]}
    axis, mistakes = build_axis("for_all", name, parts, names)
    if axis and varies and (count := len(values_of_range(axis))) > MOST_VARYING:
        expected = f"at most {MOST_VARYING} values of a number that varies"
        return None, varies, [Leaf(None, axis.place).mistake(label, expected, f"{count}", of_key=True)]
    return axis, varies, mistakes


def refuse_swept(axes: Mapping[str, Axis], for_all: ForAll) -> list[Mistake]:
    """Return a mistake for each number that is swept and has a range to hold for as well; axes: of [sweep], by path."""
    return [
        Leaf(None, axis.place).mistake(
            f"for_all.{axis.name}", "a number that [sweep] does not have as well", axis.name, of_key=True
        )
        for axis in for_all.axes
        if axis.path in axes
    ]
