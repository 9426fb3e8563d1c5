"""Ages of numbers, against a march that gives each measurement its time as a stamp, and hands stamps on tick by tick."""

import os
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from math import ceil, floor

import numpy as np
import pytest

from wavesweep.picture.moments import moments
from wavesweep.program.spec import load

TICK_HZ = 1024  # dead times in quarters of a tick are then doubles without rounding
NEVER = -(10**9)
# What a block of each type reads in a run, by the runs since: the tests' own table.
LAGS = {"gain": 0, "hold": 0, "lowpass": 0, "difference": 0, "implicit": 0, "explicit": 1, "proper": 2}


@dataclass
class Number:
    """What a block gave: the newest measurement in it, and by block the newest run that has gone into it."""

    measured: Fraction = Fraction(NEVER)
    runs: dict = field(default_factory=dict)

    def with_(self, other):
        runs = {name: max(self.runs.get(name, NEVER), other.runs.get(name, NEVER)) for name in {*self.runs, *other.runs}}
        return Number(max(self.measured, other.measured), runs)


def drawn(seed):
    """A random loop of blocks of several rates about a mass, as tables of a spec, and the same as a list for the march."""
    random = np.random.default_rng(seed)
    rates = random.choice([1, 2, 3, 4, 5, 6, 8], size=3).tolist()
    blocks, wires, parts, signals = {"mass": {"type": "mass", "mass": 1.0}}, {}, [], ["mass.x"]
    for number in range(int(random.integers(2, 9))):
        kind = str(random.choice([*LAGS, "delay", "dead", "channel"]))
        if kind == "channel" and any(part["kind"] == "channel" for part in parts):
            kind = "hold"  # two of them lose their worst together at some time only
        every = int(random.choice(rates))
        runs = {"every": every, "phase": int(random.integers(every))}
        steps = int(random.integers(1, 4))
        part = {"name": f"b{number}", "kind": kind, **runs, "lag": LAGS.get(kind, 0)}
        if kind == "delay":
            part["lag"] = steps
            keys = {"type": "delay", "steps": steps}
        elif kind == "dead":
            part |= {"every": 1, "phase": 0, "dead": Fraction(int(random.integers(1, 14)), 4)}
            runs, keys = {}, {"type": "delay", "seconds": float(part["dead"]) / TICK_HZ}
        elif kind == "channel":
            part |= {"late": int(random.integers(every)), "lost": int(random.integers(3))}
            keys = {"type": "channel", "late": part["late"], "lost": part["lost"]}
        elif kind in ("implicit", "explicit"):
            keys = {"type": "integrator", "method": kind}
        elif kind == "proper":  # u goes into the first of two states, and y is the second
            keys = {"type": "ss", "A": [[0.5, 0], [1, 0.5]], "B": [[1], [0]], "C": [[0, 1]], "discrete": True}
        else:
            keys = {"type": kind, **({"a": 0.5} if kind == "lowpass" else {})}
        reads = random.choice(signals, size=min(len(signals), int(random.integers(1, 3))), replace=False).tolist()
        if kind == "dead":  # which reads plants between two ticks, and others at ticks
            reads = reads[:1]
        blocks[part["name"]] = keys | runs
        wires[f"{part['name']}.u"] = " + ".join(f"0.5*{signal}" for signal in reads)
        parts.append(part | {"reads": reads})
        signals.append(f"{part['name']}.y")
    force = [*random.choice(signals, size=min(len(signals), 2), replace=False).tolist(), signals[-1]]
    wires["mass.f"] = " + ".join(f"0.1*{signal}" for signal in dict.fromkeys(force)) + " + push"
    ports = {"inputs": {"push": {"signal": "push", "unit": "N"}}, "outputs": {"x": {"signal": "mass.x", "unit": "m"}}}
    return {"rates": {"tick_hz": TICK_HZ}, "block": blocks, "wire": wires, "ports": ports}, parts, list(dict.fromkeys(force))


