"""The jobs of passivity of the wave channel and of the hand's port over axes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import ClassVar

import numpy as np

from wavesweep.analyses.loops import held_loop, named_loops, ports_of
from wavesweep.errors import UsageError
from wavesweep.loops.from_drawing import assembled, refuse_unsuitable
from wavesweep.passive import (
    channel_norm,
    has_waves,
    more_damping,
    port_margin,
)
from wavesweep.passive.channel import numbers_of_channel
from wavesweep.passive.held_loop import device_of
from wavesweep.passive.margin import LONGEST
from wavesweep.spec import Spec
from wavesweep.spec.drawing import Drawing
from wavesweep.sweep.grid import Grid, drawing_for, drawn_groups, make_grid, refuse_rows
from wavesweep.sweep.job import Chunk, Chunks, Job, resolve_all
from wavesweep.sweep.running import Run, gather, stretches

CHUNK = 32  # loops in a chunk: up to a second or two
CHANNELS = 256  # channels in a chunk, each of which takes about a millisecond
MOST_TRIED = 200  # combinations of the values that decide how a loop is built, whose frames are seen before the work
READY = 1.5  # s that workers take longer than those of `intervals` to be ready and to load SciPy
CHANNEL_KEYS = ("rates.", "filters.")  # the keys that the channel depends on; all others are outside its ports


def jobs_of(spec: Spec, axes) -> dict[str, Job]:
    """The jobs of the port and, if the loop has a wave channel, of the channel. Raises UsageError if they cannot be done."""
    grid = make_grid(spec, axes, apart=False)
    refuse_rows("passivity", grid.size)
    resolved = resolve_all(grid)
    port = PortJob(grid, Chunks(grid.loops, 1, CHUNK, 1), resolved)
    if spec.drawing:
        ports_of(spec, spec.drawing)
    _refuse_long(grid, resolved)
    if not sends_waves(spec):
        return {"port": port}
    inside = channels_of(grid)
    return {"channel": ChannelJob(inside, Chunks(inside.loops, 1, CHANNELS, 1), resolve_all(inside)), "port": port}


def _refuse_long(grid, resolved):
    """Raise UsageError for frames that are too long, named by the values of the axes that make them so."""
    names = {axis.path: axis.name for axis in grid.loop_axes}
    for key, values in islice(resolved.items(), MOST_TRIED):
        ticks = assembled(drawing_for(grid.spec, values), values).ticks
        if ticks > LONGEST:
            at = ", ".join(f"{names[path]} = {value:g}" for path, value in key)
            at = at and f" for {at}; leave out these values"
            raise UsageError(f"expected a frame of at most {LONGEST} ticks for passivity, found {ticks}{at}")


PORT = np.dtype([
    ("slice", "<i4"), ("port_margin", "<f8"), ("port_omega", "<f8"), ("port_passive", "?"), ("certified", "?"),
    ("stable", "?"), ("damping_needed", "<f8"),
])  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class PortJob(Job):
    """The hand's port of every slice of the grid, a loop with its wall."""

    noun: ClassVar[str] = "loops"
    dtype: ClassVar[np.dtype] = PORT
    row_bytes: ClassVar[int] = 170  # measured: 110 in the CSV and 60 in the Parquet file
    ready: ClassVar[float] = READY

    @property
    def identity(self) -> dict[str, object]:
        """The kind of the records."""
        return {"records": "ports"}

    def task(self, chunk: Chunk) -> "PortTask":
        """The task of a worker for that chunk."""
        loops = np.arange(chunk.loops.start, chunk.loops.stop)
        groups_of = drawn_groups(self.grid.spec, self.grid.loop_values(loops), loops.size, self.resolved)
        return PortTask(tuple(groups_of))

    def certified(self, records: np.ndarray) -> int:
        """Number of certified loops."""
        return int(records["certified"].sum())


@dataclass(frozen=True, slots=True, eq=False)
class PortTask:
    """The hand's port of loops. parts: (members, drawing, values), see `drawn_groups`, which number the loops from 0."""

    parts: tuple[tuple[np.ndarray, Drawing, Mapping[str, object]], ...]

    def records(self) -> np.ndarray:
        """A record per loop."""
        records = np.empty(sum(members.size for members, *_ in self.parts), PORT)
        records["slice"] = np.arange(records.size)
        for members, drawing, values in self.parts:
            refuse_unsuitable(drawing, values)
            loop = held_loop(drawing, values)
            with named_loops(loop.drawn()):
                found = port_margin(loop)
                columns = found.margin, found.omega, found.passive, found.certified, found.stable, more_damping(loop, found)
            for name, column in zip(PORT.names[1:], columns, strict=True):
                records[name][members] = column
        return records


