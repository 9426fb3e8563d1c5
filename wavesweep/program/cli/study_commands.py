"""The commands that compute tables of specs: their own options, their help, and the call that computes.

The options of a run stand in `options`; what is done before and after the call in `output`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import click

from wavesweep.capabilities import offered
from wavesweep.program.cli.options import (
    ABOUT_ITS_VALUE,
    PATH,
    Number,
    Options,
    is_given,
    run_options,
)
from wavesweep.program.row_kinds import hands_offered

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec
    from wavesweep.program.tables.table import Table

one_spec = click.argument("spec", type=PATH)
several_specs = click.argument("specs", metavar="SPEC...", nargs=-1, required=True, type=PATH)


for_hands = click.option(
    "--for-hands",
    "for_hands",
    multiple=True,
    metavar="WORD",
    help="Add the intervals for hands, in a table of its own. "
    + "".join(f"{word}: {text}. " for word, text in hands_offered().items())
    + "May be repeated. A slice takes from tenths of a second to some ten seconds.",
)


with_proof = click.option(
    "--proof",
    is_flag=True,
    help="Also write NAME.proof: the rows as claims with their proofs, which `python -m wavesweep.checker "
    "SPEC NAME.proof` checks without the rest of this program.",
)


def _of_intervals(body: Callable[..., Any]) -> Callable[..., Any]:
    """The options of the commands of stable intervals."""
    with_options: Callable[..., Any] = for_hands(with_proof(run_options("workers")(body)))
    return with_options


def refuse_equal_names(sources: tuple[str, ...]) -> None:
    """Raise UsageError if two files of specs have the same stem, which labels rows and curves."""
    stems = [PurePath(source).stem for source in sources]
    if twice := [stem for stem in stems if stems.count(stem) > 1]:
        raise click.UsageError(
            f"two specs are called {twice[0]}; expected different file names, which label the curves"
        )


@click.command("zwidth")
@several_specs
@_of_intervals
def zwidth(
    specs: tuple[str, ...], options: Options, for_hands: tuple[str, ...], proof: bool
) -> None:
    """Find the stable intervals of the stiffness K_VE for each B_VE and each other axis.

    The Z-width of a device is the range of virtual walls with which its loop is stable. A wall has
    the stiffness K_VE (N/m) and the damping B_VE (N*s/m). SPEC is a TOML file; its [sweep] table
    gives the range of K_VE, the values of B_VE, and those of any other axis, such as the wave
    impedance b. `stability-region` gives the same table along any other number.

    The table has a row per stable interval of K_VE, from low to high. There can be several, with
    unstable walls between them; all are found. felt_low and felt_high are the stiffness that the
    hand feels at both ends, which is below K_VE if waves give way. The column certified is 1 if an
    interval is verified within bounds on rounding; otherwise the column doubt gives the reason.

    With --for-hands the rows go to zwidth-hands.*, beside zwidth.*, with a column hand that says
    for whom each is: free, the device alone; operator, the spec's own; or a word of --for-hands.
    A row for a box is certified if it is proved; its ends are then those of the proof, which stays
    a thousandth away from an end that a hand sets. In doubt ("search") it is what a search found.

    Of several specs the table is zwidth-specs.*, with the column spec, and the figure has a colour
    for each.

    \b
    Examples:
      wavesweep zwidth sweeps/paper/fig4.toml
      wavesweep zwidth mine.toml --for-hands box --for-hands port
      wavesweep zwidth mine.toml --set device.mass=0.2 --set 'sweep.B_VE=[0, 1, 5]'
      wavesweep zwidth mine.toml other.toml
    """
    from wavesweep.program.cli.output import produce, produce_intervals

    if len(specs) == 1:
        return produce_intervals(
            "zwidth", specs[0], options, along="K_VE", for_hands=for_hands, proof=proof
        )
    refuse_equal_names(specs)
    if for_hands or proof:
        option = "--for-hands" if for_hands else "--proof"
        raise click.UsageError(
            f"{option}: expected one spec beside it, found several; give each its own command"
        )
    from wavesweep.program.tables.specs import intervals_of_specs

    return produce(
        ["zwidth-specs"], specs, options, lambda specs, **work: [intervals_of_specs(specs, **work)]
    )


@click.command("stability-region")
@one_spec
@click.option(
    "--map",
    "mapped",
    metavar="NUMBERS",
    default="",
    help="Two or three numbers, as K,b: their whole plane in parts that are proved stable, proved unstable or open, over their "
    f"ranges in [sweep], or else {ABOUT_ITS_VALUE}. The table is stability-map.",
)
@click.option(
    "--open",
    "share_open",
    type=Number(0.0, 1.0, min_open=True),
    default=None,
    help="With --map, the share of the plane that may stay open [default: 0.005, of three numbers 0.05].",
)
@_of_intervals
def stability_region(
    spec: str,
    options: Options,
    for_hands: tuple[str, ...],
    proof: bool,
    mapped: str,
    share_open: float | None,
) -> None:
    """Find the stable intervals along any axis for every combination of the others.

    SPEC is a TOML file; its key sweep.along gives the axis of the intervals (a symbol such as b, or
    the path of any number, such as "device.damping"), and its [sweep] table the range of that axis
    and the values of the others. The columns are those of zwidth, and along K_VE, the default, the
    whole table is that of zwidth; with --for-hands the files are stability-region-hands.*.

    With --map nothing is found along an axis: the plane of the numbers is divided until all but a
    small share of it is proved. No point is guessed, between the rows or in the figure.

    \b
    Examples:
      wavesweep stability-region sweeps/examples/impedance.toml
      wavesweep stability-region mine.toml --set 'sweep={along = "b", b = {start = 5, stop = 100}, B_VE = [1, 5]}'
      wavesweep stability-region mine.toml --map K_VE,b --set 'sweep.b={start=5, stop=100}'
    """
    from wavesweep.program.cli.output import (
        produce,
        produce_intervals,
        refuse_proof,
        unless_quiet,
    )

    refuse_proof(proof, options)
    if not mapped and share_open is not None:
        raise click.UsageError("--open: expected --map, whose share it is, found none")
    if mapped:
        for name in ("for_hands", "jobs", "backend", "scheduler", "restart"):
            if is_given(name):
                option = name.replace("_", "-")
                raise click.UsageError(
                    f"--map: expected it without --{option}; leave one of them out"
                )
        maps = offered("stability_map")
        names = [name.strip() for name in mapped.split(",")]

        def compute(specs: list[Spec], progress: Any, **_: Any) -> list[Table]:
            table = maps.stability_map(specs[0], names, share_open, progress)
            if proof:
                proofs = offered("of_table")
                table = proofs.of_map(table, specs[0], spec, options.overrides, unless_quiet)
            return [table]

        return produce(["stability-map"], [spec], options, compute)

    return produce_intervals("stability-region", spec, options, for_hands=for_hands, proof=proof)


@click.command("bode")
@several_specs
@run_options("workers")
def bode(specs: tuple[str, ...], options: Options) -> None:
    """Compute transmitted admittance and impedance over frequency, or the responses between inputs and outputs.

    The admittance is the motion that the hand gets for its force (m/N), the impedance the force
    that it feels for its motion (N/m): at low frequency the stiffness felt. Each SPEC is a TOML
    file; its [bode] table gives the frequencies, and axes, whose values give one curve per
    combination. Without that table there are 400 frequencies from 0.1 to 50 Hz, or in the same
    ratio up to half the rate of the ticks, if that is less.

    Of a drawn loop whose [ports] have inputs and outputs and no hand, the responses are those from
    each input to each output; of one with a hand too, if [bode] names an end: from = "INPUT", to =
    "OUTPUT". Their table is bode-ports.

    \b
    Examples:
      wavesweep bode sweeps/paper/fig6.toml
      wavesweep bode mine.toml other.toml --set 'bode.b=[20, 40]'
      wavesweep bode sweeps/templates/drive.toml --set bode.from=ref
    """
    from wavesweep.program.cli.output import produce
    from wavesweep.program.tables.response_table import responses

    refuse_equal_names(specs)
    less = "fewer values and frequencies in [bode] take less"
    produce(
        ["bode", "bode-ports"],
        specs,
        options,
        lambda specs, **work: [responses(specs, **work)],
        less=less,
    )
