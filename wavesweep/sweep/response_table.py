"""Frequency responses over specs and axes, as a table."""

import time

import numpy as np

from wavesweep.analysis.response import prepare, respond, worst_gain
from wavesweep.analysis.spectrum import spectral_radius
from wavesweep.diagram import draw
from wavesweep.errors import UsageError
from wavesweep.lifted import cut_at_wall
from wavesweep.sweep.grid import Grid, keys_of, make_grid, refuse_rows
from wavesweep.sweep.table import Table, facts_of

SPARED = 1e-6  # relative error up to which a row has no doubt


def parts_of(name: str, response) -> dict[str, np.ndarray]:
    """Columns `name_re`, `name_im`, `name_abs` (in the response's unit) and `name_deg`."""
    parts = {"re": response.real, "im": response.imag, "abs": np.abs(response), "deg": np.degrees(np.angle(response))}
    return {f"{name}_{part}": column for part, column in parts.items()}


def doubt_of(errors, stable, lost) -> np.ndarray:
    """The word of each row (see `DOUBTS`); errors: bounds on relative errors, NaN if a number is not known.

    An unstable loop has no steady response, even if its digits are good; one that overflows within a frame has no number.
    """
    rounded = ~np.logical_and.reduce([error <= SPARED for error in errors])
    words = np.where(lost, "overflow", np.where(stable, np.where(rounded, "rounding", ""), "unstable"))
    return np.broadcast_to(words, rounded.shape).astype(object)


BLOCK = 200_000  # responses in one batch


