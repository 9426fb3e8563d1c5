"""The derivatives of the ends of stable intervals, and of the stiffness felt there, by every
number of the loop."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.drawing import name_of, path_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import damping_ratio, eigenvalues, lines_in_loops
from wavesweep.engine.rows import Rows, distinct
from wavesweep.haptics.felt import feels, felt_of
from wavesweep.program.columns import Columns, joined
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.sweep.grid import FAST, Grid, drawn_groups, keys_of, own_loop
from wavesweep.sensitivity.sensitivity import (
    COMPLEX_STEP,
    SLOPPY,
    EndCrossings,
    crossings_of,
    tracked_eigenvalue,
)

REAL_STEP = 1e-3  # of a number, where a real step takes the place of a complex one
PATH_STEPS = 96  # in which a mode is followed into the interval
NAMED, LEAST = 4, 0.05  # states of a mode that are named, and the least participation of one
TEXTS = ("along", "side", "quantity", "unit", "states", "number", "number_unit", "doubt")


@dataclass(frozen=True, slots=True)
class _Ends(Rows):
    """Ends of intervals that stability decides: row of the table of intervals, whether it is the
    upper end, value, rad/s, and their size: that of the interval where the end is 0."""

    row: np.ndarray
    upper: np.ndarray
    value: np.ndarray
    omega: np.ndarray
    size: np.ndarray

    @classmethod
    def of(cls, found, axis):
        """Those of a table of intervals: with a frequency, or within the range, since knowledge
        may end there too."""
        value = np.stack([found["low"], found["high"]], -1).ravel()
        omega = np.stack([found["low_omega"], found["high_omega"]], -1).ravel()
        crossings = np.flatnonzero(~np.isnan(omega) | ((value > axis.start) & (value < axis.stop)))
        row = crossings // 2
        ends = value[crossings]
        size = np.where(ends == 0, (found["high"] - found["low"])[row], np.abs(ends))
        return cls(row, crossings % 2 == 1, ends, omega[crossings], size)


def elasticities(
    grid: Grid, axis: Axis, found: Columns, names: Sequence[str]
) -> dict[str, np.ndarray]:
    """How each end of intervals, and the stiffness felt there, moves with each number, for every
    combination of a grid.

    found: the table of the intervals along `axis`. names: of the columns behind those of the axes,
    in order. Errors: UsageError for a loop that varies smoothly with no other number, which has no
    such row.
    """
    smooth = _smooth(grid.spec, [each.path for each in grid.axes])
    numbers = [path for path in smooth if path != axis.path]
    if not numbers:
        expected = f"expected a number besides {axis.name} that the loop varies with smoothly"
        raise UsageError(
            f"{grid.spec.name}: {expected}, found none; give one of its numbers a name in [numbers]"
        )
    ends = _Ends.of(found, axis)
    batches = []
    changes = {each.path: np.asarray(found[each.name])[ends.row] for each in grid.axes}
    groups = drawn_groups(grid.spec, changes, ends.row.size, rates=True, along=axis.path)
    for group, several in groups:
        at_ends = several.read.unbuilt.changed({axis.path: ends.value[group]})
        for members, built in at_ends.built_alike(group):
            loops = _VariedLoops(grid.spec, axis, built, numbers)
            most = max(1, 2048 // max(PATH_STEPS, len(loops.moving) + 1))  # frames at once
            for start in range(0, members.size, most):
                batch = slice(start, start + most)
                some = replace(loops, loops=built.some(batch))
                batches.append(_rows(some, found, ends, members[batch]))
    columns = _in_order(batches, ("at", *names))
    rows = ends.row[columns.pop("at")]
    axes = {grid_axis.name: np.asarray(found[grid_axis.name])[rows] for grid_axis in grid.axes}
    return axes | columns


def _in_order(batches: Sequence[dict], names: Sequence[str]) -> dict[str, np.ndarray]:
    """The columns of batches behind each other, in the order of the ends that rows are "at"."""
    kinds = dict.fromkeys(TEXTS, object) | {"corner": bool, "certified": bool}
    kinds |= dict.fromkeys(("interval", "crossing", "at"), int)
    columns = {}
    for name in names:
        nothing = np.zeros(0, kinds.get(name, float))
        columns[name] = np.concatenate([nothing, *(batch[name] for batch in batches)])
    order = np.argsort(columns["at"], kind="stable")
    return {name: part[order].astype(kinds.get(name, float)) for name, part in columns.items()}


class Moves(NamedTuple):
    """Change of a limit per relative change of each moving number, and the error of that over the
    limit, `(crossings, moving)`."""

    slope: np.ndarray
    error: np.ndarray


@dataclass(frozen=True, slots=True)
class _VariedLoops:
    """Loops of one structure of a spec, the axis of the intervals, and the paths of the other
    numbers that they vary with."""

    spec: Spec
    axis: Axis
    loops: Loops
    numbers: list[str]

    @property
    def moving(self) -> list[str]:
        """Those that are not zero; a zero may take a branch out of the loop."""
        return [path for path in self.numbers if np.any(self.loops.values[path])]

    def with_end(self, p, each: int) -> Loops:
        """`each` copies of every loop; p: values of the axis, `(loops * each,)`."""
        varied = {
            path: np.repeat(value, each)
            for path, value in self.loops.values.items()
            if np.ndim(value)
        }
        return self.loops.changed({**varied, self.axis.path: np.where(p == 0, NEXT_TO_ZERO, p)})

    def stepped(self, p, of_end, of_numbers) -> Loops:
        """Copies of every loop with complex steps: of the end `(loops, copies)`, and relative ones
        of each moving number `(loops, copies, numbers)`; `(loops * copies,)`."""
        count = of_end.shape[-1]
        step = COMPLEX_STEP * 1j
        varied = self.with_end(np.repeat(p, count) + step * of_end.ravel(), count)
        relative = 1 + step * of_numbers.reshape(p.size * count, -1)
        steps = {
            path: varied.values[path] * relative[:, number]
            for number, path in enumerate(self.moving)
        }
        return varied.changed(steps)

    def built_after(self, p, by_number, sign) -> np.ndarray:
        """The whole numbers by which loops are built after a small step of `sign` of each moving
        number, with which the end moves by `by_number`: `(loops, numbers, whole numbers)`."""
        count = by_number.shape[-1]
        steps = np.broadcast_to(sign * np.eye(count), (p.size, count, count))
        building = self.stepped(p, sign * by_number, steps).unbuilt.building()
        whole = []
        for number in building.values():
            whole.append(np.broadcast_to(number, by_number.size).reshape(by_number.shape))
        return np.stack(whole, -1).astype(int)

    def stepped_by_each(self, p, size) -> Loops:
        """The loops with a complex step in the axis (of `size`) and in each moving number,
        `(loops * (1 + numbers),)`."""
        count = 1 + len(self.moving)
        steps = np.broadcast_to(np.eye(count), (p.size, count, count))
        return self.stepped(p, size[:, None] * steps[..., 0], steps[..., 1:])

    def crossings(self, ends: _Ends) -> EndCrossings:
        """The crossings at the ends of the loops, with their derivatives as the loops are built."""
        p = ends.value
        count = 1 + len(self.moving)
        E = self.frames(self.stepped_by_each(p, ends.size), p.size * count)
        E = E.reshape(p.size, count, *E.shape[-2:])
        by_end = E.imag[:, 0] / COMPLEX_STEP / ends.size[:, None, None]
        by_number = E.imag[:, 1:] / COMPLEX_STEP
        theta = ends.omega * self.period(p)
        return crossings_of(E[:, 0].real, by_end, by_number, theta, ends.size, ends.upper)

    def frames(self, varied, count) -> np.ndarray:
        """Frames less identity `(count, n, n)`."""
        E = varied.frames(self._drift())
        return np.broadcast_to(E, (count, *E.shape[-2:]))

    def eigenvalues(self, p, each) -> np.ndarray:
        """Those of the frames less 1 at values of the axis, `each` of every loop, `(loops * each,
        n)`; a loop with fewer states, as its dead times have fewer ticks there, has -1 for them."""
        at_values = self.with_end(p, each)
        found = []
        for members, built in at_values.at_any_value_of(self.axis.path).built_alike(
            np.arange(p.size)
        ):
            alike = replace(self, loops=built)
            delta, finite = eigenvalues(alike.frames(built, members.size))
            found.append((members, np.where(finite[:, None], delta, np.nan)))
        padded = np.full((p.size, max(delta.shape[-1] for _, delta in found)), -1.0 + 0j)
        for members, delta in found:
            padded[members, : delta.shape[-1]] = delta
        return padded

    def _drift(self):
        """What nothing opposes at values of the numbers and of the axis; times stay, since with
        other ones the loop would be built anew."""
        times = self.loops.drawing.timing
        varied = {}
        for path in self.moving:
            if name_of(path) not in times:
                varied[path] = np.ravel(self.loops.values[path])[:, None] * [1, 2]
        if name_of(self.axis.path) not in times:
            varied[self.axis.path] = np.array([self.axis.start, self.axis.stop])
        return self.loops.changed(varied).drift_of_frames()

    def felt(self, varied, count):
        """Stiffness that the hand feels at rest, `(count,)`; None for a loop without a wall and
        a hand."""
        if not feels(self.loops.drawing):
            return None
        # What is felt of a loop tick by tick takes a complex step itself: here the steps are real,
        # of fourth order.
        felts = []
        for share in (0, 1, -1, 2, -2):
            stepped = {
                path: value for path, value in varied.values.items() if np.iscomplexobj(value)
            }
            moved = {
                path: np.real(value) + np.imag(value) * (share * REAL_STEP / COMPLEX_STEP)
                for path, value in stepped.items()
            }
            felts.append(felt_of(varied.changed(moved), count))
        at_end, up, down, far_up, far_down = felts
        return at_end + 1j * COMPLEX_STEP * (8 * (up - down) - (far_up - far_down)) / (
            12 * REAL_STEP
        )

    def period(self, p) -> np.ndarray:
        """The frame's period in s, `(loops,)`; p: values of the axis, `(loops,)`."""
        drawn = self.with_end(p, 1).drawn()
        return np.broadcast_to(np.real(drawn.period * drawn.ticks), p.shape)

    def labels(self, p) -> list[str]:
        """A readable label of each state."""
        labels = self.with_end(p, 1).drawn().labels()
        drift = self._drift()
        return [labels[drift.states[index]] for index in drift.remaining]


