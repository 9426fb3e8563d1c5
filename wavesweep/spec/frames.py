"""The frames of a simulation, `frames` in [simulate]: each a number of ticks, or a table of ticks, delay and lost."""

from dataclasses import dataclass

from wavesweep.spec.checking import Mistakes, show
from wavesweep.spec.keys import HIGHEST_RATIO, LONGEST_FRAME, Key, whole
from wavesweep.spec.reading import Leaf

FRAMES = "simulate.frames"
PARTS = {
    "ticks": whole("ticks", None, "fast ticks in the frame", 1, HIGHEST_RATIO, "tick"),
    "delay": whole("delay", None, "fast ticks until its slow result is in place", 0, HIGHEST_RATIO, "tick"),
    "lost": Key("lost", "boolean", False, "", "whether its slow result never comes; the last one is held"),
}


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame: its ticks, the delay of its slow result (None: that of the loop), and whether this never comes."""

    ticks: int
    delay: int | None = None
    lost: bool = False

    def written(self) -> int | dict[str, int | bool]:
        """Return the frame as a spec could give it."""
        more = {"delay": self.delay} if self.delay is not None else {}
        more |= {"lost": True} if self.lost else {}
        return {"ticks": self.ticks, **more} if more else self.ticks


def build_frames(leaf: Leaf, mistakes: Mistakes) -> tuple[Frame, ...] | None:
    """Return the frames of a list, or None and add its mistakes."""
    if not isinstance(leaf.value, list) or not leaf.value:
        expected = "a list of frames, each a whole number of ticks"
        return mistakes.refuse(leaf, FRAMES, expected, show(leaf.value), of_key=False)
    frames, before = [], len(mistakes)
    for index, item in enumerate(leaf.value):
        path, count = f"{FRAMES}[{index}]", len(mistakes)
        if isinstance(item, dict):
            parts = mistakes.read(PARTS, {name: Leaf(value, leaf.place) for name, value in item.items()}, path)
            if "ticks" not in item:
                mistakes.refuse(leaf, path, "the ticks of the frame", "none", of_key=False)
        else:
            parts = {"ticks": mistakes.check(PARTS["ticks"], Leaf(item, leaf.place), path)}
        if len(mistakes) > count:
            continue
        frames.append(Frame(**parts))
        if parts.get("delay", 0) > parts["ticks"]:
            expected = f"a whole number <= {parts['ticks']}, the ticks of the frame"
            mistakes.refuse(leaf, f"{path}.delay", expected, show(parts["delay"]), of_key=False)
    ticks = sum(frame.ticks for frame in frames)
    if len(mistakes) == before and ticks > LONGEST_FRAME:
        mistakes.refuse(leaf, FRAMES, f"at most {LONGEST_FRAME} ticks in all", str(ticks), of_key=False)
    return tuple(frames) if len(mistakes) == before else None
