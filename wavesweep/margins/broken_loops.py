"""Loops that are broken at a signal, an output of a block."""

import re
from collections.abc import Collection, Sequence
from contextlib import suppress
from itertools import product

import numpy as np

from wavesweep.engine.blocks import FACTOR, PRODUCT
from wavesweep.engine.drawing import BLOCK, GAIN, Drawing, path_of
from wavesweep.engine.errors import IllPosedLoopError, UsageError, WavesweepError
from wavesweep.engine.frames import OpenTicks, open_loops
from wavesweep.engine.keys import nearest
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import lines_in_loops
from wavesweep.margins.lifted_margins import LiftedLoop
from wavesweep.margins.loop_margins import BESIDE_ZERO, LARGEST_GAIN_FACTOR, Margin
from wavesweep.program.analyses.cuts import signals_at_ticks
from wavesweep.program.spec import Spec, load
from wavesweep.program.sweep.grid import own_loop

MOST_TIMES = 200  # samples in a frame, whose return ratio is a matrix of that size


def broken_at(spec: Spec, signal: str) -> LiftedLoop:
    """Break the spec's own loop at a signal, "block.port" or a name in [signals].

    Errors: UsageError for a signal at which that is not possible.
    """
    named = spec.tables().get("signals", {})
    spec, signal = with_block(spec, signal)
    return broken_in(own_loop(spec), signal, named)


def broken_in(loop: Loops, signal: str, named: Collection[str] = ()) -> LiftedLoop:
    """Break a loop, or a batch of the same frame, at the output of a block; named: names of signals
    that may have been meant. Errors: see `broken_at`."""
    times = _times_per_frame(loop)
    if signal not in times:
        # Of a delay with taps, as wires read it.
        shown = [re.sub(r"\.tap(\d+)\.y$", r".y\1", name) for name in times]
        close = nearest(signal, [*shown, *named])
        hint = f"; did you mean `{close}`?" if close else ""
        expected = f"an output of a block that some wire reads at a tick ({', '.join(shown) or 'this loop has none'})"
        raise UsageError(f"cut: expected {expected}, found {signal!r}{hint}")
    if times[signal] > MOST_TIMES:
        raise UsageError(
            f"cut: expected a signal that is made at most {MOST_TIMES} times in a frame, found {signal!r}: {times[signal]} "
            "times; a number that multiplies it has its gain margin: wavesweep stability-region along that"
        )
    loop = loop.with_gain_at(signal)
    with np.errstate(all="ignore"):
        drawn = loop.drawn()
        ticks = OpenTicks.of(loop.drawn(GAIN), drawn, PRODUCT, FACTOR)
    drift = loop.changed({path_of(GAIN): np.array([0.5, 2.0])}).drift()
    (gain,) = (placed for placed in drawn.placed if placed.block.name == BLOCK)
    places = np.flatnonzero(gain.runs(drawn.ticks)) / drawn.ticks
    once = open_loops(loop, GAIN) if times[signal] == 1 and not loop.batch else None
    broken = LiftedLoop(
        loop, ticks, drift, float(drawn.period) * drawn.ticks, places, once and once.cut
    )
    if not broken.returns:
        raise UsageError(
            f"cut: expected a signal of a loop, found {signal!r}, which does not come back to itself"
        )
    return broken


def lines_at(broken: LiftedLoop, margins: Sequence[Margin]) -> np.ndarray:
    """The strongest line (Hz) of the oscillation at each margin, `(margins,)`, NaN if it has no
    frequency.

    It is that of the loop with the factor that puts an eigenvalue on the circle at the frequency of
    the margin: its gain, or -1/L: of the eigenvalues of a lifted L the one that meets the phase, or
    has the largest |1 - L|/|1 + L| (disk), |1/(1 + L)| (sensitivity) or |L/(1 + L)|. No factor does
    so for an L of 0, as a lifted one has whose samples are not all read; if there is no other, it
    is the frequency itself.
    """
    lines = np.array([margin.omega for margin in margins]) / (2 * np.pi)
    for number, margin in enumerate(margins):
        factor = factor_at(margin.name, margin.value, margin.omega, broken)
        if factor is None:
            continue
        loop = broken.loop.changed({path_of(GAIN): np.array([factor])})
        with suppress(IllPosedLoopError):  # with direct terms that end there
            s = np.array([[1j * margin.omega * broken.period]])
            lines[number] = lines_in_loops(loop, s)[0, 0]
    return lines


def factor_at(name: str, value: float, omega: float, broken: LiftedLoop) -> complex | None:
    """The factor of the signal that puts an eigenvalue on the circle at a margin, None if none
    does; see `lines_at`."""
    if not np.isfinite(omega):
        return None
    if name.startswith("gain"):
        return value
    L = np.ravel(broken.response(max(omega * broken.period, BESIDE_ZERO)))
    L = L[abs(L) > 1 / LARGEST_GAIN_FACTOR]
    if not len(L):
        return None
    with np.errstate(divide="ignore"):
        match name:
            case "phase":
                turn = np.exp(1j * np.radians(value))
                distance = np.minimum(abs(1 + turn * L), abs(1 + turn.conj() * L))
            case "sensitivity":
                distance = abs(1 + L)
            case "complementary":
                distance = abs(1 + L) / abs(L)
            case _:
                distance = abs(1 + L) / abs(1 - L)
    return complex(-1 / L[np.argmin(distance)])


