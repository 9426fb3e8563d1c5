"""`wavesweep report`."""

import time
from pathlib import Path, PurePath

import click

from wavesweep.engine.errors import UsageError
from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.options import PATH, override, overwriting
from wavesweep.program.cli.study_commands import for_hands as of_hands

FILE = "report.html"


@click.command("report")
@click.argument("spec", type=PATH)
@click.option(
    "-o",
    "--out",
    metavar="FILE",
    type=PATH,
    help="The file, FILE.html, or a folder for report.html [default: results/<spec's name>].",
)
@click.option(
    "--cut",
    metavar="SIGNAL",
    default="",
    help="The signal for the margins, BLOCK.PORT [default: the cut of the spec's require.margins, or of a wish, else of several "
    "channels, else the one that acts on the plant].",
)
@of_hands
@overwriting("Replace a file that is no report of this spec.")
@override
def report(
    spec: str,
    out: str | None,
    cut: str,
    for_hands: tuple[str, ...],
    overwrite: bool,
    overrides: tuple[str, ...],
) -> None:
    """Write a report of a spec for a design review: one HTML file.

    SPEC is a TOML file. The report needs no other file, and prints on A4. It has the question of
    the spec, the certified ranges and what the proof assumes, what makes the loop unstable beyond
    them, the verdict on the spec's own numbers, what sets the limits, margins, step and frequency
    response, the spec itself, versions and hashes, and the commands that verify all of it. What is
    not certified says so. What a spec does not allow, such as margins of an unstable loop, is
    listed with the reason. The same spec gives the same bytes.

    \b
    Examples:
      wavesweep report mine.toml
      wavesweep report sweeps/recipes/current-loop.toml --out current-loop.html
      wavesweep report mine.toml --for-hands passive --cut wall.y
    """
    from wavesweep.program.atomic_files import made_folder
    from wavesweep.program.cli import file_places
    from wavesweep.program.cli.messages import progress, say
    from wavesweep.program.plots import refuse_settings
    from wavesweep.program.results import refuse_unusable
    from wavesweep.program.spec import load
    from wavesweep.reports.content import ReportRequest, report

    started = time.perf_counter()
    loaded = load(spec, overrides)
    if out is not None:
        target = _file(out)
    else:
        target = file_places.own_folder([loaded.name], overrides) / FILE
    refuse_unusable(target.parent)
    file_places.refuse_other_things(target)
    file_places.refuse_inputs(loaded.files, target)
    if target.exists() and not overwrite and not _is_report(target, loaded.name):
        raise UsageError(
            f"{target}: the file is no report of {loaded.name}; expected another --out, or --overwrite"
        )
    refuse_settings()
    less = "fewer values in [sweep] take less"

    def at_work(title: str) -> object:
        return progress(f"at work on {title}", less)

    text = report(loaded, ReportRequest(cut, for_hands, overrides, at_work=at_work))
    with made_folder(target.parent):
        file_places.write_whole((target, text))
    if not verbosity().quiet:
        say(f"Wrote {target} in {time.perf_counter() - started:.2f} s")


def _file(out: str) -> Path:
    """The file that --out names, or the one in the folder that it names."""
    path, page = Path(out), PurePath(out).suffix.lower() in (".html", ".htm")
    if (
        not out.strip()
        or out == "-"
        or (path.suffix[1:].isalpha() and not page and not path.exists())
    ):
        raise click.UsageError(
            f"--out {out}: expected a file whose name ends in .html, or a folder"
        )
    if page and not path.is_dir():
        return path
    return path / FILE


def _is_report(path: Path, name: str) -> bool:
    """Whether a file is an earlier report of a spec of this name."""
    from wavesweep.reports.report_page import head

    return head(name) in path.read_text(encoding="utf-8", errors="replace")
