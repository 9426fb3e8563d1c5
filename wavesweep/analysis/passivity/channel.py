"""The norm of the wave channel: the energy that filters, samplers and holds can add to the waves that pass them."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.passivity.hinf import Element, Peak, angles, largest, peak_by_levels, repeated, then, tick
from wavesweep.diagram import draw
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.errors import WavesweepError
from wavesweep.lifted.connect import connect
from wavesweep.lifted.lift import prune
from wavesweep.lifted.resolvent import Response, alias_angles, flattened, response_of


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """The wave channel as two blocks at the fast rate, one for each direction; their batch is in one axis.

    outward: from `u_m` to the wave that is sampled for the slow environment, and to the wave of a local model if there is
    one. inward: from the local model's wave to its part of `v_m`, None without a local model; the other part is the held
    wave of the slow environment itself.
    ratio: ticks in a frame. delay: phase from which a new held wave is applied. period: of the frame (s), in the shape of
    the batch.
    """

    outward: Block
    inward: Block | None
    ratio: int
    delay: int
    period: np.ndarray


def channel_of(diagram: Diagram) -> Channel | None:
    """The channel between its ports in the drawing; None for a drawing without waves.

    The ports are `(u_m, v_s, v_l)` in and `(u_s, u_h, v_m)` out: those that the drawing and its blocks name as carrying waves.
    Between them lie filters, samplers and holds. The device, both environments and the other parts of the returned wave,
    such as positions, are outside. Raises WavesweepError for a channel of another shape than one environment at the slow
    rate, whose wave is held and added as it is, and at most one local model at the fast rate.
    """
    if diagram.waves is None:
        return None
    outgoing, returning = diagram.waves
    (slow,), local = _ends(diagram.slow), _ends(diagram.fast)
    ends = {block.name for block in local} | {diagram.hand.device}
    channel = [block for block in diagram.fast if block.name not in ends]
    sampled = diagram.samples.get(_only(diagram.sums, f"{slow.name}.{slow.waves[0]}"))
    held = [name for name, source in diagram.holds.items() if source == f"{slow.name}.{slow.waves[1]}"]
    if sampled is None or len(local) > 1 or len(held) != 1 or diagram.sums[returning].get(held[0]) != 1:
        raise WavesweepError(
            "the wave channel is not of a shape whose norm is known: expected a sampled wave to the slow "
            "environment, its returned wave held and added as it is, and at most one local model"
        )
    outward = _path(diagram, channel, outgoing, (sampled, *(f"{block.name}.{block.waves[0]}" for block in local)))
    inward = _path(diagram, channel, f"{local[0].name}.{local[0].waves[1]}", (returning,)) if local else None
    period = np.asarray(diagram.period * diagram.ratio)
    batch = np.broadcast_shapes(outward.batch, inward.batch if inward else (), period.shape)
    return Channel(
        flattened(outward, batch),
        flattened(inward, batch) if inward else None,
        diagram.ratio,
        diagram.delay,
        np.broadcast_to(period, batch),
    )


def _ends(blocks):
    return [block for block in blocks if block.waves]


def _only(sums, signal):
    """The signal that this one is equal to; None if it is a sum or has another gain."""
    made = sums.get(signal, {})
    return next(iter(made)) if list(made.values()) == [1] else None


def _path(diagram, channel, source, sinks) -> Block:
    """From one wave to others through the channel's filters, with all other inputs at zero."""
    own = {f"{block.name}.{port}" for block in channel for port in block.outputs}
    inputs, sums, left = [source], {}, [*sinks, *(f"{block.name}.{port}" for block in channel for port in block.inputs)]
    while left:
        signal = left.pop()
        if signal in diagram.sums and signal != source and signal not in sums:
            sums[signal] = diagram.sums[signal]
            left += list(sums[signal])
        elif signal not in own and signal not in inputs and signal not in sums:
            inputs.append(signal)
    block, _ = prune(connect("way", channel, sums, inputs, sinks))
    return Block("channel", (source,), sinks, block.states, block.E, block.B[..., :1], block.C, block.D[..., :1])


TOLERANCE = 1e-10  # relative, of the norm


