"""The library: a compiled loop with vectorised methods, and the commands as calls; both return DataFrames and arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, Unpack

import numpy as np

from wavesweep.capabilities import library_names, of_library
from wavesweep.engine.blocks import OUTPUT
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.analyses.asked import (
    Numbers,
    axes_asked,
    axis_along,
    frequencies_asked,
    key_named,
)
from wavesweep.program.analyses.claim_words import fact_of
from wavesweep.program.analyses.claims import Claim, own_figures
from wavesweep.program.analyses.spec_loops import refuse_singular
from wavesweep.program.columns import Columns, age_column, joined
from wavesweep.program.number_words import in_time
from wavesweep.program.plots.style import drawn_into
from wavesweep.program.spec import Axis, Spec, load
from wavesweep.program.spec.loading import naming
from wavesweep.program.spec.studies import value_of
from wavesweep.program.sweep.grid import Grid, keys_of, make_grid, own_loop
from wavesweep.program.sweep.running import WorkOptions
from wavesweep.program.tables import interval_table as intervals
from wavesweep.program.tables import kind_named
from wavesweep.program.tables import response_table as responses
from wavesweep.program.tables.columns import fields_of
from wavesweep.program.tables.frame import frame, framed

if TYPE_CHECKING:
    from control import StateSpace
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

Source = Spec | str | Path | Mapping[str, Any]
Span = tuple[float, float]
MOST_ANSWERS = 16  # that are kept
# The latest answers of `stable_intervals`: a figure, and the display of a notebook, ask again.
_ANSWERS: dict[
    tuple[Spec, Axis, object, object], tuple[Columns, dict[str, str], dict[str, Any]]
] = {}


def compile(source: Source) -> Loop:
    """Compile a loop once, for any number of calls.

    Parameters
    ----------
    source : Spec, str, Path or dict
        A spec, its path, or its nested tables, in which a block may also be a system of
        python-control or scipy.signal, or a `StateSpaceBlock` of `wavesweep.engine`.

    Returns
    -------
    Loop

    Raises
    ------
    UsageError
        If a file cannot be read.
    SpecError
        With all mistakes of the spec, or if its loops of direct terms have no solution.

    Examples
    --------
    >>> import wavesweep
    >>> wavesweep.compile({"controller": {"kind": "dc-slow"}})
    <Loop spec: dc-slow, 3 states, frame of 20 ticks, 20 ms; K_VE = 500, B_VE = 1>
    """
    spec = spec_of(source)
    refuse_singular(spec, own_loop(spec).drawing)
    return Loop(spec, keys_of(spec))


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """A compiled loop.

    The methods take `axes` by name, each a number or a list, and compute the product of the lists.
    An axis is named by its symbol (`K_VE`, `b`, ...) or, for any other number, by its path in a
    mapping: `loop.spectral_radius(b=[20, 40], **{"device.mass": [0.1, 0.2]})`. Of a drawn loop
    these are also the keys of blocks that are written as a number, `"block.arm.mass"`. If a call
    does not name an axis, its value is that of the spec. If only the wall (K_VE, B_VE) changes,
    nothing is compiled again. Capabilities have more methods, see `wavesweep.capabilities`.
    """

    spec: Spec
    read: frozenset[str]

    if not TYPE_CHECKING:  # which reads the methods of capabilities in wavesweep/__init__.pyi

        def __getattr__(self, name):
            return of_library(f"Loop.{name}", dir(Loop)).__get__(self)

        def __dir__(self):
            return [*object.__dir__(self), *library_names("Loop")]

    def __repr__(self) -> str:
        """The controller, the order and the frame, and the numbers that the loop reads by their symbols."""
        symbols = {
            name: path for name, path in self.spec.names.symbols.items() if path in self.read
        }
        numbers = ", ".join(
            f"{name} = {self.spec.values[path]:g}" for name, path in symbols.items()
        )
        loop = own_loop(self.spec)
        drawn, drift = loop.drawn(), loop.drift_of_frames()
        if self.spec.drawing:
            of_what = f"{len(loop.drawing.blocks)} blocks drawn"
        else:
            of_what = self.spec.kind
        frame = f"frame of {drawn.ticks} tick{'s' * (drawn.ticks > 1)}, {in_time(drawn.ticks * float(np.asarray(drawn.period)))}"
        return (
            f"<Loop {self.spec.name}: {of_what}, {len(drift.remaining)} states, {frame}; {numbers}>"
        )

    def _repr_html_(self) -> str | None:
        """For notebooks: the question, its stable intervals and their figure. None, for the text alone, without an axis."""
        from html import escape
        from io import StringIO

        try:
            axis = axis_along(self.spec, self._usual, None)
        except UsageError:  # a drawn loop whose [sweep] has no range to look along
            return None
        picture = StringIO()
        self.plot_zwidth().savefig(picture, format="svg")
        question = f"For which {axis.name} from {axis.start:g} to {axis.stop:g} is this loop stable? {self!r}"
        svg = picture.getvalue().partition("<svg")
        rows = self.stable_intervals()
        empty = [name for name in rows if rows[name].isin([""]).all() or rows[name].isna().all()]
        table = rows.drop(columns=empty).to_html(index=False)
        return f"<p>{escape(question)}</p>{table}<p>{svg[1]}{svg[2]}</p>"

    def with_(self, **values: float | str) -> Self:
        """The loop with other numbers.

        Parameters
        ----------
        **values : float or str
            By name, see `Loop`: `loop.with_(b=30, **{"device.mass": 0.2})`.

        Returns
        -------
        Loop
            Another one, of the spec with these numbers.

        Raises
        ------
        UsageError, SpecError
            As for a spec's own numbers.
        """
        spec = self.spec.with_values(
            {key_named(self.spec, name).path: value for name, value in values.items()}
        )
        refuse_singular(spec, own_loop(spec).drawing)
        return type(self)(spec, keys_of(spec))

    @property
    def _usual(self) -> str:
        """The axis of intervals if none is given."""
        if self.spec.drawing:
            return self.spec.along
        return "K_VE"

    def stable_intervals(
        self,
        along: str | None = None,
        span: Span | None = None,
        *,
        require: Mapping[str, float] | None = None,
        progress: bool = False,
        **axes: Numbers,
    ) -> DataFrame:
        """All stable intervals along an axis, for the product of the other axes given.

        Parameters
        ----------
        along : str, optional
            Name of the axis; by default K_VE or, of a drawn loop, the spec's own.
        span : tuple of float, optional
            (low, high) in the unit of the axis; by default (0, 20000) along K_VE, and the spec's
            own along an axis of its [sweep] if the loop is drawn.
        require : dict, optional
            Bounds on every mode, as [sweep] require of a spec has them: `{"radius": 0.99}` (per
            T_s, or tick of a drawn loop), `{"settling": 0.1}` (s, to 2 %), `{"damping_ratio":
            0.3}`. By default stability alone.
        progress : bool, default False
            Whether to show a bar, that of tqdm, which has to be installed.
        **axes : float or array of shape (n,)
            The other axes, see `Loop`.

        Returns
        -------
        DataFrame
            A row per interval, with the columns of `wavesweep zwidth`: each axis given, along, intervals,
            interval, low, high, open_low, open_high (in the unit of the axis), low_omega, high_omega (rad/s),
            certified, residual (relative), doubt, felt_low, felt_high (N/m), low_hz, high_hz (Hz), open_places.
            Of a spec with [for_all] the rows that hold for all of it follow (column `guarantee`). What rows say
            of which loops is in `.attrs["claims"]`, as of other DataFrames.

        Raises
        ------
        UsageError, SpecError
            If a spec would not accept a name; a value or a combination.

        Notes
        -----
        Accuracy: ends usually to 1e-12 relative along K_VE and B_VE, 1e-9 along others, see docs/accuracy.md.

        Examples
        --------
        >>> import wavesweep
        >>> loop = wavesweep.compile({"controller": {"kind": "dc-slow"}})
        >>> loop.stable_intervals("K_VE", (0, 1000), B_VE=[0.5, 1.0])[["B_VE", "low", "high", "certified"]].round(3)
           B_VE  low     high  certified
        0   0.5  0.0  210.510       True
        1   1.0  0.0  263.137       True
        """
        from wavesweep.program.analyses.interval_jobs import job_over

        grid, axis = self._asked(along, span, axes)
        required = None if require is None else value_of("sweep.require", require)
        asked_axes = tuple((name, tuple(np.ravel(values))) for name, values in axes.items())
        question = (self.spec, axis, repr(required and required.written()), asked_axes)
        answer = _ANSWERS.get(question)
        if answer is None:
            job = job_over(grid, axis, require=required)
            answer = self._table("zwidth", *intervals.of_calls(job, progress))
            if len(answer[0]["low"]) <= 10_000:  # rows, some 2 MB
                _ANSWERS[question] = answer
        if len(_ANSWERS) > MOST_ANSWERS:
            del _ANSWERS[next(iter(_ANSWERS))]
        return frame(*answer)

    def spectral_radius(self, **axes: Numbers) -> np.ndarray:
        """Largest eigenvalue modulus per frame, without drift, over the product of the axes given.

        Parameters
        ----------
        **axes : float or array of shape (n,)
            See `Loop`.

        Returns
        -------
        ndarray
            One dimension per axis that is a list, in the order given. If the radius is below 1, the
            loop is stable. It is infinite after overflow, and NaN if rounding could move it by a
            thousandth of itself or of 1.

        Notes
        -----
        A frame ends when all rates are in step again: T_s, or 50 ms for 60 Hz under 1 kHz. It is
        T_s also of `dc`, in which nothing runs at the slow rate. What is required of modes is per
        T_s, or per tick of a drawn loop: see `stable_intervals`.
        """
        from wavesweep.program.analyses.spec_loops import radius_over

        spec = naming(self.spec, axes)
        asked_axes = axes_asked(spec, axes)
        shape = tuple(
            len(axis.values)
            for axis, values in zip(asked_axes, axes.values(), strict=True)
            if np.ndim(values)
        )
        return radius_over(spec, asked_axes).reshape(shape)

    def response(
        self,
        frequency_hz: Numbers | None = None,
        *,
        from_: str | None = None,
        to: str | None = None,
        **axes: Numbers,
    ) -> DataFrame:
        """Admittance, impedance, worst-case gain and verdict over frequency.

        Parameters
        ----------
        frequency_hz : float or array of shape (n,), optional
            In Hz, from 0 (the static limit) up to the fast Nyquist frequency; by default those of
            the spec's [bode] table.
        from_, to : str, optional
            An input and an output of a drawn loop, between which the response is wanted; all of
            those if one is None. In place of an output any signal of the loop, "block.port", does.
            If both are None, it is the response that the spec's [bode] asks for: of a loop without
            a hand those between all of them.
        **axes : float or array of shape (n,)
            See `Loop`.

        Returns
        -------
        DataFrame
            A row per frequency, with the columns of `wavesweep bode`: controller, frequency_hz
            (Hz), omega_Ts (rad per sample of the slow rate), admittance_re, admittance_im,
            admittance_abs (m/N), admittance_deg (deg), impedance_re, impedance_im, impedance_abs
            (N/m), impedance_deg (deg), worst_gain (m/N), stable, admittance_error, impedance_error,
            worst_gain_error (relative), doubt. Between inputs and outputs it has those of the table
            bode-ports.

        Raises
        ------
        UsageError
            For unknown names.
        SpecError
            For a drawn loop without a hand that has no such ports.

        Notes
        -----
        Accuracy: every row has bounds on its relative errors, or a reason of doubt.

        Examples
        --------
        >>> import wavesweep
        >>> loop = wavesweep.compile({"controller": {"kind": "pmw", "Kp": 20}})
        >>> loop.response([0, 1, 10])[["frequency_hz", "admittance_abs", "impedance_abs", "stable"]].round(4)
           frequency_hz  admittance_abs  impedance_abs  stable
        0           0.0          0.0020       500.0000    True
        1           1.0          0.0024       417.0963    True
        2          10.0          0.0008       931.5156    True
        """
        from wavesweep.program.analyses.response_jobs import one_spec

        spec, frequency = naming(self.spec, axes, to), frequencies_asked(self.spec, frequency_hz)
        if from_ is None and to is None:
            routes = responses.routes_of(spec)
        else:
            routes = spec.routes_between(from_, to)
        asked_axes = axes_asked(spec, axes)
        rows = joined(
            [one_spec(spec, asked_axes, frequency, self._read(spec), route) for route in routes]
        )
        claims = own_figures([spec], "responses")
        return self._frame("bode-ports" if routes[0] else "bode", rows, claims)

    def plot_zwidth(
        self,
        along: str | None = None,
        span: Span | None = None,
        *,
        ax: Axes | None = None,
        legend: bool = True,
        caption: bool = True,
        **axes: Numbers,
    ) -> Figure:
        """The figure of stable intervals, as `wavesweep zwidth` draws it.

        Parameters
        ----------
        along, span, **axes
            As for `stable_intervals`. Intervals between the values given are computed for the
            figure.
        ax : Axes, optional
            Axes of a figure with a constrained layout, in whose place it is drawn; so for all
            figures of a loop.
        legend, caption : bool, default True
            Whether there is a legend, and notes below; a warning stays. A figure of one column
            (89 mm) has more room for its panels without.

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it.
        """
        along = self._usual if along is None else along
        columns = self.stable_intervals(along, span, require=None, progress=False, **axes)
        axis = axis_along(naming(self.spec, [along]), along, span)
        swept = {
            "along": along,
            **{name: np.atleast_1d(values).tolist() for name, values in axes.items()},
        }
        swept[along] = {"start": axis.start, "stop": axis.stop}
        draw = figure_of_table("zwidth", columns, self.spec, swept)
        return drawn_into(ax, draw, legend=legend, caption=caption)

    def plot_bode(
        self,
        frequency_hz: Numbers | None = None,
        *,
        from_: str | None = None,
        to: str | None = None,
        ax: Axes | None = None,
        legend: bool = True,
        caption: bool = True,
        **axes: Numbers,
    ) -> Figure:
        """The figure of responses, as `wavesweep bode` draws it.

        Parameters
        ----------
        frequency_hz, from_, to, **axes
            As for `response`.
        ax, legend, caption
            As for `plot_zwidth`.

        Returns
        -------
        matplotlib.figure.Figure
        """
        rows = self.response(frequency_hz, from_=from_, to=to, **axes)
        kind = "bode-ports" if "from_input" in rows else "bode"
        draw = figure_of_table(kind, rows, self.spec)
        return drawn_into(ax, draw, legend=legend, caption=caption)

    def to_control(
        self, output: Literal["position", "displacement", "outputs"] | None = None
    ) -> StateSpace:
        """The closed loop over a frame as a system of python-control.

        Parameters
        ----------
        output : {"position", "displacement", "outputs"}, optional
            "position" (m): the hand's forces (N) in the ticks of a frame in, as many positions out;
            "displacement" (m): the changes of the position in each tick; "outputs": the inputs of
            [ports] in, each held over the whole frame, and the outputs of [ports] as the first tick
            of the frame shows them, when its blocks have run. By default "position", or "outputs"
            of a loop without a hand.

        Returns
        -------
        control.StateSpace
            With dt of the frame (s).

        Raises
        ------
        UsageError
            For any other output.
        SpecError
            For a loop without a hand, or without outputs.

        Notes
        -----
        A step response of "outputs" is that of the loop at the frame's starts; for other ticks, and
        inputs that change within a frame, see `simulate` and `response`.

        Position is a state. If the loop drifts, it therefore has a pole at exactly 1, which is no
        sign of instability. Displacements do not show the drift, and the system from forces to them
        has no such pole; outputs that show it do.
        """
        import control

        from wavesweep.engine.response import over_frame
        from wavesweep.program.analyses.spec_loops import loop_at_hand

        drawing = self.spec.drawing
        if output is None:
            output = "outputs" if drawing and not drawing.hand else "position"
        if output not in ("position", "displacement", "outputs"):
            raise UsageError(
                f'output: expected "position", "displacement" or "outputs", found {output!r}'
            )
        if output == "outputs":
            return self._outputs_to_control()
        port = loop_at_hand(self.spec).port
        ratio = self.spec.values.get("rates.ratio")
        ticks = ratio if isinstance(ratio, int) else port.kind.size
        E, B, C, D = over_frame(port, ticks, positions=output == "position")
        shown = "x" if output == "position" else "dx"
        inputs = [f"f_h[{i}]" for i in range(ticks)]
        outputs = [f"{shown}[{i}]" for i in range(ticks)]
        return control.ss(
            np.eye(len(E)) + E, B, C, D, ticks / port.rate, inputs=inputs, outputs=outputs
        )

    def _outputs_to_control(self) -> StateSpace:
        """The system from the inputs to the outputs of [ports]."""
        import control

        from wavesweep.engine.response import held_over_frame

        drawing = self.spec.drawing
        if not (drawing and drawing.inputs and drawing.outputs):
            expected = "inputs and outputs of a drawn loop, or a hand"
            raise SpecError([self.spec.mistake("ports", expected, "none of these, or not both")])
        drawn, names = own_loop(self.spec).drawn(), [name for name, _, _ in drawing.inputs]
        shown = {OUTPUT + name: name for name, _, _ in drawing.outputs}
        matrices = held_over_frame(drawn, [signal for _, signal, _ in drawing.inputs], tuple(shown))
        period = float(np.asarray(drawn.period)) * drawn.ticks
        return control.ss(*matrices, period, inputs=names, outputs=list(shown.values()))

    def _frame(self, kind: str, columns: Columns, claims: Mapping[str, Claim]) -> DataFrame:
        return frame(*self._table(kind, columns, claims))

    def _table(
        self, kind: str, columns: Columns, claims: Mapping[str, Claim]
    ) -> tuple[Columns, dict[str, str], dict[str, Any]]:
        """What a DataFrame is made of, see `frame`."""
        columns = kind_named(kind).ordered(columns)
        along = str(columns["along"][0]) if len(columns.get("along", ())) else ""
        units = _units(self.spec, kind, tuple(columns), along)
        return columns, units, {word: fact_of(claim) for word, claim in claims.items()}

    def _read(self, spec: Spec) -> frozenset[str]:
        if spec is self.spec:
            return self.read
        return keys_of(spec)

    def _asked(
        self, along: str | None, span: Span | None, axes: Mapping[str, Numbers]
    ) -> tuple[Grid, Axis]:
        """The grid of the axes, and the axis of the intervals."""
        along = self._usual if along is None else along
        spec = naming(self.spec, [*axes, along])
        axis = axis_along(spec, along, span)
        return make_grid(spec, axes_asked(spec, axes, axis), axis.path, self._read(spec)), axis


@lru_cache(maxsize=64)  # a compiled loop is asked for the same table again and again
def _units(spec: Spec, kind: str, names: tuple[str, ...], along: str) -> dict[str, str]:
    """The units of the columns of a table of that kind. A controller's numbers have theirs from the schema."""
    columns: dict[str, tuple[str, ...]] = dict.fromkeys(names, ()) | (
        {"along": (along,)} if along else {}
    )
    aged = age_column("")
    channels = [name.removeprefix(aged) for name in names if name.startswith(aged)]
    facts = {"spec": spec.tables() if spec.drawing else {}, "channels": channels}
    return {field.name: field.unit for field in fields_of(kind, columns, facts)}


