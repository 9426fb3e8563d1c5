"""The commands that compute tables of specs: their own options, their help, and the call that computes.

The options of a run stand in `options`; what is done before and after the call in `output`.
"""

from collections.abc import Callable
from functools import partial
from pathlib import PurePath
from typing import Any

import click

from wavesweep.cli.options import Options, run_options

one_spec = click.argument("spec")
several_specs = click.argument("specs", metavar="SPEC...", nargs=-1, required=True)


for_hands = click.option(
    "--for-hands",
    "for_hands",
    multiple=True,
    metavar="WORD",
    help="Add the intervals that are guaranteed for hands, in a table of its own. passive: stable with every passive hand, "
    "of any mass and stiffness, also if it moves within a tick. box: stable with every hand between a fingertip and an "
    "arm, or with ranges of your own, e.g. box:mass=0.1..0.4,damping=2..5 (kg, N*s/m; stiffness in N/m). port: the hand's "
    "port is passive if forces are held over a tick. May be repeated. A slice takes from tenths of a second to some ten "
    "seconds.",
)


def _of_intervals(body: Callable[..., Any]) -> Callable[..., Any]:
    """The options of the commands of stable intervals."""
    return for_hands(run_options("workers", "long")(body))


def _refuse_equal_names(sources: tuple[str, ...]) -> None:
    """Raise UsageError if two files of specs have the same stem, which labels rows and curves."""
    stems = [PurePath(source).stem for source in sources]
    if twice := [stem for stem in stems if stems.count(stem) > 1]:
        raise click.UsageError(f"two specs are called {twice[0]}; expected different file names, which label the curves")


@click.command("zwidth")
@one_spec
@_of_intervals
def zwidth(spec: str, options: Options, for_hands: tuple[str, ...]) -> None:
    """Find the stable intervals of the stiffness K_VE for each B_VE and each other axis.

    The Z-width of a device is the range of virtual walls with which its loop is stable. A wall has the stiffness K_VE (N/m) and
    the damping B_VE (N*s/m). SPEC is a TOML file; its [sweep] table gives the range of K_VE, the values of B_VE, and those of
    any other axis, such as the wave impedance b.

    The table has a row per stable interval of K_VE, from low to high. There can be several, with unstable walls between
    them; all are found. felt_low and felt_high are the stiffness that the hand feels at both ends, which is below K_VE if
    waves give way. The column certified is 1 if an interval is proved, and otherwise the column doubt gives the reason.

    With --for-hands the rows go to zwidth-hands.*, beside zwidth.*, with a column hand that says for whom each is: free, the
    device alone; operator, the spec's own; passive, box or port. The column settled is 1 if a row for a box is proved but for a
    thousandth of the interval at each end, and 0 if a search found no unstable hand.

    \b
    Examples:
      wavesweep zwidth sweeps/paper/fig4.toml
      wavesweep zwidth mine.toml --for-hands box --for-hands port
      wavesweep zwidth mine.toml --set device.mass=0.2 --set 'sweep.B_VE=[0, 1, 5]'
    """
    from wavesweep.cli.output import produce_intervals

    produce_intervals("zwidth", spec, options, along="K_VE", for_hands=for_hands)


@click.command("stability-region")
@one_spec
@_of_intervals
def stability_region(spec: str, options: Options, for_hands: tuple[str, ...]) -> None:
    """Find the stable intervals along any axis for every combination of the others.

    SPEC is a TOML file; its key sweep.along gives the axis of the intervals (a symbol such as b, or the path of any number,
    such as "device.damping"), and its [sweep] table the range of that axis and the values of the others. The columns are
    those of zwidth; with --for-hands the files are stability-region-hands.*.

    \b
    Examples:
      wavesweep stability-region sweeps/examples/impedance.toml
      wavesweep stability-region mine.toml --set 'sweep={along = "b", b = {start = 5, stop = 100}, B_VE = [1, 5]}'
    """
    from wavesweep.cli.output import produce_intervals

    produce_intervals("stability-region", spec, options, for_hands=for_hands)


