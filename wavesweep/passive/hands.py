"""Intervals guaranteed for hands: every passive hand, every hand of a box, a passive port; and those of a passive channel."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace

import numpy as np

from wavesweep.core.analyses.interval_records import END_HANDS, HAND_RECORD
from wavesweep.core.analyses.loops import held_loop
from wavesweep.core.energy.held_loop import HAND, HeldLoop
from wavesweep.core.errors import SpecError, UsageError
from wavesweep.core.spec import Axis, Spec
from wavesweep.core.stability.certificate import NONE, SEARCH
from wavesweep.core.sweep.grid import Loops, own_loop
from wavesweep.core.sweep.job import Job
from wavesweep.for_all.rows import refuse_unsuitable_ranges
from wavesweep.for_all.unknown import Case, proofs
from wavesweep.for_all.varying import Rules
from wavesweep.passive import every_hand
from wavesweep.passive.any_hand import reads_velocity
from wavesweep.passive.hand import HOLDING_A_DEVICE, HandBox
from wavesweep.passive.ranges import PassiveRanges, channel_ranges, hand_ranges, pair_ranges, port_ranges

_RANGE = re.compile(r"\s*(mass|damping|stiffness)\s*=\s*([^.\s]\S*?)\s*\.\.\s*(\S+)\s*")
MARGIN = 1e-3  # of an end that a hand sets, left out of the proof: there the loop is about to be unstable
PASSIVE = (
    "determinant of {}, interpolated over number and angle with a bound, positive by Bernstein coefficients; outside, angles "
    "and directions in which energy comes out"
)
METHODS = {
    "passive": PASSIVE.format("the Hermitian part of the map from displacement to force, with what the damping takes"),
    "box": "exact intervals of the hands found to matter, intersected; where settled, guardian maps of hand and number, "
    "interpolated with a bound and positive by Bernstein coefficients, prove all but a thousandth at either end; else searched",
    "port": PASSIVE.format("the Hermitian part of the map from the held force to the displacement"),
    "ports": PASSIVE.format("the Hermitian part of the map at both ports with weights of their frequencies, chosen box by box"),
    "channel": PASSIVE.format("what the channel's losses leave of the tolerance"),
}


@dataclass(frozen=True, slots=True)
class Guarantee:
    """What an interval is guaranteed for: the hands "passive" or "box" (those of `box`), "port", "ports" or "channel"; see
    `METHODS`.

    tolerance: J per J sent that the channel may add.
    """

    kind: str
    box: HandBox | None = None
    tolerance: float = 0.0

    @property
    def dtype(self) -> np.dtype:
        """The records have fields about hands."""
        return HAND_RECORD

    @property
    def method(self) -> str:
        """How the intervals are found, in a line."""
        return METHODS[self.kind]

    @property
    def word(self) -> str:
        """The guarantee as a word that `hands_of` reads."""
        ranges = (f"{field.name}={_text(getattr(self.box, field.name))}" for field in fields(HandBox) if self.box)
        more = repr(self.tolerance) if self.kind == "channel" else ",".join(ranges)
        return ":".join(filter(None, [self.kind, more]))

    def records_of(self, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
        """The intervals of one loop; it takes from tenths of a second to some seconds."""
        return self.records(held_loop(loop), along, span)

    def records(self, loop: HeldLoop, along: str, span: tuple[float, float]) -> np.ndarray:
        """Intervals of the key `along` within `span` for one loop, as records of slice 0."""
        if self.kind == "box":
            return _for_box(loop, along, span, self.box)
        if self.kind == "channel":
            return _from_ranges(channel_ranges(loop, along, span, self.tolerance), span)
        ranges = {"port": port_ranges, "ports": pair_ranges, "passive": hand_ranges}[self.kind]
        return _from_ranges(ranges(loop, along, span), span)


def _text(ends: tuple[float, float]) -> str:
    return "..".join(repr(float(end)).removesuffix(".0") for end in ends)


def _from_ranges(found: PassiveRanges, span) -> np.ndarray:
    records = _blank(found.low, found.high)
    records["certified"] = found.certified if found.low.size else found.complete
    records["settled"], records["doubt"] = records["certified"], np.where(records["certified"], NONE, SEARCH)
    for end, border in zip(("low", "high"), span, strict=True):
        for at in np.flatnonzero(records[end] != border) if found.low.size else ():
            records[f"{end}_omega"][at] = found.worst(float(records[end][at]))
    return records


def _for_box(loop, along, span, box) -> np.ndarray:
    loop, ends = loop.with_hand(), box.ranges()
    ranges = [Axis(path, path, (), low, high, structural=False) for path, (low, high) in ends.items() if low < high]
    known = {path: low for path, (low, high) in ends.items() if low == high}
    case = Case(Loops(loop.drawing, {**loop.values, **known}), along, span, ranges, known)
    found = list(proofs([case], span, MARGIN))
    records = _blank(*(np.array([getattr(part, end) for part, _ in found]) for end in ("low", "high")))
    records["settled"] = case.vouched if found else case.certified
    for record, (part, proved) in zip(records, found, strict=False):
        record["settled"] &= _all_but_margin(part, proved)
        for end in ("low", "high"):
            record[f"{end}_omega"] = getattr(part, f"{end}_omega")
            if by := getattr(part, f"{end}_by"):
                for name, path in zip(END_HANDS[end], HAND, strict=True):
                    record[name] = by[path]
    return records


def _all_but_margin(part, proved):
    low, high = part.within(MARGIN)
    return proved is not None and proved[0] <= low and high <= proved[1]


def _blank(low, high) -> np.ndarray:
    """Records with these ends, or the one record of a slice without intervals."""
    records = np.zeros(max(low.size, 1), HAND_RECORD)
    records["doubt"] = SEARCH
    for name in HAND_RECORD.names:
        if HAND_RECORD[name].kind == "f":
            records[name] = np.nan
    records["intervals"] = low.size
    if low.size:
        records["interval"], records["low"], records["high"] = np.arange(low.size), low, high
    return records


@dataclass(frozen=True, slots=True)
class Hands:
    """Guarantees whose intervals are added to those of the spec's own loop; at most one of each kind."""

    guarantees: tuple[Guarantee, ...]

    @property
    def box(self) -> HandBox | None:
        """The hands of the box, if there is one."""
        return next((each.box for each in self.guarantees if each.box), None)

    @property
    def replaced(self) -> list[str]:
        """The guarantees for which other hands are in the place of the spec's operator."""
        return [each.kind for each in self.guarantees if each.kind in ("passive", "box")]

    def facts(self) -> dict[str, list[str]]:
        """The guarantees as a fact of a run: words, which `hands_of` reads."""
        return {"for_hands": [each.word for each in self.guarantees]}

    def refuse(self, job: Job) -> None:
        """Raise UsageError if the spec's own job leaves no answer for these hands."""
        swept = [axis.name for axis in (*job.grid.axes, job.asked.axis) if axis.path in HAND]
        if self.replaced and swept:
            raise UsageError(
                f"hand {self.replaced[0]}: every hand is looked at, so {', '.join(swept)} cannot be an axis as well; "
                f"--set sweep.{swept[0]}= leaves it out"
            )
        spec = job.grid.spec
        spec.refuse_require("hands")
        if spec.for_all and [each.kind for each in self.guarantees] != ["passive"]:
            found = ", ".join(each.kind for each in self.guarantees)
            raise UsageError(f"for hands: expected passive alone beside [for_all] or channels, found {found}")
        if missing := spec.without_hand() if spec.drawing else None:
            raise SpecError(missing)
        loop = held_loop(own_loop(spec, job.asked.axis.path))
        if spec.for_all:
            refuse_unsuitable_ranges(spec, job.asked.axis.path, cut=False)
        if self.replaced and loop.device is None:
            late = f"a dead time in seconds ({', '.join(dead)}), " if (dead := loop.drawing.dead_times) else ""
            late += "which may end between two ticks; give that block steps in place of seconds" if dead else "another one"
            raise UsageError(
                f"hand {self.replaced[0]}: expected a hand whose force acts on one block mass and on nothing else, and whose "
                f"displacement is the position of that block, found {late}"
            )
        if "passive" in self.replaced and reads_velocity(loop):
            raise UsageError(
                'hand passive: expected device.velocity = "difference", found "exact": a point sample of the velocity can be '
                "anything at no cost in energy, so no damping answers for what its feedback does"
                if spec.drawing is None
                else f"hand passive: expected that nothing reads {loop.device}.v, found that something does: a point sample of "
                "the velocity can be anything at no cost in energy; take a block difference of the position"
            )
        if spec.for_all:
            every_hand.refuse(spec, Rules.of(spec), job.asked.axis.path)

    def without_operator(self, spec: Spec) -> Spec | None:
        """The spec for the free device; None if it has no operator anyway."""
        operated = spec.drawing is None and any(spec.values[path] for path in HAND)
        return spec.with_values(dict.fromkeys(HAND, 0.0)) if operated else None

    def notices(self, job: Job) -> Iterator[str]:
        """Yield the notice that no interval can be guaranteed for every passive hand, if that is known beforehand."""
        spec = job.grid.spec
        if spec.for_all:
            yield "rows passive hold for all of [for_all], whatever the frames do; the others are of the spec's own numbers"
        if "passive" not in self.replaced or spec.kind not in ("pmw", "pmw-lm") or spec.values["rates.ratio"] == 1:
            return
        swept = any(axis.path == "controller.Kp" for axis in (*job.grid.axes, job.asked.axis))
        if not swept and spec.values["controller.Kp"] == 0:
            yield "waves without Kp: a motion at a multiple of the slow rate drags the avatar along, and no damping is enough"


