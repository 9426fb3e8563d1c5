"""Frames as they were measured: the table `identify-frames`, with the lengths in its facts and
its summary."""

import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from hashlib import sha256
from math import ceil, floor, log10
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.frame_times.chain import are_independent, pairs_of
from wavesweep.frame_times.times import EVEN, MeasuredFrames, read_run
from wavesweep.program.columns import Columns
from wavesweep.program.number_words import rounded_up, span_around
from wavesweep.program.platform_compat import versions
from wavesweep.program.reading.keys import HIGHEST_RATIO, MOST_VARYING
from wavesweep.program.spec.writing import as_toml
from wavesweep.program.tables.kind import Line, Numbers, count, whole_kind
from wavesweep.program.tables.table import Table

METHOD = "durations in ticks, rounded; pairs of neighbours counted, and held against runs whose order is shuffled"
LENGTHS_SHOWN = 8  # lengths in a summary, and lengths after each
# lengths of a chain: of a loop of eight states these have 720 second moments, and a proof takes 800
MOST_NEXT = 20


def identified(
    path: str,
    fast_hz: float,
    number: str,
    columns: Mapping[str, str],
    scales: Mapping[str, float],
    every: int | None = None,
) -> Table:
    """The lengths of frames in a file, and which follow which.

    number: the name in [for_all] of what gives a frame's length. columns, scales: see
    `times.read_run`. every: the loop looks for results in every so many ticks; None for the least
    number with which [for_all] takes all lengths. Errors: UsageError as of `read_run`, and if this
    number is above the shortest frame.
    """
    started = time.perf_counter()
    run = read_run(path, fast_hz, columns, scales, HIGHEST_RATIO, own_ticks=True)
    tick = _own_ticks(run, fast_hz) if run.are_ticks else None
    if tick:
        run = replace(run, ticks=np.maximum(np.round(run.ticks), 1.0))
    shortest = int(run.values[0])
    measured = len(run.values)
    if every and every > shortest:
        raise UsageError(
            f"--every {every}: expected at most {shortest}, the ticks of the shortest frame, found {every}"
        )
    run = _in_steps(run, [every] if every else range(1, shortest + 1))
    if len(run.values) > MOST_VARYING:
        raise UsageError(
            f"{path}: expected at most {MOST_VARYING} lengths of frames, which [for_all] takes, found {measured}, from {shortest} "
            "ticks on; cut out the part of the recording that has such frames, or take slower ticks"
        )
    lengths = run.lengths
    values = run.values
    pairs = pairs_of(lengths, values)
    arguments = {
        "fast_hz": fast_hz,
        "number": number,
        "columns": dict(columns),
        "scales": dict(scales),
        "every": every,
    }
    identity = f"{run.sha256} {sorted(arguments.items(), key=str)}"
    facts = {
        "schema_version": 1,
        **versions(),
        "spec_name": Path(path).stem,
        "spec_sha256": sha256(identity.encode()).hexdigest(),
        "log_sha256": run.sha256,
        "asked": arguments,
        "frames": len(lengths),
        "duration_s": tick["duration_s"] if tick else float(run.ticks.sum() / fast_hz),
        "every": run.every,
        "measured_lengths": measured,
        "lengths": [
            {"ticks": int(ticks), "frames": int((lengths == ticks).sum()), "next": row.tolist()}
            for ticks, row in zip(values, pairs, strict=True)
        ],
        "independent": are_independent(lengths, values),
        "unfit": _unfit(run),
        "tick": tick,
        "notices": [run.taken] if run.taken else [],
        "methods": {"identify": METHOD},
        "timings": {"compute_s": round(time.perf_counter() - started, 6)},
    }
    return Table.of("identify-frames", _pair_columns(pairs, values), facts)


def _in_steps(run: MeasuredFrames, steps: Iterable[int]) -> MeasuredFrames:
    """A run whose frames end in every so many ticks: the first of the steps with which [for_all]
    takes all lengths, or the last one."""
    for every in steps:
        run = replace(run, every=every)
        if len(run.values) <= MOST_VARYING:
            break
    return run


