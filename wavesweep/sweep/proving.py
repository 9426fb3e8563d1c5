"""Columns of drawn loops that doubles leave in doubt, computed again in ball arithmetic and put in place of their rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep.errors import IllPosedLoopError
from wavesweep.spec.drawing import Drawing
from wavesweep.stability import Intervals
from wavesweep.stability.certificate import NONE
from wavesweep.sweep.drawn_loops import Groups, drift_of
from wavesweep.sweep.grid import selected
from wavesweep.sweep.tasks import RECORD

TRIED = (("tried", "?"), ("bits", "<i4"), ("way", "i1"))  # bits: of the arithmetic, 0 if the column stays in doubt
PROVED_RECORD = np.dtype([*RECORD.descr, *TRIED])
PROOF = tuple(name for name, _ in TRIED)
MOST_LOOPS = 32  # of a chunk: a column takes from hundredths of a second to some ten seconds


def with_proofs(
    found: Intervals, drawing: Drawing, groups: Groups, along: str, span: tuple[float, float]
) -> tuple[Intervals, dict[int, tuple[int, int]]]:
    """Intervals with those that are proved in place of those in doubt, and bits and way of each column that was in doubt.

    found: by slices. groups: see `DrawnTask`.
    """
    from wavesweep.prove import prove_column, proved_intervals

    proofs, tried = {}, {}
    for column in np.unique(found.column[found.doubt != NONE]).tolist():
        values, proof = _values(groups, column), None
        with suppress(IllPosedLoopError):
            drift = drift_of(drawing, values | {along: np.array(span)})
            proof = prove_column(drawing, values, along, span, len(drift.states) - len(drift.kept))
        tried[column] = (proof.bits, proof.way) if proof else (0, 0)
        if proof:
            proofs[column] = proof
    if not proofs:
        return found, tried
    columns, new = np.array(list(proofs)), proved_intervals(list(proofs.values()))
    whole = Intervals.join([found.take(~np.isin(found.column, columns)), replace(new, column=columns[new.column])])
    return whole.take(np.argsort(whole.column, kind="stable")), tried


def _values(groups, column):
    """The flat values of one slice as plain numbers."""
    members, values = next(each for each in groups if column in each[0])
    loop = selected(values, int(np.searchsorted(members, column)))
    return {path: value.item() if isinstance(value, np.generic) else value for path, value in loop.items()}


def with_tries(records: np.ndarray, tried: Mapping[int, tuple[int, int]]) -> np.ndarray:
    """The records with the fields about proofs."""
    found = np.zeros(records.size, PROVED_RECORD)
    for name in records.dtype.names:
        found[name] = records[name]
    for column, (bits, way) in tried.items():
        rows = found["slice"] == column
        found["tried"][rows], found["bits"][rows], found["way"][rows] = True, bits, way
    return found


def facts_of_proofs(chunks: Iterable[np.ndarray]) -> dict[str, Any]:
    """The facts about proofs: how many columns were in doubt, how many of these are proved, with so many bits, and how."""
    from wavesweep.prove import WAYS

    tried, bits, ways = 0, Counter(), Counter()
    for records in chunks:
        first = records[(records["interval"] == 0) & records["tried"]]
        tried += first.size
        bits.update(first["bits"][first["bits"] > 0].tolist())
        ways.update(first["way"][first["bits"] > 0].tolist())
    return {
        "in_doubt": tried,
        "columns": bits.total(),
        "bits": {str(number): bits[number] for number in sorted(bits)},
        "ways": {WAYS[way]: ways[way] for way in sorted(ways)},
    }


def notice_of(facts: Mapping[str, Any]) -> str:
    """A line about proofs; facts: see `facts_of_proofs`."""
    if not facts["in_doubt"]:
        return "--prove: no column was in doubt"
    most = max(map(int, facts["bits"]), default=0)
    how = f", with up to {most} bits" if most else ""
    return f"--prove: {facts['columns']} of {facts['in_doubt']} columns in doubt are proved in ball arithmetic{how}"
