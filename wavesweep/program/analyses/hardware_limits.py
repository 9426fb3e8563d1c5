"""What an encoder, friction and a motor do to a loop: bounds on the force of the encoder's rounding, and on walls."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.energy.held_loop import device_of
from wavesweep.engine.loops.batch import Loops
from wavesweep.engine.loops.from_drawing import POSITION, REACTION
from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.response.port import port_between
from wavesweep.engine.stability.radii import drift_of, named_loops
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop

if TYPE_CHECKING:
    from wavesweep.engine.response.peak import PeakGain

GIVEN = ("resolution", "friction", "max_force")  # of `Spec.hardware`
ROUNDING = "encoder's rounding"  # the input from outside that is added to each reading


def readings(drawn: MultirateLoop, device: str) -> MultirateLoop:
    """Return the loop with the error of its encoder as an input: each junction that reads the device's position has it too.

    The position of the hand's port is the device's own.
    """
    signal = f"{device}.x"
    sums = {
        port: {**terms, ROUNDING: terms[signal]} if signal in terms and port != POSITION else terms
        for port, terms in drawn.sums.items()
    }
    return replace(drawn, sums=sums, inputs=(*drawn.inputs, ROUNDING))


def peak_of_encoder(loop: Loops) -> PeakGain | None:
    """Return the peak gain (N/m) from the error of the encoder to the force of the motors, of one loop.

    None without a device that the hand holds and a force against it, and as for `l1_norm`.
    """
    from wavesweep.engine.response.peak import l1_norm

    device = device_of(loop.drawing)
    if device is None or loop.drawing.hand[2] is None:
        return None
    drawn, drift = loop.drawn(), drift_of(loop, watched=(POSITION, REACTION))
    with named_loops(drawn):
        return l1_norm(port_between(readings(drawn, device), ROUNDING, REACTION, drift))


def peaks_of(loops: Loops, size: int) -> np.ndarray:
    """Return the peak gains of some loops, `(size,)`; NaN for loops without one."""
    peaks = (peak_of_encoder(loops.one(at)) for at in range(size))
    return np.array([np.nan if peak is None else peak.gain for peak in peaks])


def hardware_of(spec: Spec, *, stable: bool = True) -> dict[str, float | None]:
    """What the encoder, the friction and the motors of a spec do to its own design, as a JSON-able dict; None if not known.

    Of [simulate] or the device preset, each if it is given: resolution D (m), friction f_c (N), max_force (N). step_force (N):
    the largest force of the motors after one step of the encoder, at any time. chatter (N): a bound on what the encoder's
    rounding adds to the force of the linear loop, whatever the hand does; see `l1_norm`. Both are of stable loops alone.
    holds_to, passive_to: see `limits_of_walls`. depth (m), by `verdict`: to which the wall can be pressed, slowly, before the
    motors end, max_force over the stiffness felt at rest.
    """
    limits: dict[str, float | None] = {name: spec.hardware[name] for name in GIVEN if spec.hardware[name]}
    loop = own_loop(spec)
    if stable and (step := limits.get("resolution")) and device_of(loop.drawing) and loop.drawing.hand[2] is not None:
        peak = peak_of_encoder(loop)
        limits |= {"step_force": peak and peak.step * step, "chatter": peak and peak.gain * step / 2}
    return limits | limits_of_walls(spec) if limits else {}


def limits_of_walls(spec: Spec) -> dict[str, float]:
    """Stiffnesses (N/m) from which on friction and encoder, or sampling and delay, may make a wall buzz; each if it applies.

    holds_to: `2 f_c/D`. A device at rest whose reading changes by one step D sees its force change by the stiffness times D;
    friction f_c holds it in both readings if half of that is less. passive_to: `d/(T/2 + delay)`, of direct coupling without
    B_VE and with no delay or one of whole frames, that of the amplifier included: the wall up to which the damping d of the
    device takes up what sampling and delay generate. Sources: Abbott and Okamura 2005, Effects of position quantization and
    sampling rate on virtual-wall passivity; with a delay Diolaiti and others 2006, Stability of haptic rendering.
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
    elif spec.kind == "dc-slow" and (late := values["environment.delay"] + values["device.delay"]) % values["rates.ratio"] == 0:
        ticks = values["rates.ratio"] / 2 + late
        limits["passive_to"] = values["device.damping"] * values["rates.fast_hz"] / ticks
    return limits


def deciding(path: str) -> bool:
    """Whether `limits_of_walls` depends on a key of the loop."""
    of_walls = ("device.damping", "device.delay", "device.dead_time", "environment.delay", "controller.kind")
    return path in of_walls or path.startswith("rates.")
