"""`wavesweep zwidth`."""

import click

from wavesweep.cli.options import Options, common, for_hands, partition, prove, workers


@click.command("zwidth")
@click.argument("spec")
@for_hands
@prove
@partition
@common
@workers
def command(spec: str, options: Options, for_hands: tuple[str, ...], prove: bool) -> None:
    """Find the stable intervals of the stiffness K_VE for each B_VE and each other axis.

    The Z-width of a device is the range of virtual walls with which its loop is stable. A wall has the stiffness K_VE (N/m) and
    the damping B_VE (N*s/m). SPEC is a TOML file; its [sweep] table gives the range of K_VE, the values of B_VE, and those of
    any other axis, such as the wave impedance b.

    The table has a row per stable interval of K_VE, from low to high. There can be several, with unstable walls between
    them; all are found. felt_low and felt_high are the stiffness that the hand feels at both ends, which is below K_VE if
    waves give way. The column certified is 1 if an interval is proved, and otherwise the column doubt gives the reason.

    With --for-hands the rows go to zwidth-hands.*, beside zwidth.*, with a column hand that says for whom each is: free, the
    device alone; operator, the spec's own; passive, box or port. The column settled is 1 if a row for a box is proved but for a
    thousandth of the interval at each end, and 0 if a search found no unstable hand.

    \b
    Examples:
      wavesweep zwidth sweeps/paper/fig4.toml
      wavesweep zwidth mine.toml --for-hands box --for-hands port
      wavesweep zwidth mine.toml --set device.mass=0.2 --set 'sweep.B_VE=[0, 1, 5]'
    """
    from wavesweep.cli.output import produce_intervals

    produce_intervals("zwidth", spec, options, along="K_VE", for_hands=for_hands, prove=prove)
