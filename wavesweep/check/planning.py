"""The lines of `wavesweep check`: a run described before it runs."""

from collections.abc import Iterator
from functools import cache, partial
from itertools import chain, compress
from math import ceil

import numpy as np

from wavesweep.capabilities import asked, home_of
from wavesweep.engine.drawing import name_of, scalars
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.engine.expressions import sum_of
from wavesweep.engine.frames import open_loops
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import keys_of_page, steps_of
from wavesweep.program.analyses.claims import questions
from wavesweep.program.analyses.interval_jobs import method
from wavesweep.program.analyses.response_jobs import response_job
from wavesweep.program.analyses.spec_loops import refuse_singular
from wavesweep.program.number_words import in_time
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.estimates import duration, expected_bytes, expected_seconds, short
from wavesweep.program.sweep.grid import make_grid, own_loop
from wavesweep.program.sweep.workers import choose
from wavesweep.program.tables.interval_table import stages_of

SHORTEST_ESTIMATED = 0.3  # s of work, of which a sample says how long it takes


def plan(spec: Spec, estimated: bool = True) -> list[str]:
    """Lines for `wavesweep check`: the loop, the work and the method of each command, and the keys
    that are skipped.

    estimated: with the loop, and the time and the disk that each command takes, for which samples
    of the work are done; otherwise of each command whether it is possible, and its method.
    """
    drawing = spec.drawing
    lines = []
    if estimated:
        lines += _drawn_lines(spec) if drawing else _loop_lines(spec)
    for command, along in (("zwidth", "K_VE"), ("stability-region", None)):
        if command != "zwidth" or not drawing or drawing.wall:
            lines += _interval_lines(spec, command, along, estimated)
    if drawing and drawing.hand is None and not spec.routes:
        if drawing.inputs:
            names = "neither a hand nor outputs"
            others = ["passivity"]
        else:
            names = "neither a hand nor inputs"
            others = ["passivity", "simulate"]
        lacking = ["bode", *filter(home_of, others)]  # of the others those that a capability has
        return [*lines, f"  {', '.join(lacking)}: not possible, [ports] names {names}"]
    lines += _bode_lines(spec, estimated)
    for said, jobs in asked("on_check", "sweep_plan", spec):
        lines += [*said, *(_long_lines(jobs) if estimated else ())]
    if drawing:
        return lines
    return [*lines, *_skipped_lines(spec)]


def _loop_lines(spec):
    yield f"{spec.source or spec.name}: valid, controller {spec.kind}"
    loop = own_loop(spec)
    drawn = loop.drawn()
    drift = loop.drift_of_frames()
    ticks = _count(drawn.ticks, "tick")
    lasts = in_time(drawn.ticks * float(drawn.period))
    if spec.uneven:
        steps = _count(steps_of(spec.values["rates.ratio"])[1], "slow step")
        yield f"  loop: the rates do not divide; both are in step again after a frame of {ticks} and {steps}, {lasts}"
        over = "the next step begins" if spec.delay_of_frame else "its delay is over"
        yield f"    a slow step reads the fast tick at or before it; its result is in place from the first one on once {over}"
    else:
        yield f"  loop: frame of {ticks}, {lasts}"
    labels = drawn.labels()
    yield from _state_lines(drift, [labels[name] for name in drift.states])
    free = loop.changed({"environment.K_VE": 0.0}).drift_of_frames()
    if len(free.constant) + len(free.varying) > len(drift.constant) + len(drift.varying):
        yield "  drift set aside at K_VE = 0: the position of the whole scene, which only the wall holds"


def read_in_several_places(spec: Spec, number: str) -> bool:
    """Whether messages may be late or lost, and more than one wire or gain reads a number, so that
    no intervals along it hold for all of these."""
    messages = [each for question in questions(spec) for each in question.scope.messages]
    late = spec.drawing is not None and not all(each.in_time for each in messages)
    return late and not spec.drawing.scalar_place(name_of(number))


