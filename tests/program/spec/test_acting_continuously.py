"""What a drawn loop's reader is told acts continuously is what does, against the interpreter of the documents."""

import re

import numpy as np
import pytest
from meaning.reading import radius_of

import wavesweep
from wavesweep.engine.errors import SpecError
from wavesweep.program.analyses.assumptions import model_in_words

LAG_AND_BODY = {
    "body": {"type": "mass", "mass": 1.0, "damping": 1.0},
    "motor": {"type": "tf", "num": [1], "den": [0.05, 1]},
}


def drawn(seed):
    """A random loop of masses and lags that read each other directly or through holds: its tables, and the numbers that act
    continuously.
    """
    r = np.random.default_rng(seed)
    kinds = [str(r.choice(["mass", "tf"])) for _ in range(int(r.integers(2, 5)))]
    signals = [f"p{i}.{port}" for i, kind in enumerate(kinds) for port in (("x", "v") if kind == "mass" else ("y",))]
    numbers, continuous, blocks, wires = {}, set(), {}, {}
    for i, kind in enumerate(kinds):
        a, b = (float(each) for each in np.exp(r.uniform(-1, 1, 2)))
        keys = {"mass": {"mass": a, "damping": b, "stiffness": 1.0}, "tf": {"num": [1], "den": [a, b]}}[kind]
        blocks[f"p{i}"] = {"type": kind} | keys
        terms = []
        # Bodies read lags, and springs: their own position beside that of another one may be either, and is refused.
        for signal in [each for each in signals if r.random() < 0.6 and (kind == "tf" or each.endswith(("x", "y")))]:
            spring = kind == "mass" and signal.endswith("x")
            if spring and signal == f"p{i}.x":
                continue
            name = f"k{len(numbers)}"
            text, numbers[name] = f"{name}*({signal} - p{i}.x)" if spring else f"{name}*{signal}", float(r.normal())
            if r.random() < 0.4:
                blocks[f"h{name}"], wires[f"h{name}.u"] = {"type": "hold", "every": int(r.integers(1, 4))}, text
                text = f"h{name}.y"
            elif signal != f"p{i}.y":  # which is sampled
                continuous.add(name)
            terms.append(text)
        wires[f"p{i}.{'f' if kind == 'mass' else 'u'}"] = " + ".join(terms) or "0"
    outputs = {f"o{place}": signal for place, signal in enumerate(signals)}
    tables = {"rates": {"tick_hz": 20}, "numbers": numbers, "block": blocks, "wire": wires, "ports": {"outputs": outputs}}
    return tables, continuous


def named(said):
    """The numbers that a sentence says act continuously."""
    named_there, found, _ = said.partition(" (as physics does")
    return set(re.findall(r"\bk\d*\b", named_there)) if found else set()


@pytest.mark.parametrize("seed", range(8))
def test_the_numbers_named_act_continuously_and_all_others_are_held(seed):
    tables, continuous = drawn(seed)
    loop = wavesweep.compile(tables)
    assert named(model_in_words(loop.spec)) == continuous
    assert float(loop.spectral_radius()) == pytest.approx(radius_of(tables, 0), rel=1e-9)


def controlled(motor, body="motor.y + push", **more):
    """A body behind a lag, and the wires of both."""
    return {
        "rates": {"tick_hz": 100},
        "numbers": {"k": 1.0},
        "block": LAG_AND_BODY | more.pop("block", {}),
        "wire": {"motor.u": motor, "body.f": body} | more.pop("wire", {}),
        "ports": {"inputs": {"push": "push"}, "outputs": {"place": "body.x"}},
        "sweep": {"along": "k", "k": {"start": 0, "stop": 1000}},
    } | more


LAW = "-k*body.x - 0.5*k*body.v"


@pytest.mark.parametrize(
    ("tables", "end", "said"),
    [
        (
            controlled(LAW),
            1000.0,
            "k acts continuously in motor.u (as physics does; a program holds its sums)",
        ),
        (controlled("c.y", block={"c": {"type": "hold"}}, wire={"c.u": LAW}), 392.1505, ""),
        (
            controlled("u", signals={"u": LAW}),
            1000.0,
            "k acts continuously in motor.u (as physics does; a program holds its sums)",
        ),
    ],
)
def test_a_controller_is_a_program_only_through_a_hold(tables, end, said):
    (row,) = wavesweep.stability_region(tables).to_dict("records")
    assert row["high"] == pytest.approx(end, abs=1e-3)
    assert model_in_words(wavesweep.load(tables)) == said


