"""`wavesweep check`."""

import click

from wavesweep.cli.options import debug, override, quiet


@click.command("check")
@click.argument("spec")
@override
@quiet
@debug
def command(spec: str, overrides: tuple[str, ...], **switches: bool) -> None:
    """Validate a spec and say what would be computed, and how.

    All mistakes of the SPEC are listed at once. A valid spec gives the methods, the number of slices and workers, and the
    axes and keys that are skipped, with the reason.
    """
    from wavesweep import spec as specs
    from wavesweep import sweep

    lines = sweep.plan(specs.load(spec, overrides))
    if not switches["quiet"]:
        click.echo("\n".join(lines))
