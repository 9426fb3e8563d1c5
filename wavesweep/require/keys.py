"""What [sweep] requires of every mode, of a gain, or of margins, in place of stability alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Key
from wavesweep.program.reading.keys import ALL_MODES, MODES, TIMES_OF_MODES
from wavesweep.program.reading.tables import KeyValues, SpecTable, nested, several
from wavesweep.program.reading.units import WITH_UNIT, has_unit
from wavesweep.require.damped import Damped
from wavesweep.require.gain_bound import (
    BAND,
    FACTOR_GAIN,
    FACTOR_PHASE,
    MEASURES,
    WITHIN,
    CutBound,
    FactorBound,
    GainBound,
    PeakBound,
    TimeBound,
    distance,
)

if TYPE_CHECKING:
    from wavesweep.program.spec.schema import Shapes
    from wavesweep.program.spec.studies import Request
    from wavesweep.require.bound import Bound

PATH = "sweep.require"
KEYS = Key.by_path(
    [
        Key.number(
            "sweep.require.radius",
            None,
            "1",
            "find the intervals in which every mode falls to this share of its size, or less, in T_s of a controller (also of dc, and "
            "if rates do not divide), in a tick of a drawn loop",
            low=1e-6,
            high=0.999999,
        ),
        *(
            Key.positive(
                f"sweep.require.{name}",
                None,
                "s",
                f"find the intervals in which {time.meaning}",
                high=1e6,
            )
            for name, time in TIMES_OF_MODES.items()
        ),
        Key.number(
            "sweep.require.damping_ratio",
            None,
            "1",
            "find the intervals in which every mode has this damping ratio or more, at the line that a spectrum "
            "shows of it (of its images from frame to frame the strongest one)",
            low=0.001,
            high=0.999,
        ),
        Key.word("sweep.require.modes", ALL_MODES, "which modes need the damping ratio", MODES),
        Key.positive(
            "sweep.require.slower_than",
            None,
            "s",
            "modes that fall to 1/e in less time than this need no damping ratio",
            high=1e6,
        ),
        Key(
            "sweep.require.bounded",
            "boolean",
            None,
            "",
            "for a loop that conserves energy: find the intervals in which no mode grows; all are on the unit circle, "
            "no two equal",
        ),
        Key.word("sweep.require.gain.from", None, "input in [ports] of the gain that is bounded"),
        Key.word(
            "sweep.require.gain.to",
            None,
            "output in [ports] of the gain that is bounded, or a signal",
        ),
        Key.positive(
            "sweep.require.gain.at_most",
            None,
            "of to over from",
            "find the stable intervals in which the gain from an input to an output is below this at all frequencies: the "
            "H-infinity norm, root of energy over root of energy of all ticks of a frame. Of an input that is read once in "
            "n ticks, and held in what follows, it is the root of n at rest, since the other n - 1 count as 0",
            high=1e12,
        ),
        Key.several(
            Key.number("sweep.require.gain.band_hz", None, "Hz", "", low=0.0, high=1e12),
            2,
            rising=True,
            description="lowest and highest frequency at which it has to be so",
        ),
        Key.word("sweep.require.peak.from", None, "input in [ports] of the peak that is bounded"),
        Key.word(
            "sweep.require.peak.to",
            None,
            "output in [ports] of the peak that is bounded, or a signal",
        ),
        Key.positive(
            "sweep.require.peak.at_most",
            None,
            "of to over from",
            "find the stable intervals in which what comes out of a sine at its own frequency, over the sine, is below this, as bode "
            "has it: Mt from a reference. Of sines below half the rate at which the input is read, since those above are read as these",
            high=1e12,
        ),
        Key.number(
            BAND,
            WITHIN,
            "1",
            "the share of its final value within which a step has settled; or how far it may be from it after a step of 1, with "
            'the unit of the output: "0.5 mm"',
            low=1e-6,
            high=0.999,
            instead=WITH_UNIT,
        ),
        Key.word(
            "sweep.require.margins.cut",
            None,
            "signal BLOCK.PORT at which the loop is cut, as for margins",
        ),
        Key.number(
            "sweep.require.margins.Ms",
            None,
            "1",
            "find the stable intervals in which the peak sensitivity, the largest |1/(1 + L)|, is below this at the cut; of a "
            "signal that is made several times in a frame the largest singular value",
            low=1.001,
            high=1e6,
        ),
        Key.number(
            "sweep.require.margins.disk",
            None,
            "1",
            "find the stable intervals in which the disk margin is above this at the cut, which is made once in a frame: "
            "disk = a holds a gain up and down by (2 + a)/(2 - a), a phase of 2 atan(a/2), and both together",
            low=1e-6,
            high=1.999,
        ),
        Key.number(
            "sweep.require.margins.gain",
            None,
            "1",
            "find the intervals in which the loop is stable with every factor of the cut from 1/gain to gain",
            low=1.001,
            high=1e3,
        ),
        Key.number(
            "sweep.require.margins.phase_deg",
            None,
            "deg",
            "find the intervals in which the loop is stable with every phase at the cut of up to so many degrees either way",
            low=0.01,
            high=179.0,
        ),
        *(
            key
            for name, measure in MEASURES.items()
            for key in (
                Key.word(f"sweep.require.{name}.from", None, "input in [ports]"),
                Key.word(f"sweep.require.{name}.to", None, "output in [ports], or a signal"),
                Key.positive(
                    f"sweep.require.{name}.at_most",
                    None,
                    measure.unit,
                    f"find the stable intervals in which {measure.found}; the input is held over each tick, "
                    "and the output seen in each",
                    high=measure.most,
                ),
            )
        ),
    ]
)
KEYS_BY_NAME = {path.removeprefix(f"{PATH}."): key for path, key in KEYS.items()}
BETWEEN = ("gain", "peak", *MEASURES)  # tables of what lies between an input and a signal
NEEDED = ("from", "to", "at_most")  # keys that each of these has


class Require(KeyValues):
    """The bounds on every mode, on a gain, margins and responses in time, by the names of their
    keys.

    modes, slower_than: which modes need the damping ratio, and those that fall to 1/e in less time
    (s) do not. bounded: whether the modes of a loop that conserves have to stay on the unit circle,
    in place of all of these.
    """

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it, without what is as by default."""
        values = {}
        for name, key in KEYS_BY_NAME.items():
            if self.get(name) and self[name] != key.default:
                values[name] = self[name]
        if self.cuts:
            values["margins"] = [*self.cuts] if len(self.cuts) > 1 else self.cuts[0]
        return nested(values)

    @property
    def cuts(self) -> Sequence[Mapping[str, Any]]:
        """The margins at each cut, by the names of their keys."""
        return self.get("margins", ())

    def refuse_stability_alone(self, name: str, purpose: str) -> None:
        """Raise UsageError, since more is required; see `TableValue`."""
        expected = f"no [sweep] require with {purpose}, which is about stability alone"
        raise UsageError(
            f"{name}: expected {expected} (--set sweep.require= leaves it out; columns low_hz and high_hz of "
            "stability-region name the mode at each end), found one"
        )

    @property
    def bound(self) -> Bound:
        """The same for the search: bounds on the eigenvalues of the frames of a drawing."""
        from wavesweep.require.bound import Bound

        damped = None
        if self.get("damping_ratio"):
            modes = self.get("modes", ALL_MODES)
            damped = Damped(self["damping_ratio"], modes, self.get("slower_than", 0.0))
        # Each is looked for where those before it hold: what takes longest comes last.
        gains: tuple[GainBound | PeakBound | CutBound | FactorBound | TimeBound, ...] = ()
        if "gain.at_most" in self:
            ends_and_level = (self[f"gain.{name}"] for name in NEEDED)
            gains = (GainBound(*ends_and_level, self.get("gain.band_hz")),)
        if "peak.at_most" in self:
            gains += (PeakBound(*(self[f"peak.{name}"] for name in NEEDED)),)
        for cut in self.cuts:
            if "Ms" in cut:
                gains += (CutBound(cut["cut"], cut["Ms"], 0.0),)
            if "disk" in cut:
                gains += (CutBound(cut["cut"], 1 / cut["disk"], 0.5),)
        for measure in reversed(MEASURES):
            if f"{measure}.at_most" in self:
                ends_and_level = (self[f"{measure}.{name}"] for name in NEEDED)
                gains += (
                    TimeBound(measure, *ends_and_level, self.get(f"{measure}.within", WITHIN)),
                )
        for cut, margin in product(self.cuts, (FACTOR_GAIN, FACTOR_PHASE)):
            if margin in cut:
                gains += (FactorBound(cut["cut"], margin, cut[margin]),)
        return Bound(
            self.get("radius", 1.0),
            tuple((name, self[name]) for name in TIMES_OF_MODES if name in self),
            damped,
            self.get("bounded", False),
            gains,
        )


