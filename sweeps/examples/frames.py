"""Make `frames.csv`: time stamps of 1200 frames of an engine, whose slow frames come in a row, and one of which stalls.

python sweeps/examples/frames.py > sweeps/examples/frames.csv
python sweeps/examples/frames.py misses > sweeps/examples/misses.csv, 300 frames of an engine that misses one or two at times
"""

import random
import sys

FRAMES, STALL = 1200, (900, 41)  # frames; the number of one, and its length in ms
NEXT = {
    16: (70, 24, 4, 2),
    20: (12, 80, 6, 2),
    25: (5, 35, 45, 15),
    33: (5, 45, 30, 20),
}  # chances of the next length, in per cent
MISSES = dict.fromkeys((17, 34, 51), (88, 10, 2))  # the same of an engine that waits for the next frame of a display


def rows(chances=NEXT, frames=FRAMES, stall=STALL):
    """Yield the time (s) at which each frame begins, and at last the end, as texts."""
    numbers, length, time = random.Random(1), min(chances), 0  # noqa: S311 - nothing here is secret
    yield "time"
    yield f"{time / 1000:.3f}"
    for frame in range(frames):
        (length,) = numbers.choices(list(chances), chances[length])
        time += stall[1] if frame == stall[0] else length
        yield f"{time / 1000:.3f}"


if __name__ == "__main__":
    print("\n".join(rows(MISSES, 300, (-1, 0)) if "misses" in sys.argv else rows()))  # noqa: T201 - the file
