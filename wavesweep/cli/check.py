"""`wavesweep check`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from wavesweep.cli.options import FORMATS, folder, override
from wavesweep.cli.talk import talk

if TYPE_CHECKING:
    from wavesweep.spec import Axis, Spec

PATIENT = 1.0  # s, after which ranges that are not done have a bar on a terminal


@click.command("check")
@click.argument("spec")
@click.option("--plot", is_flag=True, help="Draw the loop as well: blocks with type and rate, sums, ports, wires with gains.")
@click.option(
    "--root-locus",
    "locus",
    metavar="NUMBER",
    help="Draw the poles over a number as well, over its range in [sweep], or that in which the verdict looks.",
)
@folder("Folder for the pictures [default: results/<spec's name>], or a file for the only one, e.g. loop.svg.", or_file=True)
@click.option("--exit-code", is_flag=True, help="End with 1 if the design is not known to be stable.")
@override
def command(spec: str, plot: bool, locus: str | None, out: str | None, exit_code: bool, overrides: tuple[str, ...]) -> int:
    """Judge a spec's own design, and list the work that each command would do.

    SPEC is a TOML file. All of its mistakes are listed at once. For a valid spec the verdict on its own design comes first:
    whether the loop is stable; the range in which it stays so if one number changes and all others are kept; the delay up to
    which it is stable; the stiffness and the damping that the hand feels; the slowest mode and, if it rings, the least damped
    one, with the states that take part most; the norm of the wave channel; the assumptions. A number that the spec does not
    give has its default, and is marked so.

    Then follow the states of the loop, the methods, the numbers of slices and workers, the estimated time, and the axes and
    keys that are skipped, with the reason. Nothing is written, except with --plot the picture of the loop, diagram.png, and
    with --root-locus its poles per frame over a number, root-locus.png. Earlier ones are replaced.

    \b
    Examples:
      wavesweep check mine.toml --set environment.delay=20
      wavesweep check mine.toml --exit-code --quiet
      wavesweep check mine.toml --plot --out loop.svg
      wavesweep check sweeps/templates/drive.toml --root-locus kp
    """
    from wavesweep import spec as specs
    from wavesweep.analyses.assumptions import over_preset, unusual
    from wavesweep.analyses.measured import read_points
    from wavesweep.analyses.planning import plan, within_ticks
    from wavesweep.analyses.verdict import further, own_design
    from wavesweep.cli.messages import printable, progress, say, show_json
    from wavesweep.cli.verdict import own_lines, verdict_lines

    loaded, silent = specs.load(spec, overrides), talk().as_json or talk().quiet
    # Errors come before anything is printed.
    poles = _axis_of_poles(loaded, locus) if locus is not None else None
    read_points(loaded)
    places = _places(["diagram"] * plot + ["root-locus"] * (locus is not None), out, loaded, overrides)

    def show(lines: Iterable[str]) -> None:
        if not silent:
            click.echo(printable("\n".join(lines)))

    with progress(talk().quiet, "at work on the ranges of its numbers") as report:
        verdict = own_design(loaded)
        show(own_lines(loaded, verdict))
        verdict |= further(loaded, verdict, report and _after(PATIENT, report))
    show(verdict_lines(loaded, verdict))
    lines = plan(loaded)
    if loaded.design:
        from wavesweep.search import study

        lines += study.plan(loaded)
    notices = [*unusual(loaded), *over_preset(loaded), *(within_ticks(loaded) if loaded.drawing else ())]
    files = [str(path) for path in _drawn(loaded, places, poles)]
    if talk().as_json:
        summary = {"command": "check", "specs": [loaded.name], "spec_sha256": loaded.sha256, "assumes": verdict["assumes"]}
        show_json(summary | {"verdict": verdict, "plan": lines, "notices": notices} | ({"files": files} if files else {}))
    show([*(f"  {line}" for line in notices), *lines])
    if files and not silent:
        say(f"Wrote {', '.join(files)}")
    return int(exit_code and not verdict["stable"])


def _places(figures: list[str], out: str | None, spec: Spec, overrides: tuple[str, ...]) -> dict[str, Path]:
    """The file of each picture. Errors: UsageError for a place that cannot be used, or one without a picture."""
    from wavesweep.cli.output import own_folder, refuse_other_things

    if not figures:
        if out is not None:
            raise click.UsageError("--out: expected --plot or --root-locus, since nothing else is written, found none")
        return {}
    from wavesweep import plots, results

    to = Path(out or own_folder([spec.name], overrides))
    places = {name: to / f"{name}.png" for name in figures}
    if to.suffix[1:].lower() in FORMATS and not to.is_dir():
        if len(figures) > 1:
            raise click.UsageError(f"--out {out}: expected a folder, since two pictures are drawn")
        places = {figures[0]: to}
    for path in places.values():
        results.refuse_unusable(path.parent)
    refuse_other_things(*places.values())
    plots.refuse_settings()
    return places


def _axis_of_poles(spec: Spec, name: str) -> Axis:
    """The values of a root locus: over the range of a number in [sweep], or that in which the verdict looks."""
    import numpy as np

    from wavesweep.analyses.asked import axes_asked, key_named
    from wavesweep.analyses.verdict import searched
    from wavesweep.plots.locus import LOCUS

    key = key_named(spec, name)
    of_sweep = [axis for axis in spec.sweep if axis.path == key.path]
    if of_sweep and of_sweep[0].values:
        return of_sweep[0]
    start, stop = (of_sweep[0].start, of_sweep[0].stop) if of_sweep else searched(spec, name, key.path)
    (axis,) = axes_asked(spec, {name: np.linspace(start, stop, LOCUS)})
    return axis


def _drawn(spec: Spec, places: Mapping[str, Path], poles: Axis | None) -> Iterator[Path]:
    """Draw the loop, its poles over an axis, or both, and yield the paths of the files."""
    if not places:
        return
    from wavesweep import __version__, plots
    from wavesweep.plots.files import save_all
    from wavesweep.plots.locus import locus_of
    from wavesweep.plots.style import about_figure

    facts = {"tool_version": __version__, "spec_name": spec.name, "spec_sha256": spec.sha256}
    for name, path in places.items():
        canvas = plots.diagram(spec) if name == "diagram" else locus_of(spec, poles)
        yield from save_all(canvas, path.parent, path.stem, (path.suffix[1:].lower(),), about_figure(name, facts))


def _after(seconds: float, report: Callable[..., None]) -> Callable[..., None]:
    """The same report, from so many seconds on: what takes less shows no bar."""
    from time import monotonic

    started = monotonic()
    return lambda *done: report(*done) if monotonic() - started > seconds else None
