"""What several capabilities offer to the program and to each other: a type for each of these
modules.

What one capability alone offers is asked for by `capabilities.offered`, and needs none. A
capability that names a module in its `offers` has every name of the module's type. Of a type that
is `AsYouLike` it has those that it has something to say to, and no other public name but constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from wavesweep.program.analyses.interval_jobs import Guarantee
    from wavesweep.program.reading.tables import SpecTable
    from wavesweep.program.row_kinds import RowKind
    from wavesweep.program.spec import Spec
    from wavesweep.program.sweep.job import Job
    from wavesweep.program.tables.table import Table

    Facts = Mapping[str, Any]  # of a run or a verdict, JSON-able
    Ranked = tuple[
        float, str | Callable[[], str]
    ]  # a line with its rank, or what makes one that takes a while


class AsYouLike(Protocol):
    """A module that leaves out what it has nothing to say to."""


class KeysModule(Protocol):
    """A table of a spec that the capability reads."""

    TABLE: SpecTable


class GuaranteeModule(AsYouLike, Protocol):
    """Rows of stable intervals that hold for more than one loop."""

    ROWS: Mapping[str, RowKind]
    """Words and look of the rows by their word, from those that promise least."""
    HANDS: Mapping[str, str]
    """The words of --for-hands that `of_word` reads, and what is stable with each."""

    def of_word(self, kind: str, more: str | None) -> Guarantee | None:
        """The guarantee for a word of --for-hands, None for a word of others; more: what stands
        behind its colon.

        Errors: ValueError for what does not fit.
        """

    def of_run(self, own: Job, asked: Iterable[Guarantee]) -> Iterable[Guarantee]:
        """The guarantees of a run of a spec's own job, from those asked for and those that come
        before.

        Errors: UsageError for one that cannot be had.
        """


class OnCheckModule(AsYouLike, Protocol):
    """What `check` says in addition."""

    def numbers(self, spec: Spec) -> dict[str, Any]:
        """Numbers in addition to those of a spec's own design."""

    def facts(
        self, spec: Spec, own: Facts, report: Callable[[int, int], None] | None
    ) -> dict[str, Any]:
        """Facts of a verdict; own: the numbers of the design. claims: among them, those that
        answer what the spec asks."""

    def lines(self, spec: Spec, found: Facts) -> Iterator[Ranked]:
        """The lines of a verdict."""

    def sweep_plan(self, spec: Spec) -> tuple[list[str], list[Job]]:
        """Lines and jobs of a command over [sweep]."""

    def plan(self, spec: Spec) -> list[str]:
        """Lines about another command."""

    def refuse(self, spec: Spec) -> None:
        """Raise UsageError or SpecError before anything is printed."""

    def is_next(self, spec: Spec, found: Facts) -> bool:
        """Whether its command goes on from a verdict."""


class SectionModule(Protocol):
    """Sections of a report."""

    PLACE: int
    """Sections come in this order."""

    def sections(self, spec: Spec, cut: str) -> Iterable[tuple[str, str, Callable[[], Table]]]:
        """The title of each, the command of its table, with {} for the spec, and what makes the
        table."""


class PanelModule(AsYouLike, Protocol):
    """What a page of `explore` shows in addition."""

    def answers(
        self,
    ) -> Mapping[str, Callable[[Spec, Mapping[str, Any], Mapping[str, Any]], dict[str, Any]]]:
        """More questions that it answers, by name, of (spec, question, data)."""

    def data(self, spec: Spec) -> dict[str, Any]:
        """What the page has from the start."""

    def quick(
        self, spec: Spec, question: Mapping[str, Any], shown: Mapping[str, Any], stable: bool
    ) -> dict[str, Any]:
        """What is computed while a slider moves; shown: the data of the page."""


class WishModule(Protocol):
    """What may be wished for of a design."""

    WISHES: Mapping[str, Mapping[str, Any]]
    """The arguments of a `WishKind` by the name of the wish."""


SEAMS: Mapping[str, type] = MappingProxyType(
    {
        "keys": KeysModule,
        "guarantee": GuaranteeModule,
        "on_check": OnCheckModule,
        "section": SectionModule,
        "panel": PanelModule,
        "wish": WishModule,
    }
)
"""The type of each module that several capabilities offer, by the module's name."""
