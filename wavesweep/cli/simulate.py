"""`wavesweep simulate`."""

import click

from wavesweep.cli.options import Options, common


@click.command("simulate")
@click.argument("spec")
@common
def command(spec: str, options: Options) -> None:
    """Run both loops tick by tick, with what a real rig adds to the linear model.

    SPEC is a TOML file; its [simulate] table names the force of the hand and the additions: a one-sided wall, an
    encoder, friction, a force limit, imperfect timing, or a device by name. If the force is a sine or a stepped sine,
    the response estimated from it is written as a second table, simulate-response. A loop that diverges is no failure:
    the rows end where numbers overflow, and a message says so.
    """
    from wavesweep import sweep
    from wavesweep.cli.output import produce
    from wavesweep.spec import Spec

    kinds = ["simulate", "simulate-response"]
    produce(kinds, [spec], options, lambda specs, **_: sweep.simulate(*specs), asked=Spec.as_simulated)
