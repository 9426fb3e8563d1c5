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
from .reader.loops import INPUT, OUTPUT, Instant, Schedule, Unreadable

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
        equations = {name: _renamed(row, source, into) for name, row in instant.equations.items()}
        writes = {name: _renamed(row, source, into) for name, row in instant.writes.items()}
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
    for instant in (*(kinds[kind] for kind in present), schedule.motion):
        if any(source in row for row in (*instant.equations.values(), *instant.writes.values())):
            raise Refused(f"the input {source[1:]} is read between ticks")
    return replace(schedule, kinds=kinds, times=times)


def source_of(tables: dict, name: str) -> str:
    """The signal from outside that an input of a spec is."""
    if "controller" in tables:
        if name != "f_h":
            raise Unreadable(f"the input of a controller is f_h, and not {name!r}")
        return "hand"
    ports = tables.get("ports", {})
    port = ports.get("inputs", {}).get(name, name)
    return port["signal"] if isinstance(port, dict) else port


def _renamed(row: dict, source: str, into: str) -> dict:
    return {into if name == source else name: c for name, c in row.items()}


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
    stored = _bordered(P, len(out), balls.ONE)
    allowed = _bordered(P, len(into), balls.ball(level * level)[1])
    return form.decreases(allowed, [(None, M, stored)])


def _bordered(P: form.Matrix, count: int, entry: int) -> form.Matrix:
    """P, and after it so many times the same entry of the diagonal."""
    size = len(P.error) + count
    parts = {}
    for m, part in P.parts.items():
        parts[m] = [[*row, *[0] * count] for row in part]
        parts[m] += [[0] * size for _ in range(count)]
    still = parts[min(parts, key=sum)]
    for place in range(len(P.error), size):
        still[place][place] = entry
    return form.Matrix(parts, [[0] * size for _ in range(size)])
