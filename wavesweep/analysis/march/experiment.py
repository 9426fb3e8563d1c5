"""The paper's experiment in simulation: both loops with what real devices and real-time systems add."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.march.device import zero_order_hold
from wavesweep.analysis.march.direct import direct_tick
from wavesweep.analysis.march.energy import Energy, energies
from wavesweep.analysis.march.friction import Body, slide
from wavesweep.analysis.march.linear import Loop, at_rest, compile_loop
from wavesweep.analysis.march.options import Options
from wavesweep.analysis.march.timing import lateness, tick_lengths
from wavesweep.analysis.march.waves import WaveLaw, wave_tick

_FAST = ("f_m", "touching", "u_m", "v_m", "u_h", "v_l", "v_2")
_AVATAR = {"v_s": "v", "x_s": "x", "x_dot_s": "x_dot", "F_s": "F"}
_EXACT_STEPS = 2.0**53  # beyond this many encoder steps every double is one


@dataclass(frozen=True)
class Simulation:
    """A simulated experiment.

    `signals`: the columns, read-only, an entry per fast tick, SI units. Always: `time` the tick's start, `f_h` the
    hand's force, `x` and `v` the motion, `x_hat` and `v_hat` as measured, `f_m` the controller's force, `f_device` what
    the motors make of it, `touching` whether the held slow result is of a contact. With waves: `u_m`, `v_m`, and the
    last slow update's `u_s`, `v_s`, `x_s`, `x_dot_s`, `F_s`, repeated until the next; with a local model behind
    them `u_h`, `v_l`, `v_2`. `F_s` also without waves.
    `energy`: see `Energy`. `frame`: ticks in a frame, 1 for `dc`.
    `late`: ticks by which each frame's slow result was late, -1 for one that was lost.
    `finite`: how many ticks passed before a number left the range of doubles; all of them unless the loop is unstable.
    """

    signals: Mapping[str, np.ndarray]
    energy: Energy
    late: np.ndarray
    frame: int
    finite: int


def simulate(values: Mapping, force, options: Options | None = None, x: float = 0.0) -> Simulation:
    """Run the experiment under a record of hand forces.

    The equations are those of `march`, tick by tick; `options` adds what the linear model leaves out. A tick is about a
    hundred operations on plain Python floats (filters as one-pole sections, walls solved in closed form for each way of
    touching, the plant by coefficients made for all ticks at once), which takes no longer than a few calls of numpy
    would and keeps the equations readable: about 1 s for a minute at 1 kHz with everything on.

    Parameters: `values` the flat values of a spec, `force` the hand's force (N) per tick, shape ``(ticks,)``, `options`
    see `Options`, `x` where the hand starts from rest (m).

    Accuracy: with all options off the bits of `march`; contact, saturation and friction are solved within the tick, not
    iterated. An encoder, late results and jitter see the signal at the ticks, as their originals do.
    """
    options = Options() if options is None else options
    force = np.asarray(force, dtype=float)
    loop = compile_loop(values, options.wall)
    late = lateness(options, -(-len(force) // loop.frame))
    lengths = tick_lengths(options, loop.T, len(force))
    rows, last = _run(loop, values, options, force.tolist(), lengths, late, x)
    signals = _columns(rows, force, lengths)
    moved = np.diff(signals["x"], append=last) if len(rows) else np.zeros(0)
    finite = np.isfinite(np.append(signals["x"], last))
    return Simulation(
        signals={name: _frozen(column) for name, column in signals.items()},
        energy=energies(signals, moved, loop.T, loop.frame),
        late=_frozen(np.array([-1 if ticks is None else ticks for ticks in late], dtype=int)),
        frame=loop.frame,
        finite=len(force) if finite.all() else int(finite.argmin()),
    )


def _run(loop: Loop, values: Mapping, options: Options, force: list, lengths: np.ndarray, late: list, x: float):
    """March; returns `x`, `v`, `x_hat`, `v_hat`, `f_device` and the controller's signals per tick, and the last `x`."""
    measure, exert = _encoder(options.resolution), _motor(options.max_force)
    move = _mover(values, options, loop, lengths)
    step = wave_tick if isinstance(loop.law, WaveLaw) else direct_tick
    control, v = at_rest(loop).control, 0.0
    x_before, rows = measure(x), []
    for k, f_h in enumerate(force):
        x_hat = measure(x)
        v_hat = v if loop.velocity == "exact" else (x_hat - x_before) / loop.T
        control, seen = step(loop.law, control, k, x_hat, v_hat, late[k // loop.frame])
        f_device = exert(seen.f_m)
        rows.append((x, v, x_hat, v_hat, f_device, seen))
        x, v = move(x, v, f_h - f_device)
        x_before = x_hat
    return rows, x


def _encoder(resolution: float) -> Callable[[float], float]:
    """Give the position as the nearest step of the encoder."""
    if resolution == 0.0:
        return lambda x: x
    return lambda x: resolution * math.floor(x / resolution + 0.5) if abs(x) < _EXACT_STEPS * resolution else x


def _motor(max_force: float | None) -> Callable[[float], float]:
    """Give the force that the motors exert."""
    if max_force is None:
        return lambda f: f
    return lambda f: min(max(f, -max_force), max_force)


def _mover(values: Mapping, options: Options, loop: Loop, lengths: np.ndarray) -> Callable:
    """Give the motion over the next tick, each call a tick further on."""
    body = Body(
        values["device.mass"] + values["operator.mass"],
        values["device.damping"] + values["operator.damping"],
        values["operator.stiffness"],
        options.friction,
    )
    plants = _plants(body, options, loop, lengths)

    def free(x: float, v: float, f: float) -> tuple[float, float]:
        a, b, c, d, e, g = next(plants)[1]
        return x + (a * x + b * v + c * f), v + (d * x + e * v + g * f)

    def rubbing(x: float, v: float, f: float) -> tuple[float, float]:
        return slide(body, x, v, f, *next(plants))

    return rubbing if options.friction else free


def _plants(body: Body, options: Options, loop: Loop, lengths: np.ndarray) -> Iterator:
    """Give the length of each tick and the plant's increments over it; ticks of one length share them."""
    if options.jitter == 0:
        return ((loop.T, loop.plant) for _ in lengths)
    increments = zero_order_hold(body.mass, body.damping, body.stiffness, lengths)
    return zip(lengths.tolist(), increments.tolist(), strict=True)


def _columns(rows: list, force: np.ndarray, lengths: np.ndarray) -> dict[str, np.ndarray]:
    """Turn rows into columns; what a controller does not have is left out."""
    names = ("x", "v", "x_hat", "v_hat", "f_device")
    columns = {"time": np.concatenate([[0.0], np.cumsum(lengths)])[: len(rows)], "f_h": force}
    columns |= {name: np.array([row[place] for row in rows]) for place, name in enumerate(names)}
    seen = [row[-1] for row in rows]
    columns |= {name: np.array(found) for name in _FAST if (found := _found(seen, name))}
    for name in ("u_s", "F_s"):
        columns |= _held(name, [getattr(signals, name, None) for signals in seen])
    avatars = [getattr(signals, "slow", None) for signals in seen]
    for name, field in _AVATAR.items():
        columns |= _held(name, [avatar and getattr(avatar, field) for avatar in avatars])
    return columns


def _found(seen: list, name: str) -> list:
    """Give a signal of every tick, nothing where the controller does not have it."""
    return [getattr(signals, name) for signals in seen] if seen and getattr(seen[0], name, None) is not None else []


def _held(name: str, numbers: list) -> dict[str, np.ndarray]:
    """Repeat the number of each slow update until the next; the first tick is one, where there are any at all."""
    updates = np.array([k for k, number in enumerate(numbers) if number is not None], dtype=int)
    if not len(updates):
        return {}
    known = np.array([numbers[k] for k in updates])
    return {name: np.repeat(known, np.diff(updates, append=len(numbers)))}


def _frozen(column: np.ndarray) -> np.ndarray:
    column.flags.writeable = False
    return column
