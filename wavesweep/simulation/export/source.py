"""The controller of a loop as C: the programs of its ticks, line by line, without the device.

The device consists of the blocks whose inputs are always held over a tick: masses and continuous
models. It is the host's.
"""

from collections.abc import Iterator, Mapping, Sequence
from textwrap import fill
from typing import Any

from wavesweep import __version__
from wavesweep.engine.drawing import scalars
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import sum_of
from wavesweep.program.spec import Spec
from wavesweep.simulation.experiment import refuse_what_makes_no_loop
from wavesweep.simulation.export.controller import (
    ExportedController,
    as_drawn,
    controller_of,
    identifiers,
    with_late_device,
)
from wavesweep.simulation.export.example_host import ExampleHost
from wavesweep.simulation.export.repeated_experiment import (
    NEXT_SLOW_STEP,
    Steps,
    drawing_of,
    loop_with,
    march_of,
    steps_of,
    timing_of,
)
from wavesweep.simulation.export.single import operations_of, single
from wavesweep.simulation.export.text import comment, constants, filled, table_of
from wavesweep.simulation.export.tick_functions import tick_function
from wavesweep.simulation.from_spec import effects_of, hand_force
from wavesweep.simulation.running_blocks import DEPTH, FORCE, SEEN, SPEED
from wavesweep.simulation.tick_sums import arrived

NUMBERS_IN_A_LINE = 40  # of a table in C


def exported(spec: Spec, *, floats: bool = False) -> dict[str, str]:
    """Return the files of the controller of a spec in C: name -> text.

    The vectors are the experiment of the spec's [simulate] table: what the controller reads and
    gives in each tick, and the ticks by which slow results are late. floats: in place of doubles.

    Errors: `UsageError` if the loop cannot be simulated, or if no tick could be, if it has no
    device, nothing but a device, or one that responds within the tick, or too many terms;
    `IllPosedLoopError` if what goes round within a tick has no solution.
    """
    spec = spec.asking("simulate")
    refuse_what_makes_no_loop(spec)
    effects = effects_of(spec)
    steps = steps_of(spec)
    all_steps = steps and steps.all
    drawing = drawing_of(spec, steps)
    loop = with_late_device(loop_with(spec, drawing, spec.values, all_steps))
    late = effects.late or effects.dropped or loop.channels or steps
    controller = controller_of(loop, bool(late))
    outputs = {name: name.removesuffix(" besides") for name in controller.outputs}
    march = march_of(spec, loop, steps, controller.inputs, outputs)
    signals = march.under(hand_force(spec).force).signals
    count = len(signals["time_s"])
    if not count:
        raise UsageError(
            "export: expected an experiment with at least one tick for the vectors, found none"
        )
    names = [*controller.inputs, *controller.outputs]
    members = dict(zip(names, identifiers(names), strict=True))
    columns = timing_of(march, steps, count, late=controller.late)
    for name, member in members.items():
        columns[member] = signals[name if name in controller.inputs else SEEN + name]
    amplifier = _amplifier_ticks(spec, controller)
    host = ExampleHost(controller, march.loop, members, march.entry)
    # the flags of the templates' conditional parts
    flags = {
        "wall": controller.loop.wall is not None,
        "late": controller.late,
        "results": bool(controller.results),
        "tells": any(result.touches for result in controller.results),
        "several": len(controller.programs) > 1,
        "zero": controller.late and any(result.zero for result in controller.results),
        "steps": steps is not None,
    }
    flags["amplifier"] = bool(amplifier)
    flags["dead_times"] = bool(dead_times_of(spec))
    flags |= {"single": False, "sizes": False}
    values = _values(spec, controller, march.entry, steps)
    values["late"] = f"{amplifier:g}"
    values["dead_times"] = ", ".join(dead_times_of(spec))
    values["pending"] = (_longest_delay(columns) + 2) * max(1, len(controller.results))
    values |= _signals(controller, members)
    values |= host.texts()
    files = {
        "controller.h": filled("controller.h", flags, values),
        "controller.c": filled("guards.c", flags, values) + filled("controller.c", flags, values),
        "check.c": filled("check.c", flags, values),
        "example.c": filled("example.c", flags, values),
        "vectors.csv": table_of(columns),
        "Makefile": filled("Makefile", flags, values),
    }
    return single(controller, files, flags, values) if floats else files


def terms_of(spec: Spec) -> dict[str, dict[str, Any]]:
    """What enters each output of a spec's controller, by its port of a plant; one that only inputs
    from outside enter is none.

    A port has its `sum` as a text, and `terms`: what each is `from`, its `gain` as a text, and the
    `coefficient` that it is.
    """
    drawing = drawing_of(spec)
    numbers = scalars(spec.values)
    plants = {block.name for block in drawing.blocks if block.plant} | {*drawing.dead_times}
    hand = (drawing.hand or ("",))[0]
    of_device = {hand, *(f"{name}.y" for name in drawing.dead_times)}
    outside = {signal for _, signal, _ in drawing.inputs}
    terms_by_port = {}
    for port, all_terms in drawing.wires:
        terms = tuple(term for term in all_terms if term[0] not in of_device)
        if port.rpartition(".")[0] not in plants or all(name in outside for name, _ in terms):
            continue
        told = []
        for name, gain in terms:
            coefficient = 0.0 + gain.value(numbers)
            told.append({"from": name, "gain": gain.text, "coefficient": coefficient})
        terms_by_port[port] = {"sum": sum_of(terms), "terms": told}
    return terms_by_port


