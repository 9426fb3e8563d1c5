"""Frames as they were measured: the table `identify-frames`, with the lengths in its facts and its summary."""

import time
from collections.abc import Iterator, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.core.columns import Columns
from wavesweep.core.reproducibility import versions
from wavesweep.core.spec.writing import as_toml
from wavesweep.core.tables.kind import Line, Numbers, count, whole_kind
from wavesweep.core.tables.table import Table
from wavesweep.frame_times.chain import are_independent, pairs_of
from wavesweep.frame_times.times import read_run

METHOD = "durations in ticks, rounded; pairs of neighbours counted, and held against runs whose order is shuffled"
SHOWN = 8  # lengths in a summary, and lengths after each
MOST = 64  # values of a number that varies in [for_all]


def identified(path: str, fast_hz: float, number: str, columns: Mapping[str, str], scales: Mapping[str, float]) -> Table:
    """The lengths of frames in a file, and which follow which.

    number: the name in [for_all] of what gives a frame's length. columns, scales: see `times.read_run`, as are the errors.
    """
    started = time.perf_counter()
    run = read_run(path, fast_hz, columns, scales)
    lengths, values = run.lengths, run.values
    pairs, unfit = pairs_of(lengths, values), np.flatnonzero(run.unfit)
    asked = {"fast_hz": fast_hz, "number": number, "columns": dict(columns), "scales": dict(scales)}
    off = np.abs(run.ticks - np.round(run.ticks))
    facts = {
        "schema_version": 1,
        **versions(),
        "spec_name": Path(path).stem,
        "spec_sha256": sha256(f"{run.sha256} {sorted(asked.items(), key=str)}".encode()).hexdigest(),
        "log_sha256": run.sha256,
        "asked": asked,
        "frames": len(lengths),
        "duration_s": float(run.ticks.sum() / fast_hz),
        "lengths": [
            {"ticks": int(ticks), "frames": int((lengths == ticks).sum()), "next": row.tolist()}
            for ticks, row in zip(values, pairs, strict=True)
        ],
        "independent": are_independent(lengths, values),
        "unfit": {"frames": len(unfit), "worst": float(off.max())}
        | ({"begins_s": float(run.begins[unfit[0]]), "ticks": float(run.ticks[unfit[0]])} if len(unfit) else {}),
        "notices": [],
        "methods": {"identify": METHOD},
        "timings": {"compute_s": round(time.perf_counter() - started, 6)},
    }
    first, after = np.nonzero(pairs)
    counts = pairs[first, after]
    found = {"ticks": values[first], "next_ticks": values[after], "pairs": counts, "share": counts / pairs.sum(1)[first]}
    return Table.of("identify-frames", found, facts)


def _numbers(_: Columns, facts: Mapping[str, Any]) -> Numbers:
    of_run = ("frames", "duration_s", "lengths", "independent", "unfit")
    return {"fast_hz": facts["asked"]["fast_hz"]} | {name: facts[name] for name in of_run}


def _lines(found: Numbers) -> Iterator[Line]:
    rows, tick = found["lengths"], 1e3 / found["fast_hz"]
    mean = found["duration_s"] * found["fast_hz"] / found["frames"]
    ticks = [each["ticks"] for each in rows]
    span = f"{ticks[0]} to {ticks[-1]} ticks" if len(ticks) > 1 else count(ticks[0], "tick")
    yield (
        f"{count(found['frames'], 'frame')} in {found['duration_s']:.6g} s: {span} of {tick:.6g} ms, {mean:.6g} on average",
        False,
    )
    frequent = sorted(rows, key=lambda each: -each["frames"])[:SHOWN]
    for each in (each for each in rows if each in frequent):
        after = sorted(((n, length) for n, length in zip(each["next"], ticks, strict=True) if n), reverse=True)
        shares = ", ".join(f"{length} ({100 * n / sum(each['next']):.3g} %)" for n, length in after[:SHOWN])
        more = f"; the next one: {shares}{', ...' if len(after) > SHOWN else ''}" if after and len(ticks) > 1 else ""
        yield f"  {count(each['ticks'], 'tick')}: {100 * each['frames'] / found['frames']:.3g} % of frames{more}", False
    if len(rows) > SHOWN:
        yield f"  and {count(len(rows) - SHOWN, 'rarer length')}, which the table has", False
    if len(rows) > 1 and found["independent"]:
        yield "the length of a frame does not depend on that of the frame before, as far as this run shows", False
    elif len(rows) > 1:
        yield "the length of a frame depends on that of the frame before: shares alone do not describe this run", False
    unfit = found["unfit"]
    if unfit["frames"]:
        of, low = f"{unfit['frames']} of {count(found['frames'], 'frame')}", int(unfit["ticks"])
        first = f"the first of {unfit['ticks']:.6g} ticks at {unfit['begins_s']:.6g} s"
        counted = f"the loop may count {low} or {low + 1}, and both are in [for_all]"
        yield f"{of} do not last whole ticks, but up to {unfit['worst']:.2g} more or less; {first}: {counted}", True
    if len(rows) > MOST:
        yield (
            f"[for_all] takes at most {MOST} lengths, found {len(rows)}: choose longer ticks, or make frames more regular",
            True,
        )


def spec_text(facts: Mapping[str, Any]) -> str:
    """The table [for_all] with the lengths, as a piece of a spec."""
    rows, asked, unfit = facts["lengths"], facts["asked"], facts["unfit"]["frames"]
    shares = [each["frames"] for each in rows]
    lines = [
        f"# The frames of {facts['spec_name']}, as wavesweep identify found them, for a spec of {asked['fast_hz']:g} Hz.",
        f"# {count(facts['frames'], 'frame')} in {facts['duration_s']:.6g} s.",
        *([f"# Of {count(unfit, 'frame')} that did not last whole ticks, both neighbours are here."] if unfit else []),
    ]
    table: dict[str, Any] = {"values": [each["ticks"] for each in rows], "varying": True}
    if len(rows) > 1 and facts["independent"]:
        lines.append("# shares: how often each length occurred; without it, only answers for any order are given.")
        table["shares"] = shares
    elif len(rows) > 1:
        lines.append("# next: how often each length followed each; without it, only answers for any order are given.")
        table["next"] = [each["next"] if any(each["next"]) else shares for each in rows]
    return "\n".join(lines) + "\n" + as_toml({"for_all": {asked["number"]: table}})


KINDS = (whole_kind("identify-frames", _numbers, _lines, "wavesweep.frame_times.figure.identify_frames"),)
