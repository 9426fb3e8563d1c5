"""Proof files beside tables of stable intervals, and of the verdict on a spec's own design."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product
from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.checker import balls, coverage
from wavesweep.checker.__main__ import in_words, limited
from wavesweep.checker.balls import Refused
from wavesweep.checker.factor import FACTOR, PHASE
from wavesweep.checker.file import Proof, ask_of, claim_of, read, spec_of
from wavesweep.checker.gain import Gain
from wavesweep.checker.reader import for_all, path_of
from wavesweep.checker.reader.loops import Unreadable
from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.analyses.asked import axes_asked, key_named
from wavesweep.program.analyses.spec_loops import radius_over
from wavesweep.program.spec import SYMBOLS, Spec, load, sweep_axes
from wavesweep.program.tables.kind import count
from wavesweep.program.tables.refuters import Refuters
from wavesweep.proofs.cells import WINDOW, exactly
from wavesweep.proofs.claims import (
    Lines,
    claim_at,
    claim_of_factors,
    claim_of_plane,
    claim_of_set,
    claim_refuted,
    claims_again,
    claims_along,
    radii_at,
    times_of,
    write,
)
from wavesweep.proofs.gains import claims_of_energy, gain_of, in_file, of_waves
from wavesweep.proofs.planes import Part
from wavesweep.proofs.sets import LEFT_OPEN, decimals
from wavesweep.proofs.walls import claim_of_motion, claim_of_walls

if TYPE_CHECKING:
    from wavesweep.program.columns import Columns
    from wavesweep.program.tables.table import Table

OWN = ("", "spec", "operator")  # rows of the spec's own loop
CLAIMED = {"for_all": "for all", "mean_square": "mean square"}  # kinds of rows, and of claims
UNCLAIMED = {
    "passive": "every passive hand",
    "box": "the hands of a range",
    "free": "nobody at the device",
    "ports": "both ports",
}  # kinds of rows
UNCLAIMED_FACTS = {"every_hand": "every passive hand"}
FACTS = "for_all", "at_random", "tick"  # of `check`
IN_ANY_ORDER = "for_all", "messages"  # their kinds that are not about means
ORDINALS = "first", "second", "third"  # in the columns of a map
REQUIRED = "what [sweep] require asks for"
SHORT = 0.0, 1e-3, 1e-2, 3e-2  # of a row: how much of it a claim may leave out at its high end
MEGABYTES = 800  # of memory that a claim may take
SAME_END = 8 * WINDOW  # of an end or of the range: what a proof leaves open about it
SAME_RADIUS = 1e-5  # of a radius in doubles
PLACES = np.array(
    [[0.7, 0.3], [0.2, 0.8]]
)  # of a range, at which loops are held against each other
NO_CONTRADICTION = 1e-6  # of an end: how far a row and its proof may differ


def text_of(source: str) -> bytes:
    """Return the bytes of a spec, which a proof file is about. Errors: UsageError."""
    if source == "-":
        raise UsageError(
            "--proof: expected a spec in a file, whose SHA-256 the proof has, found stdin"
        )
    return Path(source).read_bytes()


def numbers_set(spec: Spec, overrides: Sequence[str]) -> dict[str, str]:
    """Return the numbers that --set gives a spec, as decimals. Errors: UsageError for another key."""
    numbers = {}
    for override in overrides:
        name = override.partition("=")[0].strip()
        if name.partition(".")[0] in ("sweep", "bode"):
            continue
        key = spec.names.find(name)
        if key is None or not key.numeric:
            raise UsageError(
                f"--set {override}: expected a number beside --proof, which is about the spec as its file has it; "
                "write other keys into the file"
            )
        numbers[checked_name(key.path)] = repr(spec.own(key.path))
    return numbers


def checked_name(path: str) -> str:
    """Return the name of a number by which the checker knows it."""
    return next((name for name, of in SYMBOLS.items() if of == path), path.removeprefix("numbers."))


def with_proof(
    table: Table, spec: Spec, source: str, overrides: Sequence[str], say: Callable[[str], None]
) -> Table:
    """Return a table of intervals that writes its proof file as well. say: is called with what the
    file has, and what has no proof. Errors: ContradictedError."""
    text = text_of(source)
    numbers = numbers_set(spec, overrides)
    if spec.require and not (sizes_alone(spec) or gains_alone(spec)):
        say(f"no proof file for {REQUIRED}")
        return table
    along, _ = sweep_axes(spec, str(table.columns["along"][0]))
    span = float(along.start), float(along.stop)
    proofs = Proofs(spec, text, "sweep", along.name, checked_name(along.path), span)
    proofs.tolerance = float(table.facts.get("tolerance", 0.0))
    for kind, own, rows in _slices(spec, table.columns):
        proofs.of_rows(kind, numbers | own, rows)
    for line in proofs.in_words(f"{table.kind}.proof"):
        say(line)
    return proofs.beside(table)


def sizes_alone(spec: Spec) -> bool:
    """Return whether a spec requires nothing but sizes of modes: a radius, or times in which they
    decay."""
    required: Any = spec.require
    bound = required.bound
    return not (bound.gains or bound.damped or bound.bounded)


class Factors(NamedTuple):
    """Factors of the signal at a cut, or its phases, with which a loop has to be stable; name: FACTOR or PHASE."""

    cut: str
    name: str
    span: tuple[float, float]


def gains_alone(spec: Spec) -> list[Gain | Factors]:
    """Return the gains that a spec requires to stay below a level, and factors at cuts; none if it requires
    more than such at all frequencies."""
    required: Any = spec.require
    if not required or required.bound.of_modes:
        return []
    found = [_factors_of(bound) or gain_of(bound) for bound in required.bound.gains]
    return [] if None in found else [gain for gain in found if gain]


def _factors_of(bound: Any) -> Factors | None:
    """What a bound of [sweep] require asks of factors; None of another one."""
    if not hasattr(bound, "margin"):
        return None
    if bound.word.startswith("phase"):
        return Factors(bound.cut, PHASE, (0.0, bound.size))
    return Factors(bound.cut, FACTOR, (1 / bound.size, bound.size))


def radius_of(spec: Spec, tables: dict, numbers: Mapping[str, str]) -> float:
    """Return the radius within which a spec with these numbers requires modes to be at the end of a
    frame."""
    required: Any = spec.require
    clock, frame = clock_and_frame(spec, tables, numbers)
    return float(required.bound.over(clock / frame).radius_of(np.array(frame)))


def clock_and_frame(spec: Spec, tables: dict, numbers: Mapping[str, str]) -> tuple[float, float]:
    """Return the time over which a spec with these numbers counts, a tick of a drawing, else T_s,
    whatever runs at the slow rate; and that after which its rates are in step. Errors: Unreadable."""
    tick, frame = times_of(tables, numbers)
    if spec.drawing:
        return tick, frame
    if "rates.slow_hz" in numbers:
        return 1 / float(numbers["rates.slow_hz"]), frame
    own = {path: str(spec.own(path)) for path in ("rates.ratio", "rates.fast_hz")} | {**numbers}
    return float(own["rates.ratio"]) / float(own["rates.fast_hz"]), frame


def _members(tables: dict) -> Iterator[dict[str, float]]:
    """Yield the members of [for_all] with the least and the last values of all its numbers."""
    allowed = for_all.read(tables, balls.exact)
    values = allowed.ranges | allowed.listed | allowed.varying
    for at in (0, -1):
        chosen = {name: ends[at] for name, ends in values.items()}
        yield {name: float(value) for name, value in chosen.items() if value != "frame"}


def wall_with(spec: Spec, numbers: Mapping[str, str]) -> dict[str, tuple[Fraction, Fraction]]:
    """Return the numbers of the wall, each as a range of one value."""
    found = {}
    for path in spec.wall:
        name = checked_name(path)
        value = exactly(float(numbers.get(name, spec.own(path))))
        found[name] = value, value
    return found


def of_map(
    table: Table, spec: Spec, source: str, overrides: Sequence[str], say: Callable[[str], None]
) -> Table:
    """Return a table of a map that writes its proof file as well; otherwise as `with_proof`."""
    text = text_of(source)
    columns = table.columns
    names = [checked_name(key_named(spec, name).path) for name in table.facts["numbers"]]
    ends = [(columns[f"{place}_low"], columns[f"{place}_high"]) for place in ORDINALS[: len(names)]]
    boxes = np.moveaxis(np.array(ends, float), 2, 0).mT
    parts = []
    for box, outside in zip(boxes, columns["outside"].tolist(), strict=True):
        parts.append(Part(box, None if np.isnan(outside) else int(outside)))
    whole = np.array(table.facts["ends"]).T.tolist()
    try:
        share, lines = claim_of_plane(
            spec_of(text),
            numbers_set(spec, overrides),
            dict(zip(names, map(tuple, whole), strict=True)),
            parts,
        )
    except (Refused, Unreadable) as error:
        say(f"no proof file: {error}")
        return table
    forms = sum("L" in line for line in lines)
    say(f"{table.kind}.proof: {forms} forms prove {100 * share:.4g} % of the area")
    proofs = Proofs(spec, text, "map", claims=[lines])
    proofs.ask("modes", lines[0]["numbers"], lines[0]["sides"])
    return proofs.beside(table)


class ContradictedError(WavesweepError):
    """A claim of a proof file is not what its table says, or the checker's loop is another one."""

    def __str__(self) -> str:
        return f"{super().__str__()}; this is a fault of wavesweep: please report it, with the spec; no proof file is written"


