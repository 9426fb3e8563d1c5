"""Passivity of the wave channel and of the hand's port over the axes of a sweep, as a table."""

import time
from collections.abc import Iterator
from functools import partial

import numpy as np

from wavesweep.analysis.passivity import channel_norm, filter_table, sufficient_order
from wavesweep.analysis.passivity.channel import CUTOFFS_HZ
from wavesweep.diagram import draw
from wavesweep.errors import UsageError
from wavesweep.spec import Spec
from wavesweep.sweep.grid import Grid, groups, loop_of, make_grid, refuse_rows
from wavesweep.sweep.table import Table, facts_of
from wavesweep.sweep.tasks import PORT, PortTask
from wavesweep.sweep.workers import choose, results

TOLERANCE = 1e-3  # J per J sent that aliasing may add for the channel to pass for passive in a verdict
PAPER_HZ = 50.0  # the slow rate that the cutoffs of the table of filters are for
CHUNK = 32  # loops in a task: up to a second or two
READY = 1.5  # s that workers take longer than those of `intervals` to be ready and to load SciPy
CHANNEL = ("rates.", "filters.")  # the keys that the channel depends on; all others are outside its ports
METHODS = {
    "channel": "H-infinity norm by levels: the level just above it is met at no frequency (symplectic pencil of a frame)",
    "port": "least eigenvalue of the Hermitian part by levels, the level just below it met at no frequency",
}


def passivity(spec: Spec, tolerance: float = TOLERANCE, jobs=None, backend=None, scheduler=None, progress=None) -> Table:
    """Channel norm and port margin for every combination of the axes of [sweep] that have values.

    An axis that has only a span is not swept. Nothing is computed twice: the norm depends on filters and rates, the
    margin on the keys that the controller reads. tolerance: J per J sent that aliasing may add, for the verdicts of the
    summary. jobs, backend, scheduler, progress: as for `intervals`.
    """
    started = time.perf_counter()
    grid = make_grid(spec, tuple(axis for axis in spec.sweep if axis.values))
    refuse_rows("passivity", grid.size)
    if grid.drawing:
        found, count = _drawn_columns(grid, progress), 1
    else:
        channel = _channel_columns(grid)
        port, workers = _port_columns(grid, (jobs, backend, scheduler), progress)
        found = {**channel, **port, "certified": port["certified"] & channel["certified"]}
        count = workers.count
    certified = found.pop("certified")
    counts = {"computed": grid.slices, "skipped": grid.size - grid.slices, "certified": int(certified.sum())}
    timings = {"compute_s": time.perf_counter() - started, "workers": count}
    methods = METHODS | ({"damping_needed": "not computed for loops that are assembled tick by tick"} if grid.drawing else {})
    facts = facts_of(spec, methods, counts, timings, _notices(grid), [axis.path for axis in grid.axes])
    return Table.of("passivity", _rows(grid, found), facts | {"tolerance": tolerance})


def in_memory(spec: Spec, axes) -> dict:
    """The table over `axes`, computed in this process."""
    grid = make_grid(spec, axes)
    if grid.drawing:
        return _rows(grid, _drawn_columns(grid))
    found = _channel_columns(grid) | _port_columns(grid, (1, None, None), None)[0]
    return _rows(grid, found)


ORDER = (
    *("channel_norm", "channel_omega", "port_margin", "port_omega", "channel_passive", "port_passive"),
    *("stable", "damping_needed"),
)


def _rows(grid, found) -> dict:
    combination = np.arange(grid.size)
    slices = grid.slice_of(combination)
    return grid.axis_columns(combination) | {name: found[name][slices] for name in ORDER}


def _drawn_columns(grid: Grid, progress=None) -> dict[str, np.ndarray]:
    """Table columns of the port of drawn loops, one after the other; they have no wave channel that a spec would name."""
    from wavesweep.analysis.passivity.drawn import drawn_port_margin
    from wavesweep.sweep.drawn_loops import ports_of_slices

    size = grid.slices
    found = {
        name: np.full(size, np.nan) for name in ("channel_norm", "channel_omega", "port_margin", "port_omega", "damping_needed")
    }
    found |= {name: np.ones(size, bool) for name in ("channel_passive", "port_passive", "stable", "certified")}
    for done, (number, _, port) in enumerate(ports_of_slices(grid), 1):
        margin = drawn_port_margin(port)
        row = {"port_margin": margin.margin, "port_omega": margin.omega, "port_passive": margin.passive}
        row |= {"stable": margin.stable, "certified": margin.certified, "damping_needed": np.where(margin.passive, 0.0, np.nan)}
        for name, value in row.items():
            found[name][number] = value.item()
        if progress:
            progress(done, size, int(found["certified"].sum()))
    return found


def channels_of(grid: Grid) -> Grid:
    """The part of the grid that the wave channel reads: its loops are the different channels."""
    return make_grid(grid.spec, tuple(axis for axis in grid.loop_axes if axis.path.startswith(CHANNEL)))


