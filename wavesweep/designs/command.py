"""`wavesweep design`."""

import click

from wavesweep.program.cli.options import Options, run_options
from wavesweep.program.cli.study_commands import one_spec


@click.command("design")
@one_spec
@run_options("workers")
def design(spec: str, options: Options) -> None:
    """Search for designs that meet a wish, for all devices and hands that they have to hold for.

    SPEC is a TOML file. Its table [design.vary] has the numbers that may be changed, with their
    ranges; [design.wish] the quantities wished for, each with a bound (at_least, at_most) or as
    good as possible; [for_all] devices, hands, delays and frames, of which the worst counts.
    With two wishes without a bound the result is their front, with one the best design, and if all
    have bounds the design that keeps the tightest of them by the largest share.

    A row of the table is a design, the best first, with the worst value of each wish and what sets
    it. best/SPEC-*.toml are specs of up to ten of them, which every other command takes. If no
    design meets all bounds, the exit code is 1, and the message names the nearest miss and the
    wishes that stand against each other. An interrupted search goes on where it stopped.

    \b
    Example:
      wavesweep design sweeps/design/front.toml
    """
    from wavesweep.program.cli.output import produce

    def compute(specs, **work):
        from wavesweep.designs import study
        from wavesweep.designs.best import with_best

        table = study.design(*specs, **work)
        return [with_best(table, specs[0]) if options.to_folder else table]

    less = "a smaller population and fewer generations in [design] take less"
    produce(
        ["design"], [spec], options, compute, asked=lambda spec: spec.asking("design"), less=less
    )
