"""A closed loop of several rates and what it answers: stable intervals, poles, responses, gains, the lifted state space."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._drawing.expressions import Terms
from wavesweep.engine._energy.lifted_map import TickMaps, damping_peak
from wavesweep.engine._energy.norms import squared_norm
from wavesweep.engine._keys.checking import Rejected, check, computable, nearest
from wavesweep.engine._keys.key import Key, Names
from wavesweep.engine._loops.from_drawing import OUTPUT
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine._response.at_hand import ports_of_batch
from wavesweep.engine._response.lifted import Lifted
from wavesweep.engine._response.port import Port
from wavesweep.engine._response.steady import transfer
from wavesweep.engine._search.interval_search import Search, Searches
from wavesweep.engine._search.question import Prover
from wavesweep.engine._stability.modes import certain_modes, named_modes
from wavesweep.engine._stability.spectrum import count_outside, damping_ratio, is_stable
from wavesweep.engine.arguments import real_numbers
from wavesweep.engine.doubts import words
from wavesweep.engine.errors import UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct

if TYPE_CHECKING:
    from control import StateSpace
    from numpy.typing import ArrayLike, NDArray

    Numbers = Mapping[str, ArrayLike] | None
    Floats = NDArray[np.float64]
    Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class StableIntervals:
    """Stable intervals along a number, one row each; a loop that is stable nowhere has one row without ends.

    All fields are arrays `(rows,)`, sorted by loop, then by value.

    loop: index of the loop among those asked for, flat. low, high: ends, in the unit of the number,
    NaN without an interval. low_omega, high_omega: angular frequency (rad/s) of the oscillation
    that starts at the end, as it is seen once a frame; NaN where the range ends the interval.
    low_hz, high_hz: the strongest line (Hz) of that oscillation between the ticks. certified:
    whether all intervals of the loop are proved, and that there are no others. doubt: why not, a
    word of `wavesweep.engine.doubts`; empty if certified. residual: of the characteristic equation
    at the ends, relative. open_low, open_high: from where to where the number lies at which nothing
    is known; NaN if everything is.
    """

    loop: NDArray[np.int32]
    low: Floats
    high: Floats
    low_omega: Floats
    high_omega: Floats
    low_hz: Floats
    high_hz: Floats
    certified: Bools
    doubt: NDArray[np.object_]
    residual: Floats
    open_low: Floats
    open_high: Floats

    @staticmethod
    def of(records: np.ndarray) -> StableIntervals:
        """Those of a search."""
        loop = records["slice"].copy()
        columns = {
            column.name: np.ascontiguousarray(records[column.name])
            for column in fields(StableIntervals)
            if column.name not in ("loop", "doubt")
        }
        return StableIntervals(loop=loop, doubt=words(records["doubt"]), **columns)


@dataclass(frozen=True, slots=True, eq=False)
class ClosedLoopPoles:
    """The poles of one loop per frame, the slowest first, without those that drift; arrays `(poles,)`.

    z: eigenvalues of the frame. s: `log(z)/frame_s` (1/s); -inf for a pole at 0. damping_ratio: -Re
    s/|s|; NaN for poles at 0 and 1. certain: whether rounding cannot take the pole across the unit
    circle. shares: participation of each state in each pole, `(poles, states)`, from 0 to 1.
    states: a name for each.
    """

    z: NDArray[np.complex128]
    s: NDArray[np.complex128]
    damping_ratio: Floats
    certain: Bools
    shares: Floats
    states: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class InputResponse:
    """The response of an output to an input at some frequencies.

    frequency_hz: `(points,)`. value: complex, `(..., points)`, in the output's unit per the
    input's; NaN if it is not known. error: bound on its relative error, likewise. stable: whether
    the loop is stable, `(...)`; the response of one that is not is that of its equations, and no
    experiment shows it.
    """

    frequency_hz: Floats
    value: NDArray[np.complex128]
    error: Floats
    stable: Bools


@dataclass(frozen=True, slots=True, eq=False)
class ExtremeGain:
    """The extreme of a gain over all frequencies, `(...)`: its value, where it is taken (Hz), and whether that is proved.

    Not certified and finite: the largest or smallest of the values that were looked at.
    """

    value: Floats
    frequency_hz: Floats
    certified: Bools


@dataclass(frozen=True, slots=True, eq=False)
class LiftedStateSpace:
    """One loop from frame to frame: `x[k+1] = A x[k] + B u[k]`, `y[k] = C x[k] + D u[k]`.

    u and y have the inputs and outputs of all ticks of a frame one after the other, `r[0], r[1],
    ...`. frame_s: period of the frame (s). states: a name for each.
    """

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    frame_s: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[str, ...]

    def __repr__(self) -> str:
        """Its sizes and the frame."""
        sizes = f"{len(self.A)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<LiftedStateSpace: {sizes}, frame of {1e3 * self.frame_s:.6g} ms>"

    def to_control(self) -> StateSpace:
        """The same as a system of python-control, with dt of the frame (s)."""
        import control

        names = {
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "states": list(self.states),
        }
        return control.ss(self.A, self.B, self.C, self.D, self.frame_s, **names)


@dataclass(frozen=True, slots=True, eq=False)
class ClosedLoop:
    """A closed loop of blocks that run at several rates, made by `loop_from_blocks` or `loop_from_drawing`.

    Methods take other values of its numbers as a dict by name, each a number or an array; arrays
    broadcast together, and what is returned has their shape. `loop.spectral_radius({"kp": [1.0,
    2.0], "tau": 0.01})` is two loops. A number that is not named keeps the value that it was made
    with. The rate of the tick has the name `rates.tick_hz`.

    drawing: the structure. values: path -> value of each number. state_names: names of states in
    place of those that the blocks give them, such as "plant angle" for "plant x0".
    """

    drawing: Drawing
    values: Mapping[str, float]
    state_names: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        """The blocks, the frame and the numbers."""
        blocks = ", ".join(block.name for block in self.drawing.blocks)
        numbers = ", ".join(f"{name} = {value:g}" for name, value in self.numbers.items())
        return f"<ClosedLoop: {blocks}; frame of {1e3 * self.frame_s:.6g} ms; {numbers or 'no numbers'}>"

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers by name, with the values that they have unless a call gives others."""
        return {name: self.values[path] for name, path in self._names.symbols.items()}

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs from outside."""
        return tuple(name for name, *_ in self.drawing.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(name for name, *_ in self.drawing.outputs)

    @property
    def assumptions(self) -> tuple[str, ...]:
        """A sentence for each wire of which a part acts continuously, as springs do, and is not held over the ticks."""
        return tuple(
            f"{port}: {_sum(terms)} acts continuously, other terms are held over each tick"
            for port, terms in self.drawing.couplings
        )

    @property
    def frame_s(self) -> float:
        """Period (s) after which all blocks are in step again."""
        drawn = self._single({}).drawn()
        return float(np.asarray(drawn.period)) * drawn.ticks

    def at(self, numbers: Mapping[str, float]) -> ClosedLoop:
        """The loop with other numbers, which it keeps.

        Parameters
        ----------
        numbers : dict
            Name -> number.

        Returns
        -------
        ClosedLoop
            Another one, of the same drawing.

        Raises
        ------
        UsageError
            For a name that the loop does not have, a value that makes no loop, or an array.
        """
        values = self._single(numbers).values
        changed = {path: values[path] for path in map(self._path, numbers)}
        return replace(self, values={**self.values, **changed})

    def stable_intervals(
        self,
        along: str,
        span: tuple[float, float],
        numbers: Numbers = None,
        *,
        prover: Prover | None = None,
    ) -> StableIntervals:
        """All stable intervals along one of the numbers, with a certificate.

        A number that multiplies one signal is cut out of the frame: `det(z - F(p)) = 0` is one real
        polynomial in the cosine of the angle, whose roots are all crossings of the unit circle.
        Along any other number the eigenvalues are followed as polynomials on panels, and a dominant
        diagonal proves that none is missed. See docs/proof.md.

        Parameters
        ----------
        along : str
            Name of the number; not one that decides how the loop is built, such as a number of ticks.
        span : tuple of float
            (low, high) of the range that is searched, in the unit of the number.
        numbers : dict, optional
            Other values of other numbers: name -> number or array.
        prover : callable, optional
            Is asked about stretches that doubles leave in doubt; see
            `wavesweep.engine._search.question.Prover`.

        Returns
        -------
        StableIntervals
            For each loop.

        Raises
        ------
        UsageError
            For a name or a value that the loop does not have, or a range with a value without a loop.
        IllPosedLoopError
            If a loop of direct terms has no solution.

        Notes
        -----
        Accuracy: ends usually to 1e-12 relative along a number that multiplies one signal, 1e-9
        along others. If `certified` is false, `doubt` says why, and what is between `open_low` and
        `open_high` may be stable or not.
        """
        key = self._key(along)
        ends = real_numbers(span)
        if key.structural:
            expected = "a number that does not decide how the loop is built"
            raise UsageError(
                f"along {along}: expected {expected}; ask for the spectral radius at its values"
            )
        if ends is None or ends.shape != (2,) or not computable(ends).all() or ends[0] >= ends[1]:
            raise UsageError(f"span: expected (low, high), low < high, found {span!r:.60}")
        if key.path in map(self._path, numbers or {}):
            raise UsageError(
                f"{along}: expected other numbers than the one that the intervals are along"
            )
        low, high = map(float, ends)
        _, arrays = self._arrays(numbers)
        # One search for all loops of a drawing, which share what depends on the drawing alone.
        by_drawing: dict[Drawing, list[tuple[NDArray[np.intp], Loops]]] = {}
        for members, loops in self._batches(arrays, along=True):
            by_drawing.setdefault(loops.drawing, []).append((members, loops.read))
        searches = []
        for groups in by_drawing.values():
            searches.append(Search(key.path, (low, high), tuple(groups), prover=prover))
        return StableIntervals.of(Searches(tuple(searches)).records())

    def spectral_radius(self, numbers: Numbers = None) -> Floats:
        """The largest modulus of the eigenvalues of a frame, without what nothing opposes (drift): below 1, it is stable.

        Parameters
        ----------
        numbers : dict, optional
            Other values of numbers: name -> number or array.

        Returns
        -------
        ndarray
            In the shape of the arrays; infinite after overflow, NaN if rounding could move it by a
            thousandth of itself or of 1.

        Raises
        ------
        UsageError, IllPosedLoopError
            As for `stable_intervals`.
        """

        def of_batch(loops: Loops, size: int) -> tuple[Floats]:
            return (loops.read.radii(size),)

        radii: Floats = self._of_batches(numbers, of_batch, 1)[0]
        return radii

    def poles(self, numbers: Numbers = None) -> ClosedLoopPoles:
        """The closed-loop poles of one loop, per frame.

        Parameters
        ----------
        numbers : dict, optional
            Other values of numbers: name -> number.

        Returns
        -------
        ClosedLoopPoles

        Raises
        ------
        UsageError
            As for `stable_intervals`, and for an array, or a loop whose frame overflows.
        IllPosedLoopError
            As for `stable_intervals`.

        Notes
        -----
        Accuracy: that of eigenvalues in doubles, computed as z - 1: slow poles keep their distance from 1.
        """
        loops = self._single(numbers).read
        drawn = loops.drawn()
        drift = loops.drift_of_frames()
        E, hidden = loops.frames_with_reliability(drift, drawn)
        if not np.isfinite(E).all():
            expected = "expected a loop whose frame stays within doubles, found one that overflows"
            raise UsageError(f"poles: {expected}")
        names, (delta, shares) = named_modes(E, drawn, drift)
        clear = bool(count_outside(E[None])[1].all() and not np.any(hidden))
        period = float(np.asarray(drawn.period)) * drawn.ticks
        with np.errstate(divide="ignore"):  # of a pole at 0
            logarithm = np.log1p(delta)
        s = logarithm.real / period + 1j * (logarithm.imag / period)
        certain = certain_modes(delta, clear=clear)
        states = tuple(self.state_names.get(name, name) for name in names)
        return ClosedLoopPoles(1 + delta, s, damping_ratio(delta), certain, shares, states)

    def response(
        self, frequency_hz: ArrayLike, source: str, output: str, numbers: Numbers = None
    ) -> InputResponse:
        """The steady response of an output to a sinusoidal input that is held over each tick.

        The component at the frequency of the input itself: a loop of several rates answers with
        images of it too.

        Parameters
        ----------
        frequency_hz : float or array of shape (points,)
            From 0 (the static limit) up to half the rate of the tick, Hz.
        source, output : str
            Names of an input and of an output.
        numbers : dict, optional
            Other values of numbers: name -> number or array.

        Returns
        -------
        InputResponse

        Raises
        ------
        UsageError
            As for `stable_intervals`, and for other frequencies.
        IllPosedLoopError
            As for `stable_intervals`.

        Notes
        -----
        Accuracy: every value has a bound on its relative error, which counts the rounding of the
        loop's entries.
        """
        self._refuse_ends(source, output)
        asked_hz = real_numbers(frequency_hz)
        frequency = np.array([np.nan]) if asked_hz is None else asked_hz.astype(float).ravel()
        half = self._rate / 2
        if not frequency.size or not np.all((frequency >= 0) & (frequency <= half)):
            received = f"{frequency_hz!r:.60}"
            raise UsageError(
                f"frequency_hz: expected numbers from 0 to {half:g} Hz, half the rate of the tick, found {received}"
            )

        def of_batch(loops: Loops, size: int) -> tuple[Any, Any, Bools]:
            value = np.empty((size, frequency.size), complex)
            error = np.empty((size, frequency.size))
            for members, port in ports_of_batch(loops.read, size, (source, output)):
                value[members], error[members] = transfer(Lifted.of(port), frequency)
            return value, error, loops.read.radii(size) < 1

        return InputResponse(frequency, *self._of_batches(numbers, of_batch, 3))

    def hinf_norm(self, source: str, output: str, numbers: Numbers = None) -> ExtremeGain:
        """The largest gain from an input to an output: the H-infinity norm of the loop lifted over a frame.

        `sum |y[k]|^2 <= value^2 sum |u[k]|^2` over all ticks k, for every input that is held over
        the ticks, from rest. It is the largest singular value of the lifted loop over all
        frequencies, found by level sets (S. Boyd, V. Balakrishnan; N. Bruinsma, M. Steinbuch,
        1990), and counts the images that `response` leaves out.

        Parameters
        ----------
        source, output : str
            Names of an input and of an output.
        numbers : dict, optional
            Other values of numbers: name -> number or array.

        Returns
        -------
        ExtremeGain
            In the output's unit per the input's; infinite for a loop that is not stable, whether or
            not the output shows it, or whose output drifts; NaN if it is not known whether the loop
            is stable.

        Raises
        ------
        UsageError, IllPosedLoopError
            As for `stable_intervals`.

        Notes
        -----
        Accuracy: 1e-10 relative if certified. Over frames of more than 64 inputs or outputs, that
        no gain is larger is proved to 5e-9 at least.
        """

        def largest(ticks: TickMaps) -> tuple[Floats, Floats, Bools]:
            peak = squared_norm(ticks)
            return np.sqrt(peak.value), peak.theta, peak.certified

        return self._extreme(source, output, numbers, largest, np.inf)

    def passivity_index(self, source: str, output: str, numbers: Numbers = None) -> ExtremeGain:
        """How passive the loop is between an input and an output: the least energy that it takes up per energy of the input.

        `sum u[k] y[k] >= value sum u[k]^2` over all ticks k, from rest: the loop is passive if the
        index is at least 0. It is the smallest eigenvalue of the Hermitian part of the lifted loop
        over all frequencies (input feedforward passivity).

        Parameters
        ----------
        source, output, numbers
            As for `hinf_norm`.

        Returns
        -------
        ExtremeGain
            In the output's unit per the input's; -inf where `hinf_norm` is infinite, and NaN where
            it is NaN.

        Raises
        ------
        UsageError, IllPosedLoopError
            As for `stable_intervals`.

        Notes
        -----
        Accuracy: 1e-10 of the index and of 1 if certified.
        """

        def smallest(ticks: TickMaps) -> tuple[Floats, Floats, Bools]:
            peak = damping_peak(
                ticks, ticks.lifted(measured=False), np.ones(ticks.loops), np.zeros(ticks.loops)
            )
            return -peak.value, peak.theta, peak.certified

        return self._extreme(source, output, numbers, smallest, -np.inf)

    def lifted(self, numbers: Numbers = None) -> LiftedStateSpace:
        """One loop from frame to frame, from all inputs to all outputs, one of each for every tick.

        Parameters
        ----------
        numbers : dict, optional
            Other values of numbers: name -> number.

        Returns
        -------
        LiftedStateSpace
            What drifts is among its states.

        Raises
        ------
        UsageError, IllPosedLoopError
            As for `poles`.
        """
        drawn = self._single(numbers).drawn()
        with drawn.naming_blocks():
            ticks = Ticks.of(drawn, tuple(OUTPUT + name for name in self.outputs))
        columns = [ticks.maps[0].inputs.index(signal) for _, signal, _ in self.drawing.inputs]
        maps = []
        for tick in ticks.maps:
            maps.append((tick.E, tick.B[..., columns], tick.C, tick.D[..., columns]))
        lifted = TickMaps.of(maps, ticks.kind, ()).lifted(measured=False)
        E, B, C, D = (matrix[0] for matrix in (lifted.E, lifted.G, lifted.O, lifted.T))
        inputs: list[str] = []
        outputs: list[str] = []
        for number in range(drawn.ticks):
            inputs += [f"{name}[{number}]" for name in self.inputs]
            outputs += [f"{name}[{number}]" for name in self.outputs]
        labels = drawn.labels()
        period = float(np.asarray(drawn.period)) * drawn.ticks
        named = (labels.get(state, state) for state in ticks.states)
        states = tuple(self.state_names.get(name, name) for name in named)
        return LiftedStateSpace(
            np.eye(len(E)) + E, B, C, D, period, tuple(inputs), tuple(outputs), states
        )

    @property
    def _names(self) -> Names:
        names: Names = self.drawing.names
        return names

    @property
    def _rate(self) -> float:
        """Rate of the tick with the loop's own numbers (Hz)."""
        return float(self.drawing.rate(self.values))

    def _key(self, name: str) -> Key:
        key = self._names.find(name)
        if key is None:
            near = nearest(name, [*self._names.symbols, *self._names.keys])
            hint = f"; did you mean {near}?" if near else ""
            raise UsageError(
                f"{name}: expected one of the numbers {', '.join(self._names.symbols) or '(none)'}{hint}"
            )
        return key

    def _path(self, name: str) -> str:
        return self._key(name).path

    def _refuse_ends(self, source: str, output: str) -> None:
        """Raise UsageError for names that are no input and no output."""
        for side, name, ends in (("input", source, self.inputs), ("output", output, self.outputs)):
            if name not in ends:
                raise UsageError(
                    f"expected an {side} of the loop, one of {', '.join(ends) or '(none)'}, found {name!r:.60}"
                )

    def _arrays(self, numbers: Numbers) -> tuple[tuple[int, ...], dict[str, Floats]]:
        """The shape that the values given have together, and path -> values, flat. Errors: UsageError."""
        arrays: dict[str, Floats] = {}
        for name, argument in (numbers or {}).items():
            key = self._key(name)
            values = real_numbers(argument)
            if values is None or not computable(values).all() or key.path in arrays:
                raise UsageError(
                    f"{name}: expected a finite number, or an array of them, once, found {argument!r:.60}"
                )
            for value in np.unique(values).tolist() if key.structural else ():
                try:
                    check(key, value)
                except Rejected as error:
                    raise UsageError(f"{name}: {error}") from None
            arrays[key.path] = values.astype(float)
        try:
            shape = np.broadcast_shapes(*(values.shape for values in arrays.values()))
        except ValueError:
            shapes = ", ".join(
                f"{name} {np.shape(values)}" for name, values in (numbers or {}).items()
            )
            raise UsageError(
                f"expected arrays of numbers that broadcast together, found {shapes}"
            ) from None
        return shape, {
            path: np.broadcast_to(values, shape).ravel() for path, values in arrays.items()
        }

    def _batches(
        self, arrays: Mapping[str, Floats], *, along: bool = False
    ) -> Iterator[tuple[NDArray[np.intp], Loops]]:
        """Yield indices and loops of one structure; of these a number that is zero in one is zero in all.

        along: for intervals along a number, which take the longest tick that the loops have in
        common.
        """
        size = next((values.size for values in arrays.values()), 1)
        shaping = {path for path in arrays if self._names.keys[path].structural}
        alike = [values if path in shaping else values == 0 for path, values in arrays.items()]
        for members in distinct(alike, size):
            values: dict[str, Any] = {**self.values}
            for path, array in arrays.items():
                values[path] = (
                    check(self._names.keys[path], array[members[0]].item())
                    if path in shaping
                    else array[members]
                )
                if array.size == 1 and path not in shaping:
                    values[path] = array.item()
            together = Loops(self.drawing, values)
            if along:
                together = together.in_common_tick()
            for batch, loops in together.built_alike(members):
                loops.refuse_unsuitable()
                yield batch, loops

    def _single(self, numbers: Numbers) -> Loops:
        """The one loop of these numbers."""
        shape, arrays = self._arrays(numbers)
        if shape:
            raise UsageError(
                f"expected numbers for a single loop, found arrays of the shape {shape}"
            )
        return next(loops for _, loops in self._batches(arrays))

    def _of_batches(
        self, numbers: Numbers, of_batch: Callable[[Loops, int], tuple[Any, ...]], count: int
    ) -> list[Any]:
        """What a function returns of batches of loops, `count` arrays `(loops, ...)`, in the shape of the numbers."""
        shape, arrays = self._arrays(numbers)
        members = []
        answers: list[list[Any]] = [[] for _ in range(count)]
        for members_of_batch, loops in self._batches(arrays):
            members.append(members_of_batch)
            values = of_batch(loops, members_of_batch.size)
            for number in range(count):
                answers[number].append(values[number])
        order = np.argsort(np.concatenate(members))
        in_order = []
        for parts in answers:
            array = np.concatenate(parts)[order]
            in_order.append(array.reshape((*shape, *array.shape[1:])))
        return in_order

    def _extreme(
        self,
        source: str,
        output: str,
        numbers: Numbers,
        extreme: Callable[[TickMaps], tuple[Floats, Floats, Bools]],
        unbounded: float,
    ) -> ExtremeGain:
        """The extreme of stable loops between an input and an output, and `unbounded` of others.

        Modes that the output does not show are left out of the levels, but not of the verdict.
        """
        self._refuse_ends(source, output)

        def of_batch(loops: Loops, size: int) -> tuple[Floats, Floats, Bools]:
            value = np.empty(size)
            frequency = np.empty(size)
            certified = np.empty(size, bool)
            for members, port in ports_of_batch(loops.read, size, (source, output)):
                found = _extreme_of_port(port.observable(), extreme, unbounded)
                value[members], frequency[members], certified[members] = found
            radius = loops.read.radii(size)
            value = np.where(radius < 1, value, np.where(np.isnan(radius), np.nan, unbounded))
            frequency = np.where(radius < 1, frequency, np.nan)
            certified = np.where(radius < 1, certified, radius > 1)
            return value, frequency, certified

        return ExtremeGain(*self._of_batches(numbers, of_batch, 3))


def _sum(terms: Terms) -> str:
    """A linear expression as a text."""
    return " + ".join(f"({gain.text})*{signal}" for signal, gain in terms)


def _extreme_of_port(
    port: Port, extreme: Callable[[TickMaps], tuple[Floats, Floats, Bools]], unbounded: float
) -> tuple[Floats, Floats, Bools]:
    """The extreme of each loop of a port, its frequency (Hz), and whether it is certified; `unbounded`
    of a loop that is not stable, NaN of one whose frame overflows."""
    maps = [(E, B, C[..., :1, :], D[..., :1, :]) for E, B, C, D in port.maps]
    ticks = TickMaps.of(maps, port.kind, port.batch)
    frame = ticks.frame()
    stable = is_stable(frame) & (port.outputs == 1)
    lost = ~np.isfinite(frame).all((-1, -2))
    value = np.where(lost, np.nan, unbounded)
    theta = np.full(ticks.loops, np.nan)
    certified = ~stable & ~lost
    loops = np.flatnonzero(stable)
    if loops.size:
        value[loops], theta[loops], certified[loops] = extreme(ticks.at(loops).in_even_units())
    return value, theta * port.rate / (2 * np.pi * port.kind.size), certified
