"""What is asked of a spec, and how much of it the claims of a proof file cover.

The first line of a file says "of", what ran: a "sweep", a "map" or a "design", and "question", a list:

    {"claim": "modes", "numbers": {"rates.ratio": "20"}, "sides": {"K_VE": ["0", "400"]}, "open": [["235.1", "235.2"]]}

claim     the kind of claims that answer ("refuted" also answers "for all", and "goes on" "contact"), or words for what none does
numbers   as those of claims; of "contact" also the wall's that is no side. radius: as that of claims
sides     the number along which it is asked, two or three of a map, none of a design; behind it a factor at a cut
gain, cut as those of claims
open      stretches of it that the table leaves open
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from typing import NamedTuple

from .balls import exact
from .channel import SENT
from .factor import FACTOR, PHASE
from .gain import Gain
from .reader import for_all, path_of

Ends = tuple[Fraction, Fraction]
Path = tuple[str, ...]  # of a number in a spec
Numbers = frozenset[tuple[Path, Ends]]
ANSWERS = {"refuted": "for all", "goes on": "contact"}
SCOPES = {
    "modes": "",
    "for all": " for all of [for_all] and channels",
    "mean square": " for the chances of [for_all] and channels",
    "contact": " for any wall that pushes and never pulls",
    "port": " for a passive port of the hand",
}
OWN = {"modes", "port"}  # of the spec's own loop, and not of [for_all]
STATES = ("stable", "unstable"), ("within", "not within")
ENERGIES = {"gain": "below", "port": "passive"}
COUNTS = {None: "open", 0: "stable"}  # of modes outside, in a map
DIGITS = 10  # of an end
ROWS = 4  # that are told one by one
SMALL = Fraction(1, 1000)  # share of what is asked, above which an opening is named
LESS = "LESS than the spec asks"


@dataclass
class Ask:
    """A part of the question; see the top of this file."""

    claim: str
    numbers: dict[str, Fraction] = field(default_factory=dict)
    sides: dict[str, Ends] = field(default_factory=dict)
    radius: Fraction = Fraction(1)
    open: list[Ends] = field(default_factory=list)
    gain: Gain | None = None
    cut: str = ""


class Piece(NamedTuple):
    """A stretch of what is asked, and what is proved there; without a state a hole."""

    low: Fraction
    high: Fraction
    state: str = ""


class Claims:
    """What claims prove, by the numbers for which they prove it: a claim is read once for all parts of the question
    that ask for the same kind by the same names."""

    def __init__(self, tables: dict, claims: Iterable):
        self.tables = tables
        self.claims = list(claims)
        self._by_form: dict[tuple, dict[Numbers, list[Piece]]] = {}

    def pieces_of(self, ask: Ask) -> list[Piece]:
        """What is proved of a part of the question that is no map."""
        along, *further = ask.sides or [""]
        numbers = {name: (value, value) for name, value in ask.numbers.items()}
        numbers = _by_path(self.tables, numbers | {name: ask.sides[name] for name in further})
        form = (ask.claim, ask.radius, ask.gain, ask.cut, along, frozenset(numbers))
        if form not in self._by_form:
            self._by_form[form] = self._by_numbers(ask, along, numbers.keys())
        return self._by_form[form].get(frozenset(numbers.items()), [])

    def _by_numbers(
        self, ask: Ask, along: str, names: Collection[Path]
    ) -> dict[Numbers, list[Piece]]:
        """The pieces of all claims that answer what is asked along a number, by the values of other numbers.

        What refutes a member of a set has numbers of the set as well."""
        of_set = ask.claim in SCOPES.keys() - OWN
        ranges = for_all.read(self.tables, exact).ranges if of_set else {}
        pieces: dict[Numbers, list[Piece]] = {}
        for claim in self.claims:
            answers = ANSWERS.get(claim.claim, claim.claim), claim.radius, claim.gain, claim.cut
            if claim.shares or answers != (ask.claim, ask.radius, ask.gain, ask.cut):
                continue
            values = {name: ends for name, ends in claim.sides.items() if name not in ranges}
            values |= {name: (value, value) for name, value in claim.numbers.items()}
            values = _by_path(self.tables, values)
            span = (
                values.pop(_path(self.tables, along), None) if along else (Fraction(0), Fraction(0))
            )
            numbers = frozenset((name, values[name]) for name in names if name in values)
            exceeds = len(values) > len(numbers) and claim.claim not in ANSWERS
            if not span or len(numbers) < len(names) or exceeds:
                continue
            state = ENERGIES.get(ask.claim) or STATES[ask.radius != 1][bool(claim.outside)]
            piece = Piece(*span, "refuted" if claim.claim in ANSWERS else state)
            pieces.setdefault(numbers, []).append(piece)
        return pieces


def _by_path(tables, values: dict) -> dict[Path, Ends]:
    return {_path(tables, name): value for name, value in values.items()}


def _path(tables, name: str) -> Path:
    return (name,) if name in (FACTOR, PHASE) else path_of(tables, name)


def with_holes(ask: Ask, pieces: Iterable[Piece]) -> tuple[list[Piece], bool]:
    """What is asked from low to high: the pieces, with the holes between them; and whether two pieces overlap."""
    begin, end = next(iter(ask.sides.values()), (Fraction(0), Fraction(0)))
    reached = begin
    line: list[Piece] = []
    again = False
    clipped = [Piece(max(low, begin), min(high, end), state) for low, high, state in pieces]
    for piece in sorted(piece for piece in clipped if piece.low <= piece.high):
        if piece.low > reached:
            line.append(Piece(reached, piece.low))
        again |= bool(line) and (piece.low < line[-1].high or piece[:2] == line[-1][:2])
        line.append(piece)
        reached = max(reached, piece.high)
    if reached < end or not line:
        line.append(Piece(reached, end))
    return line, again


def is_stated(ask: Ask, hole: Piece) -> bool:
    """Whether a hole is one that the question leaves open."""
    return any(low <= hole.low and hole.high <= high for low, high in ask.open)


def in_words(tables: dict, ran: str, question: Sequence[Ask], claims: Sequence) -> tuple[str, bool]:
    """The line of what is covered, and whether that is all of the question and of the spec."""
    scopes: dict[str, list[tuple[Ask, str, bool]]] = {}
    known = Claims(tables, claims)
    for ask in question:
        sides = [
            f"{name} from {plain(low)} to {plain(high)}" for name, (low, high) in ask.sides.items()
        ]
        scope = (" and ".join(sides) or "own numbers") + SCOPES.get(ask.claim, f" for {ask.claim}")
        if ask.gain:
            scope = f"{' and '.join(sides) or 'own numbers'} for {gain_in_words(ask.gain, '')}"
        if ask.cut:
            scope += f" at {ask.cut}"
        if ask.radius != 1:
            scope += f" within a circle of radius {plain(ask.radius)} in each period of its rates"
        covered = _of_map(ask, claims) if ran == "map" else _of_row(ask, known)
        scopes.setdefault(scope, []).append((ask, *covered))
    parts = []
    for scope, rows in scopes.items():
        shown = sorted(rows, key=lambda row: row[2])[:ROWS] if len(rows) > ROWS else rows
        said = [
            f" at {_written(ask.numbers)}: {words}" if ask.numbers else f": {words}"
            for ask, words, _ in shown
        ]
        if len(rows) > ROWS:
            said.append(
                f" at {sum(whole for *_, whole in rows)} of {len(rows)} combinations all is covered up to openings"
            )
        parts.append(scope + ";".join(said))
    outside = [*_less(tables, ran, question)]
    whole = (
        bool(question)
        and not outside
        and all(all_of_it for rows in scopes.values() for *_, all_of_it in rows)
    )
    return "; ".join(parts + outside) or "nothing is asked", whole


def _written(numbers: dict[str, Fraction]) -> str:
    return ", ".join(
        f"{name.removeprefix('rates.')} = {plain(value)}" for name, value in numbers.items()
    )


def _of_row(ask: Ask, claims: Claims) -> tuple[str, bool]:
    line, again = with_holes(ask, claims.pieces_of(ask))
    low, high = line[0].low, line[-1].high
    size = high - low
    words = []
    between = Fraction(0)
    whole = any(piece.state for piece in line)
    for piece in line:
        ends = f" from {_end(piece.low, ROUND_CEILING)}" * (piece.low > low)
        ends += f" to {_end(piece.high, ROUND_FLOOR)}" * (piece.high < high)
        if piece.low == piece.high:
            ends = f" at {plain(piece.low)}" * bool(size)
        ends = ends or " all over" * bool(size)
        stated = is_stated(ask, piece)
        if piece.state:
            words.append(piece.state + ends)
        elif stated and piece.high - piece.low <= SMALL * size:
            between += piece.high - piece.low
        else:
            whole &= stated
            share = f" ({_share(piece.high - piece.low, size)})" * bool(size)
            words.append(f"{'open' if stated else 'NOT COVERED'}{ends}{share}")
    if between:
        words.append(f"open between ({_share(between, size)})")
    for place, said in enumerate(words):
        if whole and not said.startswith("open"):
            words[place] = f"proved {said}" * (said[:7] != "refuted") or said
            break
    return ", ".join(words + ["claimed more than once"] * again), whole


def _of_map(ask: Ask, claims) -> tuple[str, bool]:
    maps = [claim for claim in claims if claim.claim == "modes" and claim.sides == ask.sides]
    if not maps:
        return "NOT COVERED", False
    shares = maps[0].shares or {maps[0].outside: Fraction(1)}
    return shares_in_words(shares) + ", claimed more than once" * (len(maps) > 1), True


def shares_in_words(shares: dict) -> str:
    """How much of a map has which count of modes outside; None of what is open."""
    ordered = sorted(shares.items(), key=lambda pair: (pair[0] is None, pair[0]))
    parts = [
        f"{_share(share, Fraction(1))} {COUNTS.get(count, f'{count} modes outside')}"
        for count, share in ordered
    ]
    return ", ".join(parts)


def _less(tables: dict, ran: str, question: Sequence[Ask]) -> Iterator[str]:
    """Yield words for what the spec asks about and the question leaves out."""
    kinds = {ask.claim for ask in question}
    sets = for_all.read(tables, exact)
    messages = any(for_all.MESSAGES & keys.keys() for keys in tables.get("block", {}).values())
    if ran != "map" and (sets.asked or messages) and kinds <= {"contact", *OWN}:
        yield f"{LESS}: nothing of [for_all] and channels"
    if ran != "map" and sets.contact and "contact" not in kinds:
        yield f"{LESS}: nothing of walls that let go"
    if ran != "sweep":
        return
    sweep = tables.get("sweep", {})
    axes = dict(for_all.axes(tables, "sweep", sweep))
    if (
        sweep.get("require")
        and "require" not in axes
        and all(ask.claim == "modes" and ask.radius == 1 and not ask.cut for ask in question)
    ):
        yield f"{LESS}: nothing of [sweep] require"
    for name, axis in axes.items():
        path = path_of(tables, name)
        low, high, count = _axis(axis)
        sides = [_by_path(tables, ask.sides).get(path) for ask in question]
        values = {_by_path(tables, ask.numbers).get(path, low - 1) for ask in question}
        if all(sides):
            covers = all(begin <= low and high <= end for begin, end in filter(None, sides))
        else:
            covers = not count or (low in values and high in values and len(values) >= count)
        if not covers:
            yield f"{LESS}: [sweep] has {name} from {plain(low)} to {plain(high)}"


def _axis(axis) -> tuple[Fraction, Fraction, int]:
    """The ends of an axis of [sweep], and how many values it has; none of a span."""
    if isinstance(axis, dict) and "start" in axis:
        return exact(axis["start"]), exact(axis["stop"]), int(axis.get("num", 0))
    values = axis["values"] if isinstance(axis, dict) else axis
    numbers = [exact(value) for value in (values if isinstance(values, list) else [values])]
    return min(numbers), max(numbers), len(set(numbers))


def gain_in_words(gain: Gain, verb: str = "is ") -> str:
    level = plain(gain.at_most)
    if gain.source == SENT:
        return f"the norm of the wave channel {verb}below {level}"
    if gain.cut:
        less = f" - {plain(gain.less)}" if gain.less else ""
        return f"|1/(1 + L){less}| at {gain.cut} {verb}below {level} at all frequencies"
    return f"in the energy of all ticks {gain.signal} {verb}below {level} times {gain.source}, whatever comes in"


def plain(number: Fraction) -> str:
    """All digits of a decimal number: a claim about a rounded one would be another."""
    short = f"{float(number):.15g}"
    if Fraction(short) == number:
        return short
    digits = Context(300).divide(Decimal(number.numerator), Decimal(number.denominator))
    return str(digits if Fraction(digits) == number else number)


def _end(number: Fraction, way: str) -> str:
    """An end with fewer digits, by which less is said."""
    digits = Context(DIGITS, way).divide(Decimal(number.numerator), Decimal(number.denominator))
    return plain(Fraction(digits))


def _share(size: Fraction, whole: Fraction) -> str:
    """A share of a length or an area, which is all of it only where it is."""
    share = size / whole if whole else Fraction(1)
    if 1 - SMALL**2 < share < 1:
        return "more than 99.9999 %"
    return f"{100 * float(share):.4g} %"
