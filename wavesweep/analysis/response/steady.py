"""What the hand feels: steady response of the whole loop to a sinusoidal hand force."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.analysis.response.direct import direct_admittance, is_direct
from wavesweep.analysis.response.transfer import Modes, modal_response, modes_of, solved_response
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted.assemble import fast_side, slow_side
from wavesweep.lifted.circle import on_circle, solve

PROBES = 8  # frequencies of a request at which the modal form is checked against a solve
GOOD = 1e-11  # relative error, estimated or seen, up to which the modal form is believed


@dataclass(frozen=True, slots=True, eq=False)
class Loop:
    """Both rates of one loop, with the wall in place, ready to be evaluated at any frequency.

    fast: from `f_h` and the held signals to the tick's displacement `dx` (m), the control force `f_m` (N) and what is
    sampled; held signals that it does not read are left out. slow: from what the hand's force adds to the samples to the
    sources of the held signals, or with a `drift` from twice that (see `_without_drift`). drift: its gain past the states.
    wall: K_VE (N/m) and B_VE (N*s/m).
    """

    diagram: Diagram
    fast: Modes
    slow: Modes
    drift: np.ndarray | None
    wall: tuple


def prepare(diagram: Diagram, K_VE, B_VE) -> Loop:
    """Connect and lift once; `K_VE` (N/m), `B_VE` (N*s/m): numbers or arrays over the diagram's batch."""
    samples = tuple(diagram.samples.values())
    fast = fast_side(diagram, (*diagram.outputs, *samples))
    keep = [i for i, name in enumerate(fast.inputs) if name == "f_h" or np.any(fast.B[..., i]) or np.any(fast.D[..., i])]
    fast = replace(fast, inputs=tuple(fast.inputs[i] for i in keep), B=fast.B[..., keep], D=fast.D[..., keep])
    wall = {"F_s": {diagram.wall[0]: K_VE, diagram.wall[1]: B_VE}}
    slow, _ = slow_side(diagram, tuple(diagram.holds[name] for name in fast.inputs[1:]), injected=True, wall=wall)
    if diagram.wall_drifts and diagram.reference in slow.states:
        slow, drift = _without_drift(slow, slow.states.index(diagram.reference))
        return Loop(diagram, modes_of(fast), modes_of(slow), drift, (K_VE, B_VE))
    return Loop(diagram, modes_of(fast), modes_of(slow), None, (K_VE, B_VE))


def _without_drift(slow: Block, ref: int):
    """Count the reference from its conserved value q = s - l x: what remains has no pole at z = 1, and q only adds up.

    l = E_sR E_RR^-1, from (-l, 1) E = 0. With `w q = B_q u` the response times w is that of the other states to
    `w B_R u + E_Rq B_q u`, plus `C_q B_q u + w D u`: the block gets both inputs side by side, and C_q B_q is returned.
    """
    rest = np.flatnonzero(np.arange(len(slow.states)) != ref)
    E, from_s = slow.E[..., rest[:, None], rest], slow.E[..., rest, ref : ref + 1]
    along = solve(np.swapaxes(E, -1, -2), slow.E[..., ref, rest][..., None]).swapaxes(-1, -2)
    B, C_s = slow.B[..., rest, :], slow.C[..., ref : ref + 1]
    into_q = slow.B[..., ref : ref + 1, :] - along @ B
    block = Block(
        slow.name, slow.inputs + slow.inputs, slow.outputs, tuple(slow.states[i] for i in rest), E + from_s @ along,
        np.concatenate(np.broadcast_arrays(B, from_s @ into_q), axis=-1), slow.C[..., rest] + C_s @ along,
        np.concatenate([slow.D, 0 * slow.D], axis=-1),
    )
    return block, C_s @ into_q