def _pair_columns(pairs: np.ndarray, values: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of the pairs of neighbours that occur."""
    first, after = np.nonzero(pairs)
    counts = pairs[first, after]
    shares = counts / pairs.sum(1)[first]
    return {"ticks": values[first], "next_ticks": values[after], "pairs": counts, "share": shares}


def _own_ticks(run: MeasuredFrames, fast_hz: float) -> dict[str, Any]:
    """The times of a fast loop's own ticks (s): the interval that holds them all and the nominal
    one, with ends of three digits of a lateness, and where the longest is; after_late: the mean
    tick after one of the latest tenth."""
    nominal = 1 / fast_hz
    lengths = run.ticks * nominal
    step = 10.0 ** (
        # Of a tick: a lateness that is none.
        floor(log10(max(np.abs(lengths - nominal).max(), 1e-6 * nominal))) - 2
    )
    longest = int(lengths.argmax())
    # Nine tenths of the ticks are shorter than those that are called late.
    late = np.flatnonzero(lengths[:-1] >= np.quantile(lengths, 0.9))
    return {
        "start": min(nominal, float(floor(lengths.min() / step) * step)),
        "stop": max(nominal, float(ceil(lengths.max() / step) * step)),
        "mean_s": float(lengths.mean()),
        "duration_s": float(lengths.sum()),
        "longest_begins_s": float(run.begins[longest]),
        "late": bool(lengths.max() > (1 + EVEN) * nominal),
        "after_late_s": float(lengths[late + 1].mean()) if late.size else nominal,
    }


def _unfit(run: MeasuredFrames) -> dict[str, Any]:
    """How many frames do not last whole ticks, or multiples of `every`, by how much the worst,
    and where the first is."""
    unfit = np.flatnonzero(run.unfit)
    off = np.abs(run.ticks - run.every * np.round(run.ticks / run.every))
    facts = {"frames": len(unfit), "worst": float(off.max())}
    if len(unfit):
        facts["begins_s"] = float(run.begins[unfit[0]])
        facts["ticks"] = float(run.ticks[unfit[0]])
    return facts


def _numbers(_: Columns, facts: Mapping[str, Any]) -> Numbers:
    of_run = (
        "frames",
        "duration_s",
        "every",
        "measured_lengths",
        "lengths",
        "independent",
        "unfit",
        "tick",
    )
    return {"fast_hz": facts["asked"]["fast_hz"]} | {name: facts[name] for name in of_run}


def _lines(found: Numbers) -> Iterator[Line]:
    if found["tick"]:
        yield from _lines_of_ticks(found)
        return
    rows = found["lengths"]
    tick = 1e3 / found["fast_hz"]
    mean = found["duration_s"] * found["fast_hz"] / found["frames"]
    ticks = [row["ticks"] for row in rows]
    if len(ticks) > 1:
        span = f"{ticks[0]} to {ticks[-1]} ticks"
    else:
        span = count(ticks[0], "tick")
    yield (
        f"{count(found['frames'], 'frame')} in {found['duration_s']:.6g} s: {span} of {tick:.6g} ms, {mean:.6g} on average",
        False,
    )
    shares = {row["ticks"]: 100 * row["frames"] / found["frames"] for row in rows}
    frequent = sorted(ticks, key=lambda length: -shares[length])
    shown = sorted(frequent[:LENGTHS_SHOWN])
    rare = sorted(frequent[LENGTHS_SHOWN:])
    for row in rows:
        if row["ticks"] not in shown:
            continue
        share = shares[row["ticks"]]
        yield (
            f"  {count(row['ticks'], 'tick')}: {share:.3g} % of frames{_next_lengths(row, ticks)}",
            False,
        )
    if rare:
        most = max(shares[length] for length in rare)
        share = f"at most {rounded_up(most, 3)}" if len(rare) > 1 else f"{most:.3g}"
        yield f"  {', '.join(map(str, rare))} ticks: {share} % of frames each", False
    yield from _caveats(found)


def _lines_of_ticks(found: Numbers) -> Iterator[Line]:
    """What is said of a run of the fast loop's own ticks."""
    tick = found["tick"]
    nominal = 1e3 / found["fast_hz"]
    span = f"{span_around(1e3 * tick['start'], 1e3 * tick['stop'])} ms"
    ticks = (
        f"{count(found['frames'], 'tick')} of the fast loop itself in {tick['duration_s']:.6g} s"
    )
    yield (
        f"{ticks}: {span}, {1e3 * tick['mean_s']:.6g} on average, {nominal:.6g} by its rate",
        False,
    )
    yield f"  the longest begins at {tick['longest_begins_s']:.6g} s", False
    if not tick["late"]:
        yield "  no tick is late: the stamps are even", False
    elif tick["after_late_s"] < 1 / found["fast_hz"]:
        yield "  a late tick is followed by a shorter one, as with a timer at fixed times", False
    else:
        yield (
            "  a late tick is not made up for by the next, as with a timer that starts again",
            False,
        )
    yield (
        "the worst pattern of these times depends on the loop: check and zwidth of a spec with this [for_all] name it",
        False,
    )


def _next_lengths(row, ticks) -> str:
    """How often the frame after one of this length has which length."""
    after = sorted((-n, length) for n, length in zip(row["next"], ticks, strict=True) if n)
    if not after or len(ticks) == 1:
        return ""
    total = sum(row["next"])
    following = [f"{length} ({100 * -n / total:.3g} %)" for n, length in after[:LENGTHS_SHOWN]]
    if len(after) > LENGTHS_SHOWN:
        following.append("...")
    return f"; the next one: {', '.join(following)}"


def _caveats(found: Numbers) -> Iterator[Line]:
    """What is to be known of the lengths: whether they depend on each other, how many decide,
    and which do not fit ticks."""
    rows = found["lengths"]
    every = found["every"]
    if len(rows) > 1 and found["independent"]:
        yield (
            "the length of a frame does not depend on that of the frame before, as far as this run shows",
            False,
        )
    elif len(rows) > 1:
        yield (
            "the length of a frame depends on that of the frame before: shares alone do not describe this run",
            False,
        )
    if len(rows) > LENGTHS_SHOWN:
        yield (
            f"few of {len(rows)} lengths decide: the summary of zwidth says which, and which may be left out",
            False,
        )
    if every > 1:
        fewer = (
            f"{found['measured_lengths']} lengths become {len(rows)}, multiples of {every} ticks"
        )
        yield (
            f"{fewer}: this assumes a loop that looks for a result in every {every} ticks and not in each",
            True,
        )
    unfit = found["unfit"]
    if unfit["frames"]:
        of = f"{unfit['frames']} of {count(found['frames'], 'frame')}"
        low = every * int(unfit["ticks"] // every)
        first = f"the first of {unfit['ticks']:.6g} ticks at {unfit['begins_s']:.6g} s"
        counted = f"the loop may count {low} or {low + every}, and both are in [for_all]"
        multiples = "whole ticks" if every == 1 else f"multiples of {every} ticks"
        yield (
            f"{of} do not last {multiples}, but up to {unfit['worst']:.2g} more or less; {first}: {counted}",
            every == 1,
        )


def _tick_text(facts: Mapping[str, Any]) -> str:
    """The table [for_all] with the range of a tick."""
    tick = facts["tick"]
    head = f"# The ticks of {facts['spec_name']}, as wavesweep identify found them, for a spec of {facts['asked']['fast_hz']:g} Hz.\n"
    run = f"# {count(facts['frames'], 'tick')} in {tick['duration_s']:.6g} s.\n"
    interval = {"start": tick["start"], "stop": tick["stop"]}
    return head + run + as_toml({"for_all": {"tick": interval}})


def spec_text(facts: Mapping[str, Any]) -> str:
    """The table [for_all] with the lengths, as a piece of a spec."""
    rows = facts["lengths"]
    arguments = facts["asked"]
    if facts["tick"]:
        return _tick_text(facts)
    every = facts["every"]
    counted = "whole ticks" if every == 1 else f"multiples of {every} ticks"
    shares = [row["frames"] for row in rows]
    lines = [
        f"# The frames of {facts['spec_name']}, as wavesweep identify found them, for a spec of {arguments['fast_hz']:g} Hz.",
        f"# {count(facts['frames'], 'frame')} in {facts['duration_s']:.6g} s.",
    ]
    if unfit := facts["unfit"]["frames"]:
        lines.append(
            f"# Of {count(unfit, 'frame')} that did not last {counted}, both neighbours are here."
        )
    if every > 1:
        lines.append(
            f"# ASSUMED: the loop looks for a result in every {every} ticks and not in each; as measured there are"
        )
        lines.append(f"# {facts['measured_lengths']} lengths.")
    table: dict[str, Any] = {"values": [row["ticks"] for row in rows], "varying": True}
    if len(rows) > 1 and facts["independent"]:
        lines.append(
            "# shares: how often each length occurred; without it, only answers for any order are given."
        )
        table["shares"] = shares
    elif len(rows) > MOST_NEXT:
        lines.append(
            f"# A frame depends on the one before; a chain (next) of more than {MOST_NEXT} lengths is too large for a proof"
        )
        lines.append("# in mean square, so there is none here, and answers are for any order.")
    elif len(rows) > 1:
        lines.append(
            "# next: how often each length followed each; without it, only answers for any order are given."
        )
        table["next"] = [row["next"] if any(row["next"]) else shares for row in rows]
    return "\n".join(lines) + "\n" + as_toml({"for_all": {arguments["number"]: table}})


KINDS = (
    whole_kind("identify-frames", _numbers, _lines, "wavesweep.frame_times.figure.identify_frames"),
)
