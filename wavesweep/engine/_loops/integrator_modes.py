"""Loops whose signals do not change: their equations in fractions, and the shifts of states that
fulfil them.

The numbers of a spec count as the decimals that they are written as, and numbers of arrays as
doubles. Square roots of squares are exact; values of other functions count as the doubles that they
are, which no sum of others meets by chance.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Collection, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from math import isqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing, scalars
from wavesweep.engine._drawing.drawn_block import DELTA
from wavesweep.engine._drawing.expressions import FUNCTIONS, Tree
from wavesweep.engine._loops.block import Block
from wavesweep.engine._loops.blocks import recentred
from wavesweep.engine._loops.dead_time import SENSED
from wavesweep.engine._loops.definitions import at_rest, tf_at_rest
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._loops.values import keys_with
from wavesweep.engine.doubles import UNIT_ROUNDING

if TYPE_CHECKING:
    from wavesweep.engine._drawing.drawn_block import DrawnBlock, Plant
    from wavesweep.engine._state_space import StateSpace

# Types of firmware with sums that may count for ever if no other block reads them: an impulse reads
# changes of its sum alone, and the integral of a `pi` or `pid`, which are a `tf`, may have no gain.
# A position is not among them, as its body moves.
SUMMING = ("impulse", "tf")
# A root is taken so large a part of itself too large that no sum of other numbers meets it by chance.
UNMET = 2**100
_OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "negative": operator.neg,
}
Sum = dict[str, Any]  # unknown -> factor, a fraction


@lru_cache(maxsize=1024)
def decimal(value: float) -> Fraction:
    """Return the decimal that a double is written as."""
    return Fraction(Decimal(repr(float(value))))


def root(number: Fraction) -> Fraction:
    """Return the square root: that of a square as it is, of other numbers a double."""
    above = isqrt(max(number.numerator, 0))
    below = isqrt(number.denominator)
    if above * above == number.numerator and below * below == number.denominator:
        return Fraction(above, below)
    return Fraction(math.sqrt(number))


def value_in_fractions(
    tree: Tree, constants: Mapping[str, Fraction], varied: Collection[str] = ()
) -> Fraction:
    """Return the value of an expression. varied: names of numbers that other loops have other
    values of; a root of these is nowhere exact, since that of a square is either of two numbers.

    Errors: ArithmeticError or ValueError if it has no value.
    """
    operation = tree.operation
    if operation == "number":
        return decimal(tree.leaf)
    if operation == "name":
        return constants[tree.leaf]
    first, *further = (value_in_fractions(operand, constants, varied) for operand in tree.operands)
    if operation == "sqrt" or (operation == "**" and further[0] * 2 == 1):
        value = root(first)
        if any(name in varied for name in tree.operands[0].names):
            return value + value / UNMET
        return value
    if operation in FUNCTIONS:
        angle = float(first)
        result = getattr(math, operation)(angle)
        if operation in ("sin", "cos", "tan") and abs(result) <= UNIT_ROUNDING * abs(angle):
            return Fraction(0)  # of the angle's nearest double or decimal
        return Fraction(result)
    if operation == "**":
        return _power(first, *further)
    return _OPERATIONS[operation](first, *further)


def _power(base: Fraction, exponent: Fraction) -> Fraction:
    if exponent.denominator != 1 or abs(exponent) > 64:  # larger powers are not multiplied out
        raise ArithmeticError("expected a power that is a fraction")
    return base ** int(exponent)


class RestEquations:
    """The equations of blocks at rest.

    Unknowns are states and input ports. changes: of each state that has an equation of its own, a
    sum that is 0. rows: other sums that are 0: each port less the sum that is connected to it.
    outputs: each as a sum. states: each as the unknown that it is, or as a sum of input ports that
    it follows. A block may have more ports than its equations, behind theirs: those by which a
    number is taken out of it. wires: of each port, the outputs that it reads, with their gains;
    outside: what else it reads. sums: states that may count for ever if nothing reads them, each with the register that shows
    it, or "". plants: names of the blocks that move by themselves; None if it is not known which
    do.
    """

    def __init__(self) -> None:
        self.rows: list[Sum] = []
        self.wires: dict[str, Sum] = {}
        self.outside: dict[str, Sum] = {}
        self.sums: dict[str, str] = {}
        self.plants: set[str] | None = None
        self.changes: dict[str, Sum] = {}
        self.outputs: dict[str, Sum] = {}
        self.states: dict[str, Sum] = {}

    def add(
        self,
        start: str,
        states: list[str] | tuple[str, ...],
        ports: tuple[tuple[str, ...], tuple[str, ...]],
        parts: StateSpace | tuple[list[list[Any]], ...],
    ) -> None:
        """Add a block. start: what the names of its states and ports begin with. parts: E, B, C
        and D as rows of fractions."""
        inputs, outputs = ports
        E, B, C, D = parts
        unknowns = [start + name for name in (*states, *inputs)]
        names = unknowns[: len(states)]
        changes = []
        for by_states, by_inputs in zip(E, B, strict=True):
            changes.append(_sum_of(unknowns, (*by_states, *by_inputs)))
        shown = []
        for by_states, by_inputs in zip(C, D, strict=True):
            shown.append(_sum_of(unknowns, (*by_states, *by_inputs)))
        unit = decimal(1.0)
        self.states |= {name: {name: unit} for name in names}
        self.changes |= dict(zip(names, changes, strict=True))
        self.outputs |= {start + port: row for port, row in zip(outputs, shown, strict=False)}

    def follow(self, block: Block, D: list[list[Fraction | int]]) -> None:
        """Add a block whose outputs follow its inputs by D whatever its states are, which settle
        where its own entries say, `x = -E^-1 B u`."""
        inputs = [f"{block.name}.{port}" for port in block.inputs]
        if block.states:
            E = _first(block.E)
            B = _first(block.B)
            n = len(block.states)
            if np.array_equal(E, np.eye(n, k=-1) - np.eye(n)):  # a delay, whose states are alike
                settled = np.cumsum(B, axis=0)
            else:
                settled = np.linalg.solve(E, -B)
            for state, row in zip(block.states, settled.tolist(), strict=True):
                by_inputs = [Fraction(value) for value in row]
                self.states[f"{block.name}.{state}"] = _sum_of(inputs, by_inputs)
        for port, row in zip(block.outputs, D, strict=False):
            self.outputs[f"{block.name}.{port}"] = _sum_of(inputs, row)

    def connect(self, force: str = "") -> None:
        """Connect ports with the outputs that they read, and with a force from outside, so that
        each less its sum is 0, and let sums that nothing reads count for ever: that these do not
        change is left out."""
        unit = decimal(1.0)
        for state, register in self.sums.items():
            if register:
                self._show(register, state)
        self.rows = []
        for port, terms in self.wires.items():
            less = {signal: -gain for signal, gain in terms.items()}
            by_force = self.outside.get(port, {}).get(force)
            if by_force:
                less[force] = -by_force
            self.rows.append(_substituted({port: unit} | less, self.outputs))
        for state in self.sums:
            if not any(state in row for row in (*self.changes.values(), *self.rows)):
                self.changes.pop(state, None)

    def _show(self, register: str, state: str) -> None:
        """Let a register show a state, of which it is a copy, in place of its input."""
        self.wires.pop(f"{register}.u", None)
        for shown in (self.states, self.outputs):
            for name in shown:
                if name.rpartition(".")[0] == register:
                    shown[name] = {state: decimal(1.0)}

    def null_space(self) -> list[Sum]:
        """Return independent solutions, of which all others are sums, ports being those of
        states as far as they can be.

        Gauss and Jordan's elimination: each unknown in turn is solved for by the shortest equation
        that has it, and replaced in all others; one that no equation has is free. Of each free
        unknown there is one solution, in which it is 1 and the other free ones are 0.
        """
        states = [name for name, row in self.states.items() if row.keys() == {name}]
        rows = [row for row in (*self.changes.values(), *self.rows) if row]
        ports = dict.fromkeys(name for row in rows for name in row if name not in states)
        solved: dict[str, Sum] = {}
        free = []
        for name in (*ports, *states):
            among = [row for row in rows if name in row]
            if not among:
                free.append(name)
                continue
            chosen = min(among, key=len)
            rows.remove(chosen)
            solution = _solution(chosen, name)
            rows = [_eliminated(row, name, solution) for row in rows]
            solved = {unknown: _eliminated(row, name, solution) for unknown, row in solved.items()}
            solved[name] = solution
        solutions = []
        for name in free:
            dependent = {unknown: row[name] for unknown, row in solved.items() if name in row}
            solutions.append({name: decimal(1.0)} | dependent)
        return solutions

    def moving(self) -> list[Sum]:
        """Return the solutions of `null_space` as what they do to states and to outputs that are
        held."""
        shown = self.states | {f"{port} held": row for port, row in self.outputs.items()}
        moving = []
        for solution in self.null_space():
            moved = {}
            for name, row in shown.items():
                terms = [f * solution[unknown] for unknown, f in row.items() if unknown in solution]
                if value := sum(terms):
                    moved[name] = value
            moving.append(moved)
        return moving


def _sum_of(names: Sequence[str], factors: Sequence[Any]) -> Sum:
    """The sum of unknowns with these factors, as far as there are factors, without those that
    are 0."""
    return {name: factor for name, factor in zip(names, factors, strict=False) if factor}


def _solution(row: Sum, name: str) -> Sum:
    """The variable of this name as the sum of others that makes the row zero."""
    return {term: -value / row[name] for term, value in row.items() if term != name}


def _eliminated(row: Sum, name: str, solution: Sum) -> Sum:
    """A sum in which a variable is replaced by its solution, if it has that variable."""
    return _substituted(row, {name: solution}) if name in row else row


def _substituted(row: Sum, sums: Mapping[str, Sum]) -> Sum:
    """A sum in which each known unknown is the sum that it is of others."""
    total: Sum = {}
    for name, factor in row.items():
        if not factor:
            continue
        # a sum with 0, or a product with 1, of fractions takes as long as others
        terms = {name: factor}
        if name in sums:
            terms = {unknown: factor * value for unknown, value in sums[name].items()}
        for unknown, term in terms.items():
            total[unknown] = total[unknown] + term if unknown in total else term
    return {name: value for name, value in total.items() if value}


def _pop_shift(moving: list[Sum], lead: str) -> Sum:
    """Take the first solution that moves the lead out of the list, and return it with the value
    1 there."""
    for index, shift in enumerate(moving):
        if lead in shift:
            del moving[index]
            return {name: value / shift[lead] for name, value in shift.items()}
    raise ArithmeticError("expected shifts of the same states")


def rest_of_blocks(drawn: MultirateLoop, names: Collection[str]) -> RestEquations:
    """Return the equations at rest of blocks of these names.

    Errors: ArithmeticError or ValueError where numbers are not known as fractions.
    """
    blocks = [scheduled.block for scheduled in drawn.placed if scheduled.block.name in names]
    return drawn.exact(blocks) if drawn.exact else _of_entries(drawn, blocks)


def shifts(
    drawn: MultirateLoop, names: Collection[str], leads: Sequence[str] = ()
) -> list[dict[str, float]]:
    """Return the independent shifts of states of some blocks that nothing in the loop opposes.

    A shift is a solution with all signals constant and no input: no state changes, and each port is
    the sum connected to it. A state has the name "block.state", an output that is held "block.port
    held". Each shift has a lead, a state of its own which is first among its keys, with the value
    1; the other shifts do not move that state. names: of the blocks. leads: those of the shifts, if
    they are known; otherwise the states that move furthest. Errors: ArithmeticError or ValueError
    where numbers are not known as fractions.
    """
    rest = rest_of_blocks(drawn, names)
    rest.connect()
    moving = rest.moving()
    by_lead: dict[str, Sum] = {}
    while moving and not (leads and len(by_lead) == len(leads)):
        if leads:
            lead = leads[len(by_lead)]
        else:
            sizes = {name: abs(float(v)) for name, v in moving[0].items() if name in rest.states}
            if not sizes:
                moving = moving[1:]
                continue
            lead = max(sizes, key=sizes.__getitem__)
        shift = _pop_shift(moving, lead)
        moving = [_without(later, shift, lead) for later in moving]
        by_lead = {name: _without(earlier, shift, lead) for name, earlier in by_lead.items()}
        by_lead[lead] = shift
    in_doubles = []
    for lead, shift in by_lead.items():
        followers = {name: float(value) for name, value in shift.items() if name != lead}
        in_doubles.append({lead: 1.0} | followers)
    return in_doubles


def rests(drawn: MultirateLoop, names: Collection[str], force: str) -> bool | None:
    """Return whether some blocks of a loop can stand still under a constant force from outside,
    which is so if their equations at rest have a solution in which it is not 0; None where numbers
    are not known as fractions."""
    try:
        rest = rest_of_blocks(drawn, names)
        rest.connect(force)
        return any(force in solution for solution in rest.null_space())
    except (ArithmeticError, ValueError):
        return None


def _without(shifted: Sum, shift: Sum, lead: str) -> Sum:
    """Another shift, from which so much of this one is taken that it does not move the lead."""
    share = shifted.get(lead, 0)
    less = {}
    if share:
        less = {name: shifted.get(name, 0) - share * value for name, value in shift.items()}
    return {name: value for name, value in (shifted | less).items() if value}


def _first(matrix: np.ndarray) -> np.ndarray:
    """The first of a batch of matrices, real."""
    return matrix[(0,) * (matrix.ndim - 2)].real


def _add_by_entries(rest: RestEquations, block: Block) -> None:
    """Add a block that is known by its entries alone."""
    matrices = []
    for matrix in block.at_rest or (block.E, block.B, block.C, block.D):
        matrices.append([[Fraction(value) for value in row] for row in _first(matrix).tolist()])
    _add_matrices(rest, block, tuple(matrices))


def _add_matrices(
    rest: RestEquations, block: Block, matrices: StateSpace | tuple[list[list[Any]], ...]
) -> None:
    """Add a block with E, B, C and D as rows of fractions, or D alone that its outputs follow."""
    if len(matrices) == 1:
        rest.follow(block, *matrices)
    else:
        rest.add(f"{block.name}.", block.states, (block.inputs, block.outputs), matrices)


def _add_drawn(rest: RestEquations, kind: str, keys: dict[str, Any], block: Block) -> None:
    """Add a drawn block with the values of its keys; a type that has no equations at rest by the
    entries of a run."""
    matrices: tuple[list[list[Any]], ...] | None
    if kind == "butterworth":
        passes_constants = keys["pass"] == "low" or not block.states  # noqa: S105 - a side
        matrices = ([[int(passes_constants)]],)
    elif kind == "delay":
        # a dead time may have two inputs, and a second output, which shows changes
        matrices = ([[int(not row)] * len(block.inputs) for row in range(len(block.outputs))],)
    elif kind == "tf" and keys["discrete"]:
        matrices = _discrete_tf(keys["num"], keys["den"], keys["discrete"] == DELTA, block.states)
    else:
        matrices = at_rest(kind, keys, root)
    if matrices is None:
        _add_by_entries(rest, block)
    else:
        _add_matrices(rest, block, matrices)


def _add_plant(rest: RestEquations, plant: Plant, value: Callable[..., Any], block: Block) -> None:
    """Add the members of a plant. value: of a tree, in fractions."""
    for member in plant.members:
        start = plant.own(f"{member.name}.")
        states = [state.removeprefix(start) for state in block.states if state.startswith(start)]
        matrices: tuple[list[list[Any]], ...] = at_rest(  # type: ignore[assignment]  # all have them
            member.type, keys_with(member, value), root
        )
        if len(matrices) == 1:
            (D,) = matrices
            matrices = [], [], [[] for _ in D], D
        rest.add(plant.start(member.name), states, member.ports, matrices)


def _discrete_tf(
    num: list[Fraction], den: list[Fraction], delta: bool, states: tuple[str, ...]
) -> tuple[list[list[Any]], ...]:
    """Return `at_rest` of a transfer function in z, or in z - 1 if `delta`.

    The last k of its states may be delays, for poles at 0 (see `blocks.tf`). Then the denominator
    is z^k below(z), the numerator z^k above(z) + later(z), and the function at z = 1 is
    (above(1) + sum(later))/below(1), unless that is a pole.
    """
    n = sum(name.startswith("x") for name in states)  # without the delays
    num = [Fraction(0)] * (len(den) - len(num)) + num
    above = num[: n + 1]
    below = den[: n + 1]
    later = num[n + 1 :]
    if not delta:
        above = recentred(1, above)
        below = recentred(1, below)
    if below[-1]:
        return ([[(above[-1] + sum(later)) / below[-1]]],)
    return tf_at_rest(above, below, [coefficient / den[0] for coefficient in later])


def _of_entries(drawn: MultirateLoop, blocks: list[Block]) -> RestEquations:
    """The equations of blocks that are known by their entries alone, as those of loops that are
    made in Python."""
    rest = RestEquations()
    for block in blocks:
        _add_by_entries(rest, block)

    def traced(signal: str, factor: Fraction) -> dict[str, Fraction]:
        terms = {signal: factor} if signal in rest.outputs or signal in drawn.inputs else {}
        for source, gain in drawn.sums.get(signal, {}).items():
            for name, value in traced(source, factor * Fraction(np.ravel(gain)[0].real)).items():
                terms[name] = terms.get(name, 0) + value
        return terms

    ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
    for port in ports:
        read = traced(port, decimal(1.0))
        rest.outside[port] = {name: read.pop(name) for name in drawn.inputs if name in read}
        rest.wires[port] = read
    return rest


def equations_of(
    drawing: Drawing,
    values: Mapping[str, object],
    varied: Collection[str],
    out: str,
    blocks: Sequence[Block],
) -> RestEquations:
    """Return the equations of blocks of a drawing.

    values: flat numbers. varied: names of those that other loops have other values of. out: a
    number that is 0, or empty.
    """
    numbers = {n: decimal(x) for n, x in scalars(values).items() if isinstance(x, (int, float))}
    if out:
        numbers[out] = decimal(0.0)

    def value(tree: Tree) -> Fraction:
        return value_in_fractions(tree, numbers, varied)

    rest = RestEquations()
    cores = {block.name: block for block in drawing.cores}
    plants = {plant.name: plant for plant in drawing.plants}
    rest.plants = {block.name for block in drawing.cores if block.plant} | plants.keys()
    for block in blocks:
        if block.name in plants:
            _add_plant(rest, plants[block.name], value, block)
        else:
            core = cores[block.name]
            _add_drawn(rest, core.type, keys_with(core, value), block)
            if core.type in SUMMING:
                together = [part.name for part in drawing.cores if _clock(part) == _clock(core)]
                # By registers that run with it, of which the first is a copy.
                shown = [name for name in together if name.startswith(f"prev({core.name}.sum)")]
                for state in block.states:
                    rest.sums[f"{block.name}.{state}"] = shown[0] if shown else ""
    rest.wires, rest.outside = _wires_at_rest(drawing, rest.outputs.keys(), value, blocks)
    return rest


def _clock(block: DrawnBlock) -> tuple[str, str, tuple[Any, ...]]:
    """When a drawn block runs: texts of its period and phase."""
    return block.every.text, block.phase.text, block.phases


def _wires_at_rest(
    drawing: Drawing, outputs: Any, value: Callable[..., Any], blocks: Sequence[Block]
) -> tuple[dict[str, Sum], dict[str, Sum]]:
    """Input port of each of the blocks -> outputs that it reads, with their gains, and -> what
    else it reads. value: of a tree, in fractions."""
    sensed = {(signal, f"{name}.u") for plant in drawing.plants for signal, name in plant.sensed}
    inside = drawing.inside
    wires: dict[str, Sum] = {}
    for block in blocks:
        wires |= {f"{block.name}.{port}": {} for port in block.inputs}
    outside: dict[str, Sum] = {port: {} for port in wires}
    for port, terms in (*drawing.wires, *drawing.couplings):  # at rest, holds have no effect
        for name, gain in terms:
            reader = inside.get(port, port)
            if (name, port) in sensed:  # what a dead time reads of a plant is what it is at rest
                reader = f"{port.removesuffix('u')}{SENSED}"
            signal = inside.get(name, name)
            row = (wires if signal in outputs else outside).get(reader)
            if row is not None:
                row[signal] = row.get(signal, 0) + value(gain)
    return wires, outside
