"""What every answer has to hold for, the table [for_all]: numbers that are unknown, or vary from frame to frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

from wavesweep.core.reading.axes import Axis, axis_place, build_axis
from wavesweep.core.reading.checking import show
from wavesweep.core.reading.keys import Key, gain, whole
from wavesweep.core.reading.tables import Asked, Section, Table

if TYPE_CHECKING:
    from wavesweep.core.spec.schema import Shapes
    from wavesweep.core.spec.studies import Request
    from wavesweep.for_all.design_proof import DesignProof, DesignRanking

LOST = whole("for_all.lost", 0, "slow results in a row that may fail to come; the last one that came is held", 0, 16)
WEIGHT = gain("for_all.shares", None, "1", "how often a value occurs; of several their ratios count", high=1e12)
CHANCES = "shares", "next"  # of values that vary: a weight of each, or a row of weights for what follows each
GUARANTEES = "for_all", "mean_square"  # words in the column `guarantee` of rows that hold for more than the spec's own numbers
MOST_VARYING = 64  # values of a number that varies


@dataclass(frozen=True, slots=True)
class ForAll(Asked):
    """The table [for_all].

    axes: the range or the values of each number. varying: paths of those that may change from frame to frame; the others are
    unknown but constant. lost: how many slow results in a row may fail to come. shares: weights of the values of the number
    that varies, a row if they are independent, or for each value a row of those of the next; empty if none are given.
    """

    members: ClassVar[str] = "[for_all]"
    axes: tuple[Axis, ...]
    varying: frozenset[str] = frozenset()
    lost: int = 0
    shares: tuple[tuple[float, ...], ...] = ()

    @property
    def changing(self) -> tuple[Axis, ...]:
        """The numbers that may change from frame to frame; one with a single value is constant."""
        return tuple(axis for axis in self.axes if axis.path in self.varying and len(values_of_range(axis)) > 1)

    @property
    def unknown(self) -> tuple[Axis, ...]:
        """The numbers that are constant."""
        return tuple(axis for axis in self.axes if axis not in self.changing)

    def apart(self, values: Mapping[str, object]) -> list[str]:
        """The numbers of a spec with these values that the table leaves out, each with its value, as texts."""
        own = ((axis, values[axis.path]) for axis in self.axes)
        return [
            f"{axis.name} = {value:g}"
            for axis, value in own
            if (value not in axis.values if axis.values else not axis.start <= value <= axis.stop)
        ]

    def ends(self, design: Any) -> tuple[Axis, ...]:
        """The numbers that are constant as axes of [design.for_all], which the search looks at: their ends, or their values.

        Numbers that the design varies, or already has to hold for, are left out.
        """
        known = {axis.path for axis in (*design.vary, *design.for_all)}
        others = (axis for axis in self.unknown if axis.path not in known)
        return tuple(replace(axis, values=axis.values or (axis.start, axis.stop), scale=None) for axis in others)

    def beside(self, design: Any) -> ForAll:
        """Return the table with the values of [design.for_all] for the numbers that it does not have itself."""
        known = {axis.path for axis in self.axes}
        hand = ((f"operator.{part}", values) for part, values in design.hand.items())
        axes = [axis for axis in design.for_all if axis.path not in known]
        axes += [Axis(path, path, values, min(values), max(values), False) for path, values in hand if path not in known]
        return replace(self, axes=(*self.axes, *axes))

    def verdict(self, spec: Any) -> str:
        """Whether the loop of a spec with this table is stable for all of it, in words."""
        from wavesweep.for_all.rows import in_words, verdict

        return in_words(verdict(spec))

    def proof(self, spec: Any) -> DesignProof:
        """What proves the designs of a spec with this table."""
        from wavesweep.for_all.design_proof import DesignProof

        return DesignProof.of(spec)

    def ranking(self, spec: Any) -> DesignRanking | None:
        """The same for a search, which takes longer if it proves; None if nothing varies, where it looks at `ends`."""
        from wavesweep.for_all.design_proof import DesignProof, DesignRanking

        rules = DesignProof.of(spec).rules
        return DesignRanking(rules) if rules.vary and not rules.at_random else None

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        table: dict[str, object] = {}
        for axis in self.axes:
            range_ = {"values": list(axis.values)} if axis.scale is None else {"start": axis.start, "stop": axis.stop}
            table[axis.name] = range_ | ({"varying": True} if axis.path in self.varying else {})
            if self.shares and axis in self.changing:
                rows = [list(row) for row in self.shares]
                table[axis.name] |= {"shares": rows[0]} if len(rows) == 1 else {"next": rows}
        return table | ({"lost": self.lost} if self.lost else {})


def values_of_range(axis: Axis) -> tuple:
    """The values of a range, those of a whole number one by one."""
    return axis.values or tuple(range(int(axis.start), int(axis.stop) + 1))


def build(request: Request) -> ForAll | None:
    """Return the table and add its mistakes; None if the spec has none and no channels."""
    axes, varying, chances, mistakes = [], set(), {}, request.mistakes
    for name, given in request.belongs.axes["for_all"].items():
        label, parts, before = f"for_all.{name}", dict(given), len(mistakes)
        place, varies = axis_place(parts), parts.pop("varying", None)
        weights = {part: parts.pop(part) for part in CHANCES if part in parts}
        if varies is not None and not isinstance(varies.value, bool):
            mistakes.refuse(varies, f"{label}.varying", "true or false", show(varies.value), of_key=False)
        elif not parts:
            mistakes.refuse(varies, label, "start and stop, or values", "neither")
        elif "values" in parts and len(parts) > 1:
            mistakes.refuse(place, label, "either start and stop or values", "both")
        elif weights and not ("values" in parts and varies and varies.value):
            mistakes.refuse(place, label, f"values and varying = true beside {' and '.join(weights)}", "others")
        elif len(weights) > 1:
            mistakes.refuse(place, label, "either shares or next", "both")
        if len(mistakes) > before:
            continue
        axis = build_axis("for_all", name, {"": parts["values"]} if "values" in parts else parts, mistakes, request.names)
        if axis and varies and varies.value:
            varying.add(axis.path)
            if (count := len(values_of_range(axis))) > MOST_VARYING:
                mistakes.refuse(axis.place, label, f"at most {MOST_VARYING} values of a number that varies", f"{count}")
        if axis and weights:
            chances[axis.path] = axis, _weights(mistakes, label, *weights.popitem(), len(axis.values))
        axes += [axis] if axis else []
    lost = request.belongs.keys.get("for_all.lost")
    results = mistakes.check(LOST, lost) if lost else 0
    for axis in axes:
        if axis.path in {other.path for other in request.sweep}:
            mistakes.refuse(axis.place, f"for_all.{axis.name}", "a number that [sweep] does not have as well", axis.name)
    request.refuse_beyond_limits("for_all", axes)
    channels = request.drawing and request.drawing.channels
    found = ForAll(tuple(axes), frozenset(varying), results or 0)
    for axis, rows in chances.values():
        if found.lost or channels or axis.path == "environment.delay" or len(found.changing) > 1:
            expected = "lengths of frames as all that varies, where they are at random"
            mistakes.refuse(axis.place, f"for_all.{axis.name}", expected, "more, or another number")
        found = replace(found, shares=rows if found.changing else ())
    return found if axes or results or channels else None


def _weights(mistakes: Any, label: str, part: str, leaf: Any, count: int) -> tuple[tuple[float, ...], ...]:
    """The rows of weights of values; their mistakes are added."""
    rows = [leaf.value] if part == "shares" else leaf.value
    if not isinstance(rows, list) or len(rows) not in (1, count) or (part == "next" and len(rows) != count):
        mistakes.refuse(leaf, f"{label}.{part}", f"{count} lists, one for each value", show(leaf.value), of_key=False)
        return ()
    found = []
    for row in rows:
        weights = mistakes.check_list(WEIGHT, replace(leaf, value=row), f"{label}.{part}", f"a list of {count} weights", count)
        if weights and None not in weights and not any(weights):
            mistakes.refuse(leaf, f"{label}.{part}", "a weight above 0 in each list", "none", of_key=False)
        found.append(tuple(weights))
    return tuple(found)


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table: ranges of numbers, or of any names in a drawn loop."""
    others, lost = False, shapes.value(LOST)
    if shapes.drawn:
        others = shapes.define("range", {"anyOf": [_range(shapes), shapes.table({}, shapes.reference("range"))]})
        lost = {"anyOf": [lost, others]}
    ranges = {name: shapes.define(f"range_of_{key.path}", _range(shapes, key)) for name, key in shapes.numbers.items()}
    return shapes.table(ranges | shapes.nested(ranges) | {"lost": lost}, others)


