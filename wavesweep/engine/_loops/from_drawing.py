"""From a drawn loop to its blocks: numbers put in, twins of it with other numbers, and the names
of its port's signals."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from zlib import crc32

import numpy as np

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import Drawing, decides, name_of
from wavesweep.engine._drawing.expressions import (
    ONE,
    SharedParts,
    degree,
    evaluate,
    names_in,
    with_number,
)
from wavesweep.engine._loops import blocks, dead_time
from wavesweep.engine._loops.block import numbers
from wavesweep.engine._loops.integrator_modes import equations_of
from wavesweep.engine._loops.multirate import MultirateLoop, ScheduledBlock
from wavesweep.engine._loops.plant import plant_of
from wavesweep.engine._loops.values import keys_with, numbers_of, rest_of, values_of
from wavesweep.engine._state_space import StateSpace

POSITION, REACTION = (
    "ports.hand.displacement",
    "ports.hand.reaction",
)  # the junctions at the hand's port
PRODUCT, FACTOR = (
    "ports.product",
    "ports.factor",
)  # of a number that is taken out of its wire, and what it multiplies
BESIDE = "ports.beside"  # what another number of the same wire multiplies, see `shares_wire`
OUTPUT = "ports.outputs."  # begins the junctions of the outputs
HAND = "ports.hand."  # keys of the hand's port


def assembled(
    drawing: Drawing, values: Mapping[str, object], out: str = "", beside: str = ""
) -> MultirateLoop:
    """Return the drawn loop of `values`: flat numbers, or arrays over a batch, real or complex.

    out: a number to take out of its place (see `scalar_place`): its product is then the input
    PRODUCT, and it would multiply the signal FACTOR. beside: a number of the same wire (see
    `shares_wire`) whose value is 0; it would multiply the signal BESIDE. A value that is not finite
    makes entries that are not finite.
    """
    known_values = dead_time.built(drawing, numbers_of(values))
    with np.errstate(all="ignore"):
        rate = values_of(drawing.tick_hz, known_values)
        tick = 1 / numbers(rate)
        placed = _blocks(drawing, known_values, rate, tick)
        sums = {port: _gains(terms, known_values) for port, terms in drawing.wires}
        if out:
            placed = _take_out(drawing, placed, sums, known_values, out)
        if beside:
            wire = dict(drawing.wires)[scalar_place(drawing, beside).partition(".")[2]]
            sums[BESIDE] = _factor(wire, known_values, beside)
    shown = [(OUTPUT + name, terms) for name, terms, _ in drawing.outputs]
    shown += zip((POSITION, REACTION), drawing.hand[1:], strict=True) if drawing.hand else ()
    sums |= {signal: _gains(terms, known_values) for signal, terms in shown if terms is not None}
    inputs = drawing.outside
    if inside := drawing.inside:  # the names that the ports of blocks have in plants of several
        sums = {
            inside.get(port, port): {
                inside.get(name, name): gain for name, gain in sums[port].items()
            }
            for port in sums
        }
    if drawing.dead_times:
        sums = dead_time.joined(sums, drawing.plants, drawing.inside, PRODUCT, FACTOR)
    return MultirateLoop(tick, placed, sums, (*inputs, PRODUCT) if out else inputs, rate=rate)


def _blocks(drawing, known, rate, tick):
    """The blocks, dead times and plants of a drawing, with their numbers."""
    placed = [_placed(block, known, tick) for block in drawing.alone if not block.dead_time]
    placed += [_dead_time(drawing, name, known) for name in drawing.dead_times]
    shares = dead_time.shares(drawing, known, rate)
    return tuple(placed + [_plant(plant, known, tick, shares) for plant in drawing.plants])


def _plant(plant, known, tick, shares):
    """A plant of several blocks, or one that dead times act on, with its numbers."""
    gains = {port: _gains(terms, known) for port, terms in plant.couplings}
    keys = {block.name: _keys(block, known) for block in plant.members}
    return ScheduledBlock(plant_of(plant, keys, gains, tick, known, shares))


def _dead_time(drawing, name, known):
    """The block of a dead time."""
    sensed = {signal for plant in drawing.plants for signal, delay in plant.sensed if delay == name}
    arriving = any(name == delay for plant in drawing.plants for _, delay in plant.arriving)
    reads_others = any(
        signal not in sensed for signal, _ in dict(drawing.wires).get(f"{name}.u", ())
    )
    ticks = known[f"block.{name}.ticks"]
    return ScheduledBlock(
        dead_time.block_of(name, ticks, sensed=bool(sensed), others=reads_others, arriving=arriving)
    )


def rate_of(drawing: Drawing, values: Mapping[str, object]):
    """Return the rate of the tick (Hz); values: as for `assembled`."""
    with np.errstate(all="ignore"):
        return values_of(drawing.tick_hz, numbers_of(values))


def _gains(terms, known):
    return {signal: values_of(gain, known) for signal, gain in terms}


def _placed(block, known, tick):
    """The block with its numbers; one that they do not vary in a batch is remembered."""
    read = {name: known[name] for name in _read_by(block)}
    if np.ndim(tick) or any(np.ndim(value) or np.iscomplexobj(value) for value in read.values()):
        return _with_numbers(block, known, tick)
    return _placed_alone(
        block,
        tuple((name, v if isinstance(v, int) else v.item()) for name, v in read.items()),
        tick,
    )


@lru_cache(maxsize=4096)
def _read_by(block):
    return tuple(sorted({name for _, tree in block.trees() for name, _ in names_in(tree)}))


@lru_cache(maxsize=2048, typed=True)
def _placed_alone(block, read, tick):
    return _with_numbers(
        block, {name: v if isinstance(v, int) else numbers(v) for name, v in read}, tick
    )


def _with_numbers(block, known, tick):
    every, phase = int(values_of(block.every, known)), int(values_of(block.phase, known))
    block = block if TYPES[block.type].formula else block.core(ONE)
    keys = _keys(block, known)
    period = every * tick if not block.phases else every * tick / len(block.phases)
    if TYPES[block.type].formula:  # whose sums do not cancel, if those of its keys do not
        of_names = block.core(ONE, named=True)
        block = block.core(ONE)
        keys = {
            name: [evaluate(tree, {**keys, "T": period}, np) for tree in trees]
            for name, trees in of_names.keys[:2]
        }
        keys["discrete"] = of_names.keys[2][1]
    if keys.get("discrete") is True:
        trees = dict(block.keys)
        if block.type == "tf":
            keys["rests"] = tuple(_rests(trees[name], keys[name], known) for name in ("num", "den"))
        else:
            keys["rests"] = [_rests(*row, known) for row in zip(trees["A"], keys["A"], strict=True)]
    make = getattr(blocks, block.type, None) or partial(blocks.defined, block.type)
    return ScheduledBlock(make(block.name, period, **keys), every, block.phases or phase)


def _keys(block, known):
    """The keys of a block with their values."""
    shared = SharedParts()
    keys = keys_with(block, lambda tree: values_of(tree, known, shared))
    if block.type == "butterworth":
        keys["passes"] = keys.pop("pass")
    if block.type == "ss" and not keys["D"]:
        keys["D"] = [[0.0] * len(keys["inputs"]) for _ in keys["outputs"]]
    return keys


def _rests(trees, values, known):
    return [rest_of(tree, value, known) for tree, value in zip(trees, values, strict=True)]


def _take_out(drawing, placed, sums, known, out):
    """Make the product of a number the input PRODUCT, in the sums and, if it is the factor of a
    gain, in its block."""
    table, _, place = scalar_place(drawing, out).partition(".")
    block = place.rpartition(".")[0]
    if table == "wire":
        gains = {signal: _parts(gain, known, out) for signal, gain in dict(drawing.wires)[place]}
        sums[place] = {PRODUCT: 1.0} | {signal: constant for signal, (constant, _) in gains.items()}
        sums[FACTOR] = _factor(dict(drawing.wires)[place], known, out)
        return placed
    keys = dict(next(core.keys for core in drawing.cores if core.name == block))
    sums[f"{block}.{PRODUCT}"] = {PRODUCT: 1.0}
    if "k" in keys:
        constant, slope = _parts(keys["k"], known, out)
        sums[FACTOR] = {signal: slope * gain for signal, gain in sums[f"{block}.u"].items()}
        both = blocks.ss(
            block, 1.0, [], [], [], [[constant, 1.0]], ("u", PRODUCT), ("y",), discrete=True
        )
    else:
        num, den = (
            [_parts(tree, known, out) for tree in keys["num"]],
            [values_of(tree, known) for tree in keys["den"]],
        )
        sums[FACTOR] = {f"{block}.factor": 1.0}
        both = _opened(
            *(
                blocks.tf(block, 1.0, list(half), den, keys["discrete"])
                for half in zip(*num, strict=True)
            )
        )
    return tuple(
        replace(scheduled, block=both) if scheduled.block.name == block else scheduled
        for scheduled in placed
    )


def _opened(constant, slope):
    """A transfer function with the product as an input too, and what the number multiplies as
    the output `factor`."""

    def wider(E, B, C, D, c, d):
        unit, none = np.ones_like(D), np.zeros_like(D)
        rows = (np.concatenate(np.broadcast_arrays(*row), -1) for row in ((D, unit), (d, none)))
        C, D = (np.concatenate(np.broadcast_arrays(*column), -2) for column in ((C, c), rows))
        return StateSpace(E, np.concatenate([B, np.zeros_like(B)], -1), C, D)

    matrices = wider(*(getattr(constant, name) for name in "EBCD"), slope.C, slope.D)
    terms = constant.terms and wider(*constant.terms, *slope.terms[2:])
    ports = {"inputs": ("u", PRODUCT), "outputs": ("y", "factor")}
    return replace(constant, **ports, **matrices._asdict(), terms=terms, at_rest=None)


def _factor(terms, known, out):
    """The signals that a number of a wire multiplies, with their factors."""
    slopes = {signal: _parts(gain, known, out)[1] for signal, gain in terms}
    return {signal: slope for signal, slope in slopes.items() if np.any(slope)}


def _parts(gain, known, out):
    """The constant part of a gain that is linear in a number, and the factor of the number."""
    constant, total = (with_number(gain, out, p) for p in (0.0, 1.0))
    return values_of(constant, known), values_of(("-", total, constant, 0), known)


@lru_cache(maxsize=256)  # a compiled loop is asked again and again
def scalar_place(drawing: Drawing, number: str) -> str:
    """The path of the only wire that is not within a plant, of the factor of the only gain, or of
    the output of the only word of firmware that reads a number, if it is linear in it; else empty.

    The ports may read the number too (see `seen_by_hand`), which changes nothing of the loop.
    """
    pairs = zip(drawing.blocks, drawing.cores, strict=True)
    words = {
        f"block.{block.name}": dict(core.keys) for block, core in pairs if core.type != block.type
    }
    path = _only_reader(drawing, number, words)
    is_wire = path.startswith("wire.")
    if is_wire and _split(drawing, path.removeprefix("wire."), number):
        return ""
    trees = [tree for tree_path, tree in drawing.trees() if tree_path == path]
    if word := words.get(path.removesuffix(".y")):
        is_gain, trees = (
            number not in {name for tree in word["den"] for name, _ in names_in(tree)},
            word["num"],
        )
    else:
        is_gain = path in {
            f"block.{block.name}.k" for block in drawing.blocks if block.type == "gain"
        }
    return path if (is_gain or is_wire) and all(degree(tree, number) <= 1 for tree in trees) else ""


def _only_reader(drawing, number, words):
    """The path of what alone reads a number, other than ports; empty if there is more. words:
    paths of blocks of firmware."""
    readers = set()
    for path in _readers(drawing, number):
        block = path.rpartition(".")[0]
        if not path.startswith("ports."):
            readers.add(f"{block}.y" if block in words and not decides(path) else path)
    if len(readers) != 1 or any(
        name == number for _, gain in _inside(drawing) for name, _ in names_in(gain)
    ):
        return ""
    return readers.pop()


def _split(drawing, port, number):
    """Whether a number multiplies what a dead time brings to a plant, or both what it reads of
    plants and other signals."""
    signals = [
        signal
        for signal, gain in dict(drawing.wires)[port]
        if any(name == number for name, _ in names_in(gain))
    ]
    arriving = {
        (port_of_plant, f"{name}.y")
        for plant in drawing.plants
        for port_of_plant, name in plant.arriving
    }
    sensed = {
        signal for plant in drawing.plants for signal, name in plant.sensed if f"{name}.u" == port
    }
    return any((port, signal) in arriving for signal in signals) or 0 < len(
        sensed & {*signals}
    ) < len(signals)


def _inside(drawing):
    """Signals and gains of the terms that act within a plant."""
    return (term for _, terms in drawing.couplings for term in terms)


@lru_cache(maxsize=256)
def shares_wire(drawing: Drawing, number: str, other: str) -> bool:
    """Whether another number is the factor of other terms in the same wire, see `scalar_place`."""
    place = scalar_place(drawing, number)
    if (
        not place.startswith("wire.")
        or scalar_place(drawing, other) != place
        or place[5:-2] in drawing.dead_times
    ):
        return False
    return not any(
        {number, other} <= {name for name, _ in names_in(tree)}
        for path, tree in drawing.trees()
        if path == place
    )


@lru_cache(maxsize=256)
def seen_by_hand(drawing: Drawing, number: str) -> bool:
    """Whether the signals at the hand's port read a number themselves."""
    return any(path.startswith(HAND) for path in _readers(drawing, number))


