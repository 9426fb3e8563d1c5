"""What an encoder, friction and a motor do to a loop: bounds on the force of the encoder's
rounding, and on walls."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from wavesweep.engine.blocks import POSITION, REACTION, MultirateLoop
from wavesweep.engine.loop import Loops
from wavesweep.engine.response import Port
from wavesweep.haptics.held_loop import device_of
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop

if TYPE_CHECKING:
    from wavesweep.engine.response import PeakGain

GIVEN = ("resolution", "friction", "max_force")  # of `Spec.hardware`
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
    if device is None:
        return None
    _, _, reaction = loop.drawing.hand
    if reaction is None:
        return None
    drawn = loop.drawn()
    # Of the motors' force it is that of `drift_at_hand`, which is found once.
    drift = loop.drift(watched=(POSITION, signal))
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
    damping and no delay. depth (m), by `verdict`: to which the wall can be pressed, slowly, before
    the motors end, max_force over the stiffness felt at rest.
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
    return limits | walls


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
