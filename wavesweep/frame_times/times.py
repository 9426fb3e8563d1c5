"""Frames from a file of time stamps or durations, in ticks of the fast loop."""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import nearest
from wavesweep.program.csv_files import MOST, TRACE, of_time, option, read_csv
from wavesweep.program.reading.units import TIME, column_named, converted, unit_in

OF_FRAMES = ("time", "duration")  # what a column of frames may be
EVEN = 1e-4  # of a tick, by which one that is not late may be longer, as by the digits of a stamp
FITS = 0.1  # ticks by which a frame may differ from a whole number of them
LONGEST_FRAME_S = 10.0  # s, of most frames
LEAST_OF_TICK = 1e-3  # of a tick, in which most frames are of another unit
KNOWN = {  # columns of programs: what they are, and the factor to s
    "elapsed": ("time", 1e-9),  # MangoHud, whose frametime is in us or ms
    "intendedvsync": ("time", 1e-9),  # framestats of Android
    "predicteddisplaytime": ("time", 1e-9),  # OpenXR
    "frametime": ("duration", 1e-3),
    "msbetweenpresents": ("duration", 1e-3),  # PresentMon 1 and CapFrameX
    "timeinseconds": ("time", 1.0),
    "__time": ("time", 1.0),  # PlotJuggler
    "%time": ("time", 1e-9),  # rostopic
}
# ends of names in messages of ROS 2, as those of ros2_control
SECONDS = "stamp.sec"
NANOSECONDS = "stamp.nanosec"
# of PresentMon, in a file with the frames of several programs
ONE_OF = ("Application", "SwapChainAddress", "ProcessID")
LOOP_COUNT = "loopIteration"  # of a flight controller's blackbox, whose time is in us


@dataclass(frozen=True, eq=False)
class MeasuredFrames:
    """Frames in a row: when each begins (s, by the clock of the file), and how long it lasts
    (ticks, as it was measured).

    sha256: of the file. every: the loop looks for a result of the slow environment in every so many
    of its ticks, so that frames last multiples of them. taken: a sentence on the column, if it
    names another unit.
    """

    begins: np.ndarray
    ticks: np.ndarray
    sha256: str
    every: int = 1
    taken: str = ""

    @property
    def are_ticks(self) -> bool:
        """Whether these are the ticks of the fast loop itself, and no frames."""
        # Below this the stamps are those of the fast loop itself.
        return float(np.median(self.ticks)) < 1.5

    @property
    def unfit(self) -> np.ndarray:
        """Which frames do not last whole ticks, or no multiple of `every`."""
        return np.abs(self.ticks - self.every * np.round(self.ticks / self.every)) > FITS

    @property
    def possible(self) -> tuple[np.ndarray, np.ndarray]:
        """The ticks that the fast loop counts in each frame, at least and at most.

        It counts its own ticks between two stamps. If a frame does not last whole ticks, their
        number depends on where the stamps lie between two ticks, which is not known; so with
        multiples of `every`.
        """
        counts = self.ticks / self.every
        nearest_counts = np.round(counts)
        least = np.where(self.unfit, np.floor(counts), nearest_counts).astype(int)
        most = np.where(self.unfit, np.ceil(counts), nearest_counts).astype(int)
        return self.every * least, self.every * most

    @property
    def lengths(self) -> np.ndarray:
        """The length of each frame as the loop may count it. Those that do not fit are rounded
        so that their sum is right."""
        counts = self.ticks / self.every
        unfit = self.unfit
        lengths = np.round(counts)
        lengths[unfit] = np.diff(np.round(np.cumsum(counts[unfit])), prepend=0.0)
        return self.every * lengths.astype(int)

    @property
    def values(self) -> np.ndarray:
        """All lengths that may have occurred, in increasing order."""
        return np.unique(self.possible)


def read_run(
    path: str | Path,
    fast_hz: float,
    columns: Mapping[str, str] | None,
    scales: Mapping[str, float] | None = None,
    most: float = 1e9,  # ticks of a frame
    *,
    own_ticks: bool = False,
) -> MeasuredFrames:
    """Read a run. fast_hz: the rate of the ticks. columns, scales: see `log.read_log`, of the names
    time and duration; another name in `columns` is a column of the file, whose rows with this value
    are read.

    scales: None where there is no option, but a list in a spec. most: ticks that a frame may last.
    own_ticks: whether the stamps may be those of the fast loop itself, some of whose ticks are
    shorter than its own.

    Errors: UsageError that names the file, the line or the column, what was expected and what was
    found.
    """
    columns = columns or {}
    options = scales is not None
    file = read_csv(path, 1_000_000_000)  # bytes
    others = columns.keys() - {*OF_FRAMES}
    for name in others - {*file.names} or (scales or {}).keys() - {*OF_FRAMES}:
        raise UsageError(f"{path}: expected time, duration or a column of the file, found {name}")
    for name in others:
        file = file.only(name, columns[name])
    _refuse_several(path, file, options)
    named = {name: columns[name] for name in columns.keys() - others}
    column = _column(path, file, named, options)
    name = column.name
    rows = file.numbers(column.columns, 3 if name == "time" else 2)
    place = (column.columns[0], column.unit)
    readings, said = converted(rows @ np.array(column.factors), place, path, name, scales, "s")
    largest = float(np.abs(readings).max())
    if largest > MOST:
        raise UsageError(
            f"{path}: {name}: expected a largest size of {MOST:g} s, found {largest:g}"
        )
    if column.known and name == "duration" and readings[0] == 0:  # there is none before the first
        readings = readings[1:]
    if name == "time":
        begins = readings[:-1]
        durations = np.diff(readings)
    else:
        begins = np.cumsum(readings) - readings
        durations = readings
    median = float(np.median(durations))
    _refuse_other_unit(f"{path}: {name}", name, median, fast_hz, options)
    ticks = durations * fast_hz
    begin = len(rows) - len(readings) + (name == "time")  # a row with a time ends a frame
    run = MeasuredFrames(begins, ticks, file.sha256, taken=said)
    volts = [column for column in file.names if unit_in(column, "V") in ("V", "mV")]
    if volts and np.ptp(durations) < EVEN * median:
        expected = "expected times at which ticks begin, such as those of its rising edges"
        raise UsageError(f"{path}: {expected}, found even samples of {volts[0]}")
    least = 0.0 if own_ticks and run.are_ticks else 1 - FITS
    wrong = _wrong_length(ticks, fast_hz, least, most)
    if wrong:
        frame, expected, hint = wrong
        raise UsageError(
            f"{path}:{file.line(begin + frame)}: {name}: expected frames of {expected}, "
            f"found one of {1e3 * durations[frame]:.6g} ms{hint}"
        )
    return run


