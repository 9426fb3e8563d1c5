"""Frames of loops by hand, without a spec's [for_all]."""

from wavesweep.for_all.frame_families import IN_PHASE, RATIO, FramesInAnyOrder, SlowFrames, drawing_of_controller, plan_of


def plan_of_controller(values, frames, gains=()):
    """What the frames of a built-in controller consist of; values: all keys, of which the ratio is the nominal length."""
    drawing = drawing_of_controller(values, gains)
    return plan_of(drawing, values, frames, SlowFrames.of(drawing, values, RATIO, frames.lengths))


def frames_of_controller(values, frames, number="environment.K_VE"):
    """Its frames along one of its keys."""
    return plan_of_controller(values, frames, (number,)).along(number)


def frames_of_drawing(drawing, values, lengths, number, *, elapsed=True):
    """The frames of a drawn loop whose slow blocks have one `every`, the nominal length."""
    return plan_of(drawing, values, FramesInAnyOrder(lengths, IN_PHASE, 0, elapsed), SlowFrames.of(drawing, values)).along(
        number
    )
