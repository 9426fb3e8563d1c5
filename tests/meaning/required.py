"""Random requirements of `[sweep] require`, and whether the rows of the package keep what a march says of them."""

import ast
import math
import tomllib
import zlib
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from meaning import responses
from meaning.machine import radius
from meaning.modes import beyond, of_modes, period_of
from meaning.reading import drift_of, machine_of, radius_of, with_numbers
from meaning.specs import toml

from wavesweep.checker.reader.drawings import PLANTS
from wavesweep.checker.reader.expressions import names_in

KEYS = {  # of `[sweep] require`, which this reads
    "radius", "settling", "time_constant", "damping_ratio", "modes", "slower_than", "bounded",
    *(f"gain.{key}" for key in ("from", "to", "at_most", "band_hz")),
    *(f"margins.{key}" for key in ("cut", "Ms", "disk", "gain", "phase_deg")),
    *(f"{kind}.{key}" for kind in ("peak", "overshoot", "step_settling", "rms") for key in ("from", "to", "at_most")),
    "step_settling.within",
}  # fmt: skip
NEAR = 1e-5  # of an end, as far inside and outside of which a requirement is looked at
AT_LOW_END = 1e-6  # of a range, within which an interval begins at its low end
UNTOLD = 1e-8  # by how much less than this is missed or kept, it is not told
FRAME = 60  # ticks in which responses are looked at; those of factors and of sines take more
SHORT_FRAME = 6
GROWS = 1e-6  # of a radius: equal modes on the circle are known to the root of rounding
SETTLED = 0.02  # of a final value


@dataclass
class Found:
    """A comparison: what was compared, both values, and whether they are the same."""

    what: str
    same: bool
    mine: object
    theirs: object


@dataclass
class Case:
    """A spec, the number along which its intervals are, what is required, and how many of its modes drift."""

    tables: dict
    along: str
    span: tuple[float, float]
    drift: int
    wanted: dict

    def misses(self, value: float) -> float | None:
        """By how much the worst misses what is wanted, below 0 if none does; None if it cannot be told."""
        changed = with_numbers(self.tables, {self.along: float(value)})
        machine = machine_of(changed)
        over = radius(machine.monodromy(), self.drift) - 1
        if over >= 0:
            return over
        found = [over]
        asked = {kind: table for kind, table in self.wanted.items() if not isinstance(table, dict)}
        if asked:
            found.append(beyond(machine, self.drift, period_of(changed, machine), asked))
        for kind, table in self.wanted.items():
            if kind == "margins":
                lifted = at_cut(changed, table["cut"])
                (margin,) = set(table) - {"cut"}
                share = responses.margin_used(margin, table[margin], lifted, self.drift)
                found.append(None if share is None else share - 1)
            elif isinstance(table, dict):
                found.append(missed_by(machine, kind, table))
        if None in found:
            known = max(one for one in found if one is not None)
            return known if known > 0 else None
        return max(found)


def at_cut(tables: dict, cut: str):
    """A, B, C, D from the input at a cut to what is read there, in the ticks in which its block runs."""
    machine = machine_of(tables, cut)
    block = tables["block"][cut.rpartition(".")[0]]
    every = block.get("every", 1)
    runs = [tick for tick in range(len(machine.schedule.ticks)) if (tick - block.get("phase", 0)) % every == 0]
    A, B, C, D = machine.lifted("cut", ["cut"])
    return A, B[:, runs], C[runs], D[np.ix_(runs, runs)]


def lifted_of(machine, table: dict):
    """A, B, C, D from an input of the package to an output of it."""
    source = {"f_h": "hand", "command": "ref"}.get(table["from"], table["from"])
    output = f"output {table['to']}"
    return machine.lifted(source, [output if output in machine.schedule.shown else table["to"]])


