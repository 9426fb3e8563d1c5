"""The width and the style of figures that a user asks for, as texts."""

import re
from pathlib import Path
from typing import Any

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import nearest
from wavesweep.program.plots import refuse_settings

LEAST, MOST = 2.0, 20.0  # inches
_INCHES = {"": 1.0, "in": 1.0, "mm": 1 / 25.4, "cm": 1 / 2.54}
# set by the program
_OWN = ("backend", "figure.figsize", "figure.dpi", "savefig.bbox", "savefig.dpi")


def width_of(text: str) -> float:
    """Return a width such as 3.5, 3.5in, 89mm or 8.9cm in inches. Errors: UsageError."""
    match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(in|mm|cm|)\s*", text)
    width = float(match[1]) * _INCHES[match[2]] if match else 0.0
    if not LEAST <= width <= MOST:
        expected = f"a width from {LEAST:g} to {MOST:g} inches, such as 3.5in, 89mm or 8.9cm"
        raise UsageError(f"--width: expected {expected}, found {text}")
    return width


def style_of(text: str) -> dict[str, Any]:
    """Return the settings of a style of matplotlib, by its name or from a file. Errors:
    UsageError for anything else."""
    refuse_settings()
    import matplotlib
    import matplotlib.style

    if text in matplotlib.style.library:
        settings = dict(matplotlib.style.library[text])
    elif Path(text).is_file():
        settings = _read(Path(text))
    else:
        close = nearest(text, matplotlib.style.library)
        hint = f" (did you mean {close}?)" if close else ""
        names = "the name of a style of matplotlib, such as ggplot, or a file with settings"
        raise UsageError(f"--style: expected {names}, found {text}{hint}")
    if settings.get("text.usetex"):
        raise UsageError(
            f"--style: expected a style whose texts matplotlib sets itself, found text.usetex in {text}"
        )
    return {name: value for name, value in settings.items() if name not in _OWN}


def _read(path: Path) -> dict[str, Any]:
    """The settings of a file. matplotlib itself only warns of mistakes, and goes on."""
    import matplotlib

    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise UsageError(
            f"--style: expected a text with settings, found {path}, which is not UTF-8"
        ) from error
    settings = {}
    for number, line in enumerate(lines, 1):
        if not line.partition("#")[0].strip():
            continue
        name, colon, rest = line.partition(":")
        name, value = name.strip(), re.match(r'\s*("[^"]*"|[^#]*)', rest)[1].strip().strip('"')
        if not colon or name not in matplotlib.rcParams:
            close = nearest(name, matplotlib.rcParams)
            hint = f" (did you mean {close}?)" if close else ""
            raise UsageError(
                f"--style: {path}:{number}: expected a setting of matplotlib, found {name}{hint}"
            )
        try:
            settings[name] = matplotlib.RcParams({name: value})[name]
        except ValueError as error:
            raise UsageError(f"--style: {path}:{number}: {error}") from error
    return settings