@click.command("bode")
@several_specs
@run_options("workers", "long")
def bode(specs: tuple[str, ...], options: Options) -> None:
    """Compute transmitted admittance and impedance over frequency, or the responses between inputs and outputs.

    The admittance is the motion that the hand gets for its force (m/N), the impedance the force that it feels for its motion
    (N/m): at low frequency the stiffness felt. Each SPEC is a TOML file; its [bode] table gives the frequencies, and axes,
    whose values give one curve per combination. Without that table there are 400 frequencies from 0.1 to 50 Hz, or in the
    same ratio up to half the rate of the ticks, if that is less.

    Of a drawn loop whose [ports] have inputs and outputs and no hand, the responses are those from each input to each output;
    of one with a hand too, if [bode] names an end: from = "INPUT", to = "OUTPUT". Their table is bode-ports.

    \b
    Examples:
      wavesweep bode sweeps/paper/fig6.toml
      wavesweep bode mine.toml other.toml --set 'bode.b=[20, 40]'
      wavesweep bode sweeps/templates/drive.toml --set bode.from=ref
    """
    from wavesweep.cli.output import produce
    from wavesweep.tables.responses import responses

    _refuse_equal_names(specs)
    produce(["bode", "bode-ports"], specs, options, lambda specs, **work: [responses(specs, **work)])


@click.command("compare")
@several_specs
@run_options("workers")
def compare(specs: tuple[str, ...], options: Options) -> None:
    """Compare the Z-width and the responses of several specs, in a figure and two tables.

    Each SPEC is a TOML file with its own [sweep] and [bode] tables. The table compare has a row per spec and stable interval of
    K_VE: the column spec, then the columns of zwidth. The table compare-bode has the responses, as bode writes them. The
    figure has the stable walls of all specs, as zwidth draws them, above their responses, as bode draws them, with a colour
    for each spec. The results go to results/<names of all specs>, and --set applies to all specs.

    \b
    Example:
      wavesweep compare mine.toml other.toml
    """
    from wavesweep.cli.output import produce
    from wavesweep.identification.points import facts_of_points
    from wavesweep.tables import comparison

    _refuse_equal_names(specs)

    def compute(loaded, **work):
        measured = facts_of_points(loaded, "compare")
        walls, responses = comparison.compare(loaded, **work)
        if not options.formats:
            return [walls, responses]
        from wavesweep import plots

        draw = partial(
            plots.compare, walls.columns, {**walls.facts, **measured}, responses=responses.columns, of_responses=responses.facts
        )
        return [plots.with_figure(walls, draw), responses]

    produce(["compare", "compare-bode"], specs, options, compute)


@click.command("simulate")
@one_spec
@run_options()
def simulate(spec: str, options: Options) -> None:
    """Simulate the loop tick by tick, optionally with contact, friction and hardware limits.

    SPEC is a TOML file. Its [simulate] table gives the force of the hand, and effects that the linear model does not have: a
    one-sided wall, an encoder, friction, a force limit, imperfect timing, or all of a device by its name. If the force is a
    sine or a stepped sine, the response estimated from it is written as a second table, simulate-response.

    Of a loop that the spec draws, an input in [ports] may be in the place of the hand: [simulate] from = "INPUT". The table has
    its inputs, its outputs and its named signals; after a step the summary says where the outputs settle, and when.

    With [simulate] frames = [16, 16, 20, 33, 33] the slow environment's frames have these lengths in turn, for ever: so a
    counterexample of [for_all] is seen to grow.

    If the linear loop is unstable, the summary, the figure and the facts of the run say so, with its spectral radius, and the
    response is compared with no linear one. The simulation stops before the hand is 1 km away or a force exceeds 1e6 N. The
    exit code is 0 in both cases.

    \b
    Examples:
      wavesweep simulate sweeps/examples/rig.toml
      wavesweep simulate mine.toml --set simulate.input=step --set device.preset=omni
      wavesweep simulate sweeps/templates/drive.toml --set simulate.from=load
    """
    from wavesweep.cli.output import produce
    from wavesweep.spec import Spec
    from wavesweep.tables import simulation

    kinds = ["simulate", "simulate-response"]
    produce(kinds, [spec], options, lambda specs, **_: simulation.simulate(*specs), asked=Spec.as_simulated)


