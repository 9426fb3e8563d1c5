"""What the numbers of a drawn loop have to fulfil: the ranges of keys, and what keys say
together."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache, partial
from typing import Any

from wavesweep.engine._drawing.block_types import LONGEST_DELAY, TICK_HZ, TYPES
from wavesweep.engine._drawing.drawing import Drawing, scalars
from wavesweep.engine._drawing.drawn_block import DrawnBlock, keys_of_block
from wavesweep.engine._drawing.expressions import ONE, SharedParts, Tree
from wavesweep.engine._drawing.mass_matrix import MASS, is_mass
from wavesweep.engine._keys.checking import SIZES, computable, expectation
from wavesweep.engine._keys.key import LONGEST_FRAME, Key

# of the blocks: a delay of the most steps, and everything else; time grows with their third power
MOST_STATES = 1200
WRITTEN = 1e-6  # relative: to what a period is rounded that a spec writes in seconds
NOT_FINITE = "a division by zero, a root or logarithm of a negative number or an overflow"
OF_PLANT = "a position that a plant has in every tick, such as a mass's x"


class Condition:
    """What a number has to fulfil, also that it is `computable`.

    subject, others: path and tree of the number, and of others that it depends on; names: in these
    trees. holds: whether their values, or arrays of these, fulfil it. expected: the text of what is
    expected, or a function of the values that gives it.
    """

    def __init__(
        self,
        holds: Callable[..., Any],
        expected: Callable[..., Any] | str,
        subject: tuple[str, Tree],
        *further: tuple[str, Tree],
    ) -> None:
        self.path = subject[0]
        self.reads = (subject, *further)
        self.holds = holds
        self.expected = expected
        self.names = frozenset(name for _, tree in self.reads for name in tree.names)


@lru_cache(maxsize=64)
def conditions(drawing: Drawing) -> tuple[Condition, ...]:
    """What the numbers of a drawing have to fulfil, those of a key by itself first."""
    rate, *other_trees = (
        (path, tree) for path, tree in drawing.trees() if not path.startswith("block.")
    )
    alone = [Condition(partial(_within, TICK_HZ), expectation(TICK_HZ), rate)]
    alone += [Condition(lambda value: True, "", number) for number in other_trees]  # noqa: ARG005 - any finite number will do
    return (
        *alone,
        *(condition for block in drawing.blocks for condition in _conditions(block, *rate)),
    )


def _conditions(block: DrawnBlock, rate: str, tick_hz: Tree) -> Iterator[Condition]:
    """Yield what the numbers of a block have to fulfil. rate, tick_hz: path and tree of the
    tick's rate."""
    tick = rate, tick_hz
    keys = keys_of_block(block.type)
    by_name: dict[str, tuple[str, Tree]] = {}  # of a list the first number
    for name, tree in (*block.trees(), *block.limit_trees()):
        number = f"block.{block.name}.{name}", tree
        by_name.setdefault(name, number)
        yield Condition(partial(_within, keys[name]), partial(expectation, keys[name]), number)
    if block.plant or block.dead_time:
        noun = "a dead time" if block.dead_time else f"a {block.type} that is continuous"
        expected = f"1, since {noun} runs in every tick"
        yield Condition(lambda ticks: ticks == 1, expected, by_name["every"])
    yield Condition(
        operator.lt,
        lambda _, every: f"a whole number < every = {every:g}",
        by_name["phase"],
        by_name["every"],
    )
    for name in TYPES[block.type].below_half:
        reads = by_name[name], tick, by_name["every"], by_name.get("order", ("", ONE))
        yield Condition(
            lambda hz, rate, every, order: (hz < rate / every / 2) | (order == 0),
            _below_half,
            *reads,
        )
    if "low" in by_name:
        yield Condition(
            operator.gt, lambda _, low: f"a number > low = {low:g}", by_name["high"], by_name["low"]
        )
    elif "high" in by_name:
        yield Condition(lambda high: high > 0, "a number > 0, as low is -high", by_name["high"])
    if "tracking_s" in by_name:
        # In a run the integral moves by T/tracking_s of what the output is beyond its limit: by
        # more than that it overshoots.
        yield Condition(
            lambda seconds, rate, every: seconds * rate / every >= 1 - WRITTEN,
            lambda _, rate, every: (
                f"at least {every / rate:g}, the block's period (s), below which it overshoots the limit"
            ),
            by_name["tracking_s"],
            tick,
            by_name["every"],
        )
    if block.loses_at_random:
        alone = {
            "late": "0 beside loss or burst, since how late a message is has no chances; a delay that is always there is a block delay",
            "lost": "0 beside loss or burst, since messages are lost either at random or by any pattern",
        }
        for name, words in alone.items():
            yield Condition(lambda number: number == 0, words, by_name[name])
    yield from _conditions_of_type(block, by_name, tick)


