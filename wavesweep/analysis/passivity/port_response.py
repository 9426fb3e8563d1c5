"""The lifted map at the hand's port, frequency by frequency, in the basis of the aliases."""

from dataclasses import replace

import numpy as np

from wavesweep.analysis.passivity.aliases import alias_angles, response_of
from wavesweep.analysis.passivity.port_loop import PortLoop
from wavesweep.analysis.passivity.secular import smallest_hermitian
from wavesweep.lifted.circle import on_circle

LOWEST = 1e-7  # rad per frame that stands for zero frequency, where shares are 0/0 and a drift has its pole


class PortResponse:
    """The lifted map as a diagonal (the fast way of each alias) and a mixture of low rank (the way over the slow side).

    Where the fast side samples a position that nothing holds, its response has the pole z = 1, which only the slow loop
    takes away: a difference of large numbers. There the mixture is put together from displacements: to shift the sample
    by p is to shift the state x by p, and that is an input (z - 1) p of the closed loop.
    """

    def __init__(self, loop: PortLoop, lowest: float = LOWEST):
        self.ratio, self.delay, self.lowest = loop.ratio, loop.delay, lowest
        fast, slow = loop.fast, loop.slow
        self.shifted = _drifts(fast)
        if self.shifted:
            fast, slow = _from_displacements(fast, slow)
        self.fast, self.slow = response_of(fast, loop.loops), response_of(slow, loop.loops)

    def parts(self, owner, theta):
        """d `(points, M)`, left `(points, M, r)`, right `(points, r, M)` of `diag(d) + left right`; theta not 0."""
        phi = alias_angles(theta, self.ratio)
        fast = self.fast.at(owner, phi)
        slow = self.slow.at(owner, theta[:, None])[:, 0]
        share = np.exp(-1j * phi * self.delay) * on_circle(-theta)[:, None] / (self.ratio * on_circle(-phi))
        left = (fast[..., 0, 1:] * share[..., None]) @ slow
        right = np.swapaxes(fast[..., 1:, 0], -1, -2)
        if self.shifted:
            shift = fast[..., 0, 0] * on_circle(theta)[:, None] / on_circle(phi)
            right = np.concatenate([right, shift[:, None, :]], axis=1)
        return fast[..., 0, 0], left, right

    def smallest(self, owner, theta):
        """Smallest eigenvalue of the Hermitian part (m/N) of the loops `owner` at `theta` (rad per frame)."""
        return smallest_hermitian(*self.parts(owner, np.maximum(theta, self.lowest)))


def _drifts(fast):
    """Whether a sampled position is held by nothing on the fast side, and its displacement comes out of it."""
    if fast.outputs[0] != "device.dx":
        return False
    return "device.x" in fast.states and not np.any(fast.E[..., fast.states.index("device.x")])


def _from_displacements(fast, slow):
    """The fast side without its position; the slow side with an input that shifts the position of the scene."""
    x = fast.states.index("device.x")
    rest = [i for i in range(len(fast.states)) if i != x]
    fast = replace(
        fast, states=tuple(fast.states[i] for i in rest), positions=frozenset(), E=fast.E[..., rest, :][..., rest],
        B=fast.B[..., rest, :], C=fast.C[..., rest],
    )
    push = np.zeros((*slow.B.shape[:-1], 1))
    push[..., [i for i, name in enumerate(slow.states) if name == "frame.device.x"], 0] = 1
    return fast, replace(
        slow, inputs=(*slow.inputs, "shift"), B=np.concatenate([slow.B, push], axis=-1),
        D=np.concatenate([slow.D, np.zeros((*slow.D.shape[:-1], 1))], axis=-1),
    )
