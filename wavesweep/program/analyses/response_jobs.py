"""Frequency responses of a spec over axes, at the hand or between an input and an output."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np

from wavesweep.engine.doubts import Doubt, words
from wavesweep.engine.errors import SpecError
from wavesweep.engine.keys import Mistakes
from wavesweep.engine.loop import Loops
from wavesweep.engine.response import Lifted, Route, gain_of, ports_of_batch, respond, transfer
from wavesweep.haptics.controller_page import RATIO, steps_of
from wavesweep.program.analyses.spec_loops import port_at_hand
from wavesweep.program.columns import SPARED, Columns, complex_columns
from wavesweep.program.reading.axes import Axis
from wavesweep.program.spec.studies import refuse_beyond_half
from wavesweep.program.sweep.grid import keys_of, loops_of, make_grid, refuse_rows
from wavesweep.program.sweep.job import Chunks, Job, JobKind
from wavesweep.program.sweep.running import in_memory

PARTS = ("re", "im", "abs", "deg")
NUMBERS = (
    "omega_Ts",
    *(f"{name}_{suffix}" for name in ("admittance", "impedance") for suffix in PARTS),
    "worst_gain",
)
ERRORS = ("admittance_error", "impedance_error", "worst_gain_error")


def _record(numbers, errors):
    numbers, errors = ([(name, "<f8") for name in names] for names in (numbers, errors))
    return np.dtype([("slice", "<i4"), *numbers, ("stable", "?"), *errors, ("doubt", "i1")])


RESPONSE = _record(NUMBERS, ERRORS)
TRANSFER = _record(
    ("omega_Ts", *(f"response_{suffix}" for suffix in PARTS)), ("response_error",)
)  # of a signal to an input
# responses of a chunk times ticks of a frame: a tenth to half a second, and some 50 MB
RESPONSES_OF_CHUNK = 100_000
# frequencies of a chunk: the last digits depend on those that are computed together, so few tables
# are cut there
FREQUENCIES_OF_CHUNK = 10_000


@dataclass(frozen=True, slots=True)
class ResponseQuery:
    """Frequencies (Hz), the names of all columns before the spec's name, the keys that the
    controller reads, and the route."""

    frequency: np.ndarray
    names: tuple[str, ...]
    read: frozenset[str]
    route: Route | None


def one_spec(spec, axes, frequency, read, route: Route | None) -> Columns:
    """Table of one spec over `axes`, at the frequencies (Hz, an array); read: the keys that its
    controller reads."""
    return in_memory(
        response_job(spec, axes, frequency, tuple(axis.name for axis in axes), read, route)
    )


def response_job(
    spec, axes, frequency_hz, names: tuple[str, ...], read=None, route: Route | None = None
) -> Job:
    """The job of one spec over `axes`; names: the axes of all specs. Raises UsageError if it cannot
    be done.

    route: an input and an output, between which the responses are, in place of those at the hand.

    A slice is a loop at a frequency. A chunk has all frequencies of some curves or, if these are
    more than FREQUENCIES_OF_CHUNK, a part of those of one curve.
    """
    read, frequency = keys_of(spec) if read is None else read, np.asarray(frequency_hz, float)
    grid = make_grid(spec, axes, read=read, apart=False, rates=False)
    refuse_rows("bode", grid.size * frequency.size)
    # raise SpecError for frequencies beyond half the fast rate, which a force that is held over a
    # tick does not have
    name = "rates.tick_hz" if grid.spec.drawing else "rates.fast_hz"
    highest = frequency.max(initial=0.0)
    axis_of_bode = Axis("frequency_hz", "bode.frequency_hz", (), 0.0, highest, False)
    beyond = Mistakes()
    refuse_beyond_half(axis_of_bode, grid.axes, grid.spec.tick_hz, name, beyond)
    if beyond:
        raise SpecError(beyond)
    grid.resolve_all("bode")
    points = frequency.size
    if spec.drawing:
        ticks = _ticks_drawn(spec, at_hand=route is None)
    else:
        ticks = max(steps_of(values[RATIO])[0] for values in grid.resolved.values())
    curves = 1
    if 0 < points <= FREQUENCIES_OF_CHUNK:
        curves = max(1, RESPONSES_OF_CHUNK // ticks // points)
    chunks = Chunks(grid.loops, points, curves, min(points, FREQUENCIES_OF_CHUNK))
    query = ResponseQuery(frequency, names, read, route)
    if route:
        identity = {"records": "transfer", "route": list(route)}
        return Job(TRANSFERS, grid, chunks, TRANSFER, identity, query)
    return Job(RESPONSES, grid, chunks, RESPONSE, {"records": "responses"}, query)


@lru_cache(maxsize=64)  # a compiled loop is asked again and again
def _ticks_drawn(spec, *, at_hand):
    """The ticks of a drawn loop's frame. Errors: SpecError if the responses are at the hand, and
    it has no port of one."""
    if at_hand:
        port_at_hand(spec)
    return loops_of(spec, spec.values).drawn().ticks


def _task(job, chunk):
    spec, groups = job.grid.spec, []
    for members, loops in job.grid.drawn(numbers=chunk.loops):
        read = {path: value for path, value in loops.values.items() if path in loops.drawing.reads}
        groups.append(
            (members, Loops(loops.drawing, read), None if spec.drawing else loops.values[RATIO])
        )
    frequency = job.asked.frequency[chunk.points.start : chunk.points.stop]
    return partial(_records, tuple(groups), frequency, job.asked.route, job.dtype)


def _records(parts, frequency, route, dtype):
    """A record for each loop and frequency, the frequencies of a loop one after the other.

    parts: (members, loops, ratio of a controller's rates), whose members number all loops from 0.
    """
    records = np.empty((sum(members.size for members, *_ in parts), frequency.size), dtype)
    for members, loops, ratio in parts:
        if members.size > 1:
            several = _prepared(loops, members.size, ratio, route)
        else:
            several = _prepared_one(loops.drawing, loops.one(0).items, ratio, route)
        for prepared in several:
            for name, array in prepared.columns(frequency).items():
                records[name][members[prepared.at]] = array
    records = records.reshape(-1)
    records["slice"] = np.arange(records.size)
    return records


def _columns(job, combination, records):
    """The axes of all specs, the spec, the frequency, and the fields of the records."""
    index, point = np.divmod(combination, job.asked.frequency.size)
    spec, rows, route = job.grid.spec, combination.size, job.asked.route
    columns = {
        name: np.full(rows, own_value(spec, name, job.asked.read)) for name in job.asked.names
    }
    columns |= job.grid.axis_columns(index)
    text = {"spec": spec.name, "controller": spec.kind}
    if route:
        text = {
            "spec": spec.name,
            "from_input": route[0],
            "to_output": route[1],
            "unit": spec.unit_between(*route),
        }
    columns |= {name: np.full(rows, word, dtype=object) for name, word in text.items()}
    columns["frequency_hz"] = job.asked.frequency[point]
    columns |= {
        name: np.ascontiguousarray(records[name]) for name in job.dtype.names if name != "slice"
    }
    return columns | {"doubt": words(records["doubt"])}


# Bytes of a row: measured, 320 in the CSV and 130 in the Parquet file, and longer names of specs.
RESPONSES = JobKind(_task, _columns, "responses", certifies=False, row_bytes=480)
TRANSFERS = JobKind(_task, _columns, "responses", certifies=False, row_bytes=300)


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """Loops of one drawing, ready for any frequency. at: which of a batch they are. slow: ticks in
    a sample of the slow rate.

    gain: gives the worst-case gain; None of loops between an input and an output.
    """

    at: np.ndarray
    loop: Lifted
    gain: Callable | None
    radius: np.ndarray
    slow: float

    def columns(self, frequency) -> dict[str, np.ndarray]:
        """The columns of the table, `(loops, frequencies)` or what is broadcast to it.

        A number without bound is missing, and its error with it, but that is known, and no doubt.
        """
        columns = {"omega_Ts": 2 * np.pi * frequency * (self.slow * (1 / self.loop.port.rate))}
        if self.gain is None:
            value, error = transfer(self.loop, frequency)
            columns, errors = columns | complex_columns("response", value), {"response": error}
        else:
            felt, (gain, gain_error) = respond(self.loop, frequency), self.gain(frequency)
            columns |= complex_columns("admittance", felt.admittance) | complex_columns(
                "impedance", felt.impedance
            )
            columns["worst_gain"] = gain
            errors = {
                "admittance": felt.admittance_error,
                "impedance": felt.impedance_error,
                "worst_gain": gain_error,
            }
        radius, lost = self.radius[:, None], self.loop.lost[..., None]
        is_known = {
            name: ~np.isnan(columns[name if name in columns else f"{name}_re"]) for name in errors
        }
        columns |= {
            f"{name}_error": np.where(is_known[name], error, np.nan)
            for name, error in errors.items()
        }
        doubt = _doubts(errors.values(), radius < 1, lost | np.isnan(radius), radius == 1)
        return columns | {"stable": radius < 1, "doubt": doubt}


@lru_cache(maxsize=4)  # a compiled loop is asked again and again
def _prepared_one(drawing, items, ratio, route):
    return _prepared(Loops(drawing, dict(items)), 1, ratio, route)


def _prepared(loops, size, ratio, route) -> list[Prepared]:
    """Loops of one drawing, as many at a time as are computed together."""
    prepared = []
    for members, port in ports_of_batch(loops, size, route):
        loop, these = Lifted.of(port), loops if members.size == size else loops.some(members)
        radius = np.zeros(members.size)  # 0 stands for any that is surely less than 1
        rest = np.flatnonzero(~np.broadcast_to(loop.stable_for_sure(), members.shape))
        if rest.size:
            radius[rest] = these.some(rest).radii(rest.size)
        gain = None if route else gain_of(loop)
        prepared.append(
            Prepared(members, loop, gain, radius, port.slowest if ratio is None else ratio)
        )
    return prepared


def doubt_of(errors, stable, lost, marginal=False) -> np.ndarray:
    """The word of each row (see `program.doubts`); errors: bounds on relative errors, NaN if a
    number is not known.

    An unstable loop has no steady response, even if its digits are good; one that overflows within
    a frame has no number. marginal: the spectral radius is below 1 by rounding alone, or 1.
    """
    return words(_doubts(errors, stable, lost, marginal))


def _doubts(errors, stable, lost, marginal):
    rounded = ~np.logical_and.reduce([error <= SPARED for error in errors])
    certain = np.where(
        stable,
        np.where(rounded, Doubt.ROUNDING, Doubt.NONE),
        np.where(marginal, Doubt.ROUNDING, Doubt.UNSTABLE),
    )
    codes = np.where(lost, Doubt.OVERFLOW, certain)
    return np.broadcast_to(codes, np.broadcast_shapes(codes.shape, rounded.shape))


def own_value(spec: Any, name: str, read: Collection[str]) -> Any:
    """The spec's own value of a key, named as an axis is; NaN if its controller reads other keys
    (`read`)."""
    key = spec.names.find(name)
    value = None if key is None else spec.own(key.path)
    if value is None or key.type == "integer":
        return np.nan if value is None else value
    if ("rates.ratio" if key.path == "rates.slow_hz" else key.path) in read:
        return value
    return np.nan


def units_in(several, name: str) -> list[tuple[str, str]]:
    """The unit of a column of an axis in each spec that has values there; several: specs, each
    with its axes."""
    return [
        (spec.name, spec.names.find(name).unit)
        for spec, axes in several
        if has_values(spec, axes, name, keys_of(spec))
    ]


def has_values(spec, axes, name, read) -> bool:
    """Whether a spec has values of an axis; read: the keys that its controller reads."""
    return name in {axis.name for axis in axes} or not np.isnan(own_value(spec, name, read))
