"""Terms of a wire between plants act continuously, and those of a plant alone are held."""

import pytest

from wavesweep.engine._drawing.continuous import parted
from wavesweep.engine._drawing.parsing import parse
from wavesweep.program.spec import load

PLANTS = {"a": "mass", "b": "mass", "c": "mass", "s": "spring", "g": "tf"}
SIGNALS = {"a.x", "a.v", "b.x", "b.v", "c.x", "s.f1", "g.y", "h.y", "push"}
NUMBERS = {"k": 3.0, "q": 5.0, "p": 7.0, "n": 2.0}


def split(text, own="a"):
    """The gains that are held, and those that act continuously."""
    return [{name: gain.evaluate(NUMBERS) for name, gain in terms} for terms in parted(parse(text), SIGNALS, own, PLANTS)]


@pytest.mark.parametrize(
    ("text", "held", "continuous"),
    [
        ("-p*a.x - k*a.v + push", {"a.x": -7, "a.v": -3, "push": 1}, {}),
        ("k*(b.x - a.x) - p*a.x", {"a.x": -7}, {"b.x": 3, "a.x": -3}),
        ("-(k*(a.x - b.x) + p*a.x)", {"a.x": -7}, {"b.x": 3, "a.x": -3}),
        ("k*b.x - k*a.x - p*a.x", {"a.x": -7}, {"b.x": 3, "a.x": -3}),
        ("k*b.x - (k + p)*a.x", {"a.x": -7}, {"b.x": 3, "a.x": -3}),
        ("k*b.x - (k + q)*a.x + q*c.x", {}, {"b.x": 3, "a.x": -8, "c.x": 5}),
        ("300*b.x - 700*a.x + 400*c.x - p*a.v", {"a.v": -7}, {"b.x": 300, "a.x": -700, "c.x": 400}),
        ("k/n*(b.x - a.x/n) - p*a.x", {"a.x": -7}, {"b.x": 1.5, "a.x": -0.75}),
        ("k*(b.x - a.x + h.y)", {"h.y": 3}, {"b.x": 3, "a.x": -3}),
        ("p*(h.y - a.x) + s.f1", {"h.y": 7, "a.x": -7}, {"s.f1": 1}),
        ("g.y - k*a.v", {"a.v": -3}, {"g.y": 1}),
        ("2*h.y", {"h.y": 2}, {}),
    ],
)
def test_a_term_that_reads_another_plant_acts_continuously(text, held, continuous):
    assert split(text) == [held, continuous]


def test_a_wire_of_a_block_that_is_no_plant_is_sampled():
    assert parted(parse("a.x - b.x"), SIGNALS, "h", {})[1] == ()


def test_what_nothing_reads_is_no_part_of_a_plant():
    """So what it counts, which may grow for ever, is no state of what is read."""
    tables = {
        "rates": {"tick_hz": 1000},
        "block": {name: {"type": "mass", "mass": 1} for name in "ab"},
        "wire": {"a.f": "-3*a.x - 2*a.v", "b.f": "a.x"},
    }
    assert load(tables).drawing.plants == ()
    sprung = load(tables | {"wire": {"a.f": "-3*a.x - 2*a.v", "b.f": "7*(a.x - b.x)"}}).drawing
    assert [plant.name for plant in sprung.plants] == ["b"]  # a spring on which it swings for ever, and not less
    assert [[name for name, _ in terms] for _, terms in sprung.couplings] == [["b.x"]]
    (plant,) = load(tables | {"wire": {"a.f": "-3*a.x + 2*b.v", "b.f": "a.x"}}).drawing.plants
    assert plant.name == "a+b"
