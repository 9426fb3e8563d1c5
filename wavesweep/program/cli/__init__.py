"""The command line: parse, make one call into the core, write the results."""

from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code, see `wavesweep.program.cli.entry`.

    What a start takes is loaded here, so that a Ctrl-C meanwhile has its line as well.
    """
    try:
        from wavesweep.program.cli import entry

        return entry.main(arguments)
    except KeyboardInterrupt:
        import sys

        sys.stderr.write("Interrupted.\n")
        return 130


__all__ = ["main"]
