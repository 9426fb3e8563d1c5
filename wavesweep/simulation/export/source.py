"""The controller of a loop as C: the programs of its ticks, line by line, without the device.

The device consists of the blocks whose inputs are always held over a tick: masses and continuous
models. It is the host's.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, product
from operator import itemgetter
from textwrap import fill
from typing import Any, NamedTuple

from wavesweep import __version__
from wavesweep.engine.drawing import AT, PORT, scalars
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import sum_of, text_of, value_of
from wavesweep.program.spec import Spec
from wavesweep.simulation.experiment import refuse_what_makes_no_loop
from wavesweep.simulation.export.gains import CoefficientTable, Gains, gains_of, named
from wavesweep.simulation.export.repeated_experiment import (
    NEXT_SLOW_STEP,
    Steps,
    drawing_of,
    loop_with,
    march_of,
    steps_of,
    timing_of,
)
from wavesweep.simulation.export.text import comment, constants, factor, filled, number, table_of
from wavesweep.simulation.from_spec import effects_of, hand_force
from wavesweep.simulation.laws import Sum
from wavesweep.simulation.march import Results, results_of
from wavesweep.simulation.named import Named
from wavesweep.simulation.running_blocks import (
    DEPTH,
    FORCE,
    REACTION,
    SEEN,
    SPEED,
    MarchedLoop,
    RunningBlock,
    divided,
)
from wavesweep.simulation.tick_sums import Line, Program, TickSums, arrived, besides

MOST_PRODUCTS = 50_000  # in all programs together; each is a product in the source
MOST_PROGRAMS = 1000


class ExportedController(NamedTuple):
    """A controller without its device.

    ticks: the lines and places of its programs. programs; table: the number of the program for each
    kind of tick, for each set of slow results that are in time (bits), and for a wall that is free
    or touched. results: slow results that may be late, or that show whether the wall is touched.
    inputs, outputs: names of numbers. late: whether results may be late. places: the name in C of
    each place. beside: ports of the device that only signals from outside enter.
    """

    loop: MarchedLoop
    ticks: TickSums
    programs: list[Program]
    table: list[int]
    results: list[Results]
    inputs: list[str]
    outputs: list[str]
    late: bool
    places: dict[str, str]
    beside: dict[str, Sum]


def _longest_delay(columns: Mapping[str, Any]) -> int:
    """The most ticks by which a result of the vectors is late."""
    return max(
        (ticks for name in columns if name.startswith("late_") for ticks in columns[name].tolist()),
        default=0,
    )


def _table_of(paths: Sequence[str]) -> CoefficientTable:
    """A table of coefficients whose variables have the last words of the paths as names."""
    return CoefficientTable(
        dict(zip(paths, _identifiers([path.rpartition(".")[2] for path in paths]), strict=True))
    )


def exported(spec: Spec, *, gains: bool = False) -> dict[str, str]:
    """Return the files of the controller of a spec in C: name -> text.

    gains: whether numbers that determine coefficients by arithmetic are variables in C, see
    `gains_of`.

    The vectors are the experiment of the spec's [simulate] table: what the controller reads and
    gives in each tick, and the ticks by which slow results are late.

    Errors: `UsageError` if the loop cannot be simulated, or if no tick could be, if it has no
    device, nothing but a device, or one that responds within the tick, or too many terms;
    `IllPosedLoopError` if what goes round within a tick has no solution.
    """
    spec = spec.asking("simulate")
    refuse_what_makes_no_loop(spec)
    effects, steps = effects_of(spec), steps_of(spec)
    all_steps = steps and steps.all
    drawing = drawing_of(spec, steps, gains=gains)

    def made(values: Mapping[str, Any]) -> ExportedController:
        loop = loop_with(spec, drawing, values, all_steps)
        return controller_of(loop, bool(effects.late or effects.dropped or loop.channels or steps))

    loop, gains_found = loop_with(spec, drawing, spec.values, all_steps), Gains((), ())
    if gains:
        gains_found = gains_of(spec, made, () if loop.wall is None else spec.wall)
    numbered = made(named(spec.values, gains_found.paths))
    march = march_of(
        spec,
        loop,
        steps,
        numbered.inputs,
        {name: name.removesuffix(" besides") for name in numbered.outputs},
    )
    entry, signals = march.entry, march.under(hand_force(spec).force).signals
    count = len(signals["time_s"])
    if not count:
        raise UsageError(
            "export: expected an experiment with at least one tick for the vectors, found none"
        )
    members = dict(
        zip(
            (*numbered.inputs, *numbered.outputs),
            _identifiers([*numbered.inputs, *numbered.outputs]),
            strict=True,
        )
    )
    columns = timing_of(march, steps, count, late=numbered.late)
    columns |= {
        member: signals[name if name in numbered.inputs else SEEN + name]
        for name, member in members.items()
    }
    table = _table_of(gains_found.paths)
    numbered = numbered._replace(programs=[table.of(program) for program in numbered.programs])
    flags, values = _values(spec, numbered, march.loop, members, entry, steps)
    values["pending"] = (_longest_delay(columns) + 2) * max(1, len(numbered.results))
    flags |= {"gains": bool(gains_found.paths), "constants": bool(gains_found.constants)}
    flags["library"] = any("sqrt" in line for line in table.lines)
    values["and_no_library"] = "" if flags["library"] else " and no mathematical library"
    values |= _gains(spec, table, gains_found.constants)
    return {
        "controller.h": filled("controller.h", flags, values),
        "controller.c": filled("guards.c", flags, values) + filled("controller.c", flags, values),
        "check.c": filled("check.c", flags, values),
        "example.c": filled("example.c", flags, values),
        "vectors.csv": table_of(columns),
        "Makefile": filled("Makefile", flags, values),
    }


def terms_of(spec: Spec) -> dict[str, dict[str, Any]]:
    """What enters each output of a spec's controller, by its port of a plant; one that only inputs
    from outside enter is none.

    A port has its `sum` as a text, and `terms`: what each is `from`, its `gain` as a text, and the
    `coefficient` that it is.
    """
    drawing, numbers = drawing_of(spec), scalars(spec.values)
    plants, hand = (
        {block.name for block in drawing.blocks if block.plant},
        (drawing.hand or ("",))[0],
    )
    wires = {
        port: tuple(term for term in terms if term[0] != hand) for port, terms in drawing.wires
    }
    outside = {signal for _, signal, _ in drawing.inputs}
    return {
        port: {
            "sum": sum_of(terms),
            "terms": [
                {"from": name, "gain": text_of(gain), "coefficient": 0.0 + value_of(gain, numbers)}
                for name, gain in terms
            ],
        }
        for port, terms in wires.items()
        if port.rpartition(".")[0] in plants and any(name not in outside for name, _ in terms)
    }


def controller_of(loop: MarchedLoop, late: bool) -> ExportedController:
    """Return the controller of a loop, and what it reads of its device and puts there.

    late: whether its slow results may be late. Errors: see `exported`.
    """
    plants = [block for block in loop.blocks if block.plant]
    _refuse(loop, plants)
    one_sided = loop.wall is not None and loop.wall.position is not None
    results = results_of(loop) if late or one_sided else []
    outside = [*loop.inputs, *(signal for _, signal in loop.entries)]
    at_plants = [f"{block.name}.{port}" for block in plants for port in block.inputs]
    pushed = [
        port
        for port in at_plants
        if any(gain and name not in outside for gain, name in loop.wires.get(port, ()))
    ]
    unforced = {*at_plants}.difference(pushed)
    cut = _cut_at_plants(loop, unforced)
    delayed = [signal for result in results for signal in result.signals] if late else ()
    ticks = TickSums(cut, [block.name for block in plants], delayed)
    programs, table = _programs(ticks, results if late else [], one_sided and loop.gated)
    names = list(ticks.places)
    read = {
        names[source] for program in programs for _, terms in _lines(program) for _, source in terms
    }
    inputs = [*(f"{block.name}.{port}" for block in plants for port in block.outputs), *outside]
    inputs = [name for name in inputs if name in read]
    if not pushed or not inputs:
        raise UsageError(
            "export: expected a controller that reads the device and acts on it, found one that does not"
        )
    for name in (DEPTH, SPEED, FORCE, *(naming(s) for s in delayed for naming in (str, arrived))):
        ticks.at(name)  # even if nothing reads it
    places = dict(
        zip(
            ticks.places,
            _identifiers([name.replace(" ", "_") for name in ticks.places], "ws_z_"),
            strict=True,
        )
    )
    sums = {port: loop.wires[port] for port in sorted(unforced) if loop.wires.get(port)}
    outputs = [besides(port) for port in pushed]
    return ExportedController(
        cut, ticks, programs, table, results, inputs, outputs, late, places, sums
    )


def _cut_at_plants(loop: MarchedLoop, unforced: set[str]) -> MarchedLoop:
    """The wires that a controller computes: those of ports, without the ports of plants that it
    does not push."""
    ports = {
        port: loop.wires[port] for port in loop.wires if port in loop.ports and port not in unforced
    }
    cut = replace(
        loop,
        wires=ports,
        away={port: terms for port, terms in loop.away.items() if port not in unforced},
    )
    if (
        cut.wall_rhythm != loop.wall_rhythm
    ):  # the force against the hand reads the wall's in every tick
        cut = replace(loop, wires=ports | {REACTION: loop.wires[REACTION]})
    return cut


def _refuse(loop: MarchedLoop, plants: Sequence[RunningBlock]) -> None:
    """Raise UsageError if the loop is not a device, whose outputs are states, and a controller."""
    if not plants or (len(plants) == len(loop.blocks) and not loop.wall):
        problem = "nothing else" if plants else "none"
        raise UsageError(
            f"export: expected a device (continuous blocks, as a mass) and further blocks, found {problem}"
        )
    if waits := [f"block.{block.name}" for block in loop.blocks if block.type == "dead time"]:
        problem = f"{waits[0]} with a dead time in seconds, which is between the ticks of a program"
        raise UsageError(
            f"export: expected delays of whole steps, or none where the network or the motor is what is late, found {problem}"
        )
    read = set(map(itemgetter(1), chain.from_iterable(loop.wires.values())))
    for block in plants:
        if any(
            factor and name in block.inputs
            for port in block.outputs
            if f"{block.name}.{port}" in read
            for factor, name in block.law.gives[port]
        ):
            problem = f"block.{block.name} with direct terms"
            raise UsageError(
                f"export: expected a device whose outputs follow its inputs a tick later, found {problem}"
            )


def _programs(
    ticks: TickSums, results: Sequence[Results], gated: bool
) -> tuple[list[Program], list[int]]:
    """The programs, and which of them belongs to each kind of tick, results in time and contact."""
    firsts = map(ticks.kinds.index, range(len(ticks.sets)))
    number: dict[tuple, int] = {}
    programs, table = [], []
    for k, mask, touching in product(firsts, range(2 ** len(results)), (False, True)):
        in_time = [result for g, result in enumerate(results) if mask >> g & 1 and result.shown(k)]
        key = (
            k,
            frozenset(chain.from_iterable(result.signals for result in in_time)),
            touching or not gated,
        )
        if key not in number and len(number) < MOST_PROGRAMS:
            programs.append(ticks.program(*key))
        table.append(number.setdefault(key, len(number)))
    terms = sum(len(line[1]) for program in programs for line in _lines(program))
    if terms > MOST_PRODUCTS or len(number) > MOST_PROGRAMS:
        size = f"{terms} in {len(number)}"
        raise UsageError(
            f"export: expected at most {MOST_PRODUCTS} terms in {MOST_PROGRAMS} kinds of ticks, found {size}"
        )
    return programs, table


def _lines(program: Program) -> list[Line]:
    return [*program.first, *program.second, *program.keeps]


def _identifiers(signals: Sequence[str], start: str = "ws_") -> list[str]:
    """A name in C for each signal, no two the same; start: of all of them, which no word or
    macro of C has, as EOF or unix."""
    identifiers: dict[str, None] = {}
    for signal in map(_port, signals):
        base = name = start + re.sub(r"\W", "_", signal, flags=re.ASCII)
        count = 1
        while name in identifiers:
            count += 1
            name = f"{base}_{count}"
        identifiers[name] = None
    return list(identifiers)


def _values(
    spec: Spec,
    own: ExportedController,
    whole: MarchedLoop,
    members: Mapping[str, str],
    entry: str,
    steps: Steps | None,
) -> tuple[dict[str, bool], dict[str, Any]]:
    """Flags and texts for the templates' names.

    whole: the loop with its amplifier. entry: the signal from outside that the example gives.
    """
    loop, wall = own.loop, own.loop.wall
    kinds, ticks = _phases(own, steps)
    programs = [_function(number, program, own) for number, program in enumerate(own.programs)]
    cases = [
        f"    {f'case {i}' if i else 'default'}:\n        tick_{i}(s);\n        break;"
        for i in range(len(programs))[::-1]
    ]
    texts = {
        "entry": f"{entry} = 1 from rest" if spec.drawing else "pushed with 1 N from rest",
        "title": "A controller that a spec draws"
        if spec.drawing
        else f"The controller {spec.kind}",
        "version": __version__,
        "name": comment(spec.name),
        "digest": spec.sha256,
        "tick_ms": f"{1e3 * loop.tick:g}",
        "plants": ", ".join(block.name for block in loop.blocks if block.plant),
        "frame": loop.frame,
        "count": len(own.outputs),
        "programs": "\n".join(programs),
        "kinds": _listed(kinds),
        "phases": len(ticks),
        "table": _listed(own.table),
        "sets": len(own.table) // len(own.ticks.sets),
        "place": " + 2 * in_time" * own.late + " + (unsigned int)s->touching" * (wall is not None),
        "cases": "\n".join(cases),
        "touching": int(
            loop.walled and not (wall and wall.position is not None and wall.position >= 0.0)
        ),
        "one_sided": int(wall is not None and wall.position is not None),
        "pulls": int(wall is None or wall.pulls),
        "wall_depth": own.places[DEPTH],
        "wall_speed": own.places[SPEED],
        "wall_force": own.places[FORCE],
    }
    late = (
        0.0
        if spec.drawing
        else spec.values["device.delay"] + spec.values["device.dead_time"] * loop.rate
    )
    numbers = {
        "fast_hz": loop.rate,
        "T": loop.tick,
        "K": wall.K if wall else 0.0,
        "B": wall.B if wall else 0.0,
    }
    numbers["position"] = (wall and wall.position) or 0.0
    flags = {
        "wall": wall is not None,
        "late": own.late,
        "results": bool(own.results),
        "tells": any(result.touches for result in own.results),
        "several": len(programs) > 1,
        "zero": own.late and any(result.zero for result in own.results),
        "steps": steps is not None,
        "amplifier": bool(late),
    }
    texts |= {"late": f"{late:g}", **_signals(own, members), **_results(own, ticks)}
    texts |= _host(own, whole, members, entry, divided(late)[0])
    texts |= _steps(steps) if steps else {}
    sums = []  # what enters each output, a line for each term
    for port, made in terms_of(spec).items():
        sums.append(f" *   {port} = {made['sum']}")
        sums += [f" *     {term['coefficient']:g} times {term['from']}" for term in made["terms"]]
    sums += [f" *   {_port(port)}: from outside alone, so the host's" for port in own.beside]
    texts["sums"] = "\n".join(sums)
    texts["places"] = "\n".join(f"    {name}," for name in own.places.values())
    return flags, constants(numbers) | texts


def _phases(own: ExportedController, steps: Steps | None) -> tuple[list[int], list[int]]:
    """The kind of each tick of a frame, and a tick with each phase that slow blocks and results
    have.

    With steps that the caller triggers the kinds are in rows, one for each length of the frame
    before, and the last phase is that of all ticks in which no slow block runs.
    """
    if steps is None:
        return own.ticks.kinds, [*range(own.loop.frame)]
    latest = max(block.rhythm.phases[0] for block in own.loop.blocks if block.rhythm.periods)
    starts, last = own.loop.frames.starts, steps.lengths.index(max(steps.lengths))
    if steps.lengths[last] <= latest + 1:
        raise UsageError(f"export: expected frames of more than {latest + 1} ticks, found none")
    rest = starts[last] + latest + 1
    after = (*starts[1:], starts[0])  # the frame after one of each length
    kinds = [
        own.ticks.kinds[k] for start in after for k in (*range(start, start + latest + 1), rest)
    ]
    return kinds, [*range(latest + 1), rest]


def _steps(steps: Steps) -> dict[str, Any]:
    """The texts about slow steps that the caller triggers."""
    nominal = (
        f"always over {steps.frames.nominal:g} ticks"
        if steps.frames.nominal
        else "over the ticks since their last one"
    )
    places = {length: i for i, length in enumerate(steps.lengths)}
    return {
        "lengths": fill(", ".join(map(str, steps.lengths)), 110, subsequent_indent=" *   "),
        "nominal": nominal,
        "longest": max(steps.lengths),
        "length_of": _listed([places.get(ticks, -1) for ticks in range(max(steps.lengths) + 1)]),
        "before": steps.frames.ticks[-1],
        "usual": "WS_NEXT" if steps.usual == NEXT_SLOW_STEP else steps.usual,
        "pattern": _listed(steps.frames.ticks),
        "pattern_count": len(steps.frames.ticks),
    }


def _gains(spec: Spec, table: CoefficientTable, constants: Sequence[str]) -> dict[str, Any]:
    """The texts about gains, and about numbers that are constants."""
    keys = spec.names.keys
    units = {
        path: f" {comment(keys[path].unit)}" if path in keys and keys[path].unit != "1" else ""
        for path in table.members
    }
    return {
        "gains": "\n".join(
            f"    double {name}; /* {path}: {spec.values[path]:g}{units[path]} */"
            for path, name in table.members.items()
        ),
        "set": "\n".join(
            f"    s->gains.{name} = {number(spec.values[path])};"
            for path, name in table.members.items()
        ),
        "coefficients": table.count,
        "computed_from_gains": "\n".join(table.lines),
        "constants": fill(
            ", ".join(constants), 110, initial_indent=" *   ", subsequent_indent=" *   "
        ),
    }


def _signals(own: ExportedController, members: Mapping[str, str]) -> dict[str, str]:
    """The texts with a line for each input, or for each output."""
    terms_besides = {
        name: [
            _port(output)
            for output in own.outputs
            if any(s == name for _, s in own.loop.wires[output.removesuffix(" besides")])
        ]
        for name in own.inputs
    }
    notes = {
        name: f"; part of {', '.join(ports)}: 0 where it acts on the device itself"
        for name, ports in terms_besides.items()
        if ports
    }
    outside = set(dict(own.loop.entries).values())
    lines = {
        "inputs": [
            f"    double {members[name]}; /* {name}{notes.get(name, '') * (name in outside)} */"
            for name in own.inputs
        ],
        "outputs": [f"    double {members[name]}; /* {_port(name)} */" for name in own.outputs],
        "given": [f"    z[{own.places[name]}] = in.{members[name]};" for name in own.inputs],
        "taken": [f"    out.{members[name]} = z[{own.places[name]}];" for name in own.outputs],
        "read": [f"        in.{members[name]} = strtod(at + 1, &at);" for name in own.inputs],
        "compared": [
            f'        compare(out.{members[name]}, strtod(at + 1, &at), "{_port(name)}", ticks);'
            for name in own.outputs
        ],
    }
    return {name: "\n".join(text_lines) for name, text_lines in lines.items()}


def _newer_forces(own: ExportedController, ticks: Sequence[int]) -> list[list[int]]:
    """For each result and tick, how many forces of the wall are newer when it is shown; -2 if it
    is not shown."""
    frame, behind = own.loop.frame, []
    for result in own.results:
        later = [
            result.origin.count(k + frame) - result.origin.runs(k) - 1 - result.number(k + frame)
            for k in ticks
        ]
        behind.append(
            [number if result.shown(k) else -2 for k, number in zip(ticks, later, strict=True)]
        )
    return behind


def _places_of_results(own: ExportedController) -> dict[str, list[list[str]]]:
    """The places of the signals of each result, computed and arrived; empty if no result may be
    late."""
    rows = {"computed": str, "arrived": arrived} if own.late else {}
    return {
        name: [[own.places[of(signal)] for signal in result.signals] for result in own.results]
        for name, of in rows.items()
    }


def _results(own: ExportedController, ticks: Sequence[int]) -> dict[str, Any]:
    """The texts about slow results: for each of them, when it is shown, and how many forces of
    the wall are newer by then."""
    results, behind = own.results, _newer_forces(own, ticks)
    most = max((len(result.signals) for result in results), default=1)
    texts = _places_of_results(own)
    return {
        "groups": len(results),
        "most": most,
        "ring": max((number for row in behind for number in row), default=0) + 2,
        "behind": ",\n    ".join(f"{{{_listed(row)}}}" for row in behind),
        "zero_groups": ", ".join(str(int(result.zero)) for result in results),
        "messages": ", ".join(str(int(bool(result.channel))) for result in results),
        "told": ", ".join(str(int(result.touches)) for result in results),
        "sizes": ", ".join(str(len(result.signals)) for result in results),
        "computed": ", ".join(f"{{{', '.join(row)}}}" for row in texts.get("computed", ())),
        "arrived": ", ".join(f"{{{', '.join(row)}}}" for row in texts.get("arrived", ())),
    }


def _function(number: int, program: Program, own: ExportedController) -> str:
    """A program as a function: a sum for each line, which begins with 0 and adds product after
    product, within limits."""
    names = [own.places[name] for name in own.ticks.places]

    def summed(lines: Iterable[Line]) -> Iterator[str]:
        for target, terms in lines:
            place = f"z[{names[target]}]"
            yield f"    {place} = {_sum(terms, names)};"
            if target in program.limits:
                low, high = map(factor, program.limits[target])
                yield f"    {place} = {place} < {low} ? {low} : {place} > {high} ? {high} : {place};"

    lines = [*summed(program.first)]
    if program.wall:
        lines.append(f"    meet(s, {factor(program.wall.yields)}, {factor(program.wall.slows)});")
        lines += summed(program.second)
    writes = _kept(program, names)
    for source, first, last in program.moves:
        writes += (
            [f"    for (i = {last - 1}; i > {first}; i--)", "        z[i] = z[i - 1];"]
            if last - first > 1
            else []
        )
        writes.append(f"    z[{first}] = z[{names[source]}];")
    head = [
        "    double *const z = s->z;",
        *(["    int i;"] * any(last - first > 1 for _, first, last in program.moves)),
    ]
    inner = [f"    {line}" for line in writes]
    body = [*head, *lines, *(["    { /* what is kept */", *inner, "    }"] if writes else [])]
    return f"static void tick_{number}(ws_state *s)\n{{\n" + "\n".join(body) + "\n}\n"


def _kept(program: Program, names: Sequence[str]) -> list[str]:
    """The lines of a program that compute all that is kept for the next tick, and then write it."""
    stops = {
        line: [f"z[{names[place]}]" for place in (*sources, program.keeps[line][0])]
        for line, *sources in program.stops
    }
    writes = []
    for i, (_, terms) in enumerate(program.keeps):
        total = _sum(terms, names)
        if i in stops:
            free, limited, driven, still = stops[i]
            up, down = (
                f"({free} > {limited} && {driven} > 0.0)",
                f"({free} < {limited} && {driven} < 0.0)",
            )
            total = f"{up} || {down} ? {still} : {total}"
        writes.append(f"    const double kept_{i} = {total};")
    return writes + [
        f"    z[{names[target]}] = kept_{i};" for i, (target, _) in enumerate(program.keeps)
    ]


def _sum(terms: Iterable[tuple[float, int]], names: Sequence[str]) -> str:
    return "0.0" + "".join(_term(gain, f"z[{names[source]}]") for gain, source in terms)


def _term(value: float, name: str) -> str:
    """A product to add; 1 and -1 change no bit of the number."""
    sign = {1.0: "+", -1.0: "-"}.get(value) if not isinstance(value, Named) else None
    return f" {sign} {name}" if sign else f" + {factor(value)} * {name}"


def _host(
    own: ExportedController, whole: MarchedLoop, members: Mapping[str, str], entry: str, late: int
) -> dict[str, Any]:
    """The texts of the device in the example: what is sensed, what pushes it, and how it moves.

    whole, entry: see `_values`. late: ticks after which what the amplifier is asked for is exerted,
    maybe before the last ends.
    """
    plants, sensed, pushed, moved, after = (
        [block for block in whole.blocks if block.plant],
        [],
        [],
        [],
        [],
    )
    names = [
        f"{block.name}.{name}" for block in plants for name in (*block.law.keeps, *block.inputs)
    ]
    own_names = dict(zip(names, _identifiers(names, "host_"), strict=True))

    def sum_of(part: RunningBlock, terms: Iterable[tuple[float, str]]) -> str:
        return "0.0" + "".join(
            _term(float(gain), own_names[f"{part.name}.{s}"]) for gain, s in terms if gain
        )

    for block in plants:
        ports = [(f"{block.name}.{port}", block.law.gives[port]) for port in block.outputs]
        sensed += [
            f"        in.{members[name]} = {sum_of(block, terms)};"
            for name, terms in ports
            if name in members
        ]
        for port in (f"{block.name}.{port}" for port in block.inputs):
            if AT in port:  # by how much it changes within the tick
                pushed.insert(-1, f"        {own_names[port]} = -asked[tick % {late}];")
                pushed.append(f"        {own_names[port]} += asked[(tick + 1) % {late}];")
                continue
            terms = own.beside.get(port) or [
                term for term in own.loop.wires.get(port, ()) if term[1] in own.loop.inputs
            ]
            share = sum(float(gain) for gain, name in terms if name == entry)
            force = f"out.{members[besides(port)]}" if besides(port) in members else "0.0"
            share_text = _term(share, "given") if share else ""
            pushed.append(
                f"        {own_names[port]} = {f'asked[tick % {late}]' if late else force}{share_text};"
            )
            pushed += [f"        asked[tick % {late}] = {force};"] * bool(late)
        for i, (name, terms) in enumerate(block.law.keeps.items(), len(moved)):
            moved.append(f"        next[{i}] = {sum_of(block, terms)};")
            after.append(f"        {own_names[f'{block.name}.{name}']} = next[{i}];")
    outside = (*own.loop.inputs, *(signal for _, signal in own.loop.entries))
    sensed += [
        f"        in.{members[s]} = {'given' if s == entry else '0.0'};"
        for s in own.inputs
        if s in outside
    ]
    shown = [
        *(f"in.{members[name]}" for name in own.inputs),
        *(f"out.{members[name]}" for name in own.outputs),
    ]
    return {
        "host": "\n".join(f"    double {name} = 0.0;" for name in own_names.values()),
        "amplifier_ticks": late,
        "size": len(moved),
        "header": ",".join(members.values()),
        "formats": ",%.17g" * len(shown),
        "printed": ", ".join(shown),
        "sensed": "\n".join(sensed),
        "pushed": "\n".join(pushed),
        "moved": "\n".join([*moved, *after]),
    }


def _port(name: str) -> str:
    """The name of a port as it is drawn."""
    return (name.rpartition(".")[2].replace(PORT, ".") if PORT in name else name).removesuffix(
        " besides"
    )


def _listed(numbers: Sequence[int]) -> str:
    """Numbers with commas, 40 in a line."""
    return ",\n    ".join(
        ", ".join(map(str, numbers[i : i + 40])) for i in range(0, len(numbers), 40)
    )
