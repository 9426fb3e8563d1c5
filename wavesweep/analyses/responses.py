"""The job of frequency responses of a spec over axes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from wavesweep.analyses.loops import Route, ports_of, ports_of_batch, radii_of
from wavesweep.columns import Columns, complex_columns
from wavesweep.errors import SpecError
from wavesweep.loops.from_drawing import assembled
from wavesweep.loops.page import RATIO, steps_of
from wavesweep.response.gain import gain_of
from wavesweep.response.lifted import Lifted
from wavesweep.response.steady import respond, transfer
from wavesweep.spec.axes import Axis
from wavesweep.spec.drawing import Drawing
from wavesweep.spec.studies import beyond_half
from wavesweep.stability.certificate import NONE, OVERFLOW, ROUNDING, SPARED, UNSTABLE, words
from wavesweep.sweep.grid import drawing_for, groups, items_of, keys_of, make_grid, refuse_rows, selected
from wavesweep.sweep.job import Chunk, Chunks, Job, resolve_all
from wavesweep.sweep.running import in_memory


def doubt_of(errors, stable, lost, marginal=False) -> np.ndarray:
    """The word of each row (see `DOUBTS`); errors: bounds on relative errors, NaN if a number is not known.

    An unstable loop has no steady response, even if its digits are good; one that overflows within a frame has no number.
    marginal: see `_doubts`.
    """
    return words(_doubts(errors, stable, lost, marginal))


def _doubts(errors, stable, lost, marginal=False):
    """The codes of the words. marginal: the spectral radius is below 1 by rounding alone, or 1."""
    rounded = ~np.logical_and.reduce([error <= SPARED for error in errors])
    certain = np.where(stable, np.where(rounded, ROUNDING, NONE), np.where(marginal, ROUNDING, UNSTABLE))
    codes = np.where(lost, OVERFLOW, certain)
    return np.broadcast_to(codes, np.broadcast_shapes(codes.shape, rounded.shape))


NUMBERS = (
    "omega_Ts",
    *(f"{name}_{part}" for name in ("admittance", "impedance") for part in ("re", "im", "abs", "deg")),
    "worst_gain",
)
ERRORS = ("admittance_error", "impedance_error", "worst_gain_error")
RESPONSE = np.dtype(
    [
        ("slice", "<i4"),
        *((name, "<f8") for name in NUMBERS),
        ("stable", "?"),
        *((name, "<f8") for name in ERRORS),
        ("doubt", "i1"),
    ]
)
TRANSFER = np.dtype(
    [
        *(RESPONSE.descr[:2]),
        *((f"response_{part}", "<f8") for part in ("re", "im", "abs", "deg")),
        ("stable", "?"),
        ("response_error", "<f8"),
        ("doubt", "i1"),
    ]
)  # of a signal to an input
TICKS = 100_000  # responses of a chunk times ticks of a frame: a tenth to half a second, and some 50 MB
WIDE = 10_000  # frequencies of a chunk: the last digits depend on those that are computed together, so few tables are cut there


def one_spec(spec, axes, frequency, read, route: Route | None = None) -> Columns:
    """Table of one spec over `axes`, at the frequencies (Hz, an array); read: the keys that its controller reads."""
    return in_memory(response_job(spec, axes, frequency, tuple(axis.name for axis in axes), read, route))


def response_job(spec, axes, frequency_hz, names: tuple[str, ...], read=None, route: Route | None = None) -> "ResponseJob":
    """The job of one spec over `axes`; names: the axes of all specs. Raises UsageError if it cannot be done.

    route: an input and an output, between which the responses are, in place of those at the hand.

    A chunk has all frequencies of some curves or, if these are more than WIDE, a part of those of one curve.
    """
    read, frequency = keys_of(spec) if read is None else read, np.asarray(frequency_hz, float)
    grid = make_grid(spec, axes, read=read, apart=False)
    refuse_rows("bode", grid.size * frequency.size)
    _refuse_aliases(grid, frequency)
    resolved = resolve_all(grid, "bode")
    points = frequency.size
    if spec.drawing:
        ticks = _ticks_drawn(spec, at_hand=route is None)
    else:
        ticks = max(steps_of(values[RATIO])[0] for values in resolved.values())
    curves = TICKS // ticks // points if 0 < points <= WIDE else 1
    chunks = Chunks(grid.loops, points, max(1, curves), min(points, WIDE))
    if route:
        return TransferJob(grid, chunks, resolved, frequency, names, read, route)
    return ResponseJob(grid, chunks, resolved, frequency, names, read)


@lru_cache(maxsize=64)  # a compiled loop is asked again and again
def _ticks_drawn(spec, *, at_hand):
    """The ticks of a drawn loop's frame. Errors: SpecError if the responses are at the hand, and it has no port of one."""
    if at_hand:
        ports_of(spec, spec.drawing)
    return assembled(spec.drawing, spec.values).ticks


