"""Responses that the hand feels, by analysis and in the simulated experiment of Section 4, and measures of them.

The measures put the paper's words in numbers: closer to the ideal, natural frequency, transmitted stiffness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import wavesweep
from wavesweep import Spec
from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._response.at_hand import ports_of_batch
from wavesweep.engine._response.lifted import Lifted
from wavesweep.engine._response.steady import respond as respond_at
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.program.columns import Columns

# Ranges of normalised frequency, rad/sample, as the tick labels of the paper's figures give them.
LOW_OF_FIGURE_2 = (0.0, 0.15)
LOW = (0.0, 0.6)
HIGH = (0.6, np.pi)
WHOLE = (0.0, np.pi)

_ROUNDING = 1e-13  # rounding of a number that is 0, which differs from machine to machine

CONTROLLERS = {  # the paper's name -> overrides of Figure 7's spec; PMW has no position term, which is Section 3's
    "PMW+LM": ('controller.kind="pmw-lm"',),
    "PMW": ('controller.kind="pmw"', "controller.Kp=0"),
    "DC": ('controller.kind="dc"',),
}

METHODS = {
    "admittance": "least squares over the settled stretches: the sine, its images about the slow rate, a constant",
    "linear_admittance": "lifted resolvent of both rates, component at the force's own frequency",
}


@dataclass(frozen=True, eq=False)
class FeltResponse:
    """The response that the hand feels, at the frequencies of a spec's [bode] table.

    omega: rad/sample of the slow rate, as the paper's axes. admittance (m/N), impedance (N/m): complex. stable: whether
    there is a steady response at all.
    """

    omega: np.ndarray
    admittance: np.ndarray
    impedance: np.ndarray
    stable: bool


def respond(spec: Spec, frequency_hz=None) -> FeltResponse:
    """Compute the response of one spec, at the frequencies (Hz) of its [bode] table unless others are given."""
    frequency = np.asarray(spec.frequency_hz if frequency_hz is None else frequency_hz, float)
    return respond_to(loop_drawing(spec.values), spec.values, 1, frequency)[0]


def respond_to(drawing: Drawing, values: Mapping, size: int, frequency: np.ndarray) -> list[FeltResponse]:
    """Compute the responses of `size` loops that share one drawing.

    values: flat keys -> one value for all loops, or an array over them; the wall and the rates are read from it.
    """
    loops, stable = Loops(drawing, values).read, np.ones(size, bool)
    admittance, impedance = np.empty((2, size, frequency.size), complex)
    for at, port in ports_of_batch(loops, size):
        loop = Lifted.of(port)
        found = respond_at(loop, frequency)
        admittance[at], impedance[at] = found.admittance, found.impedance
        unsure = at[~np.broadcast_to(loop.stable_for_sure(), at.shape)]
        if unsure.size:
            stable[unsure] = loops.some(unsure).radii(unsure.size) < 1
    omega = 2 * np.pi * frequency * values["rates.ratio"] / values["rates.fast_hz"]
    return [FeltResponse(omega, *each) for each in zip(admittance, impedance, stable.tolist(), strict=True)]


def estimated(spec: Spec) -> Columns:
    """Run the stepped sine of a spec and give the columns of the table `simulate-response`."""
    _, response = wavesweep.simulate(spec)
    return {name: column.to_numpy() for name, column in response.items()}


def within(omega: np.ndarray, band: tuple[float, float]) -> np.ndarray:
    """Whether each frequency is in the band; the last one may differ from pi by rounding."""
    return (omega >= band[0]) & (omega <= band[1] + 1e-9)


def deviation(response: FeltResponse, ideal: FeltResponse, band: tuple[float, float]) -> float:
    """Mean relative deviation of the admittance's magnitude from the ideal's over the band."""
    chosen = within(response.omega, band)
    found, wanted = np.abs(response.admittance[chosen]), np.abs(ideal.admittance[chosen])
    return float(np.mean(np.abs(found - wanted) / wanted))


def stiffness_error(response: FeltResponse, stiffness: float, band: tuple[float, float]) -> float:
    """Mean deviation (N/m) of the transmitted impedance's magnitude from a stiffness (N/m) over the band."""
    chosen = within(response.omega, band)
    return float(np.mean(np.abs(np.abs(response.impedance[chosen]) - stiffness)))


def natural_frequency(omega: np.ndarray, magnitude: np.ndarray) -> float:
    """Frequency of the first peak, or of the largest value if the curve only falls or rises."""
    peaks = np.flatnonzero((magnitude[1:-1] > magnitude[:-2]) & (magnitude[1:-1] >= magnitude[2:])) + 1
    return float(omega[peaks[0] if peaks.size else magnitude.argmax()])


def peak(response: FeltResponse) -> float:
    """Give the first natural frequency of a response, rad/sample."""
    return natural_frequency(response.omega, np.abs(response.admittance))


def worst_difference(columns: Columns) -> float:
    """Largest relative difference between simulated and linear admittance."""
    seen, linear = (columns[f"{prefix}admittance_re"] + 1j * columns[f"{prefix}admittance_im"] for prefix in ("", "linear_"))
    return float(np.max(np.abs(seen - linear) / np.abs(linear)))


def deviation_of(columns: Columns, ideal: Columns, band: tuple[float, float]) -> float:
    """Mean relative deviation of simulated magnitudes from those of another run over the band."""
    chosen = within(columns["omega_Ts"], band)
    found, wanted = columns["admittance_abs"][chosen], ideal["admittance_abs"][chosen]
    return float(np.mean(np.abs(found - wanted) / wanted))


def joined(runs: list[Columns]) -> Columns:
    """Concatenate the columns of several runs."""
    return {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}


def rises(numbers) -> bool:
    """Whether each number is larger than the one before."""
    return bool(np.all(np.diff(np.asarray(numbers)) > 0))


def falls(numbers) -> bool:
    """Whether each number is smaller than the one before."""
    return rises(-np.asarray(numbers))


def show(numbers, digits: int = 3) -> str:
    """A number or some numbers as text, large ones to the unit; "no limit" for an infinite one."""
    return ", ".join(_spell(number, digits) for number in np.atleast_1d(np.asarray(numbers, float)).tolist())


def _spell(number: float, digits: int) -> str:
    if np.isinf(number):
        return "no limit"
    if abs(number) < _ROUNDING:
        return "0"
    return f"{number:.0f}" if abs(number) >= 10**digits else f"{number:.{digits}g}"


def show_limits(limits) -> str:
    """The stiffest stable walls (N/m) as text; infinite if the searched range ends there."""
    each = np.atleast_1d(np.asarray(limits, float))
    if not each.any():
        return "no K_VE is stable"
    if np.isinf(each).all():
        return "every K_VE to 20000 N/m is stable"
    return f"K_VE up to {show(each, 4)} N/m"
