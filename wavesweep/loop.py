"""The library: a compiled loop with vectorised methods that return DataFrames and arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import isnan

import numpy as np

from wavesweep.drawn_loop import DrawnLoop, refuse_infinite
from wavesweep.errors import UsageError
from wavesweep.given import real_numbers
from wavesweep.loops.from_drawing import assembled, first_of
from wavesweep.loops.multirate import MultirateLoop
from wavesweep.monodromy.drift import drift_of_drawn
from wavesweep.spec import SYMBOLS, Axis, Spec, load
from wavesweep.spec.axes import NARROWEST_SPAN
from wavesweep.spec.checking import nearest
from wavesweep.spec.loading import naming
from wavesweep.spec.resolving import LIMITS
from wavesweep.sweep.drawn_loops import drift_of, refuse_singular
from wavesweep.sweep.grid import keys_of, make_grid, own_loop


def compile(source) -> "Loop | DrawnLoop":  # noqa: A001 - the name that the interface gives it
    """Compile `source` (a `Spec`, a path, nested tables as a dict, or a `MultirateLoop`) once, for any number of calls."""
    if isinstance(source, MultirateLoop):
        source.refuse_wrong_names()
        refuse_infinite(source)
        return DrawnLoop(source, drift_of_drawn(first_of(source), first_of(source, -1)))
    spec = source if isinstance(source, Spec) else load(source)
    refuse_singular(spec, own_loop(spec)[0])
    return Loop(spec, keys_of(spec))


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """A compiled loop.

    The methods take `axes` by name, each a number or a list, and compute the product of the lists. An axis is named by its
    symbol (`K_VE`, `b`, ...) or, for any other number, by its path in a mapping:
    `loop.spectral_radius(b=[20, 40], **{"device.mass": [0.1, 0.2]})`. Of a drawn loop these are also the keys of blocks that
    are written as a number, `"block.arm.mass"`. If a call does not name an axis, its value is that of the spec. If only the
    wall (K_VE, B_VE) changes, nothing is compiled again.
    """

    spec: Spec
    read: frozenset[str]

    def __repr__(self) -> str:
        """The controller, the order and the frame, and the numbers that the loop reads by their symbols."""
        symbols = {name: path for name, path in self.spec.names.symbols.items() if path in self.read}
        numbers = ", ".join(f"{name} = {self.spec.values[path]:g}" for name, path in symbols.items())
        drawing, values = own_loop(self.spec)
        drawn, drift = assembled(drawing, values), drift_of(drawing, values)
        what = f"{len(drawing.blocks)} blocks drawn" if self.spec.drawing else self.spec.kind
        frame = f"frame of {drawn.ticks} ticks, {1e3 * drawn.ticks * float(drawn.period):.6g} ms"
        return f"<Loop {self.spec.name}: {what}, {len(drift.kept)} states, {frame}; {numbers}>"

    def with_(self, **values) -> "Loop":
        """The loop with other numbers: `loop.with_(b=30, **{"device.mass": 0.2})`. Errors: as for a spec's own numbers."""
        return compile(self.spec.with_values({_key(self.spec, name).path: value for name, value in values.items()}))

    @property
    def _usual(self) -> str | None:
        """The axis of intervals if none is given."""
        return self.spec.along if self.spec.drawing else "K_VE"

    def stable_intervals(self, along: str | None = None, span=None, *, prove: bool = False, **axes):
        """All stable intervals along an axis, for the product of the other axes given: a DataFrame, a row per interval.

        along: name of the axis; by default K_VE or, of a drawn loop, the spec's own. span: (low, high) in its unit; by default
        (0, 20000) along K_VE, and the spec's own along an axis of its [sweep] if the loop is drawn. axes: the others, see
        `Loop`. Columns as in the table of `wavesweep zwidth`: each axis given, along, intervals, interval, low, high,
        low_omega, high_omega (rad/s), certified, residual, doubt, felt_low, felt_high. Errors: UsageError if a spec
        would not accept a name, SpecError if it would not accept a value or a combination.
        prove: compute columns in doubt again in ball arithmetic, if the loop is drawn.
        Accuracy: ends usually to 1e-12 relative, 1e-9 along other axes, see ACCURACY.md.
        """
        from wavesweep.sweep.interval_job import job_over
        from wavesweep.sweep.running import in_memory

        grid, axis = self._asked(along, span, axes)
        return self._frame("zwidth", in_memory(job_over(grid, axis, prove=prove)))

    def sensitivity(self, along: str | None = None, span=None, **axes):
        """How each end of the stable intervals, and the stiffness felt there, moves with each number: a DataFrame.

        along, span, axes: as for `stable_intervals`. A row per end that stability sets, crossing, quantity ("end" or "felt")
        and number, with the columns of `wavesweep why`: elasticity is d ln limit/d ln number, slope d limit/d number. By the
        implicit function theorem. Errors: UsageError if a spec would not accept a name or a value.
        Accuracy: elasticities to 1e-8 of themselves or of 1; if rounding could exceed that, a reason of doubt and no number.
        """
        from wavesweep.sweep.why_table import sensitivities

        grid, axis = self._asked(along, span, axes)
        return self._frame("why", sensitivities(grid, axis))

    def spectral_radius(self, **axes) -> np.ndarray:
        """Largest eigenvalue modulus per frame of `ratio` ticks, without drift, over the product of the axes given.

        axes: see `Loop`. The array has one dimension per axis that is a list, in the order given. If the radius is below 1,
        the loop is stable. It is infinite after overflow, and NaN if rounding could move it by a thousandth of itself or of 1.
        """
        from wavesweep.sweep.tasks import radius_over

        spec = naming(self.spec, axes)
        asked = _axes(spec, axes)
        shape = tuple(len(axis.values) for axis, values in zip(asked, axes.values(), strict=True) if np.ndim(values))
        return radius_over(spec, asked).reshape(shape)

    def response(self, frequency_hz=None, **axes):
        """Admittance, impedance, worst-case gain and verdict: a DataFrame with the columns of `wavesweep bode`.

        frequency_hz: Hz, those of the spec's [bode] table by default; 0 (the static limit) up to the fast Nyquist frequency.
        axes: see `Loop`. Accuracy: every row has bounds on its relative errors, or a reason of doubt.
        """
        from wavesweep.sweep.response_table import one_spec

        spec, frequency = naming(self.spec, axes), self._frequencies(frequency_hz)
        return self._frame("bode", one_spec(spec, _axes(spec, axes), frequency, self._read(spec)))

    def passivity(self, **axes):
        """Norm of the wave channel and margin at the hand's port: a DataFrame with the columns of `wavesweep passivity`.

        axes: see `Loop`. Accuracy: see ACCURACY.md.
        """
        from wavesweep.sweep.passivity_table import in_memory

        spec = naming(self.spec, axes)
        return self._frame("passivity", in_memory(spec, _axes(spec, axes)))

    def simulate(self, force=None, **options):
        """The loop run tick by tick: a DataFrame with the columns of `wavesweep simulate`, a row per fast tick.

        force: the hand's force (N) per tick, `(ticks,)`; by default the input of the spec's [simulate]. options: effects
        of the device in place of those of [simulate] (`wall=0.01, friction=0.2`). Errors: as for a spec.
        """
        from wavesweep.simulation import table
        from wavesweep.sweep.simulation_table import simulation_of

        return self._frame("simulate", table(simulation_of(self.spec, force, **options)))

    def plot_zwidth(self, along: str | None = None, span=None, **axes):
        """The figure of stable intervals, as `wavesweep zwidth` draws it: a matplotlib `Figure`, which a notebook shows.

        along, span, axes: as for `stable_intervals`. Intervals between the values given are computed for the figure.
        """
        along = self._usual if along is None else along
        columns = self.stable_intervals(along, span, **axes)
        axis = _along(naming(self.spec, [along]), along, span)
        swept = {"along": along, **{name: np.atleast_1d(values).tolist() for name, values in axes.items()}}
        return _figure("zwidth", columns, self.spec, swept | {along: {"start": axis.start, "stop": axis.stop}})

    def plot_bode(self, frequency_hz=None, **axes):
        """The figure of responses, as `wavesweep bode` draws it: a matplotlib `Figure`.

        frequency_hz, axes: as for `response`.
        """
        return _figure("bode", self.response(frequency_hz, **axes), self.spec)

    def plot_passivity(self, **axes):
        """The figure of channel norm and port margin, as `wavesweep passivity` draws it: a matplotlib `Figure`.

        axes: as for `passivity`.
        """
        return _figure("passivity", self.passivity(**axes), self.spec)

    def plot_simulate(self, force=None, **options):
        """The figure of a simulation, as `wavesweep simulate` draws it: a matplotlib `Figure`.

        force, options: as for `simulate`.
        """
        tables = self.spec.as_simulated().tables()
        off = [name for name, value in options.items() if value is None]
        keys = {name: value for name, value in (tables["simulate"] | options).items() if name not in off}
        used = load(tables | {"simulate": keys}).as_simulated()
        return _figure("simulate", self.simulate(force, **options), used)

    def plot_diagram(self):
        """The picture of the loop, as `wavesweep check --plot` draws it: a matplotlib `Figure`."""
        from wavesweep.plots import diagram

        return diagram(self.spec)

    def to_control(self, output: str = "position"):
        """The lifted closed loop as a `control.StateSpace`: the hand's forces (N) in the ticks of a frame in, as many outputs,
        dt of the frame.

        output: "position" (m), or "displacement" (m), the change of the position in each tick. Position is a state. If the loop
        drifts, it therefore has a pole at exactly 1, which is no sign of instability. Displacements do not show the drift, and
        the system from forces to them has no such pole. Errors: UsageError for any other output; SpecError
        for a loop without a hand.
        """
        import control

        from wavesweep.response.lifted import displacements, positions
        from wavesweep.sweep.drawn_loops import loop_at_hand

        if output not in ("position", "displacement"):
            raise UsageError(f'output: expected "position" or "displacement", found {output!r}')
        port, ratio = loop_at_hand(self.spec).port, self.spec.values.get("rates.ratio")
        ticks = ratio if isinstance(ratio, int) else port.kind.size
        E, B, C, D = (positions if output == "position" else displacements)(port, ticks)
        inputs, outputs = ([f"{name}[{i}]" for i in range(ticks)] for name in ("f_h", "x" if output == "position" else "dx"))
        return control.ss(np.eye(len(E)) + E, B, C, D, ticks / port.rate, inputs=inputs, outputs=outputs)

    def _frame(self, kind, columns):
        from wavesweep.library import frame

        along = str(columns["along"][0]) if len(columns.get("along", ())) else ""
        return frame(kind, columns, units=_units(self.spec, kind, tuple(columns), along))

    def _read(self, spec):
        return self.read if spec is self.spec else keys_of(spec)

    def _asked(self, along, span, axes):
        """The grid of the axes, and the axis of the intervals."""
        along = self._usual if along is None else along
        spec = naming(self.spec, [*axes, along])
        axis = _along(spec, along, span)
        return make_grid(spec, _axes(spec, axes, axis), axis.path, self._read(spec)), axis

    def _frequencies(self, frequency_hz):
        found = real_numbers(self.spec.frequency_hz if frequency_hz is None else frequency_hz)
        if found is None:
            raise UsageError(f"frequency_hz: expected a number or a list of numbers, found {frequency_hz!r:.60}")
        frequency = found.astype(float).ravel()
        if not frequency.size or not np.all((frequency >= 0) & np.isfinite(frequency)):
            wrong = frequency[~((frequency >= 0) & np.isfinite(frequency))]
            raise UsageError(f"frequency_hz: expected finite numbers >= 0, found {wrong[0] if wrong.size else 'none'}")
        return frequency


