"""What every answer has to hold for, the table [for_all]: numbers that are unknown, or vary from
frame to frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wavesweep.engine.keys import Key, show
from wavesweep.for_all.asked_ranges import DELAY, ForAllRanges, values_of_range
from wavesweep.program.reading.axes import Axis, axis_place, build_axis
from wavesweep.program.reading.keys import BAND_EDGES
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
CHANCES = (
    "shares",
    "next",
)  # of values that vary: a weight of each, or a row of weights for what follows each
MOST_VARYING = 64  # values of a number that varies


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

        known, _ = claim(spec, Rules.of(spec))
        return known.words()

    def proof(self, spec: Any) -> DesignProof:
        """What proves the designs of a spec with this table."""
        from wavesweep.for_all.design_proof import DesignProof

        return DesignProof.of(spec)

    def ranking(self, spec: Any) -> DesignRanking | None:
        """The same for a search, which takes longer if it proves; None if nothing varies, where
        it looks at `ends`."""
        from wavesweep.for_all.design_proof import DesignProof, DesignRanking

        rules = DesignProof.of(spec).rules
        return DesignRanking(rules) if rules.vary and not rules.at_random else None


def build(request: Request) -> ForAll | None:
    """Return the table and add its mistakes; None if the spec has none and no channels."""
    axes, varying, chances, mistakes = [], set(), {}, request.mistakes
    for name, given in request.belongs.axes["for_all"].items():
        label, parts, before = f"for_all.{name}", dict(given), len(mistakes)
        place, varies = axis_place(parts), parts.pop("varying", None)
        weights = {part: parts.pop(part) for part in CHANCES if part in parts}
        if varies is not None and not isinstance(varies.value, bool):
            mistakes.refuse(
                varies, f"{label}.varying", "true or false", show(varies.value), of_key=False
            )
        elif not parts:
            mistakes.refuse(varies, label, "start and stop, or values", "neither")
        elif "values" in parts and len(parts) > 1:
            mistakes.refuse(place, label, "either start and stop or values", "both")
        elif "next" in weights and name == DELAY:
            mistakes.refuse(
                place,
                label,
                "shares of delays, or a list of them for each length of frames",
                "next",
            )
        elif weights and not ("values" in parts and varies and varies.value):
            mistakes.refuse(
                place, label, f"values and varying = true beside {' and '.join(weights)}", "others"
            )
        elif len(weights) > 1:
            mistakes.refuse(place, label, "either shares or next", "both")
        if len(mistakes) > before:
            continue
        axis = build_axis(
            "for_all",
            name,
            {"": parts["values"]} if "values" in parts else parts,
            mistakes,
            request.names,
        )
        if axis and len(set(axis.values)) < len(axis.values):
            mistakes.refuse(
                axis.place,
                label,
                "values that differ",
                ", ".join(f"{value:g}" for value in axis.values),
            )
        if axis and varies and varies.value:
            varying.add(axis.path)
            if (count := len(values_of_range(axis))) > MOST_VARYING:
                mistakes.refuse(
                    axis.place,
                    label,
                    f"at most {MOST_VARYING} values of a number that varies",
                    f"{count}",
                )
        if axis and weights:
            chances[axis.path] = axis, label, *weights.popitem()
        axes += [axis] if axis else []
    given = request.belongs.keys
    lost, loss = (
        mistakes.check(key, given[key.path]) or 0 if key.path in given else 0
        for key in (LOST, LOSS)
    )
    if request.drawn:
        expected = "no lost or loss beside a drawn loop, whose channels say what is lost"
        for key, number in ((LOST, lost), (LOSS, loss)):
            if number:
                mistakes.refuse(given[key.path], key.path, expected, f"{number:g}")
    for axis in axes:
        if axis.path in {other.path for other in request.sweep}:
            mistakes.refuse(
                axis.place,
                f"for_all.{axis.name}",
                "a number that [sweep] does not have as well",
                axis.name,
            )
    request.refuse_beyond_limits("for_all", axes)
    _refuse_what_others_follow_from(request, axes)
    _refuse_frames_below_delays(request, [axis for axis in axes if axis.path not in varying])
    found = _with_chances(
        request, ForAll(tuple(axes), frozenset(varying), lost, loss=loss), chances
    )
    return found if axes or lost or loss or (request.drawing and request.drawing.channels) else None


def _refuse_what_others_follow_from(request: Request, axes: Iterable[Axis]) -> None:
    """Add the mistakes of numbers from which others follow: a case has its own numbers in their
    places, and no more."""
    request.refuse_other_edges("for_all", axes)
    given = request.given.leaves
    edges = [path for path in given if path.rpartition(".")[2] in BAND_EDGES]
    for axis in axes:
        expected, found = "", axis.name
        if axis.path == "rates.slow_hz":
            expected = "rates.ratio = { values = [...] }, the fast ticks in a frame"
        elif axis.path.rpartition(".")[2] in BAND_EDGES and axis.path in edges:
            expected = "a filter by its order and cutoff_hz, and one of these"
        elif axis.path == "rates.fast_hz" and (
            others := [path for path in ("rates.slow_hz", *edges) if path in given]
        ):
            expected = "beside several fast rates a ratio in place of slow_hz, and filters by order and cutoff_hz"
            found = others[0]
        if expected:
            request.mistakes.refuse(axis.place, f"for_all.{axis.name}", expected, found)


def _refuse_frames_below_delays(request: Request, axes: Iterable[Axis]) -> None:
    """Add the mistake of a delay that is longer than a frame, where both are constant and
    [for_all] has the frame."""
    known = {axis.path: axis for axis in axes}
    ratio, delay = known.get("rates.ratio"), known.get(DELAY)
    if ratio is None or request.values is None or (delay is None and is_frame(request.given)):
        return
    shortest = min(values_of_range(ratio))
    longest = max(values_of_range(delay)) if delay else request.values[DELAY]
    if longest > shortest:
        expected = f"frames of at least {longest:g} ticks (environment.delay)"
        request.mistakes.refuse(ratio.place, f"for_all.{ratio.name}", expected, show(shortest))


def _with_chances(request: Request, found: ForAll, chances: Mapping[str, tuple]) -> ForAll:
    """Return the table with the weights of values, and add their mistakes. chances: by path
    axis, label, part and leaf."""
    given, mistakes = request.belongs.keys, request.mistakes
    lengths = next((len(values_of_range(axis)) for axis in found.changing if axis.path != DELAY), 1)
    rows = {
        DELAY if axis.path == DELAY else "": _weights(
            mistakes, label, part, leaf, len(axis.values), lengths
        )
        for axis, label, part, leaf in chances.values()
        if axis in found.changing
    }
    found = replace(found, shares=rows.get("", ()), delays=rows.get(DELAY, ()))
    if found.at_random and found.lost:
        expected = "loss = PROBABILITY where what varies is at random"
        mistakes.refuse(
            given["for_all.lost"], "for_all.lost", expected, show(found.lost), of_key=False
        )
    for axis in found.changing if found.at_random else ():
        if axis.path not in chances:
            expected = "shares beside values of each number that varies, where one is at random"
            mistakes.refuse(axis.place, f"for_all.{axis.name}", expected, "none")
    return found


def _weights(
    mistakes: Any, label: str, part: str, leaf: Any, count: int, lengths: int
) -> tuple[tuple[float, ...], ...]:
    """The rows of weights of values; their mistakes are added. lengths: of frames."""
    several = isinstance(leaf.value, list) and bool(leaf.value) and isinstance(leaf.value[0], list)
    rows = leaf.value if several else [leaf.value]
    may_be_several = part == "next" or (several and label.endswith(DELAY))
    if several != may_be_several or (several and len(rows) != lengths):
        lists = f"{lengths} lists, one for each {'value' if part == 'next' else 'length of frames'}"
        mistakes.refuse(leaf, f"{label}.{part}", lists, show(leaf.value), of_key=False)
        return ()
    found = []
    for row in rows:
        weights = mistakes.check_list(
            WEIGHT, replace(leaf, value=row), f"{label}.{part}", f"a list of {count} weights", count
        )
        if weights and None not in weights and not any(weights):
            mistakes.refuse(
                leaf, f"{label}.{part}", "a weight above 0 in each list", "none", of_key=False
            )
        found.append(tuple(weights))
    return tuple(found)


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table: ranges of numbers, or of any names in a drawn loop."""
    others, own = False, {"lost": shapes.value(LOST), "loss": shapes.value(LOSS)}
    if shapes.drawn:
        others = shapes.define(
            "range", {"anyOf": [_range(shapes), shapes.table({}, shapes.reference("range"))]}
        )
        own = {name: {"anyOf": [each, others]} for name, each in own.items()}
    ranges = {
        name: shapes.define(f"range_of_{key.path}", _range(shapes, key))
        for name, key in shapes.numbers.items()
    }
    return shapes.table(ranges | shapes.nested(ranges) | own, others)


def _range(shapes: Shapes, key: Key | None = None) -> dict[str, Any]:
    """A range or values of a number, which may vary from frame to frame; key: None for one of a
    drawn loop."""
    value, varying = (
        shapes.value(key) if key else {"type": "number"},
        {"varying": {"type": "boolean"}},
    )
    ends = shapes.table({"start": value, "stop": value, **varying}, required=["start", "stop"])
    weights: dict[str, Any] = {"type": "array", "items": shapes.value(WEIGHT), "minItems": 1}
    rows = {"type": "array", "items": weights, "minItems": 1}
    chances = {
        "shares": {"anyOf": [weights, rows]} if key and key.path == DELAY else weights,
        "next": rows,
    }
    listed = {"values": {"type": "array", "items": value, "minItems": 1}}
    values = shapes.table(listed | varying | chances, required=["values"])
    about = {"description": shapes.described(key)} if key else {}
    return {"anyOf": [ends, values, values["properties"]["values"]]} | about


TABLE = SpecTable(
    path="for_all",
    build=build,
    sections={
        "for_all": Section(("lost", "loss"), ("start", "stop", "values", "varying", *CHANCES))
    },
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
