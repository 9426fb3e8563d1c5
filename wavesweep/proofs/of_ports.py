"""Proof files beside tables of passivity: the hand's port and the wave channel at each combination of the axes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.checker import balls, file
from wavesweep.checker.balls import Refused
from wavesweep.checker.coverage import Ask
from wavesweep.checker.gain import Gain
from wavesweep.checker.port import PUSH
from wavesweep.checker.reader import path_of
from wavesweep.checker.reader.loops import INPUT, OUTPUT
from wavesweep.proofs.cells import exactly
from wavesweep.proofs.claims import times_of
from wavesweep.proofs.drifts import drifts_of
from wavesweep.proofs.gains import claims_of_energy, frame_terms, of_waves
from wavesweep.proofs.of_table import (
    ContradictedError,
    Proofs,
    checked_name,
    numbers_set,
    text_of,
)

if TYPE_CHECKING:
    from wavesweep.program.columns import Columns
    from wavesweep.program.spec import Spec
    from wavesweep.program.tables.table import Table

SAME_SIZE = 1e-6  # of a norm, or of a margin and the mean eigenvalue


def of_passivity(
    table: Table, spec: Spec, source: str, overrides: Sequence[str], say: Callable[[str], None]
) -> Table:
    """Return a table of passivity that writes its proof file as well. say: is called with what the file
    has, and what has no proof. Errors: ContradictedError."""
    proofs = Proofs(spec, text_of(source), "design")
    set_by_user = numbers_set(spec, overrides)
    for row, axes in enumerate(_combinations(spec, table.columns)):
        numbers = set_by_user | axes
        columns = {name: column[row].item() for name, column in table.columns.items()}
        proofs.hold_loop(numbers, {})
        proofs.ask("port", numbers, {})
        with proofs.telling("port"):
            _hold_margin(proofs, numbers, columns["port_margin"], columns["port_omega"])
            if not columns["port_passive"]:
                raise Refused("it is not passive, or not stable")
            proofs.claims += claims_of_energy(proofs.tables, numbers, "", (0.0, 0.0), None)
        if np.isfinite(norm := columns["channel_norm"]):
            gain = of_waves(norm)
            proofs.ask("gain", numbers, {}, gain=gain)
            with proofs.telling("wave channel"):
                _hold_norm(proofs, numbers, gain, norm, columns["channel_omega"])
                proofs.claims += claims_of_energy(proofs.tables, numbers, "", (0.0, 0.0), gain)
        if "ports_margin" in columns:
            proofs.unproved["no proof file for both ports"] += 1
            proofs.ask("both ports", numbers, {})
    for line in proofs.in_words(f"{table.kind}.proof"):
        say(line)
    return proofs.beside(table)


def missing(tables: dict, question: Sequence[Ask], spec: Spec, columns: Columns) -> Iterator[str]:
    """Yield the rows of a table whose port is passive, and of which a question does not ask."""
    asked = []
    for ask in question:
        if ask.claim == "port":
            asked.append({path_of(tables, name): x for name, x in ask.numbers.items()}.items())
    for axes, passive in zip(_combinations(spec, columns), columns["port_passive"], strict=True):
        row = {path_of(tables, name): exactly(float(x)) for name, x in axes.items()}.items()
        if passive and not any(row <= numbers for numbers in asked):
            where = ", ".join(f"{name} = {value}" for name, value in axes.items())
            yield f"{where or 'own numbers'}: a row of the table, of which the file does not ask"


def _combinations(spec: Spec, columns: Columns) -> Iterator[dict[str, str]]:
    """Yield the numbers of the axes in each row."""
    axes = {axis.name: checked_name(axis.path) for axis in spec.sweep if axis.values}
    for row in range(len(columns["port_passive"])):
        yield {of_checker: repr(columns[name][row].item()) for name, of_checker in axes.items()}


def _hold_margin(proofs: Proofs, numbers: Mapping[str, str], margin: float, omega: float) -> None:
    """Hold the checker's port against a margin at a frequency (rad/s) that is not 0. Errors: ContradictedError."""
    z = np.exp(1j * omega * times_of(proofs.tables, numbers)[1])
    if not abs(z - 1) > SAME_SIZE:
        return
    family = _family(proofs, file.Claim("port", _exact(numbers)))
    rows = family.frames.matrix("", balls.POINT)
    states = sorted(name for name in rows if not name.startswith((INPUT, OUTPUT, PUSH)))
    G, D = _response(rows, states, z)
    _hold(
        proofs,
        "margin at the hand's port",
        margin,
        np.linalg.eigvalsh((G + G.conj().T) / 2)[0],
        np.trace(D) / len(D),
    )


def _hold_norm(
    proofs: Proofs, numbers: Mapping[str, str], gain: Gain, norm: float, omega: float
) -> None:
    """Hold the checker's wave channel against a norm at a frequency (rad/s). Errors: ContradictedError."""
    z = np.exp(1j * omega * times_of(proofs.tables, numbers)[1])
    family = _family(proofs, file.Claim("gain", _exact(numbers), gain=gain))
    G, _ = _response(family.rows("", balls.POINT), family.states, z)
    _hold(proofs, "norm of the wave channel", norm, np.linalg.norm(G, 2), 0.0)


def _exact(numbers: Mapping[str, str]) -> dict[str, Fraction]:
    return {name: exactly(float(x)) for name, x in numbers.items()}


def _family(proofs: Proofs, claim: file.Claim) -> file.Family:
    claim.drifts = drifts_of(proofs.tables, claim)
    return file.family_of(proofs.tables, claim)


def _response(rows: dict, states: Sequence[str], z: complex) -> tuple[np.ndarray, np.ndarray]:
    """The response of a frame at a point of the unit circle, and what goes through at once."""
    (M,) = frame_terms(balls.POINT, rows, states)
    n = len(states)
    D = M[n:, n:]
    return D + M[n:, :n] @ np.linalg.solve(z * np.eye(n) - M[:n, :n], M[:n, n:]), D


def _hold(proofs: Proofs, words: str, value: float, of_checker: float, scale: float) -> None:
    if abs(of_checker - value) > SAME_SIZE * (abs(value) + scale):
        raise ContradictedError(
            f"{proofs.spec.name}: the {words} is {value:.10g}, and {of_checker:.10g} by the checker"
        )
