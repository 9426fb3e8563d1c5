"""The table [simulate]: what goes into the loop, how long, and how the rig differs from the ideal
one.

Its `frames` are a list, in which each frame is a number of ticks or a table of ticks, delay and
lost, or the word "random", or the name of a file; its `messages` are a table of lists, one for each
channel of the loop.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

from wavesweep.engine.drawing import MOST_LATE, RATE, Drawing
from wavesweep.engine.errors import SpecError
from wavesweep.engine.keys import LONGEST_FRAME, Key, Leaf, Mistakes, Place, nearest, show
from wavesweep.program.reading.axes import Axis, axis_place, build_axis, linear
from wavesweep.program.reading.keys import HARDWARE_KEYS, HIGHEST_RATIO, MOST_SEED, HapticDevice
from wavesweep.program.reading.sorting import Sorted, names_in_list
from wavesweep.program.reading.tables import SpecTable, TableValue

if TYPE_CHECKING:
    from wavesweep.program.spec.schema import Shapes
    from wavesweep.program.spec.spec import Spec
    from wavesweep.program.spec.studies import Request

MOST_TICKS = 1_000_000  # about 1 GB of rows while the loop is marched
# of a tick: times rounded to a few digits pass, a clock that drifts or loses samples does not
AT_A_TICK = 0.01
MOST_COUNTED = 2.0**53  # ticks; more cannot be counted by doubles
RANDOM = "random"  # as frames
FRAMES = "simulate.frames"
SHOW = "simulate.show"
MESSAGES = "simulate.messages"
FREQUENCIES = "simulate.frequency_hz"
FROM = "simulate.from"
TICKS = "simulate.ticks"
INPUTS = {
    "sine": "one frequency",
    "stepped-sine": "several frequencies in turn, each until it has settled and is measured",
    "chirp": "a sine whose frequency rises by the same factor in equal times",
    "step": "a constant force from at_s on",
    "pulse": "a constant force for width_s",
    "noise": "white noise, a new value in each tick",
}
KEYS = Key.by_path(
    [
        Key.word(
            "simulate.input",
            "sine",
            "force of the hand, or signal of another input; without a hand a step by default",
            INPUTS,
        ),
        Key.word(
            FROM,
            None,
            "input of a drawn loop that it is fed to; by default the hand, or the first input",
        ),
        Key.number(
            "simulate.amplitude",
            1.0,
            "N",
            "size of the force, or of the input in its unit; of noise its standard deviation",
        ),
        Key.positive(
            FREQUENCIES,
            None,
            "Hz",
            "of the sine; of the stepped sine, in turn; both ends of the chirp",
        ),
        Key.gain("simulate.settle_s", 2.0, "s", "time that a sine lasts before it is measured"),
        Key.whole(
            "simulate.periods",
            5,
            "least number of whole periods in which a stepped sine is measured",
            1,
            10_000,
        ),
        Key.gain(
            "simulate.at_s",
            0.1,
            "s",
            "when the step or the pulse sets in: at the first tick at or after it, a hundredth of a tick forgiven",
        ),
        Key.gain(
            "simulate.width_s",
            0.05,
            "s",
            "how long the pulse lasts: to the first tick at or after its end",
        ),
        Key.gain(
            "simulate.duration_s",
            None,
            "s",
            "simulated time, all ticks before its end; by default 10 s, 100 ticks below 1 Hz, or what the steps take",
        ),
        Key.whole("simulate.seed", 0, "seed of noise, jitter, lateness and drops", 0, MOST_SEED),
        Key.number(
            "simulate.wall",
            None,
            "m",
            "where a one-sided wall begins; absent: the linear wall on both sides of 0",
        ),
        Key(
            "simulate.pulls",
            "boolean",
            True,
            "",
            "whether the damper of a one-sided wall may pull inside; false: F = max(0, K depth + B speed), a wall that only "
            "pushes, beside which a local model acts in free space too",
        ),
        HARDWARE_KEYS["simulate.resolution"],
        HARDWARE_KEYS["simulate.max_force"],
        HARDWARE_KEYS["simulate.friction"],
        Key.gain(
            "simulate.jitter",
            0.0,
            "1",
            "largest share of a tick by which a tick is shorter or longer",
            high=0.9,
        ),
        Key.whole(
            "simulate.late",
            0,
            "largest number of ticks by which a slow result is late",
            0,
            1_000_000,
            "tick",
        ),
        Key.gain(
            "simulate.dropped", 0.0, "1", "probability that a slow result never comes", high=1.0
        ),
        Key.several(
            Key.word(
                SHOW,
                None,
                "signals of a drawn loop that the table has in addition to its outputs: BLOCK.PORT, an output or an input of "
                "a block",
            )
        ),
        Key(
            FRAMES,
            "list",
            None,
            "tick",
            "frames of slow blocks, repeated for ever: the ticks of each, or { ticks, delay, lost } if its result has another "
            'delay, or never comes (lost = true); "random": drawn by the shares of [for_all]; or a CSV file of frames as they '
            'were measured, with a column time or duration, or a list of the file and what --column takes, as "time=t"; absent: all of '
            "the same length",
        ),
        Key(
            MESSAGES,
            "list",
            None,
            "tick",
            'table: of a channel by its name, how late its messages are in turn, repeated for ever: ticks, "lost", or "3 lost" '
            "for so many in a row; absent: all in time, or lost at random by the channel's own probabilities",
        ),
        Key.several(
            Key.positive(TICKS, None, "s", "", high=10.0),
            description="true lengths of the fast ticks, repeated for ever, the first of a frame first: the device moves for "
            "these, and the program counts with the nominal one; absent: all as the rates have them",
        ),
    ]
)
LATE = Key.whole("late", None, "how late a message is", 0, MOST_LATE, "tick")
IN_A_ROW = re.compile(r"(?:([1-9][0-9]{0,3}) )?lost")  # messages that are lost
FRAME_KEYS = {
    "ticks": Key.whole("ticks", None, "fast ticks in the frame", 1, HIGHEST_RATIO, "tick"),
    "delay": Key.whole(
        "delay", None, "fast ticks until its slow result is in place", 0, HIGHEST_RATIO, "tick"
    ),
    "lost": Key(
        "lost", "boolean", False, "", "whether its slow result never comes; the last one is held"
    ),
}


def _default(values: tuple[float, ...], scale: str | None = None) -> Axis:
    return Axis("frequency_hz", FREQUENCIES, values, values[0], values[-1], False, scale)


# The steps avoid 25 and 50 Hz: at the default rates, a sine there coincides with its own image.
INPUT_FREQUENCIES = {
    "sine": _default((5.0,)),
    "stepped-sine": _default(linear(0.5, 49.5, 50), "linear"),
    "chirp": _default((0.1, 50.0)),
}

# Keys that only some inputs read.
READ_BY = {
    "frequency_hz": tuple(INPUT_FREQUENCIES),
    "settle_s": ("sine", "stepped-sine"),
    "periods": ("stepped-sine",),
    "at_s": ("step", "pulse"),
    "width_s": ("pulse",),
}


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame: its ticks, the delay of its slow result (None: that of the loop), and whether
    this never comes."""

    ticks: int
    delay: int | None = None
    lost: bool = False

    def written(self) -> int | dict[str, int | bool]:
        """Return the frame as a spec could give it."""
        optional: dict[str, int | bool] = {}
        if self.delay is not None:
            optional["delay"] = self.delay
        if self.lost:
            optional["lost"] = True
        if optional:
            return {"ticks": self.ticks, **optional}
        return self.ticks