CHANNEL = np.dtype(
    [("slice", "<i4"), ("channel_norm", "<f8"), ("channel_omega", "<f8"), ("channel_passive", "?"), ("certified", "?")]
)


@dataclass(frozen=True, slots=True, eq=False)
class ChannelJob(Job):
    """The different wave channels of a grid, which has no other axes; they have no rows of their own."""

    noun: ClassVar[str] = "channels"
    dtype: ClassVar[np.dtype] = CHANNEL

    @property
    def size(self) -> int:
        """None."""
        return 0

    @property
    def identity(self) -> dict[str, object]:
        """The kind of the records."""
        return {"records": "channels"}

    def task(self, chunk: Chunk) -> "ChannelTask":
        """The task of a worker for that chunk."""
        changes = self.grid.loop_values(np.arange(chunk.loops.start, chunk.loops.stop))
        return ChannelTask(tuple(drawn_groups(self.grid.spec, changes, len(chunk.loops), self.resolved)))

    def certified(self, records: np.ndarray) -> int:
        """None of the slices that are counted."""
        del records
        return 0


@dataclass(frozen=True, slots=True, eq=False)
class ChannelTask:
    """Wave channels. parts: see `PortTask`; they number the channels from 0."""

    parts: tuple[tuple[np.ndarray, Drawing, Mapping[str, object]], ...]

    def records(self) -> np.ndarray:
        """A record per channel."""
        records = np.empty(sum(members.size for members, *_ in self.parts), CHANNEL)
        records["slice"] = np.arange(records.size)
        for members, drawing, values in self.parts:
            norm = channel_norm(drawing, values)
            for name, part in zip(CHANNEL.names[1:], (norm.norm, norm.omega, norm.passive, norm.certified), strict=True):
                records[name][members] = part
        return records


def blocks(found: Run) -> Iterator[tuple[dict[str, np.ndarray], dict[str, np.ndarray]]]:
    """Yield the axes and the fields of the records of a run, in blocks of rows."""
    grid = found.jobs["port"].grid
    for combination in stretches(grid.size):
        slices = grid.slice_of(combination)
        _, port = gather(found.jobs["port"], found.stores["port"], slices)
        yield grid.axis_columns(combination), {name: port[name] for name in PORT.names} | channel_columns(found, slices)


def channel_columns(found: Run, slices) -> dict[str, np.ndarray]:
    """The columns of the channel of each slice, and `certified`."""
    if "channel" not in found.jobs:
        missing, true = np.full(slices.size, np.nan), np.ones(slices.size, bool)  # what is not there adds no energy
        return {"channel_norm": missing, "channel_omega": missing, "channel_passive": true, "certified": true}
    job = found.jobs["channel"]
    _, records = gather(job, found.stores["channel"], _inner(found.jobs["port"].grid, job.grid, slices))
    return {name: records[name] for name in CHANNEL.names if name != "slice"}


def sends_waves(spec):
    """Whether the loop of a spec has waves."""
    return has_waves(drawing_for(spec, spec.values))


def certified_slices(found: Run) -> int:
    """Number of slices whose port and whose channel are both certified."""
    count = 0
    for slices in stretches(found.jobs["port"].slices):
        _, port = gather(found.jobs["port"], found.stores["port"], slices)
        count += int((port["certified"] & channel_columns(found, slices)["certified"]).sum())
    return count


def channels_of(grid: Grid) -> Grid:
    """The part of the grid that the wave channel reads: its loops are the different channels."""
    drawn = grid.spec.drawing and numbers_of_channel(grid.spec.drawing)
    read = [axis.path in drawn if drawn is not None else axis.path.startswith(CHANNEL_KEYS) for axis in grid.loop_axes]
    return make_grid(grid.spec, tuple(axis for axis, kept in zip(grid.loop_axes, read, strict=True) if kept), apart=False)


def _inner(grid, inside, slices):
    """For each slice of the grid, all of whose axes are loop axes, the loop of `inside`, whose axes are some of them."""
    shape = tuple(len(axis.values) for axis in grid.loop_axes)
    digits = dict(zip(grid.loop_axes, np.unravel_index(slices, shape), strict=True)) if shape else {}
    loop = np.zeros(slices.size, int)
    for axis in inside.loop_axes:
        loop = loop * len(axis.values) + digits[axis]
    return loop


def not_computed(grid: Grid) -> list[str]:
    """A sentence about each column that the loops do not have."""
    if device_of(drawing_for(grid.spec, grid.spec.values)):
        return []
    return ["not computed for a hand that holds no single mass: damping_needed unless it is 0"]
