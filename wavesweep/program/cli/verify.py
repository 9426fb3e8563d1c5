"""`wavesweep verify`."""

import click

from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.options import PATH

MOST_LINES = 50  # of the differences of results


def _count(context: click.Context, option: click.Parameter, prove: str | None) -> int:
    del context, option
    if prove is not None and not (prove.isdecimal() and int(prove)):
        raise click.UsageError(
            f"--prove: expected a number of slices from 1 on, or none behind DIR, found {prove}"
        )
    return int(prove or 0)


@click.command("verify")
@click.argument("directory", metavar="DIR", type=PATH)
@click.option(
    "--prove",
    is_flag=False,
    flag_value="20",
    metavar="[N]",
    callback=_count,
    help="Also prove N certified slices of each table of intervals (20 without N) again in ball arithmetic, spread evenly over "
    "it, and say how many that confirms, refutes or cannot settle. It stands behind DIR.",
)
def command(directory: str, prove: int) -> int:
    """Hold results against their data packages, and compute a sample of the rows again.

    DIR is a folder of results. Hashes, columns, types and facts of every table in it are compared,
    and some of its rows with what the spec gives now. The exit code is 1 if anything differs, or if
    a proof refutes a certified row.

    \b
    Examples:
      wavesweep verify results/mine
      wavesweep verify results/mine --prove
    """
    from wavesweep.program.cli.messages import printable, progress, say, show_json
    from wavesweep.program.results.verification import verify

    report = progress("computing rows again", "--prove with fewer slices takes less")
    verified = verify(directory, prove=prove, progress=report)
    if verbosity().as_json:
        summary = {
            "command": "verify",
            "folder": directory,
            "checked": verified.checked,
            "differences": verified.differences,
        }
        show_json(summary | ({"proved": verified.proved} if prove else {}))
    else:
        if verified.checked and not verbosity().quiet:
            click.echo(printable("\n".join(verified.checked)))
        for difference in verified.differences[:MOST_LINES]:
            say(f"differs: {difference}", warning=True)
        if (unlisted := len(verified.differences) - MOST_LINES) > 0:
            say(f"and {unlisted} more differences", warning=True)
    return 1 if verified.differences else 0
