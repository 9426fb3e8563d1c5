"""A device found from a log: the table `identify`, with the numbers in its facts and its
summary."""

from __future__ import annotations

import re
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from math import exp, inf, isnan, sqrt
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import PORT_UNITS
from wavesweep.identification.columns import COLUMNS
from wavesweep.identification.device_spec import IN_CIRCUITS, PATHS, negative, spoken
from wavesweep.program.analyses.assumptions import USUAL
from wavesweep.program.columns import Columns
from wavesweep.program.csv_files import LEAST, MOST, seconds
from wavesweep.program.number_words import in_digits, rounded_up, span_around
from wavesweep.program.platform_compat import one_thread, versions
from wavesweep.program.tables.fields import Field
from wavesweep.program.tables.kind import Line, Numbers, count, whole_kind
from wavesweep.program.tables.table import Table

if TYPE_CHECKING:
    from wavesweep.identification.log import Log

PREDICTION_METHOD = (
    "least squares of the errors of predictions from one row to the next by a steady Kalman filter, which follows a force that "
    "walks at random, with its fitted variance; intervals from white innovations, from sums over blocks of rows and from other "
    "variances"
)
METHOD = (
    "likelihood of rounded readings against the sampled model, force held over a tick, from the row on at which the force "
    "before the log no longer matters; intervals from linear programs if rounding explains each reading, from the curvature "
    "of the likelihood if white noise does as well, and otherwise from the spectrum of what is left"
)
UNITS = {
    "mass": "kg",
    "damping": "N*s/m",
    "stiffness": "N/m",
    "friction": "N",
    "delay": "tick",
    "offset": "N",
}
COUPLED = {
    "load_mass": "kg",
    "load_damping": "N*s/m",
    "coupling_stiffness": "N/m",
    "coupling_damping": "N*s/m",
}
UNITS |= COUPLED
# that are fitted
LOGARITHMS = {"mass": "log_mass", "load_mass": "log_load", "coupling_stiffness": "log_coupling"}
OF_FORCE = {*UNITS} - {"delay"}  # which are proportional to the motor's constant
READ = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}  # unit of what is measured
# units of what turns, and of a circuit, for those of what slides
TURNING = {**PORT_UNITS["turns"], "kg": "kg*m^2", "m/s^2": "rad/s^2"}
ELECTRICAL = {**PORT_UNITS["volts"], "kg": "H"}
# of numbers whose unit has a force over a length or an angle, or a voltage over a charge
POWERS_OF_TIME = {
    **dict.fromkeys(("kg", "kg*m^2", "H"), 2),
    **dict.fromkeys(("N*s/m", "N*m*s/rad", "ohm"), 1),
    **dict.fromkeys(("N/m", "N*m/rad", "1/F"), 0),
}
MISSING = {
    "friction": "Coulomb friction; --friction fits it",
    "spring": "a spring; --spring fits it",
    "delay": "a delay; without --delay it is fitted",
    "resonance": "a resonance near {frequency_hz:.3g} Hz; --two-masses fits a load on a spring",
    "sided friction": "friction that depends on direction",
    "sided damping": "damping that depends on direction",
    "drag": "a drag that grows with the square of the speed",
    "hardening": "a force that is a curve of the position, as of a spring that hardens",
    "saturating mass": "a mass that changes with speed, as an inductance that saturates",
    "saturating force": "a force that saturates",
    "axes": "what the forces of other axes do, which the log has as well; --axes fits them together",
    "lag": "a lag of the force behind that of the log, as of an amplifier or a winding; record what the actuator really does "
    "(its measured current), or filter the force of the log by the lag",
    "force": "a force that does not depend on the motion, as of a drift, a cable or a hand",
    "noise": "noise of the reading that is not white; no force shows beside that of the log",
    "one-way": "what tells friction from a constant force (offset): the device moves one way only; record a motion both ways",
    "unknown": "an effect that is no friction, spring, delay or single resonance; most is left near {frequency_hz:.3g} Hz",
}
MISSING_OF_TWO = {
    "resonance": "another resonance, near {frequency_hz:.3g} Hz",
    "unknown": "an effect that is no delay or resonance, as Coulomb friction, which is a constant force (offset) if the motor "
    "moves one way only; most is left near {frequency_hz:.3g} Hz",
}
MISSING_OF_CIRCUIT = {
    "friction": "a voltage against the current, as of dead times and diodes",
    "spring": "a capacitor in series",
    "resonance": "a resonance near {frequency_hz:.3g} Hz; --lcl fits an LCL filter",
    "saturating mass": "an inductance that saturates",
}
# of sentences on a device, what they say of a circuit
WORDS_OF_CIRCUIT = IN_CIRCUITS | {
    "force": "voltage",
    "position": "current",
    "velocity": "current",
    "encoder": "sensor",
    "two masses on a spring": "an LCL filter",
    "the two masses": "the LCL filter",
    "--two-masses": "--lcl",
}