def build_frames(leaf: Leaf, mistakes: Mistakes) -> tuple[Frame | str, ...] | str | None:
    """Return the frames of a list, RANDOM, or the name of a file alone or with texts NAME=COLUMN,
    or None and add its mistakes."""
    if not isinstance(leaf.value, (str, list)) or not leaf.value:
        expected = 'a list of frames, each a whole number of ticks, "random", or a CSV file'
        return mistakes.refuse(leaf, FRAMES, expected, show(leaf.value), of_key=False)
    if isinstance(leaf.value, str):
        return leaf.value
    if all(isinstance(item, str) for item in leaf.value):
        return tuple(leaf.value)
    before = len(mistakes)
    frames = []
    for index, item in enumerate(leaf.value):
        frame = _frame(replace(leaf, value=item), f"{FRAMES}[{index}]", mistakes)
        if frame:
            frames.append(frame)
    ticks = sum(frame.ticks for frame in frames)
    if ticks > LONGEST_FRAME:
        expected = f"at most {LONGEST_FRAME} ticks in all"
        mistakes.refuse(leaf, FRAMES, expected, str(ticks), of_key=False)
    if len(mistakes) == before:
        return tuple(frames)
    return None


def _frame(leaf: Leaf, path: str, mistakes: Mistakes) -> Frame | None:
    """A frame of a list, which is a number of ticks or a table; adds its mistakes."""
    if not isinstance(leaf.value, dict):
        ticks = mistakes.check(FRAME_KEYS["ticks"], leaf, path)
        return Frame(ticks) if ticks else None
    parts = {name: replace(leaf, value=value) for name, value in leaf.value.items()}
    values = mistakes.read(FRAME_KEYS, parts, path)
    if "ticks" not in parts:
        mistakes.refuse(leaf, path, "the ticks of the frame", "none", of_key=False)
    if "ticks" not in values:
        return None
    frame = Frame(**values)
    if frame.lost and frame.delay is not None:
        expected = "no delay of a result that never comes"
        mistakes.refuse(leaf, f"{path}.delay", expected, show(frame.delay), of_key=False)
    elif frame.delay is not None and frame.delay > frame.ticks:
        expected = f"a whole number <= {frame.ticks}, the ticks of the frame"
        mistakes.refuse(leaf, f"{path}.delay", expected, show(frame.delay), of_key=False)
    return frame


