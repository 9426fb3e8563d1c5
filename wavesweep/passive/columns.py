"""The columns of the tables of `passivity`."""

from wavesweep.program.tables.fields import COLUMNS as OF_CORE
from wavesweep.program.tables.fields import columns_beside

COLUMNS = columns_beside(__file__) | {"passivity-along": OF_CORE["zwidth-hands"]}
