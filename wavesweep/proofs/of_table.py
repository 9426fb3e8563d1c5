"""Proof files beside tables of stable intervals, and of the verdict on a spec's own design."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.checker.__main__ import in_words
from wavesweep.checker.balls import Refused
from wavesweep.checker.file import check, spec_of
from wavesweep.checker.reader.loops import Unreadable
from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses.asked import key_named
from wavesweep.program.number_words import rounded_up
from wavesweep.program.spec import SYMBOLS, Spec, sweep_axes
from wavesweep.program.tables.kind import count
from wavesweep.program.tables.refuters import Refuters, in_a_sentence
from wavesweep.proofs.cells import WINDOW, exactly
from wavesweep.proofs.claims import (
    Found,
    Lines,
    claim_of_plane,
    claim_of_point,
    claim_of_set,
    claim_refuted,
    claims_along,
    frame_of,
    write,
)
from wavesweep.proofs.planes import Part
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
}  # kinds of rows
UNCLAIMED_FACTS = {"every_hand": "every passive hand"}
FACTS = "for_all", "at_random", "tick"  # of `check`
IN_ANY_ORDER = "for_all", "messages"  # their kinds that are not about means
IN_WORDS = {"for all": "stable", "mean square": "stable in mean square"}
ORDINALS = "first", "second", "third"  # in the columns of a map
REQUIRED = "what [sweep] require asks for"
SLICES, ROWS, REFUTED = "slices", "rows for all of [for_all]", "refuted ends"
THROUGH_CONTACT = "rows through contact"
SHORT = 0.0, 1e-3, 1e-2, 3e-2  # of a row: how much of it a claim may leave out at its high end
SAME_END = 4 * WINDOW  # of an end or of the range: how far a row and its proof may differ


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
    file has, and what has no proof."""
    text = text_of(source)
    numbers = numbers_set(spec, overrides)
    if spec.require and not sizes_alone(spec):
        say(f"no proof file for {REQUIRED}")
        return table
    along, _ = sweep_axes(spec, str(table.columns["along"][0]))
    proofs = _Proofs(
        spec, text, along.name, checked_name(along.path), (float(along.start), float(along.stop))
    )
    others = set()
    for kind, own, rows in _slices(spec, table.columns):
        if kind in OWN:
            proofs.of_slice(numbers | own, rows)
        elif kind == "contact":
            proofs.of_walls(numbers | own, rows)
        elif kind in CLAIMED and not spec.require:
            proofs.of_set(CLAIMED[kind], numbers | own, rows)
        else:
            of_all = f"{REQUIRED}, for all of [for_all]"
            others.add(of_all if kind in CLAIMED else UNCLAIMED.get(kind, kind))
    for line in proofs.in_words(f"{table.kind}.proof"):
        say(line)
    if others:
        say(f"no proof file for {', '.join(sorted(others))}")
    if not proofs.claims:
        return table

    return _with_file(table, text, proofs.claims)


def sizes_alone(spec: Spec) -> bool:
    """Return whether a spec requires nothing but sizes of modes: a radius, or times in which they
    decay."""
    required: Any = spec.require
    bound = required.bound
    return not (bound.gains or bound.damped or bound.bounded)


def radius_of(spec: Spec, tables: dict, numbers: Mapping[str, str]) -> float:
    """Return the radius within which a spec with these numbers requires modes to be at the end of a
    frame."""
    required: Any = spec.require
    frame = frame_of(tables, numbers)
    if spec.drawing:
        clock = 1 / spec.tick_hz
    else:  # T_s, whatever runs at the slow rate
        own = {path: str(spec.own(path)) for path in ("rates.ratio", "rates.fast_hz")} | {**numbers}
        clock = float(own["rates.ratio"]) / float(own["rates.fast_hz"])
    return float(required.bound.over(clock / frame).radius_of(np.array(frame)))


def wall_with(spec: Spec, numbers: Mapping[str, str]) -> dict[str, tuple[Fraction, Fraction]]:
    """Return the numbers of the wall, each as a range of one value."""
    found = {}
    for path in spec.wall:
        name = checked_name(path)
        value = exactly(float(numbers.get(name, spec.own(path))))
        found[name] = value, value
    return found


def _with_file(table: Table, text: bytes, claims: Sequence[Lines]) -> Table:
    """The table that writes these claims about a text as well."""
    name = f"{table.kind}.proof"

    def more(folder: Path) -> None:
        write(folder / name, text, claims)

    facts = {**table.facts, "proof": name, "proved_spec": text.decode()}
    return replace(table, facts=facts, extra_files=more)


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
    return _with_file(table, text, [lines])


