"""What `check` finds of the ranges of a design's own numbers, and the lines about them, the feel,
the hardware and the modes.

Each line has a rank, by which the short form of `check` chooses: up to NEEDED it is always shown, a
DETAIL only with --all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import pi
from shlex import quote
from typing import TYPE_CHECKING, Any

from wavesweep.check import room_of_numbers as ranges
from wavesweep.check.verdict import distance
from wavesweep.program.analyses.hardware_limits import hardware_of
from wavesweep.program.analyses.own_design import is_an_end
from wavesweep.program.number_words import (
    MOST_DIGITS,
    ends_in_words,
    rounded_down,
    rounded_up,
    span_in_words,
)
from wavesweep.program.reading.keys import readable

if TYPE_CHECKING:
    from wavesweep.check.verdict import Facts, Ranked
    from wavesweep.program.spec import Spec

NEEDED, DETAIL = 1.5, 9.0  # see above
SEARCHED, OF_KEY = " (where the search starts)", " (where the range of the key ends)"


def facts(spec: Spec, own: Facts, report: Callable[[int, int], None] | None) -> dict[str, Any]:
    """limits: for each number of the loop the stable interval that its value lies in, see
    `ranges.limits`. delay: the number of ticks it may grow to; a drawn loop has no delay that a
    spec would name. hardware: see `hardware_of`.
    """
    facts_found = {"limits": ranges.limits(spec, report), "delay": ranges.delays(spec)}
    hardware = hardware_of(spec, stable=own["stable"])
    stiffness = (own["felt"] or {}).get("stiffness")
    if "max_force" in hardware and own["stable"]:  # the depth to which the wall can be pressed
        hardware["depth"] = None
        if stiffness and stiffness > 0:
            hardware["depth"] = hardware["max_force"] / stiffness
    return facts_found | {"hardware": hardware}


def lines(spec: Spec, facts: Facts) -> Iterator[Ranked]:
    """Yield the lines about ranges, delay, feel, hardware and modes."""
    yield from _limit_lines(spec, facts)
    if facts["delay"] and facts["spectral_radius"] is not None:
        yield 2.5, _delay(spec, facts["delay"])
    if facts["stable"] and facts["felt"]:
        yield from _felt(facts["felt"], spec.at_port("N/m"), spec.at_port("N*s/m"))
    yield from _hardware(facts.get("hardware", {}), facts["stable"], spec)
    if facts["stable"]:
        # A mode rings below this damping ratio.
        rings = facts["least_damped"] and facts["least_damped"]["damping_ratio"] < 0.5
        yield from _mode(4 if rings else 2.5, "slowest mode", facts["slowest"])
        if rings:
            yield from _mode(2.5, "least damped mode", facts["least_damped"])


def _limit_lines(spec: Spec, found: Facts) -> Iterator[Ranked]:
    """The range of each number in which the design stays as it is: that of the sweep is always
    shown, then the nearest end."""
    swept = spec.along and spec.names.find(spec.along).path
    swept_limits = [
        limit for limit in found["limits"] if spec.names.find(limit["name"]).path == swept
    ]
    # Where stability changes in the range searched, or is not known there.
    bounded = [
        limit
        for limit in found["limits"]
        if limit in swept_limits
        or limit["stopped"]
        or limit["stable"] is None
        or not limit["certified"]
        or limit["intervals"] not in ([], [[limit["from"], limit["to"]]])
    ]
    for limit in bounded:
        rank = 0 if limit in swept_limits else 2 + distance(limit)
        yield rank, _limit(spec, limit)
        if going_on := _going_on(spec, limit):
            yield DETAIL, f"  {going_on}"
    for said, stable in (("stable at every value", True), ("stable at no value", False)):
        # By its intervals: at an end of one, as Kp = 0 is of a loop that drifts there, a value
        # counts as not inside.
        spans = []
        for limit in found["limits"]:
            if limit not in bounded and bool(limit["intervals"]) == stable:
                unit = _unit(spec, limit["name"])
                span = span_in_words(limit["from"], limit["to"])
                spans.append(f"{limit['name']} {span}{unit}")
        if spans:
            yield 5, f"{said} in the range: {', '.join(spans)}"


def _limit(spec: Spec, limit: Facts) -> str:
    name = limit["name"]
    unit = _unit(spec, name)
    at_value = f"{name} = {limit['value']:g}{unit}"
    if not spec.drawing and spec.names.find(name).path not in spec.given:
        at_value += " (default)"
    unit_again = unit if len(unit) < 12 else ""  # a longer unit is not said twice in a line
    return f"{at_value}: {_stable_where(limit, unit_again)}"


def _going_on(spec: Spec, limit: Facts) -> str:
    """What finds the rest of a range that ended early, unless both ends of the interval are
    known, or a pose may end it."""
    name = limit["name"]
    path = spec.names.find(name).path
    if spec.drawing and path in spec.drawing.posing:
        return ""
    start, stop = ranges.searched(spec, name, path)
    if limit["of_key"][0]:
        start = limit["from"]
    if limit["of_key"][1]:
        stop = limit["to"]
    ended_below = limit["low"] is None and limit["from"] > start
    ended_above = limit["high"] is None and limit["to"] < stop
    if not (limit["stopped"] and (ended_below or ended_above)):
        return ""
    file = quote(spec.source or spec.name)
    first, last = ends_in_words(start, stop)
    axes = f"--set sweep.along={name} --set 'sweep.{name}={{start={first}, stop={last}}}'"
    return f"the whole range takes longer: wavesweep stability-region {file} {axes}"


def _stable_where(limit: Facts, unit: str) -> str:
    if limit["stable"] is None:
        return f"not known ({limit['doubt']})"
    proved = "" if limit["certified"] else f", not certified ({limit['doubt']})"
    if not limit["stable"]:
        if limit["intervals"]:
            spans = [f"{_span(limit, low, high)}{unit}" for low, high in limit["intervals"]]
            at_end = "on an end, " if is_an_end(limit["value"], limit["intervals"]) else ""
            return f"{at_end}stable in {' and '.join(spans)}{proved}"
        searched = f"{span_in_words(limit['from'], limit['to'])}{unit}"
        if limit["certified"]:
            return f"nowhere stable in {searched}"
        return f"no stable value known in {searched} ({limit['doubt']})"
    start, end = _ends(limit, unit)
    if limit["open"]:
        known_where = _known_where(limit, limit["open"], start, end, unit)
        return f"known to be stable {known_where} ({limit['doubt']})"
    unbounded = limit["low"] is None and limit["high"] is None
    if limit["stopped"] and limit["certified"] and unbounded:
        span = span_in_words(limit["from"], limit["to"])
        return f"known to be stable from {span}{unit}, not known beyond"
    factors = _factors(limit) if limit["value"] else ""
    return f"stable {start} {end}{factors}{_beyond(limit, unit)}{proved}"


def _beyond(limit: Facts, unit: str) -> str:
    """The stable intervals that the value does not lie in."""
    other_intervals = [
        each for each in limit["intervals"] if not each[0] <= limit["value"] <= each[1]
    ]
    spans = [f"{_span(limit, *interval)}{unit}" for interval in other_intervals]
    if spans:
        return f"; also in {' and '.join(spans)}"
    return ""


def _ends(limit: Facts, unit: str) -> tuple[str, str]:
    """The ends of the stable interval in words, or those of the search where it goes on beyond."""
    from_key, to_key = limit["of_key"]
    if limit["low"] is not None:
        start = f"from {rounded_up(limit['low'])}"
    else:
        start = f"from {rounded_up(limit['from'])}"
        if limit["from"]:
            start += OF_KEY if from_key else SEARCHED
    if limit["high"] is not None:
        end = f"to {rounded_down(limit['high'])}{unit}"
    elif to_key:
        end = f"to {rounded_down(limit['to'])}{unit}{OF_KEY}"
    else:
        end = f"to at least {rounded_down(limit['to'])}{unit}"
    return start, end


def _known_where(limit: Facts, open_: Facts, start: str, end: str, unit: str) -> str:
    """The part of a range in doubt in which the design is known to be stable, the open places,
    and what is beyond them."""
    from wavesweep.program.tables.interval_sentences import open_in_words

    low = limit["from"] if limit["low"] is None else limit["low"]
    high = limit["to"] if limit["high"] is None else limit["high"]
    places = open_in_words(open_, unit)
    if open_["from"] >= limit["value"]:
        beyond = f", and stable again {end}" if high > open_["to"] else ""
        inner_end = rounded_down(min(high, open_["from"]))
        return f"{start} up to at least {inner_end}{unit}; {places}{beyond}"
    if open_["to"] <= limit["value"]:
        beyond = f", and stable again {start}" if low < open_["from"] else ""
        inner_end = rounded_up(max(low, open_["to"]))
        return f"at least from {inner_end} {end}; {places}{beyond}"
    return f"in places {start} {end}; {places}"


def _span(limit: Facts, low: float, high: float) -> str:
    """An interval; an end of the searched range is not an end of stability."""
    start = SEARCHED if low == limit["from"] != 0 else ""
    least = "at least " if high == limit["to"] else ""
    first, _, last = span_in_words(low, high).partition(" to ")
    return f"{first}{start} to {least}{last or first}"


def _factors(limit: Facts) -> str:
    """The factors of the value at the ends."""
    inwards = {"low": rounded_up, "high": rounded_down}
    if limit["value"] < 0:  # the larger share of it is the lower end
        inwards = {"low": rounded_down, "high": rounded_up}
    ways = []
    for words, end in (("down to", "low"), ("up to", "high")):
        if limit[end]:
            share = limit[end] / limit["value"]
            digits = 3
            factor = inwards[end](share, digits)
            while float(factor) == 1 != share and digits < MOST_DIGITS:
                digits += 1
                factor = inwards[end](share, digits)
            ways.append(f"{words} {float(factor):.{digits}g}")
    if ways:
        return f" ({' and '.join(ways)} times its value)"
    return ""


def _unit(spec: Spec, name: str) -> str:
    unit = spec.names.find(name).unit
    if unit in ("", "1"):
        return ""
    return f" {readable(unit)}"


def _delay(spec: Spec, delay: Facts) -> str:
    whole = delay["ticks"] == spec.values["rates.ratio"]
    at_delay = f"delay = {delay['ticks']:.6g} of {delay['frame']:.6g} ticks"
    if whole:
        at_delay = f"delay of a whole frame, {delay['frame']:.6g} ticks"
    if delay["most"] is None:
        return f"{at_delay}: unstable at this delay"
    if delay["most"] == delay["frame"]:
        return f"{at_delay}: stable{'' if whole else ' up to a whole frame'}"
    least = "at least " if delay["most"] == delay["tried"] else ""
    return f"{at_delay}: stable up to {least}{delay['most']} ticks"


def _felt(felt: Facts, *units: str) -> Iterator[Ranked]:
    """What the hand feels of the wall."""
    from wavesweep.program.analyses.feel import outweighed_in_words, sizes_in_words

    if felt["rigid"]:
        yield 2.5, "felt at rest: rigid, a constant force moves nothing in the end"
        return
    if felt["stiffness"] is None and felt["damping"] is None:
        yield 2.5, "felt at rest: not known"
        return
    band = felt.get("over_band")
    if band is None:
        ways = []
        for name, unit, digits in zip(("stiffness", "damping"), units, (6, 4), strict=True):
            value = felt[name]
            ways.append(f"{name} not known" if value is None else f"{value:.{digits}g} {unit}")
        yield 2.5, f"felt at rest: {' and '.join(ways)}"
        return
    parts = [f"felt at rest: {felt['stiffness']:.6g} {units[0]}"]
    hz = band["holds_to_hz"]
    if hz:
        up_to = "up to" if hz >= 1 else "only up to"
        parts.append(f"within 10 % {up_to} {rounded_down(hz, 3)} Hz")
    if outweighed := outweighed_in_words(band):
        parts.append(outweighed)
    yield 2.5, "; ".join(parts)
    if sizes := sizes_in_words(band):
        yield DETAIL, f"  the wall adds to free motion, in {units[0]}: {', '.join(sizes)}"


def _moved_by_a_step(found: Facts, spec: Spec) -> str:
    """What a step of the encoder does to the force."""
    exact = not spec.drawing and spec.values["device.velocity"] == "exact"
    if found["step_force"] == 0:
        if exact:
            return 'moves no force, since the velocity is taken as exact; device.velocity = "difference" is of readings'
        return "moves no force, since no block reads the position"
    if found["chatter"] is None:
        return "makes a force that is not known to be bounded"
    moved = f"{rounded_up(found['step_force'], 4)} {spec.at_port('N')}"
    text = f"moves the force by up to {moved}, all rounding by at most {rounded_up(found['chatter'], 4)}"
    if exact:
        text += "; the velocity is taken as exact, without steps"
    return text


def _hardware(found: Facts, stable: bool, spec: Spec) -> Iterator[Ranked]:
    """What encoder, friction and motors do to the design."""
    force = spec.at_port("N")
    length = spec.at_port("m")
    unit = f"{force}/{length}"
    source = "Abbott and Okamura 2005"
    if "chatter" in found:
        step = f"{found['resolution']:.4g} {length}"
        yield 3, f"encoder: a step of {step} {_moved_by_a_step(found, spec)}"
        bounds = [(found.get("moves"), length), (found.get("speed"), f"{length}/s")]
        said = [f"{rounded_up(value, 4)} {name}" for value, name in bounds if value]
        if said:
            yield DETAIL, f"  and rounding moves the device by at most {' and '.join(said)}"
    if "holds_to" in found:
        limit = rounded_down(found["holds_to"])
        held = f"holds against the encoder's steps up to {limit} {unit} felt"
        yield 3, f"friction: {found['friction']:.4g} {force} {held}; stiffer walls may buzz"
        yield DETAIL, f"  after {source}"
        if not stable:
            yield (
                2,
                "only friction can bring this loop to rest: `wavesweep simulate` shows after which pushes it does",
            )
    if "passive_to" in found:
        yield (
            5,
            f"damping: walls up to {rounded_down(found['passive_to'])} {unit} without B_VE generate no energy ({source})",
        )
    if "passive" in found:
        wall = min(found["holds_to"], found["passive_to"])
        said = "generates no energy" if found["passive"] else "may generate energy"
        yield (
            5,
            f"encoder, friction and sampling together: the wall {said}, as up to {rounded_down(wall)} {unit} ({source})",
        )
    if found.get("depth") is not None:
        depth = f"{found['depth']:.4g} {length}"
        most = f"{found['max_force']:.4g} {force}"
        yield 4, f"motors: the wall can be pressed {depth} deep, slowly, with their {most}"


def _mode(rank: float, name: str, mode: Facts | None) -> Iterator[Ranked]:
    if mode is None:
        yield rank, f"{name}: none"
        return
    tau = _text(mode["time_constant_s"], 4)
    ratio = _text(mode["damping_ratio"], 3)
    if mode["time_constant_s"] == 0:
        text = f"{name}: over within a frame"
    else:
        text = f"{name}: falls to 1/e in {tau} s, damping ratio {ratio}"
    if mode["omega"] or mode["second_hz"]:
        text += f", {mode['omega'] / (2 * pi):.4g} Hz"
    if mode["second_hz"]:
        text += f" and {mode['second_hz']:.4g} Hz"
    yield rank, text
    if mode["states"]:
        yield DETAIL, f"  most in {', '.join(mode['states'])}"


def _text(value: float | None, digits: int = 6) -> str:
    if value is None:
        return "not known"
    return f"{value:.{digits}g}"
