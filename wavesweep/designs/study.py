"""A design study: a search in chunks on workers that can be resumed after an interruption, and
the front as a table."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from wavesweep.designs.best import judged, miss
from wavesweep.designs.family import Scenario, count_of, described, frames_are_tried, scenarios_of
from wavesweep.designs.furthest import SHORTEST, climbed, furthest, wanted_number
from wavesweep.designs.search import (
    Evolution,
    Judged,
    designs_of,
    differing,
    generations,
    genes_of,
    spread,
    undominated,
)
from wavesweep.designs.table import fields_of_design, wish_units
from wavesweep.designs.wish_keys import Wish
from wavesweep.designs.wishes import evaluate
from wavesweep.engine.errors import SpecError, UsageError, WavesweepError
from wavesweep.program.analyses.claim_words import in_words, scope_in_words
from wavesweep.program.analyses.claims import (
    STABLE,
    Claim,
    Property,
    Range,
    Status,
    own_scope,
)
from wavesweep.program.spec import Spec
from wavesweep.program.spec.resolving import longest_delay
from wavesweep.program.spec.studies import K_VE_SPAN
from wavesweep.program.sweep.estimates import SLOW_SLICE
from wavesweep.program.sweep.grid import keys_of, make_grid, own_loop
from wavesweep.program.sweep.job import Chunks, Job, JobKind
from wavesweep.program.sweep.running import (
    RunCounts,
    Work,
    checkpoint_of,
    compute,
    kept_of,
    records_of,
    resumable,
)
from wavesweep.program.sweep.workers import choose
from wavesweep.program.tables.kind import count
from wavesweep.program.tables.table import Table, facts_of

FRONT = 48  # designs of the table at most
# designs with [for_all] next to the best of the search that are proved for all of it, the spec's own
# among them
PROVED = 3
NEARLY_THE_SAME = 0.01  # of a number's range: designs that differ by less are proved alike
RUNNERS_UP = 3  # further designs next to a single best one
RANKED_ALONE = 8  # designs that rank one by one before these are chosen, at either distance
FRONT_DISTANCE = 0.1  # of a number's range: how far apart these are
MOST_SCENARIOS = 4096  # combinations that a search holds for, and that a design of the front is checked over, at most
# designs from which the time is estimated, up to the first ones that take a second; half as
# many as the last cost nearly as much together
TIMED = 2, 2, 16


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """What a search looks at.

    genes: number of a generation -> `(designs, axes)`, known once the one before it is judged.
    scenarios: combinations that designs have to hold for in the search; more are added during it.
    finer, finest: those that the front is checked over during the search, and at its end. stop: the
    largest stiffness of a wall that is searched, N/m.
    """

    genes: dict[int, np.ndarray]
    scenarios: list[Scenario]
    finer: Sequence[Scenario]
    finest: Sequence[Scenario]
    stop: float


def record_of(wishes: Sequence[Wish]) -> np.dtype:
    """A value, a scenario and flags for each wish."""
    fields = [("slice", "<i4")]
    for wish in wishes:
        fields.append((wish.name, "<f8"))
        fields.append((f"{wish.name}_scenario", "<i4"))
        fields.append((f"{wish.name}_certified", "?"))
        fields.append((f"{wish.name}_at_end", "?"))
    return np.dtype(fields)


def generation(job: Job, number: int) -> range:
    """The numbers of the chunks of a generation, among which its designs are divided evenly."""
    across = len(job.chunks) // job.chunks.loops
    return range(number * across, (number + 1) * across)


def _task(job, chunk):
    number = chunk.loops.start
    study = job.asked
    chunks = generation(job, number)
    genes = np.array_split(study.genes[number], len(chunks))[chunk.number - chunks.start]
    designs = designs_of(job.grid.spec.design.vary, genes)
    last = number == job.chunks.loops - 1
    scenarios = study.finest if last else tuple(study.scenarios)
    return partial(Evaluation.of(job, scenarios, last=last).records, designs, len(genes))


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """What is measured of designs: the wishes of a spec, at their worst over the scenarios.

    stop: see `Study`. dtype: of the records, see `record_of`. proof: of [for_all]. ranked: whether a
    search ranks designs by it.
    """

    spec: Spec
    scenarios: Sequence[Scenario]
    stop: float
    dtype: np.dtype
    proof: Any
    ranked: bool

    @staticmethod
    def of(job: Job, scenarios: Sequence[Scenario], *, last: bool) -> Evaluation:
        """That of a job; last: whether designs are of the front, for which more is checked."""
        spec = job.grid.spec
        if last:
            proof = _proof_of(spec)
        else:
            proof = spec.for_all and spec.for_all.ranking(spec)
        return Evaluation(spec, scenarios, job.asked.stop, job.dtype, proof, not last)

    def records(self, designs: Mapping[str, np.ndarray], count: int) -> np.ndarray:
        """A record for each of `count` designs, which may be none."""
        records = np.zeros(count, self.dtype)
        records["slice"] = np.arange(count)
        if not count:
            return records
        wishes = self.spec.design.wishes
        about = self.spec, wishes, self.scenarios, designs, self.stop, self.proof
        measured = evaluate(*about, ranked=self.ranked)
        for name, worst in measured.items():
            records[name] = worst.value
            records[f"{name}_scenario"] = worst.scenario
            records[f"{name}_certified"] = worst.certified
            records[f"{name}_at_end"] = worst.at_end
        return records


# Certificates of a search are those of its result.
DESIGNS = JobKind(_task, noun="designs", certifies=False, has_rows=False)


def design(spec: Spec, **options: Any) -> Table:
    """Search for the designs that meet the wishes of a spec's [design].

    Returns the front if some wishes have no bound, otherwise the best design, as a table.
    options: jobs, backend, scheduler, progress, checkpoint and
    force, see `Work`. The result depends on the seed and not on the workers. Errors: UsageError for
    a loop that cannot be designed, WavesweepError if no design meets all bounds, and the errors of
    a run.
    """
    started = time.perf_counter()
    work = Work.of(options)
    job = job_of(spec)
    warnings: list[str] = []
    store = checkpoint_of(job, work.checkpoint, work.force, warnings)
    run = _Run(job, store, work.progress)
    with resumable(job, store, run.tally):
        run.workers = choose(
            work.jobs,
            work.backend,
            work.scheduler,
            len(job.chunks),
            partial(seconds_of, job),
        )
        return _best_of(spec, run, started, warnings)


def _best_of(spec: Spec, run: _Run, started: float, warnings: list[str]) -> Table:
    """The best designs of a study that began at this time (s)."""
    job = run.job
    wanted = spec.design
    evolution = Evolution(**wanted.settings)
    nominal = genes_of(wanted.vary, spec.values)[None]
    genes = _front(spec, run, evolution, nominal)
    job.asked.genes[evolution.generations] = genes
    proved = {}
    if spec.for_all:
        proved = {"proved": len(genes), "ranked": spec.for_all.ranking(spec) is not None}
    checked = run.records(evolution.generations)
    of_own = own_design(spec, job, checked[(genes == nominal).all(1)])
    genes, records = run.kept(genes, checked)
    if not len(genes):  # between the ends of the ranges none of them meets its bounds
        _refuse_missed(spec, run, records, job.asked.finest)
    # With more to hold for, a design may be worth less than another one.
    objectives, violation = judged(wanted, records)
    still = undominated(Judged(genes, objectives, violation))
    rest = np.setdiff1d(np.lexsort(objectives.T[::-1]), still, assume_unique=True)
    columns, best_rows = _columns(spec, job, genes[still], records[still])
    certified = int(best_rows["certified"].sum())
    counts = {"computed": run.tally.done, "skipped": 0, "certified": certified}
    timings = {"compute_s": time.perf_counter() - started, "processor_s": run.tally.seconds}
    timings["workers"] = run.workers.count
    notices = [*_notices(job), *_how_far(spec, run.ends, columns)]
    facts = facts_of(spec, METHODS, counts, timings, notices, claims=claims_of(job))
    facts |= {
        "warnings": warnings,
        "own": of_own,
        "own_unstable": _is_unstable(spec),
        "stop": job.asked.stop,
        "at_end": [wish.name for wish in wanted.wishes if _ends_with_walls(wish, records[still])],
        "runners_up": run.runners_up(genes[still], genes[rest], records[rest]),
        **proved,
        "scenarios": len(job.asked.scenarios),
        "checked_scenarios": len(job.asked.finest),
        "units": wish_units(spec),
    }
    fields = fields_of_design(spec, columns)
    return Table("design", lambda: (columns,), facts, fields=fields, forget=run.forget)


def _front(spec, run, evolution, nominal):
    """The genes of the front of a search, which begins with the spec's own; of a single one with
    similar ones. Errors: WavesweepError if no design meets all bounds."""
    choices = [len(axis.values or ()) for axis in spec.design.vary]
    for tried in generations(run.judge, evolution, choices, nominal, run.look):
        best = tried
    if not (best.violation == 0).any():
        _refuse_missed(spec, run, run.everything(), run.job.asked.scenarios)
    genes = spread(best, FRONT).genes
    if len(genes) > 1:
        return genes
    similar = _with_similar(run, genes, nominal)
    if wanted_number(spec):
        return np.unique(np.concatenate([similar, run.furthest(genes[0])]), axis=0)
    return similar


def _refuse_missed(spec, run, records, scenarios):
    """Raise the error that no design meets its bounds; records: of designs over scenarios."""
    said = miss(spec, records, scenarios, wish_units(spec))
    run.forget()  # nothing of it is left to be done
    raise WavesweepError(said)


def _with_similar(run, best, nominal):
    """The best design with similar ones, since what is worth less in the search may be worth more
    over all that it is checked for."""
    candidates = run.feasible()
    genes = [best]
    spec = run.job.grid.spec
    if spec.for_all:  # of which the search proves nothing
        if spec.design.only_walls and spec.for_all.ranking(spec) is not None:
            candidates = run.ranked_alone(candidates, best)
        candidates = np.concatenate([nominal, candidates])
        genes.append(run.next_to(candidates, best, NEARLY_THE_SAME, PROVED))
    genes.append(run.next_to(candidates, best, FRONT_DISTANCE, RUNNERS_UP))
    return np.unique(np.concatenate(genes), axis=0)


def _ends_with_walls(wish, records):
    """Whether the best value of a wish among the designs of a result is that of a wall at which
    the range of walls ends."""
    value = records[wish.name] if wish.kind.more else -records[wish.name]
    best = np.argmax(np.where(np.isnan(value), -np.inf, value))
    return bool(records[f"{wish.name}_at_end"][best])


def _proof_of(spec):
    """The proof of designs for all of [for_all]; None without it."""
    return spec.for_all and spec.for_all.proof(spec)


METHODS = {
    "search": "MOEA/D with differential evolution and constrained domination, seeded; every design at its worst over all that "
    "it has to hold for",
    "check": "the designs of the front again, with values between the ends of every range",
}


def _refuse_for_all(spec, wanted):
    """Raise UsageError if designs cannot be found for all of [for_all]."""
    table = spec.for_all
    if not table:
        return
    varied = {axis.path for axis in wanted.vary}
    for axis in table.axes:
        if axis.path in ("rates.fast_hz", "rates.tick_hz"):
            expected = "one rate of the tick for designs"
        elif axis.path in spec.wall:
            expected = "numbers that are not of the wall for designs (walls belong to the wishes)"
        elif axis.path in varied:
            expected = "numbers that [design.vary] does not vary"
        else:
            continue
        raise UsageError(f"[for_all]: expected {expected}, found {axis.name}")
    of_walls = any(wish.word in ("z_width", "felt") for wish in wanted.wishes)
    _proof_of(spec).refuse_unsuitable(spec, spec.wall[0] if of_walls else "")


def _stiffest_searched(spec, wishes):
    """The stiffest wall that is searched. Errors: SpecError if a wish asks for more, or if there
    is no range."""
    axis = next((axis for axis in spec.sweep if axis.path in spec.wall[:1]), None)
    stop = float(axis.stop if axis else K_VE_SPAN[1])
    if axis and stop <= 0:
        expected = "a stop > 0, up to which walls are searched"
        raise SpecError(
            [axis.place.mistake(f"sweep.{axis.name}", expected, f"{stop:g}", of_key=True)]
        )
    unseen = next(
        (wish for wish in wishes if wish.word == "z_width" and (wish.bound or 0) > stop), None
    )
    if unseen:
        name = spec.drawing.wall[0] if spec.drawing else "K_VE"
        unit = wish_units(spec)["z_width"]
        searched = f"<= {stop:g} {unit}, the stiffest wall that is searched; raise it: sweep.{name} = {{ stop = ... }}"
        mistake = unseen.places["at_least"].mistake(
            "design.wish.z_width.at_least", searched, f"{unseen.bound:g}"
        )
        raise SpecError([mistake])
    return stop


def job_of(spec: Spec) -> Job:
    """Return the job of a spec's [design]. Errors: UsageError if it cannot be done."""
    wanted = spec.asking("design").design
    spec.refuse_require("[design]")
    _refuse_for_all(spec, wanted)
    grid = make_grid(spec.asking("design"), ())
    stop = _stiffest_searched(spec, wanted.wishes)
    _refuse_unreachable(spec, wanted.wishes)
    for axis in spec.for_all.unknown if spec.for_all else ():
        if axis.structural:
            for value in axis.values:
                grid.spec.with_values(
                    {axis.path: value}
                )  # or an error that names what it does not suit
    if count_of(grid.spec) > MOST_SCENARIOS:
        expected = f"at most {MOST_SCENARIOS} combinations of values; list fewer"
        raise UsageError(f"[for_all]: expected {expected}, found {count_of(grid.spec)}")
    often = _between(grid.spec, 20)  # of those that the search looks at from time to time
    finer = scenarios_of(grid.spec, between=often or int(count_of(grid.spec, 1) <= MOST_SCENARIOS))
    finest = finer
    one_by_one = any(wish.kind.seen for wish in wanted.wishes)
    between = _between(grid.spec, 256)
    if between and not one_by_one:
        finest = scenarios_of(grid.spec, between)
    study = Study({}, scenarios_of(grid.spec), finer, finest, stop)
    rounds = wanted.settings["generations"]
    population = wanted.settings["population"]
    # Designs of a task, at most: those of one structure are the faster, the more they are.
    chunks = Chunks(rounds + 1, max(population, FRONT), 1, 12 if one_by_one else 48)
    total = rounds * population
    return Job(
        DESIGNS,
        grid,
        chunks,
        record_of(wanted.wishes),
        {"records": "designs", "stop": stop},
        study,
        total,
    )


