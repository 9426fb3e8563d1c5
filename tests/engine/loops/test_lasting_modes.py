"""Drifts beside sums of which changes alone are read. What `tests/meaning` finds of such loops is the witness."""

import pytest

import wavesweep

PULSES = {
    "rates": {"tick_hz": 200},
    "numbers": {"K": 10.0},
    "block": {
        "arm": {"type": "mass", "mass": 0.2, "damping": 2.0},
        "pulse": {"type": "impulse", "every": 2},
        "between": {"type": "hold", "every": 2, "phase": 1},
        "end": {"type": "wave", "b": 5.0},
        "far": {"type": "local_model", "b": 5.0, "K": 30.0, "B": 0.5},
    },
    "wire": {
        "pulse.u": "arm.x",
        "between.u": "pulse.y",
        "end.v": "arm.v",
        "far.in": "end.out",
        "end.in": "far.out",
        "arm.f": "-K*between.y - end.force",
    },
}


def rows_of(blocks=(), wires=(), force=""):
    """The certificates of the loop with pulses, and of what is added to it."""
    tables = {
        **PULSES,
        "block": PULSES["block"] | dict(blocks),
        "wire": PULSES["wire"] | dict(wires),
    }
    tables["wire"]["arm.f"] += force
    return wavesweep.compile(tables).stable_intervals("K", (0.0, 500.0))


@pytest.mark.parametrize(
    ("blocks", "wires", "force"),
    [
        ({"often": {"type": "hold"}}, {"often.u": "pulse.y"}, " - 4*often.y"),  # pulses that are not over when they are read
        (
            {"sum": {"type": "integrator"}, "change": {"type": "difference", "every": 4}},
            {"sum.u": "arm.x", "change.u": "sum.y"},
            " - 4*change.y",
        ),
        (
            {
                "law": {"type": "pi", "kp": 1.0, "ki": 2.0},
                "high": {"type": "butterworth", "order": 2, "cutoff_hz": 5.0, "pass": "high", "every": 2},
            },
            {"law.u": "arm.x", "high.u": "law.y"},
            " - 4*high.y",
        ),
    ],
)
def test_what_drifts_beside_a_sum_of_which_changes_alone_are_read_is_set_aside(blocks, wires, force):
    """A position beside a line of waves, while the sum counts it for ever."""
    rows = rows_of(blocks, wires, force)
    assert rows.certified.all()
    assert rows[["low", "high"]].to_numpy().tolist() == [[0.0, 500.0]]


FLIP = {"type": "ss", "A": [[-1.0]], "B": [[1.0]], "C": [[1.0]], "D": [[0.0]], "discrete": True}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("blocks", "wires", "force"),
    [
        ({"flip": FLIP | {"inputs": ["u"], "outputs": ["y"]}}, {"flip.u": "0*arm.x"}, " + flip.y"),
        ({"flip": {"type": "delay"}}, {"flip.u": "-flip.y"}, " + flip.y"),
        (
            {
                "one": {"type": "hold", "every": 2},
                "two": {"type": "hold", "every": 2, "phase": 1},
                "long": {"type": "hold", "every": 4},
            },
            {"one.u": "-two.y", "two.u": "one.y", "long.u": "arm.x"},
            " + one.y - 0.1*long.y",
        ),
        ({}, {"pulse.u": "arm.x - 2*prev(pulse.sum)"}, ""),
        ({"ball": {"type": "mass", "mass": 1.0}}, {"ball.f": "0*arm.x"}, " + 0.01*ball.v"),
    ],
    ids=["a state", "a delay", "two holds", "a sum that undoes itself", "a mass that coasts"],
)
def test_an_oscillation_that_is_back_after_a_frame_is_no_drift(blocks, wires, force):
    """Nor is a mass that coasts, of which the velocity alone is read."""
    assert not rows_of(blocks, wires, force).certified.any()


def test_an_output_that_sees_pulses_changes_no_pole():
    tables = PULSES | {"ports": {"outputs": {"seen": "prev(pulse.y)"}}}
    radius, with_output = (wavesweep.compile(each).spectral_radius() for each in (PULSES, tables))
    assert with_output == pytest.approx(radius, rel=1e-12)