def march(parts, force, ticks, first=0):
    """The age (ticks) of the oldest number that acts, just before another takes its place, over the last half of a march.

    All messages are late by all their ticks, and as many as may be are lost between two, from a first one on that comes.
    """
    given = {part["name"]: [] for part in parts}  # (tick from which it is there, number), as the block gave them
    read = {part["name"]: [] for part in parts}  # what each run read
    made = {}  # (block, tick of the run) -> newest measurement

    def value(signal, time):
        if signal == "mass.x":
            return Number(Fraction(time))
        name = signal.removesuffix(".y")
        part = next(part for part in parts if part["name"] == name)
        if "dead" in part:
            before = time - part["dead"]
            source = part["reads"][0]
            # At a tick another block sees what a signal that is held was at the tick before the dead time began.
            found = value(source, before if source == "mass.x" else Fraction(floor(before)))
            made[name, time] = found.measured
            return found.with_(Number(runs={name: time}))
        return next((number for there, number in reversed(given[name]) if there <= time), Number())

    ages = []
    for tick in range(ticks):
        for part in parts:
            name = part["name"]
            if "dead" in part or tick % part["every"] != part["phase"]:
                continue
            found = Number()
            for signal in part["reads"]:
                found = found.with_(value(signal, Fraction(tick)))
            read[name].append(found)
            count = len(read[name])
            number = read[name][count - 1 - part["lag"]] if count > part["lag"] else Number()
            made[name, tick] = number.measured
            number = Number(number.measured, {**number.runs, name: tick})
            if part["kind"] != "channel":
                given[name].append((tick, number))
            elif (count - first) % (part["lost"] + 1) == 0:
                given[name].append((tick + part["late"], number))
        if tick < ticks // 2:
            continue
        times = {Fraction(tick)}
        for signal in force:  # what a dead time was given at a tick arrives at the mass between two
            part = next((part for part in parts if f"{part['name']}.y" == signal), {})
            if "dead" in part and part["reads"] != ["mass.x"]:
                times.add(tick + part["dead"] - floor(part["dead"]))
        starts = sorted(times)
        for start, end in zip(starts, [*starts[1:], Fraction(tick + 1)], strict=True):
            acts = Number()
            for signal in force:
                part = next((part for part in parts if f"{part['name']}.y" == signal), {})
                if "dead" in part and part["reads"] != ["mass.x"]:  # as it was the dead time ago
                    number = value(part["reads"][0], Fraction(floor(start - part["dead"])))
                else:
                    number = value(signal, Fraction(tick))
                acts = acts.with_(number)
                if signal == "mass.x":
                    acts = acts.with_(Number(runs={"mass": tick}))
            for name, run in acts.runs.items():
                measured = made.get((name, run), Fraction(run)) if name != "mass" else Fraction(tick)
                if measured > NEVER:
                    ages.append(end - measured)
    return max(ages, default=None)


SEEDS = int(os.environ.get("WAVESWEEP_AGES", "12"))


@pytest.mark.parametrize("seed", range(SEEDS))
def test_the_oldest_number_is_that_of_a_march_with_stamps(seed):
    tables, parts, force = drawn(seed)
    found = moments(load(tables))[-1]
    losses = max(part.get("lost", 0) for part in parts)
    oldest = max(march(parts, force, 480, first) or 0 for first in range(losses + 1))
    if not oldest:
        assert found.age is None
    else:
        assert found.age == pytest.approx(float(oldest), abs=1e-9)


