"""`wavesweep simulate`."""

import click

from wavesweep.cli.options import Options, common


@click.command("simulate")
@click.argument("spec")
@common
def command(spec: str, options: Options) -> None:
    """Simulate both loops tick by tick, optionally with contact, friction and hardware limits.

    SPEC is a TOML file. Its [simulate] table gives the force of the hand, and effects that the linear model does not
    have: a one-sided wall, an encoder, friction, a force limit, imperfect timing, or all of a device by its name. If the
    force is a sine or a stepped sine, the response estimated from it is written as a second table, simulate-response. If
    the loop diverges, the rows end before the numbers overflow, and a warning is printed; the exit code is still 0.
    """
    from wavesweep import sweep
    from wavesweep.cli.output import produce
    from wavesweep.spec import Spec

    kinds = ["simulate", "simulate-response"]
    produce(kinds, [spec], options, lambda specs, **_: sweep.simulate(*specs), asked=Spec.as_simulated)
