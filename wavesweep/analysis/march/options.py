"""What an experiment has and the model leaves out; each is off unless asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

from wavesweep.errors import UsageError


@dataclass(frozen=True)
class Options:
    """Features of a simulated experiment. With all of them off a simulation is the linear march to the bit.

    Parameters:
    `wall` the position (m) above which a one-sided wall stands, None for the model's wall on both sides of 0;
    `resolution` of the encoder (m), 0 for none: position is the nearest step, velocity its difference where the spec
    says ``difference`` (an ``exact`` velocity stays exact);
    `max_force` of the motors (N), None for no limit: the device exerts ``f_m`` cut off there, the controller knows
    nothing of it;
    `friction` Coulomb's (N), at rest as in motion;
    `jitter` (part of a tick, below 1): every fast tick is longer or shorter by up to that part, evenly spread; the
    device moves for the real length, the controller counts with the nominal one;
    `late` the most ticks by which a slow result can be late, evenly spread over 0 to `late`;
    `dropped` the probability (0 to 1) that a slow result never comes: the fast loop holds what it has;
    `seed` of jitter, lateness and drops, which do not change each other's numbers.

    Errors: `UsageError` for a number out of range.
    """

    wall: float | None = None
    resolution: float = 0.0
    max_force: float | None = None
    friction: float = 0.0
    jitter: float = 0.0
    late: int = 0
    dropped: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what has no meaning, naming the option, what was found and what was expected."""
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and not math.isfinite(value):
                raise UsageError(f"option {field.name}: expected a finite number, found {value}")
            if value is not None and field.name != "wall" and value < 0:
                raise UsageError(f"option {field.name}: expected a number >= 0, found {value}")
        if self.jitter >= 1:
            raise UsageError(f"option jitter: expected a part of a tick below 1, found {self.jitter}")
        if self.dropped > 1:
            raise UsageError(f"option dropped: expected a probability of at most 1, found {self.dropped}")
        if self.late != int(self.late):
            raise UsageError(f"option late: expected a whole number of ticks, found {self.late}")


def changed(options: Options, changes: Mapping[str, float | None]) -> Options:
    """Give the options with some of them changed.

    Errors: `UsageError` for a name that is no option, or a number out of range.
    """
    known = [field.name for field in fields(Options)]
    unknown = [name for name in changes if name not in known]
    if unknown:
        raise UsageError(f"option {', '.join(unknown)}: expected some of {', '.join(known)}, found an unknown name")
    return replace(options, **changes)