def dead_times_of(spec: Spec) -> list[str]:
    """The dead times in seconds of a drawn loop, each in words."""
    if not spec.drawing:
        return []
    numbers = scalars(spec.values)
    dead_times = spec.drawing.dead_times.items()
    return [f"{name} ({1e3 * tree.value(numbers):g} ms)" for name, tree in dead_times]


def _longest_delay(columns: Mapping[str, Any]) -> int:
    """The most ticks by which a result of the vectors is late."""
    late = [column.max() for name, column in columns.items() if name.startswith("late_")]
    return int(max(late, default=0))


def _amplifier_ticks(spec: Spec, controller: ExportedController) -> float:
    """The ticks by which the amplifier of a built-in controller's device is late."""
    if spec.drawing:
        return 0.0
    return spec.values["device.delay"] + spec.values["device.dead_time"] * controller.loop.rate


def _sums(spec: Spec, controller: ExportedController) -> Iterator[str]:
    """Lines that say what enters each output, one for each term."""
    for port, made in terms_of(spec).items():
        yield f" *   {port} = {made['sum']}"
        for term in made["terms"]:
            yield f" *     {term['coefficient']:g} times {term['from']}"
    for port in controller.beside:
        yield f" *   {as_drawn(port)}: from outside alone, so the host's"


def _values(
    spec: Spec, controller: ExportedController, entry: str, steps: Steps | None
) -> dict[str, Any]:
    """The texts for the templates' names. entry: the signal from outside that the example gives."""
    loop = controller.loop
    kinds, ticks = _phases(controller, steps)
    names = [controller.places[name] for name in controller.ticks.places]
    functions = [
        tick_function(index, program, names) for index, program in enumerate(controller.programs)
    ]
    in_drawing = bool(spec.drawing)
    texts = {
        "entry": f"{entry} = 1 from rest" if in_drawing else "pushed with 1 N from rest",
        "own_header": "controller.h",
        "title": "A controller that a spec draws" if in_drawing else f"The controller {spec.kind}",
        "version": __version__,
        "name": comment(spec.name),
        "digest": spec.sha256,
        "tick_ms": f"{1e3 * loop.tick:g}",
        "plants": ", ".join(block.name for block in loop.blocks if block.plant),
        "frame": loop.frame,
        "count": len(controller.outputs),
        "programs": "\n".join(functions),
        "operations": operations_of(functions),
        "kinds": listed(kinds),
        "phases": len(ticks),
        "table": listed(controller.table),
        "sets": len(controller.table) // len(controller.ticks.sets),
        "cases": "\n".join(branch(index) for index in reversed(range(len(functions)))),
        "sums": "\n".join(_sums(spec, controller)),
        "places": "\n".join(f"    {name}," for name in controller.places.values()),
    }
    texts |= constants({"fast_hz": loop.rate, "T": loop.tick})
    texts |= _wall(controller)
    texts |= _results(controller, ticks)
    return texts | _steps(steps) if steps else texts


def branch(index: int) -> str:
    """The branch of a switch that runs a program; the first one is that of all other values."""
    label = f"case {index}" if index else "default"
    return f"    {label}:\n        tick_{index}(s);\n        break;"


def _wall(controller: ExportedController) -> dict[str, Any]:
    """The texts about the wall, and about the place of a program in the table, which depends on
    it."""
    wall = controller.loop.wall
    position = wall.position if wall else None
    touched_at_rest = controller.loop.walled and (position is None or position < 0.0)
    place = " + 2 * in_time" if controller.late else ""
    if wall:
        place += " + (unsigned int)s->touching"
    return {
        "place": place,
        "touching": int(touched_at_rest),
        "one_sided": int(position is not None),
        "pulls": int(wall is None or wall.pulls),
        "wall_depth": controller.places[DEPTH],
        "wall_speed": controller.places[SPEED],
        "wall_force": controller.places[FORCE],
        **constants(
            {
                "K": wall.K if wall else 0.0,
                "B": wall.B if wall else 0.0,
                "position": position or 0.0,
            }
        ),
    }


def _phases(controller: ExportedController, steps: Steps | None) -> tuple[list[int], list[int]]:
    """The kind of each tick of a frame, and a tick with each phase that slow blocks and results
    have.

    With steps that the caller triggers the kinds are in rows, one for each length of the frame
    before, and the last phase is that of all ticks in which no slow block runs.
    """
    if steps is None:
        return controller.ticks.kinds, list(range(controller.loop.frame))
    latest = max(block.rhythm.phases[0] for block in controller.loop.blocks if block.rhythm.periods)
    starts = controller.loop.frames.starts
    last = steps.lengths.index(max(steps.lengths))
    if steps.lengths[last] <= latest + 1:
        raise UsageError(f"export: expected frames of more than {latest + 1} ticks, found none")
    rest = starts[last] + latest + 1
    kinds = []
    for start in (*starts[1:], starts[0]):  # the frame after one of each length
        kinds += [
            controller.ticks.kinds[tick] for tick in (*range(start, start + latest + 1), rest)
        ]
    return kinds, [*range(latest + 1), rest]