def oldest_of(frames, delays, lost, explicit):
    """The oldest age (ticks) in a force of one result a frame, in the last half of frames of such lengths.

    delays: of each result, its own length for "frame". lost: whether each never comes. explicit: whether a result is made of
    the sample of the frame before.
    """
    samples = [0]
    for length in frames:
        samples.append(samples[-1] + length)
    there = []
    for number in range(len(frames) // 2, len(frames) - 3):
        if not lost[number]:
            there.append((samples[number] + delays[number], samples[number - explicit]))
    return max(after - sample for (_, sample), (after, _) in pairwise(there))


@pytest.mark.parametrize("kind", ["dc-slow", "dc-lm", "dc-vc", "pmw"])
@pytest.mark.parametrize("delay", ["frame", 1, 7])
def test_no_order_of_frames_makes_a_number_older_than_the_longest_ones(kind, delay):
    lengths, most_lost = [9, 16, 23], 2
    wall = {"integration": "explicit", "delay": delay}
    ranges = {"rates.ratio": {"values": lengths, "varying": True}, "lost": most_lost}
    spec = load({"controller": {"kind": kind}, "environment": wall, "rates": {"ratio": 16}, "for_all": ranges})
    shortest, longest = moments(spec)
    explicit = kind in ("dc-vc", "pmw")  # whose avatar moves from where it was a frame ago

    def oldest(frames, lost):
        delays = frames if delay == "frame" else [delay] * len(frames)
        return oldest_of(frames, delays, lost, explicit)

    assert shortest.age == oldest([9] * 40, [False] * 40)
    assert longest.age == oldest([23] * 60, [bool(number % 3) for number in range(60)])
    random = np.random.default_rng(0)
    for _ in range(200):
        frames = random.choice(lengths, size=40).tolist()
        lost = []
        for _ in frames:
            lost.append(bool(random.random() < 0.7) and lost[-most_lost:] != [True] * most_lost)
        assert oldest(frames, lost) <= longest.age


@pytest.mark.parametrize(("slow_hz", "delay"), [(60.0, "frame"), (60.0, 5), (72.0, "frame"), (400.0, 1)])
def test_rates_that_do_not_divide_have_the_ages_of_their_own_instants(slow_hz, delay):
    spec = load({"controller": {"kind": "dc-slow"}, "environment": {"delay": delay}, "rates": {"slow_hz": slow_hz}})
    frame = Fraction(1000) / Fraction(slow_hz)
    waits = frame if delay == "frame" else delay
    ages = []
    for number in range(frame.denominator):
        replaced = ceil((number + 1) * frame + waits)
        ages.append(replaced - floor(number * frame))
    found = moments(spec)
    assert found[-1].age == max(ages)
    assert min(life.oldest for life in found[-1].main.lives) == min(ages)


@pytest.mark.asks("late_ticks")
def test_an_age_is_that_of_ticks_that_are_as_late_as_they_may_be():
    """A result a tick late, held for a frame of 20 ticks: 21 ticks of 1.2 ms."""
    spec = {"environment": {"delay": 1}, "controller": {"kind": "dc-slow"}, "for_all": {"tick": {"late": 0.0002}}}
    (frames,) = moments(load(spec))
    assert frames.age * frames.tick_s == pytest.approx(21 * 1.2e-3)


@pytest.mark.parametrize(("every", "late"), [(1, 0), (1, 2), (2, 1), (3, 3), (4, 7), (5, 9)])
def test_a_message_without_a_next_one_is_there_up_to_a_run_of_its_channel_that_shows_zero(every, late):
    """A message of tick 0 that arrives in tick d is replaced by zero, or by another, in the first run after d."""
    channel = {"type": "channel", "every": every, "late": late, "lost": 1, "missing": "zero"}
    blocks = {"m": {"type": "mass", "mass": 1.0}, "net": channel}
    tables = {"rates": {"tick_hz": 1000}, "block": blocks, "wire": {"net.u": "-m.x", "m.f": "net.y"}}
    ends = [min(tick for tick in range(0, 100, every) if tick > arrives) for arrives in range(late + 1)]
    assert moments(load(tables))[-1].age == max(ends)


@pytest.mark.parametrize(
    ("for_all", "which"),
    [
        ({"environment.delay": {"values": [1, 10], "varying": True}}, "earliest results"),
        ({"rates.ratio": {"values": [16, 33], "varying": True}}, "shortest frames"),
        ({"lost": 1}, "all results in time"),
        ({"rates.ratio": {"values": [16, 33], "varying": True}, "lost": 1}, "freshest number"),
    ],
)
def test_the_freshest_age_is_said_of_what_varies(for_all, which):
    first, _ = moments(load({"controller": {"kind": "dc-slow"}, "environment": {"delay": 1}, "for_all": for_all}))
    assert first.which == which