def _conditions_of_type(
    block: DrawnBlock, by_name: Mapping[str, tuple[str, Tree]], tick: tuple[str, Tree]
) -> Iterator[Condition]:
    """Yield what the numbers of some types have to fulfil together. by_name, tick: paths and
    trees of keys and of the rate."""
    start = f"block.{block.name}."
    if block.type == "mass_matrix":
        block_keys = dict(block.keys)
        reads = []
        for name in MASS:
            for row in block_keys[name]:
                reads += [(f"{start}{name}", tree) for tree in row]
        yield Condition(
            partial(is_mass, block_keys),
            "a mass matrix that is symmetric and positive definite",
            *reads,
        )
    if block.type == "tf":
        yield Condition(
            lambda first: first != 0, "a first coefficient other than 0", by_name["den"]
        )
    if block.dead_time:
        yield Condition(
            lambda seconds, hz: seconds * hz <= LONGEST_DELAY,
            lambda _, hz: f"at most {LONGEST_DELAY} ticks of the loop, {LONGEST_DELAY / hz:g} s",
            by_name["seconds"],
            tick,
        )
    if block.type == "local_model":
        yield _divides(block, by_name, tick[1])


def _divides(
    block: DrawnBlock, by_name: Mapping[str, tuple[str, Tree]], tick_hz: Tree
) -> Condition:
    """That a local model divides by a number that is not 0."""
    changed = "K"
    divisor = "b + B + K h is not 0, h the time that its spring reads ahead"
    if dict(block.keys)["integration"] == "explicit":
        changed = "B"
        divisor = "b + B is not 0"
    return Condition(
        # A local model does not divide by less.
        lambda _, total, b: abs(total) > 1e-12 * abs(b),
        f"a number with which {divisor}",
        by_name[changed],
        ("", block.divisor(tick_hz)),
        by_name["b"],
    )


def _below_half(_: float, rate: float, every: float, __: float) -> str:
    return f"a number < {rate / every / 2:g} (half the block's own rate)"


def _within(key: Key, value: Any) -> Any:
    """Whether a value, or each of an array, is one that the key of a number accepts."""
    low = -math.inf if key.low is None else key.low
    high = math.inf if key.high is None else key.high
    above = value > low if key.above_low else value >= low
    is_kind = (value % 1 == 0) if key.type == "integer" else True
    return above & (value <= high) & is_kind


def faults(drawing: Drawing, values: Mapping[str, float]) -> Iterator[tuple[str, str, str]]:
    """Yield path, expected and found text for each key that these values do not suit; keys
    without values are left out."""
    numbers = scalars(values)
    shared = SharedParts()
    wrong: set[str] = set()
    every: dict[str, int] = {}
    for condition in conditions(drawing):
        path = condition.path
        read = {read_path for read_path, _ in condition.reads}
        if not condition.names <= numbers.keys() or not wrong.isdisjoint(read):
            continue  # a number that has a mistake itself
        values_read = [tree.finite_value(numbers, shared) for _, tree in condition.reads]
        fault = _fault(condition, values_read)
        if fault:
            wrong.add(path)
            yield path, *fault
        elif path.startswith("block.") and path.endswith(".every"):
            every[path] = int(values_read[0])  # type: ignore[arg-type]  # else it has a fault
    runs = {path: ticks for path, ticks in every.items() if path not in wrong}
    yield from _size_faults(drawing, numbers, runs)