@dataclass(frozen=True, slots=True, eq=False)
class ResponseJob(Job):
    """Responses of every slice of the grid, a loop with its wall, at every frequency (Hz).

    In the chunks, the frequencies are in the place of the walls: slice = loop * frequencies + frequency. names: of all
    columns before the spec's name. read: the keys that the controller reads. route: see `response_job`.
    """

    frequency: np.ndarray
    names: tuple[str, ...]
    read: frozenset[str]
    route: Route | None = None
    noun: ClassVar[str] = "responses"
    dtype: ClassVar[np.dtype] = RESPONSE
    row_bytes: ClassVar[int] = 480  # measured: 320 in the CSV and 130 in the Parquet file, and longer names of specs
    proves: ClassVar[bool] = False

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.grid.size * self.frequency.size

    @property
    def identity(self) -> dict[str, object]:
        """The kind of the records; the spec has the frequencies."""
        return {"records": "responses"}

    def slice_of(self, combination) -> np.ndarray:
        """Number of the slice of each row, frequencies innermost."""
        at, point = np.divmod(combination, self.frequency.size)
        return self.grid.slice_of(at) * self.frequency.size + point

    def task(self, chunk: Chunk) -> "ResponseTask":
        """The task of a worker for that chunk."""
        loops = np.arange(chunk.loops.start, chunk.loops.stop)
        frequency = self.frequency[chunk.walls.start : chunk.walls.stop]
        parts = groups(self.grid.spec, self.grid.loop_values(loops), loops.size, self.resolved)
        return ResponseTask(tuple(LoopGroup.of(self.grid.spec, *part, self.route) for part in parts), frequency, self.dtype)

    def columns(self, combination: np.ndarray, records: np.ndarray) -> dict[str, np.ndarray]:
        """The axes of all specs, the spec, the frequency, and the fields of the records."""
        at, point = np.divmod(combination, self.frequency.size)
        spec, rows = self.grid.spec, combination.size
        columns = {name: np.full(rows, own_value(spec, name, self.read)) for name in self.names} | self.grid.axis_columns(at)
        text = {"spec": spec.name, "controller": spec.kind}
        if self.route:
            text = {
                "spec": spec.name,
                "from_input": self.route[0],
                "to_output": self.route[1],
                "unit": spec.unit_between(*self.route),
            }
        columns |= {name: np.full(rows, word, dtype=object) for name, word in text.items()}
        columns["frequency_hz"] = self.frequency[point]
        columns |= {name: np.ascontiguousarray(records[name]) for name in self.dtype.names if name != "slice"}
        return columns | {"doubt": words(records["doubt"])}

    def certified(self, records: np.ndarray) -> int:
        """None: each response has its own bounds."""
        del records
        return 0


@dataclass(frozen=True, slots=True, eq=False)
class TransferJob(ResponseJob):
    """The same between an input and an output."""

    dtype: ClassVar[np.dtype] = TRANSFER
    row_bytes: ClassVar[int] = 300

    @property
    def identity(self) -> dict[str, object]:
        """The kind of the records, and what they are between."""
        return {"records": "transfer", "route": list(self.route)}


@dataclass(frozen=True, slots=True, eq=False)
class LoopGroup:
    """Loops of one drawing: their numbers, flat values with arrays over them, and the ratio of a controller's rates.

    route: see `response_job`.
    """

    members: np.ndarray
    drawing: Drawing
    values: Mapping[str, object]
    ratio: float | None
    route: Route | None = None

    @staticmethod
    def of(spec, members, values, route=None) -> "LoopGroup":
        """Return loops of a spec with these numbers and values; see `groups`."""
        drawing = drawing_for(spec, values)
        some = {path: value for path, value in values.items() if path in drawing.reads}
        return LoopGroup(members, drawing, some, None if spec.drawing else values[RATIO], route)


