"""`wavesweep explore`."""

import os
import sys
from pathlib import Path, PurePath

import click

from wavesweep.engine.errors import UsageError
from wavesweep.program.cli.options import PATH, is_given, override, overwriting

_TITLE = b": wavesweep explore</title>"  # of each page


@click.command("explore")
@click.argument("spec", type=PATH)
@override
@click.option(
    "--save",
    metavar="FILE",
    type=PATH,
    help="Write the page with the results of the spec's sweep to a file, and serve nothing.",
)
@overwriting("Replace the file of --save if it exists.")
@click.option(
    "--port",
    metavar="N",
    type=click.IntRange(0, 65535),
    default=0,
    help="Port of the server [default: any free one].",
)
@click.option(
    "--browser/--no-browser",
    default=True,
    show_default=True,
    help="Open the page, or only print its address.",
)
def explore(
    spec: str,
    overrides: tuple[str, ...],
    save: str | None,
    overwrite: bool,
    port: int,
    browser: bool,
) -> None:
    """Show the boundary of stability in a browser, and vary every number by a slider.

    SPEC is a TOML file. The page has a slider for each number that the loop reads, the stable
    designs in the plane of two of them (K_VE over B_VE to begin with), the stable intervals through
    the design, the felt stiffness, admittance and impedance, and the norm of the wave channel. All
    of it follows while a slider is dragged; if the sliders rest, the intervals are certified and
    marked so. A button copies the design as TOML.

    The server answers on this machine alone, at an address with a secret in it, and ends if the
    page is closed or by Ctrl-C. With --save the page is written to a file that needs no server,
    with figures, tables, spec and facts of the sweep.

    \b
    Examples:
      wavesweep explore mine.toml
      wavesweep explore mine.toml --set b=40 --save mine.html
    """
    from wavesweep.program.spec import load

    if save is not None and PurePath(save).suffix.lower() not in (".html", ".htm"):
        raise click.UsageError(f"--save {save}: expected a file whose name ends in .html")
    if overwrite and save is None:
        raise click.UsageError("--overwrite: expected --save, whose file it replaces, found none")
    for name, option in (("port", "port"), ("browser", "no-browser")):
        if save is not None and is_given(name):
            raise click.UsageError(
                f"--save: expected no --{option} beside it, since nothing is served, found both"
            )
    loaded = load(spec, overrides)
    loaded.refuse_require("explore")
    if save is not None:
        _save(loaded, Path(save), overwrite)
        return
    from wavesweep.explore.explorer_page import Page
    from wavesweep.explore.server import Server
    from wavesweep.program.cli.messages import progress

    page = Page(loaded)
    try:
        server = Server(page.text, page.answers, port)
    except OSError as error:
        raise UsageError(
            f"--port {port}: {error.strerror}; expected a free port, or none for any"
        ) from error
    progress(None)
    click.echo(f"{server.address} (Ctrl-C or closing the page ends it)", err=True)
    if browser and _has_screen():
        import threading
        import webbrowser

        threading.Thread(target=webbrowser.open, args=(server.address,), daemon=True).start()
    server.serve()


def _has_screen() -> bool:
    """Whether a browser has a screen; without one Python would start a browser for terminals in this one."""
    return sys.platform == "darwin" or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


def _save(spec, target: Path, overwrite: bool) -> None:
    from wavesweep.explore.explorer_page import saved_page
    from wavesweep.program.cli.file_places import refuse_inputs, refuse_no_folder, write_whole
    from wavesweep.program.cli.messages import progress
    from wavesweep.program.plots import refuse_settings

    refuse_no_folder(target)
    refuse_inputs(spec.files, target)
    refuse_settings()
    expected = "another name, or --overwrite to replace it"
    # A run that was killed may have put this very page in place, which is seen once it is computed.
    if target.exists() and not overwrite and _TITLE not in target.read_bytes():
        raise UsageError(f"{target}: the file exists; expected {expected}")
    text = saved_page(spec, progress(less="fewer values in [sweep] take less"))
    write_whole((target, text), overwrite=overwrite, expected=expected)
    click.echo(str(target), err=True)
