"""The verdict on a spec's own design: stability, the room that each number has, and the feel."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from wavesweep.core.analyses.assumptions import assumes
from wavesweep.core.analyses.feel import felt_at_rest
from wavesweep.core.analyses.hardware import hardware_of
from wavesweep.core.analyses.interval_records import open_places
from wavesweep.core.analyses.intervals import Way, cost_of, job_over, searches_of
from wavesweep.core.analyses.lines import lines_in_loops
from wavesweep.core.analyses.loops import drift_of, loop_at_hand, radii_of, refuse_singular, telling_frames
from wavesweep.core.errors import WavesweepError
from wavesweep.core.reading.keys import VALUE_PATHS
from wavesweep.core.spec import KEYS, Axis, Spec
from wavesweep.core.spec.resolving import longest_delay
from wavesweep.core.stability.certificate import words
from wavesweep.core.stability.spectrum import GONE, damping_ratio, eigenvalues, radius_of
from wavesweep.core.sweep.grid import keys_of, loops_of, make_grid, own_loop
from wavesweep.core.sweep.running import in_memory
from wavesweep.for_all import rows as for_all
from wavesweep.identification.measured import distances, read_points
from wavesweep.margins.poles import ON_CIRCLE, leading, named_modes
from wavesweep.passive import every_hand

FAR = 10.0  # factor up to which a number is followed
USUAL = {"K_VE": 1000.0, "B_VE": 10.0, "Kp": 20.0, "K_LM": 1000.0, "B_LM": 10.0}  # followed up to FAR times that, from 0
HALVINGS, FEW = 30, 8  # towards the end of what a spec takes; and of where it has loops, as an angle has up to a pole
WORK = 50_000  # on the range of one number in pieces, see `Search.about`, after which it ends where it is: some 3 s
SECONDS, LONG = 3.0, 1.0  # that another range may take by `expected_cost`, from a cut and by panels
LATE = "it takes longer than check does"
DELAYS = 200  # ticks of delay that are tried
CHANNEL = ("rates.", "filters.", "controller.kind")  # keys that the wave channel depends on, see `channel_norm`
LARGEST_CHANNEL = 20_000  # entries of its matrix, up to which the norm takes less than 0.1 s; it grows with their power of 1.5
SAME = 1e-9  # distance of two eigenvalues, up to which they are of one mode
LARGEST = np.finfo(float).max


@np.errstate(all="ignore")  # numbers that overflow are told from what they leave
def verdict(spec: Spec) -> dict:
    """The verdict on the spec's own design as a JSON-able dict; a missing number is None.

    The numbers of `own_design`, and those of `further`.
    """
    own = own_design(spec)
    return own | further(spec, own)


@np.errstate(all="ignore")
def further(spec: Spec, own: dict, report: Callable[[int, int], None] | None = None) -> dict:
    """What the verdict says in addition to the numbers of `own_design`.

    report: is called with the number of ranges that are done, and of all. limits: for each number of the loop the stable
    interval that its value lies in, see `limits`. delay: the number of ticks it may grow to; a drawn loop has no delay that a
    spec would name. for_all: of a spec with [for_all], whether it is stable for all of it, see `for_all.verdict`; every_hand:
    what hands need then, see `every_hand.damping`. hardware: see `hardware_of`. measured: of a spec with [measured], how
    far the design is from the points, see `measured.distances`.
    """
    points, found = read_points(spec), {}
    if spec.for_all:
        found |= {"for_all": for_all.verdict(spec), "every_hand": every_hand.damping(spec)}
    found |= {"limits": limits(spec, report), "delay": _delays(spec), "hardware": hardware_of(spec, stable=own["stable"])}
    stiffness = (own["felt"] or {}).get("stiffness")
    if "max_force" in found["hardware"] and own["stable"]:  # the depth to which the wall can be pressed
        found["hardware"]["depth"] = found["hardware"]["max_force"] / stiffness if stiffness and stiffness > 0 else None
    return found | ({"measured": distances(spec, points, own["stable"])} if spec.measured else {})


def own_design(spec: Spec, loop=None) -> dict:
    """The numbers of the spec's own design without those about its changes, as a JSON-able dict; a missing number is None.

    stable, spectral_radius (per frame; missing after overflow or if rounding hides it, and then it is not known to be stable),
    only_oscillates (of a radius of 1: whether all modes are pairs on the circle, as those of a loop that conserves energy),
    period_s (of the frame), assumes (see `assumptions`); felt: stiffness (N/m) and damping (N*s/m) of the wall as the hand
    feels it towards 0 Hz, whether it is rigid, as an integrator makes it: then neither has a limit, and over_band, see
    `felt_over_band`; slowest: time constant (s), damping ratio from frame to frame and, at the strongest line that a spectrum
    of the states shows of it (see `lines_of`), the frequency (rad/s) of the slowest mode, the second line (Hz) if it has more
    than a third of the energy, and the states that take part most; least_damped: the same of the mode with the lowest damping
    ratio, if it is another one;
    channel_norm: of the wave channel, 1 or less if it is passive, missing if its matrix has more than LARGEST_CHANNEL entries.
    A drawn loop has no channel that a spec would name, and is felt at the hand's port if it has one.
    loop: the one prepared for responses, if it is known already.
    """
    own = own_loop(spec)
    refuse_singular(spec, own.drawing)
    (E, hidden), drawn, drift = telling_frames(own), own.drawn(), drift_of(own)
    radius, period = float(radius_of(E, hidden)), float(drawn.period * drawn.ticks)
    found = {"stable": radius < 1, "spectral_radius": _number(radius), "period_s": period, "assumes": assumes(spec)}
    if radius == 1:
        z = 1 + eigenvalues(E)[0].ravel()
        z = z[np.abs(z) > ON_CIRCLE]  # the others are over after one frame
        found["only_oscillates"] = bool(((np.abs(np.abs(z) - 1) <= ON_CIRCLE) & (np.abs(z.imag) > ON_CIRCLE)).all())
    # A design that is varied by something else keeps its channel.
    of_channel = tuple((path, value) for path, value in spec.values.items() if path.startswith(CHANNEL))
    channel, modes = None if spec.drawing else _channel_norm(of_channel), []
    if loop is None and not (spec.drawing and spec.drawing.hand is None):
        loop = loop_at_hand(spec)
    if found["stable"]:
        names, (delta, shares) = named_modes(E, drawn, drift)
        modes = [(complex(mode), leading(names, each)) for mode, each in zip(delta, shares, strict=True)]
        modes = modes or [(-1 + 0j, [])]  # without a state
    slowest = modes[0] if modes else None
    ratios = [np.nan_to_num(damping_ratio(mode), nan=1.0) if abs(1 + mode) >= GONE else 1.0 for mode, _ in modes]
    damped = modes[int(np.argmin(ratios))] if modes else None
    another = damped and abs(damped[0] - slowest[0]) > SAME and abs(damped[0] - slowest[0].conjugate()) > SAME
    named = {"slowest": slowest, "least_damped": damped if another else None}
    described = {name: mode and _mode(spec, *mode, period) for name, mode in named.items()}
    return found | {"felt": felt_at_rest(spec, loop), **described, "channel_norm": channel}


def limits(spec: Spec, report: Callable[[int, int], None] | None = None) -> list[dict]:
    """For each symbol that the loop reads: value, the ends of the stable interval about it, and the factors to them.

    low, high: None if the interval goes on to the end of the range that was searched (`from`, `to`): 0 or a tenth of the
    value, and ten times the value, as far as the spec takes these. intervals: all stable intervals in that range. certified:
    whether they are. open: the places in or beside the interval where nothing is known, see `open_places`. stopped: whether the
    range would go on, but takes more than WORK or SECONDS; it is then the part next to the value, or LATE is the doubt. report:
    is called with the numbers that are done, and all.
    """
    read = keys_of(spec) - (spec.drawing.of_losses if spec.drawing else set())
    names = {name: path for name, path in spec.names.symbols.items() if path in read and not spec.names.keys[path].structural}
    found = []
    for done, (name, path) in enumerate(names.items(), start=1):
        found.append(_limit(spec, name, path))
        if report:
            report(done, len(names))
    return found


def searched(spec: Spec, name: str, path: str) -> tuple[float, float]:
    """The range about the value of a number in which its stable intervals are looked for."""
    value, wall = spec.values[path], spec.wall
    usual = USUAL.get(dict(zip(wall, ("K_VE", "B_VE"), strict=False)).get(path, name), 1.0)
    start = 0.0 if path in wall or not (value or spec.drawing) else value / FAR or -FAR * usual
    low, high = sorted((start, float(np.clip(FAR * (value or usual), -LARGEST, LARGEST))))
    return low, high


def _limit(spec, name, path, span=None):
    value, span = spec.values[path], span or searched(spec, name, path)
    found = {"name": name, "value": value, "from": span[0], "to": span[1], "low": None, "high": None, "intervals": []}
    found |= {"stopped": False, "open": None}
    try:
        job = _job(spec, name, path, span)
        rows, (start, stop) = _rows(job, value, span)
    except WavesweepError as error:
        if value == 0 and span[0] < 0:  # a number that may not be negative
            return _limit(spec, name, path, (0.0, span[1]))

        def makes_loops(end: float) -> object:
            return _job(spec, name, path, tuple(sorted((float(value), end))))

        for attempt, times in ((lambda end: spec.with_values({path: end}), HALVINGS), (makes_loops, FEW)):
            less = tuple(_reached(attempt, value, end, times) for end in span)
            if less != span and less[0] < less[1]:
                return _limit(spec, name, path, less)
        return found | {"stable": None, "doubt": str(error), "certified": False}
    found |= {"from": start, "to": stop, "stopped": (start, stop) != span}
    if rows is None:
        return found | {"stable": None, "doubt": LATE, "certified": False}
    at_ends = [(rows[end] == value) & ~np.isnan(rows[f"{end}_omega"]) for end in ("low", "high")]
    inside = (rows["low"] <= value) & (value <= rows["high"]) & ~np.logical_or(*at_ends)
    pairs = zip(rows["low"].tolist(), rows["high"].tolist(), strict=True)
    found["intervals"] = [list(pair) for pair, number in zip(pairs, rows["intervals"].tolist(), strict=True) if number]
    found |= {"stable": bool(inside.any()), "doubt": str(rows["doubt"][0]), "certified": bool(rows["certified"].all())}
    if not inside.any():
        unknown = ((rows["open_low"] <= value) & (value <= rows["open_high"])).any()
        return found | ({"stable": None} if unknown else {})
    row = int(np.flatnonzero(inside)[0])
    found["open"] = open_places(rows, row)
    for end, of_range in (("low", start), ("high", stop)):  # one without a crossing may end where nothing is known
        if not np.isnan(rows[f"{end}_omega"][row]) or rows[end][row] != of_range:
            found[end] = float(rows[end][row])
    return found


def _job(spec, name, path, span):
    """The job of the intervals along a number alone."""
    return job_over(make_grid(spec, (), path), Axis(name, path, (), *span, False, "linear"))


def _rows(job, value, span):
    """The intervals, and the part of the range that was searched; None and the value itself if they take too long."""
    (search,) = searches_of(job, job.chunks[0]).searches
    if search.in_pieces:
        records, span = search.about(value, WORK)
        return {name: records[name] for name in records.dtype.names} | {"doubt": words(records["doubt"])}, span
    cost, way = cost_of(job.grid.spec, job.asked.axis)
    if cost > (SECONDS if way is Way.CUT else LONG):
        return None, (value, value)
    return in_memory(job), span


def _reached(attempt, value, end, times):
    """The value nearest to an end of a range whose attempt raises no error, by halving from the number's own on."""
    inside, tried, beyond = float(value), float(end), float(end)
    for _ in range(1 + times):
        try:
            attempt(tried)
            inside = tried
        except WavesweepError:
            beyond = tried
        if inside == beyond:
            break
        tried = (inside + beyond) / 2
    return inside


