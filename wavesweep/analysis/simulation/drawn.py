"""Drawn loops run tick by tick, from their blocks alone: nothing is lifted, and no code of the lifting is used.

For each set of blocks that run in a tick, the blocks are run once on unit states, unit held outputs and unit inputs, one after
the other in the order in which they depend on each other. That gives the tick as a matrix, and a run is one product a tick,
whose terms are multiplied and added one by one in a fixed order: the same on every processor, and in an exported controller.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from wavesweep.analysis.simulation.both_loops import FARTHEST, STRONGEST
from wavesweep.analysis.simulation.inputs import Tone
from wavesweep.analysis.simulation.record import Energy, Simulation
from wavesweep.diagram.drawn import Drawn
from wavesweep.errors import UsageError

CHECKED = 1024  # ticks after which a run is checked for numbers that mean nothing
SAME = 1e-9  # rad per frame: a sine this close to one that is its own image has one part


def run_drawn(
    drawn: Drawn, inputs: Mapping[str, np.ndarray], signals: Sequence[str], limits: Mapping[str, float] | None = None
) -> dict[str, np.ndarray]:
    """Run the blocks of a drawing from rest and record signals, `(ticks,)` each.

    inputs: the value of each input from outside in every tick. In a tick the blocks that run read their inputs and give their
    outputs in the order in which they depend on each other; blocks that depend on each other directly are solved together.
    Then they update their states. Outputs of the others hold. The rows end before a signal is not finite or, if it has one
    in `limits`, exceeds its limit.
    """
    rows, good = _run(drawn, inputs, signals, limits or {})
    return dict(zip(signals, rows[:good].T, strict=True))


def simulate_drawn(
    drawn: Drawn, force: np.ndarray, hand: str, position: str, velocity: str = "", reaction: str = "", units=("m", "N")
):
    """Run a drawn loop under the hand's force; a `Simulation`, which has no encoder, no motors and no waves.

    force: the hand's force (N) per tick, `(ticks,)`, which is the input `hand`. position (m), velocity (m/s) and reaction (the
    force against the hand, N): signals of the drawing, the last two if they are known. The simulation stops early if the
    position exceeds `FARTHEST` or a force `STRONGEST`. units: of position and force, for its reason.
    Accuracy: rounding, about 1e-15 of the largest signal per tick; states are summed from their changes in a tick.
    """
    names = {"x": position} | ({"v": velocity} if velocity else {}) | ({"f_m": reaction} if reaction else {}) | {"f_h": hand}
    limits = {position: FARTHEST, reaction: STRONGEST, hand: STRONGEST}
    T, count = float(drawn.period), len(force)
    outside = {name: np.zeros(count + 1) for name in drawn.inputs} | {hand: np.append(force, 0.0)}
    rows, good = _run(drawn, outside, tuple(names.values()), limits)
    good = min(good, count)
    signals = {"time": np.arange(good) * T} | {name: rows[:good, i] for i, name in enumerate(names)}
    signals |= {"f_device": signals["f_m"]} if reaction else {}
    with np.errstate(all="ignore"):  # the row in which it stops may not be finite
        moved = np.diff(rows[: good + 1, 0])
        work = {name: np.cumsum(signals[name] * moved) for name in ("f_h", "f_device") if name in signals}
    energy = Energy(work["f_h"], work.get("f_device"), None, None, None, None)
    signals["touching"] = np.zeros(good, bool)
    late = np.zeros(-(-good // drawn.ticks), int)
    for column in (*signals.values(), late):
        column.flags.writeable = False
    return Simulation(signals, energy, late, drawn.ticks, _reason(rows[good:, 0], *units) if good < count else "")


def _reason(position, length, force):
    if np.isfinite(position[:1]).all() and abs(position[0]) <= FARTHEST:
        return f"a force exceeds {STRONGEST:g} {force}"
    return f"the hand's position exceeds {FARTHEST:g} {length}"


def components(signals: Mapping[str, np.ndarray], tone: Tone, tick_hz: float, frame: int) -> list[complex]:
    """Complex amplitudes of `f_h`, `x` and `f_device` at a tone's frequency; see `record.estimate`.

    Each phase of the frame sees a sine, with an amplitude of its own, and a constant. The amplitudes are fitted phase by phase,
    and their mean, each turned back by its phase, is the component at the frequency itself: images of it drop out.
    Errors: `UsageError` if a section has fewer than three frames.
    """
    frames = (tone.last - tone.first) // frame
    if frames < 3:
        raise UsageError(
            f"tone of {tone.frequency_hz} Hz: expected at least {3 * frame} ticks, three frames, to tell it from its images, "
            f"found {tone.last - tone.first}; measure longer"
        )
    omega = 2 * np.pi * tone.frequency_hz / tick_hz
    part = slice(tone.first, tone.first + frames * frame)
    measured = np.concatenate([signals[name][part].reshape(frames, frame) for name in ("f_h", "x", "f_device")], axis=1)
    turn = omega * frame * np.arange(frames)
    alone = own_image(omega * frame)  # each phase sees one number, or two in turn
    basis = [np.cos(turn)] if alone else [np.cos(turn), np.sin(turn)]
    basis += [] if alone and np.cos(omega * frame) > 0 else [np.ones(frames)]
    found = np.linalg.lstsq(np.stack(basis, axis=1), measured, rcond=None)[0]
    amplitudes = 2 * found[0] if alone else found[0] - 1j * found[1]
    return list((amplitudes.reshape(3, frame) * np.exp(-1j * omega * np.arange(frame))).mean(axis=1))


def own_image(angle: float) -> bool:
    """Whether a sine that turns by this angle (rad) in a frame is its own image."""
    return abs(np.sin(angle)) < SAME


def _run(drawn, inputs, signals, limits):
    """Rows of signals, `(ticks, signals)`, and the number of rows before the first that means nothing."""
    count = len(next(iter(inputs.values()))) if inputs else 0
    kinds, sets = kinds_of(drawn, count)
    blocks = Blocks(drawn, tuple(inputs), tuple(signals))
    outside = np.stack(list(inputs.values()), axis=1) if inputs else np.zeros((0, 0))
    most = np.array([limits.get(name, np.inf) for name in signals])
    n, h = blocks.summed, len(blocks.direct) + len(blocks.holding)
    maps, z, rows = {}, np.zeros(h + len(inputs)), np.full((count, len(signals)), np.nan)
    with np.errstate(all="ignore"):
        for first in range(0, count, CHECKED):
            last = min(first + CHECKED, count)
            for tick in range(first, last):
                kind = kinds[tick % drawn.ticks]
                if kind not in maps:
                    maps[kind] = blocks.tick(sets[kind])
                z[h:] = outside[tick]
                each = maps[kind]
                found = np.bincount(each.rows, each.factors * z[each.columns], each.count)  # sums from 0.0, in order
                z[:n] += found[:n]
                z[n:h] = found[n:h]
                rows[tick] = found[h:]
            wrong = ~(np.isfinite(rows[first:last]) & (np.abs(rows[first:last]) <= most)).all(axis=1)
            if wrong.any():
                return rows, first + int(wrong.argmax())
    return rows, count


def kinds_of(drawn: Drawn, count: int) -> tuple[list[int], list[tuple[int, ...]]]:
    """The number of the set of blocks that run in each tick of the frame, as far as `count` ticks need it, and the sets."""
    ticks = np.arange(min(count, drawn.ticks))
    masks = np.stack([np.isin(ticks % each.every, each.phase) for each in drawn.placed], axis=1)
    sets, which = np.unique(masks, axis=0, return_inverse=True)
    return which.reshape(-1).tolist(), [tuple(np.flatnonzero(row).tolist()) for row in sets]


class Tick(NamedTuple):
    """The entries of a tick's matrix that are not zero, row by row: row, column and factor of each; and the number of rows."""

    rows: np.ndarray
    columns: np.ndarray
    factors: np.ndarray
    count: int


