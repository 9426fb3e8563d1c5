"""`wavesweep stability-region`."""

import click

from wavesweep.cli.options import Options, common, for_hands, partition, prove, workers


@click.command("stability-region")
@click.argument("spec")
@for_hands
@prove
@partition
@common
@workers
def command(spec: str, options: Options, for_hands: tuple[str, ...], prove: bool) -> None:
    """Find the stable intervals along any axis for every combination of the others.

    SPEC is a TOML file; its key sweep.along gives the axis of the intervals (a symbol such as b, or the path of any number,
    such as "device.damping"), and its [sweep] table the range of that axis and the values of the others. The columns are
    those of zwidth; with --for-hands the files are stability-region-hands.*.

    \b
    Examples:
      wavesweep stability-region sweeps/examples/impedance.toml
      wavesweep stability-region mine.toml --set 'sweep={along = "b", b = {start = 5, stop = 100}, B_VE = [1, 5]}'
    """
    from wavesweep.cli.output import produce_intervals

    produce_intervals("stability-region", spec, options, for_hands=for_hands, prove=prove)
