"""The spec of a device that was found from a log: the text that `wavesweep identify` writes."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from wavesweep.engine.drawing import LONGEST_DELAY
from wavesweep.program.number_words import span_around
from wavesweep.program.spec.writing import as_toml

PATHS = {"mass": "device.mass", "damping": "device.damping", "stiffness": "operator.stiffness"}
DRAWN = {
    "mass": "Jm",
    "damping": "D",
    "load_mass": "Jl",
    "load_damping": "Dl",
    "coupling_stiffness": "k",
    "coupling_damping": "d",
}
"""The numbers of the template two-mass."""
IN_CIRCUITS = {
    "mass": "inductance",
    "damping": "resistance",
    "load_mass": "second_inductance",
    "load_damping": "second_resistance",
    "coupling_stiffness": "capacitance",
    "coupling_damping": "capacitor_resistance",
}
"""The numbers of a coil and of an LCL filter, which move as one mass, and as two on a spring."""
STRAIGHT = (
    ("kg*m^2", "kg"),
    ("N*m*s/rad", "N*s/m"),
    ("N*m/rad", "N/m"),
    ("rad/s", "m/s"),
    ('"N*m"', '"N"'),
    ("inertia", "mass"),
)
"""What the template says of what turns, and what is said of a device that moves straight."""
EARLY = 1.5  # ticks; a log whose rows have the position after their force is one tick ahead
TOLD = 0.1  # ticks that a delay may differ from the one in the spec


def negative(parameters: Mapping[str, Any]) -> Iterator[str]:
    """Sentences on numbers below 0."""
    delay = parameters["delay"]
    if withheld(parameters):
        return
    unit = delay["unit"].replace("tick", "ticks")
    if delay["high"] < -EARLY:
        yield f"the position is {-delay['value']:.3g} {unit} ahead of its force: are the two columns of the same time?"
    elif delay["value"] < -EARLY:
        low, high = (f"{delay[end]:.3g}" for end in ("low", "high"))
        yield f"the log does not tell the delay, which may be from {low} to {high} {unit}; the spec's range begins at 0"
    for name in dict.fromkeys((*PATHS, *DRAWN, *IN_CIRCUITS.values())):
        if name in parameters and parameters[name]["low"] < 0:
            yield f"the log allows a {name} below 0, which no device has; the spec's range begins at 0"


def withheld(parameters: Mapping[str, Any]) -> bool:
    """Whether the numbers have no intervals; the first one is a mass."""
    return next(iter(parameters.values()))["low"] is None


def spoken(estimate: Mapping[str, Any]) -> str:
    """A number with its interval, to the digits that it has."""
    value, low, high, unit = (estimate[name] for name in ("value", "low", "high", "unit"))
    if low is None:
        return f"{value:.2g} {unit} (no interval)"
    if low == high:
        return f"{value:g} {unit}, given"
    digits = min(
        max(int(np.ceil(np.log10(max(abs(value), abs(low), abs(high)) / (high - low)))) + 2, 2), 12
    )
    return f"{value:.{digits}g} {unit} ({span_around(low, high, digits)})"


def whole(delay: Mapping[str, Any]) -> int | None:
    """The delay as a whole number of ticks, which a spec's device may have; None if it is not
    known to be one."""
    ticks = max(round(delay["value"]), 0)
    if delay["low"] is None:
        return ticks
    if max(ticks - delay["low"], delay["high"] - ticks) <= TOLD or delay["high"] <= TOLD:
        return ticks
    return None


def late(facts: Mapping[str, Any]) -> str:
    """The key of [device] that has the delay of a table: "delay" in whole ticks, "dead_time" in
    s, "" if there is none."""
    ticks = whole(facts["parameters"]["delay"])
    if ticks == 0:
        return ""
    if ticks is None or "analogue" in facts["asked"]:
        return "dead_time"
    return "delay"


def _set_delay(device: dict[str, Any], facts: Mapping[str, Any]) -> dict[str, Any]:
    """Put the delay into [device], as whole ticks or a dead time; return the range of the latter
    for [for_all]."""
    name = late(facts)
    if name == "delay":
        device["delay"] = whole(facts["parameters"]["delay"])
    if name in ("delay", ""):
        return {}
    ticks = (
        min(max(facts["parameters"]["delay"][end], 0.0), LONGEST_DELAY)
        for end in ("low", "value", "high")
    )
    low, device["dead_time"], high = (float(f"{tick * facts['period_s']:.9g}") for tick in ticks)
    if low < high:
        return {"device.dead_time": {"start": low, "stop": high}}
    return {}


def spec_text(facts: Mapping[str, Any]) -> str:
    """The text of a spec with the device of a table, for every other command, and what its numbers
    may be in [for_all].

    It has no [for_all] if the numbers have no intervals.
    """
    parameters = facts["parameters"]
    if "inductance" in parameters:
        return "\n".join([*_comments(facts), _circuit(facts)])
    if "load_mass" in parameters:
        return "\n".join([*_comments(facts), _two_masses(facts)])
    if "axes" in facts:
        return "\n".join([*_comments(facts), _several_axes(facts)])
    fitted = {path: parameters[name] for name, path in PATHS.items() if name in parameters}
    tables: dict[str, dict[str, Any]] = {
        "controller": {"kind": "dc"},
        "rates": {"fast_hz": float(f"{1 / facts['period_s']:.9g}")},
    }
    for path, fitted_number in fitted.items():
        room, name = path.split(".")
        tables.setdefault(room, {})[name] = max(fitted_number["value"], 0.0)
    ranges = _set_delay(tables["device"], facts)
    if _of_positions(facts):
        tables["device"]["velocity"] = "difference"
    effects = {}
    if facts["resolution"] and facts["measured"] == "position":
        effects["resolution"] = float(f"{facts['resolution']:.9g}")
    if "friction" in parameters:
        effects["friction"] = max(parameters["friction"]["value"], 0.0)
    tables["simulate"] = effects
    tables["for_all"] = {
        path: {"start": max(estimate["low"], 0.0), "stop": max(estimate["high"], 0.0)}
        for path, estimate in fitted.items()
        if estimate["low"] is not None
    }
    tables["for_all"] |= ranges
    if not tables["for_all"]:
        del tables["for_all"]
    return "\n".join([*_comments(facts), as_toml(tables)])


def _several_axes(facts: Mapping[str, Any]) -> str:
    """A device of several axes before a flat wall: a template with the numbers that were found."""
    return _with_numbers(f"axes-{len(facts['axes'])}.toml", facts, facts["parameters"])


def _circuit(facts: Mapping[str, Any]) -> str:
    """A coil, or an LCL filter, under a PI controller of its current: a template with the numbers
    that were found, and a first bandwidth below the filter's resonance and the delay."""
    parameters = {}
    for name, number in facts["parameters"].items():
        ends = {end: number[end] and max(number[end], 0.0) for end in ("value", "low", "high")}
        parameters[name] = number if name == "delay" else ends
    inductances = [parameters["inductance"]["value"]]
    bandwidth = 0.1 / facts["period_s"] / (1 + max(parameters["delay"]["value"], 0.0))
    template = "coil.toml"
    if "capacitance" in parameters:
        template = "lcl.toml"
        inductances.append(parameters["second_inductance"]["value"])
        rates = sum(1 / inductance for inductance in inductances)
        bandwidth = min(bandwidth, np.sqrt(rates / parameters["capacitance"]["value"]) / 10)
    gain = f"{bandwidth * sum(inductances):.3g}"
    first = {"kp": gain, "ki": f"{float(gain) * bandwidth / 10:.3g}", "most": 20 * float(gain)}
    return _with_numbers(template, facts, parameters, first)


