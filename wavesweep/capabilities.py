"""The capabilities: what stands beside engine, haptics and program, a line for each.

Nothing of one is imported until it is asked for.

A capability is the folder of its name: `command.py` has its commands, `table.py` its kinds of
tables, `library.py` its calls. What it offers to others stands in modules such as `on_check.py`; of
those that several offer, `program.seams` has names and signatures. It imports these three and no
other capability, and the program asks this list what there is. A capability is taken away by
deleting its folder, its tests and its line.
"""

from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple


class Capability(NamedTuple):
    """One capability.

    name: of its folder. commands: each with its short help. tables: of a spec, which it reads.
    kinds: of tables that it makes. library: names that `library.py` has for users: functions of
    `wavesweep`, and methods of its loops, as "Loop.margins", in a class of its own, see
    `class_for`. offers: modules of the folder that others may ask for, see `modules` and `offered`.
    """

    name: str
    commands: Mapping[str, str] = MappingProxyType({})
    tables: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    library: tuple[str, ...] = ()
    offers: tuple[str, ...] = ()

    def name_of(self, module: str) -> str:
        """The whole name of one of its modules."""
        return f"wavesweep.{self.name}.{module}"

    def class_for(self, name: str) -> str:
        """The class of `library.py` with its methods for a class of the library: `LoopMargins`
        for `Loop`."""
        return name + self.name.title().replace("_", "")

    def module(self, name: str) -> ModuleType:
        """Import one of its modules."""
        return import_module(self.name_of(name))


# Rows of guarantees are listed in this order, from what promises least: those of for_all before
# those of passive.
CAPABILITIES = (
    Capability("for_all", tables=("for_all",), offers=("guarantee", "keys", "on_check", "rules")),
    Capability("late_ticks", tables=("for_all.tick",), offers=("guarantee", "keys", "on_check")),
    Capability(
        "contact",
        tables=("for_all.contact",),
        offers=(
            "guarantee",
            "keys",
            "on_check",
            "rows_in_frames",
            "stored_search",
            "stretches",
            "sums_of_squares",
        ),
    ),
    Capability(
        "check",
        {"check": "Judge a spec's own design, and say what to do next."},
        library=("verdict",),
        offers=("on_check", "verdict"),
    ),
    Capability(
        "simulation",
        {
            "simulate": "Simulate the loop tick by tick, optionally with contact, friction and hardware limits.",
            "export": "Write the controller as C, with test vectors: what was analysed is what runs.",
        },
        tables=("simulate",),
        kinds=("simulate", "simulate-response"),
        library=("simulate", "Loop.simulate", "Loop.plot_simulate"),
        offers=("controller_group", "keys", "on_check", "section"),
    ),
    Capability(
        "passive",
        {
            "passivity": "Compute the norm of the wave channel and the passivity margin at the hand's port."
        },
        kinds=("passivity", "passivity-ports", "passivity-along"),
        library=("passivity", "Loop.passivity", "Loop.plot_passivity"),
        offers=("guarantee", "on_check", "wish"),
    ),
    Capability(
        "sensitivity",
        {
            "why": "Explain each limit of a design: by how many per cent it moves for one per cent of each number."
        },
        kinds=("why",),
        library=("why", "Loop.sensitivity"),
        offers=("section",),
    ),
    Capability(
        "margins",
        {
            "margins": "Compute gain, phase, delay and disk margins and peak sensitivities of a loop broken at one signal."
        },
        kinds=("margins",),
        library=("Loop.margins", "Loop.plot_margins"),
        offers=("on_check", "panel", "section", "wish"),
    ),
    Capability(
        "poles",
        {
            "poles": "List the modes of a loop with frequency, damping and states, and draw their root locus over a number."
        },
        kinds=("poles",),
        library=("Loop.poles", "Loop.plot_root_locus"),
    ),
    Capability("maps", kinds=("stability-map",), offers=("stability_map",)),
    Capability(
        "designs",
        {
            "design": "Search for designs that meet a wish, for all devices and hands that they have to hold for."
        },
        tables=("design",),
        kinds=("design",),
        library=("design",),
        offers=("keys", "on_check", "wished"),
    ),
    Capability(
        "reports",
        {"report": "Write a report of a spec for a design review: one HTML file."},
        library=("report",),
    ),
    Capability(
        "identification",
        {
            "identify": "Fit mass, damping, friction and delay to a log of force and position, with intervals, and write a spec."
        },
        tables=("measured",),
        kinds=("identify", "identify-response"),
        library=("identify",),
        offers=("keys", "marks", "on_check", "panel"),
    ),
    Capability("frame_times", kinds=("identify-frames",), offers=("frames",)),
    Capability(
        "explore",
        {
            "explore": "Show the boundary of stability in a browser, and vary every number by a slider."
        },
    ),
    Capability("require", tables=("sweep.require",), offers=("bound", "keys", "on_check", "wish")),
    Capability("axes", offers=("classes",)),
    Capability("proofs", offers=("of_margins", "of_ports", "of_table")),
    Capability("prove", offers=("prover", "ticks")),
    Capability(
        "picture",
        library=("Loop.plot_diagram", "Loop.plot_timing"),
        offers=("diagram", "on_check", "timing"),
    ),
)