def _interval_lines(spec, command, along, estimated):
    try:
        own, *guaranteed = stages_of(spec, along, None)
    except (SpecError, UsageError) as error:
        return [f"  {command}: not possible with this spec: {error}"]
    job = own.job
    grid = job.grid
    axis = job.asked.axis
    if read_in_several_places(spec, axis.path):
        reason = (
            f"several wires or blocks read {axis.name}; `check` proves a range of it in [for_all]"
        )
        return [f"  {command}: not possible with this spec: {reason}"]
    expected = cache(partial(expected_seconds, job))
    product = " x ".join(f"{a.name}[{len(a.values)}]" for a in grid.axes) or "the spec's own values"
    slices = _count(job.slices, "slice")
    if grid.size > job.slices:
        slices += f", {grid.size - job.slices} more are repeats"
    lines = [
        f"  {command}: stable intervals along {axis.name} in ({axis.start:g}, {axis.stop:g}) for {product}: {slices}",
        f"    method: {method(job.asked)}",
    ]
    if not estimated:
        return lines
    from wavesweep.program.analyses.plane_columns import seconds_of_curves

    workers = choose(None, None, None, len(job.chunks), expected)
    who = "no workers" if workers.backend is None else f"{workers.count} worker processes"
    chunks = _count(sum(len(stage.job.chunks) for stage in (own, *guaranteed)), "chunk")
    # A second to load what draws, and to draw.
    figure = 1.0 + seconds_of_curves(spec, axis, grid.axes, expected() / job.slices)
    work = f"about {_about(expected() / workers.count)}; {who} ({workers.why})"
    if guaranteed:  # whose proofs go on for as long as they find something
        words = " and ".join(stage.hand for stage in guaranteed)
        work = f"how long the rows of {words} take is not known beforehand"
    return [
        *lines,
        f"    work: {chunks}, {work}",
        f"    figure: up to about {duration(figure)} more, which --no-plot leaves out",
        f"    disk: about {_size(expected_bytes(job))} until the results are in place",
        *_advice([job]),
    ]


def _about(seconds):
    """An estimate; so short a work is over before its start is."""
    if seconds < SHORTEST_ESTIMATED:
        return "a second at most"
    return duration(seconds)


def _advice(jobs):
    """The advice for tables that few programs can read as a single CSV."""
    advice = "--out FILE.parquet writes the Parquet file alone, and no CSV"
    for job in jobs:
        rows = round(job.kind.rows * job.size)
        if rows > 30_000_000:  # some 5 GB of CSV
            yield f"    about {rows:.2g} rows: {advice}"


def _size(count):
    if count < 1e9:
        return f"{short(count / 1e6)} MB"
    return f"{short(count / 1e9)} GB"


def _bode_lines(spec, estimated):
    points = spec.frequency_hz
    names = tuple(axis.name for axis in spec.bode)
    try:
        routes = spec.routes or (None,)
        jobs = [response_job(spec, spec.bode, points, names, route=route) for route in routes]
    except (SpecError, UsageError) as error:
        return [f"  bode: not possible with this spec: {error}"]
    frequencies = f"1 frequency, {points[0]:g} Hz"
    if len(points) > 1:
        frequencies = f"{len(points)} frequencies from {min(points):g} to {max(points):g} Hz"
    curves = _count(sum(job.grid.loops for job in jobs), "curve")
    if spec.routes:
        curves += f" ({', '.join(' to '.join(route) for route in spec.routes)})"
    line = f"  bode: {curves} of {frequencies}; method: lifted resolvent of all rates"
    if estimated:
        return [line, *_long_lines(jobs)]
    return [line]


def _long_lines(jobs):
    """The chunks, the time and the disk of a table of several chunks; otherwise it is there at
    once, and nothing is kept."""
    if all(len(job.chunks) == 1 for job in jobs):
        return [*_advice(jobs)]
    chunks = sum(len(job.chunks) for job in jobs)
    size = _size(sum(map(expected_bytes, jobs)))
    seconds = 0.0
    for job in jobs:
        # Seconds for samples of work whose parts take unlike times, as at several rates.
        expected = cache(partial(expected_seconds, job, 0.2))
        workers = choose(None, None, None, len(job.chunks), expected)
        seconds += expected() / workers.count
    work = f"{_count(chunks, 'chunk')}, about {_about(seconds)}"
    return [f"    work: {work}; disk: about {size} until the results are in place", *_advice(jobs)]


