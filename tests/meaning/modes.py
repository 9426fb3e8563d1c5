"""Whether the modes of a loop are where `[sweep] require` wants them, by the eigenvectors of a march."""

import math

import numpy as np
from meaning.machine import Machine

TENTH = 0.1  # of a mode that is left after T_s, or after a tick of a drawn loop, from which on it needs a damping ratio
LINES_HIDDEN = 1e-6  # of a mode that is left when all rates are in step again, below which it has every damping ratio
CLEAR = 1.02  # how far from such a limit a mode is known to be on one side of it
LEAD = 0.02  # of the energy, by which the strongest line of a spectrum is known to be that


def period_of(tables: dict, machine: Machine) -> float:
    """The time after which a radius is asked: T_s of a controller, a tick of a drawn loop."""
    tick = float(machine.schedule.period) / len(machine.schedule.ticks)
    if "controller" not in tables:
        return tick
    rates = tables.get("rates", {})
    if "slow_hz" in rates:
        return 1 / rates["slow_hz"]
    return rates.get("ratio", 20) * tick


def of_modes(random, radius: float, period: float, unit: float) -> dict | None:
    """A random requirement that a loop of this radius and period may have, or none.

    unit: see `period_of`.
    """
    if not 1e-3 < radius < 1 - 1e-6:
        return None
    rate = -math.log(radius) / period * random.uniform(0.4, 0.95)
    kind = ("radius", "settling", "time_constant", "damping_ratio")[int(random.integers(4))]
    if kind == "radius":
        return {kind: float(f"{math.exp(-rate * unit):.5g}")}
    if kind == "settling":
        return {kind: float(f"{math.log(50) / rate:.5g}")}
    if kind == "time_constant":
        return {kind: float(f"{1 / rate:.5g}")}
    wanted: dict[str, object] = {kind: float(f"{random.uniform(0.02, 0.6):.3g}")}
    if random.uniform() < 0.3:
        wanted["modes"] = "oscillating"
    if random.uniform() < 0.3:
        wanted["slower_than"] = float(f"{random.uniform(0.1, 2.0) / rate:.3g}")
    return wanted


def beyond(machine: Machine, drift: int, unit: float, wanted: dict) -> float | None:
    """By how much the worst mode misses what is wanted, below 0 if none does; None if it cannot be told.

    unit: see `period_of`.
    """
    z, vectors = np.linalg.eig(machine.monodromy())
    rest = np.argsort(abs(z - 1))[drift:]
    z = z[rest]
    vectors = vectors[:, rest]
    period = float(machine.schedule.period)
    with np.errstate(divide="ignore"):
        decay = np.log(abs(z)) / period  # 1/s
    if "radius" in wanted:
        return float(max(decay, default=-np.inf) - math.log(wanted["radius"]) / unit) * period
    if "settling" in wanted:
        return float(max(decay, default=-np.inf) + math.log(50) / wanted["settling"]) * period
    if "time_constant" in wanted:
        return float(max(decay, default=-np.inf) + 1 / wanted["time_constant"]) * period
    worst = float(max(decay, default=-np.inf)) * period
    for at in range(len(z)):
        needs = _needs_a_ratio(z[at], decay[at], unit, period, wanted)
        if needs is None:
            return None if worst < 0 else worst
        if not needs:
            continue
        line = _strongest_line(machine, z[at], vectors[:, at])
        if line is None:
            return None if worst < 0 else worst
        ratio = -decay[at] / math.hypot(decay[at], line)
        worst = max(worst, wanted["damping_ratio"] - ratio)
    return worst


def _needs_a_ratio(z, decay, unit, period, wanted) -> bool | None:
    """Whether a mode needs the damping ratio; None if it is next to a limit."""
    limits = [math.log(TENTH) / unit, math.log(LINES_HIDDEN) / period]
    if "slower_than" in wanted:
        limits.append(-1 / wanted["slower_than"])
    highest = max(limits)
    if decay < highest * CLEAR:
        return False
    if decay < highest / CLEAR:
        return None
    return not (wanted.get("modes") == "oscillating" and abs(z.imag) < 1e-9 * abs(z))


def _strongest_line(machine, z, vector) -> float | None:
    """rad/s of the line with most of the energy in the states of plants, in mean of their shares; None if two are as strong."""
    moving = [machine.memory[name] for name in machine.schedule.motion.writes]
    seen = []
    state = vector.astype(complex)
    for kind, number, flow in machine.steps():
        if number is not None:
            seen.append(state[moving])
        state = machine.solved[kind][0] @ state
        if flow is not None:
            state = flow @ state
    count = len(seen)
    s = np.log(complex(z))
    shown = np.array(seen) * np.exp(-s / count * np.arange(count))[:, None]
    lines = abs(np.fft.fft(shown, axis=0)) ** 2
    total = lines.sum(0)
    some = total > 1e-12 * total.max()
    share = (lines[:, some] / total[some]).mean(1)
    turns = np.fft.fftfreq(count, 1 / count)
    hertz = abs(s.imag + 2 * math.pi * turns)
    energies: dict[float, float] = {}
    for value, part in zip(np.round(hertz, 9), share, strict=True):  # a line and its conjugate are one
        energies[value] = energies.get(value, 0.0) + part
    strongest = sorted(energies, key=energies.get, reverse=True)
    if len(strongest) > 1 and energies[strongest[0]] - energies[strongest[1]] < LEAD:
        return None
    return strongest[0] / float(machine.schedule.period)