RESPONSE_METHOD = (
    "least squares of the logarithm of measured over modelled admittance, force held over a tick, weighted by coherence; "
    "intervals from the Jacobian and the errors that are left"
)


class FitOptions(TypedDict, total=False):
    """Names in the file and factors to SI units of columns, step of the encoder, what is fitted,
    and the rate of a response.

    motor_constant: the least and the largest one (N/A or N*m/A) of the motor whose current is in
    the log. axes: names of those whose forces and positions it has; None for one.
    """

    columns: Mapping[str, str]
    scales: Mapping[str, float]
    resolution: float | None
    spring: bool
    friction: bool
    two_masses: bool
    delay: float | None
    rate_hz: float | None
    motor_constant: tuple[float, float] | None
    axes: Sequence[str] | None


def identify(path: str, **options: Unpack[FitOptions]) -> Table:
    """Fit mass, damping and more to a log or, if the file has frequencies, to a frequency response,
    as `library.identify` says.

    Errors: UsageError for a log that cannot be used, or that does not tell the mass.
    """
    from wavesweep.identification.model import Model
    from wavesweep.identification.points import is_response

    for name in ("resolution", "delay", "rate_hz"):
        size = options.get(name) or 1.0
        if not LEAST <= size <= MOST:
            option = f"--{name.removesuffix('_hz')}"
            raise UsageError(
                f"{option}: expected a number from {LEAST:g} to {MOST:g}, or 0, found {options[name]:g}"
            )
    rate_hz = options.get("rate_hz")
    two = options.get("two_masses", False)
    if two and (options.get("spring") or options.get("friction")):
        hint = "if the motor moves one way only, its Coulomb friction is a constant force, which the offset takes up"
        raise UsageError(
            f"--two-masses: expected no --spring and no --friction, which one mass has; {hint}"
        )
    axes = options.get("axes")
    if axes and (two or options.get("spring") or "".join(axes) not in ("xy", "xyz")):
        expected = "expected x,y or x,y,z without --spring and --two-masses"
        raise UsageError(f"--axes: {expected}, found {','.join(axes)}")
    model = Model(
        options.get("spring", False), options.get("friction", False), options.get("delay"), load=two
    )
    columns = options.get("columns", {})
    if is_response(path, columns):
        if axes or two or options.get("resolution") is not None or options.get("friction"):
            taken = "--rate, --spring, --delay, --column and --scale; leave the other options out"
            raise UsageError(f"{path}: a frequency response takes {taken}")
        return _of_response(path, rate_hz, options.get("scales", {}), columns, model)
    if rate_hz is not None:
        raise UsageError(f"{path}: a log has its rate in its times; leave --rate out")
    return _of_log(path, options, model)


