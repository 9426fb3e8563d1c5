"""Admittance and impedance from a record, as an experimenter gets them: least squares on settled sines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from wavesweep.analysis.march.inputs import Tone
from wavesweep.errors import UsageError

_SAME = 1e-9  # rad per tick: images closer than this are one column


def estimate(
    signals: Mapping[str, np.ndarray], tones: Sequence[Tone], fast_hz: float, ratio: int
) -> dict[str, np.ndarray]:
    """Estimate the transmitted admittance ``x/f_h`` and impedance ``f_device/x`` at each tone's frequency.

    A multirate loop answers a sine also at its images ``f + n·f_slow``. Each signal of a stretch is fitted with sines
    at the frequency, at its images and a constant (drift), and only the component at the frequency itself is kept;
    left out, the images would leak into it wherever the stretch is no whole number of frames.

    Parameters: `signals` with the columns `f_h`, `x`, `f_device` (see `Simulation.signals`), `tones` the stretches to
    use, `fast_hz` the fast rate, `ratio` ticks in a frame (1 for `dc`).

    Returns the columns ``frequency_hz``, ``omega_Ts`` (radians per slow sample), ``admittance_re``, ``_im``, ``_abs``
    (m/N), ``_deg``, and ``impedance_…`` likewise (N/m), an entry per tone.

    Errors: `UsageError` for a stretch with fewer ticks than the fit has unknowns.

    Accuracy: rounding, once the loop has settled. At multiples of half the slow rate the sine is its own image: what a
    single record shows there depends on the phase of the sine against the slow clock, in an experiment as here.
    """
    found = np.array([_components(signals, tone, fast_hz, ratio) for tone in tones], dtype=complex).reshape(-1, 3)
    f_h, x, f_device = found.T
    frequency = np.array([tone.frequency_hz for tone in tones])
    columns = {"frequency_hz": frequency, "omega_Ts": 2 * np.pi * frequency * ratio / fast_hz}
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing moved, or nothing pushed: NaN says so
        responses = {"admittance": x / f_h, "impedance": f_device / x}
    for name, response in responses.items():
        columns[f"{name}_re"], columns[f"{name}_im"] = response.real, response.imag
        columns[f"{name}_abs"], columns[f"{name}_deg"] = np.abs(response), np.degrees(np.angle(response))
    return columns


def _components(signals: Mapping[str, np.ndarray], tone: Tone, fast_hz: float, ratio: int) -> list[complex]:
    """Fit the complex amplitudes at the tone's frequency."""
    basis = _basis(2 * np.pi * tone.frequency_hz / fast_hz, ratio, np.arange(tone.first, tone.last))
    if basis.shape[0] < basis.shape[1]:
        raise UsageError(
            f"tone of {tone.frequency_hz} Hz: expected at least {basis.shape[1]} ticks to tell it from its images, "
            f"found {basis.shape[0]}; measure longer"
        )
    measured = np.stack([signals[name][tone.first : tone.last] for name in ("f_h", "x", "f_device")], axis=1)
    cosine, sine = np.linalg.lstsq(basis, measured, rcond=None)[0][:2]
    return list(cosine - 1j * sine)


def _basis(omega: float, ratio: int, k: np.ndarray) -> np.ndarray:
    """Give cosines and sines at ``omega`` (first) and at its images, each frequency once, and a constant."""
    images = omega + 2 * np.pi * np.arange(ratio) / ratio
    folded = np.abs((images + np.pi) % (2 * np.pi) - np.pi)
    columns, seen = [], [0.0]
    for image in folded:
        if min(abs(image - other) for other in seen) > _SAME:
            seen.append(image)
            columns += [np.cos(image * k)] if abs(image - np.pi) <= _SAME else [np.cos(image * k), np.sin(image * k)]
    return np.stack([*columns, np.ones(len(k))], axis=1)
