"""`wavesweep passivity`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from wavesweep.cli.options import Options, common

if TYPE_CHECKING:
    from wavesweep.spec import Spec
    from wavesweep.sweep import Table


@click.command("passivity")
@click.argument("spec")
@click.option(
    "--filters",
    is_flag=True,
    help="Write a second table, passivity-filters: the norm for orders 1 to 8 of LP1 at the paper's cutoffs.",
)
@common
def command(spec: str, options: Options, filters: bool) -> None:
    """Find how far the wave channel and the hand's port are from passive.

    SPEC is a TOML file; each axis of its [sweep] table that has values is swept. The channel is passive where its norm
    is at most 1, the port where the margin is not negative. A controller without waves has no channel: its norm is
    missing, and channel_passive is 1.

    The port is that of a hand whose force is held over a tick. A hand that also moves within the tick can need more
    damping: see zwidth --hand passive.
    """
    from wavesweep import sweep
    from wavesweep.cli.output import produce

    def compute(specs: list[Spec], **work: Any) -> list[Table]:
        (asked,) = specs
        return [sweep.passivity(asked, **work), *([sweep.filter_choices(asked)] if filters else [])]

    produce(["passivity", *(["passivity-filters"] if filters else [])], [spec], options, compute)
