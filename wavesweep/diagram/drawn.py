"""A loop of several rates: blocks that run every so many ticks, and the junctions between them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import lcm
from numbers import Integral

import numpy as np

from wavesweep.diagram.block import Block
from wavesweep.diagram.elimination import (
    ROUNDING,
    exact_echelon,
    first_of_batch,
    reduced_echelon,
    residue,
    sum_or_zero,
    without_rounding,
)
from wavesweep.errors import UsageError
from wavesweep.spec.keys import LONGEST_FRAME


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A block that runs at the ticks `phase`, `phase + every`, and so on; between these its outputs hold.

    phase: a tick, or several ticks of the same period.
    """

    block: Block
    every: int = 1
    phase: int | tuple[int, ...] = 0

    def __post_init__(self):
        """Refuse a block that would never run, or between two ticks. Errors: UsageError."""
        phases = self.phase if isinstance(self.phase, tuple) else (self.phase,)
        whole = [isinstance(each, Integral) for each in (self.every, *phases)]
        if not all(whole) or self.every < 1 or not phases or not all(0 <= each < self.every for each in phases):
            raise UsageError(
                f"block {self.block.name}: expected every >= 1 and phases from 0 on and below it, whole numbers, found every = "
                f"{self.every!r}, phase = {self.phase!r}"
            )

    def runs(self, ticks: int) -> np.ndarray:
        """Whether it runs in each of the first ticks, `(ticks,)`, read-only."""
        return _runs(self.every, self.phase, ticks)


@lru_cache(maxsize=256)
def _runs(every, phase, ticks):
    runs = np.isin(np.arange(ticks) % every, phase)
    runs.flags.writeable = False
    return runs


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """Blocks placed on a common tick, and the loop that they make.

    period: of the tick (s), a number or an array over the batch. sums: junctions by the signal that they make: source signal ->
    gain (a number or an array over the batch); a port is the signal "block.port". inputs: signals from outside. All blocks that
    run in the same tick see each other's outputs of that tick. exact: gives the exact shifts (see `shifts`) of some of the
    blocks from those with rounding and the sums that outputs are, or None if these are wrong; None if the entries of the blocks
    are all that is known. rate: ticks per second (Hz) as it was given, from which 1/period may differ in the last bit; by
    default 1/period.
    Errors: UsageError for a frame of more than LONGEST_FRAME ticks.
    """

    period: object
    placed: tuple[Placed, ...]
    sums: Mapping[str, Mapping[str, object]]
    inputs: tuple[str, ...] = ()
    exact: Callable[[Sequence[Block], Sequence[dict[str, float]], Mapping], list[dict[str, float]] | None] | None = None
    rate: object = None
    ticks: int = field(init=False)

    def __post_init__(self):
        ticks = lcm(*(each.every for each in self.placed))
        if ticks > LONGEST_FRAME:
            raise UsageError(
                f"the frame, after which all blocks are in step again, has {ticks} ticks, expected at most {LONGEST_FRAME}; "
                "choose rates with a larger common divisor"
            )
        object.__setattr__(self, "ticks", ticks)

    def labels(self) -> dict[str, str]:
        """Readable labels of the states of blocks and of outputs that are held, by their names in `TickDrift`."""
        found = {}
        for block in (each.block for each in self.placed):
            readable = block.labels or [f"{block.name} {state}" for state in block.states]
            found |= {f"{block.name}.{state}": label for state, label in zip(block.states, readable, strict=True)}
            alone = len(block.outputs) == 1 and not block.states  # nothing else of it could be meant
            found |= {f"{block.name}.{port} held": f"{block.name}{'' if alone else f' {port}'} held" for port in block.outputs}
        return found

    def refuse_wrong_names(self) -> None:
        """Raise UsageError for names or junctions that make no loop, or another one than was meant."""
        blocks = [each.block for each in self.placed]
        names, ports = [block.name for block in blocks], {f"{block.name}.{port}" for block in blocks for port in block.inputs}
        made = {f"{block.name}.{port}" for block in blocks for port in block.outputs} | {*self.inputs, *self.sums}
        twice = [name for name in names if names.count(name) > 1]
        unknown = sorted({source for terms in self.sums.values() for source in terms} - made)
        wrong = [name for name in self.sums if name not in ports and name.rpartition(".")[0] in names]
        rings = [name for name in self.sums if _comes_back(name, self.sums)]
        for found, expected in (
            ([] if blocks else ["none"], "at least one block"),
            (twice, "blocks of different names"),
            (unknown, "sources that are outputs of blocks, junctions or inputs"),
            (wrong, "the block's own inputs as ports"),
            (rings, "junctions that are not made of themselves"),
        ):
            if found:
                raise UsageError(f"a drawn loop: expected {expected}, found {', '.join(dict.fromkeys(found))}")
        period = np.asarray(self.period)
        if period.dtype.kind not in "iufc" or not np.all(period.real > 0):
            raise UsageError(f"a drawn loop: expected a period > 0 in s, found {self.period!r}")

    def sources(self, signal: str) -> set[str]:
        """The block outputs and inputs from outside that a signal is made of."""
        found, open_ = set(), [signal]
        while open_:
            name = open_.pop()
            if name in self.sums:
                open_ += self.sums[name]
            else:
                found.add(name)
        return found

    def living(self, watched=()) -> "Drawn":
        """The same without the blocks of which nothing is read, by a block that remains or as one of the signals `watched`."""
        placed = list(self.placed)
        while True:
            ports = (f"{each.block.name}.{port}" for each in placed for port in each.block.inputs)
            read = {source.rpartition(".")[0] for signal in (*ports, *watched) for source in self.sources(signal)}
            kept = [each for each in placed if each.block.name in read]
            if len(kept) == len(placed):
                return self if len(kept) == len(self.placed) else replace(self, placed=tuple(kept))
            placed = kept

    def schedule(self) -> tuple[list[tuple[int, ...]], np.ndarray]:
        """The different sets of blocks (indices) that run in a tick, and the number of the set of each tick of the frame."""
        sets, which = _schedule(tuple((each.every, each.phase) for each in self.placed), self.ticks)
        return list(sets), which

    def held(self, watched=()) -> dict[str, list[str]]:
        """Block -> its output ports that something reads in a tick in which the block does not run.

        watched: signals that are read in every tick.
        """
        masks = {each.block.name: each.runs(self.ticks) for each in self.placed}
        readers = [(masks[each.block.name], f"{each.block.name}.{port}") for each in self.placed for port in each.block.inputs]
        readers += [(np.ones(self.ticks, bool), signal) for signal in watched]
        found = {}
        for mask, signal in readers:
            for source in self.sources(signal):
                name, _, port = source.rpartition(".")
                if name in masks and np.any(mask & ~masks[name]):
                    found.setdefault(name, {})[port] = None
        return {
            each.block.name: [port for port in each.block.outputs if port in found.get(each.block.name, {})]
            for each in self.placed
        }


