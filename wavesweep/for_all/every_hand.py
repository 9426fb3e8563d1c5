"""Intervals that hold for every passive hand and all of [for_all], whatever the frames do: the
loops are those without waves.

The force against the hand and the device's damping are linear in the number along which the
intervals lie. So the energies that are stored at two of its values add up to those of any value
between them: passive values are an interval, and what is proved at two of them is proved between.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from wavesweep.engine.drawing import Drawing, name_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.switched import Verdict, decide
from wavesweep.for_all.claimed import scope_of
from wavesweep.for_all.members import claims_hold
from wavesweep.for_all.rows import (
    Row,
    all_of,
    cases_of,
    felt_for_all,
    recorded,
    text_of_part,
)
from wavesweep.for_all.unknown import Case, Part
from wavesweep.for_all.varying import Rules, placed, text_of_pattern
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.held_loop import HeldLoop, device_keys, device_of, held_loop
from wavesweep.program.analyses.claims import PASSIVE_HANDS, Scope
from wavesweep.program.analyses.interval_jobs import Guarantee
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop

FREE = dict.fromkeys(HAND, 0.0)
END_DISTANCE = 1e-5  # of an end, or of the range, how near the last value on its other side is
# rad per tick, below which the motion is the same in each repetition of a pattern
STANDING_ANGLE = 1e-3
REFUSED = "hand passive while frames vary ([for_all]): expected {}, found {}"


@dataclass(frozen=True, slots=True)
class EveryHandGuarantee(Guarantee):
    """Every passive hand with all of [for_all], as `IntervalQuery.guarantee`."""

    rules: Rules
    kind = "passive"
    method = (
        "stored energies at the nodes of an automaton of ticks, by a semidefinite program, proved by elimination in ball "
        "arithmetic; refuted by a pattern of frames and a motion of the hand that takes energy out for ever"
    )

    def scope(self, spec: Spec) -> Scope:
        """The loops that its rows are of."""
        design = Loops(own_loop(spec).drawing, dict(spec.values))
        loops = scope_of(spec, self.rules, cases_of(self.rules, "", (0.0, 0.0), design))
        return replace(loops, hands=PASSIVE_HANDS)

    def records_of(self, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
        """The intervals of one loop."""
        cases = cases_of(self.rules, along, span, loop)
        found = [_row(_Margin(self.rules, case, along), case, span) for case in cases]
        row = None if None in found else all_of(found)
        rows = [row] if row and row.low < row.high else []
        return recorded(rows, True, agreed=claims_hold(self.rules, cases, rows, FREE))

    def felt(self, loop: Loops, along: str, values: np.ndarray) -> np.ndarray:
        """The least of all loops of the rules."""
        return felt_for_all(self.rules, loop, along, values)


def refuse(spec: Spec, rules: Rules, along: str) -> None:
    """Raise UsageError for a loop, ranges, or a number along which nothing can be said of every
    passive hand."""
    drawing = own_loop(spec, along).drawing
    _refuse_loop(spec, rules, drawing)
    with placed(spec):
        case = cases_of(rules, along, (0.0, 0.0), Loops(drawing, spec.values))[0]
        margin = _Margin(rules, case, along)
    ruled = margin.ruled
    name = name_of(along)
    for axis in case.ranges:
        if axis.path not in HAND and (axis.path in ruled.reads or margin.is_curved(axis.path)):
            expected = "ranges of the device's mass and damping alone, and values of others"
            raise UsageError(REFUSED.format(expected, axis.name))
    many = along in ruled.reads and not _acts_once(ruled, name)
    if along and (many or margin.is_curved(along)):
        expected = (
            "intervals along a number that multiplies what it does not act on itself, such as K_VE"
        )
        raise UsageError(REFUSED.format(expected, name))


def _refuse_loop(spec, rules, drawing):
    if drawing.has_waves:
        expected = "a wall without waves (dc-slow, dc-lm, or a drawn one)"
        raise UsageError(REFUSED.format(expected, "waves"))
    if rules.for_all.loss:
        # A force that is held for ever is moved by a hand for ever: no damping is enough.
        expected = "a limit to the results that are lost in a row (lost = 1, or more)"
        text_found = "loss, with which any number in a row may be lost"
        raise UsageError(REFUSED.format(expected, text_found))
    if drawing.dead_times:
        expected = "device.delay in place of device.dead_time"
        if spec.drawing:
            expected = "delays in ticks"
        raise UsageError(REFUSED.format(expected, f"seconds of {', '.join(drawing.dead_times)}"))


def _acts_once(ruled: Drawing, name: str) -> bool:
    """Whether a single wire or gain of a loop with a ruler reads a number, and what it gives
    does not come back to it."""
    place = ruled.scalar_place(name)
    if not place:
        return False
    start = place.split(".")[1]
    sources: dict[str, set[str]] = {}  # of each block, the blocks whose signals enter it
    for port, terms in (*ruled.wires, *ruled.couplings):
        into = sources.setdefault(port.partition(".")[0], set())
        into.update(signal.partition(".")[0] for signal, _ in terms)
    reached: set[str] = set()
    fresh = sources.get(start, set())
    while fresh:
        reached |= fresh
        fresh = set().union(*(sources.get(block, ()) for block in fresh)) - reached
    return start not in reached


def damping(spec: Spec) -> dict[str, object] | None:
    """What every passive hand needs of the device's damping, for all of [for_all]: `needed` and
    `refuted` (N*s/m, None if it is not known), the device's own, and the counterexample. None
    for loops of which nothing is said."""
    rules = Rules.of(spec)
    loop = Loops(own_loop(spec).drawing, dict(spec.values))
    if not rules.vary or device_of(loop.drawing) is None or held_loop(loop).reads_velocity:
        return None
    try:
        refuse(spec, rules, "")
        margins = [_Margin(rules, case, "") for case in cases_of(rules, "", (0.0, 0.0), loop)]
        at_rest = [(margin, *margin.need(0.0)) for margin in margins]
    except UsageError:
        return None
    _, needed, has = max(at_rest, key=lambda need: need[1].proved - need[2])
    margin, worst, _ = max(at_rest, key=lambda need: need[1].refuted - need[2])
    facts: dict[str, object] = {}
    for name, value in (("needed", needed.proved), ("refuted", worst.refuted), ("device", has)):
        facts[name] = value if np.isfinite(value) else None
    facts["by"] = margin.text(worst)
    cases = [margin.case for margin in margins]
    if needed.proved <= has and not claims_hold(rules, cases, changes=FREE):
        return facts | {"needed": None, "doubt": "contradiction"}
    return facts


class _Margin:
    """What is left of the device's damping beyond what every passive hand needs, at values of
    the number along."""

    def __init__(self, rules: Rules, case: Case, along: str):
        from wavesweep.for_all.every_hand_proof import with_ruler

        self.case = case
        self.along = along
        self.known = {}
        self.unmet = None
        self.plan = rules.plan({**case.values, **FREE}, (along,) if along else ())
        self.loop = HeldLoop(self.plan.drawing, self.plan.values)
        self.ruled = with_ruler(self.plan.drawing)
        device = device_of(self.plan.drawing)
        keys = next(dict(block.keys) for block in self.plan.drawing.blocks if block.name == device)
        self.device = [keys[name] for name in ("damping", "stiffness")]

    def is_curved(self, path: str) -> bool:
        """Whether the device's damping or stiffness is no line in a number."""
        return any(tree.degree(name_of(path)) > 1 for tree in self.device)

    def need(self, p: float):
        """What is needed at a value, and the least damping of the device there."""
        from wavesweep.for_all.every_hand_proof import Needed

        along_value = {self.along: p} if self.along else {}
        paths = [axis.path for axis in self.case.ranges]
        dampings = []
        stiffnesses = []
        for corner in product(*((axis.start, axis.stop) for axis in self.case.ranges)):
            changes = {**dict(zip(paths, corner, strict=True)), **along_value}
            _, damping, stiffness = device_keys(self.loop.changed(changes))
            dampings.append(damping)
            stiffnesses.append(stiffness)
        has = float(min(dampings))
        loop, needed = self._needed(p, along_value)
        if loop and loop.pulls(float(min(stiffnesses))):
            return Needed(np.inf), has
        return needed, has

    def _needed(self, p, along_value):
        """The loop at a value, and what it needs of the device, both remembered."""
        from wavesweep.for_all.every_hand_proof import EveryHand, Needed

        key = p if self.along in self.ruled.reads else None
        if key not in self.known:
            loop = EveryHand.of(replace(self.plan, values={**self.plan.values, **along_value}))
            decays = loop is not None and self._decays(loop, p)
            self.known[key] = loop, loop.needed() if decays else Needed(np.inf)
        return self.known[key]

    def _decays(self, loop, p) -> bool:
        """Whether the states that the hand does not meet decay, which has to be so between two
        values as well: they may not depend on the number, but at 0, which takes a branch out of
        the loop."""
        if loop.unmet is None:
            return True
        if not p:
            return decide(loop.unmet).verdict == Verdict.PROVED
        self.unmet = self.unmet or loop.unmet
        alike = np.array_equal(self.unmet.E, loop.unmet.E)
        return alike and decide(loop.unmet).verdict == Verdict.PROVED

    def text(self, needed) -> str:
        """What refutes."""
        if not needed.word:
            return ""
        loop = next(row for row in self.known.values() if row[1] is needed)[0]
        omega = needed.omega
        alike = omega * loop.period < STANDING_ANGLE
        if alike:
            moves = "alike in each repetition"
        else:
            moves = f"at {omega / (2 * np.pi):.4g} Hz"
        return f"{text_of_pattern(loop, needed.word)}, a hand that moves {moves}"


