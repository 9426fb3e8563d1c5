"""Units that a text names, as pint reads them; every other unit is one of SI by its key or column.

pint is loaded where a text names a unit that is not the expected one. It is told two things: an
angle is a dimension of its own, so that 1/s is no rad/s and Hz no speed, and what drives and tables
write, as Nm or r/min.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple, TypeGuard

from wavesweep.engine.errors import UsageError

OWN = (
    "radian = [angle] = rad",
    "@alias turn = rev = r",
    "revolutions_per_minute = turn / minute = rpm = RPM",
    "newton_meter = newton * meter = Nm",
    "newton_meter_second = newton * meter * second = Nms",
    "newton_centimeter = newton * centimeter = Ncm",
    "degree_per_second = degree / second = dps",
)
TIME = ("time", "t", "realtime")  # names of a column of times
# as `Key.instead` of a share that may be a text of a number and a unit as well
WITH_UNIT = "a value with its unit"
LONGEST = 40  # letters; no more, so that no text takes long
_TEXT = re.compile(rf"(?!.*\d{{3}})[\w°%µμΩ·⋅•*/^().+ ⁻¹²³-]{{1,{LONGEST}}}")
# a power that no unit has; what is expected is held against it as well, as a spec may name it
_NO_POWER = re.compile(r"(?:\*\*|\^)(?!\s*\(?\s*[-+]?[123](?![\d.])\s*\)?(?!\s*(?:\*\*|\^)))")
_PART = re.compile(r"[^\W\d_]+")
# parts of units of drawn loops for which pint is not loaded
_OF_LOOPS = {"A", "F", "H", "Hz", "N", "Nm", "V", "W", "kg", "m", "min", "ohm", "rad", "s"}
_OF_LOOPS |= {"frame", "message", "pixel", "pixels", "px", "sample", "step", "tick"}
# parts of units that a name of a column may have behind a `_` or a space
_USUAL = frozenset(
    [
        "s",
        "sec",
        "second",
        "seconds",
        "ms",
        "us",
        "µs",
        "μs",
        "ns",
        "m",
        "mm",
        "cm",
        "um",
        "µm",
        "μm",
        "inch",
        "rad",
        "mrad",
        "deg",
        "degree",
        "degrees",
        "rev",
        "turn",
        "turns",
        "rpm",
        "hz",
        "khz",
        "dps",
        "n",
        "mn",
        "kn",
        "nm",
        "mnm",
        "ncm",
        "a",
        "ma",
        "v",
        "kg",
        "g",
        "per",
    ]
)
_INERTIA = re.compile(r"(?<![^\W\d_])([km]?g)([cm]?m)(?=\*\*2|\^2|²)")  # kgm^2, g apart from m
_A_MINUTE = re.compile(r"1? ?/ ?min|min(\^|\*\*)?-1|min⁻¹")  # of turns, where an angle is expected
_QUANTITY = re.compile(  # of as many digits as any number has, and none of many millions
    r"([-+]?(?:\d{1,1100}(?:\.\d{0,1100})?|\.\d{1,1100})(?:[eE][-+]?\d{1,3})?)\s*([^\W\d].*|[°%].*)"
)
_ELECTRICAL = re.compile(r"\be_?rpm\b|(?<=_)erpm\b", re.IGNORECASE)
_PICTURE = re.compile(r"px|pixels?|dots?", re.IGNORECASE)  # of a camera or a screen, of any size


class Unit(NamedTuple):
    """A unit that a text names. factor: what turns its numbers into the unit `expected`, exact but
    for the pi of angles, which has 50 digits. spelling: as pint took it."""

    factor: Fraction
    spelling: str
    expected: str

    def of(self, values: Any) -> Any:
        """Numbers in the expected unit; decimal ones are rounded once."""
        return values * float(self.factor.numerator) / float(self.factor.denominator)


@cache
def _registry() -> Any:
    from importlib.resources import files

    import pint

    # Loaded after it was made: what it would compute of all units before is the slower part.
    registry = pint.UnitRegistry(None, on_redefinition="ignore", non_int_type=Fraction)
    registry.load_definitions(files(pint) / "default_en.txt")
    for line in OWN:
        registry.define(line)
    return registry


@cache
def unit_of(text: str, *expected: str) -> Unit | None:
    """The unit that a text names, as the first of the expected ones that it can be converted to;
    None if there is none, if no such unit is known, or if 0 is not 0 in both."""
    if text in expected:
        return Unit(Fraction(1), text, text)
    for spelling in _spellings(text):
        for unit in expected:
            factor = _factor(spelling, unit)
            if factor is not None:
                return Unit(factor, spelling, unit)
    return None


def _spellings(text: str) -> Iterator[str]:
    """Yield what a text may mean, as it is written first; then, as a guess, in small letters, and
    with the large one of newton, ampere, hertz or volt among them."""
    text = text.strip().replace("\N{MINUS SIGN}", "-")
    if not _TEXT.fullmatch(text) or _ELECTRICAL.search(text) or _PICTURE.fullmatch(text):
        return
    if _A_MINUTE.fullmatch(text):
        yield "rpm"
    text = re.sub(r"(?<=[^\W\d])[.-](?=[^\W\d])", "*", text.replace("_per_", "/"))  # N.m, N-m
    text = re.sub(r"(?<=[^\W\d_])(?=-?\d)", "**", text)  # s2, min-1
    text = _INERTIA.sub(r"\1*\2", text)
    for written in dict.fromkeys((text.replace("_", "/"), text.replace("_", "*"))):
        small = written.lower()
        yield written
        yield small
        for place, letter in enumerate(small):
            if letter in "nahv":
                yield small[:place] + letter.upper() + small[place + 1 :]


def _factor(spelling: str, expected: str) -> Fraction | None:
    """What turns numbers in one unit into the other; None if one is not known, or they differ in
    more than a factor."""
    from tokenize import TokenError

    if len(expected) > LONGEST or _NO_POWER.search(spelling) or _NO_POWER.search(expected):
        return None
    registry = _registry()
    known_faults = (ArithmeticError, AssertionError, AttributeError, TypeError, ValueError)
    try:
        unit = registry.parse_units(spelling)
        zero, unity = (
            registry.Quantity(Fraction(number), unit).to(expected).m for number in (0, 1)
        )
    except (*known_faults, SyntaxError, TokenError):
        return None
    return None if zero else Fraction(unity)


def is_unit(cell: str) -> bool:
    """Whether a cell of a row may be a unit: one that is known, anything in brackets, or nothing."""
    if cell in ("", "-") or cell[0] + cell[-1] in ("[]", "()"):
        return True
    return any(_factor(spelling, spelling) for spelling in _spellings(cell))


def unknown_part(unit: str) -> str:
    """The first part of a unit of several parts that is no unit and nothing that is counted, as `foo` of `Nm/foo`; empty
    without one. A single word may count anything."""
    parts = _PART.findall(unit)
    if len(parts) < 2:
        return ""
    return next((part for part in parts if part not in _OF_LOOPS and not is_unit(part)), "")


def named_unit(text: str) -> str:
    """A unit that cannot be converted, as a message names what it found."""
    if _ELECTRICAL.search(text):
        return f"{text}, electrical turns: their number in a turn, the pole pairs, is not known"
    return text


def has_unit(value: object) -> TypeGuard[str]:
    """Whether a value is a text like `45g`, a number with a unit."""
    return isinstance(value, str) and _QUANTITY.fullmatch(value.strip()) is not None


def number_in(text: str, expected: str) -> float | None:
    """The number of a text like `45g` in the expected unit, rounded once; None if it cannot be
    converted."""
    number, unit_text = _QUANTITY.fullmatch(text.strip()).groups()
    unit = unit_of(unit_text, expected)
    if unit is None:
        return None
    try:
        return float(Fraction(number) * unit.factor)
    except OverflowError:  # the key says what it takes
        return math.inf


def converted(
    values: Any,
    place: tuple[str, str],
    path: object,
    name: str,
    scales: Mapping[str, float] | None,
    *expected: str,
) -> tuple[Any, str]:
    """The numbers of a column in the first expected unit that its own can be converted to, and what
    is to be said of a unit that is another, or guessed; empty without one.

    place: of the column, as of `column_named`. name: of what it is. scales: factors by name, which
    go before units; None where a command has no option for them. Errors: UsageError.
    """
    column, text = place
    if scales and name in scales:
        return values * scales[name], ""
    unit = unit_of(text or expected[0], *expected)
    if unit is None:
        hint = f"; --scale {name}=FACTOR turns its numbers into {expected[0]}"
        hint = "" if scales is None else hint
        raise UsageError(
            f"{path}: {column}: expected {' or '.join(expected)}, found {named_unit(text)}{hint}"
        )
    written, taken = (re.sub(r"[\W_]", "", spelling) for spelling in (text, unit.spelling))
    said = f"{column} is taken as {name} in {unit.spelling}, times {float(unit.factor):.6g}"
    if unit.factor == 1 and (not text or written == taken):
        said = ""
    return unit.of(values), said


def quantity(text: str) -> tuple[Fraction, str] | None:
    """The number and the unit of a text like `45g`; None of another text."""
    match = _QUANTITY.fullmatch(text.strip())
    return match and (Fraction(match[1]), match[2])


def column_named(
    columns: Iterable[str], names: Iterable[str], *expected: str
) -> tuple[str, str] | None:
    """The column that has one of these names, alone or with a unit behind it, and the text of the
    unit, which is empty without one.

    The first name goes before others, and a unit that can be converted before one in brackets that
    cannot. What stands behind `_` or `in` is one if it is usual and can be converted.
    """
    first, *_ = names
    unlike_one = None
    for column in sorted(columns, key=lambda column: column != first):
        for name in names:
            pattern = rf"{re.escape(name)}(?:(_|\s+in\s+|\s*[\[(])(.*?)[\])]?)?"
            match = re.fullmatch(pattern, column.strip(), re.IGNORECASE)
            if not match:
                continue
            mark, unit = match[1], (match[2] or "").strip()
            in_brackets = mark is not None and mark.strip() in ("[", "(")
            if not unit or ((in_brackets or _is_usual(unit)) and unit_of(unit, *expected)):
                return column, unit
            if in_brackets:
                unlike_one = unlike_one or (column, unit)
    return unlike_one


def unit_in(column: str, *expected: str) -> str:
    """The text of the unit in a column's name, whatever that name is: what stands in brackets at
    its end, or else a usual unit, the whole name or behind a `_` or a space; empty without one."""
    column = column.strip()
    in_brackets = re.search(r"[\[(]([^\[(]*)[\])]$", column)
    if in_brackets:
        return in_brackets[1].strip()
    texts = [column, *(column[mark.end() :] for mark in re.finditer(r"[_\s]+", column))]
    texts = [text for text in texts if len(text) > 1 or text != column]
    for text in texts:
        if _ELECTRICAL.search(text) or (_is_usual(text) and unit_of(text, *expected)):
            return text
    # of another dimension, unless it is a letter, which may be a name
    return next((text for text in texts if len(text) > 1 and _is_usual(text)), "")


def _is_usual(text: str) -> bool:
    """Whether a text without brackets is a unit that columns have in their names."""
    words = re.findall(r"[^\W\d_]+", text.lower())
    return bool(words) and all(word in _USUAL for word in words)
