"""The HTML of a report: a template, and the few elements that it is made of. Without styles it
reads as plain text."""

import re
from collections.abc import Iterable, Sequence
from html import escape
from string import Template

_PAGE = Template("""\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
$head
<style>
@page { size: A4; margin: 18mm 16mm; }
body { max-width: 52rem; margin: 2rem auto; padding: 0 1rem; color: #1a1a1a; background: #fff;
  font: 1rem/1.5 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 .4rem; }
h2 { font-size: 1.2rem; margin: 2rem 0 .5rem; padding-top: .6rem; border-top: 1px solid #ccc; break-after: avoid; }
p, ul { margin: .4rem 0; }
li { margin: .2rem 0; }
.question { font-size: 1.15rem; }
.words, figcaption, .small { color: #555; font-size: .88rem; }
.verdict { margin: .8rem 0; padding: .5rem .8rem; border-left: .35rem solid #0072b2; background: #eef5fa; break-inside: avoid; }
.verdict.doubt { border-color: #d55e00; background: #fcf1ea; }
.doubt strong, li.doubt { color: #a34700; }
.verdict ul { padding-left: 1.2rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; margin: .6rem 0; }
th, td { text-align: left; padding: .2rem .9rem .2rem 0; border-bottom: 1px solid #ddd; vertical-align: top;
  overflow-wrap: normal; }
td:not(:last-child) { white-space: nowrap; }
td:last-child { overflow-wrap: anywhere; min-width: 11rem; }
th { vertical-align: bottom; }
figure { margin: 1rem 0; break-inside: avoid; }
figure svg { max-width: 100%; height: auto; }
pre, code { font: .8rem/1.45 ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; }
pre { white-space: pre-wrap; padding: .6rem .8rem; background: #f6f6f4; }
@media screen and (prefers-color-scheme: dark) {
  html { color-scheme: dark; }
  body { color: #e4e4e4; background: #17191c; }
  h2, th, td { border-color: #454a50; }
  .words, figcaption, .small { color: #a9afb6; }
  .verdict { border-color: #4aa3dd; background: #1b2a36; }
  .verdict.doubt { border-color: #e58a3c; background: #35251a; }
  .doubt strong, li.doubt { color: #ffab70; }
  pre { background: #22262a; }
  figure svg { filter: invert(.93) hue-rotate(180deg) brightness(1.5); } /* light and dark change places, and colours stay */
}
@media screen and (max-width: 620px) { figure { overflow-x: auto; } figure svg { max-width: none; }
  td:last-child { min-width: 24rem; } } /* a table scrolls, and has no rows of eight lines */
@media print { body { max-width: none; margin: 0; padding: 0; font-size: 10pt; }
  figure svg { max-height: 11cm; } /* so that a page has room for the next one */
  .wide { overflow: visible; } td:not(:last-child) { white-space: normal; } }
</style>
</head>
<body>
<main>
$body
</main>
</body>
</html>
""")


def page(name: str, body: Iterable[str]) -> str:
    """The page of a spec of this name, with these elements in its body."""
    return _PAGE.substitute(head=head(name), body="\n".join(body))


def head(name: str) -> str:
    """The lines by which a report of a spec of this name is known."""
    return (
        f'<meta name="generator" content="wavesweep report">\n<title>{escape(name)}: report</title>'
    )


def element(name: str, text: str, kind: str = "") -> str:
    """An element around a text. kind: its class."""
    opened = f'{name} class="{kind}"' if kind else name
    return f"<{opened}>{escape(text)}</{name}>"


def verdict(certified: bool, title: str, text: str, lines: Iterable[tuple[str, bool]]) -> str:
    """What stands out: whether it is certified in its first words, a sentence, and lines as in a
    listing."""
    said = f"<p><strong>{escape(title)}</strong> {escape(text)}</p>"
    return f'<div class="verdict{"" if certified else " doubt"}">\n{said}\n{listing(lines)}\n</div>'


def listing(lines: Iterable[tuple[str, bool]]) -> str:
    """Lines, each with a flag that is true for a warning; one that is indented is below the line
    before, or part of it."""
    headings = _headings(lines)
    items = ""
    for at, (depth, text, warning) in enumerate(headings):
        below = depth > headings[0][0]
        if below and headings[at - 1][0] < depth:
            items = items.removesuffix("</li>\n") + "\n<ul>\n"
        items += element("li", text, "doubt" * warning) + "\n"
        if below and (at + 1 == len(headings) or headings[at + 1][0] < depth):
            items += "</ul>\n</li>\n"
    return f"<ul>\n{items}</ul>" if items else ""


def _headings(lines: Iterable[tuple[str, bool]]) -> list[tuple[int, str, bool]]:
    """The depth of every line, its text with its continuations, and whether one of them is a
    warning."""
    headings: list[tuple[int, str, bool]] = []
    for text, warning in lines:
        depth = len(text) - len(text.lstrip())
        if headings and depth >= headings[-1][0] + 4:  # what a terminal has in two lines
            depth, before, doubt = headings.pop()
            headings.append((depth, f"{before} {text.strip()}", doubt or warning))
        else:
            headings.append((min(depth, 2), text.strip(), warning))
    return headings


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of texts, which scrolls on its own where it is too wide."""
    lines = "\n".join([_row("th", head), *(_row("td", row) for row in rows)])
    region = (
        f'class="wide" role="region" tabindex="0" aria-label="Table of {escape(", ".join(head))}"'
    )
    return f"<div {region}><table>\n{lines}\n</table></div>"


def _row(name: str, texts: Sequence[str]) -> str:
    """A row of cells with the name of an element."""
    return f"<tr>{''.join(element(name, text) for text in texts)}</tr>"


# times its size on paper, a figure on the page: its smallest texts have 11 pixels
LARGER_ON_PAGE = 1.19


def _enlarged(size: re.Match[str]) -> str:
    return f'{size[1]}="{LARGER_ON_PAGE * float(size[2]):.2f}pt"'


def figure(svg: str, number: int, caption: str) -> str:
    """A figure as matplotlib writes it, whose names are its own on the page. number: of the
    figure."""
    inside = re.sub(r"<metadata>.*?</metadata>\s*", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    inside = re.sub(r'\b(width|height)="([\d.]+)pt"', _enlarged, inside, count=2)
    inside = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>f{number}-", inside).strip()
    return f'<figure tabindex="0">\n{inside}\n{element("figcaption", f"Figure {number}. {caption}")}\n</figure>'
