"""The same bits from any number of workers on any backend; what is missing or dies is named."""

import contextlib
import logging
import os
import subprocess
import sys
import time
import warnings
from concurrent.futures import Future, ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
from support.chunks import DieOnce, meet

from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.platform_compat import versions
from wavesweep.program.sweep import clusters, workers
from wavesweep.program.sweep.pools import in_parallel, left_in, started_here, timed
from wavesweep.program.sweep.workers import Workers, results
from wavesweep.program.tables.interval_table import intervals


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 4])
def test_workers_give_the_bits_that_none_give(long, long_table, same, jobs, tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "processors", lambda: 4)
    run = intervals(long, jobs=jobs, backend="loky", checkpoint=tmp_path / "parts")
    same(run.columns, long_table)
    assert run.facts["timings"]["workers"] == jobs


@pytest.fixture(scope="module")
def cluster():
    """Address of a dask cluster of two worker processes on this machine."""
    from distributed import LocalCluster

    here = {"host": "127.0.0.1", "dashboard_address": None, "silence_logs": logging.CRITICAL}
    with warnings.catch_warnings():
        # Of the cluster's own making, and of no consequence for what it computes.
        warnings.simplefilter("ignore")
        with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, **here) as running:
            yield running.scheduler_address


@pytest.mark.slow
def test_workers_make_no_folder_that_a_kill_would_leave():
    program = (
        "import glob, os\n"
        "from wavesweep.program.sweep.pools import in_parallel\n"
        "for done in in_parallel(2, [(divmod, 3, 2)] * 2):\n"
        "    print(*glob.glob(f'/dev/shm/joblib_memmapping_folder_{os.getpid()}_*'))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n") == ["", "", ""]


@pytest.mark.slow
def test_the_next_run_has_the_processes_of_the_last_one_and_an_error_ends_them(tmp_path):
    def both(name):
        """The processes of a run whose two tasks wait for each other, so that neither process does both."""
        (tmp_path / name).mkdir()
        return {process for process, _ in in_parallel(2, [(meet, tmp_path / name, 2)] * 2)}

    first = both("first")
    assert len(first) == 2
    assert both("second") == first
    with pytest.raises(ZeroDivisionError):
        list(in_parallel(2, [(divmod, 1, 0)]))
    assert not both("third") & first


@pytest.mark.slow
def test_a_dask_cluster_of_two_processes_gives_the_same_bits(long, long_table, same, cluster):
    run = intervals(long, backend="dask", scheduler=cluster)
    same(run.columns, long_table)


