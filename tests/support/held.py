"""Controllers of flat values as loops that a hand holds, and what the package says of them."""

from dataclasses import dataclass

import numpy as np

import wavesweep
from support.specs import nested
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import LiftedMap, damping_peak
from wavesweep.engine.poles import is_stable
from wavesweep.engine.rows import distinct, selected
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.held_loop import HeldLoop
from wavesweep.passive.over_ranges import reaction, settled

WALL = "environment.K_VE"
LOWEST = 1e-3  # rad per frame; loops that do not settle are examined from here on
THETA = np.concatenate([np.geomspace(1e-5, 1, 90), np.linspace(0.03, np.pi, 90)])  # rad per frame


def held(values, along=""):
    """The loop of flat values, numbers or arrays; along: a number that is varied beside them."""
    drawing = loop_drawing(values, (along,))
    return HeldLoop(drawing, {path: value for path, value in values.items() if path in drawing.reads})


def port_margin(values):
    from wavesweep.passive import margin

    return margin.port_margin(held(values))


def more_damping(values):
    from wavesweep.passive import margin

    return margin.more_damping(held(values))


@dataclass(frozen=True, slots=True, eq=False)
class DampingNeeded:
    """Arrays over the batch of the loops.

    damping: d* (N*s/m), of device and hand together; infinite if none is enough. omega: the
    frequency that needs it, rad/s, in [0, pi/T_s]. responsive: whether the controller, its position prescribed, is
    stable; else no damping is enough. certified: whether no frequency needs more, see `damping_peak`.
    """

    damping: np.ndarray
    omega: np.ndarray
    responsive: np.ndarray
    certified: np.ndarray


def damping_needed(values) -> DampingNeeded | None:
    """Least damping d* of device and hand with which the loop is stable whatever else, passive, the hand is.

    None if nothing bounds it, see `wavesweep.passive.over_ranges.reaction_maps`, whose map is C in `d* = -T min lambda(He C)`.
    The least eigenvalue is searched for over the whole circle.
    """
    loop = held(values)
    if loop.device is None or loop.reads_velocity:
        return None
    drawn = loop.drawn()
    batch = loop.batch
    ticks, x = reaction(loop, drawn, batch)
    lifted = ticks.lifted()
    responsive = _is_responsive(lifted, x)
    apart = settled(lifted, x)
    chosen = {}
    for name in LiftedMap.__slots__:
        settles = responsive[:, None, None]
        chosen[name] = np.where(settles, getattr(apart, name), getattr(lifted, name))
    lifted = LiftedMap(**chosen)
    M = ticks.kind.size
    period = np.broadcast_to(np.real(drawn.period), batch).reshape(-1)
    peak = damping_peak(ticks, lifted, period, np.where(responsive, 0.0, LOWEST))
    finite = np.isfinite(peak.value)
    needed = np.where((responsive | (M == 1)) & finite, peak.value, np.inf)
    return DampingNeeded(
        needed.reshape(batch),
        (peak.theta / (period * M)).reshape(batch),
        (responsive & finite).reshape(batch),
        (peak.certified & finite).reshape(batch),
    )


def _is_responsive(lifted: LiftedMap, x) -> np.ndarray:
    """Whether the states other than the position x settle, `(loops,)`."""
    rest = np.setdiff1d(np.arange(lifted.E.shape[-1]), x)
    if not rest.size:
        return np.isfinite(lifted.E).all((-1, -2))
    return is_stable(lifted.E[:, rest][..., rest])


def channel_norm(values):
    from wavesweep.passive import channel

    return channel.channel_norm(loop_drawing(values), values)


def any_hand_walls(values, span, path=WALL):
    from wavesweep.passive.port_ranges import hand_ranges

    return hand_ranges(held(values, path), path, span)


def passive_walls(values, span, path=WALL):
    from wavesweep.passive.port_ranges import port_ranges

    return port_ranges(held(values, path), path, span)


def scan(values, theta=THETA):
    """Smallest eigenvalue at each angle, from the lifted system with every tick's force an input."""
    G = over_frame(values, theta)
    return np.linalg.eigvalsh((G + np.swapaxes(G.conj(), -1, -2)) / 2)[:, 0]


def over_frame(values, theta):
    """The map from the forces of a frame to its displacements, by python-control; the frame of `dc` is one tick."""
    tables = nested(values | {"rates.ratio": 1, "environment.delay": 0} if values["controller.kind"] == "dc" else values)
    return np.moveaxis(wavesweep.compile(tables).to_control("displacement")(np.exp(1j * theta), squeeze=False), -1, 0)


def ends_of(box):
    """The low and the high ends of a box of hands, `(2, 3)`."""
    return np.array(list(box.ranges().values())).T


def hands_at(low, high, shares):
    """Hands of a box with these ends at shares of its ranges, `(n, 3)`: evenly in the logarithm, from 0 on in the cube root."""
    low, high = np.array([low, high])
    start = np.where(low > 0, low, 1.0)
    return np.clip(np.where(low > 0, start * (high / start) ** shares, high * shares**3), low, high)


def worst_modes(values, hands, K_VE, B_VE):
    """Spectral radius and least damping ratio of the loop with each hand `(n, 3)` and wall, `(n,)` each, drift aside."""
    loop, size = held(values).with_hand(), len(hands)
    numbers = dict(zip((*HAND, WALL, "environment.B_VE"), (*np.asarray(hands, float).T, K_VE, B_VE), strict=True))
    numbers = {path: np.ascontiguousarray(np.broadcast_to(each, (size,)), float) for path, each in numbers.items()}
    radius, damping = np.empty(size), np.empty(size)
    for some in distinct([each == 0 for each in numbers.values()], size):
        own = Loops(loop.drawing, loop.values | selected(numbers, some))
        with np.errstate(all="ignore"):
            E = own.frames(own.drift())
            E = np.broadcast_to(E, (some.size, *E.shape[-2:]))
            finite = np.isfinite(E).all((-1, -2))
            log = np.log(1 + np.linalg.eigvals(np.where(finite[:, None, None], E, 0.0)).astype(complex) + 1e-300)
        radius[some] = np.where(finite, np.exp(log.real.max(-1)), np.inf)
        damping[some] = np.where(finite, (-log.real / np.maximum(np.abs(log), 1e-300)).min(-1), -1.0)
    return radius, damping


def box_intervals(values, span, box):
    """The rows for a box of hands, as records."""
    from wavesweep.for_all.hand_box import BoxGuarantee

    return BoxGuarantee(box).records_of(held(values), WALL, span)