def _smooth(spec, swept: Sequence[str] = ()) -> list[str]:
    """Paths of the floats that the loop reads and that do not decide how it is built. swept: paths
    of axes.

    The fast rate decides it where the spec keeps a slow rate or the edges of a band, with which a
    ratio or an order jumps.
    """
    drawing, values = own_loop(spec)
    deciding = {"rates.ratio"}
    if not spec.drawing and spec.builds(FAST, swept):
        deciding.add(FAST)
    deciding |= {path_of(name) for name in drawing.shaping}
    return [
        path for path, value in values.items() if isinstance(value, float) and path not in deciding
    ]


def without_derivatives(spec) -> list[str]:
    """Names of the numbers that the loop reads without being smooth in them."""
    smooth, read = _smooth(spec), keys_of(spec)
    paths = [
        path
        for path, value in spec.values.items()
        if path in read and not isinstance(value, str) and path not in smooth
    ]
    if "rates.slow_hz" in spec.given:
        kept = "rates.slow_hz"
    else:
        kept = "the edges of a filter's band"
    return [_name(spec, path) + f" (the spec keeps {kept})" * (path == FAST) for path in paths]


def _name(spec, path):
    """The name that an axis of this key has: its symbol if there is one. A spec that gives the
    slow rate has no ratio."""
    if path == "rates.ratio" and "rates.slow_hz" in spec.given:
        path = "rates.slow_hz"
    return next(
        (symbol for symbol, known_path in spec.names.symbols.items() if known_path == path), path
    )


