"""What a capability can offer to the program and to other capabilities: a type for each module that `modules` asks for.

A capability that names a module in its `offers` has every name of the module's type. Of a type that is `AsYouLike` it has those
that it has something to say to, and no other public name but constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from wavesweep.engine.loop import Loops
    from wavesweep.engine.monodromy.drift import MarginalModes
    from wavesweep.engine.search.interval_search import Search
    from wavesweep.engine.sets.enclosed_loop import Side
    from wavesweep.program.analyses.interval_jobs import Guarantee
    from wavesweep.program.reading.tables import SpecTable
    from wavesweep.program.row_kinds import RowKind
    from wavesweep.program.spec import Axis, Spec
    from wavesweep.program.sweep.job import Job
    from wavesweep.program.tables.kind import ProvedAgain
    from wavesweep.program.tables.table import Table

    Facts = Mapping[str, Any]  # of a run or a verdict, JSON-able
    Ranked = tuple[float, str | Callable[[], str]]  # a line with its rank, or what makes one that takes a while


class AsYouLike(Protocol):
    """A module that leaves out what it has nothing to say to."""


class DiagramModule(Protocol):
    """The picture of a loop."""

    def diagram(self, spec: Spec) -> Figure:
        """The blocks and wires of a spec's loop."""


class LocusModule(Protocol):
    """The root locus of a spec."""

    def axis_over(self, spec: Spec, name: str) -> Axis:
        """The axis over a number, of its values in [sweep]. Errors: UsageError."""

    def root_locus(self, spec: Spec, axis: Axis) -> Figure:
        """The poles per frame over that axis."""


class MarksBesideIntervals(Protocol):
    """Points beside the intervals of a figure."""

    def highest(self, most: float) -> float:
        """The end of the axis that shows them too; most: without them."""

    def draw(self, axes: Axes) -> None:
        """Draw them."""

    def handles(self, x: Sequence[float], y: tuple[float, float]) -> list[Any]:
        """The entries of the legend, of those within these ranges."""


class MarksBesideCurves(Protocol):
    """Points beside the curves of responses."""

    def draw(self, axes: Axes, name: str) -> np.ndarray:
        """Draw those of a quantity, and return their values."""


class MarksModule(Protocol):
    """Points next to the curves of a figure."""

    def facts_of(self, specs: Iterable[Spec], kind: str) -> dict[str, Any]:
        """Facts of a run whose table of this kind has points beside it, with the points."""

    def walls(self, facts: Facts, x: str | None, along: str, several: bool) -> MarksBesideIntervals:
        """The points in the plane of x and along, from the facts of the run; several: of several specs."""

    def undrawn(self, facts: Facts, x: str | None, along: str) -> str:
        """A sentence about points that the figure cannot show; empty without any."""

    def responses(self, facts: Facts, specs: Iterable[str]) -> MarksBesideCurves:
        """The points beside responses."""


class KeysModule(Protocol):
    """A table of a spec that the capability reads."""

    TABLE: SpecTable


class GuaranteeModule(Protocol):
    """Rows of stable intervals that hold for more than one loop."""

    ROWS: Mapping[str, RowKind]
    """Words and look of the rows by their word, from those that promise least."""
    HANDS: Mapping[str, str]
    """The words of --for-hands that it reads, and what is guaranteed with each."""

    def of_word(self, kind: str, more: str | None) -> Guarantee | None:
        """The guarantee for a word of --for-hands, None for a word of others; more: what stands behind its colon.

        Errors: ValueError for what does not fit.
        """

    def of_run(self, own: Job, asked: Iterable[Guarantee]) -> Iterable[Guarantee]:
        """The guarantees of a run of a spec's own job, from those asked for and those that come before.

        Errors: UsageError for one that cannot be had.
        """


class BoxesModule(Protocol):
    """All loops of a box of numbers, for margins that hold for all of them; see `for_all.boxes`."""

    def varying(self, spec: Spec) -> list[str]:
        """The paths of the numbers that vary. Errors: UsageError for ranges that a box cannot have."""

    def values_of_range(self, axis: Axis) -> tuple:
        """The values of a range, those of a whole number one by one."""

    def numbers_in_words(self, by: Mapping[str, object]) -> str:
        """Numbers, by their paths, as a text."""

    def drift_over(self, loop: Loops, paths: Sequence[str], box: np.ndarray) -> MarginalModes:
        """What nothing opposes in any loop of a box, `(2, numbers)`."""

    def frames_over(self, loop: Loops, paths: Sequence[str], drift: MarginalModes, x: np.ndarray) -> Any:
        """The frames at points of the box, `(points, numbers)`."""

    def proved_stable(
        self, loop: Loops, sides: Sequence[Side], ends: np.ndarray, ranges: Sequence[str], box: np.ndarray, up: bool
    ) -> Any:
        """Up to where all loops of a box are proved stable, from an end of its first side on."""


