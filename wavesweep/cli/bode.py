"""`wavesweep bode`."""

import click

from wavesweep.cli.options import Options, common, refuse_equal_names


@click.command("bode")
@click.argument("specs", metavar="SPEC...", nargs=-1, required=True)
@common
def command(specs: tuple[str, ...], options: Options) -> None:
    """Compute transmitted admittance and impedance over frequency, one curve per spec.

    Each SPEC is a TOML file; the axes of its [bode] table give one curve per combination of their values.
    """
    from wavesweep import sweep
    from wavesweep.cli.output import produce

    refuse_equal_names(specs)
    produce(["bode"], specs, options, lambda specs, **work: [sweep.responses(specs, **work)])
