"""The wave channel: what lies between the ends of waves, filters, samplers, holds and delays, without what moves a mass.

An end sends a wave and receives one in each instant in which it runs. What the others make of received waves, as positions, is
left at 0. The energy of a wave counts with the time between the runs of its end, which is a frame over their number.
"""

from dataclasses import replace
from typing import Any

from .balls import Refused
from .drifts import needed
from .reader.controllers import Controller
from .reader.loops import INPUT, OUTPUT, Instant, Schedule

SENT, RECEIVED = (
    "waves sent",
    "waves received",
)  # from and to of its gain, which are no names of a spec
ENDS = {"wave", "avatar", "local_model"}  # types of blocks
OUTSIDE = {"mass", "inertia", "mass_matrix"}


def between_ends(loop: Any, schedule: Schedule) -> Schedule:
    """The schedule of the channel alone, with memory for each wave that is sent and received."""
    ends = _ends_of(loop)
    blocks = {} if isinstance(loop, Controller) else loop.blocks
    if any(blocks[name]["type"] not in OUTSIDE for name in getattr(loop, "plants", ())):
        raise Refused("a wave channel beside plants other than masses has no proof here")
    kinds: dict[object, Instant] = {}
    times = []
    for place, (time, kind) in enumerate(schedule.times):
        instant = schedule.kinds[kind]
        equations = dict(instant.equations)
        writes = dict(instant.writes)
        for name in equations:
            owner = loop.owner(name) if blocks else ""
            if blocks and blocks.get(owner, {}).get("type") in ENDS | OUTSIDE and name not in ends:
                equations[name] = {}
        for sent, received in ends.items():
            if equations.get(sent, {f"@held {sent}": 1}) != {f"@held {sent}": 1}:
                equations[sent] = {f"{INPUT}{place} {sent}": 1}
                between = sent == "new w" and "u_s" not in equations  # ticks
                writes[f"{OUTPUT}{place} {sent}"] = {"@read u_s": 1} if between else received
        kinds[place] = Instant(equations, writes)
        times.append((time, place))
    opened = replace(schedule, kinds=kinds, times=times)
    outputs = {
        name for instant in kinds.values() for name in instant.writes if name.startswith(OUTPUT)
    }
    wanted = needed([opened], outputs)
    kinds = {place: _part(instant, wanted) for place, instant in kinds.items()}
    return replace(opened, kinds=kinds, motion=_part(opened.motion, wanted))


def _ends_of(loop: Any) -> dict[str, dict]:
    """What is sent by each end, and the form of what it receives."""
    if not isinstance(loop, Controller):
        found = {name for name, block in loop.blocks.items() if block["type"] in ENDS}
        ends = {f"{name}.out": loop.into(name, "in") for name in sorted(found)}
    elif loop.kind.startswith("pmw"):
        ends = {"u_m": {"held w": 1}, "new w": {"u_s": 1}}
        if loop.kind == "pmw-lm":
            ends["u_m"]["@v_2" if loop.local_delay else "lp2 out"] = 1
            ends["v_l"] = {"u_l": 1}
    else:
        ends = {}
    if not ends:
        raise Refused("the loop has no wave channel")
    return ends


def _part(instant: Instant, wanted: set[str]) -> Instant:
    equations, writes = (
        {name: row for name, row in rows.items() if name in wanted}
        for rows in (instant.equations, instant.writes)
    )
    return Instant(equations, writes)
