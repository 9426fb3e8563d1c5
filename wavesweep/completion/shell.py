"""Shell completion: specs, keys and values of --set, devices and controllers. Loaded only if a shell asks for it.

A command may complete a parameter of its own by click's `shell_complete`.
"""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from types import MappingProxyType

import click
from click.shell_completion import BashComplete, CompletionItem, add_completion_class, split_arg_string

from wavesweep.engine.drawing.block_types import TICK_HZ, TYPES
from wavesweep.engine.drawing.drawing import MARKS, RATE
from wavesweep.engine.drawing.drawing_keys import is_dotted, is_name
from wavesweep.engine.drawing.drawn_block import keys_of_block
from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.keys.key import Key
from wavesweep.engine.loops.controllers import CONTROLLERS
from wavesweep.program.reading.devices import DEVICES
from wavesweep.program.reading.keys import KEYS, SYMBOLS, find_key
from wavesweep.program.reading.reading import read_file
from wavesweep.program.reading.tables import study_keys

STUDIES = ("sweep", "bode")
# After `KEY=` there is no space, so that the value can be typed.
NO_SPACE = "[[ ${#COMPREPLY[@]} -eq 1 && ${COMPREPLY[0]} == *= ]] && compopt -o nospace"


class Bash(BashComplete):
    """Bash takes `--set KEY=VALUE` apart at the `=` and replaces only the part behind it."""

    source_template = BashComplete.source_template.replace("    return 0\n", f"    {NO_SPACE}\n\n    return 0\n")
    _typed = ""

    def get_completion_args(self) -> tuple[list[str], str]:
        """Words before the cursor and the incomplete one, both with their `=`."""
        position = int(os.environ["COMP_CWORD"])
        words = split_arg_string(os.environ["COMP_WORDS"])[1 : position + 1]
        incomplete = len(words) == position
        joined: list[str] = []
        for before, word in zip(["", *words], words, strict=False):
            if joined and "=" in (before, word):
                joined[-1] += word
            else:
                joined.append(word)
        last = joined.pop() if incomplete and joined else ""
        self._typed = last[: last.rfind("=") + 1].removeprefix("--set=")
        return joined, last

    def format_completion(self, item: CompletionItem) -> str:
        """Type and value without the part that is typed already."""
        return f"{item.type},{item.value.removeprefix(self._typed)}"


def register() -> None:
    """Let click use the completion of this module for bash; it knows zsh and fish."""
    add_completion_class(Bash)


def prepare(command: click.Command) -> click.Command:
    """Give the parameters of a command their completions, by name."""
    for parameter in command.params:
        if parameter.name in COMPLETIONS:
            parameter.shell_complete = _completer(COMPLETIONS[parameter.name])
    return command


def _completer(candidates: Callable[..., Iterable[CompletionItem]]) -> Callable:
    read = {settings: _drawn_keys, axes: _drawn_keys, cuts: _signals}.get(candidates)
    return lambda context, incomplete: list(candidates(incomplete, *([read(context)] if read else [])))


def _tables(context: click.Context) -> Iterator[dict]:
    """The tables of the specs that are typed already; a spec that is still written, or none at all, is left out."""
    specs = [context.params.get("spec"), *(context.params.get("specs") or ())]
    # Where an option has no value yet, click leaves arguments where they are.
    for path in filter(None, [*specs, *context.args]):
        with suppress(WavesweepError):
            yield read_file(path)[0]


def _signals(context: click.Context) -> list[str]:
    """The outputs of blocks that some wire reads in the specs that are typed already."""
    wires = (tables.get("wire") for tables in _tables(context))
    texts = (str(text) for table in wires if isinstance(table, dict) for text in table.values())
    return sorted({signal for text in texts for signal in re.findall(r"[A-Za-z_][\w.]*\.[A-Za-z_]\w*", text)})


def _drawn_keys(context: click.Context) -> dict[str, Key]:
    """The keys of the drawn loops among the specs that are typed already, by their names; empty without a drawn loop.

    These are its rate, its numbers by their names and paths and as axes, and the keys of its blocks.
    """
    keys_found: dict[str, Key] = {}
    for tables in _tables(context):
        if not any(mark in tables for mark in MARKS):
            continue
        numbers, blocks = (table if isinstance(table, dict) else {} for table in map(tables.get, ("numbers", "block")))
        keys_found[RATE] = TICK_HZ
        for name, number in ((name, number) for name, number in numbers.items() if is_name(name)):  # which no shell would run
            keys_found |= _keys_of_number(name, number)
        for name, block in ((name, block) for name, block in blocks.items() if is_dotted(name)):
            keys_found |= _keys_of_block(name, block)
    return keys_found


