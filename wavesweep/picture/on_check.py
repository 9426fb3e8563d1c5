"""What `check` says of time: the age of the oldest number that a force is made of."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from wavesweep.picture.moments import Moments, in_words, moments
from wavesweep.program.spec import Spec


def facts(
    spec: Spec, _own: Mapping[str, Any], _report: Callable[[int, int], None] | None
) -> dict[str, Any]:
    """age: of the oldest number, None if no number acts on a plant: its age (s) when the next one
    takes its place, its block, the port that it acts on, after how long (s) it is in place, and the
    same of the freshest one, see `moments`.
    """
    frames = moments(spec)
    oldest = _facts_of(frames[-1])
    if oldest and len(frames) > 1:
        oldest["freshest"] = _facts_of(frames[0])
    return {"age": oldest}


def _facts_of(frames: Moments) -> dict[str, Any] | None:
    if frames.main is None or frames.shown is None or frames.age is None:
        return None
    return {
        "which": frames.which,
        "oldest_s": frames.age * frames.tick_s,
        "in_place_after_s": (frames.shown.start - frames.shown.measured) * frames.tick_s,
        "block": frames.main.block,
        "port": frames.main.port,
        "bounded": not frames.loses,
    }


def lines(spec: Spec, _found: Mapping[str, Any]) -> Iterator[tuple[float, str | Callable[[], str]]]:
    """Yield the line about the age."""
    if said := in_words(moments(spec), "" if spec.drawing else "the force"):
        yield 1.4, f"age: {said}"  # rank among the lines that are always shown