@dataclass(frozen=True, slots=True, eq=False)
class ResponseTask:
    """Responses of loops at frequencies (Hz). groups: number the loops from 0. dtype: of the records."""

    groups: tuple[LoopGroup, ...]
    frequency: np.ndarray
    dtype: np.dtype

    def records(self) -> np.ndarray:
        """A record for each loop and frequency, the frequencies of a loop one after the other."""
        records = np.empty((sum(group.members.size for group in self.groups), self.frequency.size), self.dtype)
        for group in self.groups:
            for prepared in _prepared(group):
                for name, array in prepared.columns(self.frequency).items():
                    records[name][group.members[prepared.at]] = array
        records = records.reshape(-1)
        records["slice"] = np.arange(records.size)
        return records


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """Loops of a group, ready for any frequency. at: which of it they are. slow: ticks in a sample of the slow rate.

    gain: gives the worst-case gain; None of loops between an input and an output.
    """

    at: np.ndarray
    loop: Lifted
    gain: Callable | None
    radius: np.ndarray
    slow: float

    def columns(self, frequency) -> dict[str, np.ndarray]:
        """The columns of the table, `(loops, frequencies)` or what is broadcast to it."""
        columns = {"omega_Ts": 2 * np.pi * frequency * (self.slow * (1 / self.loop.port.rate))}
        if self.gain is None:
            value, error = transfer(self.loop, frequency)
            columns, errors = columns | complex_columns("response", value), {"response": error}
        else:
            found, (gain, gain_error) = respond(self.loop, frequency), self.gain(frequency)
            columns |= complex_columns("admittance", found.admittance) | complex_columns("impedance", found.impedance)
            columns["worst_gain"] = gain
            errors = {"admittance": found.admittance_error, "impedance": found.impedance_error, "worst_gain": gain_error}
        radius, lost = self.radius[:, None], self.loop.lost[..., None]
        columns |= {"stable": radius < 1}
        columns |= _errors_shown(columns, errors)
        return columns | {"doubt": _doubts(errors.values(), radius < 1, lost | np.isnan(radius), radius == 1)}


def _prepared(group) -> list[Prepared]:
    """The loops of a group, as many at a time as are computed together; one alone is remembered."""
    if group.members.size > 1:
        return _prepare(group.drawing, group.values, group.members.size, group.ratio, group.route)
    values = {path: np.ravel(value)[0].item() if np.ndim(value) else value for path, value in group.values.items()}
    return _prepared_one(group.drawing, items_of(values), group.ratio, group.route)


@lru_cache(maxsize=4)  # a compiled loop is asked again and again
def _prepared_one(drawing, items, ratio, route):
    return _prepare(drawing, dict(items), 1, ratio, route)


def _prepare(drawing, values, size, ratio, route):
    found, ticks = [], 1 if ratio is None else steps_of(ratio)[0]
    for at, port in ports_of_batch(drawing, values, size, route):
        loop, some = Lifted.of(port), values if at.size == size else selected(values, at)
        radius = np.zeros(at.size)  # of which 0 means that it is less than 1
        rest = np.flatnonzero(~np.broadcast_to(loop.stable_for_sure(), at.shape))
        if rest.size:
            radius[rest] = radii_of(drawing, selected(some, rest), rest.size)
        gain = None if route else gain_of(loop, ticks)
        found.append(Prepared(at, loop, gain, radius, port.slowest if ratio is None else ratio))
    return found


def _errors_shown(columns, errors):
    """The columns of errors. A number without bound is missing, and its error with it, but that is known, and no doubt."""
    values = {name: columns[name if name in columns else f"{name}_re"] for name in errors}
    return {f"{name}_error": np.where(np.isnan(values[name]), np.nan, error) for name, error in errors.items()}


def own_value(spec, name, read):
    """The spec's own value of a key, named as an axis is; NaN if its controller reads other keys (`read`)."""
    key = spec.names.find(name)
    own = None if key is None else spec.own(key.path)
    if own is None or key.type == "integer":
        return np.nan if own is None else own
    return own if ("rates.ratio" if key.path == "rates.slow_hz" else key.path) in read else np.nan


def units_in(several, name: str) -> list[tuple[str, str]]:
    """The unit of a column of an axis in each spec that has values there; several: specs, each with its axes."""
    return [(spec.name, spec.names.find(name).unit) for spec, axes in several if has_values(spec, axes, name, keys_of(spec))]


def has_values(spec, axes, name, read):
    return name in {axis.name for axis in axes} or not np.isnan(own_value(spec, name, read))


def _refuse_aliases(grid, frequency):
    """Raise SpecError for frequencies beyond half the fast rate, which a force that is held over a tick does not have."""
    name = "rates.tick_hz" if grid.spec.drawing else "rates.fast_hz"
    own = Axis("frequency_hz", "bode.frequency_hz", (), 0.0, frequency.max(initial=0.0), False)
    if beyond := list(beyond_half(own, grid.axes, grid.spec.tick_hz, name)):
        raise SpecError(beyond)