@click.command("passivity")
@one_spec
@click.option(
    "--filters",
    is_flag=True,
    help="Write a second table, passivity-filters: the norm of the channel with LP1 of order 1 to 8 at several cutoffs.",
)
@click.option(
    "--tolerance",
    metavar="SHARE",
    type=click.FloatRange(min=0.0),
    default=1e-3,
    show_default=True,
    help="Energy (J per J sent) that aliasing may add for the channel to count as passive, here and with --filters.",
)
@click.option(
    "--along",
    metavar="NAME",
    help="Find the intervals of this number, such as K_VE, with a passive port and with a passive channel, with their proof. "
    "[sweep] gives its range.",
)
@run_options("workers", "long")
def passivity(spec: str, options: Options, filters: bool, tolerance: float, along: str | None) -> None:
    """Compute the norm of the wave channel and the passivity margin at the hand's port.

    A passive loop gives out no energy, so it is stable with every passive hand. SPEC is a TOML file; each axis of its [sweep]
    table that has values is swept. The channel is passive if its norm is at most 1, the port if its margin is not negative.
    damping_needed is the further damping of the device with which the port is passive. If the loop has no waves, the norm
    is missing and channel_passive is 1.

    At the port the force of the hand is held over a tick. If the hand may also move within the tick, more damping can be
    necessary: see zwidth --for-hands passive.

    A drawn loop with a second port, [ports] environment, is absolutely stable if it is stable with every pair of passive
    terminations: ports_margin is the damping that both ports may lose, and a second table, passivity-ports, has Llewellyn's
    index over frequency.

    With --along NAME the table is passivity-along: the stable intervals of that number, those with a passive port, those that
    are absolutely stable, and those with a passive channel, one row each. The column hand says which; certified is 1 if every
    value of the interval is proved to be so, and those just outside are proved not to be.

    \b
    Examples:
      wavesweep passivity sweeps/paper/fig4.toml --filters
      wavesweep passivity mine.toml --along K_VE --set 'sweep.K_VE={start = 0, stop = 2000}'
    """
    from wavesweep.cli.output import produce
    from wavesweep.tables import passivity as tables

    def compute(specs, **work):
        (loaded,) = specs
        if along:
            return [tables.passive_along(loaded, along, tolerance, **work)]
        choices = [tables.filter_choices(loaded, tolerance)] if filters else []  # first, since a spec may have none
        choices += [tables.over_frequency(loaded)] if loaded.drawing and loaded.drawing.environment else []
        return [tables.passivity(loaded, tolerance, **work), *choices]

    if along and filters:
        raise click.UsageError("--filters: expected without --along, which has a table of its own")
    kinds = ["passivity-along"] if along else ["passivity", *(["passivity-filters"] if filters else []), "passivity-ports"]
    produce(kinds, [spec], options, compute)


