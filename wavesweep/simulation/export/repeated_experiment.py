"""The experiment that a controller in C repeats: the loop with all that its device has, tick by
tick."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavesweep.engine.drawing import Drawing
from wavesweep.engine.errors import UsageError
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.program.spec import Spec
from wavesweep.simulation.from_spec import (
    effects_of,
    frames_in_turn,
    frames_of,
    hand_force,
    lengths_at,
)
from wavesweep.simulation.keys import entry_of
from wavesweep.simulation.march import SLOW_ALONE, March, refuse
from wavesweep.simulation.running_blocks import SEEN, FrameClock, MarchedLoop, loop_of

AMPLIFIER = ("device.delay", "device.dead_time")  # of the device, and so of no controller
RATIO, DELAY = "rates.ratio", "environment.delay"
NEXT_SLOW_STEP = -1  # as a delay in C: the result is in place with the next slow step


@dataclass(frozen=True, slots=True)
class Steps:
    """Slow steps that the caller triggers.

    lengths: the ticks that a frame may have, from one step to the next. frames: of the experiment.
    delays: what C calls the delay of each of these. usual: of a frame of which nothing else is
    said.
    """

    lengths: tuple[int, ...]
    frames: FrameClock
    delays: tuple[int, ...]
    usual: int

    @property
    def all(self) -> FrameClock:
        """A frame of each length, with results that are in place at once."""
        return replace(self.frames, ticks=self.lengths, delays=(0,) * len(self.lengths))


def _proved_for_changes(spec: Spec) -> bool:
    """Whether [for_all] has frames that change, or results that are lost."""
    for_all = spec.for_all
    if not for_all or spec.uneven:
        return False
    return bool(for_all.changing or ((for_all.lost or for_all.loss) and spec.drawing is None))


def steps_of(spec: Spec) -> Steps | None:
    """Return the slow steps of a spec whose frames vary, in [for_all] or in [simulate]; None if
    they do not.

    Errors: UsageError for frames in [simulate] whose lengths [for_all] does not have, and beside
    channels.
    """
    frames = frames_in_turn(spec, len(hand_force(spec).force), effects_of(spec))
    if not (frames or _proved_for_changes(spec)):
        return None
    if spec.drawing and spec.drawing.senders:
        raise UsageError(
            "export: expected frames of one length in a loop with channels, found frames that vary; leave either out"
        )
    simulated = {frame.ticks for frame in frames}
    # the lengths of frames in [for_all]; empty if they do not change there
    proved = {
        length
        for axis in (spec.for_all.changing if spec.for_all else ())
        for length in lengths_at(spec, axis)
    }
    # refuse frames in [simulate] of a length that [for_all] does not have
    if strange := sorted(simulated - proved) if proved else []:
        raise UsageError(
            f"simulate.frames: expected the lengths of [for_all] ({', '.join(map(str, sorted(proved)))}), found {strange[0]}; "
            "--set simulate.frames= leaves them out"
        )
    lengths = tuple(sorted(proved or simulated or {int(spec.values[RATIO])}))
    if spec.delay_of_frame:
        usual = NEXT_SLOW_STEP
    else:
        usual = int(spec.values.get(DELAY, 0))
    delays = tuple(usual if frame.delay is None else frame.delay for frame in frames) or (
        usual,
    ) * len(lengths)
    return Steps(lengths, frames_of(spec, frames) or _clock(spec, lengths, usual), delays, usual)


def _clock(spec: Spec, lengths: tuple[int, ...], usual: int) -> FrameClock:
    """A frame of each length. usual: the delay of its results in ticks, or NEXT_SLOW_STEP."""
    if spec.step == "nominal" and spec.drawing is None:
        nominal = spec.values[RATIO]
    else:
        nominal = None
    every = tuple(length if usual == NEXT_SLOW_STEP else usual for length in lengths)
    return FrameClock(lengths, every, nominal)


def drawing_of(spec: Spec, steps: Steps | None = None, *, amplifier: bool = False) -> Drawing:
    """Return the drawing of a spec, without the delays of its amplifier unless `amplifier`."""
    changed = ({} if amplifier else dict.fromkeys(AMPLIFIER, 0)) | (SLOW_ALONE if steps else {})
    return spec.drawing or loop_drawing({**spec.values, **changed})


def loop_with(
    spec: Spec, drawing: Drawing, values: Mapping[str, Any], frames: FrameClock | None
) -> MarchedLoop:
    """Return the loop of a drawing with these numbers, and with the wall of the experiment;
    frames: see `loop_of`."""
    effects = effects_of(spec)
    loop = loop_of(
        drawing, {**values, **SLOW_ALONE} if frames and spec.drawing is None else values, frames
    )
    refuse(loop, effects)
    if effects.wall is None:
        return loop
    return loop.behind(effects.wall, effects.pulls)


def march_of(
    spec: Spec,
    loop: MarchedLoop,
    steps: Steps | None,
    inputs: list[str],
    outputs: Mapping[str, str],
) -> March:
    """Return the march of the whole loop that shows what its controller reads and gives.

    loop: the controller's. inputs: signals. outputs: name -> port of a device, without forces from
    outside.
    """
    loop_with_hardware = loop_with(
        spec, drawing_of(spec, steps, amplifier=True), spec.values, steps and steps.frames
    )

    def seen(sums):
        return {
            SEEN + name: tuple(term for term in sums[port] if term[1] not in loop.inputs)
            for name, port in outputs.items()
        }

    loop_with_hardware = replace(
        loop_with_hardware,
        wires={**loop_with_hardware.wires, **seen(loop.wires)},
        away={**loop_with_hardware.away, **seen(loop.away)},
    )
    entry = entry_of(spec) or loop.hand
    messages = spec.simulate["messages"] or {}
    return March(
        loop_with_hardware,
        effects_of(spec),
        (*inputs, *(SEEN + name for name in outputs)),
        entry,
        messages=messages,
    )


def timing_of(
    march: March, steps: Steps | None, count: int, *, late: bool
) -> dict[str, np.ndarray]:
    """Return the columns of the vectors that say when slow steps begin, and which results are late.

    late_0: the ticks by which the result of a group that is shown in the tick is late beyond the
    delay of its step, -1 if it is lost, 0 if none is shown.
    """
    columns = {"tick": np.arange(count)}
    delays = march.loop.delays
    if steps:
        starts = np.array(march.loop.frames.starts)
        frame = np.searchsorted(starts, columns["tick"] % march.loop.frame, side="right") - 1
        columns["step"] = np.isin(columns["tick"] % march.loop.frame, starts).astype(int)
        columns["delay"] = np.array(steps.delays)[frame]
    for g, result in enumerate(march.results if late else ()):
        ticks_late = np.zeros(count, dtype=int)
        for k in range(count):
            if result.shown(k) and (number := result.number(k)) >= 0:
                lateness = result.late[number]
                usual = 0 if result.channel else delays[number % len(delays)]
                ticks_late[k] = -1 if lateness is None else lateness * (lateness != usual)
        columns[f"late_{g}"] = ticks_late
    return columns
