"""What a result is for: integration of the wall, delay and velocity, and which of them the spec left to the defaults."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from math import ceil, floor
from types import MappingProxyType
from typing import Any

from wavesweep.engine.drawing import name_of, path_of, scalars
from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.expressions import names_in, text_of, value_of
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import assumption_of_page, keys_of_page
from wavesweep.program.reading.keys import DEVICES
from wavesweep.program.spec import KEYS, Axis, Spec
from wavesweep.program.spec.resolving import longest_delay
from wavesweep.program.sweep.grid import Grid

MOST_BUILT = 32
LISTED, MOST_AXES = 6, 3  # values of a number, and numbers
MOST_PORTS = 4  # ports that a sentence lists
CONTINUOUS = "as physics does; a program holds its sums"
FAVOURABLE = "optimistic default"  # in a sentence of `assumes` that rests on some
INTEGRATION, DELAY, VELOCITY = "environment.integration", "environment.delay", "device.velocity"


@dataclass(frozen=True, slots=True)
class RunWords:
    """What a single run has, in words: its frames, empty if all have the spec's length, and when messages come."""

    frames: str = ""
    messages: str = ""


IN_TIME = RunWords(messages="all messages in time")


def assumes(spec: Spec, swept: Collection[str] = (), *, nominal: bool = False, run: RunWords | None = None) -> str:
    """A sentence about the wall, the delay and the velocity that a result of `spec` is for.

    swept: paths of the axes of the result, which have no single value. nominal: whether the result is of the spec's own
    numbers and frames alone, with all messages in time. run: what the result is a run of. If the spec gives one of the three
    no value of its own, the sentence says so, and names the usual practice of engines, which is less kind than the default. A
    drawn loop shows all of that itself; its sentence says which numbers act continuously, and within which limits of its blocks
    it is linear.
    """
    in_run = run or (IN_TIME if nominal else None)  # of the spec's own numbers
    varied = {} if in_run else {axis.path: _values(axis) for axis in spec.changing}
    ranges, order = None if in_run else spec.for_all, "in any order"
    if ranges and ranges.at_random:
        alone = ranges.loss or (spec.drawing and spec.drawing.at_random)
        order = f"{'' if alone else 'in any order, or '}at random (mean_square)"
    if spec.drawing:
        said = [*_continuous(spec), *(f"{name_of(path)} is {how} {order}" for path, how in varied.items())]
        of_run = [in_run.frames, in_run.messages * bool(spec.drawing.senders)] if in_run else []
        said += of_run if in_run else [*_unknown(spec, swept), *_messages(spec, swept)]
        if limits := ", ".join(_limits(spec, swept)):
            said.append(f"kept to its limits, {limits}" if run else f"linear while {limits}; simulate goes beyond")
        return "; ".join(filter(None, said))
    read, values = keys_of_page(spec.values), spec.values
    varies = bool(varied or (run and run.frames))
    phrases = [assumption_of_page(values), *_frames_that_vary(spec, varied, read, order, run.frames if run else "")]
    phrases += _lost(ranges)
    if DELAY in read and not varies:
        phrases.append(_delay(values, swept))
    if VELOCITY in read:
        phrases.append("exact velocity" if values[VELOCITY] == "exact" else "velocity from differences of position")
    phrases += [] if in_run else _unknown(spec, swept)
    phrases += _amplifier(values, swept)
    by_default = [path for path in (INTEGRATION, DELAY, VELOCITY) if path in read and path not in {*spec.given, *swept}]
    if not by_default:
        return ", ".join(phrases)
    usual = {INTEGRATION: '"explicit"', DELAY: str(longest_delay(values["rates.ratio"])), VELOCITY: '"difference"'}
    defaults = f"{FAVOURABLE}{'s' * (len(by_default) > 1)} of {_listed(by_default)}"
    return f"{', '.join(phrases)}; {defaults}: engines usually have {_listed([usual[path] for path in by_default])}"


def _delay(values: Mapping[str, Any], swept: Collection[str]) -> str:
    """The delay of the environment's results."""
    if DELAY in swept:
        return "delay swept"
    delay, ratio = values[DELAY], values["rates.ratio"]
    within = "" if {"rates.fast_hz", "rates.slow_hz", "rates.ratio"} & set(swept) else f" of {ratio:.6g}"
    return f"delay of {delay}{within} {'tick' if delay == 1 and not within else 'ticks'}" if delay else "no delay"


def _amplifier(values: Mapping[str, Any], swept: Collection[str]) -> list[str]:
    """How late the amplifier is, if it is at all."""
    late, dead = values["device.delay"], values["device.dead_time"]
    if {"device.delay", "device.dead_time"} & set(swept):
        return ["amplifier's delay swept"]
    times = [f"{late} tick{'s' * (late > 1)}"] * bool(late) + [f"{1e3 * dead:g} ms"] * bool(dead)
    return [f"amplifier late by {' and '.join(times)}"] if times else []


def losses(spec: Spec) -> list[str]:
    """How messages may be late or lost in answers for all that they may do, or slow results be lost, in words."""
    return [*_messages(spec, ())] if spec.drawing else _lost(spec.for_all)