@dataclass(slots=True, eq=False)
class Proofs:
    """A proof file: what is asked, the claims, and what has none.

    text: of the spec, as its file has it. ran: the kind of question. axis, number: along which rows are, and its name for the
    checker; span: its range. tolerance: J per J sent that a wave channel may add. unproved: why some claims are not there.
    loops: numbers of those that were held against the engine's.
    slices: claims of the own loop by the ends of its rows, which other numbers that it does not read leave as they are.
    """

    spec: Spec
    text: bytes
    ran: str
    axis: str = ""
    number: str = ""
    span: tuple[float, float] = (0.0, 0.0)
    question: list[dict[str, Any]] = field(default_factory=list)
    claims: list[Lines] = field(default_factory=list)
    tolerance: float = 0.0
    unproved: Counter[str] = field(default_factory=Counter)
    loops: set[tuple] = field(default_factory=set)
    slices: dict[tuple, list[Lines]] = field(default_factory=dict)

    @property
    def tables(self) -> dict[str, Any]:
        return spec_of(self.text)

    def ask(
        self,
        kind: str,
        numbers: Mapping[str, str],
        sides: Mapping,
        radius: float = 1.0,
        gain: Gain | None = None,
        cut: str = "",
    ) -> None:
        """Add a part of the question."""
        part: dict[str, Any] = {"claim": kind, "numbers": dict(numbers), "sides": dict(sides)}
        if radius != 1:
            part["radius"] = repr(radius)
        if gain:
            part["gain"] = in_file(gain)
        if cut:
            part["cut"] = cut
        self.question.append(part)

    def of_rows(self, kind: str, numbers: dict[str, str], rows: Columns) -> None:
        """Add what is asked of a combination of the other axes, and the claims of its rows."""
        sides = {self.number: [*map(repr, self.span)]}
        radius = 1.0
        first = len(self.claims)
        gains = gains_alone(self.spec)
        if kind in OWN and gains:
            for gain in gains:
                first = len(self.claims)
                if isinstance(gain, Factors):
                    both = sides | {gain.name: [*map(repr, gain.span)]}
                    self.ask("modes", numbers, both, cut=gain.cut)
                    self._of_planes(numbers, rows, gain)
                else:
                    self.ask("gain", numbers, sides, gain=gain)
                    self._of_energy(numbers, rows, gain)
                self._close("gain", numbers, rows, self.claims[first:])
            return
        if kind in OWN:
            kind = "modes"
            radius = radius_of(self.spec, self.tables, numbers) if self.spec.require else 1.0
            self.ask(kind, numbers, sides, radius)
            self._of_slice(numbers, rows, radius)
        elif kind == "port":
            self.ask(kind, numbers, sides)
            self._of_energy(numbers, rows, None)
        elif kind == "channel":
            kind = "gain"
            gain = of_waves(sqrt(1 + self.tolerance))
            self.ask(kind, numbers, sides, gain=gain)
            self._of_energy(numbers, rows, gain)
        elif kind == "contact":
            walls = {
                name: decimals(low) for name, (low, _) in wall_with(self.spec, numbers).items()
            }
            walls.pop(self.number, None)
            self.ask(kind, numbers | walls, sides)
            self._of_walls(numbers, rows)
        elif kind in CLAIMED and not self.spec.require:
            kind = CLAIMED[kind]
            self.ask(kind, numbers, sides)
            self._of_set(kind, numbers, rows)
        else:
            of_all = f"{REQUIRED}, for all of [for_all]"
            words = of_all if kind in CLAIMED else UNCLAIMED.get(kind, kind)
            self.unproved[f"no proof file for {words}"] += 1
            self.ask(words, numbers, sides)
            return
        self._close(kind, numbers, rows, self.claims[first:])

    def of_limit(self, numbers: dict[str, str], limit: Mapping[str, Any]) -> None:
        """Add what `check` found along a number. limit: from where to where, and the stable intervals."""
        self.axis = limit["name"]
        self.number = checked_name(key_named(self.spec, self.axis).path)
        self.span = float(limit["from"]), float(limit["to"])
        low, high = np.array(limit["intervals"] or [[np.nan, np.nan]], float).T
        others = {name: value for name, value in numbers.items() if name != self.number}
        self.of_rows("spec", others, {"low": low, "high": high})

    def _of_slice(self, numbers: dict[str, str], rows: Columns, radius: float) -> None:
        """Add the claims of the spec's own loop along the number."""
        ends = ends_of(rows, self.span)
        with self.telling("slice"):
            key = self.number, *ends, radius
            claims = claims_again(self.tables, numbers, self.slices.get(key, []))
            if not claims:
                found = claims_along(self.tables, numbers, self.number, self.span, ends, radius)
                claims = [lines for _, lines in found]
            self.slices[key] = claims
            self.claims += claims

    def _of_energy(self, numbers: dict[str, str], rows: Columns, gain: Gain | None) -> None:
        """Add the claims of a gain, or without one of the hand's port, in the intervals of a slice."""
        ends = _within(rows)
        for span in zip(ends[::2], ends[1::2], strict=True):
            with self.telling("row"):
                self.claims += claims_of_energy(self.tables, numbers, self.number, span, gain)

    def _of_planes(self, numbers: dict[str, str], rows: Columns, factors: Factors) -> None:
        """Add the claims of stability with all factors in the intervals of a slice, without what is next to ends."""
        ends = _within(rows)
        for low, high in zip(ends[::2], ends[1::2], strict=True):
            away = LEFT_OPEN / 2 * (high - low)
            begin = low + away * (low > self.span[0])
            end = high - away * (high < self.span[1])
            sides = {self.number: (begin, end), factors.name: factors.span}
            with self.telling("row"):
                self.claims.append(claim_of_factors(self.tables, numbers, sides, factors.cut))

    def of_factors(
        self, numbers: Mapping[str, str], factors: Factors, limits: Sequence[float] = ()
    ) -> None:
        """Ask for stability with all factors, and add the claims, up to a window about each limit."""
        cut, name, span = factors
        self.ask("modes", numbers, {name: [*map(repr, span)]}, cut=cut)
        first = len(self.claims)
        with self.telling(f"margin, {name}"):
            runs = claims_along(self.tables, numbers, name, span, limits, cut=cut)
            self.claims += [lines for (*_, outside), lines in runs if not outside]
        question = self.question[-1]
        low, high = map(exactly, span)
        line = covered(self.tables, ask_of(question), self.claims[first:])
        question["open"] = openings(line, [(low, high, exactly(SAME_END) * max(high, high - low))])

    def _of_set(self, kind: str, numbers: dict[str, str], rows: Columns) -> None:
        """Add the claims of rows of all that [for_all] says, and of what refutes the values beyond."""
        for at in np.flatnonzero(rows["intervals"] > 0).tolist():
            refuters = Refuters.read(str(rows["counterexample"][at]))
            above = float(rows["fails_from"][at])
            along = self.number, float(rows["low"][at]), float(rows["high"][at])
            beyond = (above, refuters.high) if above > along[2] else (np.inf, "")
            with self.telling("row for all of [for_all]"):
                self._add_row(kind, numbers, along, beyond)
            if kind == "mean square":
                continue
            below = float(rows["fails_below"][at])
            for end, text, away in ((below, refuters.low, -WINDOW), (above, refuters.high, WINDOW)):
                if np.isfinite(end):
                    with self.telling("refuted end"):
                        self.claims.append(self._refuted(numbers, end, text, away))

    def _of_walls(self, numbers: dict[str, str], rows: Columns) -> None:
        """Add the claims of rows of every wall that pushes and never pulls."""
        for at in np.flatnonzero(rows["intervals"] > 0).tolist():
            span = exactly(float(rows["low"][at])), exactly(float(rows["high"][at]))
            walls = wall_with(self.spec, numbers)
            with self.telling("row through contact"):
                walls[self.number] = span
                self.claims.append(claim_of_walls(self.tables, numbers, walls))
            refuters = Refuters.read(str(rows["counterexample"][at]))
            refuted = (
                (rows["fails_below"][at], refuters.low),
                (rows["fails_from"][at], refuters.high),
            )
            for end, text in refuted:
                if np.isfinite(end) and text.startswith(("a wall through", "a wall, in frames")):
                    walls[self.number] = (exactly(float(end)),) * 2
                    with self.telling("refuted end"):
                        self.claims.append(claim_of_motion(self.tables, numbers, walls, text))

    def _add_row(self, kind, numbers, along, beyond):
        """Add the claim of a row, or of what is left of one for late ticks beyond which no form is
        found at the places of ticks. Errors: Refused, also for what is left; Unreadable."""
        name, low, high = along
        for share in SHORT if self.spec.tick else SHORT[:1]:
            end = high - share * (high - low)
            try:
                lines = claim_of_set(self.tables, kind, numbers, (name, low, end), beyond)
            except Refused as error:
                refused = error
                continue
            self.claims.append(lines)
            if end < high:
                raise Refused(f"above {self.axis} = {end:.6g}: no forms are found")
            return
        raise refused

    def _refuted(self, numbers, end, text, away):
        """The claim that an end is refuted, or what is next to it: of a member, the end of its stable
        interval is where a mode is on the circle."""
        try:
            return claim_refuted(self.tables, numbers | {self.number: repr(end)}, text)
        except Refused:
            beyond = end + away * abs(end)
        return claim_refuted(self.tables, numbers | {self.number: repr(beyond)}, text)

    def _close(
        self, kind: str, numbers: dict[str, str], rows: Columns, claims: list[Lines]
    ) -> None:
        """Hold claims against their rows, claim the low end by itself where its drift is its own, and
        say what the rows leave open. Errors: ContradictedError."""
        part = self.question[-1]
        ask = ask_of(part)
        line = covered(self.tables, ask, claims)
        low, high = ask.sides[self.number]
        begins_at_drift = not line[0].state and len(line) > 1 and float(rows["low"][0]) == low
        if begins_at_drift and kind in ("modes", *CLAIMED.values()):
            point = numbers | {self.number: repr(self.span[0])}
            with suppress(Refused, Unreadable):
                self.claims.append(claim_at(self.tables, kind, point, float(ask.radius)))
                line = covered(self.tables, ask, [*claims, self.claims[-1]])
        if words := contradicted(line, rows):
            where = ", ".join(f"{name} = {value}" for name, value in numbers.items())
            raise ContradictedError(f"{where or self.spec.name}: {self.axis} {words}")
        own = self.number, *numbers.items()
        if own not in self.loops:
            self.loops.add(own)
            places = {*self.span, *ends_of(rows, self.span), *PLACES @ np.array(self.span)}
            self.hold_loop(numbers, {self.number: sorted(map(float, places))})
        if kind in CLAIMED.values():
            for member in filter(None, _members(self.tables)):
                self.hold_loop(numbers, {name: [value] for name, value in member.items()})
        near = exactly(SAME_END) * max(abs(low), abs(high), high - low)
        intervals = [(low, high, near)]
        if kind != "modes":
            ends = [*map(exactly, _within(rows))]
            pairs = zip(ends[::2], ends[1::2], strict=True)
            intervals = [
                (start, stop, exactly(LEFT_OPEN) * (stop - start)) for start, stop in pairs
            ]
        part["open"] = openings(line, intervals)

    @contextmanager
    def telling(self, what: str) -> Iterator[None]:
        """Keep why there is no claim."""
        limited(0, MEGABYTES)
        try:
            yield
        except (Refused, Unreadable, MemoryError) as error:
            why = str(error)
            if isinstance(error, MemoryError):
                why = f"more than {MEGABYTES} MB of memory; fewer states or messages take less"
            self.unproved[f"no proof of a {what}: {why}"] += 1
        finally:
            limited(0, 0)

    def hold_loop(self, numbers: Mapping[str, str], places: Mapping[str, list[float]]) -> None:
        """Hold the checker's loop against the engine's, by their spectral radius in doubles, at places of
        a number or a member of [for_all]. Errors: ContradictedError."""
        values = {name: [float(value)] for name, value in numbers.items()} | dict(places)
        try:
            radii = self.radii_at(values)
        except WavesweepError:  # no loop with these numbers
            return
        points = [dict(zip(values, point, strict=True)) for point in product(*values.values())]
        for point, radius, checked in zip(points, radii, self._checked(values), strict=True):
            if _same(radius, checked):
                continue
            # A mode at 1 that this point alone has is a drift where it is asked about alone.
            alone = {name: [value] for name, value in point.items()}
            (of_checker,) = self._checked(alone)
            if not (np.isnan(of_checker) or _same(*self.radii_at(alone), of_checker)):
                where = ", ".join(f"{name} = {value!r}" for name, value in point.items())
                raise ContradictedError(
                    f"{where or self.spec.name}: the spectral radius is {radius:.10g}, and {of_checker:.10g} by the checker"
                )

    def _checked(self, values: Mapping[str, Sequence[float]]) -> list[float]:
        """The checker's spectral radius of each combination of these values, NaN if it has none."""
        numbers = {name: repr(own[0]) for name, own in values.items() if len(own) == 1}
        along = {name: own for name, own in values.items() if len(own) > 1}
        points = [*product(*along.values())]
        with suppress(Refused, Unreadable):
            radii = radii_at(self.tables, numbers, along)
            if self.spec.drawing:
                return radii
            for place, point in enumerate(points):
                texts = numbers | dict(zip(along, map(repr, point), strict=True))
                clock, frame = clock_and_frame(self.spec, self.tables, texts)
                radii[place] **= max(1.0, clock / frame)
            return radii
        if not along:
            return [np.nan]
        each = [dict(zip(along, ([value] for value in point), strict=True)) for point in points]
        return [radius for point in each for radius in self._checked(dict(values) | point)]

    def radii_at(self, values: Mapping[str, list[float]]) -> list[float]:
        """Return the spectral radius of each combination of these values. Errors: WavesweepError."""
        return radius_over(self.spec, axes_asked(self.spec, values)).tolist()

    def in_words(self, name: str) -> Iterator[str]:
        """Yield what the file has, and what has no proof."""
        question = [ask_of(part) for part in self.question]
        if self.claims:
            claims = [claim_of(lines[0]) for lines in self.claims]
            covered, _ = coverage.in_words(self.tables, self.ran, question, claims)
            yield f"{name}: {count(len(claims), 'claim')}; {covered}"
        else:
            yield "no proof file"
        for why, times in self.unproved.items():
            yield f"  {why}{f' ({times} times)' * (times > 1)}"

    def write(self, place: Path) -> None:
        """Write the file."""
        write(place, self.text, self.ran, self.question, self.claims)

    def beside(self, table: Table) -> Table:
        """The table that writes the file as well, if there is a claim."""
        if not self.claims:
            return table
        name = f"{table.kind}.proof"
        facts = {**table.facts, "proof": name, "proved_spec": self.text.decode()}
        return replace(table, facts=facts, extra_files=lambda folder: self.write(folder / name))


