"""Where digits are lost: hard cases against 50 digits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wavesweep.analysis.response import prepare, steady_state
from wavesweep.bench import hard, ours
from wavesweep.bench.references import references
from wavesweep.bench.scoring import score
from wavesweep.bench.table import Row
from wavesweep.diagram import draw
from wavesweep.loop import compile as compile_loop
from wavesweep.spec import load

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
    for case, truth in zip(hard.ENDS, references()["hard_ends"], strict=True):
        table = compile_loop(case.spec()).stable_intervals(case.along, case.span)
        found = score(ours.answer_of(table), [truth], case.span)
        error = found.error_max if found.found == found.there and not found.wrong else np.nan
        yield _row("end of a stable interval", case.condition, error, _said(table))


def _said(table) -> str:
    return "certified" if table.certified.all() else "not certified, and says so"


def _ends_anywhere() -> Iterator[Row]:
    """With K_VE at its critical value the loop is critical at its own b, K_LM, Kp and mass: an end is known without
    further arithmetic, to the sensitivity of K_VE's end times rounding."""
    spec = load({"controller": {"kind": "pmw-lm", "Kp": 20.0}, "environment": {"integration": "explicit"}})
    critical = compile_loop(spec).stable_intervals("K_VE").high.iloc[0]
    loop = compile_loop(spec.with_values({"environment.K_VE": critical}))
    for name, span in ANYWHERE.items():
        table = loop.stable_intervals(name, span)
        true = spec.values["device.mass" if "." in name else {"K_LM": "local_model.K_LM"}.get(name, f"controller.{name}")]
        error = np.nanmin(np.abs(np.append(table.low, table.high) / true - 1))
        yield _row("end of a stable interval", f"along {name}", error, _said(table))


def _responses() -> Iterator[Row]:
    for case, ((Y_re, Y_im, Z_re, Z_im),) in zip(hard.RESPONSES, references()["hard_responses"], strict=True):
        values = case.values()
        loop = prepare(draw(values), values["environment.K_VE"], values["environment.B_VE"])
        Y, Z = (part[0] for part in steady_state(loop, np.array([case.frequency_hz])))
        for name, got, true in (("admittance", Y, complex(Y_re, Y_im)), ("transmitted impedance", Z, complex(Z_re, Z_im))):
            yield _row(name, case.condition, float(abs(got / true - 1)))
