"""Makes support, benchmarks and the paper's program importable, gives BLAS one thread, marks tests by their fixtures."""

import gc
import os
import signal
import sys
from collections import Counter
from pathlib import Path

import pytest

from wavesweep.program.platform_compat import ONE_THREAD

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / folder) for folder in ("benchmarks", "sweeps/paper", "tests", "tests/engine")]
# As the command line does: threads of BLAS in every worker of the tests are in each other's way. Nothing has loaded numpy yet.
os.environ.update({name: os.environ.get(name, "1") for name in ONE_THREAD})
os.environ.pop("COLUMNS", None)  # pytest-xdist gives its workers the width of a narrow terminal

signal.signal(signal.SIGINT, signal.default_int_handler)  # which a script's background has ignored, and processes inherit
pytest.register_assert_rewrite("meaning", "stress", "support", "words")  # so that their assertions say both sides
from support.command_line import (  # noqa: E402, F401 - fixtures of all tests of commands and specs
    a_word_on_the_time_after_one_sample,
    command_line,
    no_word_on_a_busy_machine,
    spec,
    sweep,
    write,
)
from support.missing import MISSING, THERE  # noqa: E402

from wavesweep.program.sweep import workers  # noqa: E402

workers.PROCESSES = 1  # tests are many processes already: those that are about workers ask for them
gc.set_threshold(50_000, 20, 20)  # thousands of tests are objects that stay: to look through them again and again takes a tenth

collect_ignore_glob = ["whole/*", "stress/test_*"] if MISSING else []
COUNTED = pytest.StashKey[Counter[str]]()  # tests of each folder that were found, whatever their marks
SLOW = {"judged", "quick"}  # fixtures that take many seconds, whichever test asks for them first


def pytest_report_header():
    """Say so if tests are left out."""
    return f"without {', '.join(sorted(MISSING))}: tests of everything together are left out" if MISSING else None


def pytest_collection_modifyitems(config, items):
    """Tests that read such a fixture are slow; of parameters that are sampled, the others are no tests.

    WAVESWEEP_EACH=5 in the environment leaves each fifth test, and all that run a command.
    """
    sampled = {}
    for item in items:
        if mark := item.get_closest_marker("sample"):
            sampled.setdefault(item.nodeid.partition("[")[0], (mark.args[0], []))[1].append(item)
        if SLOW.intersection(item.fixturenames):
            item.add_marker("slow")
        gone = {name for mark in item.iter_markers("asks") for name in mark.args} - THERE
        if gone or (MISSING and item.get_closest_marker("whole")):
            item.add_marker(pytest.mark.skip(reason="asks for capabilities that are taken away"))
    left_out = set()
    for number, same in sampled.values():
        kept = {round(i * (len(same) - 1) / max(1, number - 1)) for i in range(number)}
        left_out |= {item for at, item in enumerate(same) if at not in kept}
    items[:] = [item for item in items if item not in left_out]
    config.stash[COUNTED] = Counter(item.path.parent.relative_to(ROOT).as_posix() for item in items)
    each = int(os.environ.get("WAVESWEEP_EACH", "1"))
    items[:] = [item for at, item in enumerate(items) if at % each == 0 or "wavesweep" in item.fixturenames]


@pytest.fixture
def counted(request):
    """How many tests of each folder this run has found, whatever their marks and whichever of them it runs."""
    return request.config.stash[COUNTED]


def pytest_collection_finish():
    """What is there before the first test stays to the end."""
    gc.freeze()