def responses(specs, **_work) -> Table:
    """Admittance, impedance, worst-case gain and verdict of all specs, for every combination of their [bode] axes.

    A spec without one of the axes has its own value in that column, or NaN if its controller does not read it. Workers are
    not used (`_work` is ignored): thousands of curves take less time than starting one. Raises UsageError for a frequency
    beyond half the fast rate.
    """
    started = time.perf_counter()
    names = list(dict.fromkeys(axis.name for spec in specs for axis in spec.bode))
    tables, counts, notices = [], {"computed": 0, "skipped": 0, "certified": 0}, []
    for spec in specs:
        read = keys_of(spec)
        grid = make_grid(spec, spec.bode, read=read)
        refuse_rows("bode", grid.size * len(spec.frequency_hz))
        tables.append(_rows(grid, np.asarray(spec.frequency_hz), names, read))
        counts["computed"] += grid.slices
        counts["skipped"] += grid.size - grid.slices
        notices += grid.notices
    columns = {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
    swept = [axis.path for spec in specs for axis in spec.bode]
    methods = METHODS | ({"worst_gain": "not computed for drawn loops"} if all(spec.drawing for spec in specs) else {})
    facts = facts_of(list(specs), methods, counts, {"compute_s": time.perf_counter() - started}, notices, swept)
    return Table.of("bode", columns, facts)


METHODS = {
    "admittance": "closed loop of the frame, displacement in the tick, component at the force's own frequency",
    "worst_gain": "singular values of the lifted map from forces to positions",
    "errors": "residual, rounding of all entries and size of the inverse, entry by entry",
}


def one_spec(spec, axes, frequency, read) -> dict:
    """Table of one spec over `axes`, at the frequencies (Hz, an array); read: the keys that its controller reads."""
    return _rows(make_grid(spec, axes, read=read), frequency, [axis.name for axis in axes], read)


def _rows(grid: Grid, frequency, names, read) -> dict:
    """Rows of one spec: combinations in order, frequencies innermost."""
    combination, repeat = np.arange(grid.size), frequency.size
    found, slices = response_arrays(grid, frequency), grid.slice_of(combination)
    leading = grid.axis_columns(combination)
    own = {name: np.full(grid.size, own_value(grid.spec, name, read)) for name in names}
    rows = {name: np.repeat(values, repeat) for name, values in (own | leading).items()}
    text = {"spec": grid.spec.name, "controller": grid.spec.kind}
    rows |= {name: np.full(grid.size * repeat, word, dtype=object) for name, word in text.items()}
    rows["frequency_hz"] = np.tile(frequency, grid.size)
    return rows | {name: values[slices].reshape(-1) for name, values in found.items()}


def own_value(spec, name, read):
    """The spec's own value of a key, named as an axis is; NaN if its controller reads other keys (`read`)."""
    key, values = spec.names.find(name), spec.values
    if key is None:
        return np.nan
    if key.path == "rates.slow_hz":
        return values["rates.fast_hz"] / values["rates.ratio"] if "rates.ratio" in read else np.nan
    if key.type == "integer":
        return values[key.path]
    return values.get(key.path, np.nan) if key.path in read else np.nan


def response_arrays(grid: Grid, frequency) -> dict[str, np.ndarray]:
    """Table columns from `omega_Ts` on, each `(slices, points)`."""
    _refuse_aliases(grid, frequency)
    if grid.drawing:
        return _drawn_arrays(grid, frequency)
    out = {}
    for numbers, values in grid.slices_of_a_drawing(max(1, BLOCK // frequency.size)):
        for name, array in _block(values, frequency).items():
            out.setdefault(name, np.empty((grid.slices, frequency.size), array.dtype))[numbers] = array
    return out


def _refuse_aliases(grid, frequency):
    """Raise UsageError for frequencies beyond half the fast rate, which a force that is held over a tick does not have."""
    name = "rates.tick_hz" if grid.spec.drawing else "rates.fast_hz"
    rates = [axis.values for axis in grid.axes if axis.path == name]
    spec = grid.spec
    own = spec.drawing.rate(spec.values) if spec.drawing else spec.values[name]
    limit = min(*rates[0], np.inf) / 2 if rates else own / 2
    if frequency.size and frequency.max() > limit:
        raise UsageError(f"bode.frequency_hz: expected at most half of {name} = {limit:g} Hz, found {frequency.max():g}")


def _drawn_arrays(grid, frequency):
    """The columns of drawn loops, one after the other; they have no worst-case gain."""
    from wavesweep.analysis.response.drawn import frame_of_port, respond_port
    from wavesweep.sweep.drawn_loops import ports_of_slices, radii

    shape, radius, out = (grid.slices, frequency.size), radii(grid), {}
    for number, _, port in ports_of_slices(grid):
        found, lost = respond_port(port, frequency), not np.isfinite(frame_of_port(port)).all()
        columns = {"omega_Ts": 2 * np.pi * frequency * port.period * port.kind.size}
        parts = {"admittance": found.admittance, "impedance": found.impedance}
        # At 0 Hz the displacement in a tick says nothing of the position.
        known = {name: np.where(np.isfinite(part), part, complex(np.nan, np.nan)) for name, part in parts.items()}
        errors = {"admittance": found.admittance_error, "impedance": found.impedance_error}
        errors = {name: np.where(np.isnan(known[name]), np.nan, error) for name, error in errors.items()}
        stable = np.full(frequency.shape, radius[number] < 1)
        columns |= parts_of("admittance", known["admittance"]) | parts_of("impedance", known["impedance"])
        columns |= {"worst_gain": np.full(frequency.shape, np.nan), "stable": stable}
        columns |= {f"{name}_error": error for name, error in errors.items()}
        columns |= {"worst_gain_error": np.full(frequency.shape, np.nan), "doubt": doubt_of(errors.values(), stable, lost)}
        for name, array in columns.items():
            out.setdefault(name, np.empty(shape, array.dtype))[number] = array
    return out


def _block(values, frequency):
    """The columns for loops of one drawing."""
    diagram, K, B, ratio = draw(values), values["environment.K_VE"], values["environment.B_VE"], values["rates.ratio"]
    loop = prepare(diagram, K, B)
    found, radius = respond(loop, frequency), spectral_radius(cut_at_wall(diagram), K, B)
    gain, gain_error = worst_gain(loop, frequency, ratio)
    omega = 2 * np.pi * frequency * (ratio * np.reshape(1 / np.asarray(values["rates.fast_hz"], float), (-1, 1)))
    columns = {"omega_Ts": omega} | parts_of("admittance", found.admittance) | parts_of("impedance", found.impedance)
    errors = {"admittance": found.admittance_error, "impedance": found.impedance_error, "worst_gain": gain_error}
    stable = (radius < 1)[..., None]
    columns |= {"worst_gain": gain, "stable": stable}
    # A gain without bound is missing, and that is known.
    columns |= {f"{name}_error": np.where(np.isnan(columns.get(name, error)), np.nan, error) for name, error in errors.items()}
    return columns | {"doubt": doubt_of(errors.values(), stable, loop.lost[..., None])}
