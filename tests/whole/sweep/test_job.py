"""What cannot be answered is refused before anything is computed; `check` says what would be."""

import pytest

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.program.analyses.interval_jobs import job_of
from wavesweep.program.spec import load
from wavesweep.program.sweep import estimates, workers
from wavesweep.program.sweep.estimates import expected_bytes, refuse_full_disk
from wavesweep.program.sweep.workers import WORTH, choose
from wavesweep.program.tables.response_table import responses


def spec_of(kind="pmw", **axes):
    return load({"controller": {"kind": kind}, "sweep": axes})


IN_A_RING = {
    "rates": {"tick_hz": 1000},
    "numbers": {"g": 0.5, "d": 2.0, "K": 100.0},
    "block": {"arm": {"type": "mass", "mass": 0.5, "damping": "d"}, "amp": {"type": "gain", "k": "g"}},
    "wire": {"amp.u": "amp.y - K*arm.x", "arm.f": "amp.y + hand"},
    "ports": {"hand": {"force": "hand", "displacement": "arm.x"}},
}


@pytest.mark.parametrize("backend", [None, pytest.param("loky", marks=pytest.mark.slow)])
@pytest.mark.parametrize("table", [wavesweep.stability_region, wavesweep.bode, wavesweep.passivity])
def test_values_whose_loop_has_no_solution_are_named(table, backend):
    values = {"d": [1.0, 2.0], "g": [0.25, 0.5, 1.0, 2.0]}
    sweep = {"along": "K", "K": {"start": 0, "stop": 400}} | values
    spec = IN_A_RING | {"sweep": sweep, "bode": values | {"frequency_hz": [1.0]}}
    with pytest.raises(wavesweep.IllPosedLoopError, match=r"^d = 1.0, g = 1.0: the loop of direct terms through amp has no"):
        table(spec, backend=backend)


@pytest.mark.parametrize(
    ("jobs", "backend", "chunks", "seconds", "expected"),
    [
        (2, None, 9, 10.0, (2, "loky")),
        (8, None, 3, 10.0, (3, "loky")),
        (2, None, 9, 1.01 * WORTH, (2, "loky")),
        (2, None, 9, 0.99 * WORTH, (1, None)),
        (1, None, 9, 10.0, (1, None)),
        (2, None, 1, 10.0, (1, None)),
        (2, "loky", 1, 0.1, (2, "loky")),
    ],
)
def test_workers_are_chosen_where_the_work_is_worth_them(jobs, backend, chunks, seconds, expected, monkeypatch):
    monkeypatch.setattr(workers, "processors", lambda: 8)
    chosen = choose(jobs, backend, None, chunks, lambda: seconds)
    assert (chosen.count, chosen.backend) == expected
    assert chosen.why


def test_a_disk_that_is_too_small_is_refused_before_the_work(long, tmp_path, monkeypatch):
    long = job_of(long)
    need = expected_bytes(long)
    assert 200 * long.slices < need < 500 * long.slices
    for free, kept, refused in ((need + 1, 0, False), (need - 1, 0, True), (need - 1000, 1000, False)):
        place = tmp_path / f"{free}-{kept}" / "kept.sqlite"
        if kept:
            place.parent.mkdir()
            place.write_bytes(bytes(kept))
        monkeypatch.setattr(estimates, "free_bytes", lambda _, free=free: free)
        if refused:
            with pytest.raises(UsageError, match=r"needs about \S+ MB, found \S+ MB free on this disk"):
                refuse_full_disk(place, [long])
        else:
            refuse_full_disk(place, [long])
    refuse_full_disk(None, [long])


@pytest.mark.slow
def test_more_combinations_than_can_be_computed_are_refused():
    million = {"start": 1.0, "stop": 2.0, "num": 10**6}
    with pytest.raises(UsageError, match=r"at most 1000000000 combinations, found .* = 1e\+24"):
        job_of(spec_of(B_VE=million, b=million, Kp=million, K_LM=million))
    bode = {"frequency_hz": {"start": 1, "stop": 50, "num": 10**6}, "b": {"start": 5, "stop": 50, "num": 2000}}
    with pytest.raises(UsageError, match="bode: expected at most 1000000000 rows, found 2e\\+09"):
        responses([load({"controller": {"kind": "pmw"}, "bode": bode})])
