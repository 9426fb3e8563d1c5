"""Proof files beside tables of stable intervals, and of the verdict on a spec's own design."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.checker.__main__ import in_words
from wavesweep.checker.balls import Refused
from wavesweep.checker.file import check, spec_of
from wavesweep.checker.reader.loops import Unreadable
from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import SYMBOLS, Spec, sweep_axes
from wavesweep.proofs.cells import WINDOW
from wavesweep.proofs.claims import Found, Lines, claim_of_point, claims_along, write

if TYPE_CHECKING:
    from wavesweep.program.columns import Columns
    from wavesweep.program.tables.table import Table

OWN = ("", "spec", "operator")  # rows of the spec's own loop
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
    file has."""
    text = text_of(source)
    numbers = numbers_set(spec, overrides)
    along, _ = sweep_axes(spec, str(table.columns["along"][0]))
    number = checked_name(along.path)

    def more(folder: Path) -> None:
        claims: list[Lines] = []
        unproved: Counter[str] = Counter()
        proved = 0
        span = float(along.start), float(along.stop)
        for own, rows in _slices(spec, table.columns):
            try:
                found = list(
                    claims_along(spec_of(text), numbers | own, number, span, ends_of(rows, span))
                )
            except (Refused, Unreadable) as error:
                unproved[str(error)] += 1
                continue
            claims += [lines for _, lines in found]
            missing = end_without_proof(rows, [stretch for stretch, _ in found], span)
            proved += not missing
            unproved[f"other ends than {along.name} = {missing:.10g}"] += bool(missing)
        write(folder / f"{table.kind}.proof", text, claims)
        say(
            f"{table.kind}.proof: {len(claims)} claims prove {proved} of {proved + unproved.total()} slices"
        )
        for why, slices in unproved.items():
            if slices:
                say(f"  no proof of {slices} slices: {why}")

    kinds = sorted({*table.columns.get("guarantee", table.columns.get("hand", []))} - {*OWN})
    if kinds:
        say(f"no proof file for rows of {', '.join(kinds)}")
    facts = {**table.facts, "proof": f"{table.kind}.proof", "proved_spec": text.decode()}
    return replace(table, facts=facts, extra_files=more)


def _slices(spec: Spec, columns: Columns) -> Iterator[tuple[dict[str, str], Columns]]:
    """Yield the numbers and the rows of each combination of the axes that are of the own loop."""
    from wavesweep.program.analyses.asked import key_named
    from wavesweep.program.columns import axes_of, whose_column

    axes = axes_of(columns)
    whose = whose_column(columns)
    own = (
        np.isin(columns[whose].astype(str), OWN) if whose else np.ones(len(columns["along"]), bool)
    )
    of_slices: dict[tuple, list[int]] = {}
    for row in np.flatnonzero(own).tolist():
        of_slices.setdefault(tuple(columns[name][row].item() for name in axes), []).append(row)
    for values, rows in of_slices.items():
        numbers = {}
        for name, value in zip(axes, values, strict=True):
            numbers[checked_name(key_named(spec, name).path)] = repr(value)
        yield numbers, {name: column[rows] for name, column in columns.items()}


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


def of_design(spec: Spec, source: str, overrides: Sequence[str], place: Path) -> str:
    """Write the proof of a spec's own design, and say in a line what it proves."""
    text = text_of(source)
    try:
        found = claim_of_point(spec_of(text), numbers_set(spec, overrides))
    except (Refused, Unreadable) as error:
        return f"no proof file: {error}"
    if found is None:
        return "no proof file: an eigenvalue is next to the unit circle"
    outside, lines = found
    write(place, text, [lines])
    said = (
        f"{outside} modes outside the unit circle" if outside else "the spec's own design is stable"
    )
    return f"{place}: {said}, with its own numbers"


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
