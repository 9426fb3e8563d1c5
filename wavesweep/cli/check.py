"""`wavesweep check`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from wavesweep.cli.measured import measured_lines
from wavesweep.cli.options import as_json, debug, folder, formats, override, quiet

if TYPE_CHECKING:
    from wavesweep.spec import Axis, Spec

Facts = Mapping[str, Any]
PATIENT = 1.0  # s, after which ranges that are not done have a bar on a terminal
RINGS = 0.5  # damping ratio, below which a mode rings


@click.command("check")
@click.argument("spec")
@click.option("--plot", is_flag=True, help="Draw the loop as well: blocks with type and rate, sums, ports, wires with gains.")
@click.option(
    "--root-locus",
    "locus",
    metavar="NUMBER",
    help="Draw the poles over a number as well, over its range in [sweep], or that in which the verdict looks.",
)
@formats
@folder("Folder for the pictures of --plot and --root-locus [default: results/<spec's name>].")
@click.option("--exit-code", is_flag=True, help="End with 1 if the design is not known to be stable.")
@override
@as_json
@quiet
@debug
def command(
    spec: str,
    plot: bool,
    locus: str | None,
    formats: tuple[str, ...],
    out: str | None,
    overrides: tuple[str, ...],
    exit_code: bool,
    **switches: bool,
) -> int:
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
      wavesweep check mine.toml --plot --format svg
      wavesweep check sweeps/examples/motor.toml --root-locus kp
    """
    _refuse_at_odds(plot or locus is not None, out)
    from wavesweep import spec as specs
    from wavesweep.cli.messages import printable, progress
    from wavesweep.cli.output import own_folder, refuse_other_things
    from wavesweep.sweep.assumptions import over_preset, unusual
    from wavesweep.sweep.measured import read_points
    from wavesweep.sweep.planning import plan, within_ticks
    from wavesweep.sweep.verdict import beside, own_design

    loaded, silent = specs.load(spec, overrides), switches["as_json"] or switches["quiet"]
    poles = _axis_of_poles(loaded, locus) if locus is not None else None
    read_points(loaded)  # an error comes before anything is printed
    directory, figures = (
        Path(out or own_folder([loaded.name], overrides)),
        ["diagram"] * plot + ["root-locus"] * (poles is not None),
    )
    if figures:
        from wavesweep import plots, results

        results.refuse_unusable(directory)
        refuse_other_things(*(directory / f"{name}.{form}" for name in figures for form in formats))
        plots.refuse_settings()

    def show(lines: Iterable[str]) -> None:
        if not silent:
            click.echo(printable("\n".join(lines)))

    with progress(switches["quiet"], "at work on the ranges of its numbers") as report:
        found = own_design(loaded)
        show(own_lines(loaded, found))
        found |= beside(loaded, found, report and _after(PATIENT, report))
    show(verdict_lines(loaded, found))
    lines = plan(loaded)
    if loaded.design:
        from wavesweep.search import study

        lines += study.plan(loaded)
    notices = [*unusual(loaded), *over_preset(loaded), *(within_ticks(loaded) if loaded.drawing else ())]
    pictures = _pictures(loaded, figures, poles, directory, formats) if figures else []
    if switches["as_json"]:
        from wavesweep.cli.messages import show_json

        summary = {"command": "check", "specs": [loaded.name], "spec_sha256": loaded.sha256, "assumes": found["assumes"]}
        files = {"files": [str(path) for path in pictures]} if pictures else {}
        show_json(summary | {"verdict": found, "plan": lines, "notices": notices} | files)
    show([*(f"  {line}" for line in notices), *lines])
    if pictures and not silent:
        from wavesweep.cli.messages import say

        say(f"Wrote {', '.join(map(str, pictures))}")
    return int(exit_code and not found["stable"])


