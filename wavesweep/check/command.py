"""`wavesweep check`."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import click

from wavesweep.capabilities import asked, offered
from wavesweep.engine.errors import WavesweepError
from wavesweep.program.cli.entry import COMMANDS, verbosity
from wavesweep.program.cli.messages import width
from wavesweep.program.cli.options import FORMATS, PATH, folder, override
from wavesweep.program.number_words import folded

if TYPE_CHECKING:
    from wavesweep.check.verdict import Facts, Ranked
    from wavesweep.program.spec import Spec


@click.command("check")
@click.argument("spec", type=PATH)
@click.option(
    "--all",
    "whole",
    is_flag=True,
    help="Print all that is known, not only the 18 lines that matter most: also states, methods, times, and what is skipped.",
)
@click.option(
    "--plot",
    is_flag=True,
    help="Draw the loop as well, blocks with type and rate, sums, ports, wires with gains, and when they run and act.",
)
@click.option(
    "--frames",
    metavar="TIMES",
    help="Say also whether the frames of a run are among those that the answers are for. A CSV file with a column time (s), "
    "their stamps, or duration (s), or one of a program whose files are known.",
)
@click.option(
    "--column",
    "columns",
    multiple=True,
    metavar="NAME=COLUMN",
    help="Which column of --frames is time or duration, e.g. time=t, or the value that rows have, e.g. event=done.",
)
@click.option(
    "--scale",
    "scales",
    multiple=True,
    metavar="NAME=FACTOR",
    help="Factor from that column to s, e.g. duration=0.001 from ms.",
)
@click.option(
    "--controller",
    metavar="NAME",
    help="Say also what one controller of the loop reads and gives, and what it assumes of the rest: wires, blocks, rates, numbers. "
    "NAME is a block, as of export --controller.",
)
@click.option(
    "--proof",
    is_flag=True,
    help="Write check.proof as well: that the spec's own design is stable, or how many modes are not, and what is proved or refuted "
    "for all of [for_all], with proofs that `python -m wavesweep.checker SPEC check.proof` checks without the rest of this program.",
)
@folder(
    "Folder for the pictures and the proof [default: results/<spec's name>], or a file for the only one, e.g. loop.svg.",
    or_file=True,
)
@click.option(
    "--strict",
    is_flag=True,
    help="End with 1 if the answer to what the spec asks is no, or not known, or if --frames are others.",
)
@override
def check(
    spec: str,
    whole: bool,
    plot: bool,
    frames: str | None,
    columns: tuple[str, ...],
    scales: tuple[str, ...],
    out: str | None,
    strict: bool,
    proof: bool,
    controller: str | None,
    overrides: tuple[str, ...],
) -> int:
    """Judge a spec's own design, and say what to do next.

    SPEC is a TOML file. All of its mistakes are listed at once. For a valid spec the verdict comes
    first, on all that it asks: whether the loop is stable, or has what [sweep] requires, for all of
    [for_all], and through contact. Then comes its own design, and what decides it, in up to 18
    lines, the most important ones: the range in which the loop stays stable if one number changes
    and all others are kept; the delay up to which it is stable; the stiffness that the hand feels;
    the slowest mode and, if it rings, the least damped one; the norm of the wave channel; the
    assumptions. A number that the spec does not give has its default, and is marked so. The last
    lines name the commands that go on from there.

    With --all nothing is left out, and the states of the loop follow, the methods, the numbers of
    slices and workers, the estimated time, and the axes and keys that are skipped, with the reason.

    Nothing is written, except with --plot the picture of the loop, diagram.png, and that of time,
    timing.png: when each rate samples and computes, when its results are in place, and how old they
    are. Earlier ones are replaced. With --out loop.svg these are loop.svg and loop-timing.svg.

    \b
    Examples:
      wavesweep check mine.toml --set environment.delay=20
      wavesweep check mine.toml --all
      wavesweep check mine.toml --strict --quiet
      wavesweep check mine.toml --plot --out loop.svg
      wavesweep check engine.toml --frames times.csv --strict
    """
    from wavesweep.program import spec as specs
    from wavesweep.program.cli.messages import progress, say

    loaded = specs.load(spec, overrides)
    # Errors come before anything is printed.
    run = _frames_of_run(loaded, frames, columns, scales)
    list(asked("on_check", "refuse", loaded))
    figures = _pictures(loaded) if plot else []
    places = _places(figures, out, loaded, overrides, proof)
    around = _around(loaded, controller) if controller else []
    of_proof = places.pop("proof", None)
    judged = _judged(loaded, run, overrides, whole, progress("at work on the verdict"))
    progress("summing up")
    files = [str(path) for path in _drawn(loaded, places)]
    if verbosity().as_json:
        from wavesweep.program.cli.messages import show_json

        further = {"files": files, "controller": around}
        show_json(judged.summary(loaded) | {key: said for key, said in further.items() if said})
    if not _is_silent():  # some lines are computed as they are shown
        _show([*chain.from_iterable(map(folded, around)), *judged.lines(whole)])
    if files and not _is_silent():
        say(f"Wrote {', '.join(files)}")
    if of_proof:
        of_proof.parent.mkdir(parents=True, exist_ok=True)
        proved = offered("of_table").of_design(loaded, spec, overrides, of_proof, judged.verdict)
        for line in proved:
            say(line)
    beyond = run is not None and bool(run["left"])
    return int(strict and (judged.answer != "yes" or beyond))


@dataclass(frozen=True)
class _Judged:
    """What is known of a spec, without the lines that are shown first.

    answer: to what the spec asks. verdict: the numbers. shown: lines that are on the screen
    already. ranked: lines with their ranks. plan: those about all commands. notices: what is
    unusual about the spec, and its algebraic loops. steps: the commands that go on from there.
    """

    answer: str
    verdict: Facts
    shown: int
    ranked: list[Ranked]
    plan: list[str]
    notices: list[str]
    steps: list[str]

    def summary(self, spec: Spec) -> Facts:
        """The same as JSON."""
        return {
            "command": "check",
            "specs": [spec.name],
            "spec_sha256": spec.sha256,
            "assumes": self.verdict["assumes"],
            "verdict": self.verdict,
            "plan": self.plan,
            "notices": self.notices,
        }

    def lines(self, whole: bool) -> Iterable[str]:
        """The lines that follow: all of them, or the foremost."""
        if whole:
            ranked = (line for _, line in self.ranked)
            return [*chain.from_iterable(map(folded, ranked)), *self.plan, *self.steps]
        return [
            *_foremost(self.ranked, 18 - self.shown - len(self.steps)),  # 18 lines without --all
            *self.steps,
        ]


def _judged(
    spec: Spec,
    run: Facts | None,
    overrides: Sequence[str],
    whole: bool,
    report: Callable[..., None],
) -> _Judged:
    """Judge a spec, and show the lines that come first at once. run: what the frames of a run are, None without."""
    from wavesweep.check.planning import dead_times_in_series, plan, within_ticks
    from wavesweep.check.verdict import further, numbers, of_spec, verdict_lines, written
    from wavesweep.program.analyses.assumptions import near_rates, over_preset, unusual
    from wavesweep.program.analyses.claims import asks_more
    from wavesweep.program.analyses.own_design import own_design, own_lines

    verdict = own_design(spec)
    more = asks_more(spec)
    shown = 0 if more else _show_first(own_lines(spec, verdict), whole)
    if verbosity().as_json:
        verdict |= numbers(spec)
    verdict |= further(spec, verdict, report)
    judged = of_spec(spec, verdict)
    if more:
        shown = _show_first(own_lines(spec, verdict, judged), whole)
    verdict = written(spec, verdict)
    if run:
        verdict |= {"frames": run}
    plan_lines = plan(spec, estimated=whole or verbosity().as_json)
    plan_lines += chain.from_iterable(asked("on_check", "plan", spec))
    unusual_lines = [*unusual(spec), *over_preset(spec), *near_rates(spec)]
    if spec.drawing:
        unusual_lines += dead_times_in_series(spec)
    within = list(within_ticks(spec)) if spec.drawing else []
    ranked = [*_needed().lines(run)] if run else []
    ranked += verdict_lines(spec, verdict, late=not whole)
    ranked += [(1, f"  {line}") for line in unusual_lines]
    ranked += [(4, f"  {line}") for line in within]
    steps = list(_aligned(_steps(spec, verdict, plan_lines, whole), overrides))
    notices = [*unusual_lines, *within]
    return _Judged(verdict["answer"], verdict, shown, ranked, plan_lines, notices, steps)


def _show_first(lines: Iterable[str], whole: bool) -> int:
    """Print the lines that come first, of which the verdict is folded least; gives their number."""
    first, *remaining = lines
    fold = folded if whole else _folded
    return _show([*folded(first), *chain.from_iterable(map(fold, remaining))])


def _frames_of_run(
    spec: Spec, file: str | None, columns: tuple[str, ...], scales: tuple[str, ...]
) -> Facts | None:
    """Whether the frames of a run are among those of the spec; None without a file."""
    if file is None and not (columns or scales):
        return None
    if file is None:
        option = "column" if columns else "scale"
        raise click.UsageError(f"--{option}: expected --frames, whose column it names, found none")
    from wavesweep.program.csv_files import factors, pairs

    scaled = factors(pairs(scales, "--scale"))
    return _needed().within(spec, file, pairs(columns, "--column"), scaled)


def _is_silent() -> bool:
    return verbosity().as_json or verbosity().quiet


def _show(lines: Iterable[str]) -> int:
    """Print lines, unless nothing is to be printed; gives their number."""
    from wavesweep.program.cli.messages import printable

    if _is_silent():
        return 0
    text = "\n".join(lines)
    if text:
        click.echo(printable(text))
    return len(text.splitlines())


def _folded(line: str) -> list[str]:
    """A line as lines that a terminal shows whole, of about the same length."""
    widest = folded(line, width())
    for narrower in range(width() // 2, width()):
        lines = folded(line, narrower)
        if len(lines) == len(widest):
            return lines
    return widest


def _foremost(ranked: Sequence[Ranked], room: int) -> Iterator[str]:
    """Yield the lines of the lowest ranks, in their order: as many as there is room for, and all that NEEDED shows."""
    from wavesweep.check.on_check import DETAIL, NEEDED

    foremost = {}
    for number in sorted(range(len(ranked)), key=lambda number: ranked[number][0]):
        rank, line = ranked[number]
        needed = rank <= NEEDED
        if not needed and (rank >= DETAIL or room <= 0):
            continue
        folded = _folded(line() if callable(line) else line)
        if needed or len(folded) <= room:
            foremost[number] = folded
            room -= len(folded)
    for number in sorted(foremost):
        yield from foremost[number]


def _steps(spec: Spec, verdict: Facts, plan: Sequence[str], whole: bool) -> list[tuple[str, str]]:
    """The commands that go on from a verdict, each with what it gives.

    plan: the lines about all commands. whole: whether all that is known has been said.
    """
    told = [line for line in plan if line.startswith("  ") and ": not possible" not in line]
    possible = {line.partition(":")[0].strip() for line in told}
    name = shlex.quote(spec.source or spec.name)
    stable = verdict["stable"]
    drawing = spec.drawing
    regions = [command for command in ("zwidth", "stability-region") if command in possible]
    region = regions[0] if regions else ""
    steps = []
    steps += _interval_steps(spec, verdict, region, name)
    if "design" in possible:
        steps.append((f"design {name}", "designs that meet the wishes of [design]"))
    if not stable and (not drawing or drawing.hand or drawing.inputs):
        steps.append((f"simulate {name}", "what it does, tick by tick"))
    if any(asked("on_check", "is_next", spec, verdict)):
        steps.append((f"margins {name}", "gain, phase, delay and disk margins"))
    if stable:
        steps.append((f"report {name}", "all of it in one HTML file"))
    # Three commands are named, at most.
    steps = [step for step in steps if step[0].split()[0] in COMMANDS][:3]
    if not whole:
        steps.append((f"check {name} --all", "the rest: states, methods, times"))
    return steps


def _interval_steps(
    spec: Spec, verdict: Facts, region: str, name: str
) -> Iterator[tuple[str, str]]:
    """Yield the commands for stable intervals; region: the possible one, empty without. name: of the spec, quoted."""
    from wavesweep.check.planning import read_in_several_places
    from wavesweep.check.verdict import distance
    from wavesweep.program.number_words import ends_in_words

    if region and verdict["stable"] and not spec.require and len(verdict["limits"]) > 1:
        yield f"why {name}", "what sets each limit"
    if region:
        subject = "all stable walls" if region == "zwidth" else "all stable intervals"
        if spec.drawing and spec.drawing.at_random:
            subject += ", in mean square"
        elif spec.drawing and spec.for_all and not spec.for_all.axes:
            subject += ", for all patterns of messages"
        elif spec.for_all:
            subject += ", for all of [for_all]"
        yield f"{region} {name}", subject
        return
    for limit in sorted(verdict["limits"], key=distance):
        number = limit["name"]
        if limit["stable"] is None or read_in_several_places(spec, number):
            continue
        first, last = ends_in_words(limit["from"], limit["to"])
        if _is_done_along(spec, number, float(first), float(last)):
            span = f"'sweep.{number}={{start={first}, stop={last}}}'"
            yield f"stability-region {name} --set sweep.along={number} --set {span}", ""
            return


def _is_done_along(spec: Spec, number: str, start: float, stop: float) -> bool:
    """Whether the rows of a spec can be computed along a number: what it asks for may not be proved
    along that."""
    from wavesweep.program.spec import Axis
    from wavesweep.program.tables.interval_table import stages_of

    path = spec.names.find(number).path
    other_axes = [axis for axis in spec.sweep if axis.path != path]
    axis = Axis(number, path, (), start, stop, False, "linear")
    try:
        stages_of(replace(spec, along=number, sweep=(*other_axes, axis)), number, None)
    except WavesweepError:
        return False
    return True


def _aligned(steps: Sequence[tuple[str, str]], overrides: Sequence[str]) -> Iterator[str]:
    """Yield the lines of the next steps, with what each gives if there is room for it."""
    room = width() - len("  wavesweep   ")
    wide = max((len(line) for line, text in steps if len(line) + len(text) <= room), default=0)
    yield "next, with the same --set:" if overrides else "next:"
    for line, text in steps:
        if text and max(len(line), wide) + len(text) <= room:
            yield f"  wavesweep {line:{wide}}  {text}"
        else:
            yield f"  wavesweep {line}"


def _places(
    figures: list[str], out: str | None, spec: Spec, overrides: tuple[str, ...], proof: bool
) -> dict[str, Path]:
    """The file of each picture, and of the proof. Errors: UsageError for a place that cannot be used, or one without a picture."""
    from wavesweep.program.cli.file_places import own_folder, refuse_inputs, refuse_other_things

    if not figures and not proof:
        if out is not None:
            raise click.UsageError(
                "--out: expected --plot or --proof, since nothing else is written, found none"
            )
        return {}
    from wavesweep.program import plots, results

    to = Path(out or own_folder([spec.name], overrides))
    # Of a folder's name, as mine,b=0.5, what follows a point says nothing.
    is_picture = to.suffix[1:].lower() in FORMATS and not to.is_dir()
    places = {name: to / f"{name}.png" for name in figures}
    if figures and is_picture:
        places = {name: to.with_stem(f"{to.stem}-{name}") for name in figures}
        places[figures[0]] = to
    if proof:
        folder = to.parent if is_picture else to
        places["proof"] = folder / "check.proof"
    for path in places.values():
        results.refuse_unusable(path.parent)
    refuse_other_things(*places.values())
    refuse_inputs(spec.files, *places.values())
    plots.refuse_settings()
    return places


def _pictures(spec: Spec) -> list[str]:
    """The pictures of --plot: that of time is left out if nothing runs in ticks. Errors: UsageError if nothing draws them."""
    if offered("diagram") is None:
        raise click.UsageError(
            "--plot: expected the capability picture, found that it is not there"
        )
    if offered("timing").has_moments(spec):
        return ["diagram", "timing"]
    return ["diagram"]


def _needed() -> ModuleType:
    """The module that reads --frames. Errors: UsageError if the capability that offers it is not there."""
    module = offered("frames")
    if module is None:
        raise click.UsageError(
            "--frames: expected the capability frame_times, found that it is not there"
        )
    return module


def _around(spec: Spec, controller: str) -> list[str]:
    """What a controller assumes of the rest. Errors: UsageError if nothing says it, or for a name that none has."""
    module = offered("controller_group")
    if module is None:
        raise click.UsageError(
            "--controller: expected the capability simulation, found that it is not there"
        )
    return [f"  {line}" for line in module.assumed_of_rest(spec, module.group_of(spec, controller))]


def _drawn(spec: Spec, places: Mapping[str, Path]) -> Iterator[Path]:
    """Draw the loop, and yield the paths of the files."""
    if not places:
        return
    from wavesweep import __version__
    from wavesweep.program import plots
    from wavesweep.program.plots.figure_files import save_all
    from wavesweep.program.plots.style import about_figure

    facts = {"tool_version": __version__, "spec_name": spec.name, "spec_sha256": spec.sha256}
    for name, path in places.items():
        canvas = getattr(plots, name)(spec)
        yield from save_all(
            canvas, path.parent, path.stem, (path.suffix[1:].lower(),), about_figure(name, facts)
        )