def figure_of_table(
    kind: str,
    table: DataFrame,
    spec: Spec,
    swept: Mapping[str, Any] | None = None,
) -> Callable[[], Figure]:
    """What draws the figure of a DataFrame. swept: the axes of the call in place of those of the spec."""
    from wavesweep.program.analyses.assumptions import model_in_words
    from wavesweep.program.plots import figure_of
    from wavesweep.program.plots.figure_marks import facts_of_marks

    tables = spec.tables() | ({"sweep": swept} if swept else {})
    varied = [
        key.path for name in (*table, *(swept or ())) if (key := spec.names.find(name)) is not None
    ]
    facts = {
        "spec": tables,
        "spec_name": spec.name,
        "assumes": model_in_words(spec, varied),
        "claims": table.attrs["claims"],
        **facts_of_marks([spec], kind),
    }
    columns = {str(name): table[name].to_numpy() for name in table}
    return lambda: figure_of(kind)(columns, facts)


def zwidth(
    source: Source,
    along: str | None = "K_VE",
    for_hands: str | Iterable[str] = (),
    **work: Unpack[WorkOptions],
) -> DataFrame:
    """Stable intervals over the spec's own [sweep], as `wavesweep zwidth` computes them.

    Parameters
    ----------
    source : Spec, str, Path or dict
        A spec, its path, or its nested tables.
    along : str or None, default "K_VE"
        The axis of the intervals; None for the spec's own.
    for_hands : str or iterable of str, optional
        A word or several, whose intervals are added: "passive", "box",
        "box:mass=0.1..0.4,damping=2..5" (kg, N*s/m; stiffness in N/m), "port", see `wavesweep
        zwidth --help`.
    **work
        How the run is done, see Other Parameters.

    Returns
    -------
    DataFrame
        The axes of [sweep] and the columns of `Loop.stable_intervals`; with `for_hands` also those
        of guarantees for hands. Its `.attrs` has the `units` of the columns, the `facts` of the
        run, and the `summary`.

    Other Parameters
    ----------------
    jobs : int, optional
        Number of worker processes if the work is worth them.
    backend : {"loky", "threading", "dask"}, optional
        Kind of the workers, which is then used in any case.
    scheduler : str, optional
        Address of a dask scheduler.
    progress : bool or callable, optional
        True shows a bar, that of tqdm, which has to be installed. A callable
        is called with the number of slices done, of all slices, and of certified ones, None if no
        slice can be.
    checkpoint : str or Path, optional
        File for finished chunks, from which a run of the same spec goes on; by default they stay in
        memory.
    force : bool, default False
        Begin anew, whatever the checkpoint holds.
    part : str, optional
        Name of this run in the checkpoint, if several runs keep their chunks in one.

    Raises
    ------
    UsageError, SpecError, WavesweepError
        For arguments, for the spec, and if a run fails.

    Examples
    --------
    >>> import wavesweep
    >>> spec = {"controller": {"kind": "dc-slow"}, "sweep": {"K_VE": {"start": 0, "stop": 1000}, "B_VE": [0, 1, 2]}}
    >>> wavesweep.zwidth(spec)[["B_VE", "low", "high", "certified"]].round(1)
       B_VE  low   high  certified
    0   0.0  0.0  157.9       True
    1   1.0  0.0  263.1       True
    2   2.0  0.0  368.4       True
    """
    from wavesweep.program.tables.hand_rows import hands_of

    return framed(intervals.intervals(spec_of(source), along, hands_of(for_hands), **work))