def _same(radius: float, of_checker: float) -> bool:
    return abs(radius - of_checker) <= SAME_RADIUS * max(1.0, radius)


def covered(tables: dict, ask: coverage.Ask, claims: Sequence[Lines]) -> list[coverage.Piece]:
    """What claims prove of a part of the question, from low to high with the holes."""
    heads = [claim_of(lines[0]) for lines in claims]
    return coverage.with_holes(ask, coverage.Claims(tables, heads).pieces_of(ask))[0]


def openings(
    line: Sequence[coverage.Piece], intervals: Sequence[tuple[Fraction, Fraction, Fraction]]
) -> list[list[str]]:
    """Return the holes of a line that the question may leave open: of no more than so much in each
    interval, `(low, high, near)`."""
    holes = []
    for begin, end, state in line:
        inside = [min(end, high) - max(begin, low) <= near for low, high, near in intervals]
        if not state and all(inside):
            holes.append([decimals(begin), decimals(end)])
    return holes


def _within(rows: Columns) -> list[float]:
    """The ends of the intervals of a slice, low and high in turn."""
    pairs = np.stack([rows["low"], rows["high"]], 1)
    return pairs[np.isfinite(pairs).all(1)].ravel().tolist()


def contradicted(line: Sequence[coverage.Piece], rows: Columns) -> str:
    """Return what is proved of a slice and is not what its rows say, in words; empty if all is."""
    ends = _within(rows)
    intervals = list(zip(ends[::2], ends[1::2], strict=True))
    for piece in line:
        low, high = float(piece.low), float(piece.high)
        near = NO_CONTRADICTION * max(abs(low), abs(high))
        if piece.state in ("stable", "within", *coverage.ENERGIES.values()):
            agrees = any(begin <= low + near and high - near <= end for begin, end in intervals)
        else:
            agrees = all(high <= begin + near or end - near <= low for begin, end in intervals)
        if piece.state and not agrees:
            said = ", ".join(f"{begin:.10g} to {end:.10g}" for begin, end in intervals)
            return f"is proved {piece.state} from {low:.10g} to {high:.10g}, and stable from {said or 'nowhere'} in the table"
    return ""


