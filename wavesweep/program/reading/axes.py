"""The axes of a sweep: the values or the span of each key, and their spacing."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from wavesweep.engine.keys import Key, Leaf, Mistakes, Names, Place, Rejected, check, show
from wavesweep.program.reading.keys import AXIS_KEYS, BUILT_IN
from wavesweep.program.reading.tables import study_keys


def linear(start: float, stop: float, num: int) -> tuple[float, ...]:
    """Return the values of `numpy.linspace(start, stop, num)`, bit for bit; both ends are exact."""
    if num == 1:
        return (start,)
    step = (stop - start) / (num - 1)
    return (*(i * step + start for i in range(num - 1)), stop)


def logarithmic(start: float, stop: float, num: int) -> tuple[float, ...]:
    """Return the values of `numpy.geomspace(start, stop, num)`, for 0 < start <= stop; both ends
    are exact.

    Accuracy: the two differ by the rounding of exponents, a few ulp times `log(10)*|log10(value)|`,
    because numpy has logarithms and powers of its own.
    """
    if num == 1:
        return (start,)
    exponents = linear(math.log10(start), math.log10(stop), num)[1:-1]
    return (start, *(min(max(10.0**exponent, start), stop) for exponent in exponents), stop)


SPACINGS = {"linear": linear, "log": logarithmic}


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis: `values` in order (empty if only the span is given), `start` and `stop` the span or
    the extremes.

    `name` is the name in the spec, and that of the column; `path` is the path of the key. If
    `structural` is true, a value has to go through `Spec.with_values`; otherwise an array of floats
    may replace `values[path]`.
    """

    name: str
    path: str
    values: tuple[float | int, ...]
    start: float | int
    stop: float | int
    structural: bool
    scale: str | None = None
    place: Place = field(default=Place(), repr=False, compare=False)

    @property
    def choices(self) -> Sequence[float | int]:
        """Its values if they are listed, or all of a range of a whole number; empty if it has any
        number of them."""
        if self.values or not isinstance(self.start, int):
            return self.values
        return range(self.start, int(self.stop) + 1)

    def written(self) -> list | dict:
        """Return the axis as a spec could give it: a list, or a table of start, stop, num and
        scale."""
        if self.scale is None:
            return list(self.values)
        span = {"start": self.start, "stop": self.stop}
        if self.values:
            return {**span, "num": len(self.values), "scale": self.scale}
        return span | ({"scale": "log"} if self.scale == "log" else {})


def build_axis(
    study: str, name: str, parts: Mapping[str, Leaf], mistakes: Mistakes, names: Names = BUILT_IN
) -> Axis | None:
    """Return the axis given by the parts of one key of a study, or None and add its mistakes."""
    key = names.find(name) or study_keys()[f"{study}.{name}"]
    label = f"{study}.{name}"
    before = len(mistakes)
    if not key.numeric:
        not_numeric = f"{key.path}, which takes one of {', '.join(map(show, key.choices))}"
        mistakes.refuse(next(iter(parts.values())), label, "a numeric key", not_numeric)
    elif "" in parts:
        leaf = parts[""]
        expected = "a list of numbers or { start, stop, num }"
        values = tuple(mistakes.check_list(key, leaf, label, expected))
        if len(mistakes) == before:
            ends = min(values), max(values)
            return Axis(name, key.path, values, *ends, key.structural, None, leaf.place)
    else:
        span = _span(label, key, parts, mistakes)
        if len(mistakes) == before:
            return Axis(name, key.path, *span, axis_place(parts))
    return None


def axis_place(parts: Mapping[str, Leaf]) -> Place:
    """Return the place of the axis with these parts."""
    first_part, leaf = next(iter(parts.items()))
    if first_part:
        return leaf.place.parent()
    return leaf.place


def _span_fault(start: float, stop: float, num: int | None, scale: str) -> tuple[str, str] | None:
    """Return the first part of a span that does not fit the others, and what is expected of it."""
    if start > stop or (start == stop and num != 1):
        return "stop", f"a number > start = {start!r}"
    if num == 1 and start < stop:
        return "num", "a whole number >= 2, start and stop being two values"
    if scale == "log" and not start > 0:
        return "start", "a number > 0 for the log scale"
    return None


def _span(label: str, key: Key, parts: Mapping[str, Leaf], mistakes: Mistakes) -> tuple:
    """Return values, start, stop, whether the axis is structural, and the scale; a part that is
    unknown is reported already."""
    keys = AXIS_KEYS | {"start": key, "stop": key}
    before = len(mistakes)
    given = {}
    for name, leaf in parts.items():
        if name in keys:
            given[name] = mistakes.check(keys[name], leaf, f"{label}.{name}")
    if not {"start", "stop"} <= set(parts):
        mistakes.refuse(axis_place(parts), label, "both start and stop", "only " + ", ".join(parts))
    if len(mistakes) > before:
        return ()
    start, stop, num = (given.get(name) for name in ("start", "stop", "num"))
    scale = given.get("scale") or AXIS_KEYS["scale"].default
    fault = _span_fault(start, stop, num, scale)
    if fault:
        name, expected = fault
        text_found = show(parts[name].value)
        mistakes.refuse(parts[name], f"{label}.{name}", expected, text_found, of_key=False)
        return ()
    values = SPACINGS[scale](start, stop, num) if num else ()
    if key.type == "integer":
        try:
            values = tuple(check(key, value) for value in values)
        except Rejected as error:
            expected = "so many values that all are whole numbers"
            mistakes.refuse(parts["num"], f"{label}.num", expected, error.found, of_key=False)
    return values, start, stop, key.structural, scale
