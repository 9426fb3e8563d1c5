"""The command line: parse, make one call into the core, write, say where."""

from wavesweep.cli.entry import main

__all__ = ["main"]
