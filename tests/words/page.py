"""The texts of a report: each with the title of its section, and the kind of element that it stands in."""

import re
from html.parser import HTMLParser

KINDS = {"h1", "h2", "p", "strong", "li", "tr", "pre", "figcaption", "g", "style", "title"}


class _Page(HTMLParser):
    """Collects texts; those of cells of a row are put together, and so are the lines of one text of a figure."""

    def __init__(self):
        super().__init__()
        self.open, self.said, self.section, self.texts = [], "", "", []

    def handle_starttag(self, tag, attrs):
        if tag in KINDS:
            self._end_of_text()
            names = dict(attrs)
            self.open.append((tag, names.get("class") or names.get("id", "")))

    def handle_data(self, data):
        self.said += data.replace("\N{NO-BREAK SPACE}", " ").replace("\N{MINUS SIGN}", "-")

    def handle_endtag(self, tag):
        if tag in KINDS:
            self._end_of_text()
            opened, _ = self.open.pop()
            assert opened == tag, (opened, tag, self.section)
        if tag in ("td", "th"):
            self.said += " | "

    def _end_of_text(self):
        text = self.said.strip() if self.open and self.open[-1][0] == "pre" else " ".join(self.said.split())
        self.said = ""
        if not text or not self.open:
            return
        kind, name = self.open[-1]
        if kind == "h2":
            self.section = text
        in_a_figure = any(tag == "g" for tag, _ in self.open)
        tick = any("matplotlib.axis" in each for _, each in self.open) and re.fullmatch(
            r"-?[\d.]+(e-?\d+)?|1 0( -)?( \d)+", text
        )
        if kind not in ("style", "title") and not tick:
            self.texts.append((self.section, "drawn" if in_a_figure else name or kind, text.strip(" |")))


def texts_of(page):
    """The texts of a report as (section, kind, text); numbers at ticks of an axis are left out."""
    parser = _Page()
    parser.feed(page)
    return parser.texts
