"""What every controller's drawing has in common."""

import numpy as np


def common(values) -> dict:
    """Rates and the hand, as the keywords that a `Diagram` takes."""
    return {
        "period": 1 / np.asarray(values["rates.fast_hz"], float),
        "ratio": values["rates.ratio"],
        "delay": values["environment.delay"],
        "held_by_spring": bool(np.any(values["operator.stiffness"])),
    }
