"""`wavesweep bode`."""

from pathlib import Path

import click

from wavesweep.cli.options import Options, common


@click.command("bode")
@click.argument("specs", metavar="SPEC...", nargs=-1, required=True)
@common
def command(specs: tuple[str, ...], options: Options) -> None:
    """Compute transmitted admittance and impedance over frequency, one curve per spec.

    Each SPEC is a TOML file; the axes of its [bode] table give one curve per combination of their values.
    """
    from wavesweep import sweep
    from wavesweep.cli.output import produce

    stems = [Path(source).stem for source in specs]
    for stem in stems:
        if stems.count(stem) > 1:
            raise click.UsageError(f"two specs are called {stem}; expected different file names, which label the curves")
    produce(["bode"], specs, options, lambda specs, **work: [sweep.responses(specs, **work)])
