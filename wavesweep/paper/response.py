"""What the hand feels of one loop: the paper's frequency responses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.response import prepare, steady_state
from wavesweep.analysis.spectrum import spectral_radius
from wavesweep.diagram import draw
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted import cut_at_wall
from wavesweep.spec import Spec


@dataclass(frozen=True, eq=False)
class Response:
    """What the hand feels at the frequencies of a spec's [bode] table.

    omega: rad/sample of the slow rate, as the paper's axes. admittance (m/N), impedance (N/m): complex. stable: whether
    there is a steady response at all.
    """

    omega: np.ndarray
    admittance: np.ndarray
    impedance: np.ndarray
    stable: bool


def respond(spec: Spec, frequency_hz=None) -> Response:
    """Compute the response of one spec, at the frequencies (Hz) of its [bode] table unless others are given."""
    frequency = np.asarray(spec.frequency_hz if frequency_hz is None else frequency_hz, float)
    return respond_to(draw(spec.values), spec.values, 1, frequency)[0]


def respond_to(diagram: Diagram, values: Mapping, size: int, frequency: np.ndarray) -> list[Response]:
    """Compute the responses of `size` loops that one drawing serves.

    values: flat keys -> one value for all loops, or an array over them; the wall and the rates are read from it.
    """
    K, B = values["environment.K_VE"], values["environment.B_VE"]
    felt = [np.broadcast_to(part, (size, frequency.size)) for part in steady_state(prepare(diagram, K, B), frequency)]
    stable = np.broadcast_to(spectral_radius(cut_at_wall(diagram), K, B) < 1, (size,)).tolist()
    omega = 2 * np.pi * frequency * values["rates.ratio"] / values["rates.fast_hz"]
    return [Response(omega, *each) for each in zip(*felt, stable, strict=True)]
