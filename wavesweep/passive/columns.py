"""The columns of the tables of `passivity`."""

from wavesweep.program.tables.fields import COLUMNS as OF_CORE
from wavesweep.program.tables.fields import columns_beside

COLUMNS = columns_beside(
    __file__,
    derived={
        "excess": lambda columns: columns["channel_norm"] - 1,
        "energy_gain": lambda columns: columns["channel_norm"] ** 2 - 1,
    },
) | {"passivity-along": OF_CORE["zwidth-hands"]}
