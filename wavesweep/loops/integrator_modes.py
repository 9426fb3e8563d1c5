"""Loops whose signals do not change: their equations in exact numbers, and the shifts of states that fulfil them.

The numbers of a spec count as the decimals that they are written as, and numbers of arrays as doubles. Square roots are exact
too: numbers then are matrices, those by which they multiply the products of the roots. Values of other functions count as
doubles; these are fractions to which no sum of others comes by chance.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Collection, Mapping, Sequence
from decimal import Decimal
from math import isqrt, sqrt
from types import SimpleNamespace

import numpy as np

from wavesweep.loops.block import Block
from wavesweep.loops.dead_time import SENSED
from wavesweep.loops.multirate import MultirateLoop
from wavesweep.spec.drawing import PORT, Drawing, scalars
from wavesweep.spec.expressions import FUNCTIONS, Tree, names_in
from wavesweep.spec.words import DELTA

MOST_ROOTS = 3  # that are independent
HIGHEST = 64  # power that is multiplied out
_OPERATIONS = {"+": operator.add, "-": operator.sub, "*": operator.mul}


class _NewRoot(ArithmeticError):
    """A root that is none of the numbers yet."""


class Numbers:
    """Fractions, and sums of fractions times products of some square roots; both have `+`, `-` and `*`.

    Roots that depend on each other make numbers other than 0 without an inverse. Where none of these is divided by, what is
    found holds for either sign of each root.
    """

    def __init__(self, roots: Sequence = ()) -> None:
        """roots: fractions whose roots are numbers. ImportError without python-flint."""
        from flint import fmpq, fmpq_mat

        self.fraction, self.matrix, self.squares = fmpq, fmpq_mat, [fmpq(1)]
        for root in roots:
            self.squares += [root * square for square in self.squares]
        self.one = self._product(0)

    def _product(self, which):
        """A product of roots: those of the bits of `which`."""
        size = len(self.squares)
        if size == 1:
            return self.fraction(1)
        found = self.matrix(size, size)
        for other in range(size):
            found[other ^ which, other] = self.squares[other & which]
        return found

    def decimal(self, value: float):
        """The decimal that a double is written as."""
        return self.fraction(*Decimal(repr(float(value))).as_integer_ratio()) * self.one

    def double(self, value: float):
        """The double itself."""
        return self.fraction(*float(value).as_integer_ratio()) * self.one

    def rational(self, number):
        """The fraction that a number is. Errors: ArithmeticError."""
        found = number if len(self.squares) == 1 else number[0, 0]
        if number != found * self.one:
            raise ArithmeticError("expected a fraction")
        return found

    def inverse(self, number):
        """1 over it. Errors: ZeroDivisionError."""
        return 1 / number if len(self.squares) == 1 else number.inv()

    def root(self, number, *, simple: bool):
        """The square root. simple: whether that of a square is a fraction; otherwise it has either sign."""
        number = self.rational(number)
        for which, square in enumerate(self.squares):
            ratio = number / square
            above, below = (isqrt(int(part)) if part > 0 else 0 for part in (ratio.p, ratio.q))
            if (which or simple or not number) and self.fraction(above, below) ** 2 == ratio:
                return self.fraction(above, below) * self._product(which)
        raise _NewRoot(number)

    def to_double(self, number) -> float:
        """The nearest double, but for a few roundings."""
        if len(self.squares) == 1:
            return _double(number)
        return sum(_double(number[i, 0]) * sqrt(abs(_double(square))) for i, square in enumerate(self.squares))


def _double(number) -> float:
    """The nearest double of a rational or whole number; python-flint before 0.9 has no `float` of them."""
    return int(number.p) / int(number.q) if hasattr(number, "q") else float(int(number))


def shifts(drawn: MultirateLoop, names: Collection[str], leads: Sequence[str] = ()) -> list[dict[str, float]]:
    """Return the independent shifts of states of some blocks that nothing in the loop opposes.

    A shift is a solution with all signals constant and no input: no state changes, and each port is the sum connected to it. A
    state has the name "block.state", an output that is held "block.port held". Each shift has a lead, a state of its own which
    is first among its keys, with the value 1; the other shifts do not move that state.
    names: of the blocks. leads: those of the shifts, if they are known. Errors: ArithmeticError or ValueError where numbers are
    neither fractions nor roots, or are none.
    """
    blocks = [each.block for each in drawn.placed if each.block.name in names]
    numbers, rows, outputs, states = drawn.exact(blocks) if drawn.exact else _of_entries(drawn, blocks)
    ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
    moving = _null_space(numbers, rows, ports, {name: row for name, row in states.items() if row.keys() == {name}})
    moving = [[_combined(vector, terms) for terms in (states, outputs)] for vector in moving]
    found = _with_leads(numbers, moving, leads)
    return [
        {lead: 1.0}
        | {name: numbers.to_double(value) for name, value in own.items() if value and name != lead}
        | {f"{port} held": numbers.to_double(value) for port, value in held.items() if value}
        for lead, (own, held) in found.items()
    ]


def _null_space(numbers, rows, ports, states):
    """Solutions of equations, unknown -> value, of which all others are sums. rows: unknown -> factor, which add up to 0."""
    solved = {}
    for given in sorted(rows, key=len):
        row = _substituted(given, solved)
        if not row:
            continue
        name = next((name for name in row if name not in states), next(iter(row)))
        scale = -numbers.inverse(row.pop(name))
        found = {name: {other: value * scale for other, value in row.items()}}
        for pivot, other in solved.items():
            if name in other:
                solved[pivot] = _substituted(other, found)
        solved |= found
    free = [name for name in (*ports, *states) if name not in solved]
    return [{one: numbers.one} | {name: row[one] for name, row in solved.items() if one in row} for one in free]


def _substituted(row, known):
    """A sum in which each known unknown is the sum that it is of others."""
    found = {}
    for name, factor in row.items():
        for other, value in known[name].items() if name in known else ((name, None),):
            term = factor if value is None else factor * value
            found[other] = found[other] + term if other in found else term
    return {name: value for name, value in found.items() if value}


def _combined(vector, terms):
    """The sums of a solution that have these terms, those that are not 0."""
    found = {}
    for name, row in terms.items():
        parts = [factor * vector[each] for each, factor in row.items() if each in vector]
        if parts and (total := sum(parts[1:], parts[0])):
            found[name] = total
    return found


def _with_leads(numbers, moving, leads):
    """Lead -> its shift, as states and outputs; a solution that moves no state is none. leads: if they are known."""
    found = {}
    while moving:
        own = moving[0][0]
        if leads:
            lead = leads[len(found)]
            at = next((at for at, each in enumerate(moving) if lead in each[0]), None)
            if at is None:
                raise ArithmeticError("expected shifts of the same states")
        elif own:
            lead, at = max(own, key=lambda name: abs(numbers.to_double(own[name]))), 0
        else:
            moving = moving[1:]
            continue
        scale = numbers.inverse(moving[at][0][lead])
        shift = [{name: value * scale for name, value in part.items()} for part in moving.pop(at)]
        found = {name: _without(each, shift, lead) for name, each in found.items()} | {lead: shift}
        moving = [_without(each, shift, lead) for each in moving]
        if leads and len(found) == len(leads):
            break
    return found


def _without(each, shift, lead):
    """Another shift, less so much of this one that it does not move the lead."""
    if lead not in each[0]:
        return each
    share = each[0][lead]
    less = [{name: -share * value for name, value in part.items()} for part in shift]
    sums = [
        one | {name: one[name] + value if name in one else value for name, value in two.items()}
        for one, two in zip(each, less, strict=True)
    ]
    return [{name: value for name, value in part.items() if value} for part in sums]


def _of_entries(drawn, blocks):
    """The numbers, rows, outputs and states of blocks that are known by their entries alone; see `equations_of`."""
    numbers, rows, outputs, states = Numbers(), [], {}, {}
    for block in blocks:
        E, B, C, D = block.at_rest or (block.E, block.B, block.C, block.D)
        follow = _settled(numbers, block) if block.at_rest and not C.any() and (-np.eye(E.shape[-1]) == E).all() else {}
        names = [f"{block.name}.{name}" for name in (*block.states, *block.inputs)]
        of_states, of_outputs = (
            [{name: numbers.double(v) for name, v in zip(names, row, strict=True) if v} for row in _first(*pair)]
            for pair in ((E, B), (C, D))
        )
        rows += of_states if not follow else []
        outputs |= {f"{block.name}.{port}": row for port, row in zip(block.outputs, of_outputs, strict=True)}
        states |= {name: {name: numbers.one} for name in names[: len(block.states)]}
        states |= {f"{block.name}.{state}": {f"{block.name}.u": value} for state, value in follow.items()}

    def traced(signal, factor):
        if signal in outputs:
            yield signal, factor
        for source, gain in drawn.sums.get(signal, {}).items():
            yield from traced(source, factor * numbers.double(np.ravel(gain)[0].real))

    wires = {
        port: list(traced(port, numbers.one)) for port in (f"{block.name}.{port}" for block in blocks for port in block.inputs)
    }
    return numbers, rows + _connected(numbers, wires, outputs), outputs, states


def _first(left, right):
    """Two matrices of the first of a batch side by side."""
    return np.hstack([each[(0,) * (each.ndim - 2)].real for each in (left, right)]).tolist()


def _settled(numbers, block):
    """By what multiples of the input states follow it."""
    E, B = (each[(0,) * (each.ndim - 2)].real for each in (block.E, block.B))
    found = np.linalg.solve(E, -B)[:, 0].tolist() if block.states else []
    return {state: numbers.double(value) for state, value in zip(block.states, found, strict=True)}


def _connected(numbers, wires, outputs):
    """A row for each port, which is the sum connected to it."""
    return [
        _substituted({port: numbers.one} | {signal: -gain for signal, gain in _summed(terms)}, outputs)
        for port, terms in wires.items()
    ]


def _summed(terms):
    found = {}
    for signal, gain in terms:
        found[signal] = found[signal] + gain if signal in found else gain
    return found.items()


def equations_of(
    drawing: Drawing, values: Mapping[str, object], varied: Collection[str], out: str, blocks: Sequence[Block]
) -> tuple:
    """Return the numbers, and the equations of blocks of a drawing: rows, outputs and states as unknown -> factor.

    Unknowns are states and input ports. Rows are sums that are 0: of each change of a state, and of each port less the sum
    connected to it. values: flat numbers; varied: names of those that other loops have other values of. out: one that is 0.
    """
    roots = []
    while True:
        try:
            return _Equations(drawing, values, varied, out, Numbers(roots)).of(blocks)
        except _NewRoot as error:
            roots.append(error.args[0])
            if len(roots) > MOST_ROOTS:
                raise


class _Equations:
    """The equations of the blocks of a drawing at rest.

    Each type of block gives its rows, its outputs, and those states that follow from its inputs, as unknown -> factor.
    """

    def __init__(self, drawing, values, varied, out, numbers):
        self.types, self.numbers, self.varied = {block.name: block for block in drawing.cores}, numbers, varied
        self.plants, inside = {plant.name: plant for plant in drawing.plants}, drawing.inside
        sensed = {(signal, f"{name}.u") for plant in drawing.plants for signal, name in plant.sensed}
        self.wires = {}  # at rest it is all one whether a wire is held
        for port, terms in (*drawing.wires, *drawing.couplings):
            for name, gain in terms:  # what a dead time reads of a plant is what it is at rest
                own = port if (name, port) not in sensed else f"{port[:-1]}{SENSED}"
                self.wires.setdefault(inside.get(own, own), []).append((inside.get(name, name), gain))
        self.known = {name: value for name, value in scalars(values).items() if isinstance(value, (int, float))}
        self.known |= {out: 0.0} if out else {}

    def of(self, blocks):
        rows, outputs, states, one = [], {}, {}, self.numbers.one
        for start, drawn, own_states in (each for block in blocks for each in self._members(block)):
            own, shown, follow = getattr(self, f"_{drawn.type}")(drawn, own_states)

            def named(row, start=start):
                found = ((start + each, value * one if isinstance(value, int) else value) for each, value in row.items())
                return {each: value for each, value in found if value}

            rows += map(named, own)
            outputs |= {start + port: named(row) for port, row in shown.items()}
            states |= {start + state: named(follow.get(state, {state: 1})) for state in own_states.states}
        ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
        wires = {
            port: [(signal, self._value(gain)) for signal, gain in self.wires.get(port, ()) if signal in outputs]
            for port in ports
        }
        return self.numbers, rows + _connected(self.numbers, wires, outputs), outputs, states

    def _members(self, block):
        """Yield what the names of a block's ports and states begin with, the block as drawn, and one with its states."""
        if block.name not in self.plants:
            yield f"{block.name}.", self.types[block.name], block
            return
        for member in self.plants[block.name].members:
            start = f"{member.name}{PORT}".replace(".", PORT)
            own = [state.removeprefix(start) for state in block.states if state.startswith(start)]
            yield self.plants[block.name].start(member.name), member, SimpleNamespace(states=own)

    def _value(self, tree: Tree):
        operation, *parts, _ = tree
        if operation == "number":
            return self.numbers.decimal(parts[0])
        if operation == "name":
            return self.numbers.decimal(self.known[parts[0]])
        first, *others = map(self._value, parts)
        if operation == "sqrt":
            return self.numbers.root(first, simple=not any(name in self.varied for name, _ in names_in(tree)))
        if operation in FUNCTIONS:
            return self.numbers.double(getattr(math, operation)(self.numbers.to_double(first)))
        return -first if operation == "negative" else self._joined(operation, first, others[0], tree)

    def _joined(self, operation, first, second, tree):
        if operation in _OPERATIONS:
            return _OPERATIONS[operation](first, second)
        if operation == "/":
            return first * self.numbers.inverse(second)
        exponent = self.numbers.rational(second)
        if exponent * 2 == 1:
            return self._value(("sqrt", tree[1], 0))
        if exponent.q != 1 or abs(exponent) > HIGHEST:
            raise ArithmeticError("expected a power that is a fraction")
        found = self.numbers.one
        for _ in range(abs(int(exponent.p))):
            found = found * first
        return found if exponent >= 0 else self.numbers.inverse(found)

    def _key(self, block, name):
        return self._value(dict(block.keys)[name])

    def _impedance(self, block):
        """b, and sqrt(2 b)."""
        b = dict(block.keys)["b"]
        return self._value(b), self._value(("sqrt", ("*", b, ("number", 2.0, 0), 0), 0))

    def _row(self, names, trees):
        return {name: self._value(tree) for name, tree in zip(names, trees, strict=True)}

    def _mass(self, block, _):
        return [{"v": 1}, {"f": 1, "x": -self._key(block, "stiffness")}], {"x": {"x": 1}, "v": {"v": 1}}, {}

    _inertia = _mass

    def _spring(self, block, _):
        k, d = (self._key(block, name) for name in "kd")
        rows = {"x1": -k, "v1": -d, "x2": k, "v2": d}, {"x1": k, "v1": d, "x2": -k, "v2": -d}
        return [], dict(zip(("f1", "f2"), rows, strict=True)), {}

    def _ss(self, block, own):
        keys = dict(block.keys)
        names = (*own.states, *keys["inputs"])
        rows = [self._row(names, (*a, *b)) for a, b in zip(keys["A"], keys["B"], strict=True)]
        for state, row in zip(own.states, rows, strict=True) if keys["discrete"] else ():
            row[state] -= self.numbers.one
        C = keys["C"] or [()] * len(keys["outputs"])
        D = keys["D"] or [[("number", 0.0, 0)] * len(keys["inputs"])] * len(keys["outputs"])
        return rows, {port: self._row(names, (*c, *d)) for port, c, d in zip(keys["outputs"], C, D, strict=True)}, {}

    def _tf(self, block, own):
        keys = dict(block.keys)
        num, den = ([self._value(tree) for tree in keys[name]] for name in ("num", "den"))
        num = [0 * self.numbers.one] * (len(den) - len(num)) + num
        names, later = ([name for name in own.states if name.startswith(kind)] for kind in "xu")
        last, n = num[len(num) - len(later) :], len(names)
        if keys["discrete"]:
            about = (lambda each: each) if keys["discrete"] == DELTA else _about_one
            above, below = about(num)[-1], about(den)[-1]
            if below:
                return [], {"y": {"u": above * self.numbers.inverse(below)}}, self._settled(own)
            num, den = about(num[: n + 1]), about(den[: n + 1])
        share = self.numbers.inverse(den[0])
        if not n:
            return [], {"y": {"u": num[0] * share}}, {}
        rows = [{"u": den[0]} | {name: -value for name, value in zip(names, den[1:], strict=True)}]
        rows += [{name: 1} for name in names[:-1]]
        shown = {name: value * share for name, value in zip(names, num[1:], strict=True)}
        through = sum(last[1:], last[0]) * share if last else 0
        return rows, {"y": shown | {"u": through}}, {name: {"u": 1} for name in later}

    def _settled(self, own):
        return {state: {"u": value} for state, value in _settled(self.numbers, own).items()}

    def _gain(self, block, _):
        return [], {"y": {"u": self._key(block, "k")}}, {}

    def _hold(self, *_):
        return [], {"y": {"u": 1}}, {}

    def _delay(self, _, own):
        return [], {"y": dict.fromkeys(own.inputs, 1)}, {state: {state.rstrip("0123456789"): 1} for state in own.states}

    _mean = _delay

    def _difference(self, _, own):
        return [], {"y": {}}, {state: {"u": 1} for state in own.states}

    def _integrator(self, *_):
        return [{"u": 1}], {"y": {"s": 1}}, {}

    def _butterworth(self, block, own):
        low = dict(block.keys)["pass"] == "low"  # noqa: S105 - the side that passes
        return [], {"y": {"u": int(low or not own.states)}}, self._settled(own)

    def _wave(self, block, _):
        b, root = self._impedance(block)
        if dict(block.keys)["gives"] == "force":
            return [], {"force": {"v": b, "in": -root}, "out": {"v": root, "in": -1}}, {}
        share = self.numbers.inverse(b)
        return [], {"v": {"in": root * share, "f": -share}, "out": {"in": 1, "f": -root * share}}, {}

    def _avatar(self, block, _):
        outputs = {"v": {}, "x": {"s": 1}, "x_spring": {"s": 1}, "out": {"in": -1}}
        return [{"in": self._impedance(block)[1], "f": -1}], outputs, {}

    def _local_model(self, block, _):
        return [{"in": self._impedance(block)[1], "s": -self._key(block, "K")}], {"out": {"in": -1}}, {}


def _about_one(coefficients):
    """Coefficients of descending powers of z - 1 from those of z."""
    found = list(coefficients)
    for end in range(len(found), 1, -1):
        for i in range(1, end):
            found[i] = found[i] + found[i - 1]
    return found