def _of_response(
    path: str,
    rate_hz: float | None,
    scales: Mapping[str, float],
    renamed: Mapping[str, str],
    model: Any,
) -> Table:
    from wavesweep.identification.points import read_response
    from wavesweep.identification.response import Hold, fitted_response
    from wavesweep.program.columns import complex_columns

    # A millisecond, the unit of the delay of an analogue force.
    period = 1e-3 if rate_hz is None else 1 / rate_hz
    started = time.perf_counter()
    measured = read_response(path, scales=scales, columns=renamed)
    fit = fitted_response(measured, Hold(period, rate_hz is not None), model)
    parameters = _parameters(fit, fit.names, fit.half + fit.extra, {})
    unwidened = _parameters(fit, fit.names, fit.half, {})
    if rate_hz is None:
        parameters["delay"]["unit"] = "ms"
        unwidened["delay"]["unit"] = "ms"
    # What the curve leaves open is refused; what it lacks widens intervals, and refuses nothing.
    try:
        _refuse_unknown(unwidened)
    except UsageError as refused:
        raise UsageError(f"{path}: {refused}") from None
    residual = {
        "rms": float(np.sqrt(np.mean(np.abs(fit.residual) ** 2))),
        "correlation": fit.correlation,
        "frequency_hz": None if isnan(fit.frequency_hz) else fit.frequency_hz,
        "share_of_missing": fit.share,
    }
    options = {"spring": model.spring, "delay": model.delay, "period_s": period}
    beside = {
        "scales": dict(scales),
        "columns": dict(renamed),
        "analogue": rate_hz is None,
    }
    options |= {name: value for name, value in beside.items() if value}
    explained = _explained(parameters, fit, residual)
    facts = _facts(path, measured.sha256, options, period, explained, started)
    facts["methods"] = {"identify": RESPONSE_METHOD}
    if not scales:
        question = (
            "is the admittance in m/N, or that of a rotor in rad/(N*m), whose mass is in kg*m^2"
        )
        facts["unusual"] = _unusual(parameters["mass"], False, question, {"admittance": -1})
    if rate_hz is None:
        facts["notices"] = [
            "the force is taken to be analogue; if it was held over ticks, --rate HZ gives their rate"
        ]
    arrays = {
        "frequency_hz": measured.frequency_hz,
        "residual_abs": np.abs(fit.residual),
        "coherence": measured.coherence,
    }
    arrays |= complex_columns("measured", measured.admittance)
    arrays |= complex_columns("fitted", fit.fitted)
    columns = {field.name: arrays[field.name] for field in COLUMNS["identify-response"]}
    return Table.of("identify-response", columns, facts)


def _explained(parameters, verdict, residual) -> dict[str, Any]:
    """The numbers of a device, whether they explain its log, what is missing, and what is left."""
    return {
        "parameters": parameters,
        "explained": verdict.explained,
        "missing": verdict.missing,
        "residual": residual,
    }


def _facts(path, sha, options, period, facts: Mapping[str, Any], started) -> dict[str, Any]:
    return {
        "schema_version": 1,
        **versions(),
        "spec_name": Path(path).stem,
        "spec_sha256": sha256(f"{sha} {sorted(options.items(), key=str)}".encode()).hexdigest(),
        "log_sha256": sha,
        "asked": options,
        "turns": False,
        "measured": "position",
        "period_s": period,
        "resolution": 0.0,
        **facts,
        "unusual": "",
        "notices": [],
        "timings": {"compute_s": round(time.perf_counter() - started, 6)},
    }


def _of_log(path: str, given: FitOptions, model: Any) -> Table:
    from wavesweep.identification.log import columns_of, read_log, step_of
    from wavesweep.identification.refusals import help_for

    started = time.perf_counter()
    columns = given.get("columns", {})
    scales = given.get("scales", {})
    resolution = given.get("resolution")
    constants = given.get("motor_constant")
    axes = given.get("axes") or ()
    constant = None if constants is None else sum(constants) / 2
    wanted = columns_of(axes, columns) if axes else [columns]
    logs = [read_log(path, each, scales, constant) for each in wanted]
    steps = [step_of(log.reading) if resolution is None else resolution for log in logs]
    log = logs[0]
    model = replace(model, measured=log.measured)
    if log.circuit and (axes or model.spring or model.friction):
        expected = "a voltage and a current take --lcl and --delay"
        raise UsageError(f"{path}: {expected}; leave the other options of the fit out")
    for each, step in zip(logs, steps, strict=True):
        _refuse_log(path, each, step, model)
    with one_thread():
        try:
            fits, parameters = _fitted(model, axes, logs, steps, constants)
        except UsageError as refused:
            hint = "" if axes else help_for(model, log, steps[0])
            said = f"{refused}{hint}"
            said = _of_circuit(said) if log.circuit else said
            raise UsageError(f"{path}: {said}") from None
    _widen_by_period(parameters, log)
    if log.circuit:
        parameters = dict(_in_circuit(*item) for item in parameters.items())
    options = {name: getattr(model, name) for name in ("spring", "friction", "delay")}
    options["resolution"] = resolution
    if constants:
        options["motor_constant"] = constants
    if model.load:
        options["two_masses"] = True
    options |= {"scales": dict(scales), "columns": dict(columns)}
    judged = {}
    notices = []
    rows = []
    for index, (axis, each, (fit, verdict)) in enumerate(
        zip(axes or [""], logs, fits, strict=True)
    ):
        outliers = fit.rows.skip + np.flatnonzero(np.logical_not(fit.rows.used))
        said = _notices(each, resolution, steps[index], outliers)
        notices += [f"{axis}: {line}" if axis else line for line in said]
        judged[axis] = _explained(parameters, verdict, _residual(fit, verdict))
        judged[axis]["resolution"] = steps[index]
        rows.append(_rows_of_fit(each, fit) | {"axis": np.full(len(each.force), 1.0 + index)})
    worst = min(judged.values(), key=itemgetter("explained"))
    facts = _facts(path, log.sha256, options, log.period, worst, started)
    facts |= {
        "turns": log.turns,
        "methods": {"identify": PREDICTION_METHOD},
        "measured": log.measured,
        "notices": notices,
    }
    if log.circuit:
        facts["circuit"] = True
        facts["notices"] = [_of_circuit(line) for line in notices]
    if axes:
        facts["axes"] = judged
    else:
        is_unlikely = not (log.scaled or log.circuit)
        facts["unusual"] = _unusual_of_log(parameters["mass"], log) if is_unlikely else ""
        facts["methods"]["identify"] = METHOD if fits[0][0].estimate else PREDICTION_METHOD
        del rows[0]["axis"]
    table_columns = {name: np.concatenate([each[name] for each in rows]) for name in rows[0]}
    fields = fields_of_log(table_columns, units_of(log.turns, log.circuit))
    return Table.of("identify", table_columns, facts, fields=fields)