def build_messages(
    leaves: Mapping[str, Leaf], mistakes: Mistakes
) -> dict[str, tuple[int | None, ...]]:
    """Return the ticks by which each message of a channel is late, None if it is lost, by channel,
    and add mistakes.

    leaves: the lists by path.
    """
    expected = (
        'a list, of how late messages are in turn: ticks, "lost", or "3 lost" for so many in a row'
    )
    messages: dict[str, tuple[int | None, ...]] = {}
    for path, leaf in leaves.items():
        listed = isinstance(leaf.value, list) and bool(leaf.value)
        late: list[int | None] = []
        if not listed:
            mistakes.refuse(leaf, path, expected, show(leaf.value), of_key=False)
        for item in leaf.value if listed else ():
            lost = IN_A_ROW.fullmatch(item) if isinstance(item, str) else None
            if lost:
                late += [None] * int(lost[1] or 1)
            # whether a message may be late by that many ticks
            elif isinstance(item, int) and not isinstance(item, bool) and 0 <= item <= MOST_LATE:
                late.append(item)
            else:
                mistakes.refuse(leaf, path, expected, show(item), of_key=False)
        messages[path.removeprefix(f"{MESSAGES}.")] = tuple(late)
    return messages


def written_messages(late: tuple[int | None, ...]) -> list[int | str]:
    """Return the ticks by which messages are late in turn, and the words for those that are
    lost, as a spec could give them."""
    written: list[int | str] = []
    for ticks_late, run in groupby(late):
        count = len(list(run))
        if ticks_late is None:
            written.append(f"{count} lost")
        else:
            written += [ticks_late] * count
    return written


