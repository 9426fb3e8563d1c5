"""Loops that are broken at a signal, an output of a block."""

import re
from collections.abc import Sequence

import numpy as np

from wavesweep.engine.drawing.drawing import path_of
from wavesweep.engine.drawing.gain_at_signal import BLOCK, GAIN, with_gain
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys.checking import nearest
from wavesweep.engine.loop import Loops
from wavesweep.engine.loops.from_drawing import FACTOR, PRODUCT
from wavesweep.engine.monodromy.open_ticks import OpenTicks
from wavesweep.engine.search.lines_of_loops import lines_in_loops
from wavesweep.engine.search.open_loops import open_loops
from wavesweep.margins.lifted_margins import LiftedLoop
from wavesweep.margins.loop_margins import BESIDE, MOST, BrokenLoop, Margin
from wavesweep.program.spec import Spec, load
from wavesweep.program.sweep.grid import own_loop

MOST_TIMES = 200  # samples in a frame, whose return ratio is a matrix of that size


def broken_at(spec: Spec, signal: str) -> BrokenLoop | LiftedLoop:
    """Break the spec's own loop at a signal, "block.port" or a name in [signals].

    Errors: UsageError for a signal at which that is not possible.
    """
    named = spec.tables().get("signals", {})
    spec, signal = with_block(spec, signal)
    loop = own_loop(spec)
    times = _times_per_frame(loop)
    if signal not in times:
        shown = [re.sub(r"\.tap(\d+)\.y$", r".y\1", name) for name in times]  # of a delay with taps, as wires read it
        hint = nearest(signal, [*shown, *named])
        raise UsageError(
            f"cut: expected an output of a block that some wire reads ({', '.join(shown) or 'this loop has none'}), found "
            f"{signal!r}" + (f"; did you mean `{hint}`?" if hint else "")
        )
    if times[signal] > MOST_TIMES:
        raise UsageError(
            f"cut: expected a signal that is made at most {MOST_TIMES} times in a frame, found {signal!r}: {times[signal]} "
            "times; a number that multiplies it has its gain margin: wavesweep stability-region along that"
        )
    loop = _with_gain(loop, signal)
    with np.errstate(all="ignore"):
        drawn = loop.drawn()
        ticks = OpenTicks.of(loop.drawn(GAIN), drawn, PRODUCT, FACTOR)
    drift = loop.changed({path_of(GAIN): np.array([0.5, 2.0])}).drift()
    break_block = next(placed_block for placed_block in drawn.placed if placed_block.block.name == BLOCK)
    places = np.flatnonzero(break_block.runs(drawn.ticks)) / drawn.ticks
    lifted = LiftedLoop(ticks, drift, float(drawn.period) * drawn.ticks, places)
    if not lifted.returns:
        raise UsageError(f"cut: expected a signal of a loop, found {signal!r}, which does not come back to itself")
    opened = open_loops(loop, GAIN) if times[signal] == 1 else None
    return lifted if opened is None or opened.cut is None else BrokenLoop(opened.cut, lifted)


def _with_gain(loop: Loops, signal: str) -> Loops:
    return Loops(with_gain(loop.drawing, signal), loop.values | {path_of(GAIN): 1.0})


