"""Keys of values with type, range and unit, values with their places, and all mistakes at once."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._keys.checking import (
        Mistakes,
        Rejected,
        check,
        computable,
        expectation,
        nearest,
        show,
    )
    from wavesweep.engine._keys.key import (
        FORMULA,
        HIGHEST_ORDER,
        INTEGRATIONS,
        LARGEST,
        LONGEST_FRAME,
        PORT_UNITS,
        VALUE_WORDS,
        Key,
        Leaf,
        Names,
        Path,
        Place,
        leaves_of,
        plain,
        split_names,
    )
else:
    __getattr__ = on_demand(
        {
            "_keys.checking": (
                "Mistakes",
                "Rejected",
                "check",
                "computable",
                "expectation",
                "nearest",
                "show",
            ),
            "_keys.key": (
                "FORMULA",
                "HIGHEST_ORDER",
                "INTEGRATIONS",
                "Key",
                "LARGEST",
                "LONGEST_FRAME",
                "Leaf",
                "Names",
                "Path",
                "Place",
                "PORT_UNITS",
                "VALUE_WORDS",
                "leaves_of",
                "plain",
                "split_names",
            ),
        }
    )