@lru_cache(maxsize=64)  # a compiled loop is asked for the same table again and again
def _units(spec, kind, names, along):
    """The units of the columns of a table of that kind. A controller's numbers have theirs from the schema."""
    from wavesweep.results import fields_of

    columns = dict.fromkeys(names, ()) | ({"along": (along,)} if along else {})
    return {each.name: each.unit for each in fields_of(kind, columns, {"spec": spec.tables() if spec.drawing else {}})}


def _key(spec, name):
    names = spec.names
    if not isinstance(name, str):
        raise UsageError(f"expected the name of a numeric key, found {name!r:.60}")
    key = names.find(name)
    if key is None or not key.numeric:
        hint = nearest(name, (*names.symbols, *(path for path, each in names.keys.items() if each.numeric)))
        raise UsageError(f"{name}: expected the name of a numeric key" + (f", did you mean {hint}?" if hint else ""))
    return key


def _along(spec, name, span) -> Axis:
    key = _key(spec, name)
    if span is None and spec.drawing:
        span = next(((axis.start, axis.stop) for axis in spec.sweep if axis.path == key.path and axis.start < axis.stop), None)
    if span is None:
        if key.path != SYMBOLS["K_VE"]:
            raise UsageError(f"along {name}: give the span to search, span=(low, high)")
        span = (0.0, 20000.0)
    ends = real_numbers(span)
    if ends is None or ends.shape != (2,):
        raise UsageError(f"span: expected (low, high), found {span!r:.60}")
    low, high = map(float, ends)
    if not -np.inf < low < high or high - low < NARROWEST_SPAN:
        raise UsageError(
            f"span: expected finite (low, high), low < high, at least {NARROWEST_SPAN:g} apart, found ({low!r}, {high!r})"
        )
    return Axis(name, key.path, (), low, high, key.structural, "linear")


