"""The experiment of Section 4 in simulation: stepped sines on both loops, run tick by tick."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wavesweep.analysis.simulation import hand_force, simulated
from wavesweep.paper.measures import within
from wavesweep.spec import Spec
from wavesweep.sweep.seen_response import seen_response

CONTROLLERS = {  # the paper's name -> overrides of Figure 7's spec; PMW has no position term, which is Section 3's
    "PMW+LM": ('controller.kind="pmw-lm"',),
    "PMW": ('controller.kind="pmw"', "controller.Kp=0"),
    "DC": ('controller.kind="dc"',),
}

METHODS = {
    "admittance": "least squares over the settled stretches: the sine, its images about the slow rate, a constant",
    "linear_admittance": "lifted resolvent of both rates, component at the force's own frequency",
}

Columns = Mapping[str, np.ndarray]


def estimated(spec: Spec) -> Columns:
    """Run the stepped sine of a spec and give the columns of the table `simulate-response`."""
    hand = hand_force(spec)
    return seen_response(spec, simulated(spec, hand.force), hand.tones)


def worst_difference(columns: Columns) -> float:
    """Largest relative difference between simulated and linear admittance."""
    seen, linear = (columns[f"{prefix}admittance_re"] + 1j * columns[f"{prefix}admittance_im"] for prefix in ("", "linear_"))
    return float(np.max(np.abs(seen - linear) / np.abs(linear)))


def deviation_of(columns: Columns, ideal: Columns, band: tuple[float, float]) -> float:
    """Mean over the band of how far simulated magnitudes are off those of another run, relative to these."""
    chosen = within(columns["omega_Ts"], band)
    found, wanted = columns["admittance_abs"][chosen], ideal["admittance_abs"][chosen]
    return float(np.mean(np.abs(found - wanted) / wanted))


def joined(runs: list[Columns]) -> Columns:
    """Give the columns of several runs one below the other."""
    return {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}
