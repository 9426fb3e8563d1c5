"""What is said of a fit, and of points beside a model, from numbers written by hand."""

import pytest

import wavesweep
from wavesweep.identification import on_check, table

DEVICE = {
    "mass": {"value": 0.1, "low": 0.099, "high": 0.101, "unit": "kg"},
    "friction": {"value": 0.2, "low": 0.19, "high": 0.21, "unit": "N"},
    "delay": {"value": 1.0, "low": 1.0, "high": 1.0, "unit": "tick"},
}
RESIDUAL = {"rms": 2e-6, "rms_of_encoder": 1e-6, "withheld": False, "share_of_missing": 0.5, "stribeck_speed": None}
RESIDUAL |= dict.fromkeys(("white_noise", "beyond_half_step", "walked", "lacking", "lacking_share"), 0.0)
RESIDUAL |= dict.fromkeys(("static_friction", "frequency_hz", "resonance_hz"))
EXPLAINED, NOT = "the model explains the log", "the model does not explain the log"


NOISY, WHITE = {"white_noise": 3e-6}, "white noise of 3e-06 m in addition to the rounding"
LACKS = NOISY | {"lacking": 0.05, "lacking_share": 0.126}
FALLS = "friction falls with speed, from 0.4 N at rest to the number above, by exp(-(v/0.03 m/s)^2)"
RESONANCE, FORCE = (
    {"explained": False, "missing": "resonance"},
    "what it lacks is a force of 0.05 N rms, 13 % of that of the log",
)
SLOW = f"{NOT}, but the numbers above are those beside what it lacks: it lacks a slow motion near 2 Hz, 1.73 um rms"
JUDGED = [
    ({}, {}, ["each reading is within half a step of the model", EXPLAINED]),
    ({"beyond_half_step": 2}, {}, ["all but 2 readings are within half a step of the model", EXPLAINED]),
    (NOISY, {}, [WHITE, EXPLAINED]),
    (NOISY | {"walked": 1.0}, {}, [WHITE, "friction and damping are a line over the speeds of the log", EXPLAINED]),
    (NOISY | {"static_friction": 0.4, "stribeck_speed": 0.03}, {}, [WHITE, FALLS, EXPLAINED]),
    (
        NOISY | {"resonance_hz": (20, 90)},
        {},
        [WHITE, EXPLAINED, "a resonance of a quarter of the mass would show from 20 to 90 Hz"],
    ),
    (NOISY, {"explained": False, "missing": "noise"}, [f"{NOT}, and the intervals are wider by what is left: "]),
    (NOISY, {"explained": False, "missing": "unseen"}, ["the log cannot tell", "push harder"]),
    (LACKS | {"frequency_hz": 2.0}, RESONANCE, [SLOW, f"{FORCE}; this effect explains 50 % of it"]),
    (
        LACKS | {"frequency_hz": 40.0, "withheld": True},
        RESONANCE,
        [f"{NOT}, so no number has an interval: it lacks a resonance near 40 Hz; --two-masses fits a load on a spring", FORCE],
    ),
    (
        LACKS,
        {"explained": False, "missing": "force", "turns": True},
        [f"{NOT}, and the intervals are wider by it: it lacks a force", FORCE.replace("N rms", "N*m rms")],
    ),
]


@pytest.mark.parametrize(("residual", "facts", "said"), JUDGED)
def test_a_fit_is_judged_in_words(residual, facts, said):
    found = {"samples": 4000, "duration_s": 4.0, "rate_hz": 1000.0, "turns": False, "measured": "position", "resolution": 1e-5}
    found |= {"parameters": DEVICE, "explained": True, "missing": "", "unusual": ""} | facts
    lines = [line for line, _ in table._lines(found | {"residual": RESIDUAL | residual})]
    unit = "rad" if found["turns"] else "m"
    assert lines[:1] == ["4000 samples, 4 s at 1000 Hz"]
    assert [line.partition(" ")[0] for line in lines[1:4]] == ["mass", "friction", "delay"]
    assert lines[4] == f"residual 2e-06 {unit} rms, 2 times what its steps of 1e-05 {unit} leave"
    assert len(lines) == 5 + len(said)
    for line, start in zip(lines[5:], said, strict=True):
        assert line.startswith(start)


