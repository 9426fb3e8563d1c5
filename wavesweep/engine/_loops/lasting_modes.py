"""The modes of a loop that nothing opposes, whatever its blocks do while they move.

At rest a block fulfils `R x + S u = 0` and gives `y = C x + D u`. Whatever its rate is, and
whatever it does while it moves, it is one of the blocks

    x[k+1] = x[k] + P (R x[k] + S u[k]),   y[k] = C x[k] + D u[k] + Q (R x[k] + S u[k])

with matrices P and Q of its own; R and S of a block that settles wherever its inputs are, as a
filter, are its own too. What an output holds between two runs is `y + q (y - held)` of what it held
before, with a number q of its own. Let M be the product of the ticks of a frame. Its eigenvalue 1
is a drift if it is there for all P, Q and q, so that nothing but the rest of the blocks makes it.
(An oscillation that comes back after a frame has it for some of them alone.) Pulses of an `impulse`
are what they are: its input in the tick in which it runs, and 0 in all others.

A shift W that no tick changes, and that no body and no hand sees, is of sums of which changes alone
are read, as that of an `impulse` or before a `difference`. Such a sum may count for ever while
another drift stands still. So drifts are modes of M in which it does not matter where these sums
are: x with `(M - I) x` in W. What outputs see does not count: they act on nothing.

Both counts are ranks. They are computed for numbers P, Q and q drawn at random, modulo a prime
number: a rank that is not the largest one there is the root of a polynomial that is not zero. Of
`degree` it has that root by a chance of `degree/prime` (Schwartz; Zippel), below 1e-10 a draw.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from random import Random
from typing import TYPE_CHECKING, Any, NamedTuple

from wavesweep.engine._loops.dead_time import SENSED
from wavesweep.engine._loops.from_drawing import POSITION, REACTION
from wavesweep.engine._loops.integrator_modes import RestEquations, rest_of_blocks
from wavesweep.engine._loops.multirate import MultirateLoop

if TYPE_CHECKING:
    from wavesweep.engine._loops.block import Block

PRIME = 2**61 - 1  # of the field in which ranks are found
Row = dict[str, int]  # unknown -> factor modulo PRIME
HELD = " held"  # what the name of a state adds to that of the output that it holds


def lasting_modes(
    drawn: MultirateLoop, names: set[str], shifts: Sequence[Collection[str]], seed: int
) -> int:
    """Return the number of modes of some blocks of a loop that nothing opposes, beside sums of
    which changes alone are read; 0 if there are no such sums, or if it is not known.

    shifts: the names of the states that each of its shifts moves (see `integrator_modes.shifts`).
    seed: of the random numbers.
    """
    if not shifts:
        return 0
    rest = rest_of_blocks(drawn, names)
    if rest.plants is None or all(_moves(shift, rest.plants) for shift in shifts):
        return 0
    random = Random(seed)  # noqa: S311 - nothing is secret
    try:
        return _AnyLoop(drawn, names, rest, random).lasting()
    except (_UnlikeRestError, ZeroDivisionError):
        return 0


def _moves(shift: Collection[str], plants: set[str]) -> bool:
    return any(state.rpartition(".")[0] in plants for state in shift)


class _UnlikeRestError(Exception):
    """What a loop reads is not what its equations at rest read."""


class _AnyBlock(NamedTuple):
    """A block with its rest, and with random numbers P, Q and q for all else (see this file's head).

    changes: P (R x + S u) of each state in a run. outputs: each as it is shown after a run. moving: a
    sum that is 0 while a plant rests.
    """

    changes: dict[str, Row]
    outputs: dict[str, Row]
    moving: Row


class _AnyLoop:
    """A loop of blocks with the rest that they have, and with random numbers for all else.

    states: the place of each state, of blocks and of outputs that they hold. changes: of the states
    of blocks in a run, and outputs: of all blocks, as sums of states and ports. moving: a sum that is
    0 while all plants rest. wires: of each port, the outputs that it reads. registers: of each impulse
    of which pulses alone are read, the register with which these are made; neither has states here.
    """

    def __init__(
        self, drawn: MultirateLoop, names: set[str], rest: RestEquations, random: Random
    ) -> None:
        self.drawn = drawn
        self.random = random
        self.plants = rest.plants or set()
        self.registers = _registers(drawn, names, rest)
        here = names - set().union(*self.registers.values())
        placed = [
            block_with_rate
            for block_with_rate in drawn.placed
            if block_with_rate.block.name in here
        ]
        self.blocks = [block_with_rate.block for block_with_rate in placed]
        self.changes: dict[str, Row] = {}
        self.outputs: dict[str, Row] = {}
        self.moving: Row = {}
        for block_with_rate in placed:
            if block_with_rate.block.name not in self.registers:
                rows = self._any_block(block_with_rate.block, rest, slow=block_with_rate.every > 1)
                self.changes |= rows.changes
                self.outputs |= rows.outputs
                _add(self.moving, rows.moving, 1)
        held_names = [_held(signal) for signal in self.outputs]
        self.states = {name: place for place, name in enumerate([*self.changes, *held_names])}
        self.wires = {}
        for block in self.blocks:
            for port in block.inputs:
                signal = f"{block.name}.{port}"
                self.wires[signal] = self._wire(block.name, signal, rest)

    def _number(self) -> int:
        return self.random.randrange(1, PRIME)

    def _mixed(self, rows: Iterable[Mapping[str, int]]) -> Row:
        """The sum of rows with random factors."""
        total: Row = {}
        for row in rows:
            _add(total, row, self._number())
        return total

    def _any_block(self, block: Block, rest: RestEquations, *, slow: bool) -> _AnyBlock:
        """The rows of a block; slow: whether it does not run in every tick, and holds its outputs."""
        states = [f"{block.name}.{state}" for state in block.states]
        ports = [f"{block.name}.{port}" for port in block.inputs]
        signals = [f"{block.name}.{port}" for port in block.outputs]
        residuals = []  # R x + S u
        for state in states:
            if state in rest.changes:
                residuals.append(_modulo(rest.changes[state]))
            else:  # of a block that settles where its inputs are
                residuals.append(self._mixed({name: 1} for name in (*states, *ports)))
        moving: Row = {}
        if block.name in self.plants:
            read = set().union(*residuals, *(rest.outputs.get(signal, {}) for signal in signals))
            residuals += [{port: 1} for port in ports if port not in read]
            moving = self._mixed(residuals)
        changes = {state: self._mixed(residuals) for state in states}
        outputs = {}
        for signal in signals:
            if signal not in rest.outputs:  # of a plant, as it is read by a dead time
                continue
            output = _modulo(rest.outputs[signal])
            _add(output, self._mixed(residuals), 1)
            if slow:  # y + q (y - held)
                q = self._number()
                shown = {_held(signal): -q % PRIME}
                _add(shown, output, 1 + q)
                output = shown
            outputs[signal] = output
        return _AnyBlock(changes, outputs, moving)

    def _wire(self, name: str, port: str, rest: RestEquations) -> Row:
        """The outputs that a port reads. What dead times add to it is 0 at rest."""
        wire = _modulo(rest.wires[port])
        sensed = port == f"{name}.{SENSED}"
        read = self.drawn.sources(port) - set(self.drawn.inputs)
        for register in set().union(*self.registers.values()):
            wire.pop(f"{register}.y", None)
            read.discard(f"{register}.y")
        for signal in wire.keys() - read:
            inside = name in self.plants and signal.startswith(f"{name}.")
            if not (inside or sensed):
                raise _UnlikeRestError
        for signal in read - wire.keys():
            if sensed:
                continue
            gains = self.drawn.sums.get(port, {})
            if signal in gains and not gains[signal]:
                continue
            if rest.outputs.get(signal) != {}:
                raise _UnlikeRestError
            wire[signal] = self._number()
        return wire

    def lasting(self) -> int:
        """The number of modes: the dimension of the x with `(M - I) x` in W, `n + dim W - rank [M - I,
        W]`, and one for each register."""
        from flint import nmod_mat

        sets, kind = self.drawn.schedule()
        n = len(self.states)
        if len(kind) * n**3 > 1e8:  # of products of matrices over a frame; tenths of a second
            return 0
        identity = nmod_mat(n, n, [int(i == j) for i in range(n) for j in range(n)], PRIME)
        ticks = []
        unseen: list[list[Any]] = []  # rows that are 0 for a shift in W
        for running in sets:
            tick, outside = self._tick({self.drawn.placed[index].block.name for index in running})
            ticks.append(tick)
            unseen += (tick - identity).tolist()
            unseen += outside.tolist()
        for name, place in self.states.items():
            if name.rpartition(".")[0] in self.plants:
                unseen.append([int(place == column) for column in range(n)])
        kernel, shifts = _of_rows(unseen, n).nullspace()
        M = identity
        for number in kind.tolist():
            M = ticks[number] * M
        W = [row[:shifts] for row in kernel.tolist()]
        both = [[*row, *of_W] for row, of_W in zip((M - identity).tolist(), W, strict=True)]
        return len(self.registers) + n + shifts - _of_rows(both, n + shifts).rank()

    def _port_row(self, port: str, shown: Mapping[str, Row]) -> Row:
        """The sum that a port is, less the port, over the states and the ports; shown: that of each
        signal."""
        row = {port: PRIME - 1}
        for signal, gain in self.wires[port].items():
            _add(row, shown[signal], gain)
        if port.endswith(f".{SENSED}"):  # a body is read while it moves
            _add(row, self.moving, 1)
        return row

    def _tick(self, running: set[str]) -> tuple[Any, Any]:
        """The states after a tick in which these blocks run, and what the hand's port reads:
        each a matrix over the states before it."""
        ports: dict[str, int] = {}
        for block in self.blocks:
            if block.name in running:
                for port in block.inputs:
                    ports[f"{block.name}.{port}"] = len(ports)
        shown = {}
        for signal, output in self.outputs.items():
            runs = signal.rpartition(".")[0] in running
            shown[signal] = output if runs else {_held(signal): 1}
        for impulse in self.registers:
            shown[f"{impulse}.sum"] = {f"{impulse}.u": 1} if impulse in running else {}
        read, reads = self._matrices([self._port_row(port, shown) for port in ports], ports)
        of_ports = (-reads).solve(read) if ports else None

        def over_states(rows: list[dict[str, int]]) -> Any:
            of_states, through = self._matrices(rows, ports)
            return of_states if of_ports is None else of_states + through * of_ports

        after = []
        for name in self.states:
            row = {name: 1}
            signal = name.removesuffix(HELD)
            if name != signal:
                row = shown[signal]
            elif signal.rpartition(".")[0] in running:
                _add(row, self.changes[name], 1)
            after.append(row)
        outside = []
        for signal in (POSITION, REACTION):
            row = {}
            for source in self.drawn.sources(signal) & shown.keys():
                _add(row, shown[source], self._number())
            outside.append(row)
        return over_states(after), over_states(outside)

    def _matrices(self, rows: list[dict[str, int]], ports: dict[str, int]) -> tuple[Any, Any]:
        """Rows as two matrices: their factors of states, and those of ports."""
        from flint import nmod_mat

        of_states = nmod_mat(len(rows), len(self.states), PRIME)
        of_ports = nmod_mat(len(rows), len(ports), PRIME)
        for index, row in enumerate(rows):
            for name, factor in row.items():
                if name in ports:
                    of_ports[index, ports[name]] = factor
                else:
                    of_states[index, self.states[name]] = factor
        return of_states, of_ports


def _registers(drawn: MultirateLoop, names: set[str], rest: RestEquations) -> dict[str, set[str]]:
    """The registers of each impulse of which pulses alone are read: its sum, less a register of
    it."""
    in_every_tick = {placed.block.name for placed in drawn.placed if placed.every == 1}
    wires = {**drawn.sums, **rest.wires}
    registers_of = {}
    for impulse in names:
        register = f"prev({impulse}.sum)"
        if register not in names & in_every_tick:
            continue
        registers = {name for name in names if name.startswith(register)}
        own_ports = {f"{name}.u" for name in registers}
        readers = [wire for port, wire in wires.items() if port not in own_ports]
        pairs = []
        for row in readers:
            before = sum(row.get(f"{name}.y", 0) for name in registers)
            pairs.append((row.get(f"{impulse}.sum", 0), before))
        if all(total == -before for total, before in pairs):
            registers_of[impulse] = registers
    return registers_of


def _held(signal: str) -> str:
    """The state that an output holds between runs."""
    return signal + HELD


def _of_rows(rows: list[list[Any]], columns: int) -> Any:
    from flint import nmod_mat

    return nmod_mat(len(rows), columns, [int(entry) for row in rows for entry in row], PRIME)


def _modulo(row: Mapping[str, Fraction]) -> Row:
    return {
        name: value.numerator * pow(value.denominator, -1, PRIME) % PRIME
        for name, value in row.items()
        if value
    }


def _add(total: Row, row: Mapping[str, int], factor: int) -> None:
    """Add a row times a factor to another one."""
    for name, value in row.items():
        total[name] = (total.get(name, 0) + factor * value) % PRIME
