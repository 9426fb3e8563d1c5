"""Hard cases in which digits are lost, against references of 50 digits; each is named by its difficulty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import wavesweep
from bench.measuring import Row
from bench.problems import references, score
from bench.this_tool import answer_of
from wavesweep import Spec, load
from wavesweep.engine._response.steady import respond
from wavesweep.program.analyses.spec_loops import loop_at_hand

_EXPLICIT = {"environment": {"integration": "explicit"}}


def _order(order: int, cutoff_hz: float) -> dict[str, Any]:
    return {"filters": {"lp1": {"order": order, "cutoff_hz": cutoff_hz}}}


@dataclass(frozen=True)
class Case:
    """A loop and the condition that makes it hard; tables: as in a spec's file, besides the controller's kind."""

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
ANYWHERE = {"b": (5.0, 60.0), "K_LM": (10.0, 3000.0), "Kp": (1.0, 60.0), "device.mass": (0.02, 1.0)}


def rows() -> Iterator[Row]:
    """An error for each hard case."""
    yield from _ends()
    yield from _ends_anywhere()
    yield from _responses()


def _row(quantity: str, condition: str, error: float, certified: str = "") -> Row:
    return {"part": "accuracy", "problem": quantity, "method": "this tool", "setting": condition, "error_max": error,
            "error_median": error, "yardstick": certified}  # fmt: skip


def _ends() -> Iterator[Row]:
    for case, truth in zip(ENDS, references()["hard_ends"], strict=True):
        table = wavesweep.compile(case.spec()).stable_intervals(case.along, case.span)
        found = score(answer_of(table), [truth], case.span)
        error = found.error_max if found.found == found.there and not found.wrong else np.nan
        yield _row("end of a stable interval", case.condition, error, _said(table))


def _said(table) -> str:
    return "certified" if table.certified.all() else "not certified, and says so"


def _ends_anywhere() -> Iterator[Row]:
    """With K_VE at its critical value the loop is critical at its own b, K_LM, Kp and mass. So an end is known without
    further arithmetic, to the sensitivity of K_VE's end times rounding."""
    spec = load({"controller": {"kind": "pmw-lm", "Kp": 20.0}, "environment": {"integration": "explicit"}})
    critical = wavesweep.compile(spec).stable_intervals("K_VE").high.iloc[0]
    loop = wavesweep.compile(spec.with_values({"environment.K_VE": critical}))
    for name, span in ANYWHERE.items():
        table = loop.stable_intervals(name, span)
        true = spec.values["device.mass" if "." in name else {"K_LM": "local_model.K_LM"}.get(name, f"controller.{name}")]
        error = np.nanmin(np.abs(np.append(table.low, table.high) / true - 1))
        yield _row("end of a stable interval", f"along {name}", error, _said(table))


def _responses() -> Iterator[Row]:
    for case, ((Y_re, Y_im, Z_re, Z_im),) in zip(RESPONSES, references()["hard_responses"], strict=True):
        found = respond(loop_at_hand(case.spec()), case.frequency_hz)
        Y, Z = found.admittance[0], found.impedance[0]
        for name, got, true in (("admittance", Y, complex(Y_re, Y_im)), ("transmitted impedance", Z, complex(Z_re, Z_im))):
            yield _row(name, case.condition, float(abs(got / true - 1)))
