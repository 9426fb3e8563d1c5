"""The columns of the table `design` beside those that a spec varies and wishes."""

from wavesweep.designs.wish_keys import WISHES
from wavesweep.program.tables.fields import Field, columns_beside

COLUMNS = {}  # of the kind: they follow from the spec
DESIGN = columns_beside(__file__)["design"]
_WORST = (
    Field(name, "number", wish.unit, f"{wish.description}, at its worst")
    for name, wish in WISHES.items()
)
_SCENARIOS = (
    Field(f"{name}_scenario", "string", "", f"what sets the worst {name}") for name in WISHES
)
EXPLAINED = {"design": (*_WORST, *_SCENARIOS, *DESIGN)}
