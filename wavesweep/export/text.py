"""Templates with conditional parts, and numbers as C writes them."""

from collections.abc import Mapping
from importlib.resources import files
from string import Template


def number(value: float) -> str:
    """A double as a hexadecimal constant of C99, which is exact."""
    return float(value).hex()


def filled(name: str, flags: Mapping[str, bool], values: Mapping[str, object]) -> str:
    """Return the template `c/<name>` with $names replaced by `values`.

    Lines between `@if flag` (or `@if !flag`) and `@end` are kept if the flag is true (or false); `@else` reverses that.
    """
    text = files("wavesweep.export").joinpath("c", name).read_text(encoding="utf-8")
    kept, lines = [True], []
    for line in text.splitlines():
        word, _, flag = line.partition(" ")
        if word == "@if":
            kept.append(flags[flag.removeprefix("!")] is not flag.startswith("!"))
        elif word == "@else":
            kept[-1] = not kept[-1]
        elif word == "@end":
            kept.pop()
        elif all(kept):
            lines.append(line)
    return Template("\n".join(lines) + "\n").substitute(values)