def _steps(steps: Steps) -> dict[str, Any]:
    """The texts about slow steps that the caller triggers."""
    nominal = steps.frames.nominal
    longest = max(steps.lengths)
    if nominal:
        over = f"always over {nominal:g} ticks"
    else:
        over = "over the ticks since their last one"
    places = {length: place for place, length in enumerate(steps.lengths)}
    lengths = ", ".join(map(str, steps.lengths))
    return {
        "lengths": fill(lengths, 110, subsequent_indent=" *   "),  # letters of a line
        "nominal": over,
        "longest": longest,
        "length_of": listed([places.get(ticks, -1) for ticks in range(longest + 1)]),
        "before": steps.frames.ticks[-1],
        "usual": "WS_NEXT" if steps.usual == NEXT_SLOW_STEP else steps.usual,
        "pattern": listed(steps.frames.ticks),
        "pattern_count": len(steps.frames.ticks),
    }


def _signals(controller: ExportedController, members: Mapping[str, str]) -> dict[str, str]:
    """The texts with a line for each input, or for each output."""
    entries = {signal for _, signal in controller.loop.entries}
    declared_inputs = []
    given = []
    read = []
    for name in controller.inputs:
        member = members[name]
        note = _note(controller, name) if name in entries else ""
        declared_inputs.append(f"    double {member}; /* {name}{note} */")
        given.append(f"    z[{controller.places[name]}] = in.{member};")
        read.append(f"        in.{member} = strtod(at + 1, &at);")
    declared_outputs = []
    taken = []
    compared = []
    for name in controller.outputs:
        member = members[name]
        port = as_drawn(name)
        declared_outputs.append(f"    double {member}; /* {port} */")
        taken.append(f"    out.{member} = z[{controller.places[name]}];")
        compared.append(f'        compare(out.{member}, strtod(at + 1, &at), "{port}", ticks);')
    return {
        "inputs": "\n".join(declared_inputs),
        "outputs": "\n".join(declared_outputs),
        "given": "\n".join(given),
        "taken": "\n".join(taken),
        "read": "\n".join(read),
        "compared": "\n".join(compared),
    }


def _note(controller: ExportedController, name: str) -> str:
    """What a comment says of a signal from outside that is part of outputs."""
    ports = []
    for output in controller.outputs:
        terms = controller.loop.wires[output.removesuffix(" besides")]
        if any(source == name for _, source in terms):
            ports.append(as_drawn(output))
    if ports:
        return f"; part of {', '.join(ports)}: 0 where it acts on the device itself"
    return ""


def _newer_forces(controller: ExportedController, ticks: Sequence[int]) -> list[list[int]]:
    """For each result and tick, how many forces of the wall are newer when it is shown; -2 if it
    is not shown."""
    frame = controller.loop.frame
    newer = []
    for result in controller.results:
        row = []
        for tick in ticks:
            if not result.shown(tick):
                row.append(-2)
                continue
            made = result.origin.count(tick + frame) - result.origin.runs(tick)
            row.append(made - 1 - result.number(tick + frame))
        newer.append(row)
    return newer


def _results(controller: ExportedController, ticks: Sequence[int]) -> dict[str, Any]:
    """The texts about slow results: for each of them, when it is shown, and how many forces of
    the wall are newer by then."""
    results = controller.results
    newer = _newer_forces(controller, ticks)
    computed = []
    come = []
    for result in results if controller.late else ():
        computed.append([controller.places[signal] for signal in result.signals])
        come.append([controller.places[arrived(signal)] for signal in result.signals])
    return {
        "groups": len(results),
        "most": max((len(result.signals) for result in results), default=1),
        "ring": max((count for row in newer for count in row), default=0) + 2,
        "behind": ",\n    ".join(f"{{{listed(row)}}}" for row in newer),
        "zero_groups": ", ".join(str(int(result.zero)) for result in results),
        "messages": ", ".join(str(int(bool(result.channel))) for result in results),
        "told": ", ".join(str(int(result.touches)) for result in results),
        "sizes": ", ".join(str(len(result.signals)) for result in results),
        "computed": ", ".join(f"{{{', '.join(row)}}}" for row in computed),
        "arrived": ", ".join(f"{{{', '.join(row)}}}" for row in come),
    }


def listed(numbers: Sequence[int]) -> str:
    """Numbers with commas, NUMBERS_IN_A_LINE in a line."""
    lines = []
    for start in range(0, len(numbers), NUMBERS_IN_A_LINE):
        lines.append(", ".join(map(str, numbers[start : start + NUMBERS_IN_A_LINE])))
    return ",\n    ".join(lines)
