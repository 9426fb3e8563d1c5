"""`wavesweep simulate`."""

import click

from wavesweep.program.cli.options import PATH, Options, run_options
from wavesweep.program.cli.study_commands import one_spec
from wavesweep.simulation.export.command import export

__all__ = ["export", "simulate"]


@click.command("simulate")
@one_spec
@click.option(
    "--log",
    metavar="LOG",
    type=PATH,
    help="A CSV file of a run of the real loop, with a column time (s): its inputs are simulated, and its outputs stand beside, in the "
    "table as log_NAME and in the figure, with by how much they differ.",
)
@click.option(
    "--column",
    "columns",
    multiple=True,
    metavar="NAME=COLUMN",
    help="Which column of the log is time, an input (f_h, or of [ports]) or an output (a column of the table), e.g. ref=cmd [default: "
    "those of these names, with a unit behind or not]. May be repeated.",
)
@click.option(
    "--scale",
    "scales",
    multiple=True,
    metavar="NAME=FACTOR",
    help="Factor from the numbers of such a column to s, or the unit of the port, e.g. speed=0.1047. May be repeated.",
)
@run_options()
def simulate(
    spec: str, log: str | None, columns: tuple[str, ...], scales: tuple[str, ...], options: Options
) -> None:
    """Simulate the loop tick by tick, optionally with contact, friction and hardware limits.

    SPEC is a TOML file. Its [simulate] table gives the force of the hand, and effects that the
    linear model does not have: a one-sided wall, an encoder, friction, a force limit, imperfect
    timing, or all of a device by its name. If the force is a sine or a stepped sine, the response
    estimated from it is written as a second table, simulate-response.

    A one-sided wall is off outside it. Inside, its force is that of spring and damper, which may
    also pull: the damper does when the hand leaves fast, and so does a force that is held or late.
    With pulls = false it only pushes: its force is max(0, K depth + B speed), also shortly before a
    fast hand arrives, and it is what [for_all] contact is about.

    Of a loop that the spec draws, an input in [ports] may be in the place of the hand: [simulate]
    from = "INPUT". The table has its inputs, its outputs and its named signals; after a step the
    summary says where the outputs settle, and when.

    With [simulate] frames = [16, 16, 20, 33, 33] the slow environment's frames have these lengths
    in turn, for ever: so a counterexample of [for_all] is seen to grow.

    If the linear loop is unstable, the summary, the figure and the facts of the run say so, with
    its spectral radius, and the response is compared with no linear one. The simulation stops
    before the hand is 1 km away or a force exceeds 1e6 N. The exit code is 0 in both cases.

    \b
    Examples:
      wavesweep simulate sweeps/examples/rig.toml
      wavesweep simulate mine.toml --set simulate.input=step --set device.preset=omni
      wavesweep simulate sweeps/templates/drive.toml --set simulate.from=load
      wavesweep simulate servo.toml --log run.csv --column ref=command --column position=encoder
    """
    from wavesweep.program.cli.output import produce
    from wavesweep.program.csv_files import factors, pairs
    from wavesweep.simulation import table as simulation

    if log is None and (columns or scales):
        option = "column" if columns else "scale"
        raise click.UsageError(f"--{option}: expected --log, whose column it names, found none")
    named = pairs(columns, "--column")
    scaled = factors(pairs(scales, "--scale"))
    kinds = ["simulate", "simulate-response"]
    produce(
        kinds,
        [spec],
        options,
        lambda specs, **_: simulation.simulate(*specs, log, named, scaled),
        asked=lambda spec: spec.asking("simulate"),
    )