@dataclass(slots=True, eq=False)
class _Proofs:
    """The claims of the rows of a table, and what has none.

    text: of the spec, as its file has it. axis, number: along which rows are, and its name for the checker; span: its
    range. proved, wanted: slices, and ends that are refuted. unproved: why some are not. begins: from
    where on rows are proved whose low ends are not.
    """

    spec: Spec
    text: bytes
    axis: str
    number: str
    span: tuple[float, float]
    claims: list[Lines] = field(default_factory=list)
    proved: Counter[str] = field(default_factory=Counter)
    wanted: Counter[str] = field(default_factory=Counter)
    unproved: Counter[str] = field(default_factory=Counter)
    begins: float = 0.0

    def of_slice(self, numbers: dict[str, str], rows: Columns) -> None:
        """Add the claims of the spec's own loop along the number."""
        ends = ends_of(rows, self.span)
        with self._counted(SLICES):
            tables = spec_of(self.text)
            radius = radius_of(self.spec, tables, numbers) if self.spec.require else 1.0
            found = list(claims_along(tables, numbers, self.number, self.span, ends, radius))
            self.claims += [lines for _, lines in found]
            if end := end_without_proof(rows, [stretch for stretch, _ in found], self.span):
                raise Refused(f"other ends than {self.axis} = {end:.10g}")

    def of_set(self, kind: str, numbers: dict[str, str], rows: Columns) -> None:
        """Add the claims of rows of all that [for_all] says, and of what refutes the values beyond."""
        for at in np.flatnonzero(rows["intervals"] > 0).tolist():
            refuters = Refuters.read(str(rows["counterexample"][at]))
            above = float(rows["fails_from"][at])
            along = self.number, float(rows["low"][at]), float(rows["high"][at])
            beyond = (above, refuters.high) if above > along[2] else (np.inf, "")
            with self._counted(ROWS):
                self._add_row(kind, numbers, along, beyond)
            if kind == "mean square":
                continue
            below = float(rows["fails_below"][at])
            for end, text, away in ((below, refuters.low, -WINDOW), (above, refuters.high, WINDOW)):
                if np.isfinite(end):
                    with self._counted(REFUTED):
                        self.claims.append(self._refuted(numbers, end, text, away))

    def of_walls(self, numbers: dict[str, str], rows: Columns) -> None:
        """Add the claims of rows of every wall that pushes and never pulls."""
        for at in np.flatnonzero(rows["intervals"] > 0).tolist():
            span = exactly(float(rows["low"][at])), exactly(float(rows["high"][at]))
            walls = wall_with(self.spec, numbers)
            with self._counted(THROUGH_CONTACT):
                walls[self.number] = span
                self.claims.append(claim_of_walls(spec_of(self.text), numbers, walls))
            refuters = Refuters.read(str(rows["counterexample"][at]))
            refuted = (
                (rows["fails_below"][at], refuters.low),
                (rows["fails_from"][at], refuters.high),
            )
            for end, text in refuted:
                if np.isfinite(end) and text.startswith("a wall through"):
                    walls[self.number] = (exactly(float(end)),) * 2
                    with self._counted(REFUTED):
                        self.claims.append(
                            claim_of_motion(spec_of(self.text), numbers, walls, text)
                        )

    def _add_row(self, kind, numbers, along, beyond):
        """Add the claim of a row, or of what is left of one for late ticks beyond which no form is
        found at the places of ticks. Errors: Refused, also for what is left; Unreadable."""
        name, low, high = along
        for share in SHORT if self.spec.tick else SHORT[:1]:
            end = high - share * (high - low)
            try:
                lines = claim_of_set(spec_of(self.text), kind, numbers, (name, low, end), beyond)
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
            return claim_refuted(spec_of(self.text), numbers | {self.number: repr(end)}, text)
        except Refused:
            beyond = end + away * abs(end)
        return claim_refuted(spec_of(self.text), numbers | {self.number: repr(beyond)}, text)

    @contextmanager
    def _counted(self, what: str) -> Iterator[None]:
        self.wanted[what] += 1
        try:
            yield
            self.proved[what] += 1
        except (Refused, Unreadable) as error:
            self.unproved[f"{what}: {error}"] += 1

    def in_words(self, name: str) -> Iterator[str]:
        """Yield what the file has, and what has no proof."""
        counts = [f"{self.proved[what]} of {wanted} {what}" for what, wanted in self.wanted.items()]
        if counts:
            prove = "proves" if len(self.claims) == 1 else "prove"
            yield f"{name}: {count(len(self.claims), 'claim')} {prove} {', '.join(counts)}"
        if self.begins:
            yield f"  {self.axis} from {rounded_up(self.begins, 3)} on: next to lower ends no form is found"
        for why, unproved in self.unproved.items():
            yield f"  no proof of {unproved} {why}"


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
    for (kind, *own), rows in of_slices.items():
        numbers = {}
        for name, value in zip(axes, own, strict=True):
            numbers[checked_name(key_named(spec, name).path)] = repr(value)
        yield kind, numbers, {name: column[rows] for name, column in columns.items()}


