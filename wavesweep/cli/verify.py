"""`wavesweep verify`."""

import click

from wavesweep.cli.options import talk


@click.command("verify")
@click.argument("directory", metavar="DIR")
def command(directory: str) -> int:
    """Hold results against their data packages, and compute a sample of the rows again.

    DIR is a folder of results. Hashes, columns, types and facts of every table in it are compared, and some of its rows with
    what the spec gives now. The exit code is 1 if anything differs.

    \b
    Example:
      wavesweep verify results/mine
    """
    from wavesweep.cli.messages import printable, say, show_json
    from wavesweep.results.verify import verify

    found = verify(directory)
    if talk().as_json:
        show_json({"command": "verify", "folder": directory, "checked": found.checked, "differences": found.differences})
    else:
        if found.checked and not talk().quiet:
            click.echo(printable("\n".join(found.checked)))
        for difference in found.differences:
            say(f"differs: {difference}", warning=True)
    return 1 if found.differences else 0