def _refuse_other_unit(
    column: str, name: str, median: float, fast_hz: float, options: bool
) -> None:
    """Raise UsageError for frames so long or short that they are in another unit; median: s."""
    if median > LONGEST_FRAME_S:
        limit = f"expected frames of at most {LONGEST_FRAME_S:g} s, found {median:.6g} s for most"
        hint = of_time(name, median) if options else "are they in ms?"
        raise UsageError(f"{column}: {limit}; {hint}")
    if 0 < median < LEAST_OF_TICK / fast_hz:
        limit = f"expected frames of about a tick of {1e3 / fast_hz:.6g} ms or more"
        hint = f"; --scale {name}=1 if its numbers are in s" if options else ""
        raise UsageError(f"{column}: {limit}, found {median:.6g} s for most{hint}")


@dataclass(frozen=True)
class FrameColumn:
    """What is read, time or duration, from which columns, whose sum it is with these factors, in a
    unit, s if it is empty; known: by their names alone."""

    name: str
    columns: tuple[str, ...]
    factors: tuple[float, ...] = (1.0,)
    known: bool = False
    unit: str = ""


def _column(path, file, columns, options) -> FrameColumn:
    """The column that is read."""
    for name in (*columns, *OF_FRAMES):
        if name in columns:
            place = (columns[name], unit_in(columns[name], "s"))
        else:
            place = column_named(file.names, TIME if name == "time" else (name,), "s")
        if place and place[0] in file.names:
            in_us = LOOP_COUNT in file.names and place[0] == "time"
            return FrameColumn(name, place[:1], unit=place[1] or "us" * in_us)
    if not columns:
        known = _known(file)
        if known is not None:
            return known
    likely = [
        column for column in file.names if "time" in column.lower() or "stamp" in column.lower()
    ]
    meant = nearest("time", file.names) or (likely[0] if likely else "NAME")
    hint = f"{_choice(path, 'time', meant, options)} names that of stamps"
    expected = " or ".join(columns.values() or OF_FRAMES)
    raise UsageError(f"{path}: expected a column {expected}, found {file.listed}; {hint}")


def _known(file) -> FrameColumn | None:
    """The column of a program whose names are known."""
    lower = {name.lower(): name for name in file.names}
    for name, (what, factor) in KNOWN.items():
        if name in lower:
            return FrameColumn(what, (lower[name],), (factor,), known=True)
    seconds = next((name for name in file.names if name.endswith(SECONDS)), None)
    if seconds is None:
        return None
    nanoseconds = seconds.removesuffix(SECONDS) + NANOSECONDS
    if nanoseconds not in file.names:
        return None
    return FrameColumn("time", (seconds, nanoseconds), (1.0, 1e-9), known=True)


def _choice(path, name, value, options) -> str:
    """How a column is named, or the value that its rows have, on the command line or in a spec."""
    if options:
        return option(name, value)
    return f"frames = {json.dumps([Path(path).name, f'{name}={value}'])}"


def _refuse_several(path, file, options) -> None:
    """Raise UsageError for a file with the frames of several programs, or with several events."""
    for name in ONE_OF if file.names != TRACE else ("event",):
        if name not in file.names:
            continue
        values = [*dict(Counter(filter(None, file.cells(name))).most_common())]
        if len(values) > 1:
            shown = ", ".join(values[:3])
            hint = f"{_choice(path, name, values[0], options)} keeps those of the first"
            raise UsageError(
                f"{path}: {name}: expected the frames of one, found {len(values)} ({shown}); {hint}"
            )


def _wrong_length(ticks, fast_hz, least, most) -> tuple[int, str, str] | None:
    """The first frame that is shorter than the least ticks, or longer than the most, what is
    expected and a hint; None if all are right."""
    tick = f"of {1e3 / fast_hz:.6g} ms"
    short = (ticks < least) | (ticks <= 0)
    if short.any():
        expected = f"at least a tick {tick}" if least else "some time"
        return int(short.argmax()), expected, ""
    long = ticks > most + FITS
    if long.any():
        hint = "; is it a pause of the recording? Cut it out"
        return int(long.argmax()), f"at most {most:g} ticks {tick}", hint
    return None