def build(request: Request) -> Require | None:
    """Return the requirement and add its mistakes; None if nothing is required."""
    mistakes = request.mistakes
    leaves = request.belongs.below(PATH)
    of_margins = {name: leaf for name, leaf in leaves.items() if name.startswith("margins")}
    remaining = {name: leaf for name, leaf in leaves.items() if name not in of_margins}
    name = BAND.removeprefix(f"{PATH}.")
    band = remaining.get(name)
    if band and has_unit(band.value):
        remaining = {key: leaf for key, leaf in remaining.items() if key != name}
    values = TABLE.read(remaining, mistakes)
    if band and has_unit(band.value):
        values[name] = band.value
        _refuse_unit(request, band, leaves.get("step_settling.to"))
    if of_margins:
        inside = {name[len("margins.") :]: leaf for name, leaf in of_margins.items()}
        values["margins"] = tuple(_at_cut(request, table) for table in several(inside))
    if values.get("bounded") and len(values) > 1:
        expected, text_found = "true alone", "other requirements as well"
        mistakes.refuse(leaves["bounded"], f"{PATH}.bounded", expected, text_found, of_key=False)
    for name in ("modes", "slower_than"):
        if name in values and "damping_ratio" not in values:
            mistakes.refuse(
                leaves[name], f"{PATH}.{name}", "damping_ratio beside it", "none", of_key=False
            )
    _refuse_missing(mistakes, leaves)
    _refuse_unknown_ports(request, leaves)
    if any(values.values()):
        return Require(values)
    return None


