"""Controllers of flat values as loops that a hand holds, and what the package says of them."""

from functools import partial

import numpy as np

from wavesweep import passive as passivity
from wavesweep.loops.controllers import loop_drawing
from wavesweep.passive import HeldLoop, hand, hand_box
from wavesweep.sweep.hands import stable_of

WALL = "environment.K_VE"


def held(values, along=""):
    """The loop of flat values, numbers or arrays; along: a number that is varied beside them."""
    drawing = loop_drawing(values, (along,))
    return HeldLoop(drawing, {path: value for path, value in values.items() if path in drawing.reads})


def port_margin(values):
    return passivity.port_margin(held(values))


def more_damping(values):
    return passivity.more_damping(held(values))


def damping_needed(values):
    return passivity.damping_needed(held(values))


def channel_norm(values):
    return passivity.channel_norm(loop_drawing(values), values)


def any_hand_walls(values, span, hand_damping=0.0, path=WALL):
    return passivity.any_hand_walls(held(values, path), span, path, hand_damping)


def port_passive_walls(values, span, path=WALL):
    return passivity.port_passive_walls(held(values, path), span, path)


def worst_modes(values, hands, K_VE, B_VE):
    walls = (np.broadcast_to(np.asarray(wall, float), (len(hands),)) for wall in (K_VE, B_VE))
    return hand.worst_modes(held(values), hands, dict(zip((WALL, "environment.B_VE"), walls, strict=True)))


def box_intervals(values, span, box):
    return hand_box.box_intervals(held(values), partial(stable_of, WALL, span), WALL, span, box)


def prove(values, box, walls, **work):
    return hand_box.prove(held(values), WALL, box, walls, **work)