@lru_cache(maxsize=256)
def _readers(drawing, number):
    return {
        path for path, tree in drawing.trees() if any(name == number for name, _ in names_in(tree))
    }


def twins(
    drawing: Drawing, values: Mapping[str, object], out: str = "", beside: str = ""
) -> tuple[MultirateLoop, MultirateLoop]:
    """Return two loops of a batch, in which drift is searched for, or one loop twice if no number
    varies.

    values: flat numbers, with arrays of those that vary, and that are between the values of these
    in the two loops. out, beside: numbers to take out, see `assembled`.
    """
    pair = ({path: _between(path, value, salt) for path, value in values.items()} for salt in SALTS)
    return _twins(drawing, *(tuple(side_values.items()) for side_values in pair), out, beside)


def _between(path, value, salt):
    if not isinstance(value, np.ndarray):
        return value
    low, high = float(np.min(value.real)), float(np.max(value.real))
    return low + (high - low) * (0.25 + 0.5 * scattered(path, salt)) if low < high else low


SALTS = "ab"  # of the two loops


def scattered(path: str, salt: str = "") -> float:
    """Return a number from 0 to 1 for a path, another one for other paths and salts, always the
    same."""
    return crc32((salt + path).encode()) / 2**32


@lru_cache(maxsize=256)
def _twins(drawing, one, other, out, beside):
    varied = frozenset(
        name_of(path) for (path, value), (_, twin) in zip(one, other, strict=True) if value != twin
    )
    drawn_twins = []
    for items in (one, other)[: 1 + bool(varied)]:
        drawn, values = assembled(drawing, dict(items), out, beside), dict(items)
        drawn_twins.append(
            replace(drawn, exact=partial(equations_of, drawing, values, varied, out))
        )
    return drawn_twins[0], drawn_twins[-1]


@dataclass(frozen=True, slots=True)
class Ports:
    """The hand's port of a drawn loop: the input `force` (N), and the signals of its position (m)
    and of the force against it.

    reaction: empty if none is known; then the impedance is that of the whole port, force over
    position. others: input and position of each further port, or axis of the hand, of which no
    reaction is known.
    """

    force: str
    position: str
    reaction: str = ""
    others: tuple[tuple[str, str], ...] = ()

    @property
    def forces(self) -> list[str]:
        """The inputs of the ports."""
        return [self.force, *(force for force, _ in self.others)]

    @property
    def signals(self) -> tuple[str, ...]:
        """The outputs of the ports."""
        return (
            self.position,
            *(position for _, position in self.others),
            *([self.reaction] if self.reaction else ()),
        )


def hand_of(drawing: Drawing) -> Ports:
    """The signals at the port of a hand that the drawing has."""
    return Ports(drawing.hand[0], POSITION, REACTION if drawing.hand[2] is not None else "")


def axes_of(drawing: Drawing) -> Ports:
    """The signals at the port of a hand with all its axes."""
    further = tuple((force, OUTPUT + name) for name, force, _ in drawing.further)
    return Ports(drawing.hand[0], POSITION, others=further)
