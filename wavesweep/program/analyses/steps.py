"""Step responses of a spec's own loop: of an output to an input of [ports], or of a signal to a
step that is added to it."""

from dataclasses import replace

from wavesweep.engine.expressions import ONE
from wavesweep.engine.loop import Loops
from wavesweep.engine.response import (
    MOST_SAMPLED_STATES,
    Route,
    Step,
    ports_of_batch,
)
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop

ADDED = "the step"  # no signal of a spec can be called so


def routes_of(spec: Spec) -> list[Route]:
    """Each input of [ports] with each output."""
    drawing = spec.drawing
    if drawing:
        return [(name, output) for name, *_ in drawing.inputs for output, *_ in drawing.outputs]
    return []


def step_between(spec: Spec, route: Route, most_states: int = MOST_SAMPLED_STATES) -> Step:
    """The response of an output to a step of an input, route, both of [ports]. most_states, errors: see
    `Step.of`."""
    _, port = next(ports_of_batch(own_loop(spec), 1, route))
    return Step.of(port, most_states)


def step_at(spec: Spec, signal: str, most_states: int = MOST_SAMPLED_STATES) -> Step:
    """The response of a signal, "block.port", to a step of 1 that is added to it wherever it is
    read.

    The transfer function is -L/(1 + L), with L as `broken_at` has it. most_states, errors: see `Step.of`.
    """
    nominal = own_loop(spec)
    wires = []
    for port, terms in nominal.drawing.wires:
        added = [(ADDED, gain) for name, gain in terms if name == signal]
        wires.append((port, (*terms, *added)))
    drawing = replace(
        nominal.drawing,
        wires=tuple(wires),
        inputs=(*nominal.drawing.inputs, (ADDED, ADDED, "1")),
        outputs=(*nominal.drawing.outputs, (ADDED, ((signal, ONE),), "1")),
    )
    _, port = next(ports_of_batch(Loops(drawing, nominal.values), 1, (ADDED, ADDED)))
    return Step.of(port, most_states)
