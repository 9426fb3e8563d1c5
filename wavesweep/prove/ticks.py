"""A drawn loop tick by tick in ball arithmetic: every number is its double, and every result has a
bound on its error.

A number of the loop may be a ball that holds a whole range of it, real or complex.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from math import lcm
from types import SimpleNamespace
from typing import Any

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx

from wavesweep.engine.drawing import TYPES, Drawing, DrawnBlock, Plant, scalars
from wavesweep.engine.expressions import (
    FUNCTIONS,
    Tree,
)
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
    Errors: ValueError for a dead time in seconds, which `Loops.in_whole_ticks` gives in ticks.
    """

    def __init__(self, drawing: Drawing, values: Mapping[str, Any], number: str) -> None:
        if drawing.dead_times:
            raise ValueError(f"dead times in seconds: {', '.join(drawing.dead_times)}")
        self.drawing = drawing
        self.number = number
        self._kept = {}
        self.blocks = [*(block.core(drawing.tick_hz) for block in drawing.alone), *drawing.plants]
        self.values = {name: value for name, value in scalars(values).items() if value is not None}
        self.every = [int(block.every.value(self.values)) for block in self.blocks]
        self.phases = [
            block.phases or (int(block.phase.value(self.values)),) for block in self.blocks
        ]
        self.ticks = lcm(*self.every)
        self.kinds = tuple(self._running_in(tick) for tick in range(self.ticks))
        self.inputs = []
        self.outputs = []
        for i, block in enumerate(self.blocks):
            inputs, outputs = block.ports
            self.inputs += [(i, f"{block.name}.{port}") for port in inputs]
            self.outputs += [(i, f"{block.name}.{port}") for port in outputs]
        self.at = {signal: j for j, (_, signal) in enumerate(self.outputs)}
        self.wires = {}
        read = set()
        for port, terms in drawing.wires:
            kept = []
            for signal, gain in terms:
                source = drawing.inside.get(signal, signal)
                if source in self.at:
                    kept.append((source, gain))
                    read.add(self.at[source])
            self.wires[drawing.inside.get(port, port)] = kept
        self.held = [j for j, (i, _) in enumerate(self.outputs) if self.every[i] > 1 and j in read]

    def _running_in(self, tick: int) -> tuple[int, ...]:
        """The blocks that run in a tick of the frame."""
        running = []
        for i, (every, phases) in enumerate(zip(self.every, self.phases, strict=True)):
            if tick % every in phases:
                running.append(i)
        return tuple(running)

    def rate(self, number: Any) -> Any:
        """The rate of the tick (Hz) at a value of the number."""
        return self._value(self.drawing.tick_hz, number)

    def frame(self, number: Any) -> tuple[Any, Any]:
        """The map of a frame, and the product of the determinants of the algebraic loops in its
        ticks.

        number: an arb or an acb. Entries are NaN if an algebraic loop may have no solution in that
        ball.
        """
        ticks = self.tick_maps(number)
        pivot = type(number)(1)
        for kind in self.kinds:
            _, pivot_of_tick = ticks[kind]
            pivot = pivot * pivot_of_tick
        maps = {kind: tick for kind, (tick, _) in ticks.items()}
        return product(self.kinds, maps), pivot

    def pattern(self, number: Any) -> np.ndarray:
        """The entries of the frame that may not be 0 for a value in the ball `number`; zeros of
        sums are not seen."""
        ones = {}
        for kind, (tick, _) in self.tick_maps(number).items():
            ones[kind] = arb_mat(_places(tick).astype(int).tolist())
        return _places(product(self.kinds, ones))

    def tick_maps(self, number: Any) -> dict[tuple[int, ...], tuple[Any, Any]]:
        """The map of each kind of tick, and the determinant of its algebraic loops."""
        blocks = [self._block(i, block, number) for i, block in enumerate(self.blocks)]
        matrix = arb_mat if isinstance(number, arb) else acb_mat
        wires = self._wire_gains(matrix, number)
        owners = [i for i, (A, *_) in enumerate(blocks) for _ in A]  # of each state
        parts = _side_by_side(blocks, [len(block.ports[0]) for block in self.blocks])
        return {
            kind: self._tick(set(kind), matrix, owners, wires, parts) for kind in set(self.kinds)
        }

    def _wire_gains(self, matrix, number):
        """The gains from outputs to inputs as a matrix."""
        W = [[0] * len(self.outputs) for _ in self.inputs]
        for row, (_, port) in zip(W, self.inputs, strict=True):
            for signal, gain in self.wires.get(port, ()):
                key = "wire", port, signal
                row[self.at[signal]] = self._once(
                    key, (gain,), number, lambda g=gain: self._value(g, number)
                )
        return matrix(
            len(W), len(self.outputs), [gain for row in W for gain in row]
        )  # a list of no rows has no columns

    def _tick(self, running, matrix, owners, W, parts):
        """The map of a tick in which some blocks run, and the determinant of its algebraic
        loops; parts: A, B, C and D of all blocks."""
        A, B, C, D = parts
        states = len(owners)
        size = states + len(self.held)
        # of held outputs among all that is remembered
        places = {j: states + k for k, j in enumerate(self.held)}

        def padded(row):
            return [*row, *[0] * (size - len(row))]

        def unit(index):
            return [int(k == index) for k in range(size)]

        runs = [i in running for i, _ in self.outputs]
        shown = []
        through = []
        for j, (of_states, of_inputs) in enumerate(zip(C, D, strict=True)):
            if runs[j]:
                shown.append(padded(of_states))
                through.append(of_inputs)
            else:
                shown.append(unit(places.get(j)))
                through.append([0] * len(of_inputs))
        C = matrix(shown)
        D = matrix(through)
        inputs, pivot = _closed(W * D, W * C)
        if not size:
            return matrix(0, 0), pivot
        rows = []
        by_inputs = (matrix(B) * inputs).tolist() if B else []
        for k, i in enumerate(owners):
            if i in running:
                rows.append([a + b for a, b in zip(padded(A[k]), by_inputs[k], strict=True)])
            else:
                rows.append(unit(k))
        outputs = (C + D * inputs).tolist()
        for j, index in places.items():
            rows.append(outputs[j] if runs[j] else unit(index))
        return matrix(rows), pivot

    def _block(self, i: int, block: DrawnBlock | Plant, number: Any) -> Any:
        def made():
            period = self.every[i] / len(self.phases[i]) / self.rate(number)
            if isinstance(block, Plant):
                return self._plant(block, period, number)
            return matrices(block.type, period, self._keys(block, number))

        trees = (self.drawing.tick_hz, *(tree for _, tree in block.trees()))
        return self._once(("block", i), trees, number, made)

    def _plant(self, plant, T, number):
        """A plant of several blocks: `x' = A x + B u`, `y = C x + D u`, `u = K y + e` with e
        held over the period."""
        models = [continuous(block.type, self._keys(block, number)) for block in plant.members]
        ports = [len(block.ports[0]) for block in plant.members]
        A, B, C, D = _side_by_side(models, ports)
        n = len(A)
        m = sum(ports)
        rates = [[*by_states, *by_inputs] for by_states, by_inputs in zip(A, B, strict=True)]
        shown = [[*by_states, *by_inputs] for by_states, by_inputs in zip(C, D, strict=True)]
        inputs, outputs = plant.drawn_ports
        K = [[0] * len(outputs) for _ in inputs]
        for port, terms in plant.couplings:
            for signal, gain in terms:
                K[inputs.index(port)][outputs.index(signal)] = self._value(gain, number)
        of = arb_mat if isinstance(number, arb) else acb_mat
        coupled = (of(K) * of(shown)).tolist()  # K y by states and inputs
        by_inputs = [row[n:] for row in coupled]
        by_states_and_e = [[*row[:n], *_unit(i, m)] for i, row in enumerate(coupled)]
        inside, _ = _closed(of(by_inputs), of(by_states_and_e))
        states = [_unit(i, n + m) for i in range(n)]
        closed = (of(rates + shown) * of(states + inside.tolist())).tolist()
        A = [row[:n] for row in closed[:n]]
        B = [row[n:] for row in closed[:n]]
        C = [row[:n] for row in closed[n:]]
        D = [row[n:] for row in closed[n:]]
        if n:
            A, B = held(A, B, T)
        return A, B, C, D

    def _keys(self, block, number):
        types = TYPES[block.type].keys
        return {name: self._key(types[name].type, value, number) for name, value in block.keys}

    def _key(self, kind, value, number):
        if kind == "number":
            return self._value(value, number)
        if kind == "integer":
            return int(value.value(self.values))
        if kind == "list":
            return [self._value(tree, number) for tree in value]
        if kind == "rows":
            return [[self._value(tree, number) for tree in row] for row in value]
        return value

    def _value(self, tree: Tree, number: Any) -> Any:
        ball = type(number)
        numbers = {constant: ball(constant) for constant in tree.constants}
        for name in tree.names:
            if name != self.number:
                numbers[name] = ball(self.values[name])
        numbers[self.number] = number
        try:
            return ball(tree.in_names.evaluate(numbers, _LIBRARIES[ball]))
        except ZeroDivisionError:
            return ball("nan")

    def _once(
        self, name: tuple, trees: tuple[Tree, ...], number: Any, make: Callable[[], Any]
    ) -> Any:
        """The result of `make`, kept for other values of the number if the trees do not read it."""
        if any(reads(tree, self.number) for tree in trees):
            return make()
        key = (*name, type(number), ctx.prec)
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]


