"""Both loops, tick by tick: the model's equations in their order, with the effects of hardware.

`CONTROLLERS` lists the kinds of controller that the simulator has a law for, since no law here is derived from a drawing (see
the package).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from wavesweep.analysis.simulation.body import Body, slide, zero_order_hold
from wavesweep.analysis.simulation.direct_coupling import dc, dc_lm, dc_slow, direct_memory, direct_tick
from wavesweep.analysis.simulation.hardware import Effects, encoder, lateness, motor, tick_lengths
from wavesweep.analysis.simulation.record import Simulation, energies, signals_of
from wavesweep.analysis.simulation.wave_control import pmw, pmw_lm, wave_memory, wave_tick
from wavesweep.errors import UsageError

FARTHEST = 1e3  # m
STRONGEST = 1e6  # N
"""A simulation stops before the first tick in which the hand is farther away, or a force is larger: it means nothing there."""


class Control(NamedTuple):
    """The functions of a controller: values -> its law, law -> its memory at rest, and one tick of it."""

    law: Callable[..., Any]
    memory: Callable[[Any], Any]
    tick: Callable[..., tuple[Any, Any]]


CONTROLLERS = MappingProxyType(
    {
        "dc": Control(dc, direct_memory, direct_tick),
        "dc-slow": Control(dc_slow, direct_memory, direct_tick),
        "dc-lm": Control(dc_lm, direct_memory, direct_tick),
        "pmw": Control(pmw, wave_memory, wave_tick),
        "pmw-lm": Control(pmw_lm, wave_memory, wave_tick),
    }
)


class SimulatedLoop(NamedTuple):
    """The constants of a loop: tick (s), velocity measurement, the plant's increments, the control and its law."""

    T: float
    velocity: str
    plant: tuple[float, ...]
    control: Control
    law: Any

    @property
    def frame(self) -> int:
        """Ticks in a frame; 1 for `dc`, which has no slow loop."""
        return self.law.ratio


def compile_loop(values: Mapping, surface: float | None = None) -> SimulatedLoop:
    """Return the loop of a spec's flat values (``spec.values``, or any mapping with those keys).

    `surface` makes the wall one-sided, to be touched above that position (m).

    Errors: `UsageError` for a kind of controller without a law here.
    """
    kind = values["controller.kind"]
    if kind not in CONTROLLERS:
        raise UsageError(
            f"controller.kind: expected one that the simulator has a law for ({', '.join(CONTROLLERS)}), found {kind}; "
            "it simulates equations of its own and cannot take them from a drawing"
        )
    T = 1.0 / values["rates.fast_hz"]
    whole = (values[f"device.{name}"] + values[f"operator.{name}"] for name in ("mass", "damping"))
    plant = tuple(zero_order_hold(*whole, values["operator.stiffness"], T).tolist())
    return SimulatedLoop(T, values["device.velocity"], plant, CONTROLLERS[kind], CONTROLLERS[kind].law(values, surface))


def simulate(values: Mapping, force, effects: Effects | None = None, x: float = 0.0) -> Simulation:
    """Run the experiment under a record of hand forces.

    The equations are those of the model, in their order; `effects` adds effects outside the linear model. A tick is
    about a hundred operations on plain Python floats (filters as one-pole sections, walls solved in closed form for each
    way of touching, the plant by coefficients made for all ticks at once), which takes no longer than a few calls of
    numpy would and keeps the equations readable: about 1 s for a minute at 1 kHz with everything on.

    Parameters: `values` the flat values of a spec, `force` the hand's force (N) per tick, shape ``(ticks,)``, `effects`
    see `Effects`, `x` the initial position (m), at rest.

    The simulation stops early if the position exceeds `FARTHEST` or a force `STRONGEST`, as those of an unstable loop do;
    `Simulation.stopped` then gives the reason.

    Errors: see `compile_loop`; `IllPosedLoopError` if a loop without delay has no solution.

    Accuracy: rounding, about 1e-15 of the largest signal per tick: contact, saturation and friction are solved within
    the tick, not iterated. An encoder, late results and jitter see the signal at the ticks, as their originals do.
    """
    effects = Effects() if effects is None else effects
    force = np.asarray(force, dtype=float)
    loop = compile_loop(values, effects.wall)
    late = lateness(effects, -(-len(force) // loop.frame))
    lengths = tick_lengths(effects, loop.T, len(force))
    rows, last, stopped = _run(loop, values, effects, force.tolist(), lengths, late, x)
    signals = signals_of(rows, force[: len(rows)], lengths)
    moved = np.diff(signals["x"], append=last) if len(rows) else np.zeros(0)
    return Simulation(
        signals={name: _frozen(column) for name, column in signals.items()},
        energy=energies(signals, moved, loop.T, loop.frame),
        late=_frozen(np.array([-1 if ticks is None else ticks for ticks in late], dtype=int)),
        frame=loop.frame,
        stopped=stopped,
    )


def _run(loop: SimulatedLoop, values: Mapping, effects: Effects, force: list, lengths: np.ndarray, late: list, x: float):
    """Return a row per tick (`x`, `v`, `x_hat`, `v_hat`, `f_device`, the controller's signals), the last `x`, and a reason.

    The reason is empty if all ticks were simulated.
    """
    measure, exert = encoder(effects.resolution), motor(effects.max_force)
    move = _mover(values, effects, loop, lengths)
    step, memory, v = loop.control.tick, loop.control.memory(loop.law), 0.0
    x_before, rows = measure(x), []
    for k, f_h in enumerate(force):
        x_hat = measure(x)
        v_hat = v if loop.velocity == "exact" else (x_hat - x_before) / loop.T
        memory, seen = step(loop.law, memory, k, x_hat, v_hat, late[k // loop.frame])
        if not (abs(x) <= FARTHEST and abs(f_h) <= STRONGEST and abs(seen.f_m) <= STRONGEST):  # also if one is NaN
            return rows, x, _too_large(x)
        f_device = exert(seen.f_m)
        rows.append((x, v, x_hat, v_hat, f_device, seen))
        x, v = move(x, v, f_h - f_device)
        x_before = x_hat
    return rows, x, ""


def _too_large(x: float) -> str:
    if not abs(x) <= FARTHEST:
        return f"the hand's position exceeds {FARTHEST:g} m"
    return f"a force exceeds {STRONGEST:g} N"


def _mover(values: Mapping, effects: Effects, loop: SimulatedLoop, lengths: np.ndarray) -> Callable:
    """Return a function that moves the device by the next tick at each call."""
    body = Body(
        values["device.mass"] + values["operator.mass"],
        values["device.damping"] + values["operator.damping"],
        values["operator.stiffness"],
        effects.friction,
    )
    plants = _plants(body, effects, loop, lengths)

    def free(x: float, v: float, f: float) -> tuple[float, float]:
        a, b, c, d, e, g = next(plants)[1]
        return x + (a * x + b * v + c * f), v + (d * x + e * v + g * f)

    def rubbing(x: float, v: float, f: float) -> tuple[float, float]:
        return slide(body, x, v, f, *next(plants))

    return rubbing if effects.friction else free


def _plants(body: Body, effects: Effects, loop: SimulatedLoop, lengths: np.ndarray) -> Iterator:
    """Yield the length of each tick and the plant's increments over it; ticks of one length share them."""
    if effects.jitter == 0:
        return ((loop.T, loop.plant) for _ in lengths)
    increments = zero_order_hold(body.mass, body.damping, body.stiffness, lengths)
    return zip(lengths.tolist(), increments.tolist(), strict=True)


def _frozen(column: np.ndarray) -> np.ndarray:
    column.flags.writeable = False
    return column
