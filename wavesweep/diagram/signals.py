"""What every controller's drawing has in common."""

import numpy as np


def hand(values) -> dict:
    """The tick and the hand, as keywords that a `Diagram` takes."""
    return {
        "period": 1 / np.asarray(values["rates.fast_hz"], float),
        "held_by_spring": bool(np.any(values["operator.stiffness"])),
    }


def rates(values) -> dict:
    """The frame and the slow environment's delay in it, as keywords that a `Diagram` takes."""
    return {"ratio": values["rates.ratio"], "delay": values["environment.delay"]}
