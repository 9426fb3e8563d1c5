"""The blocks of a drawn loop with some of its numbers anywhere in a cell, and the ticks that they
make.

What the blocks do is written in `_loops.definitions`, for numbers of every kind; here the numbers
are Taylor models of the sides of the cell. Names of states and ports are those of the loop in
doubles, whose structure this follows.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from flint import arb, ctx

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import Drawing, name_of, scalars
from wavesweep.engine._drawing.drawn_block import DELTA, DrawnBlock, Plant
from wavesweep.engine._drawing.expressions import (
    FUNCTIONS,
    ONE,
    Tree,
)
from wavesweep.engine._loops import dead_time, definitions
from wavesweep.engine._loops.blocks import realisation
from wavesweep.engine._loops.filters import sections, sections_of_angle
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._loops.values import keys_with
from wavesweep.engine._sets.taylor_models import (
    BALL_BITS,
    Polynomials,
    TaylorModel,
    UnresolvedError,
)

if TYPE_CHECKING:
    from wavesweep.engine._loops.block import Block
    from wavesweep.engine._loops.definitions import Equations


@dataclass(frozen=True, slots=True)
class Side:
    """A side t of a cell, of the number with this path.

    The number is t itself if `zero` is NaN; `zero + exp(t)` for one that changes by a factor; `zero
    + (end - zero)/(1 + exp(-t))` for one that also comes near to an end.
    """

    path: str
    zero: float = np.nan
    end: float = np.inf

    def number(self, t: Any) -> Any:
        """Return the number at places of the side, doubles or arrays."""
        with np.errstate(all="ignore"):
            if np.isnan(self.zero):
                return np.array(t)
            return self.zero + (
                np.exp(t) if np.isinf(self.end) else (self.end - self.zero) / (1 + np.exp(-t))
            )

    def place(self, number: Any) -> Any:
        """Return t at numbers, doubles or arrays."""
        with np.errstate(all="ignore"):
            if np.isnan(self.zero):
                return np.array(number)
            above = number - self.zero
            return np.log(above if np.isinf(self.end) else above / (self.end - number))

    def model(self, t: Any) -> Any:
        """Return the number at a place that is a model or an arb."""
        if np.isnan(self.zero):
            return t
        return self.zero + (
            t.exp() if np.isinf(self.end) else (self.end - arb(self.zero)) / (1 + (-t).exp())
        )


class BlockModel(NamedTuple):
    """A block `x[k+1] - x[k] = E x[k] + B u[k]`, `y[k] = C x[k] + D u[k]` in a cell."""

    E: Polynomials
    B: Polynomials
    C: Polynomials
    D: Polynomials


class EnclosedLoop:
    """A drawn loop of which some numbers are anywhere in a cell.

    drawing, values: of one loop, flat; values have the whole ticks of dead times. sides: of the
    cells. own_units: names of filters whose states may be in units that depend on the sides.
    """

    def __init__(
        self,
        drawing: Drawing,
        values: Mapping[str, Any],
        sides: Sequence[Side],
        order: int,
        own_units: Collection[str] = (),
    ) -> None:
        self.drawing = drawing
        self.sides = tuple(sides)
        self.order = order
        self.own_units = own_units
        numbers = {name: value for name, value in scalars(values).items() if value is not None}
        self.known = dead_time.built(drawing, numbers)
        self.names = tuple(name_of(side.path) for side in sides)
        self.kept: dict[Any, Any] = {}
        self.last: tuple[np.ndarray, LoopModel] | None = None  # the cell that was asked for last

    def over(self, cells: np.ndarray, known: dict[Any, BlockModel] | None = None) -> LoopModel:
        """Return the blocks and the gains of the wires in cells that are wide along the same sides
        and the same along all others, `(*cells, 2, sides)`.

        known: blocks in these cells, of loops with the same values and sides; those that are the
        same here are taken from there. Errors: UnresolvedError if a cell is too wide for a bound;
        its numbers are those of the sides that are wide.
        """
        if self.last is not None and np.array_equal(self.last[0], cells):
            return self.last[1]
        with ctx.workprec(BALL_BITS):
            model = _Evaluation(self, cells, {} if known is None else known).model()
        self.last = cells, model
        return model


@dataclass(frozen=True, slots=True, eq=False)
class LoopModel:
    """The blocks of a loop by name, and the gains of its junctions, in cells of this shape."""

    blocks: Mapping[str, BlockModel]
    sums: Mapping[str, Mapping[str, Any]]
    numbers: int
    order: int
    cells: tuple[int, ...]

    def tick(
        self,
        loop: MultirateLoop,
        place: int,
        held: Mapping[str, Sequence[str]],
        exact: Collection[str] = (),
    ) -> Polynomials:
        """Return the map of a tick less the identity, `(*cells, n, n)`, with the states of
        `Ticks.of`.

        loop: the same in doubles, whose blocks run as its schedule says. place: of the tick in its
        frame. held: the ports that each block holds. exact: blocks whose entries in doubles are
        what they are.

        With the blocks side by side, `y = C x + D u` and the wires `u = K y` give `(I - K D) u = K
        C x`.
        """
        placed = [scheduled.block for scheduled in loop.placed]
        n = sum(len(block.states) + len(held[block.name]) for block in placed)
        ports = [f"{block.name}.{port}" for block in placed for port in block.inputs]
        made = [f"{block.name}.{port}" for block in placed for port in block.outputs]
        A = self._zeros(n, n)
        B = self._zeros(n, len(ports))
        C = self._zeros(len(made), n)
        D = self._zeros(len(made), len(ports))
        state = 0
        entry = 0
        out = 0
        for scheduled in loop.placed:
            block = scheduled.block
            of_block = slice(state, state + len(block.states))
            into = slice(entry, entry + len(block.inputs))
            shown = slice(out, out + len(block.outputs))
            rows = [block.outputs.index(port) for port in held[block.name]]
            holding = np.arange(of_block.stop, of_block.stop + len(rows))
            if scheduled.runs(place + 1)[place]:
                is_exact = block.name in exact or block.name not in self.blocks
                model = self._exactly(block) if is_exact else self.blocks[block.name]
                A.put((of_block, of_block), model.E)
                B.put((of_block, into), model.B)
                C.put((shown, of_block), model.C)
                D.put((shown, into), model.D)
                A.put((holding, of_block), model.C.at(rows, range(len(block.states))))
                B.put((holding, into), model.D.at(rows, range(len(block.inputs))))
                A.terms[0, ..., holding, holding] = -1.0
            else:
                C.terms[0, ..., [out + row for row in rows], holding] = 1.0
            state = of_block.stop + len(rows)
            entry = into.stop
            out = shown.stop
        K = self._wires(loop, ports, made)
        return A + B @ self._closed(K @ D, K @ C)

    def parts(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the sizes of the terms of each matrix of a block, and of each gain, `(monomials,
        *cells)`, and what is left out of it."""
        for block in self.blocks.values():
            for matrix in block:
                yield np.abs(matrix.terms).sum((-1, -2)), matrix.rest.sum((-1, -2))
        for terms in self.sums.values():
            for gain in terms.values():
                if isinstance(gain, TaylorModel):
                    yield np.abs(gain.terms), gain.rest

    def _zeros(self, *shape: int) -> Polynomials:
        return Polynomials.constant(np.zeros((*self.cells, *shape)), self.numbers, self.order)

    def _exactly(self, block: Block) -> BlockModel:
        return exactly(block, self.numbers, self.order, len(self.cells))

    def _wires(self, loop: MultirateLoop, ports: list[str], made: list[str]) -> Polynomials:
        """The gains from outputs to ports, those of other junctions put in."""
        traced: dict[str, dict[str, Any]] = {signal: {signal: 1} for signal in made}
        traced |= {signal: {} for signal in loop.inputs}

        def trace(signal: str) -> dict[str, Any]:
            if signal not in traced:
                gains: dict[str, Any] = {}
                terms = self.sums[signal] if loop.sums.get(signal) else {}
                for source, gain in terms.items():
                    for end, factor in trace(source).items():
                        gains[end] = gains.get(end, 0) + gain * factor
                traced[signal] = gains
            return traced[signal]

        rows = [[trace(port).get(signal, 0) for signal in made] for port in ports]
        shape = len(ports), len(made)
        return Polynomials.of_entries(rows, shape, self.numbers, self.order, self.cells)

    def _closed(self, L: Polynomials, R: Polynomials) -> Polynomials:
        """The solution of `u = L u + R`; without a loop in L it takes no inverse."""
        acts: np.ndarray = np.any(L.whole > 0, tuple(range(L.whole.ndim - 2)))
        steps = 0
        reached: np.ndarray = np.eye(len(acts), dtype=bool)
        while reached.any() and steps <= len(acts):
            steps += 1
            reached = (reached.astype(float) @ acts) > 0
        if steps <= len(acts):
            solution = R
            for _ in range(steps - 1):
                solution = R + L @ solution
            return solution
        ring = np.flatnonzero((acts | acts.T).any(0))
        loop_matrix = L.at(ring, ring)
        solved = (loop_matrix.identity() - loop_matrix).inverse() @ R.at(
            ring, range(R.rest.shape[-1])
        )
        solution = Polynomials(R.terms.copy(), R.rest.copy(), self.numbers, self.order)
        solution.terms[..., ring, :] = solved.terms
        solution.rest[..., ring, :] = solved.rest
        return solution


