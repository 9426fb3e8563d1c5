"""The site of the documents: `python -m sphinx -W docs site`, with the package installed."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from reference import filled  # noqa: E402 - it stands beside this file

project = "wavesweep"
author = copyright = "The wavesweep authors"  # noqa: A001 - Sphinx's name
extensions = ["myst_parser", "sphinx_copybutton"]
exclude_patterns = ["*.ipynb"]
myst_heading_anchors = 3
html_theme = "furo"
html_static_path, html_css_files = ["_static"], ["site.css"]
smartquotes = False  # they turn --set into a dash and quotes of a shell into others
suppress_warnings = ["myst.xref_missing"]  # links to files beside the site; a test follows all of them
copybutton_prompt_text = r"\$ |>>> |\.\.\. "  # is not copied, nor is what a command prints below its prompt
copybutton_prompt_is_regexp = True
copybutton_line_continuation_character = "\\"

# The pages in the order of the site. They stand here, so that the files have no directives, which a forge does not show.
SECTIONS = {
    "Start": "haptics three-axes drives first-drawing gallery",
    "Concepts": "concepts controllers",
    "Guides": "check sweeps identify for-all frames timing margins drawn-loops design results",
    "Reference": "commands keys blocks tables library engine",
    "Background": "proof check-it-yourself proof-files accuracy speed in-place-of design-notes",
}


def source_of(page, text):
    """The text of a page of the site: with what the program says, and the list of pages on the first one."""
    text = filled(text)
    if page == "index":
        for title, names in SECTIONS.items():
            text += "\n".join(["", "```{toctree}", f":caption: {title}", ":hidden:", "", *names.split(), "```", ""])
    return text


def setup(app):
    """Read the pages as the site has them."""
    app.connect("source-read", lambda _, page, source: source.insert(0, source_of(page, source.pop())))
