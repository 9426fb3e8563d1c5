"""Cells of gains that stay below a level along a number, each with a form of the bounded real lemma."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from scipy import linalg

from wavesweep.checker import balls, file, form
from wavesweep.checker.balls import Refused
from wavesweep.checker.gain import Gain, stays_below
from wavesweep.checker.reader.loops import INPUT, OUTPUT
from wavesweep.proofs.cells import Cell, Find, cells_between, exactly, stretches, tree, written
from wavesweep.proofs.drifts import drifts_of
from wavesweep.proofs.sets import decimals

SHARES = 0.3, 0.03, 3e-3, 3e-4, 1e-5, 1e-7, 1e-9  # of a state's energy that a form loses besides
ENOUGH = 1e-3  # of such a share, that the inequality has left
NEAREST = 0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4  # of a range, from its end to a form
NO_RIMS = np.nan, np.nan  # no end of a range is next to the unit circle
PLACES = -1.0, 0.0, 1.0  # of a cell, at which forms are found
UNSEEN = 1e-9  # energy of a state that the output does not show, of the largest
Ball = dict[str, tuple[float, float]]


def gain_of(bound: Any) -> Gain | None:
    """Return what the checker knows a bound of [sweep] require by; None of one that is not of a gain
    over a frame at all frequencies."""
    level = exactly(bound.at_most) if hasattr(bound, "at_most") else None
    if hasattr(bound, "centre"):
        return Gain("", "", bound.cut, exactly(bound.centre), level)
    if bound.word == "gain" and level and bound.band_hz is None:
        return Gain(bound.source, bound.signal, "", Fraction(0), level)
    return None


def in_file(gain: Gain) -> dict[str, str]:
    """Return a gain as a file has it."""
    names = {"from": gain.source, "to": gain.signal}
    if gain.cut:
        names = {"cut": gain.cut, "less": decimals(gain.less)}
    return names | {"at_most": decimals(gain.at_most)}


def claims_of_gain(
    tables: dict,
    numbers: Mapping[str, str],
    name: str,
    span: tuple[float, float],
    gain: Gain,
) -> list[list[dict[str, Any]]]:
    """Return the lines of claims that a gain stays below its level all over the ranges of a number in
    which forms are found, or at the spec's own numbers if `name` is empty.

    numbers: the others that are set. Errors: Refused, Unreadable.
    """
    sides = {name: (exactly(span[0]), exactly(span[1]))} if name else {}
    claim = file.Claim(
        "gain", {key: exactly(float(x)) for key, x in numbers.items()}, sides, gain=gain
    )
    claim.drifts = drifts_of(tables, claim)
    family = file.family_of(tables, claim)
    head: dict[str, Any] = {
        "claim": "gain",
        "gain": in_file(gain),
        "numbers": dict(numbers),
        "drifts": claim.drifts,
        "states": family.states,
    }
    if not name:
        found = cell_below(family, gain, {})
        if not isinstance(found, Cell):
            raise Refused("the gain is not below its level, or no form is found")
        return [[head, found.line]]

    def find(box):
        return cell_below(family, gain, box)

    claims = []
    low, high = span
    start = _first_proved(name, low, high, find)
    stop = _first_proved(name, high, low, find)
    if start is None or stop is None:
        raise Refused(
            "no form is found next to an end, as where the level is the gain at rest at all values"
        )
    cells = cells_between(name, (start, stop), NO_RIMS, [low, high], find)
    for run in stretches(sorted(cells, key=lambda cell: cell.low)):
        sides_written = {name: [repr(run[0].low), repr(run[-1].high)]}
        claims.append([head | {"sides": sides_written}, *tree(name, run)])
    return claims


def _first_proved(name: str, end: float, other_end: float, find: Find) -> float | None:
    """Return the place next to an end of a range at which a form is found; None without one.

    At the end itself two eigenvalues of Riccati's equation meet, which rounding moves by its root.
    """
    for share in NEAREST:
        place = end + share * (other_end - end)
        if isinstance(find({name: (place, place)}), Cell):
            return place
    return None


def cell_below(family: file.Family, gain: Gain, box: Ball) -> Cell | list:
    """Return a cell with a form that the checker accepts; an empty list without one."""
    cell = balls.Cell({name: (exactly(low), exactly(high)) for name, (low, high) in box.items()})
    try:
        rows = family.rows("", cell)
    except Refused:
        return []
    states = family.states
    terms = frame_terms(cell, rows, states)
    line = form_below(terms, len(states), float(gain.at_most))
    if line is None:
        return []
    P = file.form_from(line, cell, [1] * len(states))
    if not stays_below(cell, rows, states, P, gain.at_most):
        return []
    low, high = next(iter(box.values()), (0.0, 0.0))
    return Cell(low, high, line, 0)


def frame_terms(cell: balls.Cell, rows: dict, states: Sequence[str]) -> list[np.ndarray]:
    """Return [A B; C D] of a frame by powers of the side, in doubles."""
    into = sorted({name for row in rows.values() for name in row if name.startswith(INPUT)})
    out = sorted(name for name in rows if name.startswith(OUTPUT))
    M = form.matrix_of(cell, rows, [*states, *out], [*states, *into])
    keys = sorted(M.parts, key=sum)
    return [np.array(M.parts[key], float) / balls.ONE for key in keys]


def form_below(terms: Sequence[np.ndarray], n: int, level: float) -> dict[str, Any] | None:
    """Return the line of a form that may hold for s from -1 to 1; None without one.

    With outputs over their level P solves a Riccati equation at three places of the cell, and a parabola goes
    through it: `P = A'PA + C'C + e + (A'PB + C'D)(1 - D'D - B'PB)^-1 (A'PB + C'D)'`, with e as large as possible.
    """
    if not n:
        return {"L": []}
    places = PLACES if len(terms) > 1 else (0.0,)
    units = _units(terms[0], n)
    if units is None:
        return None
    outputs, inputs = (size - n for size in terms[0].shape)
    units = units / level
    left = np.append(units, [1 / level] * outputs)
    right = np.append(units, [1.0] * inputs)
    scaled = [term * left[:, None] / right for term in terms]
    frames = [sum(x * s**power for power, x in enumerate(scaled)) for s in places]
    for share in SHARES:
        try:
            forms = [_riccati(M, n, share) for M in frames]
            middle = forms[len(forms) // 2]
            L = linalg.cholesky(middle)
        except (np.linalg.LinAlgError, ValueError):
            continue
        line: dict[str, Any] = {"L": written(level * L * units)}
        if len(forms) > 1:
            inverse = linalg.solve_triangular(L, np.eye(n))
            first, _, last = (inverse.T @ P @ inverse for P in forms)
            slopes = (last - first) / 2, (last + first) / 2 - np.eye(n)
            line["Q"] = [[[at + 1], written(_even(Q))] for at, Q in enumerate(slopes)]
        return line
    return None


def _even(Q: np.ndarray) -> np.ndarray:
    return (Q + Q.T) / 2


def _units(M: np.ndarray, n: int) -> np.ndarray | None:
    """By which states are multiplied so that each makes an output of energy 1; None of a frame that is not stable."""
    A, C = M[:n, :n], M[n:, :n]
    if np.abs(np.linalg.eigvals(A)).max() >= 1:
        return None
    energy = np.diag(linalg.solve_discrete_lyapunov(A.T, C.T @ C))
    return np.sqrt(np.maximum(energy, UNSEEN * energy.max(initial=1e-300)))


def _riccati(M: np.ndarray, n: int, share: float) -> np.ndarray:
    """P of (1) in `checker/gain.py` for g = 1 at a place, in which a state of energy 1 loses a share of it besides."""
    A, B, C, D = M[:n, :n], M[:n, n:], M[n:, :n], M[n:, n:]
    weight = D.T @ D - np.eye(B.shape[1])
    P = linalg.solve_discrete_are(
        A, B, C.T @ C + share * np.eye(n), weight, s=C.T @ D, balanced=True
    )
    cross = A.T @ P @ B + C.T @ D
    balance = np.block([[P - A.T @ P @ A - C.T @ C, -cross], [-cross.T, -weight - B.T @ P @ B]])
    if linalg.eigvalsh(balance)[0] < ENOUGH * share:
        raise np.linalg.LinAlgError
    return P
