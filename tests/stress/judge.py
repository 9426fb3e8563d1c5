"""One question put to the package and to the certified witness, and what became of it."""

import warnings
from dataclasses import dataclass, field

import numpy as np
from support import certified
from support.intervals import cut_of

from wavesweep.engine._search.interval_search import intervals_of
from wavesweep.engine._search.open_loops import Opened
from wavesweep.engine._search.question import Question, Slices
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.haptics.controllers import WALL

SAME = 1e-9  # relative, of an end and a hundred-thousandth of the span together
NEAR_ZERO = 1e-5
LOOSE = 1e-6  # relative, of an end that is the right one; and of its angle, which may lie next to pi


@dataclass
class Verdict:
    """Of one column; of one that is not certified only what it calls stable counts.

    kind: "right", "loose" (an end off by SAME to LOOSE), "wrong", "undecided" (by the witness) or
    "refused"; certified; rows; why it is not certified; what was answered and what is true."""

    kind: str
    certified: bool
    rows: int = 0
    why: str = ""
    error: float = 0.0
    answered: list = field(default_factory=list)
    truth: list = field(default_factory=list)


def judge(question, witness=None) -> list[Verdict]:
    """A verdict per column. Warnings are errors, and so is a number that is not one."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            cut = cut_of(question.values)
            found = _intervals(question)
        except IllPosedLoopError:
            return [Verdict("refused", False) for _ in question.fixed]
    _must_be_numbers(found)
    witness = witness or certified.Witness(question.values)
    return [_column(question, cut, found, witness, index) for index in range(len(question.fixed))]


def _intervals(question):
    """The stable intervals of the question's columns, by every way that doubles have."""
    along, other = WALL if question.along == "K_VE" else WALL[::-1]
    loops = Loops(loop_drawing(question.values), question.values | {other: np.array(question.fixed, float)}).read
    size = len(question.fixed)
    asked = Question(along, question.span)
    return intervals_of(asked, Slices(loops, size, Opened.of(loops, asked.number, size)))


def _must_be_numbers(found):
    some = found.index >= 0
    assert np.isfinite([found.low[some], found.high[some]]).all()
    assert np.isfinite(found.residual).all()
    assert (found.low[some] < found.high[some]).all()


def _column(question, cut, found, witness, index):
    mine = found.column == index
    rows = [
        (float(a), float(b), float(s), float(t))
        for a, b, s, t in zip(found.low[mine], found.high[mine], found.low_omega[mine], found.high_omega[mine], strict=True)
    ]
    rows = [row for row, number in zip(rows, found.index[mine], strict=True) if number >= 0]
    sure = bool(found.certified[mine].all())
    verdict = Verdict("undecided", sure, max(len(rows), 1), "" if sure else reason(cut, question), answered=rows)
    try:
        regions = witness.regions(question.along, question.span, question.fixed[index])
    except certified.Undecided:
        return verdict
    verdict.truth = [
        (
            float(r.low.mid()),
            float(r.high.mid()),
            *(np.nan if t is None else t / float(cut.period[0]) for t in (r.low_theta, r.high_theta)),
        )
        for r in regions
        if r.unstable == 0
    ]
    if sure:
        verdict.kind, verdict.error = _compared(verdict.answered, verdict.truth, question.span)
    else:
        verdict.kind = "right" if _known(verdict.answered, verdict.truth, question.span) else "wrong"
    return verdict


def _known(rows, truth, span):
    """Whether what is called stable is so; what is not certified may leave something out."""
    slack = LOOSE * (span[1] - span[0])
    return all(
        any(a >= low - LOOSE * abs(low) - slack and b <= high + LOOSE * abs(high) + slack for low, high, *_ in truth)
        for a, b, *_ in rows
    )


def _compared(rows, truth, span):
    rows, truth = (_beyond_rounding(part, span) for part in (rows, truth))
    if len(rows) != len(truth):
        return "wrong", np.inf
    if not rows:
        return "right", 0.0
    ours, theirs = np.array(rows), np.array(truth)
    # A crossing at an end of the span to rounding may be named there or not.
    if np.any((np.isnan(ours) != np.isnan(theirs))[:, 2:] & (ours[:, :2] != span[0]) & (ours[:, :2] != span[1])):
        return "wrong", np.inf
    gap = np.abs(ours - theirs)[:, :2]
    error = float((gap / (np.abs(theirs[:, :2]) + NEAR_ZERO * (span[1] - span[0]))).max())
    turning = (theirs[:, 2:] > 0) & (ours[:, 2:] > 0)
    angle = float((np.abs(ours - theirs)[:, 2:][turning] / theirs[:, 2:][turning]).max(initial=0.0))
    kind = "right" if error <= SAME else "loose" if error <= LOOSE else "wrong"
    return (kind if angle <= LOOSE else "wrong"), max(error, angle) if angle > LOOSE else error


def _beyond_rounding(rows, span):
    """The intervals but for those at an end of the span that are no wider than an end may be off."""
    at_edge, least = [low == span[0] or high == span[1] for low, high, *_ in rows], NEAR_ZERO * (span[1] - span[0])
    return [
        row for row, edge in zip(rows, at_edge, strict=True) if not (edge and row[1] - row[0] <= SAME * (abs(row[1]) + least))
    ]


def reason(cut, question):
    """Why a column may not be certified, in one word or two."""
    values, size = question.values, np.abs(cut.E).max()
    if not np.isfinite(size):
        return "frame overflows"
    if size > 1e6:
        return "unstable inside the frame"
    orders = sum(values[f"filters.{name}.order"] for name in ("lp1", "hp", "lp2"))
    if values["controller.kind"].startswith("pmw") and orders > 12:
        return "long filters"
    if values["device.damping"] + values["operator.damping"] == 0:
        return "undamped"
    return "other"