def _drawn_lines(spec):
    """Yield when the blocks of a drawn loop run, its drift, and the method by which each number
    is swept."""
    refuse_singular(spec, spec.drawing)
    loop = Loops(spec.drawing, spec.values)
    drawing = loop.drawing
    drawn = loop.drawn()
    drift = loop.drift_of_frames()
    period = float(drawn.period)
    labels = drawn.labels()
    yield f"{spec.source or spec.name}: valid, a drawn loop of {_count(len(drawing.blocks), 'block')}"
    yield f"  frame of {_count(drawn.ticks, 'tick')} of {in_time(period)}, {in_time(drawn.ticks * period)}"
    yield from _rhythm_lines(drawing, drawn)
    yield from _plant_lines(drawing)
    yield from _dead_time_lines(drawing, spec.values)
    sums = [terms for _, terms, *_ in (*drawing.wires, *drawing.couplings, *drawing.outputs)]
    sums += filter(None, (drawing.hand or ())[1:])
    read = {signal.rpartition(".")[0] for terms in sums for signal, _ in terms}
    unread = [block.name for block in drawing.blocks if block.name not in read]
    if unread:  # which may be a slip
        yield f"  nothing reads {_listed(unread)}, which counts for stability all the same"
    yield from _state_lines(drift, [labels[state] for state in drift.states])
    # a line per method, with the numbers that go this way
    ways = {"": [], "panels": [], "values": []}
    for name, path in spec.names.symbols.items():
        if spec.names.keys[path].structural:
            ways["values"].append(name)
        else:
            opened = open_loops(Loops(spec.drawing, spec.values), name)
            way = "" if opened and opened.cut else "panels"
            ways[way].append(name)
    texts = {
        "": "fast method, because each is one gain, once a frame",
        "panels": "slower method, because they act in more than one place, more than once a frame, or in the key of a block",
        "values": "as values only, since they decide how the loop is built",
    }
    for way, names in ways.items():
        if names:
            yield f"  intervals along {', '.join(names)}: {texts[way]}"


def _rhythm_lines(drawing, drawn):
    """In which ticks of the frame blocks run."""
    plant_of = {block.name: plant.name for plant in drawing.plants for block in plant.members}
    placed = {placed_block.block.name: placed_block for placed_block in drawn.placed}
    when = {}
    for block in drawing.blocks:
        block_placed = placed[plant_of.get(block.name, block.name)]
        rhythm = (block_placed.every, block_placed.phase)
        when.setdefault(rhythm, []).append(f"{block.name} ({block.type})")
    for (every, phase), blocks in sorted(when.items()):
        ticks = "in every tick" if every == 1 else f"every {every} ticks"
        if every != 1 and phase:
            ticks += f" from tick {phase}"
        yield f"  runs {ticks}: {', '.join(blocks)}"


def _plant_lines(drawing):
    """What acts continuously, and which forces of plants on themselves are computed from
    samples."""
    for plant in drawing.plants:
        if not plant.couplings:
            continue
        names = [block.name for block in plant.members]
        yield f"  one plant, within which all acts continuously: {', '.join(names)}"
        for port, terms in plant.couplings:
            yield f"    {port}: {sum_of(terms)}"
    plants = {block.name for block in drawing.blocks if block.plant}
    for port, terms in drawing.wires:
        sampled = [term for term in terms if term[0].rpartition(".")[0] in plants]
        if sampled and port.rpartition(".")[0] in plants:
            yield f"  from samples of every tick, and held over it: {port}: {sum_of(sampled)}"


def _dead_time_lines(drawing, values):
    """How long dead times are in ticks, and what they read or bring between two ticks."""
    wires = dict(drawing.wires)
    for name, tree in drawing.dead_times.items():
        seconds = tree.value(scalars(values))
        arriving = []
        sensed = []
        for plant in drawing.plants:
            arriving += [port for port, dead_time in plant.arriving if dead_time == name]
            sensed += [signal for signal, dead_time in plant.sensed if dead_time == name]
        held = any(signal not in sensed for signal, _ in wires[f"{name}.u"])
        readers = []
        for port, terms in wires.items():
            reads = any(signal == f"{name}.y" for signal, _ in terms)
            if reads and (sensed or port not in arriving):
                readers.append(port)
        phrases = {
            "reads {} between two ticks": sensed,
            "brings what is held to {} between two ticks": arriving * held,
            "is read in ticks by {}": readers,
        }
        does = ", ".join(
            phrase.format(_listed(names)) for phrase, names in phrases.items() if names
        )
        ticks = _count(f"{seconds * drawing.rate(values):.6g}", "tick")
        yield f"  {name}: {1e3 * seconds:.6g} ms, {ticks}; {does}"


def dead_times_in_series(spec: Spec) -> Iterator[str]:
    """Yield a line for each dead time of held signals that another one reads: what it brings between
    two ticks waits for the next one there."""
    drawing = spec.drawing
    wires = dict(drawing.wires)
    sensed = {signal for plant in drawing.plants for signal, _ in plant.sensed}
    for name, tree in drawing.dead_times.items():
        held = any(signal not in sensed for signal, _ in wires[f"{name}.u"])
        first = tree.value(scalars(spec.values)) * drawing.rate(spec.values)
        if not held or abs(first - round(first)) < 1e-11:  # whole but for rounding
            continue
        for other, other_tree in drawing.dead_times.items():
            if any(signal == f"{name}.y" for signal, _ in wires[f"{other}.u"]):
                second = other_tree.value(scalars(spec.values)) * drawing.rate(spec.values)
                ms = 1e3 / drawing.rate(spec.values)
                comes = (
                    f"{ms * (ceil(first) + second):.6g} ms late, not {ms * (first + second):.6g}"
                )
                yield f"{name} and {other} are dead times in series: what is held waits between them, and comes {comes}; draw their sum"


