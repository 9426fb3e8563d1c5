"""Resolving: from the given keys to a value for every key, with the checks that concern more
than one key."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from wavesweep.engine.drawing import LONGEST_DELAY, Drawing, faults
from wavesweep.engine.keys import (
    HIGHEST_ORDER,
    Leaf,
    Mistakes,
    Place,
    expectation,
    show,
)
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program.reading.keys import (
    BAND_EDGES,
    DEVICES,
    FILTERS,
    HIGHEST_RATIO,
    KEYS,
    VALUE_PATHS,
    HapticDevice,
)

DELAY = "environment.delay"
# ticks after which rates that do not divide are in step again: commands take minutes with more, and
# seconds with few
MOST_TICKS_IN_STEP = 10_000
FEW_TICKS_IN_STEP = 2000
# Two ways to give one rate: each displaces the other.
TWINS = {"rates.ratio": "rates.slow_hz", "rates.slow_hz": "rates.ratio"}


def quantity_of(path: str) -> str:
    """Return the path that stands for all keys of one quantity: that of the ratio for the slow rate
    too."""
    return "rates.ratio" if path in TWINS else path


@dataclass(frozen=True, slots=True)
class Given:
    """The leaves of the loop's own tables by path, and the place of their source."""

    leaves: Mapping[str, Leaf]
    source: Place

    def leaf(self, path: str) -> Leaf:
        """Return the given leaf at `path`, or an empty one at the place that it would have."""
        return self.leaves.get(path) or Leaf(None, self.source.under(tuple(path.split("."))))

    def device(self) -> HapticDevice | None:
        """Return the device that the spec names; None if it names none, or one that does not
        exist."""
        leaf = self.leaves.get("device.preset")
        if leaf is not None and isinstance(leaf.value, str):
            return DEVICES.get(leaf.value)
        return None

    def replaced(self, path: str, leaf: Leaf, beside: Collection[str] = ()) -> Given:
        """Return the same with another value at `path`; a rate displaces the other way to give it
        if not `beside` it.

        Order and cutoff that a resolved spec has in addition to the band edges follow from these
        again.
        """
        displaced: set[str] = set()
        if path in TWINS and TWINS[path] not in beside:
            displaced.add(TWINS[path])
        by_edges = [name for name in FILTERS if f"filters.{name}.{BAND_EDGES[0]}" in self.leaves]
        displaced |= {
            f"filters.{name}.{key}" for name in by_edges for key in ("order", "cutoff_hz")
        }
        return Given(
            {
                **{name: old for name, old in self.leaves.items() if name not in displaced},
                path: leaf,
            },
            self.source,
        )


def resolve(given: Given) -> tuple[dict[str, float | int | str], Mistakes]:
    """Return the value of every path of VALUE_PATHS, and all mistakes; if there are mistakes,
    the values are not valid."""
    of_frame = is_frame(given)
    mistakes = Mistakes()
    leaves = {path: leaf for path, leaf in given.leaves.items() if not (of_frame and path == DELAY)}
    checked = mistakes.read(KEYS, leaves)
    wrong = set(leaves) - set(checked)
    # Defaults replace wrong values, so that one mistake does not hide those that are independent of
    # it.
    device = given.device()
    given_values = (device.loop() if device else {}) | checked
    values = {path: given_values.get(path, KEYS[path].default) for path in VALUE_PATHS}
    _refuse_missing_keys(given, device.unknown() if device else (), mistakes)
    rate_known = not ("rates.fast_hz" in given.leaves and "rates.fast_hz" not in checked)
    _resolve_rates(given, checked, values, rate_known, mistakes)
    if of_frame:
        values[DELAY] = values["rates.ratio"]  # ticks, of which the last one may be a part
    for name in FILTERS:
        _resolve_filter(name, given, checked, values, rate_known, mistakes)
    # A limit is not applied where the value that sets it is itself a mistake.
    _refuse_beyond_limits(given, values, wrong | {mistake.key for mistake in mistakes}, mistakes)
    return values, mistakes


