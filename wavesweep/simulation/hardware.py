"""Effects of hardware and real-time systems: sensing, actuation, timing, and slow results in
transit.

Every effect is off by default. Time is a whole number of fast ticks.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import accumulate

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Rejected, check
from wavesweep.simulation.keys import KEYS


@dataclass(frozen=True)
class Effects:
    """Effects of a simulated experiment beyond the linear model; all of them are off by default.

    Parameters: `wall` the position (m) above which there is a one-sided wall, None for the model's
    wall on both sides of 0;
    `pulls` whether its damper may pull inside; otherwise its force is ``max(0, K depth + B
    speed)``, outside too;
    `resolution` of the encoder (m), 0 for none: position is the nearest step, velocity its
    difference if the spec says ``difference`` (an ``exact`` velocity stays exact);
    `max_force` of the motors (N), None for no limit: the device exerts ``f_m`` cut off there, which
    the controller does not take into account;
    `friction` Coulomb's (N), the same at rest and in motion;
    `jitter` (part of a tick, at most 0.9): every fast tick is longer or shorter by up to that part,
    uniformly; the device moves for the real length, the controller uses the nominal one;
    `ticks` the real lengths of fast ticks (s) in turn, repeated for ever, in place of jitter; None
    for none;
    `late` the largest delay of a slow result in ticks, uniformly from 0 to `late`;
    `dropped` the probability (0 to 1) that a slow result is lost: the fast loop holds the one
    before;
    `seed` of jitter, lateness and losses, also of the messages of channels and of frames at random,
    which have independent streams of numbers.

    Errors: `UsageError` for a number out of range.
    """

    wall: float | None = None
    pulls: bool = True
    resolution: float = 0.0
    max_force: float | None = None
    friction: float = 0.0
    jitter: float = 0.0
    ticks: tuple[float, ...] | None = None
    late: int = 0
    dropped: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Reject a value that its key in [simulate] would not have."""
        if self.ticks is not None and not (self.ticks and min(self.ticks) > 0):
            raise UsageError(f"option ticks: expected lengths > 0 in s, found {self.ticks!r}")
        for field in fields(self):
            if field.name == "ticks":
                continue
            value = getattr(self, field.name)
            if not (value is None and field.default is None):
                try:
                    check(
                        KEYS[f"simulate.{field.name}"],
                        value.item() if isinstance(value, np.generic) else value,
                    )
                except Rejected as error:
                    raise UsageError(f"option {field.name}: {error}") from None

    @property
    def uneven(self) -> bool:
        """Whether ticks have other lengths than the nominal one."""
        return bool(self.jitter or self.ticks)


def encoder(resolution: float) -> Callable[[float], float]:
    """Return a function of the position (m) that gives the nearest step of the encoder."""
    if resolution == 0.0:
        return lambda x: x
    return lambda x: (
        # Beyond 2^53 encoder steps every double is one.
        resolution * math.floor(x / resolution + 0.5) if abs(x) < 2.0**53 * resolution else x
    )


def tick_lengths(effects: Effects, T: float, ticks: int) -> np.ndarray:
    """Return the length of every fast tick (s): those in turn, or ``T·(1 + jitter·U)`` with
    ``U`` uniform over -1 to 1."""
    if effects.ticks:
        return np.resize(effects.ticks, ticks)
    if effects.jitter == 0:
        return np.full(ticks, T)
    source = _source(effects, 0)
    return T * (1 + effects.jitter * source.uniform(-1.0, 1.0, ticks))


def lateness(effects: Effects, results: int, *stream: int) -> list[int | None]:
    """Return the ticks by which each slow result is late, None for one that is lost; stream: a
    number of another slow loop."""
    late = (
        _source(effects, 1, *stream).integers(0, int(effects.late), results, endpoint=True).tolist()
    )
    lost = _source(effects, 2, *stream).uniform(size=results) < effects.dropped
    return [None if gone else ticks for ticks, gone in zip(late, lost.tolist(), strict=True)]


def losses(
    effects: Effects, keys: Mapping[str, float], messages: int, *stream: int
) -> list[int | None]:
    """Return what happens to each message of a channel with these keys: 0, or None for one that
    is lost at random; stream: a number of another channel."""
    changes, lost = _source(effects, 3, *stream).uniform(size=(2, messages))
    lost_frames = []
    burst = False
    for change, chance in zip(changes.tolist(), lost.tolist(), strict=True):
        burst = change >= keys["burst_end"] if burst else change < keys["burst"]
        lost_frames.append(None if chance < (keys["burst_loss"] if burst else keys["loss"]) else 0)
    return lost_frames


def random_frames(effects: Effects) -> Callable[[Sequence[float]], int]:
    """Return what draws an index, with these probabilities of each."""
    source = _source(effects, 4)

    def drawn(chances: Sequence[float]) -> int:
        return min(
            bisect_right(list(accumulate(chances)), source.uniform() * sum(chances)),
            len(chances) - 1,
        )

    return drawn


def _source(effects: Effects, *stream: int) -> np.random.Generator:
    """Return the random stream of one effect, so that enabling one does not change the numbers
    of the others."""
    return np.random.default_rng(np.random.SeedSequence(int(effects.seed), spawn_key=stream))