def exactly(block: Any, numbers: int, order: int, axes: int) -> BlockModel:
    """Return a block whose entries in doubles are what they are, the same in all cells. axes: of
    the cells."""
    matrices = []
    for matrix in (block.E, block.B, block.C, block.D):
        in_cells = matrix.reshape(*(1,) * axes, *matrix.shape)
        matrices.append(Polynomials.constant(in_cells, numbers, order))
    return BlockModel(*matrices)


class _Evaluation:
    """Some cells of a loop: the values of its expressions, and the blocks that these make."""

    def __init__(self, loop: EnclosedLoop, cells: np.ndarray, known: dict[Any, BlockModel]) -> None:
        first_cell = cells.reshape(-1, *cells.shape[-2:])[0]
        wide = np.flatnonzero(first_cell[0] < first_cell[1])
        self.loop = loop
        self.numbers = wide.size
        self.order = loop.order
        self.known = known
        self.cells = cells.shape[:-2]
        self.values = {}
        for index, (name, side) in enumerate(zip(loop.names, loop.sides, strict=True)):
            low = cells[..., 0, index]
            high = cells[..., 1, index]
            value: TaylorModel | arb
            if index in wide:
                number = int(np.searchsorted(wide, index))
                value = TaylorModel.side(number, low, high, wide.size, loop.order)
            else:
                value = arb(float(low.flat[0]))
            self.values[name] = side.model(value)
        self.library = SimpleNamespace(
            **{name: _function(name) for name in FUNCTIONS},
            pi=arb.pi(),
            hypot=lambda a, b: _function("sqrt")(a * a + b * b),
        )

    def model(self) -> LoopModel:
        drawing = self.loop.drawing
        rate = self.value(drawing.tick_hz)
        tick = 1 / rate
        blocks = {}
        for block in drawing.alone:
            if not block.dead_time:
                blocks[block.name] = self._once(block, self._block, block, tick)
        for name in drawing.dead_times:
            blocks[name] = self._dead_time(name)
        shares = self._shares(rate)
        for plant in drawing.plants:
            blocks[plant.name] = self._once(plant, self._plant, plant, tick, shares)
        inside = drawing.inside
        sums = {}
        for port, terms in drawing.wires:
            gains = {inside.get(signal, signal): self.value(gain) for signal, gain in terms}
            sums[inside.get(port, port)] = gains
        if drawing.dead_times:
            sums = dead_time.joined(sums, drawing.plants, inside, "", "")
        return LoopModel(blocks, sums, self.numbers, self.order, self.cells)

    def _shares(self, rate: TaylorModel | arb) -> dict[Any, Any]:
        """The share s of each dead time of `(m - s)` ticks.

        Errors: UnresolvedError if it may be of other whole ticks somewhere in the cell, or if
        another one may come before it.
        """
        drawing = self.loop.drawing
        constants = self.loop.known
        shares = {}
        for name, tree in drawing.dead_times.items():
            shares[name] = constants[f"block.{name}.ticks"] - self.value(tree) * rate
        for path, names in drawing.building.items():
            total = sum(shares[name] for name in names)
            low = 1 if len(names) == 2 and constants[path] else 0  # ticks
            most_late = dead_time.WHOLE_TICK * (1 + constants[f"block.{names[0]}.ticks"])
            for beyond in (low - total, total - (low + 1)):
                if isinstance(beyond, TaylorModel):
                    late = beyond.ends()[1] > most_late
                    number = beyond.widest()
                else:
                    late = float(arb(beyond).upper()) > most_late
                    number = -1
                if np.any(late):
                    raise UnresolvedError(late, number)
        return shares

    def _once(self, block: DrawnBlock, make: Callable[..., Any], *arguments: Any) -> BlockModel:
        """The model of a block, kept for all cells if it reads none of the sides, and else for
        other loops in this cell."""
        trees = [self.loop.drawing.tick_hz, *(tree for _, tree in block.trees())]
        if isinstance(block, Plant):
            timed = {name for _, name in (*block.arriving, *block.sensed)}
            trees += [tree for name, tree in self.loop.drawing.dead_times.items() if name in timed]
        models: dict[Any, Any] = self.loop.kept
        key: Any = block.name, self.numbers, len(self.cells)
        if any(self.reads(tree) for tree in trees):
            models = self.known
            key = block
        if key not in models:
            models[key] = make(*arguments)
        return models[key]

    def reads(self, tree: Tree) -> bool:
        """Whether a tree reads a number of the sides."""
        return any(name in self.values for name in tree.names)

    def value(self, tree: Tree) -> Any:
        """The value of a tree: a model, or an arb if it reads none of the sides."""
        numbers: dict[Any, Any] = {constant: arb(constant) for constant in tree.constants}
        for name in tree.names:
            numbers[name] = self.values[name] if name in self.values else arb(self.loop.known[name])
        try:
            return tree.in_names.evaluate(numbers, self.library)
        except ZeroDivisionError:
            raise UnresolvedError(np.ones(self.cells, bool)) from None

    def _keys(self, block: DrawnBlock) -> dict[str, Any]:
        keys = keys_with(block, self.value, lambda tree: tree.value(self.loop.known))
        if block.type == "ss" and not keys["D"]:
            keys["D"] = [[0] * len(keys["inputs"]) for _ in keys["outputs"]]
        return keys

    def _block(self, block: DrawnBlock, tick: Any) -> BlockModel:
        every = int(block.every.value(self.loop.known))
        period = tick * every / max(1, len(block.phases))
        if TYPES[block.type].formula:
            return self._of_formula(block, period)
        core = block.core(ONE)
        keys = self._keys(core)
        if core.type == "butterworth":
            highpass = keys["pass"] == "high"  # noqa: S105 - the side that passes
            return self._filter(block.name, keys["order"], keys["cutoff_hz"], highpass, period)
        if core.type == "tf" and keys["discrete"] is True:
            written: list[float | None] = []
            for tree in dict(core.keys)["den"]:
                written.append(None if tree.names else float(tree.evaluate({})))
            return self._discrete(keys["num"], keys["den"], written)
        if not TYPES[core.type].plant:
            return self._arranged(definitions.running(core.type, period, keys, self.library.sqrt))
        equations = definitions.continuous(core.type, keys)
        if core.type == "spring":
            return self._arranged(equations)
        if keys.get("discrete") is True:
            less_identity = []
            for i, row in enumerate(equations.E):
                less_identity.append([entry - int(i == j) for j, entry in enumerate(row)])
            equations = equations._replace(E=less_identity)
        if keys.get("discrete"):
            return self._arranged(equations)
        rates = self._arranged(equations)
        return BlockModel(*self._held(rates.E, rates.B, period), rates.C, rates.D)

    def _of_formula(self, block: DrawnBlock, period: Any) -> BlockModel:
        """A block of firmware: the transfer function whose coefficients are formulas of its keys
        and of T."""
        core = dict(block.core(ONE, named=True).keys)
        numbers = {"T": period}
        for name, value in self._keys(block).items():
            if not isinstance(value, str):
                numbers[name] = value
        num = [self._in_names(tree, numbers) for tree in core["num"]]
        den = [self._in_names(tree, numbers) for tree in core["den"]]
        if core["discrete"] == DELTA:
            return self._arranged(definitions.controllable(num, den))
        return self._discrete(num, den, [None] * len(den))

    def _in_names(self, tree: Tree, numbers: dict[str, TaylorModel | arb]) -> TaylorModel | arb:
        constants: dict[Any, Any] = {constant: arb(constant) for constant in tree.constants}
        try:
            return tree.in_names.evaluate({**numbers, **constants}, self.library)
        except ZeroDivisionError:
            raise UnresolvedError(np.ones(self.cells, bool)) from None

    def _arranged(self, equations: Equations) -> BlockModel:
        """The matrices of equations whose entries are models or numbers."""
        n = len(equations.states)
        p = len(equations.D)
        m = len(equations.D[0]) if p else 0
        return BlockModel(
            self._matrix(equations.E, (n, n)),
            self._matrix(equations.B, (n, m)),
            self._matrix(equations.C, (p, n)),
            self._matrix(equations.D, (p, m)),
        )

    def _matrix(self, rows: list[list[Any]], shape: tuple[int, int]) -> Polynomials:
        cells = (1,) * len(self.cells)
        return Polynomials.of_entries(rows, shape, self.numbers, self.order, cells)

    def _discrete(
        self, num: list[Any], den: list[Any], written: Sequence[float | None]
    ) -> BlockModel:
        """A transfer function in z in the realisation of `blocks.tf`. written: coefficients of
        den that are plain numbers."""
        delays, centre = realisation(written)
        n = len(den) - 1 - delays
        num = [0] * (len(den) - len(num)) + list(num)
        equations = definitions.controllable(
            _recentred(centre, num[: n + 1]), _recentred(centre, den[: n + 1])
        )
        E = []
        for i, row in enumerate(equations.E):
            E.append([entry + (centre - 1) * int(i == j) for j, entry in enumerate(row)])
        later = [coefficient / den[0] for coefficient in num[n + 1 :]]
        return self._arranged(definitions.with_delays(equations._replace(E=E), later))

    def _filter(
        self, name: str, order: int, cutoff_hz: TaylorModel | arb, highpass: bool, period: arb
    ) -> BlockModel:
        """A Butterworth filter: its sections in series, the first nearest to the input."""
        E: list[list[Any]] = []
        B: list[list[Any]] = []
        C: list[Any] = []
        D = 1
        in_series = []
        if order:
            angle = self.library.pi * cutoff_hz * period
            if name in self.loop.own_units and isinstance(angle, TaylorModel):
                parts = angle.sin(), angle.cos()
                in_series = sections_of_angle(order, *parts, highpass, self.library)
            else:
                in_series = sections(order, self.library.tan(angle), highpass, self.library)
        for e, b, c, d in in_series:
            through = d[0][0]
            E = [[*row, *[0] * len(e)] for row in E]
            for (input_gain,), row in zip(b, e, strict=True):
                E.append([*(input_gain * entry for entry in C), *row])
                B.append([input_gain * D])
            C = [*(through * entry for entry in C), *c[0]]
            D = through * D
        return self._arranged(
            definitions.Equations(tuple(map(str, range(len(E)))), E, B, [C], [[D]])
        )

    def _held(
        self, A: Polynomials, B: Polynomials, period: TaylorModel | arb
    ) -> tuple[Polynomials, Polynomials]:
        """`exp(A T) - 1` and `int_0^T exp(A s) ds B`."""
        n, m = B.rest.shape[-2:]
        cells = np.broadcast_shapes(A.rest.shape[:-2], B.rest.shape[:-2])
        zeros = np.zeros((*cells, n + m, n + m))
        both = Polynomials.constant(zeros, self.numbers, self.order)
        for part, columns in ((A, slice(n)), (B, slice(n, n + m))):
            both.terms[..., :n, columns] = part.terms
            both.rest[..., :n, columns] = part.rest
        moved = both.scaled(period).exponential()
        E = moved.at(range(n), range(n))
        return E - E.identity(), moved.at(range(n), range(n, n + m))

    def _couplings(self, plant: Plant) -> Polynomials:
        """K of `u = K y + e`, `(*cells, inputs, outputs)`."""
        inputs, outputs = plant.drawn_ports
        gains: list[list[Any]] = [[0] * len(outputs) for _ in inputs]
        for port, terms in plant.couplings:
            for signal, gain in terms:
                gains[inputs.index(port)][outputs.index(signal)] = self.value(gain)
        return self._matrix(gains, (len(inputs), len(outputs)))

    def _plant(self, plant: Plant, period: Any, shares: Mapping[str, Any]) -> BlockModel:
        """Blocks that act on each other by `u = K y + e`, e held over the period; see
        `_loops.plant.plant_of`."""
        inputs, outputs = plant.drawn_ports
        members = (
            self._arranged(definitions.continuous(b.type, self._keys(b))) for b in plant.members
        )
        A, B, C, D = (_diagonal(matrices) for matrices in zip(*members, strict=True))
        K = self._couplings(plant)
        back = B @ K
        shown, through = _shown(C, D, K)
        A = A + back @ shown
        B = B + back @ through
        E, G = self._held(A, B, period)
        states = range(A.rest.shape[-1])
        columns = [G]
        for port, name in plant.arriving:
            column = B.at(states, [inputs.index(port)])
            columns.append(self._held(A, column, shares[name] * period)[1])
        shape = *(1,) * len(self.cells), len(outputs), len(plant.arriving)
        nothing = Polynomials.constant(np.zeros(shape), self.numbers, self.order)
        rows_of_C = [shown]
        rows_of_D = [_joined([through, nothing], -1)]
        for signal, name in plant.sensed:
            i = [outputs.index(signal)]
            row = shown.at(i, states)
            moved, pushed = self._held(A, B, shares[name] * period)
            rows_of_C.append(row + row @ moved)
            direct = [through.at(i, range(len(inputs))) + row @ pushed]
            for port, earlier in plant.arriving:
                if not self.loop.known[f"block.{earlier}.before.{name}"]:
                    direct.append(nothing.at([0], [0]))
                    continue
                j = [inputs.index(port)]
                late = (shares[earlier] + shares[name] - 1) * period
                direct.append(through.at(i, j) + row @ self._held(A, B.at(states, j), late)[1])
            rows_of_D.append(_joined(direct, -1))
        return BlockModel(E, _joined(columns, -1), _joined(rows_of_C, -2), _joined(rows_of_D, -2))

    def _dead_time(self, name: str) -> BlockModel:
        """The block of a dead time, whose entries are whole numbers."""
        drawing = self.loop.drawing
        sensed = set()
        arriving = False
        for plant in drawing.plants:
            sensed |= {signal for signal, delay in plant.sensed if delay == name}
            arriving |= name in [delay for _, delay in plant.arriving]
        read = [signal for signal, _ in dict(drawing.wires).get(f"{name}.u", ())]
        reads_plain = not sensed.issuperset(read)
        ticks = self.loop.known[f"block.{name}.ticks"]
        block = dead_time.block_of(
            name, ticks, sensed=bool(sensed), plain=reads_plain, arriving=arriving
        )
        return exactly(block, self.numbers, self.order, len(self.cells))


