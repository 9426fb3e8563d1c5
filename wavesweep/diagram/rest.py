"""The equations of a drawn loop whose signals do not change, in residues of a prime, which show the exact zeros.

A number has a residue if it is a fraction, as doubles and decimals are, and so has a sum, product or quotient of such numbers.
Roots and broken powers have some residue, the same for the same argument.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import partial
from hashlib import sha256

from wavesweep.diagram.block import Block
from wavesweep.diagram.elimination import PRIME
from wavesweep.spec.drawing import Drawing, DrawnBlock, scalars
from wavesweep.spec.exact import constants_of, named
from wavesweep.spec.expressions import Tree, evaluate


class Residue:
    """The residue of a number, with the arithmetic of expressions. Errors: ZeroDivisionError."""

    __slots__ = ("value",)

    def __init__(self, value: int) -> None:
        self.value = value % PRIME

    @staticmethod
    def of(number: object, decimals: bool = False) -> Residue:
        """The residue of a double; decimals: of the shortest decimal that is read as this double."""
        if isinstance(number, Residue):
            return number
        exact = Fraction(repr(float(number))) if decimals else Fraction(number)
        return Residue(exact.numerator * pow(exact.denominator, -1, PRIME))

    def __add__(self, other):
        return Residue(self.value + Residue.of(other).value)

    def __sub__(self, other):
        return Residue(self.value - Residue.of(other).value)

    def __mul__(self, other):
        return Residue(self.value * Residue.of(other).value)

    def __truediv__(self, other):
        divisor = Residue.of(other).value
        if not divisor:
            raise ZeroDivisionError
        return Residue(self.value * pow(divisor, -1, PRIME))

    def __pow__(self, other):
        if not isinstance(other, Residue) and float(other).is_integer():
            return Residue(pow(self.value, int(other), PRIME))
        return _scattered("power", self.value, Residue.of(other).value)

    def __neg__(self):
        return Residue(-self.value)

    def __rmul__(self, other):
        return self * other

    def __rtruediv__(self, other):
        return Residue.of(other) / self

    def __bool__(self):
        return bool(self.value)

    def sqrt(self) -> Residue:
        """Some residue in place of the root."""
        return _scattered("root", self.value)


def _scattered(*given):
    return Residue(int.from_bytes(sha256(repr(given).encode()).digest()))


def exact_shifts(
    drawing: Drawing, values: Mapping[str, object], out: str, blocks: Sequence[Block], shifts: Sequence[dict[str, float]]
) -> list[dict[str, float]] | None:
    """Return the shifts without states that do not move, or None if blocks of a drawing do not have exactly these.

    The numbers of a spec are taken as doubles or, if that fails, as decimals. values: flat numbers. out: a number that is taken
    out of its place. shifts: see `wavesweep.diagram.drawn.shifts`; rounding may have left traces in them of zeros.
    """
    try:
        tried = (_agreeing(_Equations(drawing, values, out, decimals), blocks, shifts) for decimals in (False, True))
        return next((found for found in tried if found is not None), None)
    except (ZeroDivisionError, OverflowError, ValueError):  # numbers that make no loop
        return None


def _agreeing(equations, blocks, shifts):
    leads = [next(iter(shift)) for shift in shifts]
    rows, known = equations.of(blocks)
    pivots = _reduced(rows, leads)
    unknowns = {f"{block.name}.{name}" for block in blocks for name in (*block.states, *block.inputs)}
    if pivots is None or len(unknowns) - len(pivots) != len(leads):
        return None
    moved = [{lead} | {name for name, row in pivots.items() if row.get(lead)} for lead in leads]
    if not all(each & known <= shift.keys() for each, shift in zip(moved, shifts, strict=True)):
        return None
    return [
        {name: factor for name, factor in shift.items() if name in each or name not in known}
        for each, shift in zip(moved, shifts, strict=True)
    ]


def _reduced(rows, leads):
    """Rows in reduced echelon form by their pivots, none of which is a lead; None if there is a row of leads alone."""
    open_ = [{name: value.value for name, value in row.items() if value} for row in rows]
    pivots = {}
    while open_ := sorted(filter(None, open_), key=len):
        first, *open_ = open_
        name = next((each for each in first if each not in leads), None)
        if name is None:
            return None
        inverse = pow(first[name], -1, PRIME)
        first = {each: value * inverse % PRIME for each, value in first.items()}
        for row in (*open_, *pivots.values()):
            factor = row.get(name, 0)
            for each, value in first.items() if factor else ():
                row[each] = (row.get(each, 0) - factor * value) % PRIME
                if not row[each]:
                    del row[each]
        pivots[name] = first
    return pivots


class _Equations:
    """The equations of the blocks of a drawing at rest.

    Each type of block gives its rows, which are zero, and its outputs, as unknown -> factor; unknowns are states and inputs.
    """

    def __init__(self, drawing, values, out, decimals):
        self.types = {block.name: block for block in drawing.blocks}
        self.wires, self.number = dict(drawing.wires), partial(Residue.of, decimals=decimals)
        self.known = {name: Residue.of(value) for name, value in scalars(values).items() if isinstance(value, (int, float))}
        self.known |= {out: Residue(0)} if out else {}

    def of(self, blocks: Iterable[Block]) -> tuple[list[dict[str, Residue]], set[str]]:
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

    def _connected(self, block, outputs) -> Iterator[dict[str, Residue]]:
        for port in block.inputs:
            row = {f"{block.name}.{port}": Residue(1)}
            for signal, gain in self.wires.get(f"{block.name}.{port}", ()):
                factor = self._value(gain)
                for name, value in outputs.get(signal, {}).items():
                    row[name] = row.get(name, Residue(0)) - factor * value
            yield row

    def _value(self, tree: Tree) -> Residue:
        numbers = {constant: self.number(constant) for constant in constants_of(tree)} | self.known
        return Residue.of(evaluate(named(tree), numbers, Residue.sqrt))

    def _key(self, block: DrawnBlock, name: str) -> Residue:
        return self._value(dict(block.keys)[name])

    def _row(self, names, trees):
        return {name: self._value(tree) for name, tree in zip(names, trees, strict=True)}

    def _mass(self, block, _):
        stiffness = self._key(block, "stiffness")
        rows = [{"v": Residue(1)}, {"f": Residue(1), "x": -stiffness}]
        return rows, {"x": {"x": Residue(1)}, "v": {"v": Residue(1)}}, True

    def _ss(self, block, states):
        keys = dict(block.keys)
        rows = [self._row((*states, *keys["inputs"]), (*a, *b)) for a, b in zip(keys["A"], keys["B"], strict=True)]
        for state, row in zip(states, rows, strict=True) if keys["discrete"] else ():
            row[state] -= Residue(1)
        D = keys["D"] or [[("number", 0.0, 0)] * len(keys["inputs"])] * len(keys["outputs"])
        C = keys["C"] or [[]] * len(keys["outputs"])
        both = zip(keys["outputs"], C, D, strict=True)
        return rows, {port: self._row((*states, *keys["inputs"]), (*c, *d)) for port, c, d in both}, True

    def _tf(self, block, states):
        keys = dict(block.keys)
        num, den = ([self._value(tree) for tree in keys[name]] for name in ("num", "den"))
        num = [Residue(0)] * (len(den) - len(num)) + num
        later = [state for state in states if state.startswith("u")]
        last, n = num[len(num) - len(later) :], len(den) - 1 - len(later)
        if keys["discrete"]:
            at_one = sum(num, Residue(0)), sum(den, Residue(0))
            if at_one[1]:
                return *self._following(states, at_one[0] / at_one[1]), False
            num, den = _about_one(num[: n + 1]), _about_one(den[: n + 1])
        if not n:
            return [], {"y": {"u": num[0] / den[0]}}, True
        names, lead = [state for state in states if state not in later], den[0]
        rows = [{"u": lead} | {name: -value for name, value in zip(names, den[1:], strict=True)}]
        rows += [{name: Residue(1)} for name in names[:-1]] + [{name: Residue(1), "u": Residue(-1)} for name in later]
        shown = {name: value / lead for name, value in zip(names, num[1:], strict=True)}
        return rows, {"y": shown | {name: value / lead for name, value in zip(later, last, strict=True)}}, True

    def _following(self, states, factor):
        """States that are some multiple of the input, and an output that is this one."""
        return [{state: Residue(1), "u": Residue(-1)} for state in states], {"y": {"u": factor}}

    def _gain(self, block, _):
        return [], {"y": {"u": self._key(block, "k")}}, True

    def _hold(self, *_):
        return [], {"y": {"u": Residue(1)}}, True

    def _delay(self, _, states):
        return *self._following(states, Residue(1)), True

    def _difference(self, _, states):
        return *self._following(states, Residue(0)), True

    def _integrator(self, _, states):
        return [{"u": Residue(1)}], {"y": {state: Residue(1) for state in states}}, True

    def _butterworth(self, block, states):
        low = dict(block.keys)["pass"] == "low"  # noqa: S105 - the side that passes
        return *self._following(states, Residue(low or not states)), False

    def _wave(self, block, _):
        b = self._key(block, "b")
        root, one = (b * 2.0).sqrt(), Residue(1)
        if dict(block.keys)["gives"] == "force":
            return [], {"force": {"v": b, "in": -root}, "out": {"v": root, "in": -one}}, True
        return [], {"v": {"in": root / b, "f": -one / b}, "out": {"in": one, "f": -root / b}}, True

    def _avatar(self, block, _):
        root, one = (self._key(block, "b") * 2.0).sqrt(), Residue(1)
        outputs = {"v": {}, "x": {"s": one}, "x_spring": {"s": one}, "out": {"in": -one}}
        return [{"in": root, "f": -one}], outputs, True

    def _local_model(self, block, _):
        root = (self._key(block, "b") * 2.0).sqrt()
        return [{"in": root, "s": -self._key(block, "K")}], {"out": {"in": Residue(-1)}}, True


def _about_one(coefficients):
    """Coefficients of descending powers of z - 1 from those of z."""
    found = list(coefficients)
    for end in range(len(found), 1, -1):
        for i in range(1, end):
            found[i] = found[i] + found[i - 1]
    return found
