"""`wavesweep bode`."""

import click

from wavesweep.cli.options import Options, common, partition, refuse_equal_names, workers


@click.command("bode")
@click.argument("specs", metavar="SPEC...", nargs=-1, required=True)
@partition
@common
@workers
def command(specs: tuple[str, ...], options: Options) -> None:
    """Compute transmitted admittance and impedance over frequency, one curve per spec.

    The admittance is the motion that the hand gets for its force (m/N), the impedance the force that it feels for its motion
    (N/m): at low frequency the stiffness felt. Each SPEC is a TOML file; its [bode] table gives the frequencies, and axes,
    whose values give one curve per combination. Without that table there are 400 frequencies from 0.1 to 50 Hz, or in the
    same ratio up to half the rate of the ticks, if that is less.

    \b
    Examples:
      wavesweep bode sweeps/paper/fig6.toml
      wavesweep bode mine.toml other.toml --set 'bode.b=[20, 40]'
    """
    from wavesweep.cli.output import produce
    from wavesweep.tables.responses import responses

    refuse_equal_names(specs)
    produce(["bode"], specs, options, lambda specs, **work: [responses(specs, **work)])