def _refuse_missing_keys(given: Given, unpublished: Iterable[str], mistakes: Mistakes) -> None:
    """Add a mistake for each key without a default that is missing. unpublished: those that the
    preset has no number for."""
    for key in KEYS.values():
        if key.required and key.path not in given.leaves:
            mistakes.refuse(
                given.leaf(key.path),
                key.path,
                expectation(key),
                "nothing (it has no default)",
                of_key=False,
            )
    for path in unpublished:
        if path not in given.leaves:
            leaf = given.leaf("device.preset")
            expected = f"{expectation(KEYS[path])} in {KEYS[path].unit} (none is published for {leaf.value})"
            mistakes.refuse(leaf, path, expected, "nothing")


def _refuse_beyond_limits(
    given: Given, values: Mapping, wrong: set[str], mistakes: Mistakes
) -> None:
    """Add a mistake for each value beyond its limit. wrong: keys with mistakes, which limit
    nothing."""
    for path, limiting in LIMITS.items():
        if wrong & {path, *limiting} or not is_read(path, values):
            continue
        if expected := exceeds_limit(path, values[path], values):
            default = "" if path in given.leaves else " (the default)"
            mistakes.refuse(
                given.leaf(path), path, expected, show(values[path]) + default, of_key=False
            )


def resolve_drawn(
    drawing: Drawing, before: Mapping[str, float], given: Given
) -> tuple[dict[str, float], Mistakes]:
    """Return the values of a drawing's numbers as they are given now, and all mistakes."""

    values = dict(before)
    mistakes = Mistakes()
    for path, key in drawing.names.keys.items():
        if leaf := given.leaves.get(path):
            values[path] = mistakes.check(key, leaf, path)
    for path, expected, value in () if mistakes else faults(drawing, values):
        mistakes.refuse(given.leaf(path), path, expected, value, of_key=False)
    return values, mistakes


def is_frame(given: Given) -> bool:
    """Return whether slow results are in place with the next frame, however long it is."""
    return DELAY in given.leaves and given.leaves[DELAY].value == "frame"


def _resolve_rates(
    given: Given, checked: Mapping, values: dict, rate_known: bool, mistakes: Mistakes
) -> None:
    """Set the ratio in `values` if the slow rate was given instead."""
    path = "rates.slow_hz"
    fast_hz = values["rates.fast_hz"]
    if path in given.leaves and "rates.ratio" in given.leaves:
        mistakes.refuse(given.leaf(path), path, "either ratio or slow_hz", "both")
    elif path in checked and rate_known:
        if ratio := _ratio(fast_hz, checked[path]):
            values["rates.ratio"] = ratio
        else:
            expected = f"rates.fast_hz = {fast_hz!r} divided by a whole number from 1 to {HIGHEST_RATIO}, or by a fraction of "
            expected += (
                f"at least 2 after which both are in step again within {MOST_TICKS_IN_STEP} ticks"
            )
            below = math.floor(min(fast_hz / checked[path], HIGHEST_RATIO))
            # With their ratios, as few of these rates are short decimals.
            ratios = [
                ratio_near for ratio_near in (below, below + 1) if 1 <= ratio_near <= HIGHEST_RATIO
            ]
            nearest = [f"{fast_hz / near:g} Hz, ratio = {near}" for near in ratios]
            if 2 <= fast_hz / checked[path] <= HIGHEST_RATIO:
                ticks, steps = _short_fraction(fast_hz / checked[path], FEW_TICKS_IN_STEP)
                nearest.append(f"{fast_hz * steps / ticks!r} Hz, {ticks} ticks")
            expected += f" (the nearest: {' and '.join(nearest)})"
            if checked[path] > fast_hz:
                expected = f"at most rates.fast_hz = {fast_hz!r} (are the two swapped?)"
            mistakes.refuse(
                given.leaf(path), path, expected, show(given.leaf(path).value), of_key=False
            )