@dataclass(frozen=True, slots=True)
class Experiment(TableValue):
    """The keys of [simulate] by their last name, resolved, None if one is absent; and their places.

    `frequency_hz` is a tuple: one for a sine, all of a stepped sine, both ends of a chirp. `frames`
    are of type `Frame`, or RANDOM, or a file alone or before texts NAME=COLUMN, `show` are names, `messages` those of
    `build_messages`. given: leaves by path.
    """

    values: dict[str, float | int | str | tuple | None]
    frequencies: Axis | None
    given: Mapping[str, Leaf] = field(repr=False)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    @property
    def files(self) -> tuple[str, ...]:
        """That of frames."""
        return (self.frames_file,) if self.frames_file else ()

    @property
    def frames_file(self) -> str:
        """The file of frames; empty without."""
        frames = self.values["frames"]
        if not frames or frames == RANDOM:
            return ""
        file = frames if isinstance(frames, str) else frames[0]
        return file if isinstance(file, str) else ""

    @property
    def hardware(self) -> Mapping[str, Any]:
        """Friction, resolution and largest force of the device."""
        names = [path.rpartition(".")[2] for path in HARDWARE_KEYS]
        return {name: self.values[name] for name in names}

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        present = {name: value for name, value in self.values.items() if value is not None}
        if self.values["pulls"]:  # digests of specs that do not say it stay as they are
            del present["pulls"]
        for name in ("show", "ticks"):
            if name in present:
                present[name] = list(present[name])
        if self.frequencies:
            present["frequency_hz"] = self.frequencies.written()
        frames = present.get("frames")
        if isinstance(frames, tuple):
            present["frames"] = [
                frame if isinstance(frame, str) else frame.written() for frame in frames
            ]
        messages = present.get("messages")
        if messages:
            present["messages"] = {name: written_messages(messages[name]) for name in messages}
        return present

    def on(self, device: HapticDevice | None) -> Experiment:
        """Return the experiment with the limits of a device, except for keys that are given
        themselves."""
        numbers = device.simulation() if device else {}
        missing = {}
        for name, value in numbers.items():
            if f"simulate.{name}" not in self.given:
                missing[name] = value
        if missing:
            return replace(self, values=self.values | missing)
        return self

    def unread(self) -> list[str]:
        """Return the keys that are given, and not as their defaults, and that the input does not
        read."""
        settings = {path: leaf.value for path, leaf in self.given.items()}
        settings[FREQUENCIES] = self.frequencies
        unread = []
        for name, inputs in READ_BY.items():
            path = f"simulate.{name}"
            if self.values["input"] in inputs or path not in settings:
                continue
            if settings[path] != KEYS[path].default:
                unread.append(name)
        return unread

    def refuse_beyond_limits(self, fast_hz: float, rate: str, mistakes: Mistakes) -> None:
        """Add the mistakes that matter to a simulation alone. fast_hz, rate: the fast rate and
        the path of its key."""
        kind, sets_in, width = (self.values[name] for name in ("input", "at_s", "width_s"))
        lasts = self.values["duration_s"]
        seconds = self._seconds()
        table = next((leaf.place.parent() for leaf in self.given.values()), Place())

        def refuse(name: str, expected: str, found: str) -> None:
            leaf = self.given.get(f"simulate.{name}", table)
            mistakes.refuse(leaf, f"simulate.{name}", expected, found, of_key=False)

        if self.frequencies and self.values["frequency_hz"]:
            highest = self.frequencies.stop
            if highest >= fast_hz / 2:
                refuse("frequency_hz", f"numbers < {fast_hz / 2!r} (half of {rate})", show(highest))
        longest = MOST_TICKS / fast_hz
        if seconds > longest:
            name = "frequency_hz" if lasts is None else "duration_s"
            expected = f"at most {longest:g} s ({MOST_TICKS} ticks at {rate})"
            refuse(name, expected, f"{seconds:g} s")
        tick = f"at least a tick ({1 / fast_hz:g} s)"
        if lasts is not None and 0 < seconds * fast_hz < 1 - AT_A_TICK:
            refuse("duration_s", tick, show(seconds))
        if kind in READ_BY["at_s"] and first_tick(sets_in, fast_hz) >= first_tick(seconds, fast_hz):
            refuse("at_s", f"a number < {seconds!r} (simulate.duration_s)", show(sets_in))
        if kind in READ_BY["width_s"] and width * fast_hz < 1 - AT_A_TICK:
            refuse("width_s", tick, show(width))

    def between_ticks(self, fast_hz: float) -> Iterator[str]:
        """Yield which times are read and lie between two ticks, and what that means."""
        kind, sets_in, width = (self.values[name] for name in ("input", "at_s", "width_s"))
        lasts = self.values["duration_s"]
        times = [("duration_s", lasts, lasts, "the run ends")]
        if kind in READ_BY["at_s"]:
            times.append(("at_s", sets_in, sets_in, f"the {kind} sets in"))
        if kind in READ_BY["width_s"]:
            times.append(("width_s", width, sets_in + width, "the pulse ends"))
        for name, value, seconds, meaning in times:
            if seconds is None:
                continue
            ticks = first_tick(seconds, fast_hz)
            if ticks - seconds * fast_hz > AT_A_TICK:
                before, after = (f"{count / fast_hz:.9g}" for count in (ticks - 1, ticks))
                yield f"simulate.{name} = {value:g}: {meaning} between the ticks at {before} and {after} s; taken at the later one"

    def _seconds(self) -> float:
        """How long the run takes (s); 0 if it is not known here."""
        values = self.values
        if values["duration_s"] is not None or values["input"] != "stepped-sine":
            return values["duration_s"] or 0.0
        settle_s = values["settle_s"]
        periods = values["periods"]
        return sum(step_seconds(tone, settle_s, periods) for tone in values["frequency_hz"] or ())


def first_tick(seconds: float, fast_hz: float) -> int:
    """Return the number of the first tick at or after a time (s), which may be rounded to a few
    digits."""
    ticks = min(seconds * fast_hz, MOST_COUNTED)
    nearest = round(ticks)
    return nearest + (ticks - nearest > AT_A_TICK)


