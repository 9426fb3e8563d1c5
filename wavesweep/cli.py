"""The command line under a short name, for programs that call it: `from wavesweep.cli import
main`."""

from wavesweep.program.cli import main

__all__ = ["main"]
