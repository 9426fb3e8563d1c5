"""The columns of each table: names, kinds, units, meanings; columns are checked against them before they are written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from wavesweep.errors import WavesweepError
from wavesweep.spec import KEYS, SYMBOLS
from wavesweep.spec.drawing import keys_of_block
from wavesweep.spec.keys import TURNED
from wavesweep.spec.spec import K_VE_SPAN
from wavesweep.stability.certificate import OF_DERIVATIVES, OF_INTERVALS, OF_RESPONSES

FieldKind = Literal["number", "integer", "boolean", "string"]
_DTYPES = {"number": np.float64, "integer": np.int64, "boolean": np.bool_, "string": np.object_}
_ACCEPTED = {"number": "fiu", "integer": "iu", "boolean": "b", "string": "OU"}


@dataclass(frozen=True)
class Field:
    """One column: name, kind, unit ("1" if dimensionless, "" if none applies) and meaning."""

    name: str
    kind: FieldKind
    unit: str
    description: str


# The last columns of tables of intervals, behind those about hands.
_FELT = tuple(
    Field(f"felt_{end}", "number", "N/m", f"static stiffness that the hand feels at {end}; missing without an interval")
    for end in ("low", "high")
)

_INTERVALS = (
    Field("along", "string", "", "name of the axis that the intervals lie on"),
    Field("intervals", "integer", "1", "number of stable intervals of this combination"),
    Field("interval", "integer", "1", "number of this interval, from 0"),
    Field("low", "number", "", "lower end of the stable interval, clipped to the swept range"),
    Field("high", "number", "", "upper end of the stable interval, clipped to the swept range"),
    Field("low_omega", "number", "rad/s", "oscillation that starts at low; missing where the range ends it"),
    Field("high_omega", "number", "rad/s", "oscillation that starts at high; missing where the range ends it"),
    Field("certified", "boolean", "", "ends and label are verified, no crossing inside can have been missed"),
    Field("residual", "number", "1", "largest relative residual of the characteristic equation at the ends"),
    Field("doubt", "string", "", f"why the row is not certified: {', '.join(OF_INTERVALS)}; empty where it is"),
    *_FELT,
)

_DOUBT = Field("doubt", "string", "", f"why the row is not vouched for: {', '.join(OF_RESPONSES)}; empty where it is")

# Only in tables that have rows for hands; see `wavesweep zwidth --for-hands`.
_HAND = Field("hand", "string", "", "whose hand the row is for: free, operator, passive, box or port")
_ENDS = (
    *(
        Field(f"{end}_hand_{part}", "number", unit, f"{part} of the hand that sets {end}; missing where none does")
        for end in ("low", "high")
        for part, unit in (("mass", "kg"), ("damping", "N*s/m"), ("stiffness", "N/m"))
    ),
    Field(
        "settled",
        "boolean",
        "",
        "the interval holds for every hand that the row is for: for a box proved but for a thousandth of the interval at "
        "either end, where a search found no hand that it does not hold for; else as certified",
    ),
)

_BODE = (
    Field("spec", "string", "", "file stem of the spec"),
    Field("controller", "string", "", "controller kind"),
    Field("frequency_hz", "number", "Hz", "frequency of the hand force"),
    Field("omega_Ts", "number", "rad", "normalised frequency, radians per sample of the slow rate, or of the slowest block"),
    Field("admittance_re", "number", "m/N", "transmitted admittance, real part"),
    Field("admittance_im", "number", "m/N", "transmitted admittance, imaginary part"),
    Field("admittance_abs", "number", "m/N", "transmitted admittance, magnitude"),
    Field("admittance_deg", "number", "deg", "transmitted admittance, phase"),
    Field("impedance_re", "number", "N/m", "transmitted impedance, real part"),
    Field("impedance_im", "number", "N/m", "transmitted impedance, imaginary part"),
    Field("impedance_abs", "number", "N/m", "transmitted impedance, magnitude"),
    Field("impedance_deg", "number", "deg", "transmitted impedance, phase"),
    Field("worst_gain", "number", "m/N", "largest singular value of the lifted response"),
    Field("stable", "boolean", "", "every eigenvalue but drift is inside the unit circle"),
    Field("admittance_error", "number", "1", "bound on the relative error of the admittance; missing with it"),
    Field("impedance_error", "number", "1", "bound on the relative error of the impedance; missing with it"),
    Field("worst_gain_error", "number", "1", "bound on the relative error of worst_gain; missing with it"),
    _DOUBT,
)

_SIMULATE = (
    Field("tick", "integer", "tick", "number of the fast tick, from 0"),
    Field("frame", "integer", "1", "number of the slow frame, from 0; for dc, whose frame is one tick, the tick"),
    Field("phase", "integer", "tick", "tick in the frame; the slow event happens at 0"),
    Field("time_s", "number", "s", "when the tick starts"),
    Field("f_h", "number", "N", "force of the hand, held over the tick"),
    Field("x", "number", "m", "position of the device at the start of the tick"),
    Field("v", "number", "m/s", "velocity of the device at the start of the tick"),
    Field("x_hat", "number", "m", "position as the encoder gives it"),
    Field("v_hat", "number", "m/s", "velocity as it is measured"),
    Field("f_m", "number", "N", "force that the controller asks for"),
    Field("f_device", "number", "N", "force that the motors exert, held over the tick"),
    Field("touching", "boolean", "", "the slow result that the fast loop holds is of a contact with the wall"),
    Field("late", "integer", "tick", "by how much the slow result of this frame comes late; -1 where it never comes"),
    Field("u_m", "number", "W^(1/2)", "wave that leaves the user's side; NaN without waves"),
    Field("v_m", "number", "W^(1/2)", "wave that reaches the user's side; NaN without waves"),
    Field("u_s", "number", "W^(1/2)", "wave at the slow environment, held from its event on; NaN without waves"),
    Field("v_s", "number", "W^(1/2)", "wave that the slow environment returns, held likewise; NaN without waves"),
    Field("x_s", "number", "m", "position of the avatar, held likewise; NaN without waves"),
    Field("x_dot_s", "number", "m/s", "velocity of the avatar, held likewise; NaN without waves"),
    Field("F_s", "number", "N", "force of the virtual environment, held from its event on"),
    Field("u_h", "number", "W^(1/2)", "wave at the local model; NaN but for pmw-lm"),
    Field("v_l", "number", "W^(1/2)", "wave that the local model returns; NaN but for pmw-lm"),
    Field("v_2", "number", "W^(1/2)", "the local model's part of v_m; NaN but for pmw-lm"),
    Field("energy_hand", "number", "J", "work of the hand on the device up to the end of the tick"),
    Field("energy_device", "number", "J", "work that the motors took up, up to the end of the tick"),
    Field("energy_user", "number", "J", "energy that went into the wave channel at the user's side; NaN without waves"),
    Field("energy_slow", "number", "J", "energy that came out at the slow environment; NaN without waves"),
    Field("energy_local", "number", "J", "energy that came out at the local model; NaN without waves"),
    Field("energy_channel", "number", "J", "energy_user - energy_slow - energy_local; NaN without waves"),
)

_RESPONSE = tuple(field for field in _BODE if not field.name.endswith(("worst_gain", "stable", "error", "doubt")))
_BOUNDS = tuple(field for field in _BODE if field.name in ("admittance_error", "impedance_error"))

# As seen in the simulation, beside what the linear analysis says of the same loop.
_SIMULATE_RESPONSE = (
    *_RESPONSE,
    *(
        replace(field, name=f"linear_{field.name}", description=f"{field.description}, of the linear loop")
        for field in (*_RESPONSE, *_BOUNDS)
        if field.name.startswith(("admittance", "impedance"))
    ),
    replace(_DOUBT, description="why the linear response is not vouched for, or missing (unstable); empty where it is"),
)

_PASSIVITY = (
    Field("channel_norm", "number", "1", "H-infinity norm of the wave channel; passive where it is at most 1"),
    Field("channel_omega", "number", "rad/s", "frequency of that norm"),
    Field("port_margin", "number", "m/N", "smallest eigenvalue of the Hermitian part, force to displacement"),
    Field("port_omega", "number", "rad/s", "frequency of that margin"),
    Field("channel_passive", "boolean", "", "the wave channel gives out no more energy than it takes in"),
    Field("port_passive", "boolean", "", "the whole loop gives the hand no more energy than it takes in"),
    Field("stable", "boolean", "", "the loop is stable with the spec's own operator"),
    Field("damping_needed", "number", "N*s/m", "further device damping that makes the port passive; missing if none is enough"),
)

_WHY = (
    *_INTERVALS[:1],
    Field("interval", "integer", "1", "number of the stable interval, from 0"),
    Field("end", "string", "", "end of the interval: low or high; only ends that stability sets, and not the range"),
    Field(
        "crossing",
        "integer",
        "1",
        "number of the crossing at this end, from 0; the first one is the column low_omega or high_omega",
    ),
    Field("corner", "boolean", "", "several crossings lie within 1e-6 of this end, which moves with one of them"),
    Field("quantity", "string", "", "the limit: end, or felt, the static stiffness that the hand feels at this end"),
    Field("limit", "number", "", "value of the limit, in its unit"),
    Field("unit", "string", "", "unit of the limit"),
    Field("omega", "number", "rad/s", "frequency of the mode that crosses there, from frame to frame"),
    Field("damping_ratio", "number", "1", "its damping ratio a tenth of the end inside, half-way into a narrow interval"),
    Field("states", "string", "", "states that take part in this mode most, with their participation"),
    Field("number", "string", "", "name of a number that the loop reads"),
    Field("value", "number", "", "value of the number, in its unit"),
    Field("number_unit", "string", "", "unit of the number"),
    Field("elasticity", "number", "1", "per cent by which the limit moves for one per cent of the number; 0 if this is 0"),
    Field("slope", "number", "", "derivative of the limit by the number, in their units; missing if the number is 0"),
    Field("certified", "boolean", "", "the interval is certified, and rounding cannot change the derivatives by 1e-8"),
    Field("doubt", "string", "", f"why the derivatives are missing: {', '.join(OF_DERIVATIVES)}; empty if they are given"),
)

_PASSIVITY_FILTERS = (
    Field("lp1_order", "integer", "1", "Butterworth order of LP1, and of the high-pass to the local model"),
    Field("lp1_cutoff_hz", "number", "Hz", "-3 dB frequency of both"),
    *_PASSIVITY[:2],
    Field("excess", "number", "1", "channel_norm less 1: how far pmw is from passive"),
    Field("energy_gain", "number", "1", "channel_norm^2 - 1: energy that aliasing can add to a wave, J per J, at most"),
    Field("bank_norm", "number", "1", "norm of the way out of pmw-lm, with a high-pass of the same order and cutoff"),
    Field("certified", "boolean", "", "no frequency exceeds either norm by more than 1e-10, relative"),
    Field("sufficient_order", "number", "1", "least order at this cutoff within the run's tolerance; missing where none is"),
)

TABLES: Mapping[str, tuple[Field, ...]] = {
    "compare": (_BODE[0], *_INTERVALS),
    "compare-bode": _BODE,
    "zwidth": _INTERVALS,
    "stability-region": _INTERVALS,
    "zwidth-hands": _INTERVALS,
    "stability-region-hands": _INTERVALS,
    "bode": _BODE,
    "simulate": _SIMULATE,
    "simulate-response": _SIMULATE_RESPONSE,
    "passivity": _PASSIVITY,
    "passivity-filters": _PASSIVITY_FILTERS,
    "why": _WHY,
}


OTHER_TABLES = ("bench", "design")  # with a figure and with columns of their own


def fields(
    kind: str,
    axes: Iterable[str] = (),
    along: str = "K_VE",
    extra: Iterable[str] = (),
    facts: Mapping[str, Any] | None = None,
) -> tuple[Field, ...]:
    """Give the columns of a table in order: the swept axes, then those that every table of this kind has.

    A comparison has the spec before the axes.

    `along` names the axis that `low` and `high` are values of; they take its unit. `extra` names the further columns of
    a table of intervals: `hand`, after `along`, and the hands at the ends. `facts` of the run have the numbers of a
    drawn loop. Raises WavesweepError for a table or an axis that does not exist.
    """
    if kind not in TABLES:
        raise WavesweepError(f"no table is called {kind!r}, expected one of {', '.join(TABLES)}")
    own = numbers_of(facts)
    units = dict.fromkeys(("low", "high"), _axis(along, own).unit)
    units |= dict.fromkeys((field.name for field in _FELT), felt_unit(facts))
    units |= dict.fromkeys(unlike_units(facts), "")
    columns = [replace(field, unit=units.get(field.name, at_port(field.unit, facts))) for field in TABLES[kind]]
    first = [columns.pop(0)] if kind == "compare" else []  # the spec comes before the axes
    wanted = set(extra)
    columns[1:1] = [field for field in (_HAND,) if field.name in wanted]
    ends = [field for field in _ENDS if field.name in wanted]
    last = len(columns) - len(_FELT) if ends else len(columns)
    return (*first, *(_axis(axis, own) for axis in axes), *columns[:last], *ends, *columns[last:])


def fields_of(kind: str, columns: Mapping[str, Any], facts: Mapping[str, Any] | None = None) -> tuple[Field, ...]:
    """Give the columns of a table that is at hand: those that its kind does not have itself are its axes.

    `facts` of the run describe the numbers of a drawn loop.
    """
    extra = [field.name for field in (_HAND, *_ENDS) if field.name in columns]
    own = {field.name for field in TABLES.get(kind, ())}.union(extra)
    along = columns.get("along", ())
    axes = [name for name in columns if name not in own]
    found = fields(kind, axes, str(along[0]) if len(along) else "K_VE", extra, facts)
    # A whole number that only some specs of a comparison have is missing in the others.
    rough = {name for name in axes if getattr(columns[name], "dtype", np.dtype(object)) == np.float64}
    return tuple(replace(each, kind="number") if each.name in rough and each.kind == "integer" else each for each in found)


def in_order(kind: str, columns: Mapping[str, Any], facts: Mapping[str, Any]) -> dict[str, Any]:
    """Give the columns of a table in the order of the program, without those that it does not have."""
    if kind not in TABLES:
        return dict(columns)
    specs = [spec for spec in (facts.get("spec"), *facts.get("specs", {}).values()) if isinstance(spec, Mapping)]
    study = "bode" if kind in ("bode", "compare-bode") else "sweep"
    own = [field.name for field in (*TABLES[kind], _HAND, *_ENDS)]
    axes = [name for spec in specs for name in spec.get(study, {}) if name not in own]
    found = {name: columns[name] for name in dict.fromkeys([*axes, *own]) if name in columns}
    return {field.name: found[field.name] for field in fields_of(kind, found, facts)}


def felt_unit(facts: Mapping[str, Any] | None) -> str:
    """Give the unit of the stiffness that is felt: that of the wall of a drawn loop, which may turn and not slide."""
    wall = (facts or {}).get("spec", {}).get("ports", {}).get("wall", {})
    number = numbers_of(facts).get(wall.get("stiffness", ""))
    return (number and number.unit) or at_port("N/m", facts)


def at_port(unit: str, facts: Mapping[str, Any] | None) -> str:
    """Give a unit of what the hand feels, or that in its place if the hands of all specs of a run turn."""
    specs = [spec for spec in ((facts or {}).get("spec"), *(facts or {}).get("specs", {}).values()) if spec]
    turns = [spec.get("ports", {}).get("hand", {}).get("turns", False) for spec in specs]
    return TURNED.get(unit, unit) if turns and all(turns) else unit


def swept_range(facts: Mapping[str, Any] | None, along: str) -> tuple[float, float]:
    """Give both ends of the range in which stable intervals were wanted; infinite if they are not known."""
    own = K_VE_SPAN if along == "K_VE" else (-np.inf, np.inf)
    axis = (facts or {}).get("spec", {}).get("sweep", {}).get(along, dict(zip(("start", "stop"), own, strict=True)))
    ends = (axis["start"], axis["stop"]) if isinstance(axis, Mapping) else (np.min(axis), np.max(axis))
    return float(ends[0]), float(ends[1])


def numbers_of(facts: Mapping[str, Any] | None) -> dict[str, Field]:
    """Give the fields of the numbers that the drawn loops of a run have, in [numbers] and in blocks, by their names as axes."""
    found = {}
    specs = [(facts or {}).get("spec", {}), *(facts or {}).get("specs", {}).values()]
    for name, block in ((name, block) for spec in specs for name, block in spec.get("block", {}).items()):
        for key in keys_of_block(block["type"]).values():
            axis = f"block.{name}.{key.path}"
            if key.type in ("number", "integer"):
                found.setdefault(axis, Field(axis, key.type, key.unit, f"{key.description}, of {name}"))
    for name, number in ((name, number) for spec in specs for name, number in spec.get("numbers", {}).items()):
        kind = "integer" if isinstance(number["value"], int) else "number"
        for axis in (name, f"numbers.{name}"):
            found.setdefault(axis, Field(axis, kind, number["unit"], number["description"]))
    rate = Field("rates.tick_hz", "number", "Hz", "common tick of the blocks")
    found |= {name: replace(found[name], unit="") for name in unlike_units(facts) if name in found}
    return found | {rate.name: rate} if found else found


def unlike_units(facts: Mapping[str, Any] | None) -> Mapping[str, Mapping[str, list[str]]]:
    """Give the columns that have another unit in each spec of a run, and therefore none, with the specs of each unit."""
    return (facts or {}).get("unlike_units", {})


def kind_of(names: Iterable[str], stem: str) -> str:
    """Give the kind of the table that has columns of these names; stem: the name of its file, if several kinds have them.

    Raises WavesweepError if it is none.
    """
    names = list(names)
    fitting = [kind for kind, known in TABLES.items() if {field.name for field in known} <= set(names)]
    if stem in fitting or (not fitting and stem in OTHER_TABLES):
        return stem
    if not fitting:
        known = ", ".join((*TABLES, *OTHER_TABLES))
        raise WavesweepError(f"expected the columns of a table with a figure ({known}), found {', '.join(names)}")
    return max(fitting, key=lambda kind: len(TABLES[kind]))


def kinds_by_name() -> dict[str, FieldKind]:
    """Give the kind of each column name; a name means the same in every table."""
    axes = {name: _axis(name).kind for name in (*SYMBOLS, *KEYS) if KEYS[SYMBOLS.get(name, name)].numeric}
    return {**axes, **{field.name: field.kind for table in (*TABLES.values(), (_HAND, *_ENDS)) for field in table}}


def _axis(name: str, own: Mapping[str, Field] = MappingProxyType({})) -> Field:
    if name in own:
        return own[name]
    key = KEYS.get(SYMBOLS.get(name, name))
    if key is None or not key.numeric:
        raise WavesweepError(f"column {name}: neither a column of this table nor an axis that a spec can sweep")
    return Field(name, "integer" if key.type == "integer" else "number", key.unit, key.description)


def checked(fields: tuple[Field, ...], columns: Mapping[str, Any], first_row: int = 0) -> dict[str, np.ndarray]:
    """Give the columns in their fields' order as contiguous float64, int64, bool and object arrays.

    `first_row` is the number of rows of the table before these; it only makes the row numbers of errors right.
    Raises WavesweepError if columns are missing, unknown, of unequal length or of the wrong kind, and if a
    number is infinite: no table holds an infinity, several readers break on it.
    """
    expected = [field.name for field in fields]
    if sorted(columns) != sorted(expected):
        raise WavesweepError(f"the table's columns are {', '.join(columns)}; expected {', '.join(expected)}")
    arrays = {field.name: _typed(field, np.asarray(columns[field.name])) for field in fields}
    lengths = {name: array.shape[0] for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise WavesweepError(f"the table's columns differ in length: {lengths}")
    for name, array in arrays.items():
        _refuse_infinity(name, array, first_row)
    return arrays


def _typed(field: Field, array: np.ndarray) -> np.ndarray:
    if array.ndim != 1 or (array.size and array.dtype.kind not in _ACCEPTED[field.kind]):
        raise WavesweepError(
            f"column {field.name}: found {array.ndim}-dimensional {array.dtype}, expected a column of kind {field.kind}"
        )
    return np.ascontiguousarray(array, dtype=_DTYPES[field.kind])


def _refuse_infinity(name: str, array: np.ndarray, first_row: int) -> None:
    if array.dtype != np.float64 or not np.isinf(array).any():
        return
    row = int(np.flatnonzero(np.isinf(array))[0])
    raise WavesweepError(
        f"column {name}, row {first_row + row + 1}: found {array[row]}, expected a finite number or a missing value; "
        "nothing was written"
    )
