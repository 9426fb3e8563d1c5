"""Dead times of any fraction of a tick: of how many ticks they are, and what acts on plants or is
read of them in between.

With tick T a dead time tau is `(m - s) T`, m whole and 0 <= s < 1. Of a signal u that is held,
u[k-m] acts on a plant in tick k until `s T` before its end, and from then on u[k-m+1]. Over the
tick that adds

    int_0^{s T} exp(A t) dt B (u[k-m+1] - u[k-m])

to the plant's states, on which it acts by a port of its own. The output of a plant that is read at
the tick k is that of `s T` after the tick k - m began. If another dead time arrives there before,
`s' T` before the end, it has acted for `(s + s' - 1) T`. So m, and which comes first, decide how a
loop is built, and s is a number of it like others.
"""

from collections.abc import Callable, Iterator, KeysView, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import lcm
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._drawing.drawing import AT, Drawing, name_of, scalars
from wavesweep.engine._drawing.drawn_block import DrawnBlock, Plant
from wavesweep.engine._drawing.expressions import Tree
from wavesweep.engine._loops.block import Block, concatenated
from wavesweep.engine._loops.blocks import Rates
from wavesweep.engine.doubles import BY_TWO

Sums = dict[str, dict[str, np.ndarray | float]]  # signal -> what it is a sum of, with gains

# ports of a dead time: what it reads of plants, and by how much its output changes in the tick
SENSED = "sensed"
NEXT = "next"
MOST_PARTS_OF_TICK = 64  # parts of a tick, of which a finer tick is made
# Relative distance from a whole number of ticks up to which a dead time is meant to be one: that of
# a decimal of twelve digits.
WHOLE_TICK = 1e-11


