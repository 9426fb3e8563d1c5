"""One frame of the loop, seen from the hand's port, as a scattering element."""

import numpy as np

from wavesweep.analysis.passivity.port_loop import PortLoop
from wavesweep.analysis.passivity.scattering import Element, passage, repeated, then, tick


def level_frame(loop: PortLoop, owner, level) -> Element:
    """One frame with the balance `2 f (x+ - x) - 2 level f^2`.

    Its state: that of the fast side, held signals, that of the slow side, pending signals. Phase 0 makes new values of
    the held signals, which are pending until phase `delay`.
    """
    fast, event = loop.fast, loop.event
    n, h, s = len(fast.states), len(fast.inputs) - 1, len(event.states) - len(fast.states)
    pending = h if loop.delay else 0
    size, k = n + h + s + pending, owner.size
    own, held, slow, late = (slice(a, b) for a, b in ((0, n), (n, n + h), (n + h, n + h + s), (n + h + s, size)))
    A, B, C = np.zeros((k, size, size)), np.zeros((k, size, 1)), np.zeros((k, 1, size))
    A[:] = np.eye(size)
    A[:, own, own] += fast.E[owner]
    A[:, own, held], B[:, own] = fast.B[owner][..., 1:], fast.B[owner][..., :1]
    C[..., own], C[..., held] = fast.C[owner][:, :1], fast.D[owner][:, :1, 1:]
    every = tick(A, B, 0 * A, np.swapaxes(C, -1, -2), 2 * (fast.D[owner][:, :1, :1] - level[:, None, None]))
    moved = np.zeros((k, size, size))
    moved[:] = np.eye(size)
    both = np.r_[own, slow]
    moved[:, both[:, None], both] += event.E[owner]
    target = late if pending else held
    moved[:, target] = 0
    moved[:, target, both] = event.C[owner]
    if not pending:
        return then(passage(moved), repeated(every, loop.ratio))
    moved[:, both, held] = event.B[owner]
    moved[:, target, held] = event.D[owner]
    shown = np.zeros((k, size, size))
    shown[:] = np.eye(size)
    shown[:, held] = 0
    shown[:, held, late] = np.eye(h)
    first, second = repeated(every, loop.delay), repeated(every, loop.ratio - loop.delay)
    return then(then(passage(moved), first), then(passage(shown), second))
