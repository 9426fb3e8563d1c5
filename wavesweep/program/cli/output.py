"""Results to files or stdout, with notices and summaries."""

from __future__ import annotations

import errno
import os
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from wavesweep.capabilities import (
    FOR_ALL_MESSAGES,
    FOR_ALL_NUMBERS,
    OVER_AXES,
    THROUGH_CONTACT,
    listed,
)
from wavesweep.engine.errors import UsageError
from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.file_places import own_folder, refuse_inputs
from wavesweep.program.cli.messages import WRITING, progress, say, show_json, where
from wavesweep.program.cli.options import Options
from wavesweep.program.number_words import folded

if TYPE_CHECKING:
    from wavesweep.program.analyses.claims import Claim
    from wavesweep.program.spec import Spec
    from wavesweep.program.tables.kind import Line
    from wavesweep.program.tables.table import Table

# commands that sweep all axes of [sweep]
INTERVALS = ("zwidth", "stability-region", "zwidth-specs")
HANDS = "-hands"  # what the name of a table of intervals for hands ends in
MOST_CHANGES = 5  # of a spec that are listed


def produce(
    kinds: Sequence[str],
    sources: Sequence[str],
    options: Options,
    compute: Callable[..., list[Table]],
    asked: Callable[[Spec], Spec] = lambda spec: spec,
    less: str = "fewer values in [sweep] take less",
) -> None:
    """Load the specs, compute their tables, write all of them to files or the first one to stdout, and summarise them.

    kinds: every table that the command can write, the main one first. compute: a function (specs,
    jobs=, backend=, scheduler=, progress=, checkpoint=, force=) that returns the tables of this
    run, in the same order. asked: a function from a loaded spec to the one whose digest the results
    carry. less: what would take less time.
    """
    from wavesweep.program import results, spec
    from wavesweep.program.tables.table import digest_of

    started = time.perf_counter()
    specs = [asked(spec.load(source, options.overrides)) for source in sources]
    directory = folder_of(specs, options)
    place = results.place_of(sources, directory)
    _refuse_to_overwrite(specs, kinds, directory, options)
    if options.formats:
        from wavesweep.program import plots

        plots.refuse_settings()
    beside = _facts_of_run(specs, kinds[0], place)
    with alone(kinds, directory, options):
        if options.to_folder and not options.overwrite:
            # Before the work as well as after it: a refusal should not cost a long run.
            for kind in kinds:
                results.refuse_other_spec(kind, directory, digest_of(specs), place)
        prepare_work(options)
        checkpoint = None if options.to_stdout else checkpoint_of(kinds[0], specs, options)
        report = progress(less=less)
        tables = compute(specs, **options.work, progress=report, checkpoint=checkpoint)
        before = None
        if options.to_folder and not options.silent:
            before = results.existing_facts(tables[0].kind, directory)
        beside["date"] = datetime.now(UTC).isoformat(timespec="seconds")
        beside["command"] = shlex.join(["wavesweep", *verbosity().words])
        tables = [replace(table, facts={**table.facts, **beside}) for table in tables]
        with _telling_of(checkpoint):
            finished = _written(tables, directory, options)
        if options.to_folder:
            for kind in set(kinds) - {table.kind for table in tables}:
                results.discard(kind, directory)  # of another spec, it would pass for this run's
    if options.silent:
        return
    progress("summing up")
    changed = []
    if before and before.get("spec_place") == place:
        changed = results.changes(before, tables[0].facts)
    command = kinds[0].removesuffix(HANDS)
    seconds = time.perf_counter() - started
    _report(command, specs, options, tables[0].facts, finished, changed, seconds)


@contextmanager
def _telling_of(checkpoint: Path | None) -> Iterator[None]:
    """Have errors say that a checkpoint keeps what was computed."""
    try:
        yield
    except BaseException as error:
        if checkpoint is not None and checkpoint.is_file():
            error.add_note(
                f"All that was computed is kept in {checkpoint}; the same command goes on from there."
            )
        raise


