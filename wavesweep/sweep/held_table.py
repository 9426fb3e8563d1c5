"""Stable intervals of the free device, of the one that is held, and those guaranteed for hands, as one table."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from wavesweep.analysis.passivity import HOLDING_A_DEVICE
from wavesweep.diagram import WALL, draw, drift_of
from wavesweep.errors import UsageError
from wavesweep.spec import Spec
from wavesweep.sweep.checkpoint import blocks
from wavesweep.sweep.guarantees import METHODS, Guarantee, Holders
from wavesweep.sweep.interval_table import JOBS, Progress, compute, method, notices, parts_of
from wavesweep.sweep.job import Question, ask, cut_otherwise, expected_seconds
from wavesweep.sweep.run import Table, facts_of
from wavesweep.sweep.tasks import END_HANDS
from wavesweep.sweep.workers import choose

FEW = 4  # columns of a chunk: they take from tenths of a second to some seconds each
OPERATOR = ("operator.mass", "operator.damping", "operator.stiffness")


@dataclass(frozen=True, slots=True)
class Stage:
    """One kind of rows: the name in the column `hand`, and the question that they answer."""

    hand: str
    asked: Question


def holders_of(hand: str, box: dict[str, tuple[float, float]] | None, port: bool) -> Holders:
    """Who is asked for; box: the ranges that are not those of the literature. Raises UsageError for an empty range."""
    if hand != "box":
        return Holders(hand, None, port)
    try:
        return Holders(hand, replace(HOLDING_A_DEVICE, **(box or {})), port)
    except ValueError as error:
        raise UsageError(str(error)) from error


def stages_of(spec: Spec, holders: Holders, along: str | None) -> list[Stage]:
    """Settle every question before anything is computed. Raises UsageError where one cannot be answered."""
    own = ask(spec, along)
    _refuse(spec, own, holders)
    operated = any(spec.values[path] for path in OPERATOR)
    stages = [Stage("operator" if operated else "free", own)]
    if operated and holders.hand != "free":
        stages.insert(0, Stage("free", ask(spec.with_values(dict.fromkeys(OPERATOR, 0.0)), along)))
    stages += [Stage(hand, _guaranteed(own, guarantee)) for hand, guarantee in holders.guarantees().items()]
    return stages


def _guaranteed(own: Question, guarantee: Guarantee) -> Question:
    walls = own.grid.walls
    few = cut_otherwise(own, deep=max(1, FEW // walls), wide=min(FEW, walls))
    return replace(few, guarantee=guarantee, cut=None)


def _refuse(spec, own, holders):
    swept = [axis.name for axis in (*own.grid.axes, own.axis) if axis.path in OPERATOR]
    if holders.hand != "free" and swept:
        raise UsageError(f"hand {holders.hand}: every hand is looked at, so {', '.join(swept)} cannot be an axis as well")
    if holders.hand == "box" and own.axis.path != WALL[0]:
        raise UsageError(f"hand box: expected intervals along K_VE, found {own.axis.name}; the other hands go along any axis")
    if holders.hand == "passive" and spec.values["device.velocity"] != "difference":
        raise UsageError(
            'hand passive: expected device.velocity = "difference", found "exact": a point sample of the velocity can be '
            "anything at no cost in energy, so no damping answers for what its feedback does"
        )


def held_intervals(
    spec: Spec,
    holders: Holders,
    along: str | None = None,
    jobs: int | None = None,
    backend: str | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    force: bool = False,
) -> Table:
    """The intervals of `intervals` and, in further rows, those that hold for hands; a column `hand` tells them apart.

    hand: "free", the device alone; "operator", with the spec's operator, where it has one; "passive" and "box", see
    `Holders`; "port", where the spec's own loop is stable and passive at the hand's port. Where only the port is asked
    for, the other rows are those of the spec's loop as it is. All else as for `intervals`.
    """
    started = time.perf_counter()
    stages = stages_of(spec, holders, along)
    total, done, certified, tallies, kept = sum(stage.asked.columns for stage in stages), 0, 0, [], []
    for stage in stages:
        asked = stage.asked
        parts = parts_of(asked, checkpoint and checkpoint / stage.hand, force)
        workers = choose(jobs or JOBS, backend, scheduler, len(asked.chunks), partial(expected_seconds, asked))
        report = progress and partial(_report, progress, done, total, certified)
        tallies.append(compute(asked, parts, workers, report))
        kept.append(parts)
        done, certified = done + asked.columns, certified + tallies[-1].certified
    facts = _facts(spec, holders, stages, tallies, time.perf_counter() - started)
    axes = {axis.name: axis.values for axis in stages[0].asked.grid.axes}
    rows, forget = partial(_blocks, stages, kept, extra_columns(holders)), partial(_forget, kept, checkpoint)
    return Table("zwidth", rows, facts, axes, forget=forget)


def _report(progress, done, total, certified, now, _, now_certified):
    progress(done + now, total, certified + now_certified)


def extra_columns(holders: Holders) -> tuple[str, ...]:
    """Names of the columns that the table has beyond those of `intervals`."""
    return ("hand", *END_HANDS["low"], *END_HANDS["high"], "settled") if holders.hand == "box" else ("hand",)


def _blocks(stages, kept, extra) -> Iterator[dict[str, np.ndarray]]:
    """The rows, hand by hand."""
    for stage, parts in zip(stages, kept, strict=True):
        for block in blocks(stage.asked, parts):
            rows = len(block["along"])
            blank = {name: np.full(rows, np.nan) for name in extra} | {"settled": block["certified"]}
            found = blank | block | {"hand": np.full(rows, stage.hand, dtype=object)}
            yield {name: found[name] for name in _order(block, extra)}


def _order(block, extra):
    """The columns of `intervals`, `hand` behind the axes, what is known of the ends at the end."""
    own = [name for name in block if name not in extra and name not in (*END_HANDS["low"], *END_HANDS["high"], "settled")]
    at = own.index("along") + 1
    return [*own[:at], "hand", *own[at:], *extra[1:]]


def _forget(kept, checkpoint):
    for parts in kept:
        parts.remove()
    if checkpoint and checkpoint.exists():
        checkpoint.rmdir()


def _facts(spec, holders, stages, tallies, seconds) -> dict:
    computed = sum(stage.asked.columns for stage in stages)
    skipped = sum(stage.asked.grid.size for stage in stages) - computed
    counts = {"computed": computed, "skipped": skipped, "certified": sum(tally.certified for tally in tallies)}
    timings = {
        "compute_s": seconds,
        "kernel_s": sum(tally.seconds for tally in tallies),
        "slices_from_checkpoint": sum(tally.kept for tally in tallies),
    }
    methods = {stage.hand: METHODS.get(stage.hand, method(stage.asked.axis.path)) for stage in stages}
    said = [*notices(stages[0].asked.grid), *_hopeless(spec, stages[0].asked, holders)]
    facts = facts_of(spec, methods, counts, timings, said)
    if holders.box:
        facts["hand_box"] = {name: list(getattr(holders.box, name)) for name in ("mass", "damping", "stiffness")}
    return facts


def _hopeless(spec, own, holders):
    diagram = draw(spec.values)
    if holders.hand != "passive" or diagram.waves is None or diagram.ratio == 1:
        return
    swept = any(axis.path == "controller.Kp" for axis in (*own.grid.axes, own.axis))
    if not swept and f"frame.{diagram.hand.position}" not in drift_of(diagram).shift:
        yield "waves without Kp: a motion at a multiple of the slow rate drags the avatar along, and no damping is enough"