def _refuse_at_odds(plot: bool, out: str | None) -> None:
    """Raise UsageError for options of the picture without one."""
    if out is not None and not plot:
        raise click.UsageError("--out: expected --plot or --root-locus, since nothing else is written, found none")
    for name in () if plot else ("formats", "width", "style"):
        if click.get_current_context().get_parameter_source(name) is not ParameterSource.DEFAULT:
            expected = "expected --plot or --root-locus, since no other figure is drawn, found none"
            raise click.UsageError(f"--{name.removesuffix('s')}: {expected}")


def _axis_of_poles(spec: Spec, name: str) -> Axis:
    """The values of a root locus: over the range of a number in [sweep], or that in which the verdict looks."""
    import numpy as np

    from wavesweep.plots.locus import LOCUS
    from wavesweep.sweep.asked import axes_asked, key_named
    from wavesweep.sweep.verdict import searched

    key = key_named(spec, name)
    of_sweep = [axis for axis in spec.sweep if axis.path == key.path]
    if of_sweep and of_sweep[0].values:
        return of_sweep[0]
    start, stop = (of_sweep[0].start, of_sweep[0].stop) if of_sweep else searched(spec, name, key.path)
    (axis,) = axes_asked(spec, {name: np.linspace(start, stop, LOCUS)})
    return axis


def _pictures(spec: Spec, figures: list[str], poles: Axis | None, directory: Path, formats: tuple[str, ...]) -> list[Path]:
    """Draw the loop, its poles over an axis, or both, and write the pictures; gives the paths of the files."""
    from wavesweep import __version__, plots
    from wavesweep.plots.files import save_all
    from wavesweep.plots.locus import locus_of
    from wavesweep.plots.style import about_figure

    facts = {"tool_version": __version__, "spec_name": spec.name, "spec_sha256": spec.sha256}
    drawn = (plots.diagram(spec) if name == "diagram" else locus_of(spec, poles) for name in figures)
    written = (
        save_all(canvas, directory, name, formats, about_figure(name, facts))
        for canvas, name in zip(drawn, figures, strict=True)
    )
    return [path for paths in written for path in paths]


def _after(seconds: float, report: Callable[..., None]) -> Callable[..., None]:
    """The same report, from so many seconds on: what takes less shows no bar."""
    from time import monotonic

    started = monotonic()
    return lambda *done: report(*done) if monotonic() - started > seconds else None


def own_lines(spec: Spec, found: Facts) -> Iterator[str]:
    """Yield whether the design is stable, in a line or two."""
    if _favourable(found):
        yield f"assumes: {found['assumes']}"
    yield from _stability(spec, found)


def _favourable(found: Facts) -> bool:
    """Whether the design is better only by what it assumes, which is then said first."""
    from wavesweep.sweep.assumptions import FAVOURABLE

    return FAVOURABLE in found["assumes"]


def verdict_lines(spec: Spec, found: Facts) -> Iterator[str]:
    """Yield what the verdict says beside `own_lines`, in about eight lines."""
    from wavesweep.passive.channel import has_waves
    from wavesweep.passive.margin import LONGEST
    from wavesweep.sweep.grid import own_loop

    yield from _for_all(found.get("for_all"))
    bounded = [each for each in found["limits"] if _bounded(each)]
    yield from (f"  {_limit(spec, each)}" for each in bounded)
    others = [each for each in found["limits"] if each not in bounded]
    if others:
        state = "stable" if found["stable"] else "unstable"
        spans = ", ".join(f"{each['name']} {each['from']:g} to {each['to']:g}{_unit(spec, each['name'])}" for each in others)
        yield f"  {state} at every value searched: {spans}"
    if found["delay"] and found["spectral_radius"] is not None:
        yield f"  {_delay(found['delay'])}"
    if found["stable"] and found["felt"]:
        stiffness, damping = spec.units_felt
        yield f"  felt at rest: {_felt(found['felt'], stiffness, damping)}"
    yield from (
        f"  {line}" for line in _hardware(found.get("hardware", {}), found["stable"], spec.at_port("N"), spec.at_port("m"))
    )
    if found["stable"]:
        yield f"  slowest mode: {_mode(found['slowest'])}"
        if found["least_damped"] and found["least_damped"]["damping_ratio"] < RINGS:
            yield f"  least damped mode: {_mode(found['least_damped'])}"
    if found["channel_norm"] is not None:
        yield f"  wave channel: norm {found['channel_norm']:.7g} (passive up to 1)"
    elif not spec.drawing and has_waves(own_loop(spec)[0]):
        yield f"  wave channel: norm not computed in check for so long a frame; passivity does it up to {LONGEST} ticks"
    yield from (f"  {line}" for line in measured_lines(spec, found.get("measured", {})))
    if found["assumes"] and not _favourable(found):
        yield f"  assumes: {found['assumes']}"