def stability_region(
    source: Source,
    along: str | None = None,
    for_hands: str | Iterable[str] = (),
    **work: Unpack[WorkOptions],
) -> DataFrame:
    """Stable intervals along the spec's own axis, as `wavesweep stability-region` computes them.

    Parameters
    ----------
    source, for_hands, **work
        As for `zwidth`.
    along : str, optional
        Another axis than the spec's own.

    Returns
    -------
    DataFrame
        As of `zwidth`.
    """
    return zwidth(source, along, for_hands, **work)


def bode(*sources: Source, **work: Unpack[WorkOptions]) -> DataFrame:
    """Admittance (m/N), impedance (N/m) and worst-case gain over the [bode] axes, as `wavesweep bode` computes them.

    Parameters
    ----------
    *sources : Spec, str, Path or dict
        Specs, their paths, or their nested tables; of several that are called alike, the second and
        further ones have a number in the column `spec`.
    **work
        As for `zwidth`.

    Returns
    -------
    DataFrame
        The axes of [bode], the column `spec` and those of `Loop.response`; of drawn loops that ask
        for them the responses between inputs and outputs, with the columns of the table bode-ports.
    """
    return framed(responses.responses(_numbered([spec_of(source) for source in sources]), **work))


def _numbered(specs: list[Spec]) -> list[Spec]:
    """The specs under different names, which label their rows."""
    names: list[str] = []
    for spec in specs:
        tries = (f"{spec.name} {number}" if number > 1 else spec.name for number in count(1))
        names.append(next(name for name in tries if name not in names))
    return [replace(spec, name=name) for spec, name in zip(specs, names, strict=True)]


def spec_of(source: Source) -> Spec:
    """The spec, loaded if `source` is a path or nested tables."""
    if isinstance(source, Spec):
        return source
    return load(source)
