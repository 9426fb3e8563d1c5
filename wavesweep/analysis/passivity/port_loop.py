"""The loop as the hand's port sees it: one fast block between the frames' events."""

import math
from dataclasses import dataclass, replace

import numpy as np

from wavesweep.analysis.passivity.aliases import flattened
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted.connect import connect
from wavesweep.lifted.lift import fast_side, slow_side, wall_sum


@dataclass(frozen=True, slots=True, eq=False)
class PortLoop:
    """Both rates with the wall in place, one loop per element of the flattened `batch`.

    fast: from `f_h` and the held signals to the displacement in the tick and the samples, a block of the tick.
    slow: from what the hand adds to the samples to the sources of the held signals, a block of the frame.
    event: what happens at phase 0: its states are those of `fast` and of the slow blocks, its inputs the held signals
    as shown (none without delay), its outputs their sources.
    finite: `(loops,)`, false where the frame overflowed; the slow block is zero there.
    source: the drawing and its wall (K_VE, B_VE).
    """

    fast: Block
    slow: Block
    event: Block
    ratio: int
    delay: int
    batch: tuple[int, ...]
    finite: np.ndarray
    source: tuple

    @property
    def loops(self) -> int:
        """How many loops there are."""
        return math.prod(self.batch)

    @property
    def mean(self) -> np.ndarray:
        """Mean eigenvalue of the port's Hermitian part over all frequencies (m/N), `(loops,)`: its direct term."""
        return self.fast.D[:, 0, 0]


def port_loop(diagram: Diagram, K_VE, B_VE, seen: str | None = None) -> PortLoop:
    """Connect both rates; `K_VE` (N/m), `B_VE` (N*s/m): numbers or arrays over the diagram's batch.

    seen: the fast signal that the port shows, by default the displacement of the hand's device.
    """
    samples = tuple(diagram.samples.values())
    fast = _without_idle(fast_side(diagram, (seen or diagram.hand.displacement, *samples)))
    held = fast.inputs[1:]
    sources = tuple(diagram.holds[name] for name in held)
    wall = wall_sum(diagram, K_VE, B_VE)
    with np.errstate(over="ignore", invalid="ignore"):
        slow, _ = slow_side(diagram, sources, injected=True, wall=wall)
    event = _event(diagram, fast, held, sources, wall)
    batch = np.broadcast_shapes(fast.batch, slow.batch, event.batch, np.shape(diagram.period))
    fast, slow, event = (flattened(block, batch) for block in (fast, slow, event))
    finite = np.logical_and.reduce([np.isfinite(getattr(slow, name)).all((-1, -2)) for name in "EBCD"])
    slow = replace(slow, **{name: np.where(finite[:, None, None], getattr(slow, name), 0) for name in "EBCD"})
    return PortLoop(fast, slow, event, diagram.ratio, diagram.delay, batch, finite, (diagram, K_VE, B_VE))


def _without_idle(fast: Block) -> Block:
    """Leave out the held signals that nothing reads."""
    keep = [i for i in range(len(fast.inputs)) if i == 0 or np.any(fast.B[..., i]) or np.any(fast.D[..., i])]
    return replace(fast, inputs=tuple(fast.inputs[i] for i in keep), B=fast.B[..., keep], D=fast.D[..., keep])


def _event(diagram, fast, held, sources, wall) -> Block:
    """Sampler, slow blocks and wall at one instant; the fast states stand still."""
    samples = tuple(diagram.samples.values())
    n, shape = len(fast.states), fast.B.shape[:-2]
    reader = Block(
        "tick", held, samples, fast.states, np.zeros((*shape, n, n)), np.zeros((*shape, n, len(held))),
        fast.C[..., 1:, :], fast.D[..., 1:, 1:],
    )
    shown = () if diagram.delay == 0 else tuple(f"shown.{name}" for name in held)
    sums = dict(diagram.sums) | wall
    for name, source in zip(held, shown or sources, strict=True):
        sums[f"tick.{name}"] = {source: 1}
    for name, source in diagram.samples.items():
        sums[name] = {f"tick.{source}": 1}
    return connect("event", (reader, *diagram.slow), sums, shown, sources)
