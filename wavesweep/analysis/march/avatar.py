"""A spring and damper behind a wave port: the avatar in the slow virtual environment, and the local model's."""

from __future__ import annotations

import math
from typing import NamedTuple


class Port(NamedTuple):
    """A wall ``F = K·x̃ + B·ẋ`` seen through waves of impedance ``b``, updated every ``period`` seconds.

    The three integrations differ in three times: the spring's position is ``x̃ = x + behind·ẋ_before + ahead·ẋ``, and the
    avatar moves to ``x + behind·ẋ_before + step·ẋ``.
    """

    K: float
    B: float
    b: float
    behind: float
    ahead: float
    step: float


class Avatar(NamedTuple):
    """What an update leaves: position (m), velocity (m/s), force (N) and the returned wave (√W)."""

    x: float = 0.0
    x_dot: float = 0.0
    F: float = 0.0
    v: float = 0.0


def port(K: float, B: float, b: float, period: float, integration: str) -> Port:
    """The port for one of the integrations ``explicit``, ``implicit``, ``trapezoidal``."""
    behind, ahead, step = {
        "explicit": (0.0, 0.0, period),
        "implicit": (0.0, period, period),
        "trapezoidal": (period / 2, period / 2, period / 2),
    }[integration]
    return Port(K, B, b, behind, ahead, step)


def touch(wall: Port, avatar: Avatar, u: float) -> Avatar:
    """The avatar after the arriving wave ``u`` (√W): the update's own algebraic loop is solved exactly.

        ẋ = (√(2b)·u − F)/b,    F = K·x̃ + B·ẋ,    v = u − √(2/b)·F

    with ``x̃ = before + ahead·ẋ`` put into the first two gives ``ẋ·(b + B + K·ahead) = √(2b)·u − K·before``.
    """
    K, B, b, behind, ahead, step = wall
    before = avatar.x + behind * avatar.x_dot
    x_dot = (math.sqrt(2 * b) * u - K * before) / (b + B + K * ahead)
    F = K * (before + ahead * x_dot) + B * x_dot
    return Avatar(before + step * x_dot, x_dot, F, u - math.sqrt(2 / b) * F)
