"""`wavesweep poles`."""

import click

from wavesweep.program.cli.options import ABOUT_ITS_VALUE, Options, run_options
from wavesweep.program.cli.study_commands import one_spec


@click.command("poles")
@one_spec
@click.option(
    "--over",
    metavar="NUMBER",
    default="",
    help="The number over which the root locus is wanted, over its range in [sweep], from the least to the largest value of "
    f"a list, or else from 0 or {ABOUT_ITS_VALUE}.",
)
@run_options()
def poles(spec: str, options: Options, over: str) -> None:
    """List the modes of a loop with frequency, damping and states, and draw their root locus over a number.

    SPEC is a TOML file. The poles are the eigenvalues of its own loop from one frame to the next,
    with all its rates; a row each, the slowest first. What drifts is left out. Since a frame shows
    only an image of what is faster, each mode is followed through the ticks of its frame: shown_hz
    is the line that a spectrum shows.

    With --over there are rows for 300 values of a number, and the figure is the root locus in the
    plane of z, with the unit circle, lines of equal damping ratio, and the ends of the stable
    intervals, which are certified or marked.

    \b
    Examples:
      wavesweep poles sweeps/paper/fig4.toml
      wavesweep poles sweeps/templates/drive.toml --over kp
      wavesweep poles mine.toml --over b --set 'sweep.b={start=5, stop=80}'
    """
    from wavesweep.poles import table
    from wavesweep.program.cli.output import produce

    produce(["poles"], [spec], options, lambda specs, **_: [table.poles(specs[0], over)])
