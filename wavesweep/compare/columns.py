"""The columns of the tables `compare` and `compare-bode`."""

from wavesweep.core.tables.fields import COLUMNS as OF_CORE

COLUMNS = {"compare": (OF_CORE["bode"][0], *OF_CORE["zwidth"]), "compare-bode": OF_CORE["bode"]}
