"""`wavesweep passivity`."""

import click

from wavesweep.cli.options import Options, common, partition, workers


@click.command("passivity")
@click.argument("spec")
@click.option(
    "--filters",
    is_flag=True,
    help="Write a second table, passivity-filters: the norm of the channel with LP1 of order 1 to 8 at several cutoffs.",
)
@click.option(
    "--tolerance",
    metavar="SHARE",
    type=click.FloatRange(min=0.0),
    default=1e-3,
    show_default=True,
    help="Energy (J per J sent) that aliasing may add for the channel to count as passive, here and with --filters.",
)
@partition
@common
@workers
def command(spec: str, options: Options, filters: bool, tolerance: float) -> None:
    """Compute the norm of the wave channel and the passivity margin at the hand's port.

    A passive loop gives out no energy, so it is stable with every passive hand. SPEC is a TOML file; each axis of its [sweep]
    table that has values is swept. The channel is passive if its norm is at most 1, the port if its margin is not negative.
    damping_needed is the further damping of the device with which the port is passive. If the loop has no waves, the norm
    is missing and channel_passive is 1.

    At the port the force of the hand is held over a tick. If the hand may also move within the tick, more damping can be
    necessary: see zwidth --for-hands passive.

    \b
    Example:
      wavesweep passivity sweeps/paper/fig4.toml --filters
    """
    from wavesweep.cli.output import produce
    from wavesweep.tables.passivity import filter_choices, passivity

    def compute(specs, **work):
        (asked,) = specs
        choices = [filter_choices(asked, tolerance)] if filters else []  # first, since a spec may have none
        return [passivity(asked, tolerance, **work), *choices]

    produce(["passivity", *(["passivity-filters"] if filters else [])], [spec], options, compute)