def step_seconds(frequency_hz: float, settle_s: float, periods: int) -> float:
    """Return the duration (s) of a step of the stepped sine: settling, then whole periods and at
    least a second."""
    return settle_s + max(periods, math.ceil(frequency_hz)) / frequency_hz


def _checked(belongs: Sorted, mistakes: Mistakes) -> tuple[dict[str, Leaf], dict[str, Any]]:
    """The leaves of [simulate] without those of messages, and the values of all; adds their
    mistakes."""
    leaves = {f"simulate.{name}": leaf for name, leaf in belongs.below("simulate").items()}
    of_messages = {path: leaves.pop(path) for path in list(leaves) if path.startswith(MESSAGES)}
    checked = mistakes.read(
        KEYS, {path: leaf for path, leaf in leaves.items() if path not in (FRAMES, SHOW)}
    )
    checked[MESSAGES] = build_messages(of_messages, mistakes) or None
    if FRAMES in leaves:
        checked[FRAMES] = build_frames(leaves[FRAMES], mistakes)
    if TICKS in leaves and "simulate.jitter" in leaves and leaves["simulate.jitter"].value:
        expected = "either lengths of ticks in turn, or jitter"
        mistakes.refuse(leaves[TICKS], TICKS, expected, "both", of_key=False)
    if SHOW in leaves:
        leaf = leaves[SHOW]
        checked[SHOW] = names_in_list(leaf) or None  # one name stands without a list, too
        if not checked[SHOW]:
            expected = "a list of signals, BLOCK.PORT"
            mistakes.refuse(leaf, SHOW, expected, show(leaf.value), of_key=False)
    return leaves, checked


def _input_axis(leaves: dict[str, Leaf], kind: str, mistakes: Mistakes) -> Axis | None:
    """The axis of frequencies that is given for an input, None without; a single number becomes
    a list in its leaf."""
    if "" in leaves and isinstance(leaves[""].value, (int, float)):
        leaves[""] = replace(leaves[""], value=[leaves[""].value])
    # as `Experiment.written` has it
    nothing = "" in leaves and leaves[""].value == [] and kind not in INPUT_FREQUENCIES
    if not leaves or nothing:
        return None
    return build_axis("simulate", "frequency_hz", leaves, mistakes)


def build_experiment(
    belongs: Sorted, usual: str, mistakes: Mistakes, hz: float | None = None
) -> Experiment:
    """Return the experiment and add its mistakes; usual: the input that is taken by default; hz:
    the fast rate, if it is known, at which a pulse lasts a tick at least by default."""
    leaves, checked = _checked(belongs, mistakes)
    defaults = {path: key.default for path, key in KEYS.items()} | {"simulate.input": usual}
    slowly = hz is not None and hz < 1
    if slowly:
        defaults["simulate.width_s"] = 1 / hz
    values = {path.removeprefix("simulate."): value for path, value in (defaults | checked).items()}
    kind = values["input"]
    before = len(mistakes)
    frequency_leaves = dict(belongs.axes["simulate"].get("frequency_hz", {}))
    axis = _input_axis(frequency_leaves, kind, mistakes)
    if len(mistakes) == before and ("simulate.input" in checked or "simulate.input" not in leaves):
        axis = axis or INPUT_FREQUENCIES.get(kind)
        values["frequency_hz"] = _frequencies(kind, axis, frequency_leaves, mistakes)
    if values["duration_s"] is None and kind != "stepped-sine":
        values["duration_s"] = 100 / hz if slowly else 10.0
    if frequency_leaves:
        leaves[FREQUENCIES] = Leaf(None, axis_place(frequency_leaves))
    return Experiment(values, axis, leaves)


def _frequencies(
    kind: str, axis: Axis | None, parts: Mapping[str, Leaf], mistakes: Mistakes
) -> tuple[float, ...]:
    """Return the frequencies of this input; too many of them, or only a span, are a mistake."""
    if kind not in INPUT_FREQUENCIES:
        return ()
    ends = axis.values or (axis.start, axis.stop)
    problem = f"{len(ends)} frequencies" if axis.values else "only a span"
    if kind == "chirp":
        if len(ends) <= 2 and ends[0] <= ends[-1]:
            return ends[0], ends[-1]
        expected = "one or two frequencies for a chirp, the lower one first"
        problem = problem if len(ends) > 2 else " and ".join(map(repr, ends))
    elif axis.values and (kind != "sine" or len(ends) == 1):
        return axis.values
    else:
        single_frequency = 'one frequency for a sine (several are for input = "stepped-sine")'
        if kind == "sine":
            expected = single_frequency
        else:
            expected = "num with start and stop, or a list"
    mistakes.refuse(axis_place(parts), FREQUENCIES, expected, problem)
    return ()


