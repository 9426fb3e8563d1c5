"""The command line: parse, make one call into the core, write the results."""

from wavesweep.cli.entry import main

__all__ = ["main"]
