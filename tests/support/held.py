"""Controllers of flat values as loops that a hand holds, and what the package says of them."""

import numpy as np

import wavesweep
from support import every_hand
from support.specs import nested
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct, selected
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.haptics.controllers import HAND
from wavesweep.haptics.held_loop import HeldLoop

WALL = "environment.K_VE"
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


def damping_needed(values):
    return every_hand.damping_needed(held(values))


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