def ends_of(rows: Columns, span: tuple[float, float]) -> list[float]:
    """Return the ends of the intervals of a slice within the span."""
    ends = np.concatenate([rows["low"], rows["high"]])
    away = WINDOW * (span[1] - span[0])
    return np.unique(ends[(ends > span[0] + away) & (ends < span[1] - away)]).tolist()


def end_without_proof(
    rows: Columns, stretches: Sequence[Found], span: tuple[float, float]
) -> float:
    """Return an end of an interval that no stable stretch has; 0 if all have one."""
    for low, high in zip(rows["low"], rows["high"], strict=True):
        if np.isnan(low):
            continue
        near = SAME_END * max(abs(low), abs(high), span[1] - span[0])
        if not any(
            outside == 0 and abs(start - low) <= near and abs(stop - high) <= near
            for start, stop, outside in stretches
        ):
            return float(high)
    return 0.0


def of_design(
    spec: Spec, source: str, overrides: Sequence[str], place: Path, found: Mapping[str, Any]
) -> Iterator[str]:
    """Write the proof of a spec's own design, and of what is known of all of [for_all], and yield
    lines that say what it proves. found: the facts of `check`."""
    text = text_of(source)
    numbers = numbers_set(spec, overrides)
    claims: list[Lines] = []
    unproved = [
        f"no proof file for {words}" for kind, words in UNCLAIMED_FACTS.items() if found.get(kind)
    ]
    if spec.require and not sizes_alone(spec):
        unproved.append(f"no proof file for {REQUIRED}")
    try:
        if of_point := claim_of_point(spec_of(text), numbers):
            outside, lines = of_point
            claims.append(lines)
            if spec.require and sizes_alone(spec):
                radius = radius_of(spec, spec_of(text), numbers)
                required = claim_of_point(spec_of(text), numbers, radius)
                claims += [required[1]] if required else []
            said = (
                f"{outside} modes outside the unit circle"
                if outside
                else "the spec's own design is stable"
            )
            yield f"{place}: {said}, with its own numbers"
        else:
            unproved.append("no proof file: an eigenvalue is next to the unit circle")
    except (Refused, Unreadable) as error:
        unproved.append(f"no proof file: {error}")
    for of_all in map(found.get, FACTS):
        if not of_all:
            continue
        if spec.require:
            unproved.append(f"no proof file for {REQUIRED}, for all of [for_all]")
            continue
        verdict = of_all.get("verdict") or of_all["status"]
        kind = "for all" if of_all.get("kind", "for_all") in IN_ANY_ORDER else "mean square"
        try:
            if verdict == "proved":
                claims.append(claim_of_set(spec_of(text), kind, numbers, None))
                yield f"{place}: {IN_WORDS[kind]} for all of [for_all]"
            elif verdict == "refuted":
                claims.append(claim_refuted(spec_of(text), numbers, of_all["counterexample"]))
                yield f"{place}: unstable with {in_a_sentence(of_all['counterexample'])}"
        except (Refused, Unreadable) as error:
            unproved.append(f"no proof file for all of [for_all]: {error}")
    wall = found.get("contact", {"verdict": ""})
    try:
        if wall["verdict"] == "proved":
            claims.append(claim_of_walls(spec_of(text), numbers, wall_with(spec, numbers)))
            yield f"{place}: comes to rest at any wall that pushes and never pulls"
        elif wall["verdict"] == "refuted":
            refuted = wall["counterexample"]
            claims.append(
                claim_of_motion(spec_of(text), numbers, wall_with(spec, numbers), refuted)
            )
            yield f"{place}: refuted through contact by {in_a_sentence(refuted)}"
        elif wall["verdict"]:
            unproved.append(f"no proof file for a wall that lets go: {wall['verdict']}")
    except (Refused, Unreadable) as error:
        unproved.append(f"no proof file for a wall that lets go: {error}")
    if claims:
        write(place, text, claims)
    yield from unproved


def checked(proof: Path, spec: str) -> Iterator[tuple[str, bool]]:
    """Yield what the checker says of a proof file about the text of a spec, and whether a claim, or
    the file, is refused."""
    proved = 0
    refused = []
    try:
        with proof.open("rb") as opened:
            for claim, why in check(spec.encode(), opened):
                proved += not why
                if why:
                    refused.append(f"{proof}: refused: {in_words(claim)}: {why}")
    except (Unreadable, OSError) as error:
        yield f"{proof}: cannot be checked: {error}", True
        return
    yield from ((text, True) for text in refused)
    yield f"{proof}: {proved} of {proved + len(refused)} claims proved by the checker", False