def _fitted(model: Any, axes: Sequence[str], logs, steps, constants):
    """The fit of each log with its verdict, and the parameters that they tell together.

    constants: of a motor, at least and at most. Errors: UsageError for logs that leave the mass
    open.
    """
    from wavesweep.identification.axes import identified_axes
    from wavesweep.identification.explained import identified

    log = logs[0]
    units = units_of(log.turns, log.circuit)
    if axes:
        numbers, fits = identified_axes(model, axes, logs, steps)
        parameters = {}
        for name, (value, half) in numbers.items():
            ends = value - half, value + half
            parameters[name] = _parameter(name, value, ends, UNITS, units, constants)
        told = [{"mass": parameters[f"mass_{axis}{axis}"]} for axis in axes]
    else:
        reading = log.reading - _origin(log)
        fits = [identified(model, log.force, reading, log.period, steps[0], log.others)]
        fit = fits[0][0]
        names = fit.model.names
        parameters = _parameters(fit, names, fit.half + fit.extra, units, constants)
        told = [_parameters(fit, names, fit.half, units, constants)]
    if any(verdict.withheld for _, verdict in fits):
        _take_intervals_away(parameters)
    else:
        for estimates in told:
            _refuse_unknown(estimates)
    return fits, parameters


def _rows_of_fit(log, fit) -> dict[str, np.ndarray]:
    """The columns of a table of a log and its fit, a row for each reading."""
    return {
        "time_s": log.times,
        "force": fit.rows.force,
        log.measured: log.reading,
        "fitted": fit.readings + _origin(log),
        "residual": fit.residual,
        "weight": np.append(np.zeros(fit.rows.skip), fit.rows.used),
    }


def _origin(log) -> float:
    """The first position, with which readings far from 0 would lose digits."""
    return log.reading[0] if log.measured == "position" else 0.0


def _refuse_log(path, log, step, model):
    """Raise UsageError for a log that does not move, or not what the model reads, or for no longer
    than a given delay."""
    half = len(log.reading) // 2
    if (model.delay or 0) > half:
        expected = f"expected at most half of the rows, {half} ticks"
        raise UsageError(f"{path}: --delay: {expected}, found {model.delay:g}")
    if np.ptp(log.reading) < 3 * step:
        moved = np.ptp(log.reading) / step
        raise UsageError(
            f"{path}: expected a {log.measured} that changes by 3 of its steps at least, found {moved:.2g}"
        )
    if model.load and log.measured == "acceleration":
        raise UsageError(
            f"{path}: --two-masses: expected a position or a velocity of the motor, found an acceleration"
        )


def _take_intervals_away(parameters: Mapping[str, dict[str, Any]]) -> None:
    """Leave the numbers without their intervals; one that is given as it is keeps its ends."""
    for number in parameters.values():
        if number["low"] != number["high"]:
            number |= {"low": None, "high": None}