def value_of(machine, kind: str, table: dict) -> float | None:
    """The value that is to be at most `at_most`; of a settling time in ticks."""
    lifted = lifted_of(machine, table)
    if kind == "gain":
        return responses.gain(lifted, float(machine.schedule.period), table)
    if kind == "peak":
        return responses.of_sines(lifted)
    pulses = responses.samples(lifted)
    if pulses is None:
        return None
    if kind != "step_settling":
        return responses.IN_TIME[kind](pulses)
    away = responses.away(pulses)
    return None if away is None else float(np.count_nonzero(away > table.get("within", SETTLED)))


def missed_by(machine, kind: str, table: dict) -> float | None:
    """By what share of the level a value is above it; of a settling time how much of 2 % is left after it."""
    if kind != "step_settling":
        value = value_of(machine, kind, table)
        return None if value is None else value / table["at_most"] - 1
    pulses = responses.samples(lifted_of(machine, table))
    away = None if pulses is None else responses.away(pulses)
    if away is None:
        return None
    tick = float(machine.schedule.period) / len(machine.schedule.ticks)
    first = math.floor(table["at_most"] / tick)  # the last tick by which it may be there to stay
    return float(away[first] if first < len(away) else 0.0) / table.get("within", SETTLED) - 1


def case_of(text: str) -> Case | None:
    """A random requirement of a spec, of which some values of the number have it, or None."""
    random = np.random.default_rng(zlib.crc32(text.encode()))
    tables = tomllib.loads(text)
    along = tables["sweep"]["along"]
    span = (tables["sweep"][along]["start"], tables["sweep"][along]["stop"])
    drift = drift_of(with_numbers(tables, {along: 0.37 * span[1]}))
    case = Case(tables, along, span, drift, {})
    values = random.uniform(0, 1, 4) ** 2 * (span[1] - span[0]) + span[0]
    stable = [value for value in values if radius_of(with_numbers(tables, {along: float(value)}), drift) < 1 - 1e-4]
    if not stable:
        return None
    machine = machine_of(with_numbers(tables, {along: float(stable[0])}))
    ticks = len(machine.schedule.ticks)
    kind = random.uniform()
    if kind < 0.25 or ticks > FRAME:
        slowest = min(radius_of(with_numbers(tables, {along: float(value)}), drift) for value in stable)
        case.wanted = of_modes(random, slowest, float(machine.schedule.period), period_of(tables, machine)) or {}
    elif kind < 0.5 and "controller" not in tables:
        case.wanted = of_cut(random, case, stable, ticks)
    else:
        case = with_ports(random, case)
        case.span = (float(f"{0.2 * min(stable):.4g}"), span[1])  # nearer to 0 a loop may take long to come to rest
        for _ in range(2 if random.uniform() < 0.2 else 1):
            case.wanted |= of_response(random, case, stable, ticks)
    return case if case.wanted else None


def with_ports(random, case: Case) -> Case:
    """A drawing also with an input and an output of its own."""
    if "controller" in case.tables or random.uniform() < 0.5:
        return case
    tables = deepcopy(case.tables)
    tables["wire"]["arm.f"] += " + 3*ref"
    own = {"inputs": {"command": "ref"}, "outputs": {"seen": {"signal": "0.5*arm.x + 0.02*arm.v", "unit": "m"}}}
    tables["ports"] |= {name: tables["ports"].get(name, {}) | more for name, more in own.items()}
    return Case(tables, case.along, case.span, case.drift, {})


def judge_required(text: str, loop) -> list[Found]:
    """It holds just inside each end, not just outside, and as the rows say in between."""
    case = case_of(text)
    if case is None:
        return []
    if "inputs" in case.tables.get("ports", {}):
        import wavesweep

        loop = wavesweep.compile(tomllib.loads(toml(case.tables)))
    return judge_case(case, loop)


