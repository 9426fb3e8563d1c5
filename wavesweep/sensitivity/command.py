"""`wavesweep why`."""

import click

from wavesweep.program.cli.options import ABOUT_ITS_VALUE, Options, run_options
from wavesweep.program.cli.study_commands import one_spec


@click.command("why")
@one_spec
@click.option(
    "--along",
    metavar="NAME",
    help="The axis whose stable intervals are explained [default: sweep.along]. Without a span in [sweep] it is searched from "
    f"{ABOUT_ITS_VALUE}; K_VE from 0 to 20000.",
)
@run_options()
def why(spec: str, options: Options, along: str | None) -> None:
    """Explain each limit of a design: by how many per cent it moves for one per cent of each number.

    SPEC is a TOML file. For its own values the stable intervals along an axis are found; other axes
    of [sweep] are not swept. For each end that stability sets, and for the stiffness that the hand
    feels there, the table has the elasticity (per cent per per cent) and the slope with respect to
    every number that the loop reads, the mode that crosses the unit circle there, its damping
    beside the end, and the states that take part in it.

    The derivatives are exact and not differences. They hold for small changes: another crossing may
    set the end after a large one. If two crossings set an end, each has rows of its own. Whole
    numbers have no derivative and are left out.

    \b
    Examples:
      wavesweep why sweeps/paper/fig4.toml
      wavesweep why mine.toml --along b --set 'sweep.b={start=5, stop=80}'
    """
    from wavesweep.program.cli.output import produce
    from wavesweep.sensitivity import table

    produce(["why"], [spec], options, lambda specs, **_: [table.why(*specs, along)])
