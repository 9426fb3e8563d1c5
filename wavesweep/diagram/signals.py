"""What every controller's drawing has in common."""

from wavesweep.diagram.arrays import numbers


def hand(values) -> dict:
    """The tick and the hand, as keywords that a `Diagram` takes."""
    return {
        "period": 1 / numbers(values["rates.fast_hz"]),
        "rate": values["rates.fast_hz"],
    }


def rates(values) -> dict:
    """The frame and the slow environment's delay in it, as keywords that a `Diagram` takes."""
    return {"ratio": values["rates.ratio"], "delay": values["environment.delay"]}