def _refuse_unit(request: Request, band: Any, signal: Any) -> None:
    """Add the mistake of a distance with a unit that is not that of the output."""
    loop = request.loop(request.sweep) if signal else None
    if loop is None:
        return
    try:
        distance(loop, signal.value, band.value)
    except UsageError as error:
        expected, found = str(error).removeprefix(f"{BAND}: expected ").rsplit(", found ", 1)
        request.mistakes.refuse(band, BAND, expected, found, of_key=False)


def _at_cut(request: Request, leaves: dict[str, Any]) -> dict[str, float | str]:
    """The margins at a cut, and their mistakes: those of none, of a cut at which the loop cannot
    be cut, and of a cut alone."""
    mistakes = request.mistakes
    values = MARGINS.read(leaves, mistakes)
    leaf = leaves.get("cut")
    if "" in leaves:
        return values
    if leaf is None or len(leaves) == 1:
        missing = "cut" if leaf is None else "Ms, disk, gain and phase_deg"
        first = next(iter(leaves.values()))
        expected = "cut, and one of Ms, disk, gain, phase_deg"
        mistakes.refuse(first, MARGINS.path, expected, f"none of {missing}")
    elif loop := request.loop(request.sweep):
        from wavesweep.program.analyses.cuts import fault_of_cut

        if fault := fault_of_cut(loop, leaf.value):
            mistakes.refuse(leaf, f"{MARGINS.path}.cut", *fault, of_key=False)
    return values


def _refuse_missing(mistakes: Any, leaves: dict[str, Any]) -> None:
    """Add the mistakes of what lies between an input and a signal without its ends or its level."""
    for table in BETWEEN:
        leaves_of_table = [leaf for name, leaf in leaves.items() if name.startswith(f"{table}.")]
        keys = [f"{table}.{name}" for name in NEEDED]
        for key in keys if leaves_of_table else ():
            if key not in leaves:
                expected = f"all of {', '.join(keys)}"
                mistakes.refuse(leaves_of_table[0], f"{PATH}.{table}", expected, f"none of {key}")


def _refuse_unknown_ports(request: Request, leaves: dict[str, Any]) -> None:
    """Add the mistakes of inputs and signals that the loop does not have."""
    for table in BETWEEN:
        ends = {key: leaves.get(f"{table}.{key}") for key in ("from", "to")}
        loop = request.loop(request.sweep) if all(ends.values()) else None
        if loop is None:
            continue
        from wavesweep.program.analyses.signals import faults_of_ends

        for key, *fault in faults_of_ends(loop, *(leaf.value for leaf in ends.values())):
            request.mistakes.refuse(ends[key], f"{PATH}.{table}.{key}", *fault, of_key=False)


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table."""
    table = shapes.keys(TABLE.keys_in_it)
    settling = table["properties"]["step_settling"]["properties"]
    settling["within"] = {"anyOf": [settling["within"], {"type": "string"}]}
    table["properties"]["margins"] = shapes.several(table["properties"]["margins"])
    return table


MARGINS = SpecTable(
    path=f"{PATH}.margins",
    keys={path: key for path, key in KEYS.items() if path.startswith(f"{PATH}.margins.")},
)
TABLE = SpecTable(
    path=PATH,
    build=build,
    keys=KEYS,
    signals=tuple(f"{PATH}.{table}.to" for table in BETWEEN),
    always=True,
    schema=schema,
)