def held_response(loop: Loop, theta, respond):
    """`w` times the response of the held sources to what the hand adds to the samples, and the size of its terms.

    theta: `(points,)`, rad per frame, `w = exp(j theta) - 1`. Shapes `(..., points, held, samples)`. Times w because a
    held signal's part at the hand's own frequency vanishes with w at multiples of the slow rate, while a conserved
    combination of states grows without limit there: their product is finite and is what counts.
    """
    w = on_circle(theta)
    G, size = respond(loop.slow, w)
    w = w[:, None, None]
    with np.errstate(over="ignore", invalid="ignore"):  # modes of a defective or overflown frame, which count as doubtful
        if loop.drift is None:
            return w * G, np.abs(w) * size
        half, past = G.shape[-1] // 2, loop.drift[..., None, :, :]
        return w * G[..., :half] + G[..., half:] + past, np.abs(w) * size[..., :half] + size[..., half:] + np.abs(past)


def steady_state(loop: Loop, frequency_hz) -> tuple[np.ndarray, np.ndarray]:
    """Transmitted admittance (m/N) and impedance (N/m), complex, `(..., points)`.

    The hand's force `exp(j w k T)` gives a sum over `w + 2 pi m/T_s`; both are its components at w itself. x is never
    formed as a state: it is the displacement in the tick over `exp(j w T) - 1`. Evaluated through modes; frequencies at
    which these cancel, or all when they disagree with a solve at PROBES of the frequencies, are solved one by one. Where the
    wall alone holds a free device, `direct_admittance` does it.
    Accuracy: 1e-10 and better from 1e-3 Hz to the fast Nyquist frequency, at multiples of the slow rate too.
    """
    ticks = np.asarray(frequency_hz, float) * loop.diagram.period  # cycles per tick
    if is_direct(loop.diagram):
        return direct_admittance(loop, ticks)
    found, doubt = _own_component(loop, ticks, modal_response)
    probes = np.unique(np.linspace(0, ticks.size - 1, PROBES).astype(int))
    exact, _ = _own_component(loop, ticks[probes], solved_response)
    seen = np.abs(found[..., probes, :] - exact) > GOOD * np.abs(exact)
    redo = np.arange(ticks.size) if seen.any() else np.flatnonzero(doubt)
    if redo.size:
        found[..., redo, :], _ = _own_component(loop, ticks[redo], solved_response)
    admittance = found[..., 0] / on_circle(2 * np.pi * ticks)
    with np.errstate(divide="ignore", invalid="ignore"):
        return admittance, found[..., 1] / admittance


def _own_component(loop, ticks, respond):
    """(displacement in the tick, control force) at the hand's frequency, `(..., points, 2)`: the direct way and the way
    over the slow side; and at which points the terms cancel too far."""
    fast, fast_size = respond(loop.fast, on_circle(2 * np.pi * ticks))
    held, held_size = held_response(loop, frame_angle(ticks, loop.diagram.ratio), respond)
    share = held_share(ticks, loop.diagram)[..., None, None]
    with np.errstate(all="ignore"):
        total = fast[..., :2, 0] + (fast[..., :2, 1:] @ held @ fast[..., 2:, :1] * share)[..., 0]
        over = (fast_size[..., :2, 1:] @ np.abs(held) @ np.abs(fast[..., 2:, :1])
                + np.abs(fast[..., :2, 1:]) @ (held_size @ np.abs(fast[..., 2:, :1]) + np.abs(held) @ fast_size[..., 2:, :1]))
        error = 8 * np.finfo(float).eps * (fast_size[..., :2, 0] + (over * np.abs(share))[..., 0])
        doubt = ~(error <= GOOD * np.abs(total))
    return total, doubt.any(axis=tuple(i for i in range(doubt.ndim) if i != doubt.ndim - 2))


def frame_angle(ticks, ratio):
    """Angle per frame, reduced to (-pi, pi] before it is rounded, so that multiples of the slow rate give exactly 0."""
    frames = ticks * ratio
    return 2 * np.pi * (frames - np.round(frames))


def held_share(ticks, diagram):
    """Component at the hand's frequency of a held signal, over w times its samples: `exp(-j w D T)/(M z (1 - exp(-j w T)))`."""
    angle = 2 * np.pi * ticks
    tail = np.exp(-1j * (angle * diagram.delay + frame_angle(ticks, diagram.ratio)))
    return tail / (diagram.ratio * -on_circle(-angle))
