"""Loops with all of their numbers in a cell: ticks as polynomials of these with a bound on the rest."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._sets.enclosed_loop import EnclosedLoop, Side
    from wavesweep.engine._sets.sides import Sides
    from wavesweep.engine._sets.taylor_models import (
        Polynomials,
        UnresolvedError,
    )
else:
    __getattr__ = on_demand(
        {
            "_sets.enclosed_loop": ("EnclosedLoop", "Side"),
            "_sets.sides": ("Sides",),
            "_sets.taylor_models": (
                "Polynomials",
                "UnresolvedError",
            ),
        }
    )
