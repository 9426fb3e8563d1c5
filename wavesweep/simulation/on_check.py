"""What `check` says of a controller in single precision."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from wavesweep.program.spec import Spec


def lines(spec: Spec, facts: Mapping[str, Any]) -> Iterator[tuple[float, str | Callable[[], str]]]:
    """Yield the line about floats, of a stable loop that `export --float` takes, among all lines."""
    drawing = spec.drawing
    plants = {block.plant for block in drawing.blocks} if drawing else {True, False}
    moved = not drawing or drawing.hand or drawing.inputs
    varies = (drawing and drawing.senders) or (spec.for_all and spec.for_all.changing)
    if facts["stable"] and len(plants) == 2 and moved and not varies:
        from wavesweep.simulation.export import floats_in_words

        yield 9.0, partial(floats_in_words, spec)
