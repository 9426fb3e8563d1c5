"""Sections 2 and 3: aliasing, the filters, and whether the wave channel is passive."""

from __future__ import annotations

import numpy as np

from wavesweep.analysis.response.transfer import modes_of, solved_response
from wavesweep.diagram.filters import butterworth
from wavesweep.lifted.circle import on_circle
from wavesweep.paper.bench import Bench
from wavesweep.paper.measures import show
from wavesweep.paper.readings import LP1_ORDERS, SPEC, Reading, set_to
from wavesweep.paper.specs import load_paper
from wavesweep.paper.verdicts import Answer, Finding, Statement, over

CUTOFFS = tuple(set_to(f"LP1 of order 1 at {hz} Hz", f"filters.lp1.cutoff_hz={hz}") for hz in (1, 5, 20))
LP2_CHOICES = (
    SPEC,
    set_to("LP2 of order 1", "filters.lp2.order=1"),
    set_to("LP2 of order 4", "filters.lp2.order=4"),
    set_to("LP2 at 10 Hz", "filters.lp2.cutoff_hz=10"),
    set_to("LP2 at 40 Hz", "filters.lp2.cutoff_hz=40"),
)
WITHOUT_LP2 = "filters.lp2.order=0"


def aliasing_injects_energy(bench: Bench) -> Finding:
    """Norm of the wave channel without the anti-aliasing filter; above 1 it can give out more energy than it takes
    in."""
    return over(lambda *reading: _gives_energy(bench, "pmw", "filters.lp1.order=0", *reading), (SPEC,))


def low_pass_makes_passive(bench: Bench) -> Finding:
    """Norm of the wave channel with LP1 below 25 Hz; passive where it is at most 1, to 1e-10."""
    return over(lambda *reading: _is_passive(bench, "pmw", *reading), (SPEC, *CUTOFFS, *LP1_ORDERS))


def bank_keeps_passive(bench: Bench) -> Finding:
    """Norm of the wave channel with filter bank and local model, ports (u_m, v_s, v_l) to (u_s, u_h, v_m)."""
    return over(lambda *reading: _is_passive(bench, "fig6", *reading), (*LP2_CHOICES, *CUTOFFS, *LP1_ORDERS))


def _is_passive(bench: Bench, name: str, *overrides: str) -> Answer:
    norm = bench.channel(name, *overrides)
    numbers = f"norm 1 + {show(norm.norm - 1)}"
    if norm.inward > norm.outward:
        numbers += f", of the returned waves; of the outgoing ones 1 + {show(norm.outward - 1)}"
    return Answer(bool(norm.passive), numbers)


def _gives_energy(bench: Bench, name: str, *overrides: str) -> Answer:
    passive, numbers = _is_passive(bench, name, *overrides)
    return Answer(not passive, numbers)


def bank_divides(bench: Bench) -> Finding:
    """Powers of LP1 and HP from 0.1 to 400 Hz: whether they add up to 1, and which one is larger on each side of 10
    Hz."""
    del bench

    def check(*reading: str) -> Answer:
        frequency = np.geomspace(0.1, 400, 200)
        low, high = (_gain(name, frequency, *reading) ** 2 for name in ("lp1", "hp"))
        off = np.abs(low + high - 1).max()
        apart = np.all((low > high) == (frequency < 10))
        return Answer(bool(apart and off < 1e-9), f"powers add up to 1, off by {show(off)}")

    return over(check, (SPEC, *(_both(order) for order in (2, 4))))


def _both(order: int) -> Reading:
    return set_to(f"both of order {order}", *(f"filters.{name}.order={order}" for name in ("lp1", "hp")))


def lp2_reduces_reflections(bench: Bench) -> Finding:
    """Largest part |HP LP2| of a wave that comes back to the user from a lossless local model, and whether the loop of
    Figure 6 is stable, with LP2 and without."""

    def check(*reading: str) -> Answer:
        frequency = np.geomspace(0.1, 499, 2000)
        loops = [(*reading, WITHOUT_LP2), reading]
        without, found = (np.max(_gain("hp", frequency, *loop) * _gain("lp2", frequency, *loop)) for loop in loops)
        words = ["stable" if bench.response("fig6", *loop).stable else "unstable" for loop in loops]
        return Answer(bool(found < without), f"{show(found)} ({words[1]}), without LP2 {show(without)} ({words[0]})")

    return over(check, (*LP2_CHOICES, set_to("local model without delay", "local_model.delay=0")))


def _gain(filter_name: str, frequency_hz: np.ndarray, *overrides: str) -> np.ndarray:
    """Magnitude of a filter of Figure 6's loop over frequency."""
    values = load_paper("fig6", overrides).values
    order, cutoff = (values[f"filters.{filter_name}.{part}"] for part in ("order", "cutoff_hz"))
    if order == 0:
        return np.ones_like(frequency_hz)
    block = butterworth(filter_name, order, cutoff, 1 / values["rates.fast_hz"], filter_name == "hp")
    angle = on_circle(2 * np.pi * frequency_hz / values["rates.fast_hz"])
    return np.abs(solved_response(modes_of(block), angle)[0][:, 0, 0])


STATEMENTS = (
    Statement("2", "Wave aliasing due to downsampling may inject energy and destroy passivity", aliasing_injects_energy),
    Statement(
        "2",
        "A low-pass filter with a cutoff below half the environment's update rate eliminates aliasing and guarantees passivity",
        low_pass_makes_passive,
    ),
    Statement("Abstract; 3", "The filter bank divides the outgoing wave into its low and its high frequencies", bank_divides),
    Statement("3", "The filter bank structure maintains the passivity of the wave-based channels", bank_keeps_passive),
    Statement("3; 3.1", "LP2 reduces the wave reflections in the loop closed through the local model", lp2_reduces_reflections),
)
