"""The columns of the tables `identify` and `identify-response`."""

from wavesweep.program.tables.fields import columns_beside

COLUMNS = columns_beside(__file__)
