"""Whether the hand's port is passive: with forces that are held over ticks, no more work comes out of it than went in.

In a frame of m ticks the hand exerts u = (u_1 .. u_m), y_i is how far it moves in tick i, and u'y is its work. PLACE has its
position p as a frame begins, and PUSH a force that stays and is added to those of all ticks. If the loop has a drift of PLACE,
k, the share of PUSH in it, is its stiffness at rest: the force k p holds it at any p. With u_i = k p + w_i and the memory x that
is left,

    x+ = A x + B w,   y = C x + D w,   p+ = p + s,   s = y_1 + .. + y_m = S (x, w).

Positive real lemma: let P > 0, k >= 0 and

    [P C'; C D + D'] - k S'S - [A B]' P [A B] > 0.                                                       (1)

Then x' P x + k p^2 grows by less than 2 u'y in a frame, as 2 k p s + k s^2 = k (p+^2 - p^2). So without forces it decays, to 0 where
k > 0, and from rest the sum of u'y over all frames is never negative: the map from u to y is positive real (Yakubovich 1962, Kalman 1963).
"""

from dataclasses import replace

from . import balls, form
from .balls import Cell, Number, Refused, add
from .drifts import Form
from .gain import refuse_between_ticks, renamed
from .reader.loops import INPUT, OUTPUT, Instant, Schedule

PLACE, PUSH = "@place of the hand", "@push of the hand"


def opened(tables: dict, schedule: Schedule) -> Schedule:
    """The schedule with PLACE and PUSH, and with memory for the force in each tick and for how far the hand moves in it."""
    force, position = _port_of(tables)
    first = next(iter(schedule.ticks))
    times = [*schedule.times, (schedule.period, schedule.times[first][1])]
    ticks = {**schedule.ticks, len(schedule.times): len(schedule.ticks)}
    kinds = dict(schedule.kinds)
    for place, tick in ticks.items():
        time, kind = times[place]
        fed = {f"{INPUT}{tick}": 1, PUSH: 1}
        equations = renamed(schedule.kinds[kind].equations, force, fed)
        writes = (
            renamed(schedule.kinds[kind].writes, force, fed) if place < len(schedule.times) else {}
        )
        if tick:
            writes |= {PLACE: {position: 1}, f"{OUTPUT}{tick - 1}": {position: 1, PLACE: -1}}
        kinds[kind, tick] = Instant(equations, writes)
        times[place] = time, (kind, tick)
    present = {kind for _, kind in times}
    found = replace(schedule, kinds={kind: kinds[kind] for kind in present}, times=times)
    refuse_between_ticks(found, force)
    return found


def _port_of(tables: dict) -> tuple[str, str]:
    """The force and the position of the hand."""
    if "controller" in tables:
        return "!hand", "x"
    force = tables.get("ports", {}).get("hand", {}).get("force")
    if not isinstance(force, str):
        raise Refused(
            "the port of a hand of one force, [ports] hand.force, has a proof, and no other"
        )
    return f"!{force}", "hand displacement"


def stiffness(drifts: list[Form]) -> Number:
    """k. Refused, if a force that stays takes part in another drift than that of PLACE."""
    pushed = [drift for drift in drifts if PUSH in drift]
    if any(next(iter(drift)) != PLACE for drift in pushed):
        raise Refused(f"{PUSH} takes part in a drift that does not begin with {PLACE}")
    return pushed[0][PUSH] if pushed else balls.number(0)


def is_passive(cell: Cell, rows: dict, states: list[str], P: form.Matrix, k: Number) -> bool:
    """Whether (1) holds all over a cell. rows: of a frame; P: over the states."""
    radius, *parts = k.value(cell)
    share = form.Matrix(
        {m: [[c]] for m, c in zip(cell.ring.monomials, parts, strict=False)}, [[radius]]
    )
    moved, work, way = port_matrices(cell, rows, states)
    stored = form.minus(form.bordered(P, [0] * (len(way.error[0]) - len(states))), work)
    unit = form.Matrix({min(way.parts, key=sum): [[balls.ONE]]}, [[0]])
    return _not_negative(cell, k) and form.decreases(stored, [(None, moved, P), (share, way, unit)])


def port_matrices(cell: Cell, rows: dict, states: list[str]) -> tuple[form.Matrix, ...]:
    """[A B], a matrix whose symmetric part is -[0 C'; C D + D'], and S."""
    out = sorted(name for name in rows if name.startswith(OUTPUT))
    into = [INPUT + name.removeprefix(OUTPUT) for name in out]
    if any(name.startswith(INPUT) and name not in into for row in rows.values() for name in row):
        raise Refused("the hand moves at once as it is pushed")
    columns = [*states, *into]
    work: dict[str, dict] = {name: {} for name in states}
    way: dict[str, tuple] = {}
    for name in out:
        work[name] = {
            column: (2 * c[0], *(-2 * x for x in c[1:])) for column, c in rows[name].items()
        }
        for column, c in rows[name].items():
            way[column] = add(way[column], c) if column in way else c
    return (
        form.matrix_of(cell, rows, states, columns),
        form.matrix_of(cell, work, [*work], columns),
        form.matrix_of(cell, {PLACE: way}, [PLACE], columns),
    )


def _not_negative(cell: Cell, k: Number) -> bool:
    """Whether a number is not negative: a sum of products of shares and sides that are not, or by its enclosure."""
    if k.exact is not None and all(
        share >= 0 and all(name.ends[0] >= 0 for name, _ in monomial)
        for monomial, share in k.exact.items()
    ):
        return True
    radius, middle, *slopes = k.value(cell)
    return middle >= radius + sum(map(abs, slopes))
