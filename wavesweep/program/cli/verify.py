"""`wavesweep verify`."""

import click

from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.options import PATH

MOST_LINES = 50  # of the differences of results


@click.command("verify")
@click.argument("directory", metavar="DIR", type=PATH)
def command(directory: str) -> int:
    """Hold results against their data packages, and compute a sample of the rows again.

    DIR is a folder of results. Hashes, columns, types and facts of every table in it are compared,
    and some of its rows with what the spec gives now; the checker reads the proof file that `--proof` of `zwidth` and
    `stability-region` wrote. The exit code is 1 if anything differs or a claim is refused.

    \b
    Example:
      wavesweep verify results/mine
    """
    from wavesweep.program.cli.messages import printable, progress, say, show_json
    from wavesweep.program.results.verification import verify

    verified = verify(directory, progress=progress("computing rows again"))
    if verbosity().as_json:
        summary = {
            "command": "verify",
            "folder": directory,
            "checked": verified.checked,
            "differences": verified.differences,
        }
        show_json(summary)
    else:
        if verified.checked and not verbosity().quiet:
            click.echo(printable("\n".join(verified.checked)))
        for difference in verified.differences[:MOST_LINES]:
            say(f"differs: {difference}", warning=True)
        if (unlisted := len(verified.differences) - MOST_LINES) > 0:
            say(f"and {unlisted} more differences", warning=True)
    return 1 if verified.differences else 0