def _slices(spec: Spec, columns: Columns) -> Iterator[tuple[str, dict[str, str], Columns]]:
    """Yield what rows are of, their numbers and the rows of each combination of the axes."""
    from wavesweep.program.columns import axes_of, whose_column

    axes = axes_of(columns)
    whose = whose_column(columns)
    of_slices: dict[tuple, list[int]] = {}
    for row in range(len(columns["along"])):
        kind = str(columns[whose][row]) if whose else ""
        values = tuple(columns[name][row].item() for name in axes)
        of_slices.setdefault((kind, *values), []).append(row)
    operated = any(kind == "operator" for kind, *_ in of_slices)
    for (row_kind, *own), rows in of_slices.items():
        kind = "spec" if row_kind == "free" and not operated else row_kind
        numbers = {}
        for name, value in zip(axes, own, strict=True):
            numbers[checked_name(key_named(spec, name).path)] = repr(value)
        yield kind, numbers, {name: column[rows] for name, column in columns.items()}


def ends_of(rows: Columns, span: tuple[float, float]) -> list[float]:
    """Return the ends of the intervals of a slice within the span."""
    ends = np.concatenate([rows["low"], rows["high"]])
    away = WINDOW * (span[1] - span[0])
    return np.unique(ends[(ends > span[0] + away) & (ends < span[1] - away)]).tolist()


