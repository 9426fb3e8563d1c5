"""The law of rewriting for sets, and for time: a set in other words has rows and verdicts that agree.

What is proved and what is refuted of one set is found by searches, which other roundings lead elsewhere: what is proved of one
writing must not be refuted of the other, and settled ends lie within 2 % of each other.
"""

from copy import deepcopy

import numpy as np
from meaning.required import Found
from meaning.sets import set_of
from meaning.specs import Draw, toml

SAME = 1e-6  # relative: of the spec's own ends, and of what is computed without a search
SETTLED = 0.02  # of ends that are settled


def steps_as_seconds(tables: dict, draw: Draw) -> dict:
    """Whole ticks of a delay in seconds, or the other way round."""
    del draw
    for keys in tables.get("block", {}).values():
        if keys["type"] != "delay" or keys.get("every", 1) != 1 or "taps" in keys:
            continue
        hz = tables["rates"]["tick_hz"]
        if isinstance(hz, str):
            return tables
        if "seconds" not in keys:
            keys["seconds"] = keys.pop("steps", 1) / hz
        elif not isinstance(keys["seconds"], str) and abs(keys["seconds"] * hz - round(keys["seconds"] * hz)) < 1e-9:
            keys["steps"] = round(keys.pop("seconds") * hz)
    return tables


def tick_halved(tables: dict, draw: Draw) -> dict:
    """A tick of half the time, in every second of which all runs as before; late messages would be other ones."""
    del draw
    if "controller" in tables:
        return _fast_doubled(tables)
    blocks = tables.get("block", {})
    if not blocks or any("late" in keys for keys in blocks.values()):
        return tables
    tables["rates"]["tick_hz"] *= 2
    for keys in blocks.values():
        if keys["type"] == "mass" or "seconds" in keys:
            continue
        every = keys.get("every", 1)
        keys["every"] = f"2*({every})" if isinstance(every, str) else 2 * every
        if "phase" in keys:
            keys["phase"] = 2 * keys["phase"]
    return tables


def _fast_doubled(tables: dict) -> dict:
    """The same of a wall that is felt as it is: where anything runs in the fast ticks, or counts them, it is another one."""
    asked = tables.get("for_all", {})
    if tables["controller"]["kind"] != "dc-slow" or tables["device"]["velocity"] != "exact" or "tick" in asked:
        return tables
    tables["rates"]["fast_hz"] *= 2
    if "ratio" in tables["rates"]:
        tables["rates"]["ratio"] *= 2
    for table in ("device", "environment"):
        delay = tables[table].get("delay", "frame")
        if delay != "frame":
            tables[table]["delay"] = 2 * delay
    for name in ("rates.ratio", "environment.delay"):
        if name in asked:
            given = asked[name]
            values = given.get("values") or range(given.pop("start"), given.pop("stop") + 1)
            given["values"] = [2 * value for value in values]
    return tables


def number_in_a_list(tables: dict, draw: Draw) -> dict:
    """A number as the only value of a list, or as a range whose ends are the same."""
    value = _constant(tables)
    if value is not None:
        name, number = value
        given = {"values": [number]} if draw.chance(0.5) else {"start": number, "stop": number}
        tables.setdefault("for_all", {})[name] = given
    return tables


def _constant(tables):
    """A number that [for_all] does not have, with its value; in a drawing a new one, which the mass reads."""
    asked = tables.get("for_all", {})
    if "tick" in asked:
        return None
    if "controller" in tables:
        return None if "device.damping" in asked else ("device.damping", tables["device"]["damping"])
    mass = tables["block"]["x"]
    damping = mass["damping"]
    tables["numbers"]["listed"] = damping
    mass["damping"] = "listed"
    return "listed", damping


def ranges_listed(tables: dict, draw: Draw) -> dict:
    """A range of a whole number as its values, in any order."""
    for name, given in tables.get("for_all", {}).items():
        if name in ("rates.ratio", "environment.delay", "n") and "start" in given:
            values = list(range(given.pop("start"), given.pop("stop") + 1))
            draw.random.shuffle(values)
            given["values"] = values
    return tables


def mass_as_inertia(tables: dict, draw: Draw) -> dict:
    del draw
    for keys in tables.get("block", {}).values():
        if keys["type"] == "mass":
            keys["type"] = "inertia"
            keys["inertia"] = keys.pop("mass")
    return tables


def holds_as_channels(tables: dict, draw: Draw) -> dict:
    """A hold as a channel whose messages are all in time."""
    for keys in tables.get("block", {}).values():
        if keys["type"] == "hold":
            keys["type"] = "channel"
            if draw.chance(0.5):
                keys |= {"lost": 0, "late": 0}
    return tables


