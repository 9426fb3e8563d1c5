"""Drawn loops run block by block, tick by tick: nothing is lifted, and no algebraic loop is closed in advance."""

from collections.abc import Mapping, Sequence

import numpy as np

from wavesweep.diagram.drawn import Drawn

HUGE = 1e12  # of a signal; what grows beyond it has no meaning


def run_drawn(drawn: Drawn, inputs: Mapping[str, np.ndarray], signals: Sequence[str]) -> dict[str, np.ndarray]:
    """Run the blocks of a drawing from rest and record signals, `(ticks,)` each.

    inputs: the value of each input from outside in every tick. In a tick the blocks that run read their inputs and give their
    outputs in the order in which they depend on each other; blocks that depend on each other directly are solved together.
    Then they update their states. Outputs of the others hold. The rows end if a signal exceeds HUGE.
    """
    stepper = _Stepper(drawn)
    count = len(next(iter(inputs.values()))) if inputs else 0
    rows = np.full((len(signals), count), np.nan)
    for tick in range(count):
        stepper.step(tick, {name: float(values[tick]) for name, values in inputs.items()})
        rows[:, tick] = [stepper.value(signal) for signal in signals]
        if not np.all(np.abs(rows[:, tick]) < HUGE):
            rows = rows[:, :tick]
            break
    return dict(zip(signals, rows, strict=True))


class _Stepper:
    """The blocks' states and outputs between two ticks."""

    def __init__(self, drawn):
        self.drawn, self.blocks = drawn, [each.block for each in drawn.placed]
        self.states = [np.zeros(len(block.states)) for block in self.blocks]
        self.outputs = {f"{block.name}.{port}": 0.0 for block in self.blocks for port in block.outputs}
        self.external, self.orders = {}, {}

    def value(self, signal):
        """A signal, from outputs as they are now."""
        if signal in self.outputs:
            return self.outputs[signal]
        if signal in self.external:
            return self.external[signal]
        return sum(float(gain) * self.value(source) for source, gain in self.drawn.sums.get(signal, {}).items())

    def read(self, block):
        """What its ports read now."""
        return np.array([self.value(f"{block.name}.{port}") for port in block.inputs])

    def step(self, tick, external):
        """Let the blocks of this tick run."""
        self.external = external
        running = tuple(i for i, each in enumerate(self.drawn.placed) if np.isin(tick % each.every, each.phase))
        if running not in self.orders:
            self.orders[running] = self._order(running)
        for group in self.orders[running]:
            self._give(group)
        read = {i: self.read(self.blocks[i]) for i in running}
        for i, u in read.items():
            block = self.blocks[i]
            self.states[i] = self.states[i] + block.E @ self.states[i] + block.B @ u

    def _order(self, running):
        """Groups of blocks, each after those that it depends on directly."""
        direct = {i: {j for j in running if self._feeds(j, i)} for i in running}
        reach = {i: set(direct[i]) for i in running}
        for k in running:
            for i in running:
                if k in reach[i]:
                    reach[i] |= reach[k]
        groups, placed = [], set()
        while len(placed) < len(running):
            ready = next(
                i
                for i in running
                if i not in placed and reach[i] - placed <= {j for j in running if j in reach[i] and i in reach[j]} | {i}
            )
            group = sorted({ready} | {j for j in reach[ready] if ready in reach[j]} - placed)
            groups.append(group)
            placed |= set(group)
        return groups

    def _feeds(self, source, target):
        """Whether an output of the one is needed at once for an output of the other."""
        block, before = self.blocks[target], {f"{self.blocks[source].name}.{port}" for port in self.blocks[source].outputs}
        return any(
            np.any(block.D[:, k]) and self.drawn.sources(f"{block.name}.{port}") & before for k, port in enumerate(block.inputs)
        )

    def _give(self, group):
        """Set the outputs of a group: those of one block at once, of several as the solution of their equations."""
        names = [(i, port) for i in group for port in range(len(self.blocks[i].outputs))]
        keys = [f"{self.blocks[i].name}.{self.blocks[i].outputs[port]}" for i, port in names]
        base = self._tried(group, keys, np.zeros(len(keys)))
        if len(group) == 1 and not self._feeds(group[0], group[0]):
            solution = base
        else:
            columns = [self._tried(group, keys, unit) - base for unit in np.eye(len(keys))]
            solution = np.linalg.solve(np.eye(len(keys)) - np.array(columns).T, base)
        self.outputs |= dict(zip(keys, solution.tolist(), strict=True))

    def _tried(self, group, keys, values):
        """The outputs of a group if these were its outputs."""
        self.outputs |= dict(zip(keys, values.tolist(), strict=True))
        blocks = [(self.blocks[i], self.states[i]) for i in group]
        return np.concatenate([block.C @ x + block.D @ self.read(block) for block, x in blocks])
