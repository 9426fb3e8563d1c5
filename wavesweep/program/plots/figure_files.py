"""Figures as files: PNG, SVG, PDF and EPS, the same bytes for the same drawing."""

import re
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from wavesweep.program.atomic_files import made_folder, scratch
from wavesweep.program.plots.style import png, style


def save(canvas: Any, path: Path, about: Mapping[str, str]) -> None:
    """Write a figure by the suffix of `path`, with texts about it (see `about_figure`) in its
    metadata.

    The same drawing gives the same bytes: there is no date in the file.
    """
    from matplotlib.lines import Line2D

    words = {"Title": about["Title"], "Creator": about["Software"]}
    with style():
        if path.suffix == ".png":
            path.write_bytes(png(canvas, about))
        elif path.suffix == ".svg":
            words |= {"Date": None, "Description": _lines(about)}
            for line in canvas.findobj(Line2D):  # each mark would be an element: megabytes of them
                line.set_rasterized(
                    # Marks of a line in an SVG; more are an image.
                    line.get_linestyle() == "None" and len(line.get_xdata()) > 500
                )
            # Dots per inch of marks that are an image.
            canvas.savefig(path, format="svg", metadata=words, dpi=400)
        elif path.suffix == ".eps":
            file, title = BytesIO(), f"%%Title: {about['Title']}\n".encode("ascii", "replace")
            canvas.savefig(
                file, format="eps", metadata={"Creator": f"{about['Software']}; {_lines(about)}"}
            )
            path.write_bytes(
                re.sub(rb"%%CreationDate: .*\n", lambda _: title, file.getvalue(), count=1)
            )
        else:
            words |= {"Subject": _lines(about), "CreationDate": None}
            canvas.savefig(path, format="pdf", metadata=words)


def save_all(
    canvas: Any, directory: Path, stem: str, formats: Sequence[str], about: Mapping[str, str]
) -> list[Path]:
    """Write a figure in several formats, each whole or not at all, into a folder, which is created;
    returns the paths.

    about: see `save`.
    """
    written = [directory / f"{stem}.{form}" for form in dict.fromkeys(formats)]
    with made_folder(directory), scratch(directory) as folder:
        for path in written:
            try:
                save(canvas, folder / path.name, about)
            except OSError as error:
                raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        for path in written:
            (folder / path.name).replace(path)
    return written


def _lines(about):
    return "; ".join(
        f"{name}: {text}" for name, text in about.items() if name not in ("Title", "Software")
    )
