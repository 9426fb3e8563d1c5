"""Where a value was given, for the line that reports it: in a file, on the command line, or in a dict."""

from __future__ import annotations

from dataclasses import dataclass

from wavesweep.errors import Mistake


@dataclass(frozen=True, slots=True)
class Place:
    """In a dict, which has no lines to point at; base of the other places."""

    def location(self, of_key: bool = False) -> str:  # noqa: ARG002 - what a file needs to know
        """Return the prefix of a mistake's line, for the value here or for its key; empty where there is none."""
        return ""

    def under(self, path: tuple[str, ...]) -> Place:  # noqa: ARG002 - what a file needs to know
        """Return the place of another path of the same source."""
        return self

    def parent(self) -> Place:
        """Return the place of the table around this value."""
        return self


@dataclass(frozen=True, slots=True)
class InFile(Place):
    """At a path of a TOML text; the line is searched for only when it is asked for."""

    name: str
    text: str
    path: tuple[str, ...] = ()

    def location(self, of_key: bool = False) -> str:
        from wavesweep.spec.positions import locate

        line, column = locate(self.text, self.path, of_key)
        return f"{self.name}:{line}:{column}"

    def under(self, path: tuple[str, ...]) -> Place:
        return InFile(self.name, self.text, path)

    def parent(self) -> Place:
        return self.under(self.path[:-1])


@dataclass(frozen=True, slots=True)
class OnCommandLine(Place):
    """In an override, as it was typed."""

    typed: str

    def location(self, of_key: bool = False) -> str:  # noqa: ARG002 - both stand in the text that was typed
        return "--set " + " ".join(self.typed.split())


@dataclass(frozen=True, slots=True)
class Leaf:
    """A value as given, and where."""

    value: object
    place: Place

    def mistake(self, key: str, expected: str, found: str, suggestion: str = "", of_key: bool = False) -> Mistake:
        """Return the mistake that this value is, or that its key is."""
        return Mistake(self.place.location(of_key), key, expected, found, suggestion)
