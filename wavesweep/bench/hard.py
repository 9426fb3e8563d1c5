"""Cases where digits are lost: each names what is hard about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from wavesweep.spec import Spec, load

_EXPLICIT = {"environment": {"integration": "explicit"}}


def _order(order: int, cutoff_hz: float) -> dict[str, Any]:
    return {"filters": {"lp1": {"order": order, "cutoff_hz": cutoff_hz}}}


@dataclass(frozen=True)
class Case:
    """A loop with what makes it hard; tables: as in a spec's file, besides the controller's kind."""

    condition: str
    kind: str
    tables: Mapping[str, Any]
    along: str = "K_VE"
    span: tuple[float, float] = (0.0, 20000.0)
    frequency_hz: float = 10.0

    def spec(self) -> Spec:
        """The loop as a spec."""
        return load({**self.tables, "controller": {"kind": self.kind}})

    def values(self) -> dict[str, Any]:
        """Flat values of the loop."""
        return dict(self.spec().values)


ENDS = (
    Case("pmw-lm with its defaults, explicit wall", "pmw-lm", _EXPLICIT),
    Case("pmw-lm with its defaults, explicit wall, along B_VE", "pmw-lm", _EXPLICIT, "B_VE", (0.0, 100.0)),
    Case("dc-slow with its defaults", "dc-slow", {}),
    Case("LP1 of 6th order at 3 Hz", "pmw", _EXPLICIT | _order(6, 3.0)),
    Case("LP1 of 12th order at 10 Hz", "pmw", _EXPLICIT | _order(12, 10.0)),
    Case("LP1 of 12th order at 1 Hz, poles within 1e-3 of each other", "pmw", _EXPLICIT | _order(12, 1.0)),
    Case("ratio 200", "pmw", _EXPLICIT | {"rates": {"fast_hz": 10000.0, "ratio": 200}}),
    Case("ratio 1000", "pmw", _EXPLICIT | {"rates": {"fast_hz": 50000.0, "ratio": 1000}}),
    Case("a device of 1 mg", "dc-slow", {"device": {"mass": 1e-6}}),
    Case(
        "two crossings close together, about to merge", "pmw",
        {"environment": {"integration": "explicit", "B_VE": 2.16304}, "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}}},
    ),
)  # fmt: skip

RESPONSES = (
    Case("10 Hz", "pmw-lm", {}, frequency_hz=10.0),
    Case("1e-3 Hz, next to the drift pole", "pmw-lm", {}, frequency_hz=1e-3),
    Case("50 Hz, the slow rate itself", "pmw-lm", {}, frequency_hz=50.0),
    Case("100.00001 Hz, next to twice the slow rate", "pmw-lm", {}, frequency_hz=100.00001),
    Case("499.9 Hz, next to the fast Nyquist frequency", "pmw-lm", {}, frequency_hz=499.9),
    Case("LP1 of 10th order at 1 Hz, seen at 0.1 Hz", "pmw", _order(10, 1.0), frequency_hz=0.1),
    Case("LP1 of 12th order at 10 Hz", "pmw", _order(12, 10.0), frequency_hz=10.0),
    Case("ratio 200", "pmw", {"rates": {"fast_hz": 10000.0, "ratio": 200}}, frequency_hz=10.0),
)
