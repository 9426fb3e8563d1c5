"""The times that `check --all` tells of tables are right to a factor of 3, in processor seconds."""

import time

import pytest

from wavesweep.capabilities import asked
from wavesweep.check.planning import SHORTEST_ESTIMATED
from wavesweep.program.analyses.response_jobs import response_job
from wavesweep.program.spec import load
from wavesweep.program.sweep.estimates import expected_seconds
from wavesweep.program.sweep.running import in_memory
from wavesweep.program.tables.interval_table import stages_of

WALLS = {"start": 0, "stop": 20000}
MASSES = {"start": 0.04, "stop": 1, "num": 300}
CASES = {
    "intervals": ("dc-vc", {"B_VE": {"start": 0.1, "stop": 20, "num": 500}, "device.mass": MASSES}),
    "passivity": ("pmw-lm", {"K_LM": {"start": 0, "stop": 3000, "num": 31}, "Kp": [0, 10, 20, 40]}),
    "responses": ("dc-vc", {"B_VE": {"start": 0.1, "stop": 5.0, "num": 40}, "device.damping": [0.5, 2.0, 5.0]}),
}  # fmt: skip


def told(spec):
    """The jobs whose times are told, with the seconds of their samples."""
    yield stages_of(spec, None, None)[0].job, 0.1
    axes = tuple(axis.name for axis in spec.bode)
    jobs = [response_job(spec, spec.bode, spec.frequency_hz, axes)]
    jobs += [job for _, its in asked("on_check", "sweep_plan", spec) for job in its]
    yield from ((job, 0.2) for job in jobs if len(job.chunks) > 1)


@pytest.mark.slow
@pytest.mark.asks("passive")
@pytest.mark.parametrize("case", CASES)
def test_the_time_of_a_table_is_told_within_a_factor_of_three(case):
    kind, axes = CASES[case]
    keys = {"controller": {"kind": kind}, "environment": {"delay": 0}}
    spec = load(keys | {"sweep": {"along": "K_VE", "K_VE": WALLS} | axes, "bode": axes})
    compared = 0
    for job, longest in told(spec):
        expected = expected_seconds(job, longest)
        if expected < SHORTEST_ESTIMATED or expected > 30:
            continue
        started = time.process_time()
        in_memory(job)
        taken = time.process_time() - started
        assert taken / 3 < expected < 3 * taken, (job.kind, job.slices)
        compared += 1
    assert compared
