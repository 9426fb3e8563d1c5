"""The worst hand of a box, and a short search for it, for tests of all that comes after the search."""

from types import SimpleNamespace

import numpy as np

from support.held import held
from wavesweep.passive import hand


def worst_hand(values, box, by="radius"):
    """The worst hand with the spec's own wall, and the loop's spectral radius and least damping ratio with it."""
    K = np.array([values["environment.K_VE"]], float)
    hands, radius, damping = hand.worst_hands(held(values), box, "environment.K_VE", K, by)
    parts = dict(zip(("mass", "damping", "stiffness"), hands[0].tolist(), strict=True))
    return SimpleNamespace(**parts, spectral_radius=float(radius[0]), damping_ratio=float(damping[0]))


def quick_search(monkeypatch):
    """Try a third of the hands: the proof, or the table, has to be right all the same."""
    for name, count in (("EDGE", 16), ("SPREAD", 60), ("SEEDS", 2)):
        monkeypatch.setattr(hand, name, count)