def _rows(loops, found, ends, members) -> dict:
    """The columns of some ends, and `at`: the end of each row."""
    ends = ends.take(members)
    row = ends.row
    p = ends.value
    period = loops.period(p)
    labels = loops.labels(p)
    crossings = loops.crossings(ends)
    at = crossings.end
    certified = found["certified"][row][at]
    certain = certified & np.isfinite(crossings.error).all(-1) & ~crossings.defective
    states = []
    for share, is_certain in zip(crossings.share, certain, strict=True):
        states.append(_states(share, labels) if is_certain else "")
    width = found["high"][row] - found["low"][row]
    damping_ratio = _damping_inside(loops, ends, width, period, crossings)
    omega = np.abs(np.angle(1 + crossings.delta)) / period[at]
    known_columns = {
        "at": members[at],
        "interval": found["interval"][row][at],
        "side": np.where(ends.upper[at], "high", "low").astype(object),
        "crossing": crossings.number,
        "corner": np.bincount(at, minlength=p.size)[at] > 1,
        "omega": np.where(crossings.number == 0, ends.omega[at], omega),
        "damping_ratio": np.where(certain, damping_ratio, np.nan),
        "states": np.array(states, object).reshape(at.size),
    }
    s = 1j * known_columns["omega"] * period[at]
    hz = lines_in_loops(loops.with_end(p, 1).some(at), s[:, None])
    known_columns |= {"hz": hz[:, 0], "second_hz": hz[:, 1]}
    of_crossing = np.where(crossings.defective, "defective", "")
    doubt = np.where(certified, of_crossing, found["doubt"][row][at].astype(str))
    sides = [_one_sided(loops, ends, crossings, sign) for sign in (1, -1)]
    size = ends.size[at][:, None]
    moves = [Moves(side.slope, side.error / size) for side in sides]
    quantities = [Quantity("end", p[at], *moves)]
    stepped = loops.stepped_by_each(p, ends.size)
    stiffness = loops.felt(stepped, p.size * (1 + len(loops.moving)))
    if stiffness is not None:
        felt_there = np.where(ends.upper, found["felt_high"][row], found["felt_low"][row])[at]
        stiffness = stiffness.reshape(p.size, -1)[at]
        moves = [_felt(stiffness, felt_there, ends.size[at], side) for side in sides]
        # Nothing holds what feels no wall, and real steps lead there.
        unknown = p[at] == 0
        if loops.axis.path not in loops.spec.wall:
            # Another number's 0 takes a branch out of the loop, see also `felt_at_ends`.
            unknown |= ends.omega[at] == 0
        for move in moves:
            move.error[unknown] = np.inf
        quantities.append(Quantity("felt", felt_there, *moves))
    numbers = [np.broadcast_to(loops.loops.values[path], p.shape)[at] for path in loops.numbers]
    value = np.stack(numbers, -1)
    tables = []
    for quantity in quantities:
        rows = _rows_of(quantity, loops, known_columns, value, doubt)
        known = ~np.isnan(rows["limit_value"])
        tables.append({name: column[known] for name, column in rows.items()})
    columns = joined(tables)
    order = np.lexsort((columns["crossing"], columns["at"]))
    return {name: column[order] for name, column in columns.items()}