def lines_at(spec: Spec, signal: str, broken: BrokenLoop | LiftedLoop, margins: Sequence[Margin]) -> np.ndarray:
    """The strongest line (Hz) of the oscillation at each margin, `(margins,)`, NaN if it has no frequency.

    It is that of the loop with the factor that puts an eigenvalue on the circle at the frequency of the margin: its gain, or
    -1/L: of the eigenvalues of a lifted L the one that meets the phase, or has the largest |1 - L|/|1 + L| (disk), |1/(1 + L)|
    (sensitivity) or |L/(1 + L)|. No factor does so for an L of 0, as a lifted one has whose samples are not all read; if there
    is no other, it is the frequency itself.
    """
    lines, at, factors = np.array([margin.omega for margin in margins]) / (2 * np.pi), [], []
    for i, margin in enumerate(margins):
        if not np.isfinite(margin.omega):
            continue
        L, turn = np.ravel(broken.response(max(margin.omega * broken.period, BESIDE))), np.exp(1j * np.radians(margin.value))
        L = L[abs(L) > 1 / MOST]
        if margin.name.startswith("gain"):
            factor = margin.value
        elif len(L):
            with np.errstate(divide="ignore"):
                far = {
                    "phase": np.minimum(abs(1 + turn * L), abs(1 + turn.conj() * L)),
                    "sensitivity": abs(1 + L),
                    "complementary": abs(1 + L) / abs(L),
                }.get(margin.name, abs(1 + L) / abs(1 - L))
            factor = -1 / L[np.argmin(far)]
        else:
            continue
        at.append(i)
        factors.append(factor)
    if not at:
        return lines
    spec, signal = with_block(spec, signal)
    loop = _with_gain(own_loop(spec), signal)
    omega = np.array([margins[i].omega for i in at])
    lines[at] = lines_in_loops(loop.changed({path_of(GAIN): np.array(factors)}), 1j * omega[:, None] * broken.period)[:, 0]
    return lines


def with_block(spec: Spec, signal: str) -> tuple[Spec, str]:
    """The spec with a name in [signals] as the output of a block, and that output; another signal as it is.

    The block is a gain of 1, which runs when the only block that reads it does, else in every tick.
    """
    tables = spec.tables()
    named, block = tables.get("signals", {}), f"cut_at_{signal}"
    if signal not in named:
        return spec, signal
    tables["wire"] |= {f"{block}.u": named[signal]}
    named[signal], tables["block"][block] = f"{block}.y", {"type": "gain"}
    wires = load(tables).drawing.wires
    readers = {port.rpartition(".")[0] for port, terms in wires if f"{block}.y" in dict(terms)}
    block_keys = tables["block"].get(readers.pop(), {}) if len(readers) == 1 else {}
    tables["block"][block] |= {key: block_keys[key] for key in ("every", "phase") if key in block_keys}
    return load(tables), f"{block}.y"


def cuts_of(spec: Spec) -> list[str]:
    """The signals at which the spec's own loop can be broken, first those of controllers that a plant reads and rare ones."""
    loop = own_loop(spec)
    plants = {block.name for block in loop.drawing.blocks if block.plant}
    joined = [*loop.drawing.wires, *loop.drawing.couplings]
    pairs = {(port.rpartition(".")[0], name.rpartition(".")[0]) for port, terms in joined for name, _ in terms}
    for block in loop.drawing.blocks:  # what depends on what, by S. Warshall's method
        pairs |= {(reader, source) for reader, a in pairs if a == block.name for b, source in pairs if b == block.name}
    late = {name for plant in loop.drawing.plants for _, name in plant.arriving}
    acting = {name for port, terms in loop.drawing.wires if port.rpartition(".")[0] in plants | late for name, _ in terms}
    times_of = {
        name: times
        for name, times in _times_per_frame(loop).items()
        if times <= MOST_TIMES
        if (name.rpartition(".")[0],) * 2 in pairs
    }
    return sorted(times_of, key=lambda name: (name.rpartition(".")[0] in plants, name not in acting, times_of[name]))


def _times_per_frame(loop: Loops) -> dict[str, int]:
    """How often each output that a wire reads is made in a frame.

    Those that dead times bring to plants, or read of them, between two ticks are left out: a gain there would be in the tick.
    """
    drawn, plants, read = loop.drawn(), loop.drawing.plants, {name for _, terms in loop.drawing.wires for name, _ in terms}
    read -= {name for plant in plants for name, _ in plant.sensed}
    read -= {f"{name}.y" for plant in plants for _, name in plant.arriving}
    runs = [(placed_block.block, int(placed_block.runs(drawn.ticks).sum())) for placed_block in drawn.placed]
    times_of = {name: count for block, count in runs for port in block.outputs if (name := f"{block.name}.{port}") in read}
    of_plants = [name for plant in plants for name in plant.drawn_ports[1] if name in read]
    return times_of | dict.fromkeys(of_plants, drawn.ticks)
