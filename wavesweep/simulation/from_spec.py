"""The experiment of a spec's [simulate] table."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.engine.drawing import name_of, scalars
from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses.claims import Claim, Frames, Order, Property, Status, own_scope
from wavesweep.program.csv_files import pairs
from wavesweep.program.reading.reading import PASSED
from wavesweep.program.spec import Axis, Spec
from wavesweep.simulation import inputs
from wavesweep.simulation.hardware import Effects, random_frames
from wavesweep.simulation.inputs import Input
from wavesweep.simulation.keys import FRAMES, RANDOM, Frame, entry_of, first_tick, written_messages
from wavesweep.simulation.march import simulate
from wavesweep.simulation.record import Simulation
from wavesweep.simulation.running_blocks import FrameClock


def _changed(effects: Effects, changes: Mapping[str, Any]) -> Effects:
    """The effects with other values of some fields. Errors: UsageError for other names."""
    names = [field.name for field in fields(Effects)]
    if unknown := [name for name in changes if name not in names]:
        raise UsageError(
            f"option {', '.join(unknown)}: expected some of {', '.join(names)}, found an unknown name"
        )
    return replace(effects, **changes)


def _entry_of_records(spec: Spec, records: Mapping[str, np.ndarray]) -> str:
    """The input at which a run begins: the hand's force if it is recorded, else the first record's."""
    hand = spec.drawing.hand[0] if spec.drawing and spec.drawing.hand else "f_h"
    return hand if hand in records else next(iter(records))


def simulated(
    spec: Spec, force=None, records: Mapping[str, np.ndarray] | None = None, **changes: Any
) -> Simulation:
    """Run the experiment of a spec's [simulate] table.

    Parameters: `force` the hand's force (N), or the signal of the input that [simulate] names, per
    fast tick, in place of what the spec describes, shape ``(ticks,)``; `records` records of several
    inputs by their signals, in place of both; `changes` fields of
    `Effects` (``wall=0.01, friction=0.2``) in place of the spec's.

    Errors: `SpecError` if the experiment does not fit the fast rate, `UsageError` for a record that
    cannot be read, a force that is not a vector of finite numbers, an option that does not exist or
    is out of range, or frames that the loop cannot have.
    """
    effects = _changed(effects_of(spec), changes)
    entry = entry_of(spec)
    other_records = {**(records or {})}
    if records:
        entry = _entry_of_records(spec, records)
        force = other_records.pop(entry)
    elif force is None:
        force = hand_force(spec.asking("simulate"), effects.seed).force
    else:
        force = inputs.given(force).force
    frames = frames_of(spec, frames_in_turn(spec, len(force), effects))
    return simulate(
        spec.values,
        force,
        effects,
        drawing=spec.drawing,
        units=(spec.at_port("m"), spec.at_port("N")),
        entry=entry,
        other_records=other_records,
        frames=frames,
        messages=spec.simulate["messages"],
    )


def frames_in_turn(spec: Spec, count: int, effects: Effects) -> tuple[Frame, ...]:
    """Return the frames of the spec's [simulate] table, none if it has none; those at random for so
    many ticks.

    Errors: UsageError for a file that cannot be read, or without the capability that reads it.
    """
    if spec.simulate.frames_file:
        return tuple(map(Frame, measured_frames(spec).lengths.tolist()))
    frames = spec.simulate["frames"] or ()
    if frames != RANDOM:
        return frames
    for_all, frames_run, ticks = spec.for_all, [], 0
    lengths, delays = [spec.values.get("rates.ratio")], [None]
    for axis in for_all.changing:
        if axis.path == "environment.delay":
            delays = axis.values
        else:
            lengths = lengths_at(spec, axis)
    kinds = [Frame(0, delay) for delay in delays] + [Frame(0, lost=True)]
    draw = random_frames(effects)
    last = 0  # index of the last length; the first frame comes as after the first length
    while ticks < count or not frames_run:
        chances = for_all.lengths[last % len(for_all.lengths)]  # the row after it, or the only one
        last = draw(chances)
        result = kinds[draw(for_all.results[last % len(for_all.results)])]
        frames_run.append(replace(result, ticks=lengths[last]))
        ticks += lengths[last]
    return tuple(frames_run)


def measured_frames(spec: Spec) -> Any:
    """Return the frames of the file that [simulate] names. Errors: see `frames_in_turn`."""
    file = spec.simulate.frames_file
    module = offered("frames")
    if module is None:
        raise UsageError(
            f"{FRAMES}: expected the capability frame_times, which reads {file}, found that it is not there"
        )
    frames = spec.simulate["frames"]
    columns = () if frames == file else frames[1:]
    return module.read_run(beside(spec, file), spec.tick_hz, pairs(columns, FRAMES))


MOST_SHOWN = 12  # frames, or messages of a channel, that are listed


def claim_of(spec: Spec) -> Claim:
    """What a run of the spec's experiment is: its frames, ticks and messages."""
    patterns, messages = spec.simulate["messages"] or {}, []
    for block in spec.drawing.senders if spec.drawing else ():
        if turns := written_messages(patterns.get(block.name, ())[:MOST_SHOWN]):
            rest = ", ..." * (len(patterns[block.name]) > MOST_SHOWN)
            said = ", ".join(turn if isinstance(turn, str) else _late(turn) for turn in turns)
            messages.append(f"messages of {block.name} in turn {said}{rest}")
        elif block.loses_at_random:
            messages.append(
                f"messages of {block.name} lost at random, seed {spec.simulate['seed']}"
            )
    file = spec.simulate.frames_file
    frames = f"the frames of {file}" if file else _frames_in_words(spec.simulate)
    ticks = _ticks_in_words(spec.simulate)
    scope = own_scope(spec)
    if frames:
        scope = replace(scope, frames=Frames(Order.ANY))
    if spec.drawing and spec.drawing.senders and not messages:
        messages = ["all messages in time"]
    said = ", ".join(filter(None, (frames, ticks, *messages)))
    return Claim(
        Property("a run", "figures"), replace(scope, messages=(), run=said), Status.COMPUTED
    )


