"""Published bounds that results are held against."""

import numpy as np


def colgate_schenkel(stiffness, damping, period):
    """Least damping (N*s/m) of a device under one sampled wall: `K T/2 + |B|`, B by the backward difference.

    stiffness K (N/m), damping B (N*s/m), period T (s). J. E. Colgate, G. G. Schenkel, Passivity of a class of
    sampled-data systems: application to haptic interfaces, Journal of Robotic Systems 14(1), 37-47, 1997. The device is
    passive with a continuous hand exactly when its own damping is larger.
    """
    return stiffness * period / 2 + np.abs(damping)