def _one_sided(loops: _VariedLoops, ends: _Ends, crossings: EndCrossings, sign) -> EndCrossings:
    """The crossings with the derivatives of the end by each number on one side of its value, above
    it (sign 1) or below (-1).

    They differ where a dead time is a whole number of ticks, from which on the loop is built
    anew. How it is built after a step is known from where the step leads; along a dead time that
    has to agree with how the end itself moves then, else the error is infinite.
    """
    if not loops.loops.drawing.dead_times:
        return crossings
    at = crossings.end
    of_crossings = replace(loops, loops=loops.loops.some(at))
    error = crossings.error.copy()
    # An end that is none of the loop as it is built here may be one of the loop on the other side.
    slope = np.where(np.isfinite(error), crossings.slope, -crossings.slope)
    paths = list(loops.loops.drawing.building)
    assumed = np.empty((*slope.shape, len(paths)), int)
    assumed[:] = [loops.loops.values[path] for path in paths]
    wanted = of_crossings.built_after(ends.take(at).value, slope, sign)
    for _ in range(3):  # ways to build a loop beside a whole tick: as the end moves, which moves it
        moved = (wanted != assumed).any(-1)
        assumed[moved] = wanted[moved]
        for some in distinct(list(assumed[moved].T), int(moved.sum())):
            row, number = (places[some] for places in np.nonzero(moved))
            built = dict(zip(paths, assumed[row[0], number[0]].tolist(), strict=True))
            if min(built.values()) < 0:
                error[row, number] = np.inf
                continue
            alike = replace(loops, loops=loops.loops.changed(built))
            found = alike.crossings(ends)
            apart = np.abs(found.delta - crossings.delta[row][:, None])
            same = np.argmin(np.where(found.end == at[row][:, None], apart, np.inf), -1)
            slope[row, number] = found.slope[same, number]
            error[row, number] = found.error[same, number]
        wanted = of_crossings.built_after(ends.take(at).value, slope, sign)
    error[(wanted != assumed).any(-1)] = np.inf
    return replace(crossings, slope=slope, error=error)


def _felt(stepped, stiffness, size, crossings: EndCrossings) -> Moves:
    """Of the stiffness k felt at the end e of each crossing `dk/dlog n + dk/de de/dlog n` by each
    number n, and the bound `|dk/de| error/|k|` that the error of de/dlog n leaves.

    stepped `(crossings, 1 + numbers)`: k with a complex step in e, times `size` (of e), and in each
    log n. stiffness: k, `(crossings,)`; where it is 0, `|dk/de| size` is in its place.
    """
    by_end = stepped.imag[:, :1] / COMPLEX_STEP / size[:, None]
    direct = stepped.imag[:, 1:] / COMPLEX_STEP
    with np.errstate(all="ignore"):
        unit = np.where(stiffness == 0, np.abs(by_end[:, 0]) * size, stiffness)
        error = np.abs(by_end) * crossings.error / unit[:, None]
        error = np.where((by_end == 0) & np.isfinite(crossings.error), 0.0, np.abs(error))
    return Moves(direct + by_end * crossings.slope, error)