def _with_numbers(
    template: str,
    facts: Mapping[str, Any],
    parameters: Mapping[str, Any],
    others: Mapping[str, Any] | None = None,
) -> str:
    """A template of this folder with the numbers that were found, and others; without its [for_all]
    if they have no intervals."""
    values = {"tick_hz": float(f"{1 / facts['period_s']:.9g}"), **(others or {})}
    for name, number in parameters.items():
        values |= {
            name: number["value"],
            f"{name}_low": number["low"],
            f"{name}_high": number["high"],
        }
    ticks = whole(parameters["delay"])
    if ticks is None:
        ticks = max(parameters["delay"]["value"], 0.0)
    values["delay"] = ticks * facts["period_s"]
    path = Path(__file__).with_name(template)
    text, ranges, bounds = (
        Template(path.read_text("utf-8")).substitute(values).partition("[for_all]")
    )
    return text if withheld(parameters) else text + ranges + bounds


def _of_positions(facts):
    return (
        facts["measured"] == "position" and "period_s" not in facts["asked"]
    )  # and no frequency response


def _two_masses(facts: Mapping[str, Any]) -> str:
    """The template two-mass with the numbers that were found, and a slow first controller.

    A proof takes five ranges at most, so the load's damping has its ends as values in place of a
    range.
    """
    from wavesweep.program.bundled import bundled

    template = (bundled("sweeps/templates") / "two-mass.toml").read_text(encoding="utf-8")
    text = "[rates]" + template.partition("[rates]")[2].partition("[sweep]")[0]
    parameters = facts["parameters"]
    period = facts["period_s"]
    numbers = {name: max(parameters[parameter]["value"], 0.0) for parameter, name in DRAWN.items()}
    numbers["tau"] = max(parameters["delay"]["value"], 0.0) * period
    resonance = float(np.sqrt(numbers["k"] * (1 / numbers["Jm"] + 1 / numbers["Jl"])))
    bandwidth = min(resonance / 10, 0.1 / (numbers["tau"] + period))
    gain = float(f"{bandwidth * (numbers['Jm'] + numbers['Jl']):.3g}")
    numbers["f"] = float(f"{resonance / 2 / np.pi:.4g}")
    numbers["kp"] = gain
    numbers["ki"] = float(f"{gain * bandwidth / 10:.3g}")
    for name, value in numbers.items():
        text = re.sub(rf"(?m)^({name} *= {{ value = )[^,]*", rf"\g<1>{value!r}", text)
    text = re.sub(r"(?m)^tick_hz = \S+", f"tick_hz = {float(f'{1 / period:.9g}')!r}", text)
    for turning, straight in STRAIGHT if not facts["turns"] else ():
        text = text.replace(turning, straight)
    sweep = {"along": "kp", "kp": {"start": 0.0, "stop": 20 * gain}}
    if parameters["mass"]["low"] is None:
        return text + as_toml({"sweep": sweep})
    ends = {
        name: [max(parameters[parameter][end], 0.0) for end in ("low", "high")]
        for parameter, name in DRAWN.items()
    }
    ranges: dict[str, Any] = {
        name: {"start": low, "stop": high} for name, (low, high) in ends.items()
    }
    return text + as_toml(
        {"sweep": sweep, "for_all": ranges | {"Dl": {"values": sorted({*ends["Dl"]})}}}
    )


