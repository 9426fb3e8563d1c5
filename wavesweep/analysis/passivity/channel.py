"""The norm of the wave channel: how much energy the filters, samplers and holds can add to what passes them."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.aliases import Response, alias_angles, response_of
from wavesweep.analysis.passivity.climb import Summit, climb
from wavesweep.analysis.passivity.scattering import Element, angles, repeated, then, tick
from wavesweep.analysis.passivity.secular import largest
from wavesweep.analysis.passivity.ways import Ways, ways_of
from wavesweep.diagram import draw

TOLERANCE = 1e-10  # relative, of the norm


@dataclass(frozen=True, slots=True, eq=False)
class ChannelNorm:
    """Norms of the channel, arrays over the batch of the values.

    norm: of the whole. omega: where it is reached, rad/s, in [0, pi/T_s], up to multiples of 2 pi/T_s. outward, inward:
    of the way to the environment and of the way back; nothing joins them within the ports, so the norm is the larger.
    outward_omega, inward_omega: theirs. certified: no frequency exceeds the norm by more than TOLERANCE, relative.
    """

    norm: np.ndarray
    omega: np.ndarray
    outward: np.ndarray
    outward_omega: np.ndarray
    inward: np.ndarray
    inward_omega: np.ndarray
    certified: np.ndarray

    @property
    def passive(self) -> np.ndarray:
        """Whether the channel gives out no more energy than it takes in, to within TOLERANCE."""
        return self.norm <= 1 + TOLERANCE


def channel_norm(values) -> ChannelNorm | None:
    """H-infinity norm of the lifted wave channel, every wave weighted by the root of its period; None without waves.

    values: flat keys; filter cutoffs and rates may be arrays. Ports as in `ways_of`. The position feedback Kp, the wave
    impedance, the device and both walls are outside, so none of them matters, and neither do the two delays: they only
    turn phases. Not a grid: a level just above the value is shown to be met at no frequency (`climb`).
    Accuracy: 1e-10 relative; the value is attained at `omega` to rounding.
    """
    diagram = draw(values)
    ways = ways_of(diagram)
    if ways is None:
        return None
    batch, loops = ways.period.shape, ways.period.size
    outward, inward = outward_summit(ways, loops), inward_summit(ways, loops)
    sides = [(np.sqrt(s.value).reshape(batch), s.theta.reshape(batch) / ways.period) for s in (outward, inward)]
    (out, out_omega), (back, back_omega) = sides
    return ChannelNorm(
        np.maximum(out, back), np.where(out >= back, out_omega, back_omega), out, out_omega, back, back_omega,
        (outward.certified & inward.certified).reshape(batch),
    )


def outward_summit(ways: Ways, loops: int) -> Summit:
    """Square of the norm of `u_m -> (u_s, u_h)`: in the basis of the aliases `diag|HP|^2 + l l*`, l the row of LP1."""
    response = response_of(ways.outward, loops)
    root = np.sqrt(ways.ratio)

    def value(owner, theta):
        gain = np.abs(response.at(owner, alias_angles(theta, ways.ratio))[..., 0]) ** 2
        return largest(gain[..., 1] if gain.shape[-1] > 1 else 0 * gain[..., 0], gain[..., 0])

    def level(owner, square):
        block = response.block
        every = _supply(block, owner, square, block.C[owner][:, 1:], block.D[owner][:, 1:])
        scale = np.array([root] + [1.0] * (block.C.shape[-2] - 1))[:, None]
        event = _supply(block, owner, square, scale * block.C[owner], scale * block.D[owner])
        return angles(then(event, repeated(every, ways.ratio - 1)))

    return climb(value, level, loops, _slack)


def inward_summit(ways: Ways, loops: int) -> Summit:
    """Square of the norm of `(v_s, v_l) -> v_m`: `diag|LP2|^2 + c c*`, c the aliases of the held wave, of length 1."""
    response = response_of(ways.inward, loops) if ways.inward else None

    def value(owner, theta):
        phi = alias_angles(theta, ways.ratio)
        hold = _hold_power(theta, phi, ways.ratio)
        own = np.abs(response.at(owner, phi)[..., 0, 0]) ** 2 if response else 0 * hold
        return largest(own, hold)

    def level(owner, square):
        return angles(_inward_frame(ways, response, owner, square))

    return climb(value, level, loops, _slack)


def _slack(_, square):
    """For the square: half of it is the norm's, half of the tolerance is left for rounding."""
    return TOLERANCE * square


def _hold_power(theta, phi, ratio):
    """`|sin(theta/2) / (ratio sin(phi/2))|^2`, what a hold puts into each alias; they add up to 1."""
    below = ratio * np.sin(phi / 2)
    return np.where(below == 0, 1.0, np.sin(theta / 2)[..., None] / np.where(below == 0, 1, below)) ** 2


def _supply(block, owner, square, C, D) -> Element:
    """A tick with the balance `square u^2 - |C x + D u|^2`."""
    A = np.eye(block.E.shape[-1]) + block.E[owner]
    transposed = np.swapaxes(C, -1, -2)
    room = square[:, None, None] - np.swapaxes(D, -1, -2) @ D
    return tick(A, block.B[owner], -transposed @ C, -transposed @ D, room)


def _inward_frame(ways, response: Response | None, owner, square) -> Element:
    """The frame of the way back: its state is the held wave, then that of LP2 and the delay."""
    n = response.block.E.shape[-1] if response else 0
    A, B = np.zeros((owner.size, n + 1, n + 1)), np.zeros((owner.size, n + 1, 1))
    C, D = np.ones((owner.size, 1, n + 1)), np.zeros((owner.size, 1, 1))
    A[:, 0, 0] = 1
    if response:
        block = response.block
        A[:, 1:, 1:], B[:, 1:] = np.eye(n) + block.E[owner], block.B[owner]
        C[..., 1:], D = block.C[owner], block.D[owner]
    transposed = np.swapaxes(C, -1, -2)
    every = tick(A, B, -transposed @ C, -transposed @ D, square[:, None, None] - D * D)
    first = np.zeros((n + 1, 1))
    first[0] = 1
    new = tick(np.diag(1 - first[:, 0]), first, 0 * A, 0 * B, ways.ratio * square[:, None, None])
    return then(repeated(every, ways.delay), then(new, repeated(every, ways.ratio - ways.delay)))
