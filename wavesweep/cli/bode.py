"""`wavesweep bode`."""

import click

from wavesweep.cli.options import Options, common, partition, refuse_equal_names, workers


@click.command("bode")
@click.argument("specs", metavar="SPEC...", nargs=-1, required=True)
@partition
@common
@workers
def command(specs: tuple[str, ...], options: Options) -> None:
    """Compute transmitted admittance and impedance over frequency, or the responses between inputs and outputs.

    The admittance is the motion that the hand gets for its force (m/N), the impedance the force that it feels for its motion
    (N/m): at low frequency the stiffness felt. Each SPEC is a TOML file; its [bode] table gives the frequencies, and axes,
    whose values give one curve per combination. Without that table there are 400 frequencies from 0.1 to 50 Hz, or in the
    same ratio up to half the rate of the ticks, if that is less.

    Of a drawn loop whose [ports] have inputs and outputs and no hand, the responses are those from each input to each output;
    of one with a hand too, if [bode] names an end: from = "INPUT", to = "OUTPUT". Their table is bode-ports.

    \b
    Examples:
      wavesweep bode sweeps/paper/fig6.toml
      wavesweep bode mine.toml other.toml --set 'bode.b=[20, 40]'
      wavesweep bode sweeps/examples/motor.toml --set bode.from=ref
    """
    from wavesweep.cli.output import produce
    from wavesweep.tables.responses import responses

    refuse_equal_names(specs)
    produce(["bode", "bode-ports"], specs, options, lambda specs, **work: [responses(specs, **work)])
