"""What may be wished for of a design: the norm of the wave channel, and the passivity margin at
the hand's port."""


def channel(loops, size: int) -> tuple:
    """The norm of the wave channel of each loop, 0 without waves, and whether it is certified,
    `(size,)` both."""
    import numpy as np

    from wavesweep.haptics.controller_page import loop_drawing
    from wavesweep.passive.channel import channel_norm

    norm = channel_norm(loop_drawing(loops.values), loops.values)
    if norm is None:
        return (np.zeros(size), np.ones(size, bool))
    return (norm.norm, norm.certified)


def port(loops, size: int) -> tuple:
    """The passivity margin at the hand's port of each loop (m/N), missing if it is unstable, and
    whether it is certified.

    The map of an unstable loop may have a positive real part on the whole circle.
    """
    import numpy as np

    from wavesweep.haptics.held_loop import held_loop
    from wavesweep.passive.margin import port_margin

    del size
    margin = port_margin(held_loop(loops))
    return np.where(margin.stable, margin.margin, np.nan), margin.certified


WISHES = {
    "channel": {
        "unit": "1",
        "more": False,
        "title": "norm of the wave channel",
        "description": "norm of the wave channel",
        "reads": ("filters.", "rates."),
        "measure": channel,
    },
    "port": {
        "unit": "m/N",
        "more": True,
        "title": "margin of the hand's port",
        "description": "passivity margin of the hand's port of stable loops",
        "ports": ("hand",),
        "measure": port,
    },
}
