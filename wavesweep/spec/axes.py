"""The axes of a sweep: the values or the span of each key, and their spacing."""

import math
from dataclasses import dataclass, field

from wavesweep.errors import Mistake
from wavesweep.spec.checking import Rejected, check, show
from wavesweep.spec.keys import AXIS_KEYS, BUILT_IN, STUDY_KEYS, Key, Names
from wavesweep.spec.reading import Leaf, Place

MOST_VALUES = 1_000_000
MOST_MISTAKES = 20  # that are listed for one axis


def linear(start: float, stop: float, num: int) -> tuple[float, ...]:
    """Return the values of `numpy.linspace(start, stop, num)`, bit for bit; both ends are exact."""
    if num == 1:
        return (start,)
    span = stop - start
    step = span / (num - 1)
    if step == 0.0:  # a span of a few denormal numbers: the quotient underflows, the products need not
        inner = [i / (num - 1) * span + start for i in range(num - 1)]
    else:
        inner = [i * step + start for i in range(num - 1)]
    return (*inner, stop)


def logarithmic(start: float, stop: float, num: int) -> tuple[float, ...]:
    """Return the values of `numpy.geomspace(start, stop, num)`, for 0 < start <= stop; both ends are exact.

    Accuracy: the two differ by the rounding of exponents, a few ulp times `log(10)*|log10(value)|`, because numpy has
    logarithms and powers of its own.
    """
    if num == 1:
        return (start,)
    exponents = linear(math.log10(start), math.log10(stop), num)[1:-1]
    return (start, *(_power_of_ten(exponent, start, stop) for exponent in exponents), stop)


def _power_of_ten(exponent: float, lowest: float, highest: float) -> float:
    try:
        return min(max(10.0**exponent, lowest), highest)
    except OverflowError:  # an exponent that rounding has put above the largest double's
        return highest


SPACINGS = {"linear": linear, "log": logarithmic}


NARROWEST_SPAN = 1e-290  # from start to stop


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis: `values` in order (empty if only the span is given), `start` and `stop` the span or the extremes.

    `name` is the name in the spec, and that of the column; `path` is the path of the key. If `structural` is true, a value
    has to go through `Spec.with_values`; otherwise an array of floats may replace `values[path]`.
    """

    name: str
    path: str
    values: tuple[float | int, ...]
    start: float | int
    stop: float | int
    structural: bool
    scale: str | None = None
    place: Place = field(default=Place(), repr=False, compare=False)

    def written(self) -> list | dict:
        """Return the axis as a spec could give it: a list, or a table of start, stop, num and scale."""
        if self.scale is None:
            return list(self.values)
        span = {"start": self.start, "stop": self.stop}
        return {**span, "num": len(self.values), "scale": self.scale} if self.values else span


def build_axis(study: str, name: str, parts: dict[str, Leaf], names: Names = BUILT_IN) -> tuple[Axis | None, list[Mistake]]:
    """Return the axis given by the parts of one key of [sweep] or [bode], or None and its mistakes."""
    key = names.find(name) or STUDY_KEYS[f"{study}.{name}"]
    label = f"{study}.{name}"
    first = next(iter(parts.values()))
    if not key.numeric:
        takes = "one of " + ", ".join(map(show, key.choices))
        return None, [first.mistake(label, "a numeric key", f"{key.path}, which takes {takes}", of_key=True)]
    if "" in parts:
        return _from_list(label, name, key, parts[""])
    return _from_span(label, name, key, parts)


def axis_place(parts: dict[str, Leaf]) -> Place:
    """Return the place of the axis with these parts."""
    part, leaf = next(iter(parts.items()))
    return leaf.place.parent() if part else leaf.place


def _from_list(label: str, name: str, key: Key, leaf: Leaf) -> tuple[Axis | None, list[Mistake]]:
    if not isinstance(leaf.value, list) or not leaf.value:
        return None, [leaf.mistake(label, "a list of numbers or { start, stop, num }", show(leaf.value))]
    if len(leaf.value) > MOST_VALUES:
        return None, [leaf.mistake(label, f"at most {MOST_VALUES} values", f"{len(leaf.value)}")]
    values, mistakes = [], []
    for index, item in enumerate(leaf.value):
        if len(mistakes) == MOST_MISTAKES:
            rest = f"so many wrong ones that the {len(leaf.value) - index} values from [{index}] on were not looked at"
            mistakes.append(leaf.mistake(label, "numbers of this axis", rest))
            break
        try:
            values.append(check(key, item))
        except Rejected as error:
            mistakes.append(leaf.mistake(f"{label}[{index}]", error.expected, error.found))
    if mistakes:
        return None, mistakes
    return Axis(name, key.path, tuple(values), min(values), max(values), key.structural, None, leaf.place), []


def _from_span(label: str, name: str, key: Key, parts: dict[str, Leaf]) -> tuple[Axis | None, list[Mistake]]:
    numbers, mistakes = _check_parts(label, key, parts)
    if mistakes:
        return None, mistakes
    start, stop, num, scale = (numbers.get(part) for part in ("start", "stop", "num", "scale"))
    scale = scale or AXIS_KEYS["scale"].default
    wrong = _span_fault(start, stop, num, scale)
    if wrong:
        part, expected = wrong
        return None, [parts[part].mistake(f"{label}.{part}", expected, show(parts[part].value))]
    values = SPACINGS[scale](start, stop, num) if num else ()
    try:
        if key.type == "integer":
            values = tuple(check(key, value) for value in values)
    except Rejected as error:
        return None, [parts["num"].mistake(f"{label}.num", "a spacing by whole numbers", error.found)]
    return Axis(name, key.path, values, start, stop, key.structural, scale, axis_place(parts)), []


def _check_parts(label: str, key: Key, parts: dict[str, Leaf]) -> tuple[dict, list[Mistake]]:
    keys = {**AXIS_KEYS, "start": key, "stop": key}
    numbers, mistakes = {}, []
    for part, leaf in parts.items():
        if part not in keys:
            continue  # reported where the leaves were sorted
        try:
            numbers[part] = check(keys[part], leaf.value)
        except Rejected as error:
            mistakes.append(leaf.mistake(f"{label}.{part}", error.expected, error.found, error.suggestion))
    if not {"start", "stop"} <= set(parts):
        axis = Leaf(None, axis_place(parts))
        mistakes.append(axis.mistake(label, "both start and stop", "only " + ", ".join(parts), of_key=True))
    return numbers, mistakes


def _span_fault(start: float, stop: float, num: int | None, scale: str) -> tuple[str, str] | None:
    """Return the part of a span that contradicts the others, and the expected value."""
    if start > stop or (start == stop and num != 1):
        return "stop", f"a number > start = {start!r}"
    if num is None and stop - start < NARROWEST_SPAN:  # steps of it would have no digits
        return "stop", f"a number at least {NARROWEST_SPAN:g} above start"
    if num == 1 and start < stop:
        return "num", "a whole number >= 2, start and stop being two values"
    if scale == "log" and not start > 0:
        return "start", "a number > 0 for the log scale"
    return None
