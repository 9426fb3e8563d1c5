"""The names by which the ends of a gain are found in a loop, drawn or of a controller."""

from collections.abc import Iterator
from dataclasses import replace

from wavesweep.engine.blocks import OUTPUT
from wavesweep.engine.drawing import Drawing
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import ONE
from wavesweep.engine.keys import nearest, show

# What simulate has in columns: names of signals, and of what is there of them the first one.
COLUMNS = {
    "v": ("device.v",),
    "v_hat": ("velocity.y", "device.v"),
    "u_m": ("encoder.out",),
    "v_m": ("encoder.in",),
    "v_s": ("avatar.out",),
    "x_s": ("avatar.x", "avatar.y"),
    "x_dot_s": ("avatar.v", "avatar_speed.y"),
    "F_s": ("avatar.f", "wall.y"),
    "u_h": ("local.in",),
    "v_l": ("local.out",),
}


def routed(
    drawing: Drawing, source: str, signal: str, path: str
) -> tuple[Drawing, tuple[str, str]]:
    """Return a drawing with an output for the signal, and the input and the output between which
    the gain is.

    source: an input in [ports], or the signal of the hand's force. signal: an output in [ports], a
    port of a block as BLOCK.PORT, or a name in [signals]; of a loop with a hand x, and f_m against
    it; of a controller's loop COLUMNS too. path: of the table. Errors: UsageError for other
    names.
    """
    for key, expected, text_found, hint in faults_of_ends(drawing, source, signal):
        meant = f"; did you mean {hint}?" if hint else ""
        raise UsageError(f"{path}.{key}: expected {expected}, found {text_found}{meant}")
    unit = next((unit for name, _, unit in drawing.outputs if name == signal), "")
    others = (port for port in drawing.outputs if port[0] != signal)
    outputs = (*others, (signal, _outputs(drawing)[signal], unit))
    drawing = replace(drawing, outputs=outputs)
    return drawing, (_inputs(drawing)[source], OUTPUT + signal)


def faults_of_ends(
    drawing: Drawing, source: str, signal: str
) -> Iterator[tuple[str, str, str, str]]:
    """Yield the key of each end that a loop does not have, what is expected and found, and a
    suggestion; see `routed`."""
    inputs = _inputs(drawing)
    outputs = _outputs(drawing)
    if source not in inputs:
        expected = f"an input of the loop ({', '.join(inputs)})"
        yield "from", expected, show(source), nearest(source, inputs)
    if signal not in outputs:
        named = [port for port in outputs if "." not in port]
        expected = f"an output of the loop ({', '.join(named)}) or a signal BLOCK.PORT"
        yield "to", expected, show(signal), nearest(signal, outputs)


def _inputs(drawing: Drawing) -> dict[str, str]:
    """The signals at which inputs come in, by their names."""
    inputs = {name: wired for name, wired, _ in drawing.inputs}
    return inputs | {name: name for name in (drawing.hand or ())[:1]}


def _outputs(drawing: Drawing) -> dict[str, tuple]:
    """The sums of signals to which a gain may lead, by their names."""
    outputs = {name: terms for name, terms, _ in drawing.outputs} | dict(drawing.named)
    made = {f"{block.name}.{port}" for block in drawing.blocks for port in block.ports[1]}
    outputs |= {**dict(drawing.wires), **{name: ((name, ONE),) for name in made}}
    columns = {}
    if drawing.hand:
        for name, terms in zip(("x", "f_m"), drawing.hand[1:], strict=True):
            if terms is not None:
                columns[name] = terms
        if not drawing.numbers:  # the loop of a controller
            for name, names in COLUMNS.items():
                there = [output for output in names if output in outputs]
                if there:
                    columns[name] = outputs[there[0]]
    return {**columns, **outputs}
