"""Direct coupling of a free hand, where the wall alone holds the device and the ways through it cancel at low frequency."""

import numpy as np

from wavesweep.analysis.response.transfer import modal_response, solved_response
from wavesweep.lifted.circle import on_circle


def is_direct(diagram) -> bool:
    """Whether the wall's held force is all that acts on a device that no spring holds (kinds dc and dc-slow)."""
    return tuple(diagram.holds) == ("held_F",) and not diagram.held_by_spring


def direct_admittance(loop, ticks):
    """Admittance and the wall's share of it: (x/f_h, f_m/x), `(..., points)`; ticks: frequencies, cycles per tick.

    The device moves by `P (f_h - f_m)`, `P ~ 1/w` or `1/w^2`, and the wall answers the samples of all aliases of x:
    `F = phi x`, `phi = (K + B c)/(1 - K R_x - B R_v)`, c the ratio of measured velocity to position, R what the force
    gives back through the other aliases, `-sum_{m != 0} P_m h_m`. So `x/f_h = 1/(1/P + h phi)`: sums of like sizes, where
    the difference of the way with and without the wall loses digits as 1/w^2.
    """
    K, B = (np.asarray(value, float)[..., None] for value in loop.wall)
    ratio = loop.diagram.ratio
    w, position, velocity, share = _aliases(loop, ticks[:, None] + np.arange(ratio) / ratio)
    with np.errstate(divide="ignore", invalid="ignore"):
        R_x, R_v = (-(way[..., 1:] * share[..., 1:]).sum(-1) for way in (position / w, velocity))
        ratio_v = w[..., 0] * velocity[..., 0] / position[..., 0]
        phi = (K + B * ratio_v) / (1 - K * R_x - B * R_v)
        phi = np.where(np.any(w[..., 1:] == 0, axis=-1), 0, phi)  # an aliased constant force leaves the wall none
        inverse = w[..., 0] / position[..., 0] + share[..., 0] * phi
        return 1 / inverse, share[..., 0] * phi


def inverse_map(loop, ticks, ratio):
    """Inverse of the lifted map from forces to positions in the basis of the aliases, as (s, h, a): `diag(s) + h a^T`.

    `f = x/P + h F`, `F = sum_m (K + B c_m) x_m`: nothing of it is large at low frequency. Each `(..., points, M)`; h and a
    are None where the wall runs every tick and mixes nothing.
    """
    K, B = (np.asarray(value, float)[..., None, None] for value in loop.wall)
    w, position, velocity, share = _aliases(loop, ticks[:, None] + np.arange(ratio) / ratio)
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness = w / position
        read = K + B * velocity * stiffness
    return (stiffness + share * read, None, None) if loop.diagram.ratio == 1 else (stiffness, share + 0 * read, read)


def _aliases(loop, cycles):
    """w, displacement in the tick and measured velocity per force, and the held force's share, at each alias."""
    nearest = cycles - np.round(cycles)
    w = on_circle(2 * np.pi * nearest)
    flat = w.reshape(-1)
    found, size = modal_response(loop.fast, flat)
    if not np.all(8 * np.finfo(float).eps * size[..., (0, 3), 0] <= 1e-12 * np.abs(found[..., (0, 3), 0])):
        found, _ = solved_response(loop.fast, flat)
    position, velocity = (found[..., row, 0].reshape(*found.shape[:-3], *cycles.shape) for row in (0, 3))
    angle, delay, ratio = 2 * np.pi * nearest, loop.diagram.delay, loop.diagram.ratio
    frames = nearest * ratio
    with np.errstate(divide="ignore", invalid="ignore"):
        held = on_circle(-2 * np.pi * (frames - np.round(frames))) / (ratio * on_circle(-angle))
    held = np.where(nearest == 0, 1.0, held)
    return w, position, velocity, np.exp(-1j * angle * delay) * held