def _place_of_delay(facts: Mapping[str, Any]) -> str:
    """What has the delay in the spec."""
    if {"load_mass", "inductance"} & {*facts["parameters"]} or "axes" in facts:
        return "tau"
    if late(facts):
        return f"device.{late(facts)}"
    return "left out"


def _comments(facts: Mapping[str, Any]) -> Sequence[str]:
    delay = facts["parameters"]["delay"]
    millis = 1e3 * facts["period_s"]
    two = "load_mass" in facts["parameters"]
    bare = withheld(facts["parameters"])
    lines = [
        f"# The device of {facts['spec_name']}, as wavesweep identify found it; the controller is a first one, put your own.",
        "# Numbers without intervals:" if bare else "# Intervals of 95 %, in [for_all]:",
        *(f"#     {name} {spoken(estimate)}" for name, estimate in facts["parameters"].items()),
        f"# The delay is {delay['value'] * millis:.4g} ms, in ticks of {millis:.6g} ms. It is {_place_of_delay(facts)}.",
    ]
    drawn = two or "axes" in facts or "inductance" in facts["parameters"]
    if _of_positions(facts) and not drawn:
        lines.append("# The log has positions, so the velocity is that of their differences.")
    if two and not bare:
        lines.append(
            "# A proof takes five ranges, so the load's damping Dl has the ends of its interval as values, and tau its own."
        )
    if "stiffness" in facts["parameters"]:
        lines.append("# The spring stands as that of the hand, which acts as well on the device.")
    if facts["turns"]:
        lines.append("# The device turns: kg is kg*m^2, N is N*m, and m is rad.")
    if facts["missing"] == "unseen":
        lines.append("# The log cannot tell whether the model is enough.")
    elif not facts["explained"]:
        if bare:
            hint = "no number has an interval"
        else:
            hint = "the intervals are wider by what is left"
        lines.append(f"# The model does NOT explain the log; {hint}.")
    return [*lines, *(f"# {line[0].upper()}{line[1:]}." for line in negative(facts["parameters"]))]
