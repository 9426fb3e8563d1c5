"""What [sweep] requires of every mode, of a gain, or of margins, in place of stability alone."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import inf, radians, tan
from typing import TYPE_CHECKING, Any

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Key, Leaf, show
from wavesweep.program.reading.keys import ALL_MODES, MODES
from wavesweep.program.reading.tables import SpecTable, TableValue
from wavesweep.require.damped import Damped
from wavesweep.require.gain_bound import BASE_BAND, LIFTED, GainBound, Margins

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
        Key.positive(
            "sweep.require.settling",
            None,
            "s",
            "find the intervals in which every mode by itself falls to 2 % of its size in this time, ln(50) = 3.912 time constants",
            high=1e6,
        ),
        Key.positive(
            "sweep.require.time_constant",
            None,
            "s",
            "find the intervals in which every mode falls to 1/e of its size in this time",
            high=1e6,
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
            "H-infinity norm, of all ticks of a frame",
            high=1e12,
        ),
        Key(
            "sweep.require.gain.band_hz",
            "list",
            None,
            "Hz",
            "lowest and highest frequency at which it has to be so",
        ),
        Key.word(
            "sweep.require.gain.measure",
            LIFTED,
            "what the gain is of a loop of several rates",
            {
                LIFTED: "of inputs of any form, root of energy over root of energy of all ticks of a frame: of an input that is read "
                "once in n ticks, and held in what follows, it is the root of n at rest, since the other n - 1 count as 0",
                BASE_BAND: "of a sine: the component at its own frequency over it, as bode has it",
            },
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
    ]
)
KEYS_BY_NAME = {path.removeprefix(f"{PATH}."): key for path, key in KEYS.items()}
OF_GAIN = tuple(name for name in KEYS_BY_NAME if name.startswith("gain."))
NEEDED = OF_GAIN[:3]
OF_MARGINS = tuple(name for name in KEYS_BY_NAME if name.startswith("margins."))
SINGLE = ("gain", "phase_deg")  # margins that are not proved along a number
HZ = Key(f"{PATH}.gain.band_hz", "number", None, "Hz", "", low=0.0, high=1e12)


@dataclass(frozen=True, slots=True)
class Require(TableValue):
    """The bounds on every mode: its size after T_s or a tick, the times (s) in which it is down to
    SETTLED and to 1/e, its damping ratio.

    modes, slower_than: which modes need the damping ratio, and those that fall to 1/e in less time
    (s) do not. bounded: whether the modes of a loop that conserves have to stay on the unit circle,
    in place of all of these.
    """

    radius: float | None = None
    settling: float | None = None
    time_constant: float | None = None
    damping_ratio: float | None = None
    modes: str = ALL_MODES
    slower_than: float | None = None
    bounded: bool = False
    gain: GainBound | None = None
    margins: Margins | None = None

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        table = {
            name: value for name, value in asdict(self).items() if value and value != ALL_MODES
        }
        for name in ("gain", "margins"):
            value = getattr(self, name)
            if value:
                table[name] = value.written()
        return table

    def refuse_stability_alone(self, name: str, what: str) -> None:
        """Raise UsageError, since more is required; see `TableValue`."""
        expected = f"no [sweep] require with {what}, which is about stability alone"
        raise UsageError(
            f"{name}: expected {expected} (--set sweep.require= leaves it out; columns low_hz and high_hz of "
            "stability-region name the mode at each end), found one"
        )

    @property
    def bound(self) -> Bound:
        """The same for the search: bounds on the eigenvalues of the frames of a drawing."""
        from wavesweep.require.bound import Bound

        damped = (
            Damped(self.damping_ratio, self.modes, self.slower_than or 0.0)
            if self.damping_ratio
            else None
        )
        settling = self.settling or inf
        constant = self.time_constant or inf
        gains = (self.gain,) if self.gain else ()
        gains += self.margins.bounds() if self.margins else ()
        return Bound(self.radius or 1.0, settling, constant, damped, self.bounded, gains)


def build(request: Request) -> Require | None:
    """Return the requirement and add its mistakes; None if nothing is required."""
    leaves, mistakes = request.belongs.below(PATH), request.mistakes
    if (table := leaves.get("")) is not None:
        problem = "an empty table" if table.value == {} else show(table.value)
        return mistakes.refuse(
            table, PATH, f"a table with some of {', '.join(KEYS_BY_NAME)}", problem, of_key=False
        )
    for table in ("gain", "margins"):
        if isinstance(getattr(leaves.get(table), "value", None), dict):  # of a call of the library
            leaf = leaves.pop(table)
            for name, value in leaf.value.items():
                leaves[f"{table}.{name}"] = Leaf(value, leaf.place)
    _refuse_single(mistakes, leaves)
    band = leaves.pop("gain.band_hz", None)
    numbers = mistakes.read(KEYS_BY_NAME, leaves, PATH)
    if numbers.get("bounded") and len(numbers) > 1:
        mistakes.refuse(
            leaves["bounded"],
            f"{PATH}.bounded",
            "true alone",
            "other requirements as well",
            of_key=False,
        )
    for name in ("modes", "slower_than"):
        if name in numbers and "damping_ratio" not in numbers:
            mistakes.refuse(
                leaves[name], f"{PATH}.{name}", "damping_ratio beside it", "none", of_key=False
            )
    gain = {name.removeprefix("gain."): numbers.pop(name) for name in OF_GAIN if name in numbers}
    margins = {
        name.removeprefix("margins."): numbers.pop(name) for name in OF_MARGINS if name in numbers
    }
    _refuse_wrong_cut(request, leaves)
    _refuse_missing(mistakes, leaves, band)
    if band:
        gain["band_hz"] = _band(mistakes, band)
    _refuse_unknown_ports(request, leaves)
    gain = (
        None
        if {"from", "to", "at_most"} - gain.keys()
        else GainBound(gain.pop("from"), gain.pop("to"), **gain)
    )
    at_cut = Margins(**margins) if len(margins) > 1 and "cut" in margins else None
    required = gain or at_cut or any(numbers.values())
    return Require(**numbers, gain=gain, margins=at_cut) if required else None


def _refuse_single(mistakes, leaves):
    """Take the margins of a gain or a phase alone out of the table, with the disk that holds
    them."""
    for name in SINGLE:
        leaf = leaves.pop(f"margins.{name}", None)
        if leaf is None:
            continue
        instead = ""
        value = leaf.value
        if isinstance(value, (int, float)) and name == "gain" and value > 1:
            disk = 2 * (value - 1) / (value + 1)
            instead = f"; disk = {disk:.4g} holds a gain up and down by {value:g}, and more"
        elif isinstance(value, (int, float)) and name == "phase_deg" and 0 < value < 90:
            disk = 2 * tan(radians(value) / 2)
            instead = f"; disk = {disk:.4g} holds a phase of {value:g} deg, and more"
        expected = f"Ms or disk, which are proved along a number{instead}"
        mistakes.refuse(leaf, f"{PATH}.margins.{name}", expected, name, of_key=False)


def _refuse_wrong_cut(request, leaves):
    """Add the mistakes of margins without a cut, or with one at which the loop cannot be cut,
    and of a cut alone."""
    given = [name for name in OF_MARGINS if name in leaves]
    if not given:
        return
    mistakes = request.mistakes
    leaf = leaves.get("margins.cut")
    if leaf is None or len(given) == 1:
        missing = "cut" if leaf is None else "Ms and disk"
        first = leaves[given[0]]
        mistakes.refuse(first, f"{PATH}.margins", "cut, and Ms or disk", f"none of {missing}")
    elif request.drawing:
        from wavesweep.program.analyses.cuts import fault_of_cut

        if fault := fault_of_cut(request.drawing, leaf.value):
            mistakes.refuse(leaf, f"{PATH}.margins.cut", *fault, of_key=False)


def _refuse_missing(mistakes, leaves, band):
    for name in NEEDED if band or leaves.keys() & {*OF_GAIN} else ():
        if name not in leaves:
            first_leaf = band or next(
                leaf for name_of_leaf, leaf in leaves.items() if name_of_leaf in OF_GAIN
            )
            mistakes.refuse(
                first_leaf, f"{PATH}.gain", f"all of {', '.join(NEEDED)}", f"none of {name}"
            )


def _band(mistakes, leaf) -> tuple:
    """The lowest and the highest frequency between which the gain is bounded (Hz)."""
    ends = tuple(mistakes.check_list(HZ, leaf, HZ.path, "[lowest, highest frequency]", count=2))
    if len(ends) == 2 and None not in ends and ends[0] >= ends[1]:
        mistakes.refuse(
            leaf, HZ.path, "the lower frequency first", f"[{ends[0]:g}, {ends[1]:g}]", of_key=False
        )
    return ends


def _refuse_unknown_ports(request, leaves):
    if not request.drawing:
        return
    hand = (request.drawing.hand or ())[:1]
    for name, ports, columns_known in (
        ("gain.from", "inputs", hand),
        ("gain.to", "outputs", ("x", "f_m") if hand else ()),
    ):
        path = f"{PATH}.{name}"
        names = [leaves[name].value] if path in request.belongs.keys else []
        request.refuse_unknown_ends(
            path, [name for name in names if name not in columns_known], ports
        )


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table."""
    shapes_of = {name: shapes.value(key) for name, key in KEYS_BY_NAME.items()}
    gain = {name.partition(".")[2]: shapes_of.pop(name) for name in OF_GAIN}
    margins = {name.partition(".")[2]: shapes_of.pop(name) for name in OF_MARGINS}
    return shapes.table(shapes_of | {"gain": shapes.table(gain), "margins": shapes.table(margins)})


TABLE = SpecTable(
    path=PATH,
    build=build,
    keys=KEYS,
    signals=(f"{PATH}.gain.to", f"{PATH}.margins.cut"),
    always=True,
    schema=schema,
)
