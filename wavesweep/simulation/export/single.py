"""A controller in single precision, with what holds it against doubles tick by tick.

Each of the N operations and constants of a tick is rounded once to a float, so a number that the
tick computes from floats of the same state and inputs is off by at most N u/(1 - N u) times what it
would be if all terms were positive, u = 2^-24 (Higham, Accuracy and Stability of Numerical
Algorithms, 2002, section 3.1). That is computed beside it, by the same program without its signs.
What stays of it in later ticks is not bounded: without its device a controller may be unstable.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from wavesweep.engine.errors import UsageError
from wavesweep.simulation.export.controller import ExportedController
from wavesweep.simulation.export.text import filled

_CONSTANT = re.compile(r"(0x[\da-f.]+p[+-]\d+|(?<![\w.])\d+\.0(?![\w.]))")


def operations_of(functions: Sequence[str]) -> int:
    """How many operations and constants a tick has at most, the rounding of what it begins with and
    of a wall among them. functions: its programs in C."""
    return 10 + max(
        2 * text.count("*") + text.count(" + ") + text.count(" - ") for text in functions
    )


# says how far floats move an output, in the place of the line that takes the output
TOLD = r'    printf("%s: off by at most %.2g, within %.2g\\n", NAME[\1], off[\1], widest[\1]);'


def refuse_decisions(controller: ExportedController) -> None:
    """Raise UsageError for a controller whose ticks decide something by the size of a number."""
    wall = controller.loop.wall
    if controller.late or (wall and (wall.position is not None or not wall.pulls)):
        raise UsageError(
            "export: --float is for a linear loop, and [simulate] has late results, frames that vary or a one-sided wall; --set "
            "leaves them out"
        )


def _renamed(text: str, letter: str) -> str:
    """A file with a letter in all names of the controller, so that several stand beside each other."""
    apart = text.replace('"controller', f'"controller_{letter}')
    return re.sub(r"\b(ws|WS)_", rf"\1{letter}_", apart)


def single(
    controller: ExportedController,
    files: Mapping[str, str],
    flags: Mapping[str, bool],
    values: Mapping[str, Any],
) -> dict[str, str]:
    """The files of a controller in floats, beside the same in doubles and without signs. files:
    those in doubles; flags, values: of their templates.

    Errors: see `refuse_decisions`.
    """
    refuse_decisions(controller)

    def program(flags, values):
        return filled("guards.c", flags, values) + filled("controller.c", flags, values)

    flags = flags | {"single": True}
    beside = {
        "read": _renamed(values["read"], "D"),
        "compared": _renamed(values["compared"], "D"),
        "told": re.sub(r" +out\.\w+ = z\[(\w+)\];", TOLD, values["taken"]),
        "names": re.sub(r"ws_z_(\w+)", r'"\1"', values["places"]),
    }
    unsigned = values | {"programs": _without_signs(values["programs"])}
    sizes = {"single": False, "sizes": True}
    header = files["controller.h"]
    return {
        "controller.h": _in_floats(filled("controller.h", flags, values)),
        "controller.c": _in_floats(program(flags, values)),
        "controller_D.h": _renamed(header, "D"),
        "controller_D.c": _renamed(files["controller.c"], "D"),
        "controller_A.h": _renamed(header, "A"),
        "controller_A.c": _renamed(program(flags | sizes, unsigned), "A"),
        "check.c": filled("check_floats.c", flags, values | beside),
        "example.c": _in_floats(files["example.c"]),
        "vectors.csv": files["vectors.csv"],
        "Makefile": filled("Makefile", flags, values),
    }


def _without_signs(programs: str) -> str:
    """Programs whose terms are all positive, and which have no limits."""
    lines = []
    for line in programs.splitlines():
        free = re.sub(r"= \(z.* \? (z\[\w+\]) :", r"= \1 +", line)  # what a limit stops, or not
        if "meet(" not in line:
            free = re.sub(r" - (?=[z0(])", " + ", free).replace("(-", "(")
        if " < " not in free:
            lines.append(free)
    return "\n".join(lines)


def _in_floats(text: str) -> str:
    """A file in C with floats in place of doubles."""
    lines = []
    for line in text.splitlines():
        is_comment = line.lstrip().startswith(("*", "/*"))
        lines.append(line if is_comment else _CONSTANT.sub(r"\1f", line.replace("double", "float")))
    return "\n".join([*lines, ""])
