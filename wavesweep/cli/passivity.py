"""`wavesweep passivity`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from wavesweep.cli.options import Options, common

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wavesweep.spec import Spec
    from wavesweep.sweep import Run


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
    missing, and channel_passive is 1, since what is not there adds no energy.

    The port is that of a hand whose force is held over a tick. A hand that moves on within the tick can ask for more:
    see zwidth --hand passive.
    """
    from wavesweep import sweep
    from wavesweep.cli.producing import produce_tables
    from wavesweep.plots.filter_choices import filter_choices
    from wavesweep.plots.passivity import passivity

    def compute(specs: Sequence[Spec], **work: Any) -> dict[str, Run]:
        (asked,) = specs
        runs = {"passivity": sweep.passivity(asked, **work)}
        return runs | ({"passivity-filters": sweep.filter_choices(asked)} if filters else {})

    draws = {"passivity": passivity} | ({"passivity-filters": filter_choices} if filters else {})
    produce_tables(draws, [spec], options, compute)
