"""Hands in a box of masses, dampings and stiffnesses, and the intervals that hold for all of
them."""

import re
from dataclasses import dataclass, fields, replace

import numpy as np

from wavesweep.engine.arguments import real_numbers
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.errors import UsageError
from wavesweep.engine.intervals import blank_records
from wavesweep.engine.loop import Loops
from wavesweep.for_all.unknown import Case, Part, Proved, proofs
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.felt import RECORD
from wavesweep.haptics.held_loop import held_loop
from wavesweep.program.analyses.claims import Scope, Status, own_scope
from wavesweep.program.analyses.interval_jobs import Guarantee
from wavesweep.program.spec import Axis, Spec

_RANGE = re.compile(r"\s*(mass|damping|stiffness)\s*=\s*([^.\s]\S*?)\s*\.\.\s*(\S+)\s*")
# of an end that a hand sets, left out of the proof: there the loop is about to be unstable
LEFT_OF_END = 1e-3
END_HANDS = {
    end: tuple(f"{end}_hand_{quantity}" for quantity in ("mass", "damping", "stiffness"))
    for end in ("low", "high")
}
BOX_RECORD = np.dtype(
    [
        *RECORD.descr,
        *((name, "<f8") for names in END_HANDS.values() for name in names),
        ("settled", "?"),
    ]
)


@dataclass(frozen=True, slots=True)
class HandBox:
    """Ranges (low, high) of the hand's mass (kg), damping (N*s/m) and stiffness (N/m), all at
    least 0."""

    mass: tuple[float, float]
    damping: tuple[float, float]
    stiffness: tuple[float, float]

    def __post_init__(self):
        for name in ("mass", "damping", "stiffness"):
            range_given = getattr(self, name)
            ends = real_numbers(range_given)
            if ends is None or ends.shape != (2,):
                raise ValueError(
                    f"hand box: {name} expected (low, high), found {range_given!r:.60}"
                )
            low, high = map(float, ends)
            if not 0 <= low <= high < np.inf:
                raise ValueError(
                    f"hand box: {name} expected 0 <= low <= high, found {low:g} to {high:g}"
                )

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Low and high of each number, by its path."""
        sides = zip(HAND, (self.mass, self.damping, self.stiffness), strict=True)
        return {path: (float(low), float(high)) for path, (low, high) in sides}


HOLDING_A_DEVICE = HandBox(mass=(0.005, 0.6), damping=(2.0, 10.0), stiffness=(100.0, 1000.0))
"""From one finger to the whole arm.

Heavy, soft end: an arm at the handle of a HapticMaster, fitted with 0.554 kg, 6.45 N*s/m, 135 N/m
(W. van Beek, W. Bergmann Tiest, W. Mugge, A. Kappers, Haptic perception of force magnitude and its
relation to postural arm dynamics in 3D, Scientific Reports 5:18004, 2015, caption of Figure 3: one
trial of one participant; authors and year quoted from memory). Light, stiff end: a fingertip, of
the order of 5 g, 2 to 10 N*s/m and 200 to 1000 N/m for forces of 2 to 20 N (A. Hajian, R. Howe,
Identification of the mechanical impedance at the human finger tip, J. Biomech. Eng. 119, 1997;
quoted from memory, not checked). The box is the hull of both, rounded outwards.
"""


@dataclass(frozen=True, slots=True)
class BoxGuarantee(Guarantee):
    """Every hand of a box."""

    box: HandBox
    kind = "box"
    order = 1
    replaces = True
    status = Status.PROVED
    dtype = BOX_RECORD
    method = (
        "exact intervals of the hands found to matter, intersected; of these, quadratic forms that decrease in every cell of "
        "hand and number, proved by Cholesky with bounds on all errors, prove what is a thousandth away from ends that hands "
        "set; else not certified"
    )

    @property
    def word(self) -> str:
        """The box as a word of --for-hands."""
        texts = []
        for field in fields(HandBox):
            ends = [repr(float(end)).removesuffix(".0") for end in getattr(self.box, field.name)]
            texts.append(f"{field.name}={'..'.join(ends)}")
        return f"box:{','.join(texts)}"

    def scope(self, spec: Spec) -> Scope:
        """The spec's own numbers, with every hand of the box in place of its operator."""
        return replace(own_scope(spec), hands=f"every hand of {self.word}")

    def records_of(self, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
        """Intervals of the key `along` within `span` for one loop, as records of slice 0.

        Those that are proved end where the proof does, and are certified; others end where the
        hands do that set their ends. It takes from tenths of a second to some seconds.
        """
        loop = held_loop(loop).with_hand()
        ends = self.box.ranges()
        ranges = [
            Axis(path, path, (), low, high, structural=False)
            for path, (low, high) in ends.items()
            if low < high
        ]
        constants = {path: low for path, (low, high) in ends.items() if low == high}
        case = Case(
            Loops(loop.drawing, {**loop.values, **constants}), along, span, ranges, constants
        )
        proved_parts = list(proofs([case], span, LEFT_OF_END))
        low = np.array([interval.low for interval, _ in proved_parts])
        high = np.array([interval.high for interval, _ in proved_parts])
        records = blank_records(low, high, BOX_RECORD)
        records["settled"] = bool(proved_parts) or case.certified
        records["certified"] = case.certified and not proved_parts  # that there are none
        records["doubt"] = np.where(records["certified"], Doubt.NONE, Doubt.SEARCH)
        for record, (interval, proved) in zip(records, proved_parts, strict=False):
            record["settled"] &= _all_but_margin(interval, proved)
            if record["settled"]:
                record["low"] = proved.low
                record["high"] = proved.high
                record["certified"] = True
                record["doubt"] = Doubt.NONE
            for end in ("low", "high"):
                record[f"{end}_omega"] = getattr(interval, f"{end}_omega")
                if by := getattr(interval, f"{end}_by"):
                    for name, path in zip(END_HANDS[end], HAND, strict=True):
                        record[name] = by[path]
        return records


def _all_but_margin(part: Part, proved: Proved | None) -> bool:
    low, high = part.within(LEFT_OF_END)
    return proved is not None and proved.low <= low and high <= proved.high


def box_in_words(text: str | None) -> BoxGuarantee:
    """The box whose ranges a word of --for-hands has behind its colon; None: that of the
    literature.

    Errors: UsageError for a text, ValueError for ranges that are empty.
    """
    return BoxGuarantee(
        HOLDING_A_DEVICE if text is None else replace(HOLDING_A_DEVICE, **_ranges(text))
    )


def _ranges(text: str) -> dict[str, tuple[float, float]]:
    """Read ranges such as `mass=0.1..0.5,damping=1..2`."""
    ranges: dict[str, tuple[float, float]] = {}
    for text_of_range in text.split(","):
        name, low, high = (
            matched.groups() if (matched := _RANGE.fullmatch(text_of_range)) else ("", "", "")
        )
        if name in ranges:
            raise UsageError(f"hand box: expected one range of {name}, found two")
        try:
            ranges[name] = (float(low), float(high))
        except ValueError:
            expected = "ranges such as mass=0.1..0.5 (mass, damping, stiffness)"
            raise UsageError(
                f"hand box: expected {expected}, found {text_of_range.strip()!r:.60}"
            ) from None
    return ranges