def _range(shapes: Shapes, key: Key | None = None) -> dict[str, Any]:
    """A range or values of a number, which may vary from frame to frame; key: None for one of a drawn loop."""
    value, varying = shapes.value(key) if key else {"type": "number"}, {"varying": {"type": "boolean"}}
    ends = shapes.table({"start": value, "stop": value, **varying}, required=["start", "stop"])
    weights: dict[str, Any] = {"type": "array", "items": shapes.value(WEIGHT), "minItems": 1}
    chances = {"shares": weights, "next": {"type": "array", "items": weights, "minItems": 1}}
    listed = {"values": {"type": "array", "items": value, "minItems": 1}}
    values = shapes.table(listed | varying | chances, required=["values"])
    about = {"description": shapes.described(key)} if key else {}
    return {"anyOf": [ends, values, values["properties"]["values"]]} | about


TABLE = Table(
    path="for_all",
    build=build,
    sections={"for_all": Section(("lost",), ("start", "stop", "values", "varying", *CHANCES))},
    always=True,
    described={
        "for_all": {
            "description": "what every answer has to hold for: NAME = { start, stop } or { values = [...] } of a number that "
            "is not known, with varying = true of one that may change from frame to frame (rates.ratio, environment.delay, or "
            "the number in every of blocks); shares = [...] of these values, or next = [[...], ...], the shares after each, "
            "for what holds in mean square; lost = slow results in a row that may fail to come; the last one that came is held"
        }
    },
    hint="What every answer has to hold for is in [for_all]: `wavesweep keys for_all`.",
    schema=schema,
)