def _lost(asked) -> list[str]:
    """How slow results may be lost by a [for_all], in words."""
    often = [f"results lost up to {asked.lost} in a row"] if asked and asked.lost else []
    return often + ([f"results lost with probability {asked.loss:g}"] if asked and asked.loss else [])


def of_axes(spec: Spec, axes: Iterable[Axis], table: str) -> str:
    """The spec's own value of each number for which the axes of a table have others, in words."""
    said = []
    for axis in axes:
        value, unit = spec.own(axis.path), spec.names.keys[axis.path].unit
        if value is None:  # the edge of a band, which the spec does not have
            continue
        inside = value in axis.values if axis.values else axis.start <= value <= axis.stop
        many = f"{len(axis.values)} values from {axis.start:g} to {axis.stop:g}"
        values = many if len(axis.values) > LISTED else _values(axis)
        if axis.values != (value,):
            shown = f"{axis.name} = {value:g}{f' {unit}' if unit not in ('', '1') else ''}"
            said.append(f"{shown}, {'of' if inside else 'not in'} {table} {values}")
    left_out = len(said) - MOST_AXES
    return "; ".join(said if left_out < 2 else [*said[:MOST_AXES], f"{left_out} other numbers of {table}"])


def _continuous(spec) -> Iterator[str]:
    """Yield which numbers act continuously, between ticks too: the factors of terms by which plants act on each other."""
    ports: dict[str, list[str]] = {}
    for port, terms in spec.drawing.couplings:
        numbers = [f"{value_of(gain, {}):g}" for _, gain in terms if not any(names_in(gain))]
        names = [name for _, gain in terms for name, _ in names_in(gain)]
        for name in dict.fromkeys([*names, *(term for term in numbers if term not in ("1", "-1"))]):
            ports.setdefault(name, []).append(port)
    acting: dict[str, list[str]] = {}
    for name, continuous in ports.items():
        shown = continuous if len(continuous) <= MOST_PORTS else [*continuous[:2], f"{len(continuous) - 2} other wires"]
        acting.setdefault(_listed(shown), []).append(name)
    said = [f"{_listed(names)} act{'s' * (len(names) == 1)} continuously in {where}" for where, names in acting.items()]
    if said:
        yield f"{_listed(said)} ({CONTINUOUS})"


def _frames_that_vary(spec, varied, read, order, of_run) -> Iterator[str]:
    """Yield which frames may follow each other, when their results are in place, and over what time the wall integrates.

    of_run: the frames of a run, in words.
    """
    if not (varied or of_run):
        return
    ratio = spec.values["rates.ratio"]
    if of_run:
        yield of_run
    elif "rates.ratio" in varied:
        yield f"frames of {varied['rates.ratio']} ticks {order}"
    if DELAY in read:
        late = varied.get(DELAY, spec.values[DELAY])
        in_ticks = f"delay of {late} tick{'s' * (late != 1)}{f' {order}' * (DELAY in varied)}"
        yield (
            'results in place with the next frame (delay = "frame")'
            if spec.delay_of_frame and DELAY not in varied
            else in_ticks
        )
    if INTEGRATION in read:
        over = "the time since the last frame" if spec.step == "elapsed" else f"{ratio} ticks, however long a frame is"
        yield f'integrated over {over} (step = "{spec.step}")'


def _unknown(spec, swept) -> Iterator[str]:
    """Yield the numbers of [for_all] that are constant and not known."""
    for axis in spec.for_all.unknown if spec.for_all else ():
        if axis.path not in swept:
            unit = spec.names.keys[axis.path].unit
            yield f"{axis.name} {'of' if axis.values else 'from'} {_values(axis)}{f' {unit}' if unit not in ('', '1') else ''}"


def _messages(spec, swept) -> Iterator[str]:
    """Yield what the messages of each channel may do; a number of a swept axis is a range."""
    numbers, axes = scalars(spec.values), [axis for axis in (*spec.sweep, *spec.bode) if axis.path in swept]

    def ends(tree):
        """The least and the largest value of a key."""
        varied = [axis for axis in axes if axis.path in {path_of(name) for name, _ in names_in(tree)}]
        names, values = (
            [name_of(axis.path) for axis in varied],
            [axis.values or (axis.start, axis.stop) for axis in varied],
        )
        delays = [float(value_of(tree, numbers | dict(zip(names, place, strict=True)))) for place in product(*values)]
        return sorted({min(delays), max(delays)})

    for block in spec.drawing.channels:
        late, lost = (ends(dict(block.keys)[key]) for key in ("late", "lost"))
        said = [f"late by {_most(late)} tick{'s' * (late != [1])}"] * any(late)
        said += ["lost at random"] if block.loses_at_random else [f"lost {_most(lost)} in a row"] * any(lost)
        yield f"messages of {block.name} {' or '.join(said) or 'all in time'}"


def _most(ends) -> str:
    """The most that there may be, itself a range if a number of it is swept."""
    return f"{'at most' if len(ends) > 1 else 'up to'} {' to '.join(f'{end:g}' for end in ends)}"


