"""The options that commands share: each is defined once and means one thing everywhere."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from wavesweep.sweep.guarantees import Holders

STDOUT = "-"
_RANGE = re.compile(r"\s*(mass|damping|stiffness)\s*=\s*([^.\s]\S*?)\s*\.\.\s*(\S+)\s*")


@dataclass(frozen=True)
class Options:
    """What the shared options were set to."""

    out: str | None
    overrides: tuple[str, ...]
    jobs: int
    backend: str | None
    scheduler: str | None
    plot: bool
    force: bool
    quiet: bool
    debug: bool

    @property
    def to_stdout(self) -> bool:
        """Whether the table goes to stdout and nothing to files."""
        return self.out == STDOUT


override = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Override a key of the spec, e.g. controller.b=40, or b=40. May be repeated.",
)
quiet = click.option("--quiet", is_flag=True, help="Say nothing but errors.")
# Read by the entry, before any command runs; declared here so that it stands in each help.
debug = click.option("--debug", is_flag=True, help="Show a traceback when something fails.")

_COMMON = (
    click.option(
        "--out",
        metavar="DIR",
        help="Folder for the results [default: results/<spec's name>]; - writes the CSV to stdout.",
    ),
    override,
    click.option(
        "--jobs",
        metavar="N",
        type=click.IntRange(min=1),
        default=2,
        show_default=True,
        help="Worker processes, for work that is worth them.",
    ),
    click.option("--backend", metavar="NAME", help="Any joblib backend: loky, threading, dask, ray, ..."),
    click.option("--scheduler", metavar="ADDRESS", help="Address of the dask scheduler, with --backend dask."),
    click.option("--plot/--no-plot", default=True, show_default=True, help="Draw the figure."),
    click.option("--force", is_flag=True, help="Replace results of another spec."),
    quiet,
    debug,
)


def common(body: Callable[..., None]) -> Callable[..., None]:
    """Give a command the common options; its body receives them together as `options`."""

    @wraps(body)
    def gathered(**given: Any) -> None:
        options = Options(**{field.name: given.pop(field.name) for field in fields(Options)})
        if options.scheduler is not None and options.backend != "dask":
            raise click.UsageError(f"--scheduler needs --backend dask, found --backend {options.backend}")
        body(options=options, **given)

    for option in reversed(_COMMON):
        gathered = option(gathered)
    return gathered


_HANDS = (
    click.option(
        "--hand",
        type=click.Choice(["free", "passive", "box"]),
        default="free",
        show_default=True,
        help=(
            "Whose hand holds the device. passive: add what is guaranteed for every passive hand, of any mass and "
            "stiffness, also one that moves within a tick; the damping of the device has to pay for it, and waves without "
            "Kp never get there. box: add what is stable for every hand of a box; settled says 1 where that is proved, but "
            "for a thousandth of the interval at its ends, 0 where it is only searched. "
            "What is not certified has certified 0."
        ),
    ),
    click.option(
        "--hand-box",
        "hand_box",
        metavar="RANGES",
        help=(
            "With --hand box, e.g. mass=0.1..0.4,damping=2..5 (kg, N*s/m; stiffness in N/m). What is not named: "
            "mass 0.005..0.6, damping 2..10, stiffness 100..1000, from a fingertip to an arm."
        ),
    ),
    click.option(
        "--passive",
        is_flag=True,
        help="Add where the hand's port is passive for forces held over a tick. Takes tenths of a second per slice.",
    ),
)


def hands(body: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options; its body receives them together as `holders`, None where the free device is all."""

    @wraps(body)
    def gathered(hand: str, hand_box: str | None, passive: bool, **given: Any) -> None:
        body(holders=_holders(hand, hand_box, passive), **given)

    for option in reversed(_HANDS):
        gathered = option(gathered)
    return gathered


def _holders(hand: str, hand_box: str | None, passive: bool) -> Holders | None:
    if hand_box is not None and hand != "box":
        raise click.UsageError(f"--hand-box needs --hand box, found --hand {hand}")
    ranges = _ranges(hand_box) if hand_box is not None else {}
    if hand == "free" and not passive:
        return None
    from wavesweep.sweep import holders_of

    return holders_of(hand, ranges, passive)


def _ranges(text: str) -> dict[str, tuple[float, float]]:
    """Read `mass=0.1..0.5,damping=1..2`; a part that is not named keeps its default."""
    found: dict[str, tuple[float, float]] = {}
    for part in text.split(","):
        matched = _RANGE.fullmatch(part)
        try:
            name, low, high = matched.groups() if matched else ("", "", "")
            found[name] = (float(low), float(high))
        except ValueError:
            raise click.BadParameter(
                f"expected ranges such as mass=0.1..0.5 (mass, damping, stiffness), found {part.strip()!r}",
                param_hint="--hand-box",
            ) from None
    return found