@pytest.mark.slow
def test_what_fails_in_the_threads_of_dask_is_no_traceback_on_the_terminal(cluster, caplog):
    """A scheduler that is lost makes callbacks of its client fail, which tornado would show."""
    from distributed import Client

    def fail():
        raise OSError("Stream is closed")

    with clusters.dask(Workers(1, "dask", cluster, "")) as pool, Client(cluster, set_as_default=False) as other:
        other.loop.add_callback(fail)
        assert pool.submit(len, "ab").result() == 2
    assert caplog.records == []


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_named_and_nothing_is_left(mixed, long, monkeypatch, tmp_path):
    monkeypatch.setattr(clusters, "SCHEDULER_SECONDS", 1.0)
    with pytest.raises(UsageError, match=r"^scheduler tcp://127\.0\.0\.1:9: no dask scheduler answers there"):
        intervals(mixed, backend="dask", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(UsageError, match="give the scheduler's address") as refused:
        intervals(long, backend="dask", checkpoint=tmp_path / "parts")
    assert getattr(refused.value, "__notes__", []) == list(tmp_path.iterdir()) == []


def test_no_more_workers_are_used_than_there_are_processors(monkeypatch):
    monkeypatch.setattr(workers, "PROCESSES", 2)
    monkeypatch.setattr(workers, "processors", lambda: 3)
    assert workers.choose(60, None, None, 1000, lambda: 10.0).count == 3
    assert workers.choose(60, "loky", None, 1000, lambda: 10.0).count == 3
    assert "this machine has 3 processors" in workers.excess(60, None)
    assert workers.excess(3, None) == workers.excess(60, "dask") == ""
    monkeypatch.setattr(workers, "processors", lambda: 1)
    assert workers.choose(2, None, None, 1000, lambda: 10.0).backend is None
    assert workers.excess(2, None) == ""  # the default is no wish


def test_a_missing_package_is_named_with_the_extra_that_brings_it(mixed, monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "distributed"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UsageError, match=r"the package distributed is missing; .*'wavesweep\[dask\]'"):
        intervals(mixed, backend="dask")


@pytest.mark.parametrize("name", ["tool_version", "numpy_version"])
def test_workers_of_another_version_are_refused_and_no_row_of_theirs_is_kept(long, monkeypatch, tmp_path, name):
    monkeypatch.setattr(workers, "versions", lambda: versions() | {name: "0.0.1"})
    with pytest.raises(
        WavesweepError, match=r"expected workers with wavesweep .*0\.0\.1.*, found one with wavesweep .* and numpy"
    ):
        intervals(long, jobs=2, backend="loky", checkpoint=tmp_path / "kept.sqlite")
    assert not (tmp_path / "kept.sqlite").exists()


@pytest.mark.slow
def test_a_worker_that_dies_is_an_error_and_what_is_finished_is_kept(long, long_table, same, monkeypatch, tmp_path):
    monkeypatch.setattr(workers, "timed", DieOnce(tmp_path / "died"))
    with pytest.raises(WavesweepError, match="a worker process died") as caught:
        intervals(long, jobs=2, backend="loky", checkpoint=tmp_path / "parts")
    told = "".join(getattr(caught.value, "__notes__", []))
    assert ("the same command goes on from there" in told) == ("slices are kept" in told) == bool(told)
    monkeypatch.undo()
    same(intervals(long, jobs=1, checkpoint=tmp_path / "parts").columns, long_table)


def test_what_fails_in_a_worker_fails_here(monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(workers, "timed", fail)
    with pytest.raises(ZeroDivisionError, match="by zero"):
        list(results(Workers(2, "loky", None, ""), [0, 1], lambda number: number))


@pytest.mark.slow
def test_a_cluster_that_is_lost_is_an_error_and_not_a_wait(long, monkeypatch, tmp_path):
    from distributed import LocalCluster

    monkeypatch.setattr(clusters, "SECONDS_WITHOUT_WORKERS", 1.0)
    monkeypatch.setattr(workers, "LOOK_AT_POOL", 0.2)
    here = {"host": "127.0.0.1", "dashboard_address": None, "silence_logs": logging.CRITICAL}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        running = LocalCluster(n_workers=0, **here)
    with running, pytest.raises(WavesweepError, match="has had no workers for 1 s"):
        intervals(long, backend="dask", scheduler=running.scheduler_address, checkpoint=tmp_path / "parts")


def test_a_run_in_which_nothing_finishes_says_so_once_and_then_rarely(caplog):
    now = [0.0]
    silence = workers.Silence(clock=lambda: now[0])
    for second in range(0, 1000, 2):
        now[0] = float(second)
        if second in (10, 100):
            silence.end()
        else:
            silence.go_on("6 tasks are with 2 processes")
    said = [record.getMessage() for record in caplog.records]
    assert [text.split(";")[0] for text in said] == [f"nothing has finished for {s} s" for s in (20, 40, 80, 160, 320, 640)]
    assert said[0].endswith("; 6 tasks are with 2 processes. If no processor is busy with them, Ctrl-C stops the run")


@pytest.mark.parametrize(("seconds", "together"), [(0.0, 8), (0.4, 2), (3.0, 1)])
def test_quick_chunks_go_to_a_cluster_together(monkeypatch, seconds, together):
    """Its scheduler takes milliseconds for a task, however small."""
    sizes = []

    def submit(function, each_of, work, batch):
        sizes.append(len(batch))
        done = Future()
        done.set_result(function(each_of, work, batch))
        return done

    monkeypatch.setattr(clusters, "dask", lambda _: contextlib.nullcontext(clusters.Pool(submit, 1, str)))
    monkeypatch.setattr(workers, "timed", lambda number, _: (number, None, seconds))
    found = list(results(Workers(1, "dask", None, ""), range(50), lambda number: number))
    assert sorted(number for number, *_ in found) == list(range(50))
    assert max(sizes) == together


def test_a_cluster_is_lost_when_it_has_been_without_workers_for_long_and_never_while_it_has_some(monkeypatch):
    now, there = [0.0], {"tcp://one": 2}
    executor = SimpleNamespace(submit=None, shutdown=lambda **_: None)
    scheduler = SimpleNamespace(address="tcp://here", ncores=None)
    client = SimpleNamespace(
        scheduler=scheduler, status="running", get_executor=lambda **_: executor, sync=lambda *_, **__: there
    )
    monkeypatch.setattr(clusters, "imported", lambda: SimpleNamespace(KilledWorker=ZeroDivisionError))
    monkeypatch.setattr(clusters, "_client", lambda *_: client)
    monkeypatch.setattr(clusters, "time", SimpleNamespace(monotonic=lambda: now[0]))
    with clusters.dask(SimpleNamespace(scheduler=None, count=1)) as pool:
        for now[0] in (15.0, 30.0, 45.0):
            assert pool.look().startswith("1 workers of the dask scheduler tcp://here")
        there.clear()
        now[0] = 64.0
        assert pool.look().startswith("0 workers")
        now[0] = 66.0
        with pytest.raises(WavesweepError, match="has had no workers for 20 s"):
            pool.look()


def test_threads_that_start_workers_leave_the_streams_and_the_environment_as_they_were():
    """Other threads print meanwhile; variables of the whole process are lent to what is started."""

    def streams():
        return os.fstat(1).st_ino, os.fstat(2).st_ino

    before = streams(), dict(os.environ)

    def start():
        for _ in range(20):
            with started_here():
                time.sleep(1e-4)
                assert streams() == before[0]

    with ThreadPoolExecutor(4) as pool:
        for done in [pool.submit(start) for _ in range(4)]:
            done.result()
    assert (streams(), dict(os.environ)) == before


@pytest.mark.slow
def test_workers_write_nothing_also_when_their_program_is_killed():
    program = (
        "import os, signal\n"
        "from wavesweep.program.sweep.pools import in_parallel\n"
        "for _ in in_parallel(2, [(os.system, 'echo from a worker; echo so >&2')] * 4):\n"
        "    pass\n"
        "print('killed', flush=True)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("killed\n", "")


def test_a_folder_without_room_is_named(monkeypatch, tmp_path):
    def full(*_):
        raise OSError("7211 requested and 73 written")

    monkeypatch.setattr(np, "save", full)
    with pytest.raises(WavesweepError, match=rf"{tmp_path}: no room .*7211 requested.*TMPDIR"):
        left_in(str(tmp_path), timed, 0, lambda: np.zeros(3))


@pytest.mark.slow
def test_threads_give_the_bits_that_none_give(long, long_table, same, tmp_path):
    run = intervals(long, jobs=2, backend="threading", checkpoint=tmp_path / "parts")
    same(run.columns, long_table)
