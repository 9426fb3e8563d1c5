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

    All mistakes of the SPEC are named at once. Otherwise: the methods, how many slices, and what is skipped and why.
    """
    from wavesweep import spec as specs
    from wavesweep import sweep

    lines = sweep.plan(specs.load(spec, overrides))
    if not switches["quiet"]:
        click.echo("\n".join(lines))
