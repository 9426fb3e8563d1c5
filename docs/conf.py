"""The site of the documents: `python -m sphinx -W docs site`, with the package installed."""

import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

project = "wavesweep"
author = copyright = "The wavesweep authors"  # noqa: A001 - Sphinx's name
extensions = ["myst_parser", "sphinx_copybutton"]
exclude_patterns = ["*.ipynb"]
myst_heading_anchors = 3
html_theme = "furo"
html_static_path, html_css_files = ["_static"], ["site.css"]
smartquotes = False  # they turn --set into a dash and quotes of a shell into others
suppress_warnings = ["myst.xref_missing"]  # links to files beside the site; a test follows them
copybutton_prompt_text = r"\$ |>>> |\.\.\. "  # is not copied, nor is what a command prints below its prompt
copybutton_prompt_is_regexp = True
copybutton_line_continuation_character = "\\"

# The pages in the order of the site. They stand here, so that the files have no directives, which a forge does not show.
SECTIONS = {
    "Start": "haptics drives first-drawing paper gallery",
    "Concepts": "concepts controllers",
    "Guides": "questions check sweeps gains identify measured for-all contact frames margins poles drawn-loops axes design "
    "export results clusters",
    "Reference": "commands keys blocks tables other-programs json library engine",
    "Background": "proof accuracy safety speed",
}
SEE = re.compile(r"See \[.*\]\((\.\./wavesweep/\w+\.md)\)\.\n")  # a page that stands beside the code


def source_of(page, text):
    """The text of a page of the site: with the contents in place of a link to it, and the list of pages on the first one."""
    if see := SEE.fullmatch(text):
        text = (HERE / see[1]).read_text(encoding="utf-8")
    pages = {SEE.fullmatch(path.read_text("utf-8")): path.name for path in HERE.glob("*.md")}
    for see, name in pages.items():
        text = re.sub(rf"\]\({re.escape(see[1])}(#[^)]*)?\)", rf"]({name}\1)", text) if see else text
    if page == "index":
        for title, names in SECTIONS.items():
            text += "\n".join(["", "```{toctree}", f":caption: {title}", ":hidden:", "", *names.split(), "```", ""])
    return text


def setup(app):
    """Read the pages as the site has them."""
    app.connect("source-read", lambda _, page, source: source.insert(0, source_of(page, source.pop())))