def _facts_of_run(specs: Sequence[Spec], kind: str, place: str) -> dict[str, Any]:
    """Facts of the place of the specs, and of what figures mark in them."""
    if not any(spec.measured for spec in specs):
        return {"spec_place": place}
    from wavesweep.program.plots.figure_marks import facts_of_marks

    return {"spec_place": place, **facts_of_marks(specs, kind)}


def _written(tables: Sequence[Table], directory: Path, options: Options) -> list[Finished]:
    """Write the tables."""
    progress(WRITING)
    finished = [_finish(table, directory, options, table is tables[0]) for table in tables]
    if not options.to_folder and not options.quiet:
        for table in tables[1:]:
            say(
                f"the table {table.kind} is left out, since --out {options.out} takes one; --out DIR writes it"
            )
    return finished


def alone(kinds: Sequence[str], directory: Path, options: Options) -> AbstractContextManager[None]:
    """Be the only run that writes these tables, from before the work on, if they go to files; see `results.at_work`."""
    from wavesweep.program import results

    if options.to_stdout:
        return nullcontext()
    busy = (lambda _: None) if options.quiet else partial(say, warning=True)
    return results.at_work(kinds, directory, options.wait, busy)


def _without_effect(command: str, spec: Spec, overrides: Sequence[str]) -> Iterator[str]:
    """Yield a notice for each number that --set gives a value although the command sweeps it."""
    from wavesweep.program.spec import SYMBOLS

    table = "bode" if command == "bode" else "sweep"
    swept = {
        axis.path: axis.name for axis in getattr(spec, table) if axis.values or command in INTERVALS
    }
    swept = ({SYMBOLS["K_VE"]: "K_VE"} if command == "zwidth" else {}) | swept
    for override in overrides if command in (*INTERVALS, *OVER_AXES) else ():
        name = override.partition("=")[0].strip()
        key = spec.names.find(name)
        if key is not None and key.path in swept:
            axis = swept[key.path]
            yield f"--set {override} has no effect here: {axis} is swept; --set {table}.{axis}=... changes its values"


def _uncovered(spec: Spec, claims: Sequence[Claim]) -> Iterator[str]:
    """Yield a notice for each of the scopes that a spec asks about and no claim of its tables
    covers; without one, what a table with a single claim is of, beside the spec's own numbers."""
    from wavesweep.program.analyses.claim_words import claimed, scope_in_words
    from wavesweep.program.analyses.claims import LINEAR, uncovered

    if not claims:
        return
    scopes = [claim.scope for claim in claims]
    beyond = [scope for scope in uncovered(spec, scopes) if scope_in_words(scope)]
    for scope in beyond:
        able: Sequence[str] = FOR_ALL_NUMBERS
        if scope.walls != LINEAR:  # of blocks that saturate there are no rows, but a verdict
            able = THROUGH_CONTACT if spec.wall else ("check",)
        elif scope.messages or spec.changing or scope.tick:  # for which there are no margins
            able = FOR_ALL_MESSAGES
        answer = "answers" if len(able) == 1 else "answer"
        yield f"{spec.name}: {claimed(claims[0])}; {listed(able)} {answer} {scope_in_words(scope)}"
    if not beyond and len(claims) == 1 and scope_in_words(scopes[0]):
        yield f"{spec.name}: {claimed(claims[0])}"


def _refuse_to_overwrite(
    specs: Sequence[Spec], kinds: Sequence[str], directory: Path, options: Options
) -> None:
    """Raise UsageError if a file that is to be written is one that a spec reads."""
    from wavesweep.program import results

    written = []
    if options.file:
        written = [options.file]
    elif not options.to_stdout:
        written = [directory / name for kind in kinds for name in results.names_of(kind)]
    refuse_inputs((file for spec in specs for file in spec.files), *written)


def _of_specs(
    command: str, specs: Sequence[Spec], options: Options, facts: Mapping[str, Any]
) -> Iterator[str]:
    """Yield what is unusual about specs, not covered by the claims, or without effect."""
    from wavesweep.program.analyses.assumptions import unusual
    from wavesweep.program.analyses.claims import Claim

    claims: dict[str, list[Claim]] = {spec.name: [] for spec in specs}
    for word, fact in facts.get("claims", {}).items():
        name = word.split("/")[0] if len(specs) > 1 else specs[0].name
        claims[name].append(Claim.read(fact))
    for spec in specs:
        yield from unusual(spec)
        yield from _uncovered(spec, claims[spec.name])
        yield from _without_effect(command, spec, options.overrides)


