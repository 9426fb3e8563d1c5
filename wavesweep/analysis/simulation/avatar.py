"""A spring and damper behind a wave port: the avatar in the slow virtual environment, and the local model's."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple


class Port(NamedTuple):
    """A wall ``F = K·x̃ + B·ẋ`` seen through waves of impedance ``b``, updated every ``period`` seconds.

    The three integrations differ in three times: the spring's position is ``x̃ = x + behind·ẋ_before + ahead·ẋ``, and
    the avatar moves to ``x + behind·ẋ_before + step·ẋ``. A one-sided wall fills the positions above `position` (m).
    """

    K: float
    B: float
    b: float
    behind: float
    ahead: float
    step: float
    position: float = 0.0
    one_sided: bool = False


class Avatar(NamedTuple):
    """The avatar after an update: position (m), velocity (m/s), force (N), the returned wave (√W), and whether it touches."""

    x: float = 0.0
    x_dot: float = 0.0
    F: float = 0.0
    v: float = 0.0
    touching: bool = True


Contact = Callable[[Port, Avatar, float], Avatar]
"""One of the ways in which an avatar and a wall can meet: `pressed`, `free`, `grazing`."""


def port(K: float, B: float, b: float, period: float, integration: str) -> Port:
    """Give the port for one of the integrations ``explicit``, ``implicit``, ``trapezoidal``."""
    behind, ahead, step = {
        "explicit": (0.0, 0.0, period),
        "implicit": (0.0, period, period),
        "trapezoidal": (period / 2, period / 2, period / 2),
    }[integration]
    return Port(K, B, b, behind, ahead, step)


def touch(wall: Port, avatar: Avatar, u: float) -> Avatar:
    """Move the avatar under the arriving wave ``u`` (√W)."""
    return contact(wall, avatar, u)(wall, avatar, u)


def pressed(wall: Port, avatar: Avatar, u: float) -> Avatar:
    """Inside the wall: the update's own algebraic loop is solved exactly.

        ẋ = (√(2b)·u - F)/b,    F = K·x̃ + B·ẋ,    v = u - √(2/b)·F

    with ``x̃ = before + ahead·ẋ`` put into the first two gives ``ẋ·(b + B + K·ahead) = √(2b)·u - K·before``.
    """
    K, B, b, behind, ahead, step, position, _ = wall
    before = avatar.x + behind * avatar.x_dot
    x_dot = (math.sqrt(2 * b) * u - K * (before - position)) / (b + B + K * ahead)
    F = K * (before + ahead * x_dot - position) + B * x_dot
    return Avatar(before + step * x_dot, x_dot, F, u - math.sqrt(2 / b) * F, touching=True)


def free(wall: Port, avatar: Avatar, u: float) -> Avatar:
    """Off the wall: no force, and the wave comes back as it was."""
    x_dot = math.sqrt(2 / wall.b) * u
    return Avatar(avatar.x + wall.behind * avatar.x_dot + wall.step * x_dot, x_dot, 0.0, u, touching=False)


def grazing(wall: Port, avatar: Avatar, u: float) -> Avatar:
    """On the surface, ``x̃ = position``, with whatever part of the damper's force keeps the avatar there."""
    before = avatar.x + wall.behind * avatar.x_dot
    x_dot = (wall.position - before) / wall.ahead
    F = math.sqrt(2 * wall.b) * u - wall.b * x_dot
    return Avatar(before + wall.step * x_dot, x_dot, F, u - math.sqrt(2 / wall.b) * F, touching=True)


def contact(wall: Port, avatar: Avatar, u: float) -> Contact:
    """Return the way in which the avatar meets a wall that fills ``x̃ > position``.

    Free motion arrives at ``before + ahead·√(2/b)·u``, pressed motion at the same with ``b + B`` for ``b`` and a bit
    of the spring; with a gap ``position - before`` still open (or negative) those are inside when ``ahead·√(2b)·u`` is
    above gap·b and gap·(b + B). Between the two the damper alone would throw an arriving avatar out and let a free
    one in, so it grazes; a leaving one stays pressed as long as it can.
    """
    if not wall.one_sided:
        return pressed
    gap = _gap(wall, avatar)
    push = wall.ahead * math.sqrt(2 * wall.b) * u
    if push > gap * (wall.b + wall.B):
        return pressed
    return free if push <= gap * wall.b else grazing


def allows(wall: Port, avatar: Avatar, u: float, how: Contact) -> bool:
    """Whether the wave ``u`` is consistent with this way of meeting, if several are possible."""
    if how is free:
        return wall.ahead * math.sqrt(2 * wall.b) * u <= _gap(wall, avatar) * wall.b
    return contact(wall, avatar, u) is how


def away(local: Port, u: float) -> Avatar:
    """Leave a local model without contact: it moves freely and its spring is not stretched."""
    return Avatar(0.0, math.sqrt(2 / local.b) * u, 0.0, u, touching=False)


def _gap(wall: Port, avatar: Avatar) -> float:
    return wall.position - avatar.x - wall.behind * avatar.x_dot