def structure(drawing: Drawing, values: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the whole numbers by which dead times decide how loops are built, by their paths:
    of each its ticks m, and of two that follow each other, whether `s + s' > 1`.

    values: flat. A complex one is where its real part is and takes a small step of its imaginary
    part: a dead time of whole ticks has one tick more if it grows by that, and of two with
    `s + s' = 1` the first comes before the second if the sum grows.
    """
    numbers = scalars(values)
    exact = {}
    ticks = {}
    with np.errstate(all="ignore"):
        rate = np.asarray(drawing.tick_hz.values(numbers))
        for name, tree in drawing.dead_times.items():
            exact[name] = np.asarray(tree.values(numbers)) * rate
            real = exact[name].real
            ticks[name] = np.ceil(real * (1 - WHOLE_TICK))
            is_whole = real >= ticks[name] * (1 - WHOLE_TICK)
            ticks[name] = ticks[name] + (is_whole & (exact[name].imag > 0))
    whole = {}
    for path, names in drawing.building.items():
        if len(names) == 1:
            whole[path] = ticks[names[0]]
        else:  # the first acts before the second reads
            shares = sum(ticks[name] - exact[name] for name in names)
            rounding = WHOLE_TICK * sum(ticks[name] for name in names)
            at_once = np.abs(shares.real - 1) <= rounding
            whole[path] = np.where(at_once, shares.imag > 0, shares.real > 1)
    return whole


def built(drawing: Drawing, numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers, by name, with those of `structure`, which are the same in all loops of
    the batch."""
    if numbers.keys() >= drawing.building.keys():
        return dict(numbers)
    whole = structure(drawing, numbers)
    return {path: int(np.ravel(number)[0]) for path, number in whole.items()} | dict(numbers)


def in_longer_ticks(
    drawing: Drawing, values: Mapping[str, Any], longer: int
) -> dict[str, int | bool]:
    """Return the whole numbers of `structure` that are among values, for a tick as long as
    `longer` of these.

    A dead time of m ticks lies between m - 1 and m of them, and the sum of two between p - 1 and
    p, with p one less than their ticks together if the first acts before the second reads. Longer
    ticks end where one of these does.
    """
    whole: dict[str, int | bool] = {}
    for path, names in drawing.building.items():
        if path not in values:
            continue
        ticks = [values[f"block.{name}.ticks"] for name in names]
        in_longer = [-(-count // longer) for count in ticks]
        if len(names) == 1:
            whole[path] = in_longer[0]
        else:
            whole[path] = sum(ticks) - values[path] <= longer * (sum(in_longer) - 1)
    return whole


def in_whole_ticks(drawing: Drawing, values: Mapping[str, Any], path: str) -> Drawing | None:
    """Return the same loop at a finer tick, of which its dead times are whole numbers; None if it
    cannot be given so.

    values: of one loop. path: path of a number whose value may change.

    A plant that runs more often with the same inputs is the same plant. So no plant may be sampled
    for another one, which would happen more often as well, and no dead time for another. Dead times
    are meant to be simple parts of a tick, from which they differ by rounding.
    """
    if not drawing.dead_times:
        return drawing
    if name_of(path) in drawing.timing:
        return None
    numbers = scalars(values)
    rate = drawing.rate(values)
    exact = {}
    for name, tree in drawing.dead_times.items():
        ticks = tree.value(numbers) * rate
        exact[name] = Fraction(ticks).limit_denominator(MOST_PARTS_OF_TICK)
        if abs(exact[name] - ticks) > WHOLE_TICK * max(ticks, 1):
            return None
    finer = lcm(*(ticks.denominator for ticks in exact.values()))
    if finer > MOST_PARTS_OF_TICK:
        return None
    if any(block.every.value(numbers) != 1 for block in drawing.blocks if block.name in exact):
        return None
    plants = {block.name for block in drawing.blocks if block.plant}
    if _samples_another(drawing, plants, exact.keys()):
        return None
    blocks = tuple(_at_finer_tick(block, exact, finer) for block in drawing.blocks)
    return replace(drawing, tick_hz=finer * drawing.tick_hz, blocks=blocks)


def _at_finer_tick(block: DrawnBlock, exact: Mapping[str, Fraction], finer: int) -> DrawnBlock:
    """The block at a tick of which `finer` are one of before. exact: ticks of each dead time,
    fractions."""
    if block.name in exact:
        return replace(block, keys=(("steps", Tree.number(float(exact[block.name] * finer))),))
    if block.plant:
        return block
    every = finer * block.every
    phase = finer * block.phase
    phases = tuple(tick * finer for tick in block.phases)
    return replace(block, every=every, phase=phase, phases=phases)


def _samples_another(drawing: Drawing, plants: set[str], dead_times: KeysView[str]) -> bool:
    """Whether a plant is sampled for another one, or a dead time for another."""
    timed = plants | dead_times
    pairs = []
    for port, terms in drawing.wires:
        reader = port.rpartition(".")[0]
        sources = {signal.rpartition(".")[0] for signal, _ in terms}
        if reader in timed:
            pairs += [(reader, source) for source in sources & timed]
    sensing = {reader for reader, source in pairs if source in plants}
    for reader, source in pairs:
        alike = (reader in plants) == (source in plants)
        if alike or source in sensing:
            return True
    return False


class DeadTime(NamedTuple):
    """A dead time of loops, `(ticks - share) T`: its whole ticks m, the same in all, and s."""

    ticks: int
    share: Any


def of_loops(drawing: Drawing, values: Mapping[str, Any]) -> dict[str, DeadTime]:
    """Return the dead times of loops by the names of their blocks; values: flat."""
    constants = built(drawing, scalars(values))
    rate = drawing.tick_hz.values(constants)
    dead_times = {}
    for name, share in shares(drawing, constants, rate).items():
        dead_times[name] = DeadTime(constants[f"block.{name}.ticks"], share)
    return dead_times


def shares(
    drawing: Drawing, constants: Mapping[str, Any], rate: np.ndarray | float
) -> dict[str, Any]:
    """Return `s = m - tau/T` of each dead time; constants: with `structure`; rate: 1/T, of the tick
    (Hz)."""
    return {
        name: constants[f"block.{name}.ticks"] - tree.values(constants) * rate
        for name, tree in drawing.dead_times.items()
    }


def breaks(
    drawing: Drawing, values: Mapping[str, Any], path: str, span: tuple[float, float]
) -> list[float]:
    """Return the ends of a number's span and the values within it at which dead times decide anew
    how the loop is built.

    values: flat numbers of one loop.
    """
    points = _places(drawing, values, path, span)
    ticks = _ticks(drawing, values, path, points)
    near = np.round(ticks)  # a dead time of so many ticks whatever the number is, but for rounding
    ticks = np.where(np.abs(ticks - near) <= WHOLE_TICK * np.maximum(near, 1.0), near, ticks)
    crossings = set()  # (dead time, whole number, cell between two points)
    for row, cell in np.argwhere(np.diff(np.floor(ticks), axis=1) != 0).tolist():
        low, high = sorted(ticks[row, cell : cell + 2])
        for count in range(int(np.floor(low)) + 1, int(np.floor(high)) + 1):
            crossings.add((row, count, cell))
    if not crossings:
        return [*span]
    row, count, cell = np.array(sorted(crossings), int).T

    def beyond(p: np.ndarray) -> np.ndarray:
        return _ticks(drawing, values, path, p)[row, np.arange(p.size)] - count

    apart = WHOLE_TICK * (span[1] - span[0])  # values that are nearer are meant to be the same
    ends = [span[0]]
    for value in sorted(_whole_at(beyond, points[cell], points[cell + 1])):
        if ends[-1] + apart < value < span[1] - apart:
            ends.append(value)
    return [*ends, span[1]]


def pieces_of(
    drawing: Drawing, values: Mapping[str, Any], path: str, span: tuple[float, float]
) -> Iterator[tuple[tuple[float, float], dict[str, int]]]:
    """Yield the parts of a number's span in which the loop is built alike, with the whole numbers
    by which it is.

    values: flat numbers of one loop.
    """
    if name_of(path) not in drawing.timing:
        yield span, {}
        return
    for piece in pairwise(breaks(drawing, values, path, span)):
        ticks = structure(drawing, {**values, path: sum(piece) / 2})
        yield piece, {key: int(number) for key, number in ticks.items()}


def _whole_at(beyond: Callable[..., Any], low: np.ndarray, high: np.ndarray) -> list[float]:
    """The values in cells from `low` to `high`, arrays, at which functions are 0, which they pass
    there or meet at an end.

    beyond: the functions, one for each cell, of an array of values.
    """
    at_low = beyond(low)
    at_high = beyond(high)
    at_an_end = _nearer(low, high, at_low, at_high)
    passed = at_low * at_high < 0
    for _ in range(BY_TWO):
        middle = (low + high) / 2
        before = (beyond(middle) < 0) == (at_low < 0)
        low = np.where(before, middle, low)
        high = np.where(before, high, middle)
    within = _nearer(low, high, beyond(low), beyond(high))
    return np.where(passed, within, at_an_end).tolist()


def _nearer(
    low: np.ndarray, high: np.ndarray, at_low: np.ndarray, at_high: np.ndarray
) -> np.ndarray:
    """The end of each cell at which its function is nearer to 0."""
    return np.where(np.abs(at_low) <= np.abs(at_high), low, high)


MOST_SPREAD = 0.25  # ticks by which a dead time may change between neighbours


def _places(
    drawing: Drawing, values: Mapping[str, Any], path: str, span: tuple[float, float]
) -> np.ndarray:
    """Points of a span: even ones, and as many more as it takes until no dead time changes by more
    than MOST_SPREAD between two.

    How far it changes is enclosed in balls, so that what rises and falls within a step is seen as
    well.
    """
    # A number of ticks is taken as monotone between neighbours, which a proof over a range tries
    # again.
    points = np.linspace(*span, 4001)
    name = name_of(path)
    numbers = scalars(values)
    trees = [tree * drawing.tick_hz for tree in drawing.dead_times.values()]
    bent = [tree for tree in trees if tree.degree(name) > 1]
    further: list[float] = []
    open_ = [span] if bent else []
    while open_ and len(further) < 4000:  # about as many as there are without them
        low, high = open_.pop(0)
        if all(_spread(tree, numbers, name, low, high) < MOST_SPREAD for tree in bent):
            continue
        middle = low + (high - low) / 2
        if middle in (low, high):
            continue
        # A stretch over more than two octaves is divided at its geometric mean.
        if 0 < low * 4.0 < high:
            middle = (low * high) ** 0.5
        further.append(middle)
        open_ += [(low, middle), (middle, high)]
    return np.unique(np.concatenate([points, further]))


def _spread(tree: Tree, numbers: Mapping[str, Any], name: str, low: float, high: float) -> float:
    """A bound on how far the value of a tree changes while a number goes from low to high."""
    from flint import arb

    balls: dict[Any, Any] = {constant: arb(constant) for constant in tree.constants}
    balls |= {name_read: arb(numbers[name_read]) for name_read in tree.names if name_read != name}
    balls[name] = arb((low + high) / 2, (high - low) / 2)
    try:
        value = tree.in_names.evaluate(balls, arb)
    except ZeroDivisionError:
        return np.inf
    return 2 * float(value.rad()) if value.is_finite() else np.inf


def _ticks(drawing: Drawing, values: Mapping[str, Any], path: str, p: np.ndarray) -> np.ndarray:
    """Dead times in ticks, and sums of two of which the order matters, at values of a number:
    `(sums, points)`."""
    numbers = scalars({**values, path: p})
    rate = drawing.tick_hz.values(numbers)
    ticks = {name: tree.values(numbers) * rate for name, tree in drawing.dead_times.items()}
    rows = [sum(ticks[name] for name in names) + 0 * p for names in drawing.building.values()]
    return np.stack(rows)


def block_of(name: str, ticks: int, *, sensed: bool, plain: bool, arriving: bool) -> Block:
    """Return the block of a dead time of so many ticks, m: a line of m delays for each input.

    Its output y adds the ends of the lines, u[k-m] and that of plants. The second output, NEXT, is
    `u[k-m+1] - u[k-m]`. sensed, plain: whether it reads plants, and other signals; arriving:
    whether it acts on a plant, which reads NEXT.
    """
    inputs = ("u",) * (plain or not sensed) + (SENSED,) * sensed
    states = tuple(f"{port}{k}" for port in inputs for k in range(1, ticks + 1))
    n = len(states)
    m = len(inputs)
    line = np.eye(ticks, k=-1) - np.eye(ticks)
    E = np.kron(np.eye(m), line)
    B = np.zeros((n, m))
    C = np.zeros((2, n))
    D = np.zeros((2, m))
    for i in range(m):
        B[i * ticks : i * ticks + 1, i] = 1
    if ticks:
        C[0, ticks - 1 :: ticks] = 1
    else:
        D[0] = 1
    if ticks and inputs[0] == "u":
        C[1, ticks - 1] = -1
        if ticks > 1:
            C[1, ticks - 2] = 1
        else:
            D[1, 0] = 1
    count = 1 + arriving
    return Block(name, inputs, ("y", NEXT)[:count], states, E, B, C[:count], D[:count])


def joined(
    sums: Sums, plants: tuple[Plant, ...], inside: Mapping[str, str], product: str, factor: str
) -> Sums:
    """Return junctions with those at the ports by which dead times act on plants and read them.

    What a dead time reads of a plant goes from its port "u" to SENSED, where it is the plant's
    signal at that dead time. If a number that is taken out multiplies this signal, the product goes
    there as well, and the number multiplies the signal at the dead time. sums: with names of ports
    of plants. product, factor: the input that a number has become, and what it multiplies.
    """
    sums = dict(sums)
    for plant in plants:
        for port, name in plant.arriving:
            arriving = inside[port]
            sums[arriving + AT + name] = {f"{name}.{NEXT}": sums[arriving][f"{name}.y"]}
        for signal, name in plant.sensed:
            measured = inside[signal]
            late = measured + AT + name
            junction = dict(sums[f"{name}.u"])
            read = sums.setdefault(f"{name}.{SENSED}", {})
            if measured in junction:
                read[late] = junction.pop(measured)
            multiplied = measured in sums.get(factor, ())
            if multiplied and product in junction:
                read[product] = junction.pop(product)
            if multiplied and product in read:
                sums[factor] = {
                    late if source == measured else source: gain
                    for source, gain in sums[factor].items()
                }
            sums[f"{name}.u"] = junction
    return {port: terms for port, terms in sums.items() if terms or not port.endswith(".u")}


def with_ports(
    block: Block,
    plant: Plant,
    rates: Rates,
    constants: Mapping[str, Any],
    shares: Mapping[str, Any],
) -> Block:
    """Return the block of a plant with ports for the dead times that act on it or read it.

    With E(s) and G(s) of `Rates.over`, an input that arrives s T before the end of a tick adds
    `G(s) (u[k-m+1] - u[k-m])` to the states. An output that is read s T after the tick began is

        C (x + E(s) x + G(s) u) + D u

    and an input that has arrived there before acts on it by `C G(s + s' - 1) + D`. rates: of the
    states. shares: s of each dead time. constants: with `structure`. Accuracy: that of `held`.
    """
    inputs, outputs = plant.drawn_ports
    of_E, of_B, of_C, of_D = block.terms
    arriving = [rates.over(shares[name], [inputs.index(port)]) for port, name in plant.arriving]
    nothing = np.zeros((len(outputs), len(plant.arriving)))
    G = concatenated([block.B, *(late.G for late in arriving)], -1)
    of_G = concatenated([of_B, *(late.of_G for late in arriving)], -1)
    rows_C = [block.C]
    rows_of_C = [of_C]
    rows_D = [concatenated([block.D, nothing], -1)]
    rows_of_D = [concatenated([of_D, nothing], -1)]
    eye = np.eye(len(block.states))
    for signal, name in plant.sensed:
        i = [outputs.index(signal)]
        row = block.C[..., i, :]
        of_row = of_C[..., i, :]
        through = block.D[..., i, :]
        of_through = of_D[..., i, :]
        E, held_B, of_own, of_held = rates.over(shares[name])
        rows_C.append(row + row @ E)
        rows_of_C.append(of_row @ np.abs(E + eye) + np.abs(row) @ of_own)
        columns = [through + row @ held_B]
        of_columns = [of_through + of_row @ np.abs(held_B) + np.abs(row) @ of_held]
        for port, earlier in plant.arriving:
            if not constants[f"block.{earlier}.before.{name}"]:
                columns.append(np.zeros((1, 1)))
                of_columns.append(np.zeros((1, 1)))
                continue
            j = [inputs.index(port)]
            step = rates.over(shares[earlier] + shares[name] - 1, j)
            columns.append(through[..., j] + row @ step.G)
            of_step = of_row @ np.abs(step.G) + np.abs(row) @ step.of_G
            of_columns.append(of_through[..., j] + of_step)
        rows_D.append(concatenated(columns, -1))
        rows_of_D.append(concatenated(of_columns, -1))
    late_inputs = [f"{plant.own(port)}{AT}{name}" for port, name in plant.arriving]
    late_outputs = [f"{plant.own(signal)}{AT}{name}" for signal, name in plant.sensed]
    return replace(
        block,
        inputs=(*block.inputs, *late_inputs),
        outputs=(*block.outputs, *late_outputs),
        B=G,
        C=concatenated(rows_C, -2),
        D=concatenated(rows_D, -2),
        terms=(of_E, of_G, concatenated(rows_of_C, -2), concatenated(rows_of_D, -2)),
    )