def misjudged(tables: dict, along: str, span: tuple[float, float], wanted: dict) -> list[Found]:
    """Where rows with a requirement are not what a march says, or in doubt, and ends at which it cannot tell."""
    import wavesweep

    drift = drift_of(with_numbers(tables, {along: span[0] + 0.37 * (span[1] - span[0])}))
    found = judge_case(Case(tables, along, span, drift, wanted), wavesweep.compile(tables))
    return [one for one in found if not one.same or one.what.endswith(("end untold", "in doubt"))]


def judge_case(case: Case, loop) -> list[Found]:
    """The package's rows with what is required, against the march at ends and in between."""
    low, high = case.span
    what = "required " + " and ".join(_kinds(case.wanted))
    rows = loop.stable_intervals(along=case.along, span=case.span, require=case.wanted)
    if (rows["doubt"] != "").any():
        return [Found(f"{what} in doubt", True, case.wanted, list(rows["doubt"]))]
    kept = rows[rows["intervals"] > 0]
    ends = [(float(row.low), float(row.high)) for row in kept.itertuples()]
    found = []
    for first, last in ends:
        step = min(NEAR * max(abs(first), abs(last)), (last - first) / 3)
        places = [(last - step, last + step)] if last < high else [(last - step, None)]
        places.append((first + step, first - step if first > low + AT_LOW_END * (high - low) else None))
        for inside, outside in places:
            pair = (case.misses(inside), 1.0 if outside is None else case.misses(outside))
            if None in pair or min(map(abs, pair)) < UNTOLD:
                found.append(Found(f"{what}, end untold", True, pair, inside))
            else:
                found.append(Found(f"{what}, end", pair[0] < 0 < pair[1], (case.wanted, pair), (inside, outside)))
    random = np.random.default_rng(8)
    for value in random.uniform(0, 1, 4) ** 2 * (high - low) + low:
        misses = case.misses(value)
        near = any(abs(value - end) < 1e-4 * abs(end) for pair in ends for end in pair)
        if misses is None or near or abs(misses) < 1e-7:
            found.append(Found(f"{what}, untold", True, misses, value))
            continue
        holds = any(first < value < last for first, last in ends)
        found.append(Found(what, (misses < 0) == holds, (case.wanted, value, misses), ends))
    return found


def _kinds(wanted: dict):
    for kind, table in wanted.items():
        if kind == "margins":
            yield from (f"{kind}.{margin}" for margin in table if margin != "cut")
        elif kind not in {"modes", "slower_than"}:
            yield kind


def judge_bounded(tables: dict, loop) -> list[Found]:
    """Of a loop that conserves energy: nothing grows just inside each end, and something just outside."""
    along = tables["sweep"]["along"]
    span = (tables["sweep"][along]["start"], tables["sweep"][along]["stop"])

    def grows(value):
        return radius_of(with_numbers(tables, {along: float(value)}), 0) > 1 + GROWS

    rows = loop.stable_intervals(along=along, span=span, require={"bounded": True})
    if (rows["doubt"] != "").any():
        return [Found("bounded in doubt", True, None, list(rows["doubt"]))]
    ends = [(float(row.low), float(row.high)) for row in rows[rows["intervals"] > 0].itertuples()]
    found = [Found("bounded somewhere", bool(ends), None, ends)]
    for low, high in ends:
        step = min(NEAR * high, (high - low) / 3)
        found.append(Found("bounded inside", not grows(low + step) and not grows(high - step), None, (low, high)))
        if high < span[1]:
            found.append(Found("bounded high end", grows(high + step), None, high))
        if low > span[0]:
            found.append(Found("bounded low end", grows(low - step), None, low))
    return found