def _report(
    command: str,
    specs: Sequence[Spec],
    options: Options,
    facts: Mapping[str, Any],
    finished: Sequence[Finished],
    changed: Sequence[str],
    seconds: float,
) -> None:
    """Print the summary of a run: one JSON object on stdout, or lines on stderr."""
    said = [*_of_specs(command, specs, options, facts)]
    notices = [*dict.fromkeys(said), *(notice for done in finished for notice in done.notices)]
    if options.as_json:
        show_json(
            {
                "command": command,
                "specs": [spec.name for spec in specs],
                "spec_sha256": facts["spec_sha256"],
                "assumes": facts.get("assumes", ""),
                "notices": notices,
                "tables": {done.kind: done.numbers for done in finished},
                "files": [str(path) for done in finished for path in done.paths],
                "changed": list(changed),
                "seconds": round(seconds, 3),
            }
        )
        return
    for line, warning in _lines(said, facts, finished):
        say(line, warning)
    if not options.to_stdout:
        # name the checkpoints that interrupted runs of a command have left in a folder
        directory = folder_of(specs, options)
        from wavesweep.program.store.checkpoint import SUFFIX

        for checkpoint in sorted(directory.glob(f".{command}-*{SUFFIX}")):
            say(
                f"an interrupted run of another version of the spec is kept in {checkpoint}; remove it if it is not needed"
            )
    _say_written(finished, changed, seconds)


def _lines(
    said: Sequence[str], facts: Mapping[str, Any], finished: Sequence[Finished]
) -> list[Line]:
    """The lines of a summary and whether they are warnings; assumptions that favour stability come first, others last."""
    from wavesweep.program.analyses.assumptions import FAVOURABLE

    assumed = []
    for model in facts.get("assumes", "").splitlines():
        assumed += [(line, False) for line in folded(f"assumes: {model}")]
    lines: list[Line] = []
    for sentence in dict.fromkeys(said):
        lines += [(line, False) for line in folded(sentence)]
    for done in finished:
        lines += [(notice, False) for notice in done.notices]
        lines += done.lines
    if FAVOURABLE in facts.get("assumes", ""):
        return [*assumed, *lines]
    return [*lines, *assumed]


def _say_written(finished: Sequence[Finished], changed: Sequence[str], seconds: float) -> None:
    """Say what of a spec has changed since the results that were replaced, and which files were written."""
    if changed:
        shown = [
            *changed[:MOST_CHANGES],
            *([f"{len(changed) - MOST_CHANGES} more"] if len(changed) > MOST_CHANGES else []),
        ]
        say(f"replaced the results of this spec; changed: {', '.join(shown)}")
    for done in finished:
        if done.paths:
            say(where(done.paths, seconds))


def produce_intervals(
    kind: str,
    source: str,
    options: Options,
    along: str | None = None,
    for_hands: Sequence[str] = (),
    proof: bool = False,
) -> None:
    """Compute and write a table of stable intervals, which need not fit into memory; otherwise as `produce`.

    along: axis of the intervals, the spec's own by default. for_hands: words for guarantees, which
    go with the intervals of the loop itself into a table KIND-hands. proof: whether its proof file is written too.
    """
    from wavesweep.capabilities import offered
    from wavesweep.program import results
    from wavesweep.program.tables.hand_rows import hands_of
    from wavesweep.program.tables.interval_table import intervals

    hands = None
    refuse_proof(proof, options)
    if for_hands:
        hands, kind = hands_of(for_hands), kind + HANDS

    def compute(specs: list[Spec], **work: Any) -> list[Table]:
        if hands and not options.to_stdout and not options.overwrite:
            results.refuse_other_hands(kind, folder_of(specs, options), hands.facts()["for_hands"])
        (spec,) = specs
        loud = not (verbosity().quiet or verbosity().as_json)
        own_axis = spec.names.find(spec.along) if along is None and spec.wall else None
        if loud and own_axis and own_axis.path == spec.wall[0]:
            say(f"along {spec.along} this is the table of `wavesweep zwidth`")
        table = replace(intervals(spec, along=along, hands=hands, **work), kind=kind)
        if proof:
            proofs = offered("of_table")
            table = proofs.with_proof(table, spec, source, options.overrides, unless_quiet)
        return [table]

    produce([kind], [source], options, compute)