def _widen_by_period(parameters: Mapping[str, dict[str, Any]], log: Log) -> None:
    """Widen intervals by that of the period T: with readings of the derivative k of the position
    a mass is in proportion to T^(2-k), a damping to T^(1-k) and a stiffness to T^-k."""
    from wavesweep.identification.model import ORDER

    for number in parameters.values():
        if number["low"] is None or number["low"] == number["high"]:
            continue
        power = POWERS_OF_TIME.get(number["unit"])
        if power is not None:
            wider = abs((power - ORDER[log.measured]) * number["value"]) * log.period_half
            number |= {"low": number["low"] - wider, "high": number["high"] + wider}


def units_of(turns: bool, circuit: bool = False) -> Mapping[str, str]:
    """The units of a device that turns, or of a circuit, for those of one that slides."""
    if circuit:
        return ELECTRICAL
    return TURNING if turns else {}


def unit_said(unit: str, facts: Mapping[str, Any]) -> str:
    """The unit of a table's own device, for one of a device that slides."""
    return units_of(facts["turns"], facts.get("circuit", False)).get(unit, unit)


def _of_circuit(sentence: str) -> str:
    """A sentence on a device, said of a circuit."""
    names = sorted(WORDS_OF_CIRCUIT, key=len, reverse=True)
    pattern = rf"(?<![-\w])(?:{'|'.join(names)})(?!\w)"
    return re.sub(pattern, lambda match: WORDS_OF_CIRCUIT[match[0]], sentence)


