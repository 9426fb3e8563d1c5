"""Frames that [simulate] draws by the shares of [for_all], or plays back from a file."""

from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.program.spec import load
from wavesweep.simulation.from_spec import effects_of, frames_in_turn, simulated
from wavesweep.simulation.hardware import Effects
from wavesweep.simulation.record import recorded
from wavesweep.simulation.table import simulate

pytestmark = pytest.mark.asks("for_all")
LENGTHS, CHAIN = [16, 20, 33], [[8, 1, 1], [2, 5, 3], [4, 4, 2]]
WALL = {
    "controller": {"kind": "pmw", "b": 10.0},
    "environment": {"integration": "explicit", "delay": 1, "K_VE": 200.0},
    "device": {"velocity": "difference"},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
    "for_all": {
        "rates.ratio": {"values": LENGTHS, "varying": True, "next": CHAIN},
        "environment.delay": {"values": [1, 9, 16], "varying": True, "shares": [[1, 1, 0], [1, 1, 1], [0, 1, 3]]},
        "loss": 0.2,
    },
    "simulate": {"input": "pulse", "duration_s": 2, "frames": "random", "seed": 7},
}


@pytest.mark.slow
def test_frames_are_drawn_as_often_as_the_shares_say():
    found = frames_in_turn(load(WALL), 150_000, Effects(seed=1))
    assert 150_000 <= sum(each.ticks for each in found) < 150_033
    pairs = Counter((a.ticks, b.ticks) for a, b in pairwise(found))
    for row, before in zip(CHAIN, LENGTHS, strict=True):
        seen = np.array([pairs[before, length] for length in LENGTHS])
        assert seen / seen.sum() == pytest.approx(np.array(row) / sum(row), abs=0.035)
    for length, shares in zip(LENGTHS, WALL["for_all"]["environment.delay"]["shares"], strict=True):
        own = Counter(each.delay for each in found if each.ticks == length)
        seen = np.array([own[delay] for delay in (1, 9, 16, None)]) / own.total()
        assert seen == pytest.approx([*(0.8 * np.array(shares) / sum(shares)), 0.2], abs=0.035)
    assert {each.delay for each in found if each.lost} == {None}


def test_a_seed_gives_the_same_frames_again_and_another_one_others():
    spec = load(WALL)
    frames = [frames_in_turn(spec, 2000, Effects(seed=seed)) for seed in (1, 1, 2)]
    assert frames[0] == frames[1] != frames[2]


EFFECTS = {"wall": 0.002, "late": 9, "dropped": 0.1, "jitter": 0.2, "friction": 0.05, "max_force": 2.0, "resolution": 1e-5}


@pytest.mark.parametrize("effects", [{}, EFFECTS])
def test_a_run_is_that_of_the_same_frames_one_by_one_to_the_last_bit(effects):
    spec = load({**WALL, "simulate": WALL["simulate"] | effects})
    listed = [each.written() for each in frames_in_turn(spec, 2000, effects_of(spec))]
    both = [
        recorded(simulated(load({**WALL, "simulate": {**spec.simulate.written(), "frames": f}}))) for f in ("random", listed)
    ]
    for name, column in both[0].items():
        np.testing.assert_array_equal(column, both[1][name], err_msg=name)
    lengths = [each if isinstance(each, int) else each["ticks"] for each in listed]
    assert np.bincount(both[0]["frame"])[:-1].tolist() == lengths[: both[0]["frame"][-1]]


@pytest.mark.slow
def test_a_result_is_as_late_as_its_own_delay_says():
    """By what it comes later than the earliest may, and no sentence has the spec's own delay for all."""
    spec = load(WALL)
    (table, *_) = simulate(spec)
    delays = [frame.delay for frame in frames_in_turn(spec, 2000, effects_of(spec))]
    late = [-1 if delay is None else delay - 1 for delay in delays]
    frame = table.columns["frame"]
    assert table.columns["late"].tolist() == [late[number] for number in frame]
    assert {-1, 0, 8, 15} == set(late)
    assert "delays of 1, 9, 16 ticks" in table.facts["assumes"]


def test_messages_that_are_lost_beside_frames_that_vary_keep_what_the_channel_shows():
    spec = {
        "rates": {"tick_hz": 100.0},
        "numbers": {"n": 2},
        "block": {"plant": {"type": "integrator"}, "net": {"type": "channel", "every": "n", "loss": 0.3}},
        "wire": {"plant.u": "push - 3*net.y", "net.u": "plant.y"},
        "ports": {"inputs": {"push": "push"}, "outputs": {"place": "plant.y"}},
        "for_all": {"n": {"values": [2, 5], "varying": True, "shares": [1, 1]}},
    }
    push = np.random.default_rng(1).normal(size=60)
    lengths = [2, 5, 3]
    runs = [0, *np.cumsum(np.resize(lengths, 60)).tolist()]  # ticks in which the channel runs
    arrives = [True, False, True, False, False]  # in five runs, again and again
    x = shown = 0.0
    expected = []
    for k, force in enumerate(push):
        if k in runs and arrives[runs.index(k) % 5]:
            shown = x
        expected.append(x)
        x += 0.01 * (force - 3 * shown)
    run = load(spec | {"simulate": {"frames": lengths, "messages": {"net": [0, "lost", 0, "2 lost"]}}})
    np.testing.assert_allclose(recorded(simulated(run, push))["place"], expected, rtol=0, atol=1e-14)
    late = simulated(load(spec | {"simulate": {"frames": "random", "duration_s": 100}}), np.zeros(10_000)).late
    assert 0.25 < (late == -1).mean() < 0.35  # of all messages those that were lost


@pytest.mark.asks("frame_times")
def test_a_file_of_frames_is_played_back(tmp_path):
    lengths = [16, 20, 33, 20, 16, 41]
    Path(tmp_path / "spec.toml").write_text('controller.kind = "dc-slow"\nsimulate.frames = "times.csv"\n')
    Path(tmp_path / "times.csv").write_text("time\n" + "\n".join(f"{each / 1000}" for each in (0, *np.cumsum(lengths))))
    spec = load(tmp_path / "spec.toml")
    (table, *others) = simulate(spec.asking("simulate"))
    assert not others
    assert np.bincount(table.columns["frame"])[:12].tolist() == lengths * 2
    assert table.facts["frames"].keys() == {"16", "20", "33", "41"}
    assert [path.name for path in spec.files] == ["spec.toml", "times.csv"]
    (tmp_path / "times.csv").unlink()
    with pytest.raises(UsageError, match=r"times\.csv"):
        simulated(spec)
