"""The site of the documents: `python -m sphinx -W docs site`, with the package installed, of which the reference is made."""

import sys
from itertools import count
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import reference

project = "wavesweep"
author = copyright = "The wavesweep authors"  # noqa: A001 - Sphinx's name
extensions = ["myst_parser"]
myst_heading_anchors = 3
html_theme = "furo"
html_static_path, html_css_files = ["_static"], ["site.css"]
smartquotes = False  # they turn --set into a dash and quotes of a shell into others
suppress_warnings = ["myst.xref_missing"]  # links to files beside the site; a test follows them


def setup(app):
    """Fill the pages as they are read; those with marks are read at every build, since the code may have changed.

    With the tag `sample` only each eighth figure of the gallery is drawn, as for a test of the pages.
    """
    if app.tags.has("sample"):
        numbers = count()
        reference.MADE["picture"] = lambda name: "" if next(numbers) % 8 else reference.picture(name)
    app.connect("source-read", lambda _, __, source: source.insert(0, reference.filled(source.pop())))
    marked = [path.stem for path in reference.HERE.glob("*.md") if reference.MARK.search(path.read_text("utf-8"))]
    app.connect("env-get-outdated", lambda *_: marked)
