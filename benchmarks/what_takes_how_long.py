"""What takes how long: questions about loops and the processor time of each, as a table for docs/speed.md.

    OPENBLAS_NUM_THREADS=1 python benchmarks/what_takes_how_long.py

A question is asked once, of a loop that no call has seen, after calls of another loop have loaded what is needed. Times are
those of this process, which has no workers.
"""

import time
from collections.abc import Callable
from pathlib import Path

import wavesweep
from wavesweep.program.platform_compat import keep_memory

TEMPLATES = Path(__file__).parents[1] / "sweeps" / "templates"
WALLS = {"sweep": {"K_VE": {"start": 0, "stop": 5000}, "B_VE": {"start": 0, "stop": 10, "num": 41}}}
ENGINE = {"device": {"velocity": "difference"}, "environment": {"integration": "explicit", "delay": "frame"}}
PMW = {"controller": {"kind": "pmw", "b": 25.0}, **ENGINE}
EVEN, UNEVEN = {"rates": {"slow_hz": 50.0}}, {"rates": {"slow_hz": 60.0}}
LISTS = {"device.mass": [0.09, 0.11], "device.damping": [1.2, 1.8]}
RANGES = {name: {"start": low, "stop": high} for name, (low, high) in LISTS.items()}
FRAMES = {"rates.ratio": {"values": [17, 34], "varying": True}}
WISHED = {
    "vary": {"b": {"start": 5, "stop": 100}, "filters.lp1.cutoff_hz": {"start": 2, "stop": 20}},
    "wish": {"z_width": {}, "channel": {}},
}
ONE_WALL = {"sweep": {"K_VE": {"start": 0, "stop": 5000}, "B_VE": [1.0]}}
MASSES = {"sweep": {"along": "device.mass", "device.mass": {"start": 0.05, "stop": 0.5}, "B_VE": [1.0]}}


def late(ticks: int) -> dict:
    """A mass whose spring reads it so many ticks late."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"k": 1.0},
        "block": {"arm": {"type": "mass", "mass": 1.0, "damping": 5.0}, "net": {"type": "delay", "steps": ticks}},
        "wire": {"net.u": "arm.x", "arm.f": "-k*net.y"},
        "sweep": {"along": "k", "k": {"start": 0, "stop": 100}},
    }


def drive(command: Callable, *given: object) -> Callable:
    """A question of the servo drive of the templates."""
    return lambda: command(wavesweep.compile(TEMPLATES / "drive.toml"), *given)


def pmw(command: Callable, *tables: dict, **options: object) -> Callable:
    """A question of waves with filters, in an engine as it usually is."""
    return lambda: command(PMW | {key: value for table in tables for key, value in table.items()}, **options)


VARYING = {"rates": {"ratio": 17}, "for_all": FRAMES}
VARYING_WALL = VARYING | {"environment": ENGINE["environment"] | {"K_VE": 100.0}, "for_all": FRAMES | RANGES}
HAPTIC, DRIVE = "`pmw`, 50 Hz under 1 kHz", "servo drive, 4 states"
QUESTIONS: tuple[tuple[str, str, Callable], ...] = (
    ("What is stable, and how far may each number go? `check`", DRIVE, lambda: wavesweep.verdict(TEMPLATES / "drive.toml")),
    ("All modes: `poles`", DRIVE, drive(lambda loop: loop.poles())),
    ("Gain, phase and delay margins: `margins`", DRIVE, drive(lambda loop: loop.margins("control.y"))),
    ("200 frequencies: `bode`", HAPTIC, pmw(wavesweep.bode, EVEN)),
    ("All stable walls, 41 values of `B_VE`: `zwidth`", HAPTIC, pmw(wavesweep.zwidth, EVEN, WALLS)),
    ("The same", "60 Hz, which does not divide 1 kHz", pmw(wavesweep.zwidth, UNEVEN, WALLS)),
    ("Along a mass: `stability-region`", HAPTIC, pmw(wavesweep.stability_region, EVEN, MASSES)),
    ("Along a gain: `stability-region`", "a delay of 20 ticks", lambda: wavesweep.stability_region(late(20))),
    ("The same", "a delay of 100 ticks", lambda: wavesweep.stability_region(late(100))),
    ("The same", "a delay of 400 ticks", lambda: wavesweep.stability_region(late(400))),
    ("What sets a limit: `why`", HAPTIC, pmw(wavesweep.why, EVEN, WALLS)),
    (
        "For every passive hand, one slice: `--for-hands passive`",
        HAPTIC,
        pmw(wavesweep.zwidth, EVEN, ONE_WALL, for_hands="passive"),
    ),
    ("For two masses and two dampings in `[for_all]`", HAPTIC, pmw(wavesweep.zwidth, EVEN, ONE_WALL, {"for_all": LISTS})),
    ("For ranges of mass and damping between them", HAPTIC, pmw(wavesweep.zwidth, EVEN, ONE_WALL, {"for_all": RANGES})),
    ("For frames of 17 and 34 ticks in any order, one slice", "`pmw`", pmw(wavesweep.zwidth, ONE_WALL, VARYING)),
    ("The same and two masses and dampings", "`pmw`", pmw(wavesweep.zwidth, ONE_WALL, VARYING, {"for_all": FRAMES | LISTS})),
    ("One wall, for these frames and ranges of both: `check`", "`pmw`", lambda: wavesweep.verdict(PMW | VARYING_WALL)),
    ("80 generations of 96 designs: `design`", HAPTIC, pmw(wavesweep.design, EVEN, ONE_WALL, {"design": WISHED}, jobs=1)),
)


def main() -> None:
    """Measure and print."""
    keep_memory()  # as commands do
    load_all()
    print("| question | loop | processor time |\n| --- | --- | --- |")
    for question, loop, ask in QUESTIONS:
        started = time.process_time()
        ask()
        print(f"| {question} | {loop} | {in_words(time.process_time() - started)} |", flush=True)


def load_all() -> None:
    """Ask each kind of question about a small loop, which loads what is needed."""
    small = {"controller": {"kind": "dc-slow"}, "rates": {"ratio": 2}, "device": {"velocity": "difference"}}
    swept = small | {"sweep": {"K_VE": {"start": 0, "stop": 100}, "B_VE": [1.0]}}
    loop = wavesweep.compile(small)
    wavesweep.verdict(small)
    loop.poles()
    loop.margins("wall.y")
    wavesweep.bode(small | {"bode": {"frequency_hz": [1.0]}})
    wavesweep.why(swept)
    wavesweep.zwidth(swept, for_hands="passive")
    wavesweep.zwidth(swept | {"for_all": {"device.mass": [0.1, 0.101]}})


def in_words(seconds: float) -> str:
    """Seconds with two digits, in the unit that suits them."""
    return (
        f"{1e3 * seconds:.2g} ms" if seconds < 0.0995 else f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds / 60:.2g} min"
    )


if __name__ == "__main__":
    main()
