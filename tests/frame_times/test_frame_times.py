"""Frames as they were measured, against counts by hand, loops that count ticks, and chains whose numbers are known."""

import json
import re
import shlex
import tomllib
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from wavesweep import load
from wavesweep.engine.errors import UsageError
from wavesweep.frame_times.chain import are_independent, pairs_of
from wavesweep.frame_times.table import identified, spec_text
from wavesweep.frame_times.times import read_run
from wavesweep.frame_times.within import lengths_of, lines, number_of, within
from wavesweep.program.csv_files import pairs

ENGINE = {
    "environment": {"integration": "explicit", "delay": 1},
    "device": {"velocity": "difference"},
    "controller": {"kind": "dc-slow"},
    "for_all": {"rates.ratio": {"values": [16, 20, 25, 33], "varying": True}},
}
CHAIN = np.array([[0.7, 0.2, 0.05, 0.05], [0.1, 0.8, 0.05, 0.05], [0.1, 0.5, 0.3, 0.1], [0.1, 0.6, 0.2, 0.1]])
LENGTHS = np.array([16, 20, 25, 33])


def run_of_chain(frames, seed=0):
    rng, states = np.random.default_rng(seed), [0]
    for _ in range(frames - 1):
        states.append(rng.choice(4, p=CHAIN[states[-1]]))
    return LENGTHS[states]


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Write a column of numbers to times.csv."""
    monkeypatch.chdir(tmp_path)

    def write(name, numbers, file="times.csv"):
        Path(file).write_text("\n".join([f"number,{name}", *(f"{i},{each!r}" for i, each in enumerate(map(float, numbers)))]))
        return file

    return write


def stamps(ticks, fast_hz=1000.0, start=12.5):
    return start + np.append(0, np.cumsum(ticks)) / fast_hz


SEEN = np.array([11.1, 11.0, 22.3, 11.2])  # ms
PROGRAMS = {
    "PresentMon 1": (
        "Application,ProcessID,SwapChainAddress,Runtime,TimeInSeconds,msInPresentAPI,msBetweenPresents",
        [f"a.exe,7,0xA,DXGI,{t:.6f},0.1,{ms}" for t, ms in zip(np.cumsum([0, *SEEN]) / 1e3, [0, *SEEN], strict=True)],
    ),
    "PresentMon 2": (
        "Application,ProcessID,SwapChainAddress,CPUStartTime,FrameTime,CPUBusy",
        [f'"a, b.exe",7,0xA,{100 + k},{ms},NA' for k, ms in enumerate(SEEN)],
    ),
    "OCAT": (
        "Application,TimeInSeconds,MsInPresentAPI,Processor,System RAM",
        [f"a.exe,{t:.6f},1" + ',"a, b",32 GB' * int(t == 0) for t in np.cumsum([0, *SEEN]) / 1e3],
    ),
    "a header at the end again, and another unit": (
        "frame,realtime_ms,used",
        [*(f"{k},{t!r},1" for k, t in enumerate(np.cumsum([0, *SEEN]).tolist())), "frame,realtime_ms,used", ""],
    ),
    "microseconds by their name": ("Time (us)", [f"{round(1e3 * t)}" for t in np.cumsum([0, *SEEN])]),
    "PlotJuggler": ("__time,/statistics/period", [f"{1.7e9 + t:.6f}," for t in np.cumsum([0, *SEEN]) / 1e3]),
    "rostopic": ("%time,field.data", [f"{1_700_000_000_000_000_000 + round(1e6 * t)},0" for t in np.cumsum([0, *SEEN])]),
    "ROS 2": (
        "header.stamp.sec,header.stamp.nanosec,name",
        [f"{1_700_000_000 + int(t // 1000)},{round(1e6 * (t % 1000))},x" for t in 990 + np.cumsum([0, *SEEN])],
    ),
    "MangoHud": (
        "os,cpu,gpu,ram\nArch Linux,a cpu,a gpu,16\nfps,frametime,cpu_load,elapsed",
        [f"{1e6 / ms:.1f},{1e3 * ms:.0f},7,{round(1e6 * t)}" for t, ms in zip(np.cumsum([0, *SEEN]), [9, *SEEN], strict=True)],
    ),
    "blackbox_decode": (
        "H Product:Blackbox flight data recorder\nH looptime:125\nloopIteration, time (us), axisP[0], flightModeFlags (flags)",
        [f"{4 * k}, {round(1e3 * t)},  -1, ANGLE_MODE|HORIZON_MODE" for k, t in enumerate(np.cumsum([0, *SEEN]))],
    ),
    "Blackbox Explorer": (
        "\n".join(['"Product","Blackbox"', *(f'"setting_{k}",{k}' for k in range(12)), '"loopIteration","time","heading[0]"']),
        [f"{4 * k},{round(1e3 * t)},NaN" for k, t in enumerate(np.cumsum([0, *SEEN]))],
    ),
    "perf script": (
        "# captured on: a machine",
        [
            f" wall loop 7/8 [001] {9 + t / 1e3:.6f}:   1 probe_wall:done: (55d1) k=1\n   55d1 draw+0x1"
            for t in np.cumsum([0, *SEEN])
        ],
    ),
    "ftrace": ("# tracer: nop", [f"  wall-7   [001] d..2. {9 + t / 1e3:.6f}: frame_done: k" for t in np.cumsum([0, *SEEN])]),
    "FRAPS": ("Frame, Time (ms)", [f"    {k + 1}, {t:11.3f}" for k, t in enumerate(np.cumsum([0, *SEEN]))]),
    "framestats of Android": (
        "Applications Graphics Acceleration Info:\n\n---PROFILEDATA---\nFlags,IntendedVsync,Vsync,FrameCompleted,",
        [*(f"0,{10**14 + round(1e6 * t)},5,6," for t in np.cumsum([0, *SEEN])), "---PROFILEDATA---", "", "View hierarchy:"],
    ),
    "CapFrameX": (
        '{"Info": {"AppVersion": "1.7"}, "Runs": [{"CaptureData":',
        [json.dumps({"Dropped": [False] * 4, "MsBetweenPresents": SEEN.tolist(), "Empty": []}) + "}]}"],
    ),
    "OpenXR": (
        "[",
        [",".join(json.dumps({"predictedDisplayTime": round(1e6 * t), "layers": [1]}) for t in np.cumsum([0, *SEEN])) + "]"],
    ),
}


@pytest.mark.parametrize("program", PROGRAMS)
def test_files_of_other_programs_are_read_as_they_are(program, tmp_path):
    header, rows = PROGRAMS[program]
    path = tmp_path / "run.csv"
    path.write_text("\n".join([header, *rows]))
    assert read_run(path, 10_000.0, {}, {}).ticks == pytest.approx(10 * SEEN, abs=0.02)


OTHER_ROWS = {  # of a program, and one of another that is not among its frames
    "PresentMon 1": ("a.exe,7,0xB,DXGI,0.02,0.1,3", "SwapChainAddress: expected the frames of one, found 2 (0xA, 0xB)"),
    "PresentMon 2": ("dwm.exe,8,0xC,100,3,NA", "Application: expected the frames of one, found 2 (a, b.exe, dwm.exe)"),
    "perf script": (
        "  idle 0 [000] 9.02: irq:entry: irq=3",
        "event: expected the frames of one, found 2 (probe_wall:done, irq:entry)",
    ),
    "FRAPS": None,
}


@pytest.mark.parametrize("options", [True, False])
@pytest.mark.parametrize("program", OTHER_ROWS)
def test_what_a_refusal_says_to_write_makes_a_file_be_read(program, options, tmp_path):
    header, rows = PROGRAMS[program]
    path = tmp_path / "run 1.csv"
    if OTHER_ROWS[program]:
        row, said = OTHER_ROWS[program]
        path.write_text("\n".join([header, *rows[:2], row, *rows[2:]]))
    else:
        said = "expected a column time or duration, found "
        stamps = np.cumsum([0, *SEEN]) / 1e3
        path.write_text("\n".join(["number,the stamp (s)", *(f"{k},{stamp}" for k, stamp in enumerate(stamps))]))
    with pytest.raises(UsageError, match=re.escape(said)) as caught:
        read_run(path, 10_000.0, {}, {} if options else None)
    if options:
        _, word = shlex.split(re.search(r"--column ('[^']*'|\S+)", str(caught.value))[0])
        named = pairs([word], "--column")
    else:
        file, *words = tomllib.loads(re.search(r"frames = \[.*?\]", str(caught.value))[0])["frames"]
        assert file == path.name
        named = pairs(words, "frames")
    assert read_run(path, 10_000.0, named, {} if options else None).ticks == pytest.approx(10 * SEEN, abs=0.02)


@pytest.mark.asks("check")
def test_check_takes_other_names_and_units_of_frames_as_identify_does(wavesweep, written):
    Path("mine.toml").write_text(
        '[controller]\nkind = "dc-slow"\n[for_all]\n"rates.ratio" = { values = [16, 20, 25, 33], varying = true }\n'
    )
    written("took", run_of_chain(50))
    named = ("--column", "duration=took", "--scale", "duration=0.001")
    code, out, _ = wavesweep("check", "mine.toml", "--frames", "times.csv", *named, "--all")
    assert (code, "all 50 are within 16, 20, 25, 33 ticks in any order" in out) == (0, True)
    code, _, err = wavesweep("check", "mine.toml", *named)
    assert (code, "--column: expected --frames, whose column it names" in err) == (2, True)


def test_stamps_and_durations_give_the_same_lengths(written):
    lengths = run_of_chain(200)
    of_stamps = read_run(written("time", stamps(lengths)), 1000.0, {}, {})
    of_durations = read_run(written("took", lengths), 1000.0, {"duration": "took"}, {"duration": 0.001})
    for run in (of_stamps, of_durations):
        assert not run.unfit.any()
        assert run.lengths.tolist() == lengths.tolist()
        assert run.values.tolist() == [16, 20, 25, 33]
    assert np.allclose(of_stamps.begins - 12.5, of_durations.begins, atol=1e-9)


@pytest.mark.parametrize(("seed", "every"), [(0, 1), (1, 1), (2, 4), (3, 7)])
def test_a_loop_that_counts_its_ticks_finds_a_length_that_is_possible(written, seed, every):
    """An engine with a clock of its own: the ticks in which the loop looks for a stamp are counted one by one."""
    rng = np.random.default_rng(seed)
    ends = np.append(0, np.cumsum(rng.choice([16.0, 16.6667, 20.4, 33.3], 60) + 0.04 * rng.standard_normal(60)))
    run = replace(read_run(written("time", ends / 1000), 1000.0, {}, {}), every=every)
    least, most = run.possible
    phase = rng.uniform(0, every)
    ticks = np.arange(0, int(ends[-1]) + 2 * every, every) + phase
    counted = every * np.array([((ticks >= a) & (ticks < b)).sum() for a, b in pairwise(ends)])
    unfit = run.unfit
    assert unfit.sum() > 20
    assert ((least <= counted) & (counted <= most))[unfit].all()
    assert ((least <= run.lengths) & (run.lengths <= most)).all()
    assert abs(run.lengths[unfit].sum() - run.ticks[unfit].sum()) <= every
    assert set(counted[unfit]) <= set(run.values)


def test_pairs_are_those_that_a_counter_counts():
    lengths = run_of_chain(500)
    counted = Counter(zip(lengths.tolist(), lengths[1:].tolist(), strict=False))
    pairs = pairs_of(lengths, LENGTHS)
    assert {(a, b): pairs[i, j] for i, a in enumerate(LENGTHS) for j, b in enumerate(LENGTHS) if pairs[i, j]} == counted


def test_independent_frames_are_told_from_a_chain():
    rng = np.random.default_rng(1)
    independent = [are_independent(rng.choice(LENGTHS, 60, p=[0.1, 0.6, 0.2, 0.1]), LENGTHS) for _ in range(20)]
    assert sum(independent) >= 18  # 1 of 100 is expected to be taken for a chain
    assert not any(are_independent(run_of_chain(300, seed), LENGTHS) for seed in range(3))
    assert are_independent(np.full(50, 20), np.array([20]))


@pytest.mark.slow
@pytest.mark.asks("identification", "for_all")
def test_identify_writes_the_lengths_as_a_table_and_as_a_piece_of_spec(wavesweep, written):
    lengths = run_of_chain(800)
    code, out, _ = wavesweep("identify", "--frames", written("time", stamps(lengths)), "--fast-hz", "1000", "--json")
    assert code == 0
    found = json.loads(out)
    assert {each["ticks"]: each["frames"] for each in found["lengths"]} == Counter(lengths.tolist())
    assert (found["frames"], found["independent"], found["unfit"]["frames"]) == (800, False, 0)
    assert found["duration_s"] == pytest.approx(lengths.sum() / 1000)
    names = {f"identify-frames{suffix}" for suffix in (".csv", ".parquet", ".png", ".datapackage.json")}
    assert {path.name for path in Path("results/times").iterdir()} == names | {"frames.toml"}
    rows = np.loadtxt("results/times/identify-frames.csv", delimiter=",", skiprows=1)
    assert rows[:, 2].sum() == 799
    for ticks in LENGTHS:
        assert rows[rows[:, 0] == ticks, 3].sum() == pytest.approx(1)
    piece = tomllib.loads(Path("results/times/frames.toml").read_text(encoding="utf-8"))
    for_all = load({"controller": {"kind": "dc-slow"}} | piece).for_all
    assert [(axis.path, axis.values) for axis in for_all.changing] == [("rates.ratio", (16, 20, 25, 33))]
    assert np.array_equal(for_all.shares, pairs_of(lengths, LENGTHS))
    assert wavesweep("verify", "results/times")[0] == 0
    code, _, err = wavesweep("identify", "--frames", "times.csv", "--fast-hz", "1000", "--no-plot", "--quiet")
    assert (code, err) == (0, "")  # its own files are replaced


@pytest.mark.asks("for_all")
def test_independent_frames_have_shares_and_a_length_that_nothing_follows_the_shares_of_all(written):
    lengths = np.append(np.random.default_rng(3).choice([16, 20], 200, p=[0.3, 0.7]), 33)
    for more, independent in ((lengths, True), (np.append(run_of_chain(300), 40), False)):
        table = identified(written("time", stamps(more)), 1000.0, "rates.ratio", {}, {})
        values, counts = np.unique(more, return_counts=True)
        found = tomllib.loads(spec_text(table.facts))["for_all"]["rates.ratio"]
        assert found["values"] == values.tolist()
        assert (found["shares"] if independent else found["next"][-1]) == counts.tolist()
        assert load({"controller": {"kind": "pmw"}, "for_all": {"rates.ratio": found}}).for_all.shares


@pytest.mark.asks("identification")
def test_frames_that_do_not_fit_are_warned_of_and_have_both_neighbours(wavesweep, written):
    file = written("time", 5 + np.arange(100) / 60)
    code, _, err = wavesweep("identify", "--frames", file, "--fast-hz", "1000", "--no-plot")
    assert code == 0
    assert "99 of 99 frames do not last whole ticks, but up to 0.33 more or less; the first of 16.6667 ticks at 5 s: " in err
    assert "values = [16, 17], varying = true, next = [[0, " in Path("results/times/frames.toml").read_text(encoding="utf-8")


@pytest.mark.asks("for_all")
def test_a_run_is_within_the_frames_of_a_spec_or_the_first_that_is_not_is_named(written):
    spec, lengths = load(ENGINE), run_of_chain(100)
    assert within(spec, written("time", stamps(lengths)))["left"] == 0
    lengths[[40, 70]] = 41, 17
    found = within(spec, written("time", stamps(lengths)))
    begins = 12.5 + lengths[:40].sum() / 1000
    assert found["left"] == 2
    assert found["first"] == {"frame": 41, "begins_s": pytest.approx(begins), "ticks": pytest.approx(41)}
    said = [line for _, line in lines(found)]
    assert said[0].endswith("2 of 100 are NOT within 16, 20, 25, 33 ticks in any order, so no answer here is for this run")
    assert said[1].endswith(f"the first is frame 41, which begins at {begins:.6g} s and lasts 41 ticks")
    between = np.where(lengths > 33, 20, np.where(lengths == 17, 20.5, lengths))  # 20 or 21
    assert within(spec, written("time", stamps(between)))["first"]["frame"] == 71


@pytest.mark.slow
@pytest.mark.asks("for_all", "identification")
def test_lengths_of_which_there_are_too_many_become_multiples_that_for_all_takes(wavesweep, written):
    """Also what is written grows with the frames and not with the square of the lengths."""
    took = np.random.default_rng(0).uniform(0.03, 0.9, 4000)
    written("duration", took)
    code, _, err = wavesweep("identify", "--frames", "times.csv", "--fast-hz", "1000", "--no-plot")
    assert (code, "this assumes a loop that looks for a result in every 14 ticks and not in each" in err) == (0, True)
    assert sum(path.stat().st_size for path in Path("results/times").iterdir()) < 300_000
    text = Path("results/times/frames.toml").read_text(encoding="utf-8")
    assert "# ASSUMED: the loop looks for a result in every 14 ticks" in text
    spec = load({"controller": {"kind": "pmw"}} | tomllib.loads(text))
    values = np.array(spec.for_all.changing[0].values)
    assert (len(values) <= 64, (values % 14).any()) == (True, False)
    counts = np.floor(took * 1000 / 14), np.ceil(took * 1000 / 14)
    assert {*values} == {14 * int(each) for each in np.unique(counts)}
    found = within(spec, "times.csv")
    assert (found["left"] > 3000, found["every"]) == (True, 14)


def test_a_chain_of_more_lengths_than_a_proof_takes_is_left_out(written):
    lengths = np.repeat(np.arange(10, 40), 30)
    text = spec_text(identified(written("duration", lengths / 1000), 1000.0, "rates.ratio", {}, {}).facts)
    assert {*tomllib.loads(text)["for_all"]["rates.ratio"]} == {"values", "varying"}


@pytest.mark.asks("for_all")
def test_a_constant_length_is_one_that_stays():
    unknown = ENGINE | {"for_all": {"rates.ratio": {"values": [16, 20]}}}
    assert lengths_of(load(unknown)) == ((16, 20), False)
    assert lengths_of(load({"controller": {"kind": "pmw"}, "rates": {"ratio": 12}})) == ((12,), False)


@pytest.mark.asks("for_all")
def test_frames_of_unknown_constant_length_may_not_change(written):
    spec = load(ENGINE | {"for_all": {"rates.ratio": {"values": [16, 20]}}})
    assert within(spec, written("time", stamps([20] * 9)))["left"] == 0
    found = within(spec, written("time", stamps([20] * 9 + [16, 16])))
    assert (found["left"], found["first"]["frame"]) == (2, 10)


@pytest.mark.asks("for_all")
def test_a_drawn_loop_says_which_number_its_frames_are():
    drawing = {
        "rates": {"tick_hz": 500},
        "numbers": {"k": 2.0, "n": 8},
        "block": {"one": {"type": "integrator"}, "slow": {"type": "hold", "every": "n"}},
        "wire": {"one.u": "-k*slow.y", "slow.u": "one.y"},
    }
    assert number_of(load(drawing)) == "n"
    assert lengths_of(load(drawing)) == ((8,), False)
    drawing["for_all"] = {"n": {"start": 6, "stop": 9, "varying": True}}
    assert lengths_of(load(drawing)) == ((6, 7, 8, 9), True)
    drawing["block"]["slow"]["every"] = "2*n"
    assert lengths_of(load(drawing)) == ((12, 14, 16, 18), True)
    with pytest.raises(UsageError, match=r"expected one number as `every` of all blocks .* found 2\*n"):
        number_of(load(drawing))


@pytest.mark.slow
@pytest.mark.asks("check")
def test_check_says_it_and_ends_with_it(wavesweep, written):
    Path("slow.toml").write_text('controller.kind = "dc-slow"\nenvironment.K_VE = 60\n')
    asked = ("check", "slow.toml", "--frames", "times.csv", "--strict")
    for ticks, left in ((25, 1), (20, 0)):
        written("time", stamps([20, 20, ticks, 20]))
        code, out, _ = wavesweep(*asked)
        said = "1 of 4 are NOT within" if left else "all 4 are within"
        assert (code, f"measured frames (times.csv): {said} a constant length of 20 ticks" in " ".join(out.split())) == (
            left,
            True,
        )


@pytest.mark.parametrize(
    ("name", "numbers", "said"),
    [
        ("stamp", [1, 2, 3], "expected a column time or duration, found number, stamp; --column time=stamp names"),
        ("time", [0, 0.02, 0.02, 0.04], "times.csv:4: time: expected frames of at least a tick of 1 ms, found one of 0 ms"),
        ("time", [0, 20, 40], "expected frames of at most 10 s, found 20 s for most; --scale time=0.001 if it is in ms"),
        ("time", [0, 0.02], "expected at least 3 rows"),
        (
            "time",
            [0, 0.02, 5.02],
            "csv:4: time: expected frames of at most 1000 ticks of 1 ms, found one of 5000 ms; is it",
        ),
        ("duration", [0.02, 0.02, 1e307], "duration: expected a largest size of 1e+30 s, found 1e+307"),
        (
            "duration",
            np.linspace(0.003, 0.9, 900),
            "at most 64 lengths of frames, which [for_all] takes, found 898, from 3 ticks",
        ),
    ],
)
def test_a_file_that_cannot_be_used_is_refused(written, name, numbers, said):
    with pytest.raises(UsageError) as caught:
        identified(written(name, numbers), 1000.0, "rates.ratio", {}, {})
    assert said in str(caught.value)


def test_a_rate_at_which_frames_last_more_ticks_than_a_ratio_has_is_refused(written):
    with pytest.raises(UsageError, match="expected frames of at most 1000 ticks of 1e-297 ms, found one of 20 ms"):
        identified(written("duration", [0.02] * 3), 1e300, "rates.ratio", {}, {})
    with pytest.raises(UsageError, match="--every 21: expected at most 20, the ticks of the shortest frame, found 21"):
        identified("times.csv", 1000.0, "rates.ratio", {}, {}, every=21)


def test_a_loop_without_frames_is_refused():
    for values, said in (
        ({"controller": {"kind": "dc"}}, "expected a controller with a slow environment, which has frames, found dc"),
        ({"controller": {"kind": "pmw"}, "rates": {"slow_hz": 60.0}}, "expected frames of whole ticks"),
    ):
        with pytest.raises(UsageError, match=said):
            lengths_of(load(values))


@pytest.mark.parametrize("fixed", [False, True])
def test_stamps_of_fast_ticks_give_their_interval(wavesweep, written, fixed):
    """Lateness up to 0.2 ms: of a timer at fixed times, or of one that begins again when it wakes."""
    late = np.random.default_rng(0).uniform(0, 2e-4, 3000)
    late[:2] = 0.0, 2e-4
    times = 5 + 1e-3 * np.arange(3000) + (late if fixed else np.cumsum(late))
    written("time", times)
    for _ in range(2):  # its own spec is in place of it the second time
        code, _, err = wavesweep("identify", "--frames", "times.csv", "--fast-hz", "1000")
        assert code == 0, err
    spans = np.diff(times)
    tick = tomllib.loads(Path("results/times/frames.toml").read_text())["for_all"]["tick"]
    assert tick["start"] <= spans.min() + 1e-12
    assert tick["stop"] >= spans.max() - 1e-12
    assert tick["start"] == pytest.approx(min(spans.min(), 1e-3), abs=2e-6)
    assert tick["stop"] == pytest.approx(spans.max(), abs=2e-6)
    assert "2999 ticks of the fast loop itself in" in err
    assert ("a timer at fixed times" in err) == fixed
    spec = load(ENGINE | {"for_all": {"tick": tick}})
    assert spec.tick.interval(spec.tick_hz) == (tick["start"], tick["stop"])


def test_of_even_stamps_no_tick_is_said_to_be_late(wavesweep, written):
    written("time", 1e-3 * np.arange(400))
    code, _, err = wavesweep("identify", "--frames", "times.csv", "--fast-hz", "1000")
    assert code == 0, err
    assert "no tick is late" in err
    assert "a late tick is" not in err


def test_the_samples_of_a_voltage_are_no_stamps(tmp_path):
    path = tmp_path / "scope.csv"
    path.write_text("Time (s),CH1 (V)\n" + "".join(f"{1e-6 * row:.7f},{row % 37 // 18 * 3.3}\n" for row in range(400)))
    with pytest.raises(
        UsageError,
        match=r"scope\.csv: expected times .*, found even samples of CH1 \(V\)",
    ):
        read_run(path, 1e6, {}, {}, own_ticks=True)


def test_times_whose_name_has_another_unit_than_their_numbers_are_refused_with_the_scale_of_seconds(tmp_path):
    path = tmp_path / "frames.csv"
    path.write_text("time_us\n" + "".join(f"{0.0245 * row:.4f}\n" for row in range(60)))
    with pytest.raises(
        UsageError, match=r"time: expected frames of about a tick of 1 ms or more, found 2.45e-08 s .*--scale time=1 "
    ):
        read_run(path, 1000.0, {}, {}, own_ticks=True)
    assert read_run(path, 1000.0, {}, {"time": 1.0}, own_ticks=True).ticks[0] == pytest.approx(24.5)