def _stability(spec: Spec, found: Facts) -> Iterator[str]:
    """Whether the design is stable."""
    from wavesweep.spec.require import BOUNDED

    frame = 1e3 * found["period_s"]
    radius = found["spectral_radius"]
    known = radius is not None and radius != 1  # 1 also stands for a radius that is below it by rounding alone
    said = "stable" if found["stable"] else "UNSTABLE" if known else "not known whether it is stable"
    why = "numbers overflow, or rounding hides them"
    if radius is not None:
        why = f"spectral radius {_text(radius)} per frame of {frame:.6g} ms{'' if known else ', but for rounding'}"
    yield f"{spec.name}, {spec.kind}: {said} ({why})"
    if spec.drawing and radius == 1:
        yield f"  {BOUNDED}"


def _for_all(found: Facts | None) -> Iterator[str]:
    from wavesweep.sweep.for_all import in_words

    if found:
        yield f"  for all of [for_all]: {in_words(found)}"


def _bounded(limit: Facts) -> bool:
    """Whether stability changes in the range searched, or is not known there."""
    whole = [[limit["from"], limit["to"]]]
    return limit["stopped"] or limit["stable"] is None or not limit["certified"] or limit["intervals"] not in ([], whole)


def _limit(spec: Spec, limit: Facts) -> str:
    name, value, unit = limit["name"], limit["value"], _unit(spec, limit["name"])
    default = "" if spec.drawing or spec.names.find(name).path in spec.given else ", the default"
    here = f"{name} = {value:g}{unit}{default}"
    return f"{here}: {_stable_where(limit, unit)}{_going_on(spec, limit)}"


def _going_on(spec: Spec, limit: Facts) -> str:
    """A line with what finds the rest of a range that ended early, unless both ends of the interval are known."""
    from wavesweep.sweep.verdict import searched

    name = limit["name"]
    start, stop = searched(spec, name, spec.names.find(name).path)
    ended = [limit["low"] is None and limit["from"] > start, limit["high"] is None and limit["to"] < stop]
    if not (limit["stopped"] and any(ended)):
        return ""
    axes = f"--set sweep.along={name} --set 'sweep.{name}={{start={start:g}, stop={stop:g}}}'"
    return f"\n    the whole range takes longer: wavesweep stability-region {spec.source or spec.name} {axes}"


def _stable_where(limit: Facts, unit: str) -> str:
    value = limit["value"]
    if limit["stable"] is None:
        return f"not known ({limit['doubt']})"
    proved = "" if limit["certified"] else f", not proved ({limit['doubt']})"
    if not limit["stable"]:
        spans = " and ".join(_span(limit, low, high) + unit for low, high in limit["intervals"])
        searched = f"{limit['from']:g} to {limit['to']:g}{unit}"
        if not (spans or limit["certified"]):
            return f"no stable value known in {searched} ({limit['doubt']})"
        return f"stable in {spans}{proved}" if spans else f"nowhere stable in {searched}"
    low, high = limit["low"], limit["high"]
    start = f"from {low:.6g}" if low is not None else f"from {'at most ' if limit['from'] else ''}{limit['from']:g}"
    end = f"to {high:.6g}{unit}" if high is not None else f"to at least {limit['to']:g}{unit}"
    factors = _factors(limit) if value else ""
    return f"stable {start} {end}{factors}{proved}"


