"""`wavesweep margins`."""

import click

from wavesweep.capabilities import offered
from wavesweep.program.cli.options import Options, run_options
from wavesweep.program.cli.study_commands import one_spec, with_proof


@click.command("margins")
@one_spec
@click.option(
    "--cut",
    metavar="SIGNAL",
    default="",
    help="The signal at which the loop is broken: an output of a block that a wire reads, BLOCK.PORT, or a name in [signals] "
    "[default: the cut of the spec's require.margins, or of a wish, else of several channels, else the one that acts on the plant].",
)
@with_proof
@run_options()
def margins(spec: str, options: Options, cut: str, proof: bool) -> None:
    """Compute gain, phase, delay and disk margins and peak sensitivities of a loop broken at one signal.

    SPEC is a TOML file. Its own loop is broken at an output of a block, so that the rest of the
    loop, at all its rates, is one exact transfer function at the rate of the frame. The table has a
    row per margin, with its frequency and a bound on its error. A signal that is made several times
    in a frame has the margins of the lifted loop: one factor multiplies all of its samples.

    No grid of frequencies is used: gains are the ends of a certified stable interval, phases come
    from all crossings of the gain 1, peaks from level sets. With unknown numbers in [for_all] there
    are also rows of the margins that are proved for all of them, with the numbers that refute
    larger ones.

    \b
    Examples:
      wavesweep margins sweeps/recipes/current-loop.toml
      wavesweep margins mine.toml --cut avatar.out --set b=20
    """
    from wavesweep.margins import table
    from wavesweep.program.cli.output import produce, refuse_proof, unless_quiet

    refuse_proof(proof, options)

    def compute(specs, **_):
        (loaded,) = specs
        computed = table.margins(loaded, cut)
        if proof:
            proofs = offered("of_margins")
            computed = proofs.of_margins(computed, loaded, spec, options.overrides, unless_quiet)
        return [computed]

    produce(["margins"], [spec], options, compute)
