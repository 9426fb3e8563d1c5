"""The numbers of a spec that a page can vary, with the range of each slider, and the spec with
other numbers."""

import re
from collections.abc import Container, Mapping
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any

from wavesweep.engine.errors import SpecError
from wavesweep.haptics.controller_page import keys_of_page
from wavesweep.program.analyses.own_design import USUAL
from wavesweep.program.reading.keys import BAND_EDGES, HIGHEST_RATIO
from wavesweep.program.spec import SYMBOLS, Key, Spec, load
from wavesweep.program.spec.resolving import longest_delay
from wavesweep.program.spec.studies import FARTHEST_FACTOR, K_VE_SPAN
from wavesweep.program.spec.writing import as_toml
from wavesweep.program.sweep.grid import is_plain

FACTOR = 4.0  # times a gain's value: the end of its slider
HAND = {
    "operator.mass": 0.5,
    "operator.damping": 5.0,
    "operator.stiffness": 500.0,
}  # usual numbers of keys that are often 0


@dataclass(frozen=True, slots=True)
class Slider:
    """A number that can be varied.

    path, name: its key, as a path and as it is called. low, high: ends of the slider. least, most:
    limits of the spec, None if there are none. scale: "log" or "linear". step: 1 for whole numbers.
    search: the range that is searched for stable intervals, None if the key decides the structure
    of the loop. values: those that the spec sweeps. stops: the only places of the slider, empty if
    it has all. limited: why an end is where other numbers of the spec put it; empty if none is.
    """

    path: str
    name: str
    unit: str
    description: str
    value: float
    low: float
    high: float
    least: float | None
    most: float | None
    scale: str
    step: int | None
    search: tuple[float, float] | None
    values: tuple[float, ...]
    stops: tuple[float, ...]
    limited: str


def sliders_of(spec: Spec) -> list[Slider]:
    """The sliders of all numbers that the spec's loop reads and that it keeps when another one
    moves, in the order of its keys.

    A spec that gives the slow rate has a slider of that, and not of the ratio. A delay of a frame
    has none.
    """
    return [_slider(spec, spec.names.keys[path]) for path in _paths(spec)]


def _paths(spec):
    """Paths of the numbers that have sliders: those that the loop reads.

    Of a filter that is given by the edges of its bands these, and not its order and cutoff, which
    follow from them.
    """
    if spec.drawing:
        return [path for path in spec.names.numeric if path in spec.values]
    # A gain of zero may leave a branch out of the loop, whose other numbers come in with it.
    raised = dict(spec.values)
    for path, value in spec.values.items():
        if value == 0 and isinstance(value, float):
            raised[path] = 1.0
    read = keys_of_page(spec.values) | keys_of_page(raised)
    if spec.delay_of_frame:
        read -= {"environment.delay"}
    if _keeps_slow_rate(spec):
        read -= {"rates.ratio"}
        read |= {"rates.slow_hz"}
    paths = []
    for path in spec.names.numeric:
        stem, _, last = path.rpartition(".")
        by_edges = f"{stem}.passband_hz" in spec.given
        if last in BAND_EDGES:
            if by_edges and f"{stem}.order" in read:
                paths.append(path)
        elif path in read and not (by_edges and stem.startswith("filters.")):
            paths.append(path)
    return paths


def _keeps_slow_rate(spec):
    return "rates.slow_hz" in spec.given


def _stops(spec, key):
    """The rates that divide each other, of a spec that keeps a slow rate; empty for other keys."""
    if (
        spec.uneven
        or not _keeps_slow_rate(spec)
        or key.path not in ("rates.fast_hz", "rates.slow_hz")
    ):
        return ()
    ratios = range(1, min(int(FACTOR * spec.values["rates.ratio"]), HIGHEST_RATIO) + 1)
    if key.path == "rates.slow_hz":
        return tuple(sorted(spec.values["rates.fast_hz"] / ratio for ratio in ratios))
    rates = [spec.own("rates.slow_hz") * ratio for ratio in ratios]
    return tuple(rate for rate in rates if _accepts(spec, key.path, rate))


def _begin_above(value, axis, *, stepped):
    """The lowest value of a slider whose range begins with one that is refused, and its scale."""
    if stepped:
        swept = axis.values if axis else ()
        return min([value, *swept]), "linear"
    low = max(value, 0.0) / FARTHEST_FACTOR
    return low, "log" if low > 0 else "linear"