def with_block(spec: Spec, signal: str) -> tuple[Spec, str]:
    """The spec with a name in [signals] as the output of a block, and that output; another signal
    as it is.

    The block is a gain of 1. It runs when all do that the name reads, which hold between their runs,
    or else when all that read it do.
    """
    tables = spec.tables()
    named = tables.get("signals", {})
    if signal not in named:
        return spec, signal
    block = f"cut_at_{signal}"
    output = f"{block}.y"
    gain = {"type": "gain"}
    tables["wire"][f"{block}.u"] = named[signal]
    tables["block"][block] = gain
    named[signal] = output
    wires = load(tables).drawing.wires
    sources = {_block_of(name) for name, _ in dict(wires)[f"{block}.u"]}
    readers = {_block_of(port) for port, terms in wires if output in dict(terms)}
    in_each_tick = (1, 0)
    clocks = {}
    for name, keys in tables["block"].items():
        if keys["type"] != "impulse":  # which is 0 between its runs
            clocks[name] = (keys.get("every", 1), keys.get("phase", 0))
    for blocks in (readers, sources):
        clocks_of_blocks = {clocks.get(name, in_each_tick) for name in blocks}
        if len(clocks_of_blocks) == 1 and clocks_of_blocks != {in_each_tick}:
            gain["every"], gain["phase"] = clocks_of_blocks.pop()
    return load(tables), output


def _block_of(port: str) -> str:
    """The block of an input or output such as "pid.u"."""
    return port.rpartition(".")[0]


def asked_cuts(spec: Spec) -> list[str]:
    """The signals at which the spec asks for margins, in [sweep] require and then in wishes."""
    cuts = []
    if required := spec.asked.get("require"):
        cuts += [margins["cut"] for margins in required.cuts]
    if design := spec.asked.get("design"):
        cuts += [wish.options["cut"] for wish in design.wishes if "cut" in wish.options]
    return [*dict.fromkeys(cuts)]


def default_cut(spec: Spec) -> str:
    """The first of `asked_cuts`, or else of `cuts_of` that comes back to itself. Empty without
    one."""
    cuts = asked_cuts(spec)
    if cuts:
        return cuts[0]
    return next((cut for cut in cuts_of(spec) if returns(spec, cut)), "")


def returns(spec: Spec, cut: str) -> bool:
    """Whether the loop can be broken at a signal, and that comes back to itself."""
    try:
        broken_at(spec, cut)
    except WavesweepError:
        return False
    return True


def _readings(drawing: Drawing) -> set[tuple[str, str]]:
    """Pairs of blocks of which the first one reads the second one, also through others: by S.
    Warshall's method."""
    reads = set()
    for port, terms in (*drawing.wires, *drawing.couplings):
        reads |= {(_block_of(port), _block_of(name)) for name, _ in terms}
    for block in drawing.blocks:
        readers = [reader for reader, source in reads if source == block.name]
        sources = [source for reader, source in reads if reader == block.name]
        reads |= set(product(readers, sources))
    return reads


def cuts_of(spec: Spec) -> list[str]:
    """The signals at which the spec's own loop can be broken.

    First what channels show if there are several, as there and back of a network, since all that crosses it is cut
    there; then those of controllers that a plant reads, and rare ones.
    """
    loop = own_loop(spec)
    drawing = loop.drawing
    reads = _readings(drawing)
    plants = {block.name for block in drawing.blocks if block.plant}
    arriving = {name for plant in drawing.plants for _, name in plant.arriving}
    acting = set()  # signals that plants read
    for port, terms in drawing.wires:
        if _block_of(port) in plants | arriving:
            acting |= {name for name, _ in terms}
    times = {}
    for name, often in _times_per_frame(loop).items():
        if often <= MOST_TIMES and (_block_of(name), _block_of(name)) in reads:
            times[name] = often
    channels = {channel.name for channel in spec.drawing.channels} if spec.drawing else set()
    if len(channels) == 1:
        channels = set()

    def rank(name: str) -> tuple[bool, bool, bool, int]:
        block = _block_of(name)
        return block in plants, block not in channels, name not in acting, times[name]

    return sorted(times, key=rank)


def _times_per_frame(loop: Loops) -> dict[str, int]:
    """How often each output that a wire reads at a tick is made in a frame."""
    drawn = loop.drawn()
    read = signals_at_ticks(loop.drawing)
    times = {}
    for placed in drawn.placed:
        often = int(placed.runs(drawn.ticks).sum())
        for port in placed.block.outputs:
            name = f"{placed.block.name}.{port}"
            if name in read:
                times[name] = often
    for plant in loop.drawing.plants:
        _, outputs = plant.drawn_ports
        for name in outputs:
            if name in read:
                times[name] = drawn.ticks
    return times
