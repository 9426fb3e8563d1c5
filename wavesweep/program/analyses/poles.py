"""The closed-loop poles of a spec's own loop, or over a number, with frequency, damping and the
states that take part."""

from collections.abc import Iterator

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.loop import Loops
from wavesweep.engine.poles import (
    certain_modes,
    count_outside,
    damping_ratio,
    lines_of_each,
    named_modes,
)
from wavesweep.program.analyses.spec_loops import refuse_singular
from wavesweep.program.columns import Columns, joined
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.sweep.grid import make_grid, own_loop

# distance from the unit circle, up to which a pole is on it: it is known to rounding
ON_CIRCLE = 1e-6
# of a frame of several ticks, some 10 s; the time grows with the fourth power
MOST_STATES = 400


@np.errstate(divide="ignore", invalid="ignore")  # of a pole of 0 or of 1
def poles(spec: Spec, axis: Axis | None = None) -> Columns:
    """The columns of all poles per frame, the slowest first, of the spec's own loop or of those
    over the values of an axis.

    What drifts is left out. frequency_hz: as it is seen once a frame; shown_hz: the strongest line
    that a spectrum of the states shows; second_hz: the next one, if it has more than a third of the
    energy. doubt: "rounding" of poles that rounding could move across the circle, "overflow" of a
    row without numbers for a loop whose frame is not known.

    Errors: SpecError for a loop without a solution, UsageError for more than MOST_STATES.
    """
    refuse_singular(spec, own_loop(spec).drawing)
    grid = make_grid(spec, (axis,) if axis else ())
    blocks = {}
    for members, loops in grid.drawn(numbers=range(grid.loops)):
        by_loop = _of_batch(loops.read, members.size)
        axes = grid.axis_columns(members)
        for place, (index, columns) in enumerate(zip(members.tolist(), by_loop, strict=True)):
            rows = len(columns["doubt"])
            of_axes = {name: np.full(rows, axes[name][place]) for name in axes}
            blocks[index] = of_axes | columns
    return joined(blocks[index] for index in sorted(blocks))


def _columns(
    delta: np.ndarray, s: np.ndarray, hz: np.ndarray, doubted: np.ndarray
) -> dict[str, np.ndarray]:
    """The numbers of modes z = 1 + delta with the logarithms `s` (1/s) and the lines `hz`."""
    return {
        "z_re": 1 + delta.real,
        "z_im": delta.imag,
        "radius": np.abs(1 + delta),
        "s_re": s.real,
        "s_im": s.imag,
        "frequency_hz": np.abs(s.imag) / (2 * np.pi),
        "damping_ratio": damping_ratio(delta),
        "time_constant_s": -1 / s.real,
        "shown_hz": hz,
        "shown_damping_ratio": -s.real / np.abs(s.real + 2j * np.pi * hz),
        "stable": (np.abs(1 + delta) < 1) & ~doubted,
        "doubt": np.where(doubted, "rounding", "").astype(object),
    }


def _of_batch(loops: Loops, size: int) -> Iterator[dict[str, np.ndarray]]:
    """Yield the columns of each loop of a batch."""
    drawn = loops.drawn()
    drift = loops.drift_of_frames()
    states = len(drift.remaining)
    if drawn.ticks > 1 and states > MOST_STATES:
        raise UsageError(
            f"poles: expected a frame of at most {MOST_STATES} states, each of whose modes has its own spectrum, found "
            f"{states}; a delay has one for each of its steps: give it fewer, in a block that runs more slowly"
        )
    frame_period = np.asarray(drawn.period * drawn.ticks, float)
    period = np.broadcast_to(frame_period, (size,))
    E, hidden = loops.frames_with_reliability(drift, drawn)
    E = np.broadcast_to(E, (size, *E.shape[-2:]))
    hidden = np.broadcast_to(hidden, (size,))
    finite = np.isfinite(E).all((-1, -2))
    clear = count_outside(E)[1] & ~hidden
    named = [named_modes(frame, drawn, drift) for frame in E]
    all_delta = np.full((size, states), -0.5 + 0j)  # also of frames without numbers
    for index, (_, modes) in enumerate(named):
        if modes.delta.size:
            all_delta[index] = modes.delta
    lines = [*lines_of_each(loops, [np.log1p(all_delta[:, [k]]) for k in range(states)])]
    for index, (names, (delta, shares)) in enumerate(named):
        doubted = ~certain_modes(delta, clear=bool(clear[index]))
        s = np.log1p(delta) / period[index]
        lines_here = np.array([line[index] for line in lines]).reshape(-1, 2)
        hz, second = lines_here[: delta.size].T
        numbers = _columns(delta, s, hz, doubted)
        numbers["second_hz"] = second
        leaders = [", ".join(leading(names, array)) for array in shares]
        numbers["states"] = np.array(leaders, object)
        if states and not finite[index]:
            numbers = {name: np.full(1, np.nan) for name in numbers}
            numbers["states"] = np.array([""], object)
            numbers["stable"] = np.zeros(1, bool)
            numbers["doubt"] = np.array(["overflow"], object)
        yield {name: _finite_or_missing(array) for name, array in numbers.items()}


def _finite_or_missing(array: np.ndarray) -> np.ndarray:
    if array.dtype == float:
        return np.where(np.isfinite(array), array, np.nan)
    return array


def leading(names: list[str], shares: np.ndarray) -> list[str]:
    """The names of the states that take part most in a mode, those with the largest share first."""
    order = np.argsort(-shares, kind="stable")[:3]  # states that are named of a mode
    # Share of a mode, below which a state is not named.
    return [names[index] for index in order if shares[index] >= 0.05]
