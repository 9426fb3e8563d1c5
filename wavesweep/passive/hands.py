"""Intervals guaranteed for hands: every passive hand, a passive port, or two of them; and those
of a passive channel."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.intervals import blank_records
from wavesweep.engine.loop import Loops
from wavesweep.haptics.felt import RECORD
from wavesweep.haptics.held_loop import HeldLoop, held_loop
from wavesweep.passive.port_ranges import channel_ranges, hand_ranges, pair_ranges, port_ranges
from wavesweep.program.analyses.claims import (
    PASSIVE_HANDS,
    STABLE,
    Property,
    Scope,
    Status,
    own_scope,
)
from wavesweep.program.analyses.interval_jobs import Guarantee
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.job import Job

PASSIVE = (
    "determinant of {}, a power series over number and angle with sampled bounds, positive by Bernstein coefficients; outside, "
    "angles and directions in which energy comes out"
)
WHAT = {
    "passive": STABLE,
    "port": Property("passive at the hand's port for forces held over a tick", short="passive"),
    "ports": Property("absolutely stable at both ports", short="absolutely stable"),
    "channel": Property("passive in the wave channel to within the tolerance", short="passive"),
}
METHODS = {
    "passive": PASSIVE.format(
        "the Hermitian part of the map from displacement to force, with what the damping takes"
    ),
    "port": PASSIVE.format("the Hermitian part of the map from the held force to the displacement"),
    "ports": PASSIVE.format(
        "the Hermitian part of the map at both ports with weights of their frequencies, chosen box by box"
    ),
    "channel": PASSIVE.format("what the channel's losses leave of the tolerance"),
}


@dataclass(frozen=True, slots=True)
class PassiveGuarantee(Guarantee):
    """What an interval is guaranteed for: "passive" hands, "port", "ports" or "channel"; see
    `METHODS`.

    tolerance: J per J sent that the channel may add.
    """

    kind: str
    tolerance: float = 0.0
    dtype = RECORD
    status = Status.CHECKED

    @property
    def method(self) -> str:
        """How the intervals are found, in a line."""
        return METHODS[self.kind]

    @property
    def word(self) -> str:
        """The guarantee as a word of --for-hands."""
        if self.kind == "channel":
            return f"channel:{self.tolerance!r}"
        return self.kind

    @property
    def order(self) -> int:
        """Of the rows in a table: those of a box are between the first two."""
        return 2 * [*METHODS].index(self.kind)

    @property
    def own_ticks(self) -> bool:
        """Whether forces are held over the spec's own ticks."""
        return self.kind in ("port", "ports")

    @property
    def replaces(self) -> bool:
        """Whether other hands are in the place of the spec's operator."""
        return self.kind == "passive"

    @property
    def what(self) -> Property:
        """What its rows say of their loops."""
        return WHAT[self.kind]

    def scope(self, spec: Spec) -> Scope:
        """The spec's own numbers, with every passive hand in place of its operator if the rows
        are of these."""
        own = own_scope(spec)
        if self.kind == "passive":
            return replace(own, hands=PASSIVE_HANDS)
        return own

    def notices(self, job: Job) -> Iterable[str]:
        """Yield the notice that no interval can be guaranteed for every passive hand, if that is
        known beforehand."""
        spec = job.grid.spec
        if (
            self.kind != "passive"
            or spec.kind not in ("pmw", "pmw-lm")
            or spec.values["rates.ratio"] == 1
        ):
            return
        swept = any(axis.path == "controller.Kp" for axis in (*job.grid.axes, job.asked.axis))
        if not swept and spec.values["controller.Kp"] == 0:
            yield "waves without Kp: a motion at a multiple of the slow rate drags the avatar along, and no damping is enough"

    def records_of(self, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
        """The intervals of one loop; it takes from tenths of a second to some seconds."""
        return self.records(held_loop(loop), along, span)

    def records(self, loop: HeldLoop, along: str, span: tuple[float, float]) -> np.ndarray:
        """Intervals of the key `along` within `span` for one loop, as records of slice 0."""
        ranges = {"port": port_ranges, "ports": pair_ranges, "passive": hand_ranges}
        of_channel = self.kind == "channel"
        if of_channel:
            intervals = channel_ranges(loop, along, span, self.tolerance)
        else:
            intervals = ranges[self.kind](loop, along, span)
        records = blank_records(intervals.low, intervals.high, RECORD)
        records["certified"] = intervals.certified if intervals.low.size else intervals.complete
        records["doubt"] = np.where(records["certified"], Doubt.NONE, Doubt.SEARCH)
        for end, border, sign in zip(("low", "high"), span, (-1, 1), strict=True):
            for at in np.flatnonzero(records[end] != border) if intervals.low.size else ():
                records[f"{end}_omega"][at] = intervals.frequency(float(records[end][at]), sign)
        return records
