"""Passivity of the wave channel and of the hand's port over axes."""

from collections.abc import Iterator
from functools import partial
from itertools import islice
from operator import attrgetter

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.haptics.held_loop import device_of, held_loop
from wavesweep.passive.channel import channel_norm, channel_of, numbers_of_channel
from wavesweep.passive.margin import LONGEST_MAP, more_damping, port_margin
from wavesweep.program.analyses.spec_loops import port_at_hand
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import (
    Grid,
    loops_of,
    make_grid,
    own_loop,
    refuse_rows,
)
from wavesweep.program.sweep.job import Chunks, Job, JobKind
from wavesweep.program.sweep.running import Run, gather, stretches

# the keys that the channel depends on; all others are outside its ports
CHANNEL_KEYS = ("rates.", "filters.")
PORT = np.dtype([
    ("slice", "<i4"), ("port_margin", "<f8"), ("port_omega", "<f8"), ("port_passive", "?"), ("certified", "?"),
    ("stable", "?"), ("damping_needed", "<f8"),
])  # fmt: skip
PAIR = np.dtype([
    *PORT.descr, ("ports_margin", "<f8"), ("ports_omega", "<f8"), ("absolutely_stable", "?"), ("ports_certified", "?"),
    ("counterexample", "<U160"),
])  # fmt: skip
CHANNEL = np.dtype([
    ("slice", "<i4"), ("channel_norm", "<f8"), ("channel_omega", "<f8"), ("channel_passive", "?"), ("certified", "?"),
])  # fmt: skip


def jobs_of(spec: Spec, axes) -> dict[str, Job]:
    """The jobs of the port and, if the loop has a wave channel, of the channel. Raises UsageError
    if they cannot be done.

    The different channels of the grid have no rows of their own.
    """
    grid = make_grid(spec, axes, apart=False, rates=False)
    refuse_rows("passivity", grid.size)
    grid.resolve_all()
    pair = spec.drawing and spec.drawing.environment
    port = Job(
        PORTS,
        grid,
        Chunks(grid.loops, 1, 32, 1),  # loops in a chunk: up to a second or two
        PAIR if pair else PORT,
        {"records": "ports"},
    )
    if spec.drawing:
        port_at_hand(spec)
    _refuse_long_frames(spec, grid)
    if not sends_waves(spec):
        return {"port": port}
    inside = channels_of(grid)
    inside.resolve_all()
    # Channels in a chunk, each of which takes about a millisecond.
    chunks = Chunks(inside.loops, 1, 256, 1)
    return {
        "channel": Job(WAVES, inside, chunks, CHANNEL, {"records": "channels"}),
        "port": port,
    }


def _refuse_long_frames(spec: Spec, grid: Grid) -> None:
    """UsageError if a loop of the grid has a frame, or a channel, that is too long."""
    names = {axis.path: axis.name for axis in grid.loop_axes}
    # Combinations of the values that decide how a loop is built, whose frames are seen before the
    # work.
    for key, values in islice(grid.resolved.items(), 200):
        loops = loops_of(spec, values)
        ticks = loops.drawn().ticks
        if ticks > LONGEST_MAP:
            at = ", ".join(f"{names[path]} = {value:g}" for path, value in key)
            at = at and f" for {at}; leave out these values"
            raise UsageError(
                f"expected a frame of at most {LONGEST_MAP} ticks for passivity, found {ticks}{at}"
            )
        # Ticks of a frame, from which on a channel may be too large.
        if ticks > 100 and (channel := channel_of(*loops)):
            channel.refuse_large()


def _task(of_loops, job, chunk):
    """What computes the records of a chunk; of_loops: gives the fields for loops of one drawing."""
    return partial(_records, of_loops, job.grid.drawn(numbers=chunk.loops), job.dtype)


def _records(of_loops, parts, dtype):
    """A record per loop; parts: (members, loops), see `drawn_groups`, whose members number all
    loops from 0."""
    records = np.empty(sum(members.size for members, _ in parts), dtype)
    records["slice"] = np.arange(records.size)
    for members, loops in parts:
        for name, column in zip(dtype.names[1:], of_loops(loops), strict=True):
            records[name][members] = column
    return records