def _late(ticks: int) -> str:
    """How late a message comes."""
    if ticks == 0:
        return "in time"
    return f"{ticks} tick{'s' * (ticks != 1)} late"


def _ticks_in_words(experiment: Mapping[str, Any]) -> str:
    """The lengths of ticks of an experiment in words; empty if they are those of the rates."""
    ticks = experiment["ticks"] or ()
    lengths = ", ".join(f"{1e3 * length:g}" for length in ticks[:MOST_SHOWN])
    rest = ", ..." * (len(ticks) > MOST_SHOWN)
    if ticks:
        return f"ticks of {lengths}{rest} ms in turn"
    return ""


def _frames_in_words(experiment: Mapping[str, Any]) -> str:
    """The frames of an experiment in words; empty if they are those of the rates."""
    frames = experiment["frames"]
    if frames == RANDOM:
        return f"frames at random, seed {experiment['seed']}"
    if not frames:
        return ""
    lengths = ", ".join(f"{frame.ticks}" for frame in frames[:MOST_SHOWN])
    irregular = any(frame.lost or frame.delay is not None for frame in frames)
    if irregular:
        rest = ", some with results that are lost or have a delay of their own"
    else:
        rest = ""
    return f"frames of {lengths}{', ...' * (len(frames) > MOST_SHOWN)} ticks in turn{rest}"


def lengths_at(spec: Spec, axis: Axis) -> list[int]:
    """The ticks in a frame at each value of a number that varies; none if it sets no frame."""
    values = axis.choices
    if spec.drawing is None:
        if axis.path == "rates.ratio":
            return list(values)
        return []
    every = next(
        block.every for block in spec.drawing.blocks if block.every.reads(name_of(axis.path))
    )
    lengths = [every.value(scalars({**spec.values, axis.path: value})) for value in values]
    for ticks, value in zip(lengths, values, strict=True):
        if ticks % 1:
            problem = f"{ticks:g} with {axis.name} = {value:g}"
            raise UsageError(
                f"for_all.{axis.name}: expected whole ticks in a frame, found {problem}"
            )
    return list(map(int, lengths))


def frames_of(spec: Spec, frames: Sequence[Frame]) -> FrameClock | None:
    """Return these frames of a spec as the simulation takes them, None for none.

    Results come after the delay of their frame, by default that of the spec; those of a drawn
    loop's blocks at once.
    """
    if not frames:
        return None
    delays: list[int | None] = []
    for frame in frames:
        if frame.lost:
            delays.append(None)
        elif frame.delay is not None:
            delays.append(frame.delay)
        elif spec.delay_of_frame:
            delays.append(frame.ticks)
        else:
            delays.append(spec.values.get("environment.delay", 0))
    nominal = spec.values["rates.ratio"] if spec.step == "nominal" else None
    return FrameClock(tuple(frame.ticks for frame in frames), tuple(delays), nominal)


def effects_of(spec: Spec) -> Effects:
    """Return the effects that the spec adds to the linear model."""
    return Effects(**{field.name: spec.simulate[field.name] for field in fields(Effects)})


def hand_force(spec: Spec, seed: int | None = None) -> Input:
    """Return the force of the hand over the simulated time of the spec; seed: of noise, by
    default the spec's."""
    values, fast_hz = spec.simulate, spec.tick_hz
    size, seconds, start = (values[name] for name in ("amplitude", "duration_s", "at_s"))
    frequencies = values["frequency_hz"]
    settle = values["settle_s"]
    makers = {
        "sine": lambda: inputs.sine(fast_hz, *frequencies, size, seconds, settle),
        "stepped-sine": lambda: inputs.stepped_sine(
            fast_hz,
            frequencies,
            size,
            settle,
            values["periods"],
            longest=math.inf if seconds is None else seconds,
        ),
        "chirp": lambda: inputs.chirp(fast_hz, *frequencies, size, seconds),
        "step": lambda: inputs.pulse(fast_hz, size, seconds, start, seconds),
        "pulse": lambda: inputs.pulse(fast_hz, size, seconds, start, values["width_s"]),
        "noise": lambda: inputs.noise(
            fast_hz, size, seconds, values["seed"] if seed is None else int(seed)
        ),
    }
    record = makers[values["input"]]()
    if seconds is None:
        return record
    return inputs.lasting(record, first_tick(seconds, fast_hz))


def beside(spec: Spec, name: str) -> Path:
    """Return the path of a file, relative to the spec's folder, or to the current one for a dict.

    Errors: UsageError for what the spec itself is read from, which can be read once.
    """
    path = Path(spec.source or "").parent / name
    if re.fullmatch(PASSED, str(path)) and spec.source in (str(path), "-"):
        raise UsageError(f"{name}: expected a file of its own, found what the spec is read from")
    return path
