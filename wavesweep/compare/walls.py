"""What `zwidth` asks of this capability for several specs."""

from wavesweep.compare.table import walls_of

__all__ = ["walls_of"]
