"""What every answer has to hold for, the table [for_all]: numbers that are unknown, or vary from
frame to frame."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from wavesweep.engine.drawing import path_of
from wavesweep.engine.keys import Key, Leaf, Mistakes, show
from wavesweep.for_all.asked_ranges import DELAY, ForAllRanges
from wavesweep.program.reading.axes import Axis, axis_place, build_axis
from wavesweep.program.reading.keys import BAND_EDGES, MOST_VARYING
from wavesweep.program.reading.tables import Section, SpecTable
from wavesweep.program.spec.resolving import is_frame

if TYPE_CHECKING:
    from types import ModuleType

    from wavesweep.for_all.design_proof import DesignProof, DesignRanking
    from wavesweep.program.spec.schema import Shapes
    from wavesweep.program.spec.studies import Request

LOST = Key.whole(
    "for_all.lost",
    0,
    "slow results in a row that may fail to come; the last one that came is held",
    0,
    16,
)
LOSS = Key.gain(
    "for_all.loss",
    0.0,
    "1",
    "probability that a slow result never comes; the last one that came is held",
    high=1.0,
)
WEIGHT = Key.gain(
    "for_all.shares",
    None,
    "1",
    "how often a value occurs; of several their ratios count",
    high=1e12,
)
ROWS = Key.several(
    Key.several(WEIGHT), description="for each value how often which value comes after it"
)
# Parts of a number that varies; those of CHANCES say how often which of its values occurs.
PARTS = {
    "varying": Key(
        "varying", "boolean", False, "", "whether the number may change from frame to frame"
    ),
    "shares": Key.several(WEIGHT),
    "next": ROWS,
}
CHANCES = ("shares", "next")


class ForAll(ForAllRanges):
    """The table [for_all], and what proves that a loop holds for all of it."""

    __slots__ = ()

    @property
    def boxes(self) -> ModuleType:
        """What margins ask of all loops of a box of numbers; see `wavesweep.for_all.boxes`."""
        from wavesweep.for_all import boxes

        return boxes

    def verdict(self, spec: Any) -> str:
        """Whether the loop of a spec with this table is stable for all of it, in words."""
        from wavesweep.for_all.rows import claim
        from wavesweep.for_all.varying import Rules
        from wavesweep.program.analyses.claim_words import in_words

        claimed, _ = claim(spec, Rules.of(spec))
        return in_words(claimed)

    def proof(self, spec: Any) -> DesignProof:
        """What proves the designs of a spec with this table."""
        from wavesweep.for_all.design_proof import DesignProof

        return DesignProof.of(spec)

    def ranking(self, spec: Any) -> DesignRanking | None:
        """The same for a search, which takes longer if it proves; None if nothing varies, where
        it looks at `ends`."""
        from wavesweep.for_all.design_proof import DesignProof, DesignRanking

        rules = DesignProof.of(spec).rules
        if rules.vary and not rules.at_random:
            return DesignRanking(rules)
        return None


@dataclass(frozen=True, slots=True)
class AskedNumber:
    """A number of [for_all]: its range or its values, and whether it varies from frame to frame.

    chances: how often which of the values occurs, "shares" or "next"; empty without. weights: the
    leaf of these.
    """

    axis: Axis
    varies: bool
    chances: str = ""
    weights: Leaf | None = None

    @property
    def label(self) -> str:
        """Its path in the spec."""
        return f"for_all.{self.axis.name}"


def build(request: Request) -> ForAll | None:
    """Return the table and add its mistakes; None if the spec has none and no channels."""
    numbers = []
    for name, parts in request.belongs.axes["for_all"].items():
        number = _number(request, name, parts)
        if number:
            numbers.append(number)
    axes = tuple(number.axis for number in numbers)
    lost = _losses(request, LOST)
    loss = _losses(request, LOSS)
    _refuse_what_is_swept(request, axes)
    request.refuse_beyond_limits("for_all", axes)
    _refuse_what_others_follow_from(request, axes)
    _refuse_what_cannot_vary(request, [asked for asked in numbers if asked.varies])
    _refuse_frames_below_delays(request, [asked.axis for asked in numbers if not asked.varies])
    varying = frozenset(number.axis.path for number in numbers if number.varies)
    table = _with_chances(request, ForAll(axes, varying, lost, loss=loss), numbers)
    channels = request.drawing.channels if request.drawing else ()
    if axes or lost or loss or channels:
        return table
    return None


def _number(request: Request, name: str, parts: Mapping[str, Leaf]) -> AskedNumber | None:
    """The number of [for_all] with these parts; None, and its mistakes, if they do not fit."""
    mistakes = request.mistakes
    place = axis_place(parts)
    label = f"for_all.{name}"
    varying = parts.get("varying")
    if varying:
        varies = mistakes.check(PARTS["varying"], varying, f"{label}.varying")
    else:
        varies = False
    if varies is None:
        return None
    fault = _fault_of_parts(name, parts.keys(), varies)
    if fault:
        mistakes.refuse(place, label, *fault)
        return None
    ends = {part: leaf for part, leaf in parts.items() if part not in PARTS}
    if "values" in ends:  # as an axis has them
        ends = {"": ends["values"]}
    elif "stop" in ends and "start" in ends and ends["start"].value == ends["stop"].value:
        ends = {"": replace(ends["start"], value=[ends["start"].value])}
    axis = build_axis("for_all", name, ends, mistakes, request.names)
    if axis is None:
        return None
    if len(set(axis.values)) < len(axis.values):
        text_found = ", ".join(f"{value:g}" for value in axis.values)
        mistakes.refuse(axis.place, label, "values that differ", text_found)
    if varies:
        count = len(axis.choices)
        if count > MOST_VARYING:
            expected = (
                f"at most {MOST_VARYING} values of a number that varies, such as "
                "values = [16, 18, 20] with steps of 2 in place of a range"
            )
            mistakes.refuse(axis.place, label, expected, f"{count}")
    for part in CHANCES:
        if part in parts:
            return AskedNumber(axis, varies, part, parts[part])
    return AskedNumber(axis, varies)


def _fault_of_parts(name: str, parts: Collection[str], varies: bool) -> tuple[str, str] | None:
    """What is expected of the parts of a number, and what is there instead; None if they fit."""
    chances = [part for part in CHANCES if part in parts]
    ends = [part for part in parts if part not in PARTS]
    if not ends:
        return "start and stop, or values", "neither"
    if "values" in ends and len(ends) > 1:
        return "either start and stop or values", "both"
    if "next" in chances and name == DELAY:
        return "shares of delays, or a list of them for each length of frames", "next"
    if chances and not ("values" in ends and varies):
        return f"values and varying = true beside {' and '.join(chances)}", "others"
    if len(chances) > 1:
        return "either shares or next", "both"
    return None


def _losses(request: Request, key: Key) -> Any:
    """The value of `lost` or of `loss`, 0 without it, which a drawn loop may not have."""
    leaf = request.belongs.keys.get(key.path)
    number = request.mistakes.check(key, leaf) if leaf else 0
    if number and request.drawn:
        expected = "no lost or loss beside a drawn loop, whose channels say what is lost"
        request.mistakes.refuse(leaf, key.path, expected, f"{number:g}")
    return number or 0


def _refuse_what_is_swept(request: Request, axes: Iterable[Axis]) -> None:
    """Add the mistakes of numbers that are axes of [sweep] as well."""
    swept = {axis.name for axis in request.sweep}  # one by another name is a mistake already
    for axis in axes:
        if axis.name in swept:
            expected = "a number that [sweep] does not have as well"
            request.mistakes.refuse(axis.place, f"for_all.{axis.name}", expected, axis.name)


def _refuse_what_others_follow_from(request: Request, axes: Iterable[Axis]) -> None:
    """Add the mistakes of axes from which other numbers follow: of slow_hz the ratio does, of a
    band's edges the order and cutoff_hz, of fast_hz beside one of these as well.

    A case changes the numbers of its axes alone: what follows from them would stay.
    """
    request.refuse_other_edges("for_all", axes)
    leaves = request.given.leaves
    edges = [path for path in leaves if path.rpartition(".")[2] in BAND_EDGES]
    of_fast_rate = [path for path in ("rates.slow_hz", *edges) if path in leaves]
    for axis in axes:
        name_found = axis.name
        if axis.path == "rates.slow_hz":
            expected = "rates.ratio = { values = [...] }, the fast ticks in a frame"
        elif axis.path in edges:
            expected = "a filter by its order and cutoff_hz, and one of these"
        elif axis.path == "rates.fast_hz" and of_fast_rate:
            expected = "beside several fast rates a ratio in place of slow_hz, and filters by order and cutoff_hz"
            name_found = of_fast_rate[0]
        else:
            continue
        request.mistakes.refuse(axis.place, f"for_all.{axis.name}", expected, name_found)


def _refuse_what_cannot_vary(request: Request, numbers: Iterable[AskedNumber]) -> None:
    """Add the mistakes of numbers that vary and are neither lengths of frames nor delays."""
    if request.drawing:
        may_vary = {path_of(name) for block in request.drawing.blocks for name in block.every.names}
        expected = "one number that varies, which `every` of blocks reads"
    elif not request.drawn:
        may_vary = {"rates.ratio", DELAY}
        expected = "rates.ratio or environment.delay as numbers that vary"
    else:  # a drawing with mistakes of its own
        return
    for index, number in enumerate(numbers):
        if number.axis.path not in may_vary or (request.drawing and index):
            request.mistakes.refuse(number.axis.place, number.label, expected, number.axis.name)


def _refuse_frames_below_delays(request: Request, axes: Iterable[Axis]) -> None:
    """Add the mistake of a delay that is longer than a frame, where both are constant and
    [for_all] has the frame."""
    by_path = {axis.path: axis for axis in axes}
    ratio = by_path.get("rates.ratio")
    delay = by_path.get(DELAY)
    if ratio is None or request.values is None or (delay is None and is_frame(request.given)):
        return
    longest = delay.stop if delay else request.values[DELAY]
    if longest > ratio.start:
        expected = f"frames of at least {longest:g} ticks (environment.delay)"
        request.mistakes.refuse(ratio.place, f"for_all.{ratio.name}", expected, show(ratio.start))


def _with_chances(request: Request, table: ForAll, numbers: Iterable[AskedNumber]) -> ForAll:
    """Return the table with the weights of values, and add their mistakes. numbers: of it."""
    leaves = request.belongs.keys
    mistakes = request.mistakes
    lengths = [axis for axis in table.changing if axis.path != DELAY]
    frames = len(lengths[0].choices) if lengths else 1
    for number in numbers:
        if not number.chances or number.axis not in table.changing:
            continue
        weights = _weights(mistakes, number, frames)
        if number.axis.path == DELAY:
            table = replace(table, delays=weights)
        else:
            table = replace(table, shares=weights)
    if not table.at_random:
        return table
    if table.lost:
        expected = "loss = PROBABILITY where what varies is at random"
        mistakes.refuse(leaves[LOST.path], LOST.path, expected, show(table.lost), of_key=False)
    for number in numbers:
        if number.axis in table.changing and not number.chances:
            expected = "shares beside values of each number that varies, where one is at random"
            mistakes.refuse(number.axis.place, number.label, expected, "none")
    return table


def _weights(mistakes: Mistakes, number: AskedNumber, frames: int) -> tuple[tuple[float, ...], ...]:
    """The rows of weights of the values of a number; their mistakes are added. frames: number of
    lengths of frames."""
    leaf = number.weights
    path = f"{number.label}.{number.chances}"
    in_rows = isinstance(leaf.value, list) and bool(leaf.value) and isinstance(leaf.value[0], list)
    after_each = number.chances == "next"
    count = len(number.axis.values)
    expected_row = f"a list of {count} weights"
    if in_rows and not after_each and number.axis.path != DELAY:
        mistakes.refuse(leaf, path, expected_row, "a list of lists", of_key=False)
        return ()
    if (after_each and not in_rows) or (in_rows and len(leaf.value) != frames):
        expected = f"{frames} lists, one for each {'value' if after_each else 'length of frames'}"
        mistakes.refuse(leaf, path, expected, show(leaf.value), of_key=False)
        return ()
    rows = []
    for row in leaf.value if in_rows else [leaf.value]:
        listed = replace(leaf, value=row)
        weights = mistakes.check_list(WEIGHT, listed, path, expected_row, count)
        if weights and None not in weights and not any(weights):
            mistakes.refuse(leaf, path, "a weight above 0 in each list", "none", of_key=False)
        rows.append(tuple(weights))
    return tuple(rows)


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table: ranges of numbers, or of any names in a drawn loop."""
    ranges: dict[str, Any] = {}
    for name, key in shapes.numbers.items():
        ranges[name] = shapes.define(f"range_of_{key.path}", _range(shapes, key))
    losses = {key.path.removeprefix("for_all."): shapes.value(key) for key in (LOST, LOSS)}
    of_any_name = False
    if shapes.drawn:
        named = shapes.table({}, shapes.reference("range"))
        of_any_name = shapes.define("range", {"anyOf": [_range(shapes), named]})
        losses = {name: {"anyOf": [shape, of_any_name]} for name, shape in losses.items()}
    return shapes.table(ranges | shapes.nested(ranges) | losses, of_any_name)


