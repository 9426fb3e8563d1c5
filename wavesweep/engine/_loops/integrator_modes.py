"""Loops whose signals do not change: their equations in fractions, and the shifts of states that
fulfil them.

The numbers of a spec count as the decimals that they are written as, and numbers of arrays as
doubles. Square roots of squares are exact; values of other functions count as the doubles that they
are, which no sum of others meets by chance.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Collection, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from math import isqrt
from typing import Any

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing, scalars
from wavesweep.engine._drawing.drawn_block import DELTA
from wavesweep.engine._drawing.expressions import FUNCTIONS, Tree, names_in
from wavesweep.engine._loops.block import Block
from wavesweep.engine._loops.blocks import recentred
from wavesweep.engine._loops.dead_time import SENSED
from wavesweep.engine._loops.definitions import at_rest, tf_at_rest
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._loops.values import keys_with

HIGHEST_POWER = 64  # power that is multiplied out
NOT_EXACT = 2**100  # 1 part in this makes a number one that no sum of others meets by chance
# Types of firmware with sums that may count for ever if no other block reads them: an impulse reads
# changes of its sum alone, and the integral of a `pi` or `pid`, which are a `tf`, may have no gain.
# A position is not among them, as its body moves.
SUMMING = ("impulse", "tf")
_OPERATIONS = {
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
    above, below = (
        isqrt(integer) if integer > 0 else 0 for integer in (number.numerator, number.denominator)
    )
    if above * above == number.numerator and below * below == number.denominator:
        return Fraction(above, below)
    return Fraction(math.sqrt(number))


def value_in_fractions(
    tree: Tree, known: Mapping[str, Fraction], varied: Collection[str] = ()
) -> Fraction:
    """Return the value of an expression. varied: names of numbers that other loops have other
    values of; a root of these is nowhere exact, since that of a square is either of two numbers.

    Errors: ArithmeticError or ValueError if it has no value.
    """
    operation, *operands, _ = tree
    if operation in ("number", "name"):
        return decimal(operands[0]) if operation == "number" else known[operands[0]]
    first, *rest = (value_in_fractions(operand, known, varied) for operand in operands)
    if operation == "sqrt" or (operation == "**" and rest[0] * 2 == 1):
        value = root(first)
        return (
            value + value / NOT_EXACT
            if any(name in varied for name, _ in names_in(operands[0]))
            else value
        )
    if operation in FUNCTIONS:
        return Fraction(getattr(math, operation)(float(first)))
    return _power(first, *rest) if operation == "**" else _OPERATIONS[operation](first, *rest)


def _power(base: Fraction, exponent: Fraction) -> Fraction:
    if exponent.denominator != 1 or abs(exponent) > HIGHEST_POWER:
        raise ArithmeticError("expected a power that is a fraction")
    return base ** int(exponent)


class RestEquations:
    """The equations of blocks at rest.

    Unknowns are states and input ports. changes: of each state that has an equation of its own, a
    sum that is 0. rows: other sums that are 0: each port less the sum that is connected to it.
    outputs: each as a sum. states: each as the unknown that it is, or as a sum of input ports that
    it follows. A block may have more ports than its equations, behind theirs: those by which a
    number is taken out of it. wires: of each port, the outputs that it reads, with their gains.
    sums: states that may count for ever if nothing reads them, each with the register that shows
    it, or "". plants: names of the blocks that move by themselves; None if it is not known which
    do.
    """

    def __init__(self) -> None:
        self.rows: list[Sum] = []
        self.wires: dict[str, Sum] = {}
        self.sums: dict[str, str] = {}
        self.plants: set[str] | None = None
        self.changes: dict[str, Sum] = {}
        self.outputs: dict[str, Sum] = {}
        self.states: dict[str, Sum] = {}

    def add(self, start: str, states, ports, parts) -> None:
        """Add a block. start: what the names of its states and ports begin with. parts: E, B, C
        and D as rows of fractions."""
        (inputs, outputs), (E, B, C, D), unit = ports, parts, decimal(1.0)
        names = [start + name for name in (*states, *inputs)]
        self.states |= {name: {name: unit} for name in names[: len(states)]}
        changes, shown = (
            [
                _substituted(dict(zip(names, (*x, *u), strict=False)), {})
                for x, u in zip(*pair, strict=True)
            ]
            for pair in ((E, B), (C, D))
        )
        self.changes |= dict(zip(names[: len(states)], changes, strict=True))
        self.outputs |= {start + port: row for port, row in zip(outputs, shown, strict=False)}

    def follow(self, block: Block, D) -> None:
        """Add a block whose outputs follow its inputs by D whatever its states are, which settle
        where its own entries say."""
        n, inputs = len(block.states), [f"{block.name}.{port}" for port in block.inputs]
        E, B = (np.array(_first(matrix)) for matrix in (block.E, block.B))
        settled = np.linalg.solve(E, -B.reshape(n, len(inputs))).tolist() if n else []
        for sums, names, rows in (
            (self.states, block.states, [[Fraction(value) for value in row] for row in settled]),
            (self.outputs, block.outputs, D),
        ):
            for name, row in zip(names, rows, strict=False):
                sums[f"{block.name}.{name}"] = _substituted(
                    dict(zip(inputs, row, strict=False)), {}
                )

    def connect(self) -> None:
        """Connect ports with the outputs that they read, and let sums that nothing reads count for
        ever: that these do not change is left out."""
        unit = decimal(1.0)
        for state, register in self.sums.items():
            if register:
                self._show(register, state)
        self.rows = [
            _substituted({port: unit} | {s: -gain for s, gain in row.items()}, self.outputs)
            for port, row in self.wires.items()
        ]
        for state in self.sums:
            if not any(state in row for row in (*self.changes.values(), *self.rows)):
                self.changes.pop(state, None)

    def _show(self, register, state):
        """Let a register show a state, of which it is a copy, in place of its input."""
        self.wires.pop(f"{register}.u", None)
        for shown in (self.states, self.outputs):
            for name in shown:
                if name.rpartition(".")[0] == register:
                    shown[name] = {state: decimal(1.0)}

    def null_space(self) -> list[Sum]:
        """Return independent solutions, of which all others are sums, ports being those of
        states as far as they can be."""
        states = [name for name, row in self.states.items() if row.keys() == {name}]
        equations = [*self.changes.values(), *self.rows]
        unknowns = [
            *dict.fromkeys(name for row in equations for name in row if name not in states),
            *states,
        ]
        rows, solved, free = [row for row in equations if row], {}, []
        for name in unknowns:
            among = [row for row in rows if name in row]
            if not among:
                free.append(name)
                continue
            chosen = min(among, key=len)
            rows.remove(chosen)
            solution = _solution(chosen, name)
            rows = [_eliminated(row, name, solution) for row in rows]
            solved = {
                variable: _eliminated(row, name, solution) for variable, row in solved.items()
            } | {name: solution}
        return [
            {name: decimal(1.0)}
            | {variable: row[name] for variable, row in solved.items() if name in row}
            for name in free
        ]

    def moving(self) -> list[Sum]:
        """Return the solutions of `null_space` as what they do to states and to outputs that are
        held."""
        shown = self.states | {f"{port} held": row for port, row in self.outputs.items()}
        return [
            {
                name: value
                for name, row in shown.items()
                if (value := sum(f * v[u] for u, f in row.items() if u in v))
            }
            for v in self.null_space()
        ]


def _solution(row: Sum, name: str) -> Sum:
    """The variable of this name as the sum of others that makes the row zero."""
    return {term: -value / row[name] for term, value in row.items() if term != name}


def _eliminated(row: Sum, name: str, solution: Sum) -> Sum:
    """A sum in which a variable is replaced by its solution, if it has that variable."""
    return _substituted(row, {name: solution}) if name in row else row


def _substituted(row: Sum, known: Mapping[str, Sum]) -> Sum:
    """A sum in which each known unknown is the sum that it is of others."""
    total: Sum = {}
    for name, factor in row.items():
        if not factor:
            continue
        terms = (
            ((unknown, factor * value) for unknown, value in known[name].items())
            if name in known
            else ((name, factor),)
        )
        for (
            unknown,
            term,
        ) in terms:  # a sum with 0, or a product with 1, of fractions takes as long as others
            total[unknown] = total[unknown] + term if unknown in total else term
    return {name: value for name, value in total.items() if value}


def _pop_shift(moving: list[Sum], lead: str) -> Sum:
    """Take the first solution that moves the lead out of the list, and return it with the value
    1 there."""
    at = next((at for at, candidate in enumerate(moving) if lead in candidate), None)
    if at is None:
        raise ArithmeticError("expected shifts of the same states")
    shift = moving.pop(at)
    return {name: value / shift[lead] for name, value in shift.items()}


def _led(by_lead: Mapping[str, Sum]) -> list[dict[str, float]]:
    """The shifts in floating point, each with its lead as its first key."""
    return [
        {lead: 1.0} | {name: float(value) for name, value in shift.items() if name != lead}
        for lead, shift in by_lead.items()
    ]


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
    they are known. Errors: ArithmeticError or ValueError where numbers are not known as fractions.
    """
    rest = rest_of_blocks(drawn, names)
    rest.connect()
    moving = rest.moving()
    by_lead: dict[str, Sum] = {}
    while moving and not (leads and len(by_lead) == len(leads)):
        states = [name for name in moving[0] if name in rest.states]
        if not (leads or states):
            moving = moving[1:]
            continue
        lead = (
            leads[len(by_lead)]
            if leads
            else max(states, key=lambda name: abs(float(moving[0][name])))
        )
        shift = _pop_shift(moving, lead)
        by_lead = {name: _without(earlier, shift, lead) for name, earlier in by_lead.items()} | {
            lead: shift
        }
        moving = [_without(later, shift, lead) for later in moving]
    return _led(by_lead)


