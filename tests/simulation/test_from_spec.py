import numpy as np
import pytest

from wavesweep.program.spec import load
from wavesweep.program.tables import kind_named
from wavesweep.simulation.from_spec import hand_force, simulated
from wavesweep.simulation.record import recorded
from wavesweep.simulation.table import simulate


def spec(kind="pmw-lm", **simulate):
    return load({"controller": {"kind": kind}, "simulate": {"duration_s": 0.5} | simulate})


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"input": "sine", "frequency_hz": 7}, 2 * np.sin(2 * np.pi * 7 * np.arange(500) / 1000)),
        ({"input": "step", "at_s": 0.2}, np.repeat([0.0, 2.0], [200, 300])),
        ({"input": "pulse", "at_s": 0.2, "width_s": 0.1}, np.repeat([0.0, 2.0, 0.0], [200, 100, 200])),
        ({"input": "noise", "seed": 4}, 2 * np.random.default_rng(4).standard_normal(500)),
    ],
)
def test_the_hand_does_what_the_spec_names(given, expected):
    np.testing.assert_allclose(hand_force(spec(amplitude=2, **given)).force, expected, atol=1e-12)


def test_a_stepped_sine_lasts_as_long_as_it_takes_unless_told():
    steps = {"input": "stepped-sine", "frequency_hz": [10, 20], "settle_s": 0.5}
    whole = hand_force(load({"controller": {"kind": "dc"}, "simulate": steps}))
    assert (len(whole.force), len(whole.tones)) == (3000, 2)
    short, long = (hand_force(spec(**steps, duration_s=seconds)) for seconds in (2, 4))
    assert (len(short.force), len(short.tones)) == (2000, 1)
    assert (len(long.force), len(long.tones)) == (4000, 2)
    assert np.array_equal(long.force, np.append(whole.force, np.zeros(1000)))


@pytest.mark.parametrize(
    ("given", "begins", "ends", "said"),
    [
        ({"input": "step", "at_s": 0.0014}, 2, 500, ["at_s = 0.0014: the step sets in between the ticks at 0.001 and 0.002 s"]),
        ({"input": "step", "at_s": 0.0005}, 1, 500, ["at_s = 0.0005: the step sets in between the ticks at 0 and 0.001 s"]),
        (
            {"input": "pulse", "at_s": 0.1, "width_s": 0.0025},
            100,
            103,
            ["width_s = 0.0025: the pulse ends between the ticks at 0.102 and 0.103 s"],
        ),
        # both ends are after a half of a tick, where rounding to even gave another length
        ({"input": "pulse", "at_s": 0.0995, "width_s": 0.002}, 100, 102, ["the pulse sets in", "the pulse ends"]),
        ({"input": "step", "duration_s": 0.1235}, 100, 124, ["duration_s = 0.1235: the run ends between"]),
        ({"input": "step", "at_s": 0.1000001, "duration_s": 0.2999999}, 100, 300, []),
    ],
)
def test_a_time_between_two_ticks_is_the_later_one_and_said(given, begins, ends, said):
    asked = spec(**given)
    force = hand_force(asked).force
    assert (np.flatnonzero(force)[[0, -1]] == [begins, ends - 1]).all()
    found = list(asked.simulate.between_ticks(asked.tick_hz))
    assert len(found) == len(said)
    for line, words in zip(found, said, strict=True):
        assert words in line


@pytest.mark.parametrize("kind", ["dc", "dc-slow", "dc-lm", "dc-vc", "dc-vc-lm", "pmw", "pmw-lm"])
def test_the_table_has_the_same_columns_for_every_controller(kind):
    columns = recorded(simulated(spec(kind, late=3, dropped=0.2)))
    assert list(columns) == [field.name for field in kind_named("simulate").fields]
    assert {len(column) for column in columns.values()} == {500}
    missing = {name for name, column in columns.items() if np.isnan(column).any()}
    waves = {"u_m", "v_m", "u_s", "v_s", "x_s", "x_dot_s"}
    waves |= {f"energy_{name}" for name in ("user", "slow", "local", "channel")}
    local = {"u_h", "v_l", "v_2"}
    assert missing == {"pmw-lm": set(), "pmw": local}.get(kind, waves | local)
    ratio = 1 if kind == "dc" else 20
    assert np.array_equal(columns["frame"] * ratio + columns["phase"], np.arange(500))


def test_no_infinity_gets_into_the_table_of_a_loop_that_diverges():
    run = simulated(load({"controller": {"kind": "dc"}, "environment": {"K_VE": 1e8}}))
    columns = recorded(run)
    assert 2 < len(columns["tick"]) < 10_000
    assert run.stopped
    assert not any(np.isinf(column).any() for column in columns.values())
    assert np.isfinite(columns["energy_hand"]).all()


@pytest.mark.asks("frame_times")
def test_frames_of_a_file_that_last_no_whole_ticks_are_said(tmp_path):
    (tmp_path / "frames.csv").write_text("took\n0.0165\n0.0165\n0.016\n")
    (tmp_path / "a.toml").write_text(
        'controller.kind = "dc-slow"\n[simulate]\nframes = ["frames.csv", "duration=took"]\ninput = "step"\nduration_s = 0.2\n'
    )
    (run, *_) = simulate(load(tmp_path / "a.toml").asking("simulate"))
    said = [each for each in run.facts["notices"] if "no whole ticks" in each]
    assert said == ["simulate.frames: 2 of 3 frames last no whole ticks; each is one of its neighbours, and their sum is right"]
    begun = np.flatnonzero(np.diff(run.columns["frame"])) + 1
    assert begun[:3].tolist() in ([16, 33, 49], [17, 33, 49])
    assert {*run.facts["frames"]} == {"16", "17"}
