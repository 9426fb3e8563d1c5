"""The lines of `wavesweep check`: a run described before it runs."""

from functools import cache, partial

from wavesweep.diagram import draw, drift_of, keys_read, state_labels
from wavesweep.errors import SpecError, UsageError
from wavesweep.lifted import cut_at_wall
from wavesweep.spec import Spec
from wavesweep.sweep.grid import make_grid
from wavesweep.sweep.interval_table import method
from wavesweep.sweep.job import expected_bytes, expected_seconds, job_of
from wavesweep.sweep.passivity_table import jobs_of
from wavesweep.sweep.response_table import response_job
from wavesweep.sweep.workers import choose

MANY = 30_000_000  # rows: some 5 GB of CSV


def plan(spec: Spec) -> list[str]:
    """Lines for `wavesweep check`: the loop, the work and the method of each command, and the keys that are skipped and why."""
    diagram = draw(spec.values)
    cut = cut_at_wall(diagram)
    kind, where = spec.values["controller.kind"], spec.source or spec.name
    lines = [f"{where}: valid, controller {kind}", *_loop_lines(spec, diagram, cut)]
    for command, along in (("zwidth", "K_VE"), ("stability-region", None)):
        lines += _interval_lines(spec, command, along)
    return [*lines, *_bode_lines(spec), *_passivity_lines(spec), *_skipped_lines(spec)]


def _loop_lines(spec, diagram, cut):
    frame = f"frame of {_count(diagram.ratio, 'tick')}, {1e3 * float(cut.period):.6g} ms"
    labels, lead = state_labels(diagram), drift_of(diagram).lead
    states = [labels[name] for name in (*cut.states, *([lead] if cut.integrates else []))]
    yield f"  loop: {frame}; {cut.order} states with the wall: {', '.join(states)}"
    if cut.unread:
        yield f"  states left out, since nothing in the loop reads them: {', '.join(labels[name] for name in cut.unread)}"
    if cut.conserved:
        yield f"  drift set aside: the wall cannot change {labels[lead]} less the hand's displacement"
    elif cut.integrates and spec.values["operator.stiffness"] == 0:
        yield "  drift set aside at K_VE = 0: the position of the whole scene, which only the wall holds"


def _interval_lines(spec, command, along):
    try:
        job = job_of(spec, along)
    except (SpecError, UsageError) as error:
        return [f"  {command}: not possible with this spec: {error}"]
    grid, axis, expected = job.grid, job.axis, cache(partial(expected_seconds, job))
    product = " x ".join(f"{a.name}[{len(a.values)}]" for a in grid.axes) or "the spec's own values"
    workers = choose(None, None, None, len(job.chunks), expected)
    repeated = f", {grid.size - job.slices} more are repeats" if grid.size > job.slices else ""
    slices = f"{_count(job.slices, 'slice')} over {_count(grid.loops, 'compiled loop')}{repeated}"
    span = f"({axis.start:g}, {axis.stop:g})"
    who = "no workers" if workers.backend is None else f"{workers.count} worker processes"
    return [
        f"  {command}: stable intervals along {axis.name} in {span} for {product}: {slices}",
        f"    method: {method(axis.path)}",
        f"    work: {_count(len(job.chunks), 'chunk')}, about {_duration(expected() / workers.count)}; {who} ({workers.why})",
        f"    disk: about {_size(expected_bytes(job))} until the results are in place",
        *_parts_lines(job),
    ]


def _parts_lines(job):
    """The advice for a table that few programs can read as a single CSV."""
    rows = round(job.rows * job.size)
    if rows > MANY:
        yield f"    about {rows:.2g} rows: --partition 10000000 writes Parquet files of so many rows each, and no single CSV"


def _size(count):
    return f"{count / 1e6:.2g} MB" if count < 1e9 else f"{count / 1e9:.3g} GB"


def _duration(seconds):
    return f"{seconds:.2g} s" if seconds < 100 else f"{seconds / 60:.3g} min"


def _bode_lines(spec):
    points = spec.frequency_hz
    try:
        job = response_job(spec, spec.bode, points, tuple(axis.name for axis in spec.bode))
    except (SpecError, UsageError) as error:
        return [f"  bode: not possible with this spec: {error}"]
    frequencies = f"{len(points)} frequencies from {min(points):g} to {max(points):g} Hz"
    what = f"  bode: {_count(job.grid.slices, 'curve')} of {frequencies}; method: lifted resolvent of both rates"
    return [what, *_long_lines([job])]


def _passivity_lines(spec):
    try:
        jobs = jobs_of(spec, tuple(axis for axis in spec.sweep if axis.values))
    except (SpecError, UsageError) as error:
        return [f"  passivity: not possible with this spec: {error}"]
    channels = jobs["channel"].slices if "channel" in jobs else 0
    what = f"  passivity: hand's port of {_count(jobs['port'].slices, 'loop')}, norm of {_count(channels, 'wave channel')}"
    how = "method: level sets of the frame's energy balance, without a frequency grid"
    return [f"{what}; {how}", *_long_lines(jobs.values())]


def _long_lines(jobs):
    """The chunks and the disk of a table of several chunks; otherwise nothing is kept on the way."""
    advice = [line for job in jobs for line in _parts_lines(job)]
    if all(len(job.chunks) == 1 for job in jobs):
        return advice
    chunks, size = sum(len(job.chunks) for job in jobs), _size(sum(map(expected_bytes, jobs)))
    return [f"    work: {_count(chunks, 'chunk')}; disk: about {size} until the results are in place", *advice]


def _count(number, noun):
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _skipped_lines(spec):
    read, kind = keys_read(spec.values), spec.values["controller.kind"]
    for axes, table in ((spec.sweep, "sweep"), (spec.bode, "bode")):
        for axis in make_grid(spec, axes).ignored:
            yield f"  {table}.{axis.name}: skipped, {kind} does not read it; its rows would be repeated"
    unread = [path for path in spec.values if path not in read]
    if unread:
        yield f"  not read by {kind}: {', '.join(unread)}"