def _damping_inside(loops, ends: _Ends, width, period, crossings: EndCrossings) -> np.ndarray:
    """The damping ratio of each crossing's mode, by its strongest line, a tenth of the end inside
    the interval of this width, half-way into a narrow one, a millionth of the width beside 0."""
    p = ends.value
    inwards = np.where(ends.upper, -1, 1)
    # Of the end: at this distance from it the damping of the mode is given.
    away = np.where(p == 0, 1e-6 * width, np.minimum(0.1 * np.abs(p), width / 2)) * inwards
    steps = p[:, None] + away[:, None] * (np.arange(1, PATH_STEPS + 1) / PATH_STEPS)
    path = loops.eigenvalues(steps.ravel(), PATH_STEPS).reshape(p.size, PATH_STEPS, -1)
    delta = tracked_eigenvalue(path[crossings.end], crossings.delta)
    known = np.where(np.isnan(delta), crossings.delta, delta)
    with np.errstate(all="ignore"):
        modes = np.log1p(known)
    inside = loops.with_end(p + away, 1).some(crossings.end)
    hz = np.empty(crossings.end.size)
    for members, built in inside.at_any_value_of(loops.axis.path).built_alike(np.arange(hz.size)):
        hz[members] = lines_in_loops(built, modes[members, None])[:, 0]
    return damping_ratio(delta, 2 * np.pi * hz * period[crossings.end])


def _states(share, labels) -> str:
    """The states that take part most, in per cent."""
    order = [
        i
        for i in np.argsort(-share, kind="stable")[:NAMED]
        if share[i] >= LEAST and i < len(labels)
    ]
    return ", ".join(f"{labels[i]} {100 * share[i]:.0f} %" for i in order)


class Quantity(NamedTuple):
    """What has a limit at each crossing `(crossings,)`, and how that moves if numbers grow (up)
    and if they fall (down)."""

    name: str
    limit: np.ndarray
    up: Moves
    down: Moves


def _rows_of(quantity: Quantity, loops, known, value, doubt) -> dict:
    """The rows of one quantity: one for each crossing and number.

    value `(crossings, numbers)`: of each number. A number that is zero has the elasticity 0 and no
    slope.
    """
    limit = quantity.limit
    spec = loops.spec
    numbers = loops.numbers
    columns = [numbers.index(path) for path in loops.moving]
    sides = []
    for moves in (quantity.up, quantity.down):
        change = np.zeros(value.shape)
        change[:, columns] = moves.slope
        bound = np.zeros(value.shape)
        bound[:, columns] = moves.error
        with np.errstate(all="ignore"):
            share = np.where(limit[:, None] == 0, np.nan, change / limit[:, None])
            elasticity = np.where(value == 0, 0.0, share)
            slope = np.where(value == 0, np.nan, change / value)
        known_side = (doubt == "")[:, None] & (bound <= SLOPPY * np.fmax(1, np.abs(elasticity)))
        given = [np.where(known_side, column, np.nan).ravel() for column in (elasticity, slope)]
        sides.append((known_side, *given))
    up, down = sides
    word = np.where((doubt == "")[:, None] & ~up[0], "rounding", doubt[:, None])
    rows = {}
    of_crossings = known | {"limit_value": limit}
    for name, column in of_crossings.items():
        rows[name] = np.repeat(column, len(numbers))
    if quantity.name == "felt":
        unit = spec.at_port("N/m")
    else:
        unit = spec.names.find(loops.axis.path).unit
    for name, text in (("along", loops.axis.name), ("quantity", quantity.name), ("unit", unit)):
        rows[name] = np.full(value.size, text, object)
    names = [_name(spec, path) for path in numbers]
    units = [spec.names.find(path).unit for path in numbers]
    rows["number"] = np.tile(np.array(names, object), limit.size)
    rows["number_unit"] = np.tile(np.array(units, object), limit.size)
    _, rows["elasticity"], rows["slope"] = up
    _, rows["elasticity_down"], rows["slope_down"] = down
    rows["value"] = value.ravel()
    rows["certified"] = (word == "").ravel()
    rows["doubt"] = word.ravel().astype(object)
    return rows