def _range(shapes: Shapes, key: Key | None = None) -> dict[str, Any]:
    """A range or values of a number, which may vary from frame to frame; key: None for one of a
    drawn loop."""
    value = shapes.value(key) if key else {"type": "number"}
    parts = {name: shapes.value(part) for name, part in PARTS.items()}
    varying = {"varying": parts["varying"]}
    ends = shapes.table({"start": value, "stop": value, **varying}, required=["start", "stop"])
    if key and key.path == DELAY:
        parts["shares"] = {"anyOf": [parts["shares"], shapes.value(Key.several(PARTS["shares"]))]}
    values = {"type": "array", "items": value, "minItems": 1}
    listed = shapes.table({"values": values, **parts}, required=["values"])
    about = {"description": shapes.described(key)} if key else {}
    return {"anyOf": [ends, listed, values]} | about


TABLE = SpecTable(
    path="for_all",
    build=build,
    sections={"for_all": Section(("lost", "loss"), ("start", "stop", "values", *PARTS))},
    always=True,
    members=True,
    described={
        "for_all": {
            "description": "what every answer has to hold for: NAME = { start, stop } or { values = [...] } of a number that "
            "is not known, with varying = true of one that may change from frame to frame (rates.ratio, environment.delay, or "
            "the number in every of blocks); shares = [...] of these values, or next = [[...], ...], the shares after each, "
            "for what holds in mean square; lost = slow results in a row that may fail to come, or loss = the probability that "
            "one never comes; the last one that came is held; contact = true for every wall that pushes and never pulls; "
            "tick = { late } for fast ticks that take another time each time"
        }
    },
    hint="What every answer has to hold for is in [for_all]: `wavesweep keys for_all`.",
    schema=schema,
)