@pytest.mark.parametrize(
    ("through", "read", "said"),
    [
        ("late.y", {"late.u": LAW}, "late reads body.x and body.v between ticks (a program samples: let it read a hold)"),
        ("late.y", {"late.u": "c.y", "c.u": LAW}, ""),
        ("c.y", {"late.u": "body.x", "c.u": "-k*late.y"}, ""),  # a sensor's dead time is read in ticks
    ],
)
def test_a_dead_time_that_reads_a_plant_between_ticks_is_told_from_one_that_reads_a_program(through, read, said):
    blocks = {"late": {"type": "delay", "seconds": 0.004}} | ({"c": {"type": "hold"}} if "c.u" in read else {})
    assert model_in_words(wavesweep.load(controlled(through, block=blocks, wire=read))) == said


@pytest.mark.parametrize(
    ("signals", "motor", "body", "named_in"),
    [
        ({"u": LAW}, "u", "motor.y + u + push", "u"),
        ({"e": "2*body.x", "u": "-k*e - 0.5*k*body.v"}, "u", "motor.y - k*e + push", "e"),
        ({"one": "-k*body.x", "other": "-0.5*k*body.v"}, "one + other", "motor.y + other + push", "other"),
        ({"e": "k*(motor.y - body.x) - body.x"}, "-e", "e + push", "e"),  # of its last term
    ],
)
def test_a_name_that_would_act_continuously_and_be_held_is_refused(signals, motor, body, named_in):
    with pytest.raises(SpecError) as raised:
        wavesweep.load(controlled(motor, body, signals=signals))
    (mistake,) = raised.value.mistakes
    assert (mistake.key, mistake.found) == ("wire.body.f", f"{named_in} held over a tick")
    assert mistake.expected == f"{named_in} as in motor.u, where it acts continuously, or the output of a hold in both"


@pytest.mark.parametrize(
    ("force", "signals"),
    [
        ("k*(two.x - one.x) - 3*one.x", {}),
        ("-(k*(one.x - two.x) + 3*one.x)", {}),
        ("1*(k*two.x - (k + 3)*one.x)", {}),
        ("e", {"e": "k*(two.x - one.x) - 3*one.x"}),
        ("1*e", {"e": "k*(two.x - one.x) - 3*one.x"}),
        ("-2*(0.5*e)", {"e": "-k*two.x + (k + 3)*one.x"}),
        ("k*two.x + e - 3*one.x", {"e": "-k*one.x"}),
    ],
)
def test_brackets_and_names_change_nothing(force, signals):
    bodies = {"one": {"type": "mass", "mass": 1.0}, "two": {"type": "mass", "mass": 2.0}}
    wires = {"one.f": force, "two.f": "k*(one.x - two.x)"}
    tables = {"rates": {"tick_hz": 20}, "numbers": {"k": 9.0}, "block": bodies, "signals": signals}
    plain = tables | {"wire": wires | {"one.f": "k*(two.x - one.x) - 3*one.x"}}
    found = wavesweep.compile(tables | {"wire": wires}).spectral_radius()
    assert float(found) == pytest.approx(radius_of(plain, 0), rel=1e-9)


def test_names_with_one_meaning_are_taken():
    """A sensor samples what acts continuously; both halves of a damper are one; what is held everywhere is a program's."""
    sensed = {"block": {"sensor": {"type": "hold", "every": 4}}, "wire": {"sensor.u": "u"}}
    assert wavesweep.load(controlled("u", signals={"u": LAW}, **sensed)).drawing
    bodies = {"one": {"type": "mass", "mass": 1.0}, "two": {"type": "mass", "mass": 2.0}}
    for one, other, signals in (
        ("far - near", "near - far", {"near": "k*one.v", "far": "k*two.v"}),
        ("k*(two.x - one.x) + pd", "k*(one.x - two.x)", {"pd": "-3*one.x - one.v"}),
    ):
        tables = {"rates": {"tick_hz": 100}, "numbers": {"k": 1.0}, "block": bodies}
        loop = wavesweep.load(tables | {"signals": signals, "wire": {"one.f": one, "two.f": other}})
        assert model_in_words(loop) == "k acts continuously in one.f and two.f (as physics does; a program holds its sums)"
