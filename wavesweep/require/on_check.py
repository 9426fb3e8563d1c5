"""Whether a spec's own design has what its [sweep] requires."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from wavesweep.engine.errors import WavesweepError
from wavesweep.program.analyses.claims import Claim, Status, own_scope, required
from wavesweep.program.analyses.interval_jobs import job_over
from wavesweep.program.analyses.own_design import is_an_end, searched
from wavesweep.program.columns import Columns, whose_column
from wavesweep.program.number_words import in_all_digits, span_in_words
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.sweep.grid import keys_of, make_grid, own_loop
from wavesweep.program.sweep.running import in_memory
from wavesweep.program.tables.fields import DOUBTS


def facts(spec: Spec, own: Mapping[str, Any], *_: object) -> dict[str, Any]:
    """required: of a spec with [sweep] require, along which number its own design was looked at,
    `from` and `to` where, the intervals there that have it, and whether these are certified;
    claims: the same.

    own: may have the columns of the spec's table of intervals as `swept`.
    """
    if not spec.require:
        return {}
    what = required(spec)
    name = _along(spec)
    if not name:
        no_number = "the spec has no number to look along"
        return {"claims": [Claim(what, own_scope(spec), Status.UNKNOWN, no_number)]}
    path = spec.names.find(name).path
    low, high = searched(spec, name, path)
    rows = _swept(spec, path, own.get("swept", {}))
    if rows:
        low, high = next((axis.start, axis.stop) for axis in spec.sweep if axis.path == path)
    looked_at: dict[str, Any] = {"along": name, "from": low, "to": high, "intervals": []}
    try:
        axis = Axis(name, path, (), low, high, False, "linear")
        if not rows:
            rows = in_memory(job_over(make_grid(spec, (), path), axis, require=spec.require))
    except WavesweepError as error:
        claim = Claim(what, own_scope(spec), Status.UNKNOWN, str(error))
        return {"required": looked_at | {"certified": False}, "claims": [claim]}
    ends = [(float(a), float(b)) for a, b in zip(rows["low"], rows["high"], strict=True) if a <= b]
    looked_at |= {"intervals": ends, "certified": bool(rows["certified"].all())}
    value = float(spec.values[path])
    status = _status(rows, value, ends)
    met = f"met in {' and '.join(span_in_words(*interval) for interval in ends)}"
    if not ends:
        notices = spec.require.bound.notices(own_loop(spec), path, name, (low, high))
        met = "; ".join([f"met nowhere in {span_in_words(low, high)}", *notices])
    reason = f"{name} = {in_all_digits(value)}{_in_words(value, ends, rows, status, met)}"
    claim = Claim(what, own_scope(spec), status, "" if status > Status.UNKNOWN else reason)
    return {"required": looked_at, "claims": [claim]}


def _in_words(value: float, ends: list, rows: Any, status: Status, met: str) -> str:
    """How the design's value stands to the intervals that have what is required, if it is not proved to have it."""
    if is_an_end(value, ends):
        return f" on an end, {met}"
    if status is Status.REFUTED:
        return f", {met}"
    doubts = dict.fromkeys(rows["doubt"][~rows["certified"]].tolist())
    unproved = "; ".join(DOUBTS[word].meaning for word in doubts)
    inside = any(low < value < high for low, high in ends)
    verdict = "was found to meet it" if inside else "was not found to meet it"
    return f" {verdict}, {met}, which is not certified: {unproved}"


def _swept(spec: Spec, path: str, swept: Columns) -> Columns:
    """The rows of the table of intervals that are of the spec's own design; none if it is not one
    of the sweep."""
    if not swept or whose_column(swept):
        return {}
    own = np.ones(swept["low"].size, bool)
    for axis in spec.sweep:
        value = spec.values[axis.path]
        if axis.path == path:
            own &= axis.start < value < axis.stop
        else:
            own &= swept[axis.name] == value
    return {name: column[own] for name, column in swept.items()} if own.any() else {}


def _along(spec: Spec) -> str:
    """The number along which the design is looked at: that of the sweep, of the wall, or the
    first; empty without one."""
    read = keys_of(spec)
    names = {path: name for name, path in spec.names.symbols.items() if path in read}
    if spec.along and spec.names.find(spec.along).path in read:
        return spec.along
    for path in (*spec.wall, *names):
        if path in names and not spec.names.keys[path].structural:
            return names[path]
    return ""


def _status(rows: Columns, value: float, intervals: Sequence[tuple[float, float]]) -> Status:
    """What the rows of intervals say of a value; at an end of one, nothing.

    Beside its open places a row whose search was given up is known.
    """
    inside = (rows["low"] < value) & (value < rows["high"])
    inside |= (rows["low"] == value) & np.isnan(rows["low_omega"])
    inside |= (rows["high"] == value) & np.isnan(rows["high_omega"])
    of_modes = [rows[end][~np.isnan(rows[f"{end}_omega"])] for end in ("low", "high")]
    if is_an_end(value, [np.concatenate(of_modes).tolist()]):
        return Status.UNKNOWN
    beside = (value < rows["open_low"]) | (rows["open_high"] < value)
    known = bool((rows["certified"] | ((rows["doubt"] == "search") & beside)).all())
    if inside.any():
        if known:
            return Status.CERTIFIED
        return Status.UNKNOWN
    if known and not is_an_end(value, intervals):
        return Status.REFUTED
    return Status.UNKNOWN
