"""What [sweep], [bode] and [simulate] ask for, checked in itself and against the loop."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from wavesweep.errors import Mistake
from wavesweep.spec.axes import Axis, axis_place, build_axis
from wavesweep.spec.checking import Rejected, check, show
from wavesweep.spec.experiment import Experiment, build_experiment
from wavesweep.spec.keys import BAND_EDGES, KEYS, STUDY_KEYS, SYMBOLS, find_key
from wavesweep.spec.places import Leaf
from wavesweep.spec.resolving import LIMITS, Given, exceeds_limit
from wavesweep.spec.sorting import Sorted
from wavesweep.spec.spacing import logarithmic
from wavesweep.spec.suggestions import nearest

DEFAULT_FREQUENCIES = Axis("frequency_hz", "bode.frequency_hz", logarithmic(0.1, 50.0, 400), 0.1, 50.0, False, "log")


@dataclass(frozen=True, slots=True)
class Studies:
    """`along`, the axes of both sweeps in the spec's order, the frequencies as an axis, and the experiment."""

    along: str
    sweep: tuple[Axis, ...]
    bode: tuple[Axis, ...]
    frequencies: Axis
    experiment: Experiment


def build_studies(leaves: Sorted, given: Given) -> tuple[Studies, list[Mistake]]:
    """Return the studies and their mistakes; what only the loop's values can tell is left to `beyond_limits`."""
    along, mistakes = _read_along(leaves.along)
    axes: dict[str, list[Axis]] = {}
    for study, named in leaves.axes.items():
        built = [build_axis(study, name, parts) for name, parts in named.items()]
        axes[study] = [axis for axis, _ in built if axis]
        mistakes += [mistake for _, wrong in built for mistake in wrong]
        mistakes += [*_repeated(study, named), *_at_odds_with_filters(study, axes[study], given)]
    mistakes += [need_values("bode", axis) for axis in axes["bode"] if not axis.values]
    frequencies = [axis for axis in axes["bode"] if axis.path == DEFAULT_FREQUENCIES.path]
    bode = tuple(axis for axis in axes["bode"] if axis not in frequencies)
    experiment, wrong = build_experiment(leaves)
    frequency = (*frequencies, DEFAULT_FREQUENCIES)[0]
    return Studies(along, tuple(axes["sweep"]), bode, frequency, experiment), mistakes + wrong


def need_values(study: str, axis: Axis) -> Mistake:
    """Return the mistake that an axis with only a span is, where values are needed."""
    leaf = Leaf(None, axis.place)
    return leaf.mistake(f"{study}.{axis.name}", "num beside start and stop, or a list", "only a span", of_key=True)


def axis_fault(name: str) -> tuple[str, str] | None:
    """Return what is found, and what may have been meant, where `name` names no numeric key; else None."""
    key = find_key(name)
    if key is None:
        numeric = [path for path, known in KEYS.items() if known.numeric]
        return show(name), nearest(name, SYMBOLS) or nearest(name, numeric)
    return None if key.numeric else (f"{show(name)}, which takes no number", "")


def _read_along(leaf: Leaf | None) -> tuple[str, list[Mistake]]:
    key = STUDY_KEYS["sweep.along"]
    if leaf is None:
        return key.default, []
    try:
        name = check(key, leaf.value)
    except Rejected as error:
        return key.default, [leaf.mistake(key.path, error.expected, error.found)]
    fault = axis_fault(name)
    expected = "the name of a numeric key"
    return name, [leaf.mistake(key.path, expected, *fault)] if fault else []


def _repeated(study: str, named: Mapping[str, dict[str, Leaf]]) -> Iterator[Mistake]:
    first: dict[str, str] = {}
    for name, parts in named.items():
        path = getattr(find_key(name), "path", name)
        if path == "rates.slow_hz":
            path = "rates.ratio"  # one quantity
        if path in first:
            leaf = Leaf(None, axis_place(parts))
            yield leaf.mistake(
                f"{study}.{name}", "each key once", f"the key of the axis {first[path]} again", of_key=True
            )
        first.setdefault(path, name)


def _at_odds_with_filters(study: str, axes: Iterable[Axis], given: Given) -> Iterator[Mistake]:
    for axis in axes:
        name, _, last = axis.path.rpartition(".")
        if not name.startswith("filters."):
            continue
        by_edges = f"{name}.{BAND_EDGES[0]}" in given.leaves
        if by_edges != (last in BAND_EDGES):
            used = "its band edges" if by_edges else "order and cutoff_hz"
            expected = f"an axis that fits {name}, given by {used}"
            yield Leaf(None, axis.place).mistake(f"{study}.{axis.name}", expected, axis.path, of_key=True)


def beyond_limits(study: str, axes: Iterable[Axis], values: Mapping) -> Iterator[Mistake]:
    """Yield the mistakes of axes that leave the range which the loop's other values set.

    Every combination of a study's axes is computed, so a cutoff has to suit the lowest swept rate. A delay beside a
    swept ratio is left to `with_values`, which sees each combination.
    """
    swept = {axis.path: axis for axis in axes}
    if "rates.fast_hz" in swept:
        values = {**values, "rates.fast_hz": swept["rates.fast_hz"].start}
    for axis in axes:
        if axis.path == "environment.delay" and set(LIMITS[axis.path]) & set(swept):
            continue
        expected = exceeds_limit(axis.path, axis.stop, values)
        if expected:
            yield Leaf(None, axis.place).mistake(f"{study}.{axis.name}", expected, show(axis.stop), of_key=True)
