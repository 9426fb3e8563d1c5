"""The direct couplings `dc`, `dc-slow` and `dc-lm`, one fast tick at a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from wavesweep.analysis.simulation.hardware import Mail, collect, post


class DirectLaw(NamedTuple):
    """The constants of a direct coupling. `dc` has a ratio of 1 and no delay: its wall is computed every tick.

    `surface` is the position (m) at which a one-sided wall begins, None for a wall on both sides of 0.
    """

    K: float
    B: float
    K_LM: float
    B_LM: float
    ratio: int
    delay: int
    surface: float | None = None


class Sample(NamedTuple):
    """A force of the slow wall (N), the position (m) and velocity (m/s) that it comes from, and whether it touched."""

    F: float = 0.0
    x: float = 0.0
    v: float = 0.0
    touching: bool = True


class DirectMemory(NamedTuple):
    """State of a direct coupling between ticks: the held sample, and those in transit."""

    held: Sample = Sample()
    mail: Mail = ()


class DirectTick(NamedTuple):
    """The control force of a tick, the slow force if one was computed, and whether the held one is of a contact."""

    f_m: float
    F_s: float | None
    touching: bool


def dc(values: Mapping, surface: float | None = None) -> DirectLaw:
    """Return the law of `dc`, the wall at the fast rate. If `surface` (m) is given, the wall is one-sided from there on."""
    return DirectLaw(values["environment.K_VE"], values["environment.B_VE"], 0.0, 0.0, 1, 0, surface)


def dc_slow(values: Mapping, surface: float | None = None) -> DirectLaw:
    """Return the law of `dc-slow`: the same wall once a frame, its force held."""
    return dc(values, surface)._replace(ratio=values["rates.ratio"], delay=values["environment.delay"])


def dc_lm(values: Mapping, surface: float | None = None) -> DirectLaw:
    """Return the law of `dc-lm`: that of `dc-slow` with a local model around the samples behind the held force."""
    return dc_slow(values, surface)._replace(K_LM=values["local_model.K_LM"], B_LM=values["local_model.B_LM"])


def direct_memory(law: DirectLaw) -> DirectMemory:
    """Return the memory of a loop that has not moved yet, at x = 0."""
    return DirectMemory(Sample(touching=law.surface is None or law.surface < 0.0))


def direct_tick(
    law: DirectLaw, memory: DirectMemory, k: int, x: float, v_hat: float, late: int | None = 0
) -> tuple[DirectMemory, DirectTick]:
    """Run one tick: ``f_m = F_s + K_LM·(x - x_ref) + B_LM·(v̂ - v̂_ref)`` with the held ``F_s = K·x_ref + B·v̂_ref``.

    The local model is that of a contact: it is absent while the held force comes from a wall that was not touched.

    Parameters: `k` the tick, `x` the position (m), `v_hat` the measured velocity (m/s), `late` the ticks by which a slow
    result computed now exceeds its delay, None if it is lost.
    """
    held, mail = collect(memory.held, memory.mail, k)
    F_s = None
    if k % law.ratio == 0:
        sample = _sample(law, x, v_hat)
        F_s, delay = sample.F, None if late is None else law.delay + late
        held, mail = sample if delay == 0 else held, post(mail, sample, k, delay)
    f_m = held.F
    if held.touching and (law.K_LM or law.B_LM):
        f_m = f_m + law.K_LM * (x - held.x) + law.B_LM * (v_hat - held.v)
    return DirectMemory(held, mail), DirectTick(f_m, F_s, held.touching)


def _sample(law: DirectLaw, x: float, v_hat: float) -> Sample:
    """Evaluate the wall, which is there only beyond its surface if it is one-sided."""
    if law.surface is None:
        return Sample(law.K * x + law.B * v_hat, x, v_hat, touching=True)
    touching = x > law.surface
    return Sample(law.K * (x - law.surface) + law.B * v_hat if touching else 0.0, x, v_hat, touching)
