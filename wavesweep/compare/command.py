"""`wavesweep compare`."""

from functools import partial

import click

from wavesweep.core.cli.options import Options, run_options
from wavesweep.core.cli.studies import refuse_equal_names, several_specs


@click.command("compare")
@several_specs
@run_options("workers")
def compare(specs: tuple[str, ...], options: Options) -> None:
    """Compare several specs: the old name of zwidth SPEC... and bode SPEC... in one.

    Each SPEC is a TOML file with its own [sweep] and [bode] tables. The table compare has a row per spec and stable interval of
    K_VE: the column spec, then the columns of zwidth. The table compare-bode has the responses, as bode writes them. The
    figure has the stable walls of all specs, as zwidth draws them, above their responses, as bode draws them, with a colour
    for each spec. The results go to results/<names of all specs>, and --set applies to all specs.

    \b
    Example:
      wavesweep compare mine.toml other.toml
    """
    from wavesweep.compare import table as comparison
    from wavesweep.core.cli.output import produce
    from wavesweep.core.plots.marks import facts_of_marks

    refuse_equal_names(specs)

    def compute(loaded, **work):
        marks = facts_of_marks(loaded, "compare")
        walls, responses = comparison.compare(loaded, **work)
        if not options.formats:
            return [walls, responses]
        from wavesweep.core import plots

        draw = partial(
            plots.compare, walls.columns, {**walls.facts, **marks}, responses=responses.columns, of_responses=responses.facts
        )
        return [plots.with_figure(walls, draw), responses]

    produce(["compare", "compare-bode"], specs, options, compute)