def _closed(L, R):
    """The solution of `u = L u + R` and the determinant; without a loop in L it takes no
    division."""
    size = L.nrows()
    places = _places(L)
    steps = 0
    reached = np.eye(size, dtype=bool)
    while reached.any() and steps <= size:
        reached = (reached.astype(float) @ places) > 0
        steps += 1
    matrix = type(L)
    if steps <= size:  # L is nilpotent: u = R + L R + L^2 R + ...
        u = R
        for _ in range(steps - 1):
            u = R + L * u
        return u, matrix([[1]])[0, 0]
    S = matrix([_unit(i, size) for i in range(size)]) - L
    return S.solve(R, nonstop=True, algorithm="lu"), S.det()


def _unit(at, size):
    return [int(k == at) for k in range(size)]


def _places(matrix):
    rows = [[not entry.is_zero() for entry in row] for row in matrix.tolist()]
    return np.array(rows, bool).reshape(matrix.nrows(), matrix.ncols())


def _side_by_side(models, ports):
    """The rows of A, B, C and D of several models that do not act on each other; ports: how many
    inputs each has."""
    orders = [len(A) for A, *_ in models]
    rows = []
    for place, widths in enumerate((orders, ports, orders, ports)):
        rows.append(_diagonal([model[place] for model in models], widths))
    return rows