def _fault(condition: Condition, values: list[float | None]) -> tuple[str, str] | None:
    """Return expected and found text if a condition does not hold for these values of what it
    reads."""
    number = values[0]
    if number is None:
        return "a finite number", NOT_FINITE
    if not computable(number):
        return SIZES, f"{number:g}"
    if None in values or condition.holds(*values):
        return None
    expected = condition.expected
    return expected if isinstance(expected, str) else expected(*values), f"{number:g}"


def _size_faults(
    drawing: Drawing, numbers: Mapping[str, float], runs: Mapping[str, int]
) -> Iterator[tuple[str, str, str]]:
    """Yield the `faults` of too many states, and of a frame that is too long. runs: path of
    `every` of blocks -> ticks."""
    states = {block.name: _states(block, numbers) for block in drawing.blocks}
    total = sum(states.values())
    if total > MOST_STATES:
        largest = max(states, key=states.__getitem__)
        yield f"block.{largest}", f"at most {MOST_STATES} states in all blocks", f"{total:g}"
    frame = math.lcm(*runs.values())
    if frame > LONGEST_FRAME:
        expected = f"ticks of a frame, after which all blocks are in step again, <= {LONGEST_FRAME}"
        listed = ", ".join(map(str, sorted(set(runs.values()))))
        yield (
            max(runs, key=runs.__getitem__),
            expected,
            f"{frame} (the least common multiple of {listed})",
        )


def _states(block: DrawnBlock, numbers: Mapping[str, float]) -> float:
    """The states of a block as far as its keys say how many there are: coefficients, rows,
    steps, ticks."""
    keys = dict(block.core(ONE).keys)
    states: float = len(keys.get("den", keys.get("A", ())))
    for name in ("steps", "late", "order"):
        if name in keys:
            states += keys[name].finite_value(numbers) or 0.0
    return states


def displaced(drawing: Drawing, values: Mapping[str, float]) -> Iterator[tuple[str, str, str]]:
    """Yield path, expected and found text for each part of a port's displacement that is known
    to be no such position."""
    every = {block.name: block.every for block in drawing.blocks if not block.plant}
    numbers = scalars(values)
    velocities = _velocities(drawing)
    for side, force, signal, gain in _displacements(drawing):
        period = every.get(signal.rpartition(".")[0] or signal, ONE)
        runs = period.finite_value(numbers) or 1
        reason = _no_position(signal, force, velocities, runs)
        if reason and gain.finite_value(numbers):
            yield f"ports.{side}.displacement", OF_PLANT, reason


def _no_position(signal: str, force: str, velocities: list[str], runs: float) -> str:
    """Why a signal is no position that a plant has in every tick; empty if it may be one. runs:
    ticks between its changes."""
    if signal == force:
        return "the force itself"
    if signal in velocities:
        return f"{signal} is a velocity"
    return f"{signal} changes every {runs:g} ticks only" if runs > 1 else ""


def _velocities(drawing: Drawing) -> list[str]:
    """The outputs of bodies that are velocities: the second half of them."""
    velocities = []
    for block in drawing.blocks:
        if TYPES[block.type].body or block.type == "mass_matrix":
            _, outputs = block.ports
            half = len(outputs) // 2
            velocities += [f"{block.name}.{port}" for port in outputs[half:]]
    return velocities


def _displacements(drawing: Drawing) -> Iterator[tuple[str, str, str, Tree]]:
    """Yield the port, its force, and signal and gain of each term of the displacements at the
    ports."""
    ports = [("hand", drawing.hand), ("environment", drawing.environment)]
    ports += [("hand", (force, terms, None)) for _, force, terms in drawing.further]
    for side, port in ports:
        if port:
            yield from ((side, port[0], signal, gain) for signal, gain in port[1])
