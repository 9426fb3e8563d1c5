"""`wavesweep margins`."""

import click

from wavesweep.cli.options import Options, common


@click.command("margins")
@click.argument("spec")
@click.option(
    "--cut",
    metavar="SIGNAL",
    required=True,
    help="The signal at which the loop is broken, BLOCK.PORT: an output of a block that runs once per frame.",
)
@common
def command(spec: str, options: Options, cut: str) -> None:
    """Compute gain, phase, delay and disk margins and peak sensitivities of a loop broken at one signal.

    SPEC is a TOML file. Its own loop is broken at an output of a block that runs once per frame, so that the rest of the
    loop, at all its rates, is one exact transfer function at the rate of the frame. The table has a row per margin, with its
    frequency and a bound on its error.

    No grid of frequencies is used: gains are the ends of a certified stable interval, phases come from all crossings of the
    gain 1, peaks from level sets. A signal that is made several times in a frame is refused.

    \b
    Examples:
      wavesweep margins sweeps/paper/fig4.toml --cut avatar.out
      wavesweep margins mine.toml --cut avatar.out --set b=20
    """
    from wavesweep.cli.output import produce
    from wavesweep.tables.margins import margins

    produce(["margins"], [spec], options, lambda specs, **_: [margins(*specs, cut)])
