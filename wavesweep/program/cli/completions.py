"""What click's completion by the shell offers beside commands and options: the keys of --set, and their words."""

from collections.abc import Iterator

import click
from click.shell_completion import CompletionItem


def keys(
    _context: click.Context, _parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Keys of a spec that begin with what is typed, with their meanings."""
    return [
        CompletionItem(name, help=text) for name, text in _known() if name.startswith(incomplete)
    ]


def settings(
    _context: click.Context, _parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """`KEY=` and, behind the `=`, the words that the key takes."""
    from wavesweep.program.reading.keys import find_key

    name, equals, value = incomplete.partition("=")
    if not equals:
        return [
            CompletionItem(f"{name}=", help=text)
            for name, text in _known()
            if name.startswith(incomplete)
        ]
    key = find_key(name)
    words = dict.fromkeys(key.choices, "") | dict(key.meanings) if key else {}
    return [
        CompletionItem(f"{name}={word}", help=text)
        for word, text in words.items()
        if str(word).startswith(value)
    ]


def _known() -> Iterator[tuple[str, str]]:
    """The keys of a spec and their short names, each with what it is."""
    from wavesweep.program.reading.keys import KEYS, SYMBOLS
    from wavesweep.program.reading.tables import study_keys

    yield from ((name, key.description) for name, key in {**KEYS, **study_keys()}.items())
    yield from ((symbol, KEYS[path].description) for symbol, path in SYMBOLS.items())