def _without(shifted: Sum, shift: Sum, lead: str) -> Sum:
    """Another shift, from which so much of this one is taken that it does not move the lead."""
    share = shifted.get(lead, 0)
    less = (
        {name: shifted.get(name, 0) - share * value for name, value in shift.items()}
        if share
        else {}
    )
    return {name: value for name, value in (shifted | less).items() if value}


def _first(part):
    return part[(0,) * (part.ndim - 2)].real.tolist()


def _add_by_entries(rest, block):
    """Add a block that is known by its entries alone."""
    matrices = block.at_rest or (block.E, block.B, block.C, block.D)
    rows = [[[Fraction(value) for value in row] for row in _first(matrix)] for matrix in matrices]
    if len(rows) == 1:
        rest.follow(block, *rows)
    else:
        rest.add(f"{block.name}.", block.states, (block.inputs, block.outputs), rows)


def _add_drawn(rest, kind, keys, block):
    """Add a drawn block with the values of its keys; a type that has no equations at rest by the
    entries of a run."""
    if kind == "butterworth":
        matrices = ([[int(keys["pass"] == "low" or not block.states)]],)  # noqa: S105 - the side that passes
    elif (
        kind == "delay"
    ):  # a dead time may have two inputs, and a second output, which shows changes
        matrices = ([[int(not at)] * len(block.inputs) for at in range(len(block.outputs))],)
    elif kind == "tf" and keys["discrete"]:
        matrices = _discrete_tf(keys["num"], keys["den"], keys["discrete"] == DELTA, block.states)
    else:
        matrices = at_rest(kind, keys, root)
    if matrices is None:
        _add_by_entries(rest, block)
    elif len(matrices) == 1:
        rest.follow(block, *matrices)
    else:
        rest.add(f"{block.name}.", block.states, (block.inputs, block.outputs), matrices)