class TicksModule(Protocol):
    """A loop tick by tick in ball arithmetic."""

    BallLoop: Any


class BoundModule(Protocol):
    """The region of eigenvalues that a spec asks for in place of the unit circle; see `engine.search.question`."""

    BOUNDED: str
    """What helps where nothing decides whether a loop that conserves energy is stable."""

    def words_of(self, written: Mapping[str, object]) -> str:
        """What is required, in words; written: its table."""


class OnCheckModule(AsYouLike, Protocol):
    """What `check` says in addition."""

    def numbers(self, spec: Spec) -> dict[str, Any]:
        """Numbers in addition to those of a spec's own design."""

    def facts(self, spec: Spec, own: Facts, report: Callable[[int, int], None] | None) -> dict[str, Any]:
        """Facts of a verdict; own: the numbers of the design."""

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


class VerdictModule(Protocol):
    """What is known beside a spec's own numbers."""

    def further(self, spec: Spec, own: Facts) -> dict[str, Any]:
        """Facts in addition to those of `own_design`."""

    def verdict_lines(self, spec: Spec, found: Facts) -> Iterator[Ranked]:
        """The lines of a verdict."""


class SectionModule(Protocol):
    """A section of a report."""

    TITLE: str
    PLACE: int
    """Sections come in this order."""
    KNOWN: str
    """How its numbers are known."""

    def section(self, spec: Spec, cut: str) -> tuple[str, Callable[[], Table]]:
        """The command of its table, with {} for the spec, and what makes the table."""


class PanelModule(AsYouLike, Protocol):
    """What a page of `explore` shows in addition."""

    def answers(self) -> Mapping[str, Callable[[Spec, Mapping[str, Any], Mapping[str, Any]], dict[str, Any]]]:
        """More questions that it answers, by name, of (spec, question, data)."""

    def data(self, spec: Spec) -> dict[str, Any]:
        """What the page has from the start."""

    def quick(self, spec: Spec, question: Mapping[str, Any], shown: Mapping[str, Any], stable: bool) -> dict[str, Any]:
        """What is computed while a slider moves; shown: the data of the page."""


class ProverModule(Protocol):
    """Ball arithmetic."""

    def ball_prover(
        self, loops: Loops, along: str, period: np.ndarray, operations: float = ...
    ) -> Callable[[int, float, float], Any]:
        """What decides stretches that doubles leave in doubt."""

    def prove_again(self, search: Search, claims: Sequence[tuple]) -> ProvedAgain:
        """What balls say of the certified intervals of a slice."""


class FramesModule(Protocol):
    """Frames as they were measured, for --frames."""

    def identified(
        self, path: str, fast_hz: float, number: str, columns: Mapping[str, str], scales: Mapping[str, float]
    ) -> Table:
        """The frames of a file, as a table."""

    def spec_text(self, facts: Facts) -> str:
        """The text of a spec with the frames of that table, from its facts."""

    def number_of(self, spec: Spec) -> str:
        """The number of a spec by which its frames vary."""

    def within(self, spec: Spec, path: str, columns: Mapping[str, str], scales: Mapping[str, float]) -> dict[str, Any]:
        """Whether a run is within what a spec's answers are for."""

    def lines(self, found: Facts) -> Iterator[Ranked]:
        """The same in lines."""

    def read_run(self, path: Path, tick_hz: float) -> Any:
        """The frames of a file."""


class ClassesModule(Protocol):
    """Classes of blocks that specs may use without drawing them."""

    CLASSES: Mapping[str, Path]
    """The file of each by its name."""


class WishModule(Protocol):
    """Quantities that may be wished for of a design."""

    WISHES: Mapping[str, Mapping[str, Any]]
    """Arguments of `designs.wish_keys.WishKind` by the name of the wish."""


SEAMS: Mapping[str, type] = MappingProxyType(
    {
        "diagram": DiagramModule,
        "locus": LocusModule,
        "marks": MarksModule,
        "keys": KeysModule,
        "guarantee": GuaranteeModule,
        "boxes": BoxesModule,
        "ticks": TicksModule,
        "bound": BoundModule,
        "on_check": OnCheckModule,
        "verdict": VerdictModule,
        "section": SectionModule,
        "panel": PanelModule,
        "prover": ProverModule,
        "frames": FramesModule,
        "classes": ClassesModule,
        "wish": WishModule,
    }
)
"""The type of each module that a capability may offer, by the module's name."""
