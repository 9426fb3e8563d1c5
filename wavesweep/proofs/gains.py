"""Cells of gains that stay below a level along a number, each with a form of the bounded real lemma."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from scipy import linalg

from wavesweep.checker import balls, file, form, port
from wavesweep.checker.balls import Refused
from wavesweep.checker.channel import RECEIVED, SENT
from wavesweep.checker.gain import Gain, stays_below, weights
from wavesweep.checker.reader.loops import INPUT, OUTPUT
from wavesweep.proofs.cells import Cell, Find, cells_between, exactly, stretches, tree, written
from wavesweep.proofs.drifts import drifts_of
from wavesweep.proofs.sets import decimals

ABOVE = 1 + 1e-6  # a level that is proved, of the gain that a row has
SHARES = 0.3, 0.03, 3e-3, 3e-4, 1e-5, 1e-7, 1e-9  # of energies that a form loses besides
NEAREST = 0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4  # of a range, from its end to a form
NOT_PASSIVE = "no form is found, as where the port is not passive"
NO_RIMS = np.nan, np.nan  # no end of a range is next to the unit circle
PLACES = -1.0, 0.0, 1.0  # of a cell, at which forms are found
NEWTON = 30  # steps
NEAR = 0.5  # such a step, of those in which a determinant changes by its own size
HEAVY = 0.1  # weight of the trace of a form
UNSEEN = 1e-9  # energy of a state that the output does not show, of the largest
Ball = dict[str, tuple[float, float]]


def gain_of(bound: Any) -> Gain | None:
    """Return what the checker knows a bound of [sweep] require by, of a peak the gain over a frame, which is no
    less; None of one that is not of all frequencies."""
    level = exactly(bound.at_most) if hasattr(bound, "at_most") else None
    if hasattr(bound, "centre"):
        return Gain("", "", bound.cut, exactly(bound.centre), level)
    if bound.word in ("gain", "peak") and level and bound.band_hz is None:
        return Gain(bound.source, bound.signal, "", Fraction(0), level)
    return None


def of_waves(norm: float) -> Gain:
    """Return the gain of the wave channel, below a norm."""
    return Gain(SENT, RECEIVED, "", Fraction(0), exactly(norm * ABOVE))


def in_file(gain: Gain) -> dict[str, str]:
    """Return a gain as a file has it."""
    names = {"from": gain.source, "to": gain.signal}
    if gain.cut:
        names = {"cut": gain.cut, "less": decimals(gain.less)}
    return names | {"at_most": decimals(gain.at_most)}


def claims_of_energy(
    tables: dict,
    numbers: Mapping[str, str],
    name: str,
    span: tuple[float, float],
    gain: Gain | None,
) -> list[list[dict[str, Any]]]:
    """Return the lines of claims that a gain stays below its level, or without one that the hand's port is
    passive, all over the ranges of a number in which forms are found, or at the spec's own numbers if `name` is empty.

    numbers: the others that are set. Errors: Refused, Unreadable.
    """
    sides = {name: (exactly(span[0]), exactly(span[1]))} if name else {}
    kind = "gain" if gain else "port"
    claim = file.Claim(
        kind, {key: exactly(float(x)) for key, x in numbers.items()}, sides, gain=gain
    )
    claim.drifts = drifts_of(tables, claim)
    family = file.family_of(tables, claim)
    head: dict[str, Any] = {
        "claim": kind,
        "numbers": dict(numbers),
        "drifts": claim.drifts,
        "states": family.states,
    }
    if gain:
        head["gain"] = in_file(gain)
    if not name:
        found = energy_cell(family, gain, {})
        if not isinstance(found, Cell):
            raise Refused(_not_below(family, gain, {}) if gain else NOT_PASSIVE)
        return [[head, found.line]]

    def find(box):
        return energy_cell(family, gain, box)

    claims = []
    low, high = span
    start = _first_proved(name, low, high, find)
    stop = _first_proved(name, high, low, find)
    if start is None or stop is None:
        end = {name: (low if start is None else high,) * 2}
        raise Refused(_not_below(family, gain, end) if gain else NOT_PASSIVE)
    cells = cells_between(name, (start, stop), NO_RIMS, [low, high], find)
    for run in stretches(sorted(cells, key=lambda cell: cell.low)):
        sides_written = {name: [repr(run[0].low), repr(run[-1].high)]}
        claims.append([head | {"sides": sides_written}, *tree(name, run)])
    return claims


def _not_below(family: file.Family, gain: Gain, point: Ball) -> str:
    """Return why no form is found at a point."""
    cell = balls.Cell({name: (exactly(low), exactly(high)) for name, (low, high) in point.items()})
    n = len(family.states)
    (M,) = frame_terms(cell, family.rows("", cell), family.states)
    at_rest = M[n:, n:] + M[n:, :n] @ np.linalg.solve(np.eye(n) - M[:n, :n], M[:n, n:])
    least = np.linalg.norm(at_rest, 2)
    if least < float(gain.at_most) / ABOVE:
        return "the gain is not below its level, or no form is found"
    return f"the gain is not below its level: at rest it is {least:.10g}, and forms show a millionth more"


def _first_proved(name: str, end: float, other_end: float, find: Find) -> float | None:
    """Return the place next to an end of a range at which a form is found; None without one.

    At the end itself two eigenvalues of Riccati's equation meet, which rounding moves by its root.
    """
    for share in NEAREST:
        place = end + share * (other_end - end)
        if isinstance(find({name: (place, place)}), Cell):
            return place
    return None


def energy_cell(family: file.Family, gain: Gain | None, box: Ball) -> Cell | list:
    """Return a cell with a form that the checker accepts; an empty list without one."""
    cell = balls.Cell({name: (exactly(low), exactly(high)) for name, (low, high) in box.items()})
    states = family.states
    try:
        rows = family.rows("", cell)
        if gain:
            line = form_below(frame_terms(cell, rows, states), len(states), float(gain.at_most))
        else:
            k = port.stiffness(family.drifts)
            line = form_of_port(cell, rows, states, k)
    except Refused:
        return []
    if line is None:
        return []
    P = file.form_from(line, cell, [1] * len(states))
    if gain:
        proved = stays_below(cell, rows, states, P, gain.at_most)
    else:
        proved = port.is_passive(cell, rows, states, P, k)
    low, high = next(iter(box.values()), (0.0, 0.0))
    return Cell(low, high, line, 0) if proved else []


def frame_terms(cell: balls.Cell, rows: dict, states: Sequence[str]) -> list[np.ndarray]:
    """Return [A B; C D] of a frame by powers of the side, in doubles, with weights on what comes in and out."""
    into = sorted({name for row in rows.values() for name in row if name.startswith(INPUT)})
    out = sorted(name for name in rows if name.startswith(OUTPUT))
    left, right = (
        np.sqrt([1.0] * len(states) + [*map(float, weights(names, out))]) for names in (out, into)
    )
    terms = in_doubles(form.matrix_of(cell, rows, [*states, *out], [*states, *into]))
    return [term * left[:, None] / right for term in terms]


def in_doubles(matrix: form.Matrix) -> list[np.ndarray]:
    """Return a matrix by powers of its side."""
    return [np.array(matrix.parts[key], float) / balls.ONE for key in sorted(matrix.parts, key=sum)]


def form_below(terms: Sequence[np.ndarray], n: int, level: float) -> dict[str, Any] | None:
    """Return the line of a form for the bounded real lemma that may hold for s from -1 to 1; None without one."""
    units = energy_units(terms[0][:n, :n], terms[0][n:, :n])
    if units is None:
        return None
    outputs, inputs = (size - n for size in terms[0].shape)
    left = np.append(units, [1.0] * outputs) / level
    right = np.append(units / level, [1.0] * inputs)
    frames = []
    places = PLACES if len(terms) > 1 else (0.0,)
    for M in at_places([term * left[:, None] / right for term in terms], places):
        balance = np.diag([0.0] * n + [1.0] * inputs) - M[n:].T @ M[n:]
        frames.append((M[:n], balance))
    return line_of(frames, n, units)


def form_of_port(
    cell: balls.Cell, rows: dict, states: Sequence[str], k: balls.Number
) -> dict[str, Any] | None:
    """Return the line of a form for the positive real lemma; None without one. k: stiffness of the hand at rest."""
    n = len(states)
    moved, work, way = map(in_doubles, port.port_matrices(cell, rows, [*states]))
    shares = [np.array(c, float) / balls.ONE for c in k.value(cell)[1:]]
    places = PLACES if cell.width else (0.0,)
    frames = []
    for M, W, S, share in zip(
        *(at_places(terms, places) for terms in (moved, work, way, shares)), strict=True
    ):
        frames.append((M, -_even(W) - share * S.T @ S))
    mobility = np.trace(frames[0][1][n:, n:]) / (len(frames[0][1]) - n)
    units = energy_units(frames[0][0][:, :n], work[0][n:, :n])
    if units is None or mobility <= 0:
        return None
    left = units / mobility**0.5
    right = np.append(left, np.full(len(frames[0][1]) - n, mobility**0.5))
    scaled = [(M * left[:, None] / right, H / np.outer(right, right)) for M, H in frames]
    return line_of(scaled, n, left)


def at_places(terms: Sequence[np.ndarray], places: Sequence[float]) -> list[np.ndarray]:
    """Return what a sum of powers of the side is at places of a cell."""
    return [sum(x * s**power for power, x in enumerate(terms)) for s in places]


def line_of(
    frames: Sequence[tuple[np.ndarray, np.ndarray]], n: int, units: np.ndarray
) -> dict[str, Any] | None:
    """Return the line of a form P with [P 0; 0 0] + H - M'PM > 0 for (M, H) at each place of a cell; None without one.

    M: [A B] with states times their units. At each place P solves the Riccati equation of this, with
    a share of the states' energy that is as large as possible in place of 0, and a parabola goes through it.
    """
    if not n:
        return {"L": []}
    for share in SHARES:
        try:
            forms = [_centred(_riccati(*frame, n, share), *frame) for frame in frames]
            middle = forms[len(forms) // 2]
            L = linalg.cholesky(middle)
        except (np.linalg.LinAlgError, ValueError):
            continue
        line: dict[str, Any] = {"L": written(L * units)}
        if len(forms) > 1:
            inverse = linalg.solve_triangular(L, np.eye(n))
            first, _, last = (inverse.T @ P @ inverse for P in forms)
            slopes = (last - first) / 2, (last + first) / 2 - np.eye(n)
            line["Q"] = [[[at + 1], written(_even(Q))] for at, Q in enumerate(slopes)]
        return line
    return None


def _even(Q: np.ndarray) -> np.ndarray:
    return (Q + Q.T) / 2


def energy_units(A: np.ndarray, C: np.ndarray) -> np.ndarray | None:
    """By which states are multiplied so that each makes an output of energy 1; None of a frame that is not stable."""
    if np.abs(np.linalg.eigvals(A)).max(initial=0.0) >= 1:
        return None
    energy = np.diag(linalg.solve_discrete_lyapunov(A.T, C.T @ C)) if len(A) else np.zeros(0)
    return np.sqrt(np.maximum(energy, UNSEEN * energy.max(initial=1e-300)))


def _riccati(M: np.ndarray, H: np.ndarray, n: int, share: float) -> np.ndarray:
    """P at a place, where of a state of energy 1, and of what H allows to inputs, so much is lost besides."""
    lost = share * linalg.block_diag(np.eye(n), H[n:, n:])
    tight = lost - H
    P = linalg.solve_discrete_are(
        M[:, :n], M[:, n:], tight[:n, :n], tight[n:, n:], s=tight[:n, n:], balanced=True
    )
    balance = H - M.T @ P @ M - lost / 2
    balance[:n, :n] += P
    linalg.cholesky(balance)
    return P


def _centred(P: np.ndarray, M: np.ndarray, H: np.ndarray) -> np.ndarray:
    """P nearer to where the determinant of what it leaves is largest, by Newton's method: there a form holds farthest."""
    n = len(P)
    rows, columns = np.tril_indices(n)
    units = np.zeros((len(rows), n, n))
    units[np.arange(len(rows)), rows, columns] = 1.0
    units = (units + units.mT) / 2
    changes = -M.T @ units @ M
    changes[:, :n, :n] += units
    weights = HEAVY * np.trace(units, axis1=1, axis2=2)
    for _ in range(NEWTON):
        balance = H - M.T @ P @ M
        balance[:n, :n] += P
        inverse = linalg.solve_triangular(linalg.cholesky(balance), np.eye(len(H)))
        relative = inverse.T @ changes @ inverse
        gradient = np.trace(relative, axis1=1, axis2=2) - weights
        sizes = np.sqrt((relative**2).sum((1, 2)))
        directions = (relative / sizes[:, None, None]).reshape(len(sizes), -1)
        step = np.linalg.solve(directions @ directions.T, gradient / sizes)
        size = np.sqrt(max(step @ (gradient / sizes), 0.0))
        P = P + np.tensordot(step / sizes / (1 + size), units, 1)
        if size < NEAR:
            break
    return P