def of_design(
    spec: Spec, source: str, overrides: Sequence[str], place: Path, found: Mapping[str, Any]
) -> Iterator[str]:
    """Write the proof of a spec's own design, and of what is known of all of [for_all], and yield
    lines that say what it proves. found: the facts of `check`. Errors: ContradictedError."""
    proofs = Proofs(spec, text_of(source), "design")
    numbers = numbers_set(spec, overrides)
    tables = proofs.tables
    radii = [1.0]
    proofs.hold_loop(numbers, {})
    with proofs.telling("the own design"):
        if spec.require and sizes_alone(spec):
            radii.append(radius_of(spec, tables, numbers))
        for radius in radii:
            proofs.ask("modes", numbers, {}, radius)
            proofs.claims.append(claim_at(tables, "modes", numbers, radius))
    for gain in gains_alone(spec):
        if isinstance(gain, Factors):
            proofs.of_factors(numbers, gain)
            continue
        proofs.ask("gain", numbers, {}, gain=gain)
        with proofs.telling("gain that is required"):
            proofs.claims += claims_of_energy(tables, numbers, "", (0.0, 0.0), gain)
    others = [words for kind, words in UNCLAIMED_FACTS.items() if found.get(kind)]
    if spec.require and not (sizes_alone(spec) or gains_alone(spec)):
        others.append(REQUIRED)
    for of_all in filter(None, map(found.get, FACTS)):
        if spec.require:
            others.append(f"{REQUIRED}, for all of [for_all]")
            continue
        verdict = of_all.get("verdict") or of_all["status"]
        kind = "for all" if of_all.get("kind", "for_all") in IN_ANY_ORDER else "mean square"
        proofs.ask(kind, numbers, {})
        for member in _members(tables):
            proofs.hold_loop(numbers, {name: [value] for name, value in member.items()})
        with proofs.telling("all of [for_all]"):
            if verdict == "proved":
                proofs.claims.append(claim_of_set(tables, kind, numbers, None))
            elif verdict == "refuted":
                proofs.claims.append(claim_refuted(tables, numbers, of_all["counterexample"]))
    if wall := found.get("contact"):
        walls = wall_with(spec, numbers)
        points = {name: decimals(low) for name, (low, _) in walls.items()}
        proofs.ask("contact", numbers | points, {})
        with proofs.telling("a wall that lets go"):
            if wall["verdict"] == "proved":
                proofs.claims.append(claim_of_walls(tables, numbers, walls))
            elif wall["verdict"] == "refuted":
                proofs.claims.append(
                    claim_of_motion(tables, numbers, walls, wall["counterexample"])
                )
    for limit in () if spec.require else found["limits"]:
        if limit["certified"] and not limit["stopped"]:
            proofs.of_limit(numbers, limit)
    for words in others:
        proofs.ask(words, numbers, {})
        proofs.unproved[f"no proof file for {words}"] += 1
    if proofs.claims:
        proofs.write(place)
    yield from proofs.in_words(str(place))


