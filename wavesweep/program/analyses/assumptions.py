"""What a result is for: integration of the wall, delay and velocity, and which of them the spec
left to the defaults."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from math import ceil, floor
from types import MappingProxyType
from typing import Any

from wavesweep.engine.drawing import path_of, scalars
from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import assumption_of_page, keys_of_page, steps_of
from wavesweep.program.reading.keys import DEVICES
from wavesweep.program.reading.units import unknown_part
from wavesweep.program.spec import KEYS, Axis, Spec
from wavesweep.program.spec.resolving import longest_delay
from wavesweep.program.sweep.grid import Grid

MOST_BUILT = 32  # values, the smallest ones, at which a loop is built
LISTED, MOST_AXES = 6, 3  # values of a number, and numbers
CONTINUOUS = "as physics does; a program holds its sums"
FAVOURABLE = "optimistic default"  # in a sentence that rests on some
NOMINAL_STEPS = "nominal steps"  # of what the program counts, whatever ticks take
INTEGRATION, DELAY, VELOCITY = "environment.integration", "environment.delay", "device.velocity"


def model_in_words(spec: Spec, swept: Collection[str] = (), told: Collection[str] = ()) -> str:
    """A sentence about the wall, the delay and the velocity of the loop that a spec writes.

    Which numbers, frames and messages a result is for its claim says. swept: paths of the axes of
    the result, which have no single value; told: those of numbers that claims name. If the spec
    gives one of the three no value of its own, the sentence says so, and names the usual practice
    of engines, which is less kind than the default. A drawn loop shows all of that itself; its
    sentence says which numbers act continuously, and within which limits of its blocks it is
    linear.
    """
    if spec.drawing:
        return _drawn_in_words(spec, swept)
    read = keys_of_page(spec.values) - {*told}
    values = spec.values
    phrases = [assumption_of_page(values)]
    vary = "rates.ratio" in told
    if DELAY in read:
        phrases.append(_delay(spec, swept, vary=vary))
    if vary and INTEGRATION in read:
        over = f"{values['rates.ratio']} ticks, however long a frame is"
        if spec.step == "elapsed":
            over = "the time since the last frame"
        phrases.append(f'integrated over {over} (step = "{spec.step}")')
    if VELOCITY in read:
        exact = values[VELOCITY] == "exact"
        phrases.append("exact velocity" if exact else "velocity from differences of position")
    if spec.tick:
        phrases.append(NOMINAL_STEPS)
    phrases += _amplifier(values, swept)
    assumed = ", ".join(phrases)
    said_elsewhere = {*spec.given, *swept}
    deciding = [path for path in (INTEGRATION, DELAY, VELOCITY) if path in read]
    by_default = [path for path in deciding if path not in said_elsewhere]
    return f"{assumed}; {_practice(spec, by_default)}" if by_default else assumed


def _practice(spec: Spec, by_default: Sequence[str]) -> str:
    """What engines usually have in the place of some favourable defaults."""
    delay = '"frame"' if spec.uneven else str(spec.values["rates.ratio"])
    usual = {INTEGRATION: '"explicit"', DELAY: delay, VELOCITY: '"difference"'}
    plural = "s" if len(by_default) > 1 else ""
    practice = _listed([usual[path] for path in by_default])
    return f"{FAVOURABLE}{plural} of {_listed(by_default)}: engines usually have {practice}"


def _drawn_in_words(spec: Spec, swept: Collection[str]) -> str:
    """Which numbers of a drawn loop act continuously, and within which limits it is linear."""
    said = [*_continuous(spec), *_read_between_ticks(spec)]
    if spec.tick:
        said.append(NOMINAL_STEPS)
    limits = ", ".join(_limits(spec, swept))
    if limits:
        said.append(f"linear while {limits}; simulate keeps to these limits")
    return "; ".join(said)


def _delay(spec: Spec, swept: Collection[str], *, vary: bool) -> str:
    """The delay of the environment's results; vary: whether frames have several lengths."""
    if DELAY in swept:
        return "delay swept"
    for axis in spec.changing:
        if axis.path == DELAY:
            return f"delays of {_values(axis)} ticks"
    values = spec.values
    delay = values[DELAY]
    if vary and spec.delay_of_frame:
        return 'results in place with the next frame (delay = "frame")'
    if not delay:
        return "no delay"
    if isinstance(delay, float):  # a frame that is no whole number of ticks
        return f"results in place with the next frame, {delay:.6g} ticks later"
    if vary or {"rates.fast_hz", "rates.slow_hz", "rates.ratio"} & set(swept):
        ticks = "tick" if delay == 1 else "ticks"
        return f"delay of {delay} {ticks}"
    if delay == values["rates.ratio"]:
        return f"delay of a whole frame, {delay} ticks"
    return f"delay of {delay} of {longest_delay(values)} ticks"