def _in_circuit(name: str, number: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """A number by its name in circuits; one over a capacitance is one of a spring."""
    if number["unit"] == "1/F":
        low = number["high"] and 1 / number["high"]
        high = number["low"] and 1 / number["low"]
        number = {"value": 1 / number["value"], "low": low, "high": high, "unit": "F"}
    return IN_CIRCUITS.get(name, name), number


def fields_of_log(names: Collection[str], units: Mapping[str, str]) -> tuple[Field, ...]:
    """The columns of a table with these names. units: as of `units_of`."""
    measured = next(name for name in READ if name in names)
    log_fields = []
    for field in COLUMNS["identify"]:
        if field.name not in names:
            continue
        unit = READ[measured] if field.unit == "m" else field.unit
        log_fields.append(replace(field, unit=units.get(unit, unit)))
    return tuple(log_fields)


def _parameters(
    fit, fitted_names: Sequence[str], half: np.ndarray, own_units: Mapping[str, str], constants=None
) -> dict[str, dict[str, Any]]:
    """The numbers with their intervals of 95 % and units. own_units: as of `units_of`.

    constants: the ends of that of a motor; numbers that act on a force are in proportion to it, and
    fitted with the middle one.
    """
    both_ends = np.stack([fit.theta - half, fit.theta + half], axis=1).tolist()
    ends = dict(zip(fitted_names, both_ends, strict=True))
    for name, logarithm in LOGARITHMS.items():
        if logarithm in ends:
            ends[name] = [exp(min(max(end, -700.0), 700.0)) for end in ends[logarithm]]
    if fit.model.measured == "acceleration" and "velocity" not in ends:
        ends.pop("offset", None)  # it is mixed with the effect of the initial velocity
    names = ["mass", "damping"]
    names += [name for name in (*COUPLED, "stiffness", "friction") if name in ends]
    names.append("delay")
    names += [name for name in ("offset", "bias") if name in ends]
    units = UNITS | {"bias": READ[fit.model.measured]}
    parameters = {}
    for name in names:
        value = fit.numbers[name]
        low, high = ends.get(name, (value, value))
        parameters[name] = _parameter(name, value, (low, high), units, own_units, constants)
    return parameters


def _parameter(name, value, ends, units, own_units, constants):
    """A number; one of an axis or of two has their names behind its own."""
    low, high = ends
    kind = name if name in units else name.partition("_")[0]
    if constants and kind in OF_FORCE:
        low, high = _by_constants(low, high, constants)
    if high == inf:
        low, high = None, None
    unit = own_units.get(units[kind], units[kind])
    return {"value": value, "low": low, "high": high, "unit": unit}


def _by_constants(low: float, high: float, constants: tuple[float, float]) -> tuple[float, float]:
    """The ends of a number that is in proportion to a motor's constant, over both ends of that;
    it was fitted with the middle one."""
    ends = []
    for end in (low, high):
        ends += [end * 2 * constant / sum(constants) for constant in constants]
    return min(ends), max(ends)


def _refuse_unknown(parameters: Mapping[str, Any]) -> None:
    """Raise UsageError for a mass that the log leaves open, and for numbers that are negative."""
    mass = parameters["mass"]
    if not mass["high"] < 3 * mass["low"]:
        remaining = {name: number for name, number in parameters.items() if name != "mass"}
        estimates = ", ".join(f"{name} {spoken(number)}" for name, number in remaining.items())
        raise UsageError(
            f"what was measured leaves the mass open: it could be anything from {span_around(mass['low'], mass['high'], 2)} "
            f"{mass['unit']} (with {estimates}); record a pulse, a chirp or noise that moves the device quickly"
        )
    for name in ("load_mass", "coupling_stiffness"):
        number = parameters.get(name)
        # Below this ratio of its ends a load or stiffness is told: noise alone looks like a less
        # certain one.
        if number is not None and not number["high"] < 2.0 * number["low"]:
            raise UsageError(
                f"what was measured leaves the resonance of the two masses open: the {name} could be anything from "
                f"{span_around(number['low'], number['high'], 2)} {number['unit']}; record a chirp or noise through the resonance"
            )
    for name in (*PATHS, *COUPLED):
        if name in parameters and parameters[name]["high"] < 0:
            said = f"expected a {name} of at least 0, found {spoken(parameters[name])}"
            raise UsageError(
                f"{said}; is the sign of the force that of the position, and is nothing else driving it?"
            )


def _unusual_of_log(mass: Mapping[str, Any], log: Any) -> str:
    """A doubt about the units of a log whose mass is unusual; empty if it is not."""
    from wavesweep.identification.log import MOTIONS
    from wavesweep.identification.model import ORDER

    own_units = units_of(log.turns)
    units = [own_units.get(unit, unit) for unit in ("N", READ[log.measured])]
    if log.turns:
        names = ("torque", MOTIONS[log.measured])
    else:
        names = ("force", log.measured)
    question = "are time, {} and {} in s, {} and {}".format(*names, *units)
    powers = {"time": 2 - ORDER[log.measured], names[0]: 1, names[1]: -1}
    return _unusual(mass, log.turns, question, powers)


def _unusual(mass: Mapping[str, Any], turns: bool, question: str, powers: Mapping[str, int]) -> str:
    """A doubt about a mass so unusual that a unit may be wrong, with a question; empty if it is
    not.

    powers: of the scales of columns, to which the mass is proportional.
    """
    low, high = (1e-9, 20.0) if turns else USUAL["device.mass"]
    if low <= mass["value"] <= high:
        return ""
    sizes = {column: 0.001**power * mass["value"] for column, power in powers.items()}
    likely = [
        f"{size:.3g} with --scale {column}=0.001"
        for column, size in sizes.items()
        if low <= size <= high
    ]
    hint = f" It would be {' or '.join(likely)}." if likely else ""
    return f"a mass of {mass['value']:.3g} {mass['unit']} is unusual (usual: {low:g} to {high:g}); {question}?{hint}"


def beyond_half_step(fit) -> int:
    """How many readings are further from the model than the rounding of an encoder."""
    residual = fit.residual[fit.rows.skip :][fit.rows.used]
    return int((np.abs(residual) > (0.5 + 1e-6) * fit.rows.resolution).sum())


def _residual(fit, verdict) -> dict[str, Any]:
    return {
        "rms": verdict.rms,
        "rms_of_encoder": verdict.expected,
        "steps": verdict.rms / fit.rows.resolution if fit.rows.resolution else None,
        "white_noise": fit.noise,
        "beyond_half_step": beyond_half_step(fit),
        "walked": fit.walked,
        "lacking": verdict.lacking,
        "lacking_share": verdict.lacking / float(np.std(fit.rows.force)),
        "withheld": verdict.withheld,
        "static_friction": fit.static.force if fit.static else None,
        "stribeck_speed": fit.static.speed if fit.static else None,
        "correlation": verdict.correlation,
        "correlation_of_encoder": verdict.correlation_expected,
        "frequency_hz": None if isnan(verdict.frequency_hz) else verdict.frequency_hz,
        "share_of_missing": verdict.share,
        "resonance_hz": verdict.resonance_hz,
    }


def _notices(log, resolution, step, wild) -> Iterator[str]:
    from wavesweep.identification.log import JITTER

    yield from log.taken
    if log.jitter > JITTER:
        steps = f"the fit takes equal steps of {1e3 * log.period:.6g} ms"
        yield f"times jitter by up to {rounded_up(100 * log.jitter, 2)} % of a period; {steps}"
    unit = READ[log.measured]
    unit = units_of(log.turns, log.circuit).get(unit, unit)
    if resolution is None:
        if step:
            steps_text = f"the readings have steps of {step:.4g} {unit}"
        else:
            steps_text = "the readings show no steps"
        counts = f"; if they are counts, --scale {log.measured}=SIZE has that of one" * (step == 1)
        yield f"{steps_text}; --resolution gives those of the encoder{counts}"
    if len(wild):
        yield f"{len(wild)} outlier{'s' * (len(wild) > 1)} left out of the fit; the first is at {seconds(log.times[wild[0]])} s"


# the facts that every summary has
JUDGED = ("parameters", "explained", "missing", "residual", "unusual")


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    samples = len(columns["time_s"])
    samples //= len(facts.get("axes") or [0])
    tally = {
        "samples": samples,
        "duration_s": facts["period_s"] * samples,
        "rate_hz": 1 / facts["period_s"],
    }
    told = "turns", "circuit", "measured", "resolution", *JUDGED, "axes"
    return tally | {name: facts[name] for name in told if name in facts}


def _lines(facts: Numbers) -> Iterator[Line]:
    yield (
        f"{facts['samples']} samples, {facts['duration_s']:.6g} s at {facts['rate_hz']:.6g} Hz",
        False,
    )
    yield from _spoken(facts)
    for axis, facts_of_axis in facts.get("axes", {"": {}}).items():
        for line, warning in _lines_of_fit({**facts, **facts_of_axis}):
            said = _of_circuit(line) if facts.get("circuit") else line
            yield f"{axis}: {said}" if axis else said, warning


def _lines_of_fit(facts: Numbers) -> Iterator[Line]:
    """Yield what is said of the fit of a log, or of an axis of it."""
    # whether the residual is that of predictions, which follow a constant force as any other
    followed = facts["residual"].get("walked", 0.0) > 0
    friction = facts["parameters"].get("friction")
    if friction and friction["low"] is None and not facts["residual"].get("withheld"):
        said = "the device moves one way only, where it and friction are the same"
        yield f"no constant force was fitted: {said}; friction has no interval", True
    residual = facts["residual"]
    unit = unit_said(READ[facts["measured"]], facts)
    against = ""
    if facts["resolution"]:
        against = f", {residual['rms'] / residual['rms_of_encoder']:.3g} times what its steps of {facts['resolution']:.3g} {unit} leave"
    yield f"residual {residual['rms']:.3g} {unit} rms{against}", False
    if facts["resolution"] and not residual["white_noise"]:
        beyond = residual["beyond_half_step"]
        which = f"all but {count(beyond, 'reading')} are" if beyond else "each reading is"
        yield (
            f"{which} within half a step of the model: the intervals are those of an encoder without noise",
            False,
        )
    if residual["white_noise"] and facts["explained"]:
        yield (
            f"white noise of {residual['white_noise']:.3g} {unit} in addition to the rounding",
            False,
        )
    if residual["static_friction"]:
        yield _falling(residual, facts["turns"]), False
    elif followed and "friction" in facts["parameters"]:
        line = "friction and damping are a line over the speeds of the log; what falls with speed is in neither"
        yield line, False
    yield from _judgement(facts, "log")


def _falling(residual: Mapping[str, Any], turns: bool) -> str:
    """What is said of friction that falls with speed."""
    newton, speed = ("N*m", "rad/s") if turns else ("N", "m/s")
    at_rest = f"{residual['static_friction']:.3g} {newton} at rest"
    fades = f"by exp(-(v/{residual['stribeck_speed']:.3g} {speed})^2)"
    return f"friction falls with speed, from {at_rest} to the number above, {fades}; the device of a spec has this number alone"


def _spoken(found: Numbers) -> Iterator[Line]:
    yield from (
        (f"{name} {spoken(estimate)}", False) for name, estimate in found["parameters"].items()
    )


def _judgement(found: Numbers, what: str) -> Iterator[Line]:
    """Yield whether the model explains what was measured, and otherwise what it lacks."""
    for doubt in (found["unusual"], *negative(found["parameters"])):
        if doubt:
            yield doubt, True
    if found["explained"]:
        yield f"the model explains the {what}", False
        band = found["residual"].get("resonance_hz")
        if band:
            if {"load_mass", "capacitance"} & {*found["parameters"]}:
                other = "another resonance"
            else:
                other = "a resonance"
            would_show = f"would show from {band[0]:.3g} to {band[1]:.3g} Hz"
            yield f"{other} of a quarter of the mass {would_show}", False
    elif found["missing"] == "unseen":
        yield (
            "the log cannot tell whether the model is enough: a resonance of a quarter of the mass would not show in it",
            True,
        )
        yield "push harder, or record a chirp or noise", True
    else:
        for line in _lacks(found, what):
            yield line, True


def _lacks(found: Numbers, what: str) -> Iterator[str]:
    """Yield what a model lacks that does not explain what was measured."""
    left = found["residual"]
    missing = _missing_in_words(found)
    is_noise = found["missing"] == "noise"
    if is_noise or not left.get("lacking"):
        lacks = "" if is_noise else " it lacks"
        said = f"the intervals are wider by what is left:{lacks} {missing}"
        yield f"the model does not explain the {what}, and {said}"
        return
    explains = f"; this effect explains {in_digits(100 * left['share_of_missing'], 2)} % of it"
    if left["withheld"]:
        said = "so no number has an interval"
    elif found["missing"] == "force":
        said = "and the intervals are wider by it"
        explains = ""
    else:
        said = "but the numbers above are those beside what it lacks"
    yield f"the model does not explain the {what}, {said}: it lacks {missing}"
    newton = unit_said("N", found)
    size = f"{left['lacking']:.3g} {newton} rms, {in_digits(100 * left['lacking_share'], 2)} % of that of the log"
    yield f"what it lacks is a force of {size}{explains}"


def _missing_in_words(found: Numbers) -> str:
    """What a model lacks, in words; a resonance of which the log has few periods is a slow motion."""
    left = found["residual"]
    hertz = left["frequency_hz"] or 0.0
    # In fewer periods of a log it is not told whether something is a resonance.
    if found["missing"] == "resonance" and hertz * found.get("duration_s", inf) < 10:
        size = sqrt(max(left["rms"] ** 2 - left["rms_of_encoder"] ** 2, 0.0))
        unit = unit_said(READ[found["measured"]], found)
        beyond = " beyond the steps of the encoder" if found["resolution"] else ""
        return f"a slow motion near {hertz:.3g} Hz, {1e6 * size:.3g} u{unit} rms{beyond}: a drift, a cable, or a soft spring"
    words = MISSING
    if found.get("circuit"):
        words = words | MISSING_OF_CIRCUIT
    if {"load_mass", "capacitance"} & {*found["parameters"]}:
        words = words | MISSING_OF_TWO
    said = words[found["missing"]].format(frequency_hz=hertz)
    lacks_option = "axes" in found and found["missing"] in ("resonance", "spring")
    if lacks_option or ("frequencies" in found and found["missing"] == "resonance"):
        return said.partition(";")[0]
    return said


def _response_numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    hertz = columns["frequency_hz"]
    held = not facts["asked"].get("analogue")
    tally = {
        "frequencies": len(hertz),
        "from_hz": float(hertz[0]),
        "to_hz": float(hertz[-1]),
        "rate_hz": 1 / facts["period_s"] if held else None,
    }
    return tally | {name: facts[name] for name in JUDGED}


def _response_lines(found: Numbers) -> Iterator[Line]:
    yield (
        f"{found['frequencies']} frequencies from {found['from_hz']:.6g} to {found['to_hz']:.6g} Hz",
        False,
    )
    yield from _spoken(found)
    yield f"residual {100 * found['residual']['rms']:.3g} % rms", False
    yield from _judgement(found, "response")


KINDS = (
    whole_kind("identify", _numbers, _lines, "wavesweep.identification.figure.identify"),
    whole_kind(
        "identify-response",
        _response_numbers,
        _response_lines,
        "wavesweep.identification.figure.identify_response",
    ),
)
