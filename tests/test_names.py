"""A drawing's name decides nothing: every answer is the same for a drawing under other names of kind, blocks and signals."""

import re
from dataclasses import replace

import numpy as np
import pytest
from support.specs import KINDS, nested, values_of

import wavesweep
from wavesweep.controllers import CONTROLLERS, drawing_of
from wavesweep.diagram import draw, state_labels
from wavesweep.diagram.drawing import Diagram, Hand
from wavesweep.lifted.at_wall import cut_at_wall
from wavesweep.sweep.planning import plan

NEW = "another"


def renamed(diagram: Diagram) -> Diagram:
    """The same drawing, each block, junction, sample and held signal under another name."""
    blocks = {block.name: f"b{i}" for i, block in enumerate((*diagram.fast, *diagram.slow))}

    def signal(name):
        block, dot, port = name.partition(".")
        return f"{blocks[block]}.{port}" if dot and block in blocks else f"s_{name}" if not dot else name

    def side(part):
        return tuple(replace(block, name=blocks[block.name]) for block in part)

    def keyed(table):
        return {signal(name): signal(source) for name, source in table.items()}

    hand = Hand(blocks[diagram.hand.device], signal(diagram.hand.force), signal(diagram.hand.reaction))
    return replace(
        diagram, fast=side(diagram.fast), slow=side(diagram.slow), samples=keyed(diagram.samples), holds=keyed(diagram.holds),
        sums={signal(name): {signal(s): gain for s, gain in sources.items()} for name, sources in diagram.sums.items()},
        wall=tuple(map(signal, diagram.wall)), wall_force=signal(diagram.wall_force), hand=hand,
        waves=diagram.waves and tuple(map(signal, diagram.waves)), structure=None,
    )  # fmt: skip


@pytest.fixture(params=KINDS)
def pair(request, monkeypatch):
    """The spec of a kind, and that of the same drawing registered under another name; the second one's old names."""
    original = drawing_of(request.param)
    monkeypatch.setitem(CONTROLLERS, NEW, lambda values: renamed(original(values)))
    tables = nested(values_of(request.param, Kp=20.0, ratio=10, delay=3, stiffness=0.0, integration="explicit", K_VE=150.0))
    return tables, {**tables, "controller": {**tables["controller"], "kind": NEW}}


def held(pair):
    """The same two with a spring in the hand and without position feedback."""
    return [{**t, "operator": {"stiffness": 200.0}, "controller": {**t["controller"], "Kp": 0.0}} for t in pair]


def loops(pair):
    """Both compiled."""
    return [wavesweep.compile(tables) for tables in pair]


def same(tables):
    """Two tables that differ in the controller's name alone."""
    one, other = (table.drop(columns=[name for name in ("controller",) if name in table]) for table in tables)
    assert one.equals(other)


@pytest.mark.slow
@pytest.mark.parametrize("drifting", [True, False])
def test_intervals_and_their_frequencies_are_the_same(pair, drifting):
    a, b = loops(pair if drifting else held(pair))
    same([loop.stable_intervals(B_VE=[0.0, 1.0, 5.0]) for loop in (a, b)])
    same([loop.stable_intervals(along="B_VE", span=(0, 30)) for loop in (a, b)])
    same([loop.stable_intervals(along="device.damping", span=(0, 20)) for loop in (a, b)])


@pytest.mark.slow
@pytest.mark.parametrize("drifting", [True, False])
def test_radius_response_and_passivity_are_the_same(pair, drifting):
    a, b = loops(pair if drifting else held(pair))
    assert np.array_equal(*(loop.spectral_radius(K_VE=[0.0, 100.0, 1000.0]) for loop in (a, b)))
    same([loop.response([0.1, 5.0, 50.0, 99.9, 100.0]) for loop in (a, b)])
    same([loop.response([0.1, 5.0, 100.0], K_VE=[0.0]) for loop in (a, b)])
    same([loop.passivity() for loop in (a, b)])


@pytest.mark.slow
def test_what_check_says_is_the_same(pair):
    specs = [wavesweep.load(tables) for tables in pair]
    diagram = draw(specs[0].values)
    names = {f"b{i}": block.name for i, block in enumerate((*diagram.fast, *diagram.slow))}
    found, wanted = (re.sub(r"about [0-9.e-]+ (s|min)", "", "\n".join(plan(spec))) for spec in specs[::-1])
    for new in sorted(names, key=len, reverse=True):
        found = found.replace(f"{new}.", f"{names[new]}.")
    assert not re.search(r"frame\.|u_before|hold_", wanted)
    assert found.replace("s_", "").replace(NEW, specs[0].values["controller.kind"]) == wanted.replace("s_", "")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("changes", [{}, {"delay": 3, "velocity": "difference"}, {"delay": 3, "Kp": 20.0, "lp2_order": 5}])
def test_every_state_has_a_readable_name_of_its_own(kind, changes):
    diagram = draw(values_of(kind, **changes))
    labels, cut = state_labels(diagram), cut_at_wall(diagram)
    assert {*cut.states, *cut.unread} <= labels.keys()
    assert len(set(labels.values())) == len(labels)
    assert {"device velocity", "device position"} <= set(labels.values())


def test_a_block_without_labels_lends_its_states_its_name():
    diagram = draw(values_of("dc-slow"))
    plain = replace(diagram, fast=tuple(replace(block, labels=()) for block in diagram.fast))
    assert state_labels(plain)["frame.device.v"] == "device v"