def _ratio(fast_hz: float, slow_hz: float) -> float | None:
    """A whole number if the fast rate is a multiple of the slow one, otherwise a fraction; None
    if that is not small."""
    quotient = fast_hz / slow_hz
    if not 0.5 <= quotient <= HIGHEST_RATIO + 0.5:
        return None
    ratio = max(1, round(quotient))
    # Neither 1000/3 nor 333.3 is a double: what divides exactly as written is off by the rounding
    # of both numbers and of their product, at most 1.5 units in the last place.
    if math.isclose(slow_hz * ratio, fast_hz, rel_tol=4e-16):
        return ratio
    if not 2 <= quotient <= HIGHEST_RATIO:
        return None
    ticks, steps = _short_fraction(quotient, MOST_TICKS_IN_STEP)
    if math.isclose(slow_hz * ticks, fast_hz * steps, rel_tol=5e-16):
        return ticks / steps
    return None


def _short_fraction(quotient: float, most_ticks: int) -> tuple[int, int]:
    """Ticks, at most so many, and slow steps of the nearest ratio of both."""
    from fractions import Fraction

    return Fraction(quotient).limit_denominator(int(most_ticks / quotient)).as_integer_ratio()


def _resolve_filter(
    name: str, given: Given, checked: Mapping, values: dict, rate_known: bool, mistakes: Mistakes
) -> None:
    """Set order and cutoff in `values` if the filter was given by its band edges; a resolved
    spec has both, which agree."""
    path = f"filters.{name}"
    edges = [edge for edge in BAND_EDGES if f"{path}.{edge}" in given.leaves]
    if not edges:
        return
    leaf = given.leaf(f"{path}.{edges[0]}")
    direct = [
        path_given
        for path_given in (f"{path}.order", f"{path}.cutoff_hz")
        if path_given in given.leaves
    ]
    either = "either order and cutoff_hz or the four band edges"
    numbers = [checked.get(f"{path}.{edge}") for edge in BAND_EDGES]
    if len(edges) < len(BAND_EDGES):
        all_or_some = "all of " + ", ".join(BAND_EDGES), "only " + ", ".join(edges)
        mistakes.refuse(leaf, path, *((either, "both") if direct else all_or_some))
    elif (
        None not in numbers
        and rate_known
        and (of_edges := _order_of_edges(name, leaf, numbers, values, given, mistakes))
    ):
        values[f"{path}.order"], values[f"{path}.cutoff_hz"] = of_edges
        if any(
            path_given in checked
            # Relative difference of the cutoffs that two machines find from the same edges.
            and not math.isclose(checked[path_given], values[path_given], rel_tol=1e-12)
            for path_given in direct
        ):
            mistakes.refuse(leaf, path, either, "both, which differ")


def _order_of_edges(
    name: str, leaf: Leaf, numbers: list[float], values: dict, given: Given, mistakes: Mistakes
) -> tuple[float, float] | None:
    """Return order and cutoff (Hz) of the filter that meets its band edges; None, with a
    mistake, if there is none."""
    before = len(mistakes)
    fast_hz = values["rates.fast_hz"]
    _check_edges(name, numbers, fast_hz, given, mistakes)
    if len(mistakes) > before:
        return None
    order, cutoff_hz = butterworth_order(*numbers, fast_hz)
    if order > HIGHEST_ORDER:
        expected = f"band edges that a filter of order {HIGHEST_ORDER} or less meets"
        mistakes.refuse(leaf, f"filters.{name}", expected, f"edges that need order {order:g}")
        return None
    return order, cutoff_hz


def _check_edges(
    name: str, numbers: list[float], fast_hz: float, given: Given, mistakes: Mistakes
) -> None:
    passband_hz, stopband_hz, passband_db, stopband_db = numbers
    if name == "hp":
        ordered = passband_hz > stopband_hz
    else:
        ordered = passband_hz < stopband_hz
    side = "below" if name == "hp" else "above"
    below_half = f"a number < {fast_hz / 2!r} (half of rates.fast_hz)"
    for edge, right, expected in (
        ("stopband_hz", ordered, f"an edge {side} the passband ({passband_hz!r})"),
        ("stopband_db", passband_db < stopband_db, f"more than passband_db = {passband_db!r}"),
        ("passband_hz", passband_hz < fast_hz / 2, below_half),
        ("stopband_hz", stopband_hz < fast_hz / 2, below_half),
    ):
        if not right:
            leaf = given.leaf(f"filters.{name}.{edge}")
            mistakes.refuse(
                leaf, f"filters.{name}.{edge}", expected, show(leaf.value), of_key=False
            )


