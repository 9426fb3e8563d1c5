"""Every quantity that may be wished for, at its worst over all that a design has to hold for, of
many designs at once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from wavesweep.designs.bands import GAUSS_NODES, HIGH, BandModes, Sampled, over_band
from wavesweep.designs.family import OF_ALL, Points, Scenario, points_of, scenarios_of
from wavesweep.designs.wish_keys import Wish
from wavesweep.engine.errors import IllPosedLoopError, SpecError, UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import (
    eigenvalues,
    least_damping,
    lines_of_each,
    radius_of,
    size_gone,
)
from wavesweep.engine.response import Lifted, Response, ports_of_batch, respond
from wavesweep.engine.rows import Rows, distinct_rows
from wavesweep.haptics.controller_page import keys_of_page
from wavesweep.haptics.felt import felt_of
from wavesweep.program.analyses.interval_jobs import at_points
from wavesweep.program.reading.keys import ALL_MODES, OSCILLATING, TIMES_OF_MODES
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.spec.resolving import longest_delay
from wavesweep.program.sweep.grid import drawn_groups, frames_per_clock

# how small the last coefficients of a piece have to be compared with the mean; the error is far
# less
UNSEEN = 1e-4
BAND_HZ = (0.1, 10.0)  # of a wish without a band of its own
POINTS_AT_ONCE = 512  # points at a time: more leave the processor's cache
ERROR = 1e-6  # relative, up to which a response is believed
DELAY = "environment.delay"


@dataclass(frozen=True, slots=True, eq=False)
class WorstMeasure(Rows):
    """The worst value of each design, `(designs,)`, NaN if there is none; its scenario; whether all
    values are certified.

    at_end: whether it is that of a wall at which the range of walls ends.
    """

    value: np.ndarray
    scenario: np.ndarray
    certified: np.ndarray
    at_end: np.ndarray


def evaluate(
    spec: Spec,
    wishes: Sequence[Wish],
    scenarios: Sequence[Scenario],
    designs: Mapping[str, np.ndarray],
    stop: float,
    proof: Any = None,
    *,
    ranked: bool = False,
) -> dict[str, WorstMeasure]:
    """Return the worst values of designs: wish -> `WorstMeasure`. The designs need not be the
    product of some axes.

    spec: gives all values that do not vary. wishes, scenarios: to be evaluated. designs: path ->
    value of each design, `(designs,)`. stop: the largest stiffness of a wall that is searched, N/m.
    proof: if given, walls are those that are proved for all of it, and other values are missing
    where a loop is refuted, and not certified where it is not proved. ranked: whether a search ranks
    designs by them, for which margins are not proved. Accuracy: that of stable intervals, responses
    and norms; a value is certified only if everything that it depends on is, of margins with
    values of [for_all] itself and with those that are the worst.
    """
    measured = {}
    searched = {}  # damping of the walls -> points, and the stiffest wall of each
    felt = any(wish.word == "felt" for wish in wishes)
    verdicts: dict[tuple[Any, ...], str] = {}  # of all that was proved for a wish before

    def verdict(values):
        key = tuple(values.items())
        if key not in verdicts:
            verdicts[key] = proof.verdict(spec.with_values(values))
        return verdicts[key]

    own_scenarios = scenarios_of(spec)
    for wish in wishes:
        if wish.word in ("z_width", "felt"):
            damping = wish.options.get("B_VE", (spec.values[spec.wall[1]],))
            if damping not in searched:
                points = points_of(designs, scenarios, {spec.wall[1]: damping})
                stiffest = _stiffest(spec, points, (*designs,), stop, felt, proof)
                searched[damping] = points, stiffest
            measured[wish.name] = _worst_wall(wish, *searched[damping], stop)
            continue
        walls = walls_of(spec, wish)
        points = points_of(designs, scenarios, {} if wish.kind.reads else walls)
        seen = wish.kind.seen or wish.kind.measure
        measure = partial(_offered, seen) if seen else _MEASURES[wish.word]
        blank = _unknown(points.size)
        value, certified = _where_solvable(spec, points, partial(measure, spec, wish), *blank)
        if wish.kind.seen and not ranked:
            decide = np.zeros(points.shape, bool)
            decide[:, [scenario in own_scenarios for scenario in scenarios]] = True
            _, worst = points.worst(value, wish.kind.more)
            decide[np.arange(worst.size), worst] = True
            index = np.flatnonzero(decide)
            measure = partial(_offered, wish.kind.measure, spec, wish)
            proved = _where_solvable(spec, points.some(index), measure, *_unknown(index.size))
            value[index], certified[index] = proved
        if proof and not wish.kind.reads:  # all of the loop
            said = _of_each(points, verdict, (*designs, *walls))
            value = np.where(said == "refuted", np.nan, value)
            certified = certified & (said == "proved")
        worst, scenario = points.worst(value, wish.kind.more)
        nowhere = np.zeros(len(worst), bool)
        measured[wish.name] = WorstMeasure(worst, scenario, points.all_of(certified), nowhere)
    return measured


def walls_of(spec, wish):
    """The walls that a wish is about: path -> values."""
    walls = {}
    for path, option in zip(spec.wall, ("walls", "B_VE"), strict=False):
        walls[path] = wish.options.get(option, (spec.values[path],))
    return walls


def _worst_wall(wish, points, stiffest, stop):
    """The worst of `z_width` or `felt` over the scenarios of every design."""
    value = stiffest.wall if wish.word == "z_width" else stiffest.felt
    worst, scenario = points.worst(value, more=True)
    unlike_worst = value != np.repeat(worst, points.size // worst.size)
    scenario = np.where(points.all_of(~stiffest.of_all | unlike_worst), scenario, OF_ALL)
    at_end = ~points.all_of((stiffest.wall < stop) | unlike_worst)
    return WorstMeasure(worst, scenario, points.all_of(stiffest.certified), at_end)


def _unknown(*shape: int) -> tuple[np.ndarray, np.ndarray]:
    """Values that are missing, and their certificates, one for each point."""
    return np.full(shape, np.nan), np.zeros(shape[0], bool)


def _where_solvable(
    spec, points: Points, measure: Callable[[Points], tuple], *blank: np.ndarray
) -> tuple:
    """What `measure` gives for the points, arrays over them, filled into blank ones: numbers
    that make no loop are left out."""
    waiting = [np.arange(points.size)]
    while waiting:
        batch = waiting.pop()
        try:
            measured = measure(points if batch.size == points.size else points.some(batch))
        except (UsageError, SpecError, IllPosedLoopError):  # of one of them at least
            if spec.drawing is None:  # whose numbers were checked with the spec
                raise
            if batch.size > 1:
                waiting += np.array_split(batch, 2)
        else:
            for filled, values in zip(blank, measured, strict=True):
                filled[batch] = values
    return blank


def _batches(spec, points: Points, most: int = POINTS_AT_ONCE):
    """Yield the indices of at most `most` points of one structure at a time, and their loops."""
    for members, loops in drawn_groups(spec, points.changes, points.size):
        for start in range(0, members.size, most):
            batch = slice(start, start + most)
            yield members[batch], loops.some(batch)


def _of_each(points, of, paths):
    """Return what `of` says of the values of some paths, which no scenario changes, of each
    point."""
    columns = {path: points.changes[path] for path in paths}
    first, back = distinct_rows(columns, points.size)
    said = []
    for at in first:
        own = {path: column[at].item() for path, column in columns.items()}
        said.append(of(own))
    return np.array(said)[back]


@dataclass(frozen=True, slots=True, eq=False)
class _Stiffest:
    """Of each point the stiffest wall up to which every wall is stable, and the stiffness felt of
    it, if both are certified.

    of_all: whether the wall is less than that of the scenarios, as what is proved for all of
    [for_all] is.
    """

    wall: np.ndarray
    felt: np.ndarray
    certified: np.ndarray
    of_all: np.ndarray


def _stiffest(spec, points: Points, designs, stop, wished, proof) -> _Stiffest:
    """designs: paths of the numbers of designs. wished: whether the felt stiffness is needed."""
    name = spec.drawing.wall[0] if spec.drawing else "K_VE"
    axis = Axis(name, spec.wall[0], (), 0.0, stop, False)

    def stiffest_of(points):
        """Of points that all differ the stiffest wall, the stiffness felt of it and whether they
        are certified, `(points,)` each: the end of the interval from 0 on, or where an open place
        begins before it; 0 if no interval begins at 0."""
        value = np.zeros(points.size)
        felt = np.zeros(points.size)
        certified = np.ones(points.size, bool)
        for batch, _ in _batches(spec, points):
            changes = {path: column[batch] for path, column in points.changes.items()}
            rows = at_points(spec, axis, changes, felt=wished)
            point = batch[rows["slice"]]  # of each row, which is an interval or says there is none
            certified[point] = rows["certified"]
            is_first = (rows["intervals"] > 0) & (rows["interval"] == 0)
            from_start = is_first & (rows["low"] <= 0)
            known_up_to = np.fmin(rows["high"], rows["open_low"])
            value[point[from_start]] = known_up_to[from_start]
            felt_there = np.where(rows["open_low"] < rows["high"], np.nan, rows["felt_high"])
            felt[point[from_start]] = felt_there[from_start]
        return value, felt, certified

    once, back = distinct_rows(points.changes, points.size)
    blank = np.full(once.size, np.nan), *_unknown(once.size)
    found = _where_solvable(spec, points.some(once), stiffest_of, *blank)
    value, felt, certified = (array[back] for array in found)
    if not proof:
        return _Stiffest(value, felt, certified, np.zeros(points.size, bool))
    proved = _proved_of(spec, points, designs, (axis.path, stop), value, proof)
    wall = np.minimum(value, proved)
    at_walls = replace(points, changes={**points.changes, axis.path: wall})
    if wished:
        for members, loops in _batches(spec, at_walls):
            felt[members] = np.where(wall[members] > 0, felt_of(loops, members.size), 0.0)
        certified = certified & ~np.isnan(felt)
    return _Stiffest(wall, felt, certified, proved < value)


def _proved_of(spec, points: Points, designs, wall, stable_to, proof):
    """Up to which wall the loops of each point are proved to be stable, or rank.

    wall: the path of its stiffness, and the stiffest one that is searched; stable_to: of each point
    the stiffest one that is stable. Where nothing else is wished for, it may be a bound for designs
    that are worse than the best.
    """
    path, stop = wall
    paths = [name for name in points.changes if name in designs or name in spec.wall]
    columns = {name: points.changes[name] for name in paths}
    first, back = distinct_rows(columns, points.size)
    specs = []
    for at in first:
        specs.append(
            spec.with_values({name: column[at].item() for name, column in columns.items()})
        )
    limits = np.full(first.size, float(stop))
    np.fmin.at(limits, back, stable_to)
    numbers = None
    if spec.design.only_walls:
        _, numbers = distinct_rows({name: columns[name][first] for name in designs}, first.size)
    return proof.stiffest(specs, path, stop, limits, numbers)[back]


def _transparency(spec, wish, points):
    """Root mean square of |ln(H/H_dc)| over the logarithm of the frequency; missing if a loop is
    unstable.

    A design with an unstable loop has no value, and its other loops are left out: they count as 0.
    """
    stable = _radii(spec, points) < 1
    stable_points = np.flatnonzero(np.repeat(points.all_of(stable), points.size // points.shape[0]))
    if not stable_points.size:
        return np.where(stable, 0.0, np.nan), stable
    stable_ones = points.some(stable_points)
    place = np.searchsorted(stable_points, np.arange(points.size))
    ideal, coupled, coupled_of = _coupled(spec, stable_ones)
    modes = _modes(spec, stable_ones)
    of_ideal = _modes(ideal, coupled).some(coupled_of)

    def sample(at, frequency):
        at = place[at]
        different, back = np.unique(coupled_of[at], return_inverse=True)
        admittance, off = _admittances(spec, stable_ones.some(at), frequency)
        wanted, of_wanted = _admittances(ideal, coupled.some(different), frequency)
        wanted = wanted[back]
        sure = (np.maximum(off, of_wanted[back]) <= ERROR).all(-1)
        with np.errstate(all="ignore"):
            square = np.abs(np.log(admittance / wanted)) ** 2
        return Sampled(square, sure, [(admittance, modes.some(at)), (wanted, of_ideal.some(at))])

    def reduce(degrees, share):
        value = np.sqrt(degrees[..., 0] @ share)
        unseen = np.abs(degrees[..., -HIGH:]).max(-1) @ share
        return value, unseen <= UNSEEN * np.maximum(
            value, ERROR
        ) ** 2  # responses are not known better

    band = wish.options.get("band_hz", BAND_HZ)
    begun = np.where(stable, 0.0, np.nan), stable.copy()
    return over_band(band, stable_points, sample, reduce, begun)


def _radii(spec, points):
    radius = np.empty(points.size)
    for members, loops in _batches(spec, points):
        radius[members] = loops.read.radii(members.size)
    return radius


def _modes(spec, points) -> BandModes:
    """The modes of the loops of points."""
    exponents = []
    rate = np.empty(points.size)
    for members, loops in _batches(spec, points):
        drawn = loops.drawn()
        E, _ = loops.read.frames_with_reliability(loops.read.drift_of_frames(), drawn)
        rate[members] = 1 / np.real(drawn.period * drawn.ticks)
        delta, _ = eigenvalues(E)
        with np.errstate(divide="ignore", invalid="ignore"):
            exponents.append((members, np.log1p(delta) / 2j / np.pi))
    most = max((exponent.shape[-1] for _, exponent in exponents), default=0)
    frequency = np.full((points.size, most), np.nan, complex)
    for members, exponent in exponents:
        frequency[members, : exponent.shape[-1]] = exponent * rate[members, None]
    return BandModes(frequency, rate)


def _admittances(spec, points, frequency):
    """Return the admittances at the hand and bounds on their relative errors, `(points,
    frequencies)`."""
    value = np.empty((points.size, frequency.size), complex)
    error = np.empty((points.size, frequency.size))
    for members, loops in _batches(
        spec, points, max(1, POINTS_AT_ONCE * GAUSS_NODES // frequency.size)
    ):
        # Through the modes; the few that this is too rough for are computed again, slowly, by
        # themselves.
        response = responses_of(loops, members.size, frequency, np.inf)
        value[members] = response.admittance
        error[members] = response.admittance_error
        again = np.flatnonzero(~(error[members] <= ERROR / 2).all(-1))
        if again.size:
            response = responses_of(loops.some(again), again.size, frequency, ERROR / 2)
            value[members[again]] = response.admittance
            error[members[again]] = response.admittance_error
    return value, error


def _coupled(spec, points):
    """Direct coupling at the fast rate of the points: the spec, different points, and which of
    these each one has."""
    spec = spec.with_values({"controller.kind": "dc"})
    read = keys_of_page(spec.values)
    changes = {path: column for path, column in points.changes.items() if path in read}
    first, back = distinct_rows(changes, points.size)
    return spec, Points(changes, points.shape).some(first), back


def _offered(measure, spec, wish, points):
    """What a capability measures. Of points that differ only in numbers that it does not read,
    it is computed once."""
    value, certified = _unknown(points.size)
    own = wish.kind.own_options
    options = {name: value for name, value in wish.options.items() if name in own}
    reads = wish.kind.reads
    if reads:
        read = {path: column for path, column in points.changes.items() if path.startswith(reads)}
        first, back = distinct_rows(read, points.size)
        points = Points(read, points.shape).some(first)
    for members, loops in _batches(spec, points):
        if spec.drawing:
            loops.refuse_unsuitable()
        measured = measure(loops, members.size, **options)
        value[members], certified[members] = measured
    if reads:
        return value[back], certified[back]
    return value, certified


def _number(spec, wish, points):
    """A number of each point itself; missing if the loop is unstable."""
    radius = _radii(spec, points)
    (path,) = (axis.path for axis in spec.design.vary if axis.name == wish.options["number"])
    return np.where(radius < 1, points.changes[path], np.nan), ~np.isnan(radius)


def _delay_margin(spec, wish, points):
    """Ticks of further delay of the slow result up to which every delay is stable; -1 if the loop
    is unstable without any.

    A result that is in place with the next frame cannot be later.
    """
    del wish
    if spec.delay_of_frame and DELAY not in points.changes:
        radius = _radii(spec, points)
        return np.where(radius < 1, 0.0, -1.0), ~np.isnan(radius)
    delay = np.broadcast_to(points.changes.get(DELAY, spec.values[DELAY]), (points.size,))
    value = np.full(points.size, -1.0)
    certain = np.ones(points.size, bool)
    open_ = np.arange(points.size)  # those that are stable with every delay so far
    longest = longest_delay(spec.values)
    for added in range(longest + 1):
        open_ = open_[delay[open_] + added <= longest]
        if not open_.size:
            break
        changes = {path: column[open_] for path, column in points.changes.items()}
        changes[DELAY] = delay[open_] + added
        radius = _radii(spec, Points(changes, (open_.size, 1, 1)))
        certain[open_[np.isnan(radius)]] = False  # rounding could make it stable or unstable
        open_ = open_[radius < 1]
        value[open_] = added
    return value, certain


def _damping_ratio(spec, wish, loops, size):
    """Least damping ratio of the modes that count, 0 or negative if the loop is unstable, and
    whether it is known, `(size,)` each. In a frame of several ticks a mode turns by its strongest
    line."""
    E, certain = _frames(loops, size)
    drawn = loops.drawn()
    seconds = wish.options.get("slower_than", 0.0)
    modes = wish.options.get("modes", ALL_MODES)
    period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), (size,))
    gone = size_gone(period, seconds, 1 / frames_per_clock(spec.drawing, loops))
    pairs = modes == OSCILLATING
    if drawn.ticks == 1:
        least, sure = least_damping(E, gone, pairs=pairs)
        return np.where(certain, least, np.nan), certain & sure
    delta, _ = eigenvalues(E)
    with np.errstate(all="ignore"):
        # s T of each mode, `(size, 1)`
        exponents = [*np.moveaxis(np.log1p(delta), -1, 0)[..., None]]
        # Hz, `(size, modes, 3)`, see `range_of_lines`
        lines = np.stack([*lines_of_each(loops.read, exponents, ranges=True)], axis=1)
    strongest, lowest, highest = np.moveaxis(2 * np.pi * period[:, None, None] * lines, -1, 0)
    least, sure = least_damping(E, gone, pairs=pairs, turns=strongest)
    # A ratio is monotone in the turns of its mode, so the least one by any lines that may be the
    # strongest is between those by the lowest and by the highest of them.
    for turns in (lowest, highest):
        other, _ = least_damping(E, gone, pairs=pairs, turns=turns)
        # Least damping ratios by several lines of modes that differ by less are the same.
        sure &= np.abs(other - least) <= 1e-9
    return np.where(certain, least, np.nan), certain & sure


def _time_of_modes(spec, wish, loops, size):
    """Time in which the mode that decays most slowly falls to the wish's share, s; missing if the
    loop is unstable."""
    del spec
    E, certain = _frames(loops, size)
    drawn = loops.drawn()
    delta, _ = eigenvalues(E)
    last = slowest(delta) if delta.shape[-1] else -1.0
    last = np.where(certain, last, np.nan)
    with np.errstate(all="ignore"):
        constant = -np.real(drawn.period * drawn.ticks) / np.log1p(last).real
        time = TIMES_OF_MODES[wish.word].constants * constant
    return np.where((time >= 0) & np.isfinite(time), time, np.nan), certain


def _frames(loops, size):
    """Return the frames less identity, and whether their radius is known."""
    E, hidden = loops.read.frames_with_reliability(loops.read.drift_of_frames())
    E = np.broadcast_to(E, (size, *E.shape[-2:]))
    return E, np.isfinite(radius_of(E, hidden))


def _batched(measure):
    """The measure of points that `measure` gives of those of one structure, from their loops and
    their number."""

    def of_points(spec, wish, points):
        value, certified = _unknown(points.size)
        for members, loops in _batches(spec, points):
            value[members], certified[members] = measure(spec, wish, loops, members.size)
        return value, certified

    return of_points


def slowest(delta):
    """Return, of eigenvalues less 1 `(..., n)`, the one that decays most slowly or grows most,
    `(...)`."""
    last = np.argmax(np.abs(1 + delta), -1)
    return np.take_along_axis(delta, last[..., None], -1)[..., 0]


def responses_of(loops: Loops, size: int, frequency_hz, good: float) -> Response:
    """The steady responses of `size` loops at the hand, `(size, points)`; good: see `respond`."""
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    responses = Response(
        *(np.empty((size, frequency.size), kind) for kind in (complex, complex, float, float))
    )
    read = {path: loops.values[path] for path in loops.values.keys() & loops.drawing.reads}
    for at, port in ports_of_batch(Loops(loops.drawing, read), size):
        for array, values in zip(responses, respond(Lifted.of(port), frequency, good), strict=True):
            array[at] = values
    return responses


_MEASURES = {
    "transparency": _transparency,
    "largest": _number,
    "smallest": _number,
    "delay_margin": _delay_margin,
    **dict.fromkeys(TIMES_OF_MODES, _batched(_time_of_modes)),
    "damping_ratio": _batched(_damping_ratio),
}
