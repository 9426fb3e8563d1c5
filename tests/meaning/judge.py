"""Holds what the package says of a spec against a march of the interpreter's reading of it."""

import tomllib
from functools import partial
from pathlib import Path

import numpy as np
from meaning.machine import radius
from meaning.reading import drift_of, machine_of, radius_of, with_numbers
from meaning.required import Found, judge_required

SMALL = 0.02  # of a radius: eigenvalues next to 0 are the roots of rounding
NEAR = 1e-6  # of an end: stable so near inside, unstable so near outside


def compiled(text: str, folder):
    """The package's own reading of the same text, from a file."""
    import wavesweep

    path = Path(folder) / "spec.toml"
    path.write_text(text)
    return wavesweep.compile(path)


def close(mine, theirs, relative: float, absolute: float) -> bool:
    return bool(np.all(np.abs(np.subtract(mine, theirs)) <= absolute + relative * np.abs(mine)))


def judge(text: str, loop, ticks: int = 60, *, whole: bool = True, required: bool = True) -> list[Found]:
    """All comparisons of one spec, of which `loop` is the package's reading.

    `whole`: with ends and responses, and if `required` those of a random requirement.
    """
    tables = tomllib.loads(text)
    machine = machine_of(tables)
    monodromy = machine.monodromy()
    drift = drift_of(tables, monodromy)
    mine = radius(monodromy, drift)
    found = [judge_radius(tables, mine, loop)]
    if whole:
        along = tables["sweep"]["along"]
        inside = 0.37 * tables["sweep"][along]["stop"]
        drift_inside = drift_of(with_numbers(tables, {along: inside}))  # there may be more of it at 0
        found += judge_intervals(tables, drift_inside, loop)
        if required:
            found += judge_required(text, loop)
    hand = hand_of(tables)
    found += judge_simulation(tables, machine, loop, hand, ticks)
    if whole and mine < 1:
        found += judge_response(machine, loop, hand)
    return found


def judge_radius(tables, mine, loop) -> Found:
    """Of a frame, after which all rates are in step again; of `dc`, in which nothing runs slowly, of T_s."""
    theirs = float(loop.spectral_radius())
    if tables.get("controller", {}).get("kind") == "dc":
        rates = tables.get("rates", {})
        ratio = rates.get("ratio", 20)
        if "slow_hz" in rates:
            ratio = rates.get("fast_hz", 1000.0) / rates["slow_hz"]
        mine = mine**ratio
    if np.isnan(theirs) or mine < SMALL:
        return Found("radius unknown", True, mine, theirs)
    return Found("radius", close(mine, theirs, 1e-7, 1e-8), mine, theirs)


def judge_intervals(tables, drift, loop) -> list[Found]:
    """Stable just inside each end and unstable just outside; and at values in between as the rows say."""
    along = tables["sweep"]["along"]
    span = (tables["sweep"][along]["start"], tables["sweep"][along]["stop"])
    rows = loop.stable_intervals(along=along, span=span)
    at = partial(_radius_at, tables, drift, along)
    if (rows["doubt"] != "").any():
        return [Found("in doubt", True, None, list(rows["doubt"]))]
    found = []
    kept = rows[rows["intervals"] > 0]
    ends = [(float(row.low), float(row.high)) for row in kept.itertuples()]
    for low, high in ends:
        if low > span[0]:
            found += _end(at, "low", low, -1, high - low)
        if high < span[1]:
            found += _end(at, "high", high, 1, high - low)
    random = np.random.default_rng(7)
    for value in random.uniform(0, 1, 2) ** 2 * (span[1] - span[0]) + span[0]:
        stable = any(low < value < high for low, high in ends)
        near = any(abs(value - end) < 1e-5 * abs(end) for pair in ends for end in pair)
        found.append(_label(at(value), stable, near, value, ends))
    return found


def _radius_at(tables, drift, along, value):
    return radius_of(with_numbers(tables, {along: float(value)}), drift)


def _end(at, side, end, outwards, width):
    step = min(NEAR * abs(end), width / 3)
    inside = at(end - outwards * step)
    outside = at(end + outwards * step)
    if abs(inside - 1) < 1e-11 or abs(outside - 1) < 1e-11:
        return [Found("end too flat", True, (inside, outside), end)]
    return [Found(f"{side} end", inside < 1 < outside, (inside, outside), end)]


def _label(mine, stable, near, value, ends):
    if near or abs(mine - 1) < 1e-9:
        return Found("label too near", True, mine, value)
    return Found("label", (mine < 1) == stable, (value, mine), ends)


def hand_of(tables) -> tuple[str, str, str | None]:
    """(input, position, reaction) of the hand, as the interpreter calls them."""
    if "controller" in tables:
        return "hand", "x", "f_m"
    hand = tables["ports"]["hand"]
    force = hand["force"]
    push = force if isinstance(force, str) else force[0]
    return push, "hand displacement", "hand reaction" if "reaction" in hand else None


def judge_simulation(tables, machine, loop, hand, ticks) -> list[Found]:
    """The same push in both: position, speed and force in each tick."""
    push, position, _ = hand
    force = np.random.default_rng(3).normal(size=ticks)
    effects = {"friction": 0.0, "resolution": 0.0, "max_force": None} if push == "hand" else {}  # of presets
    run = loop.simulate(force, **effects)
    columns = {"x": position}
    if push == "hand":
        columns |= {"v": "v", "v_hat": "v_hat", "f_m": "f_m"}
    for name in tables.get("ports", {}).get("outputs", {}):
        columns[name] = f"output {name}"
    mine = machine.run(force[: len(run)], push, list(columns.values()))
    found = []
    for column, name in columns.items():
        theirs = run[column].to_numpy()
        size = np.abs(theirs).max()
        found.append(Found(f"simulate {column}", close(mine[name], theirs, 1e-9, 1e-9 * size), mine[name], theirs))
    return found


def judge_response(machine, loop, hand) -> list[Found]:
    """At rest and at a frequency: what the hand moves, and the force that it meets."""
    push, position, reaction = hand
    rate = len(machine.schedule.ticks) / float(machine.schedule.period)
    hertz = [0.0, round(0.0137 * rate, 3)]
    table = loop.response(hertz)
    found = []
    names = [position, reaction] if reaction else [position]
    answers = [machine.response(frequency, push, names) for frequency in hertz]
    moved = abs(answers[1][position])
    for at, frequency in enumerate(hertz):
        mine = answers[at]
        row = table.iloc[at]
        if row["doubt"]:
            continue
        pairs = [("admittance", mine[position])]
        if reaction:
            pairs.append(("impedance", mine[reaction] / mine[position]))
        for name, value in pairs:
            theirs = complex(row[f"{name}_re"], row[f"{name}_im"])
            what = f"{name} at {frequency} Hz"
            grows = abs(value.imag) > 1e3 * abs(value.real) and abs(value) > moved
            if name == "admittance" and not frequency and grows:  # nothing holds it
                found.append(Found(what, bool(np.isnan(theirs)), value, theirs))
                continue
            if not frequency and abs(value.imag) > 1e-4 * moved:  # far below any mode it would be real
                found.append(Found("too slow to come to rest", True, value, theirs))
                continue
            least = 1e-5 * moved if name == "admittance" else 0.0  # what is 0 at rest, before an integrator
            found.append(Found(what, close(value if frequency else value.real, theirs, 1e-6, least), value, theirs))
    return found
