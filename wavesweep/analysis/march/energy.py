"""Who gave whom how much energy: the hand, the device, and the wave channel between its ports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Energy:
    """Energies (J) since the start, at the end of every tick, shape ``(ticks,)`` each.

    `hand`: work of the hand on the device, ``Σ f_h·Δx``. `device`: work that the device's motors took up, ``Σ f_d·Δx``.
    Wave power is ``(u² - v²)/2``, and a wave lasts its own period: `user` went into the channel at the user's side,
    ``Σ T·(u_m² - v_m²)/2``; `slow` came out at the slow environment, ``Σ T_s·(u_s² - v_s²)/2``, booked at its update;
    `local` came out at the local model. `channel` is what is left, ``user - slow - local``: stored or dissipated while
    it is positive, made up by aliasing, by the Kp term or by results that are held too long where it is negative.
    The last four are None without waves. Periods are the nominal ones, also where the ticks jitter.
    """

    hand: np.ndarray
    device: np.ndarray
    user: np.ndarray | None
    slow: np.ndarray | None
    local: np.ndarray | None
    channel: np.ndarray | None


def energies(signals: dict[str, np.ndarray], moved: np.ndarray, T: float, ratio: int) -> Energy:
    """Add up the energies of a simulation.

    Parameters: `signals` the columns of the simulation, `moved` the change of position in each tick (m), `T` the
    nominal tick (s), `ratio` of slow to fast period.

    Accuracy: rounding of the sums; an overflowed march gives infinities or NaN.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        hand, device = (np.cumsum(signals[name] * moved) for name in ("f_h", "f_device"))
        if "u_m" not in signals:
            return Energy(hand, device, None, None, None, None)
        user = np.cumsum(_wave(signals, "u_m", "v_m", T))
        updates = np.arange(len(moved)) % ratio == 0
        slow = np.cumsum(np.where(updates, _wave(signals, "u_s", "v_s", ratio * T), 0.0))
        local = np.cumsum(_wave(signals, "u_h", "v_l", T)) if "u_h" in signals else np.zeros_like(user)
        return Energy(hand, device, user, slow, local, user - slow - local)


def _wave(signals: dict[str, np.ndarray], going: str, coming: str, period: float) -> np.ndarray:
    """Energy (J) that a pair of waves carries away in each period."""
    return period * (signals[going] ** 2 - signals[coming] ** 2) / 2
