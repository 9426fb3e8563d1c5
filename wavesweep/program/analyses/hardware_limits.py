"""What an encoder, friction and a motor do to a loop: bounds on the force of the encoder's
rounding, and on walls."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.blocks import POSITION, REACTION, MultirateLoop
from wavesweep.engine.loop import Loops
from wavesweep.engine.response import Port
from wavesweep.haptics.held_loop import device_of
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop

if TYPE_CHECKING:
    from wavesweep.engine.response import PeakGain

GIVEN = ("resolution", "friction", "max_force")  # of `Spec.hardware`
# of a limit cycle, below which its force is no square wave that is late by half a tick
LEAST_CYCLE_TICKS = 10
ROUNDING = "encoder's rounding"  # the input from outside that is added to each reading


def readings(drawn: MultirateLoop, device: str) -> MultirateLoop:
    """Return the loop with the error of its encoder as an input: each junction that reads the
    device's position has it too.

    The position of the hand's port is the device's own.
    """
    signal = f"{device}.x"
    sums = {
        port: {**terms, ROUNDING: terms[signal]} if signal in terms and port != POSITION else terms
        for port, terms in drawn.sums.items()
    }
    return replace(drawn, sums=sums, inputs=(*drawn.inputs, ROUNDING))


def peak_of_encoder(loop: Loops, signal: str = REACTION) -> PeakGain | None:
    """Return the peak gain from the error of the encoder to the force of the motors (N/m) or
    another signal, of one loop.

    None without a device that the hand holds and a force against it, and as for `l1_norm`.
    """
    from wavesweep.engine.response import l1_norm

    device = device_of(loop.drawing)
    if device is None or loop.drawing.hand[2] is None:
        return None
    drawn, drift = loop.drawn(), loop.drift(watched=(POSITION, signal))
    with drawn.naming_blocks():
        return l1_norm(Port.between(readings(drawn, device), ROUNDING, signal, drift))


def hardware_of(spec: Spec, *, stable: bool = True) -> dict[str, float | None]:
    """What the encoder, the friction and the motors of a spec do to its own design, as a JSON-able
    dict; None if not known.

    Of [simulate] or the device preset, each if it is given: resolution D (m), friction f_c (N),
    max_force (N). step_force (N): the largest force of the motors after one step of the encoder, at
    any time. chatter (N): a bound on what the encoder's rounding adds to the force of the linear
    loop, whatever the hand does; see `l1_norm`. moves (m), speed (m/s): the same of the device's
    position and velocity. All of these are of stable loops alone. holds_to, passive_to: see
    `limits_of_walls`; passive: whether the wall is below both, where both are known and it has no
    damping and no delay. cycle_hz, cycle_amplitude (m): see `cycle_of_encoder`. depth (m), by
    `verdict`: to which the wall can be pressed, slowly, before the motors end, max_force over the
    stiffness felt at rest.
    """
    limits: dict[str, float | None] = {
        name: spec.hardware[name] for name in GIVEN if spec.hardware[name]
    }
    loop = own_loop(spec)
    if (
        stable
        and (step := limits.get("resolution"))
        and device_of(loop.drawing)
        and loop.drawing.hand[2] is not None
    ):
        peak = peak_of_encoder(loop)
        limits |= {
            "step_force": peak and peak.step * step,
            "chatter": peak and peak.gain * step / 2,
        }
        for name, signal in (("moves", POSITION), ("speed", f"{device_of(loop.drawing)}.v")):
            peak = peak_of_encoder(loop, signal)
            limits[name] = peak and peak.gain * step / 2
    if not limits:
        return {}
    walls = limits_of_walls(spec)
    if len(walls) == 2 and _is_plain_wall(spec):
        limits["passive"] = float(spec.values["environment.K_VE"]) <= min(walls.values())
    return limits | walls | cycle_of_encoder(spec)


def _is_plain_wall(spec: Spec) -> bool:
    """Whether the wall is a spring alone that direct coupling renders without a delay, as Abbott
    and Okamura have it."""
    delays = (
        "device.delay",
        "device.dead_time",
        *(["environment.delay"] if spec.kind == "dc-slow" else []),
    )
    direct = spec.kind in ("dc", "dc-slow") and spec.values["environment.B_VE"] == 0
    return direct and not any(spec.values[path] for path in delays)


def cycle_of_encoder(spec: Spec) -> dict[str, float]:
    """Return the frequency (Hz) and amplitude (m) of a limit cycle that the encoder's steps are
    expected to cause, if any.

    cycle_hz, cycle_amplitude: a prediction for a spring that direct coupling renders at every tick,
    under a push that holds the device at the edge of a step of its encoder. The encoder is then a
    relay, of height K D, whose first harmonic is `2 K D/pi`; late by half a tick and by the
    amplifier, it drives the device, mass m, damping d, friction f_c: `m w^2 A = (2 K D/pi) cos(w
    tau)` and `w d A + 4 f_c/pi = (2 K D/pi) sin(w tau)`. There is no cycle if `2 f_c >= K D`, as
    friction holds the device then. Source: the describing functions of a relay and of friction (A.
    Gelb, W. Vander Velde, Multiple-Input Describing Functions, 1968). Accuracy: in 180 simulations
    the frequency was right to a quarter and the amplitude to a factor of 2 without friction, and
    both to a factor of 3 with it; most cycles are slower and larger, since a reading is late by up
    to a tick. Cycles with fewer than LEAST_CYCLE_TICKS ticks, or beyond a step, are not predicted.
    """
    values, step, friction = (
        spec.values,
        spec.hardware["resolution"],
        spec.hardware["friction"] or 0.0,
    )
    if not step or spec.kind != "dc" or not _is_plain_wall(spec):
        return {}
    mass, damping = (
        float(values[f"device.{part}"] + values[f"operator.{part}"]) for part in ("mass", "damping")
    )
    relay, late = (
        2 * float(values["environment.K_VE"]) * step / np.pi,
        0.5 / float(values["rates.fast_hz"]),
    )
    angle = np.linspace(0, np.pi / 2, 20_001)[1:-1]
    omega = angle / late
    amplitude = relay * np.cos(angle) / (mass * omega**2)
    drive = relay * np.sin(angle) - omega * damping * amplitude - 4 * friction / np.pi
    begins = np.flatnonzero(drive > 0)
    if values["operator.stiffness"] or not begins.size:
        return {}
    hz, size = float(omega[begins[0]] / (2 * np.pi)), float(amplitude[begins[0]])
    usual = LEAST_CYCLE_TICKS * hz <= values["rates.fast_hz"] and size < step
    if usual:
        return {"cycle_hz": hz, "cycle_amplitude": size}
    return {}


def limits_of_walls(spec: Spec) -> dict[str, float]:
    """Stiffnesses (N/m) from which on friction and encoder, or sampling and delay, may make a wall
    buzz; each if it applies.

    holds_to: `2 f_c/D`. A device at rest whose reading changes by one step D sees its force change
    by the stiffness times D; friction f_c holds it in both readings if half of that is less.
    passive_to: `d/(T/2 + delay)`, of direct coupling without B_VE and with no delay or one of whole
    frames, that of the amplifier included: the wall up to which the damping d of the device takes
    up what sampling and delay generate. Sources: Abbott and Okamura 2005, Effects of position
    quantization and sampling rate on virtual-wall passivity; with a delay Diolaiti and others 2006,
    Stability of haptic rendering.
    """
    limits, values = {}, spec.values
    step, friction = spec.hardware["resolution"], spec.hardware["friction"]
    if step and friction:
        limits["holds_to"] = 2 * friction / step
    if spec.kind == "dc":
        late = values["device.delay"] + values["device.dead_time"] * values["rates.fast_hz"]
        limits["passive_to"] = values["device.damping"] * values["rates.fast_hz"] / (0.5 + late)
    elif values["device.dead_time"]:
        return limits
    elif (
        spec.kind == "dc-slow"
        and not spec.uneven  # or a sample waits for the next tick as well
        and (late := values["environment.delay"] + values["device.delay"]) % values["rates.ratio"]
        == 0
    ):
        ticks = values["rates.ratio"] / 2 + late
        limits["passive_to"] = values["device.damping"] * values["rates.fast_hz"] / ticks
    return limits


def deciding(path: str) -> bool:
    """Whether `limits_of_walls` depends on a key of the loop."""
    of_walls = (
        "device.damping",
        "device.delay",
        "device.dead_time",
        "environment.delay",
        "controller.kind",
    )
    return path in of_walls or path.startswith("rates.")
