"""Whether the energy of an output stays below a share of that of an input, whatever comes in.

In a frame the memory x goes on with what comes from outside, u = (u_1 .. u_m), a number for each tick in which the input is
read, and y has a number for each tick in which the output is looked at:

    x+ = A x + B u,   y = C x + D u.

Bounded real lemma: let P > 0 and

    [P 0; 0 g^2] - [A B; C D]' [P 0; 0 1] [A B; C D] > 0.                                             (1)

Then P - A' P A > 0, so that all modes of A are inside the unit circle, and the sum of y'y - g^2 u'u + x+' P x+ - x' P x over all
frames is negative: from rest, sum of y'y < g^2 sum of u'u. So the largest singular value of D + C (z - A)^-1 B is below g for
all z on the unit circle (Yakubovich 1962, Kalman 1963; of periodic systems by such lifting: Bittanti and Colaneri 2009).

At a cut the input is added to a signal in each tick in which that is made, and the output is the signal behind it, 1/(1 + L), less a
share of the input: 0 for the peak sensitivity Ms, 1/2 for 1 over the disk margin.
"""

from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from . import balls, form
from .balls import Cell, Refused
from .reader.loops import INPUT, OUTPUT, Instant, Schedule, Unreadable, scaled

CUT = "cut"  # the signal at a cut, and the input there


class Gain(NamedTuple):
    """What a gain is from and to, or the cut at which it is, the share of the input that is taken off, and its level."""

    source: str
    signal: str
    cut: str
    less: Fraction
    at_most: Fraction


def opened(tables: dict, schedule: Schedule, gain: Gain) -> Schedule:
    """The schedule with a memory for what comes in in each tick, and one for what comes out."""
    source = "!" + (CUT if gain.cut else source_of(tables, gain.source))
    kinds = dict(schedule.kinds)
    times = list(schedule.times)
    read = False
    for place, tick in schedule.ticks.items():
        time, kind = times[place]
        instant = kinds[kind]
        into = f"{INPUT}{tick}"
        equations = renamed(instant.equations, source, {into: 1})
        writes = renamed(instant.writes, source, {into: 1})
        reads = equations != instant.equations or writes != instant.writes
        read |= reads
        if reads or not gain.cut:
            shown = {_signal(schedule, equations, gain): 1}
            if gain.less:
                shown[into] = -gain.less
            writes[f"{OUTPUT}{tick}"] = shown
        kinds[kind, tick] = Instant(equations, writes)
        times[place] = time, (kind, tick)
    if not read:
        raise Refused(f"nothing reads the input {gain.source or gain.cut}")
    present = {kind for _, kind in times}
    kinds = {kind: instant for kind, instant in kinds.items() if kind in present}
    found = replace(schedule, kinds=kinds, times=times)
    refuse_between_ticks(found, source)
    return found


def refuse_between_ticks(schedule: Schedule, source: str) -> None:
    for instant in (*schedule.kinds.values(), schedule.motion):
        if any(source in row for row in (*instant.equations.values(), *instant.writes.values())):
            raise Refused(f"the input {source[1:]} is read between ticks")


def source_of(tables: dict, name: str) -> str:
    """The signal from outside that an input of a spec is."""
    if "controller" in tables:
        if name != "f_h":
            raise Unreadable(f"the input of a controller is f_h, and not {name!r}")
        return "hand"
    ports = tables.get("ports", {})
    port = ports.get("inputs", {}).get(name, name)
    return port["signal"] if isinstance(port, dict) else port


def renamed(rows: dict, source: str, fed: dict) -> dict:
    """Equations with a form in the place of an input."""
    found = {}
    for name, row in rows.items():
        found[name] = {term: c for term, c in row.items() if term != source}
        if source in row:
            found[name] |= scaled(row[source], fed)
    return found


def _signal(schedule: Schedule, equations: dict, gain: Gain) -> str:
    if gain.cut:
        return CUT
    for name in (f"output {gain.signal}", schedule.shown.get(gain.signal, gain.signal)):
        if name in equations:
            return name
    raise Unreadable(f"the signal {gain.signal!r} is not known")


def stays_below(cell: Cell, rows: dict, states: list[str], P: form.Matrix, level: Fraction) -> bool:
    """Whether (1) holds all over a cell. rows: of a frame; P: over the states."""
    into = sorted({name for row in rows.values() for name in row if name.startswith(INPUT)})
    out = sorted(name for name in rows if name.startswith(OUTPUT))
    M = form.matrix_of(cell, rows, [*states, *out], [*states, *into])
    shown, allowed = (weights(names, out) for names in (out, into))
    stored = form.bordered(P, [balls.ball(weight)[1] + 1 for weight in shown])
    limit = form.bordered(P, [balls.ball(level * level * weight)[1] for weight in allowed])
    return form.decreases(limit, [(None, M, stored)])


def weights(names: list[str], out: list[str]) -> list[Fraction]:
    """Of the squares of what comes in or out: 1, of waves the time between the runs of their end, in frames.

    out: of all that is shown, once in each run of an end.
    """
    runs = [_end(name) for name in out]
    return [Fraction(1, runs.count(end) if (end := _end(name)) else 1) for name in names]


def _end(name: str) -> list[str]:
    """The end of a wave; nothing of other signals."""
    return name.split(" ", 2)[2:]
