"""`wavesweep passivity`."""

import click

from wavesweep.capabilities import offered
from wavesweep.program.cli.options import Options, run_options
from wavesweep.program.cli.study_commands import one_spec, with_proof


@click.command("passivity")
@one_spec
@click.option(
    "--along",
    metavar="NAME",
    help="Find the intervals of this number, such as K_VE, with a passive port and with a passive channel. "
    "[sweep] gives its range.",
)
@with_proof
@run_options("workers")
def passivity(spec: str, options: Options, along: str | None, proof: bool) -> None:
    """Compute the norm of the wave channel and the passivity margin at the hand's port.

    A passive loop gives out no energy, so it is stable with every passive hand that holds its force
    over a tick, beside the spec's own operator. SPEC is a TOML file; each axis of its [sweep] table
    that has values is swept. The channel is passive if its norm is at most 1, the port if its
    margin is not negative. damping_needed is the further damping of the device with which the port
    is passive. If the loop has no waves, the norm is missing and channel_passive is 1.

    At the port the force of the hand is held over a tick. If the hand may also move within the
    tick, more damping can be necessary: see zwidth --for-hands passive.

    A drawn loop with a second port, [ports] environment, is absolutely stable if it is stable with
    every pair of passive terminations that hold their force over a tick: ports_margin is the
    damping that both ports may lose, and a second table, passivity-ports, has Llewellyn's index
    over frequency.

    With --along NAME the table is passivity-along: the stable intervals of that number, those with
    a passive port, those that are absolutely stable, and those with a passive channel, one row
    each. The column hand says which; certified is 1 if every value of the interval is checked to be
    so, and those just outside are refuted.

    \b
    Examples:
      wavesweep passivity sweeps/paper/fig4.toml --set 'sweep.filters.lp1.order=[1, 2, 3, 4]'
      wavesweep passivity mine.toml --along K_VE --set 'sweep.K_VE={start = 0, stop = 2000}'
    """
    from wavesweep.passive import table as tables
    from wavesweep.program.cli.output import produce, refuse_proof, unless_quiet

    refuse_proof(proof, options)

    def compute(specs, **work):
        (loaded,) = specs
        if along:
            found = [tables.passive_along(loaded, along, **work)]
            write = proof and offered("of_table").with_proof
        else:
            found = [tables.passivity(loaded, **work)]
            write = proof and offered("of_ports").of_passivity
            if loaded.drawing and loaded.drawing.environment:
                found.append(tables.over_frequency(loaded))
        if write:
            found[0] = write(found[0], loaded, spec, options.overrides, unless_quiet)
        return found

    kinds = ["passivity-along"] if along else ["passivity", "passivity-ports"]
    produce(kinds, [spec], options, compute)
