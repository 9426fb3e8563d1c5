"""`wavesweep zwidth`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from wavesweep.cli.options import Options, common, hand_options

if TYPE_CHECKING:
    from wavesweep.sweep.hands import Hands


@click.command("zwidth")
@click.argument("spec")
@hand_options
@common
def command(spec: str, options: Options, hands: Hands | None) -> None:
    """Find the stable intervals of the stiffness K_VE for each B_VE and each other axis.

    SPEC is a TOML file; its [sweep] table gives the axes. All stable intervals are found, not only the first one. The
    column certified is 1 if an interval is proved, and otherwise the column doubt gives the reason.
    """
    from wavesweep.cli.output import produce_intervals

    produce_intervals("zwidth", spec, options, along="K_VE", hands=hands)