def _add_plant(rest, plant, value, block):
    """Add the members of a plant. value: of a tree, in fractions."""
    for member in plant.members:
        start = plant.own(f"{member.name}.")
        states = [state.removeprefix(start) for state in block.states if state.startswith(start)]
        matrices = at_rest(member.type, keys_with(member, value), root)
        matrices = (
            ([], [], [[] for _ in matrices[0]], *matrices) if len(matrices) == 1 else matrices
        )
        rest.add(plant.start(member.name), states, member.ports, matrices)


def _discrete_tf(num, den, delta, states):
    """A transfer function in z or z - 1 at rest; the last of its states may be delays (see
    `blocks.tf`)."""
    num, n = [0] * (len(den) - len(num)) + num, sum(name.startswith("x") for name in states)
    later = num[n + 1 :]
    above, below = (
        powers[: n + 1] if delta else recentred(1, powers[: n + 1]) for powers in (num, den)
    )
    if below[-1]:
        return ([[(above[-1] + sum(later)) / below[-1]]],)
    return tf_at_rest(above, below, [coefficient / den[0] for coefficient in later])


def _of_entries(drawn, blocks) -> RestEquations:
    """The equations of blocks that are known by their entries alone, as those of loops that are
    made in Python."""
    rest = RestEquations()
    for block in blocks:
        _add_by_entries(rest, block)

    def traced(signal, factor):
        terms = {signal: factor} if signal in rest.outputs else {}
        for source, gain in drawn.sums.get(signal, {}).items():
            for name, value in traced(source, factor * Fraction(np.ravel(gain)[0].real)).items():
                terms[name] = terms.get(name, 0) + value
        return terms

    ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
    rest.wires = {port: traced(port, decimal(1.0)) for port in ports}
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
    rest, cores = RestEquations(), {block.name: block for block in drawing.cores}
    numbers = {
        name: decimal(value)
        for name, value in scalars(values).items()
        if isinstance(value, (int, float))
    }
    numbers |= {out: decimal(0.0)} if out else {}

    def value(tree):
        return value_in_fractions(tree, numbers, varied)

    plants = {plant.name: plant for plant in drawing.plants}
    rest.plants = {block.name for block in drawing.cores if block.plant} | plants.keys()
    for block in blocks:
        if block.name in plants:
            _add_plant(rest, plants[block.name], value, block)
        else:
            core = cores[block.name]
            _add_drawn(rest, core.type, keys_with(core, value), block)
            if core.type in SUMMING:
                register = cores.get(f"prev({core.name}.sum)")
                shown = register is not None and _clock(register) == _clock(core)
                for state in block.states:
                    rest.sums[f"{block.name}.{state}"] = register.name if shown else ""
    rest.wires = _wires_at_rest(drawing, rest.outputs.keys(), value, blocks)
    return rest


def _clock(block):
    """When a drawn block runs: trees of its period and phase without their places in the text."""
    return block.every[:2], block.phase[:2], block.phases


def _wires_at_rest(drawing, outputs, value, blocks) -> dict[str, Sum]:
    """Input port of each of the blocks -> outputs that it reads, with their gains. value: of a
    tree, in fractions."""
    sensed, inside = (
        {(signal, f"{name}.u") for plant in drawing.plants for signal, name in plant.sensed},
        drawing.inside,
    )
    wires: dict[str, Sum] = {
        f"{block.name}.{port}": {} for block in blocks for port in block.inputs
    }
    for port, terms in (*drawing.wires, *drawing.couplings):  # at rest, holds have no effect
        for name, gain in terms:  # what a dead time reads of a plant is what it is at rest
            read, signal = (
                port if (name, port) not in sensed else f"{port[:-1]}{SENSED}",
                inside.get(name, name),
            )
            row = wires.get(inside.get(read, read))
            if row is not None and signal in outputs:
                row[signal] = row.get(signal, 0) + value(gain)
    return wires