def _span(limit: Facts, low: float, high: float) -> str:
    """An interval; an end of the range that was searched is none of stability."""
    start = "at most " if low == limit["from"] != 0 else ""
    return f"{start}{low:.6g} to {'at least ' if high == limit['to'] else ''}{high:.6g}"


def _factors(limit: Facts) -> str:
    """The factors by which the value may shrink and grow."""
    ways = [("fall to", limit["low"]), ("rise to", limit["high"])]
    said = [f"{way} {100 * end / limit['value']:.3g} %" for way, end in ways if end]
    return f" (it may {' and '.join(said)})" if said else ""


def _unit(spec: Spec, name: str) -> str:
    unit = spec.names.find(name).unit
    return "" if unit in ("", "1") else f" {unit}"


def _delay(delay: Facts) -> str:
    here = f"delay = {delay['ticks']} of {delay['frame']} ticks"
    if delay["most"] is None:
        return f"{here}: unstable at this delay"
    if delay["most"] == delay["frame"]:
        return f"{here}: stable up to a whole frame"
    least = "at least " if delay["most"] == delay["tried"] else ""
    return f"{here}: stable up to {least}{delay['most']} ticks"


def _felt(felt: Facts, *units: str) -> str:
    stiffness, damping = felt["stiffness"], felt["damping"]
    if felt["rigid"]:
        return "rigid, a constant force moves nothing in the end"
    if stiffness is None and damping is None:
        return "not known"
    if felt["over_band"] is None:
        known = (
            f"{name} not known" if value is None else f"{value:.{digits}g} {unit}"
            for name, value, unit, digits in zip(("stiffness", "damping"), (stiffness, damping), units, (6, 4), strict=True)
        )
        return " and ".join(known)
    from wavesweep.sweep.feel import in_words

    return f"{stiffness:.6g} {units[0]}{in_words(felt['over_band'])}"


def _hardware(found: Facts, stable: bool, force: str, length: str) -> Iterator[str]:
    """What encoder, friction and motors do to the design."""
    if "chatter" in found:
        known = "makes a force that is not known to be bounded"
        if found["chatter"] is not None:
            largest = f"moves the force by up to {found['step_force']:.4g} {force}"
            known = f"{largest}, and the rounding of all readings by at most {found['chatter']:.4g} {force}"
        yield f"encoder: a step of {found['resolution']:.4g} {length} {known}"
    unit, source = f"{force}/{length}", "Abbott and Okamura 2005"
    if "holds_to" in found:
        held = f"holds the device against a step of the encoder up to {found['holds_to']:.6g} {unit}"
        yield f"friction: {found['friction']:.4g} {force} {held}; a wall that is felt stiffer may buzz ({source})"
        if not stable:
            yield "  nothing but friction can bring this loop to rest: `wavesweep simulate` shows after which pushes it does"
    if "passive_to" in found:
        yield f"damping: walls up to {found['passive_to']:.6g} {unit} without B_VE generate no energy ({source})"
    if found.get("depth") is not None:
        depth, most = f"{found['depth']:.4g} {length}", f"{found['max_force']:.4g} {force}"
        yield f"motors: the wall can be pressed {depth} deep, slowly, with their {most}"


def _mode(mode: Facts | None) -> str:
    if mode is None:
        return "none"
    return (
        f"falls to 1/e in {_text(mode['time_constant_s'], 4)} s, damping ratio {_text(mode['damping_ratio'], 3)}"
        + (f", {mode['omega'] / (2 * pi):.4g} Hz" if mode["omega"] else "")
        + (f" and {mode['second_hz']:.4g} Hz" if mode["second_hz"] else "")
        + (f"; most in {', '.join(mode['states'])}" if mode["states"] else "")
    )


def _text(value: float | None, digits: int = 6) -> str:
    return "not known" if value is None else f"{value:.{digits}g}"
