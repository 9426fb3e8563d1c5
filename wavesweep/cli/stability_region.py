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
    from wavesweep import plots, sweep
    from wavesweep.cli.producing import produce

    def compute(specs, **work):
        return sweep.intervals(specs[0], **work)

    produce("stability-region", [spec], options, compute, plots.zwidth)