def ratio_as_rate(tables: dict, draw: Draw) -> dict:
    """The ticks of a frame as the rate of the slow environment."""
    del draw
    rates = tables["rates"]
    exact = "ratio" in rates and 1000 % rates["ratio"] == 0 and rates["fast_hz"] == 1000
    if exact and "rates.ratio" not in tables.get("for_all", {}):
        rates["slow_hz"] = 1000 // rates.pop("ratio")
    return tables


def ticks_as_seconds(tables: dict, draw: Draw) -> dict:
    """Whole ticks of the amplifier's delay as its dead time; beside late ticks that is refused."""
    del draw
    device = tables.get("device", {})
    asked = tables.get("for_all", {})
    if device.get("delay") and "tick" not in asked and "device.dead_time" not in asked:
        device["dead_time"] = round(device.get("dead_time", 0.0) + device.pop("delay") / tables["rates"]["fast_hz"], 9)
    return tables


WAYS = (
    steps_as_seconds, tick_halved, number_in_a_list, ranges_listed, mass_as_inertia, holds_as_channels, ratio_as_rate,
    ticks_as_seconds,
)  # fmt: skip


def judge_rewritten_set(number: int) -> list[Found]:
    """The rows and the verdict of a set, and those of the same in other words."""
    draw = Draw([12, number])
    tables = set_of(number)
    changed = deepcopy(tables)
    applied = []
    for way in WAYS:
        before = toml(changed)
        if draw.chance(0.6):
            changed = way(changed, draw)
        if toml(changed) != before:
            applied.append(way.__name__)
    mine, theirs = answers(tables), answers(changed)
    if isinstance(mine, str) or isinstance(theirs, str):
        return [Found("refused", isinstance(mine, str) == isinstance(theirs, str), mine, (applied, theirs))]
    rows, verdict, poles = mine
    others, other_verdict, other_poles = theirs
    found = [
        Found("verdict", {verdict, other_verdict} != {"proved", "refuted"}, verdict, (applied, other_verdict)),
        Found(
            "poles",
            poles.shape == other_poles.shape and np.allclose(poles, other_poles, rtol=SAME, atol=1e-9),
            poles,
            other_poles,
        ),
    ]
    for kind in sorted({row["guarantee"] for row in rows if row["guarantee"] != "spec"}):
        of_kind = [[row for row in each if row["guarantee"] == kind] for each in (rows, others)]
        pair = [[row for row in each if row["intervals"]] for each in of_kind]
        what = f"rows {kind}"
        if len(pair[0]) != len(pair[1]):
            ruled_out = [any(row["certified"] and not row["intervals"] for row in each) for each in of_kind]
            same = not ((pair[0] and ruled_out[1]) or (pair[1] and ruled_out[0]))
            found.append(Found(f"{what} of one alone", same, len(pair[0]), (applied, len(pair[1]))))
            continue
        for one, other in zip(*pair, strict=True):
            found.append(Found(what, agree(one, other) and agree(other, one), _shown(one), (applied, _shown(other))))
    return found


def agree(one: dict, other: dict) -> bool:
    """Whether what is proved of one is not refuted of the other, and what is settled of both is the same."""
    if one["high"] > other["fails_from"] * (1 + SAME) or one["low"] < other["fails_below"] * (1 - SAME):
        return False
    if one["settled"] and other["settled"]:
        return bool(abs(one["high"] - other["high"]) <= SETTLED * abs(one["high"]))
    return True


def _shown(row):
    return tuple(row[name] for name in ("low", "high", "fails_below", "fails_from", "settled", "counterexample"))


def answers(tables: dict):
    """(rows, verdict, poles' sizes) of a spec, or why it is refused."""
    import wavesweep
    from wavesweep.engine.errors import SpecError, UsageError
    from wavesweep.late_ticks.rows import claim as claim_of_ticks
    from wavesweep.program.spec import load

    try:
        rows = wavesweep.stability_region(tables).to_dict("records")
        spec = load(tables)
        verdict = str(claim_of_ticks(spec).status) if spec.tick else str(spec.for_all and spec.for_all.verdict(spec))
    except (SpecError, UsageError) as error:
        return str(error)
    poles = wavesweep.compile(tables).poles()
    sizes = np.sort(np.hypot(poles["z_re"], poles["z_im"]).to_numpy())
    return rows, next((word for word in ("not stable", "proved") if word in verdict), "unknown"), sizes[sizes > 1e-2]