def _delays(spec):
    """The largest delay of the slow environment up to which every delay is stable, in ticks; none if the loop has none."""
    path = "environment.delay"
    if path not in keys_of(spec):
        return None
    now, most, frame = spec.values[path], None, longest_delay(spec.values["rates.ratio"])
    for delay in range(now, min(frame, now + DELAYS) + 1):
        if not radii_of(loops_of(spec, {**spec.values, path: delay}).read)[0] < 1:
            break
        most = delay
    return {"ticks": now, "most": most, "frame": frame, "tried": min(frame, now + DELAYS)}


def _mode(spec, mode, states, period):
    """Of a mode: s per factor e, damping ratio, rad/s of its strongest line, Hz of a second one, and the states."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a mode of 0 is over after one frame
        s = np.log1p(mode)
        hz, second = lines_in_loops(own_loop(spec), np.array([[s]]))[0].tolist()
        s = complex(s.real / period, 2 * np.pi * hz)
        ratio = float(damping_ratio(mode))  # from frame to frame, as requirements and wishes mean it
        found = {"time_constant_s": -1 / s.real, "damping_ratio": ratio, "omega": s.imag, "second_hz": second}
    return {name: _number(value) for name, value in found.items()} | {"states": states}


@lru_cache(maxsize=64)
def _channel_norm(kept):
    from wavesweep.core.loops.controllers import loop_drawing
    from wavesweep.passive.channel import channel_of, norm_of

    values = {path: KEYS[path].default for path in VALUE_PATHS} | dict(kept)
    channel = channel_of(loop_drawing(values), values)
    return None if channel is None or channel.entries > LARGEST_CHANNEL else _number(norm_of(channel).norm)


def _number(value):
    return float(value) if np.isfinite(value) else None