def unless_quiet(line: str) -> None:
    """Say a line that --quiet and --json leave out."""
    if not (verbosity().quiet or verbosity().as_json):
        say(line)


def refuse_proof(proof: bool, options: Options) -> None:
    """Refuse a proof file where there is no folder for it. Errors: UsageError."""
    if proof and not options.to_folder:
        raise UsageError(f"--proof: expected a folder as --out, found {options.out}")


def checkpoint_of(name: str, specs: Sequence[Spec], options: Options) -> Path:
    """Return the file for the finished chunks of a run.

    Its name has the digest of the specs: if a spec is edited after a run of it was interrupted, the
    new run begins anew, and the old one goes on if the edit is undone.
    """
    from wavesweep.program.store.checkpoint import SUFFIX
    from wavesweep.program.tables.table import digest_of

    return folder_of(specs, options) / f".{name}-{digest_of(specs)[:12]}{SUFFIX}"


def prepare_work(options: Options) -> None:
    """Keep freed memory for the work, and say if fewer workers are used than `--jobs` names.

    Raises UsageError if the backend or stdout cannot be used.
    """
    from wavesweep.program.platform_compat import keep_memory
    from wavesweep.program.sweep.workers import excess, refuse_backend

    refuse_backend(options.backend)
    keep_memory()
    if options.to_stdout:
        try:
            os.write(sys.stdout.fileno(), b"")
        except OSError as error:
            if (
                error.errno == errno.EBADF
            ):  # and no stream without a number, as a program that calls this one may have
                raise UsageError(
                    "--out -: expected a place to write the table to, found stdout closed"
                ) from error
    if not options.quiet and (fewer := excess(options.jobs, options.backend)):
        say(fewer, warning=True)


def folder_of(specs: Sequence[Spec], options: Options) -> Path:
    """Return the folder for the results, or that of the only file."""
    if options.file:
        return options.file.parent
    return Path(options.out or own_folder((spec.name for spec in specs), options.overrides))


class Finished(NamedTuple):
    """A table that was written: its kind, notices, summary as numbers and as lines, and the paths of its files."""

    kind: str
    notices: list[str]
    numbers: Mapping[str, Any]
    lines: list[Line]
    paths: list[Path]


def _finish(table: Table, directory: Path, options: Options, main: bool) -> Finished:
    """Write a table to files, or to stdout if it is the main one, and summarise it unless nothing is said."""
    from wavesweep.program.tables import kind_named

    kind, notices = (
        kind_named(table.kind),
        [str(notice) for notice in table.facts.get("notices", ())],
    )
    tally = None if options.silent else kind.tally(table)
    if options.formats and (main or options.to_folder):
        from wavesweep.program.plots import drawn

        table = drawn(table, notices.append)
    paths: list[Path] = []
    if options.to_folder or main:
        paths = _write(table.watched(tally.add) if tally else table, directory, options)
    elif tally:
        tally.add(table.columns)
    # The rows are written, so the checkpoint is not needed any more.
    table.forget()
    if not tally:
        return Finished(table.kind, notices, {}, [], paths)
    warnings = [(str(warning), True) for warning in table.facts.get("warnings", ())]
    numbers = tally.numbers(table.facts)
    return Finished(table.kind, notices, numbers, [*warnings, *kind.lines(numbers)], paths)


def _write(table: Table, directory: Path, options: Options) -> list[Path]:
    """Write a table to files, or to stdout, and give the paths of its files."""
    from wavesweep.program import results

    if options.file:
        return [results.save(table, options.file)]
    if options.to_folder:
        return results.publish(table, directory, options.overwrite, options.formats, True)
    try:
        results.stream(table, sys.stdout.buffer)
    except OSError as error:
        raise OSError(error.errno, error.strerror, error.filename or "stdout") from error
    return []