@dataclass(frozen=True, slots=True, eq=False)
class ChannelNorm:
    """Norms of the channel, arrays over the batch of the values.

    norm: of the whole. omega: frequency at which it is reached, rad/s, in [0, pi/T_s], up to multiples of 2 pi/T_s.
    outward, inward: norms of the direction to the environment and of the direction back; no signal joins them within the
    ports, so the norm is the larger one. outward_omega, inward_omega: their frequencies. certified: no frequency
    exceeds the norm by more than TOLERANCE, relative.
    """

    norm: np.ndarray
    omega: np.ndarray
    outward: np.ndarray
    outward_omega: np.ndarray
    inward: np.ndarray
    inward_omega: np.ndarray
    certified: np.ndarray

    @property
    def passive(self) -> np.ndarray:
        """Whether the channel gives out no more energy than it takes in, to within TOLERANCE."""
        return self.norm <= 1 + TOLERANCE


def channel_norm(values) -> ChannelNorm | None:
    """H-infinity norm of the lifted wave channel, every wave weighted by the root of its period; None without waves.

    values: flat keys; filter cutoffs and rates may be arrays. Ports as in `channel_of`. The position feedback Kp, the wave
    impedance, the device and both walls are outside, so none of them matters, and neither do the two delays: they only
    turn phases. Not a grid: a level just above the value is shown to be met at no frequency (`peak_by_levels`).
    Accuracy: 1e-10 relative; the value is attained at `omega` to rounding.
    """
    diagram = draw(values)
    channel = channel_of(diagram)
    if channel is None:
        return None
    batch, loops = channel.period.shape, channel.period.size
    outward, inward = outward_peak(channel, loops), inward_peak(channel, loops)
    sides = [(np.sqrt(s.value).reshape(batch), s.theta.reshape(batch) / channel.period) for s in (outward, inward)]
    (out, out_omega), (back, back_omega) = sides
    return ChannelNorm(
        np.maximum(out, back),
        np.where(out >= back, out_omega, back_omega),
        out,
        out_omega,
        back,
        back_omega,
        (outward.certified & inward.certified).reshape(batch),
    )


def outward_peak(channel: Channel, loops: int) -> Peak:
    """Square of the norm of `u_m -> (u_s, u_h)`: in the basis of the aliases `diag|HP|^2 + l l*`, l the row of LP1."""
    response = response_of(channel.outward, loops)
    root = np.sqrt(channel.ratio)

    def value(owner, theta, _):
        gain = np.abs(response.at(owner, alias_angles(theta, channel.ratio))[..., 0]) ** 2
        return largest(gain[..., 1] if gain.shape[-1] > 1 else 0 * gain[..., 0], gain[..., 0])

    def level(owner, square):
        block = response.block
        every = _supply(block, owner, square, block.C[owner][:, 1:], block.D[owner][:, 1:])
        scale = np.array([root] + [1.0] * (block.C.shape[-2] - 1))[:, None]
        event = _supply(block, owner, square, scale * block.C[owner], scale * block.D[owner])
        return angles(then(event, repeated(every, channel.ratio - 1)))

    return peak_by_levels(value, level, loops, _slack)


def inward_peak(channel: Channel, loops: int) -> Peak:
    """Square of the norm of `(v_s, v_l) -> v_m`: `diag|LP2|^2 + c c*`, c the aliases of the held wave, of length 1."""
    response = response_of(channel.inward, loops) if channel.inward else None

    def value(owner, theta, _):
        phi = alias_angles(theta, channel.ratio)
        hold = _hold_power(theta, phi, channel.ratio)
        own = np.abs(response.at(owner, phi)[..., 0, 0]) ** 2 if response else 0 * hold
        return largest(own, hold)

    def level(owner, square):
        return angles(_inward_frame(channel, response, owner, square))

    return peak_by_levels(value, level, loops, _slack)


def _slack(_, square):
    """For the square: half of it is the norm's, half of the tolerance is left for rounding."""
    return TOLERANCE * square


def _hold_power(theta, phi, ratio):
    """`|sin(theta/2) / (ratio sin(phi/2))|^2`, the power of a held signal in each alias; they add up to 1."""
    below = ratio * np.sin(phi / 2)
    return np.where(below == 0, 1.0, np.sin(theta / 2)[..., None] / np.where(below == 0, 1, below)) ** 2