def _port(loops):
    loops.refuse_unsuitable()
    loop = held_loop(loops)
    with loop.drawn().naming_blocks():
        margin = port_margin(loop)
        columns = (
            margin.margin,
            margin.omega,
            margin.passive,
            margin.certified,
            margin.stable,
            more_damping(loop, margin),
        )
        if not loop.drawing.environment:
            return columns
        from wavesweep.passive.port_rows import pair_margin

        pairs = [pair_margin(loop.at(at)) for at in range(margin.margin.size)]
        return *columns, *(
            np.array(column).reshape(loop.batch) for column in zip(*pairs, strict=True)
        )


def _channel(loops):
    return attrgetter("norm", "omega", "passive", "certified")(channel_norm(*loops))


# Bytes of a row: measured, 110 in the CSV and 60 in the Parquet file.
# Seconds that workers take longer than those of `intervals` to be ready and to load SciPy.
PORTS = JobKind(partial(_task, _port), noun="loops", row_bytes=170, ready=1.5)
WAVES = JobKind(partial(_task, _channel), noun="channels", certifies=False, has_rows=False)


def blocks(run: Run) -> Iterator[tuple[dict[str, np.ndarray], dict[str, np.ndarray]]]:
    """Yield the axes and the fields of the records of a run, in blocks of rows."""
    grid = run.jobs["port"].grid
    for combination in stretches(grid.size):
        slices = grid.slice_of(combination)
        _, port = gather(run.jobs["port"], run.stores["port"], slices)
        yield (
            grid.axis_columns(combination),
            {name: port[name] for name in port.dtype.names} | channel_columns(run, slices),
        )


def curves(spec: Spec, axes) -> Iterator[dict[str, np.ndarray]]:
    """Yield the columns of the response of each combination with two ports over frequency; see
    `port_rows.curve`."""
    from wavesweep.passive.port_rows import curve

    grid = make_grid(spec, axes, rates=False)
    of_loop = {}
    for members, loops in grid.drawn(numbers=range(grid.loops)):
        held = held_loop(loops)
        for at, member in enumerate(members.tolist()):
            of_loop[member] = curve(held.at(at))
    for combination in range(grid.size):
        columns = of_loop[int(grid.slice_of(combination))]
        axis = grid.axis_columns(np.array([combination]))
        yield {
            name: np.repeat(value, len(columns["frequency_hz"])) for name, value in axis.items()
        } | columns


def channel_columns(run: Run, slices) -> dict[str, np.ndarray]:
    """The columns of the channel of each slice, and `certified`."""
    if "channel" not in run.jobs:
        missing, true = (
            np.full(slices.size, np.nan),
            np.ones(slices.size, bool),
        )  # what is not there adds no energy
        return {
            "channel_norm": missing,
            "channel_omega": missing,
            "channel_passive": true,
            "certified": true,
        }
    job, axes = run.jobs["channel"], run.jobs["port"].grid.loop_axes
    shape, loop = tuple(len(axis.values) for axis in axes), np.zeros(slices.size, int)
    if shape:
        digits = dict(zip(axes, np.unravel_index(slices, shape), strict=True))
    else:
        digits = {}
    for axis in job.grid.loop_axes:  # which are some of those of the port
        loop = loop * len(axis.values) + digits[axis]
    _, records = gather(job, run.stores["channel"], loop)
    return {name: records[name] for name in CHANNEL.names if name != "slice"}


def sends_waves(spec) -> bool:
    """Whether the loop of a spec has waves."""
    return own_loop(spec).drawing.has_waves


def certified_slices(run: Run) -> int:
    """Number of slices whose port and whose channel are both certified."""
    count = 0
    for slices in stretches(run.jobs["port"].slices):
        _, port = gather(run.jobs["port"], run.stores["port"], slices)
        count += int((port["certified"] & channel_columns(run, slices)["certified"]).sum())
    return count


def channels_of(grid: Grid) -> Grid:
    """The part of the grid that the wave channel reads: its loops are the different channels."""
    drawn = grid.spec.drawing and numbers_of_channel(grid.spec.drawing)
    read = [
        axis.path in drawn if drawn is not None else axis.path.startswith(CHANNEL_KEYS)
        for axis in grid.loop_axes
    ]
    return make_grid(
        grid.spec,
        tuple(axis for axis, is_read in zip(grid.loop_axes, read, strict=True) if is_read),
        apart=False,
        rates=False,
    )


def not_computed(grid: Grid) -> list[str]:
    """A sentence about each column that the loops do not have."""
    if device_of(own_loop(grid.spec).drawing):
        return []
    return ["not computed for a hand that holds no single mass: damping_needed unless it is 0"]
