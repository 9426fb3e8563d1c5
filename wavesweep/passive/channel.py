"""The norm of the wave channel: the energy that filters, samplers and holds can add to the waves
that pass them."""

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from wavesweep.engine.blocks import Block, MultirateLoop, ScheduledBlock
from wavesweep.engine.drawing import TYPES, WAVE_ENDS, Drawing, path_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import Ticks
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import NORM_TOLERANCE, TickMaps, connected, squared_norm

# of a channel's matrix: its norm takes a second; it grows with their power of 1.5
MOST_ENTRIES = 100_000


@lru_cache(maxsize=64)
def numbers_of_channel(drawing: Drawing) -> frozenset[str]:
    """Paths of the numbers that a channel may read: those of its blocks, of the wires between
    them, and of when blocks run."""
    outside = {block.name for block in drawing.blocks if block.type in (*WAVE_ENDS, "mass")}
    trees = [drawing.tick_hz]
    for block in drawing.blocks:
        if block.name in outside:
            trees += [block.every, block.phase]
        else:
            trees += [tree for _, tree in block.trees()]
    for port, terms in drawing.wires:
        if port.endswith(".in") or port.rpartition(".")[0] not in outside:
            trees += [gain for _, gain in terms]
    return frozenset(path_of(name) for tree in trees for name in tree.names)


@dataclass(frozen=True, slots=True, eq=False)
class WaveChannel:
    """The wave channel between the ends of a wave line.

    whole: its ticks from the waves that ends send to those that reach them, each weighted by the
    root of its period, in the ticks in which an end runs. outward: those from the ends `wave` to
    the environments, which are avatars and local models. inward: those back. joined: whether a wave
    of one side comes back to that side within the channel. frame: its period (s) in the shape of
    the batch.
    """

    whole: TickMaps
    outward: TickMaps
    inward: TickMaps
    joined: bool
    frame: np.ndarray

    @property
    def entries(self) -> int:
        """Entries of the largest matrix whose singular values are the norm."""
        ways = (self.whole,) if self.joined else (self.outward, self.inward)
        entries = []
        for way in ways:
            outputs = 0
            inputs = 0
            for kind in way.kind.tolist():
                _, _, _, D = way.maps[kind]
                outputs += D.shape[-2]
                inputs += D.shape[-1]
            entries.append(outputs * inputs)
        return max(entries)

    def refuse_large(self) -> None:
        """Raise UsageError for a matrix of more than MOST_ENTRIES."""
        if self.entries > MOST_ENTRIES:
            raise UsageError(
                f"norm of the wave channel: expected a matrix of at most {MOST_ENTRIES} entries, found {self.entries} "
                f"for a frame of {self.whole.kind.size} ticks; choose rates with fewer ticks in a frame"
            )


def channel_of(drawing: Drawing, values) -> WaveChannel | None:
    """The channel of a drawing; None for one without waves.

    Filters, samplers, holds, delays and sums lie between the ends. The masses and the other parts
    of a returned wave, such as positions, are outside: they are left at zero. values: numbers of
    the drawing, or arrays over a batch.
    """
    if not drawing.has_waves:
        return None
    types = {block.name: block.type for block in drawing.blocks}
    for plant in drawing.plants:  # of several blocks, or that a dead time acts on
        moves = any(TYPES[block.type].body for block in plant.members)
        types[plant.name] = "mass" if moves else "plant"
    drawn = _cut_at_ends(Loops(drawing, values).drawn(), types)
    names = [placed_block.block.name for placed_block in drawn.placed]
    places = [place for place, name in enumerate(names) if types[name] in WAVE_ENDS]
    ends = [names[place] for place in places]
    ticks = Ticks.of(drawn, tuple(f"{name}.in" for name in ends))
    running, *_ = drawn.schedule()  # the blocks that run in each kind of tick
    runs = [[end for end, place in enumerate(places) if place in blocks] for blocks in running]
    often = np.array([drawn.placed[place].runs(drawn.ticks).sum() for place in places])
    periods = drawn.ticks / often
    frame = np.asarray(np.real(drawn.period) * drawn.ticks)
    batch = np.broadcast_shapes(frame.shape, *(block.batch for block in ticks.maps))
    between = partial(_between, ticks, runs, periods, batch)
    every = np.ones(len(ends), bool)
    user = np.array([*map(types.get, ends)], str) == "wave"
    joined = False
    for side in (user, ~user):
        for E, _, _, D in between(side, side).maps:
            joined |= bool(np.any(E) | np.any(D))
    return WaveChannel(
        whole=between(every, every),
        outward=between(user, ~user),
        inward=between(~user, user),
        joined=joined,
        frame=np.broadcast_to(frame, batch),
    )


