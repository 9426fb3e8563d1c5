"""The columns of the table `design` beside those that a spec varies and wishes."""

from wavesweep.program.tables.fields import columns_beside

COLUMNS = {}  # of the kind: they follow from the spec
DESIGN = columns_beside(__file__)["design"]