def _row(margin: _Margin, case: Case, span) -> Row | None:
    """The passive values that are proved, and the nearest ones that are refuted."""
    low, high = span
    proved = _missing(margin, "proved")
    refuted = _missing(margin, "refuted")
    # Of the range, where a passive value is looked for.
    tried = (low + share * (high - low) for share in (0.0, 1.0, 0.05, 0.2, 0.01, 0.5, 0.002))
    start = next((p for p in tried if proved(p) <= 0), None)
    if start is None:
        return None
    ends = []
    fails = []
    by = []
    omega = []
    for limit in span:
        end, beyond = _edge(proved, start, limit)
        if beyond is not None and refuted(beyond) <= 0:
            _, beyond = _edge(refuted, beyond, limit)
        needed = None if beyond is None else margin.need(beyond)[0]
        ends.append(end)
        fails.append(limit if beyond is None else beyond)
        by.append(needed and {**case.fixed, margin.text(needed): None})
        omega.append(needed.omega if needed else np.nan)
    interval = Part(*fails, *by, *omega)
    return Row(*ends, interval, span, text_of_part(interval))


def _missing(margin: _Margin, part: str) -> Callable[[float], float]:
    """What the device's damping lacks at a value, by what is proved or refuted of the need."""

    def missing(p: float) -> float:
        needed, has = margin.need(p)
        return getattr(needed, part) - has

    return missing


def _edge(
    missing: Callable[[float], float], inside: float, limit: float
) -> tuple[float, float | None]:
    """The last value found at which nothing is missing, from one where it is so towards a limit,
    and the first one beyond."""
    from scipy.optimize import brentq

    if missing(limit) <= 0:
        return limit, None
    seen = {}

    def looked(p):
        seen[p] = missing(p)
        return min(seen[p], 1e9)  # N*s/m: more than anything is short of

    least = END_DISTANCE * abs(limit - inside)
    end = brentq(looked, inside, limit, xtol=END_DISTANCE * least, rtol=END_DISTANCE / 4)
    aside = END_DISTANCE / 2 * max(abs(end), least)
    for p in (end - aside, end + aside):
        looked(float(np.clip(p, *sorted((inside, limit)))))
    within = [p for p, value in seen.items() if value <= 0]
    beyond = seen.keys() - within
    last = max(within, key=lambda p: abs(p - inside))
    return last, min(beyond, key=lambda p: abs(p - inside))