def _slider(spec: Spec, key: Key) -> Slider:
    value = number_of(spec, key.path)
    axis = next((axis for axis in spec.sweep if axis.path == key.path), None)
    names = {path: name for name, path in spec.names.symbols.items()}
    most = _most(spec, key)
    low, high, scale = _range(key, value, axis, most)
    plain = is_plain(spec, key.path)
    # Other rates of a spec of uneven rates are hardly ever in step again.
    uneven_rate = (
        spec.uneven and key.path in ("rates.fast_hz", "rates.slow_hz") and value.is_integer()
    )
    if uneven_rate:
        scale = "linear"
    structural = spec.drawing and not plain and key.path != "rates.tick_hz"
    stepped = key.type == "integer" or structural or uneven_rate
    integral = stepped and float(value).is_integer()
    low_is_refused = not integral and value > low and not _accepts(spec, key.path, low)
    if spec.drawing and low_is_refused:  # such as a mass of 0 by its block
        low, scale = _begin_above(value, axis, stepped=stepped)
    stops = _stops(spec, key)
    if stops:
        low = stops[0]
        high = stops[-1]
        scale = "linear"
    lowest = taken(spec, key.path, value, low, integral)
    highest = taken(spec, key.path, value, high, integral)
    limited = []
    if lowest != low:
        limited.append(_limited(spec, key.path, lowest, low))
    if highest != high:
        limited.append(_limited(spec, key.path, highest, high))
    return Slider(
        path=key.path,
        name=names.get(key.path, key.path),
        unit="" if key.unit in ("", "1") else key.unit,
        description=key.description,
        value=value,
        low=lowest,
        high=highest,
        least=key.low,
        most=most,
        scale=scale,
        step=1 if integral else None,
        search=_search(spec, key, value, axis, (lowest, highest)) if plain else None,
        values=tuple(map(float, axis.values)) if axis else (),
        stops=stops,
        limited="; ".join(limited),
    )


def _limited(spec, path, end, wanted):
    """Where a slider ends, and what the spec says of the end that its other numbers rule out."""
    try:
        changed(spec, {path: wanted})
    except SpecError as error:
        said = re.sub(r"^\S+:\d+:\d+: ", "", str(error).splitlines()[0])
        return f"ends at {end:g}, for {wanted:g} is refused ({said})"
    return f"ends at {end:g}"


def _accepts(spec, path, value):
    try:
        changed(spec, {path: value})
    except SpecError:
        return False
    return True


def taken(spec: Spec, path: str, value: float, end: float, whole: bool = False) -> float:
    """The end of a range or, if other numbers rule it out, a short number near the last one that
    the spec accepts."""
    if _accepts(spec, path, end):
        return end
    start = value
    rounding = ROUND_CEILING if end < value else ROUND_FLOOR
    for _ in range(12):  # steps towards an end that the spec accepts
        middle = (value * end) ** 0.5 if value * end > 0 else (value + end) / 2
        if whole:
            middle = round(middle)
        if _accepts(spec, path, middle):
            value = middle
        else:
            end = middle
    short = float(Context(prec=3, rounding=rounding).create_decimal(value))  # digits of that end
    fits = (
        not whole
        and min(start, value) <= short <= max(start, value)
        and _accepts(spec, path, short)
    )
    return short if fits else value


def number_of(spec: Spec, path: str) -> float:
    """The value of a numeric key, also of one that another follows from."""
    if path in spec.values:
        return spec.values[path]
    tables = spec.tables()
    if path == "rates.slow_hz":
        return tables["rates"].get("slow_hz", spec.own(path))
    _, name, last = path.split(".")
    return float(tables["filters"][name][last])


def _most(spec, key):
    """The largest value that the spec accepts, with the others as they are."""
    if key.path == "environment.delay":
        return longest_delay(spec.values)
    if key.path.endswith("_hz") and key.path.startswith("filters."):
        return spec.values["rates.fast_hz"] / 2 * (1 - 1e-9)
    if key.choices:
        return max(key.choices)
    return key.high


def _range(key, value, axis, most):
    """(low, high, scale) of a slider."""
    if key.type == "integer":
        low = key.low if key.low is not None else min(key.choices, default=0)
        high = 4 * max(value, 1)
        if most is not None:
            high = most if most <= 100 else min(high, most)
        return low, high, "linear"
    if axis and axis.scale and axis.start < axis.stop:
        low = min(axis.start, value)
        high = max(axis.stop, value)
        return low, high, axis.scale if low > 0 else "linear"
    low, high, scale = _usual(key, value, most)
    if axis:
        low = min(low, axis.start)
        high = max(high, axis.stop)
    return low, high, scale