def test_a_mass_and_an_interval_are_held_against_what_is_usual_and_told():
    mass = {"value": 1e5, "unit": "kg"}
    said = table._unusual(mass, False, "are time, force and position in s, N and m", {"time": 2, "force": 1, "position": -1})
    assert said.endswith("m? It would be 0.1 with --scale time=0.001.")
    assert not table._unusual({"value": 0.1, "unit": "kg"}, False, "", {})
    assert table._by_constants(2.0, 3.0, (0.9, 1.1)) == (pytest.approx(1.8), pytest.approx(3.3))
    for low, high, raises in ((1.0, 2.99, False), (1.0, 3.0, True)):
        numbers = {"mass": {"value": 2.0, "low": low, "high": high, "unit": "kg"}}
        if raises:
            with pytest.raises(wavesweep.UsageError, match="leaves the mass open"):
                table._refuse_unknown(numbers)
        else:
            table._refuse_unknown(numbers)
    numbers = {name: dict(row) for name, row in DEVICE.items()}
    table._take_intervals_away(numbers)
    assert [row["low"] for row in numbers.values()] == [None, None, 1.0]


def test_points_beside_a_model_are_said_with_how_far_it_is_off():
    worst = {"B_VE": 2.0, "computed": 1500.2, "K_VE": 1000.4, "ratio": 1.5, "beyond": False}
    limits = {
        "file": "a.csv",
        "count": 5,
        "compared": 4,
        "median_ratio": 1.25,
        "worst": worst,
        "most_promised": worst,
        "more": 3,
    }
    limits |= {"above_hole": 1, "beyond": 0, "rms": 200.0, "share": 0.21, "scatter": None, "explained": False}
    point = {"stable": True, "B_VE": 1.0, "K_VE": 50.0, "ratio": None, "computed": None}
    walls = {"file": "b.csv", "wrong": 2, "count": 9, "promised": 1, "denied": 1, "not_known": 3}
    walls["worst"] = [point, point | {"stable": False, "ratio": 2.0, "computed": 99.5}]
    response = {
        "file": "c.csv",
        "compared": 8,
        "count": 10,
        "stable": True,
        "median_ratio": 0.9,
        "softer": 2,
        "median_deg": 1.5,
    }
    response |= {"worst": {"ratio": 0.5, "frequency_hz": 12.0}, "worst_phase": {"deg": -20.0, "frequency_hz": 30.0}}
    spec = wavesweep.load({"controller": {"kind": "dc"}})

    def lines(**measured):
        return [line for _, line in on_check.lines(spec, {"measured": measured})]

    assert lines(limits=limits, tried=walls, response=response) == [
        (
            "measured limits (a.csv): computed over measured is 1.25 in the median, 1.5 at worst, "
            "at B_VE = 2 N*s/m (1500 for 1000 N/m)"
        ),
        "  of 4 limits the model promises more than was measured, the dangerous side, at 3, by 50 % at most",
        "  the model does not explain them: 200 N/m rms, 21 % of their median",
        "  1 of them lie above stiffnesses at which the model is unstable",
        "  not compared: 1 of 5, since what is stable is not known at their damping",
        (
            "measured walls (b.csv): 2 of 9 on the wrong side; unstable though computed stable, the dangerous side: 1; "
            "stable though computed unstable: 1, 3 not known"
        ),
        "  stable at B_VE = 1 N*s/m, K_VE = 50 N/m: the model is stable at no stiffness in the range",
        "  unstable at B_VE = 1 N*s/m, K_VE = 50 N/m: the model's nearest end is at 99.5 N/m, 2 times that",
        "measured response (c.csv): computed over measured admittance is 0.9 in the median, 0.5 at worst, at 12 Hz",
        "  the model is softer at 2 of 8 frequencies",
        "  its phase less the measured one: 1.5 deg in the median, -20 at worst, at 30 Hz",
        "  not compared: 2 of 10, above half the rate of the ticks or of a coherence below a half",
    ]
    beyond = limits | {
        "worst": worst | {"beyond": True},
        "most_promised": worst | {"beyond": True},
        "above_hole": 0,
        "count": 4,
    }
    beyond |= {"beyond": 1, "scatter": 30.0, "explained": True}
    assert lines(limits=beyond)[1:] == [
        "  of 4 limits the model promises more than was measured, the dangerous side, at 3",
        "  the model explains them: at least 200 N/m rms, 21 % of their median; repeated limits scatter by 30 N/m",
    ]
    assert "none of 5 compared" in lines(limits=limits | {"compared": 0})[0]
    assert "not compared, since the model is not stable" in lines(response=response | {"compared": 0, "stable": False})[0]
