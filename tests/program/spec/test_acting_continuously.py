"""What a drawn loop's reader is told acts continuously is what does, against exponentials of the whole and marches by hand."""

import re
from math import lcm

import numpy as np
import pytest
from scipy.linalg import expm

import wavesweep
from wavesweep.engine.errors import SpecError
from wavesweep.program.analyses.assumptions import model_in_words

LAG_AND_BODY = {
    "body": {"type": "mass", "mass": 1.0, "damping": 1.0},
    "motor": {"type": "tf", "num": [1], "den": [0.05, 1]},
}


def drawn(seed):
    """A random loop of masses and lags that read each other directly or through holds: its tables, the numbers that act
    continuously, and the matrix of its frame, which is marched with one exponential.
    """
    r = np.random.default_rng(seed)
    kinds = [str(r.choice(["mass", "tf"])) for _ in range(int(r.integers(2, 5)))]
    signals = [f"p{i}.{port}" for i, kind in enumerate(kinds) for port in (("x", "v") if kind == "mass" else ("y",))]
    n, numbers, held, sampled, continuous = len(signals), {}, [], [], set()
    A, B, blocks, wires = np.zeros((n, n)), np.zeros((n, len(kinds))), {}, {}
    for i, kind in enumerate(kinds):
        a, b = (float(each) for each in np.exp(r.uniform(-1, 1, 2)))
        blocks[f"p{i}"] = {"mass": {"mass": a, "damping": b, "stiffness": 1.0}, "tf": {"num": [1], "den": [a, b]}}[kind]
        blocks[f"p{i}"]["type"] = kind
        last = signals.index(f"p{i}.{'v' if kind == 'mass' else 'y'}")
        A[last, last], B[last, i] = -b / a, 1 / a
        if kind == "mass":
            A[last - 1, last], A[last, last - 1] = 1, -1 / a
    for i, kind in enumerate(kinds):
        terms = wires[f"p{i}.{'f' if kind == 'mass' else 'u'}"] = []
        # Bodies read lags, and springs: their own position beside that of another one may be either, and is refused.
        for signal in [each for each in signals if r.random() < 0.6 and (kind == "tf" or each.endswith(("x", "y")))]:
            spring = kind == "mass" and signal.endswith("x")
            if spring and signal == f"p{i}.x":
                continue
            name, value = f"k{len(numbers)}", float(r.normal())
            row = value * np.eye(n)[signals.index(signal)] - (value * np.eye(n)[signals.index(f"p{i}.x")] if spring else 0)
            text, numbers[name] = f"{name}*({signal} - p{i}.x)" if spring else f"{name}*{signal}", value
            if r.random() < 0.4:
                every = int(r.integers(1, 4))
                held.append((i, every, row))
                blocks[f"h{name}"], wires[f"h{name}.u"] = {"type": "hold", "every": every}, [text]
                text = f"h{name}.y"
            elif signal == f"p{i}.y":
                sampled.append((i, row))
            else:
                A += np.outer(B[:, i], row)
                continuous.add(name)
            terms.append(text)
    tables = {"rates": {"tick_hz": 20}, "numbers": numbers, "block": blocks}
    tables |= {"wire": {port: " + ".join(terms) or "0" for port, terms in wires.items()}}
    tables |= {"ports": {"outputs": {f"o{place}": signal for place, signal in enumerate(signals)}}}
    return tables, continuous, marched(A, B, sampled, held)


def marched(A, B, sampled, held):
    """The matrix of a frame of ticks of 1/20 s; held: input of the plant, ticks between runs, and what is taken then."""
    n, m = B.shape
    whole, frame = expm(np.block([[A, B], [np.zeros((m, n + m))]]) / 20), np.eye(n + len(held))
    for tick in range(lcm(*(every for _, every, _ in held), 1)):
        force = np.zeros((m, n + len(held)))
        for place, (i, every, row) in enumerate(held):
            if tick % every == 0:
                frame[n + place] = row @ frame[:n]
            force[i] += frame[n + place]
        for i, row in sampled:
            force[i] += row @ frame[:n]
        frame[:n] = whole[:n, :n] @ frame[:n] + whole[:n, n:] @ force
    return frame


def named(said):
    """The numbers that a sentence says act continuously."""
    named_there, found, _ = said.partition(" (as physics does")
    return set(re.findall(r"\bk\d*\b", named_there)) if found else set()


@pytest.mark.parametrize("seed", range(8))
def test_the_numbers_named_act_continuously_and_all_others_are_held(seed):
    tables, continuous, frame = drawn(seed)
    loop = wavesweep.compile(tables)
    assert named(model_in_words(loop.spec)) == continuous
    radius = np.abs(np.linalg.eigvals(frame)).max()
    assert float(loop.spectral_radius()) == pytest.approx(radius, rel=1e-9)


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
    loop = wavesweep.compile(
        {"rates": {"tick_hz": 20}, "numbers": {"k": 9.0}, "block": bodies, "signals": signals, "wire": wires}
    )
    A = np.array([[0, 1, 0, 0], [-9, 0, 9, 0], [0, 0, 0, 1], [4.5, 0, -4.5, 0]])
    frame = marched(A, np.array([[0.0, 1, 0, 0]]).T, [(0, np.array([-3.0, 0, 0, 0]))], [])
    assert float(loop.spectral_radius()) == pytest.approx(np.abs(np.linalg.eigvals(frame)).max(), rel=1e-9)


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