@lru_cache(maxsize=64)
def _schedule(rhythms, ticks):
    masks = np.stack([_runs(*each, ticks) for each in rhythms], axis=1)
    sets, which = np.unique(masks, axis=0, return_inverse=True)
    which = which.reshape(-1)
    which.flags.writeable = False
    return tuple(tuple(np.flatnonzero(row).tolist()) for row in sets), which


def _comes_back(name, sums):
    """Whether a junction is a part of itself, through junctions alone."""
    seen, open_ = set(), list(sums[name])
    while open_:
        source = open_.pop()
        if source == name:
            return True
        if source in sums and source not in seen:
            seen.add(source)
            open_ += sums[source]
    return False


def shifts(drawn: Drawn) -> tuple[list[dict[str, float]], bool]:
    """The independent shifts of states that nothing in the loop opposes, from the first of the batch, and if they are exact.

    A shift is a solution with all signals constant and no input: no state changes, and each port is the sum connected to it
    (see `drift`). A state has the name "block.state", an output that is held "block.port held". Each shift has a state of its
    own, first among its keys, with the value 1; the other shifts do not move that state.

    An entry that is smaller than rounding, as of a spring of 1e-12 N/m to the ground, may stop a shift that rounding does not
    see. Drawings tell (`exact`); otherwise the shifts are exact if the equations that say the same at rest, without rounding of
    the blocks, have as many, and if every entry of these that counts as zero is.
    """
    blocks = [each.block for each in drawn.placed]
    at, outputs = _unknowns(blocks), _outputs(blocks)
    unknowns = list(at)
    reduced, pivots = reduced_echelon(_at_rest_matrix(drawn, blocks))
    states = [at[f"{block.name}.{state}"] for block in blocks for state in block.states]
    free = [column for column in range(len(unknowns)) if column not in pivots]
    N = np.zeros((len(unknowns), len(free)))
    for k, column in enumerate(free):
        N[column, k] = 1.0
        for pivot, row in pivots.items():
            N[pivot, k] = -reduced[row, column]
    held = {}
    for name, terms in outputs.items():
        held[f"{name} held"] = [sum_or_zero(value * N[at[source], k] for source, value in terms) for k in range(len(free))]
    values = {unknowns[i]: N[i] for i in states} | held
    found = _with_leads(values, [unknowns[i] for i in states])
    if found and drawn.exact:
        exact = drawn.exact(blocks, found, outputs)
        return exact or found, exact is not None
    if not found:
        return found, True
    _, plain, exact = _eliminated(drawn, [replace(block, **_at_rest(block)) for block in blocks])
    return found, exact and len(plain) == len(pivots)


