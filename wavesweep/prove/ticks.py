"""A drawn loop tick by tick in ball arithmetic: every number is its double, and every result has a bound on its error.

A number of the loop may be a ball that holds a whole range of it, real or complex.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, partial, reduce
from math import lcm
from types import SimpleNamespace
from typing import Any

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx

from wavesweep.engine.drawing.block_types import TYPES
from wavesweep.engine.drawing.drawing import Drawing, scalars
from wavesweep.engine.drawing.drawn_block import DrawnBlock, Plant
from wavesweep.engine.drawing.expressions import FUNCTIONS, Tree, constants_of, evaluate, named, names_in, value_of
from wavesweep.prove.ball_blocks import continuous, held, matrices

# Balls of roots and logarithms that meet a cut are not finite.
_LIBRARIES = {
    arb: arb,
    acb: SimpleNamespace(
        **{name: getattr(acb, name) for name in FUNCTIONS}
        | {name: partial(getattr(acb, name), analytic=True) for name in ("sqrt", "log")}
    ),
}


class UndecidedError(Exception):
    """These bits, or this way, do not tell."""


class BallLoop:
    """A drawn loop along one of its numbers; values: flat, as a spec has them.

    A frame maps states and outputs that something may read while their block does not run.
    Errors: ValueError for a dead time in seconds, which `loops.dead_time.in_whole_ticks` gives in ticks.
    """

    def __init__(self, drawing: Drawing, values: Mapping[str, Any], number: str) -> None:
        if drawing.dead_times:
            raise ValueError(f"dead times in seconds: {', '.join(drawing.dead_times)}")
        self.drawing, self.number, self._kept = drawing, number, {}
        self.blocks = [*(block.core(drawing.tick_hz) for block in drawing.alone), *drawing.plants]
        self.values = {name: value for name, value in scalars(values).items() if value is not None}
        every = [int(value_of(block.every, self.values)) for block in self.blocks]
        phases = [block.phases or (int(value_of(block.phase, self.values)),) for block in self.blocks]
        self.every, self.phases, self.ticks = every, phases, lcm(*every)
        rhythms = list(enumerate(zip(every, phases, strict=True)))
        self.kinds = tuple(tuple(i for i, (n, phases) in rhythms if t % n in phases) for t in range(self.ticks))
        self.inputs, self.outputs = (
            [(i, f"{block.name}.{port}") for i, block in enumerate(self.blocks) for port in block.ports[side]]
            for side in (0, 1)
        )
        self.at = {signal: j for j, (_, signal) in enumerate(self.outputs)}
        self.wires = {}
        for port, terms in drawing.wires:
            named = ((drawing.inside.get(signal, signal), gain) for signal, gain in terms)
            self.wires[drawing.inside.get(port, port)] = [(signal, gain) for signal, gain in named if signal in self.at]
        read = {self.at[signal] for terms in self.wires.values() for signal, _ in terms}
        self.held = [j for j, (i, _) in enumerate(self.outputs) if every[i] > 1 and j in read]

    def rate(self, number: Any) -> Any:
        """The rate of the tick (Hz) at a value of the number."""
        return self._value(self.drawing.tick_hz, number)

    def frame(self, number: Any) -> tuple[Any, Any]:
        """The map of a frame, and the product of the determinants of the algebraic loops in its ticks.

        number: an arb or an acb. Entries are NaN if an algebraic loop may have no solution in that ball.
        """
        ticks = self.tick_maps(number)
        pivot = reduce(lambda total, kind: total * ticks[kind][1], self.kinds, type(number)(1))
        return product(self.kinds, {kind: tick for kind, (tick, _) in ticks.items()}), pivot

    def pattern(self, number: Any) -> np.ndarray:
        """The entries of the frame that may not be 0 for a value in the ball `number`; zeros of sums are not seen."""
        ones = {kind: arb_mat(_places(tick).astype(int).tolist()) for kind, (tick, _) in self.tick_maps(number).items()}
        return _places(product(self.kinds, ones))

    def tick_maps(self, number: Any) -> dict[tuple[int, ...], tuple[Any, Any]]:
        """The map of each kind of tick, and the determinant of its algebraic loops."""
        blocks = [self._block(i, block, number) for i, block in enumerate(self.blocks)]
        matrix = arb_mat if isinstance(number, arb) else acb_mat
        owners, wires = [i for i, block in enumerate(blocks) for _ in block[0]], self._wire_gains(matrix, number)
        orders, ports = [len(A) for A, *_ in blocks], [len(block.ports[0]) for block in self.blocks]
        A, B, C, D = (_diagonal([block[k] for block in blocks], (orders, ports)[k % 2]) for k in range(4))
        return {kind: self._tick(set(kind), matrix, owners, wires, A, B, C, D) for kind in set(self.kinds)}

    def _wire_gains(self, matrix, number):
        """The gains from outputs to inputs as a matrix."""
        W = [[0] * len(self.outputs) for _ in self.inputs]
        for row, (_, port) in zip(W, self.inputs, strict=True):
            for signal, gain in self.wires.get(port, ()):
                key = "wire", port, signal
                row[self.at[signal]] = self._once(key, (gain,), number, lambda g=gain: self._value(g, number))
        return matrix(len(W), len(self.outputs), [gain for row in W for gain in row])  # a list of no rows has no columns

    def _tick(self, running, matrix, owners, W, A, B, C, D):
        states, size = len(owners), len(owners) + len(self.held)

        def form(row, unit=-1):
            return [*row, *[0] * (size - len(row))] if unit < 0 else [int(k == unit) for k in range(size)]

        places, runs = {j: states + k for k, j in enumerate(self.held)}, [i in running for i, _ in self.outputs]
        C = matrix([form(row) if on else form((), places.get(j, -1)) for j, (row, on) in enumerate(zip(C, runs, strict=True))])
        D = matrix([row if on else [0] * len(row) for row, on in zip(D, runs, strict=True)])
        inputs, pivot = _closed(W * D, W * C)
        if not size:
            return matrix(0, 0), pivot
        outputs, after = (C + D * inputs).tolist(), (matrix(B) * inputs).tolist() if B else []
        rows = []
        for k, i in enumerate(owners):
            row_k = [a + b for a, b in zip(form(A[k]), after[k], strict=True)]
            rows.append(row_k if i in running else form((), k))
        return matrix(rows + [outputs[j] if runs[j] else form((), at) for j, at in places.items()]), pivot

    def _block(self, i: int, block: DrawnBlock | Plant, number: Any) -> Any:
        def made():
            period = self.every[i] / len(self.phases[i]) / self.rate(number)
            if isinstance(block, Plant):
                return self._plant(block, period, number)
            return matrices(block.type, period, self._keys(block, number))

        return self._once(("block", i), (self.drawing.tick_hz, *(tree for _, tree in block.trees())), number, made)

    def _plant(self, plant, T, number):
        """A plant of several blocks: `x' = A x + B u`, `y = C x + D u`, `u = K y + e` with e held over the period."""
        models = [continuous(block.type, self._keys(block, number)) for block in plant.members]
        orders, ports = [len(A) for A, *_ in models], [len(block.ports[0]) for block in plant.members]
        A, B, C, D = (_diagonal([model[k] for model in models], (orders, ports)[k % 2]) for k in range(4))
        rates, shown = ([[*x, *u] for x, u in zip(*pair, strict=True)] for pair in ((A, B), (C, D)))
        (inputs, outputs), n, m = plant.drawn_ports, sum(orders), sum(ports)
        K = [[0] * len(outputs) for _ in inputs]
        for port, terms in plant.couplings:
            for signal, gain in terms:
                K[inputs.index(port)][outputs.index(signal)] = self._value(gain, number)
        of = arb_mat if isinstance(number, arb) else acb_mat
        back = (of(K) * of(shown)).tolist()
        unit = [[int(i == j) for j in range(n + m)] for i in range(n + m)]
        right = of([[*row[:n], *unit[n + i][n:]] for i, row in enumerate(back)])
        inside, _ = _closed(of([row[n:] for row in back]), right)
        rows = (of(rates + shown) * of(unit[:n] + inside.tolist())).tolist()
        A, B, C, D = ([row[half] for row in row_set] for row_set in (rows[:n], rows[n:]) for half in (slice(n), slice(n, None)))
        return *(held(A, B, T) if n else (A, B)), C, D

    def _keys(self, block, number):
        types = TYPES[block.type].keys
        return {name: self._key(types[name].type, value, number) for name, value in block.keys}

    def _key(self, kind, value, number):
        if kind == "number":
            return self._value(value, number)
        if kind == "integer":
            return int(value_of(value, self.values))
        if kind == "list":
            return [self._value(tree, number) for tree in value]
        return [[self._value(tree, number) for tree in row] for row in value] if kind == "rows" else value

    def _value(self, tree: Tree, number: Any) -> Any:
        ball = type(number)
        constants = {constant: constant for constant in constants_of(tree)}
        constants |= {name: self.values[name] for name, _ in names_in(tree) if name != self.number}
        try:
            return ball(
                evaluate(
                    named(tree), {name: ball(v) for name, v in constants.items()} | {self.number: number}, _LIBRARIES[ball]
                )
            )
        except ZeroDivisionError:
            return ball("nan")

    def _once(self, name: tuple, trees: tuple[Tree, ...], number: Any, make: Callable[[], Any]) -> Any:
        """The result of `make`, kept for other values of the number if the trees do not read it."""
        if any(reads(tree, self.number) for tree in trees):
            return make()
        key = (*name, type(number), ctx.prec)
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]


def _closed(L, R):
    """The solution of `u = L u + R` and the determinant; without a loop in L it takes no division."""
    size, places = L.nrows(), _places(L)
    steps, reached = 0, np.eye(size, dtype=bool)
    while reached.any() and steps <= size:
        steps, reached = steps + 1, (reached.astype(float) @ places) > 0
    if steps <= size:
        return reduce(lambda found, _: R + L * found, range(steps - 1), R), type(L)([[1]])[0, 0]
    S = type(L)([[int(i == j) for j in range(size)] for i in range(size)]) - L
    return S.solve(R, nonstop=True, algorithm="lu"), S.det()


def _places(matrix):
    rows = [[not entry.is_zero() for entry in row] for row in matrix.tolist()]
    return np.array(rows, bool).reshape(matrix.nrows(), matrix.ncols())


def _diagonal(parts, widths):
    """Rows of blocks in a diagonal."""
    return [[*[0] * sum(widths[:i]), *row, *[0] * sum(widths[i + 1 :])] for i, matrix in enumerate(parts) for row in matrix]


def product(kinds: tuple, maps: Mapping) -> Any:
    """The product of the maps of ticks in this order, with powers of those that repeat."""
    return _multiplied(_plan(kinds), maps)


def _multiplied(plan, maps):
    kind, times, *factors = plan
    if times:
        return _multiplied(factors[0], maps) ** times
    return _multiplied(factors[1], maps) * _multiplied(factors[0], maps) if factors else maps[kind]


@lru_cache(maxsize=256)
def _plan(kinds):
    """A tree of (kind, times, parts in order): a power, a product of two parts, or the map of a kind."""
    size = len(kinds)
    for period in range(1, size // 2 + 1):
        if size % period == 0 and kinds == kinds[:period] * (size // period):
            return None, size // period, _plan(kinds[:period])
    return (None, 0, _plan(kinds[: size // 2]), _plan(kinds[size // 2 :])) if size > 1 else (kinds[0], 0)


@lru_cache(maxsize=4096)
def reads(tree: Tree, number: str) -> bool:
    """Whether a tree reads a number."""
    return any(name == number for name, _ in names_in(tree))