def _usual(key, value, most):
    """The range of a slider about a value, for a number that is not swept."""
    if key.above_low and value > 0:
        return (
            value / FARTHEST_FACTOR,
            min(value * FARTHEST_FACTOR, most or value * FARTHEST_FACTOR),
            "log",
        )
    symbol = next((name for name, path in SYMBOLS.items() if path == key.path), "")
    usual = USUAL.get(symbol, HAND.get(key.path, 1.0))
    if value < 0:
        return FACTOR * value, -FACTOR * value, "linear"
    low = 0.0 if key.low == 0 or value else -FACTOR * usual
    return low, min(FACTOR * (value or usual / FACTOR), most or float("inf")), "linear"


def _search(spec, key, value, axis, ends):
    """The range of stable intervals: that of [sweep], and otherwise that of the slider."""
    if axis and axis.start < axis.stop:
        return float(axis.start), float(axis.stop)
    if key.path in spec.wall[:1]:
        return K_VE_SPAN
    low, high = ends
    return float(low), float(max(high, value))


def changed(spec: Spec, values: Mapping[str, float]) -> Spec:
    """The spec with other numbers; a whole number may come as a float. Errors: SpecError with
    every mistake."""
    changes: dict[str, float] = {}
    for path, value in values.items():
        key = spec.names.find(path)
        integral = (
            key is not None
            and key.type == "integer"
            and isinstance(value, float)
            and value.is_integer()
        )
        wanted = int(value) if integral else value
        if path not in spec.values or spec.values[path] != wanted:
            changes[path] = wanted
    if changes:
        return spec.with_values(changes)
    return spec


def text_of(spec: Spec) -> str:
    """The spec as TOML, with the keys that its loop reads and those that it gives.

    Frequencies of [bode] end at half the rate. Other parts of [sweep], [bode], [simulate] and
    [design] that its numbers rule out are left out.
    """
    # Without being asked for [design] a spec leaves it out of its tables.
    tables = (spec.asking("design") if spec.design else spec).tables()
    # The ratio follows from a slow rate that is given.
    if _keeps_slow_rate(spec) and tables["rates"].pop("ratio", None):
        tables["rates"]["slow_hz"] = spec.own("rates.slow_hz")
    tables["bode"]["frequency_hz"] = _below(tables["bode"]["frequency_hz"], spec.tick_hz / 2)
    if not spec.drawing:
        # Keys that other kinds of controllers read are left out, what is asked of the loop is not.
        kept = {*keys_of_page(spec.values), *_paths(spec), *spec.given}
        for path in spec.given:
            stem, _, last = path.rpartition(".")
            if last in BAND_EDGES:  # from which these follow
                kept -= {f"{stem}.order", f"{stem}.cutoff_hz"}
        studies = {
            name: tables.pop(name)
            for name in ("sweep", "bode", "for_all", "measured", "design")
            if name in tables
        }
        tables = _only(tables, kept) | studies
    simulated = _simulate_table(spec)
    if simulated:
        tables["simulate"] = simulated
    _drop_mistakes(tables)
    return as_toml(tables)


def _simulate_table(spec):
    """The keys of [simulate] that the spec gives, as TOML has them."""
    if not spec.simulate:
        return {}
    names = sorted(
        path.removeprefix("simulate.") for path in spec.given if path.startswith("simulate.")
    )
    table = {}
    for name in names:
        value = spec.simulate[name]
        table[name] = list(value) if isinstance(value, tuple) else value
    return table


def _drop_mistakes(tables):
    """Leave out the parts of [sweep], [bode], [simulate] and [design] that a spec of these
    tables would be refused for."""
    try:
        load(tables)
    except SpecError as error:
        for mistake in error.mistakes:
            table, _, name = mistake.key.partition(".")
            if table in ("sweep", "bode"):
                tables[table].pop(name, None)
            elif table in ("simulate", "design"):
                tables.pop(table, None)


def _below(frequencies, most):
    """Frequencies, as a spec gives them, up to `most`."""
    if not isinstance(frequencies, Mapping):
        return [f for f in frequencies if f <= most] or [most]
    if frequencies["stop"] <= most:
        return frequencies
    start = frequencies["start"]
    if start >= most:
        start = most / 1e3
    return {**frequencies, "start": start, "stop": most}


def _only(table: Mapping[str, Any], kept: Container[str], above: str = "") -> dict[str, Any]:
    """The keys of a table and of the tables in it whose paths are `kept`."""
    tables = {}
    for name, value in table.items():
        if isinstance(value, Mapping):
            inner = _only(value, kept, f"{above}{name}.")
            if inner:
                tables[name] = inner
        elif f"{above}{name}" in kept:
            tables[name] = value
    return tables