def _amplifier(values: Mapping[str, Any], swept: Collection[str]) -> list[str]:
    """How late the amplifier is, if it is at all."""
    if {"device.delay", "device.dead_time"} & set(swept):
        return ["amplifier's delay swept"]
    late = values["device.delay"]
    dead = values["device.dead_time"]
    times = []
    if late:
        times.append(f"{late} ticks" if late > 1 else f"{late} tick")
    if dead:
        times.append(f"{1e3 * dead:g} ms")
    if times:
        return [f"amplifier late by {' and '.join(times)}"]
    return []


def of_axes(spec: Spec, axes: Iterable[Axis], table: str) -> str:
    """The spec's own value of each number for which the axes of a table have others, in words."""
    said = []
    for axis in axes:
        value = spec.own(axis.path)
        if value is None:  # the edge of a band, which the spec does not have
            continue
        if axis.values == (value,):
            continue
        if axis.values:
            inside = value in axis.values
        else:
            inside = axis.start <= value <= axis.stop
        values = _values(axis)
        if len(axis.values) > LISTED:
            values = f"{len(axis.values)} values from {axis.start:g} to {axis.stop:g}"
        among = "of" if inside else "not in"
        said.append(f"{axis.name} = {value:g}{_unit(spec, axis)}, {among} {table} {values}")
    left_out = len(said) - MOST_AXES
    if left_out >= 2:
        said[MOST_AXES:] = [f"{left_out} other numbers of {table}"]
    return "; ".join(said)


def _continuous(spec) -> Iterator[str]:
    """Yield which numbers act continuously, between ticks too: the factors of terms by which
    plants act on each other."""
    ports: dict[str, list[str]] = {}
    for port, terms in spec.drawing.couplings:
        names = []
        numbers = []
        for _, gain in terms:
            names_of_gain = [*gain.names]
            names += names_of_gain
            if not names_of_gain:
                numbers.append(f"{gain.value({}):g}")
        factors = names + [number for number in numbers if number not in ("1", "-1")]
        for factor in dict.fromkeys(factors):
            ports.setdefault(factor, []).append(port)
    acting: dict[str, list[str]] = {}
    for factor, continuous in ports.items():
        shown = continuous
        if len(continuous) > 4:  # ports that a sentence lists
            shown = [*continuous[:2], f"{len(continuous) - 2} other wires"]
        acting.setdefault(_listed(shown), []).append(factor)
    said = []
    for where, factors in acting.items():
        act = "acts" if len(factors) == 1 else "act"
        said.append(f"{_listed(factors)} {act} continuously in {where}")
    if said:
        yield f"{_listed(said)} ({CONTINUOUS})"


def _read_between_ticks(spec) -> Iterator[str]:
    """Yield which outputs of plants a dead time reads between ticks and brings to plants, as no
    program does."""
    plants = spec.drawing.plants
    brought = {dead_time for plant in plants for _, dead_time in plant.arriving}
    read: dict[str, list[str]] = {}
    for plant in plants:
        for signal, dead_time in plant.sensed:
            if dead_time in brought:
                read.setdefault(dead_time, []).append(signal)
    for dead_time, signals in read.items():
        yield f"{dead_time} reads {_listed(signals)} between ticks (a program samples: let it read a hold)"


def _values(axis) -> str:
    if axis.values:
        return ", ".join(f"{value:g}" for value in axis.values)
    return f"{axis.start:g} to {axis.stop:g}"


def _unit(spec, axis) -> str:
    unit = spec.names.keys[axis.path].unit
    return "" if unit in ("", "1") else f" {unit}"


def _limits(spec, swept) -> Iterator[str]:
    """Yield the limits of each block that has some, with the values of numbers that are not
    swept."""

    def shown(tree):
        moving = {path_of(name) for name in tree.names} & set(swept)
        if moving:
            return tree.text
        return f"{tree.value(numbers):g}"

    numbers = scalars(spec.values)
    for block in spec.drawing.blocks:
        limits = dict(block.limits)
        if "high" in limits:
            limited = "u" if block.type == "saturation" else "y"
            port = f"{block.name}.{limited}"
            high = shown(limits["high"])
            low = shown(limits["low"]) if "low" in limits else f"-{high}"
            symmetric = low == f"-{high}"
            yield f"|{port}| <= {high}" if symmetric else f"{low} <= {port} <= {high}"