# Which keys set a limit to which others.
LIMITS = {
    f"filters.{name}.cutoff_hz": (
        "rates.fast_hz",
        f"filters.{name}",
        *(f"filters.{name}.{edge}" for edge in BAND_EDGES),
    )
    for name in FILTERS
}
LIMITS["device.dead_time"] = ("device.delay", "rates.fast_hz")
LIMITS["environment.delay"] = ("rates.ratio", "rates.slow_hz", "rates.fast_hz")


def exceeds_limit(path: str, number: float, values: Mapping) -> str:
    """Return the expected range if `number` is beyond the limit that other keys set for `path`,
    otherwise an empty text."""
    if (
        path == DELAY
        and number != values["rates.ratio"]
        and number > (longest := longest_delay(values))
    ):
        if values["rates.ratio"] == longest:
            limit = "rates.ratio"
        else:
            limit = 'the longest frame, or "frame"'
        return f"a whole number <= {longest} ({limit})"
    rate = values["rates.fast_hz"]
    if path == "device.dead_time" and number * rate + values["device.delay"] > LONGEST_DELAY:
        return f"at most {(LONGEST_DELAY - values['device.delay']) / rate:g} s, {LONGEST_DELAY} ticks with device.delay"
    if path.endswith(".cutoff_hz") and not number < values["rates.fast_hz"] / 2:
        return f"a number < {values['rates.fast_hz'] / 2!r} (half of rates.fast_hz)"
    return ""


def longest_delay(values: Mapping) -> int:
    """Return the longest delay of a slow result in ticks: the longest frame, in which rates that
    do not divide begin a last one."""
    return math.ceil(values["rates.ratio"])


def is_read(path: str, values: Mapping) -> bool:
    """Whether the loop reads a key with a limit: a controller reads the cutoffs of its filters,
    unless their order is 0."""
    if not path.endswith(".cutoff_hz"):
        return True
    controller = CONTROLLERS.get(values["controller.kind"])
    unread = controller and path.split(".")[1] not in controller.filters
    return not unread and values[path.replace("cutoff_hz", "order")] != 0


def butterworth_order(
    passband_hz: float, stopband_hz: float, passband_db: float, stopband_db: float, fast_hz: float
) -> tuple[float, float]:
    """Return order and cutoff (Hz) of the least digital Butterworth filter that meets the edges.

    passband_hz, stopband_hz: edges in Hz; a low-pass if the passband lies below the stopband,
    otherwise a high-pass. passband_db: largest loss in the passband, dB. stopband_db: least
    attenuation in the stopband, dB. fast_hz: rate, Hz. As `scipy.signal.buttord`: with the edges
    prewarped, `W = tan(pi*f/fast_hz)`, and `G = 10^(dB/10)`, the order is the least whole number
    not below `log((G_stop - 1)/(G_pass - 1)) / (2 log r)` for the ratio `r > 1` of the edges; the
    cutoff then gives exactly `passband_db` at the edge of the passband. If doubles cannot tell the
    edges apart, or an edge or `passband_db` from zero, the order is infinite, and the cutoff is the
    edge of the passband.

    Accuracy: the order is SciPy's; the cutoff agrees to a few units in the last place.
    """
    passband = math.tan(math.pi * (2 * passband_hz / fast_hz) / 2)
    stopband = math.tan(math.pi * (2 * stopband_hz / fast_hz) / 2)
    lowpass = passband_hz < stopband_hz
    if 0.0 in (passband, stopband):
        return math.inf, passband_hz
    ratio = stopband / passband if lowpass else passband / stopband
    loss = 10 ** (0.1 * passband_db) - 1.0
    attenuation = 10 ** (0.1 * stopband_db) - 1.0
    if loss == 0.0 or math.log10(ratio) == 0.0:
        return math.inf, passband_hz
    order = max(1, math.ceil(math.log10(attenuation / loss) / (2 * math.log10(ratio))))
    prototype = loss ** (-1.0 / (2.0 * order))
    natural = prototype * passband if lowpass else passband / prototype
    return order, math.atan(natural) * 2.0 / math.pi * fast_hz / 2
