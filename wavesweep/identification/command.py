"""`wavesweep identify`."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from wavesweep.capabilities import offered
from wavesweep.engine.errors import UsageError
from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.options import PATH, Number, is_given, overwriting

OWN = "as wavesweep identify found"  # in the first line of each spec of this command
# options that frames take
OF_FRAMES = ("fast_hz", "spec", "every", "columns", "scales", "overwrite", "plot")


@click.command("identify")
@click.argument("log", required=False, type=PATH)
@click.option(
    "--frames",
    metavar="TIMES",
    help="In place of a log: a CSV file of the frames of a slow environment, with a column time (s), the stamp of each, or "
    "duration (s), or one of a program whose files are known, or what perf script prints. The lengths that occur, how often, and "
    "which follow which; and [for_all] with them.",
)
@click.option(
    "--fast-hz",
    type=Number(min=0, min_open=True),
    metavar="HZ",
    help="Of frames: the rate of the fast loop's ticks.",
)
@click.option(
    "--spec",
    metavar="SPEC",
    help="Of frames: the spec that has this rate, and the number that is their length.",
)
@click.option(
    "--every",
    type=click.IntRange(min=1),
    metavar="TICKS",
    help="Of frames: the loop looks for a result in every so many ticks, so that lengths are multiples of them [default: 1, or "
    "the least number with which [for_all] takes all lengths].",
)
@click.option(
    "--resolution",
    type=Number(min=0),
    metavar="STEP",
    help="Step of the encoder in m (or rad) [default: that which the readings show]. With 0 there is none.",
)
@click.option("--spring", is_flag=True, help="Fit a spring as well.")
@click.option("--friction", is_flag=True, help="Fit Coulomb friction as well.")
@click.option(
    "--axes",
    metavar="X,Y,Z",
    help="Fit a device of the axes x,y or x,y,z: the log has the position x and the force fx of each, or columns that --column "
    "gives with commas, as position=q1,q2.",
)
@click.option(
    "--two-masses",
    "--lcl",
    "two_masses",
    is_flag=True,
    help="Fit two masses on a spring, as of a drive with a flexible coupling: the log is of the first, which the force moves. "
    "Of a voltage and a current: fit an LCL filter, whose other side has a voltage that does not change.",
)
@click.option(
    "--delay",
    type=Number(min=0),
    metavar="TICKS",
    help="Hold the delay of the force at this number, and do not fit it.",
)
@click.option(
    "--rate",
    "rate_hz",
    type=Number(min=0, min_open=True),
    metavar="HZ",
    help="Of a frequency response: the rate at which its force was held [default: an analogue force].",
)
@click.option(
    "--motor-constant",
    metavar="LOW..HIGH",
    help="Of a log with a current (A): the force or torque per ampere (N/A or N*m/A), a number or bounds, to which mass, "
    "damping and more are proportional.",
)
@click.option(
    "--column",
    "columns",
    multiple=True,
    metavar="NAME=COLUMN",
    help="Which column of the log is time, force, position (or torque, current, velocity, acceleration, angle, speed, "
    "angular_acceleration; voltage, charge), e.g. position=enc; of frames also the value that rows have, e.g. event=done. May be repeated.",
)
@click.option(
    "--scale",
    "scales",
    multiple=True,
    metavar="NAME=FACTOR",
    help="Factor from the numbers of a column to s, N and m (or N*m and rad), e.g. position=2e-5. May be repeated.",
)
@click.option(
    "--out",
    metavar="FILE",
    type=PATH,
    help="The spec to write [default: results/<log's name>/device.toml]. An earlier one is replaced.",
)
@overwriting("Replace a spec, or results, that are not of the same log.")
@click.option(
    "--plot/--no-plot", default=True, show_default=True, help="Draw the figure, or leave it out."
)
def identify(
    log: str | None, out: str | None, motor_constant: str | None, frames: str | None, **options: Any
) -> None:
    """Fit mass, damping, friction and delay to a log of force and position, with intervals, and write a spec.

    LOG is a CSV file with the columns time (s), force (N) and position (m), a sample a row, equally
    spaced. In place of the force there may be a current (A), in place of the position a velocity or
    an acceleration; of a device that turns torque (N*m), angle, speed (rad/s) or
    angular_acceleration. A force is held to the next row. The numbers are those of the sampled
    model, with intervals of 95 % that know of the encoder's rounding; and the summary says whether
    the model explains the log or, if it does not, what is missing.

    A CSV file with the columns frequency_hz, admittance_abs and admittance_deg (or _re and _im),
    and maybe coherence, is a frequency response (m/N), to which mass, damping, spring and delay are
    fitted. Its force is analogue; with --rate it was held over ticks. mobility_abs, ... (m/s/N) and
    accelerance_abs, ... (m/s^2/N) are responses of the velocity and of the acceleration.

    With --two-masses the device is a motor with a load on a spring; mass, damping, position and
    velocity are the motor's. A log of a voltage (V) and the current (A) that it drives has
    inductance and resistance of a coil; with --lcl it has those of an LCL filter, and its capacitance.

    With --axes x,y,z the device has several axes: a mass matrix, a damping matrix and maybe friction
    of each are fitted, and the spec has them before a flat wall of any direction.

    With --frames nothing of a device is read: the table is identify-frames, and the spec,
    frames.toml, has [for_all] alone.

    The spec has the device, and the intervals in [for_all], so that every other command answers for
    all of them. The table identify, with its figure, goes to results/<log's name>: measured and
    fitted positions, residual and its spectrum.

    \b
    Examples:
      wavesweep identify log.csv --resolution 2e-5 --out device.toml
      wavesweep identify log.csv --column position=enc --scale position=2e-5 --friction
      wavesweep identify log.csv --axes x,y,z --friction --out device.toml
      wavesweep identify log.csv --column voltage=v --column current=i1 --lcl --out filter.toml
      wavesweep identify --frames times.csv --fast-hz 1000
    """
    from wavesweep.program import results
    from wavesweep.program.cli.file_places import write_whole
    from wavesweep.program.cli.messages import WRITING, progress, say, show_json, where

    started = time.perf_counter()
    source, product, find, text = _asked(log, frames, motor_constant, options)
    directory = Path("results", Path(source).stem)
    target = Path(out) if out else directory / f"{product}.toml"
    _refuse_places(source, directory, target, named=bool(out))
    _refuse_foreign(target, options["overwrite"])
    progress("fitting")
    table = find()
    facts = {**table.facts, "spec_place": results.place_of([source], directory)}
    table = replace(table, facts=facts)
    progress(WRITING)
    paths, numbers, lines = _published(table, directory, options)
    write_whole((target, text(table.facts)))
    seconds = time.perf_counter() - started
    notices = table.facts["notices"]
    if verbosity().as_json:
        files = [str(path) for path in (*paths, target)]
        summary = {"command": "identify", "log": Path(source).name, "notices": notices, **numbers}
        show_json({**summary, "files": files, "seconds": round(seconds, 3)})
    elif not verbosity().quiet:
        for line, warning in [*((notice, False) for notice in notices), *lines]:
            say(line, warning)
        say(f"{where(paths, seconds)}; the {product}: {target}")


def _asked(
    log: str | None, frames: str | None, motor_constant: str | None, options: dict[str, Any]
) -> tuple[str, str, Callable[[], Any], Callable[..., str]]:
    """The file that is read, a word for its spec, what finds the table, and what writes the spec."""
    from wavesweep.identification.device_spec import spec_text
    from wavesweep.identification.table import identify
    from wavesweep.program.csv_files import factors, pairs

    named: dict[str, Any] = {"columns": pairs(options.pop("columns"), "--column")}
    named["scales"] = factors(pairs(options.pop("scales"), "--scale"))
    if frames is not None:
        return frames, "frames", *_of_frames(frames, log, options, named)
    source = _log_alone(log, options)
    find = partial(identify, source, **named, **_fit_options(options, motor_constant))
    return source, "device", find, spec_text


def _published(
    table: Any, directory: Path, options: dict[str, Any]
) -> tuple[list[Path], dict[str, Any], list[tuple[str, bool]]]:
    """Write a table with its figure; gives the paths, and the summary as numbers and as lines."""
    from wavesweep.program import plots, results
    from wavesweep.program.tables import kind_named

    if options["plot"]:
        plots.refuse_settings()
        table = plots.drawn(table)
    kind = kind_named(table.kind)
    tally = kind.tally(table)
    paths = results.publish(table.watched(tally.add), directory, options["overwrite"])
    numbers = tally.numbers(table.facts)
    return paths, numbers, list(kind.lines(numbers))


def _refuse_places(source: str, directory: Path, target: Path, *, named: bool) -> None:
    """Raise an error if results of a log cannot be written to a folder, or its spec to a file.
    named: whether the user names that file."""
    from wavesweep.program import results
    from wavesweep.program.cli.file_places import (
        refuse_inputs,
        refuse_no_folder,
        refuse_other_things,
    )

    results.refuse_unusable(directory)
    if named:
        refuse_no_folder(target)
    refuse_other_things(target)
    kinds = ("identify", "identify-response", "identify-frames")
    tables = [directory / name for kind in kinds for name in results.names_of(kind)]
    refuse_inputs([source], target, *tables)


def _log_alone(log: str | None, options: dict[str, Any]) -> str:
    """The log, beside which there are no options of --frames. Errors: UsageError."""
    if log is None:
        raise click.UsageError("identify: expected LOG, or --frames TIMES, found none")
    if any(options[name] is not None for name in ("fast_hz", "spec", "every")):
        expected = "--frames with --fast-hz, --spec or --every"
        raise click.UsageError(f"identify: expected {expected}, found none")
    return log


def _fit_options(flags: dict[str, Any], motor_constant: str | None) -> dict[str, Any]:
    """What a fit of a log is asked for."""
    names = ("resolution", "spring", "friction", "two_masses", "delay", "rate_hz")
    options = {name: flags[name] for name in names}
    options["axes"] = flags["axes"] and flags["axes"].split(",")
    if motor_constant:
        # the two numbers of LOW..HIGH, or one twice
        text = motor_constant
        low, dots, high = text.partition("..")
        try:
            bounds = float(low), float(high if dots else low)
        except ValueError:
            bounds = (0.0, 0.0)
        if not 0 < bounds[0] <= bounds[1] < float("inf"):
            raise UsageError(
                f"--motor-constant {text}: expected a number above 0, or LOW..HIGH, found {text}"
            )
        options["motor_constant"] = bounds
    return options


def _of_frames(
    path: str, log: str | None, options: dict[str, Any], named: dict[str, Any]
) -> tuple[Callable[[], Any], Any]:
    """What finds the frames of a file, and what makes the text of their spec. Errors: UsageError."""
    if log is not None:
        raise click.UsageError(f"--frames: expected no LOG beside it, found {log}")
    if unfitting := [name for name in options if name not in OF_FRAMES and is_given(name)]:
        option = f"--{unfitting[0].removesuffix('_hz').replace('_', '-')}"
        raise click.UsageError(
            f"{option}: expected none beside --frames, which takes --fast-hz or --spec, --every, --column and --scale"
        )
    if (options["fast_hz"] is None) == (options["spec"] is None):
        number_found = "neither" if options["spec"] is None else "both"
        raise click.UsageError(
            f"--frames: expected --fast-hz HZ or --spec SPEC, for the rate of the ticks, found {number_found}"
        )
    module = offered("frames")
    if module is None:
        raise click.UsageError(
            "--frames: expected the capability frame_times, found that it is not there"
        )
    fast_hz = options["fast_hz"]
    number = "rates.ratio"
    if options["spec"] is not None:
        from wavesweep.program.spec import load

        spec = load(options["spec"])
        fast_hz = spec.tick_hz
        number = module.number_of(spec)
    return partial(
        module.identified, path, fast_hz, number, every=options["every"], **named
    ), module.spec_text


def _refuse_foreign(target: Path, overwrite: bool) -> None:
    if overwrite or not target.is_file():
        return
    with target.open(encoding="utf-8", errors="replace") as file:
        if OWN not in file.readline():
            raise UsageError(
                f"{target}: found a spec that identify did not write; give --overwrite to replace it"
            )
