"""`wavesweep zwidth`."""

import click

from wavesweep.cli.options import Options, common


@click.command("zwidth")
@click.argument("spec")
@common
def command(spec: str, options: Options) -> None:
    """Find the stable intervals of the stiffness K_VE for each B_VE and each other axis.

    SPEC is a TOML file; its [sweep] table names the axes. All stable intervals are reported, not the first one, and
    each says whether it is certified.
    """
    from wavesweep.cli.long_tables import produce_intervals

    produce_intervals("zwidth", spec, options, along="K_VE")