def _between(spec, most_combinations: int) -> int:
    """The largest number of values between two of each range with which there are at most so
    many combinations, or 0."""
    # Values between two of a range: the most of these with which the combinations are few.
    return next(
        (number for number in (63, 15, 7, 3) if count_of(spec, number) <= most_combinations), 0
    )


def _refuse_unreachable(spec, wishes):
    """Raise SpecError for a bound that no design meets: no damping ratio is above 1, and a delay
    ends within its frame."""
    highest = {"damping_ratio": 1.0}
    if not spec.drawing:
        highest["delay_margin"] = float(longest_delay(spec.values))
    mistakes = []
    for wish in wishes:
        if wish.word in highest and (wish.bound or 0) > highest[wish.word]:
            key = f"design.wish.{wish.name}.at_least"
            place = wish.places["at_least"]
            mistakes.append(place.mistake(key, f"<= {highest[wish.word]:g}", f"{wish.bound:g}"))
    if mistakes:
        raise SpecError(mistakes)


class _Run:
    """The chunks of a study, one generation after the other."""

    def __init__(self, job, store, progress):
        self.job = job
        self.store = store
        self.progress = progress
        self.workers = None
        self.tally = RunCounts()
        self.forget = store.remove
        self.latest = 0  # generation
        self.since = 0  # the first generation that was judged over all that is held for now
        self.ends: list[dict[str, float]] = []  # see `furthest`

    def judge(self, number: int, genes: np.ndarray) -> Judged:
        """Return the designs of a generation, judged; those of one structure are computed
        together."""
        self.latest = number
        wanted = self.job.grid.spec.design
        values = designs_of(wanted.vary, genes)
        choices = [values[axis.path] for axis in wanted.vary if axis.values]
        order = np.lexsort(choices) if choices else np.arange(len(genes))
        self.job.asked.genes[number] = genes[order]
        records = np.empty(len(genes), self.job.dtype)
        records[order] = self.records(number)
        return Judged(genes, *judged(wanted, records))

    def look(self, best: Judged) -> bool:
        """Check designs of the front over the finer choice, and add the worst scenarios to those
        that the search holds for.

        The worst of a range need not be at its ends. Returns whether anything was added.
        """
        if (best.violation > 0).any():  # nothing is feasible yet
            return False
        study = self.job.asked
        spec = self.job.grid.spec
        wanted = spec.design
        designs = designs_of(wanted.vary, spread(best, FRONT).genes)
        measured = evaluate(spec, wanted.wishes, study.finer, designs, study.stop, ranked=True)
        decide = np.concatenate([measure.scenario for measure in measured.values()])
        often = np.bincount(decide, minlength=len(study.finer))
        order = np.argsort(-often, kind="stable")[: np.count_nonzero(often)]
        worst = [study.finer[index] for index in order.tolist()]
        # Combinations at a time that the search holds for besides.
        new = [scenario for scenario in worst if scenario not in study.scenarios][:4]
        if not new:
            return False
        study.scenarios.extend(new)
        self.since = self.latest + 1
        return True

    def records(self, number: int) -> np.ndarray:
        """The records of a generation, from the checkpoint as far as it has them."""
        numbers = generation(self.job, number)
        kept_of(self.job, self.store, numbers, self.tally)
        compute(self.job, self.store, self.workers, self.progress, self.tally, numbers)
        return np.concatenate([records_of(self.job, self.store, number) for number in numbers])

    def kept(self, genes: np.ndarray, records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The designs of the front that keep their bounds over all that it is checked for, and
        their records.

        A search that sees some values of a range finds what is good there alone. If no design of
        the front keeps its bounds in between, those of all generations are tried, the best first;
        if none of them does, the records of the front remain.
        """
        _, violation = judged(self.job.grid.spec.design, records)
        good = violation == 0
        if good.any():
            return genes[good], records[good]
        # Designs that are checked for all, if none of the front holds for it.
        candidates = self.feasible()[:2000]
        for batch in np.array_split(candidates, max(1, len(candidates) // FRONT)):
            if not len(batch):
                break
            meeting, of_held = self.checked(batch)
            if len(meeting):
                return meeting, of_held
        return genes[:0], records

    def feasible(self) -> np.ndarray:
        """The designs of all generations that keep their bounds in the search, the best first."""
        last = self.job.chunks.loops - 1
        genes = np.concatenate([self.job.asked.genes[tried] for tried in range(self.since, last)])
        objectives, violation = judged(self.job.grid.spec.design, self.everything())
        order = np.lexsort(objectives.T[::-1])
        return genes[order[violation[order] == 0]]

    def checked(self, genes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Those of some designs that keep their bounds over all that a front is checked for, and
        their records."""
        wanted = self.job.grid.spec.design
        designs = designs_of(wanted.vary, genes)
        evaluation = Evaluation.of(self.job, self.job.asked.finest, last=True)
        records = evaluation.records(designs, len(genes))
        _, violation = judged(wanted, records)
        good = violation == 0
        return genes[good], records[good]

    def furthest(self, genes: np.ndarray) -> np.ndarray:
        """The genes of designs in which the number that is wanted large or small is at its last
        value or just inside, and which may meet all wishes; genes: of a design that does."""
        study = self.job.asked
        spec = self.job.grid.spec
        evaluation = Evaluation.of(self.job, study.scenarios, last=False)

        def judge(genes):
            records = evaluation.records(designs_of(spec.design.vary, genes), len(genes))
            _, violation = judged(spec.design, records)
            margins = [np.full(len(genes), np.inf)]
            for wish in spec.design.wishes:
                if wish.bound is not None:
                    margins.append(wish.margin(records[wish.name]))
            return violation == 0, np.min(margins, axis=0)

        best = climbed(spec, judge, genes)
        columns = designs_of(spec.design.vary, best[None])
        numbers = {path: column.item() for path, column in columns.items()}
        try:
            self.ends = furthest(spec, numbers, study.finest)
        except WavesweepError:  # of a wish that [sweep] require does not have, or not along it
            self.ends = []
        ends = [genes_of(spec.design.vary, numbers | end) for end in self.ends]
        return np.stack([best, *ends])

    def next_to(
        self, genes_tried: np.ndarray, genes: np.ndarray, apart: float, most: int
    ) -> np.ndarray:
        """The first of some designs, the best first, that differ from those of a result and from
        each other; see `differing`."""
        return genes_tried[
            differing(self.job.grid.spec.design.vary, genes_tried, genes, apart, most)
        ]

    def ranked_alone(self, genes_tried: np.ndarray, genes: np.ndarray) -> np.ndarray:
        """The first of some designs that differ from those of a result, the best first as they rank
        one by one: together, those that are worse than the best have bounds alone."""
        near = self.next_to(genes_tried, genes, NEARLY_THE_SAME, RANKED_ALONE)
        far = self.next_to(genes_tried, genes, FRONT_DISTANCE, RANKED_ALONE)
        some = np.unique(np.concatenate([near, far]), axis=0)
        evaluation = Evaluation.of(self.job, self.job.asked.scenarios, last=False)
        wanted = self.job.grid.spec.design
        records = np.zeros(len(some), self.job.dtype)
        for index, genes_of_design in enumerate(some):
            records[index] = evaluation.records(designs_of(wanted.vary, genes_of_design[None]), 1)[
                0
            ]
        objectives, violation = judged(wanted, records)
        order = np.lexsort(objectives.T[::-1])
        return some[order[violation[order] == 0]]

    def runners_up(
        self, genes: np.ndarray, other_genes: np.ndarray, records: np.ndarray
    ) -> list[dict[str, Any]]:
        """The next best designs after the only one of a result: their numbers, and their wishes at
        their worst.

        other_genes: that were checked as it was, the best first, with their records.
        """
        if len(genes) > 1:
            return []
        spec = self.job.grid.spec
        rows_differing = differing(spec.design.vary, other_genes, genes, FRONT_DISTANCE, RUNNERS_UP)
        columns, _ = _columns(spec, self.job, other_genes[rows_differing], records[rows_differing])
        runners = []
        for row in range(len(other_genes[rows_differing])):
            numbers = {axis.name: columns[axis.name][row].item() for axis in spec.design.vary}
            wishes = {wish.name: columns[wish.name][row].item() for wish in spec.design.wishes}
            runners.append({"numbers": numbers, "wishes": wishes})
        return runners

    def everything(self) -> np.ndarray:
        """Return the records of the search, of all generations that were judged over the same
        scenarios as the last one."""
        first = generation(self.job, self.since).start
        last = generation(self.job, self.job.chunks.loops - 1).start
        numbers = [number for number in self.store.finished() if first <= number < last]
        return np.concatenate([records_of(self.job, self.store, number) for number in numbers])


def seconds_of(job: Job) -> float:
    """Estimate the seconds of the whole study in one process, from some designs about the own one."""
    spec = job.grid.spec
    nominal = genes_of(spec.design.vary, spec.values)
    genes = nominal + 0.1 * np.random.default_rng(0).standard_normal(
        (TIMED[-1], len(spec.design.vary))
    )
    designs = designs_of(spec.design.vary, np.clip(genes, 0.0, 1.0))
    evaluation = Evaluation.of(job, job.asked.scenarios, last=False)
    for number in TIMED:  # the first of which also load what is needed
        few = {path: values[:number] for path, values in designs.items()}
        started = time.process_time()
        evaluation.records(few, number)
        seconds = time.process_time() - started
        if seconds > SLOW_SLICE:
            break
    return seconds / number * (job.chunks.loops - 1) * spec.design.settings["population"]


def own_records(spec: Spec, job: Job) -> np.ndarray:
    """The record of the spec's own design, checked as those of the front."""
    nominal = {axis.path: np.array([spec.values[axis.path]]) for axis in spec.design.vary}
    return Evaluation.of(job, job.asked.finest, last=True).records(nominal, 1)


def own_design(spec: Spec, job: Job, records: np.ndarray) -> dict[str, float | None]:
    """Return the wishes of the spec's own design, at their worst, as those of the front; None if
    there is no value. records: its own, if it was checked as the front was."""
    if not len(records):
        records = own_records(spec, job)
    values: dict[str, float | None] = {}
    for wish in spec.design.wishes:
        value = records[wish.name][0]
        certain = np.isfinite(value) and (records[f"{wish.name}_certified"][0] or not spec.for_all)
        values[wish.name] = float(value) if certain else None
    return values


def _is_unstable(spec):
    """Whether the spec's own design is refuted: for all of [for_all], or without it by itself."""
    if spec.for_all:
        return _proof_of(spec).verdict(spec) == "refuted"
    return bool((own_loop(spec).radii() > 1).any())


def _columns(spec, job, genes, records):
    """Return the columns of the table, and the records."""
    values = designs_of(spec.design.vary, genes)
    columns = {axis.name: values[axis.path] for axis in spec.design.vary}
    frames_vary = spec.for_all and _proof_of(spec).vary
    tried = frames_are_tried(spec)
    certified = np.ones(len(records), bool)
    for wish in spec.design.wishes:
        columns[wish.name] = records[wish.name]
        rate = ""
        if frames_vary and wish.word != "z_width" and not wish.kind.reads:
            rate = " at a constant rate" if tried else " at the spec's own constant rate"
        scenarios = []
        for number in records[f"{wish.name}_scenario"].tolist():
            scenario = described(job.asked.finest, number) or "the spec's own"
            scenarios.append(scenario + rate)
        columns[f"{wish.name}_scenario"] = np.array(scenarios, dtype=object)
        certified &= records[f"{wish.name}_certified"]
    objectives, violation = judged(spec.design, records)
    columns["certified"] = certified
    columns["holds"] = (violation == 0) & _checked(job)
    order = np.lexsort(objectives.T[::-1])
    return {name: column[order] for name, column in columns.items()}, columns


def _checked(job):
    """Whether the front is checked between the ends of the ranges, if there is anything between."""
    return len(job.asked.finer) >= count_of(job.grid.spec, 1)


def claims_of(job: Job) -> dict[str, Claim]:
    """What is claimed of the wishes of designs, by their names, and with [for_all] of all designs."""
    spec = job.grid.spec
    proof = _proof_of(spec)
    values: dict[str, set[float]] = {}
    for scenario in job.asked.finest:
        for path, value in scenario.items():
            values.setdefault(path, set()).add(value)
    numbers = [
        Range(path, min(values_of_number), max(values_of_number), (*sorted(values_of_number),))
        for path, values_of_number in values.items()
    ]
    tried = replace(own_scope(spec), numbers=tuple(numbers))
    claims: dict[str, Claim] = {}
    for wish in spec.design.wishes:
        claims[wish.name] = Claim(Property(wish.kind.title, "figures"), tried, Status.COMPUTED)
        if wish.word == "z_width":
            walls = Claim(STABLE, tried, Status.CERTIFIED)
            claims[wish.name] = proof.claim(spec) if proof else walls
    if proof and not all(wish.kind.reads for wish in spec.design.wishes):
        claims["loops"] = proof.claim(spec)
    return claims


def _how_far(spec, ends, columns):
    """Yield how the wanted number of the best design was looked for; ends: see `furthest`."""
    wish_and_number = wanted_number(spec)
    if not wish_and_number:
        return
    wish, number = wish_and_number
    axis = spec.design.vary[number]
    best = columns[axis.name][0]
    if any(np.isclose(best, end[axis.path], rtol=1e-12, atol=0) for end in ends):
        last = f"{axis.name} = {ends[0][axis.path]:.6g}"
        yield f"{wish.name}: with the best design's other numbers all wishes are met up to {last}, exactly"
    elif not axis.values:
        yield f"{wish.name}: {axis.name} was looked at in steps of {100 * SHORTEST:.2g} % of its range, not exactly"


def _notices(job):
    """Yield with what designs were tried and proved, what was not tried, and which wishes or varied
    numbers say little."""
    spec = job.grid.spec
    study = job.asked
    ends = count_of(spec)
    added = len(study.scenarios) - ends
    if ends > 1 or added > 0:
        several = f"{count(ends, 'combination')} of the numbers of [for_all]"
        if added > 0:
            several += f" and {added} between that were worse"
        yield f"each design was tried with {several}, those of the front with {len(study.finest)}"
    if spec.for_all:
        for name, claim in claims_of(job).items():
            if scope_in_words(claim.scope):
                yield f"{name}: {in_words(claim)}"
        if any(wish.word == "z_width" for wish in spec.design.wishes):
            share = spec.for_all.proof(spec).from_share
            yield f"walls are proved from {100 * share:g} % of z_width on"
    if not _checked(job):
        yield f"values between the ends of the ranges were not tried: with them there are more than {MOST_SCENARIOS} combinations"
    if all(wish.kind.reads for wish in spec.design.wishes):  # no wish reads the whole loop
        alone = " and ".join(wish.name for wish in spec.design.wishes)
        yield f"{alone} depends on the filters alone: the loops may be unstable, which a wish such as damping_ratio would show"
    unread = [axis.name for axis in spec.design.vary if axis.path not in keys_of(spec)]
    if unread:
        yield f"{', '.join(unread)}: not read by {spec.kind}, varied for nothing"
