"""Proof files beside tables of margins: factors of the signal with which a loop is stable, and levels
of its sensitivities."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wavesweep.checker.coverage import Ask
from wavesweep.checker.factor import FACTOR, PHASE
from wavesweep.checker.gain import Gain
from wavesweep.proofs.cells import exactly
from wavesweep.proofs.gains import ABOVE, claims_of_energy
from wavesweep.proofs.of_table import (
    Factors,
    Proofs,
    numbers_set,
    text_of,
)

if TYPE_CHECKING:
    from wavesweep.program.columns import Columns
    from wavesweep.program.spec import Spec
    from wavesweep.program.tables.table import Table

LESS = {"sensitivity": "0", "complementary": "1", "disk": "1/2"}  # of 1/(1 + L), of peaks
IN_DISK = "disk_gain", "disk_phase"  # what follows from the disk
HALF_TURN = 180.0  # deg


class Part(NamedTuple):
    """What a margin says of a loop.

    name: of the margin. sides: a factor or a phase with its ends. limits: those of them beyond which
    the loop is not stable. gain: a level of a function of 1/(1 + L), None without an inequality.
    """

    name: str
    sides: dict[str, tuple[float, float]]
    limits: Sequence[float] = ()
    gain: Gain | None = None


def of_margins(
    table: Table, spec: Spec, source: str, overrides: Sequence[str], say: Callable[[str], None]
) -> Table:
    """Return a table of margins that writes its proof file as well. say: is called with what the file
    has, and what has no proof."""
    proofs = Proofs(spec, text_of(source), "design")
    numbers = numbers_set(spec, overrides)
    cut = str(table.facts["cut"])
    proofs.hold_loop(numbers, {})
    for part in _parts(table.columns, table.facts):
        if part.sides:
            ((name, span),) = part.sides.items()
            proofs.of_factors(numbers, Factors(cut, name, span), part.limits)
        elif part.gain:
            proofs.ask("gain", numbers, {}, gain=part.gain)
            with proofs.telling(f"level of {part.name}"):
                proofs.claims += claims_of_energy(proofs.tables, numbers, "", (0.0, 0.0), part.gain)
        else:
            proofs.unproved[f"no proof file for {part.name} at {cut}"] += 1
            proofs.ask(f"{part.name} at {cut}", numbers, {})
    for line in proofs.in_words(f"{table.kind}.proof"):
        say(line)
    return proofs.beside(table)


def missing(question: Sequence[Ask], columns: Columns, facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield the margins of a table that a question does not ask about as the table has them."""
    asked = [(ask.gain, ask.sides) for ask in question]
    for part in _parts(columns, facts):
        sides = {name: tuple(map(exactly, span)) for name, span in part.sides.items()}
        if (part.sides or part.gain) and (part.gain, sides) not in asked:
            yield f"{part.name}: a row of the table, of which the file does not ask"


def _parts(columns: Columns, facts: Mapping[str, Any]) -> Iterator[Part]:
    """Yield what the margins of the spec's own numbers say, and what has no inequality here: those that
    are not certified, and all of [for_all]."""
    whose = columns.get("guarantee", np.full(len(columns["cut"]), "spec", object))
    if (whose != "spec").any():
        yield Part("margins for all of [for_all]", {})
    rows = {}
    for row in np.flatnonzero(whose == "spec").tolist():
        name = str(columns["margin"][row])
        if columns["certified"][row]:
            rows[name] = float(columns["value"][row]), bool(columns["limited"][row])
        elif name not in IN_DISK:
            yield Part(f"{name}, not certified,", {})
    low, has_low = rows.pop("gain_down", (1.0, False))
    high, has_high = rows.pop("gain_up", (1.0, False))
    if low < high:
        limits = [low] * has_low + [high] * has_high
        yield Part("gain", {FACTOR: (low, high)}, limits)
    for name, (value, limited) in rows.items():
        if name == "phase":
            limits = [value] * (limited and value < HALF_TURN)
            yield Part(name, {PHASE: (0.0, value)}, limits)
        elif name not in IN_DISK:
            yield Part(name, {}, gain=_gain(name, value, facts) if limited else None)


def _gain(name: str, value: float, facts: Mapping[str, Any]) -> Gain | None:
    """The level of a margin. A disk of several samples is that of one factor on all, no gain."""
    if name not in LESS or (name == "disk" and facts["times"] > 1):
        return None
    peak = 1 / value if name == "disk" else value
    return Gain("", "", str(facts["cut"]), Fraction(LESS[name]), exactly(peak * ABOVE))
