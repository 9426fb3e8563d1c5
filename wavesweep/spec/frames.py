"""The frames of a simulation, `frames` in [simulate]: each a number of ticks, or a table of ticks, delay and lost."""

from dataclasses import dataclass

from wavesweep.errors import Mistake
from wavesweep.spec.checking import Rejected, check, nearest, show
from wavesweep.spec.keys import HIGHEST_RATIO, LONGEST_FRAME, Key
from wavesweep.spec.reading import Leaf

FRAMES = "simulate.frames"
PARTS = {
    "ticks": Key("ticks", "integer", None, "tick", "fast ticks in the frame", low=1, high=HIGHEST_RATIO),
    "delay": Key("delay", "integer", None, "tick", "fast ticks until its slow result is in place", low=0, high=HIGHEST_RATIO),
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


def build_frames(leaf: Leaf) -> tuple[tuple[Frame, ...] | None, list[Mistake]]:
    """Return the frames of a list, or None and its mistakes."""
    if not isinstance(leaf.value, list) or not leaf.value:
        return None, [leaf.mistake(FRAMES, "a list of frames, each a whole number of ticks", show(leaf.value))]
    frames, mistakes = [], []
    for index, item in enumerate(leaf.value):
        frame, wrong = _frame(f"{FRAMES}[{index}]", item, leaf)
        frames.append(frame)
        mistakes += wrong
    if not mistakes and sum(each.ticks for each in frames) > LONGEST_FRAME:
        mistakes = [leaf.mistake(FRAMES, f"at most {LONGEST_FRAME} ticks in all", str(sum(each.ticks for each in frames)))]
    return (None if mistakes else tuple(frames)), mistakes


def _frame(label, item, leaf):
    """The frame of an item of the list, None with its mistakes."""
    parts = item if isinstance(item, dict) else {"ticks": item}
    found, mistakes = {}, []
    for name, value in parts.items():
        place = f"{label}.{name}" if parts is item else label
        if name not in PARTS:
            mistakes.append(leaf.mistake(place, f"one of {', '.join(PARTS)}", "an unknown key", nearest(name, PARTS)))
            continue
        try:
            found[name] = check(PARTS[name], value)
        except Rejected as error:
            mistakes.append(leaf.mistake(place, error.expected, error.found, error.suggestion))
    if "ticks" not in parts:
        mistakes.append(leaf.mistake(label, "the ticks of the frame", "none"))
    if not mistakes and found.get("delay", 0) > found["ticks"]:
        expected = f"a whole number <= {found['ticks']}, the ticks of the frame"
        mistakes.append(leaf.mistake(f"{label}.delay", expected, show(found["delay"])))
    return (None, mistakes) if mistakes else (Frame(**found), [])
