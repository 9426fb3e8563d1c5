"""The direct couplings `dc`, `dc-slow` and `dc-lm`, one fast tick at a time."""

from __future__ import annotations

from typing import Mapping, NamedTuple

from wavesweep.analysis.march.clock import Mail, collect, post


class DirectLaw(NamedTuple):
    """The constants of a direct coupling. `dc` has a ratio of 1 and no delay: its wall is computed every tick."""

    K: float
    B: float
    K_LM: float
    B_LM: float
    ratio: int
    delay: int


class Sample(NamedTuple):
    """A force of the slow wall (N) with the position (m) and velocity (m/s) that it was computed from."""

    F: float = 0.0
    x: float = 0.0
    v: float = 0.0


class DirectMemory(NamedTuple):
    """What a direct coupling keeps from tick to tick."""

    held: Sample = Sample()
    mail: Mail = ()


class DirectTick(NamedTuple):
    """The control force of a tick, and the slow wall's force where it was computed."""

    f_m: float
    F_s: float | None


def direct_law(values: Mapping) -> DirectLaw:
    """The controller of a spec's flat values."""
    kind = values["controller.kind"]
    with_local = kind == "dc-lm"
    return DirectLaw(
        K=values["environment.K_VE"],
        B=values["environment.B_VE"],
        K_LM=values["local_model.K_LM"] if with_local else 0.0,
        B_LM=values["local_model.B_LM"] if with_local else 0.0,
        ratio=1 if kind == "dc" else values["rates.ratio"],
        delay=0 if kind == "dc" else values["environment.delay"],
    )


def direct_tick(law: DirectLaw, memory: DirectMemory, k: int, x: float, v_hat: float) -> tuple[DirectMemory, DirectTick]:
    """One tick: ``f_m = F_s + K_LM·(x − x_ref) + B_LM·(v̂ − v̂_ref)`` with the held ``F_s = K·x_ref + B·v̂_ref``.

    Parameters: `k` the tick, `x` the position (m), `v_hat` the measured velocity (m/s).
    """
    held, mail = collect(memory.held, memory.mail, k)
    F_s = None
    if k % law.ratio == 0:
        F_s = law.K * x + law.B * v_hat
        sample = Sample(F_s, x, v_hat)
        held, mail = held if law.delay else sample, post(mail, sample, k, law.delay)
    f_m = held.F + law.K_LM * (x - held.x) + law.B_LM * (v_hat - held.v)
    return DirectMemory(held, mail), DirectTick(f_m, F_s)