def _keys_of_number(name: str, number: object) -> dict[str, Key]:
    """A number of a drawn loop by its name and path and as an axis."""
    text = " ".join(str(number.get("description", "")).split()) if isinstance(number, dict) else ""
    key = Key(f"numbers.{name}", "number", None, "", text)
    return {name: key, key.path: key} | {f"{study}.{name}": key for study in STUDIES}


def _keys_of_block(name: str, block: object) -> dict[str, Key]:
    """The keys of a block of a drawn loop, and its numbers as axes."""
    typed = isinstance(block, dict) and block.get("type") in TYPES
    block_keys = {f"block.{name}.{key}": row for key, row in (keys_of_block(block["type"]) if typed else {}).items()}
    return block_keys | {f"{study}.{path}": row for path, row in block_keys.items() if row.numeric for study in STUDIES}


def _items(known: Mapping[str, Key], incomplete: str) -> Iterator[CompletionItem]:
    return (CompletionItem(name, help=key.description) for name, key in known.items() if name.startswith(incomplete))


def keys(incomplete: str) -> Iterator[CompletionItem]:
    """Keys, symbols and axes that begin with `incomplete`; of the axes the symbols, or all behind `sweep.`."""
    keys_known = {**KEYS, **study_keys(), **{symbol: KEYS[path] for symbol, path in SYMBOLS.items()}}
    for study in STUDIES:
        keys_known |= {f"{study}.{name}": find_key(name) for name in (_axes() if incomplete.startswith(f"{study}.") else ())}
    yield from _items(keys_known, incomplete)
    if incomplete.startswith("block."):
        yield from _among({f"block.{kind}": block_type.description for kind, block_type in TYPES.items()})(incomplete)


def settings(incomplete: str, drawn: Mapping[str, Key]) -> Iterator[CompletionItem]:
    """`KEY=` for --set, and behind the `=` the values that the key takes, if these are words. drawn: see `_drawn_keys`."""
    name, equals, value = incomplete.partition("=")
    if not equals:
        for item in _items({**drawn, **study_keys()}, incomplete) if drawn else keys(incomplete):
            yield CompletionItem(f"{item.value}=", help=item.help)
        return
    key = drawn.get(name) or find_key(name) or study_keys().get(name)
    names = _axes(drawn) if name == "sweep.along" else dict.fromkeys(key.choices, "") | dict(key.meanings) if key else {}
    for choice, meaning in names.items():
        if str(choice).startswith(value):
            yield CompletionItem(f"{name}={choice}", help=meaning)


def axes(incomplete: str, drawn: Mapping[str, Key]) -> Iterator[CompletionItem]:
    """Names of axes. drawn: see `_drawn_keys`."""
    return iter(_among(_axes(drawn))(incomplete))


def cuts(incomplete: str, signals: Iterable[str]) -> Iterator[CompletionItem]:
    """Signals at which a loop can be broken."""
    return (CompletionItem(signal) for signal in signals if signal.startswith(incomplete))


def _axes(drawn: Mapping[str, Key] = MappingProxyType({})) -> dict[str, str]:
    if drawn:
        return {name: key.description for name, key in drawn.items() if "." not in name}
    names = [*SYMBOLS, *(path for path, key in KEYS.items() if key.numeric and path not in SYMBOLS.values())]
    return {name: find_key(name).description for name in names}


def _among(meanings: dict[str, str]) -> Callable[[str], list[CompletionItem]]:
    return lambda incomplete: [
        CompletionItem(name, help=text) for name, text in meanings.items() if name.startswith(incomplete)
    ]


def _loops(incomplete: str) -> list[CompletionItem]:
    from wavesweep.program.cli.init import drawn_loops

    kinds = {kind: controller.description for kind, controller in CONTROLLERS.items()} | dict.fromkeys(drawn_loops(), "")
    return _among(kinds)(incomplete)


def _files(incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(incomplete, type="file")]


def _hands(incomplete: str) -> list[CompletionItem]:
    from wavesweep.program.row_kinds import hands_offered

    return _among(hands_offered())(incomplete)


# Name of a parameter of any command -> its candidates.
COMPLETIONS: dict[str, Callable[..., Iterable[CompletionItem]]] = {
    **dict.fromkeys(("spec", "specs", "log", "table", "tables", "out", "directory", "save"), _files),
    **dict.fromkeys(("kind", "example"), _loops),
    "overrides": settings,
    **dict.fromkeys(("along", "locus", "over"), axes),
    "cut": cuts,
    "name": keys,
    "device": _among({name: device.title for name, device in DEVICES.items()}),
    "backend": _among({"loky": "processes of this machine", "threading": "threads", "dask": "with --scheduler"}),
    "for_hands": _hands,
}