# Tables of a spec, in the order in which messages list them, and the capabilities that read them,
# there or not.
TABLES = MappingProxyType(
    {
        "for_all": "for_all",
        "for_all.contact": "contact",
        "for_all.tick": "late_ticks",
        "simulate": "simulation",
        "measured": "identification",
        "design": "designs",
        "sweep.require": "require",
    }
)

HANDS = MappingProxyType(
    {"passive": "passive", "box": "for_all", "port": "passive"}
)  # words of --for-hands, likewise


# What a user asks, and the commands that answer it, in the order of the help; others are among
# OTHER_COMMANDS.
QUESTIONS = MappingProxyType(
    {
        "Describe a loop": ("init", "keys", "identify"),
        "Is it stable, and how far": (
            "check",
            "zwidth",
            "stability-region",
            "why",
            "margins",
            "poles",
            "passivity",
        ),
        "How does it behave": ("bode", "simulate"),
        "Which design, and how to build it": ("design", "explore", "report", "export"),
        "Tables": ("plot", "verify"),
    }
)
OTHER_COMMANDS = "Other commands"

# Commands, there or not, that say what holds for all numbers of [for_all], for all that frames and
# messages may do, and through contact.
FOR_ALL_NUMBERS = ("zwidth", "stability-region", "margins", "check", "design")
FOR_ALL_MESSAGES = ("zwidth", "stability-region", "check")
THROUGH_CONTACT = ("zwidth", "stability-region", "check")
# whose axes are those of [sweep] or [bode], values or not
OVER_AXES = ("zwidth", "stability-region", "bode", "passivity")
WITHOUT_SUMMARY = ("plot", "explore", "init", "report")  # for which --json has no meaning
WITH_SPECS = ("design",)  # kinds of tables with a folder of specs beside them
COMMAND_OF_FIGURE = (
    MappingProxyType(  # of a kind of table, or a picture, that has not the name of its command
        {
            "simulate-response": "simulate",
            "diagram": "check --plot",
            "timing": "check --plot",
        }
    )
)


def home_of(command: str) -> Capability | None:
    """The capability that has a command; None if none has it."""
    return next((capability for capability in CAPABILITIES if command in capability.commands), None)


def listed(commands: Iterable[str]) -> str:
    """Those of some commands that are there, in words; the program's own always are."""
    *several, last = [
        name for name in commands if home_of(name) or name in ("zwidth", "stability-region", "bode")
    ]
    if several:
        return f"{', '.join(several)} and {last}"
    return last


def modules(name: str) -> Iterator[Any]:
    """Import the module of this name of every capability that offers it.

    `program.seams` says what a module has that several offer.
    """
    for capability in CAPABILITIES:
        if name in capability.offers:
            yield capability.module(name)


def offered(name: str) -> Any:
    """Import the module of this name of the one capability that offers it; None if that
    capability is not there."""
    return next(modules(name), None)


def asked(name: str, function: str, *arguments: Any) -> Iterator[Any]:
    """What a function gives in each module of this name that has it: a module leaves out what it
    has nothing to say to."""
    for module in modules(name):
        if hasattr(module, function):
            yield getattr(module, function)(*arguments)


def library_names(of: str = "") -> list[str]:
    """The functions that capabilities add to the library, or the methods that they add to a
    class `of` it."""
    names = (name.rpartition(".") for capability in CAPABILITIES for name in capability.library)
    return [last for kind, _, last in names if kind == of]


def of_library(name: str, known: Iterable[str] = ()) -> Any:
    """Import what a capability has for the library under this name, e.g. `why` or `Loop.margins`.

    known: the names of the program. Errors: AttributeError for another name, with the nearest.
    """
    kind, _, last = name.rpartition(".")
    for capability in CAPABILITIES:
        if name in capability.library:
            library = capability.module("library")
            return getattr(getattr(library, capability.class_for(kind)) if kind else library, last)
    from wavesweep.engine.keys import nearest

    if last[0] != "_":
        meant = nearest(last, [word for word in (*known, *library_names(kind)) if word[0] != "_"])
    else:
        meant = ""
    if meant:
        hint = f"did you mean {meant}?"
    else:
        hint = f"dir({kind.lower() or 'wavesweep'}) lists what there is"
    raise AttributeError(
        f"wavesweep has no {name}; {hint}", name=last
    )  # with the name, Python adds none of its own
