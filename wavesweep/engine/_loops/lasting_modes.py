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

from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction
from random import Random
from typing import TYPE_CHECKING, Any

from wavesweep.engine._loops.dead_time import SENSED
from wavesweep.engine._loops.from_drawing import POSITION, REACTION
from wavesweep.engine._loops.integrator_modes import RestEquations, rest_of_blocks
from wavesweep.engine._loops.multirate import MultirateLoop

if TYPE_CHECKING:
    from wavesweep.engine._loops.block import Block

PRIME = 2**61 - 1  # of the field in which ranks are found
Row = dict[str, int]  # unknown -> factor modulo PRIME


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


def _moves(shift: dict[str, float], plants: set[str]) -> bool:
    return any(state.rpartition(".")[0] in plants for state in shift)


class _UnlikeRestError(Exception):
    """What a loop reads is not what its equations at rest read."""


class _AnyLoop:
    """A loop of blocks with the rest that they have, and with random numbers for all else.

    states: of blocks, and of outputs that they hold. changes: of the states of blocks in a run, and
    outputs: of all blocks, as sums of states and ports. moving: a sum that is 0 while all plants
    rest. wires: of each port, the outputs that it reads. registers: of each impulse of which pulses
    alone are read, the register with which these are made; neither has states here.
    """

    def __init__(
        self, drawn: MultirateLoop, names: set[str], rest: RestEquations, random: Random
    ) -> None:
        self.drawn = drawn
        self.random = random
        self.plants = rest.plants or set()
        self.registers = _registers(drawn, names, rest)
        registers = set().union(*self.registers.values())
        self.blocks = []
        self.slow = set()
        for placed in drawn.placed:
            name = placed.block.name
            if name in names and name not in registers:
                self.blocks.append(placed.block)
                if placed.every > 1:
                    self.slow.add(name)
        self.states: dict[str, int] = {}
        self.changes: dict[str, Row] = {}
        self.outputs: dict[str, Row] = {}
        self.moving: Row = {}
        for block in self.blocks:
            self._add(block, rest)
        self.wires = {}
        for block in self.blocks:
            for port in block.inputs:
                signal = f"{block.name}.{port}"
                self.wires[signal] = self._wire(block.name, signal, rest)

    def _number(self) -> int:
        return self.random.randrange(1, PRIME)

    def _mixed(self, rows: Iterator[Any] | list[dict[str, int]]) -> Row:
        """The sum of rows with random factors."""
        total: Row = {}
        for row in rows:
            _add(total, row, self._number())
        return total

    def _add(self, block: Block, rest: RestEquations) -> None:
        if block.name in self.registers:
            return
        own = [f"{block.name}.{state}" for state in block.states]
        ports = [f"{block.name}.{port}" for port in block.inputs]
        residuals = []
        for state in own:
            if state in rest.changes:
                residuals.append(_modulo(rest.changes[state]))
            else:  # of a block that settles where its inputs are
                residuals.append(self._mixed({name: 1} for name in (*own, *ports)))
        if block.name in self.plants:
            own_outputs = [rest.outputs.get(f"{block.name}.{port}", {}) for port in block.outputs]
            read = set().union(*residuals, *own_outputs)
            residuals += [{port: 1} for port in ports if port not in read]
            _add(self.moving, self._mixed(residuals), 1)
        for name in own:
            self.states[name] = len(self.states)
            self.changes[name] = self._mixed(residuals)
        for port in block.outputs:
            signal = f"{block.name}.{port}"
            if signal not in rest.outputs:  # of a plant, as it is read by a dead time
                continue
            self.states[f"{signal} held"] = len(self.states)
            output = _modulo(rest.outputs[signal])
            _add(output, self._mixed(residuals), 1)
            self.outputs[signal] = output
            if block.name in self.slow:
                share = self._number()
                self.outputs[signal] = {f"{signal} held": -share % PRIME}
                _add(self.outputs[signal], output, 1 + share)

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
        """The number of modes."""
        from flint import nmod_mat

        sets, kind = self.drawn.schedule()
        n = len(self.states)
        if len(kind) * n**3 > 1e8:  # of products of matrices over a frame; tenths of a second
            return 0
        identity = nmod_mat(n, n, [int(i == j) for i in range(n) for j in range(n)], PRIME)
        ticks = []
        unseen = []  # rows that are 0 for a shift that no tick changes and no hand sees
        for running in sets:
            tick, outside = self._tick({self.drawn.placed[index].block.name for index in running})
            ticks.append(tick)
            unseen += (tick - identity).tolist()
            unseen += outside.tolist()
        for name, at in self.states.items():
            if name.rpartition(".")[0] in self.plants:
                unseen.append([int(at == column) for column in range(n)])
        shifts = nmod_mat(len(unseen), n, [int(x) for row in unseen for x in row], PRIME)
        kernel, sums = shifts.nullspace()
        frame = identity
        for number in kind.tolist():
            frame = ticks[number] * frame
        change = (frame - identity).tolist()
        columns = kernel.tolist()
        both = [[*row, *columns[at][:sums]] for at, row in enumerate(change)]
        entries = [int(entry) for row in both for entry in row]
        rank = nmod_mat(n, n + sums, entries, PRIME).rank()
        return len(self.registers) + sums + n - rank

    def _tick(self, running: set[str]) -> tuple[Any, Any]:
        """The states after a tick in which these blocks run, and what the hand's port reads:
        each a matrix over the states before it."""
        ports: dict[str, int] = {}
        for block in self.blocks:
            if block.name in running:
                for port in block.inputs:
                    ports[f"{block.name}.{port}"] = len(ports)
        shown = {}
        for signal, row in self.outputs.items():
            runs = signal.rpartition(".")[0] in running
            shown[signal] = row if runs else {f"{signal} held": 1}
        for impulse in self.registers:
            shown[f"{impulse}.sum"] = {f"{impulse}.u": 1} if impulse in running else {}
        rows: list[Row] = []
        for port in ports:
            row: Row = {port: PRIME - 1}
            for signal, gain in self.wires[port].items():
                _add(row, shown[signal], gain)
            if port.endswith(f".{SENSED}"):  # a body is read while it moves
                _add(row, self.moving, 1)
            rows.append(row)
        read, reads = self._matrices(rows, ports)
        of_ports = (-reads).solve(read) if ports else None

        def over_states(rows: list[dict[str, int]]) -> Any:
            of_states, through = self._matrices(rows, ports)
            return of_states if of_ports is None else of_states + through * of_ports

        after = []
        for name in self.states:
            row = {name: 1}
            signal = name.removesuffix(" held")
            block = signal.rpartition(".")[0]
            if name != signal:
                row = shown[signal]
            elif block in running:
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
        for at, row in enumerate(rows):
            for name, factor in row.items():
                if name in ports:
                    of_ports[at, ports[name]] = factor
                else:
                    of_states[at, self.states[name]] = factor
        return of_states, of_ports


def _registers(drawn: MultirateLoop, names: set[str], rest: RestEquations) -> dict[str, set[str]]:
    """The registers of each impulse of which pulses alone are read: its sum, less a register of
    it."""
    in_every_tick = {placed.block.name for placed in drawn.placed if placed.every == 1}
    wires = {**drawn.sums, **rest.wires}
    found = {}
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
            found[impulse] = registers
    return found


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
