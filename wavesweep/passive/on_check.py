"""What `check` says of the wave channel, and of the work of `passivity`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec
    from wavesweep.program.sweep.job import Job

CHANNEL = ("rates.", "filters.", "controller.kind")  # keys that the wave channel depends on
# entries of its matrix, up to which the norm takes less than 0.1 s; it grows with their power of
# 1.5
LARGEST_CHANNEL = 20_000


def numbers(spec: Spec) -> dict[str, float | None]:
    """channel_norm: of the wave channel, 1 or less if it is passive, missing if its matrix has more
    than LARGEST_CHANNEL entries, and of a drawn loop, which has no channel that a spec would name.
    """
    return {"channel_norm": None if spec.drawing else _channel_norm(_channel_of(_kept(spec)))}


def _kept(spec):
    """What the channel depends on: a design that is varied by something else keeps it."""
    return tuple((path, value) for path, value in spec.values.items() if path.startswith(CHANNEL))


@lru_cache(maxsize=64)
def _channel_of(kept):
    """The wave channel; None without one."""
    from wavesweep.haptics.controller_page import loop_drawing
    from wavesweep.passive.channel import channel_of
    from wavesweep.program.reading.keys import VALUE_PATHS
    from wavesweep.program.spec import KEYS

    values = {path: KEYS[path].default for path in VALUE_PATHS} | dict(kept)
    return channel_of(loop_drawing(values), values)


@lru_cache(maxsize=64)
def _channel_norm(channel):
    from math import isfinite

    from wavesweep.passive.channel import norm_of

    if channel and channel.entries <= LARGEST_CHANNEL:
        norm = float(norm_of(channel).norm)
    else:
        norm = None
    if norm is not None and isfinite(norm):
        return norm
    return None


def lines(spec: Spec, found: Mapping[str, Any]) -> Iterator[tuple[float, str | Callable[[], str]]]:  # noqa: ARG001
    """Yield the norm of the wave channel, if there is one; it is computed once the line is
    shown."""
    from wavesweep.passive.channel import MOST_ENTRIES
    from wavesweep.passive.margin import LONGEST_MAP

    if spec.drawing or not (channel := _channel_of(_kept(spec))):
        return
    if channel.entries <= LARGEST_CHANNEL:
        from wavesweep.program.number_words import rounded_up

        def known():
            norm = _channel_norm(channel)
            if norm is None:
                return "wave channel: norm not known"
            return f"wave channel: norm {rounded_up(norm, 7)} (passive up to 1)"

        yield 5, known
    else:
        if channel.entries <= MOST_ENTRIES:
            does = f"passivity does it up to {LONGEST_MAP} ticks"
        else:
            does = "passivity refuses it too"
        yield 6, f"wave channel: norm not computed in check for so long a frame; {does}"


def sweep_plan(spec: Spec) -> tuple[list[str], list[Job]]:
    """The lines about `passivity`, and its jobs. Errors: SpecError for a sweep that no command
    could do."""
    from wavesweep.engine.errors import SpecError, UsageError
    from wavesweep.passive.port_jobs import jobs_of, not_computed
    from wavesweep.program.sweep.grid import make_grid

    if spec.drawing and spec.drawing.hand is None:
        return ["  passivity: not possible, [ports] names no hand"], []
    axes = tuple(axis for axis in spec.sweep if axis.values)
    make_grid(spec, axes)
    try:
        jobs = jobs_of(spec, axes)
    except (SpecError, UsageError) as error:
        return [f"  passivity: not possible with this spec: {error}"], []
    loops = jobs["port"].slices
    plan = f"  passivity: hand's port of {loops} loop{'s' * (loops != 1)}"
    if "channel" in jobs:
        channels = jobs["channel"].slices
        plan += f", norm of {channels} wave channel{'s' * (channels != 1)}"
    plan += "; method: level sets of the frame's energy balance, without a frequency grid"
    lines = [plan, *(f"    {line}" for line in not_computed(jobs["port"].grid))]
    return lines, [*jobs.values()]
