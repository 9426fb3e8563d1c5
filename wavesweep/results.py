"""The tables of runs for users of the library: another name of `wavesweep.program.results`, the
same module."""

import sys
from typing import TYPE_CHECKING

from wavesweep.program import results

if TYPE_CHECKING:
    from wavesweep.program.results import Verification, read, read_table, verify

    __all__ = ["Verification", "read", "read_table", "verify"]

sys.modules[__name__] = results
