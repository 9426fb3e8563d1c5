"""One controller of a loop as C, with the rest of the loop around it in its check."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from textwrap import wrap

import numpy as np

from wavesweep import __version__
from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import Spec
from wavesweep.simulation.controller_group import ControllerGroup, group_of
from wavesweep.simulation.experiment import refuse_what_makes_no_loop
from wavesweep.simulation.export.controller import identifiers, refuse_large
from wavesweep.simulation.export.source import branch, listed
from wavesweep.simulation.export.text import comment, filled, number, table_of
from wavesweep.simulation.export.tick_functions import tick_function
from wavesweep.simulation.from_spec import hand_force
from wavesweep.simulation.hardware import Effects
from wavesweep.simulation.keys import entry_of
from wavesweep.simulation.march import March, Running
from wavesweep.simulation.tick_sums import Program, TickSums, arrived

KEPT, ZERO = -1, -2  # in place of the tick of a message that comes: none does, and none is zero


def exported_controller(spec: Spec, name: str, about: Sequence[str]) -> dict[str, str]:
    """Return the files of one controller of a spec in C: name -> text.

    name: see `group_of`. about: lines for the header, what was analysed around it. The vectors,
    and the loop that `make check` closes, are the linear loop under the input of [simulate], with
    its messages and without its effects of hardware.

    Errors: UsageError as for `group_of` and `exported`, and for a controller that gets back within
    its step what it gives.
    """
    spec = spec.asking("simulate")
    refuse_what_makes_no_loop(spec)
    group = group_of(spec, name)
    run = _Run(spec, group)
    in_c = dict(zip(run.signals, identifiers(run.signals), strict=True))
    flags = {"sent": bool(run.sent), "single": False}
    values = _texts(spec, name, group, in_c, about) | run.texts()
    stem = values["stem"]
    return {
        f"{stem}.h": filled("step.h", flags, values),
        f"{stem}.c": filled("guards.c", flags, values) + filled("step.c", flags, values),
        "check.c": filled("check_step.c", flags, values),
        "vectors.csv": table_of(run.columns(in_c)),
        "Makefile": filled("Makefile.step", flags, values),
    }


def _texts(
    spec: Spec, name: str, group: ControllerGroup, in_c: Mapping[str, str], about: Sequence[str]
) -> dict[str, str]:
    """The texts for names in the templates that need no run. in_c: the names of signals in C."""
    stem = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")
    inputs = [in_c[signal] for signal in group.inputs]
    outputs = [in_c[signal] for signal in group.outputs]
    declared = [f"double {entry}" for entry in inputs] + [f"double *{result}" for result in outputs]
    period = group.every * group.loop.tick
    return {
        "title": f"The controller {comment(name)}",
        "own_header": f"{stem}.h",
        "stem": stem,
        "version": __version__,
        "name": comment(spec.name),
        "digest": spec.sha256,
        "period": number(period),
        "period_ms": f"{1e3 * period:g}",
        "about": "\n".join(_commented(about)),
        "arguments": ", ".join(declared),
        "passed": ", ".join([*inputs, *outputs]),
        **_step_texts(group, in_c),
    }


def _commented(lines: Sequence[str]) -> Iterator[str]:
    """Yield lines of a comment in C, folded."""
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()) + 4)
        folded = wrap(comment(line), 120, subsequent_indent=indent, break_long_words=False)
        yield from (f" * {part}".rstrip() for part in folded or [""])


def _step_texts(group: ControllerGroup, in_c: dict[str, str]) -> dict[str, object]:
    """The texts of a controller's own programs, one for each of its steps in turn."""
    wires = group.own_wires
    ticks = TickSums(replace(group.loop, blocks=group.blocks, wires=wires, away=wires))
    programs: list[Program] = []
    turns = []
    for tick in range(group.first, group.first + ticks.loop.frame, group.every):
        program = ticks.program(tick, frozenset(), touching=True)
        if program not in programs:
            programs.append(program)
        turns.append(programs.index(program))
    refuse_large(programs, len(programs))
    z = {signal: ticks.place(signal) for signal in (*group.inputs, *group.outputs)}
    names = identifiers([*ticks.places], "ws_z_")
    functions = [tick_function(index, part, names) for index, part in enumerate(programs)]
    return {
        "places": "\n".join(f"    {part}," for part in names),
        "size": len(names),
        "programs": "\n".join(functions),
        "turns": listed(turns),
        "count": len(turns),
        "cases": "\n".join(branch(index) for index in reversed(range(len(functions)))),
        "given": "\n".join(f"    s->z[{names[z[part]]}] = {in_c[part]};" for part in group.inputs),
        "taken": "\n".join(
            f"    *{in_c[part]} = s->z[{names[z[part]]}];" for part in group.outputs
        ),
    }


