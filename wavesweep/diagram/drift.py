"""Drift: shifts of the states that nothing in the loop opposes, found in its drawing by elimination with exact zeros.

Waves carry velocities, and a free hand is held by nothing. A shift of positions may therefore persist for every wall, as an
eigenvalue at exactly 1. It is a solution of the drawing with all signals constant.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.elimination import first_of_batch, reduced_echelon, sum_or_zero, without_rounding

FORCE = ""  # stands for the wall's force among the unknowns


@dataclass(frozen=True, slots=True)
class Drift:
    """A shift of states that nothing in the loop, cut at the wall, opposes.

    shift: state of the lifted frame -> its displacement per unit displacement at the wall; empty if there is no drift.
    lead: the state relative to which the others are counted; one that the wall reads, if it reads any of them.
    driven: whether the wall's force moves the loop along the shift. If not, a combination of the states is conserved.
    """

    shift: Mapping[str, float]
    lead: str | None
    driven: bool


def latch(held: str) -> str:
    """Name of the state that stores the held signal of the last frame."""
    return f"hold_{held}.u_before"


def drift_of(diagram: Diagram, signals=()) -> Drift:
    """The drift seen by the wall and by these signals, from the numbers of the first loop of the batch.

    diagram: the drawing. signals: slow signals or states that are read beside the wall. Unknowns are all states and block
    inputs. The equations state that no state changes, and that each input equals the sum connected to it. Their null space
    is the drift; if the wall's force drives it, the rank grows with the column of that force. Elimination keeps the size of
    the terms of each entry, and an entry counts as zero only if its terms cancel to rounding. So a slow pole or a soft
    spring is no drift. Several shifts without a common state are taken as one. Errors: ValueError if they have a common one.
    """
    return _drift(diagram.structure or diagram, tuple(signals))


def scene_drift(diagram: Diagram) -> Drift:
    """The drift seen by the wall, the hand and all holds: the shift of the whole scene, if nothing holds the hand."""
    return drift_of(diagram, (*diagram.holds.values(), diagram.hand.position))


@lru_cache(maxsize=256)
def _drift(diagram, signals):
    rows = _equations(diagram)
    names = _read_by(rows, [name for signal in (*diagram.wall, *signals) for name in _traced(diagram, signal)])
    A = np.array([[rows[name].get(other, 0.0) for other in names] for name in names]).reshape(len(names), len(names))
    reduced, pivots = reduced_echelon(A)
    ways = [_moved(names, reduced, pivots, column) for column in range(len(names)) if column not in pivots]
    shift = {name: value for way in ways for name, value in way.items()}
    if len(shift) < sum(map(len, ways)):
        raise ValueError(f"the drawing drifts in several ways that share a state: {ways}; expected shifts of different states")
    force = np.array([rows[name].get(FORCE, 0.0) for name in names])
    driven = bool(ways) and len(reduced_echelon(np.column_stack([A, force]))[1]) > len(pivots)
    seen = {name: factor * shift[name] for name, factor in _traced(diagram, diagram.wall[0]).items() if name in shift}
    scale = sum_or_zero(seen.values()) or 1.0
    shift = {name: without_rounding(shift[name] / scale) for name in _states(diagram) if name in shift}
    fast = tuple(f"{block.name}." for block in diagram.fast)
    lifted = {name: f"frame.{name}" if name.startswith(fast) else name for name in shift}
    lead = next((name for name in seen if name in shift), next(iter(shift), None))
    return Drift({lifted[name]: value for name, value in shift.items()}, lifted.get(lead), driven)


def _moved(names, reduced, pivots, free):
    """Displacement of each unknown per unit displacement of the free one; those at rest are left out."""
    moved = {free: 1.0} | {column: -reduced[row, free] for column, row in pivots.items()}
    return {names[i]: value for i, value in moved.items() if value}


def _states(diagram):
    own = [f"{block.name}.{state}" for block in (*diagram.fast, *diagram.slow) for state in block.states]
    return [*own, *(latch(held) for held in diagram.holds if diagram.delay > 0)]


def _equations(diagram):
    """Unknown -> terms (unknown -> factor) of its equation: the change of a state, or an input less its sources."""
    rows = {}
    for block in (*diagram.fast, *diagram.slow):
        columns = [f"{block.name}.{name}" for name in (*block.states, *block.inputs)]
        change = np.hstack([first_of_batch(block.E), first_of_batch(block.B)])
        for i, state in enumerate(block.states):
            rows[f"{block.name}.{state}"] = _terms(zip(columns, change[i], strict=True))
        for port in block.inputs:
            fed = _traced(diagram, f"{block.name}.{port}")
            rows[f"{block.name}.{port}"] = {f"{block.name}.{port}": 1.0} | {
                name: -factor + (name == f"{block.name}.{port}") for name, factor in fed.items()
            }
    for held, source in diagram.holds.items() if diagram.delay > 0 else ():
        rows[latch(held)] = _traced(diagram, source) | {latch(held): -1.0}
    return rows


def _traced(diagram, signal):
    """A constant signal as a sum of unknowns: unknown -> factor."""
    if signal == diagram.wall_force:
        return {FORCE: 1.0}
    if signal in diagram.samples:
        return _traced(diagram, diagram.samples[signal])
    if signal in diagram.holds:
        return {latch(signal): 1.0} if diagram.delay > 0 else _traced(diagram, diagram.holds[signal])
    for block in (*diagram.fast, *diagram.slow):
        if signal in (f"{block.name}.{port}" for port in block.outputs):
            row = block.outputs.index(signal.removeprefix(f"{block.name}."))
            columns = [f"{block.name}.{name}" for name in (*block.states, *block.inputs)]
            return _terms(zip(columns, np.hstack([first_of_batch(block.C), first_of_batch(block.D)])[row], strict=True))
    total = {}
    for source, gain in diagram.sums.get(signal, {}).items():
        for name, factor in _traced(diagram, source).items():
            total.setdefault(name, []).append(float(np.ravel(gain)[0].real) * factor)
    return _terms((name, sum_or_zero(parts)) for name, parts in total.items())


def _read_by(rows, read):
    """The unknowns that these depend on, directly or through others, in the drawing's order."""
    known, left = set(), list(read)
    while left:
        name = left.pop()
        if name and name not in known:
            known.add(name)
            left += list(rows[name])
    return [name for name in rows if name in known]


def _terms(pairs):
    return {name: float(factor) for name, factor in pairs if factor}