def within_ticks(spec: Spec) -> Iterator[str]:
    """Yield two lines about each algebraic loop of a drawn spec: what reads what in the same tick,
    and what that does to gains.

    1 - L is the determinant of the return difference, by which Mason's rule divides each gain whose
    way meets all of the loop.
    """
    drawing = spec.drawing
    drawn = Loops(drawing, spec.values).drawn()
    inside = drawing.inside
    wires = {inside.get(port, port): terms for port, terms in drawing.wires}
    for ring in drawn.rings():
        blocks = [
            placed_block.block for placed_block in drawn.placed if placed_block.block.name in ring
        ]
        ports = []
        outputs = []
        for block in blocks:
            ports += [f"{block.name}.{port}" for port in block.inputs]
            outputs += [f"{block.name}.{port}" for port in block.outputs]
        returned = []  # by each output, of all outputs, once round the loop
        acts = []
        for block in blocks:
            sums = [drawn.sums.get(f"{block.name}.{port}", {}) for port in block.inputs]
            gains = [[float(terms.get(name, 0.0)) for name in outputs] for terms in sums]
            returned.append(block.D @ np.array(gains))
            acts += block.D.any(axis=1).tolist()
        rest = float(np.linalg.det(np.eye(len(outputs)) - np.concatenate(returned)))
        acting = set(compress(outputs, acts))
        read = {}
        for port in ports:
            terms = wires.get(port, ())
            read[port] = [term for term in terms if inside.get(term[0], term[0]) in acting]
        reads = ", ".join(f"{port} reads {sum_of(terms)}" for port, terms in read.items() if terms)
        gain = f"a gain on this way acts {1 / rest:.4g} times, 1/(1 - L) with L = {1 - rest:.4g} round the loop"
        yield f"solved within a tick: {_listed(ring)}: {reads} of the same tick; {gain}"
        yield _implicit_line(drawing, [*chain.from_iterable(read.values())])


def _implicit_line(drawing, terms):
    """Which integrators among terms of the same tick act implicitly, and how a wire reads a
    signal as it was before."""
    ahead = {f"{block.name}.y" for block in drawing.blocks if block.type == "integrator"}
    implicit = [term for term in terms if term[0] in ahead]
    name = (implicit or terms)[0][0]
    before = f"prev({name}) in a wire reads {name} as it was before the tick"
    if not implicit:
        return f"  {before}"
    forces = ", ".join(sum_of([term]) for term in implicit)
    return f"  so these act implicitly: {forces}; {before}"


def _state_lines(drift, names):
    """names: of all states, as they are shown."""
    remaining = _listed([names[index] for index in drift.remaining])
    yield f"  {_count(len(drift.remaining), 'state')}: {remaining}"
    for lead, others in drift.constant:
        drifting = names[lead]
        if others:
            drifting += f", and with it {_listed([names[index] for index, _ in others])}"
        yield f"  drift set aside: {drifting}, which nothing in the loop holds"
    if drift.varying:
        varying = _listed([names[index] for index in drift.varying])
        yield f"  drift set aside: a combination with {varying} that nothing changes"
    if drift.unobserved:
        unobserved = _listed([names[index] for index in drift.unobserved])
        yield f"  states left out, since nothing in the loop reads them: {unobserved}"


def _listed(names):
    """The names of states in their order, those of a long delay as `net u1 to net u140`."""
    runs = []
    following = ("", "")  # stem and number of the name that goes on with the last run
    for name in names:
        stem = name.rstrip("0123456789")
        number = name.removeprefix(stem)
        if number and (stem, number) == following:
            runs[-1].append(name)
        else:
            runs.append([name])
        following = (stem, str(int(number) + 1) if number else "")
    shown = []
    for run in runs:
        # Of three names with numbers that follow each other the first and the last are enough.
        shown += [f"{run[0]} to {run[-1]}"] if len(run) >= 3 else run
    return ", ".join(shown)


def _count(number, noun):
    plural = "" if str(number) == "1" else "s"
    return f"{number} {noun}{plural}"


def _skipped_lines(spec):
    read = keys_of_page(spec.values)
    kind = spec.values["controller.kind"]
    for axes, table in ((spec.sweep, "sweep"), (spec.bode, "bode")):
        for axis in make_grid(spec, axes).ignored:
            yield f"  {table}.{axis.name}: skipped, {kind} does not read it; its rows would be repeated"
    unread = [path for path in spec.values if path not in read]
    if unread:
        yield f"  not read by {kind}: {', '.join(unread)}"