def checked(proof: Path, facts: Mapping[str, Any], columns: Columns) -> Iterator[tuple[str, bool]]:
    """Yield what the checker says of the proof file of a table, and whether a claim, or the file, is
    refused, or contradicts the table. facts, columns: of the table, none if it is damaged."""
    proved = []
    refused = []
    contradictions: list[str] = []
    try:
        with proof.open("rb") as opened:
            of_spec = read(facts["proved_spec"].encode(), opened)
            for claim, why in of_spec.claims:
                if why:
                    refused.append(f"{proof}: refused: {in_words(claim)}: {why}")
                else:
                    proved.append(claim)
        covered, _ = coverage.in_words(of_spec.tables, of_spec.ran, of_spec.question, proved)
        if columns and of_spec.ran == "sweep":
            contradictions += [
                f"{proof}: {words}"
                for words in _contradictions(of_spec, proved, load(facts["spec"]), columns)
            ]
        elif columns and "cut" in facts:
            rows = offered("of_margins").missing(of_spec.question, columns, facts)
            contradictions += [f"{proof}: {words}" for words in rows]
        elif columns and "port_passive" in columns:
            spec = load(facts["spec"])
            rows = offered("of_ports").missing(of_spec.tables, of_spec.question, spec, columns)
            contradictions += [f"{proof}: {words}" for words in rows]
    except (Unreadable, OSError) as error:
        yield f"{proof}: cannot be checked: {error}", True
        return
    yield from ((text, True) for text in refused + contradictions)
    claims = len(proved) + len(refused)
    yield f"{proof}: {len(proved)} of {claims} claims proved by the checker; {covered}", False


