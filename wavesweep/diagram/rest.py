"""The equations of a drawn loop whose signals do not change, in residues of a prime, which show the exact zeros."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction

from wavesweep.diagram.block import Block
from wavesweep.diagram.elimination import PRIME
from wavesweep.diagram.residues import PRIMES, Field, NoRoot, Residue
from wavesweep.spec.drawing import Drawing, DrawnBlock, scalars
from wavesweep.spec.exact import constants_of, named
from wavesweep.spec.expressions import Tree, evaluate


def exact_shifts(
    drawing: Drawing,
    values: Mapping[str, object],
    out: str,
    blocks: Sequence[Block],
    shifts: Sequence[dict[str, float]],
    outputs: Mapping[str, Sequence[tuple[str, float]]],
) -> list[dict[str, float]] | None:
    """Return the shifts of all that moves exactly, or None if blocks of a drawing do not have exactly these.

    The numbers of a spec are taken as doubles or, if that fails, as decimals. values: flat numbers. out: a number that is taken
    out of its place. shifts: see `wavesweep.diagram.drawn.shifts`; rounding may have left traces in them of zeros. outputs: of
    each port the (unknown, factor) pairs of which it is the sum.
    """
    try:
        tried = (_agreeing(*_equations(drawing, values, out, decimals, blocks), shifts, outputs) for decimals in (False, True))
        return next((found for found in tried if found is not None), None)
    except (ZeroDivisionError, OverflowError, ValueError):  # numbers that make no loop
        return None


def _equations(drawing, values, out, decimals, blocks):
    """Rows, the states that they know, all unknowns, and the field, the first one that has the roots if any has."""
    unknowns = {f"{block.name}.{name}" for block in blocks for name in (*block.states, *block.inputs)}
    for prime in PRIMES:
        field = Field(prime, decimals)
        with suppress(NoRoot):
            return *_Equations(drawing, values, out, field).of(blocks), unknowns, field
    field = Field(PRIME, decimals, scattered=True)
    return *_Equations(drawing, values, out, field).of(blocks), unknowns, field


def _agreeing(rows, known, unknowns, field, shifts, outputs):
    leads = [next(iter(shift)) for shift in shifts]
    pivots = _reduced(rows, leads, field)
    if pivots is None or len(unknowns) - len(pivots) != len(leads):
        return None
    moved = [{lead} | {name for name, row in pivots.items() if row.get(lead)} for lead in leads]
    if not all(each & known <= shift.keys() for each, shift in zip(moved, shifts, strict=True)):
        return None

    def moves(name, each):
        """Whether a state moves, or anything that a held output is the sum of."""
        port = name.removesuffix(" held")
        return name in each or (port in outputs and any(source in each for source, factor in outputs[port] if factor))

    return [
        {name: factor for name, factor in shift.items() if moves(name, each)} for each, shift in zip(moved, shifts, strict=True)
    ]


def _reduced(rows, leads, field):
    """Rows in reduced echelon form by their pivots, none of which is a lead; None if there is a row of leads alone."""
    open_ = [{name: field.of(value).value for name, value in row.items() if value} for row in rows]
    pivots, prime = {}, field.prime
    while open_ := sorted(filter(None, open_), key=len):
        first, *open_ = open_
        name = next((each for each in first if each not in leads), None)
        if name is None:
            return None
        inverse = pow(first[name], -1, prime)
        first = {each: value * inverse % prime for each, value in first.items()}
        for row in (*open_, *pivots.values()):
            factor = row.get(name, 0)
            for each, value in first.items() if factor else ():
                row[each] = (row.get(each, 0) - factor * value) % prime
                if not row[each]:
                    del row[each]
        pivots[name] = first
    return pivots


class _Equations:
    """The equations of the blocks of a drawing at rest.

    Each type of block gives its rows, which are zero, and its outputs, as unknown -> factor; unknowns are states and inputs.
    """

    def __init__(self, drawing, values, out, field):
        self.types = {block.name: block for block in drawing.blocks}
        self.wires, self.field = dict(drawing.wires), field
        numbers = {name: value for name, value in scalars(values).items() if isinstance(value, (int, float))}
        self.known = {name: field.of(Fraction(value)) for name, value in numbers.items()}
        self.known |= {out: field.of(0)} if out else {}

    def of(self, blocks: Iterable[Block]) -> tuple[list[dict[str, Residue | int]], set[str]]:
        """Return the rows, and the states that they know: those of filters are some multiples of their input."""
        rows, outputs, known, blocks = [], {}, set(), list(blocks)
        for block in blocks:
            own, ports, plain = getattr(self, f"_{self.types[block.name].type}")(self.types[block.name], block.states)
            rows += [{f"{block.name}.{name}": value for name, value in row.items()} for row in own]
            outputs |= {
                f"{block.name}.{port}": {f"{block.name}.{name}": value for name, value in row.items()}
                for port, row in ports.items()
            }
            known |= {f"{block.name}.{state}" for state in block.states} if plain else set()
        for block in blocks:
            rows += self._connected(block, outputs)
        return rows, known

    def _connected(self, block, outputs) -> Iterator[dict[str, Residue | int]]:
        for port in block.inputs:
            row = {f"{block.name}.{port}": 1}
            for signal, gain in self.wires.get(f"{block.name}.{port}", ()):
                factor = self._value(gain)
                for name, value in outputs.get(signal, {}).items():
                    row[name] = row.get(name, 0) - factor * value
            yield row

    def _value(self, tree: Tree) -> Residue:
        numbers = {constant: self.field.of(constant) for constant in constants_of(tree)} | self.known
        return self.field.of(evaluate(named(tree), numbers, Residue.sqrt))

    def _key(self, block: DrawnBlock, name: str) -> Residue:
        return self._value(dict(block.keys)[name])

    def _row(self, names, trees):
        return {name: self._value(tree) for name, tree in zip(names, trees, strict=True)}

    def _mass(self, block, _):
        stiffness = self._key(block, "stiffness")
        rows = [{"v": 1}, {"f": 1, "x": -stiffness}]
        return rows, {"x": {"x": 1}, "v": {"v": 1}}, True

    def _ss(self, block, states):
        keys = dict(block.keys)
        rows = [self._row((*states, *keys["inputs"]), (*a, *b)) for a, b in zip(keys["A"], keys["B"], strict=True)]
        for state, row in zip(states, rows, strict=True) if keys["discrete"] else ():
            row[state] -= 1
        D = keys["D"] or [[("number", 0.0, 0)] * len(keys["inputs"])] * len(keys["outputs"])
        C = keys["C"] or [[]] * len(keys["outputs"])
        both = zip(keys["outputs"], C, D, strict=True)
        return rows, {port: self._row((*states, *keys["inputs"]), (*c, *d)) for port, c, d in both}, True

    def _tf(self, block, states):
        keys = dict(block.keys)
        num, den = ([self._value(tree) for tree in keys[name]] for name in ("num", "den"))
        num = [0] * (len(den) - len(num)) + num
        later = [state for state in states if state.startswith("u")]
        last, n = num[len(num) - len(later) :], len(den) - 1 - len(later)
        if keys["discrete"]:
            at_one = sum(num), sum(den)
            if at_one[1]:
                return *self._following(states, at_one[0] / at_one[1]), False
            num, den = _about_one(num[: n + 1]), _about_one(den[: n + 1])
        if not n:
            return [], {"y": {"u": num[0] / den[0]}}, True
        names, lead = [state for state in states if state not in later], den[0]
        rows = [{"u": lead} | {name: -value for name, value in zip(names, den[1:], strict=True)}]
        rows += [{name: 1} for name in names[:-1]] + [{name: 1, "u": -1} for name in later]
        shown = {name: value / lead for name, value in zip(names, num[1:], strict=True)}
        return rows, {"y": shown | {name: value / lead for name, value in zip(later, last, strict=True)}}, True

    def _following(self, states, factor):
        """States that are some multiple of the input, and an output that is this one."""
        return [{state: 1, "u": -1} for state in states], {"y": {"u": factor}}

    def _gain(self, block, _):
        return [], {"y": {"u": self._key(block, "k")}}, True

    def _hold(self, *_):
        return [], {"y": {"u": 1}}, True

    def _delay(self, _, states):
        return *self._following(states, 1), True

    def _difference(self, _, states):
        return *self._following(states, 0), True

    def _integrator(self, _, states):
        return [{"u": 1}], {"y": dict.fromkeys(states, 1)}, True

    def _butterworth(self, block, states):
        low = dict(block.keys)["pass"] == "low"  # noqa: S105 - the side that passes
        return *self._following(states, int(low or not states)), False

    def _wave(self, block, _):
        b = self._key(block, "b")
        root = (b * 2.0).sqrt()
        if dict(block.keys)["gives"] == "force":
            return [], {"force": {"v": b, "in": -root}, "out": {"v": root, "in": -1}}, True
        return [], {"v": {"in": root / b, "f": -1 / b}, "out": {"in": 1, "f": -root / b}}, True

    def _avatar(self, block, _):
        root = (self._key(block, "b") * 2.0).sqrt()
        outputs = {"v": {}, "x": {"s": 1}, "x_spring": {"s": 1}, "out": {"in": -1}}
        return [{"in": root, "f": -1}], outputs, True

    def _local_model(self, block, _):
        root = (self._key(block, "b") * 2.0).sqrt()
        return [{"in": root, "s": -self._key(block, "K")}], {"out": {"in": -1}}, True


def _about_one(coefficients):
    """Coefficients of descending powers of z - 1 from those of z."""
    found = list(coefficients)
    for end in range(len(found), 1, -1):
        for i in range(1, end):
            found[i] = found[i] + found[i - 1]
    return found