class _Run:
    """The run of the whole linear loop, and the programs of its ticks around the controller.

    signals: what the controller reads and gives. sent: signals that messages and slow results
    bring, each with these. programs: each kind of tick, and whether the controller makes a step in
    it. rows: of each tick, its program, the input, the tick of the message that comes of each of
    `sent`, whether the controller makes a step, and the signals.
    """

    def __init__(self, spec: Spec, group: ControllerGroup) -> None:
        self.group = group
        self.signals = [*group.inputs, *group.outputs]
        entry = entry_of(spec) or group.loop.hand
        self.march = March(
            replace(group.loop, device=""),
            Effects(seed=spec.simulate["seed"]),
            entry=entry,
            messages=spec.simulate["messages"] or {},
        )
        self.ticks = self.march.ticks
        late = self.march.results if self.march.late else []
        self.sent = [(result, signal) for result in late for signal in result.signals]
        self.entry = self.ticks.place(entry)
        self.programs: list[tuple[Program, bool]] = []
        self.rows: list[tuple[float, ...]] = []
        record = hand_force(spec).force.tolist()
        if not record:
            raise UsageError(
                "export: expected an experiment with at least one tick for the vectors, found none"
            )
        self.march.draw_lateness(len(record))
        running = Running(self.march.loop, self.ticks, late, None, late=self.march.late)
        for signal in self.signals:
            running.place(self._as_read(signal))
        under_way: list[list[tuple[int, int]]] = [[] for _ in late]
        for k, value in enumerate(record):
            if not np.isfinite(running.z).all():  # of a loop that is not stable
                break
            self._tick(running, k, value, under_way)

    def _tick(
        self, running: Running, k: int, value: float, under_way: list[list[tuple[int, int]]]
    ) -> None:
        """Run a tick, and write down its row; under_way: of each result, the ticks in which
        messages come and in which they were sent."""
        come = {}
        in_time: set[str] = set()
        for result, waiting in zip(running.results, under_way, strict=True):
            there = [sent for arrival, sent in waiting if arrival <= k]
            absent = ZERO if result.zero and result.shown(k) else KEPT
            come[id(result)] = there[-1] if there else absent
            waiting[:] = [(arrival, sent) for arrival, sent in waiting if sent > come[id(result)]]
            if not result.shown(k):
                continue
            number_shown = result.number(k)
            late_by = result.late[number_shown] if number_shown >= 0 else 0
            if late_by == 0:
                in_time.update(result.signals)
                waiting.clear()
            elif late_by is not None:
                waiting.append((k + late_by, k))
        running.z[self.entry] = value
        running.tick(k)
        steps = self.group.steps(k)
        kind = (self.ticks.program(k, frozenset(in_time), touching=True), steps)
        if kind not in self.programs:
            self.programs.append(kind)
        shown = [running.z[self.ticks.place(self._as_read(signal))] for signal in self.signals]
        coming = [come[id(result)] for result, _ in self.sent]
        self.rows.append((k, self.programs.index(kind), value, *coming, int(steps), *shown))

    def _as_read(self, signal: str) -> str:
        """The name under which the controller reads a signal: of one that may be late, what has
        come."""
        late = signal in self.ticks.late and not self.group.has(signal)
        return arrived(signal) if late else signal

    def columns(self, in_c: dict[str, str]) -> dict[str, np.ndarray]:
        """The columns of the vectors."""
        come = [f"comes_{signal}" for _, signal in self.sent]
        signals = [in_c[signal] for signal in self.signals]
        names = ["tick", "program", "given", *come, "step", *signals]
        whole = {"tick", "program", *come, "step"}
        columns = zip(names, zip(*self.rows, strict=True), strict=True)
        return {
            name: np.array(column, dtype=int if name in whole else float)
            for name, column in columns
        }

    def texts(self) -> dict[str, object]:
        """The texts of the loop around the controller."""
        split = [self._around(program) if steps else program for program, steps in self.programs]
        refuse_large(split, len(split))
        z = {signal: self.ticks.place(self._as_read(signal)) for signal in self.signals}
        sent = [
            (self.ticks.place(signal_name), self.ticks.place(arrived(signal_name)))
            for _, signal_name in self.sent
        ]
        names = identifiers([*self.ticks.places], "loop_")
        call = ["    make_step(z);"]
        functions = [
            tick_function(index, program, names, call if steps else ())
            for index, (program, (_, steps)) in enumerate(zip(split, self.programs, strict=True))
        ]
        inputs = [f"z[{names[z[signal]]}]" for signal in self.group.inputs]
        taken = [f"&z[{names[z[signal]]}]" for signal in self.group.outputs]
        compared = [
            f'        compare(z[{names[z[signal]]}], strtod(at + 1, &at), "{signal}", tick);'
            for signal in self.signals
        ]
        return {
            "loop_places": "\n".join(f"    {signal_name}," for signal_name in names),
            "ticks": len(self.rows),
            "count_sent": len(sent),
            "computed": ", ".join(names[place] for place, _ in sent),
            "arrived": ", ".join(names[place] for _, place in sent),
            "loop_programs": "\n".join(functions),
            "loop_cases": "\n".join(branch(index) for index in reversed(range(len(functions)))),
            "entry": names[self.entry],
            "call": ", ".join([*inputs, *taken]),
            "compared": "\n".join(compared),
            "signals": len(self.signals),
        }

    def _around(self, program: Program) -> Program:
        """A program without the lines of the controller: `first` has what this reads, and `second`
        all else."""
        mine = set()
        for name, place in self.ticks.places.items():
            if self.group.has(name.removesuffix(" alone").removesuffix(" arrived")):
                mine.add(place)
        for _, signal in self.sent:
            mine.discard(self.ticks.place(arrived(signal)))
        outside = [line for line in program.first if line[0] not in mine]
        needed = {self.ticks.place(self._as_read(signal)) for signal in self.group.inputs}
        for target, terms in reversed(outside):
            if target in needed:
                needed.update(source for _, source in terms)
        computed = {target for target, _ in program.first}
        if back := sorted(needed & mine & computed):
            names = [*self.ticks.places]
            raise UsageError(
                f"--controller: expected a rest that answers a tick later at the earliest, found {names[back[0]]}, which comes back to "
                f"{self.group.name} within its step; a delay on the way, or the blocks on it named with commas, make it a program"
            )
        kept_lines = [line for line, (target, _) in enumerate(program.keeps) if target not in mine]
        return program._replace(
            first=[line for line in outside if line[0] in needed],
            second=[line for line in outside if line[0] not in needed],
            keeps=[program.keeps[line] for line in kept_lines],
            moves=[move for move in program.moves if move[1] not in mine],
            stops=[
                (kept_lines.index(line), *places)
                for line, *places in program.stops
                if line in kept_lines
            ],
        )