def _contradictions(
    of_spec: Proof, proved: Sequence, spec: Spec, columns: Columns
) -> Iterator[str]:
    """Yield what a table has and its proof file does not ask about, or proves otherwise."""
    tables = of_spec.tables
    claims = coverage.Claims(tables, proved)
    for kind, own, rows in _slices(spec, columns):
        answers = {CLAIMED.get(kind, kind)}
        if kind in OWN:
            answers = {
                "modes" if isinstance(gain, Factors) else "gain" for gain in gains_alone(spec)
            }
            answers = answers or {"modes"}
        where = ", ".join(f"{name} = {value}" for name, value in own.items()) or "own numbers"
        numbers = {path_of(tables, name): Fraction(value) for name, value in own.items()}
        if not answers & (coverage.SCOPES.keys() | {"gain"}) or (spec.require and kind not in OWN):
            continue
        answered = False
        for ask in of_spec.question:
            asked = {path_of(tables, name): value for name, value in ask.numbers.items()}
            if ask.claim in answers and numbers.items() <= asked.items():
                answered = True
                line, _ = coverage.with_holes(ask, claims.pieces_of(ask))
                if words := contradicted(line, rows):
                    yield f"{where}: {words}"
        if not answered:
            yield f"{where}: a row of the table, of which the file does not ask"
