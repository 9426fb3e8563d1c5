"""The group of commands: a command is imported when it is called, and not for the list of all."""

from importlib import import_module

import click

from wavesweep.cli.commands import COMMANDS, module_of


class LazyGroup(click.Group):
    """A click group over the static table of commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the table's order, which is the order of use."""
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of a command."""
        del ctx
        return import_module(module_of(cmd_name)).command if cmd_name in COMMANDS else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands from the table; click's own would import each one of them."""
        del ctx
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def _say_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted and not ctx.resilient_parsing:
        from wavesweep import __version__

        click.echo(f"wavesweep {__version__}")
        ctx.exit()


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_say_version,
    help="Say the version and leave.",
)
def group() -> None:
    """Stability, rendering range and transparency of multirate wave-variable haptic loops.

    A SPEC is a TOML file. Results go to results/<the spec's name>/, talk goes to stderr.
    Exit codes: 0 done, 1 failed, 2 usage or spec error, 130 interrupted, 143 terminated.
    """
