"""The site of the documents: `python -m sphinx -W docs site`."""

project = "wavesweep"
author = copyright = "The wavesweep authors"  # noqa: A001 - Sphinx's name
extensions = ["myst_parser"]
myst_heading_anchors = 3
html_theme = "furo"
suppress_warnings = ["myst.xref_missing"]  # links to files beside the site; a test follows them