def _at_rest_matrix(drawn, blocks):
    """The equations of a loop at rest, a row each."""
    at = _unknowns(blocks)
    rows = [_gathered(row, at) for row in _equations(blocks, _tracing(drawn, _outputs(blocks)))]
    return np.array(rows).reshape(-1, len(at))


def _eliminated(drawn, blocks):
    """The reduced equations of a loop at rest, their pivots, and whether all of their zeros are exact; see `exact_echelon`."""
    unknowns, outputs = _unknowns(blocks), _outputs(blocks)
    exact = {name: [(source, residue(value)) for source, value in row] for name, row in outputs.items()}
    rows = []
    for equation in _equations(blocks, _tracing(drawn, exact, residue)):
        row = {}
        for name, value in equation:
            row[unknowns[name]] = row.get(unknowns[name], 0) + (value if isinstance(value, int) else residue(value))
        rows.append(row)
    return exact_echelon(_at_rest_matrix(drawn, blocks), rows)


def _unknowns(blocks):
    names = [f"{block.name}.{name}" for block in blocks for name in (*block.states, *block.inputs)]
    return {name: index for index, name in enumerate(names)}


def _outputs(blocks):
    """The output of each port as (unknown, factor) pairs."""
    return {
        f"{block.name}.{port}": _row(block, block.C, block.D, i) for block in blocks for i, port in enumerate(block.outputs)
    }


def _tracing(drawn, outputs, number=float):
    """A function from a signal to the (unknown, factor) pairs of which it is the sum."""

    def traced(signal, factor=1):
        if signal in outputs:
            yield from ((name, factor * value) for name, value in outputs[signal])
        for source, each in drawn.sums.get(signal, {}).items():
            yield from traced(source, factor * number(float(np.ravel(each)[0].real)))

    return traced


def _at_rest(block):
    return {} if block.at_rest is None else dict(zip("EBCD", block.at_rest, strict=True))


def _equations(blocks, traced):
    """Yield (unknown, factor) pairs of each equation: the change of a state, or a port less the sum connected to it."""
    for block in blocks:
        yield from (_row(block, block.E, block.B, i) for i in range(len(block.states)))
        for port in block.inputs:
            name = f"{block.name}.{port}"
            yield [(name, 1.0), *((source, -value) for source, value in traced(name))]


def _gathered(row, at):
    """The row of a matrix with the columns `at`, where terms that cancel leave an exact zero."""
    terms = {}
    for name, value in row:
        terms.setdefault(name, []).append(value)
    found = np.zeros(len(at))
    for name, parts in terms.items():
        found[at[name]] = sum_or_zero(parts)
    return found


def _with_leads(values, states):
    """The shifts as dicts, combined so that each has a state of its own.

    Displacements are as different as the units of the states, so nothing counts as zero but a sum that cancels to rounding.
    """
    names, N = list(values), np.array([values[name] for name in values]).reshape(len(values), -1)
    leads, size = [], np.abs(N)
    for k in range(N.shape[1]):
        open_ = [i for i, name in enumerate(names) if name in states and i not in leads]
        at = max(open_, key=lambda i: abs(N[i, k]), default=None)
        if at is None or not N[at, k]:
            continue
        N[:, k], size[:, k] = N[:, k] / N[at, k], size[:, k] / abs(N[at, k])
        for other in range(N.shape[1]):
            if other != k:
                size[:, other] += abs(N[at, other]) * size[:, k]
                N[:, other] -= N[at, other] * N[:, k]
                N[np.abs(N[:, other]) <= ROUNDING * size[:, other], other] = 0.0
        leads.append(at)
    kept = [k for k in range(N.shape[1]) if N[:, k].any()]
    return [
        {names[at]: 1.0} | {names[i]: without_rounding(N[i, k]) for i in range(len(names)) if i != at and N[i, k]}
        for at, k in zip(leads, kept, strict=True)
    ]


def _row(block, left, right, i):
    """Row i of two matrices side by side as (unknown, value) pairs."""
    names = [f"{block.name}.{name}" for name in (*block.states, *block.inputs)]
    values = np.hstack([first_of_batch(left), first_of_batch(right)])[i]
    return [(name, float(value)) for name, value in zip(names, values, strict=True) if value]