def hands_of(words: str | Iterable[str]) -> Hands | None:
    """Hands from the words of `--for-hands`; None without any.

    words: "passive", "port", "box", and a box with ranges in place of those of the literature, such as
    "box:mass=0.1..0.4,damping=2..5". Raises UsageError for another word, one that is there twice, or a range that is empty.
    """
    words, found = (words,) if isinstance(words, str) else words, {}
    for word in words if isinstance(words, Iterable) else (words,):
        kind, colon, ranges = word.partition(":") if isinstance(word, str) else ("", "", "")
        if kind not in METHODS or bool(colon) > (kind in ("box", "channel")):
            raise UsageError(f"hands: expected passive, box, port or box:RANGES, found {word!r:.60}")
        if kind in found:
            raise UsageError(f"hands: expected {kind} once, found it twice")
        box = HOLDING_A_DEVICE if kind == "box" else None
        try:
            found[kind] = Guarantee(kind, replace(box, **_ranges(ranges)) if box and colon else box)
            if kind == "channel":
                found[kind] = Guarantee(kind, tolerance=float(ranges or 0))
        except ValueError as error:
            raise UsageError(str(error)) from error
    return Hands(tuple(found[kind] for kind in METHODS if kind in found)) if found else None


def _ranges(text: str) -> dict[str, tuple[float, float]]:
    """Read ranges such as `mass=0.1..0.5,damping=1..2`."""
    found: dict[str, tuple[float, float]] = {}
    for part in text.split(","):
        name, low, high = matched.groups() if (matched := _RANGE.fullmatch(part)) else ("", "", "")
        if name in found:
            raise UsageError(f"hand box: expected one range of {name}, found two")
        try:
            found[name] = (float(low), float(high))
        except ValueError:
            expected = "ranges such as mass=0.1..0.5 (mass, damping, stiffness)"
            raise UsageError(f"hand box: expected {expected}, found {part.strip()!r:.60}") from None
    return found
