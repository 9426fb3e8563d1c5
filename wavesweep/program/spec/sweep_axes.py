"""The axis along which stable intervals are wanted, and the other axes of a sweep."""

from wavesweep.engine.errors import Mistake, SpecError, UsageError
from wavesweep.program.reading.axes import Axis
from wavesweep.program.spec.spec import Spec
from wavesweep.program.spec.studies import K_VE_SPAN, axis_fault


def sweep_axes(spec: Spec, along: str | None = None, swept: bool = True) -> tuple[Axis, tuple[Axis, ...]]:
    """Return the axis of [sweep] along which intervals are wanted (`spec.along` by default), and the other axes.

    along: a symbol or a path; K_VE is the stiffness that the [ports] of a drawn loop name, and has a default span if the spec
    gives none. swept: whether the others are swept; then those that have only a span are left out. If they are not, a number
    without a span has one from a tenth of its value to ten times it. Errors: SpecError if `along` is not a numeric key or has
    no span.
    """
    name = spec.along if along is None else along
    if not isinstance(name, str):
        raise UsageError(f"along: expected the name of a number, found {along!r:.60}")
    if spec.drawing and not spec.names.find(name):
        if along == "K_VE" and not spec.wall:
            expected = "wall = { stiffness = ..., damping = ... }, the numbers of a wall"
            raise SpecError([spec.mistake("ports", expected, "no wall")])
        if not name:
            expected = "along = ..., the number whose stable intervals are wanted"
            raise SpecError([spec.mistake("sweep", expected, "none, and not a single axis that is only a span")])
        name = spec.drawing.wall[0] if along == "K_VE" else name
    if fault := axis_fault(name, spec.names):
        raise SpecError([Mistake("", "along", "the name of a numeric key", *fault)])
    path = spec.names.find(name).path
    if spec.builds(path, [axis.path for axis in spec.sweep]):
        raise UsageError(no_axis(spec, name))
    wanted = next((axis for axis in spec.sweep if axis.path == path and (swept or axis.start < axis.stop)), None)
    value, structural = spec.own(path), spec.names.keys[path].structural
    if wanted is None and (path in spec.wall[:1] or (value and not swept and not structural)):
        span = K_VE_SPAN if path in spec.wall[:1] else sorted((value / 10, value * 10))
        wanted = Axis(name, path, (), *span, structural, "linear")
    if wanted is None or not wanted.start < wanted.stop:
        place = wanted.place if wanted else spec.source_place.under(("sweep",))
        expected = f"a span to search, `{name} = {{ start = ..., stop = ... }}` in [sweep]"
        problem = "a single value" if wanted else "none"
        raise SpecError([place.mistake(f"sweep.{name}", expected, problem)])
    return wanted, tuple(axis for axis in spec.sweep if axis.path != path and (axis.values or not swept))


def no_axis(spec: Spec, name: str) -> str:
    """Return the message that a number has no intervals, since it decides how the loop is built; spec, name: of the axis."""
    if name == "rates.fast_hz":
        return (
            f"intervals along {name}: expected a ratio of the rates, and filters by order and cutoff, found a slow rate or the "
            "edges of a band, with which a ratio or an order jumps; give rates.ratio, or order and cutoff_hz"
        )
    return (
        f"intervals along {name}: expected a number that the loop varies with smoothly, found one that decides "
        f"how it is built; sweep it as values ({name} = [...]) and look along another axis"
        f"{'' if spec.drawing else ', such as K_VE'}"
    )