@click.command("why")
@one_spec
@click.option(
    "--along",
    metavar="NAME",
    help="The axis whose stable intervals are explained [default: sweep.along]. Without a span in [sweep] it is searched from "
    "a tenth of its value to ten times that; K_VE from 0 to 20000.",
)
@run_options()
def why(spec: str, options: Options, along: str | None) -> None:
    """Explain each limit of a design: by how many per cent it moves for one per cent of each number.

    SPEC is a TOML file. For its own values the stable intervals along an axis are found; other axes of [sweep] are not swept.
    For each end that stability sets, and for the stiffness that the hand feels there, the table has the elasticity (per cent
    per per cent) and the slope with respect to every number that the loop reads, the mode that crosses the unit circle there,
    its damping beside the end, and the states that take part in it.

    The derivatives are exact and not differences. They hold for small changes: another crossing may set the end after a large
    one. If two crossings set an end, each has rows of its own. Whole numbers have no derivative and are left out.

    \b
    Examples:
      wavesweep why sweeps/paper/fig4.toml
      wavesweep why mine.toml --along b --set 'sweep.b={start=5, stop=80}'
    """
    from wavesweep.cli.output import produce
    from wavesweep.tables import why as table

    produce(["why"], [spec], options, lambda specs, **_: [table.why(*specs, along)])


@click.command("margins")
@one_spec
@click.option(
    "--cut",
    metavar="SIGNAL",
    default="",
    help="The signal at which the loop is broken: an output of a block that a wire reads, BLOCK.PORT, or a name in [signals] "
    "[default: the only one that acts on the plant, the actuator's].",
)
@run_options()
def margins(spec: str, options: Options, cut: str) -> None:
    """Compute gain, phase, delay and disk margins and peak sensitivities of a loop broken at one signal.

    SPEC is a TOML file. Its own loop is broken at an output of a block, so that the rest of the loop, at all its rates, is one
    exact transfer function at the rate of the frame. The table has a row per margin, with its frequency and a bound on its
    error. A signal that is made several times in a frame has the margins of the lifted loop: one factor multiplies all of its
    samples.

    No grid of frequencies is used: gains are the ends of a certified stable interval, phases come from all crossings of the
    gain 1, peaks from level sets. With unknown numbers in [for_all] there are also rows of the margins that are proved for all
    of them, with the numbers that refute larger ones.

    \b
    Examples:
      wavesweep margins sweeps/recipes/current-loop.toml
      wavesweep margins mine.toml --cut avatar.out --set b=20
    """
    from wavesweep.cli.output import produce
    from wavesweep.tables import margins as table

    produce(["margins"], [spec], options, lambda specs, **_: [table.margins(*specs, cut)])


@click.command("design")
@one_spec
@click.option(
    "--for-hands",
    "checked",
    type=click.Choice(["vertices", "box"]),
    default="vertices",
    show_default=True,
    help="The hands that the designs of the result are checked for. vertices: the ends of the ranges of [design.for_all] and "
    "values between them. box: every hand between the ends, which takes seconds for each design and device; the columns "
    "z_width_box and box_settled say what is left and whether it is proved.",
)
@run_options("workers")
def design(spec: str, checked: str, options: Options) -> None:
    """Search for designs that meet a wish, for all devices and hands that they have to hold for.

    SPEC is a TOML file. Its table [design.vary] has the numbers that may be changed, with their ranges; [design.wish] the
    quantities wished for, each with a bound (at_least, at_most) or as good as possible; [design.for_all] devices, hands, delays
    and ratios, of which the worst counts. With two wishes without a bound the result is their front, with one the best design,
    and if all have bounds the design that keeps the tightest of them by the largest share.

    A row of the table is a design, the best first, with the worst value of each wish and what sets it. best/SPEC-*.toml are
    specs of up to ten of them, which every other command takes. If no design meets all bounds, the exit code is 1, and the
    message names the nearest miss and the wishes that stand against each other. An interrupted search goes on where it stopped.

    \b
    Example:
      wavesweep design sweeps/design/front.toml
    """
    from wavesweep.cli.output import produce
    from wavesweep.spec import Spec

    def compute(specs, **work):
        from wavesweep.search import study
        from wavesweep.search.best import with_best

        table = study.design(*specs, for_hands=checked, **work)
        return [with_best(table, specs[0]) if options.to_folder else table]

    produce(["design"], [spec], options, compute, asked=Spec.as_designed)