def of_response(random, case: Case, stable, ticks: int) -> dict:
    """A level between what two values of the number have."""
    last = "peak" if ticks <= SHORT_FRAME else "rms"
    kinds = ["gain", "overshoot", "step_settling", "rms", last]  # a list of another length draws all specs anew
    kind = kinds[int(random.integers(len(kinds)))]
    machines = [machine_of(with_numbers(case.tables, {case.along: float(value)})) for value in stable[:2]]
    ports = case.tables.get("ports", {})
    blocks = case.tables.get("block", {})
    names = list(machines[0].schedule.shown)
    if case.tables.get("controller", {}).get("kind") == "dc":  # nothing of it is slow
        names.remove("F_s")
    sources = ["f_h"]
    if blocks:
        drawn = {name for name, block in blocks.items() if block["type"] not in case.tables.get("type", {})}
        names = [name for name in machines[0].schedule.shown if name.rpartition(".")[0] in drawn and " " not in name]
        sources = [ports["hand"]["force"]]
    if "command" in ports.get("inputs", {}):
        sources.append("command")
        names.append("seen")
    table: dict = {"from": sources[int(random.integers(len(sources)))], "to": names[int(random.integers(len(names)))]}
    if kind == "gain" and random.uniform() < 0.5:
        low, high = sorted(random.uniform(0, 0.5 / float(machines[0].schedule.period), 2))
        table["band_hz"] = [float(f"{low:.3g}"), float(f"{high:.3g}")]
    if kind == "step_settling" and ticks % 2:
        table["within"] = 0.1
    if case.drift and any(responses.drifts(lifted_of(machine, table)) for machine in machines):
        return {}
    seen = [value_of(machine, kind, table) for machine in machines]
    levels = [value for value in seen if value is not None and value > 1e-6]
    if not levels:
        return {}
    level = min(levels) + random.uniform(0.2, 0.8) * (max(levels) - min(levels))
    if max(levels) < min(levels) * 1.01:
        level *= 1.2
    if kind == "step_settling":
        tick = float(machines[0].schedule.period) / ticks
        table["at_most"] = float(f"{(np.floor(level) + 0.5) * tick:.8g}")
    else:
        table["at_most"] = float(f"{level:.4g}")
    return {kind: table}


def of_cut(random, case: Case, stable, ticks: int) -> dict:
    """A margin at an output that some wire reads, of a block that runs in ticks and has no dead time."""
    blocks = case.tables["block"]
    read: set[str] = set()
    for text in case.tables["wire"].values():
        read |= names_in(ast.parse(text.strip(), mode="eval").body)
    cuts = []
    for name in sorted(read):
        block = blocks.get(name.rpartition(".")[0], {"type": "impulse"})
        plant = block["type"] in PLANTS and not block.get("discrete")
        other = block["type"] in {"impulse", *case.tables.get("type", {})} or {"seconds", "taps"} & set(block)
        if not plant and not other:
            cuts.append(name)
    if not cuts:
        return {}
    cut = cuts[int(random.integers(len(cuts)))]
    once = blocks[cut.rpartition(".")[0]].get("every", 1) == ticks
    kinds = ["Ms"] + ["disk"] * once + ["gain", "phase_deg"] * (ticks <= SHORT_FRAME)
    kind = kinds[int(random.integers(len(kinds)))]
    size = 0.5 if kind == "disk" else 0.0
    peaks = []
    for value in stable[:2]:
        lifted = at_cut(with_numbers(case.tables, {case.along: float(value)}), cut)
        found = responses.sensitivity(lifted, size)
        if found is None or (case.drift and responses.drifts(lifted)):
            return {}
        peaks.append(found)
    if kind == "gain":
        return {"margins": {"cut": cut, kind: float(f"{random.uniform(1.1, 3):.3g}")}}
    if kind == "phase_deg":
        return {"margins": {"cut": cut, kind: float(f"{random.uniform(3, 60):.3g}")}}
    level = min(peaks) + random.uniform(0.2, 0.8) * (max(peaks) - min(peaks))
    if max(peaks) < min(peaks) * 1.01:
        level *= 1.2
    level = 1 / level if kind == "disk" else level
    low, high = (1e-6, 1.999) if kind == "disk" else (1.001, 1e6)
    return {"margins": {"cut": cut, kind: float(f"{level:.4g}")}} if low < level < high else {}
