"""What a run would compute, said before it runs."""

from wavesweep.diagram import draw, keys_read
from wavesweep.errors import SpecError, UsageError
from wavesweep.lifted import cut_at_wall
from wavesweep.spec import Spec, sweep_axes
from wavesweep.sweep.grid import make_grid
from wavesweep.sweep.interval_table import method


def plan(spec: Spec) -> list[str]:
    """Lines for `wavesweep check`: the loop, what each command would compute and how, what is skipped and why."""
    diagram = draw(spec.values)
    cut = cut_at_wall(diagram)
    kind, where = spec.values["controller.kind"], spec.source or spec.name
    lines = [f"{where}: valid, controller {kind}", *_loop_lines(spec, diagram, cut)]
    for command, along in (("zwidth", "K_VE"), ("stability-region", None)):
        lines += _interval_lines(spec, command, along)
    return [*lines, *_bode_lines(spec), *_skipped_lines(spec)]


def _loop_lines(spec, diagram, cut):
    frame = f"frame of {diagram.ratio} tick{'s' if diagram.ratio > 1 else ''}, {1e3 * float(cut.period):.6g} ms"
    yield f"  loop: {frame}; {cut.order} states with the wall: {', '.join(cut.states)}{', position' if cut.integrates else ''}"
    if cut.unread:
        yield f"  left out, since nothing in the loop reads them: {', '.join(cut.unread)}"
    if cut.conserved:
        yield f"  drift set aside: the loop conserves a combination of states ({cut.conserved})"
    elif cut.integrates and spec.values["operator.stiffness"] == 0:
        yield "  drift set aside at K_VE = 0: the position of the whole scene, which only the wall holds"


def _interval_lines(spec, command, along):
    try:
        axis, others = sweep_axes(spec, along)
        grid = make_grid(spec, others, axis.path)
    except (SpecError, UsageError) as error:
        return [f"  {command}: not possible with this spec: {error}"]
    product = " x ".join(f"{a.name}[{len(a.values)}]" for a in grid.axes) or "the spec's own values"
    return [
        f"  {command}: stable intervals along {axis.name} in ({axis.start:g}, {axis.stop:g}) for {product}: "
        f"{grid.loops * grid.walls} slices over {grid.loops} compiled loops",
        f"    method: {method(axis.path)}",
    ]


def _bode_lines(spec):
    grid, points = make_grid(spec, spec.bode), spec.frequency_hz
    return [
        f"  bode: {grid.loops * grid.walls} curves of {len(points)} frequencies from {min(points):g} to {max(points):g} Hz; "
        "method: lifted resolvent of both rates"
    ]


def _skipped_lines(spec):
    read, kind = keys_read(spec.values), spec.values["controller.kind"]
    for axes, table in ((spec.sweep, "sweep"), (spec.bode, "bode")):
        for axis in make_grid(spec, axes).ignored:
            yield f"  {table}.{axis.name}: skipped, {kind} does not read it; its rows would be repeated"
    unread = [path for path in spec.values if path not in read]
    if unread:
        yield f"  not read by {kind}: {', '.join(unread)}"
