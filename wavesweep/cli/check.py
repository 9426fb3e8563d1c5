"""`wavesweep check`."""

import click

from wavesweep.cli.options import debug, override, quiet


@click.command("check")
@click.argument("spec")
@override
@quiet
@debug
def command(spec: str, overrides: tuple[str, ...], **switches: bool) -> None:
    """Validate a spec and list what would be computed, by which method.

    SPEC is a TOML file. All of its mistakes are listed at once. For a valid spec the states of the loop, the methods, the
    numbers of slices and workers, and the estimated time are listed, and the axes and keys that are skipped, with the reason.
    """
    from wavesweep import spec as specs
    from wavesweep import sweep

    lines = sweep.plan(specs.load(spec, overrides))
    if not switches["quiet"]:
        click.echo("\n".join(lines))
