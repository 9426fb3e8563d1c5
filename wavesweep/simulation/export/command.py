"""`wavesweep export`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import click

from wavesweep.program.cli.entry import verbosity
from wavesweep.program.cli.options import PATH, folder, override, overwriting

if TYPE_CHECKING:
    from wavesweep.program.analyses.claims import Claim
    from wavesweep.program.spec import Spec


@click.command("export")
@click.argument("spec", type=PATH)
@click.option(
    "--to", type=click.Choice(["c"]), default="c", show_default=True, help="Language: c is C99."
)
@click.option(
    "--float",
    "floats",
    is_flag=True,
    help="Floats in place of doubles; make check then holds each tick against the same in doubles, within a bound that follows "
    "from how often it rounds, and counts the changes that are too small for floats.",
)
@click.option(
    "--controller",
    "controller",
    metavar="NAME",
    help="Only one controller of the loop: NAME is a block, which takes the blocks of its rate with it that wires connect, or blocks "
    "with commas between. One C function makes its step, in its own period; make check runs it inside the whole loop.",
)
@folder("Folder for the files [default: results/<spec's name>/c, of one controller c-<its name>].")
@overwriting("Replace existing files.")
@override
def export(
    spec: str,
    to: str,
    floats: bool,
    controller: str | None,
    out: str | None,
    overwrite: bool,
    overrides: tuple[str, ...],
) -> None:
    """Write the controller as C, with test vectors: what was analysed is what runs.

    SPEC is a TOML file. controller.h and controller.c have the controller with its state in one
    struct, without allocation and without a mathematical library; each operation is that of
    simulate, so all numbers are the same to the last bit. The device is the host's: example.c shows
    a host. vectors.csv has the experiment of the spec's [simulate] table, and make check compiles
    the controller, runs the vectors and compares every bit. With --controller NAME it is NAME.h and
    NAME.c, and the header says what was analysed around it.

    If one of the files exists, they are replaced only with --overwrite.

    \b
    Examples:
      wavesweep export sweeps/paper/fig4.toml --to c --out controller
      wavesweep export servo.toml --controller speed --out speed
    """
    from wavesweep.program import results
    from wavesweep.program import spec as specs
    from wavesweep.program.atomic_files import made_folder
    from wavesweep.program.cli import file_places
    from wavesweep.program.cli.messages import show_json
    from wavesweep.simulation.export import exported
    from wavesweep.simulation.export.one_controller import exported_controller
    from wavesweep.simulation.from_spec import claim_of

    started = time.perf_counter()
    loaded = specs.load(spec, overrides)
    if controller and floats:
        raise click.UsageError("--controller: expected no --float beside it, found both")
    name = f"{to}-{controller}" if controller else to
    folder = Path(out or file_places.own_folder([loaded.name], overrides) / name)
    results.refuse_unusable(folder)
    told: list[str] = []
    if not controller:
        program = exported(loaded, floats=floats)
    else:
        told = _analysed_around(loaded, controller)
        program = exported_controller(loaded, controller, told)
    paths = [folder / name for name in program]
    file_places.refuse_other_things(*paths)
    file_places.refuse_inputs(loaded.files, *paths)
    expected = "another --out DIR, or --overwrite to replace the files"
    with made_folder(folder):
        files = zip(paths, program.values(), strict=True)
        file_places.write_whole(*files, overwrite=overwrite, expected=expected)
    claim = claim_of(loaded)
    facts = _facts(loaded, claim, floats, controller, told)
    facts["ticks"] = program["vectors.csv"].count("\n") - 1
    facts["files"] = [str(path) for path in paths]
    seconds = time.perf_counter() - started
    facts["seconds"] = round(seconds, 3)
    if verbosity().as_json:
        show_json(facts)
    elif not verbosity().quiet:
        compares = "each tick with doubles, within its roundings" if floats else "every bit"
        compares += " of one inside the whole loop" if controller else ""
        _say(facts, claim, f"{loaded.name}, {loaded.kind}", compares, paths, seconds)


def _facts(
    spec: Spec, claim: Claim, floats: bool, controller: str | None, told: list[str]
) -> dict[str, Any]:
    """What the summary says of the loop, as JSON; told: of the loop around one controller."""
    from wavesweep.program.analyses.assumptions import model_in_words, over_preset
    from wavesweep.program.analyses.claim_words import fact_of
    from wavesweep.simulation.experiment import linear_loop
    from wavesweep.simulation.export import dead_times_of, floats_in_words, terms_of
    from wavesweep.simulation.from_spec import hand_force

    simulated = spec.asking("simulate")
    outputs = {} if controller else terms_of(spec)
    notices = [floats_in_words(spec)] if floats else []
    notices += over_preset(spec)
    for said in dead_times_of(spec):
        notices.append(f"dead time of {said}: the device's, so the C does not compute it")
    facts = {
        "command": "export",
        "specs": [spec.name],
        "spec_sha256": simulated.sha256,
        "assumes": model_in_words(spec, told=claim.scope.paths()),
        "claims": {"spec": fact_of(claim)},
        "notices": notices,
        "computed": {port: made["sum"] for port, made in outputs.items()},
        "terms": {port: made["terms"] for port, made in outputs.items()},
        "wanted_ticks": len(hand_force(simulated).force),
        "linear_loop": linear_loop(simulated),
    }
    if controller:
        facts["controller"] = told
    return facts


def _say(
    facts: dict[str, Any],
    claim: Claim,
    loop: str,
    compares: str,
    paths: list[Path],
    seconds: float,
) -> None:
    """Print the summary; loop: its name and kind."""
    from wavesweep.program.cli.messages import say
    from wavesweep.simulation.table import unstable

    if not facts["linear_loop"]["stable"]:
        say(unstable(facts["linear_loop"]), warning=True)
    check = f"`make -C {quote(str(paths[0].parent))} check` compares {compares}"
    say(f"{loop}: vectors of {facts['ticks']} ticks; {check}")
    for line, warning in _lines(facts, claim):
        say(line, warning=warning)
    names = [str(paths[0]), *(path.name for path in paths[1:])]
    say(f"Wrote {', '.join(names)} in {seconds:.2f} s")


def _analysed_around(spec: Spec, controller: str) -> list[str]:
    """What is known of the loop of a controller, and what this assumes of the rest, in lines."""
    from wavesweep.capabilities import offered
    from wavesweep.program.analyses.claim_words import verdict_lines
    from wavesweep.program.analyses.claims import asks_more
    from wavesweep.program.analyses.own_design import own_design, own_lines
    from wavesweep.program.cli.messages import progress
    from wavesweep.simulation.controller_group import assumed_of_rest, group_of

    around = [*assumed_of_rest(spec, group_of(spec, controller))]
    design = own_design(spec)
    own_line, *_ = own_lines(spec, design)
    judging = offered("verdict")
    if judging is None or not asks_more(spec):
        return [own_line, *around]
    design |= judging.further(spec, design, progress("at work on the verdict"))
    lines = verdict_lines(judging.of_spec(spec, design), f"{spec.name}, {spec.kind}")
    return [*lines, f"  own numbers: {own_line.partition(': ')[2]}", *around]


def _lines(facts: Mapping[str, Any], claim: Claim) -> Iterator[tuple[str, bool]]:
    """Lines about the program and its vectors, and whether each is a warning."""
    for port, computed in facts["computed"].items():
        terms = _coefficients(facts["terms"][port])
        yield f"computed from samples, in C: {port} = {computed}{terms}", False
    for line in facts.get("controller", ()):
        yield line, False
    ticks = facts["ticks"]
    wanted = facts["wanted_ticks"]
    if ticks < wanted:
        ends = f"the vectors end after {ticks} of {wanted} ticks, where the run stops"
        yield f"{ends}; simulate says why", True
    if facts["assumes"] and "controller" not in facts:
        yield f"assumes: {facts['assumes']}", False
    if claim.scope.run:
        from wavesweep.program.analyses.claim_words import claimed

        yield f"vectors: {claimed(claim)}", False
    for notice in facts["notices"]:
        yield notice, False


def _coefficients(terms: list[dict[str, Any]]) -> str:
    """The coefficients of an output's terms, if not all are in its sum as numbers."""
    gains = [f"{term['coefficient']:g}" for term in terms]
    if gains != [term["gain"] for term in terms]:
        return f" (coefficients {', '.join(gains)})"
    return ""
