"""The table `stability-map`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from wavesweep.maps.stability_map import stability_map
from wavesweep.program.columns import Columns
from wavesweep.program.number_words import rounded_down, rounded_up, span_in_words
from wavesweep.program.tables.kind import Line, Numbers, count, from_spec, whole_kind


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    shares = {}
    for word in ("stable", "unstable", "open"):
        shares[word] = float(columns["share"][columns["proved"] == word].sum())
    outside: dict[str, float] = {}
    for number in np.unique(columns["outside"][columns["outside"] > 0]).tolist():
        outside[f"{number:g}"] = float(columns["share"][columns["outside"] == number].sum())
    told = {name: facts[name] for name in ("numbers", "ends", "own", "about", "wanted")}
    return {"parts": len(columns["share"]), **shares, "outside": outside, **told}


def _lines(found: Numbers) -> Iterator[Line]:
    plane = " by ".join(found["numbers"])
    shares = ", ".join(
        f"{rounded_down(100 * found[word])} % proved {word}" for word in ("stable", "unstable")
    )
    open_ = f"{rounded_up(100 * found['open'], 3)} % open"
    parts = f"{plane}: {count(found['parts'], 'part')}"
    yield f"{parts}, {shares}, {open_}", found["open"] > found["wanted"]
    if found["open"] > found["wanted"]:
        yield "  narrower ranges leave less open", True
    for outside, share in found["outside"].items():
        eigenvalues = "1 eigenvalue" if outside == "1" else f"{outside} eigenvalues"
        yield f"  {rounded_down(100 * share)} % with {eigenvalues} outside the unit circle", False
    if found["about"]:
        spans = zip(found["numbers"], *found["about"], strict=True)
        sides = ", ".join(f"{name} {span_in_words(low, high)}" for name, low, high in spans)
        yield f"  the largest rectangle about the own design, all stable: {sides}", False


KINDS = (
    whole_kind(
        "stability-map",
        _numbers,
        _lines,
        "wavesweep.maps.figure.stability_map",
        again=from_spec(stability_map, "numbers", "wanted"),
    ),
)
