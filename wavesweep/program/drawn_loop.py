"""The library: a loop drawn in Python, whose methods return DataFrames and arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.capabilities import library_names, of_library
from wavesweep.engine.arguments import real_numbers
from wavesweep.engine.blocks import MultirateLoop, Ports
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import MarginalModes
from wavesweep.engine.poles import radius_of
from wavesweep.engine.response import Lifted, Port, respond

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, eq=False)
class DrawnLoop:
    """A loop drawn in Python as a `MultirateLoop`, which has no numbers to sweep; its arrays may be a batch of loops."""

    drawn: MultirateLoop
    drift: MarginalModes

    if not TYPE_CHECKING:  # which reads the methods of capabilities in wavesweep/__init__.pyi

        def __getattr__(self, name):
            return of_library(f"DrawnLoop.{name}", dir(DrawnLoop)).__get__(self)

        def __dir__(self):
            return [*object.__dir__(self), *library_names("DrawnLoop")]

    def __repr__(self) -> str:
        """The blocks, and the ticks of a frame."""
        blocks = ", ".join(placed.block.name for placed in self.drawn.placed)
        return f"<DrawnLoop: {blocks}; frame of {self.drawn.ticks} ticks>"

    def spectral_radius(self) -> np.ndarray:
        """Largest eigenvalue modulus per frame, without drift.

        Returns
        -------
        ndarray
            Of the shape of the batch. It is infinite after overflow, and NaN if rounding hides it.
        """
        with self.drawn.naming_blocks():
            return radius_of(*self.drift.frame_with_reliability(self.drawn))

    def response(
        self, frequency_hz: ArrayLike, force: str, position: str, reaction: str = ""
    ) -> DataFrame:
        """Admittance and impedance at a port.

        Parameters
        ----------
        frequency_hz : float or array of shape (n,)
            In Hz, from 0 (the static limit) up to half the tick's rate.
        force : str
            The input of the drawing (N).
        position : str
            A plant's position (m).
        reaction : str, optional
            The signal of the force against the hand (N), if any; without it the impedance is force
            over position.

        Returns
        -------
        DataFrame
            A row per frequency: frequency_hz (Hz), the complex admittance (m/N) and impedance
            (N/m), NaN if not known, and bounds on their relative errors, admittance_error and
            impedance_error.

        Raises
        ------
        UsageError
            For a batch of loops, other frequencies, or a signal that does not fit.
        """
        from pandas import DataFrame

        drawn = self.drawn
        if force not in drawn.inputs or is_batch(drawn):
            raise UsageError(
                f"response: expected a single loop with the input {force!r}, found inputs {drawn.inputs}, or a batch"
            )
        frequencies = real_numbers(frequency_hz)
        if frequencies is None:
            frequency = np.array([np.nan])
        else:
            frequency = frequencies.astype(float).ravel()
        half = 0.5 / float(np.ravel(drawn.period)[0])
        if not frequency.size or not np.all((frequency >= 0) & (frequency <= half)):
            raise UsageError(
                f"frequency_hz: expected numbers from 0 to {half:g} Hz, half the tick's rate, found {frequency_hz!r:.60}"
            )
        signals = {*drawn.sums}
        for placed in drawn.placed:
            signals |= {f"{placed.block.name}.{port}" for port in placed.block.outputs}
        asked = [position, reaction] if reaction else [position]
        unknown = [name for name in asked if name not in signals]
        if unknown:
            raise UsageError(
                f"response: expected outputs of blocks or junctions, found {', '.join(unknown)}"
            )
        ports = Ports(force, position, reaction)
        response = respond(
            Lifted.of(Port.of(drawn, ports, MarginalModes.of(drawn, drawn, ports.signals))),
            frequency,
        )
        return DataFrame({"frequency_hz": frequency, **response._asdict()})


def refuse_infinite(drawn: MultirateLoop) -> None:
    """Raise UsageError for a block or a wire of a drawing with a number that is missing or not finite."""
    for placed in drawn.placed:
        matrices = (placed.block.E, placed.block.B, placed.block.C, placed.block.D)
        if not all(np.isfinite(matrix).all() for matrix in matrices):
            raise UsageError(
                f"block {placed.block.name}: expected finite numbers, found an entry that is not finite"
            )
    for port, terms in drawn.sums.items():
        for signal, gain in terms.items():
            factor = real_numbers(gain)
            if factor is None or not np.isfinite(factor).all():
                raise UsageError(
                    f"wire {port}: expected a finite gain of {signal}, found {gain!r:.60}"
                )


def is_batch(drawn: MultirateLoop) -> bool:
    """Whether a block or a gain has an array of values, for a batch of loops."""
    gains = (gain for terms in drawn.sums.values() for gain in terms.values())
    return any(placed.block.batch for placed in drawn.placed) or any(
        np.ndim(gain) for gain in gains
    )


def first_of(drawn: MultirateLoop, index: int = 0) -> MultirateLoop:
    """The loop at that index of a drawing's batch, flat."""

    def one(array, entry):
        batch = np.shape(array)[: np.ndim(array) - entry]
        if batch:
            return np.reshape(array, (-1, *np.shape(array)[len(batch) :]))[index]
        return array

    placed = []
    for scheduled in drawn.placed:
        matrices = {name: one(getattr(scheduled.block, name), 2) for name in "EBCD"}
        placed.append(
            replace(
                scheduled, block=replace(scheduled.block, **matrices, condition=1.0, terms=None)
            )
        )
    sums = {
        name: {source: one(gain, 0) for source, gain in sources.items()}
        for name, sources in drawn.sums.items()
    }
    return MultirateLoop(
        one(drawn.period, 0), tuple(placed), sums, drawn.inputs, rate=one(drawn.rate, 0)
    )
