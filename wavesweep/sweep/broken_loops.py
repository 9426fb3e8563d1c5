"""Loops that are broken at a signal: an output of a block that runs once per frame."""

from dataclasses import replace

from wavesweep.errors import UsageError
from wavesweep.loops.from_drawing import assembled
from wavesweep.passive import BrokenLoop
from wavesweep.spec import Spec
from wavesweep.spec.checking import nearest
from wavesweep.spec.drawing import Drawing, DrawnBlock, path_of
from wavesweep.sweep.grid import own_loop
from wavesweep.sweep.open_loops import open_loops

BLOCK, GAIN = "the cut", "gain of the cut"  # no block and no number of a spec can be called so


def broken_at(spec: Spec, signal: str) -> BrokenLoop:
    """Break the spec's own loop at a signal, "block.port". Errors: UsageError for a signal at which that is not possible."""
    drawing, values = own_loop(spec)
    times = _times_per_frame(drawing, values)
    if times.get(signal) != 1:
        once = [name for name, count in times.items() if count == 1]
        hint = nearest(signal, once) if signal not in times else ""
        found = f"{times[signal]} times in a frame" if signal in times else "an output of no block, or one that no wire reads"
        raise UsageError(
            f"cut: expected a signal that is made once per frame, so that one gain breaks the loop "
            f"({', '.join(once) or 'this loop has none'}), found {signal!r}: {found}"
            + (f"; did you mean `{hint}`?" if hint else "")
            + (_way_out(times, signal) if signal in times else "")
        )
    found = open_loops(_with_gain(drawing, signal), values | {path_of(GAIN): 1.0}, GAIN)
    if found is None or found.cut is None:
        raise UsageError(
            f"cut: expected a signal of a loop that one gain breaks, found {signal!r}: it does not come back to itself, or "
            "through no state, or what drifts in the loop is read beside it as well"
        )
    return BrokenLoop(found.cut)


def _way_out(times: dict[str, int], signal: str) -> str:
    """What to do about a signal that is made several times in a frame."""
    slower = sorted({name.rpartition(".")[0] for name, count in times.items() if count < times[signal]})
    without = f"; in a spec without the slower blocks ({', '.join(slower)}) it is made once per frame" if slower else ""
    return f". A number that multiplies it has its gain margin: wavesweep stability-region along that{without}"


def _times_per_frame(drawing: Drawing, values) -> dict[str, int]:
    """How often each output that a wire reads is made in a frame."""
    drawn = assembled(drawing, values)
    read = {source for _, terms in drawing.wires for source, _ in terms}
    runs = [(each.block, int(each.runs(drawn.ticks).sum())) for each in drawn.placed]
    return {name: count for block, count in runs for port in block.outputs if (name := f"{block.name}.{port}") in read}


def _with_gain(drawing: Drawing, signal: str) -> Drawing:
    """The drawing with a gain behind a signal, which runs when its block does; all wires read the signal behind it."""
    source = next(block for block in drawing.blocks if block.name == signal.rpartition(".")[0])
    gain = DrawnBlock(BLOCK, "gain", (("k", ("name", GAIN, 0)),), source.every, source.phase, source.phases)
    behind = {signal: f"{BLOCK}.y"}
    wires = tuple((port, tuple((behind.get(name, name), factor) for name, factor in terms)) for port, terms in drawing.wires)
    wires += ((f"{BLOCK}.u", ((signal, ("number", 1.0, 0)),)),)
    return replace(drawing, blocks=(*drawing.blocks, gain), wires=wires)
