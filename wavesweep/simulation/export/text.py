"""Templates with conditional parts, and numbers as C writes them."""

from collections.abc import Mapping
from importlib.resources import files
from string import Template

import numpy as np


def number(value: float) -> str:
    """A double as a hexadecimal constant of C99, which is exact."""
    return float(value).hex()


def comment(text: str) -> str:
    """A text of a user inside a comment, which it cannot end, nor begin another."""
    return text.replace("*/", "* /").replace("/*", "/ *")


def factor(value: float) -> str:
    """A double as a factor of a product, in parentheses if it is negative."""
    if value >= 0:
        return number(value)
    return f"({number(value)})"


def constants(numbers: Mapping[str, float]) -> dict[str, str]:
    """Each number exactly, and as a text for a comment."""
    exact = {name: number(value) for name, value in numbers.items()}
    return exact | {f"{name}_text": f"{value:g}" for name, value in numbers.items()}


def table_of(columns: Mapping[str, np.ndarray]) -> str:
    """The text of a CSV file with hexadecimal numbers; columns of whole numbers have decimal
    ones."""
    texts = [
        map(str if column.dtype.kind == "i" else float.hex, column.tolist())
        for column in columns.values()
    ]
    return "\n".join([",".join(columns), *map(",".join, zip(*texts, strict=True)), ""])


def filled(name: str, flags: Mapping[str, bool], values: Mapping[str, object]) -> str:
    """Return the template `c/<name>` with $names replaced by `values`.

    Lines between `@if flag` (or `@if !flag`) and `@end` are kept if the flag is true (or false);
    `@else` reverses that.
    """
    text = files("wavesweep.simulation.export").joinpath("c", name).read_text(encoding="utf-8")
    shown = [True]
    lines = []
    for line in text.splitlines():
        word, _, flag = line.partition(" ")
        if word == "@if":
            shown.append(flags[flag.removeprefix("!")] is not flag.startswith("!"))
        elif word == "@else":
            shown[-1] = not shown[-1]
        elif word == "@end":
            shown.pop()
        elif all(shown):
            lines.append(line)
    return Template("\n".join(lines) + "\n").substitute(values)
