"""What a call of the library asks for: axes, a span and frequencies, as a spec's [sweep] and
[bode] would have them."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import product

import numpy as np

from wavesweep.engine.arguments import real_numbers
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Key, computable, nearest
from wavesweep.program.spec import SYMBOLS, Axis, Spec
from wavesweep.program.spec.resolving import LIMITS

# of calls that take numbers by name beside these
ARGUMENTS = ("along", "span", "require", "frequency_hz")
Numbers = float | Sequence[float] | np.ndarray  # the values of an axis


def key_named(spec: Spec, name: object) -> Key:
    """The numeric key of that name. Errors: UsageError for another name."""
    names = spec.names
    if not isinstance(name, str):
        raise UsageError(f"expected the name of a numeric key, found {name!r:.60}")
    key = names.find(name)
    if key is None or not key.numeric:
        hint = nearest(name, (*ARGUMENTS, *names.symbols, *names.numeric))
        if names.symbols:
            symbols = f" ({', '.join(names.symbols)}, or the path of another)"
        else:
            symbols = ""
        raise UsageError(
            f"{name}: expected the name of a numeric key"
            + (f", did you mean {hint}?" if hint else symbols)
        )
    return key


def axis_along(spec: Spec, name: str, span: object) -> Axis:
    """The axis of intervals that a call names, searched over `span`, (low, high). Errors:
    UsageError."""
    key = key_named(spec, name)
    if span is None and spec.drawing:
        span = next(
            (
                (axis.start, axis.stop)
                for axis in spec.sweep
                if axis.path == key.path and axis.start < axis.stop
            ),
            None,
        )
    if span is None:
        if key.path != SYMBOLS["K_VE"]:
            raise UsageError(f"along {name}: give the span to search, span=(low, high)")
        span = (0.0, 20000.0)
    ends = real_numbers(span)
    if ends is None or ends.shape != (2,):
        raise UsageError(f"span: expected (low, high), found {span!r:.60}")
    low, high = map(float, ends)
    if not low < high:
        raise UsageError(f"span: expected (low, high), low < high, found ({low!r}, {high!r})")
    return Axis(name, key.path, (), low, high, key.structural, "linear")


def axes_asked(
    spec: Spec, axes: Mapping[str, object], interval_axis: Axis | None = None
) -> tuple[Axis, ...]:
    """The axes that a call names, with their values; interval_axis: that of the intervals. Errors:
    UsageError, SpecError."""
    axes_read = tuple(_axis(spec, name, values) for name, values in axes.items())
    for number, axis in enumerate(axes_read):
        if axis.path in [earlier.path for earlier in axes_read[:number]]:
            raise UsageError(
                f"{axis.name}: expected each number once, found it under two names; leave one of them out"
            )
        if interval_axis is not None and axis.path == interval_axis.path:
            raise UsageError(
                f"{axis.name}: expected other axes than {interval_axis.name}, which the intervals are along; give a span"
            )
    _refuse_values(spec, (interval_axis, *axes_read) if interval_axis else axes_read)
    return axes_read


def _refuse_values(spec: Spec, axes: Sequence[Axis]) -> None:
    """Raise SpecError for values that a spec would refuse; every combination is computed."""
    together, limited = [], {} if spec.drawing else LIMITS
    linked = {*limited, *(path for limits in limited.values() for path in limits)}
    for axis in axes:
        # What is next to 0, or NaN, is neither the least nor the largest, and is refused on its
        # own.
        values = np.array(axis.values, float)
        refused = values[~computable(values)].tolist()
        ends = tuple(dict.fromkeys((axis.start, axis.stop, *refused)))
        if axis.path in linked:
            together.append((axis.path, ends))
            continue
        for end in ends:
            _accept(spec, (axis.path,), end)
    for values in product(*(ends for _, ends in together)):
        _accept(spec, tuple(path for path, _ in together), *values)


def _axis(spec: Spec, name: str, values: object) -> Axis:
    key = key_named(spec, name)
    numbers = real_numbers(values)
    if numbers is None or numbers.ndim > 1:
        raise UsageError(f"{name}: expected a number or a list of numbers, found {values!r:.60}")
    if not numbers.size:
        raise UsageError(f"{name}: expected at least one value, found none")
    numbers = np.atleast_1d(numbers)
    plain = tuple(numbers.tolist() if numbers.dtype.kind != "f" else numbers.astype(float).tolist())
    plain = plain if key.type == "integer" else tuple(map(float, plain))
    return Axis(name, key.path, plain, min(plain), max(plain), key.structural)


@lru_cache(
    maxsize=256, typed=True
)  # a compiled loop is asked about the same ranges again and again
def _accept(spec: Spec, paths: tuple[str, ...], *values: float) -> None:
    """Raise SpecError for values that a spec would refuse, one for each path."""
    spec.with_values(dict(zip(paths, values, strict=True)))


def frequencies_asked(spec: Spec, frequency_hz: object) -> np.ndarray:
    """Frequencies in Hz that a call names, those of [bode] by default. Errors: UsageError."""
    numbers = real_numbers(spec.frequency_hz if frequency_hz is None else frequency_hz)
    if numbers is None:
        raise UsageError(
            f"frequency_hz: expected a number or a list of numbers, found {frequency_hz!r:.60}"
        )
    frequency = numbers.astype(float).ravel()
    if not frequency.size or not np.all((frequency >= 0) & np.isfinite(frequency)):
        wrong = frequency[~((frequency >= 0) & np.isfinite(frequency))]
        raise UsageError(
            f"frequency_hz: expected finite numbers >= 0, found {wrong[0] if wrong.size else 'none'}"
        )
    return frequency