def _diagonal(parts, widths):
    """Rows of blocks in a diagonal."""
    rows = []
    for i, matrix in enumerate(parts):
        before = [0] * sum(widths[:i])
        after = [0] * sum(widths[i + 1 :])
        rows += [[*before, *row, *after] for row in matrix]
    return rows


def product(kinds: tuple, maps: Mapping) -> Any:
    """The product of the maps of ticks in this order, with powers of those that repeat."""
    return _multiplied(_plan(kinds), maps)


def _multiplied(plan, maps):
    kind, times, *factors = plan
    if times:
        return _multiplied(factors[0], maps) ** times
    if not factors:
        return maps[kind]
    first, second = factors
    return _multiplied(second, maps) * _multiplied(first, maps)


@lru_cache(maxsize=256)
def _plan(kinds):
    """A tree of (kind, times, parts in order): a power, a product of two parts, or the map of a
    kind."""
    size = len(kinds)
    for period in range(1, size // 2 + 1):
        if size % period == 0 and kinds == kinds[:period] * (size // period):
            return None, size // period, _plan(kinds[:period])
    if size == 1:
        return kinds[0], 0
    return None, 0, _plan(kinds[: size // 2]), _plan(kinds[size // 2 :])


@lru_cache(maxsize=4096)
def reads(tree: Tree, number: str) -> bool:
    """Whether a tree reads a number."""
    return tree.reads(number)
