"""The columns of the table `stability-map`."""

from wavesweep.program.tables.fields import columns_beside

COLUMNS = columns_beside(__file__)