def _supply(block, owner, square, C, D) -> Element:
    """A tick with the balance `square u^2 - |C x + D u|^2`."""
    A = np.eye(block.E.shape[-1]) + block.E[owner]
    transposed = np.swapaxes(C, -1, -2)
    room = square[:, None, None] - np.swapaxes(D, -1, -2) @ D
    return tick(A, block.B[owner], -transposed @ C, -transposed @ D, room)


def _inward_frame(channel, response: Response | None, owner, square) -> Element:
    """The frame of the direction back: its state is the held wave, then that of LP2 and the delay."""
    n = response.block.E.shape[-1] if response else 0
    A, B = np.zeros((owner.size, n + 1, n + 1)), np.zeros((owner.size, n + 1, 1))
    C, D = np.ones((owner.size, 1, n + 1)), np.zeros((owner.size, 1, 1))
    A[:, 0, 0] = 1
    if response:
        block = response.block
        A[:, 1:, 1:], B[:, 1:] = np.eye(n) + block.E[owner], block.B[owner]
        C[..., 1:], D = block.C[owner], block.D[owner]
    transposed = np.swapaxes(C, -1, -2)
    every = tick(A, B, -transposed @ C, -transposed @ D, square[:, None, None] - D * D)
    first = np.zeros((n + 1, 1))
    first[0] = 1
    new = tick(np.diag(1 - first[:, 0]), first, 0 * A, 0 * B, channel.ratio * square[:, None, None])
    return then(repeated(every, channel.delay), then(new, repeated(every, channel.ratio - channel.delay)))


ORDERS = tuple(range(1, 9))
CUTOFFS_HZ = (2.0, 5.0, 8.57, 10.0, 15.0, 20.0, 25.0)


def filter_table(values, orders=ORDERS, cutoffs_hz=CUTOFFS_HZ) -> dict[str, np.ndarray]:
    """Columns over every order and cutoff (Hz) of LP1, orders slowest.

    `lp1_order`, `lp1_cutoff_hz`; `channel_norm` of `pmw` and its `channel_omega` (rad/s); `excess`, norm less 1;
    `energy_gain`, norm^2 - 1: the energy (J per J sent) that aliasing can add to a wave, at most;
    `bank_norm`: that of the outward direction of `pmw-lm`, `u_m -> (u_s, u_h)`, with a high-pass of the same order and cutoff,
    which is power-complementary; `certified`. The inward direction of `pmw-lm` has the norm sqrt(2) for every LP2 that passes
    constants, because `v_m = v_1 + v_2` adds two waves, so it is not a column.
    values: flat keys, of which rates alone are read. orders, cutoffs_hz: those of LP1.
    """
    cutoffs = np.asarray(cutoffs_hz, float)
    parts = [_of_order(dict(values), order, cutoffs) for order in orders]
    table = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return table | {"excess": table["channel_norm"] - 1, "energy_gain": table["channel_norm"] ** 2 - 1}


def _of_order(values, order, cutoffs):
    filters = {f"filters.{name}.order": order for name in ("lp1", "hp")}
    filters |= {f"filters.{name}.cutoff_hz": cutoffs for name in ("lp1", "hp")}
    alone, bank = (channel_norm(values | filters | {"controller.kind": kind}) for kind in ("pmw", "pmw-lm"))
    return {
        "lp1_order": np.full(cutoffs.size, order),
        "lp1_cutoff_hz": cutoffs,
        "channel_norm": alone.norm,
        "channel_omega": alone.omega,
        "bank_norm": bank.outward,
        "certified": alone.certified & bank.certified,
    }


def sufficient_order(table, energy_gain: float = 1e-3) -> dict[float, int | None]:
    """Least order per cutoff (Hz) whose aliasing adds at most `energy_gain` (J per J); None if no order does.

    table: the columns of `filter_table`. No finite order at a cutoff below half the slow rate makes it zero: the stop band is
    not empty of any Butterworth.
    """
    found = {}
    for cutoff in np.unique(table["lp1_cutoff_hz"]):
        enough = (table["lp1_cutoff_hz"] == cutoff) & (table["energy_gain"] <= energy_gain)
        found[float(cutoff)] = int(table["lp1_order"][enough].min()) if enough.any() else None
    return found
