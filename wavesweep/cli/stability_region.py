"""`wavesweep stability-region`."""

import click

from wavesweep.cli.options import Options, common


@click.command("stability-region")
@click.argument("spec")
@common
def command(spec: str, options: Options) -> None:
    """Find the stable intervals along any axis for every combination of the others.

    SPEC is a TOML file; sweep.along in it names the axis that the intervals lie on.
    """
    from wavesweep.cli.long_tables import produce_intervals

    produce_intervals("stability-region", spec, options)
