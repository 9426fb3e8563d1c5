"""`wavesweep compare`."""

from functools import partial

import click

from wavesweep.cli.options import Options, common, refuse_equal_names, workers


@click.command("compare")
@click.argument("specs", metavar="SPEC...", nargs=-1, required=True)
@common
@workers
def command(specs: tuple[str, ...], options: Options) -> None:
    """Compare the Z-width and the responses of several specs, in a figure and two tables.

    Each SPEC is a TOML file with its own [sweep] and [bode] tables. The table compare has a row per spec and stable interval of
    K_VE: the column spec, then the columns of zwidth. The table compare-bode has the responses, as bode writes them. The
    figure shows the ends of the stable stiffness, the stiffness that the hand feels there, admittance and impedance, with a
    colour per spec. The results go to results/<names of all specs>, and --set applies to all specs.

    \b
    Example:
      wavesweep compare mine.toml other.toml
    """
    from wavesweep.cli.output import produce
    from wavesweep.identification.points import facts_of_points
    from wavesweep.tables.comparison import compare

    refuse_equal_names(specs)

    def compute(loaded, **work):
        measured = facts_of_points(loaded, "compare")
        walls, responses = compare(loaded, **work)
        if options.to_stdout or not options.plot:
            return [walls, responses]
        from wavesweep import plots

        draw = partial(
            plots.compare, walls.columns, {**walls.facts, **measured}, responses=responses.columns, of_responses=responses.facts
        )
        return [plots.with_figure(walls, draw), responses]

    produce(["compare", "compare-bode"], specs, options, compute)