def solved_within_ticks(spec: Spec, swept: Collection[str]) -> Iterator[str]:
    """Yield a sentence for each cycle of blocks that read one another in the same tick, and are
    solved together.

    swept: paths of the axes of a result. Of those that decide how the loop is built, the least
    MOST_BUILT values are looked at, since small ones take a delay away.
    """
    if not spec.drawing:
        return
    built = []
    for axis in (*spec.sweep, *spec.bode):
        if axis.structural and axis.path in swept:
            least = sorted(axis.values)[:MOST_BUILT]
            built += [(f" at {axis.name} = {value:g}", {axis.path: value}) for value in least]
    rings: dict[str, list[str]] = {}
    for place_text, changed in built or [("", {})]:
        with suppress(WavesweepError):
            loop = Loops(spec.drawing, spec.with_values(changed).values)
            for ring in loop.drawn().rings():
                rings.setdefault(_listed(ring), []).append(place_text)
    for ring, places in rings.items():
        reads = "read one another" if " and " in ring else "reads itself"
        yield f"solved within a tick{','.join(places)}: {ring}, which {reads} in the same tick; prev(...) reads the one before"


# Ranges in which the numbers of devices and hands lie, in the unit of the key.
USUAL = MappingProxyType(
    {"device.mass": (1e-3, 20.0), "device.damping": (0.0, 200.0), "operator.mass": (0.0, 20.0)}
)


def unusual(spec: Spec) -> Iterator[str]:
    """Yield a sentence for each number of the spec that is so far from those of devices that its
    unit may be wrong."""
    for path, (low, high) in USUAL.items():
        if path in spec.given and not low <= spec.values[path] <= high:
            unit = KEYS[path].unit
            value = spec.values[path]
            yield f"{path} = {value:g} {unit} is unusual (usual: {low:g} to {high:g} {unit}); is it given in {unit}?"
    for name, unit, _ in spec.drawing.numbers if spec.drawing else ():
        if part := unknown_part(unit):
            yield f"{name} has the unit {unit}, of which {part} is not known: it is printed, and no value in another unit is taken"
    yield from _rounded_rate(spec)


def _rounded_rate(spec: Spec) -> Iterator[str]:
    """Yield as which fraction a slow rate is taken whose digits do not give it exactly."""
    if spec.slow_hz_written is None:
        return
    ticks, steps = steps_of(spec.values["rates.ratio"])
    written = Fraction(repr(spec.slow_hz_written))
    taken = Fraction(repr(spec.values["rates.fast_hz"])) * steps / ticks
    if taken != written:
        per_frame = f"{ticks}/{steps}" if steps > 1 else f"{ticks}"
        yield f"rates.slow_hz = {spec.slow_hz_written!r} is taken as {taken} Hz, a frame of {per_frame} ticks"


def near_rates(spec: Spec) -> Iterator[str]:
    """Yield which slow rates near the spec's own divide the fast one, if that does not: their
    frames are short."""
    if spec.uneven and "rates.ratio" in keys_of_page(spec.values):
        fast = float(spec.values["rates.fast_hz"])
        ratio = float(spec.values["rates.ratio"])
        higher = fast / floor(ratio)
        lower = fast / ceil(ratio)
        repeats = f"{fast / ratio:.6g} Hz does not divide {fast:.6g} Hz, so that computing takes several times as long"
        yield f"{repeats}; {higher:.6g} and {lower:.6g} Hz do"


def notices_of(grid: Grid) -> list[str]:
    """A sentence for each axis that the controller does not read, and one for numbers that a
    preset does not give."""
    kind = grid.spec.kind
    ignored = [
        f"{axis.name} is not read by {kind}: evaluated once, its rows repeated"
        for axis in grid.ignored
    ]
    return [*ignored, *over_preset(grid.spec)]


def over_preset(spec: Spec, options: Mapping[str, object] = MappingProxyType({})) -> Iterator[str]:
    """Yield a sentence about the numbers of a preset device that the spec itself gives
    otherwise; options: other numbers."""
    if spec.preset:
        used = {**spec.values, **options}
        differing = []
        for path, number in DEVICES[spec.preset].numbers.items():
            if path in used and used[path] != number.value:
                differing.append(f"{path} = {used[path]:g} and not {number.value:g}")
        if differing:
            yield f"the spec takes precedence over the preset {spec.preset}: {', '.join(differing)}"


def _listed(words):
    if len(words) == 1:
        return words[0]
    return f"{', '.join(words[:-1])} and {words[-1]}"
