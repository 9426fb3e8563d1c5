"""From a drawn loop to its blocks: numbers put in, twins of it with other numbers, and the names
of its port's signals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import Drawing, name_of
from wavesweep.engine._drawing.expressions import (
    ONE,
    SharedParts,
    Terms,
)
from wavesweep.engine._loops import blocks, dead_time
from wavesweep.engine._loops.block import numbers
from wavesweep.engine._loops.integrator_modes import equations_of
from wavesweep.engine._loops.multirate import MultirateLoop, ScheduledBlock
from wavesweep.engine._loops.plant import plant_of
from wavesweep.engine._loops.values import keys_with, numbers_of
from wavesweep.engine._state_space import StateSpace

if TYPE_CHECKING:
    from wavesweep.engine._drawing.drawn_block import DrawnBlock, Plant
    from wavesweep.engine._drawing.expressions import Tree
    from wavesweep.engine._loops.block import Block

# the junctions at the hand's port
POSITION = "ports.hand.displacement"
REACTION = "ports.hand.reaction"
PRODUCT = "ports.product"  # the input that is the product of a number taken out of its place
FACTOR = "ports.factor"  # the signal that this number multiplies
# the signal that another number of the same wire multiplies, see `Drawing.shares_wire`
BESIDE = "ports.beside"
OUTPUT = "ports.outputs."  # begins the junctions of the outputs


def assembled(
    drawing: Drawing, values: Mapping[str, Any], out: str = "", beside: str = ""
) -> MultirateLoop:
    """Return the drawn loop of `values`: flat numbers, or arrays over a batch, real or complex.

    out: a number to take out of its place (see `Drawing.scalar_place`): its product is then the
    input PRODUCT, and it would multiply the signal FACTOR. beside: a number of the same wire (see
    `Drawing.shares_wire`) whose value is 0; it would multiply the signal BESIDE. A value that is
    not finite makes entries that are not finite.
    """
    known_values = dead_time.built(drawing, numbers_of(values))
    with np.errstate(all="ignore"):
        rate = drawing.tick_hz.values(known_values)
        tick = 1 / numbers(rate)
        placed = _blocks(drawing, known_values, rate, tick)
        sums = {port: _gains(terms, known_values) for port, terms in drawing.wires}
        if out:
            placed = _take_out(drawing, placed, sums, known_values, out)
        if beside:
            wire = dict(drawing.wires)[drawing.scalar_place(beside).partition(".")[2]]
            sums[BESIDE] = _factor(wire, known_values, beside)
    shown: list[tuple[str, Terms | None]] = [
        (OUTPUT + name, terms) for name, terms, _ in drawing.outputs
    ]
    if drawing.hand:
        shown += zip((POSITION, REACTION), drawing.hand[1:], strict=True)
    sums |= {signal: _gains(terms, known_values) for signal, terms in shown if terms is not None}
    if drawing.inside:
        sums = _named_inside(sums, drawing.inside)
    if drawing.dead_times:
        sums = dead_time.joined(sums, drawing.plants, drawing.inside, PRODUCT, FACTOR)
    inputs = (*drawing.outside, PRODUCT) if out else drawing.outside
    return MultirateLoop(tick, placed, sums, inputs, rate=rate)


def _named_inside(
    sums: dict[str, dict[str, np.ndarray | float]], inside: dict[str, str]
) -> dict[str, dict[str, np.ndarray | float]]:
    """Junctions with the names that the ports of blocks have in plants of several."""
    renamed = {}
    for port, terms in sums.items():
        renamed[inside.get(port, port)] = {
            inside.get(name, name): gain for name, gain in terms.items()
        }
    return renamed


def _blocks(
    drawing: Drawing,
    constants: dict[str, Any],
    rate: np.ndarray | float,
    tick: np.ndarray | float,
) -> tuple[ScheduledBlock, ...]:
    """The blocks, dead times and plants of a drawing, with their numbers."""
    placed = [_placed(block, constants, tick) for block in drawing.alone if not block.dead_time]
    placed += [_dead_time(drawing, name, constants) for name in drawing.dead_times]
    shares = dead_time.shares(drawing, constants, rate)
    placed += [_plant(plant, constants, tick, shares) for plant in drawing.plants]
    return tuple(placed)


def _plant(
    plant: Plant, constants: dict[str, Any], tick: np.ndarray | float, shares: dict[str, Any]
) -> ScheduledBlock:
    """A plant of several blocks, or one that dead times act on, with its numbers."""
    gains = {port: _gains(terms, constants) for port, terms in plant.couplings}
    keys = {block.name: _keys(block, constants) for block in plant.members}
    return ScheduledBlock(plant_of(plant, keys, gains, tick, constants, shares))


def _dead_time(drawing: Drawing, name: str, constants: dict[str, Any]) -> ScheduledBlock:
    """The block of a dead time."""
    sensed: set[str] = set()
    arriving = False
    for plant in drawing.plants:
        sensed.update(signal for signal, delay in plant.sensed if delay == name)
        arriving |= any(delay == name for _, delay in plant.arriving)
    signals = {signal for signal, _ in dict(drawing.wires).get(f"{name}.u", ())}
    has_plain = bool(signals - sensed)
    ticks = constants[f"block.{name}.ticks"]
    block = dead_time.block_of(name, ticks, sensed=bool(sensed), plain=has_plain, arriving=arriving)
    return ScheduledBlock(block)


def rate_of(drawing: Drawing, values: Mapping[str, Any]) -> np.ndarray:
    """Return the rate of the tick (Hz); values: as for `assembled`."""
    with np.errstate(all="ignore"):
        return drawing.tick_hz.values(numbers_of(values))


def _gains(
    terms: tuple[tuple[str, Tree], ...], constants: dict[str, Any]
) -> dict[str, np.ndarray | float]:
    """The gains of terms; constants: numbers by name."""
    return {signal: gain.values(constants) for signal, gain in terms}


def _placed(
    block: DrawnBlock, constants: dict[str, Any], tick: np.ndarray | float
) -> ScheduledBlock:
    """The block with its numbers; one that they do not vary in a batch is remembered."""
    read = {name: constants[name] for name in _read_by(block)}
    if np.ndim(tick) or any(np.ndim(value) or np.iscomplexobj(value) for value in read.values()):
        return _with_numbers(block, constants, tick)
    plain = {name: v if isinstance(v, int) else v.item() for name, v in read.items()}
    return _placed_alone(block, tuple(plain.items()), tick)  # type: ignore[arg-type]  # one number


@lru_cache(maxsize=4096)
def _read_by(block: DrawnBlock) -> tuple[str, ...]:
    return tuple(sorted({name for _, tree in block.trees() for name in tree.names}))


@lru_cache(maxsize=2048, typed=True)
def _placed_alone(
    block: DrawnBlock, read: tuple[tuple[str, float], ...], tick: float
) -> ScheduledBlock:
    constants = {name: v if isinstance(v, int) else numbers(v) for name, v in read}
    return _with_numbers(block, constants, tick)


def _with_numbers(
    block: DrawnBlock, constants: dict[str, Any], tick: np.ndarray | float
) -> ScheduledBlock:
    """The block with its numbers; its period is that between its runs."""
    every = int(block.every.values(constants))
    phase = int(block.phase.values(constants))
    period = every * tick
    if block.phases:
        period = period / len(block.phases)
    core = block.core(ONE)
    if TYPES[block.type].formula:
        keys = _coefficients(block, _keys(block, constants), period)
    else:
        keys = _keys(core, constants)
    if keys.get("discrete") is True:
        trees = dict(core.keys)
        if core.type == "tf":
            keys["rests"] = tuple(
                _rests(trees[name], keys[name], constants) for name in ("num", "den")
            )
        else:
            keys["rests"] = [
                _rests(*row, constants) for row in zip(trees["A"], keys["A"], strict=True)
            ]
    make = getattr(blocks, core.type, None) or partial(blocks.defined, core.type)
    return ScheduledBlock(make(core.name, period, **keys), every, block.phases or phase)


def _coefficients(
    block: DrawnBlock, keys: dict[str, Any], period: np.ndarray | float
) -> dict[str, Any]:
    """The keys of the transfer function that a block with a formula is, from its own keys.

    The sums of its coefficients do not cancel, if those of its keys do not.
    """
    core = dict(block.core(ONE, named=True).keys)
    constants = {**keys, "T": period}
    coefficients = {"discrete": core["discrete"]}
    for name in ("num", "den"):
        coefficients[name] = [tree.evaluate(constants, np) for tree in core[name]]
    return coefficients


def _keys(block: DrawnBlock, constants: dict[str, Any]) -> dict[str, Any]:
    """The keys of a block with their values, by the names that functions of `blocks` have for
    them."""
    shared = SharedParts()
    keys = keys_with(block, lambda tree: tree.values(constants, shared))
    if block.type == "butterworth":
        keys["passes"] = keys.pop("pass")
    if block.type == "ss" and not keys["D"]:
        keys["D"] = [[0.0] * len(keys["inputs"]) for _ in keys["outputs"]]
    return keys


def _rests(
    trees: tuple[Tree, ...], values: list[np.ndarray | float], constants: dict[str, Any]
) -> list[float]:
    """What rounding has taken from the values of trees."""
    return [tree.rest(value, constants) for tree, value in zip(trees, values, strict=True)]


def _take_out(
    drawing: Drawing,
    placed: tuple[ScheduledBlock, ...],
    sums: dict[str, dict[str, np.ndarray | float]],
    by_name: dict[str, Any],
    out: str,
) -> tuple[ScheduledBlock, ...]:
    """Make the product of a number the input PRODUCT: `sums` is changed, and the blocks are
    returned, of which one has another input if the number is the factor of a gain.

    by_name: numbers by name.
    """
    table, _, place = drawing.scalar_place(out).partition(".")
    if table == "wire":
        wire = dict(drawing.wires)[place]
        sums[place] = {PRODUCT: 1.0}
        sums[place] |= {signal: _parts(gain, by_name, out)[0] for signal, gain in wire}
        sums[FACTOR] = _factor(wire, by_name, out)
        return placed
    block = place.rpartition(".")[0]
    keys = dict(next(core.keys for core in drawing.cores if core.name == block))
    sums[f"{block}.{PRODUCT}"] = {PRODUCT: 1.0}
    if "k" in keys:
        constant, slope = _parts(keys["k"], by_name, out)
        sums[FACTOR] = {signal: slope * gain for signal, gain in sums[f"{block}.u"].items()}
        D = [[constant, 1.0]]
        opened = blocks.ss(block, 1.0, [], [], [], D, ("u", PRODUCT), ("y",), discrete=True)
    else:
        constants, slopes = zip(*(_parts(tree, by_name, out) for tree in keys["num"]), strict=True)
        den = [tree.values(by_name) for tree in keys["den"]]
        by_itself = blocks.tf(block, 1.0, list(constants), den, keys["discrete"])
        multiplied = blocks.tf(block, 1.0, list(slopes), den, keys["discrete"])
        sums[FACTOR] = {f"{block}.factor": 1.0}
        opened = _opened(by_itself, multiplied)
    remaining = []
    for scheduled in placed:
        is_opened = scheduled.block.name == block
        remaining.append(replace(scheduled, block=opened) if is_opened else scheduled)
    return tuple(remaining)


def _opened(constant: Block, slope: Block) -> Block:
    """A transfer function with the product as an input too, and what the number multiplies as
    the output `factor`.

    Both parts of the numerator are over the same denominator, so in controllable form they differ
    in C and D alone:

        x+ - x = E x + B u,   y = C x + D u + product,   factor = c x + d u
    """
    matrices = _with_product(constant.E, constant.B, constant.C, constant.D, slope.C, slope.D)
    terms = constant.terms and _with_product(*constant.terms, *slope.terms[2:])
    return replace(
        constant,
        inputs=("u", PRODUCT),
        outputs=("y", "factor"),
        **matrices._asdict(),
        terms=terms,
        at_rest=None,
    )


def _with_product(
    E: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, c: np.ndarray, d: np.ndarray
) -> StateSpace:
    """The matrices of `_opened`, or the sizes of their terms."""
    row = np.concatenate(np.broadcast_arrays(D, np.ones_like(D)), -1)
    row_of_factor = np.concatenate(np.broadcast_arrays(d, np.zeros_like(D)), -1)
    both_C = np.concatenate(np.broadcast_arrays(C, c), -2)
    both_D = np.concatenate(np.broadcast_arrays(row, row_of_factor), -2)
    return StateSpace(E, np.concatenate([B, np.zeros_like(B)], -1), both_C, both_D)


def _factor(
    terms: tuple[tuple[str, Tree], ...], constants: dict[str, Any], out: str
) -> dict[str, np.ndarray | float]:
    """The signals that a number of a wire multiplies, with their factors."""
    slopes = {signal: _parts(gain, constants, out)[1] for signal, gain in terms}
    return {signal: slope for signal, slope in slopes.items() if np.any(slope)}


def _parts(
    gain: Tree, constants: dict[str, Any], out: str
) -> tuple[np.ndarray | float, np.ndarray | float]:
    """The constant part g(0) of a gain that is linear in a number, and the factor of the number,
    g(1) - g(0)."""
    constant = gain.with_number(out, 0.0)
    total = gain.with_number(out, 1.0)
    return constant.values(constants), (total - constant).values(constants)


def twins(
    drawing: Drawing, values: Mapping[str, Any], out: str = "", beside: str = ""
) -> tuple[MultirateLoop, MultirateLoop]:
    """Return two loops of a batch, in which drift is searched for, or one loop twice if no number
    varies.

    values: flat numbers, with arrays of those that vary, and that are between the values of these
    in the two loops. out, beside: numbers to take out, see `assembled`.
    """
    first, second = (
        tuple((path, _between(path, value, salt)) for path, value in values.items())
        for salt in SALTS
    )
    return _twins(drawing, first, second, out, beside)


def _between(path: str, value: np.ndarray | float, salt: str) -> float:
    """A value in the middle half of those of a number; see `scattered`."""
    if not isinstance(value, np.ndarray):
        return value
    low = float(np.min(value.real))
    high = float(np.max(value.real))
    return low + (high - low) * (0.25 + 0.5 * scattered(path, salt)) if low < high else low


SALTS = "ab"  # of the two loops


def scattered(path: str, salt: str) -> float:
    """Return a number from 0 to 1 for a path, another one for other paths and salts, always the
    same."""
    return crc32((salt + path).encode()) / 2**32


@lru_cache(maxsize=256)
def _twins(
    drawing: Drawing,
    first_numbers: tuple[tuple[str, float], ...],
    second_numbers: tuple[tuple[str, float], ...],
    out: str,
    beside: str,
) -> tuple[MultirateLoop, MultirateLoop]:
    """The loops of a drawing with two sets of numbers, paths and values; one loop twice if these are
    equal. What is exact in them holds for all values of the numbers that differ. out, beside: see
    `assembled`."""
    varied = set()
    for (path, value), (_, twin) in zip(first_numbers, second_numbers, strict=True):
        if value != twin:
            varied.add(name_of(path))

    def built(items: tuple[tuple[str, float], ...]) -> MultirateLoop:
        values = dict(items)
        exact = partial(equations_of, drawing, values, frozenset(varied), out)
        return replace(assembled(drawing, values, out, beside), exact=exact)

    first = built(first_numbers)
    return first, built(second_numbers) if varied else first


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

    @staticmethod
    def of_hand(drawing: Drawing) -> Ports:
        """The port of a hand that the drawing has."""
        force, _, reaction = drawing.hand  # type: ignore[misc]  # it has one
        return Ports(force, POSITION, REACTION if reaction is not None else "")

    @staticmethod
    def of_axes(drawing: Drawing) -> Ports:
        """The port of a hand with all its axes, without reactions."""
        further = tuple((force, OUTPUT + name) for name, force, _ in drawing.further)
        force, *_ = drawing.hand  # type: ignore[misc]  # it has one
        return Ports(force, POSITION, others=further)

    @property
    def forces(self) -> list[str]:
        """The inputs of the ports."""
        return [self.force, *(force for force, _ in self.others)]

    @property
    def signals(self) -> tuple[str, ...]:
        """The outputs of the ports."""
        positions = (self.position, *(position for _, position in self.others))
        return (*positions, self.reaction) if self.reaction else positions