def build(request: Request) -> Experiment:
    """Return the experiment, of the defaults without [simulate], and add its mistakes."""
    belongs = request.belongs
    mistakes = request.mistakes
    experiment = build_experiment(
        belongs, "step" if request.stepped else "sine", mistakes, request.hz
    )
    if request.hz and experiment.given:  # defaults are not checked, since `simulate` may never run
        experiment.refuse_beyond_limits(request.hz, request.rate, mistakes)
    request.refuse_unknown_ends(
        FROM, [belongs.keys[FROM].value] if FROM in belongs.keys else (), "inputs"
    )
    request.refuse_unknown_ends(
        SHOW, names_in_list(belongs.keys[SHOW]) if SHOW in belongs.keys else (), "outputs"
    )
    if request.drawing or not request.drawn:
        refuse_unknown_channels(belongs, request.drawing, mistakes)
    return experiment


def refuse_unknown_channels(belongs: Sorted, drawing: Drawing | None, mistakes: Mistakes) -> None:
    """Add the mistakes of messages on channels that the loop does not have."""
    channels = [block.name for block in drawing.senders] if drawing else []
    for path, leaf in belongs.below(MESSAGES).items():
        if path not in channels:
            expected = f"channels of a drawn loop ({', '.join(channels) or 'it has none'}), each with a list"
            problem = path or show(leaf.value), nearest(path, channels)
            mistakes.refuse(
                leaf, f"{MESSAGES}.{path}".rstrip("."), expected, *problem, of_key=False
            )


def demand(spec: Spec) -> None:
    """Raise SpecError if the experiment does not fit the fast rate, or if a drawn loop has
    nothing that it could come from."""
    mistakes = Mistakes()
    spec.simulate.refuse_beyond_limits(
        spec.tick_hz, RATE if spec.drawing else "rates.fast_hz", mistakes
    )
    if spec.simulate["frames"] == RANDOM and not (spec.for_all and spec.for_all.at_random):
        expected = "shares of the lengths of frames in [for_all], by which they are drawn"
        mistakes.append(spec.mistake(FRAMES, expected, "none"))
    if spec.drawing and not spec.drawing.outside:
        expected = "inputs = { NAME = SIGNAL }, or hand = { force = ..., displacement = ... }, which something comes from"
        mistakes.append(spec.mistake("ports", expected, "neither"))
    if mistakes:
        raise SpecError(mistakes)


def entry_of(spec: Spec) -> str:
    """The signal from outside that [simulate] gives: that of the named input, or the first,
    which is a hand's force."""
    if spec.drawing is None:
        return ""
    named = [signal for name, signal, _ in spec.drawing.inputs if name == spec.simulate["from"]]
    return (*named, *spec.drawing.outside, "")[0]


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table."""
    table = shapes.keys(TABLE.keys_in_it)
    keys = table["properties"]
    spans = [keys["frequency_hz"], shapes.axis(KEYS[FREQUENCIES])]
    keys["frequency_hz"] = {"anyOf": [*spans, {"type": "array", "maxItems": 0}]}
    frame = shapes.keys(FRAME_KEYS, required=["ticks"])
    text = {"type": "string", "minLength": 1}
    keys["frames"]["items"] = {"anyOf": [shapes.value(FRAME_KEYS["ticks"]), frame, text]}
    keys["frames"] = {"anyOf": [keys["frames"], text]}
    lost = {"type": "string", "pattern": f"^{IN_A_ROW.pattern}$"}
    message = {"anyOf": [shapes.value(LATE), lost]}
    late = {"type": "array", "items": message, "minItems": 1}
    keys["messages"] = shapes.table({}, late, description=keys["messages"]["description"])
    return table


TABLE = SpecTable(
    path="simulate",
    build=build,
    keys=KEYS,
    spans=(FREQUENCIES,),
    named=(MESSAGES,),
    signals=(SHOW,),
    demand=demand,
    starts=True,
    schema=schema,
)
