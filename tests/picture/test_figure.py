"""Pictures of loops: every wire is there, none passes through a box or along another, and all texts can be read."""

import itertools
import tomllib

import numpy as np
import pytest
from support.drawn import NETWORK, as_blocks, random_network
from support.plants import joint
from support.specs import nested

from wavesweep.engine.errors import UsageError
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.picture.diagram import placed
from wavesweep.picture.layout import LINES_APART, ROW
from wavesweep.picture.wiring import wiring_of_drawing
from wavesweep.program import plots
from wavesweep.program.spec import load

TINY = 1e-6


def built_in(kind):
    return load(nested({"controller.kind": kind, "controller.Kp": 8.0, "environment.delay": 3, "local_model.B_LM": 0.5}))


SPECS = {
    "network": lambda: load(tomllib.loads(NETWORK)),
    "pmw-lm": lambda: built_in("pmw-lm"),
    "pmw-lm-blocks": lambda: load(as_blocks(built_in("pmw-lm").values)),
    "twenty": lambda: load(random_network(4)),
    "chain": lambda: load(random_network(1109, chain=True)),
    "sixty": lambda: load(random_network(1, 60)),
}


def wired(spec):
    return wiring_of_drawing(spec.drawing or loop_drawing(spec.values), spec.values)


def routed(spec):
    loop = wired(spec)
    boxes, routes = placed(loop)
    return boxes[: len(loop.parts)], routes


def apart(one, other):
    """Whether two lines of different nets do not run along each other."""
    (a, b, c, d), (e, f, g, h) = one[1:], other[1:]
    if b == d and f == h and abs(b - f) < LINES_APART / 2:
        return max(a, c) < min(e, g) + TINY or max(e, g) < min(a, c) + TINY
    if a == c and e == g and abs(a - e) < LINES_APART / 2:
        return max(b, d) < min(f, h) + TINY or max(f, h) < min(b, d) + TINY
    return True


@pytest.mark.slow
@pytest.mark.parametrize("name", SPECS)
def test_every_wire_leads_to_its_reader_and_through_no_box_or_other_wire(name):
    boxes, routes = routed(SPECS[name]())
    for net, a, b, c, d in routes.lines:
        assert a == c or b == d
        for number, (x, y) in routes.places.items():
            inside_x = min(a, c) < x + boxes[number].width - TINY and max(a, c) > x + TINY
            inside_y = min(b, d) < y + ROW * boxes[number].rows - TINY and max(b, d) > y + TINY
            assert not (inside_x and inside_y), (net, number)
    for one, other in itertools.combinations(routes.lines, 2):
        assert one[0] == other[0] or apart(one, other), (one, other)
    for (i, (x, y)), (j, (u, v)) in itertools.combinations(routes.places.items(), 2):
        beside = x + boxes[i].width <= u + TINY or u + boxes[j].width <= x + TINY
        assert beside or y + ROW * boxes[i].rows <= v + TINY or v + ROW * boxes[j].rows <= y + TINY
    for number, box in enumerate(boxes):
        x, y = routes.places[number]
        for row, net in box.outputs:
            reached = reached_from(
                (x + box.width, y + ROW * (row + 0.5)), [line[1:] for line in routes.lines if line[0] == net]
            )
            for j, reader in enumerate(boxes):
                ends = [routes.ends[j, at] for at, read, _ in reader.inputs if read == net]
                assert all(any(np.allclose(point, end) for point in reached) for end in ends), (net, j)


def reached_from(start, lines):
    """The points that the lines of a net connect with a point."""
    reached, grown = {start}, -1
    while grown != len(reached):
        grown = len(reached)
        for line in lines:
            if any(on(line, *point) for point in reached):
                reached |= {line[:2], line[2:]} | {p for other in lines for p in (other[:2], other[2:]) if on(line, *p)}
    return reached


def on(line, x, y):
    a, b, c, d = line
    return min(a, c) - TINY <= x <= max(a, c) + TINY and min(b, d) - TINY <= y <= max(b, d) + TINY


def test_a_plant_of_several_blocks_shows_what_is_continuous_and_what_is_held():
    spec = load(joint())
    parts = {part.name: part for part in wired(spec).parts}
    held = (("motor.x", "held -kp"), ("motor.v", "held -kd"))
    assert parts["motor"].inputs == (("f", (*held, ("link.x", "continuous ks"), ("motor.x", "continuous -ks"))),)
    assert parts["link"].inputs == (("f", (("push", "1"), ("motor.x", "continuous ks"), ("link.x", "continuous -ks"))),)
    said = [text.get_text() for text in plots.diagram(spec).axes[0].texts]
    assert said.count("plant") == 2
    assert "held \N{MINUS SIGN}kp" in said
    assert "continuous: acts between ticks too, as physics does" in said


def test_a_picture_that_nobody_could_read_is_refused():
    names = [f"b{n}" for n in range(25)]
    read = " + ".join(f"0.01*{each}.y" for each in names[:20])
    tables = {
        "rates": {"tick_hz": 1000},
        "block": {name: {"type": "delay"} for name in names} | {"arm": {"type": "mass", "mass": 0.2}},
        "wire": {f"{name}.u": read for name in names} | {"arm.f": "hand - b0.y - arm.x"},
        "ports": {"hand": {"force": "hand", "displacement": "arm.x"}},
    }
    with pytest.raises(UsageError, match="expected at most 500 wires, which can be read, found 50"):
        plots.diagram(load(tables))