class Blocks:
    """The blocks of a drawing, run for many states at once: each number is a row over these.

    `names`: of the columns, which are states, held outputs and inputs. `summed`: the number of states that are summed from
    their changes, which come first; `direct`: whether a state gets a new value.
    """

    def __init__(self, drawn, inputs, signals):
        self.drawn, self.blocks, self.signals, self.inputs = drawn, [each.block for each in drawn.placed], signals, inputs
        ports = [(each, f"{each.block.name}.{port}") for each in drawn.placed for port in each.block.outputs]
        self.known = [name for _, name in ports]
        self.holding = [name for each, name in ports if each.every > 1]
        # A state that does not depend on itself, as those of a delay, gets a new value in place of a change.
        self.direct = np.concatenate([np.diagonal(block.E) == -1.0 for block in self.blocks])
        self.order_of_states = np.argsort(self.direct, kind="stable")
        self.summed = int((~self.direct).sum())
        self.width = len(self.direct) + len(self.holding) + len(inputs)
        states = [f"{block.name}.{state}" for block in self.blocks for state in block.states]
        self.names = [*(states[i] for i in self.order_of_states), *(f"{name}, held" for name in self.holding), *inputs]

    def tick(self, running: tuple[int, ...]) -> Tick:
        """The tick as a matrix from states, held outputs and inputs to states, held outputs and signals.

        Of the first states, the summed ones, it gives the changes.
        """
        unit, n = np.eye(self.width), len(self.direct)
        borders = np.cumsum([len(block.states) for block in self.blocks])[:-1]
        self.now = np.split(unit[np.argsort(self.order_of_states)], borders)
        self.values = dict.fromkeys(self.known, np.zeros(self.width))
        self.values |= dict(zip((*self.holding, *self.inputs), unit[n:], strict=True))
        for group in self.order(running):
            self.give(group)
        states = [mask[:, None] * now for mask, now in zip(np.split(self.direct, borders), self.now, strict=True)]
        for i in running:
            block, mask = self.blocks[i], np.split(self.direct, borders)[i]
            states[i] = (block.E + np.diag(mask)) @ self.now[i] + block.B @ self.read(block)
        rows = [self.values[name] for name in self.holding] + [self.value(name) for name in self.signals]
        matrix = np.concatenate([np.concatenate(states)[self.order_of_states], np.reshape(rows, (-1, self.width))])
        places = np.nonzero(matrix)
        return Tick(*places, matrix[places], len(matrix))

    def value(self, signal):
        """A signal, from outputs as they are now."""
        if signal in self.values:
            return self.values[signal]
        terms = self.drawn.sums.get(signal, {}).items()
        return sum((float(gain) * self.value(source) for source, gain in terms), np.zeros(self.width))

    def read(self, block):
        """The values at its input ports now."""
        return np.reshape([self.value(f"{block.name}.{port}") for port in block.inputs], (-1, self.width))

    def order(self, running):
        """Groups of blocks, each after those that it depends on directly."""
        reach = {i: {j for j in running if self.feeds(j, i)} for i in running}
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

    def feeds(self, source, target):
        """Whether an output of the one is needed at once for an output of the other."""
        block, before = self.blocks[target], {f"{self.blocks[source].name}.{port}" for port in self.blocks[source].outputs}
        return any(
            np.any(block.D[:, k]) and self.drawn.sources(f"{block.name}.{port}") & before for k, port in enumerate(block.inputs)
        )

    def give(self, group):
        """Set the outputs of a group: those of one block at once, of several as the solution of their equations."""
        keys = [f"{self.blocks[i].name}.{port}" for i in group for port in self.blocks[i].outputs]
        if len(group) > 1 or self.feeds(group[0], group[0]):
            base = self.tried(group, keys, np.zeros((len(keys), self.width)))
            slopes = [self.tried(group, keys, row[:, None] + np.zeros(self.width)) - base for row in np.eye(len(keys))]
            solution = np.linalg.solve(np.eye(len(keys)) - np.stack([slope[:, 0] for slope in slopes], axis=1), base)
            self.values |= dict(zip(keys, solution, strict=True))
        else:
            self.values |= dict(zip(keys, self.outputs(group), strict=True))

    def tried(self, group, keys, values):
        """The outputs of a group if these were its outputs."""
        self.values |= dict(zip(keys, values, strict=True))
        return self.outputs(group)

    def outputs(self, group):
        """The outputs of the blocks of a group, from what they read now."""
        return np.concatenate([self.blocks[i].C @ self.now[i] + self.blocks[i].D @ self.read(self.blocks[i]) for i in group])