def _axes(spec, axes: Mapping, along: Axis | None = None) -> tuple[Axis, ...]:
    found = tuple(_axis(spec, name, values) for name, values in axes.items())
    for number, axis in enumerate(found):
        if axis.path in [other.path for other in found[:number]]:
            raise UsageError(f"{axis.name}: expected each number once, found it under two names; leave one of them out")
        if along is not None and axis.path == along.path:
            raise UsageError(f"{axis.name}: expected other axes than {along.name}, which the intervals are along; give a span")
    _refuse_values(spec, (along, *found) if along else found)
    return found


def _refuse_values(spec, axes):
    """Raise SpecError for values that a spec would refuse; every combination is computed."""
    together, limited = [], {} if spec.drawing else LIMITS
    linked = {*limited, *(path for limits in limited.values() for path in limits)}
    for axis in axes:
        # NaN is neither the least nor the largest, and is refused on its own.
        ends = tuple(dict.fromkeys((axis.start, axis.stop, *filter(isnan, axis.values))))
        if axis.path in linked:
            together.append((axis.path, ends))
            continue
        for end in ends:
            _accept(spec, (axis.path,), end)
    for values in product(*(ends for _, ends in together)):
        _accept(spec, tuple(path for path, _ in together), *values)


def _axis(spec, name, values) -> Axis:
    key = _key(spec, name)
    numbers = real_numbers(values)
    if numbers is None or numbers.ndim > 1:
        raise UsageError(f"{name}: expected a number or a list of numbers, found {values!r:.60}")
    if not numbers.size:
        raise UsageError(f"{name}: expected at least one value, found none")
    numbers = np.atleast_1d(numbers)
    plain = tuple(numbers.tolist() if numbers.dtype.kind != "f" else numbers.astype(float).tolist())
    plain = plain if key.type == "integer" else tuple(map(float, plain))
    return Axis(name, key.path, plain, min(plain), max(plain), key.structural)


@lru_cache(maxsize=256, typed=True)  # a compiled loop is asked about the same ranges again and again
def _accept(spec, paths, *values):
    """Raise SpecError for values that a spec would refuse, one for each path."""
    spec.with_values(dict(zip(paths, values, strict=True)))


def _figure(kind, table, spec, swept=None):
    """The figure of a DataFrame. swept: the axes of the call in place of those of the spec."""
    from wavesweep.plots import figure_of
    from wavesweep.sweep.assumptions import assumes

    tables = spec.tables() | ({"sweep": swept} if swept else {})
    varied = [key.path for name in (*table, *(swept or ())) if (key := spec.names.find(name)) is not None]
    facts = {"spec": tables, "spec_name": spec.name, "assumes": assumes(spec, varied)}
    return figure_of(kind)({name: table[name].to_numpy() for name in table}, facts)