def _values(axis) -> str:
    return ", ".join(f"{value:g}" for value in axis.values) if axis.values else f"{axis.start:g} to {axis.stop:g}"


def _limits(spec, swept) -> Iterator[str]:
    """Yield the limits of each block that has some, with the values of numbers that are not swept."""

    def shown(tree):
        moving = {path_of(name) for name, _ in names_in(tree)} & set(swept)
        return text_of(tree) if moving else f"{value_of(tree, numbers):g}"

    numbers = scalars(spec.values)
    for block in spec.drawing.blocks:
        limits = dict(block.limits)
        if "high" in limits:
            port, high = f"{block.name}.{'u' if block.type == 'saturation' else 'y'}", shown(limits["high"])
            low = shown(limits["low"]) if "low" in limits else f"-{high}"
            yield f"|{port}| <= {high}" if low == f"-{high}" else f"{low} <= {port} <= {high}"


def solved_within_ticks(spec: Spec, swept: Collection[str] = ()) -> Iterator[str]:
    """Yield a sentence for each cycle of blocks that read one another in the same tick, and are solved together.

    swept: paths of the axes of a result. Of those that decide how the loop is built, the least MOST_BUILT values are looked at,
    since small ones take a delay away.
    """
    if not spec.drawing:
        return
    axes = [axis for axis in (*spec.sweep, *spec.bode) if axis.structural and axis.path in swept]
    values = [(axis, value) for axis in axes for value in sorted(axis.values)[:MOST_BUILT]]
    built = [(f" at {axis.name} = {value:g}", {axis.path: value}) for axis, value in values]
    rings: dict[str, list[str]] = {}
    for at, changed in built or [("", {})]:
        with suppress(WavesweepError):
            for ring in Loops(spec.drawing, spec.with_values(changed).values).drawn().rings():
                rings.setdefault(_listed(ring), []).append(at)
    for ring, places in rings.items():
        reads = "read one another" if " and " in ring else "reads itself"
        yield f"solved within a tick{','.join(places)}: {ring}, which {reads} in the same tick; prev(...) reads the one before"


# Ranges in which the numbers of devices and hands lie, in the unit of the key.
USUAL = MappingProxyType({"device.mass": (1e-3, 20.0), "device.damping": (0.0, 200.0), "operator.mass": (0.0, 20.0)})


def unusual(spec: Spec) -> Iterator[str]:
    """Yield a sentence for each number of the spec that is so far from those of devices that its unit may be wrong."""
    for path, (low, high) in USUAL.items():
        if path in spec.given and not low <= spec.values[path] <= high:
            unit, value = KEYS[path].unit, spec.values[path]
            yield f"{path} = {value:g} {unit} is unusual (usual: {low:g} to {high:g} {unit}); is it given in {unit}?"


def near_rates(spec: Spec) -> Iterator[str]:
    """Yield which slow rates near the spec's own divide the fast one, if that does not: their frames are short."""
    if spec.uneven:
        fast, ratio = float(spec.values["rates.fast_hz"]), float(spec.values["rates.ratio"])
        higher, lower = fast / floor(ratio), fast / ceil(ratio)
        repeats = f"{fast / ratio:.6g} Hz does not divide {fast:.6g} Hz, so that all takes several times as long"
        yield f"{repeats}; {higher:.6g} and {lower:.6g} Hz do"


def notices_of(grid: Grid) -> list[str]:
    """A sentence for each axis that the controller does not read, and one for numbers that a preset does not give."""
    kind = grid.spec.kind
    ignored = [f"{axis.name} is not read by {kind}: evaluated once, its rows repeated" for axis in grid.ignored]
    return [*ignored, *over_preset(grid.spec)]


def over_preset(spec: Spec, options: Mapping[str, object] = MappingProxyType({})) -> Iterator[str]:
    """Yield a sentence about the numbers of a preset device that the spec itself gives otherwise; options: other numbers."""
    if spec.preset:
        used, numbers = {**spec.values, **options}, DEVICES[spec.preset].numbers.items()
        pairs = [(path, used[path], number.value) for path, number in numbers if path in used]
        differing = [f"{path} = {value:g} and not {preset:g}" for path, value, preset in pairs if value != preset]
        if differing:
            yield f"the spec takes precedence over the preset {spec.preset}: {', '.join(differing)}"


def assumed_by(
    specs: Sequence[Spec], swept: Collection[str] = (), *, nominal: bool = False, run: RunWords | None = None
) -> str:
    """The sentence of one spec, or those of several, a line each with its name; swept: of any; nominal, run: see `assumes`."""
    several = len(specs) > 1
    swept_here = [{axis.path for axis in (*spec.sweep, *spec.bode)} if several else set(swept) for spec in specs]
    said = [assumes(spec, axes & {*swept}, nominal=nominal, run=run) for spec, axes in zip(specs, swept_here, strict=True)]
    if len(set(said)) == 1:
        return said[0]
    return "\n".join(f"{spec.name}: {sentence}" for spec, sentence in zip(specs, said, strict=True) if sentence)


def _listed(words):
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