def _between(ticks, runs, periods, batch, senders, receivers):
    """The maps from the waves that some ends send to those that some ends receive, masks
    `(ends,)`, in units of their power."""
    maps = []
    for block, ends_of_run in zip(ticks.maps, runs, strict=True):
        sent = [end for end in ends_of_run if senders[end]]
        received = [end for end in ends_of_run if receivers[end]]
        of_sent = np.sqrt(periods[sent])
        of_received = np.sqrt(periods[received])[:, None]
        B = block.B[..., sent] / of_sent
        C = block.C[..., received, :] * of_received
        D = (block.D[..., received, :] * of_received)[..., sent] / of_sent
        maps.append((block.E, B, C, D))
    reachable = connected(maps)
    return TickMaps.of(
        [
            (E[..., reachable, :][..., reachable], B[..., reachable, :], C[..., reachable], D)
            for E, B, C, D in maps
        ],
        ticks.kind,
        batch,
    )


def _cut_at_ends(drawn: MultirateLoop, types) -> MultirateLoop:
    """The channel alone: ends only send waves, which are its inputs, and what comes from outside
    is zero."""
    unit = np.ones((1, 1))
    placed = []
    sums = {}
    inputs = []
    received = []
    for placed_block in drawn.placed:
        name = placed_block.block.name
        if types[name] in WAVE_ENDS:
            relay = Block(name, ("wave",), ("out",), (), unit[:0, :0], unit[:0], unit[:, :0], unit)
            placed.append(ScheduledBlock(relay, placed_block.every, placed_block.phase))
            sums[f"{name}.wave"] = {f"wave.{name}": 1.0}
            inputs.append(f"wave.{name}")
            received.append(f"{name}.in")
        elif types[name] != "mass":
            placed.append(placed_block)
    made = set()
    ports = []
    for block in (placed_block.block for placed_block in placed):
        made |= {f"{block.name}.{port}" for port in block.outputs}
        if types[block.name] not in WAVE_ENDS:
            ports += [f"{block.name}.{port}" for port in block.inputs]
    for port in (*ports, *received):
        sums[port] = {
            signal: gain for signal, gain in drawn.sums.get(port, {}).items() if signal in made
        }
    return MultirateLoop(drawn.period, tuple(placed), sums, tuple(inputs), rate=drawn.rate)


@dataclass(frozen=True, slots=True, eq=False)
class ChannelNorm:
    """Norms of the channel, arrays over the batch of the values.

    norm: of the whole. omega: frequency at which it is reached, rad/s, in [0, pi/T_s], up to
    multiples of 2 pi/T_s. outward, inward: norms of the direction to the environments and of the
    direction back; if no signal joins them within the ports, the norm is the larger one.
    outward_omega, inward_omega: their frequencies. certified: no frequency exceeds the norm by more
    than NORM_TOLERANCE, relative.
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
        """Whether the channel gives out no more energy than it takes in, to within NORM_TOLERANCE."""
        return self.norm <= 1 + NORM_TOLERANCE


def channel_norm(drawing: Drawing, values) -> ChannelNorm | None:
    """H-infinity norm of the lifted wave channel, every wave weighted by the root of its period;
    None without waves.

    values: numbers of the drawing, or arrays over a batch. Ports as in `channel_of`. The position
    feedback Kp, the wave impedance, the device and both walls are outside, so none of them matters,
    and neither do delays: they only turn phases. Not a grid: a level just above the value is shown
    to be met at no frequency (`hinf_norm`). Errors: UsageError for a matrix of more than
    MOST_ENTRIES. Accuracy: 1e-10 relative; the value is attained at `omega` to rounding.
    """
    channel = channel_of(drawing, values)
    if channel is None:
        return None
    return norm_of(channel)


def norm_of(channel: WaveChannel) -> ChannelNorm:
    """`channel_norm` of a channel."""
    channel.refuse_large()
    frame = channel.frame

    def norm_and_omega(peak):
        return np.sqrt(peak.value).reshape(frame.shape), peak.theta.reshape(frame.shape) / frame

    out = squared_norm(channel.outward)
    back = squared_norm(channel.inward)
    outward, outward_omega = norm_and_omega(out)
    inward, inward_omega = norm_and_omega(back)
    if channel.joined:
        whole = squared_norm(channel.whole)
        norm, omega = norm_and_omega(whole)
        certified = whole.certified
    else:
        norm = np.maximum(outward, inward)
        omega = np.where(outward >= inward, outward_omega, inward_omega)
        certified = out.certified & back.certified
    return ChannelNorm(
        norm=norm,
        omega=omega,
        outward=outward,
        outward_omega=outward_omega,
        inward=inward,
        inward_omega=inward_omega,
        certified=certified.reshape(frame.shape),
    )
