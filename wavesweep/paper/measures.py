"""What the paper's words mean in numbers: closer to the ideal, natural frequency, transmitted stiffness."""

from __future__ import annotations

import numpy as np

from wavesweep.paper.response import Response

# Ranges of normalised frequency, rad/sample, as the tick labels of the paper's figures give them.
LOW_OF_FIGURE_2 = (0.0, 0.15)
LOW = (0.0, 0.6)
HIGH = (0.6, np.pi)
WHOLE = (0.0, np.pi)

_ROUNDING = 1e-13  # what is left of 0 in double precision, and differs from machine to machine


def within(omega: np.ndarray, band: tuple[float, float]) -> np.ndarray:
    """Tell which frequencies are in the band; the last one may be off pi by rounding."""
    return (omega >= band[0]) & (omega <= band[1] + 1e-9)


def deviation(response: Response, ideal: Response, band: tuple[float, float]) -> float:
    """Mean over the band of how far the admittance's magnitude is off the ideal's, relative to the ideal's."""
    chosen = within(response.omega, band)
    found, wanted = np.abs(response.admittance[chosen]), np.abs(ideal.admittance[chosen])
    return float(np.mean(np.abs(found - wanted) / wanted))


def stiffness_error(response: Response, stiffness: float, band: tuple[float, float]) -> float:
    """Mean over the band of how far the transmitted impedance's magnitude is off a stiffness (N/m), in N/m."""
    chosen = within(response.omega, band)
    return float(np.mean(np.abs(np.abs(response.impedance[chosen]) - stiffness)))


def natural_frequency(omega: np.ndarray, magnitude: np.ndarray) -> float:
    """Give the frequency of the first peak, or of the largest value where the curve only falls or rises."""
    peaks = np.flatnonzero((magnitude[1:-1] > magnitude[:-2]) & (magnitude[1:-1] >= magnitude[2:])) + 1
    return float(omega[peaks[0] if peaks.size else magnitude.argmax()])


def peak(response: Response) -> float:
    """Give the first natural frequency of a response, rad/sample."""
    return natural_frequency(response.omega, np.abs(response.admittance))


def rises(numbers) -> bool:
    """Tell whether each number is larger than the one before."""
    return bool(np.all(np.diff(np.asarray(numbers)) > 0))


def falls(numbers) -> bool:
    """Tell whether each number is smaller than the one before."""
    return rises(-np.asarray(numbers))


def show(numbers, digits: int = 3) -> str:
    """Spell a number or some numbers for a reader, large ones to the unit; "no limit" for an infinite one."""
    return ", ".join(_spell(number, digits) for number in np.atleast_1d(np.asarray(numbers, float)).tolist())


def _spell(number: float, digits: int) -> str:
    if np.isinf(number):
        return "no limit"
    if abs(number) < _ROUNDING:
        return "0"
    return f"{number:.0f}" if abs(number) >= 10**digits else f"{number:.{digits}g}"


def show_limits(limits) -> str:
    """Spell the stiffest stable walls (N/m) for a reader; infinite where the searched range ends them."""
    each = np.atleast_1d(np.asarray(limits, float))
    if not each.any():
        return "no K_VE is stable"
    if np.isinf(each).all():
        return "every K_VE to 20000 N/m is stable"
    return f"K_VE up to {show(each, 4)} N/m"