def _channel_columns(grid: Grid) -> dict[str, np.ndarray]:
    """Table columns of the channel and `certified`, `(loops * walls,)`; each different channel is computed once."""
    inside = channels_of(grid)
    size = inside.loops
    found = {
        "channel_norm": np.full(size, np.nan),
        "channel_omega": np.full(size, np.nan),
        # A loop without a channel has none that adds energy.
        "channel_passive": np.ones(size, bool),
        "certified": np.ones(size, bool),
    }
    for members, values in groups(grid.spec, inside.loop_values(np.arange(size)), size):
        norm = channel_norm(values)
        if norm is None:
            break
        for name, part in zip(found, (norm.norm, norm.omega, norm.passive, norm.certified), strict=True):
            found[name][members] = part
    return {name: part[_inner(grid, inside)] for name, part in found.items()}


def _inner(grid, inside):
    """For each slice of the grid the loop of `inside`, whose axes are some of the grid's loop axes."""
    shape = tuple(len(axis.values) for axis in grid.loop_axes)
    digits = dict(zip(grid.loop_axes, np.unravel_index(np.arange(grid.loops), shape), strict=True)) if shape else {}
    loop = np.zeros(grid.loops, int)
    for axis in inside.loop_axes:
        loop = loop * len(axis.values) + digits[axis]
    return np.repeat(loop, grid.walls)


def _port_columns(grid: Grid, wanted, progress):
    """Table columns of the port and `certified`, `(loops * walls,)`, and the workers that computed them."""
    tasks = [PortTask(*part) for part in grid.slices_of_a_drawing(CHUNK)]
    workers = choose(*wanted, len(tasks), partial(_expected_seconds, tasks))
    found, done = np.zeros(grid.slices, PORT), 0
    for _, records, _ in results(workers, range(len(tasks)), tasks.__getitem__):
        found[records["slice"]] = records
        done += records.size
        if progress:
            progress(done, grid.slices, int(found["certified"].sum()))
    return {name: np.ascontiguousarray(found[name]) for name in PORT.names if name != "slice"}, workers


def _expected_seconds(tasks) -> float:
    """Seconds in one process beyond READY, from some loops of the first chunk and of the last."""
    pieces = [task.first(16) for task in (tasks[0], tasks[-1])]
    pieces[0].first(1).records()  # the first call of everything costs more than it will later
    started = time.perf_counter()
    loops = sum(piece.records().size for piece in pieces)
    return (time.perf_counter() - started) / loops * sum(task.slices.size for task in tasks) - READY


def _notices(grid) -> Iterator[str]:
    """Yield notices about axes that are not swept, and about a missing channel."""
    kind, values = grid.spec.kind, grid.spec.values
    yield from grid.notices
    for axis in grid.spec.sweep:
        if not axis.values:
            yield f"{axis.name} has a span and no values: not swept, held at the spec's {values[axis.path]:g}"
    if grid.drawing:
        yield "not computed for a loop that is assembled tick by tick: the wave channel, and damping_needed unless it is 0"
    elif draw(values).waves is None:
        yield f"{kind} has no wave channel: its norm is missing, and what is not there adds no energy (channel_passive 1)"


def filter_choices(spec: Spec, tolerance: float = TOLERANCE) -> Table:
    """How far from passive the channel is for every order of LP1, at cutoffs that suit the spec's slow rate.

    The cutoffs are those that the paper could mean, which has 50 Hz, in proportion to the slow rate. tolerance: J per J sent
    that aliasing may add for an order to be enough.
    """
    if loop_of(spec):
        raise UsageError("filters: expected a [controller] whose rates divide, found a loop that is assembled tick by tick")
    started = time.perf_counter()
    fast, ratio = spec.values["rates.fast_hz"], spec.values["rates.ratio"]
    # Rounded, so that tables of rates such as 1000/30 Hz can be read.
    cutoffs = [cutoff for each in CUTOFFS_HZ if (cutoff := float(f"{each * fast / ratio / PAPER_HZ:.3g}")) < fast / 2]
    columns = filter_table(spec.values, cutoffs_hz=cutoffs)
    enough = sufficient_order(columns, tolerance)
    orders = [enough[cutoff] for cutoff in columns["lp1_cutoff_hz"].tolist()]
    columns = columns | {"sufficient_order": np.array([np.nan if order is None else order for order in orders])}
    rows = columns["certified"].size
    counts = {"computed": rows, "skipped": 0, "certified": int(columns["certified"].sum())}
    methods = {
        "channel": "H-infinity norm by levels, for LP1 of order 1 to 8; the spec's rates and nothing else of it",
        "sufficient_order": f"least order at this cutoff whose energy_gain is at most {tolerance:g}",
    }
    facts = facts_of(spec, methods, counts, {"compute_s": time.perf_counter() - started})
    facts |= {"tolerance": tolerance, "assumes": "the rates of the spec, and nothing else of it"}
    return Table.of("passivity-filters", columns, facts)
