"""What `margins` asks of [for_all]: all loops of a box, and the maps that prove that they are stable."""

from wavesweep.for_all.asked_ranges import values_of_range
from wavesweep.for_all.guardian_maps import GuardianMaps, of_complex_frames
from wavesweep.for_all.rows import numbers_in_words, refuse_unsuitable_ranges
from wavesweep.for_all.unknown import drift_over, frames_over
from wavesweep.program.spec import Spec

__all__ = ["GuardianMaps", "drift_over", "frames_over", "numbers_in_words", "of_complex_frames", "values_of_range", "varying"]


def varying(spec: Spec) -> list[str]:
    """What varies from frame to frame, or from message to message.

    Errors: UsageError for too many numbers if nothing does.
    """
    found = [axis.name for axis in spec.for_all.changing]
    found += ["lost"] * bool(spec.for_all.lost or spec.for_all.loss) + ["messages"] * bool(
        spec.drawing and spec.drawing.channels
    )
    if not found:
        refuse_unsuitable_ranges(spec, "")
    return found
