"""The same bits from any number of workers on any backend; what is missing or dies is named."""

import logging
import os
import signal
import sys
import warnings

import pytest

from wavesweep import sweep
from wavesweep.errors import UsageError, WavesweepError
from wavesweep.sweep import workers
from wavesweep.sweep.tasks import timed
from wavesweep.sweep.workers import Workers, results


@pytest.mark.slow
@pytest.mark.parametrize(("jobs", "backend"), [(1, "loky"), (2, "loky"), (4, "loky"), (2, "threading"), (2, "multiprocessing")])
def test_workers_give_the_bits_that_none_give(long, long_table, same, jobs, backend, tmp_path):
    run = sweep.intervals(long, jobs=jobs, backend=backend, checkpoint=tmp_path / "parts")
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
def test_a_dask_cluster_of_two_processes_gives_the_same_bits(long, long_table, same, cluster):
    run = sweep.intervals(long, backend="dask", scheduler=cluster)
    same(run.columns, long_table)


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_named(mixed, monkeypatch):

    monkeypatch.setattr(workers, "PATIENCE", "1s")
    with pytest.raises(UsageError, match=r"--scheduler tcp://127\.0\.0\.1:9: no dask scheduler answers there"):
        sweep.intervals(mixed, backend="dask", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(UsageError, match="give the scheduler's address"):
        sweep.intervals(mixed, backend="dask")


def test_a_backend_that_joblib_does_not_know_is_refused_with_those_that_it_knows(mixed):
    with pytest.raises(UsageError, match="lokky: joblib knows no such backend"):
        sweep.intervals(mixed, backend="lokky")


@pytest.mark.parametrize(("backend", "package"), [("ray", "ray"), ("dask", "distributed")])
def test_a_missing_package_is_named_with_the_extra_that_brings_it(mixed, monkeypatch, backend, package):
    for name in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UsageError, match=rf"the package {package} is missing; .*'wavesweep\[{backend}\]'"):
        sweep.intervals(mixed, backend=backend)


def die_once(mark):
    """Kill this process, unless another one of this test has died already."""

    def work(*given):
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return timed(*given)

    return work


@pytest.mark.slow
def test_a_worker_that_dies_is_an_error_and_what_is_finished_is_kept(long, long_table, same, monkeypatch, tmp_path):
    # The worker gets the function by value: nothing in its own modules is changed.
    monkeypatch.setattr(workers, "timed", die_once(tmp_path / "died"))
    with pytest.raises(WavesweepError, match="a worker process died") as caught:
        sweep.intervals(long, jobs=2, backend="loky", checkpoint=tmp_path / "parts")
    assert "the same command goes on from there" in caught.value.__notes__[0]
    monkeypatch.undo()
    same(sweep.intervals(long, jobs=1, checkpoint=tmp_path / "parts").columns, long_table)


def test_what_fails_in_a_worker_fails_here(monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(workers, "timed", fail)
    with pytest.raises(ZeroDivisionError, match="by zero"):
        list(results(Workers(2, "threading", None, ""), [0, 1], lambda number: number))


def give_back(number, *_):
    return number


@pytest.mark.slow
def test_a_backend_that_gives_lists_only_works_in_blocks(monkeypatch):
    monkeypatch.setattr(workers, "timed", give_back)
    given = list(results(Workers(2, "multiprocessing", None, ""), range(30), lambda number: number))
    assert given == list(range(30))
