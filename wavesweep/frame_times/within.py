"""The lengths of frames that a spec's answers are for, and whether a run stays within them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from math import gcd
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.engine.drawing import name_of, scalars
from wavesweep.engine.errors import UsageError
from wavesweep.frame_times.times import MeasuredFrames, read_run
from wavesweep.program.csv_files import seconds
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.sweep.grid import own_loop

RATIO = "rates.ratio"


def number_of(spec: Spec) -> str:
    """The name of the number that is the length of a spec's frames, in ticks.

    Errors: UsageError if the loop has no slow environment, or runs its slow blocks otherwise.
    """
    if not spec.drawing:
        _refuse_built_in(spec)
        return RATIO
    slow = {
        block.every.text: block.every
        for block in spec.drawing.blocks
        if not block.every.is_number(1.0)
    }
    if len(slow) == 1 and next(iter(slow.values())).operation == "name":
        return next(iter(slow))
    raise UsageError(
        f"{spec.name}: expected one number as `every` of all blocks that do not run in every tick, found "
        f"{', '.join(slow) or 'no such block'}; give it a name in [numbers]"
    )


def lengths_of(spec: Spec) -> tuple[tuple[int, ...], bool]:
    """The lengths of frames (ticks) that the answers of a spec are for, and whether these may
    change from frame to frame.

    Errors: see `number_of`.
    """
    axis = _axis_of_frames(spec)
    values = None
    varying = False
    if axis is not None:
        values = axis.choices
        varying = axis in spec.for_all.changing
    if spec.drawing:
        return _drawn_lengths(spec, axis and name_of(axis.path), values), varying
    _refuse_built_in(spec)
    return tuple(values or (spec.values[RATIO],)), varying


def _axis_of_frames(spec: Spec) -> Axis | None:
    """The number of [for_all] on which the length of frames depends."""
    for axis in spec.for_all.axes if spec.for_all else ():
        if spec.drawing and axis in spec.for_all.changing:
            return axis
        if not spec.drawing and axis.path == RATIO:
            return axis
    return None


def _drawn_lengths(spec: Spec, name: str | None, values: Iterable[float] | None) -> tuple[int, ...]:
    """The lengths of frames of a drawn loop in which a number has these values in turn."""
    numbers = scalars(spec.values)
    lengths = set()
    for block in spec.drawing.blocks:
        members = [numbers]
        if block.every.reads(name):
            members = [numbers | {name: value} for value in values]
        ticks = tuple(block.every.value(member) for member in members)
        if parts := [each for each in ticks if each % 1]:
            raise UsageError(
                f"{spec.name}: block.{block.name}.every: expected whole ticks for all of [for_all], found {parts[0]:g}"
            )
        if {*ticks} != {1}:
            lengths.add(tuple(map(int, ticks)))
    if len(lengths) != 1:
        runs = [f"{', '.join(map(str, ticks))} ticks" for ticks in sorted(lengths)]
        raise UsageError(
            f"{spec.name}: expected one length of frames, of all blocks that do not run in every tick, found "
            f"{' and '.join(runs) or 'none'}; a log is held against loops of two clocks, every tick and "
            "one frame, so let the other blocks run in every tick"
        )
    return lengths.pop()


def _refuse_built_in(spec: Spec) -> None:
    if spec.uneven:
        raise UsageError(
            f"{spec.name}: rates.slow_hz: expected frames of whole ticks, found rates that do not divide; give ratio"
        )
    drawing = own_loop(spec).drawing
    if RATIO not in drawing.reads and RATIO not in drawing.building:
        raise UsageError(
            f"{spec.name}: expected a controller with a slow environment, which has frames, found {spec.kind}"
        )


def within(
    spec: Spec,
    path: str,
    columns: Mapping[str, str] | None = None,
    scales: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Whether the frames of a file are among those that the answers of a spec are for, as facts
    that JSON can hold.

    expected: these lengths, in ticks, in any order if `varying`. left: how many frames are not
    certain to be among them; first: of the first one, its number from 1, when it begins (s), and
    its measured length in ticks. every: the greatest common divisor E of lengths that vary, if some
    frames are left, but none are for a loop that looks for results in every E ticks alone, whose
    frames are multiples of E; otherwise 1. taken: what is said of another unit. columns, scales: see `times.read_run`. Errors: UsageError.
    """
    expected, varying = lengths_of(spec)
    run = read_run(path, spec.tick_hz, columns or {}, scales or {})
    allowed = expected
    if not varying:  # all frames have the length of the first one, in whole ticks
        allowed = tuple(ticks for ticks in expected if ticks == run.lengths[0])
    left = _outside(run, allowed)
    every = gcd(*expected) if varying else 1
    counted = replace(run, every=every)  # frames as multiples of it
    coarse = len(left) > 0 and every > 1 and not len(_outside(counted, allowed))
    first = None
    if len(left):
        index = left[0]
        first = {"frame": int(index) + 1, "begins_s": float(run.begins[index])}
        first["ticks"] = float(run.ticks[index])
    return {
        "file": Path(path).name,
        "frames": len(run.ticks),
        "expected": sorted(expected),
        "varying": varying,
        "left": len(left),
        "first": first,
        "taken": run.taken,
        "every": every if coarse else 1,
    }


def _outside(run: MeasuredFrames, allowed: tuple[int, ...]) -> np.ndarray:
    """The numbers of the frames that may have another length than those allowed."""
    least, most = run.possible
    return np.flatnonzero(~(np.isin(least, allowed) & np.isin(most, allowed)))


def lines(found: Mapping[str, Any]) -> Iterator[tuple[float, str]]:
    """Yield what is said of it, with ranks."""
    expected = found["expected"]
    frames = found["frames"]
    several = expected[-1] - expected[0] + 1 == len(expected) > 2
    if several:
        words = f"{expected[0]} to {expected[-1]}"
    else:
        words = ", ".join(map(str, expected))
    if found["varying"]:
        order = f"{words} ticks in any order"
    else:
        order = f"a constant length of {words} ticks"
    start = f"  measured frames ({found['file']}):"
    if found["taken"]:
        yield 1, f"  {found['taken']}"
    if not found["left"]:
        yield 1, f"{start} all {frames} are within {order}"
        return
    first = found["first"]
    where = f"begins at {seconds(first['begins_s'])} s and lasts {first['ticks']:.6g} ticks"
    yield (
        1,
        f"{start} {found['left']} of {frames} are NOT within {order}, so no answer here is for this run",
    )
    yield 1, f"    the first is frame {first['frame']}, which {where}"
    if found["every"] > 1:
        yield (
            1,
            f"    they are within them for a loop that looks for a result in every {found['every']} ticks and not in each",
        )