def _function(name: str) -> Callable[..., Any]:
    """A function of models and balls."""

    def applied(value: TaylorModel | arb) -> TaylorModel | arb:
        return getattr(value if isinstance(value, TaylorModel | arb) else arb(value), name)()

    return applied


def _recentred(centre: int, coefficients: list[TaylorModel | arb]) -> list[TaylorModel | arb]:
    """Return the coefficients of a polynomial in descending powers of z - c, c = 1 or -1, from those
    of z: Horner's scheme divides by z - c again and again, and each remainder is one of them."""
    sums = list(coefficients)
    for end in range(len(sums), 1, -1):
        for i in range(1, end):
            sums[i] = sums[i] + centre * sums[i - 1]
    return sums


def _diagonal(parts: tuple[Polynomials, ...]) -> Polynomials:
    """Matrices along a diagonal."""
    height = sum(part.rest.shape[-2] for part in parts)
    width = sum(part.rest.shape[-1] for part in parts)
    cells = np.broadcast_shapes(*(part.rest.shape[:-2] for part in parts))
    zeros = np.zeros((*cells, height, width))
    whole = Polynomials.constant(zeros, parts[0].numbers, parts[0].order)
    row = column = 0
    for part in parts:
        below = row + part.rest.shape[-2]
        right = column + part.rest.shape[-1]
        whole.terms[..., row:below, column:right] = part.terms
        whole.rest[..., row:below, column:right] = part.rest
        row = below
        column = right
    return whole


def _joined(parts: list[Polynomials], axis: int) -> Polynomials:
    """Matrices side by side (axis -1) or below each other (-2)."""
    cells = np.broadcast_shapes(*(part.rest.shape[:-2] for part in parts))
    parts = [part.in_cells(cells) for part in parts]
    terms = np.concatenate([part.terms for part in parts], axis)
    rest = np.concatenate([part.rest for part in parts], axis)
    return Polynomials(terms, rest, parts[0].numbers, parts[0].order)


def _shown(C: Polynomials, D: Polynomials, K: Polynomials) -> tuple[Polynomials, Polynomials]:
    """`M C` and `M D` with `M = (1 - D K)^-1`: the outputs of blocks that act on each other by K."""
    L = D @ K
    if not L.whole.any():
        return C, D
    M = (L.identity() - L).inverse()
    return M @ C, M @ D
